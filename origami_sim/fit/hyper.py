"""The numbers on which every verdict depends: priors of how effects, flaws and discrepancy are distributed.

`slabs`, `steep` and `effects` were chosen by the log score of the truth on 81 opened cases, `flaws` on 121 of
development seed 31 (proof/HISTORY.md), `unlisted` by how often one effect was named for a law outside the catalogue in
sealed seed 1026, `imitated` by how often two were in all since.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np


@dataclass(frozen=True)
class Hyper:
    """Hyperparameters of the diagnosis.

    Attributes:
        slabs: standard deviations of strengths on the scale of detectability d', up to what fine recordings show: in
            the noise of its encoders a double chain has d' of 700 to 7000 (frictions), up to 3000 (drag) and 3e4
            (zeros). Far beyond the largest, a strength would be drawn to nothing. Half and double of the first seven
            are within the error of the log score (HISTORY); the others hold 1.6 % of the prior.
        steep: probability of each of them, as a power of one over it: large effects are rarer than small ones.
        effects: probability of one more effect, given those that are there.
        most: effects in a set, at most.
        gaps: sizes of forces that the model lacks, as a part of the rates that they change within a segment; each as
            probable as one over it. Chance forces of a thousandth would hide a small, lasting one.
        least: size of such forces up to which nothing is said to be missing.
        smooth: sizes of a discrepancy of the channels, in deviations of the noise.
        flaws: root of the sum of squares of what all suspects together do in a device of which none is at fault, in d'.
            Given the truth it is between 2 and 4 in the battery. Half of them lose 0.04 +- 0.03 of log score (nulls
            0.07), double (2, 8) 0.09 +- 0.03 (effects of d' 5: 0.28, as flaws of 8 take up all of one). With 16 beside
            them the log score is the same, and sums of all suspects follow what a real pendulum leaves, so that
            evidence of sets that hold each other differed by 10 to 15 (HISTORY).
        fewer: probability of each size over that of the next smaller one: of smooth, and of flaws.
        unlisted: odds that what one effect of the catalogue explains is done by a law that the catalogue lacks.
        imitated: times as large for each further effect that it takes: several laws together can look like most others.
            In five sealed seeds (1026 to 1033) one law that was named was right 199 times and another outside the
            catalogue 11 times, two 14 and 16 times; of two effects there were half as many as `effects` says. With
            half of it two laws that are sure have 0.78 in place of 0.64, with double they are not named.
    """

    slabs: tuple[float, ...] = (1.3, 4.0, 12.0, 40.0, 120.0, 400.0, 1.2e3, 4.0e3, 1.2e4, 4.0e4, 1.2e5)
    steep: float = 0.5
    effects: float = 0.3
    most: int = 5
    gaps: tuple[float, ...] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    least: float = 1e-3
    smooth: tuple[float, ...] = (0.0, 1.0, 10.0, 100.0)
    flaws: tuple[float, ...] = (1.0, 4.0)
    fewer: float = 0.3
    unlisted: float = 0.07
    imitated: float = 8.0

    @cached_property
    def shares(self) -> np.ndarray:
        """Prior of each of the slabs."""
        share = np.array(self.slabs) ** -self.steep
        return share / share.sum()

    @cached_property
    def cells(self) -> list[tuple[float, float, float]]:
        """All combinations of gaps, smooth and flaws."""
        return list(product(self.gaps, self.smooth, self.flaws))

    @cached_property
    def log_cells(self) -> np.ndarray:
        """Log prior of each of them."""
        parts = [-np.log(self.gaps), *(np.arange(len(v)) * np.log(self.fewer) for v in (self.smooth, self.flaws))]
        parts = [p - np.log(np.sum(np.exp(p))) for p in parts]
        return np.array([a + b + c for a, b, c in product(*parts)])

    @cached_property
    def clean(self) -> np.ndarray:
        """Whether a cell has next to no discrepancy, of forces or of channels."""
        return np.array([gap <= self.least and smooth == 0.0 for gap, smooth, _ in self.cells])

    def foreign(self, effects: int, left: float = 0.0) -> float:
        """Probability that what so many effects explain together is done by a law that the catalogue lacks.

        Args:
            left: what they leave and is real, over what they explain. It needs a law beside them (`effects`), or is the
                part that they do not imitate of the one that does all: of these any part is as probable.
        """
        odds = self.unlisted * self.imitated ** (effects - 1) + left / self.effects if effects else 0.0
        return odds / (1.0 + odds)


HYPER = Hyper()
"""Those that are used."""
