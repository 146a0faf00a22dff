"""Wild frames: what a tracker reads where it takes something else for the marker.

One such frame is as many squares as a real effect of the whole recording, and looks like no physics.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

FAR = 8.0
"""How many times further than its neighbours scatter, and than the noise, a frame lies off their course."""

SIDE = 3
"""Neighbours on each side, through which a cubic is laid."""

LONGEST = 3
"""Frames in a row that are wild at most; more are a motion."""

UNEVEN = 1.5
"""Ratio of time steps up to which frames are neighbours."""


def wild_frames(
    times: np.ndarray, values: np.ndarray, noise: float, corners: np.ndarray | Sequence[float] = ()
) -> np.ndarray:
    """(n,) frames that lie far off the cubic through the three before and the three after them, which agree.

    Where the motion itself has a corner (a blow, a snap), these do not agree: the corner of a path with constant speeds
    lies 4 times as far off the cubic as they do. The first and last three frames are not judged.

    Args:
        times: (n,) [s]. values: (n,) or (n, d), nan where missing. noise: standard deviation in the unit of `values`.
        corners: times at which a drive is switched [s]: what moves fast after that is a motion.
    """
    columns = np.asarray(values, float).reshape(len(times), -1)
    candidates: list[tuple[float, int, int]] = []
    for run in range(1, LONGEST + 1):
        size = run + 2 * SIDE
        if len(times) < size:
            break
        steps = sliding_window_view(np.diff(times), size - 1)
        even = steps.max(axis=1) < UNEVEN * steps.min(axis=1)
        ends = sliding_window_view(times, size)[:, [0, -1]]
        even &= ~np.any([(ends[:, 0] <= t) & (t <= ends[:, 1]) for t in [np.inf, *corners]], axis=0)
        at = np.linspace(-1.0, 1.0, size)
        inside = np.isin(np.arange(size), np.arange(SIDE, SIDE + run))
        outer, inner = np.vander(at[~inside], 4), np.vander(at[inside], 4)
        through = inner @ np.linalg.pinv(outer)
        reach = np.sqrt(1.0 + np.sum(through**2, axis=1))
        for column in columns.T:
            windows = sliding_window_view(column, size)
            beside = windows[:, ~inside]
            left = beside - beside @ (outer @ np.linalg.pinv(outer)).T
            scatter = np.sqrt(np.sum(left**2, axis=1) / (2 * SIDE - 4))
            off = np.abs(windows[:, inside] - beside @ through.T) / reach
            usual = np.median(scatter[np.isfinite(scatter)]) if np.isfinite(scatter).any() else 0.0
            limit = FAR * np.maximum(scatter, max(noise, usual))
            with np.errstate(invalid="ignore"):
                far = np.isnan(off) | (off > limit[:, None])
            found = even & np.all(far, axis=1) & np.any(np.isfinite(off), axis=1) & np.isfinite(scatter)
            candidates += [(float(scatter[w]), int(w), run) for w in np.flatnonzero(found)]
    out = np.zeros(len(times), bool)
    for _, w, run in sorted(candidates):  # a neighbour of a wild frame seems wild from others, which agree less
        window = np.arange(w, w + run + 2 * SIDE)
        inside = window[SIDE : SIDE + run]
        if not np.any(out[np.setdiff1d(window, inside)]):
            out[inside] = True
    return out & np.any(np.isfinite(columns), axis=1)
