"""Rollouts of rigid panels: hinge angles and the pose of the root in place of the nodes of bars."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.model.bodies import centred, eccentric
from origami_sim.model.motions import velocity
from origami_sim.solve import grips
from origami_sim.solve.batch import _FIRST, Batch
from origami_sim.solve.kernels.tree import PARTS, POSE, Tree
from origami_sim.solve.rigid.shares import closing
from origami_sim.solve.rigid.tableaus import EXPLICIT, additive
from origami_sim.solve.rigid.topology import Topology, check_inertia

TOLERANCE = 1e-10
"""Largest error of one step [rad], or part of the device's size; ten times less costs 1.6 times the steps."""

FINEST = 1e-7
"""Part of the asked step below which a world is given up as unstable, unless a batch's `finest` says another."""

ELASTIC = 1e-7
"""Error of a step from which on steps that are implicit in damping are so in the joints' stiffness, too.

A chain of twelve damped cells then takes 0.27 of the time for 1e-5, 0.9 for 1.5e-7; for 1e-10 it would take 1.5 times.
"""

STABILISATION = 100.0
"""Rate at which an error of a closed loop decays [1/s]; a loop that is consistent at first only gathers rounding."""

SOFTNESS = 1e-10
"""Softness of loop constraints, relative to the mobility of their nodes: redundant ones share the load."""


FITS = 1e-9
"""Part of the largest velocity within which rates of the coordinates fit a state in moving grips: one from which a
motion goes on is missed by 2e-15, one at rest in a grip that starts at once by all. Half and double tell the same."""

REPEATED = 1e-13
"""Part of the largest singular value of a blow's balance below which a row repeats others, as most of a held panel do.

Those of panels of 30 mg leave 2e-17, what their masses tell is 5e-9. Half and double tell the same rows.
"""


class RigidBatch(Batch):
    """A batch of worlds with rigid panels, moved in reduced coordinates.

    Panels keep the shapes that they have in the state. Steps are of order five; within each of them, unless
    `tolerance` is 0, the solver takes as many as the error of the embedded formula asks for, world by world.

    Args:
        model: with `panels` "rigid" (see `bodies.rigid`). tolerance: error of one step [rad]; 0: steps as given.
        tree: the model's, if it is known. implicit: whether steps are implicit in the joints' damping and stiffness,
            which then do not bound them, see `damping.overdamped`. The rest as for `Batch`.

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
        implicit: bool = False,
        **options,
    ):
        gripped = grips.moving(model, drive)
        self.tree_of = tree or Topology(model, gripped)
        self.implicit = implicit
        if not len(self.tree_of.turns) and not gripped:  # the kernel leaves a root that stands as it is
            state = replace(state, v=np.where(self.tree_of.body_of[:, None, None] == 0, 0.0, state.v))
        self._eccentric = eccentric(model, parameters)
        if self._eccentric is not None:
            state = replace(state, x=state.x + self._eccentric(state.x))
            parameters = centred(model, parameters)
        super().__init__(model, parameters, drive, state, **options)
        self._drive = drive
        self.tolerance, self.finest = tolerance, FINEST
        self._fresh = 1
        self._tree = self._made(state)

    def _made(self, state: State):
        """The tree on the device, its bodies shaped and placed as in a state."""
        t, model, w, x = self.tree_of, self.model, self.worlds, state.x
        joints, rates = len(t.joints), len(t.joints) + len(t.turns)
        tree = Tree()
        tree.bodies, tree.roots, tree.rates, tree.rows = len(t.parent), len(t.turns), rates, len(t.row_node)
        held = not len(t.turns)
        tree.first_body, tree.first_number = int(held), int(POSE) if held else 0
        tree.hinges, tree.memories = len(state.angles), len(state.memory)
        tree.feet_count, tree.effects = len(model.contacts), len(self.program.effects) + self.gripped
        tree.follows, tree.stabilisation, tree.softness = int(t.follows), STABILISATION, SOFTNESS

        def constant(a, dtype):
            return wp.array(np.ascontiguousarray(a), dtype=dtype, device=self.device)

        tree.parent, tree.body_of = constant(t.parent, wp.int32), constant(t.body_of, wp.int32)
        points = np.arange(len(t.body_of)) >= len(t.body_of) - len(model.carriers)  # after the corners
        order = np.lexsort((t.body_of, points))
        least = 0 if self.gripped else tree.first_body  # a root in a grip moves as well
        tree.moving = constant(order[t.body_of[order] >= least].astype(np.int32), wp.int32)
        tree.corners = int(np.sum(~points & (t.body_of >= least)))
        tree.joint_of = constant(t.joint_of, wp.int32)
        tree.axes = constant(np.concatenate([t.turns, t.shifts, t.pivots, t.row_axis]), wp.vec3d)
        tree.joined = constant(np.concatenate([t.row_node[:, None], t.row_body], axis=1), wp.int32)
        tableau, more = additive() if self.implicit else (EXPLICIT, np.zeros((0, 0)))
        tree.tableau, tree.implicit = constant(tableau.ravel(), wp.float64), constant(more, wp.float64)
        tree.stages = stages = len(tableau) - 1
        tree.elastic = int(self.tolerance == 0.0 or self.tolerance >= ELASTIC)
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
            "turned": np.tile(np.eye(3).reshape(1, 9, 1), (tree.bodies, 1, w)).reshape(-1, w),  # a held root stays so
        }
        sizes = {
            "second": 9 * tree.bodies,
            **dict.fromkeys(("placed", "omega", "speed", "alpha", "gain", "force", "moment", "first"), 3 * tree.bodies),
            **dict.fromkeys(("hinge", "joint"), 3 * joints),
            **dict.fromkeys(("power0", "spent"), tree.effects),
            **dict.fromkeys(("jacobian", "solved"), tree.rows * rates),
            **{
                "steady": 12 * tree.bodies,
                "y0": 7 + joints,
                "u0": rates,
                "dy": (stages + 1) * (7 + joints),
                "du": (stages + 1) * rates,
                "damping": self.implicit * rates**2,
                "rigidity": self.implicit * joints,
                "age": int(self.implicit),
                "damped": self.implicit * stages * rates,
                "factor0": self.implicit * rates**2,
                "stiff": self.implicit * rates**2,
                "torque": joints,
            },
            **{"angles0": tree.hinges, "memory0": tree.memories, "feet0": 3 * tree.feet_count},
            **{"heavy": tree.bodies, "factor": rates**2, "gram": min(tree.rows, rates) ** 2},
            **{"pull": tree.rows, "found": rates, "aim": 3 * tree.rows},
            **{"wrench": 6 * self.gripped, "closing": rates * self.gripped},
        }
        columns, place = [], 0
        for name in PARTS:
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
        if self.gripped:
            clamp, (root, rows) = self._clamps[0], t.in_grips
            clamp.root, clamp.rows = root, constant(rows, wp.int32)
            self._from = state, origin, axis, pivot
        return tree

    def _begin_in_grips(self, time: float):
        """Sets where paths begin, and the rates of the coordinates [m, W] there.

        They are those that fit the velocities of the state; where none do, as of a device at rest in a grip that moves
        at once, those after the blow: of all motions that the grips allow, the one nearest by mass (Gauss's principle).
        """
        state, origin, axis, pivot = self._from
        root, rows = self.tree_of.in_grips
        motion = grips.motion_at(self.model, self._drive, time, self.worlds)
        self._clamps[0].begun = wp.array(motion[0], dtype=wp.float64, device=self.device)
        t, x, corners = self.tree_of, state.x, len(state.x) - len(self.model.carriers)
        going = [rate[:, None] * velocity(x, way) for rate, way in zip(motion[1], self.model.grip_screws, strict=True)]
        base = going[root] if root >= 0 else np.zeros_like(x)
        by, mass = self.jacobian(x, origin, axis, pivot), np.broadcast_to(self._mass, x.shape[:2])
        data = self._tree.data.numpy().reshape(self.worlds, -1)
        for w in range(self.worlds):
            own, wanted = by[:, :, w], (state.v - base)[:, w]
            u = np.linalg.lstsq(own[:, :corners].reshape(len(by), -1).T, wanted[:corners].ravel(), rcond=None)[0]
            left = np.abs(np.einsum("mna,m->na", own, u) - wanted)[:corners].max(initial=0.0)
            if left > FITS * max(np.abs(base[:, w]).max(), np.abs(state.v[:, w]).max()):
                heavy = np.einsum("mna,n,kna->mk", own, mass[:, w], own)
                right = np.einsum("mna,n,na->m", own, mass[:, w], wanted)
                slope = closing(t, x[:, w])
                nodes = zip(rows.tolist(), t.row_node.tolist(), t.row_axis, strict=True)
                goal = [a @ ((going[g][n, w] if g >= 0 else 0.0) - base[n, w]) if g > -2 else 0.0 for g, n, a in nodes]
                whole = np.block([[heavy, slope.T], [slope, np.zeros((len(slope),) * 2)]])
                u = np.linalg.lstsq(whole, np.append(right, goal), rcond=REPEATED)[0][: len(by)]
            data[w, self._tree.u : self._tree.u + len(u)] = u
        self._tree.data.assign(data.ravel())

    def supporting(self) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment about the origin of all supports [W, 6], and what loops add to the coordinates [m, W]."""
        data, t = self._tree.data.numpy().reshape(self.worlds, -1), self._tree
        wrench, at = data[:, t.wrench : t.wrench + 6].copy(), data[:, t.y : t.y + 3]
        wrench[:, 3:] += np.cross(at, wrench[:, :3])
        return wrench, data[:, t.closing : t.closing + t.rates].T.copy()

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
        if self._fresh and self.gripped:
            self._begin_in_grips(max(self.step, 0) * dt)
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
                *self._clamps,
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
    implicit: bool = False,
    **options,
) -> Batch:
    """A batch of worlds of whichever kind the model's panels ask for.

    Rigid panels that are held everywhere move by grips alone, but may also be carried along a path. `tolerance`,
    `tree` and `implicit` are of rigid panels, see `RigidBatch`; the rest is as for `Batch`.
    """
    if model.panels != "rigid":
        return Batch(model, parameters, drive, state, among=among, **options)
    led = options.get("supports") is not None or not grips.moving(model, drive)
    if led and not np.any(model.free):
        unit = parameters.copy()
        unit.replace("inertia", "mass", np.ones_like(parameters["inertia", "mass"]))
        return Batch(model, unit, drive, state, among=among, **options)
    of_panels = {"tolerance": tolerance, "tree": tree, "implicit": implicit}
    return RigidBatch(model, parameters, drive, state, among=among, **of_panels, **options)
