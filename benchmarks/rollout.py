"""Crawler rollouts: time per step, on one core and on two, against the same arithmetic in plain C."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from c_loop import CLoop, compiler, library
from crawler_strip import strip
from timing import interleave, table, verdict

from origami_sim.model import State
from origami_sim.solve.batch import Batch, default_threads
from origami_sim.solve.timestep import stable_step

SAME = 1e-9
"""Largest relative difference allowed between the two programs after 1000 steps."""


def setting(worlds: int = 1):
    """Model, parameters, drive, step and speed limit."""
    model, parameters, drive = strip(worlds)
    dt = stable_step(model, parameters).dt
    return model, parameters, drive, dt, 0.5 * 0.01 / dt


def batch(worlds: int, threads: int | None = 1, device: str = "cpu") -> Batch:
    model, parameters, drive, *_ = setting(worlds)
    return Batch(model, parameters, drive, State.at_rest(model, worlds), device=device, threads=threads)


def agreement(lib, steps: int = 1000) -> float:
    """Largest difference of position to the C loop, relative to the largest displacement; asserts SAME."""
    model, parameters, drive, dt, limit = setting()
    ours, theirs = batch(1), CLoop(lib, model, parameters, drive)
    ours.advance(steps, dt, limit)
    theirs.advance(steps, dt, limit)
    state = ours.state()
    assert (state.status < 0).all(), "the rollout went unstable"
    moved = np.abs(theirs.x - model.position).max()
    difference = float(np.abs(state.x[:, 0] - theirs.x).max() / moved)
    mine = dict(zip(model.effects, state.work[:, 0], strict=True))
    work = np.array([mine[n] for n in ("crease_viscosity", "magnetic_torque", "ground", "friction")])
    difference = max(difference, float(np.abs(work - theirs.work).max() / np.abs(work).max()))
    assert difference < SAME, f"the C loop and the rollout differ by {difference:.1e} after {steps} steps"
    return difference


def clock(lib) -> float:
    """Frequency of the core [GHz], from a chain of dependent additions."""
    n, best = 40_000_000, np.inf
    for _ in range(5):
        began = time.thread_time()
        lib.additions(n)
        best = min(best, time.thread_time() - began)
    return n / best * 1e-9


def report(quick: bool = False) -> str:
    worlds, repeats, steps = 64, 9 if quick else 25, 5_000 if quick else 20_000
    each = steps // 16
    *_, dt, limit = setting()
    single, one, two = batch(1), batch(worlds, 1), batch(worlds, 2)
    runs = {
        "1 world": (lambda: single.advance(steps, dt, limit), steps),
        f"{worlds} worlds, 1 core": (lambda: one.advance(each, dt, limit), each * worlds),
        f"{worlds} worlds, 2 cores": (lambda: two.advance(each, dt, limit), each * worlds),
    }
    notes = []
    if compiler():
        lib = library()
        notes.append(
            f"position and work against the C loop after 1000 steps: {agreement(lib):.1e} relative, asserted < {SAME:g}"
        )
        loops = [CLoop(lib, *setting()[:3]) for _ in range(3)]
        pool = ThreadPoolExecutor(2)
        runs["C, 1 world"] = (lambda: loops[0].advance(steps, dt, limit), steps)
        runs["C, 2 worlds, 2 cores"] = (
            lambda: list(pool.map(lambda c: c.advance(steps, dt, limit), loops[1:])), 2 * steps)  # fmt: skip
    else:
        notes.append("no C compiler: the comparison with the plain C loop and the core's clock are left out")
    for run, _ in runs.values():
        run()
    seconds = interleave({name: run for name, (run, _) in runs.items()}, repeats)
    # one core: processor time, which other work on the machine does not lengthen by taking turns
    single_core = {n: run for n, (run, _) in runs.items() if "2 cores" not in n}
    processor = interleave(single_core, repeats, time.thread_time)
    wall = {name: seconds[name] / count * 1e6 for name, (_, count) in runs.items()}
    us = {n: processor[n] / count * 1e6 if n in processor else wall[n] for n, (_, count) in runs.items()}
    ghz = clock(lib) if compiler() else float("nan")
    rows = [(name, float(t.min()), float(np.median(t)), float(t.min() * ghz / 2.5)) for name, t in us.items()]
    names = list(us)
    per_step = us[names[1]]
    lines = []
    if compiler():
        scaled = float(np.median(per_step) * ghz / 2.5)
        lines.append(("us per world-step, 1 core, at 2.5 GHz", scaled, verdict(scaled, 2.5)))
        for name in names[:2]:
            ratio = float(np.median(us[name] / us["C, 1 world"]))
            lines.append((f"{name} : C", ratio, verdict(ratio, 1.5)))
        notes.append(
            f"one core: processor time, two: wall time; core at {ghz:.2f} GHz; last column: the minimum at 2.5 GHz"
        )
        c_one, c_two = wall["C, 1 world"], wall["C, 2 worlds, 2 cores"]
        notes.append(
            f"what the machine gave: two C loops on two cores {c_one.min() / c_two.min():.2f} times as fast as one "
            f"in their fastest repeats, {np.median(c_one / c_two):.2f} times at the median"
        )
    else:
        middle = float(np.median(per_step))
        lines.append(("us per world-step, 1 core", middle, verdict(middle, 2.5)))
    if default_threads() >= 2:
        one_core, two_cores = wall[names[1]], wall[names[2]]
        gain = float(
            one_core.min() / two_cores.min()
        )  # other work on the machine takes the second core most of the time
        lines.append(("2 cores : 1 core, fastest repeats", gain, verdict(gain, 1.7, at_least=True)))
        lines.append(("2 cores : 1 core, median", float(np.median(one_core / two_cores)), ""))
    else:
        notes.append("this process may use one core only: two cores are not measured")
    title = "Crawler rollout: 12 nodes, 26 bars, 13 hinges, 12 feet, 10 triangles with magnets, float64"
    return table(
        f"{title}, {repeats} interleaved repeats", ("us per world-step", "min", "median", "at 2.5 GHz"), rows
    ) + table("", ("target", "measured", "wanted"), lines, tuple(notes))
