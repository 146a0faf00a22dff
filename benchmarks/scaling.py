"""World-steps per second against the number of worlds on the CPU, and the same rollout on a CUDA device.

Needs warp and numpy only.
"""

import time

import numpy as np
import warp as wp
from rollout import batch, setting
from timing import interleave, table

from origami_sim.solve.batch import default_threads

CUDA_WORLDS = 131_072


def cpu_report(quick: bool = False) -> str:
    *_, dt, limit = setting()
    rows, budget = [], 40_000 if quick else 200_000
    for worlds in (1, 16, 256, 4096):
        b, steps = batch(worlds, None), max(10, budget // worlds)
        b.advance(10, dt, limit)
        seconds = interleave({"": lambda b=b, n=steps: b.advance(n, dt, limit)}, 5 if quick else 15)[""]
        rate = worlds * steps / seconds
        rows.append((worlds, steps, 1e6 / float(rate.max()), 1e6 / float(np.median(rate)), float(rate.max())))
    return table(f"Scaling with worlds on the CPU ({default_threads()} threads)",
                 ("worlds", "steps per call", "us per world-step, min", "median", "world-steps/s"), rows)  # fmt: skip


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
