"""The tree of rigid panels: how the root may move, which bodies joints carry, and which loops are to be closed."""

from functools import cached_property

import numpy as np

from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.model.articulation import Articulation
from origami_sim.model.motions import FARTHER, possible, screw

REDUNDANT = 1e-7
"""Part of the largest singular value of the loops' Jacobian below which a constraint repeats others: the flat state of
a sheet has such constraints, and so has every symmetric one; above by 10^4 where measured on folded sheets."""

NAMED = 3
"""Panels that a sentence names; more are counted."""


class Topology:
    """Tree of a model's panels: bodies, joints, how the root may move, and the loops to be closed.

    Attributes:
        parent: [B] body towards the root, bodies numbered outwards. body_of: [N]. joint_of: [C], -1 closes a loop.
        joints: (crease, sign of its angle) of each joint.
        turns, shifts, pivots: [d, 3] of the rates of the root. follows: whether it turns about its own centre.
        floating: whether nothing holds it; shifts of what is held are in metres.
        root_nodes: nodes of the root. row_node, row_body, row_axis: constraints, see `kernels.tree.Tree`.
    """

    def __init__(self, model: Model, gripped: bool = False):
        """Of a model whose grips move if it is `gripped`: then every held axis is a constraint."""
        arm = Articulation(model)
        panels = arm.order
        apart = sorted(set(range(max(model.panel_count, 1))) - set(panels))
        if apart:
            names, more = [model.name("panel", p) for p in apart[:NAMED]], len(apart) - NAMED
            raise InputError(
                "rigid panels have to be joined by creases",
                field="panels",
                value=", ".join(names) + (f" and {more} more" if more > 0 else ""),
                allowed="one connected sheet, in which faces that meet at a flat ('F') edge are one face; or "
                "panels='elastic'",
            )
        body = {p: b for b, p in enumerate(panels)}
        self._creases = model.creases
        self.parent = np.array([-1, *(body[p] for _, p, _, _ in arm.joints)], np.int32)
        self.joints = [(int(c), sign) for c, _, _, sign in arm.joints]
        owner = arm.owner
        self.body_of = np.array([body[p] for p in owner], np.int32)
        self.joint_of = np.full(len(model.creases), -1, np.int32)
        for j, (c, _) in enumerate(self.joints):
            self.joint_of[c] = j
        self._beyond = [np.array([b]) for b in range(len(panels))]
        for b in range(len(panels) - 1, 0, -1):
            self._beyond[self.parent[b]] = np.concatenate([self._beyond[self.parent[b]], self._beyond[b]])
        self._carried_by = [np.isin(self.body_of, self._beyond[j + 1]) for j in range(len(self.joints))]
        self.root_nodes = np.flatnonzero(self.body_of == 0)
        self.floating = not np.any(model.free[self.root_nodes] == 0.0)
        self.turns, self.shifts, self.pivots, self.follows = self._root(model)
        self.row_node, self.row_body, self.row_axis = self._loops(model, arm, body, gripped)
        self._free, self._grips = model.free, model.grips
        if gripped:
            _ = self.in_grips  # refuses what does not fit

    @cached_property
    def in_grips(self) -> tuple[int, np.ndarray]:
        """The grip of the root, -1 where it stands; that of each constraint [R], -1 to the ground, -2 between panels.

        Raises:
            InputError: a panel that a grip holds only in part, or beside a support that stands still.
        """
        nodes = self.root_nodes[np.any(self._free[self.root_nodes] == 0.0, axis=1)]
        mine = np.unique(self._grips[nodes])
        if len(mine) > 1 or (len(mine) and mine[0] >= 0 and len(self.turns)):
            raise InputError(
                "a rigid panel in a grip is held by it alone, and as a whole",
                field="grip",
                value=f"nodes {nodes.tolist()}",
                allowed="Sheet.grip(name, panels=[...]), or panels='elastic'",
            )
        rows = np.where(self.row_body[:, 1] >= 0, -2, self._grips[self.row_node]) if len(self.row_node) else np.zeros(0)
        return (int(mine[0]) if len(mine) else -1), rows.astype(np.int32)

    def beyond(self, body: int) -> np.ndarray:
        """A body and all that it carries."""
        return self._beyond[body]

    def positions(self, start: np.ndarray, q: np.ndarray, points=None, bodies=None) -> tuple[np.ndarray, np.ndarray]:
        """Nodes [N, W, 3] [m], and their velocities for unit rates [m, N, W, 3], of coordinates q [m, W].

        Coordinates are zero at `start` [N, 3], or [N, W, 3] of each world: shifts (in units of the device's size, if it
        floats) and turns of the root, then changes of fold angles [rad]. In place of the nodes, other `points` [N, 3]
        that `bodies` [N] carry (-1: none).
        """
        begin = start if start.ndim == 3 else start[:, None]
        own = points is None or bodies is None
        points, bodies = (begin, self.body_of) if own else (np.asarray(points)[:, None], np.asarray(bodies))
        turns, places, axes, joints, shift = self._placed(begin, q)
        w = q.shape[1]
        turns.append(np.tile(np.eye(3), (w, 1, 1)))  # of what no body carries
        places.append(np.zeros((w, 3)))
        x = _carried(points, bodies, turns, places)
        roots, centre, twists = len(self.turns), begin[self.root_nodes].mean(axis=0), self._twists(begin)
        by = np.zeros((roots + len(self.joints), *x.shape))
        for k in range(roots):
            by[k] = twists[:, k, 3:] + np.cross(self.turns[k], x - (shift if self.follows else centre))
            by[k, bodies < 0] = 0.0
        for j in range(len(self.joints)):
            mine = np.isin(bodies, self.beyond(j + 1))
            by[roots + j, mine] = np.cross(axes[j], x[mine] - joints[j])
        return x, by

    def moved(self, start: np.ndarray, q: np.ndarray) -> np.ndarray:
        """The nodes of `positions` alone."""
        begin = start if start.ndim == 3 else start[:, None]
        turns, places, *_ = self._placed(begin, q)
        return _carried(begin, self.body_of, turns, places)

    def rates(self, x: np.ndarray) -> np.ndarray:
        """Velocities of the nodes for unit rates of the coordinates [m, N, W, 3] at positions [N, W, 3]."""
        roots = len(self.turns)
        by = np.zeros((roots + len(self.joints), *x.shape))
        if roots:
            centre, twists = x[self.root_nodes].mean(axis=0), self._twists(x)
            for k in range(roots):
                by[k] = twists[:, k, 3:] + np.cross(self.turns[k], x - centre)
        for j, (c, sign) in enumerate(self.joints):
            first = x[self._creases[c, 1]]
            along = x[self._creases[c, 2]] - first
            axis = along * (sign / np.sqrt(np.einsum("wa,wa->w", along, along)))[:, None]
            mine = self._carried_by[j]
            by[roots + j, mine] = np.einsum("wab,nwb->nwa", _skew(axis), x[mine] - first)
        return by

    def _placed(self, begin: np.ndarray, q: np.ndarray):
        """Turns [W, 3, 3] and places [W, 3] of the bodies, axes and places of the joints, and the root's centre."""
        w, roots = q.shape[1], len(self.turns)
        centre = begin[self.root_nodes].mean(axis=0)
        turn, shift = np.tile(np.eye(3), (w, 1, 1)), np.tile(centre, (w // len(centre), 1))
        if roots:
            twists = np.broadcast_to(self._twists(begin), (w, roots, 6))
            of = np.einsum("kw,wka->wa", q[:roots], twists)
            turn, along = screw(of[:, :3])
            shift = shift + np.einsum("wab,wb->wa", along, of[:, 3:])
        turns, places, axes, joints = [turn], [shift - _turned(turn, centre)], [], []
        for j, (c, sign) in enumerate(self.joints):
            first, last = begin[self._creases[c, 1]], begin[self._creases[c, 2]]
            along, p = sign * (last - first), self.parent[j + 1]
            axis = along / np.sqrt(np.einsum("wa,wa->w", along, along))[:, None]
            axes.append(_turned(turns[p], axis))
            joints.append(_turned(turns[p], first) + places[p])
            angle, k = q[roots + j][:, None, None], _skew(axis)
            turns.append(turns[p] @ (np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)))
            places.append(joints[-1] - _turned(turns[-1], first))
        return turns, places, axes, joints, shift

    def twists(self, start: np.ndarray) -> np.ndarray:
        """[d, 6] turn, and velocity of the root's centre at `start` [N, 3] [m], for unit rates of the root."""
        return self._twists(start[:, None])[0]

    def _twists(self, begin: np.ndarray) -> np.ndarray:
        """The same of worlds that begin at [N, W, 3]: [W, d, 6]."""
        count = begin.shape[1]
        moves = np.tile(self.shifts * (_size(begin) if self.floating else 1.0), (count, 1, 1))
        if not self.follows:
            centre = begin[self.root_nodes].mean(axis=0)
            moves = moves + np.cross(self.turns, centre[:, None] - self.pivots)
        return np.concatenate([np.tile(self.turns, (count, 1, 1)), moves], axis=2)

    def closures(
        self, start: np.ndarray, q: np.ndarray, aims: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gaps [R, W] [m] by which loops are open at coordinates q [m, W], and their derivatives [m, R, W].

        Args:
            aims: [N, 3] where held nodes are to be, if not where they are at the start.
        """
        gap, slope = 0.0, 0.0
        for sign, bodies in zip((1.0, -1.0), self.row_body.T, strict=True):
            x, by = self.positions(start, q, start[self.row_node], bodies)
            gap = gap + sign * np.einsum("rwa,ra->rw", x, self.row_axis)
            slope = slope + sign * np.einsum("mrwa,ra->mrw", by, self.row_axis)
        if aims is not None:
            off = np.einsum("ra,ra->r", (start - aims)[self.row_node], self.row_axis)
            gap = gap + np.where(self.row_body[:, 1] < 0, off, 0.0)[:, None]
        return np.asarray(gap), np.asarray(slope)

    def _root(self, model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """How the root can move with its nodes held as they are.

        The rigid motions that the held directions leave are found at the reference; they stay possible wherever the
        root goes if they form a group, that is if their commutators are among them.
        """
        nodes = self.root_nodes
        x, held = model.position[nodes], model.free[nodes] == 0.0
        centre = x.mean(axis=0)
        size = np.ptp(x, axis=0).max() or 1.0
        points = (x - centre) / size
        basis = possible(points, held)
        if not np.any(held):
            free = np.eye(6) if np.ptp(model.position, axis=0).max() > 0 else np.eye(6)[3:]  # a point does not turn
            return free[:, :3], free[:, 3:], np.tile(centre, (len(free), 1)), True
        if not len(basis):
            return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), False
        basis = _reduced(basis)
        turns, moves = basis[:, :3], basis[:, 3:]
        for a in range(len(basis)):
            for b in range(a):
                bracket = np.concatenate(
                    [np.cross(turns[a], turns[b]), np.cross(turns[a], moves[b]) - np.cross(turns[b], moves[a])]
                )
                if np.linalg.norm(bracket - basis.T @ np.linalg.lstsq(basis.T, bracket, rcond=None)[0]) > 1e-9:
                    raise InputError(
                        "a rigid panel is held at nodes that would have to slide",
                        field="free",
                        value=[int(n) for n in nodes[held.any(axis=1)]],
                        allowed="a panel that is free, held, or turns about a fixed line, point or normal of a plane",
                    )
        translations = basis[np.linalg.norm(turns, axis=1) < 1e-9, 3:]
        span = translations.T @ np.linalg.pinv(translations.T) if len(translations) else np.zeros((3, 3))
        # a turn may be taken about the centre wherever that is, if every shift of its pivot is a motion, too
        follows = all(np.allclose(span @ side, side, atol=1e-9) for t in turns for side in np.cross(t, np.eye(3)))
        if follows:
            kept = np.linalg.norm(turns, axis=1) > 1e-9
            moves = np.where(kept[:, None], moves - moves @ span.T, moves)
        return turns, moves * size, np.tile(centre, (len(basis), 1)), follows

    def _loops(self, model: Model, arm: Articulation, body: dict[int, int], gripped: bool):
        """Rows of the constraints: ends of creases that close loops, and held nodes of other panels than the root."""
        nodes, pairs, axes = [], [], []

        def add(node: int, one: int, other: int, directions):
            for a in directions:
                nodes.append(node)
                pairs.append((one, other))
                axes.append(np.eye(3)[a])

        for c in arm.open:
            left, right = arm.sides[c]
            if left is None or right is None or left == right:
                continue
            one, other = body[left], body[right]
            if self.parent[one] == other or self.parent[other] == one:
                joint = max(one, other) - 1
                if _on_line(model, int(c), self.joints[joint][0]):  # a further piece of the same fold line
                    self.joint_of[c] = joint
                    continue
            for n in model.creases[c, 1:3]:
                add(int(n), one, other, range(3))
        held = (model.free == 0.0) & (self.body_of != 0)[:, None]
        # what no motion of the tree violates, anywhere, such as a plane that all creases cross, needs no force
        violated = held if gripped else np.zeros_like(held)
        for angle in FARTHER * np.array([0.0, 1.0, -2.0]) if np.any(held) and not gripped else ():
            q = np.full((len(self.turns) + len(self.joints), 1), angle)
            _, by = self.positions(model.position, q)
            idle = np.abs(by[:, :, 0]).max(axis=0, initial=0.0) < 1e-9 * np.abs(by).max(initial=0.0)
            violated |= held & ~idle
        for n in np.flatnonzero(held.any(axis=1)):
            add(int(n), int(self.body_of[n]), -1, np.flatnonzero(violated[n]))
        return (
            np.array(nodes, np.int32),
            np.array(pairs, np.int32).reshape(-1, 2),
            np.array(axes, float).reshape(-1, 3),
        )


def _size(x: np.ndarray) -> float:
    """Size of a device at positions [N, W, 3], that of its first world [m]."""
    return float(np.ptp(x[:, 0], axis=0).max(initial=0.0)) or 1.0


def _skew(a: np.ndarray) -> np.ndarray:
    """Matrices [W, 3, 3] that cross vectors a [W, 3] with what they are applied to."""
    out = np.zeros((len(a), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = a[:, 0], a[:, 1], a[:, 2]
    out[:, 1, 2], out[:, 2, 0], out[:, 0, 1] = -a[:, 0], -a[:, 1], -a[:, 2]
    return out


def _turned(turn: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Vectors a [1 or W, 3] turned by matrices [W, 3, 3]."""
    return np.einsum("wab,wb->wa", turn, np.broadcast_to(a, (len(turn), 3)))


def _carried(points: np.ndarray, bodies: np.ndarray, turns, places) -> np.ndarray:
    """Where bodies [N] carry points [N, 1 or W, 3]: [N, W, 3]; the last of the turns is of what none carries."""
    w = len(turns[0])
    x = np.empty((len(points), w, 3))
    for b in np.unique(bodies):
        mine = bodies == b
        own = np.broadcast_to(points[mine], (int(mine.sum()), w, 3))
        x[mine] = np.einsum("wab,nwb->nwa", turns[b], own) + places[b]
    return x


def _reduced(basis: np.ndarray) -> np.ndarray:
    """Another basis [d, 6] of the same motions, with as many pure translations as there are."""
    _, s, vt = np.linalg.svd(basis[:, :3].T)
    rank = int(np.sum(s > 1e-9))
    return vt @ basis if rank else basis


def _on_line(model: Model, c: int, other: int) -> bool:
    """Whether two creases lie on one line in the reference state."""
    x = model.position
    a, b = x[model.creases[other, 1:3]]
    along = (b - a) / np.linalg.norm(b - a)
    away = np.cross(x[model.creases[c, 1:3]] - a, along)
    return bool(np.linalg.norm(away, axis=1).max() < 1e-9 * np.linalg.norm(b - a))


def mass_matrix(by: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Mass matrices [W, m, m] of nodes of mass (N,) [kg] with velocities [m, N, W, 3] for unit rates."""
    return np.einsum("mnwa,n,knwa->wmk", by, mass, by)


def check_inertia(model: Model, tree: Topology, x: np.ndarray, mass: np.ndarray) -> None:
    """Refuses a panel that turns without inertia.

    Args:
        x: [N, 3] positions [m]. mass: (N,) of the nodes [kg].

    Raises:
        InputError: names the panel.
    """
    by = tree.rates(x[:, None])[:, :, 0]
    heavy = np.einsum("mna,n,mna->m", by, mass, by)  # only its diagonal: this is asked of every world
    light = np.flatnonzero(heavy <= 1e-15 * heavy.max(initial=0.0))
    if len(light):
        k = int(light[0]) - len(tree.turns)
        where = f"beyond {model.name('crease', tree.joints[k][0])}" if k >= 0 else "of the first panel"
        raise InputError("a rigid panel needs mass and inertia", field="body", value=f"none {where}", allowed="> 0")
