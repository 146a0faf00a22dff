"""Fold a pattern: from its given shape to its target angles, in the order of what is possible.

The targets grow from the given shape to their full size in even steps. At each the least energy is sought from the
last state, and from the shape that the angles themselves describe (`placement`); the lower one is kept, and where that
is not the one followed from the last state, the sheet has snapped. Creases that cannot turn yet wait, since turning
them would strain the sheet, and go on when others have made way. Panels are let through each other at first; a sheet
that would end so goes on from before anything touched, with panels that keep each other off (`contact`).
"""

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.errors import InputError
from origami_sim.pattern import Pattern
from origami_sim.pattern.checks import check_count, check_number
from origami_sim.pattern.drawn import NO_FOLD
from origami_sim.pattern.intersections import crossing_pairs
from origami_sim.quantities import converted

from .consistency import Vertex, vertices
from .contact import Contact
from .elastic import Elastic, Shape
from .layers import FlatVertex, flat_vertex
from .placement import Placement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SOFTNESS = (1e-3, 1e-2, 1e-1)
"""Stiffnesses of creases over that of the sheet in its plane, tried in turn, from a sheet to a rubber skin that is
drawn to its targets whatever it takes. The stiffest that reaches them is chosen. With
half and double of all the same of 20 fold, in 1.04 and 0.87 times the time; what cannot fold ends in a compromise that
keeps closer to lengths, or to angles."""
STEPS = 20
"""Steps of the targets, and frames of the replay. Half and double of them fold the same of 20 public patterns."""
ITERATIONS, LAST = 15, 60
"""Iterations at most in a step, which only has to stay near the path, and at the full targets, where it has to get.
Half of the first takes 0.8 times the time, double of the second 1.06 times; the same of 20 fold."""
LOWER = 0.9
"""Share of the energy below which another shape is taken as a snap rather than as the same minimum, less well found.
Half folds the same of 20; above 1, where states of more energy would be taken, two end otherwise."""
STRETCH = 0.05
"""Strain beyond which a sheet counts as torn, besides the drawing's inaccuracy: paper breaks at 2 to 5 per cent.
Half and double change no verdict of 20."""
THICKNESS = 2e-4
"""Thickness of a sheet that states none [m]: heavy paper."""
DEPTH = 1e-3
"""Depth over the sheet's longest side up to which triangles that cross count as layers of one plane: drawings that are
exact to 1e-4 and angles that end a tenth of a degree off leave up to 8e-4 in public patterns that fold. Half relaxes
one of these in a softer sheet first, in twice the time, and it folds. Double spares contact to one that is drawn with
errors of 6e-4 and crosses by 1.4e-3; the four others measured that get contact cross by 12e-3 and more."""
EXACT = 2e-5
"""Distance of all angles from their targets [rad] below which no other shape is looked for: it saves time. Half
and double change nothing."""
TOLERANCE = np.radians(5.0)
"""Distance from its target within which a crease has arrived [rad]; less of small targets, see `elastic.SHARE`."""


@dataclass(repr=False)
class Folding:
    """How a pattern folded.

    Attributes:
        sheet: what was folded, with its targets. vertices: what these say at each vertex inside the sheet.
        shares: [F] share of the target angles at each frame. x: [F, N, 3] positions [m].
        angles: [F, H] continuous hinge angles, creases first [rad].
        snaps: frames before which the sheet jumped to another shape.
        softness: of the sheet, see `SOFTNESS`. tolerance: [rad]. thickness: at which panels touch [m].
        wall: seconds that it took.
        clear_from: frame from which on panels kept each other off; None if they never did.
        touching: pairs of corners and triangles, or of edges, that touch at the end.
    """

    sheet: Elastic
    vertices: list[Vertex]
    shares: np.ndarray
    x: np.ndarray
    angles: np.ndarray
    snaps: list[int]
    softness: float
    tolerance: float
    thickness: float = THICKNESS
    wall: float = 0.0
    clear_from: int | None = None
    touching: int = 0

    def __repr__(self) -> str:
        worst, snaps = np.degrees(self.errors.max(initial=0.0)), f", {len(self.snaps)} snaps" if self.snaps else ""
        ends = f"folds to within {max(worst, 0.01):.2f} deg" if self.reached else f"misses by up to {worst:.1f} deg"
        return f"<Folding: {len(self.errors)} creases, {ends}{snaps}>"

    def _repr_html_(self) -> str:
        from origami_sim.view.findings import folding_html  # only who looks pays for it

        return folding_html(self)

    def plot(self) -> "Figure":
        """The sheet on its way, mountains red and valleys blue."""
        from .picture import figure_of

        return figure_of(self)

    @property
    def errors(self) -> np.ndarray:
        """Distance of each driven crease from its target at the end [rad]."""
        return self.sheet.errors(self.angles[-1])

    @property
    def stretch(self) -> float:
        """Largest strain at the end, of edges and of all pairs of corners of a panel, along it."""
        return float(np.abs(self.sheet.strains(self.x[-1] / self.sheet.size)).max(initial=0.0))

    @property
    def stretch_on_the_way(self) -> float:
        """Largest strain of any frame."""
        strains = [np.abs(self.sheet.strains(x / self.sheet.size)).max(initial=0.0) for x in self.x]
        return float(max(strains))

    @property
    def depth(self) -> float:
        """Depth from which on triangles that cross pass through each other [m]: the accuracy of a folded sheet."""
        return DEPTH * self.sheet.size

    @property
    def crossings(self) -> np.ndarray:
        """Pairs [P, 2] of triangles that pass through each other at the end."""
        return crossing_pairs(self.x[-1], self.sheet.mesh.triangles, self.depth)

    @property
    def torn(self) -> bool:
        """Whether the sheet is strained beyond `STRETCH` and beyond the drawing's inaccuracy."""
        return bool(np.max(self.sheet.misfits(self.x[-1] / self.sheet.size), initial=0.0) > STRETCH)

    @property
    def reached(self) -> bool:
        """Whether every driven crease has arrived, and the sheet is whole."""
        return bool(np.all(self.errors <= self.allowed)) and not self.torn

    @property
    def allowed(self) -> np.ndarray:
        """Distance from its target within which each driven crease has arrived [rad]."""
        return self.sheet.allowed(self.tolerance)

    def _allowed_at(self, vertex: Vertex) -> np.ndarray:
        """The same of the creases at a vertex."""
        allowed = np.full(len(self.sheet.hinges), self.tolerance)
        allowed[self.sheet.driven] = self.allowed
        return allowed[list(vertex.creases)]

    @property
    def contradictions(self) -> list[Vertex]:
        """Vertices at which no shape has all creases within what is allowed, the worst first."""
        found = [v for v in self.vertices if v.bound * len(v.creases) > self._allowed_at(v).sum()]
        return sorted(found, key=lambda v: -v.bound)

    @property
    def apart(self) -> list[Vertex]:
        """Vertices whose flat panels leave a gap beyond what a crease there is allowed, the widest first."""
        found = [v for v in self.vertices if v.gap > self._allowed_at(v).max(initial=0.0)]
        return sorted(found, key=lambda v: -v.gap)

    @property
    def flat(self) -> list[FlatVertex]:
        """Vertices all whose creases fold flat."""
        found = (flat_vertex(self.sheet, v.node, v.ring, self.angles[-1], self.tolerance) for v in self.vertices)
        return [v for v in found if v is not None]

    @property
    def uneven(self) -> list[FlatVertex]:
        """Vertices that are to fold flat, and whose sectors forbid it by more than the drawing's accuracy."""
        found = [v for v in self.flat if len(v.signs) % 2 == 0 and v.defect > v.accuracy]
        return sorted(found, key=lambda v: -v.defect)

    @property
    def unordered(self) -> list[FlatVertex]:
        """Vertices that close when they fold flat, but whose layers have no order: panels pass through each other."""
        return [v for v in self.flat if v.unordered and v.gap <= len(v.signs) * self.tolerance]

    @property
    def curved(self) -> bool:
        """Whether sharply folded curves make up half of the vertices or more: no sheet folds these flat."""
        return 2 * sum(v.curved for v in self.vertices) > sum(bool(v.creases) for v in self.vertices)


@dataclass
class _Path:
    """Frames of one attempt."""

    shapes: list[Shape]
    shares: list[float] = field(default_factory=lambda: [0.0])
    snaps: list[int] = field(default_factory=list)

    def add(self, share: float, shape: Shape):
        self.shares.append(share)
        self.shapes.append(shape)


def fold(
    pattern: Pattern,
    *,
    steps: int = STEPS,
    tolerance: float | str = TOLERANCE,
    thickness: float | str = THICKNESS,
    touch: bool | None = None,
    progress: Callable[[float], None] | None = None,
) -> Folding:
    """Fold a pattern to its target angles, as far as they can be reached together.

    Args:
        pattern: with mountains and valleys, which fold flat where they have no angle.
        steps: in which the targets grow, 1 to 1000.
        tolerance: distance from the target within which a crease has arrived [rad], or text as "2 deg"; a tenth
            of the target where that is less.
        thickness: of the sheet, at which panels touch [m], or text as "0.1 mm".
        touch: whether panels keep each other off on the whole way. None: from the last frame on at which nothing
            touches, if they would end through each other.
        progress: called with the fraction done.

    Returns:
        The path of the first sheet in `SOFTNESS` that reaches its targets; else that of the least energy.

    Raises:
        InputError: no pattern, a number out of its range or of another unit; no crease, no target angle, faces that
            cannot be triangulated; panels that are to touch, and lie in each other in the given shape.
    """
    began = clock.perf_counter()
    if not isinstance(pattern, Pattern):
        raise InputError(
            "is no pattern",
            field="pattern",
            value=pattern if isinstance(pattern, str) else type(pattern).__name__,
            allowed="a Pattern, as read('crane.svg') or miura(...) return",
        )
    steps, tolerance, thickness = _checked(steps, tolerance, thickness)
    sheet = Elastic(pattern)
    if not len(sheet.mesh.creases) or not np.any(sheet.target):
        what = "gives no target angle" if len(sheet.mesh.creases) else "has no crease to fold"
        why = "".join(f"; {n.rstrip('.')}" for n in pattern.notes if n.startswith(NO_FOLD))
        field = "edges_foldAngle" if len(sheet.mesh.creases) else "edges_assignment"
        if np.isnan(pattern.accuracy):
            raise InputError(f"the pattern {what}", field=field, allowed="M and V edges, or degrees")
        raise InputError(f"the pattern {what}{why}", allowed="mountains and valleys by colour (red, blue) or layer")
    search = _Search(sheet, Placement(sheet), vertices(sheet), steps, tolerance, thickness)
    if touch:
        sheet.contact = Contact(sheet, thickness)
    first = _Path([Shape(sheet.reference, sheet.start)])
    best = search.best(first, SOFTNESS, progress)
    if touch:
        best.clear_from = 0
    elif touch is None and len(best.crossings):
        best = search.apart(best, progress)
    if sheet.contact is not None:
        best.touching = sheet.contact.at(best.x[-1] / sheet.size).count
    sheet.softness, best.wall = best.softness, clock.perf_counter() - began
    if progress:
        progress(1.0)
    return best


def _checked(steps, tolerance, thickness) -> tuple[int, float, float]:
    """Return the settings of `fold` as numbers in their ranges, those of `calibrations/pattern.toml`."""
    ranges = (
        ("tolerance", tolerance, "rad", 1e-6, 3.0, "1e-06 to 3 rad, as a number in rad or a text as '2 deg'"),
        ("thickness", thickness, "m", 1e-6, 0.05, "1e-06 to 0.05 m, as a number in m or a text as '0.1 mm'"),
    )
    tolerance, thickness = (
        check_number(name, converted(value, unit, name), low=low, high=high, allowed=allowed)
        for name, value, unit, low, high, allowed in ranges
    )
    steps = check_count("steps", steps, 1)
    return int(check_number("steps", steps, high=1000, allowed="1 to 1000")), tolerance, thickness


@dataclass(frozen=True)
class _Search:
    """What all attempts at one pattern have in common; see `fold`."""

    sheet: Elastic
    placement: Placement
    around: list[Vertex]
    steps: int
    tolerance: float
    thickness: float

    def best(self, begin: _Path, softnesses: tuple[float, ...], progress) -> Folding:
        """The first sheet that reaches its targets from the end of a path, or that of least energy."""
        sheet, best, lowest = self.sheet, None, np.inf
        for n, softness in enumerate(softnesses):
            part = (lambda f, n=n: progress((n + f) / len(softnesses))) if progress else None
            sheet.softness = softness
            path = _follow(sheet, self.placement, begin, self.steps, part)
            used = _stiffen(sheet, path, self.tolerance)
            if sheet.arrived(path.shapes[-1].angles, self.tolerance):
                used = _untangle(sheet, path)
            found = self._folding(path, used)
            if found.reached:
                return found
            sheet.softness = SOFTNESS[0]
            firm = sheet.relax(path.shapes[-1], sheet.target, LAST)
            if best is None or firm.energy < LOWER * lowest:
                path.shapes[-1], lowest = firm, firm.energy
                best = self._folding(path, SOFTNESS[0])
            if best.contradictions or best.curved:
                break  # no softer sheet gets there either
        assert best is not None
        return best

    def apart(self, through: Folding, progress) -> Folding:
        """The same with panels that keep each other off, from the last frame before any touch in `through`.

        A given shape whose panels lie in each other stays as it was found.
        """
        sheet = self.sheet
        try:
            sheet.contact = Contact(sheet, self.thickness)
        except InputError:
            return through
        frames = [Shape(x / sheet.size, a) for x, a in zip(through.x, through.angles, strict=True)]
        clear = next((n for n, s in enumerate(frames) if n and not sheet.contact.free(s.x)), len(frames)) - 1
        begin = _Path(
            frames[: clear + 1], through.shares[: clear + 1].tolist(), [n for n in through.snaps if n <= clear]
        )
        best = self.best(begin, SOFTNESS[SOFTNESS.index(through.softness) :], progress)
        best.clear_from = clear
        return best

    def _folding(self, path: _Path, softness: float) -> Folding:
        return Folding(
            sheet=self.sheet,
            vertices=self.around,
            shares=np.array(path.shares),
            x=_steady([s.x for s in path.shapes]) * self.sheet.size,
            angles=np.array([s.angles for s in path.shapes]),
            snaps=list(path.snaps),
            softness=softness,
            tolerance=self.tolerance,
            thickness=self.thickness,
        )


def _follow(sheet: Elastic, placement: Placement, begin: _Path, steps: int, progress) -> _Path:
    """Return the states of least energy along growing targets, from the end of a path on."""
    path = _Path(list(begin.shapes), list(begin.shares), list(begin.snaps))
    shape = path.shapes[-1]
    for n in range(len(path.shapes), steps + 1):
        share = n / steps
        target = np.where(sheet.driven, (1.0 - share) * sheet.start + share * sheet.target, sheet.start)
        iterations = LAST if n == steps else ITERATIONS
        shape = sheet.relax(shape, target, iterations)
        placed = None if _exact(sheet, shape, target) else placement.at(target)
        if placed is not None and (sheet.contact is None or sheet.contact.free(placed.x)):
            other = sheet.relax(placed, target, iterations)
            if other.energy < LOWER * shape.energy:
                shape = other
                path.snaps.append(n)
        path.add(share, shape)
        if progress:
            progress(share)
    return path


def _exact(sheet: Elastic, shape: Shape, target) -> bool:
    """Tell whether a shape is as good as any."""
    return bool(np.abs(shape.angles - target)[sheet.driven].max() < EXACT)


def _stiffen(sheet: Elastic, path: _Path, tolerance: float) -> float:
    """Relax the last state of a path in the stiffest sheet that keeps to the targets; return that softness."""
    used = sheet.softness
    for softness in reversed([s for s in SOFTNESS if s < used]):
        sheet.softness = softness
        firmer = sheet.relax(path.shapes[-1], sheet.target, LAST)
        if not sheet.arrived(firmer.angles, tolerance):
            break
        path.shapes[-1], used = firmer, softness
    sheet.softness = used
    return used


def _untangle(sheet: Elastic, path: _Path) -> float:
    """Relax the last state of a path in softer sheets while fewer panels cross; return the softness.

    Where a drawing is inexact, either angles or lengths have to give way, and layers that are a degree off cross.
    """
    used = sheet.softness

    def crossings(shape: Shape) -> int:
        return len(crossing_pairs(shape.x, sheet.mesh.triangles, DEPTH))

    count = crossings(path.shapes[-1])
    for softness in [s for s in SOFTNESS if s > used]:
        if not count:
            break
        sheet.softness = softness
        softer = sheet.relax(path.shapes[-1], sheet.target, LAST)
        fewer = crossings(softer)
        if fewer < count and np.max(sheet.misfits(softer.x), initial=0.0) <= STRETCH:
            path.shapes[-1], used, count = softer, softness, fewer
    sheet.softness = used
    return used


def _steady(frames: list[np.ndarray]) -> np.ndarray:
    """Return the frames [F, N, 3] turned and moved as rigid bodies, each to lie best on the one before (Kabsch)."""
    out = [frames[0]]
    for x in frames[1:]:
        here, there = x - x.mean(axis=0), out[-1] - out[-1].mean(axis=0)
        u, _, v = np.linalg.svd(here.T @ there)
        turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        out.append(here @ turn + out[-1].mean(axis=0))
    return np.array(out)
