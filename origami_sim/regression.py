"""Stride per cycle: how a walker advances, cycle by cycle, and whether it still does what it did."""

import json
from importlib import resources

import numpy as np

from origami_sim.errors import InputError
from origami_sim.solve.dynamics import Trajectory


def strides(motion: Trajectory, frequency: float, *, world: int = 0) -> np.ndarray:
    """Advance of the centre of mass along x in each whole cycle [m].

    Raises:
        InputError: fewer than one cycle, or frames that do not fall on whole cycles.
    """
    per_cycle = 1.0 / (frequency * (motion.times[1] - motion.times[0]))
    n = round(per_cycle)
    if abs(per_cycle - n) > 1e-6 * n:
        raise InputError("frames do not fall on whole cycles", field="rate", value=per_cycle, allowed="a whole number of frames")
    x = motion.centre_of_mass()[::n, world, 0]
    if len(x) < 2:
        raise InputError("the run is shorter than one cycle", field="duration", value=float(motion.times[-1]))
    return np.diff(x)


def stride_table(motion: Trajectory, frequency: float, *, skip: int = 2) -> tuple[dict, dict[str, float]]:
    """Table by cycle, and mean, spread (standard deviation) and trend of the cycles after the first `skip` [mm]."""
    each = strides(motion, frequency) * 1e3
    cycle = np.arange(1, len(each) + 1)
    steady = each[skip:] if len(each) > skip + 1 else each
    trend = float(np.polyfit(np.arange(len(steady)), steady, 1)[0]) if len(steady) > 1 else 0.0
    numbers = {
        "stride_mm": float(steady.mean()), "spread_mm": float(steady.std()), "trend_mm_per_cycle": trend,
        "cycles": float(len(steady)),
    }  # fmt: skip
    return {"cycle": cycle, "stride_mm": each}, numbers


def reference(name: str) -> dict:
    """Stored strides of a scene (JSON of the package's calibrations)."""
    path = resources.files("origami_sim.calibrations") / f"{name}_stride.json"
    return json.loads(path.read_text())
