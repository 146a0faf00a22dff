"""Rigid panels joined by creases: a tree of hinges in which a device's motion has few coordinates.

The simulator knows only nodes. To start it where a recording starts, and to ask which moment a recorded motion needs at
which crease, panels are taken as rigid here: a spanning tree of panels, the fold angles of its creases and, where no
panel is held, the pose of the root.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from origami_sim.errors import InputError, nearest
from origami_sim.model.model import Model, beside, carried_sides, dihedral_angles
from origami_sim.model.motions import possible
from origami_sim.model.vectors import cross
from origami_sim.quantities import converted


@dataclass(frozen=True)
class Pose:
    """Configurations of W worlds.

    Attributes:
        rotation: [W, 3, 3] of the root panel. centre: [W, 3] where the root's reference centre is [m].
        angles: [J, W] fold angles of the tree's creases [rad].
    """

    rotation: np.ndarray
    centre: np.ndarray
    angles: np.ndarray

    @property
    def worlds(self) -> int:
        return self.angles.shape[1]

    def select(self, worlds) -> "Pose":
        return Pose(self.rotation[worlds], self.centre[worlds], self.angles[:, worlds])


class Articulation:
    """The tree of a model.

    Attributes:
        creases: (J,) creases of the tree, from the root outwards.
        motions: [r, 6] shifts and turns of the root along the axes for unit coordinates, which come first: six where
            nothing holds it, three where it moves in a plane, none where it is held.
        size: number of coordinates m.
        open: creases outside the tree, which close loops.
        sides: panels left and right of each crease; None: none.
    """

    def __init__(self, model: Model):
        self.model = model
        x, panels = model.position, model.triangle_panel
        nodes = [np.unique(model.triangles[panels == p]) for p in range(int(panels.max(initial=-1)) + 1)]
        nodes = nodes or [np.arange(len(x))]  # without panels it is one body
        held = ~np.any(model.free, axis=1)
        fixed = [p for p, n in enumerate(nodes) if len(n) and np.all(held[n])]
        root = fixed[0] if fixed else int(np.argmax([len(n) for n in nodes])) if nodes else 0
        if not fixed and np.any(held):  # held by single nodes: the panel that holds most of them
            root = int(np.argmax([held[n].sum() for n in nodes]))
        self.motions = np.eye(6)[[] if np.any(held) else _free_axes(x[nodes[root]], model.free[nodes[root]] == 0.0)]
        sides = self._sides(model)
        reached, order, queue = {root}, [], deque([root])
        while queue:
            parent = queue.popleft()
            for c, (left, right) in enumerate(sides):
                for child, here, sign in ((left, right, 1.0), (right, left, -1.0)):
                    if here == parent and child is not None and child not in reached:
                        reached.add(child)
                        order.append((c, parent, child, sign))
                        queue.append(child)
        self.root, self._joints, self._nodes, self.sides = root, order, nodes, sides
        self.creases = np.array([c for c, *_ in order], int)
        self.open = np.setdiff1d(np.arange(len(model.creases)), self.creases)
        self._rest = dihedral_angles(x[:, None], model.creases)[:, 0]
        self._centre = x[nodes[root]].mean(0) if nodes else x.mean(0)
        owner = np.full(len(x), -1)
        for p in [root, *(child for _, _, child, _ in order)]:
            fresh = nodes[p][owner[nodes[p]] < 0]
            owner[fresh] = p
        owner[owner < 0] = root
        if len(model.carriers):
            owner[-len(model.carriers) :] = model.carriers
        self._owner = owner
        parents = {child: parent for _, parent, child, _ in order}
        below: list[set[int]] = [{child} for _, _, child, _ in order]
        for _, _, child, _ in order:
            p = child
            while p in parents:
                p = parents[p]
                for joint, members in enumerate(below):
                    if order[joint][2] == p:
                        members.add(child)
        self._below = below
        self._carried = [np.isin(owner, list(members)) for members in below]
        self._owned = {p: np.flatnonzero(owner == p) for p in self.order}
        axes = [x[k] - x[j] for _, j, k, _ in model.creases[self.creases].tolist()]
        crossed = [np.cross(np.eye(3), axis / np.linalg.norm(axis)) for axis in axes]
        self._crossed = [(k, k @ k) for k in crossed]  # what crosses the axis with a vector, once and twice

    @property
    def order(self) -> list[int]:
        """Panels from the root outwards."""
        return [self.root, *(child for _, _, child, _ in self._joints)]

    @property
    def joints(self) -> list[tuple[int, int, int, float]]:
        """(crease, panel towards the root, panel beyond, sign of the crease's angle) of each joint."""
        return self._joints

    @property
    def owner(self) -> np.ndarray:
        """[N] panel that carries each node."""
        return self._owner

    @staticmethod
    def _sides(model: Model) -> list[tuple[int | None, int | None]]:
        """Panels left and right of each crease, on the side of l and on the side of i."""
        if len(carried := carried_sides(model)):
            return list(map(tuple, carried.tolist()))
        panels = [*model.triangle_panel.tolist(), None]  # -1: none
        return [(panels[left], panels[right]) for left, right in beside(model.triangles, model.creases).tolist()]

    @property
    def floating(self) -> bool:
        """Whether the root can move."""
        return len(self.motions) > 0

    @property
    def shifts(self) -> int:
        """Number of coordinates that shift the root; those that turn it follow."""
        return int(np.any(self.motions[:, :3], axis=1).sum())

    @property
    def size(self) -> int:
        return len(self.motions) + len(self.creases)

    def names(self) -> list[str]:
        """Names of the coordinates."""
        each = np.array([f"{k} {a}" for k in ("shift", "turn") for a in "xyz"])
        root = each[np.argmax(self.motions, axis=1)].tolist()
        return root + [self.model.name("crease", int(c)) for c in self.creases]

    def reference(self, worlds: int = 1) -> Pose:
        """The reference state."""
        return Pose(
            np.tile(np.eye(3), (worlds, 1, 1)),
            np.tile(self._centre, (worlds, 1)),
            np.tile(self._rest[self.creases][:, None], worlds),
        )

    def moved(self, pose: Pose, by: np.ndarray) -> Pose:
        """The pose after a small displacement [m, W] of the coordinates."""
        r = len(self.motions)
        if not r:
            return replace(pose, angles=pose.angles + by)
        root = by[:r].T @ self.motions
        turn = Rotation.from_rotvec(root[:, 3:]).as_matrix()
        return Pose(turn @ pose.rotation, pose.centre + root[:, :3], pose.angles + by[r:])

    def shift_between(self, base: Pose, pose: Pose) -> np.ndarray:
        """Small displacement [m, W] of the coordinates from one pose to another; folds change by less than a turn."""
        angles = turned_by(pose.angles - base.angles)
        if not self.floating:
            return angles
        turn = Rotation.from_matrix(pose.rotation @ np.swapaxes(base.rotation, 1, 2)).as_rotvec()
        root = np.concatenate([pose.centre - base.centre, turn], axis=1)
        return np.concatenate([self.motions @ root.T, angles])

    def positions(self, pose: Pose) -> np.ndarray:
        """Node positions [N, W, 3] [m]."""
        x = self.model.position
        turns = {self.root: pose.rotation}
        shifts = {self.root: pose.centre - pose.rotation @ self._centre}
        for joint, (c, parent, child, sign) in enumerate(self._joints):
            pivot, (once, twice) = x[self.model.creases[c, 1]], self._crossed[joint]
            angle = (sign * (pose.angles[joint] - self._rest[c]))[:, None, None]
            turn = np.eye(3) + np.sin(angle) * once + 2.0 * np.sin(0.5 * angle) ** 2 * twice  # Rodrigues 1840
            turns[child] = turns[parent] @ turn
            shifts[child] = turns[parent] @ pivot + shifts[parent] - turns[child] @ pivot
        out = np.empty((len(x), pose.worlds, 3))
        for panel, turn in turns.items():
            mine = self._owned[panel]  # all worlds in one product
            turned = (turn.reshape(-1, 3) @ x[mine].T).reshape(len(turn), 3, len(mine))
            out[mine] = turned.transpose(2, 0, 1) + shifts[panel]
        return out

    def poses_of(self, x: np.ndarray, angles: np.ndarray) -> Pose:
        """The poses of panels at positions x [N, W, 3] [m] of rigid panels, with fold angles of all creases [C, W]."""
        mine = self._nodes[self.root]
        middle, worlds = x[mine].mean(axis=0), x.shape[1]
        turn = np.tile(np.eye(3), (worlds, 1, 1))
        if self.floating:
            spread = np.einsum("nwa,nb->wab", x[mine] - middle, self.model.position[mine] - self._centre)
            u, _, vt = np.linalg.svd(spread)  # Kabsch 1976
            u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
            turn = u @ vt
        return Pose(turn, middle, np.asarray(angles, float)[self.creases])

    def rates_of(self, pose: Pose, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Rates [m, W] of the coordinates that give nodes at x [N, W, 3] [m] the velocities v [N, W, 3] [m/s]."""
        corners = len(x) - len(self.model.carriers)  # mass points go along
        by = np.moveaxis(self.jacobian(pose, x)[:, :corners], 2, 0).reshape(x.shape[1], self.size, -1)
        right = by @ np.moveaxis(v[:corners], 1, 0).reshape(x.shape[1], -1, 1)
        return np.linalg.solve(by @ np.swapaxes(by, 1, 2), right)[:, :, 0].T

    def jacobian(self, pose: Pose, x: np.ndarray | None = None) -> np.ndarray:
        """Velocities of the nodes for unit rates of the coordinates, [m, N, W, 3]."""
        x = self.positions(pose) if x is None else x
        out = np.zeros((self.size, *x.shape))
        first = len(self.motions)
        for k, along in enumerate(self.motions):
            out[k] = along[:3] + cross(along[3:], x - pose.centre)
        for joint, (c, _, _, sign) in enumerate(self._joints):
            carried = self._carried[joint]
            out[first + joint, carried] = cross(self._axis(x, c, sign), x[carried] - x[self.model.creases[c, 1]])
        return out

    def sought(self, shown: np.ndarray) -> np.ndarray:
        """Projector [..., m, m] on the directions in which a pose is sought, given where the search begins.

        These are all folds, and of shifts and turns those that stand out of noise there: seen from the side, a device
        cannot be told to roll, but once rolled a little, rolling further would explain any error of its length.

        Args:
            shown: [..., D, m] what changes of the coordinates by 1 m and 1 rad show, in deviations of noise.
        """
        out = np.zeros((*shown.shape[:-2], self.size, self.size)) + np.eye(self.size)
        rigid = len(self.motions)
        if rigid:
            _, size, along = np.linalg.svd(shown[..., :rigid], full_matrices=False)
            along = along * (size > 1.0)[..., None]
            out[..., :rigid, :rigid] = np.swapaxes(along, -1, -2) @ along
        return out

    def inverse(self, shown: np.ndarray, sought: np.ndarray, rounding: float) -> np.ndarray:
        """Pseudo-inverse [..., m, D] of `shown` in the directions that are sought, less those of rounding's size."""
        return sought @ np.linalg.pinv(shown @ sought, rcond=rounding)

    def turning(self, x: np.ndarray) -> dict[int, np.ndarray]:
        """Angular velocities of the panels that creases move for unit rates of the coordinates, each [m, W, 3]."""
        out = {child: np.zeros((self.size, *x.shape[1:])) for _, _, child, _ in self._joints}
        first = self.size - len(self.creases)
        for p, turns in out.items():
            turns[:first] = self.motions[:, None, 3:]
            for joint, (c, _, _, sign) in enumerate(self._joints):
                if p in self._below[joint]:
                    turns[first + joint] = self._axis(x, c, sign)
        return out

    @property
    def outer(self) -> dict[int, tuple[np.ndarray, int]]:
        """Of each panel that a crease moves, its nodes and that crease's coordinate."""
        first = self.size - len(self.creases)
        return {child: (self._nodes[child], first + n) for n, (_, _, child, _) in enumerate(self._joints)}

    def _axis(self, x: np.ndarray, crease: int, sign: float) -> np.ndarray:
        """(W, 3) about which the outer panel turns when the fold grows."""
        _, j, k, _ = self.model.creases[crease]
        axis = x[k] - x[j]
        return sign * axis / np.linalg.norm(axis, axis=-1, keepdims=True)


def folded(model: Model, angles: Mapping[str | int, float | str]) -> np.ndarray:
    """Positions [N, 3] [m] at which creases have fold angles by name or number, as `State.folded` takes them.

    Raises:
        InputError: what `State.folded` refuses.
    """
    arm = Articulation(model)
    if len(arm.open):
        raise InputError(
            "creases that close loops have no free angles",
            field="angles",
            value=", ".join(model.name("crease", int(c)) for c in arm.open),
            allowed="positions of a shape that closes: State.at_rest(model, position=x), such as x of an equilibrium",
        )
    pose, names = arm.reference(), [model.name("crease", int(c)) for c in arm.creases]
    for crease, angle in angles.items():
        mine = [n for n, c in enumerate(arm.creases) if crease in (int(c), names[n])]
        if not mine:
            known = ", ".join(dict.fromkeys(names)) + nearest(str(crease), names)
            raise InputError("there is no such crease", field="angles", value=crease, allowed=known)
        value = float(converted(angle, "rad", f"angles.{crease}"))
        if not abs(value) <= np.pi:
            raise InputError("beyond half a turn", field=f"angles.{crease}", value=angle, allowed="-180 deg to 180 deg")
        pose.angles[mine] = value
    return arm.positions(pose)[:, 0]


def turned_by(angles: np.ndarray) -> np.ndarray:
    """Differences of angles by less than a turn."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def _free_axes(x: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Of shifts, then turns along the axes, those that a panel at x [n, 3] can make; no node of it is held all round.

    All six where what it can make are no motions along the axes.

    Args:
        held: [n, 3] along which axes each node is held.
    """
    centre, size = x.mean(axis=0), float(np.ptp(x, axis=0).max(initial=0.0)) or 1.0
    basis = possible((x - centre) / size, held)
    share = basis.T @ basis
    aligned = np.allclose(share, np.diag(np.diag(share) > 0.5), atol=1e-9)
    return np.flatnonzero(np.roll(np.diag(share), 3) > 0.5) if aligned else np.arange(6)
