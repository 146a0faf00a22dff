"""Statics: tangent, equilibrium and continuation, for any set of effects.

Only the total force is asked of the laws; the tangent comes from differences of it (see `system`).

Velocities are zero: rate laws vanish, and memory (bristles of the friction, relaxation) keeps its value of the given
state. Frozen bristles push back with a constant force, so friction holds no node in place here.
"""

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from origami_sim.drive import Drive, Signal
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, check_state
from origami_sim.model.clearance import gaps
from origami_sim.model.contact import engaged, may_touch
from origami_sim.model.distort import distorted
from origami_sim.solve import grips
from origami_sim.solve.oversights import refuse_start_outside_tables
from origami_sim.solve.rigid.statics import RigidSystem
from origami_sim.solve.statics.system import NEUTRAL, NULL_SHIFT, Equilibrium, System, resting
from origami_sim.solve.watch import STATED, Met, met_at, watch_of, with_memory, without_memory

if TYPE_CHECKING:
    from origami_sim.solve.motion.dynamics import Trajectory

FURTHEST = 1e4
"""Range of the path parameter, in both directions."""

ROUNDS, TOUCHING = 10, 60
"""Newton steps to a point of a path at most, and where parts touch: there they are damped. A step of the path that
takes more is halved."""

FAINTEST = 1e-6
"""Share of a Newton step below which none is taken."""


@dataclass(repr=False)
class Path:
    """Equilibria along a load path, in the order in which they were found; printed, it is a line.

    Attributes:
        factor: [P] path parameter. arc: [P] arc length, dimensionless.
        x: [P, N, 3] positions [m]. angles: [P, C + Q] continuous hinge angles [rad].
        stable: [P] whether the point is stable at a held factor.
        negative: [P] number of negative eigenvalues (at most 8 are counted beyond 600 degrees of freedom).
        lowest: [P] lowest eigenvalue of the tangent [N/m].
        limit_points: indices of the points where the factor is largest or smallest (found to the tolerance).
        branch_points: indices after which the number of negative eigenvalues changes without a limit point.
        reached: whether the path came to its end. message: why it ended. wall: time that it took [s].
        touching: which panels met, so that the path is one with contact; empty if none did.
        energies: [P] potential energy [J] by effect, of those that have one, loads and fields at the point's factor
            among them.
        model, parameters, drive: of one world, the latter by factor as if that were the time.
    """

    factor: np.ndarray
    arc: np.ndarray
    x: np.ndarray
    angles: np.ndarray
    stable: np.ndarray
    negative: np.ndarray
    lowest: np.ndarray
    limit_points: np.ndarray
    branch_points: np.ndarray
    reached: bool
    message: str
    start: State = field(repr=False)
    wall: float = 0.0
    touching: str = ""
    energies: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    model: Model | None = field(default=None, repr=False)
    parameters: Parameters | None = field(default=None, repr=False)
    drive: Drive | None = field(default=None, repr=False)

    @property
    def energy(self) -> np.ndarray:
        """Potential energy [P] [J] of all effects that have one; at one factor, barriers are differences of it."""
        return sum(self.energies.values(), np.zeros(len(self.factor)))

    @property
    def trajectory(self) -> "Trajectory":
        """The points as the frames of a motion, a point a second, for `save_run`, `export` and `write_replay`.

        Raises:
            InputError: the path has no points.
        """
        from origami_sim.solve.motion.paths import frames  # only who looks pays for it

        return frames(self)

    def __repr__(self) -> str:
        size = len(self.factor)
        to = f", factor {self.factor[0]:.4g} to {self.factor[-1]:.4g}" if size else ""
        said = f"{size} points{to}, {int(np.sum(self.stable))} of them stable, {len(self.limit_points)} limit points"
        return f"Path: {said}; {self.message} {self.touching}".strip()

    def state(self, i: int) -> State:
        """The i-th point as a state at rest of one world."""
        return resting(self.start, self.x[i], self.angles[i])


def tangent(
    model: Model,
    parameters: Parameters,
    drive: Drive | None = None,
    *,
    time: float = 0.0,
    state: State | None = None,
    world: int = 0,
) -> sp.csr_array:
    """Tangent stiffness K = -dF/dx at a state [3 N, 3 N] [N/m], row 3 n + axis; columns of held axes are empty.

    Raises:
        InputError: no such world, a drive that ends before `time`.
    """
    system, x, angles = _start(model, parameters, drive or Drive(), time, state, world)
    return system.tangent(x, angles, time)


def equilibrium(
    model: Model,
    parameters: Parameters,
    drive: Drive | None = None,
    *,
    time: float = 0.0,
    state: State | None = None,
    world: int = 0,
    tolerance: float = 1e-10,
    max_iterations: int = 300,
    unstable: bool = False,
    contact: bool = True,
) -> Equilibrium:
    """Finds the equilibrium that a state settles into, with the drive held at its value at one instant.

    Panels of which it was not stated whether they touch keep each other off: where any two lie in each other at the
    end, it is sought again with contact, and `touching` says so.

    Newton with a tangent that is shifted until it is positive definite, so that steps go downhill and leave saddles
    (at an unstable equilibrium it is pushed off along the lowest mode and goes on). A step turns and strains no element
    by more than a half, else it is shortened. It is not asked to lower the residual at once: where panels are stiffer
    than creases by many decades every useful step stretches bars and the next one relaxes them, and a monotone search
    would creep along that valley. Only if half the iterations did not suffice, steps are damped by the natural
    monotonicity test, |K^-1 (F(x + a p) - linear model)| <= a |p| / 2, which breaks cycles (Deuflhard 2011, Newton
    Methods for Nonlinear Problems, ch. 3).

    Args:
        time: instant of the drive [s].
        state: where to start (default: the reference state); its memory is kept, its velocities are not.
        world: which world of parameters, drive and state to solve.
        tolerance: largest unbalanced force over the largest force of any one effect.
        unstable: take the nearest equilibrium of any kind (plain Newton directions) instead of a stable one.
        contact: False lets panels pass through each other of which it was not stated that they touch.

    Returns:
        The equilibrium. If it was not found, `converged` is False and `message` says why; nothing is raised.

    Raises:
        InputError: a tolerance or iteration count that is not positive, no such world, no free node, a drive that
            ends before `time`, a state of another shape than the model.
    """
    _positive(tolerance=tolerance, max_iterations=max_iterations)
    began = clock.perf_counter()
    options = tolerance, max_iterations, unstable
    found = _settled(model, parameters, drive, time, state, world, *options)
    at = world if parameters.worlds > 1 else 0
    if contact and may_touch(model, parameters) and (said := met_at(model, parameters, found, at)):
        other, own = engaged(model, parameters)
        start = with_memory(other, State.at_rest(model) if state is None else state)
        again = _settled(other, own, drive, time, start, world, *options)
        found = replace(again, state=without_memory(model, again.state), touching=said)
    found.wall = clock.perf_counter() - began
    return _with_friction_named(model, parameters, found, at)


def _with_friction_named(model: Model, parameters: Parameters, found: Equilibrium, world: int) -> Equilibrium:
    """The equilibrium, which says where it has left out friction on the ground."""
    laws = [get(e) for e in model.laws]
    own = parameters.world(world) if parameters.worlds > 1 else parameters
    slips = [np.any(own[e.name, p.name]) for e in laws if e.family == "coefficient" for p in e.strengths]
    if not any(slips) or not any(e.family == "tangent" for e in laws) or not np.all(np.isfinite(found.x)):
        return found
    if not np.any(gaps(model, own, found.state.x) < 0):
        return found
    if found.neutral and found.converged:
        said = "Friction on the ground is left out: it would hold what may slide here."
    elif found.converged:
        said = "Friction on the ground is left out: with it, a device also rests beside this equilibrium."
    else:
        said = (
            "Friction on the ground is left out, which may hold the device: quasistatic() and simulate() follow that."
        )
    return replace(found, frictionless=True, message=f"{found.message} {said}")


def _settled(model, parameters, drive, time, state, world, tolerance, max_iterations, unstable) -> Equilibrium:
    """The equilibrium of the model as it is."""
    if model.panels == "rigid":
        given = _one_world(model, parameters, drive or Drive(), time, state, world)
        return Equilibrium(**RigidSystem(*given).settle(time, tolerance, max_iterations, unstable))
    system, x, angles = _start(model, parameters, drive or Drive(), time, state, world)
    found = None
    for led in _ways(model, system, x, time):
        found = system.settle(led(x), angles, time, tolerance, max_iterations, unstable)
        x, angles = (found.x, found.angles) if found.converged else (led(x), angles)
    assert found is not None
    found.energies = {n: float(e[0]) for n, e in system.energies([(found.x, found.angles, time)]).items()}
    return found


def _ways(model: Model, system: System, x: np.ndarray, time: float) -> list[Callable[[np.ndarray], np.ndarray]]:
    """What moves nodes [N, 3] with their grips, one part of the way to where these are after the other."""
    drive = system.inputs[1]
    if not grips.moving(model, drive):
        return [lambda x: x]
    at = grips.way_to(model, x[:, None], grips.levels_at(model, drive, time, 1), system.length)
    return [lambda x, a=a, b=b: grips.carried_along(model, x[:, None], a, b)[:, 0] for a, b in pairwise(at)]


def continuation(
    model: Model,
    parameters: Parameters,
    drive: Drive,
    *,
    base: Drive | None = None,
    time: float = 0.0,
    start: float = 0.0,
    end: float = 1.0,
    step: float | None = None,
    move: float | None = None,
    state: State | None = None,
    world: int = 0,
    tolerance: float = 1e-10,
    max_points: int = 200,
    stop: Callable[[float, np.ndarray], bool] | None = None,
) -> Path:
    """Follows equilibria under proportional loading, through limit points.

    Every channel of the drive is base + factor (drive - base), at one instant; `base` is no drive unless given, so
    that the factor scales fields, voltages, loads and paths of grips. It may turn back and become negative.
    Pseudo-arclength continuation with tangent predictor and orthogonal corrector (Keller 1977; Crisfield 1981); limit
    points are found where the tangent's factor component vanishes (regula falsi). Laws that depend on time itself see
    the factor.

    Panels of which it was not stated whether they touch keep each other off: where any two meet on the way, it is
    followed again with contact, and `touching` says so. Friction holds nothing on a path.

    Args:
        drive, base: the drives at factor 1 and 0. time: instant at which both are taken [s].
        start, end: factors. The path starts with the equilibrium nearest to `state` at `start`, in the direction of
            `end`, and ends where it reaches `end`.
        step: largest change of the factor from point to point (default: a twentieth of the range).
        move: largest move of a node from point to point [m] (default: a tenth of the median bar).
        stop: called with factor and positions [N, 3] of every point; True ends the path.

    Raises:
        InputError: numbers that are not positive, start equal to end, factors beyond 1e4, no such world.
    """
    if model.panels == "rigid":
        raise InputError("paths of equilibria are followed with bars", field="panels", value="rigid", allowed="elastic")
    began = clock.perf_counter()
    span = abs(end - start)
    if not (span > 0 and max(abs(start), abs(end)) < FURTHEST):
        raise InputError(
            "a path needs a finite start and another end",
            field="end",
            value=end,
            allowed=f"not {start}, within +-{FURTHEST:g}",
        )
    _positive(tolerance=tolerance, max_points=max_points, step=step or 1.0, move=move or 1.0)
    worlds = [_fixed(distorted(model, parameters, d, time), time, world) for d in (base or Drive(), drive)]

    def followed(model: Model, parameters: Parameters, state: State | None) -> Path:
        system, x, angles = _start(model, parameters, drive, time, state, world, _line(*worlds))
        system.follows = grips.moving(model, system.inputs[1])
        tracer = _Tracer(system, span, step or span / 20, move or 0.1 * system.length, tolerance)
        return tracer.follow(x, angles, start, end, max_points, stop)

    path = followed(model, parameters, state)
    try:
        path.message += _through(model, parameters.world(world if parameters.worlds > 1 else 0), path)
    except Met as met:
        other, own = engaged(model, parameters)
        again = followed(other, own, with_memory(other, State.at_rest(model) if state is None else state))
        said = f"{met.where}: contact between panels acts on this path, without friction ({STATED})."
        path = replace(again, start=without_memory(model, again.start), touching=said)
        path.message += f" {said}"
    path.wall = clock.perf_counter() - began
    return path


def _through(model: Model, parameters: Parameters, path: Path) -> str:
    """Why panels pass through each other along a path in one world, in a sentence; empty if none can.

    Raises:
        Met: panels came as near each other as they touch, from point to point straight on.
    """
    if not len(path.x):
        return ""
    numbers = np.arange(len(path.x))

    def at(number: float) -> str:
        return f"at the factor {np.interp(number, numbers, path.factor):.4g}"

    watch, said = watch_of(model, parameters, path.state(0), reference=False, when=at)
    if watch is None:
        return "".join(f" {s}" for s in said)
    for n, x in enumerate(path.x[:, :, None]):
        watch.add(float(n), x, np.zeros_like(x))
    watch.look()
    return ""


def _positive(**values):
    for name, value in values.items():
        if not (value > 0 and math.isfinite(value)):
            raise InputError("statics needs a positive number", field=name, value=value, allowed="> 0")


def _start(model, parameters, drive, time, state, world, fixed=None) -> tuple["System", np.ndarray, np.ndarray]:
    """The system of one world, and its positions [N, 3] and angles [H] to start from."""
    given = _one_world(model, parameters, drive, time, state, world, fixed)
    return System(*given), given[3].x[:, 0], given[3].angles[:, 0]


def _one_world(model, parameters, drive, time, state, world, fixed=None) -> tuple[Model, Parameters, Drive, State]:
    """Model, parameters, held drive and state of one world."""
    if state is not None:
        check_state(model, state)
    worlds = max(parameters.worlds, drive.worlds, state.worlds if state else 1)
    if not 0 <= world < worlds:
        raise InputError("there is no such world", field="world", value=world, allowed=f"0 to {worlds - 1}")
    drive.require(time)
    one = State.at_rest(model) if state is None else state.select(np.array([world if state.worlds > 1 else 0]))
    if not np.all(np.isfinite(one.x)):
        raise InputError("a position must be finite", field="state.x", value=float("nan"))
    if not np.any(model.free):
        raise InputError("statics needs a node that is free to move", field="free", value=0)
    alone = parameters.world(world if parameters.worlds > 1 else 0)
    held = fixed or _fixed(distorted(model, parameters, drive, time), time, world)
    refuse_start_outside_tables(model, alone, held, one.x)
    return model, alone, held, one


def _fixed(drive: Drive, time: float, world: int) -> Drive:
    """The drive of one world, held at its value at one instant."""
    values = {n: np.atleast_1d(s(time)) for n, s in drive.signals.items()}
    return drive.with_signals({n: Signal(offset=float(v[world if len(v) > 1 else 0])) for n, v in values.items()})


def _line(base: Drive, drive: Drive) -> Drive:
    """base + t (drive - base), for t within +-FURTHEST."""
    t = np.array([-FURTHEST, 0.0, FURTHEST])
    if base.placed and drive.placed and base.placed != drive.placed:
        raise InputError("both ends of a path need the same sources of a field", field="base")
    fuller = drive if drive.placed else base
    names = sorted(dict.fromkeys([*base.signals, *drive.signals]), key=lambda n: n.startswith("source_"))

    def end(d: Drive, name: str) -> float | np.ndarray:
        if name in d.signals:
            return d.signals[name].offset
        there = name.startswith("source_") and not name.endswith("_strength")  # where it will be, but switched off
        return fuller.signals[name].offset if there else 0.0

    ends = {n: (end(base, n), end(drive, n)) for n in names}
    return fuller.with_signals({n: Signal(offset=a, times=t, values=t, scale=b - a) for n, (a, b) in ends.items()})


@dataclass
class _Point:
    factor: float
    x: np.ndarray
    angles: np.ndarray
    k: sp.csc_array
    largest: float
    symmetric: bool
    tx: np.ndarray
    tf: float
    arc: float = 0.0
    iterations: int = 0


class _Tracer:
    """Pseudo-arclength continuation; lengths in units of the median bar, factors in units of the span."""

    def __init__(self, system: System, span: float, step: float, move: float, tolerance: float):
        self.system, self.span, self.step, self.move, self.tolerance = system, span, step, move, tolerance
        self.mx, self.mf = 1.0 / system.length**2, 1.0 / span**2

    def _bordered(self, k: sp.csc_array, largest: float, by: np.ndarray, tx: np.ndarray, tf: float):
        """Factors of [[K, -dF/dfactor], [t]] with the last row scaled to the tangent's size."""
        free = self.system.free
        weight = largest * self.system.length
        row = np.append(tx.ravel()[free] * self.mx, tf * self.mf) * weight
        shifted = k + NULL_SHIFT * largest * sp.eye_array(k.shape[0], format="csc")
        column = sp.csc_array(-by.ravel()[free][:, None])
        top, bottom = sp.hstack([shifted, column], format="csc"), sp.csc_array(row[None, :])
        whole = sp.csc_array(sp.vstack([top, bottom], format="csc"))
        try:
            return spla.splu(whole), weight
        except RuntimeError:
            return None, weight

    def correct(self, x, angles, factor, tx, tf, arc=0.0) -> _Point | None:
        """Solves for the equilibrium on the plane through (x, factor) with normal t; None if it does not converge."""
        s, last = self.system, math.inf
        h = 1e-3 * self.span
        for iteration in range(TOUCHING if s.touches else ROUNDS):
            x = s.led(x, factor)
            f, angles = s.force(x, angles, factor)
            k, largest, symmetric = s.reduced(x, angles, factor)
            if not (np.all(np.isfinite(f)) and np.all(np.isfinite(k.data))):
                return None
            by = s.by_factor(x, angles, factor, h)
            lu, weight = self._bordered(k, largest, by, tx, tf)
            if lu is None:
                return None
            residual = float(np.abs(f.ravel()[s.free]).max())
            if residual <= max(self.tolerance * s.scale(x, angles, factor), s.noise(x, largest)):
                t = lu.solve(np.append(np.zeros(len(s.free)), weight))
                new_x, new_f = s.spread(t[:-1]), float(t[-1])
                size = math.sqrt(self.mx * (new_x**2).sum() + self.mf * new_f**2)
                if not (np.isfinite(size) and size > 0):
                    return None
                return _Point(factor, x, angles, k, largest, symmetric, new_x / size, new_f / size, arc, iteration)
            d = lu.solve(np.append(f.ravel()[s.free], 0.0))
            dx, df = s.spread(d[:-1]), float(d[-1])
            size = math.sqrt(self.mx * (dx**2).sum() + self.mf * df**2)
            if not np.isfinite(size):
                return None
            share = s.reach(x, dx)
            if not s.touches and (size > 0.7 * last or share < 1.0):
                return None
            if s.touches:
                share = self._damped(lu, x, angles, factor, dx, df, share)
                if not share:
                    return None
            last = size
            x, factor = x + share * dx, factor + share * df
        return None

    def _damped(self, lu, x, angles, factor, dx, df, share: float) -> float:
        """Share of a Newton step that the natural monotonicity test admits, 0 if none; see `equilibrium`.

        Where parts touch the tangent has kinks, about which full steps go to and fro.
        """
        s = self.system
        whole = self.mx * (dx**2).sum() + self.mf * df**2
        while share > FAINTEST:
            f, _ = s.force(x + share * dx, angles, factor + share * df)
            d = lu.solve(np.append(f.ravel()[s.free], 0.0))
            left = self.mx * (s.spread(d[:-1]) ** 2).sum() + self.mf * d[-1] ** 2
            if left <= (1.0 - 0.5 * share) ** 2 * whole:
                return share
            share *= 0.5
        return 0.0

    def ahead(self, p: _Point, sigma: float) -> _Point | None:
        """The point at arc length sigma beyond p."""
        x, factor = p.x + sigma * p.tx, p.factor + sigma * p.tf
        if abs(factor) >= FURTHEST:
            return None
        return self.correct(x, p.angles, factor, p.tx, p.tf, p.arc + sigma)

    def largest(self, p: _Point) -> float:
        """Longest step that keeps to the limits on factor and moves."""
        return min(self.step / max(abs(p.tf), 1e-300), self.move / max(np.linalg.norm(p.tx, axis=-1).max(), 1e-300))

    def limit(self, a: _Point, b: _Point) -> _Point | None:
        """The limit point between two points: the tangent's factor component vanishes (Illinois method)."""
        low, high, fl, fh, side, best = 0.0, b.arc - a.arc, a.tf, b.tf, 0, None
        for _ in range(12):
            sigma = (low * fh - high * fl) / (fh - fl)
            best = self.ahead(a, sigma)
            if best is None or abs(best.tf) < 1e-7 * abs(a.tf - b.tf):
                break
            if (best.tf > 0) == (fl > 0):
                low, fl, fh, side = sigma, best.tf, fh / 2 if side == 1 else fh, 1
            else:
                high, fh, fl, side = sigma, best.tf, fl / 2 if side == -1 else fl, -1
        return best

    def follow(self, x, angles, start, end, max_points, stop) -> Path:
        """See `continuation`."""
        s, sign = self.system, math.copysign(1.0, end - start)
        first = s.settle(s.led(x, start), angles, start, self.tolerance, 200, True)
        point = None
        if first.converged:
            point = self.correct(first.x, first.angles, start, np.zeros_like(x), sign)
        if point is None:
            message = f"there is no starting point: {first.message}"
            return self._path([], [], False, message)
        points, limits, reached = [point], [], False
        ease, message = 1.0, f"the path has {max_points} points without reaching its end."
        while len(points) < max_points:
            sigma = ease * self.largest(point)
            new = self.ahead(point, sigma)
            sharp = new is not None and self.mx * (new.tx * point.tx).sum() + self.mf * new.tf * point.tf < 0.7
            passed = new is not None and s.clear(point.x, new.x - point.x) < 1.0
            if new is None or passed or (sharp and ease > 1e-2):
                ease *= 0.5
                if ease < 1e-5:
                    message = f"the path cannot be followed beyond the factor {point.factor:.6g}."
                    break
                continue
            if new.tf * point.tf < 0:
                peak = self.limit(point, new)
                if peak is not None:
                    limits.append(len(points))
                    points.append(peak)
            if (new.factor - end) * sign >= 0:
                share = (end - point.factor) / (new.factor - point.factor)
                guess = point.x + share * (new.x - point.x)
                new = self.correct(guess, point.angles, end, np.zeros_like(x), sign, point.arc + share * sigma) or new
                reached, message = True, f"the path reached the factor {new.factor:.6g}."
            points.append(new)
            point = new
            if not reached and stop is not None and stop(point.factor, point.x):
                reached, message = True, f"the path was stopped at the factor {point.factor:.6g}."
            if reached:
                break
            ease = min(1.0, ease * (1.6 if new.iterations <= 3 else 1.0))
        return self._path(points, limits, reached, message)

    def _path(self, points: list[_Point], limits: list[int], reached: bool, message: str) -> Path:
        s, n = self.system, self.system.model.position.shape[0]
        spectra = [s.spectrum(p.k, p.largest, p.symmetric)[0] for p in points]
        negative = np.array([(v < -NEUTRAL * p.largest).sum() for v, p in zip(spectra, points, strict=True)], int)
        near = {i + d for i in limits for d in (-1, 0)}
        branches = [i for i in range(len(points) - 1) if negative[i] != negative[i + 1] and i not in near]
        return Path(
            factor=np.array([p.factor for p in points]),
            arc=np.array([p.arc for p in points]),
            x=np.array([p.x for p in points]).reshape(-1, n, 3),
            angles=np.array([p.angles for p in points]).reshape(len(points), -1),
            stable=negative == 0,
            negative=negative,
            lowest=np.array([v[0] for v in spectra]),
            limit_points=np.array(limits, int),
            branch_points=np.array(branches, int),
            reached=reached,
            message=message,
            start=s.state,
            energies=s.energies([(p.x, p.angles, p.factor) for p in points]),
            model=s.model,
            parameters=s.inputs[0],
            drive=s.inputs[1],
        )
