"""The ground under a sheet: which of its points can touch, how stiff it is there, and where the sheet starts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.design.masses import Masses, barycentric, in_plane, positive
from origami_sim.design.statements import statement
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.model.clearance import gaps, upward
from origami_sim.physics.materials import G

SINK = 1e-4
"""Depth to which a sheet's weight presses the whole of it into the ground, over the sheet's longest side.

Single points sink by some 1e-3 then. The stride of a magnetic strip of 48 mm on four feet (23.8 mm) gets 0.8 % longer
with half of it and 1.4 % shorter with double, at 0.7 and 1.4 times the time step.
"""

LANDING = 0.5
"""Damping of a landing, as a ratio of critical: what lands rebounds with 0.3 of its speed, as rubber may.

That is the restitution of a dashpot that cannot pull (Schwager and Poeschel 2007, Granular Matter 9, 465,
doi:10.1007/s10035-007-0065-z); 0.51 with half of it, 0.14 with double. Double changes the stride of that strip by 0.2 %
and halves the time step.
"""

ON_EDGE = 1e-6
"""Share of a triangle within which a point lies on its edge or corner: rounding leaves 1e-16. Half and double change
nothing."""


def _orbits(*orbits: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric places [n, 3] and weights [n] of orbits: a weight, and the share of two of the corners."""
    places = [np.roll([1 - 2 * a, a, a], k) for a, _ in orbits for k in range(3 if a != 1 / 3 else 1)]
    return np.array(places), np.array([w for a, w in orbits for _ in range(3 if a != 1 / 3 else 1)])


QUADRATURES = {
    1: _orbits((1 / 3, 1.0)),
    3: _orbits((1 / 6, 1 / 3)),
    6: _orbits((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)),
}
"""Points of a triangle by their number, exact for degrees 1, 2 and 4 (Strang & Fix 1973; Cowper 1973, Int. J. Numer.
Meth. Eng. 7, 405)."""


@dataclass(frozen=True)
class Contact:
    """A point of a sheet that can touch the ground.

    Attributes:
        triangle, weights: that carries it, and barycentric weights (3,) of its corners.
        offset: height above the mid-plane [m], or with `below` under the panel's underside [m], patches counted.
        axis: weights (3,) of the corners that give the body's forward direction. panel: of the triangle.
        foot: whether it is to bear the device with the other feet alone.
        pad: three nodes that carry it in place of the triangle's corners.
    """

    triangle: int
    weights: np.ndarray
    offset: float
    axis: np.ndarray
    name: str
    panel: int
    below: bool = False
    foot: bool = False
    pad: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class Ground:
    """The ground as it was stated, see `Grounds.ground`."""

    nodes: np.ndarray | None
    points: int
    friction: float
    both_sides: bool
    sink: float | None
    damping_ratio: float
    lift: bool
    tilt: float
    azimuth: float


Place = tuple[int, np.ndarray, str, float]
"""Triangle, barycentric weights (3,), name, and share of the sheet, of a place where it touches."""


class Grounds(Masses):
    """The part of `Sheet` that knows the ground."""

    _contacts: list[Contact]
    _ground: Ground | None

    # what a designer states ------------------------------------------------------------------------------------

    @statement(point="m", offset="m")
    def contact(
        self,
        panel: int,
        point: ArrayLike,
        *,
        offset: float = 0.0,
        axis: ArrayLike = (1, 0, 0),
        name: str | None = None,
        pad: Sequence[int] | None = None,
    ) -> int:
        """Adds a point that can touch the ground and returns its index.

        Args:
            panel: face that carries it. point: position in the reference state [m], in the panel's plane.
            offset: height above the mid-plane along the panel's normal [m]; negative below.
            axis: the body's forward direction in the reference state, for directional friction.
            pad: three nodes that carry it, such as those of a stiff block that is bonded to several cells: it lies off
                their plane, and turns with that. Otherwise it turns with its own triangle, the more the finer the mesh.

        Raises:
            InputError: no such panel or node, a point outside of the panel or the pad, a pad in one line or on rigid
                panels.
        """
        if pad is None:
            return self._touch(panel, np.asarray(point, float), axis, offset=float(offset), name=name)
        return self._on_pad(panel, np.asarray(point, float), axis, pad, offset=float(offset), name=name)

    @statement(offset="m")
    def underside(
        self, *, points: int = 3, offset: float = 0.0, axis: ArrayLike = (1, 0, 0)
    ) -> tuple[list[int], np.ndarray]:
        """Adds the points of a quadrature of every triangle that can touch the ground.

        A law per area is integrated over the sheet by giving each point that law times its area.

        Args:
            points: of each triangle: 1, 3 or 6, exact for a pressure of degree 1, 2 or 4.
            offset, axis: as in `contact`.

        Returns:
            their indices, and the area for which each stands [m^2].

        Raises:
            InputError: no such number of points.
        """
        places, weights = _quadrature(points)
        found, area = [], []
        for t, panel in enumerate(self.mesh.triangle_face.tolist()):
            forward = self._forward(self._corners(t), np.asarray(axis, float))
            for k, (at, weight) in enumerate(zip(places, weights, strict=True)):
                name = f"triangle {t}, point {k}"
                self._contacts.append(Contact(t, at, float(offset), forward, name, panel))
                found.append(len(self._contacts) - 1)
                area.append(float(weight * self.area[t]))
        return found, np.array(area)

    @statement(at="m", height="m", mass="kg")
    def feet(
        self,
        at,
        *,
        height: float = 0.0,
        friction: float = 0.5,
        backward: float | None = None,
        heading: ArrayLike = (1, 0, 0),
        mass: float = 0.0,
        name: str = "foot",
    ) -> Self:
        """Puts feet under a sheet, which alone can carry its weight; with `backward`, directional ones.

        Args:
            at: nodes (numbers), or places in the reference state (x, y, z) [m].
            height: of a foot below the panel's underside, or its patch's there [m].
            friction: coefficient for sliding forward, along `heading`, or in any direction without `backward`.
            backward: coefficient for sliding backward.
            heading: the body's forward direction in the reference state.
            mass: of each foot [kg]. name: their labels are "foot 1", "foot 2", ...

        Raises:
            InputError: no such node, a place on no panel, a coefficient that is negative or smaller backward.
        """
        listed = list(at)
        places = [self.mesh.vertices[self._index("node", [n])[0]] if np.ndim(n) == 0 else n for n in listed]
        if not places:
            raise InputError("feet need places", field="at", allowed="nodes, or places (x, y, z) [m]")
        if not 0 <= friction <= (friction if backward is None else backward):
            raise InputError(
                "friction is positive, and larger backward",
                field="friction, backward",
                value=(friction, backward),
                allowed="0 <= friction <= backward",
            )
        first = len(self._contacts)
        earlier = sum(c.foot for c in self._contacts)
        for k, place in enumerate(np.asarray(p, float) for p in places):
            panel, triangle, weights = self._under(place)
            label = f"{name} {earlier + k + 1}"
            self._touch(panel, weights @ self.mesh.vertices[self.mesh.triangles[triangle]], heading,
                        offset=-float(height), name=label, below=True, foot=True)  # fmt: skip
            np.add.at(self._extra_mass, self.mesh.triangles[triangle], mass * weights)
        own = list(range(first, len(self._contacts)))
        self.set("coulomb", own, friction_coefficient=friction)
        if backward is not None:
            self.set("directional_friction", own, backward_excess=backward - friction)
        return self

    @statement(sink="m", tilt="rad", azimuth="rad")
    def ground(
        self,
        *,
        nodes: Sequence[int] | None = None,
        points: int = 0,
        friction: float = 0.5,
        both_sides: bool = False,
        sink: float | None = None,
        damping_ratio: float = LANDING,
        lift: bool = True,
        tilt: float = 0.0,
        azimuth: float = 0.0,
    ) -> Self:
        """Puts the sheet on a flat ground that it can neither pass through nor slide on freely.

        Its underside touches at every node, of every panel that meets there, and at the corners of patches below. The
        ground is so stiff that the whole sheet sinks by `sink` where all of it lies down, or the feet do where they
        alone stand: a point's stiffness is the share that its area and its length of the outline are of the sheet's.
        So a finer mesh stands on no stiffer ground. A sheet without `gravity` gets standard gravity.

        Args:
            nodes: only these can touch besides feet and contacts (default: all; () for feet alone).
            points: of a quadrature of each triangle, 1, 3 or 6, that touch in place of the nodes, with 1, 2 or 3 Gauss
                points to an edge of the outline. What lands on an edge over less than a cell needs them: nodes alone
                make it land elsewhere on each mesh.
            friction: coefficient of all points that are no feet.
            both_sides: let the upper side touch as well, for what turns over. Twice as many points.
            sink: depth [m] (default: SINK times the longest side).
            damping_ratio: of a landing.
            lift: shift the sheet along the ground's normal until its lowest point just touches. Without it the sheet
                starts where it is stated, and `build` refuses a start inside the ground.
            tilt, azimuth: rise of the ground [rad], and the horizontal direction from x in which it rises [rad]. The
                sheet is not turned with it: one that is to lie on a slope has a tilted `gravity` and a level ground.

        Raises:
            InputError: no such node or number of points, both, a coefficient, damping or depth that is negative, a tilt
                of a right angle or more.
        """
        if points:
            _quadrature(points)
            if nodes is not None:
                allowed = "nodes that touch, or points of every triangle"
                raise InputError("a sheet touches at nodes or between them", field="nodes, points", allowed=allowed)
        if not (friction >= 0 and damping_ratio >= 0 and (sink is None or positive(sink))):
            raise InputError(
                "the ground's numbers are positive",
                field="friction, damping_ratio, sink",
                value=(friction, damping_ratio, sink),
                allowed=">= 0, >= 0, > 0 m",
            )
        if not abs(tilt) < np.pi / 2:
            raise InputError("the ground is no wall", field="tilt", value=tilt, allowed="-pi/2 to pi/2 rad")
        chosen = None if nodes is None else self._index("node", [*nodes])
        self._ground = Ground(chosen, points, friction, both_sides, sink, damping_ratio, lift, tilt, azimuth)
        if self._gravity is None:
            self.gravity()
        self.on("ground", "friction", "coulomb")
        return self

    # what follows from it ----------------------------------------------------------------------------------------

    def _touch(self, panel: int, point: np.ndarray, axis: ArrayLike, *, name: str | None, **options) -> int:
        """Adds a contact point and returns its index."""
        candidates = [(int(t), self._barycentric(int(t), point)) for t in self._triangles_of(panel)]
        inside = max(w.min() for _, w in candidates)
        if not inside >= -ON_EDGE:
            raise InputError("a contact point lies outside its panel", field=f"panel {panel}", value=point.tolist())
        # at a corner, or on an edge, of several the widest one there carries, and not the one that rounding prefers
        level = [(t, w) for t, w in candidates if w.min() > inside - ON_EDGE]
        best, weights = max(level, key=lambda c: round(self._angle_at(c[0], point), 9))
        forward = self._forward(self._corners(best), np.asarray(axis, float))
        label = name or f"contact {len(self._contacts)}"
        self._contacts.append(Contact(best, weights, axis=forward, name=label, panel=panel, **options))
        return len(self._contacts) - 1

    def _corners(self, triangle: int) -> np.ndarray:
        """Places of a triangle's corners [3, 3]."""
        return self.mesh.vertices[self.mesh.triangles[triangle]]

    def _on_pad(
        self, panel: int, point: np.ndarray, axis: ArrayLike, pad: Sequence[int], *, offset: float, name: str | None
    ) -> int:
        """Adds a contact point that a pad carries, and returns its index."""
        if self.panels == "rigid":
            raise InputError("a point turns with its rigid panel", field=f"pad of panel {panel}", allowed="left out")
        nodes = [int(n) for n in self._index("node", [*pad])]
        at = self.mesh.vertices[nodes] if len(nodes) == 3 else np.zeros((3, 3))
        upward = float(np.cross(at[1] - at[0], at[2] - at[0]) @ self._normal(panel))
        if not abs(upward) > ON_EDGE * np.ptp(at, axis=0).max(initial=1e-300) ** 2:
            raise InputError("a pad has three nodes, not in one line", field=f"pad of panel {panel}", value=nodes)
        if upward < 0:
            nodes, at = nodes[::-1], at[::-1]
        weights = barycentric(at, point)
        if not weights.min() >= -ON_EDGE:
            raise InputError("a contact point lies outside its pad", field=f"panel {panel}", value=point.tolist())
        forward = self._forward(at, np.asarray(axis, float))
        label, first = name or f"contact {len(self._contacts)}", int(self._triangles_of(panel)[0])
        self._contacts.append(
            Contact(first, weights, offset, forward, label, panel, pad=(nodes[0], nodes[1], nodes[2]))
        )
        return len(self._contacts) - 1

    @staticmethod
    def _forward(corners: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Weights (3,) of corners [3, 3] that give the part of a direction in their plane."""
        a, b = in_plane(corners, axis)
        return np.array([-a - b, a, b])

    def _angle_at(self, triangle: int, point: np.ndarray) -> float:
        """Angle of a triangle around a point on it [rad]: that of a corner, else none."""
        corners = self.mesh.vertices[self.mesh.triangles[triangle]]
        away = np.linalg.norm(corners - point, axis=1)
        k = int(away.argmin())
        if away[k] > ON_EDGE * away.max():
            return 0.0
        a, b = corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))

    def _under(self, place: np.ndarray) -> tuple[int, int, np.ndarray]:
        """The panel and triangle on which a place lies, and its barycentric weights there."""
        every = [(t, self._barycentric(t, place)) for t in range(len(self.mesh.triangles))]
        t, weights = max(every, key=lambda c: c[1].min())
        if not weights.min() >= -1e-6:
            raise InputError("a foot stands under no panel", field="at", value=place.tolist(), allowed="on the sheet")
        return int(self.mesh.triangle_face[t]), t, weights

    def _underside(self, panel: int, place: np.ndarray) -> float:
        """Depth of a panel's underside at a place below its mid-plane [m], with a patch that lies there."""
        depth, patch = 0.5 * float(self.thickness[panel]), self._patches[panel]
        if patch and patch["side"] < 0 and np.all(np.abs(place - patch["centre"])[:2] <= 0.5 * patch["size"] + 1e-9):
            depth += patch["thickness"]
        return depth

    def _grounded(self) -> tuple[list[Contact], np.ndarray]:
        """All contact points, with their heights, and the share of the weight that each bears [K]."""
        out, corners = [], self.mesh.vertices[self.mesh.triangles]
        for c in self._contacts:
            under = self._underside(c.panel, c.weights @ corners[c.triangle]) if c.below else 0.0
            out.append(replace(c, offset=c.offset - under))
        if self._ground is None:
            return out, np.zeros(len(out))
        feet = max(sum(c.foot for c in out) or len(out), 1)
        shares = [1.0 / feet] * len(out)
        ground = self._ground
        for t, at, name, share in self._at_points(ground.points) if ground.points else self._at_nodes(ground.nodes):
            panel = int(self.mesh.triangle_face[t])
            for side in (-1, 1) if self._ground.both_sides else (-1,):
                where = name + (", above" if side > 0 else "")
                out.append(Contact(t, at, side * 0.5 * float(self.thickness[panel]), np.zeros(3), where, panel))
                shares.append(share)
        for panel, patch in enumerate(self._patches):
            if self._ground.nodes is not None or not patch or (patch["side"] > 0 and not self._ground.both_sides):
                continue
            height = patch["side"] * (0.5 * float(self.thickness[panel]) + patch["thickness"])
            for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                place = patch["centre"] + np.array([x * patch["size"][0], y * patch["size"][1], 0.0]) / 2
                t, weights, _ = self._carrier(panel, place)
                if weights.min() >= -1e-6:  # a patch may hang over its panel
                    out.append(Contact(t, weights, height, np.zeros(3), f"patch on panel {panel}", panel))
                    shares.append(float(patch["size"].prod() / self.area.sum() / 4))
        return out, np.array(shares)

    def _at_nodes(self, nodes: np.ndarray | None) -> list[Place]:
        """Where a sheet touches at its nodes, or at some of them."""
        out: list[Place] = []
        for panel, node, share in self._shares():
            if nodes is None or node in nodes:
                t = int(next(t for t in self._triangles_of(panel) if node in self.mesh.triangles[t]))
                out.append((t, (self.mesh.triangles[t] == node).astype(float), f"node {node}", share))
        return out

    def _at_points(self, points: int) -> list[Place]:
        """Where a sheet touches by the quadratures of its triangles and of its outline."""
        places, weights = _quadrature(points)
        total, outline = float(self.area.sum()), self._outline()
        around = sum(length for _, length in outline.values())
        whole = 0.5 if around else 1.0
        out: list[Place] = [
            (t, at, f"triangle {t}, point {k}", whole * float(weight * self.area[t]) / total)
            for t in range(len(self.area))
            for k, (at, weight) in enumerate(zip(places, weights, strict=True))
        ]
        along, parts = np.polynomial.legendre.leggauss((points + 3) // 3)
        for (a, b), (t, length) in outline.items():
            nodes = self.mesh.triangles[t]
            for x, part in zip((1 + along) / 2, parts / 2, strict=True):
                at = (1 - x) * (nodes == a) + x * (nodes == b)
                out.append((t, at, f"edge {a} {b}", 0.5 * float(part) * length / around))
        return out

    def _outline(self) -> dict[tuple[int, int], tuple[int, float]]:
        """Triangle and length [m] of every edge of one triangle only."""
        edges: dict[tuple[int, int], list[int]] = {}
        for t, nodes in enumerate(self.mesh.triangles.tolist()):
            for k in range(3):
                a, b = sorted((nodes[k], nodes[(k + 1) % 3]))
                edges.setdefault((a, b), []).append(t)
        x = self.mesh.vertices
        return {e: (t[0], float(np.linalg.norm(x[e[1]] - x[e[0]]))) for e, t in edges.items() if len(t) == 1}

    def _shares(self) -> list[tuple[int, int, float]]:
        """Panel, node and the share of the sheet that touches there: half by area, half by length of its outline.

        By area alone the edge on which a sheet stands would grow soft as the mesh is refined.
        """
        mesh, total = self.mesh, float(self.area.sum())
        share: dict[tuple[int, int], float] = {}
        for t, nodes in enumerate(mesh.triangles.tolist()):
            for node in nodes:
                key = int(mesh.triangle_face[t]), node
                share[key] = share.get(key, 0.0) + 0.5 * float(self.area[t]) / 3 / total
        outline = self._outline()
        around = sum(length for _, length in outline.values())
        if not around:  # a closed surface
            return sorted(((p, n, 2 * s) for (p, n), s in share.items()), key=lambda i: (i[1], i[0]))
        for e, (t, length) in outline.items():
            for node in e:
                share[int(mesh.triangle_face[t]), node] += 0.25 * length / around
        return [(panel, node, s) for (panel, node), s in sorted(share.items(), key=lambda i: (i[0][1], i[0][0]))]

    def _stand(self, model: Model, parameters: Parameters, shares: np.ndarray, lifts: np.ndarray) -> Model:
        """The model where it starts; the ground's stiffness and damping go into the parameters.

        Args:
            lifts: [K] by which the panels of contact points will be moved off the pattern's plane [m].
        """
        ground = self._ground
        if ground is None or not len(model.contacts):
            return model
        mass = float(sum(self._bodies()["mass"]))
        size = float(np.ptp(self.mesh.vertices, axis=0).max())
        stiffness = mass * G / (ground.sink or SINK * size)
        damping = 2 * ground.damping_ratio * np.sqrt(stiffness * mass)
        for effect in ("ground", "friction"):
            parameters.set(effect, "stiffness", stiffness * shares).set(effect, "damping", damping * shares)
        parameters.set("coulomb", "friction_coefficient", ground.friction)
        parameters.set("plane", "tilt", ground.tilt).set("plane", "azimuth", ground.azimuth)
        there = replace(model, contact_offsets=model.contact_offsets + lifts)
        gap = gaps(there, parameters, model.position[:, None])[:, 0]
        lowest = int(gap.argmin())
        if not ground.lift:
            if gap[lowest] < -1e-9 * size:
                raise InputError(
                    f"the sheet starts {-gap[lowest] * 1e3:.3g} mm inside the ground",
                    field=model.name("contact", lowest),
                    value=float(gap[lowest]),
                    allowed="lift=True, or a pattern that lies higher",
                )
            return model
        shift = -gap[lowest] * upward(ground.tilt, ground.azimuth)
        for axis, by in zip("xyz", shift, strict=True):
            centre = parameters["body", f"centre_{axis}"]
            parameters.set("body", f"centre_{axis}", centre[:, 0] + by)
        return replace(model, position=model.position + shift)


def _quadrature(points: int) -> tuple[np.ndarray, np.ndarray]:
    if points not in QUADRATURES:
        allowed = ", ".join(map(str, QUADRATURES))
        raise InputError("no such number of points to a triangle", field="points", value=points, allowed=allowed)
    return QUADRATURES[points]
