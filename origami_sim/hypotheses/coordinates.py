"""Coordinates in which numbers are fitted: departures from where they begin, over their scales.

A number that is a positive scale itself, such as a time constant, is fitted by its logarithm: what is known of it
beforehand is its order of magnitude, and what it does changes by factors (a log-normal prior).
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.hypotheses.hypothesis import Free


class Coordinates:
    """The coordinates of numbers (P,).

    Attributes:
        low, high: (P,) bounds. precision: (P,) one over the standard deviations of what was known before, about zero.
    """

    def __init__(self, free: Sequence[Free]):
        rows = [(f.start, f.scale, f.lower, f.upper, f.spread, f.logarithmic) for f in free]
        table = np.array(rows, float).reshape(len(free), 6).T
        self._start, self._scale, self._lower, self._upper, spread = table[:5]
        self._log = table[5] > 0.0
        self.low, self.high = self.of(self._lower), self.of(self._upper)
        self.precision = np.where(np.isfinite(spread), self._scale / np.where(np.isfinite(spread), spread, 1.0), 0.0)

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates [..., P] of numbers [SI]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self._log, np.log(theta / self._start), theta - self._start) / self._scale

    def values(self, at: np.ndarray) -> np.ndarray:
        """Numbers [..., P] at coordinates, within their bounds [SI]."""
        at = at * self._scale
        with np.errstate(over="ignore"):
            theta = np.where(self._log, self._start * np.exp(np.where(self._log, at, 0.0)), self._start + at)
        return np.clip(theta, self._lower, self._upper)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """Derivatives (P,) of numbers by their coordinates [SI]."""
        return self._scale * np.where(self._log, theta, 1.0)
