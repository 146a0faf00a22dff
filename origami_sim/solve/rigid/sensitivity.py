"""How an equilibrium of rigid panels moves as its design does, by the implicit function theorem.

Coordinates q are the pose of the root and the changes of fold angles, as in `statics`. With moments f, gaps g of
closed loops, their Jacobian G = dg/dq and the forces c that keep loops closed, an equilibrium is f + G^T c = 0, g = 0.
With r = f + G^T c at held c and K = -dr/dq, a number p of the design moves it by dq/dp with

    G dq/dp = -dg/dp,    T^T K dq/dp = T^T dr/dp,    G T = 0.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, dihedral_angles
from origami_sim.model.distort import distorted
from origami_sim.model.motions import screw
from origami_sim.solve.batch import Batch
from origami_sim.solve.grips import moving
from origami_sim.solve.rigid.statics import NEUTRAL, STEP
from origami_sim.solve.rigid.topology import REDUNDANT, Topology

Design = tuple[Model, Parameters, Drive]

OPEN = 1e-6
"""Part of the change of a loop's gap that no motion of the panels may leave open: rounding leaves 1e-10 of it, and a
loop that cannot close leaves a good part of all."""


class _Near:
    """One design with its root and hinges where the equilibrium has them."""

    def __init__(self, design: Design, time: float):
        self.model, self.parameters, drive = design
        self.drive = distorted(self.model, self.parameters, drive, time)
        if moving(self.model, self.drive):
            allowed = "panels='elastic', or supports that stand still"
            raise InputError(
                "derivatives of rigid panels in grips that move are not known", field="grip", allowed=allowed
            )
        self.tree = Topology(self.model)
        self.time, self.roots = time, len(self.tree.turns)
        self.joints = [c for c, _ in self.tree.joints]
        self.ways = (self.joints, self.roots, len(self.tree.row_node))

    def turn(self, twist: np.ndarray, turned: np.ndarray, state: State, twists: np.ndarray | None = None):
        """Move the root by a twist [6] and hinges by angles [J] [rad]; `twists` [d, 6]: of whose root rates are."""
        t, x = self.tree, self.model.position
        q = np.zeros(self.roots + len(self.joints))
        q[: self.roots] = np.linalg.lstsq(t.twists(x).T, twist, rcond=None)[0]
        # the reference shape, in which loops are closed, goes along with the root
        self.start = t.positions(x, q[:, None], x, np.where(t.body_of < 0, -1, 0))[0][:, 0]
        self.folded = np.concatenate([np.zeros(self.roots), turned])[:, None]
        self.mix = np.eye(len(q))  # rates of this tree's coordinates for those of the equilibrium's
        if twists is not None:
            self.mix[: self.roots, : self.roots] = np.linalg.lstsq(t.twists(self.start).T, twists.T, rcond=None)[0]
        self.rest, self.memory = state.angles[:, 0], state.memory[:, :1]
        away = np.where(t.row_body[:, 1] < 0, 1.0, 0.0) if len(t.row_node) else np.zeros(0)
        self.gone = away * np.einsum("ra,ra->r", (self.start - x)[t.row_node], t.row_axis)

    def at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions [N, W, 3], continuous angles [C + Q, W], velocities for unit rates [m, N, W, 3] at q [m, W]."""
        x, by = self.tree.positions(self.start, self.folded + self.mix @ q)
        hinges = np.concatenate([self.model.creases, self.model.bends])
        angles = dihedral_angles(x, hinges)
        angles += 2 * np.pi * np.round((self.rest[:, None] - angles) / (2 * np.pi))
        return x, angles, np.einsum("ij,i...->j...", self.mix, by)

    def loops(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaps [R, W] [m] and their derivatives [m, R, W]."""
        if not len(self.tree.row_node):
            return np.zeros((0, q.shape[1])), np.zeros((len(q), 0, q.shape[1]))
        gap, slope = self.tree.closures(self.start, self.folded + self.mix @ q)
        return gap + self.gone[:, None], np.einsum("ij,irw->jrw", self.mix, slope)

    def moments(self, q: np.ndarray) -> np.ndarray:
        """[m, W] of all forces."""
        x, angles, by = self.at(q)
        state = State.at_rest(self.model, q.shape[1], x)
        state.angles, state.memory = angles, np.repeat(self.memory, q.shape[1], axis=1)
        force = Batch(self.model, self.parameters, self.drive, state, threads=1).total_force(self.time)
        return np.einsum("mnwa,nwa->mw", by, force)


def followed(
    designs: Sequence[Design], state: State, time: float, stencil: np.ndarray, weights: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Positions [N, 3] [m] and hinge angles [C + Q] [rad] of equilibria of designs near one, to first order.

    Args:
        designs: the one that is at rest, then those moved by each of `stencil`, for one number after another.
        state: of the first, at rest. time: of the drives [s].
        weights: of differences over `stencil` that give the derivative.

    Raises:
        InputError: designs with other panels, loops or ways to move; loops that open as the design changes.
    """
    near = [_Near(d, time) for d in designs]
    first, size = near[0], float(np.ptp(state.x[:, 0], axis=0).max()) or 1.0
    m = first.roots + len(first.joints)
    for other in near:
        if (other.joints, other.roots, len(other.tree.row_node)) != (
            first.joints,
            first.roots,
            len(first.tree.row_node),
        ):
            raise InputError("the panels' ways to move change with the design", field="point")
    nodes = first.tree.root_nodes
    twist = _twist(first.model.position[nodes], state.x[nodes, 0])
    turned = (state.angles[:, 0] - State.at_rest(first.model).angles[:, 0])[first.joints]
    first.turn(twist, turned, state)
    for other in near[1:]:
        other.turn(twist, turned, state, first.tree.twists(first.start))
    here = np.zeros((m, 1))
    slope = first.loops(here)[1][:, :, 0]
    left, values, right = np.linalg.svd(slope)
    rank = int((values > REDUNDANT * values.max(initial=0.0)).sum())
    along, keeps = left[:, rank:], (left[:, :rank] / values[:rank]) @ right[:rank]  # keeps @ gap closes it
    pull = -keeps.T @ first.moments(here)[:, 0]

    def held(one: _Near, q: np.ndarray) -> np.ndarray:
        return one.moments(q) + np.einsum("mrw,r->mw", one.loops(q)[1], pull)

    around = held(first, STEP * np.concatenate([np.eye(m), -np.eye(m)], axis=1))
    stiffness = (around[:, m:] - around[:, :m]) / (2 * STEP)
    out = []
    for k in range(1, len(near), len(stencil)):
        group = near[k : k + len(stencil)]
        opening = weights @ np.array([one.loops(here)[0][:, 0] for one in group])
        push = weights @ np.array([held(one, here)[:, 0] for one in group])
        step = -keeps @ opening
        if np.abs(slope.T @ step + opening).max(initial=0.0) > OPEN * max(
            np.abs(opening).max(initial=0.0), STEP * size
        ):
            raise InputError("no motion of rigid panels keeps loops closed as the design changes", field="point")
        inner = along.T @ stiffness @ along
        step = step + along @ np.linalg.lstsq(inner, along.T @ (push - stiffness @ step), rcond=NEUTRAL)[0]
        for s, one in zip(stencil, group, strict=True):
            x, angles, _ = one.at(s * step[:, None])
            out.append((x[:, 0], angles[:, 0]))
    return out


def _twist(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The twist (turn, velocity of the centre) [6] whose exponential takes points x to y [n, 3] as a rigid body."""
    a, b = x.mean(axis=0), y.mean(axis=0)
    turn = Rotation.align_vectors(y - b, x - a)[0].as_rotvec()
    return np.concatenate([turn, np.linalg.solve(screw(turn[None])[1][0], b - a)])
