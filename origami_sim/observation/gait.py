"""Stride per cycle: how a walker advances, cycle by cycle."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from origami_sim.drive import Drive
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


def period(drive: Drive) -> float | None:
    """Period of a drive [s]: of its slowest wave, of which all others are harmonics.

    None where nothing of it oscillates, a channel follows samples (a ramp, a recording) or waves have no common period
    of this kind. Of several worlds, the first.
    """
    frequencies = []
    for signal in drive.signals.values():
        one = signal.each()[0]
        if one.values is not None and np.any(np.asarray(one.scale) * np.ptp(one.values)):
            return None
        if np.any(one.amplitude) and np.any(one.frequency):
            frequencies.append(abs(float(one.frequency)))
    if not frequencies:
        return None
    ratios = np.array(frequencies) / min(frequencies)
    return 1.0 / min(frequencies) if np.allclose(ratios, np.round(ratios)) else None


def advances(motion: Trajectory, lasts: float, *, world: int = 0) -> np.ndarray:
    """Way [cycles, 3] of the centre of mass in each whole cycle of a motion [m].

    Between frames it is that of the cubic which has the places and speeds of the frames (of motions without inertia, a
    straight line).

    Args:
        motion: what moves. lasts: period of a cycle [s]. world: which of the worlds.
    """
    cycles = int((motion.times[-1] - motion.times[0]) / lasts * (1 + 1e-9))
    at = np.minimum(motion.times[0] + lasts * np.arange(cycles + 1), motion.times[-1])
    place, speed = motion.centre_of_mass()[:, world], motion.centre_velocity()[:, world]
    if len(motion.times) > 1 and np.any(speed):
        return np.diff(CubicHermiteSpline(motion.times, place, speed)(at), axis=0)
    return np.diff(np.stack([np.interp(at, motion.times, p) for p in place.T], axis=1), axis=0)


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
