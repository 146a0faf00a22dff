"""Thick panels: hinges anywhere through the thickness, panels beside the pattern's plane, edges that stop a fold.

Across a crease, a panel takes up what lies between its faces and beyond its edge. In polar coordinates about the hinge
it reaches up, towards the face to which the crease folds, to an angle a(r) at the distance r. Both panels meet at the
fold angle

    theta = 180 deg - max over r of (a1(r) + a2(r))

and no fold goes beyond 180 degrees, where they are parallel. With equal panels this is 2 atan(g / 2 d + tan m) for
edges that are a gap g apart, cut at m from square, and faces a distance d beyond the hinge; without such faces it is
180.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from origami_sim.design.masses import positive
from origami_sim.design.statements import statement
from origami_sim.design.touch import Touches
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import STATED, Model, Parameters, beside
from origami_sim.quantities import converted

STIFF = 100.0
"""Stiffness of edges that meet, over that of their crease.

It is chosen: no model of edges gives it. A crease that would go one radian further is stopped 0.78 degrees beyond where
its edges meet, 0.89 at half of this and 0.67 at double.
"""

GIVE = 0.02
"""Angle within which edges that meet become as stiff as they get [rad].

It is chosen, as about a degree. The same crease is stopped 0.45 degrees beyond at half of this and 1.33 at double.
"""

WORDS = {"top": 0.5, "middle": 0.0, "bottom": -0.5}
"""Where a hinge may lie, in terms of both panels: height over their middle planes, in thicknesses."""


@dataclass(frozen=True)
class Hinge:
    """How the panels of a crease are joined.

    Attributes:
        at: height over the pattern's plane [m], or one of WORDS. gap: between the edges [m].
        top, bottom: angle from square by which the edges recede above and below the hinge [rad].
        stiffness: of edges that meet [N m/rad]; None: STIFF times that of the crease.
    """

    at: float | str = 0.0
    gap: float = 0.0
    top: float = 0.0
    bottom: float = 0.0
    stiffness: float | None = None


class Thick(Touches):
    """The part of `Sheet` that knows where panels and hinges lie in the thickness."""

    _levels: np.ndarray
    _hinges: dict[int, Hinge]
    _rigidity: np.ndarray
    _crease_stiffness: np.ndarray

    # what a designer states ------------------------------------------------------------------------------------

    @statement(rigidity="N m", thickness="m", offset="m")
    def panel(
        self,
        panels,
        *,
        rigidity: ArrayLike | None = None,
        thickness: ArrayLike | None = None,
        offset: ArrayLike | None = None,
    ) -> Self:
        """Properties of some panels: one for all, or one per panel.

        Args:
            rigidity: bending rigidity per width [N m], instead of E h^3 / 12 (1 - nu^2).
            thickness: [m], instead of that of the sheet.
            offset: height of the middle plane over the pattern's plane, towards the top [m]. The hinges stay where
                they are: the panel stands off them.
        """
        index = self._index("panel", panels)
        for name, value, unit in (("bending rigidity", rigidity, "N m"), ("thickness", thickness, "m")):
            if value is not None and not np.all(positive(value)):
                raise InputError(
                    f"a {name} must be positive", field=name.split()[-1], value=value, allowed=f"> 0 {unit}"
                )
        if offset is not None and not np.all(np.isfinite(offset)):
            raise InputError("an offset is a length", field="offset", value=offset, allowed="any height [m]")
        if rigidity is not None:
            self._rigidity[index] = rigidity
        if thickness is not None:
            self.thickness[index] = thickness
        if offset is not None:
            self._levels[index] = offset
        return self

    @statement(gap="m", stop_stiffness="N m/rad")
    def hinge(
        self,
        creases=None,
        *,
        at: float | str | None = None,
        gap: float | None = None,
        stop_stiffness: float | None = None,
    ) -> Self:
        """Where the hinges of thick panels lie. Each folds until the edges of its panels meet.

        Args:
            creases: indices (default: all).
            at: "top", "bottom" or "middle" of both panels, or the height over the pattern's plane [m] (default: as
                stated before; at first in the pattern's plane). Beyond a face, panels fold flat with a gap of twice the
                distance.
            gap: between the edges [m], half of it on each side of the hinge.
            stop_stiffness: of edges that meet [N m/rad] (default: STIFF times that of the crease).

        Raises:
            InputError: no such crease or height; a gap or stiffness that is not positive. `build` refuses hinges off
                the middle plane of bars, or beside a fold of the given shape, and hinges that cannot move.
        """
        if isinstance(at, str) and at not in WORDS:
            at = float(converted(at, "m", "at"))
        if at is not None and not isinstance(at, str) and not np.isfinite(at):
            raise InputError("a hinge lies at a height", field="at", value=at, allowed=f"{', '.join(WORDS)}, or [m]")
        if gap is not None and not 0 <= gap < np.inf:
            raise InputError("panels cannot overlap", field="gap", value=gap, allowed=">= 0 m")
        if stop_stiffness is not None and not positive(stop_stiffness):
            raise InputError(
                "edges that meet are stiff", field="stop_stiffness", value=stop_stiffness, allowed="> 0 N m/rad"
            )
        given = {"at": at, "gap": gap, "stiffness": stop_stiffness}
        return self._hinged(creases, {n: v for n, v in given.items() if v is not None})

    @statement(angle="rad")
    def mitre(self, creases=None, *, angle: float, face: str = "both") -> Self:
        """Cuts the edges of panels aslant beside creases, so that they meet at twice this angle (and the gap's share).

        Args:
            creases: indices (default: all). angle: from square ("45 deg": the fold stops at 90 degrees).
            face: "top", "bottom" or "both": on which side of the hinge the edges recede.

        Raises:
            InputError: no such crease or face, an angle that is not in [0, 90) degrees.
        """
        if not 0 <= angle < 0.5 * np.pi:
            raise InputError("no such mitre", field="angle", value=angle, allowed="0 to below pi/2 rad")
        if face not in ("top", "bottom", "both"):
            raise InputError("no such face", field="face", value=face, allowed="top, bottom, both")
        return self._hinged(creases, {f: float(angle) for f in ("top", "bottom") if face in (f, "both")})

    def _hinged(self, creases: ArrayLike | None, given: dict) -> Self:
        for c in self._index("crease", creases).tolist():
            self._hinges[c] = replace(self._hinges.get(c, Hinge()), **given)
        return self.on("crease_stop")

    # what follows from it ----------------------------------------------------------------------------------------

    @cached_property
    def _beside(self) -> np.ndarray:
        """[C, 2] panels left and right of each crease."""
        return self.mesh.triangle_face[beside(self.mesh.triangles, self.mesh.creases)]

    def _faces(self, panel: int) -> tuple[float, float]:
        """Heights of the bottom and the top of a panel over the pattern's plane [m]."""
        half = 0.5 * float(self.thickness[panel])
        return float(self._levels[panel]) - half, float(self._levels[panel]) + half

    def _height(self, crease: int) -> float:
        """Height of a hinge over the pattern's plane [m]."""
        at = self._hinges.get(crease, Hinge()).at
        if not isinstance(at, str):
            return at
        left, right = self._beside[crease]
        one, other = (float(self._levels[p] + WORDS[at] * self.thickness[p]) for p in (left, right))
        if abs(one - other) > 1e-9 * self.thickness.max():
            raise InputError(
                f"the {at} of panel {left} lies at {one * 1e3:.4g} mm, that of panel {right} at {other * 1e3:.4g} mm",
                field=f"hinge of crease {crease}.at",
                value=at,
                allowed="the height of the hinge [m]",
            )
        return one

    def stops(self, crease: int) -> tuple[float, float]:
        """Fold angles at which the edges of a crease's panels meet, as valley and as mountain [rad], both >= 0.

        Raises:
            InputError: an edge that recedes beyond the far side of its panel.
        """
        hinge, z = self._hinges.get(crease, Hinge()), self._height(crease)
        sides = [self._faces(panel) for panel in self._beside[crease]]
        half = 0.5 * hinge.gap
        valley = [Edge(high - z, low - z, half, hinge.top, hinge.bottom) for low, high in sides]
        mountain = [Edge(z - low, z - high, half, hinge.bottom, hinge.top) for low, high in sides]
        for panel, edge in zip(self._beside[crease].tolist(), valley, strict=True):
            self._check_left(crease, panel, max(edge.receded(edge.top), edge.receded(edge.bottom)))
        return meeting(valley), meeting(mountain)

    def _check_left(self, crease: int, panel: int, receded: float) -> None:
        x, mesh = self.mesh.vertices, self.mesh
        start, end = x[mesh.creases[crease, 1:3]]
        along = (end - start) / np.linalg.norm(end - start)
        arms = x[np.unique(mesh.triangles[mesh.triangle_face == panel])] - start
        width = float(np.linalg.norm(arms - np.outer(arms @ along, along), axis=1).max())
        if not receded < width:
            raise InputError(
                f"nothing is left of panel {panel}, which is {width * 1e3:.4g} mm wide there: its edge recedes by "
                f"{receded * 1e3:.4g} mm",
                field=f"hinge of crease {crease}",
                allowed="a smaller gap or mitre",
            )

    def _stop(self, parameters: Parameters) -> None:
        """Stops creases where the edges of their panels meet."""
        largest = get("crease_stop").parameter("stop_angle").bounds[1]
        for c, hinge in self._hinges.items():
            valley, mountain = self.stops(c)
            stiffness = hinge.stiffness
            if stiffness is None:
                stiffness = STIFF * float(np.nan_to_num(self._crease_stiffness[c]))
            if not stiffness > 0:
                raise InputError(
                    "a crease without stiffness does not say how stiff the edges beside it are",
                    field=f"hinge of crease {c}.stop_stiffness",
                    allowed="> 0 N m/rad, or crease(stiffness=...)",
                )
            if not valley + mountain > GIVE:
                raise InputError(
                    "the hinge cannot move: the edges of its panels meet on both sides",
                    field=f"hinge of crease {c}",
                    allowed="at='top' or 'bottom', a mitre, or a gap between the edges",
                )
            for name, value in (
                ("stop_stiffness", stiffness),
                ("stop_angle", min(0.5 * (valley + mountain), largest)),
                ("stop_middle", 0.5 * (valley - mountain)),
                ("stop_room", GIVE),
            ):
                parameters.set("crease_stop", name, value, [c])

    def _cut(self) -> bool:
        return bool(self._hinges or self._levels.any())

    def _thick(self, model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
        """The model with its panels and hinges at their heights.

        Raises:
            InputError: with bars, a hinge or panel off the pattern's plane; a hinge off it where the pattern is folded.
        """
        if not (self._hinges or self._levels.any()):
            return model, parameters
        heights, sides = np.array([self._height(c) for c in range(len(self.mesh.creases))]), self._beside
        off = np.flatnonzero(np.any(self._levels[sides] != 0, axis=1) | (heights != 0))
        if not len(off):
            return model, parameters
        if self.panels != "rigid":
            raise InputError(
                "bars turn about the middle plane, and a hinge off it needs rigid panels",
                field=f"hinge of crease {off[0]}",
                value=f"{heights[off[0]] * 1e3:.4g} mm",
                allowed="panels='rigid', or every hinge and panel in the pattern's plane",
            )
        normals = np.array([self._normal(p) for p in range(self.pattern.face_count)])
        for c in np.flatnonzero(heights).tolist():
            left, right = sides[c]
            if normals[left] @ normals[right] < 1 - 1e-9:
                raise InputError(
                    "hinges off the pattern's plane are stated on a flat pattern",
                    field=f"hinge of crease {c}",
                    allowed="a pattern that is flat there",
                )
        return parted(
            model, parameters, self._levels[:, None] * normals, heights[:, None] * normals[sides[:, 0]], sides
        )


@dataclass(frozen=True)
class Edge:
    """Section of a panel across a crease, seen from its hinge; the panel goes on away from it.

    Attributes:
        top, bottom: heights of its faces over the hinge [m], upwards to where the crease folds.
        gap: distance of the edge from the hinge, at its height [m].
        above, below: angle from square by which it recedes above and below the hinge's height [rad].
    """

    top: float
    bottom: float
    gap: float
    above: float
    below: float

    def receded(self, height: float) -> float:
        """Distance of the edge from the hinge's plane across the panels [m]."""
        return self.gap + np.tan(self.above) * max(height, 0.0) + np.tan(self.below) * max(-height, 0.0)

    @property
    def corner(self) -> float:
        """Distance of the upper corner from the hinge [m]."""
        return float(np.hypot(self.top, self.receded(self.top)))

    @property
    def nearest(self) -> float:
        """Distance of the panel from the hinge [m]."""
        if self.top <= 0:
            return self.corner
        low = max(self.bottom, 0.0)
        return float(np.hypot(low, self.receded(low)))

    def reach(self, radius: float) -> float:
        """Largest angle up from the panel's own direction that it takes up at a distance from the hinge [rad]."""
        if radius >= self.corner or not self.corner > self.nearest:
            return float(np.arcsin(np.clip(self.top / max(radius, 1e-300), -1.0, 1.0)))
        # on the edge, which is straight: gap + tan z along and z up
        slope = np.tan(self.above)
        b, c = self.gap * slope, self.gap**2 - radius**2
        z = (-b + np.sqrt(max(b * b - (1 + slope**2) * c, 0.0))) / (1 + slope**2)
        return float(np.arctan2(z, self.gap + slope * z))


def meeting(edges: list[Edge]) -> float:
    """Fold angle at which two panels meet that turn towards each other about their hinge [rad]; at most half a turn."""
    one, other = edges

    def closed(radius: float) -> float:
        return -one.reach(radius) - other.reach(radius)

    begins = max(one.nearest, other.nearest)
    marks = sorted({begins, *(r for r in (one.corner, other.corner) if r > begins)})
    least = min(closed(r) for r in marks)
    marks.append(1e3 * max(marks[-1], abs(one.top), abs(other.top)))  # from where on both are as good as flat
    for low, high in pairwise(marks):
        least = min(least, float(minimize_scalar(closed, bounds=(low, high), method="bounded").fun))  # pyright: ignore[reportAttributeAccessIssue]
    return float(np.clip(np.pi + min(least, 0.0), 0.0, np.pi))


def _parted_grips(model: Model, source: np.ndarray, held: np.ndarray, free: np.ndarray, hinges: int) -> np.ndarray:
    """Grips of the nodes of `parted`: those of copies of nodes `source` that panels hold, and of what is still held."""
    if not len(model.grips):
        return model.grips
    corners = len(free)
    own = np.where(np.all(free > 0, axis=1), -1, model.grips[:corners])
    copies = np.where(held, model.grips[source], -1)
    return np.concatenate([own, copies, model.grips[corners:], np.full(hinges, -1)]).astype(np.int32)


def parted(
    model: Model, parameters: Parameters, lifts: np.ndarray, axes: np.ndarray, sides: np.ndarray
) -> tuple[Model, Parameters]:
    """The model of rigid panels that share no node, and whose hinges have nodes of their own.

    Of a node that several panels share, each but the first gets a copy, on which no load acts. Each hinge gets four
    nodes, which panels carry like the points of their mass: two of its axis and two that tell its angle.

    Args:
        lifts: [P, 3] by which panels are moved. axes: [C, 3] by which hinges are moved [m].
        sides: [C, 2] panels left and right of each crease.
    """
    corners = len(model.position) - len(model.carriers)
    owner, copies = np.full(corners, -1), []
    place: dict[tuple[int, int], int] = {}
    held = np.zeros((len(lifts), 3), bool)  # panels are held where all of their corners are
    for p in range(len(lifts)):
        mine = np.unique(model.triangles[model.triangle_panel == p])
        held[p] = ~np.any(model.free[mine], axis=0)
        for n in mine.tolist():
            first = owner[n] < 0
            place[p, n] = n if first else corners + len(copies)
            if first:
                owner[n] = p
            else:
                copies.append((p, n))
    of, source = (np.array(a, int) for a in (list(zip(*copies, strict=True)) or ((), ())))
    x, position = model.position[:corners], model.position.copy()
    position[:corners][owner >= 0] += lifts[owner[owner >= 0]]
    hinges = x[model.creases] + axes[:, None]
    first = len(position) + len(copies)
    carried = np.stack([sides[:, 1], sides[:, 0], sides[:, 0], sides[:, 0]], axis=1)
    free, given = model.free.copy(), 1.0 - held[of]
    by_others = np.zeros((corners, 3), bool)
    np.logical_or.at(by_others, source, held[of])
    free[:corners][by_others & ~held[owner]] = 1.0
    own = {tuple(t): (int(p), t) for p, t in zip(model.triangle_panel, model.triangles.tolist(), strict=True)}

    def moved(rows: np.ndarray) -> np.ndarray:
        new = [[place[own[tuple(t)][0], n] for n in t] for t in rows.tolist()]
        return np.array(new, np.int32).reshape(-1, 3)

    out = replace(
        model,
        position=np.concatenate([position[:corners], x[source] + lifts[of], position[corners:], hinges.reshape(-1, 3)]),
        free=np.concatenate([free[:corners], given, free[corners:], np.ones((4 * len(hinges), 3))]),
        triangles=moved(model.triangles),
        contacts=moved(model.contacts),
        creases=(first + np.arange(4 * len(hinges))).reshape(-1, 4).astype(np.int32),
        carriers=np.concatenate([model.carriers, carried.ravel()]).astype(np.int32),
        grips=_parted_grips(model, source, held[of], free[:corners], 4 * len(hinges)),
    )
    found = Parameters(out)
    for name, key in found:
        old, new = parameters[name, key], found[name, key]
        family = get(name).family if name not in STATED else ""
        if family == "node" or name == "inertia":
            new = np.repeat(new, old.shape[1], axis=1)
            new[corners : corners + len(copies)] = new[first:] = 0.0 if name == "inertia" else new[:1]
            new[:corners], new[corners + len(copies) : first] = old[:corners], old[corners:]
        else:
            new = old
        found.replace(name, key, new)
    return out, found
