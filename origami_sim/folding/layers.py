"""Whether the layers around one vertex have an order where all its creases fold flat.

Half a turn up and half a turn down are the same turn, so that angles alone do not see mountains and valleys there.
Layers do. Around a vertex inside a flat sheet that folds flat

- the sectors between creases alternately sum to half a turn (Kawasaki's theorem),
- mountains less valleys are +-2 (Maekawa's theorem; Hull 1994, Congressus Numerantium 100, 215), and
- of a run of k equal sectors between larger ones the k + 1 creases have mountains less valleys of 0 if k is odd, +-1 if
  it is even (Hull 2002, "The combinatorics of flat folds: a survey"); one sector: the big-little-big lemma.

These are not enough for the vertex as a whole, crimping is: a sector not larger than its neighbours, between a
mountain and a valley, is folded on them, which leaves a vertex of two creases less whose layers have an order exactly
if those of the first have one (Bern and Hayes 1996, "The complexity of flat origami", SODA; Demaine and O'Rourke 2007,
"Geometric Folding Algorithms", section 12.2). In the end two creases of one kind are left. Where no sector can be
crimped and more are left, a run of smallest sectors has creases of one kind only. Sectors are compared within what the
drawing is accurate to.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from .elastic import Elastic

STRAIGHT = np.radians(2.0)
"""Turn of a crease line at a vertex below which it is straight, and of a given shape below which it is flat: curves cut
into chords turn by 5 degrees and more. Half and double name the same curves in 20 public patterns."""
FLAT = np.radians(179.0)
"""Fold angle from which on a crease folds flat, of angles written to a degree. Half a degree less and two name the same
vertices in 43 public patterns."""


@dataclass(frozen=True)
class Caught:
    """Sectors that no order of layers lets fold.

    Attributes:
        size: of each [rad]. count: how many lie side by side between larger ones. sign: of all their creases, 1 for
            valleys. crimped: smaller sectors that had to be folded first to make these.
    """

    size: float
    count: int
    sign: int
    crimped: int


@dataclass(frozen=True)
class FlatVertex:
    """A vertex inside a flat sheet all whose creases fold flat or stay open.

    Attributes:
        node: its number in the mesh. sectors: between its folded creases, in order [rad]; sector k lies between creases
            k and k + 1. slack: by which each may be off, as far as the drawing's accuracy tells [rad]. signs: of the
            creases, 1 for valleys.
        caught: the sectors by which its layers have no order, where mountains and valleys alone allow one.
    """

    node: int
    sectors: tuple[float, ...]
    slack: tuple[float, ...]
    signs: tuple[int, ...]
    caught: Caught | None

    @property
    def excess(self) -> int:
        """Mountains less valleys."""
        return -sum(self.signs)

    @property
    def unordered(self) -> bool:
        """Whether its layers have no order."""
        return abs(self.excess) != 2 or self.caught is not None

    @property
    def sums(self) -> tuple[float, float]:
        """Sums of every other sector [rad]; half a turn each where a sheet folds flat (Kawasaki)."""
        return sum(self.sectors[::2]), sum(self.sectors[1::2])

    @property
    def defect(self) -> float:
        """By how much these differ from half a turn [rad]."""
        one, other = self.sums
        return 0.5 * abs(one - other)

    @property
    def gap(self) -> float:
        """Rotation by which flat panels do not close [rad]: half a turn of an odd number of creases."""
        return np.pi if len(self.signs) % 2 else 2.0 * self.defect

    @property
    def accuracy(self) -> float:
        """Defect that the drawing's accuracy explains [rad]."""
        return 0.5 * sum(self.slack)


def flat_vertex(sheet: Elastic, node: int, ring: Sequence[int], angles, tolerance: float) -> FlatVertex | None:
    """Return a vertex inside a sheet as one that folds flat, or None if it does not.

    Args:
        sheet: what is folded. node: the vertex. ring: hinges around it, in order.
        angles: [H] of the folded sheet, which tell what creases without a target do [rad].
        tolerance: within which such a crease is flat or open [rad].
    """
    at = np.array(ring)
    if np.any(np.abs(sheet.start[at]) > STRAIGHT):
        return None
    free = ~sheet.driven[at] & (at < len(sheet.mesh.creases))  # lines inside panels are no creases
    turn = np.where(sheet.driven[at], sheet.target[at], np.where(free, angles[at], 0.0))
    turn[free & (np.abs(turn) <= tolerance)] = 0.0
    shut = np.abs(turn) >= np.where(free, np.pi - tolerance, FLAT)
    folds = np.flatnonzero(turn)
    if not len(folds) or not np.all(shut[folds]):
        return None
    ends = sheet.hinges[at, 1] + sheet.hinges[at, 2] - node
    ways = (sheet.reference[ends] - sheet.reference[node]) / sheet.axes[at, None]
    after = np.roll(ways, -1, axis=0)
    between = np.arctan2(np.linalg.norm(np.cross(ways, after), axis=1), np.sum(ways * after, axis=1))
    place = np.concatenate([[0.0], np.cumsum(between)])
    sectors = np.diff(np.append(place[folds], place[folds[0]] + place[-1]))
    off = 2.0 * sheet.accuracy / sheet.axes[at[folds]]  # a direction, of two ends that are each as far off
    slack = off + np.roll(off, -1)
    defect = FlatVertex(node, tuple(sectors.tolist()), tuple(slack.tolist()), (), None).defect
    # half a turn up and down is one shape, so that a crease without a target may be either
    either = [(1, -1) if f else (int(s),) for f, s in zip(free[folds], np.sign(turn[folds]), strict=True)]
    found = None
    for signs in product(*either):
        balanced = abs(sum(signs)) == 2
        # sums that are off show sectors that are
        stuck = caught(sectors.tolist(), (slack + defect).tolist(), signs) if balanced else None
        vertex = FlatVertex(node, tuple(sectors.tolist()), tuple(slack.tolist()), signs, stuck)
        if not vertex.unordered:
            return vertex
        found = found if found is not None and abs(found.excess) == 2 else vertex
    return found


def caught(sectors: Sequence[float], slack: Sequence[float], signs: Sequence[int]) -> Caught | None:
    """Return the sectors that keep the layers around a vertex from having an order, or None if they have one.

    Args:
        sectors: between the creases, sector k between creases k and k + 1 [rad].
        slack: by which each may be off, so that those are equal that differ by less than theirs together [rad].
        signs: of the creases, 1 for valleys and -1 for mountains; their sum is 2 or -2.
    """
    # each crease with the sector after it, and how many were folded onto it
    left = [(*each, 0) for each in zip(sectors, slack, signs, strict=True)]
    while len(left) > 2:
        best, least = None, np.inf
        for n, (size, off, sign, _) in enumerate(left):
            (before, off_before, _, _), (after, off_after, other, _) = left[n - 1], left[(n + 1) % len(left)]
            if sign == other or size - before > off + off_before or size - after > off + off_after:
                continue
            if max(size - before, size - after) < least:  # what is clear first, what is within accuracy last
                best, least = n, max(size - before, size - after)
        if best is None:
            return _smallest_run(left)
        left = left[best:] + left[:best]  # so that its two creases come first
        (size, off, _, m), (after, off_after, _, n), *others, (before, off_before, sign, k) = left
        left = [*others, (before - size + after, off + off_before + off_after, sign, k + m + n + 1)]
    return None


def _smallest_run(left) -> Caught:
    """Return the sectors side by side that are as small as the smallest; their creases are all of one kind."""
    n = min(range(len(left)), key=lambda k: left[k][0])
    size, off, sign, _ = left[n]

    def as_small(k: int) -> bool:
        other, off_other, *_ = left[k % len(left)]
        return other - size <= off + off_other

    first = n
    while first > n - len(left) + 1 and as_small(first - 1):
        first -= 1
    last = n
    while last < first + len(left) - 1 and as_small(last + 1):
        last += 1
    crimped = sum(left[k % len(left)][3] for k in range(first, last + 1))
    return Caught(size, last - first + 1, sign, crimped)
