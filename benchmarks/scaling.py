"""Worlds on 1 to 16 threads, world-steps per second against their number, and the same rollout on a CUDA device.

    PYTHONPATH=. python benchmarks/scaling.py [--quick]

Needs warp, numpy and scipy only, and takes less than two minutes.
"""

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import warp as wp
from crawler_strip import strip
from rollout import batch, setting
from timing import interleave, table, verdict

from origami_sim.model import State
from origami_sim.model.bodies import rigid
from origami_sim.solve.batch import default_threads
from origami_sim.solve.rigid.batch import RigidBatch

CUDA_WORLDS = 131_072

WORLDS, THREADS, SHARE = 16, (1, 2, 4, 8, 16), 0.7
"""Worlds that threads share, how many threads, and the wanted share of linear scaling at the most of them."""


@wp.kernel(enable_backward=False)
def arithmetic(first: int, rounds: int, out: wp.array2d(dtype=wp.float64)):
    """Products and sums in registers: what the machine's cores can do at best beside each other."""
    w = first + wp.tid()
    a, b, c, d = wp.float64(1.0), wp.float64(1.1), wp.float64(1.2), wp.float64(1.3)
    f, g = wp.float64(0.9999), wp.float64(1e-4)
    for _ in range(rounds):
        a = a * f + g
        b = b * f + g
        c = c * f + g
        d = d * f + g
    out[w, 0] = a + b + c + d


def computed(threads: int):
    """The arithmetic of 16 worlds, split as a batch splits them."""
    out, pool = wp.zeros((WORLDS, 64), dtype=wp.float64, device="cpu"), ThreadPoolExecutor(threads)
    wp.load_module(arithmetic.module, device="cpu")
    cuts = np.linspace(0, WORLDS, threads + 1).astype(int)

    def part(lo: int, hi: int):
        wp.launch(arithmetic, dim=hi - lo, inputs=[lo, 8_000_000, out], device="cpu")

    return lambda: list(pool.map(part, cuts[:-1], cuts[1:]))


def rigid_strip(threads: int):
    """The strip of the crawler as rigid panels that hang from its first cell, let go from the side."""
    model, parameters, drive = strip(WORLDS)
    free = model.free.copy()
    free[:4] = 0.0  # its first cell
    model = replace(model, free=free, effects=("bars", "crease", "crease_viscosity", "panel_bending", "gravity"))
    body, own = rigid(model, parameters.for_model(model))
    return RigidBatch(body, own, drive, State.at_rest(body, WORLDS), threads=threads, tolerance=1e-8)


def thread_report(quick: bool = False) -> str:
    """The same 16 worlds on 1 to 16 threads."""
    *_, dt, limit = setting()
    counts = [t for t in THREADS if t <= default_threads()]
    bars, panels = ({t: make(WORLDS, t) if make is batch else make(t) for t in counts} for make in (batch, rigid_strip))
    steps, frames = (2_000, 100) if quick else (20_000, 1_000)
    runs: dict[str, dict[int, Callable[[], object]]] = {
        "arithmetic alone": {t: computed(t) for t in counts},
        "bars": {t: lambda b=b: b.advance(steps, dt, limit) for t, b in bars.items()},
        "rigid panels": {t: lambda b=b: b.advance(frames, 5e-3, np.inf) for t, b in panels.items()},
    }
    rows = []
    for what, by_threads in runs.items():
        for run in by_threads.values():
            run()
        seconds = interleave({str(t): run for t, run in by_threads.items()}, 3 if quick else 7)
        one = seconds["1"]
        for t in counts:
            many = seconds[str(t)]
            gain = float(one.min() / many.min())
            best, middle = 1e3 * float(many.min()), 1e3 * float(np.median(many))
            rows.append((what, t, best, middle, gain, float(np.median(one / many)), gain / t))
    notes = ["times as fast by the fastest repeats, as other work on the machine takes cores now and then"]
    if counts[-1] < THREADS[-1]:
        notes.append(f"this process may use {default_threads()} cores: more threads are not measured")
    else:
        for what, t, *_, gain, _, share in rows:
            if t == THREADS[-1] and what != "arithmetic alone":
                notes.append(f"{what}: {gain:.1f} times on {t} threads, a share of {share:.2f}, "
                             f"wanted {verdict(share, SHARE, at_least=True)}")  # fmt: skip
    header = ("16 worlds", "threads", "ms, min", "median", "times as fast", "median", "share of linear")
    return table("Threads on the CPU", header, rows, tuple(notes))


def cpu_report(quick: bool = False) -> str:
    *_, dt, limit = setting()
    rows, budget = [], 40_000 if quick else 200_000
    for worlds in (1, 16, 256, 4096):
        b, steps = batch(worlds, None), max(10, budget // worlds)
        b.advance(10, dt, limit)
        seconds = interleave({"": lambda b=b, n=steps: b.advance(n, dt, limit)}, 5 if quick else 15)[""]
        rate = worlds * steps / seconds
        rows.append((worlds, steps, 1e6 / float(rate.max()), 1e6 / float(np.median(rate)), float(rate.max())))
    title = f"Scaling with worlds on the CPU ({default_threads()} threads)"
    header = ("worlds", "steps per call", "us per world-step, min", "median", "world-steps/s")
    return thread_report(quick) + "\n" + table(title, header, rows)


def agreement(device: str, worlds: int = 64, steps: int = 1000) -> tuple[float, float]:
    """Largest difference of positions between the device and the CPU, and how far anything moved [m]."""
    model, *_, dt, limit = setting(worlds)
    states = []
    for where in ("cpu", device):
        b = batch(worlds, None, where)
        b.advance(steps, dt, limit)
        states.append(b.state())
    assert all((s.status < 0).all() for s in states), "a world went unstable"
    moved = np.abs(states[0].x - model.position[:, None]).max()
    return float(np.abs(states[0].x - states[1].x).max()), float(moved)


def cuda_report(device: str, quick: bool = False) -> str:
    *_, dt, limit = setting()
    difference, moved = agreement(device)
    name = wp.get_device(device).name
    rows = []
    for worlds in (4096, CUDA_WORLDS) if quick else (256, 4096, 32_768, CUDA_WORLDS):
        b, steps = batch(worlds, device=device), 200 if quick else 1000
        b.advance(20, dt, limit)
        wp.synchronize_device(device)
        seconds = []
        for _ in range(3 if quick else 7):
            began = time.perf_counter()
            b.advance(steps, dt, limit)
            wp.synchronize_device(device)
            seconds.append(time.perf_counter() - began)
        assert (b.state().status < 0).all(), "a world went unstable"
        rate = worlds * steps / np.array(seconds)
        rows.append((worlds, steps, 1e6 / float(rate.max()), float(np.median(rate)), float(rate.max())))
    return table(
        f"The same rollout on {device} ({name}), float64",
        ("worlds", "steps per call", "us per world-step, min", "world-steps/s, median", "best"), rows,
        (f"CPU and {device} after 1000 steps, 64 worlds: largest difference {difference:.1e} m of {moved:.1e} m moved, "
         f"relative {difference / moved:.1e}",),
    )  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    print(cpu_report(parser.parse_args().quick))
