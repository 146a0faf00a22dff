"""Time stamps of an evenly ticking clock that were rounded when they were written down."""

from decimal import Decimal

import numpy as np

FINEST = 1e-6
"""Digit, over the time between frames, beyond which a stamp counts for no more: else one alone would decide."""


def even_times(printed: np.ndarray) -> np.ndarray:
    """Times on an even grid, where those printed differ from it by less than one in their last digit; else as printed.

    Frames may be missing. Rounded stamps look like a clock that trembles by more than a fine encoder's angles allow:
    at 10 rad/s, a millionth of a second is 10 urad. Stamps may also be cut off instead of rounded.

    Args:
        printed: (n,) times, in the unit in which they are printed.
    """
    if len(printed) < 3 or not np.all(np.diff(printed) > 0.0):
        return printed
    steps = np.diff(printed)
    usual = float(np.median(steps))
    ticks = np.concatenate([[0.0], np.cumsum(np.round(steps / usual))])
    rounding = 8.0 * float(np.spacing(np.max(np.abs(printed))))
    if np.any(np.diff(ticks) < 1.0) or np.all(np.abs(steps - usual * np.diff(ticks)) <= rounding * np.diff(ticks)):
        return printed
    digit = np.array([10.0 ** float(Decimal(repr(t)).as_tuple().exponent) for t in printed.tolist()])
    weight = 1.0 / np.clip(digit, FINEST * usual, usual)
    line = np.stack([np.ones_like(ticks), ticks], axis=1)
    first, step = np.linalg.lstsq(line * weight[:, None], printed * weight, rcond=None)[0]
    even = np.all(np.abs(first + step * ticks - printed) < digit + rounding)
    return printed[0] + step * ticks if even else printed
