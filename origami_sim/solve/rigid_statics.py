"""Equilibria of rigid panels: Newton's method on hinge angles and the pose of the root."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, dihedral_angles
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid import Topology

STEP = 1e-5
"""Change of a coordinate [rad] for central differences of the moments: rounding and curvature both below 1e-9."""

LONGEST = 0.5
"""Longest Newton step [rad]."""

NEUTRAL = 1e-9
"""Part of the largest eigenvalue below which a stiffness is taken for zero."""


class RigidSystem:
    """Moments of one world as functions of its coordinates: shifts and turns of the root, then fold angles [rad].

    Shifts are in units of the device's size. Coordinates are zero in the state that the system is made with.

    Raises:
        InputError: panels that close loops.
    """

    def __init__(self, model: Model, parameters: Parameters, drive: Drive, state: State):
        self.model, self.state = model, state
        self.tree = t = Topology(model)
        if len(t.row_node):
            raise InputError(
                "equilibria of rigid panels that close a loop are not found",
                field="panels",
                value="rigid",
                allowed="panels='elastic', or a motion with losses",
            )
        self.x = state.x[:, 0]
        self.count = len(t.turns) + len(t.joints)
        worlds = 2 * self.count + 1
        self._batch = Batch(model, parameters, drive, state.select(np.zeros(worlds, int)))
        self._worlds = worlds

    def moments(self, q: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Moments (m,), their tangent [m, m] (minus the derivative), nodes [N, 3] and fold angles [C] at q (m,)."""
        near = np.concatenate(
            [np.zeros((self.count, 1)), STEP * np.eye(self.count), -STEP * np.eye(self.count)], axis=1
        )
        x, by = self.tree.positions(self.x, q[:, None] + near)
        angles = dihedral_angles(x, self.model.creases)
        angles += 2 * np.pi * np.round((self._angles(q)[:, None] - angles) / (2 * np.pi))
        self._batch.place(x, angles)
        found = np.einsum("mnwa,nwa->mw", by, self._batch.total_force(time))
        slope = (found[:, self.count + 1 :] - found[:, 1 : self.count + 1]) / (2 * STEP)
        return found[:, 0], slope, x[:, 0], angles[:, 0]

    def _angles(self, q: np.ndarray) -> np.ndarray:
        """Fold angles [C] at q, not wrapped."""
        out = self.state.angles[: len(self.model.creases), 0].copy()
        for c, j in enumerate(self.tree.joint_of):
            out[c] += q[len(self.tree.turns) + j]
        return out

    def settle(self, time: float, tolerance: float, max_iterations: int, unstable: bool) -> dict:
        """The equilibrium near the start, as the fields of `statics.Equilibrium`."""
        q, shift, pushes, history, message = np.zeros(self.count), 0.0, 0, [], ""
        converged, values, mode = False, np.full(1, np.nan), np.zeros(self.count)
        scale = target = 0.0
        f, k, x, angles = self.moments(q, time)
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
                mode = modes[:, 0] if len(values) else mode
                if unstable or not len(values) or values[0] >= -NEUTRAL * largest or pushes == 4:
                    converged = True
                    break
                pushes += 1
                q = q + 0.02 * mode
                f, k, x, angles = self.moments(q, time)
                continue
            if len(history) >= max_iterations:
                message = f"no equilibrium within {max_iterations} iterations"
                break
            shift = 0.0 if unstable else max(0.0, -1.5 * float(values[0]), 1e-9 * largest)
            step = np.linalg.lstsq(k + shift * np.eye(self.count), f, rcond=None)[0]
            share = min(1.0, LONGEST / max(np.abs(step).max(), 1e-300))
            new = self.moments(q + share * step, time)
            for _ in range(30):
                # along the way the moment must not have turned against the step by half of what it was
                if unstable or (np.all(np.isfinite(new[0])) and step @ new[0] >= -0.5 * abs(step @ f)):
                    break
                share *= 0.5
                new = self.moments(q + share * step, time)
            q = q + share * step
            f, k, x, angles = new
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
        shape = np.einsum("mna,m->na", self.tree.positions(self.x, q[:, None])[1][:, :, 0], mode)
        return {
            "state": state,
            "angles": state.angles[:, 0],
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
        }
