"""Tangents at which a search for equilibria looks, with what shifts them, and whether they are stable.

Where a foot slips its friction goes with the load: the tangent is unsymmetric (mu dN/dz couples a foot's height to its
slip), its symmetric part is never positive definite, and an equilibrium is stable if no eigenvalue has a negative real
part (the device, let go in a viscous medium, returns). A slip that nothing resists gives an eigenvalue of zero.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from origami_sim.solve.rigid.statics import NEUTRAL as FLAT
from origami_sim.solve.statics.system import DENSE, FINER, NEUTRAL, NULL_SHIFT, SKEW, System, shifted


@dataclass(frozen=True)
class Tangent:
    """A tangent and its factors.

    Attributes:
        factor: gives the factors of the tangent with a drag of the coordinates added. least: drag with which Newton's
            steps go, so large that they leave what is unstable. largest: of its entries or eigenvalues. stable: no
            eigenvalue has a negative real part. neutral: one is zero. drags: what a drag of one resists with, [m, m];
            None: each coordinate by itself.
    """

    factor: Callable
    least: float
    largest: float
    stable: bool
    neutral: bool = False
    drags: np.ndarray | None = None

    def dragged(self, s: np.ndarray) -> np.ndarray:
        """Forces (m,) of a drag of one on a change s (m,) of the coordinates."""
        return s if self.drags is None else self.drags @ s


def of_bars(system: System, k: sp.csc_array) -> Tangent:
    """The tangent of bars on the free axes."""
    largest = float(np.abs(k.data).max(initial=0.0)) or 1.0
    least = NULL_SHIFT * largest
    if float(abs(sp.csc_array(k - k.T)).max()) > SKEW * largest:
        small = k.shape[0] <= DENSE
        values = np.linalg.eigvals(k.toarray()).real if small else system.spectrum(k, largest, False)[0]
        lowest = float(values.min())
        stable, neutral = lowest >= -NEUTRAL * largest, lowest <= NEUTRAL * largest
        shift = least if stable else -1.5 * lowest
        return Tangent(lambda drag: spla.splu(shifted(k, drag)), shift, largest, stable, neutral)
    first, shift = system.definite(k, largest, 0.0)
    stable = shift <= least * (1 + 1e-9)
    return Tangent(
        lambda drag: first if drag == shift else system.definite(k, largest, drag)[0], shift, largest, stable
    )


def of_panels(k: np.ndarray, along: np.ndarray) -> Tangent:
    """The tangent of rigid panels [d, d] along directions [m, d] in which loops stay closed."""
    values = np.linalg.eigvalsh(0.5 * (k + k.T))
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    stable = not len(values) or bool(values[0] >= -FLAT * largest)
    return Tangent(
        lambda drag: Small(k + drag * np.eye(len(k)), along),
        0.0 if stable else -1.5 * float(values[0]),
        largest,
        stable,
    )


def of_slipping_panels(k: np.ndarray, along: np.ndarray, drags: np.ndarray) -> Tangent:
    """The same with dry friction, and with a drag [m, m] that all points feel alike.

    Not even a stable tangent goes without drag: what nothing resists must not go unseen if a force is on it.
    """
    by = along.T @ drags @ along
    values = np.sort(np.linalg.eigvals(np.linalg.solve(by, k)).real)
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    error, lowest = FLAT / FINER * largest, float(values[0]) if len(values) else np.inf
    stable = lowest >= -error
    shift = error if stable else -1.5 * lowest
    return Tangent(lambda drag: Small(k + drag * by, along), shift, largest, stable, lowest <= error, drags)


class Small:
    """A dense tangent of any symmetry along some directions [m, d]."""

    def __init__(self, k: np.ndarray, along: np.ndarray):
        self._whole = along @ np.linalg.pinv(k, rcond=1e-15) @ along.T

    def solve(self, right: np.ndarray) -> np.ndarray:
        """What gives forces [m, k]; each column is the same to the last digit whatever others are beside it."""
        return np.einsum("ab,bk->ak", self._whole, right)
