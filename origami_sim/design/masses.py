"""What panels weigh: plates and patches, bodies that were measured, point masses; and the node masses for them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from origami_sim.design.statements import Statements, statement
from origami_sim.errors import InputError
from origami_sim.model import BODY
from origami_sim.model.bodies import SYMMETRIC, check_body, inertia_tensor, rectangle, second_moments, triangle
from origami_sim.pattern import Pattern
from origami_sim.pattern.triangulate import Triangulation
from origami_sim.physics.materials import G

LEVEL = 1e-6
"""Part of a panel's size by which a mass may lie off its plane and still count as in it: rounding of stated places.

Half or double changes nothing: who states an offset states one of some per cent of the panel.
"""


@dataclass(frozen=True)
class Stated:
    """A measured body as it was stated.

    Attributes:
        mass: [kg]. centre: of mass (3,) [m] in the reference state.
        inertia: [3, 3] tensor, or one moment [kg m^2]. about: the axis of one moment: "crease", the name or number of
            a crease, or a direction (3,). through: the point that the tensor or the axis is about; None: the centre.
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    about: object = None
    through: np.ndarray | None = None


class Masses(Statements):
    """The part of `Sheet` that knows what panels weigh."""

    pattern: Pattern
    mesh: Triangulation
    panels: str
    thickness: np.ndarray
    density: np.ndarray
    area: np.ndarray
    _area_vector: np.ndarray
    _patches: list[dict]
    _labels: dict[str, tuple[str, ...]]
    _stated: dict[int, Stated]
    _points: list[tuple[int, float, np.ndarray]]
    _extra_mass: np.ndarray
    _levels: np.ndarray
    _gravity: tuple[float, float, float] | None

    # what a designer states ------------------------------------------------------------------------------------

    @statement(acceleration="m/s^2")
    def gravity(self, acceleration: Sequence[float] | np.ndarray = (0.0, 0.0, -G)) -> Self:
        """Weight of sheet and patches; acceleration (3,) [m/s^2].

        Raises:
            InputError: no vector of three finite numbers.
        """
        gx, gy, gz = _place(acceleration, "acceleration", "gravity is a vector").tolist()
        self._gravity = (gx, gy, gz)
        return self.set("gravity", gravity_x=gx, gravity_y=gy, gravity_z=gz)

    @statement(mass="kg", centre="m", inertia="kg m^2", through="m")
    def body(
        self,
        panel: int,
        *,
        mass: float,
        centre: ArrayLike,
        inertia: ArrayLike,
        about: str | int | ArrayLike | None = None,
        through: ArrayLike | None = None,
    ) -> Self:
        """Gives a panel the mass [kg], centre of mass [m] and inertia [kg m^2] of a measured rigid body.

        It replaces the weight of the panel and of its patches. Rigid panels may have any body; elastic ones only one
        that masses at their nodes can make, with its centre of mass in their plane.

        Args:
            centre: in the reference state, anywhere.
            inertia: a tensor [3, 3] in the reference axes, or the principal moments along x, y and z, about the centre
                of mass or the point `through`; or one moment, about the axis `about`.
            about: of one moment: "crease" for the panel's own crease, the name or number of one of its creases, or a
                direction (3,) through the point `through` (default: the centre of mass). The rest of the inertia is
                then that of a plate of the panel's form: its mass is spread across the axis by one factor, so that
                the moment is right.
            through: a point in the reference state (3,) [m].

        Raises:
            InputError: no such panel, a mass or an inertia that no body has, one moment without an axis. `build`
                raises where the panel has not that crease, or the moment is less than the distance of the
                centre makes.
        """
        self._triangles_of(panel)
        field = f"body of panel {panel}"
        tensor, middle = np.asarray(inertia, float), _place(centre, f"{field}.centre", "a centre is a place")
        point = None if through is None else _place(through, f"{field}.through", "an axis goes through a place")
        if tensor.ndim == 0:
            if not positive(mass):
                check_body(mass, np.eye(3), field)
            if not positive(tensor):
                raise InputError(
                    "a moment of inertia is positive", field=f"{field}.inertia", value=float(tensor), allowed="> 0"
                )
            if about is None:
                raise InputError(
                    "one moment of inertia needs an axis",
                    field=f"{field}.about",
                    allowed="'crease', a crease, or a direction with through=",
                )
            if not isinstance(about, (str, int)):
                about = _place(about, f"{field}.about", "an axis is a direction")
                if not np.linalg.norm(about) > 0:
                    raise InputError("an axis is a direction", field=f"{field}.about", value=about, allowed="not zero")
            elif through is not None:
                raise InputError("the axis is the crease", field=f"{field}.through", value=point, allowed="left out")
        else:
            tensor = np.diag(tensor) if tensor.shape == (3,) else tensor
            if about is not None:
                raise InputError(
                    "a tensor has no axis", field=f"{field}.about", value=about, allowed="left out, or through="
                )
            check_body(mass, tensor, field)
            if point is not None:
                away = middle - point
                tensor = tensor - mass * ((away @ away) * np.eye(3) - np.outer(away, away))
                check_body(mass, tensor, f"{field}, from through= to its centre")
        self._stated[panel] = Stated(float(mass), middle, tensor, about, point)
        return self

    @statement(mass="kg")
    def mass(self, nodes, mass: float) -> Self:
        """Adds point masses [kg] at nodes."""
        if not np.all(np.asarray(mass, float) >= 0):
            raise InputError("a mass cannot be negative", field="mass", value=mass, allowed=">= 0 kg")
        np.add.at(self._extra_mass, self._index("node", nodes), mass)
        return self

    @statement(mass="kg", at="m", offset="m")
    def point_mass(self, panel: int, mass: float, at: ArrayLike, *, offset: float = 0.0) -> Self:
        """Adds a small mass [kg] that a panel carries, such as a screw or a marker, off its mid-plane if need be.

        With elastic panels the nodes around it get the mass, and its offset acts by its weight alone
        (`eccentric_weight`), not by the moment of inertia that it adds.

        Args:
            at: place in the reference state (3,) [m]. With elastic panels it lies within the panel.
            offset: height above that place along the panel's normal [m]; negative below.

        Raises:
            InputError: no such panel, a mass that is not positive, no place, a place outside an elastic panel.
        """
        triangles, field = self._triangles_of(panel), f"point mass on panel {panel}"
        place = _place(at, field, "a point mass is at a place") + float(offset) * self._normal(panel)
        if not positive(mass) or not np.isfinite(offset):
            raise InputError("a point mass is positive", field=field, value=mass, allowed="> 0 kg")
        if self.panels == "elastic":
            best = max((self._barycentric(int(t), place).min() for t in triangles), default=-1.0)
            if best < -LEVEL:
                raise InputError(
                    "a point mass lies outside its panel",
                    field=field,
                    value=place.tolist(),
                    allowed="a place within it, or panels='rigid'",
                )
        self._points.append((panel, float(mass), place))
        return self

    # what follows from it ----------------------------------------------------------------------------------------

    @staticmethod
    def _patch_mass(patch: dict) -> float:
        return float(patch["density"] * patch["thickness"] * patch["size"].prod())

    def _normal(self, panel: int) -> np.ndarray:
        normal = self._area_vector[self._triangles_of(panel)].sum(0)
        return normal / np.linalg.norm(normal)

    def _carrier(self, panel: int, place: np.ndarray) -> tuple[int, np.ndarray, float]:
        """The triangle of a panel under a place, weights of its corners, and the height above its plane [m]."""
        weights = [(int(t), self._barycentric(int(t), place)) for t in self._triangles_of(panel)]
        t, w = max(weights, key=lambda c: c[1].min())
        corners = self.mesh.vertices[self.mesh.triangles[t]]
        return t, w, float((place - w @ corners) @ self._normal(panel))

    def _off_plane(self) -> dict[int, tuple[float, float]]:
        """Mass [kg] that lies off the mid-plane and its mean height [m], by triangle."""
        found: dict[int, tuple[float, float]] = {}

        def add(t: int, mass: float, height: float) -> None:
            m, h = found.get(t, (0.0, 0.0))
            found[t] = (m + mass, (m * h + mass * height) / (m + mass))

        for panel, patch in enumerate(self._patches):
            for t in self._triangles_of(panel) if patch and panel not in self._stated else ():
                height = patch["side"] * 0.5 * (self.thickness[panel] + patch["thickness"])
                add(int(t), self._patch_mass(patch) * self._share(panel, t), height)
        for panel, mass, place in self._points:
            t, _, height = self._carrier(panel, place)
            if abs(height) > LEVEL * np.sqrt(self.area[t]):
                add(t, mass, height)
        return found

    def _plate(self, panel: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, centre of mass and second moments [3, 3] about it of a panel and its patch, uniform each."""
        thick, patch, normal = self.thickness[panel], self._patches[panel], self._normal(panel)
        lift = self._levels[panel] * normal
        parts = [
            triangle(
                self.mesh.vertices[self.mesh.triangles[t]] + lift, self.density[panel] * thick * self.area[t], thick
            )
            for t in self._triangles_of(panel)
        ]
        if patch:
            middle = patch["centre"] + lift + patch["side"] * 0.5 * (thick + patch["thickness"]) * normal
            parts.append(rectangle(middle, patch["size"], patch["thickness"], normal, self._patch_mass(patch)))
        return _together(parts)

    def _axis(self, panel: int) -> tuple[np.ndarray, np.ndarray]:
        """Unit direction and a point of the axis that one moment of inertia is about."""
        stated = self._stated[panel]
        if not isinstance(stated.about, (str, int)):
            along = np.asarray(stated.about, float)
            return along / np.linalg.norm(along), stated.centre if stated.through is None else stated.through
        nodes, names = set(self._nodes_of(panel).tolist()), self._labels.get("crease", ())
        own = [c for c, hinge in enumerate(self.mesh.creases.tolist()) if {hinge[1], hinge[2]} <= nodes]
        said = [names[c] if c < len(names) else str(c) for c in own]
        if stated.about == "crease":
            chosen = own if len(own) == 1 else []
        else:
            chosen = [c for c, name in zip(own, said, strict=True) if stated.about in (c, name)]
        if len(chosen) != 1:
            raise InputError(
                "the panel has several creases or none" if stated.about == "crease" else "the panel has no such crease",
                field=f"body of panel {panel}.about",
                value=stated.about,
                allowed=", ".join(said) or "a direction with through=",
            )
        j, k = self.mesh.creases[chosen[0]][1:3]
        along = self.mesh.vertices[k] - self.mesh.vertices[j]
        return along / np.linalg.norm(along), self.mesh.vertices[j]

    def _measured(self, panel: int) -> tuple[float, np.ndarray, np.ndarray, np.ndarray | None]:
        """Mass, centre and second moments [3, 3] about it of a stated body; the axis if only one moment was stated."""
        stated = self._stated[panel]
        if stated.inertia.ndim == 2:
            return stated.mass, stated.centre, second_moments(stated.inertia), None
        axis, point = self._axis(panel)
        away = stated.centre - point
        away = away - axis * (away @ axis)
        moment = float(stated.inertia) - stated.mass * float(away @ away)
        if not moment > 0:
            raise InputError(
                "no body has this inertia",
                field=f"body of panel {panel}.inertia",
                value=float(stated.inertia),
                allowed=f"> {stated.mass * float(away @ away):.6g} kg m^2, which the distance of its centre makes",
            )
        mass, _, plate = self._plate(panel)
        if self.panels == "elastic":  # masses at nodes lie in the plane
            flat = np.eye(3) - np.outer(self._normal(panel), self._normal(panel))
            plate = flat @ plate @ flat
        across = np.eye(3) - np.outer(axis, axis)
        spread = np.trace(across @ plate @ across) * stated.mass / mass
        scale = np.outer(axis, axis) + np.sqrt(moment / spread) * across
        return stated.mass, stated.centre, scale @ plate @ scale * stated.mass / mass, axis

    def _bodies(self) -> dict[str, np.ndarray]:
        """Mass, centre of mass and inertia of each panel with patches and point masses, as `model.BODY` names them."""
        x, left, rows = self.mesh.vertices, self._extra_mass.copy(), []
        for panel in range(self.pattern.face_count):
            mass, centre, spread = self._measured(panel)[:3] if panel in self._stated else self._plate(panel)
            parts: list[tuple[float, np.ndarray, np.ndarray]] = [
                (mass, centre, spread + mass * np.outer(centre, centre))
            ]
            lift = self._levels[panel] * self._normal(panel)
            for n in self._nodes_of(panel):  # a mass on a crease is the first panel's
                at = x[n] + lift
                parts.append((float(left[n]), at, left[n] * np.outer(at, at)))
                left[n] = 0.0
            parts += [(m, at, m * np.outer(at, at)) for p, m, at in self._points if p == panel]
            mass, centre, spread = _together(parts)
            tensor = inertia_tensor(spread)
            rows.append([mass, *centre, *(tensor[k] for k in SYMMETRIC)])
        return dict(zip(BODY, np.array(rows).T, strict=True))

    def _frame(self, panel: int) -> np.ndarray:
        """[2, 3] unit vectors in the panel's plane: along its longest side, and across it."""
        corners = self.mesh.vertices[list(self.pattern.faces[panel])]
        sides = np.roll(corners, -1, axis=0) - corners
        e1 = sides[np.argmax(np.linalg.norm(sides, axis=1))]
        e1 = e1 / np.linalg.norm(e1)
        return np.stack([e1, np.cross(self._normal(panel), e1)])

    def _node_masses(self) -> np.ndarray:
        mesh, out = self.mesh, self._extra_mass.copy()
        if self.panels == "rigid":  # the bodies have it
            return np.ones(len(mesh.vertices))
        for panel, mass, place in self._points:
            t, weights, _ = self._carrier(panel, place)
            out[mesh.triangles[t]] += mass * np.maximum(weights, 0.0)
        for panel in range(self.pattern.face_count):
            nodes, triangles = self._nodes_of(panel), self._triangles_of(panel)
            patch = self._patches[panel]
            sheet = self.density[panel] * self.thickness[panel] * self.area[triangles]
            centred = len(nodes) > len(self.pattern.faces[panel])
            if panel not in self._stated and not centred:
                extra = self._patch_mass(patch) if patch else 0.0
                for t, m in zip(triangles, sheet, strict=True):
                    out[mesh.triangles[t]] += (m + extra * self._share(panel, t)) / 3
                continue
            out[nodes] += self._lumped(panel, nodes, triangles, sheet, patch)
        bad = np.flatnonzero(out <= 0)
        if len(bad):
            raise InputError("a node has no mass", field=f"node {bad[0]}", allowed="> 0 kg")
        return out

    def _lumped(
        self, panel: int, nodes: np.ndarray, triangles: np.ndarray, sheet: np.ndarray, patch: dict
    ) -> np.ndarray:
        """Node masses >= 0 that have the panel's mass, centre of mass and second moments."""
        x = self.mesh.vertices
        normal, frame = self._normal(panel), self._frame(panel)
        origin = self._centroid(panel)
        if panel in self._stated:
            mass, centre, spread, axis = self._measured(panel)
            if axis is not None and abs(axis @ normal) > LEVEL:
                axis = None
            if axis is not None:  # the moment about the axis is stated, that across it is free
                frame = np.stack([np.cross(normal, axis), axis])
            y, c, second = (x[nodes] - origin) @ frame.T, (centre - origin) @ frame.T, frame @ spread @ frame.T
            if abs((centre - origin) @ normal) > LEVEL * np.abs(y).max():
                raise InputError(
                    "the centre of mass lies off the panel's plane",
                    field=f"body of panel {panel}.centre",
                    value=centre.tolist(),
                    allowed="a place in its plane, or panels='rigid'",
                )
            target = np.append(mass * np.array([1.0, *c]), np.diag(second) + mass * c**2)
            target = np.append(target, second[0, 1] + mass * c[0] * c[1])
            if axis is not None:
                target[4] = np.nan
        else:
            y, target = (x[nodes] - origin) @ frame.T, np.zeros(6)
            for t, m in zip(triangles, sheet, strict=True):
                p = (x[self.mesh.triangles[t]] - origin) @ frame.T
                # exact for a uniform triangle: a twelfth at each corner, the rest at the centroid
                target += _moments(np.vstack([p, p.mean(0)]), m * np.array([1 / 12, 1 / 12, 1 / 12, 3 / 4]))
            if patch:
                half = patch["size"] / 2
                grid = (
                    np.array([[sx, sy, 0.0] for sx in (-1, 1) for sy in (-1, 1)]) * np.append(half, 0) + patch["centre"]
                )
                points = (np.vstack([grid, patch["centre"]]) - origin) @ frame.T
                weights = np.array([1 / 12] * 4 + [2 / 3])  # exact for a uniform rectangle
                target += _moments(points, self._patch_mass(patch) * weights)
        given = ~np.isnan(target)
        matrix = np.stack([_moments(p[None], np.ones(1)) for p in y], axis=1)[given]
        size = np.abs(y).max()
        scale = np.array([1, 1 / size, 1 / size, 1 / size**2, 1 / size**2, 1 / size**2])[given]
        floor = 0.01 * target[0] / len(nodes)  # no node without inertia
        rest = target[given] - matrix @ np.full(len(nodes), floor)
        solution, residual = nnls(matrix * scale[:, None], rest * scale)
        if panel in self._stated and residual > 1e-6 * target[0]:
            raise InputError(
                "no non-negative node masses have this mass, centre and inertia",
                field=f"panel {panel}",
                value=float(residual),
                allowed="a body whose masses lie within its panel, or panels='rigid'",
            )
        return solution + floor

    # geometry -----------------------------------------------------------------------------------------------------

    def _counts(self) -> dict[str, int]:
        mesh = self.mesh
        return {"panel": self.pattern.face_count, "crease": len(mesh.creases), "node": len(mesh.vertices)}

    def _index(self, family: str, chosen: ArrayLike | None) -> np.ndarray:
        """Indices of some entities of a family, or of all."""
        count = self._counts()[family]
        if chosen is None:
            return np.arange(count)
        if np.size(chosen) and np.asarray(chosen).dtype.kind not in "iu":
            raise InputError(f"a {family} is given by its number", field=family, value=chosen, allowed="whole numbers")
        index = np.atleast_1d(np.asarray(chosen, int)) if np.size(chosen) else np.zeros(0, int)
        bad = index[(index < 0) | (index >= count)]
        if len(bad):
            raise InputError(f"there is no such {family}", field=family, value=int(bad[0]), allowed=f"0 to {count - 1}")
        return index

    def _triangles_of(self, panel: int) -> np.ndarray:
        if not isinstance(panel, (int, np.integer)) or isinstance(panel, bool):
            raise InputError("a panel is given by its number", field="panel", value=panel, allowed="a whole number")
        if not 0 <= panel < self.pattern.face_count:
            raise InputError(
                "there is no such panel", field="panel", value=panel, allowed=f"0 to {self.pattern.face_count - 1}"
            )
        return np.flatnonzero(self.mesh.triangle_face == panel)

    def _nodes_of(self, panel: int) -> np.ndarray:
        return np.unique(self.mesh.triangles[self._triangles_of(panel)])

    def _share(self, panel: int, triangle: int) -> float:
        return float(self.area[triangle] / self.area[self._triangles_of(panel)].sum())

    def _centroid(self, panel: int) -> np.ndarray:
        t = self._triangles_of(panel)
        centres = self.mesh.vertices[self.mesh.triangles[t]].mean(axis=1)
        return (self.area[t, None] * centres).sum(0) / self.area[t].sum()

    def _edge_weights(self, triangle: int, direction: np.ndarray) -> tuple[float, float]:
        """a, b with the in-plane part of `direction` = a (x2 - x1) + b (x3 - x1)."""
        return in_plane(self.mesh.vertices[self.mesh.triangles[triangle]], direction)

    def _barycentric(self, triangle: int, point: np.ndarray) -> np.ndarray:
        return barycentric(self.mesh.vertices[self.mesh.triangles[triangle]], point)


def in_plane(corners: np.ndarray, direction: np.ndarray) -> tuple[float, float]:
    """a, b with the part of a direction (3,) in the plane of corners x1, x2, x3 = a (x2 - x1) + b (x3 - x1)."""
    (a, b), *_ = np.linalg.lstsq((corners[1:] - corners[0]).T, direction, rcond=None)
    return float(a), float(b)


def barycentric(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Barycentric weights (3,) of a point by corners [3, 3]."""
    a, b = in_plane(corners, point - corners[0])
    return np.array([1 - a - b, a, b])


def positive(value) -> np.ndarray:
    """Where a value is finite and above zero."""
    value = np.asarray(value, float)
    return np.isfinite(value) & (value > 0)


def _place(value, field: str, fault: str) -> np.ndarray:
    place = np.asarray(value, float)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise InputError(fault, field=field, value=value, allowed="x, y, z")
    return place


def _together(parts: Sequence[tuple[float, np.ndarray, np.ndarray]]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and second moments about it, of parts with mass, centre and second moments about the origin."""
    mass = sum(m for m, *_ in parts)
    centre = np.sum([m * c for m, c, _ in parts], axis=0) / mass
    return mass, centre, np.sum([s for *_, s in parts], axis=0) - mass * np.outer(centre, centre)


def _moments(points: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """m, m y1, m y2, m y1^2, m y2^2, m y1 y2 of points [n, 2], summed."""
    a, b = points[:, 0], points[:, 1]
    rows = (masses, masses * a, masses * b, masses * a * a, masses * b * b, masses * a * b)
    return np.array([row.sum() for row in rows])
