"""Implicit dynamics: long steps for stiff parts and slow holds, with the force averaged along each step.

    M (v1 - v0) / h = mean of F over the step,    (x1 - x0) / h = (v0 + v1) / 2

Nodes go straight from x0 to x1, and two Gauss points take the mean (average vector field: Quispel & McLaren 2008,
J. Phys. A 41 045206): what the force does along the path is what the potential energy loses, so energy is kept at every
length of step, through a snap as well. Only lengths and angles do not follow the straight path, on which a bar that
turns would be pressed together, but go evenly from their first to their last value, with the mean of their gradient
(discrete gradients: Gonzalez 1996, J. Nonlinear Sci. 6 449): stiff bars may turn by any step, which they may not under
the implicit midpoint rule. Second order; momentum is kept, angular momentum exactly by bars and else to second order.

Nothing is damped: modes with periods below the step, once excited, ring on from step to step. A spectral radius below 1
damps just these (generalised-alpha, Chung & Hulbert 1993; the two points then draw together about its instant of
balance). Contact and friction are not smooth: a step over their onset is of first order, and may gain or lose energy.

Newton's tangent comes from coloured central differences of the averaged force (see `system`). A difference moves the
end of the step, and with it velocity, turn and slip, so stiffness, damping and memory are in it together. It is kept
from iteration to iteration and from step to step for as long as it converges well.

Every evaluation begins with the memory of the beginning of the step; memory advances once, when a step is accepted.
"""

import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
import warp as wp

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.solve import grips
from origami_sim.solve.batch import Batch
from origami_sim.solve.program.averaging import kernel
from origami_sim.solve.statics.system import STEP, System
from origami_sim.solve.timestep import stable_step

TOLERANCE = 1e-5
"""Position error of one step over the size of the structure, where the step is adapted."""

NEWTON = 1e-12
"""Last correction of a node over the median length of the elements, unless rounding ends the iteration before."""

DIFFERENCE = 0.05 * STEP
"""Step of the differences over the smallest length at a node; two-point differences, exact enough for Newton."""

ITERATIONS = 25
"""Corrections that a step may take before it is halved."""

SLOW = 0.1
"""Convergence at which the tangent is renewed: each correction still that share of the one before."""

TURN = 1.0
"""A hinge turns at most so much in one step [rad], so that its angle can be continued."""

START, SHORTEST = 1e-2, 1e-3
"""Adapted steps begin with the first, and steps are halved down to the second share of the explicit solver's step."""


@dataclass(frozen=True)
class Scheme:
    """Newmark relations and the instant of balance, by the spectral radius at infinite frequency (1: no damping).

    Attributes:
        am, af: shares of the old acceleration and of the old force in the balance. beta, gamma: of Newmark.
        points: where along the step the force is averaged.
    """

    radius: float = 1.0

    @property
    def am(self) -> float:
        return (2 * self.radius - 1) / (1 + self.radius)

    @property
    def af(self) -> float:
        return self.radius / (1 + self.radius)

    @property
    def gamma(self) -> float:
        return 0.5 - self.am + self.af

    @property
    def beta(self) -> float:
        return 0.25 * (1 - self.am + self.af) ** 2

    @property
    def points(self) -> tuple[float, float]:
        spread = self.af / math.sqrt(3.0)
        return 1 - self.af - spread, 1 - self.af + spread


class _Copies(Batch):
    """One world many times over, each copy at one point of a step (0 and 1: of the average, 2: its end).

    Attributes (writable views): x0 [N, 3] and x [N, W, 3], where the step begins and ends; v, a, f [N, W, 3]; angles
    [H, W], memory [M, W], power [E, W].
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        scheme: "Scheme",
        which,
        threads: int | None,
    ):
        one, two = scheme.points
        self.shares, others = (np.array(at)[which] for at in ((one, two, 1.0), (two, one, 1.0)))
        super().__init__(model, parameters, drive, state.select(np.zeros(len(self.shares), int)), threads=threads)
        own = [wp.array(state.x[:, 0], dtype=wp.vec3d, device=self.device)]
        own.append(self._room(max(len(state.x), 1), dtype=wp.vec3d))
        own += [wp.array(a, dtype=wp.float64, device=self.device) for a in (self.shares, others, np.zeros(2))]

        def view(a: wp.array, rows: int) -> np.ndarray:
            return a.numpy()[:rows, : self.worlds]

        n, hinges = len(model.position), len(state.angles)
        self.v, self.a, self.f, self.x = (view(a, n) for a in (self._v, self._a, self._f, own[1]))
        self.x0, self._begin = own[0].numpy(), own[4].numpy()
        self.angles, self.memory = view(self._angles, hinges), view(self._memory, len(state.memory))
        self.power = view(self._power, len(state.power))
        averaged = kernel(model.effects)
        wp.load_module(averaged.module, device=self.device)
        arrays = [*self._constants, self._x, self._v, self._angles, self._memory, self._a, self._f, self._work]
        arrays += [self._power, *own]
        cuts = np.linspace(0, self.worlds, self.threads + 1).astype(int)
        self._commands: list[Any] = [
            wp.launch(averaged, dim=int(hi - lo), inputs=[*arrays, int(lo)], device=self.device, record_cmd=True)
            for lo, hi in itertools.pairwise(cuts)
        ]
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None

    def run(self, angles: np.ndarray, memory: np.ndarray, time: float, h: float) -> np.ndarray:
        """Forces [N, W, 3] within steps of h from `time` to the positions set, with the velocities set.

        Angles [H] and memory [M] are those of the beginning; the attributes hold the new ones afterwards.
        """
        self.angles[:], self.memory[:] = angles[:, None], memory[:, None]
        self._begin[:] = time, h
        if self._pool is None:
            self._commands[0].launch()
        else:
            list(self._pool.map(lambda c: c.launch(), self._commands))
        return self.f


@dataclass
class _Motion:
    """One world at one instant: what State says of it, and the scheme's own acceleration [N, 3]."""

    time: float
    x: np.ndarray
    v: np.ndarray
    acceleration: np.ndarray
    angles: np.ndarray
    memory: np.ndarray
    work: np.ndarray
    force: np.ndarray
    power: np.ndarray


@dataclass
class Counts:
    """What the steps of a run cost."""

    steps: int = 0
    iterations: int = 0
    tangents: int = 0
    factors: int = 0
    rejected: int = 0
    halved: int = 0
    shortest: float = math.inf
    longest: float = 0.0


class _Unsolved(Exception):
    """Newton found no end of the step."""

    def __init__(self, cause: str, node: int):
        super().__init__(cause)
        self.node = node


class _World:
    """Steps of one world.

    Args:
        model, parameters, drive, state: of one world, which starts at `time` [s].
        tolerance: of adapted steps; None takes the steps asked for.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        time: float,
        scheme: Scheme,
        tolerance: float | None,
        threads: int | None,
    ):
        self.model, self.scheme, self.tolerance = model, scheme, tolerance
        self.first = min(stable_step(model, parameters).dt, 1.0)  # infinite where nothing is stiff
        self.system = System(model, parameters, drive, state)
        self.free = self.system.free
        self.mass = np.broadcast_to(node_mass(model, parameters), (len(model.position), 1))
        self._ends = _Copies(model, parameters, drive, state, scheme, np.arange(3), 1)
        self._inputs = model, parameters, drive, state, scheme
        self._threads = threads
        self._couple()
        self._slopes: sp.csc_array | None = None
        self._factors, self._factored, self._scale = None, 0.0, 0.0
        self._past: list[tuple[float, np.ndarray]] = []
        self._drive, self._gripped = drive, grips.held(model) if grips.moving(model, drive) else None
        self._next = START * self.first
        self.counts = Counts()
        s = state
        a = s.a[:, 0] * model.free
        self.now = _Motion(
            time, s.x[:, 0], s.v[:, 0], a, s.angles[:, 0], s.memory[:, 0], s.work[:, 0], a * self.mass, s.power[:, 0]
        )

    def _couple(self):
        """Copies of the world, moved as the system's couplings ask."""
        self._colours = self.system._colours
        self._steps = DIFFERENCE / STEP * self.system._steps
        self._shape = (len(self.model.position), 2, int(self._colours.max(initial=0)) + 1, 3, 2, 3)
        self._moved = _Copies(*self._inputs, np.repeat([0, 1], math.prod(self._shape[2:5])), self._threads)

    # --- one step

    def _kinematics(self, u: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration at the end of a step that moves by u [N, 3]."""
        s, m = self.scheme, self.now
        a = (u - h * m.v - h**2 * (0.5 - s.beta) * m.acceleration) / (s.beta * h**2) * self.model.free
        v = m.v + h * ((1 - s.gamma) * m.acceleration + s.gamma * a)
        if self._gripped is not None:
            motion = grips.motion_at(self.model, self._drive, m.time + h, 1)
            v = np.where(self._gripped, grips.velocities(self.model, (m.x + u)[:, None], motion)[:, 0], v)
        return v, a

    def _led(self, u: np.ndarray, h: float) -> np.ndarray:
        """A move [N, 3] within a step of h in which nodes in grips end on their paths."""
        if self._gripped is None:
            return u
        there = grips.placed(self.model, grips.levels_at(self.model, self._drive, self.now.time + h, 1))[:, 0]
        return np.where(self._gripped, there - self.now.x, u)

    def _place(self, copies: _Copies, u: np.ndarray, v: np.ndarray, h: float):
        """Sets positions, velocities and slips of copies whose step moves by u [N, W, 3] and ends with v."""
        within = np.where(copies.shares < 1.0, 1 - self.scheme.af, 1.0)[None, :, None]
        copies.x0[:] = self.now.x
        copies.x[:] = self.now.x[:, None] + u
        copies.v[:] = self.now.v[:, None] + within * (v - self.now.v[:, None])
        if self._gripped is not None:  # within a step they go evenly, as it counts the work of losses
            even = self._gripped[:, None] & (copies.shares < 1.0)[None, :, None]
            copies.v[:] = np.where(even, u / h, copies.v)
        copies.a[:] = copies.v - u / h

    def _residual(self, u: np.ndarray, h: float) -> np.ndarray:
        """Inertia less averaged force on the free axes; leaves both ends of the step in `_ends`."""
        v, a = self._kinematics(u, h)
        self._place(self._ends, u[:, None], v[:, None], h)
        f = self._ends.run(self.now.angles, self.now.memory, self.now.time, h)
        inertia = self.mass * ((1 - self.scheme.am) * a + self.scheme.am * self.now.acceleration)
        return (inertia - 0.5 * (f[:, 0] + f[:, 1])).ravel()[self.free]

    def _difference(self, u: np.ndarray, h: float):
        """Renews the slopes -dF/du of the averaged force."""
        s, n, k = self.scheme, len(u), self.system
        k.follow((self.now.x + u)[:, None])
        if k._colours is not self._colours:
            self._couple()
        moved = np.flatnonzero(self._colours >= 0)
        moves = np.zeros(self._shape)
        for axis in range(3):
            moves[moved, :, self._colours[moved], axis, :, axis] = self._steps[moved, None, None] * np.array([1.0, -1])
        moves = moves.reshape(n, -1, 3)
        v = self._kinematics(u, h)[0]
        self._place(self._moved, u[:, None] + moves, v[:, None] + s.gamma / (s.beta * h) * moves, h)
        f = self._moved.run(self.now.angles, self.now.memory, self.now.time, h).reshape(self._shape)
        slopes = -0.25 * (f[..., 0, :] - f[..., 1, :]).sum(axis=1)  # [row node, colour, axis moved, axis of force]
        of = np.flatnonzero(self._colours[k._columns] >= 0)
        rows, columns = k._rows[of], k._columns[of]
        blocks = slopes[rows, self._colours[columns]] / self._steps[columns, None, None]
        i = np.broadcast_to(3 * rows[:, None, None] + np.arange(3)[None, None, :], blocks.shape)
        j = np.broadcast_to(3 * columns[:, None, None] + np.arange(3)[None, :, None], blocks.shape)
        whole = sp.csc_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(3 * n, 3 * n))
        self._slopes = sp.csc_array(whole[self.free][:, self.free])
        self._scale = float(np.abs(self._slopes.data).max(initial=0.0))
        self._factored = 0.0
        self.counts.tangents += 1
        if not np.isfinite(self._scale):
            self._slopes = None
            raise _Unsolved("a force is not a number", self._worst(f.sum(axis=(1, 2, 3, 4))))

    def _factorise(self, h: float):
        """Renews the factors of inertia plus slopes for a step h."""
        assert self._slopes is not None
        s = self.scheme
        inertia = (1 - s.am) / (s.beta * h**2) * np.repeat(self.mass, 3, axis=1).ravel()[self.free]
        try:
            self._factors = spla.splu(sp.csc_array(self._slopes + sp.diags_array(inertia)), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:  # exactly singular
            self._slopes = None
            raise _Unsolved("the tangent is singular", 0) from None
        self._factored = h
        self.counts.factors += 1

    def _worst(self, f: np.ndarray) -> int:
        size = np.abs(f).max(axis=-1)
        return int(np.argmax(np.where(np.isfinite(size), size, np.inf)))

    def _solve(self, u: np.ndarray, h: float) -> np.ndarray:
        """The move [N, 3] of a step h, from a guess: modified Newton.

        Where bars are stiff, useful corrections first stretch them and the next ones relax them again, so at first
        none is asked to be smaller than the one before; later ones are, or are shortened (natural monotonicity).
        """
        target, noise = NEWTON * self.system.length, 0.0
        r, d, size, ratio, fresh = self._residual(u, h), None, math.inf, 1.0, False
        for attempt in range(ITERATIONS):
            if not np.all(np.isfinite(r)):
                raise self._unsolved("a force is not a number", r)
            if d is None:
                if fresh or self._slopes is None:
                    self._difference(u, h)
                    fresh = True
                if self._factored != h:
                    self._factorise(h)
                d, size = self._correction(r)
                noise = self.system.noise(self.now.x, self._scale)
            self.counts.iterations += 1
            if size * ratio <= target:
                return u + d
            share = self.system.reach(self.now.x + u, d)
            while True:
                r_new = self._residual(u + share * d, h)
                d_new, ahead = self._correction(r_new)
                if ahead <= (1 - 0.25 * share) * size or not fresh or share < 0.05:
                    break
                if attempt < ITERATIONS // 2 and ahead < math.inf:
                    break
                share *= 0.5
            if np.abs(r).max() <= noise and not ahead <= 0.5 * size:
                return u  # rounding allows no more
            if not ahead <= size and not fresh:  # the tangent is out of date: once more from here
                d, fresh, ratio = None, True, 1.0
                continue
            if share < 0.05:
                raise self._unsolved("Newton's corrections do not get smaller", r)
            ratio = ahead / size if share == 1.0 else 1.0
            u, r, d, size, fresh = u + share * d, r_new, d_new, ahead, False
            if ratio > SLOW and size * ratio > target:
                d, fresh, ratio = None, True, 1.0
        raise self._unsolved(f"Newton does not converge within {ITERATIONS} corrections", r)

    def _correction(self, r: np.ndarray) -> tuple[np.ndarray, float]:
        """Newton's correction [N, 3] with the present factors and its largest component; infinite if r is no number."""
        if self._factors is None or not np.all(np.isfinite(r)):
            return np.zeros_like(self.now.x), math.inf
        d = self.system.spread(self._factors.solve(-r))
        size = float(np.abs(d).max())
        return d, size if math.isfinite(size) else math.inf

    def _unsolved(self, what: str, r: np.ndarray) -> _Unsolved:
        return _Unsolved(f"{what} (unbalanced by {np.abs(r).max():.3g} N)", self._worst(self.system.spread(r)))

    def _advanced(self, u: np.ndarray, h: float) -> _Motion:
        """The motion at the end of a step that moves by u; memory, angles and work advance."""
        v, a = self._kinematics(u, h)
        r = self._residual(u, h)
        e, m = self._ends, self.now
        turned = np.abs(e.angles - m.angles[:, None]).max(initial=0.0)
        if not (np.all(np.isfinite(r)) and np.all(np.isfinite(e.f)) and turned <= TURN):
            hinges = np.concatenate([self.model.creases, self.model.bends])
            worst = int(hinges[np.abs(e.angles[:, 2] - m.angles).argmax(), 0]) if turned > TURN else 0
            raise _Unsolved("a hinge turns too far in one step" if turned > TURN else "a force is not a number", worst)
        work = m.work + h * 0.5 * (e.power[:, 0] + e.power[:, 1])
        if self._gripped is not None:
            taken = 0.5 * self.mass * (v**2 - m.v**2) - 0.5 * (e.f[:, 0] + e.f[:, 1]) * u
            work[-1] = m.work[-1] + taken[self._gripped].sum()
        a = a if self.scheme.radius < 1 else np.zeros_like(a)  # without damping only its mean over the step counts
        return _Motion(
            time=m.time + h,
            x=m.x + u,
            v=v,
            acceleration=a,
            angles=e.angles[:, 2].copy(),
            memory=e.memory[:, 2].copy(),
            work=work,
            force=e.f[:, 2].copy(),
            power=e.power[:, 2].copy(),
        )

    def _guess(self, h: float) -> tuple[np.ndarray, float]:
        """The move [N, 3] that continues the last steps by a parabola, and the share of its error that the step makes.

        The step errs by h^3 x''' / 12, the parabola by h (h + h1) (h + h1 + h2) x''' / 6.
        """
        m, past = self.now, self._past
        if len(past) < 2:
            return h * m.v, 0.0
        h1, h2 = m.time - past[-1][0], past[-1][0] - past[-2][0]
        d1, d2 = (m.x - past[-1][1]) / h1, (past[-1][1] - past[-2][1]) / h2
        u = h * d1 + h * (h + h1) * (d1 - d2) / (h1 + h2)
        return np.where(self.model.free > 0, u, h * m.v), 0.5 * h**2 / ((h + h1) * (h + h1 + h2))

    # --- many steps

    def until(self, end: float, dt: float):
        """Steps up to `end` [s] in steps of dt, or adapted ones; raises _Unsolved where none is short enough."""
        c, size = self.counts, self.system.size
        h = self._next if self.tolerance is not None else dt
        while (left := end - self.now.time) > 1e-9 * dt:
            took = left if h >= left * (1 - 1e-9) else (0.5 * left if 2 * h > left else h)
            guess, share = self._guess(took)
            guess = self._led(guess, took)
            try:
                within = self._led(self.system.reach(self.now.x, guess) * guess, took)
                after = self._advanced(self._solve(within, took), took)
            except _Unsolved:
                self._slopes = None
                if 0.5 * took < SHORTEST * self.first:
                    raise
                c.halved += 1
                h = self._next = 0.5 * took
                continue
            if self.tolerance is None:
                h = min(2 * took, dt) if took < dt else dt
            else:
                error = share * float(np.linalg.norm(after.x - self.now.x - guess, axis=-1).max()) / size
                factor = min(2.0, 0.9 * (self.tolerance / max(error, 1e-300)) ** (1 / 3))
                if error > 1.5 * self.tolerance:
                    c.rejected += 1
                    h = self._next = took * max(0.2, factor)
                    continue
                # a slightly longer step is not worth new factors
                h = took * factor if not 1.0 <= factor < 1.25 else took
                if took < self._next and factor >= 1.0:  # it was only cut to fit in
                    h = max(h, self._next)
                self._next = h
            c.steps += 1
            c.shortest, c.longest = min(c.shortest, took), max(c.longest, took)
            self._past = [*self._past[-1:], (self.now.time, self.now.x)]
            self.now = after
        self.now.time = end


class Implicit(Batch):
    """A batch whose worlds advance implicitly, one after the other.

    Args:
        radius: spectral radius at infinite frequency, in [0, 1]; below 1 it damps modes faster than the step.
        tolerance: position error of one step over the size of the structure; the step is then adapted within every
            `dt` of `advance`. None takes steps of dt, halved only where Newton finds no solution.

    Attributes:
        stopped: world -> (time [s], cause) of those that could not go on.

    Raises:
        InputError: a device other than the CPU, radius or tolerance out of bounds, no node free to move.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        *,
        radius: float = 1.0,
        tolerance: float | None = TOLERANCE,
        device: str = "cpu",
        threads: int | None = None,
    ):
        super().__init__(model, parameters, drive, state, device=device, threads=threads)
        if self.device.is_cuda:
            raise InputError("implicit steps run on the CPU", field="device", value=device, allowed="cpu")
        if not 0 <= radius <= 1:
            raise InputError("no such spectral radius", field="spectral_radius", value=radius, allowed="0 to 1")
        if tolerance is not None and not (tolerance > 0 and math.isfinite(tolerance)):
            raise InputError("steps need a positive tolerance", field="tolerance", value=tolerance, allowed="> 0")
        if not np.any(model.free):
            raise InputError("implicit steps need a node that is free to move", field="free", value=0)
        scheme = Scheme(radius)
        self.stopped: dict[int, tuple[float, str]] = {}
        self._options = scheme, tolerance, threads
        self._inputs = parameters, drive
        self._worlds: list[_World] = []

    def advance(self, steps: int, dt: float, speed_limit: float):
        """So many steps of dt [s], each split further if the step is adapted or halved."""
        fresh = self.step < 0
        begin = max(self.step, 0)
        if fresh:
            super().advance(0, dt, math.inf)  # the accelerations at the start
        if not self._worlds:
            state = self.state()
            parameters, drive = self._inputs
            self._worlds = [
                _World(
                    self.model,
                    parameters.world(w if parameters.worlds > 1 else 0),
                    one_world(drive, w),
                    state.select(np.array([w])),
                    begin * dt,
                    *self._options,
                )
                for w in range(self.worlds)
            ]
        self.step = begin + steps
        status = self._status.numpy()
        for w, world in enumerate(self._worlds):
            if status[0, w] >= 0:
                continue
            try:
                for i in range(begin, begin + steps):
                    world.until((i + 1) * dt, dt)
            except _Unsolved as failure:
                time = world.now.time
                status[:, w] = math.ceil(time / dt), failure.node
                self.stopped[w] = time, f"no step down to {SHORTEST * world.first:.2g} s leads on: {failure}"
            self._write(w, world)

    def _write(self, w: int, world: _World):
        m = world.now
        for array, value in (
            (self._x, m.x),
            (self._v, m.v),
            (self._a, self.model.free * m.force / world.mass),
            (self._angles, m.angles),
            (self._memory, m.memory),
            (self._work, m.work),
            (self._power, m.power),
        ):
            array.numpy()[: len(value), w] = value

    @property
    def counts(self) -> list[Counts]:
        """What each world's steps cost."""
        return [w.counts for w in self._worlds]

    def notes(self) -> list[str]:
        """A sentence on the steps of each world."""
        out = []
        for w, c in enumerate(self.counts):
            if not c.steps:
                continue
            text = f"Implicit, world {w}: {c.steps} steps of {c.shortest:.3g} to {c.longest:.3g} s"
            text += f", {c.iterations} Newton corrections, {c.tangents} tangents"
            text += f", {c.rejected} steps repeated for accuracy" if c.rejected else ""
            text += f", {c.halved} halved for want of convergence" if c.halved else ""
            out.append(text + ".")
        return out


def one_world(drive: Drive, world: int) -> Drive:
    """The drive of one world."""

    def pick(value, axis: int = 0):
        a = np.asarray(value, float)
        return value if a.ndim <= axis or a.shape[axis] == 1 else np.take(a, world, axis=axis)

    names = ("offset", "amplitude", "frequency", "phase", "scale")
    return drive.replace(
        **{
            channel: replace(
                s, **{n: pick(getattr(s, n)) for n in names}, values=s.values if s.values is None else pick(s.values, 1)
            )
            for channel, s in drive.signals.items()
        }
    )
