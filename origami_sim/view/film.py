"""One world of a run as it is drawn: corners, colours, arrows, contact forces, where to look from."""

import hashlib
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import lsqr

from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.view.palette import COLOURS, LIGHT, nice

WALK = 3.0
"""Extent of all frames, in sizes of the device, beyond which the camera follows it."""


FOLDED = np.radians(20.0)
"""Fold angle from which a crease has its full colour; half as much flickers with small waves, twice as much hides
folds of devices that move little."""

BAND = 0.5
"""Share of the panel beside a crease that is drawn as electrode."""


class HasTrajectory(Protocol):
    """What a run read from disk offers."""

    @property
    def trajectory(self) -> Trajectory: ...


def trajectory_of(source: object) -> Trajectory:
    """The frames of a motion, of a run on disk, or of a path of equilibria.

    Raises:
        InputError: what has no frames.
    """
    found = source if isinstance(source, Trajectory) else getattr(source, "trajectory", None)
    if not isinstance(found, Trajectory):
        allowed = "a Trajectory of simulate() or quasistatic(), a Run of load_run(), a Path of continuation()"
        raise InputError("has no frames to be shown", field="source", value=type(source).__name__, allowed=allowed)
    return found


class Film:
    """The geometry and the numbers of one world, in the order in which they are drawn. Lengths [m], times [s]."""

    def __init__(
        self,
        trajectory: Trajectory,
        world: int = 0,
        magnets: Iterable[int] | None = None,
        arms: Iterable[int] = (),
        tip: int | None = None,
        title: str = "origami_sim",
    ):
        worlds = trajectory.x.shape[2]
        if not 0 <= world < worlds:
            raise InputError("there is no such world", field="world", value=world, allowed=f"0 to {worlds - 1}")
        self.trajectory, self.model, self.world, self.title = trajectory, trajectory.model, world, title
        self.times = np.asarray(trajectory.times, float)
        self.x = np.asarray(trajectory.x[:, :, world], float)
        if not np.all(np.isfinite(self.x)):  # a world that failed: keep what was sound
            sound = np.isfinite(self.x).all(axis=(1, 2))
            if not sound.any():
                raise InputError("no frame of this world has finite positions", field="world", value=world)
            self.x = self.x[np.maximum.accumulate(np.where(sound, np.arange(len(self.x)), sound.argmax()))]
        if tip is not None and not 0 <= tip < self.x.shape[1]:
            raise InputError("there is no such node", field="tip", value=tip, allowed=f"0 to {self.x.shape[1] - 1}")
        self.moments = self._moments()
        self.kinds = self._kinds(magnets, arms)
        self.tip = tip if tip is not None else self._tip()
        digest = hashlib.sha256(repr((title, self.model.hash, trajectory.parameters.hash, world)).encode())
        self.identity = digest.hexdigest()[:32]
        self.application = f"origami_sim {title}" if title != "origami_sim" else title
        self._bounds()

    # sizes ----------------------------------------------------------------------------------------------------------

    def _bounds(self):
        low, high = self.x.min(axis=(0, 1)), self.x.max(axis=(0, 1))
        frame = np.ptp(self.x, axis=1).max(axis=0)
        self.size = float(max(frame.max(), 1e-9))  # of the device
        self.low, self.high = low, high
        self.step = nice(0.25 * self.size)  # of the scale bar and the ground's grid
        self.across = 0 if high[0] - low[0] >= 0.8 * (high[1] - low[1]) else 1  # axis that lies across the view
        self.up, self.height = self.ground()

    def value(self, owner: str, name: str) -> np.ndarray:
        """Values [entity] of a parameter in this world."""
        p = self.trajectory.parameters[owner, name]
        return p[:, min(self.world, p.shape[1] - 1)]

    def ground(self) -> tuple[np.ndarray, float]:
        """Normal (3,) and height along it [m] of the ground."""
        tilt, azimuth, height = (float(self.value("plane", n)[0]) for n in ("tilt", "azimuth", "height"))
        s = np.sin(tilt)
        return np.array([-s * np.cos(azimuth), -s * np.sin(azimuth), np.cos(tilt)]), height

    def camera(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Direction to the right of the picture, camera position, point looked at, radius of what is to be seen [m]."""
        right = np.array([1.0, 0.0, 0.0]) if self.across == 0 else np.array([0.0, 1.0, 0.0])
        towards = np.array([0.45, -1.0, 0.55]) if self.across == 0 else np.array([1.0, 0.45, 0.55])
        towards /= np.linalg.norm(towards)
        radius = 0.5 * float(np.linalg.norm(self.high - self.low)) + 0.2 * self.size
        target = (self.low + self.high) / 2
        return right, target + 1.9 * radius * towards, target, radius

    def field_origin(self) -> np.ndarray:
        """Where the arrow of the field begins (3,) [m]: beside all frames."""
        right, _, _, _ = self.camera()
        centre = (self.low + self.high) / 2
        return centre - right * (0.5 * abs((self.high - self.low) @ right) + 0.35 * self.size)

    # panels -----------------------------------------------------------------------------------------------------------

    def _moments(self) -> np.ndarray:
        """[F, T, 3] remanence times volume [T m^3] of each triangle, along its poling."""
        corners = self.x[:, self.model.triangles]
        out = np.zeros((*corners.shape[:2], 3))
        edge_1, edge_2 = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
        for name in self.model.effects:
            known = {p.name for p in get(name).parameters}
            if get(name).family != "triangle" or not {"remanence", "volume", "poling_1", "poling_2"} <= known:
                continue
            a, b = self.value(name, "poling_1"), self.value(name, "poling_2")
            c = self.value(name, "poling_n") if "poling_n" in known else np.zeros_like(a)
            d = a[:, None] * edge_1 + b[:, None] * edge_2
            if "poling_n" in known:  # rotation only: the in-plane part keeps its share
                d = unit(d) * np.sqrt(np.maximum(1 - c**2, 0))[:, None]
            d = d + c[:, None] * unit(np.cross(edge_1, edge_2))
            out += (self.value(name, "remanence") * self.value(name, "volume"))[:, None] * d
        return out

    def _kinds(self, magnets: Iterable[int] | None, arms: Iterable[int]) -> list[str]:
        """[T] kind of each triangle, a key of COLOURS."""
        panels = self.model.triangle_panel
        kinds = np.full(len(panels), "passive", dtype=object)
        last = int(panels.max(initial=-1))
        for name, given in (("arms", arms), ("magnets", magnets)):
            for p in given or ():
                if not 0 <= p <= last:
                    raise InputError("there is no such panel", field=name, value=p, allowed=f"0 to {last}")
                kinds[panels == p] = "arm" if name == "arms" else "magnet"
        if magnets is None:
            kinds[np.abs(self.moments[0]).sum(-1) > 0] = "magnet"
        return kinds.tolist()

    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [F, 3T, 3] and shaded colours [F, 3T, 3] (0 to 255): every triangle has its own corners, and its
        brightness follows the angle between its normal and the light, the same on both sides."""
        corners = self.x[:, self.model.triangles]
        normal = unit(np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]))
        brightness = 0.58 + 0.42 * np.abs(normal @ (LIGHT / np.linalg.norm(LIGHT)))
        base = np.array([COLOURS[k] for k in self.kinds], float).reshape(-1, 3)
        colours = np.repeat((base * brightness[:, :, None]).round().astype(np.uint8), 3, axis=1)
        return corners.reshape(len(self.x), -1, 3), colours

    def outlines(self) -> np.ndarray:
        """[E, 2] nodes of the panels' edges that are no creases."""
        return outlines(self.model)

    def arrows(self) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Origins and vectors [F, 2P, 3] [m] of the poling on both faces of P magnetised panels, and names."""
        panels = self.model.triangle_panel
        magnetised = np.unique(panels[np.abs(self.moments[0]).sum(-1) > 0])
        corners = self.x[:, self.model.triangles]
        cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        area = 0.5 * np.linalg.norm(cross, axis=-1)
        origins, vectors, labels = [], [], []
        drawn: list[tuple[np.ndarray, np.ndarray]] = []
        for p in magnetised.tolist():
            t = panels == p
            weight = np.linalg.norm(self.moments[0, t], axis=-1)
            centre = np.einsum("t,fti->fi", weight / weight.sum(), corners[:, t].mean(axis=2))
            lift = 0.02 * self.size * unit(cross[:, t].sum(axis=1))  # off the face, or the face would hide it
            length = max(0.55 * np.sqrt(area[0, t].sum()), 0.1 * self.size)
            direction = unit(self.moments[:, t].sum(axis=1))
            if any(d @ direction[0] > 0.9 and np.linalg.norm(c - centre[0]) < 1.4 * length for c, d in drawn):
                continue  # a finely divided magnet: its neighbour's arrow tells
            drawn.append((centre[0], direction[0]))
            vector = length * direction
            for side in (1.0, -1.0):  # one arrow on each face, so that one shows from wherever one looks
                origins.append(centre + side * lift - 0.5 * vector)
                vectors.append(vector)
                labels.append(self.model.name("panel", p))
        empty = np.zeros((0, len(self.x), 3))
        return (
            np.moveaxis(np.array(origins).reshape(-1, *empty.shape[1:]), 0, 1),
            np.moveaxis(np.array(vectors).reshape(-1, *empty.shape[1:]), 0, 1),
            labels,
        )

    def folds(self) -> np.ndarray:
        """[F, C, 3] colours of the creases: mountains, valleys, and flat ones between them."""
        angle = self.trajectory.creases[:, :, self.world]
        share = np.clip(np.abs(np.nan_to_num(angle)) / FOLDED, 0.0, 1.0)[..., None]
        sides = np.where(angle[..., None] < 0, COLOURS["mountain"], COLOURS["valley"])
        return np.array(COLOURS["crease"]) + share * (sides - np.array(COLOURS["crease"], float))

    def electrode_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes [2E, 4] of the sides of panels along the E creases with a dielectric stack, and their creases [2E].

        The first two are the crease's, the others the corners of the panel after and before them.
        """
        m, stacked = self.model, np.zeros(len(self.model.creases), bool)
        for name in m.effects:
            if get(name).family == "crease" and {"layers", "width"} <= {p.name for p in get(name).parameters}:
                stacked |= (self.value(name, "layers") * self.value(name, "width")) > 0
        found, nodes = np.flatnonzero(stacked), []
        neighbours = _around(m) if len(found) else {}
        for reverse in (False, True):
            for c in found:
                j, k = m.creases[c, 1:3][:: -1 if reverse else 1].tolist()
                before, after = neighbours.get((j, k), (m.creases[c, 0 if reverse else 3],) * 2)
                nodes.append((j, k, after, before))
        return np.array(nodes, int).reshape(-1, 4), np.tile(found, 2)

    def electrodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [F, 2E, 4, 3] of bands on both sides of the creases with a dielectric stack; their creases [2E]."""
        nodes, creases = self.electrode_nodes()
        j, k, after, before = (self.x[:, nodes[:, c]] for c in range(4))
        return np.stack([j, k, k + BAND * (after - k), j + BAND * (before - j)], axis=2), creases

    def voltages(self) -> np.ndarray:
        """[F, C] voltage on the electrodes of each crease [V]."""
        groups = self.model.electrodes[: len(self.model.creases)]
        found = {g: self.channel(f"voltage_{g}") for g in set(groups.tolist()) if f"voltage_{g}" in self.channels()}
        nothing = np.zeros(len(self.times))
        return np.stack([found.get(g, nothing) for g in groups.tolist()] or [nothing], axis=1)[:, : len(groups)]

    def strains(self) -> np.ndarray:
        """[F, T] the principal strain (Green-Lagrange) of each triangle that is larger in size [-]."""
        t = self.model.triangles
        first, second = self.model.position[t[:, 1]], self.model.position[t[:, 2]]
        first, second = first - self.model.position[t[:, 0]], second - self.model.position[t[:, 0]]
        along = unit(first)
        across = unit(np.cross(np.cross(first, second), first))
        flat = np.stack(
            [np.stack([(e * a).sum(-1) for e in (first, second)], axis=-1) for a in (along, across)], axis=1
        )
        edges = np.stack([self.x[:, t[:, c]] - self.x[:, t[:, 0]] for c in (1, 2)], axis=-1)  # [F, T, 3, 2]
        gradient = edges @ np.linalg.inv(flat)
        green = 0.5 * (np.swapaxes(gradient, -1, -2) @ gradient - np.eye(2))
        principal = np.linalg.eigvalsh(green)
        return np.where(np.abs(principal[..., 0]) > np.abs(principal[..., 1]), principal[..., 0], principal[..., 1])

    def _tip(self) -> int:
        """The node that moves furthest from where it began."""
        return int(np.linalg.norm(self.x - self.x[0], axis=-1).max(axis=0).argmax())

    # drive and contacts ---------------------------------------------------------------------------------------------

    def channels(self) -> list[str]:
        """Names of the drive's channels."""
        return list(self.trajectory.drive.signals)

    def channel(self, name: str) -> np.ndarray:
        """[F] a drive channel in this world."""
        value = self.trajectory.drive[name](self.times[:, None])
        return np.broadcast_to(value, (len(self.times), max(value.shape[1], self.world + 1)))[:, self.world]

    def contact_arrows(self) -> tuple[np.ndarray, np.ndarray]:
        """Points [F, K, 3] [m] of the contacts and the forces there [F, K, 3] [N].

        The trajectory has forces by node; a force f on a point p = sum w_i x_i + o n of a triangle puts
        w_i f - o (g_i . f) n on its nodes (n the normal, g_i the gradients of the barycentric coordinates). This is
        solved for f, by least squares, over the points that are within reach of the ground.
        """
        m, forces = self.model, self.trajectory.contact_forces[:, :, self.world]
        corners = self.x[:, m.contacts]
        cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        normal, double_area = unit(cross), np.linalg.norm(cross, axis=-1)[:, :, None, None]
        opposite = np.roll(corners, -2, axis=2) - np.roll(corners, -1, axis=2)
        gradients = np.cross(normal[:, :, None], opposite) / double_area
        points = np.einsum("kc,fkci->fki", m.contact_weights, corners) + m.contact_offsets[:, None] * normal
        lever = m.contact_offsets[:, None, None, None] * normal[:, :, None, :, None] * gradients[:, :, :, None, :]
        blocks = m.contact_weights[:, :, None, None] * np.eye(3) - lever  # [F, K, 3 corners, 3, 3]
        touching = self.trajectory.gaps[:, :, self.world] <= self.value("plane", "reach")[0]
        out = np.zeros_like(points)
        for f in np.flatnonzero(touching.any(axis=1) & np.any(forces != 0, axis=(1, 2))):
            active = np.flatnonzero(touching[f])
            full = (len(active), 3, 3, 3)
            rows = np.broadcast_to(3 * m.contacts[active, :, None, None] + np.arange(3)[:, None], full)
            columns = np.broadcast_to(3 * np.arange(len(active))[:, None, None, None] + np.arange(3), full)
            matrix = coo_array(
                (blocks[f, active].ravel(), (rows.ravel(), columns.ravel())),
                shape=(3 * len(m.position), 3 * len(active)),
            )
            used = np.unique(rows)
            if len(active) <= 60:
                solved = np.linalg.lstsq(matrix.tocsr()[used].toarray(), forces[f].ravel()[used], rcond=1e-10)[0]
            else:
                solved = lsqr(matrix.tocsr(), forces[f].ravel(), atol=1e-8, btol=1e-8)[0]
            out[f, active] = solved.reshape(-1, 3)
        return points, out


def outlines(model: Model) -> np.ndarray:
    """[E, 2] nodes of the panels' edges that are no creases."""
    count: dict[tuple[int, int], dict[int, int]] = {}
    for panel, nodes in zip(model.triangle_panel.tolist(), model.triangles.tolist(), strict=True):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            edge = (min(nodes[a], nodes[b]), max(nodes[a], nodes[b]))
            sides = count.setdefault(edge, {})
            sides[panel] = sides.get(panel, 0) + 1
    creases = {(min(j, k), max(j, k)) for _, j, k, _ in model.creases.tolist()}
    edges = [e for e, sides in count.items() if 1 in sides.values() and e not in creases]
    return np.array(edges, int).reshape(-1, 2)


def _around(model: Model) -> dict[tuple[int, int], tuple[int, int]]:
    """For the directed sides (a, b) of every panel: the corner before a and the corner after b."""
    out = {}
    for p in range(model.panel_count):
        loops = model.triangles[model.triangle_panel == p].tolist()
        sides = {(t[i], t[(i + 1) % 3]) for t in loops for i in range(3)}
        border = [(a, b) for a, b in sides if (b, a) not in sides]
        following, leading = dict(border), {b: a for a, b in border}
        out |= {(a, b): (leading[a], following[b]) for a, b in border if a in leading and b in following}
    return out


def unit(v: np.ndarray) -> np.ndarray:
    """v / |v| along the last axis, zero where v is."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, length, out=np.zeros_like(v), where=length > 0)
