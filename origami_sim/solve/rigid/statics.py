"""Equilibria of rigid panels: Newton's method on hinge angles and the pose of the root, with loops kept closed."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, State, dihedral_angles
from origami_sim.model.motions import carried
from origami_sim.solve import grips
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid.topology import REDUNDANT, Topology
from origami_sim.solve.skin import clear_share

STEP = 1e-5
"""Change of a coordinate [rad] for central differences of the moments: rounding and curvature both below 1e-9."""

LONGEST = 0.5
"""Longest Newton step [rad]."""

NEUTRAL = 1e-9
"""Part of the largest eigenvalue below which a stiffness is taken for zero."""

CLOSED = 1e-11
"""Gap of a loop, in units of the device's size, below which it is closed."""


class RigidSystem:
    """Moments of one world as functions of its coordinates: shifts and turns of the root, then fold angles [rad].

    Shifts are in units of the device's size. Coordinates are zero at positions `x` [N, 3], which go along with every
    step: where they are zero, and only there, moments are the energy's derivatives by them, and the tangent of a
    balanced state is symmetric. Loops are constraints: all states are on their manifold, and moments along it.
    """

    def __init__(self, model: Model, parameters: Parameters, drive: Drive, state: State):
        self.model, self.parameters, self.state, self._drive = model, parameters, state, drive
        self._gripped = grips.moving(model, drive)
        self.tree = t = Topology(model, self._gripped)
        self.x, self.folds = state.x[:, 0], state.angles[: len(model.creases), 0].copy()
        self.size = float(np.ptp(self.x, axis=0).max(initial=0.0)) or 1.0
        self.count = len(t.turns) + len(t.joints)
        worlds = 2 * self.count + 1
        self._batch = Batch(model, parameters, drive, state.select(np.zeros(worlds, int)))
        self._worlds = worlds

    def moments(self, q: np.ndarray, time: float) -> tuple:
        """Moments and stiffness along the loops' manifold at coordinates q (m,).

        Returns:
            moments (d,), their tangent [d, d] (minus the derivative), directions [m, d] in which all loops stay closed,
            nodes [N, 3] and fold angles [C].
        """
        near = np.concatenate(
            [np.zeros((self.count, 1)), STEP * np.eye(self.count), -STEP * np.eye(self.count)], axis=1
        )
        x, by = self.tree.positions(self.x, q[:, None] + near)
        angles = dihedral_angles(x, self.model.creases)
        angles += 2 * np.pi * np.round((self._angles(q)[:, None] - angles) / (2 * np.pi))
        self._batch.place(x, angles)
        found = np.einsum("mnwa,nwa->mw", by, self._batch.total_force(time))
        along, found = loops_kept(self.tree, self.x, q[:, None] + near, found)
        slope = (found[:, self.count + 1 :] - found[:, 1 : self.count + 1]) / (2 * STEP)
        return along.T @ found[:, 0], along.T @ slope @ along, along, x[:, 0], angles[:, 0]

    def _stepped(self, step: np.ndarray, time: float) -> tuple | None:
        """The moments a step away with all loops closed; None where loops do not close."""
        q = closed(self.tree, self.x, step)
        if q is None:
            return None
        begin = self.x, self.folds
        self.folds = self._angles(q)
        self.x = self.tree.moved(begin[0][:, None], q[:, None])[:, 0]
        found = self.moments(np.zeros(self.count), time)
        self.x, self.folds = begin
        return found

    def _angles(self, q: np.ndarray) -> np.ndarray:
        """Fold angles [C] at q, not wrapped."""
        out = self.folds.copy()
        for c, j in enumerate(self.tree.joint_of):
            out[c] += q[len(self.tree.turns) + j]
        return out

    def settle(self, time: float, tolerance: float, max_iterations: int, unstable: bool) -> dict:
        """The equilibrium near the start, as the fields of an `Equilibrium`, with its grips in their places."""
        found = None
        if self._gripped:
            end = grips.levels_at(self.model, self._drive, time, 1)
            for at in grips.way_to(self.model, self.x[:, None], end, self.size)[1:]:
                x = led(self.model, self.tree, self.x, at)
                if x is None:
                    found = self._settled(time, tolerance, 1, unstable)
                    said = "the grips tear the rigid panels: no shape of theirs reaches from one to the other"
                    return {**found, "converged": False, "stable": False, "message": f"{said}."}
                angles = dihedral_angles(x[:, None], self.model.creases)[:, 0]
                self.folds = angles + 2 * np.pi * np.round((self.folds - angles) / (2 * np.pi))
                self.x = x
                found = self._settled(time, tolerance, max_iterations, unstable)
        return found or self._settled(time, tolerance, max_iterations, unstable)

    def _settled(self, time: float, tolerance: float, max_iterations: int, unstable: bool) -> dict:
        """The equilibrium near where it is."""
        start, shift, pushes, history, message = np.zeros(self.count), 0.0, 0, [], ""
        converged, values, mode = False, np.full(1, np.nan), np.zeros(self.count)
        scale = target = 0.0
        f, k, along, x, angles = self.moments(start, time)
        while True:
            history.append(float(np.abs(f).max(initial=0.0)))
            scale = max(scale, history[-1], float(np.abs(k).max(initial=0.0)))
            target = tolerance * scale
            if not np.all(np.isfinite(f)) or not np.all(np.isfinite(k)):
                message = "a moment is not a number"
                break
            values, modes = np.linalg.eigh(0.5 * (k + k.T))
            largest = float(np.abs(values).max(initial=0.0)) or 1.0
            if history[-1] <= target:
                mode = along @ modes[:, 0] if len(values) else mode
                if unstable or not len(values) or values[0] >= -NEUTRAL * largest or pushes == 4:
                    converged = True
                    break
                pushes += 1
                step = 0.02 * modes[:, 0]
            elif len(history) >= max_iterations:
                message = f"no equilibrium within {max_iterations} iterations"
                break
            else:
                shift = 0.0 if unstable else max(0.0, -1.5 * float(values[0]), 1e-9 * largest)
                step = np.linalg.lstsq(k + shift * np.eye(len(k)), f, rcond=None)[0]
                step *= min(1.0, LONGEST / max(np.abs(step).max(), 1e-300))
            work, step = step @ f, along @ step
            new = self._stepped(step, time)
            for _ in range(30):
                # along the way the moment must not have turned against the step by half of what it was
                ahead = unstable or history[-1] <= target
                if new is not None and (ahead or self._ahead(new, step, work)) and self._clear(x, new[3]):
                    break
                step = 0.5 * step
                work *= 0.5
                new = self._stepped(step, time)
            if new is None:
                message = "loops of panels cannot close on the way"
                break
            f, k, along, x, angles = new
            self.x, self.folds = x, angles
        neutral = int((np.abs(values) <= NEUTRAL * np.abs(values).max(initial=1e-300)).sum())
        stable = converged and bool(np.all(values >= -NEUTRAL * np.abs(values).max(initial=0.0)))
        if converged:
            message = f"{'stable' if stable else 'unstable'} equilibrium after {len(history)} iterations, residual "
            message += f"{history[-1]:.3g} N m" + (f", {neutral} neutral modes." if neutral else ".")
        else:
            message += f" (residual {history[-1]:.3g} N m, asked for {target:.3g} N m)."
        state = self.state.copy()
        state.x, state.v, state.a = x[:, None].copy(), np.zeros_like(state.x), np.zeros_like(state.x)
        state.angles[: len(angles), 0] = angles
        state.status = np.full((2, 1), -1, np.int32)
        shape = np.einsum("mna,m->na", self.tree.rates(x[:, None])[:, :, 0], mode)
        return {
            "state": state,
            "angles": state.angles[:, 0],
            "count": len(self.model.creases),
            "residual": history[-1],
            "tolerance": target,
            "iterations": len(history),
            "history": np.array(history),
            "converged": converged,
            "stable": stable,
            "eigenvalues": values,
            "neutral": neutral,
            "mode": shape / (np.abs(shape).max() or 1.0),
            "reactions": np.full_like(x, np.nan),
            "message": message,
            "energies": self._energies(state, time),
        }

    def _energies(self, state: State, time: float) -> dict[str, float]:
        """Potential energy [J] by effect, of those that have one."""
        worlds = self._worlds
        self._batch.place(np.repeat(state.x, worlds, axis=1), np.repeat(state.angles, worlds, axis=1))
        return {n: float(e[0]) for n, e in self._batch.evaluate(time).energies.items()}

    def _clear(self, x: np.ndarray, new: np.ndarray) -> bool:
        """Whether panels that touch come from positions x [N, 3] to new ones without passing through each other."""
        return clear_share(self.model, self.parameters, x, new - x) >= 1.0

    @staticmethod
    def _ahead(new: tuple, step: np.ndarray, work: float) -> bool:
        """Whether moments after a step have not turned against it by half of the work that they promised."""
        f, _, along, *_ = new
        return bool(np.all(np.isfinite(f)) and (along.T @ step) @ f >= -0.5 * abs(work))


def led(
    model: Model, tree: Topology, x: np.ndarray, levels: np.ndarray, reference: np.ndarray | None = None
) -> np.ndarray | None:
    """Positions [N, 3] of panels next to x [N, 3] whose held nodes are where grips at levels [G, 1] have them.

    The root goes along with its grip, and all panels with it, before loops are closed. None if they cannot be.
    """
    root, _ = tree.in_grips
    aims = grips.held_at(model, x[:, None], levels, reference)[:, 0]
    ahead = levels - grips.nearest_levels(model, x[:, None], reference)
    if root >= 0:
        x = carried(x[:, None], model.grip_screws[root], ahead[root])[:, 0]
    q = closed(tree, x, np.zeros(len(tree.turns) + len(tree.joints)), aims)
    return None if q is None else tree.moved(x, q[:, None])[:, 0]


def closed(tree: Topology, start: np.ndarray, q: np.ndarray, aims: np.ndarray | None = None) -> np.ndarray | None:
    """The coordinates (m,) nearest to q (m,), from positions [N, 3], at which loops are closed; None if not found.

    Args:
        aims: [N, 3] where held nodes are to be, if not where they are at the start.
    """
    if not len(tree.row_node):
        return q
    size = float(np.ptp(start, axis=0).max(initial=0.0)) or 1.0
    for _ in range(20):
        gap, slope = tree.closures(start, q[:, None], aims)
        if np.abs(gap).max(initial=0.0) <= CLOSED * size:
            return q
        q = q - np.linalg.lstsq(slope[:, :, 0].T, gap[:, 0], rcond=REDUNDANT)[0]
    return None


def loops_kept(tree: Topology, start: np.ndarray, q: np.ndarray, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions [m, d] in which all loops stay closed at the first of the coordinates q [m, W], and moments [m, W].

    To the moments are added those of the forces that keep the loops closed: they turn as the loops' directions do.
    """
    if not len(tree.row_node):
        return np.eye(len(q)), moments
    slopes = tree.closures(start, q)[1]
    left, values, right = np.linalg.svd(slopes[:, :, 0])
    rank = int((values > REDUNDANT * values.max(initial=0.0)).sum())
    pull = right[:rank].T @ (left[:, :rank].T @ -moments[:, 0] / values[:rank])
    return left[:, rank:], moments + np.einsum("mrw,r->mw", slopes, pull)
