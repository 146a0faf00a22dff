"""The numbers on which every verdict depends: priors of how effects, flaws and discrepancy are distributed."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Hyper:
    """Hyperparameters of the diagnosis.

    Attributes:
        slabs: standard deviations of strengths on the scale of detectability d', equally likely.
        flaws: root of the sum of squares of what all suspects together do in a device of which none is at fault, in d'.
        effects: probability of one more effect, given those that are there.
        gaps: sizes of forces that the model lacks, as a part of the rates that they change within a segment; the first
            stands for none. smooth: of a discrepancy of the channels, in deviations of the noise.
        lacking: probability that forces, or channels, have a discrepancy at all.
    """

    slabs: tuple[float, ...] = (3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)
    flaws: float = 4.0
    effects: float = 0.4
    gaps: tuple[float, ...] = (1e-5, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
    smooth: tuple[float, ...] = (0.0, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
    lacking: float = 0.15

    @property
    def widest(self) -> float:
        """Strengths beyond this detectability are not told from each other."""
        return 10.0 * self.slabs[-1]

    def log_gaps(self) -> np.ndarray:
        """Log prior of the sizes of gaps."""
        return _some(len(self.gaps), self.lacking)

    def log_smooth(self) -> np.ndarray:
        """Log prior of the sizes of the channels' discrepancy."""
        return _some(len(self.smooth), self.lacking)


def _some(count: int, lacking: float) -> np.ndarray:
    if count == 1:
        return np.zeros(1)
    return np.log(np.concatenate([[1.0 - lacking], np.full(count - 1, lacking / (count - 1))]))


HYPER = Hyper()
"""Those that are used."""
