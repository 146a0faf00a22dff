"""Forces and tangents of one world as functions of its positions, and factors of a tangent.

The tangent K = -dF/dx comes from differences of the total force: nodes that share no neighbour cannot disturb each
other's forces, so they are moved in the same world (colouring of the squared coupling graph: Curtis, Powell & Reid
1974), and one launch over some hundred worlds gives the whole sparse matrix.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.linalg.lapack import dpotrf, dpotrs

from origami_sim.drive import Drive
from origami_sim.effects import CONTACTS, PAIRS, get
from origami_sim.model import Model, Parameters, State, curvature
from origami_sim.solve import grips
from origami_sim.solve.batch import Batch
from origami_sim.solve.skin import clear_share, near_pairs, surface
from origami_sim.solve.timestep import gradient_norms

STEP = 2e-4
"""Step of the differences over the smallest length of the elements at a node."""

STENCIL = np.array([1.0, -1.0, 2.0, -2.0])
WEIGHTS = np.array([8.0, -8.0, -1.0, 1.0]) / 12.0
"""Central differences of fourth order: truncation STEP^4, rounding eps / STEP, entries near 1e-12 of the largest."""

NEUTRAL = 1e-12
"""Eigenvalues below this share of the largest stiffness count as zero: a mode that nothing holds or loads (for rigid
motions they come out near 1e-16)."""

NULL_SHIFT = 1e-11
"""Shift of every tangent, over the largest stiffness: keeps free rigid motions solvable."""

DENSE = 600
"""Up to so many degrees of freedom eigenvalues are found densely."""

COMPACT = 150
"""Up to so many degrees of freedom factors are found densely: sparse ones take 2 to 10 times as long."""

THREADED = 20000
"""Nodes of all worlds together below which starting a thread takes as long as the forces."""

SKEW = 1e-8
"""Share of the largest stiffness up to which a tangent counts as symmetric."""


TOUCHING = 1e-4
"""Largest step of the differences over the distance at which parts touch: what touches must not part within it."""

FINER = 0.01
"""Steps of the differences at points on the ground with dry friction, as a part of those elsewhere.

Within a step no foot may go from sticking to slipping, nor off the ground: over micrometres on `Sheet.ground`. With 1 a
crawler of 40 mm on bars is lost within a cycle; 0.1, 0.02, 0.005 and (bars only) 0.001 find its stride to 1e-5 of it.
"""


def _every_two(groups: np.ndarray) -> np.ndarray:
    """Every two nodes [2, P] of each group [G, k], each with itself."""
    g = np.asarray(groups, np.int64)
    return np.stack(np.broadcast_arrays(g[:, :, None], g[:, None, :])).reshape(2, -1)


@dataclass(repr=False)
class Equilibrium:
    """An equilibrium, or where the search for it stopped.

    Printed, it is a line or two; its numbers are in the attributes.

    Attributes:
        state: one world at rest, from which a simulation can start.
        angles: [C + Q] continuous hinge angles, creases first [rad]. count: C; the first so many are `creases`.
        residual: largest unbalanced force on a free node's axis [N], of rigid panels moment of a coordinate [N m].
        tolerance: what was asked for [N], [N m].
        iterations: tangents evaluated. history: residual before each of them [N].
        converged: whether the residual is below the tolerance.
        stable: whether every eigenvalue of the tangent on the free axes is positive or zero.
        eigenvalues: lowest eigenvalues of the tangent [N/m], ascending (its real parts if it is unsymmetric); of rigid
            panels all of them [N m/rad].
        neutral: how many of them are zero: rigid motions, mechanisms, the edge of stability.
        mode: [N, 3] shape of the lowest one, largest component 1.
        reactions: [N, 3] forces that the supports exert on held axes [N]; nan for rigid panels, which share them.
        message: what happened, in a sentence. wall: time that it took [s].
        touching: which panels met, so that it was found with contact that nobody had stated; empty if none did.
        frictionless: whether it touches a ground with friction, which is left out: with it, a device rests in a range
            of states around this one, and on a slope that has none without it.
        energies: potential energy [J] by effect, of those that have one, loads, weight and fields among them.
    """

    state: State
    angles: np.ndarray
    residual: float
    tolerance: float
    iterations: int
    history: np.ndarray
    converged: bool
    stable: bool
    eigenvalues: np.ndarray
    neutral: int
    mode: np.ndarray
    reactions: np.ndarray
    message: str
    wall: float = 0.0
    touching: str = ""
    frictionless: bool = False
    energies: dict[str, float] = field(default_factory=dict)
    count: int = field(default=0, repr=False)

    @property
    def creases(self) -> np.ndarray:
        """Fold angles of the creases [C] [rad], valley positive."""
        return self.angles[: self.count]

    @property
    def energy(self) -> float:
        """Potential energy [J] of all effects that have one; of two equilibria, the difference counts."""
        return float(sum(self.energies.values()))

    def __repr__(self) -> str:
        unit = "N m/rad" if np.all(np.isnan(self.reactions)) else "N/m"
        said = [f"Equilibrium: {self.message}"]
        if len(self.angles):
            said.append(f"{len(self.angles)} hinge angles from {self.angles.min():.4g} to {self.angles.max():.4g} rad")
        if np.all(np.isfinite(self.eigenvalues[:1])) and len(self.eigenvalues):
            said.append(f"lowest eigenvalue {self.eigenvalues[0]:.3g} {unit}")
        return f"{said[0]} {'; '.join(said[1:])}{'.' * (len(said) > 1)} {self.touching}".strip()

    @property
    def x(self) -> np.ndarray:
        """Positions [N, 3] [m]."""
        return self.state.x[:, 0]


def resting(state: State, x: np.ndarray, angles: np.ndarray) -> State:
    """The state with these positions [N, 3] and angles [H], without motion."""
    out = state.copy()
    out.x, out.angles = x[:, None].copy(), angles[:, None].copy()
    out.v, out.a, out.status = np.zeros_like(out.x), np.zeros_like(out.x), np.full((2, 1), -1, np.int32)
    return out


def shifted(k: sp.csc_array, shift: float) -> sp.csc_array:
    """k + shift on the diagonal."""
    at = np.flatnonzero(k.indices == np.repeat(np.arange(k.shape[1]), np.diff(k.indptr)))
    if len(at) < k.shape[0]:  # it is not all stored
        return sp.csc_array(k + shift * sp.eye_array(k.shape[0], format="csc"))
    data = k.data.copy()
    data[at] += shift
    return sp.csc_array((data, k.indices, k.indptr), shape=k.shape)


class Factor:
    """Sparse factors of a shifted tangent.

    Attributes:
        singular: it cannot be solved with.
        definite: every pivot is positive, which for a symmetric matrix means that it is positive definite.
    """

    def __init__(self, k: sp.csc_array):
        self._lu: Any = None
        try:
            self._lu = spla.splu(k, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:  # exactly singular
            self.singular, self.definite = True, False
            return
        self.singular = False
        self.definite = np.array_equal(self._lu.perm_r, self._lu.perm_c) and bool(np.all(self._lu.U.diagonal() > 0))

    def solve(self, right: np.ndarray) -> np.ndarray:
        return self._lu.solve(right)


class Cholesky:
    """The same of a small symmetric tangent, stored densely."""

    singular = False

    def __init__(self, k: np.ndarray, shift: float):
        self._lower, info = dpotrf(k + shift * np.eye(len(k)), lower=1, clean=0)
        self.definite = info == 0

    def solve(self, right: np.ndarray) -> np.ndarray:
        return dpotrs(self._lower, right, lower=1)[0]


def _factoring(k: sp.csc_array, largest: float) -> Callable[[float], "Factor | Cholesky"]:
    """Factors of k + shift for any shift."""
    if k.shape[0] <= COMPACT:
        full = k.toarray()
        if np.abs(full - full.T).max(initial=0.0) <= SKEW * largest:
            return lambda shift: Cholesky(full, shift)
    return lambda shift: Factor(shifted(k, shift))


class System:
    """Forces and tangents of one world as functions of its positions.

    Args:
        model, parameters, drive: one world of each. state: [N, 1, 3], gives the memory.
        slips: whether points on the ground are to slip, see `FINER`; else friction is left out.
    """

    def __init__(self, model: Model, parameters: Parameters, drive: Drive, state: State, *, slips: bool = False):
        self.model, self.state = model, resting(state, state.x[:, 0], state.angles[:, 0])
        self.free = np.flatnonzero(model.free.ravel())
        self._one = Batch(model, parameters, drive, self.state)
        self.inputs = parameters, drive
        self._bound = self._couplings()
        apart = self._bound[0] < self._bound[1]
        self.edges = self._bound[:, apart].T
        lengths = np.linalg.norm(np.diff(model.position[self.edges], axis=1)[:, 0], axis=-1)
        self.size = float(np.linalg.norm(np.ptp(model.position, axis=0))) or 1.0
        self.length = float(np.median(lengths[lengths > 0])) if np.any(lengths > 0) else self.size
        self._finest = STEP * self._smallest(lengths)
        if slips:
            self._finest[np.unique(model.contacts)] *= FINER
        self.touches = bool({get(e).family for e in model.laws} & set(PAIRS))
        self.couple(self.state.x)

    def couple(self, x: np.ndarray):
        """Finds the couplings and the moves whose differences give the tangent, at positions x [N, W, 3] [m].

        Nodes of pairs that are about to touch are coupled as well; `follow` renews them.
        """
        model, (parameters, drive), n = self.model, self.inputs, len(self.model.position)
        self._steps, pairs = self._finest, [self._bound]
        if self.touches:
            self._margin, self._coupled = surface(model).margin, x.copy()
            for w in range(x.shape[1]):
                near = near_pairs(model, parameters, x[:, w], margin=self._margin)
                pairs.append(_every_two(near.nodes))
                self._steps = np.minimum(self._steps, TOUCHING * near.offset.min(initial=np.inf))
        rows, columns = np.unique(np.concatenate(pairs, axis=1), axis=1)
        self._rows, self._columns = rows, columns
        self._colours = self._colour(n)
        worlds = 3 * (self._colours.max(initial=0) + 1) * len(STENCIL)
        tiled = self.state.select(np.zeros(worlds, int))
        self._many = Batch(model, parameters, drive, tiled, threads=1 if worlds * n < THREADED else None)
        self._shape = (n, worlds // 3 // len(STENCIL), 3, len(STENCIL), 3)
        moved, moves = np.flatnonzero(self._colours >= 0), np.zeros(self._shape)
        for axis in range(3):
            moves[moved, self._colours[moved], axis, :, axis] = self._steps[moved, None] * STENCIL
        self.moves = moves.reshape(n, worlds, 3)
        of = np.flatnonzero(self._colours[columns] >= 0)
        self._pairs = rows, columns = rows[of], columns[of]
        # of every entry of all pairs' blocks [axis moved, axis of force]
        self._row = (3 * rows[:, None, None] + np.tile(np.arange(3), (3, 1))).ravel()
        self._column = (3 * columns[:, None, None] + np.tile(np.arange(3), (3, 1)).T).ravel()
        numbered = sp.csr_array((np.arange(1.0, len(self._row) + 1), (self._row, self._column)), shape=(3 * n, 3 * n))
        kept = sp.csc_array(numbered[self.free][:, self.free])
        self._pattern = kept.data.astype(int) - 1, kept.indices, kept.indptr

    def follow(self, x: np.ndarray):
        """Renews what positions x [N, W, 3] couple, if any node has moved so far that other parts may touch."""
        if self.touches and (x.shape != self._coupled.shape or np.abs(x - self._coupled).max() > 0.25 * self._margin):
            self.couple(x)

    # --- forces

    follows = False
    """Whether nodes in grips are where these are at the time asked for, wherever they are put."""

    def led(self, x: np.ndarray, time: float) -> np.ndarray:
        """Positions x [N, 3], with nodes in grips on their paths at that time if it `follows` these."""
        if not self.follows:
            return x
        return grips.held_at(self.model, x[:, None], grips.levels_at(self.model, self.inputs[1], time, 1))[:, 0]

    def force(self, x: np.ndarray, angles: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Total force [N, 3] and the angles continued from the given ones [H]."""
        self._one.place(self.led(x, time)[:, None], angles[:, None])
        f = self._one.total_force(time)[:, 0]
        return f, self._one.state().angles[:, 0] if len(angles) else angles

    def scale(self, x: np.ndarray, angles: np.ndarray, time: float) -> float:
        """Largest force of any one effect on any axis of any node [N]."""
        self._one.place(x[:, None], angles[:, None])
        return max((float(np.abs(f).max(initial=0.0)) for f in self._one.evaluate(time).forces.values()), default=0.0)

    def energies(self, points: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> dict[str, np.ndarray]:
        """Potential energy [P] [J] by effect that has one, at positions [N, 3] with angles [H], each at its time."""
        found = []
        for x, angles, time in points:
            self._one.place(x[:, None], angles[:, None])
            found.append(self._one.evaluate(time).energies)
        return {n: np.array([e[n][0] for e in found]) for n in (found[0] if found else ())}

    def by_factor(self, x: np.ndarray, angles: np.ndarray, time: float, h: float) -> np.ndarray:
        """dF/dt [N, 3] at fixed positions."""
        return np.einsum("snc,s->nc", [self.force(x, angles, time + s * h)[0] for s in STENCIL], WEIGHTS) / h

    # --- tangent

    def _couplings(self) -> np.ndarray:
        """Rows and columns [2, P] of nodes of which one feels the other wherever they are, each node with itself."""
        m, families = self.model, {get(e).family for e in self.model.laws}
        groups = [np.arange(len(m.position))[:, None]]
        for family, elements in (("bar", m.bars), ("crease", m.creases), ("bend", m.bends), ("triangle", m.triangles)):
            if family in families:
                groups.append(elements)
        if "plate" in families:
            groups.append(gradient_norms(m, "plate")[0])
        if "membrane" in families:
            groups.append(curvature.of(m).reach(m.triangles, m.bends))
        if families & set(CONTACTS):
            groups.append(m.contacts)
        if any(get(e).interacts for e in m.laws):
            groups.append(np.unique(m.triangles[self._one.magnets >= 0])[None])
        return np.unique(np.concatenate([_every_two(g) for g in groups], axis=1), axis=1)

    def _smallest(self, lengths: np.ndarray) -> np.ndarray:
        """Smallest edge or height of the elements at each node [N] [m]."""
        m = self.model
        out = np.full(len(m.position), self.length)
        for c in (0, 1):
            np.minimum.at(out, self.edges[:, c], np.where(lengths > 0, lengths, self.length))
        hinges = np.concatenate([m.creases, m.bends]).reshape(-1, 4)
        corners = np.concatenate([hinges[:, [1, 2, 0]], hinges[:, [1, 2, 3]], m.triangles.reshape(-1, 3)])
        a, b, c = (m.position[corners[:, i]] for i in range(3))
        longest = np.max([np.linalg.norm(e, axis=-1) for e in (b - a, c - b, a - c)], axis=0)
        height = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / np.where(longest > 0, longest, 1.0)
        for i in range(3):
            np.minimum.at(out, corners[:, i], np.where(height > 0, height, self.length))
        return out

    def _colour(self, n: int) -> np.ndarray:
        """Colour of each node: two of one colour have no neighbour in common."""
        near = sp.csr_array((np.ones(len(self._rows), np.int32), (self._rows, self._columns)), shape=(n, n))
        clash = sp.csr_array(near.T @ near)
        movable = np.asarray(self.model.free.any(axis=1))
        colours = np.full(n, -1)
        for i in np.argsort(-np.diff(clash.indptr), kind="stable"):
            if movable[i]:
                taken = set(colours[clash.indices[clash.indptr[i] : clash.indptr[i + 1]]])
                colours[i] = next(c for c in range(n) if c not in taken)
        return colours

    def tangent(self, x: np.ndarray, angles: np.ndarray, time: float) -> sp.csr_array:
        """K = -dF/dx [3 N, 3 N] [N/m]."""
        n = len(x)
        self.follow(x[:, None])
        self._many.place(x[:, None] + self.moves, np.repeat(angles[:, None], self.moves.shape[1], axis=1))
        blocks = self._blocks(self._many.total_force(time))
        k = sp.csr_array((blocks.ravel(), (self._row, self._column)), shape=(3 * n, 3 * n))
        return k @ sp.diags_array(self.model.free.ravel().astype(float), format="csr")

    def assembled(self, force: np.ndarray) -> sp.csc_array:
        """Tangent on the free axes from the forces [N, copies, 3] on copies that are moved by `moves`."""
        taken, rows, starts = self._pattern
        size = len(self.free)
        return sp.csc_array((self._blocks(force).ravel()[taken], rows, starts), shape=(size, size))

    def _blocks(self, force: np.ndarray) -> np.ndarray:
        """[pairs, axis moved, axis of force] of the tangent."""
        slopes = -np.einsum("ncasb,s->ncab", force.reshape(self._shape), WEIGHTS)
        rows, columns = self._pairs
        return slopes[rows, self._colours[columns]] / self._steps[columns, None, None]

    def reduced(self, x: np.ndarray, angles: np.ndarray, time: float) -> tuple[sp.csc_array, float, bool]:
        """Tangent on the free axes, its largest entry [N/m] and whether it is symmetric (then made exactly so)."""
        k = sp.csc_array(self.tangent(x, angles, time)[self.free][:, self.free])
        largest = float(np.abs(k.data).max(initial=0.0)) or 1.0
        skew = abs(sp.csc_array(k - k.T))
        symmetric = float(skew.max()) <= SKEW * largest
        return sp.csc_array(0.5 * (k + k.T)) if symmetric else k, largest, symmetric

    def spectrum(
        self, k: sp.csc_array, largest: float, symmetric: bool, count: int = 8
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lowest eigenvalues [N/m] and the mode [N, 3] of the lowest."""
        n = k.shape[0]
        if n <= DENSE:
            values, vectors = np.linalg.eigh(k.toarray()) if symmetric else np.linalg.eig(k.toarray())
        else:
            shift = self.definite(k, largest, 0.0)[1]
            v0 = np.random.default_rng(0).standard_normal(n)  # fixed, so that runs repeat
            find = spla.eigsh if symmetric else spla.eigs
            values, vectors = find(k, k=min(count, n - 2), sigma=-2 * shift, which="LM", v0=v0)
        order = np.argsort(np.real(values))[:count]
        mode = np.zeros(self.model.position.size)
        mode[self.free] = np.real(vectors[:, order[0]])
        peak = mode[np.abs(mode).argmax()]
        return np.real(values)[order], (mode / (peak or 1.0)).reshape(-1, 3)

    @staticmethod
    def definite(k: sp.csc_array, largest: float, least: float) -> tuple["Factor | Cholesky", float]:
        """Factors of k + shift, with the shift raised from `least` until they are positive definite."""
        shift = max(least, NULL_SHIFT * largest)
        factors = _factoring(k, largest)
        factor = factors(shift)
        raised = False
        while not factor.definite:
            raised, shift = True, 4.0 * shift
            factor = factors(shift)
        if raised:  # away from the edge, so that the weakest direction does not take the whole step
            shift *= 2.0
            factor = factors(shift)
        return factor, shift

    # --- equilibrium

    def reach(self, x: np.ndarray, d: np.ndarray) -> float:
        """Largest share of a move d [N, 3] that turns and strains no element by half, nor passes panels through."""
        apart = np.linalg.norm(x[self.edges[:, 1]] - x[self.edges[:, 0]], axis=-1)
        change = np.linalg.norm(d[self.edges[:, 1]] - d[self.edges[:, 0]], axis=-1)
        share = min(1.0, float(np.min(0.5 * apart / np.maximum(change, 1e-300), initial=1.0)))
        share = min(share, self.size / max(float(np.linalg.norm(d, axis=-1).max()), 1e-300))
        return share * self.clear(x, share * d)

    def clear(self, x: np.ndarray, d: np.ndarray) -> float:
        """Largest share of a move d [N, 3] from x [N, 3] on which panels come no nearer than they may."""
        return clear_share(self.model, self.inputs[0], x, d) if self.touches else 1.0

    def spread(self, p: np.ndarray) -> np.ndarray:
        """A vector on the free axes as [N, 3]."""
        out = np.zeros(self.model.position.size)
        out[self.free] = p
        return out.reshape(-1, 3)

    def noise(self, x: np.ndarray, largest: float) -> float:
        """Rounding error of the forces [N]."""
        return 8 * np.finfo(float).eps * largest * float(np.abs(x).max())

    def settle(self, x, angles, time, tolerance, max_iterations, unstable) -> Equilibrium:
        """See `equilibrium`."""
        history: list[float] = []
        shift, pushes, message, converged = 0.0, 0, "", False
        values, mode = np.full(1, np.nan), np.zeros_like(x)
        f, angles = self.force(x, angles, time)
        while True:
            r = f.ravel()[self.free]
            residual = float(np.abs(r).max())
            history.append(residual)
            k, largest, symmetric = self.reduced(x, angles, time)
            target = max(tolerance * self.scale(x, angles, time), self.noise(x, largest))
            if not np.all(np.isfinite(k.data)) or not np.isfinite(residual):
                message = f"a force is not a number at node {int(np.argmax(~np.isfinite(f).all(axis=1)))}"
                break
            if residual <= target:
                x, f, angles = self._polished(x, f, angles, time, k, largest)
                residual = float(np.abs(f.ravel()[self.free]).max())
                values, mode = self.spectrum(k, largest, symmetric)
                if unstable or values[0] >= -NEUTRAL * largest or pushes == 4 or len(history) >= max_iterations:
                    converged = True
                    break
                pushes += 1
                x = x + 0.02 * self.length * mode * self.reach(x, 0.02 * self.length * mode)
                f, angles = self.force(x, angles, time)
                continue
            if len(history) >= max_iterations:
                message = f"no equilibrium within {max_iterations} iterations"
                break
            damped = len(history) > max_iterations // 2
            taken = self._newton(x, f, angles, time, k, largest, shift, unstable, damped)
            if taken is None:
                message = "no step brings the forces closer to balance; a law may have a jump here"
                break
            x, f, angles, shift = taken
        if message:
            values, mode = np.full(1, np.nan), np.zeros_like(x)
            net = np.abs(f.sum(axis=0)).max()
            if self.model.free.all() and net > max(target, 1e-6 * abs(residual)):
                message += f"; nothing holds the body against a net force of {net:.3g} N"
            message += f" (residual {residual:.3g} N at node {self._worst(f)}, asked for {target:.3g} N)."
        neutral = int((np.abs(values) <= NEUTRAL * largest).sum())
        stable = converged and bool(values[0] >= -NEUTRAL * largest)
        if converged:
            kind = "stable" if stable else "unstable"
            message = f"{kind} equilibrium after {len(history)} iterations, residual {residual:.3g} N"
            message += f", {neutral} neutral modes." if neutral else "."
        return Equilibrium(
            state=resting(self.state, x, angles),
            angles=angles,
            residual=residual,
            tolerance=target,
            iterations=len(history),
            history=np.array(history),
            converged=converged,
            stable=stable,
            eigenvalues=values,
            neutral=neutral,
            mode=mode,
            reactions=np.where(self.model.free > 0, 0.0, -f),
            message=message,
            count=len(self.model.creases),
        )

    def _worst(self, f: np.ndarray) -> int:
        return int(self.free[np.abs(f.ravel()[self.free]).argmax()] // 3)

    def _polished(self, x, f, angles, time, k, largest):
        """One more Newton step where it helps: the residual is small, but soft modes may still be off."""
        factor = Factor(k + NULL_SHIFT * largest * sp.eye_array(k.shape[0], format="csc"))
        if not factor.singular:
            d = self.spread(factor.solve(f.ravel()[self.free]))
            if np.all(np.isfinite(d)) and np.abs(d).max() <= 1e-3 * self.length:
                new, turned = self.force(x + d, angles, time)
                if np.abs(new.ravel()[self.free]).max() <= np.abs(f.ravel()[self.free]).max():
                    return x + d, new, turned
        return x, f, angles

    def _newton(self, x, f, angles, time, k, largest, shift, unstable, damped):
        """One step: new positions, forces, angles and the shift to begin with next time; None if none helps."""
        r = f.ravel()[self.free]
        if unstable:
            factor, shift = Factor(k + NULL_SHIFT * largest * sp.eye_array(k.shape[0], format="csc")), 0.0
            if factor.singular:
                return None
        else:
            factor, shift = self.definite(k, largest, shift / 16)
        for _ in range(8):
            p = factor.solve(r)
            d = self.spread(p)
            full = share = self.reach(x, d)
            while share > 1e-3 * full:
                new, turned = self.force(x + share * d, angles, time)
                rest = new.ravel()[self.free]
                off = math.inf
                if np.all(np.isfinite(rest)) and np.abs(turned - angles).max(initial=0.0) < 1.0:
                    # what the linear model, F - share K p, misses
                    missed = factor.solve(rest - r + share * (k @ p)) if damped else np.zeros(1)
                    off = float(np.linalg.norm(missed) / (share * np.linalg.norm(p)))
                if off <= 0.5:
                    return x + share * d, new, turned, shift
                share *= min(0.5, max(0.1, 0.35 / off))
            if unstable:
                return None
            factor, shift = self.definite(k, largest, 64 * max(shift, NULL_SHIFT * largest))
        return None
