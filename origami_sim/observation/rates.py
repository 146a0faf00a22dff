"""Values and rates of channels at a frame, read from cubics over windows of a recording."""

import numpy as np

POSSIBLE = 2.0
"""Standard deviations within which a rate that a window tells is possible."""

BENT = 1.5
"""Noise, in multiples of what is stated, from which on a window holds more than a motion and noise."""

WIDEST = 64
"""Frames to either side of one that are looked at for its state."""


def local_line(
    times: np.ndarray, values: np.ndarray, noise: np.ndarray, first: int, *, slowest: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, rate and its standard deviation (D,) at a frame, from a cubic over a window.

    The window grows while its cubic fits, and its rate is within what each smaller one left possible: what a cubic
    bends away from shows there before it shows in the scatter (Goldenshluger & Nemirovski 1997). That leaves room
    for a bias of some standard deviations.

    Args:
        slowest: of all these windows, that of which the rate is fewest standard deviations from zero: what is at rest
            is so in short ones, however it is driven away.
    """
    level, slope, error = np.full((3, values.shape[1]), np.nan)
    for d in range(values.shape[1]):
        half, low, high = 4, -np.inf, np.inf
        while half <= WIDEST and half <= len(times):
            lo, hi = max(0, first - half), min(len(times), first + half + 1)
            if hi - lo < 2 * half and lo == 0:
                hi = min(len(times), lo + 2 * half)
            half *= 2
            good = np.flatnonzero(np.isfinite(values[lo:hi, d])) + lo
            if len(good) < 6:
                continue
            t = times[good] - times[first]
            span = np.abs(t).max() or 1.0
            design = np.vander(t / span, 4, increasing=True)
            fit, *_ = np.linalg.lstsq(design, values[good, d], rcond=None)
            scatter = np.sqrt(np.sum((values[good, d] - design @ fit) ** 2) / (len(good) - 4))
            doubt = max(scatter, noise[d]) * np.linalg.norm(np.linalg.pinv(design)[1]) / span
            rate = fit[1] / span
            bent = scatter > BENT * noise[d]
            low, high = max(low, rate - POSSIBLE * doubt), min(high, rate + POSSIBLE * doubt)
            begun = bool(np.isfinite(level[d]))
            fits = not begun or not (bent or low > high)
            if not begun or (abs(rate) * error[d] < abs(slope[d]) * doubt if slowest else fits):
                level[d], slope[d], error[d] = fit[0], rate, doubt
            if bent or not fits:
                break
    return level, slope, error
