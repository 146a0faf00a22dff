"""What the distortions of drive and measurement have in common: a signal sampled, changed and put back."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_banded

from origami_sim.drive import PATHS, Drive, series

Read = Callable[[np.ndarray], np.ndarray]
"""What an undistorted channel would have read [n, d, W] at times [n, W] [s]."""


def sampled(
    drive: Drive,
    channels: Sequence[str],
    duration: float,
    change: Callable[[np.ndarray, np.ndarray], np.ndarray],
    *,
    when: np.ndarray | bool = True,
) -> Drive:
    """The drive with `change(times [n], values [n, W]) -> [n, W]` applied to each channel that is not zero throughout.

    It is returned as it is where `when` is zero in all worlds.
    """
    moving = [c for c in channels if not drive[c].is_zero]
    if not (np.any(when) and moving):
        return drive
    times, values = drive.series(moving, duration)
    smooth = [c.partition("_")[0] in PATHS and drive[c].smooth for c in moving]
    new = [series(times, change(times, v), smooth=s) for v, s in zip(values, smooth, strict=True)]
    return drive.replace(**dict(zip(moving, new, strict=True)))


def scaled(drive: Drive, channels: Sequence[str], factor: np.ndarray) -> Drive:
    """The drive with these channels times a factor [W]."""
    return drive.replace(
        **{
            c: replace(s, offset=s.offset * factor, amplitude=s.amplitude * factor, scale=s.scale * factor)
            for c in channels
            if not (s := drive[c]).is_zero
        }
    )


def voltages(drive: Drive) -> list[str]:
    """Names of the drive's voltage channels."""
    return [c for c in drive.signals if c.startswith("voltage_")]


def strengths(drive: Drive) -> list[str]:
    """Names of the channels of the strengths of its magnets and coils."""
    return [f"source_{k}_strength" for k in range(len(drive.placed))]


def at(times: np.ndarray, values: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Samples [n, W or 1] at other times [n, W], linearly; the first and last values hold beyond the ends."""
    columns, when = np.broadcast_arrays(values, when)
    return np.stack([np.interp(t, times, v) for t, v in zip(when.T, columns.T, strict=True)], axis=1)


def lagging(times: np.ndarray, values: np.ndarray, lag: np.ndarray) -> np.ndarray:
    """First-order lag of sampled values [n, W] with time constants [W] [s], exact for values linear between samples."""
    lag = np.maximum(lag, 1e-9)
    h = np.diff(times)[:, None]
    decay, behind = np.exp(-h / lag), np.diff(values, axis=0) / h * lag  # of what falls behind a ramp
    out = np.empty(np.broadcast_shapes(values.shape, (1, len(lag))))
    out[0], out[1:] = values[0], values[1:] - behind - (values[:-1] - behind) * decay
    below = np.broadcast_to(np.append(-decay, np.zeros_like(decay[:1]), axis=0), out.shape)
    for column, own in zip(out.T, below.T, strict=True):
        column[:] = solve_banded((1, 0), np.stack([np.ones_like(own), own]), column, check_finite=False)
    return out
