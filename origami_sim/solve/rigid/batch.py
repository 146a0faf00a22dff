"""Rollouts of rigid panels: hinge angles and the pose of the root in place of the nodes of bars."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import centred, eccentric
from origami_sim.solve.batch import _FIRST, Batch
from origami_sim.solve.kernels import articulated
from origami_sim.solve.kernels.runge_kutta import TABLEAU

TOLERANCE = 1e-10
"""Largest error of one step [rad], or part of the device's size; ten times less costs 1.6 times the steps."""

FINEST = 1e-7
"""Part of the asked step below which a world is given up as unstable, unless a batch's `finest` says another."""

FARTHER = 0.3
"""Part of a radian, and of the size, by which the root is moved to see what holds it: any angle that is not small."""

STABILISATION = 100.0
"""Rate at which an error of a closed loop decays [1/s]; a loop that is consistent at first only gathers rounding."""

SOFTNESS = 1e-10
"""Softness of loop constraints, relative to the mobility of their nodes: redundant ones share the load."""


class RigidBatch(Batch):
    """A batch of worlds with rigid panels, moved in reduced coordinates.

    Panels keep the shapes that they have in the state. Steps are of order five; within each of them, unless
    `tolerance` is 0, the solver takes as many as the error of the embedded formula asks for, world by world.

    Args:
        model: with `panels` "rigid" (see `bodies.rigid`). tolerance: error of one step [rad]; 0: steps as given.
        tree: the model's, if it is known. The rest as for `Batch`.

    Raises:
        InputError: panels that are not joined by creases, held in a way that is no rigid motion, without mass or
            inertia; loops that the model's creases cannot close.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        *,
        tolerance=TOLERANCE,
        tree: "Topology | None" = None,
        **options,
    ):
        self.tree_of = tree or Topology(model)
        if not len(self.tree_of.turns):  # the kernel leaves a root that is held as it is
            state = replace(state, v=np.where(self.tree_of.body_of[:, None, None] == 0, 0.0, state.v))
        self._eccentric = eccentric(model, parameters)
        if self._eccentric is not None:
            state = replace(state, x=state.x + self._eccentric(state.x))
            parameters = centred(model, parameters)
        super().__init__(model, parameters, drive, state, **options)
        self.tolerance, self.finest = tolerance, FINEST
        self._fresh = 1
        self._tree = self._made(state)

    def _made(self, state: State):
        """The tree on the device, its bodies shaped and placed as in a state."""
        t, model, w, x = self.tree_of, self.model, self.worlds, state.x
        joints, rates = len(t.joints), len(t.joints) + len(t.turns)
        tree = articulated.Tree()
        tree.bodies, tree.roots, tree.rates, tree.rows = len(t.parent), len(t.turns), rates, len(t.row_node)
        held = not len(t.turns)
        tree.first_body, tree.first_number = int(held), int(articulated.POSE) if held else 0
        tree.hinges, tree.memories = len(state.angles), len(state.memory)
        tree.feet_count, tree.effects = len(model.contacts), len(self.program.effects)
        tree.follows, tree.stabilisation, tree.softness = int(t.follows), STABILISATION, SOFTNESS

        def constant(a, dtype):
            return wp.array(np.ascontiguousarray(a), dtype=dtype, device=self.device)

        tree.parent, tree.body_of = constant(t.parent, wp.int32), constant(t.body_of, wp.int32)
        points = np.arange(len(t.body_of)) >= len(t.body_of) - len(model.carriers)  # after the corners
        order = np.lexsort((t.body_of, points))
        tree.moving = constant(order[t.body_of[order] >= tree.first_body].astype(np.int32), wp.int32)
        tree.corners = int(np.sum(~points & (t.body_of >= tree.first_body)))
        tree.joint_of = constant(t.joint_of, wp.int32)
        tree.axes = constant(np.concatenate([t.turns, t.shifts, t.pivots, t.row_axis]), wp.vec3d)
        tree.joined = constant(np.concatenate([t.row_node[:, None], t.row_body], axis=1), wp.int32)
        tree.tableau = constant(TABLEAU, wp.float64)
        tree.restarts = constant(np.zeros(0), wp.int32)
        tree.starts = tree.kept = constant(np.zeros((0, 1)), wp.float64)
        self._begun = state.angles[[c for c, _ in t.joints]]
        centre, mass, inertia = self._bodies(x, np.broadcast_to(self._mass, (len(x), w)))
        check_inertia(model, t, x[:, 0], np.broadcast_to(self._mass, (len(x), w))[:, 0])
        origin = x[t.root_nodes].mean(axis=0)
        axis, pivot = np.zeros((joints, w, 3)), np.zeros((joints, w, 3))
        for j, (c, sign) in enumerate(t.joints):
            along = x[model.creases[c, 2]] - x[model.creases[c, 1]]
            axis[j] = sign * along / np.linalg.norm(along, axis=-1, keepdims=True)
            pivot[j] = x[model.creases[c, 1]]
        y = np.zeros((7 + joints, w))
        y[:3], y[6] = origin.T, 1.0
        given = {
            "reference": x,
            "middle": origin[None],
            "axis": axis,
            "pivot": pivot,
            "start": state.angles[: len(model.creases)],
            "mass": mass,
            "centre": centre,
            "inertia": inertia,
            "y": y,
            "u": self._rates(state, origin, axis, pivot),
            "span": np.full((1, w), np.inf),
            "feet": contact_points(model, x),
        }
        sizes = {
            **dict.fromkeys(("turned", "second"), 9 * tree.bodies),
            **dict.fromkeys(("placed", "omega", "speed", "alpha", "gain", "force", "moment", "first"), 3 * tree.bodies),
            **dict.fromkeys(("hinge", "joint"), 3 * joints),
            **dict.fromkeys(("power0", "spent"), tree.effects),
            **dict.fromkeys(("jacobian", "solved"), tree.rows * rates),
            **{
                "steady": 12 * tree.bodies,
                "y0": 7 + joints,
                "u0": rates,
                "dy": 7 * (7 + joints),
                "du": 7 * rates,
                "torque": joints,
            },
            **{"angles0": tree.hinges, "memory0": tree.memories, "feet0": 3 * tree.feet_count},
            **{"heavy": tree.bodies, "factor": rates**2, "gram": tree.rows**2, "pull": tree.rows},
        }
        columns, place = [], 0
        for name in articulated.PARTS:
            setattr(tree, name, place)
            a = np.zeros((sizes[name], w)) if name in sizes else given[name]
            part = np.moveaxis(a, 1, 0).reshape(w, -1)
            columns.append(part)
            place += part.shape[1]
        tree.width = place + (-place) % 8 + 8  # a cache line of its own for each world
        data = np.zeros((w, tree.width))
        data[:, :place] = np.concatenate(columns, axis=1)
        tree.data = constant(data.ravel(), wp.float64)
        self.size = float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0
        return tree

    def _bodies(self, x: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Centres [B, W, 3], masses [B, W] and inertia tensors about the centres [B, W, 3, 3] of the bodies."""
        count, w = len(self.tree_of.parent), self.worlds
        centre, weight, inertia = np.zeros((count, w, 3)), np.zeros((count, w)), np.zeros((count, w, 3, 3))
        for b in range(count):
            mine = self.tree_of.body_of == b
            weight[b] = mass[mine].sum(axis=0)
            safe = np.where(weight[b] > 0, weight[b], 1.0)
            centre[b] = (mass[mine][:, :, None] * x[mine]).sum(axis=0) / safe[:, None]
            r = x[mine] - centre[b]
            spread = np.einsum("nw,nwa,nwb->wab", mass[mine], r, r)
            inertia[b] = np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(3) - spread
        return centre, weight, inertia

    def _rates(self, state: State, origin: np.ndarray, axis: np.ndarray, pivot: np.ndarray) -> np.ndarray:
        """Rates of the coordinates [m, W] that fit the velocities of a state best."""
        if not np.any(state.v):
            return np.zeros((len(self.tree_of.turns) + len(axis), self.worlds))
        corners = len(state.x) - len(self.model.carriers)  # mass points go along
        by = self.jacobian(state.x, origin, axis, pivot)[:, :corners]
        by = np.moveaxis(by, 2, 0).reshape(self.worlds, len(by), -1)  # [W, m, 3 N]
        right = by @ np.moveaxis(state.v[:corners], 1, 0).reshape(self.worlds, -1, 1)
        return np.linalg.solve(by @ np.swapaxes(by, 1, 2), right)[:, :, 0].T

    def jacobian(self, x: np.ndarray, origin: np.ndarray, axis: np.ndarray, pivot: np.ndarray) -> np.ndarray:
        """Velocities of the nodes for unit rates of the coordinates, [m, N, W, 3]."""
        t = self.tree_of
        out = np.zeros((len(t.turns) + len(axis), *x.shape))
        for k, (turn, shift, point) in enumerate(zip(t.turns, t.shifts, t.pivots, strict=True)):
            out[k] = shift + np.cross(turn, x - (origin if t.follows else point))
        for j in range(len(axis)):
            mine = np.isin(t.body_of, t.beyond(j + 1))
            out[len(t.turns) + j, mine] = np.cross(axis[j], x[mine] - pivot[j])
        return out

    def film_anew(
        self, frames: int, dt: float, when: Sequence[int], angles: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Films steps of dt [s], and moves on from elsewhere at the begin of some, with what laws remember.

        Args:
            when: (R,) of which, counted from 0. angles, rates: [R, J, W] of the joints then.

        Returns: positions [F, N, W, 3] [m] and hinge angles [F, C + Q, W] [rad], memory [R, M, W] there, and rates
            [R, J, W] before.

        Raises:
            InputError: panels that nothing holds.
        """
        if len(self.tree_of.turns):
            raise InputError(
                "only a sheet that is held can start anew", field="restart", allowed="a panel that is held"
            )
        tree, count = self._tree, len(when)
        starts = np.concatenate([angles - self._begun, rates], axis=1)
        tree.restarts = wp.array(np.asarray(when, np.int32), dtype=wp.int32, device=self.device)
        tree.starts = self._upload(starts.reshape(-1, self.worlds), wp.float64)
        rows = tree.memories + angles.shape[1]
        tree.kept = self._room(max(count * rows, 1), dtype=wp.float64)
        x, turned = self.film(frames, 1, dt, np.inf)
        kept = tree.kept.numpy()[: count * rows, : self.worlds].reshape(count, rows, self.worlds)
        tree.restarts = wp.zeros(0, dtype=wp.int32, device=self.device)
        return x, turned, kept[:, : tree.memories], kept[:, tree.memories :]

    def _run(self, steps: int, dt: float, speed_limit: float, every: int, film, angles, carried, notes=()):
        fixed = self.tolerance == 0.0
        self._launch(
            "rigid",
            [
                self._tree,
                self._f,
                self._work,
                self._power,
                self._status,
                _FIRST,
                max(self.step, 0),
                self._fresh,
                steps,
                wp.float64(dt),
                wp.float64(self.tolerance),
                wp.float64(self.size),
                wp.float64(0.0 if fixed else self.finest * dt),
                every,
                film,
                angles,
            ],
        )
        self._fresh = 0
        self.step = max(self.step, 0) + steps

    def carry(self, path: np.ndarray, dt: float, noted: Sequence[int] = ()) -> np.ndarray:
        """Refused: rigid panels that are carried along a path are held; see `batch_of`."""
        raise InputError("only held panels can be carried", field="carry", allowed="a model that is held everywhere")

    def state(self) -> State:
        """See `Batch.state`; mass points are where the model has them, whatever eccentric weights there are."""
        out = super().state()
        return out if self._eccentric is None else replace(out, x=out.x - self._eccentric(out.x))

    def place(self, x: np.ndarray, angles: np.ndarray, memory: np.ndarray | None = None):
        """See `Batch.place`: what asks for forces there needs no tree; to move on from there, make another batch."""
        super().place(x, angles, memory)


class Topology:
    """Tree of a model's panels: bodies, joints, how the root may move, and the loops to be closed.

    Attributes:
        parent: [B] body towards the root, bodies numbered outwards. body_of: [N]. joint_of: [C], -1 closes a loop.
        joints: (crease, sign of its angle) of each joint.
        turns, shifts, pivots: [d, 3] of the rates of the root. follows: whether it turns about its own centre.
        floating: whether nothing holds it; shifts of what is held are in metres.
        root_nodes: nodes of the root. row_node, row_body, row_axis: constraints, see `articulated.Tree`.
    """

    def __init__(self, model: Model):
        arm = Articulation(model)
        panels = arm.order
        apart = sorted(set(range(max(model.panel_count, 1))) - set(panels))
        if apart:
            raise InputError(
                "rigid panels have to be joined by creases",
                field="panels",
                value=", ".join(model.name("panel", p) for p in apart),
                allowed="one connected sheet, or panels='elastic'",
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
        self.row_node, self.row_body, self.row_axis = self._loops(model, arm, body)

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

    def closures(self, start: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaps [R, W] [m] by which loops are open at coordinates q [m, W], and their derivatives [m, R, W]."""
        gap, slope = 0.0, 0.0
        for sign, bodies in zip((1.0, -1.0), self.row_body.T, strict=True):
            x, by = self.positions(start, q, start[self.row_node], bodies)
            gap = gap + sign * np.einsum("rwa,ra->rw", x, self.row_axis)
            slope = slope + sign * np.einsum("mrwa,ra->mrw", by, self.row_axis)
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
        basis, found = _within(np.eye(6), points, held), 7
        while len(basis) < found:
            found = len(basis)
            # a flat sheet may begin a motion that it cannot go on with: ask again a little further along each
            for motion in basis:
                turn, along = screw(FARTHER * motion[None, :3])
                basis = _within(basis, points @ turn[0].T + FARTHER * along[0] @ motion[3:], held)
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

    def _loops(self, model: Model, arm: Articulation, body: dict[int, int]):
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
        violated = np.zeros_like(held)
        for angle in FARTHER * np.array([0.0, 1.0, -2.0]) if np.any(held) else ():
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


def screw(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations R [W, 3, 3] by rotation vectors [W, 3] [rad], and matrices V [W, 3, 3] that make screws of them.

    A velocity v that turns along for a unit of time shifts by V v: the exponential of a rigid motion (Murray, Li and
    Sastry 1994, A Mathematical Introduction to Robotic Manipulation, eq. 2.36).
    """
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    k = np.cross(np.eye(3), turn[:, None, :])
    sine, lift = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    small = angle < 1e-2  # where the difference of angle and sine is rounding
    rest = np.where(small, 1 / 6 - angle**2 / 120 + angle**4 / 5040, (1 - sine) / np.where(small, 1.0, angle) ** 2)
    return np.eye(3) + sine * k + lift * (k @ k), np.eye(3) + lift * k + rest * (k @ k)


def _within(basis: np.ndarray, points: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The motions [d, 6] (angular velocity, velocity) of a basis that move no point [n, 3] where it is held [n, 3]."""
    node, a = np.nonzero(held)
    rows = np.concatenate([np.cross(points[node], np.eye(3)[a]), np.eye(3)[a]], axis=1)
    if not len(rows) or not len(basis):
        return basis
    _, s, vt = np.linalg.svd(rows @ basis.T)
    return vt[np.sum(s > 1e-9) :] @ basis


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


def contact_points(model: Model, x: np.ndarray) -> np.ndarray:
    """Places of the contact points [K, W, 3] [m] at positions x [N, W, 3]."""
    if not len(model.contacts):
        return np.zeros((0, *x.shape[1:]))
    a, b, c = (x[model.contacts[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    corners = np.stack([a, b, c], axis=1)
    return np.einsum("kc,kcwa->kwa", model.contact_weights, corners) + model.contact_offsets[:, None, None] * normal


def batch_of(
    model: Model,
    parameters: Parameters,
    drive: Drive,
    state: State,
    *,
    among: Sequence[str] = (),
    tolerance: float = TOLERANCE,
    tree: Topology | None = None,
    **options,
) -> Batch:
    """A batch of worlds of whichever kind the model's panels ask for.

    Rigid panels that are held everywhere do not move by themselves, but may be carried along a path. `tolerance` and
    `tree` are of rigid panels, see `RigidBatch`; the rest is as for `Batch`.
    """
    if model.panels != "rigid":
        return Batch(model, parameters, drive, state, among=among, **options)
    if not np.any(model.free):
        unit = parameters.copy()
        unit.replace("inertia", "mass", np.ones_like(parameters["inertia", "mass"]))
        return Batch(model, unit, drive, state, among=among, **options)
    return RigidBatch(model, parameters, drive, state, among=among, tolerance=tolerance, tree=tree, **options)


def check_inertia(model: Model, tree: Topology, x: np.ndarray, mass: np.ndarray) -> None:
    """Refuses a panel that turns without inertia.

    Args:
        x: [N, 3] positions [m]. mass: (N,) of the nodes [kg].

    Raises:
        InputError: names the panel.
    """
    by = tree.rates(x[:, None])[:, :, 0]
    heavy = np.einsum("mna,n,mna->m", by, mass, by)
    light = np.flatnonzero(heavy <= 1e-15 * heavy.max(initial=0.0))
    if len(light):
        k = int(light[0]) - len(tree.turns)
        where = f"beyond {model.name('crease', tree.joints[k][0])}" if k >= 0 else "of the first panel"
        raise InputError("a rigid panel needs mass and inertia", field="body", value=f"none {where}", allowed="> 0")
