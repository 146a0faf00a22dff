"""Panels that keep each other off while a pattern folds, so that a sheet that begins clear of itself stays so.

A pair that comes nearer than its panels are thick, h (see `solve.kernels.touching` for what counts), adds

    K h^2 (1 - u)^2 (1/2 - ln u)        with u = distance / h < 1

to the energy: the spring of the effect `touch` where it hardly touches, and a barrier that nothing is pressed through
(after Li et al. 2020, doi:10.1145/3386569.3392425). A step of the search foresees which pairs will touch at its end,
and is cut where one would pass another. Lengths are over the sheet's size, energies as in `elastic`.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from origami_sim.design.build import Sheet
from origami_sim.design.touch import SQUEEZE
from origami_sim.pattern.intersections import crossing_pairs
from origami_sim.solve.skin import Pairs, near_pairs

from .elastic import Elastic

REACH = 0.5
"""Distance within which pairs are looked at beyond that at which they touch, over the median edge; a step moves no
node by more than half of it. Of four public patterns that would end through themselves half takes 0.97 times the
time, double 1.18 times; they end alike, but for a compromise that shifts by 2 degrees with half."""
FINEST = 1e-3
"""Share of the thickness below which a pair's h is a slip of the drawing: points that miss a line by tenths of
micrometres. Half and double change nothing in those four; ten times as much lets ten pairs through in another
(Improvisation), in 0.6 times the time."""
LEAST = 1e-12
"""Share of h below which a barrier grows no more, so that numbers stay finite; steps are cut long before. Half and
double change nothing."""


@dataclass(frozen=True)
class Touching:
    """Pairs near each other in one state.

    Attributes:
        rows: [P, 3 N] derivatives of the distances. energy: twice that of all pairs.
        weight: [P] stiffness. gap: [P] the move by which this stiffness carries the present force; of pairs that do
            not touch, their distance less that at which they do.
        closest: least distance over that at which a pair touches.
    """

    pairs: Pairs
    size: float
    finest: float
    rows: sp.csr_matrix
    energy: float
    weight: np.ndarray
    gap: np.ndarray
    closest: float

    @property
    def count(self) -> int:
        """Number of pairs that touch."""
        return int(np.sum(self.gap < 0.0))

    def after(self, step: np.ndarray) -> float:
        """Twice the energy after a step [3 N], as its derivatives say."""
        then, now = np.minimum(self.gap + self.rows @ step, 0.0), np.minimum(self.gap, 0.0)
        return self.energy + float(self.weight @ (then**2 - now**2))

    def clear(self, x: np.ndarray) -> float:
        """Share of the straight way to positions x [N, 3] on which nothing passes anything."""
        return self.pairs.clear(x * self.size, self.finest)


class Contact:
    """Finds what touches in states of a sheet.

    Args:
        sheet: what is folded. thickness: of panels for which the pattern gives none [m].

    Attributes:
        longest: move of a node along an axis for which a list of near pairs serves.

    Raises:
        InputError: panels that lie in each other in the given shape.
    """

    def __init__(self, sheet: Elastic, thickness: float):
        self.size, self.triangles = sheet.size, sheet.mesh.triangles
        self.model, self.parameters = (
            Sheet(sheet.pattern, thickness=thickness, triangulation="diagonal").touch(friction=0.0).build()
        )
        self.reach = REACH * float(np.median(sheet.lengths))
        self.finest = FINEST * float(self.parameters["touch", "thickness"].min())
        self.longest = 0.5 * self.reach / np.sqrt(3.0)

    def at(self, x: np.ndarray) -> Touching:
        """What touches or may soon, at positions x [N, 3]."""
        near = near_pairs(self.model, self.parameters, x * self.size, margin=self.reach * self.size)
        acting = np.flatnonzero((near.window > 0.0) & (near.offset >= self.finest))
        columns = (3 * near.points[acting][:, :, None] + np.arange(3)).ravel()
        values = (near.share[acting][:, :, None] * near.normal[acting][:, None, :]).ravel()
        h, u = near.offset[acting] / self.size, near.distance[acting] / near.offset[acting]
        k, shut = SQUEEZE * near.window[acting], np.clip(u, LEAST, 1.0)
        left, log = 1.0 - shut, 0.5 - np.log(shut)
        slope = -k * h * left * (2.0 * log + left / shut)
        bend = k * (2.0 * log + 4.0 * left / shut + (left / shut) ** 2)
        return Touching(
            pairs=near,
            size=self.size,
            finest=self.finest,
            rows=sp.csr_matrix((values, (np.repeat(np.arange(len(u)), 12), columns)), shape=(len(u), x.size)),
            energy=2.0 * float(np.sum(k * h**2 * left**2 * log)),
            weight=bend,
            gap=np.where(u < 1.0, slope / bend, (u - 1.0) * h),
            closest=float(np.min((near.distance / near.offset)[near.offset >= self.finest], initial=np.inf)),
        )

    def free(self, x: np.ndarray) -> bool:
        """Tell whether nothing touches at positions x [N, 3], nor has passed anything."""
        return self.at(x).closest > 1.0 and not len(crossing_pairs(x, self.triangles, 0.0))
