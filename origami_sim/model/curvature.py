"""Curvature of a sheet's triangles from its hinge angles: weights that are exact for constant curvature on any mesh.

A triangle whose edges turn by phi_e against it at their middles, towards their tangent planes, has the mean curvature

    kappa = sum over its edges of (l_e / A) phi_e n_e n_e^T,    n_e: outward normal in the plane, l_e: length, A: area

as in the element of Morley (1968, Aeronautical Quarterly 19, 149) and in the discrete shape operator with mid-edge
normals (Grinspun, Gingold, Reisman & Zorin 2006, Computer Graphics Forum 25, 547). The two sides of a hinge share its
angle, phi_left + phi_right = theta; how they share it is no further unknown here but a combination of the hinge angles
around, the smallest that is exact where the curvature is constant. Deflections are then a part of Morley's, which keeps
his convergence; angles stay angles at any rotation of the sheet, so that rigid motions cost nothing. Between triangles
of different rigidity the curvature across their line jumps so that the moment does not (`_Mesh.jump`).

At an edge without a neighbour (a border, a crease) phi_e is whatever leaves no moment across the edge: `relaxed` takes
that direction out of the rigidity. Beside a triangle that is held, the edge keeps to the plane of the held triangle.

Curvature that is constant in each triangle is softer than curvature that varies. Part of what it leaves out, the energy
of its variation, is put back as that of the difference between neighbours; it is nothing where the curvature is
constant, and falls with the square of the mesh size as the error does that it makes up for.
"""

import functools
from dataclasses import dataclass

import numpy as np

from origami_sim.model.model import ALIKE, Model

VARIATION, BESIDE_HELD = 0.2, 1.2
"""Weights of the energy of differences of curvature across a line, per third of the two areas; the second beside held
triangles, where curvature changes fastest. Chosen so that square plates of 16 cells, simply supported and clamped, are
right to 2.5 % on regular and random meshes at any Poisson's ratio; without them clamped plates are 5 % too soft, with
twice the first simply supported ones 1 % too stiff on regular meshes. They do not touch what plates converge to."""

RINGS = 4
"""Rings of triangles around a hinge that are asked at most for angles; corners of a sheet need two or three."""

CONDITION = 1e3
"""Largest condition number of the equations of exactness; beyond it another ring is asked. Ten times less changes
nothing but corners, ten times more lets needle-like corners amplify."""

OUTER = 0.3
"""Weight of each further ring: less keeps stencils short, more spreads them; twice or half moves errors by a tenth."""


@dataclass(frozen=True)
class Curvature:
    """Weights of hinge angles in rows: curvatures of triangles, and differences of curvature between neighbours.

    Attributes:
        start: [R + 1] first entry of each row. hinge: [n] bending line of each entry.
        weight: [n, 3] its share of kappa_11, kappa_22 and 2 kappa_12 in the axes of the row's triangle [1/m].
        triangle: [R] triangle of each row. whole: [R] 1: its curvature, 0: the difference to a neighbour's.
        share: [R] area for which the row stands [m^2].
        axes: [T, 2, 3] unit vectors of each triangle's plane in which components are given.
        area: [T] [m^2]. shape: [T, 2, 2] inverse of the edges 0-1 and 0-2 (columns) in these axes [1/m].
        loose: [T, 3] edges (0-1, 1-2, 2-0) without a neighbour on the same sheet.
        normal: [T, 3, 2] outward normals of the edges in the triangle's axes.
        side: [T, 3] number of each edge, which neighbours share. arc_start, arc_hinge, arc_weight: rows for these edges
            of length / sqrt(12) times the curvature along them, the mean of both sides' [-].
    """

    start: np.ndarray
    hinge: np.ndarray
    weight: np.ndarray
    triangle: np.ndarray
    whole: np.ndarray
    share: np.ndarray
    axes: np.ndarray
    area: np.ndarray
    shape: np.ndarray
    loose: np.ndarray
    normal: np.ndarray
    side: np.ndarray
    arc_start: np.ndarray
    arc_hinge: np.ndarray
    arc_weight: np.ndarray

    @property
    def dual(self) -> np.ndarray:
        """[T, 3, 3] strain 11, 22 and twice 12 (rows) of a unit strain along each edge (columns) alone."""
        return np.linalg.inv(_directions(self.normal))

    def arcs(self, angles: np.ndarray) -> np.ndarray:
        """Length / sqrt(12) times the curvature along each edge, of hinge angles [Q]."""
        out = np.zeros(len(self.arc_start) - 1)
        np.add.at(
            out, np.repeat(np.arange(len(out)), np.diff(self.arc_start)), angles[self.arc_hinge] * self.arc_weight
        )
        return out

    def reach(self, triangles: np.ndarray, bends: np.ndarray) -> np.ndarray:
        """[T, n] nodes that the membrane of each triangle feels by its corners and arcs, repeated to equal numbers."""
        of = np.split(self.arc_hinge, self.arc_start[1:-1])
        found = [
            np.unique(np.concatenate([corners, *(bends[of[s]].ravel() for s in sides)]))
            for corners, sides in zip(triangles, self.side, strict=True)
        ]
        width = max(map(len, found), default=0)
        return np.array([np.resize(f, width) for f in found], np.int64).reshape(len(triangles), width)

    @property
    def row(self) -> np.ndarray:
        """[n] row of each entry."""
        return np.repeat(np.arange(len(self.triangle)), np.diff(self.start))

    def of(self, angles: np.ndarray) -> np.ndarray:
        """Rows [R, 3] of hinge angles [Q]: curvatures and their differences [1/m]."""
        out = np.zeros((len(self.triangle), 3))
        np.add.at(out, self.row, angles[self.hinge, None] * self.weight)
        return out


def axes_of(position: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Axes [T, 2, 3] of triangles: the x axis as it lies in their plane (y where that is upright), and across it."""
    a, b, c = (position[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.where(np.abs(normal[:, :1]) < 0.99, np.eye(3)[0], np.eye(3)[1])
    along = along - normal * (along * normal).sum(1, keepdims=True)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([along, np.cross(normal, along)], axis=1)


def voigt(n: np.ndarray) -> np.ndarray:
    """n n^T of vectors [..., 2] as curvature components 11, 22 and twice 12 [..., 3]."""
    return np.stack([n[..., 0] ** 2, n[..., 1] ** 2, 2 * n[..., 0] * n[..., 1]], axis=-1)


def relaxed(rigidity: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Rigidity [3, 3] of a triangle that has no moment across edges with these normals [k, 2]."""
    if not len(normals):
        return rigidity
    by = voigt(normals).T
    return rigidity - rigidity @ by @ np.linalg.pinv(by.T @ rigidity @ by, rcond=1e-10) @ by.T @ rigidity


def of(model: Model) -> Curvature:
    """The weights of a model's triangles in its reference state."""
    return curvature(model.position, model.triangles, model.bends, model.free, model.plates)


def curvature(
    position: np.ndarray,
    triangles: np.ndarray,
    bends: np.ndarray,
    free: np.ndarray,
    plates: np.ndarray = ALIKE,
) -> Curvature:
    """The weights of a mesh in its reference state.

    Args:
        position: [N, 3] [m]. triangles: [T, 3]. bends: [Q, 4] hinges i, j, k, l. free: [N, 3] 0 where held.
        plates: [T, 6] bending stiffness D11, D22, D12, D66, D16, D26 of the triangles in their axes, as `axes_of` has
            them, up to a common factor; empty: that of one material throughout.
    """
    given = (position, float), (triangles, np.int64), (bends, np.int64), (free, float), (plates, float)
    return _cached(*((np.asarray(a, kind).tobytes(), a.shape) for a, kind in given))


@functools.lru_cache(maxsize=16)
def _cached(position, triangles, bends, free, plates) -> Curvature:
    x, mask, stiff = (np.frombuffer(data, float).reshape(shape) for data, shape in (position, free, plates))
    t, b = (np.frombuffer(data, np.int64).reshape(shape) for data, shape in (triangles, bends))
    return _Mesh(x, t, b, mask, stiff).curvature()


def _directions(normal: np.ndarray) -> np.ndarray:
    """Strain or curvature [T, 3, 3] along each edge of components 11, 22 and twice 12, from the edges' normals."""
    t = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    return np.stack([t[..., 0] ** 2, t[..., 1] ** 2, t[..., 0] * t[..., 1]], axis=-1)


def _turns_of_unit_curvature(flat: np.ndarray, edge: np.ndarray, outward: np.ndarray) -> np.ndarray:
    """phi_e [T, 3, 3] of triangles' edges for each unit component of a constant curvature."""
    out = np.zeros((*outward.shape[:2], 3))
    middle = flat + 0.5 * edge
    for c, kappa in enumerate(([[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 0.5], [0.5, 0]])):
        height = 0.5 * np.einsum("tka,ab,tkb->tk", flat, np.array(kappa, float), flat)
        slope = np.linalg.solve(edge[:, :2], np.diff(height, axis=1)[..., None])[..., 0]
        out[..., c] = np.einsum("tka,tka->tk", outward, middle @ np.array(kappa, float) - slope[:, None])
    return out


Row = tuple[int, float, float, dict[int, np.ndarray]]
"""Triangle, whether it is the whole curvature, area, and weights by hinge."""


class _Mesh:
    """A triangulated sheet.

    Attributes:
        pairs: triangle and edge left and right of each hinge. hinges: those of each triangle.
        edge, outward: [T, 3, 2] edges and their unit normals. length: [T, 3]. area: [T].
        unit: [T, 3, 3] turns of the edges for unit curvature. loose: [T, 3] edges without a neighbour. held: [T].
        stiff: [T, 3, 3] bending stiffness; nothing where all are alike.
    """

    def __init__(
        self, position: np.ndarray, triangles: np.ndarray, bends: np.ndarray, free: np.ndarray, plates: np.ndarray
    ):
        self.stiff = plates[:, [[0, 2, 4], [2, 1, 5], [4, 5, 3]]]
        self.axes = axes_of(position, triangles)
        self.flat = np.einsum("tka,tba->tkb", position[triangles] - position[triangles[:, :1]], self.axes)
        self.edge = np.roll(self.flat, -1, axis=1) - self.flat
        self.length = np.linalg.norm(self.edge, axis=2)
        self.outward = np.stack([self.edge[..., 1], -self.edge[..., 0]], axis=-1) / self.length[..., None]
        self.area = 0.5 * (self.edge[:, 0, 0] * self.edge[:, 1, 1] - self.edge[:, 0, 1] * self.edge[:, 1, 0])
        self.unit = _turns_of_unit_curvature(self.flat, self.edge, self.outward)
        side = {(c[k], c[k - 2]): (t, k) for t, c in enumerate(triangles.tolist()) for k in range(3)}
        ends = [((j, k), (k, j)) for _, j, k, _ in bends.tolist()]
        self.pairs = {q: (side[a], side[b]) for q, (a, b) in enumerate(ends) if a in side and b in side}
        normal = np.cross(self.axes[:, 0], self.axes[:, 1])
        held = np.all((free[triangles] * np.abs(normal[:, None])).sum(-1) < 1e-9, axis=1)
        self.loose, company = np.ones((len(triangles), 3), bool), np.zeros(len(triangles), bool)
        self.hinges: dict[int, list[int]] = {}
        for q, sides in self.pairs.items():
            for t, k in sides:
                self.loose[t, k] = False
                self.hinges.setdefault(t, []).append(q)
            both = [t for t, _ in sides]
            company[both] |= held[both].all()
        # all three corners of a triangle in the corner of a sheet may lie on supports that let the sheet turn
        self.held = held & (company | (self.loose.sum(axis=1) < 2))

    def curvature(self) -> Curvature:
        """See `curvature`."""
        own = self._own()
        rows = [(t, 1.0, self.area[t], e) for t, e in enumerate(own)] + self._differences(own)
        rows = [(t, w, s, self._kept(t, e)) for t, w, s, e in rows]
        rows = [r for r in rows if r[3]]
        return Curvature(
            start=np.cumsum([0, *(len(e) for *_, e in rows)]).astype(np.int32),
            hinge=np.array([f for *_, e in rows for f in e], np.int32),
            weight=np.array([v for *_, e in rows for v in e.values()]).reshape(-1, 3),
            triangle=np.array([t for t, *_ in rows], np.int32),
            whole=np.array([w for _, w, *_ in rows], float),
            share=np.array([s for _, _, s, _ in rows], float),
            axes=self.axes,
            area=self.area,
            shape=np.linalg.inv(np.stack([self.flat[:, 1], self.flat[:, 2]], axis=2)),
            loose=self.loose,
            normal=self.outward,
            **self._arcs(own),
        )

    def _arcs(self, own: list[dict[int, np.ndarray]]) -> dict[str, np.ndarray]:
        """Rows of curvature along the edges, and the edges of the triangles."""
        directions, own = _directions(self.outward), self._completed(own)
        side, rows = np.full(self.loose.shape, -1, np.int32), []
        borders = [((t, k),) for t, k in zip(*np.nonzero(self.loose), strict=True)]
        for sides in [*self.pairs.values(), *borders]:
            row: dict[int, float] = {}
            for t, k in sides:
                side[t, k] = len(rows)
                by = self.length[t, k] / np.sqrt(12.0) / len(sides) * directions[t, k]
                for f, v in own[t].items():
                    row[f] = row.get(f, 0.0) + float(by @ v)
            rows.append({} if any(self.held[t] for t, _ in sides) else row)
        return {
            "side": side,
            "arc_start": np.cumsum([0, *map(len, rows)]).astype(np.int32),
            "arc_hinge": np.array([f for row in rows for f in row], np.int32),
            "arc_weight": np.array([v for row in rows for v in row.values()], float),
        }

    def _completed(self, own: list[dict[int, np.ndarray]]) -> list[dict[int, np.ndarray]]:
        """Weights of every triangle's curvature with that across its borders, as its neighbours curve that way.

        A border's own turn is no part of a triangle's curvature, so what is left tells too little along its other
        edges. Where no neighbour knows either, those that have learnt it tell.
        """
        out, known = list(own), ~np.any(self.loose, axis=1)
        while True:
            learnt = {}
            for t in np.flatnonzero(~known).tolist():
                frames = {t: np.eye(3)}
                beside = [self.across(t, q, frames) for q in self.hinges.get(t, ())]
                beside = [b for b in beside if known[b] and not self.held[b]]
                if beside and not self.held[t]:
                    turned = [{f: np.linalg.inv(frames[b]) @ v for f, v in out[b].items()} for b in beside]
                    learnt[t] = self._with_borders(t, own[t], turned)
            if not learnt:
                return out
            for t, row in learnt.items():
                out[t], known[t] = row, True

    def _with_borders(self, t: int, own: dict[int, np.ndarray], beside: list[dict]) -> dict[int, np.ndarray]:
        """A triangle's weights, and as much across its borders as makes them the mean of the rows `beside` there."""
        across = voigt(self.outward[t][self.loose[t]])
        asks = across * [1.0, 1.0, 0.5]  # the curvature along these normals
        fill = across.T @ np.linalg.inv(asks @ across.T) @ asks
        nothing = np.zeros(3)
        return {
            f: (w := own.get(f, nothing)) + fill @ (sum(row.get(f, nothing) for row in beside) / len(beside) - w)
            for f in dict.fromkeys([*own, *(f for row in beside for f in row)])
        }

    def _kept(self, t: int, entries: dict[int, np.ndarray]) -> dict[int, np.ndarray]:
        """Entries that are not rounding."""
        return {f: v for f, v in entries.items() if np.abs(v).max() > 1e-12 / np.sqrt(self.area[t])}

    def _own(self) -> list[dict[int, np.ndarray]]:
        """Weights of every triangle's curvature by hinge."""
        out: list[dict[int, np.ndarray]] = [{} for _ in self.area]
        for q, ((a, ka), (b, kb)) in self.pairs.items():
            shares = {q: 1.0} if self.held[b] else {} if self.held[a] else self.share(q)
            for t, k, sign, whole in ((a, ka, 1.0, 0.0), (b, kb, -1.0, 1.0)):
                if self.held[t]:
                    continue
                by = self.length[t, k] / self.area[t] * voigt(self.outward[t, k])
                for f in dict.fromkeys([*shares, q]):
                    part = sign * shares.get(f, 0.0) + whole * (f == q)
                    out[t][f] = out[t].get(f, 0.0) + part * by
        return out

    def _differences(self, own: list[dict[int, np.ndarray]]) -> list[Row]:
        """Rows for the differences of curvature across hinges."""
        beside = np.zeros(len(self.area), bool)
        for (a, _), (b, _) in self.pairs.values():
            beside[[a, b]] |= self.held[a] != self.held[b]
        out: list[Row] = []
        for q, ((a, _), (b, _)) in self.pairs.items():
            if self.held[a] or self.held[b]:
                continue
            # the one of which borders leave more open; of two alike the stiffer one, which it bends less
            if self._asked(b) > self._asked(a):
                a, b = b, a
            if not self._relaxed_alike(a, b, q):
                continue
            frames = {a: np.eye(3)}
            self.across(a, q, frames)
            back = np.linalg.inv(frames[b])
            difference = {f: own[a].get(f, 0.0) - back @ own[b].get(f, np.zeros(3)) for f in {**own[a], **own[b]}}
            weight = BESIDE_HELD if beside[a] or beside[b] else VARIATION
            if len(self.stiff):  # as much as the softer one would ask: it may curve on where the other cannot
                weight *= np.divide(*sorted(s[0, 0] for s in self.in_line(a, q)))
            out.append((a, 0.0, weight * (self.area[a] + self.area[b]) / 3, difference))
        return out

    def _asked(self, t: int) -> tuple[int, float]:
        return int(self.loose[t].sum()), float(np.trace(self.stiff[t])) if len(self.stiff) else 0.0

    def _relaxed_alike(self, a: int, b: int, q: int) -> bool:
        """Whether what borders leave open in the curvature of triangle b they leave open in that of a as well."""
        known, turned = voigt(self.outward[a][self.loose[a]]), self.turned(a, q)
        return all(
            np.any(np.abs(known - v).max(axis=1, initial=0.0) < 1e-6)
            for v in voigt(self.outward[b][self.loose[b]]) @ np.linalg.inv(turned).T
        )

    def share(self, q: int) -> dict[int, float]:
        """Coefficients of the hinge angles that make up the turn of the edge against its left triangle."""
        a, ka = self.pairs[q][0]
        goal = self.unit[a, ka]
        frames, rings, ring = {a: np.eye(3)}, {}, [a]
        b = self.across(a, q, frames)
        ring.append(b)
        out: dict[int, float] = {}
        for depth in range(RINGS):
            ahead = []
            for t in ring:
                for f in self.hinges[t]:
                    other = self.across(t, f, frames)
                    if f not in rings:
                        rings[f] = depth
                        if other not in ring and not self.held[other]:
                            ahead.append(other)
            found = list(rings)
            rows = np.array([self._turn(f, frames) for f in found]).T
            weight = np.array([OUTER ** (2 * rings[f]) for f in found])
            start = np.zeros(len(found))
            across = voigt(_normal(self.edge[a, ka]))
            start[found.index(q)] = (goal @ across) / (rows[:, found.index(q)] @ across)
            square = (rows * weight) @ rows.T
            size = np.linalg.eigvalsh(square)
            change = weight * (rows.T @ np.linalg.pinv(square, 1e-9, True) @ (goal - rows @ start))
            out = dict(zip(found, (start + change).tolist(), strict=True))
            if size[0] > size[-1] / CONDITION or not ahead:
                break
            ring = ahead
        return {f: c for f, c in out.items() if abs(c) > 1e-12}

    def _turn(self, f: int, frames: dict[int, np.ndarray]) -> np.ndarray:
        """Angle of a hinge for each unit component of the curvature in the first triangle's axes."""
        turns = [self.unit[t, k] @ frames[t] for t, k in self.pairs[f] if not self.held[t]]
        return np.sum(turns, axis=0)

    def across(self, t: int, f: int, frames: dict[int, np.ndarray]) -> int:
        """The triangle on the other side of a hinge; adds its frame, which turns curvatures into its axes and state."""
        other = self.sides(t, f)[1][0]
        if other not in frames:
            frames[other] = self.turned(t, f) @ frames[t]
            if len(self.stiff):
                frames[other] = self.jump(t, f) @ frames[other]
        return other

    def sides(self, t: int, f: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Triangle and edge on this side of a hinge, and on the other one."""
        one, other = self.pairs[f]
        return (one, other) if t == one[0] else (other, one)

    def turned(self, t: int, f: int) -> np.ndarray:
        """Curvature components [3, 3] in the axes of the triangle on the other side of a hinge."""
        (a, ka), (b, kb) = self.sides(t, f)
        own, its = self.edge[a, ka], -self.edge[b, kb]
        return _rotation(np.arctan2(its[1], its[0]) - np.arctan2(own[1], own[0]))

    def in_line(self, t: int, f: int) -> list[np.ndarray]:
        """Bending stiffness [3, 3] across and along a hinge, on this side of it and on the other one."""
        back = [(c, np.linalg.inv(_axes(self.outward[c, k]))) for c, k in self.sides(t, f)]
        return [b.T @ self.stiff[c] @ b for c, b in back]

    def jump(self, t: int, f: int) -> np.ndarray:
        """Curvature [3, 3] on the other side of a hinge, of that which the sheet would have there if it went on alike.

        Along their line the curvature and the twist of both sides are the same, across it their moments.
        """
        b, kb = self.sides(t, f)[1]
        one, other = (s[0] for s in self.in_line(t, f))
        if np.allclose(one, other, rtol=1e-9, atol=1e-9 * other[0]):  # what rounding makes of one material
            return np.eye(3)
        step = np.eye(3)
        step[0] = one / other[0]
        step[0, 1:] -= other[1:] / other[0]
        axes = _axes(self.outward[b, kb])
        return np.linalg.inv(axes) @ step @ axes


def _axes(normal: np.ndarray) -> np.ndarray:
    """Curvature components [3, 3] across and along a line, and twice their twist, of those in the triangle's axes."""
    c, s = normal
    return np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])


def _normal(edge: np.ndarray) -> np.ndarray:
    return np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)


def _rotation(angle: float) -> np.ndarray:
    """Curvature components [3, 3] seen from axes in which vectors appear turned by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, -c * s], [s * s, c * c, c * s], [2 * c * s, -2 * c * s, c * c - s * s]])
