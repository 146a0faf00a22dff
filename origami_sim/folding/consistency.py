"""Whether target angles can hold together: what the panels around a vertex say.

Going once around a vertex inside the sheet, turning by the fold angle at each crease, has to end where it began:
prod turn(axis_i, theta_i) = 1 (Kawasaki 1989, belcastro and Hull 2002, doi:10.1016/S0024-3795(01)00608-5). A target
that does not leaves a gap of D radians. Turning n creases by at most d each changes the product by at most n d, so that
some crease stays off by D / n, whatever shape the sheet takes: a bound, not an estimate. Lines inside panels may bend,
so vertices on which such lines end have no bound of their own; their gap with flat panels says how much must bend.
Mountains and valleys of creases that fold flat are the matter of `layers`.
"""

from dataclasses import dataclass

import numpy as np

from .elastic import Elastic
from .layers import STRAIGHT
from .placement import rotations

SHARP = np.radians(100.0)
"""Fold angle from which on the panels beside a curved crease bend much more than the crease: twice, 1/cos(theta/2).
Half names the same curves in 20 public patterns; double is more than a crease can fold, and none would be named."""


@dataclass(frozen=True)
class Vertex:
    """A vertex inside the sheet.

    Attributes:
        node: its number in the mesh. gap: rotation by which the targets do not close, with flat panels [rad].
        creases: driven creases there. bends: hinges without a target there.
        curved: whether it is a bend of one crease line that is folded sharply.
        ring: all hinges around it, in order.
    """

    node: int
    gap: float
    creases: tuple[int, ...]
    bends: int
    curved: bool
    ring: tuple[int, ...]

    @property
    def bound(self) -> float:
        """Error that at least one of its creases must have [rad]; zero where panels could bend."""
        return 0.0 if self.bends or not self.creases else self.gap / len(self.creases)


def vertices(sheet: Elastic) -> list[Vertex]:
    """Return what the targets say at each vertex inside the sheet."""
    spokes = {}
    for a, b, c in sheet.mesh.triangles.tolist():
        for v, here, there in ((a, b, c), (b, c, a), (c, a, b)):
            spokes.setdefault(v, {})[here] = there
    hinge = {}
    for h, (_, j, k, _) in enumerate(sheet.hinges.tolist()):
        hinge[j, k] = hinge[k, j] = h
    axis = (sheet.reference[sheet.hinges[:, 2]] - sheet.reference[sheet.hinges[:, 1]]) / sheet.axes[:, None]
    # the same turn serves both ends: about the axis from j to k, seen from k, the other way round and the other way on
    turns = rotations(axis, np.where(sheet.driven, sheet.target - sheet.start, 0.0))
    out = []
    for v, following in spokes.items():
        ring = _ring(following)
        if ring is None:
            continue
        if any((v, w) not in hinge for w in ring):
            continue  # a cut without width runs to it, about which the panels turn freely
        at = [hinge[v, w] for w in ring]
        product = np.eye(3)
        for h in at:
            outward = sheet.hinges[h, 1] == v
            product = product @ (turns[h] if outward else turns[h].T)
        gap = float(np.arccos(np.clip(0.5 * (np.trace(product) - 1.0), -1.0, 1.0)))
        driven = tuple(h for h in at if sheet.driven[h])
        out.append(Vertex(v, gap, driven, len(at) - len(driven), _curved(sheet, v, driven), tuple(at)))
    return out


def _ring(following: dict[int, int]) -> list[int] | None:
    """Return the neighbours of a vertex in order, or None if the triangles around it do not close."""
    first = next(iter(following))
    ring, here = [first], following[first]
    while here != first:
        if here not in following or len(ring) > len(following):
            return None
        ring.append(here)
        here = following[here]
    return ring if len(ring) == len(following) else None


def _curved(sheet: Elastic, v: int, driven: tuple[int, ...]) -> bool:
    """Tell whether two sharply folded creases of one side, and no others, meet at an angle."""
    sharp = [h for h in driven if abs(sheet.target[h]) > SHARP]
    if len(sharp) != 2 or len(driven) != 2 or sheet.target[sharp[0]] * sheet.target[sharp[1]] < 0:
        return False
    ends = [sheet.hinges[h, 1] + sheet.hinges[h, 2] - v for h in sharp]
    a, b = (sheet.reference[e] - sheet.reference[v] for e in ends)
    cosine = -(a @ b) / (np.linalg.norm(a) * np.linalg.norm(b))
    return bool(np.arccos(np.clip(cosine, -1.0, 1.0)) > STRAIGHT)
