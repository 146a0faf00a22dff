"""Coordinates in which numbers are fitted: departures from where they begin, over their scales.

What a number does should be linear in its coordinate (Box & Cox 1964, of powers 1, 1/2 and 0). A positive scale, such
as a time constant, is fitted by its logarithm: what is known of it beforehand is its order of magnitude, and what it
does changes by factors (a log-normal prior). An angle that is one, such as that at which friction yields, is fitted by
its root: where a swing turns back, the time that friction takes to turn as well grows as the root of it.
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
        rows = [(f.start, f.scale, f.lower, f.upper, f.spread, f.power) for f in free]
        self._start, self._scale, self._lower, self._upper, spread, power = np.array(rows, float).reshape(-1, 6).T
        self._log, self._root = power == 0.0, power == 0.5
        self.low, self.high = self.of(self._lower), self.of(self._upper)
        self.precision = np.where(np.isfinite(spread), self._scale / np.where(np.isfinite(spread), spread, 1.0), 0.0)

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Coordinates [..., P] of numbers [SI]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            part = theta / self._start
            out = np.where(self._log, np.log(part), theta - self._start)
            return np.where(self._root, 2.0 * (np.sqrt(part) - 1.0), out) / self._scale

    def values(self, at: np.ndarray) -> np.ndarray:
        """Numbers [..., P] at coordinates, within their bounds [SI]."""
        at = at * self._scale
        with np.errstate(over="ignore"):
            theta = np.where(self._log, self._start * np.exp(np.where(self._log, at, 0.0)), self._start + at)
        theta = np.where(self._root, self._start * np.maximum(1.0 + 0.5 * at, 0.0) ** 2, theta)
        return np.clip(theta, self._lower, self._upper)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """Derivatives (P,) of numbers by their coordinates [SI]."""
        with np.errstate(invalid="ignore"):
            root = np.where(self._root, np.sqrt(theta * self._start), 1.0)
        return self._scale * np.where(self._log, theta, root)
