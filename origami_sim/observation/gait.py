"""Stride per cycle: how a walker advances, cycle by cycle."""

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.errors import InputError
from origami_sim.solve.motion.dynamics import Trajectory

SKIP = 2
"""Cycles before the gait counts as steady."""


def strides(motion: Trajectory, frequency: float, *, world: int = 0) -> np.ndarray:
    """Advance of the centre of mass along x in each whole cycle [m].

    Raises:
        InputError: fewer than one cycle, or frames that do not fall on whole cycles.
    """
    per_cycle = 1.0 / (frequency * (motion.times[1] - motion.times[0]))
    n = round(per_cycle)
    if n < 1 or abs(per_cycle - n) > 1e-6 * n:
        raise InputError("frames do not fall on whole cycles", field="rate", value=per_cycle,
                         allowed="a whole number of frames")  # fmt: skip
    x = motion.centre_of_mass()[::n, world, 0]
    if len(x) < 2:
        raise InputError("the run is shorter than one cycle", field="duration", value=float(motion.times[-1]))
    return np.diff(x)


def summary(values: ArrayLike, *, skip: int = SKIP) -> dict[str, float]:
    """Mean, spread (standard deviation) and trend of the cycles after the first `skip`, in the unit of `values`."""
    each = np.asarray(values, float)
    steady = each[skip:] if len(each) > skip + 1 else each
    trend = float(np.polyfit(np.arange(len(steady)), steady, 1)[0]) if len(steady) > 1 else 0.0
    return {"mean": float(steady.mean()), "spread": float(steady.std()), "trend": trend, "cycles": len(steady)}


def stride_table(motion: Trajectory, frequency: float, *, skip: int = SKIP) -> tuple[dict, dict[str, float]]:
    """Table by cycle, and mean, spread (standard deviation) and trend of the cycles after the first `skip` [mm]."""
    each = strides(motion, frequency) * 1e3
    s = summary(each, skip=skip)
    numbers = {"stride_mm": s["mean"], "spread_mm": s["spread"], "trend_mm_per_cycle": s["trend"],
               "cycles": float(s["cycles"])}  # fmt: skip
    return {"cycle": np.arange(1, len(each) + 1), "stride_mm": each}, numbers
