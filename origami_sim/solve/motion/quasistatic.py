"""Quasi-static motion with a clock: equilibria along time, with laws that remember advanced between them.

For ramps and holds of seconds to hours, where inertia and losses that go with the rate do not count but creep,
relaxation, polarisation and friction do. Each step ends in an equilibrium at which every law has the memory that it
would have had if all angles had changed evenly within the step: exact exponentials for what relaxes, and of second
order in the step altogether, at any ratio of step to time constant. Steps follow the error of a step taken twice.

An equilibrium that ceases to exist is followed to the next stable one, at once, and is reported as a jump.
"""

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.contact import engaged
from origami_sim.model.distort import distorted
from origami_sim.solve import grips
from origami_sim.solve.batch import Evaluation
from origami_sim.solve.motion.dynamics import Failure, Trajectory
from origami_sim.solve.motion.gripped import exerted_at_rest
from origami_sim.solve.oversights import (
    below_the_ground,
    beyond_breakdown,
    beyond_crease_tables,
    idle_drives,
    refuse_start_outside_tables,
)
from origami_sim.solve.statics.held import FOREVER
from origami_sim.solve.statics.settling import Settling, SettlingPanels, levels, settling
from origami_sim.solve.timestep import AT_REST, TimeStep
from origami_sim.solve.watch import Met, continued, watch_of, with_memory

TOLERANCE = 1e-5
"""Error of one step, as a part of the device's size; ten times less costs about twice the steps."""

INSTANT = 1e-12
"""Length of a step in which nothing has time to relax [s]: a millionth of the shortest time constant admitted."""

SHORTEST = 2.0**-10
"""Shortest step, as a part of the interval between two instants: what moves suddenly within it is called a jump."""

LARGE = 0.05
"""Turn [rad], or move over the size, of a step that is looked at twice: whether it was gradual; smaller jumps pass."""

SUDDEN = 0.9
"""Part of a large move that one half of a step may make; half is even, 3/4 a parabola from rest, 1 a jump."""

FALLS = 8
"""Shortest steps in a row, from each of which a world falls, after which it is given up.

A flap that is wound up by more than a turn falls at every step, at a tenth of a second each.
"""

FARTHEST = 4.0
"""Length of a step over that of the one before, up to which it is looked ahead from there."""

KNOT = 0.01
"""Part of a drive's range by which its samples between frames may depart from a straight line unseen."""

SLOW = 0.01
"""Part of the largest force from which on what a quasi-static motion leaves out is mentioned."""


@dataclass(frozen=True)
class Jump:
    """A snap: the equilibrium of a world ceased to exist, and the next one was elsewhere.

    Attributes:
        frame: first frame after it. time: when [s], to within a thousandth of the interval between two frames.
        turn: largest change of a hinge angle [rad]. where: name of that hinge.
    """

    world: int
    frame: int
    time: float
    turn: float
    where: str

    def __str__(self):
        return (
            f"world {self.world} jumps before frame {self.frame}, at t = {self.time:.6g} s: "
            f"{self.where} turns by {self.turn:.3g} rad at once"
        )


@dataclass(repr=False)
class QuasiStatic(Trajectory):
    """Frames of a quasi-static motion: a `Trajectory` at rest, of which work is summed from frame to frame.

    Attributes:
        jumps: snaps, in their order. steps: equilibria found, with those that error control asked for.
    """

    jumps: list[Jump] = field(default_factory=list)
    steps: int = 0


def quasistatic(
    model: Model,
    parameters: Parameters,
    drive: Drive | None = None,
    times: Sequence[float] | np.ndarray = (),
    *,
    state: State | None = None,
    before: Drive | None = None,
    tolerance: float | None = TOLERANCE,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> QuasiStatic:
    """Follows the equilibria of all worlds along time, with creep, relaxation and whatever else remembers.

    Panels of which it was not stated whether they touch keep each other off, see `simulate`.

    Bars or rigid panels. Inertia and laws of the rate are left out, and where they would
    have mattered a note says so.

    Args:
        times: [F] instants to keep [s], increasing. The drive comes on at the first: the first frame is the answer
            before anything has relaxed.
        state: where to start (default: the reference state, without memory); its worlds must match.
        before: a drive in which it had been for ever, so that everything has relaxed, until the first instant; with
            `drive.held(times[0])` nothing happens then. None: nothing acts on the state before.
        tolerance: error of one step over the device's size; steps between frames are cut until they keep to it. None:
            one step from frame to frame.
        threads: CPU threads (default all cores). progress: called with the fraction done.

    Returns:
        The frames. A world of which no equilibrium is found stays where it was, and `failures` says since when and why.

    Raises:
        InputError: times that are not finite or do not increase, a drive that ends early, worlds that differ,
            no node that is free to move.
    """
    model, parameters = continued(model, parameters, state)
    given = {"before": before, "tolerance": tolerance, "threads": threads, "progress": progress}
    try:
        return _quasistatic(model, parameters, drive or Drive(), times, state=state, **given)
    except Met as met:
        model, parameters = engaged(model, parameters)
        start = None if state is None else with_memory(model, state)
        out = _quasistatic(model, parameters, drive or Drive(), times, state=start, **given)
        out.notes.insert(1, met.sentence)
        return out


def _quasistatic(
    model: Model,
    parameters: Parameters,
    drive: Drive,
    times: Sequence[float] | np.ndarray,
    *,
    state: State | None,
    before: Drive | None,
    tolerance: float | None,
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> QuasiStatic:
    """The motion of the model as it is.

    Raises:
        Met: panels came near each other that nothing keeps apart.
    """
    at = np.asarray(times, float)
    if at.ndim != 1 or not len(at) or not np.all(np.isfinite(at)):
        raise InputError("a quasi-static motion needs finite times", field="times", value=list(at.ravel()[:4]))
    back = np.flatnonzero(~(np.diff(at) > 0))
    if len(back):
        raise InputError(
            f"times must increase; time {back[0] + 1} does not", field="times", value=float(at[back[0] + 1])
        )
    if tolerance is not None and not (tolerance > 0 and math.isfinite(tolerance)):
        raise InputError("steps need a positive tolerance", field="tolerance", value=tolerance, allowed="> 0, or None")
    if not np.any(model.free):
        raise InputError("statics needs a node that is free to move", field="free", value=0)
    drive.require(float(at[-1]))
    count = max(parameters.worlds, drive.worlds, state.worlds if state else 1)
    start = state.copy() if state else State.at_rest(model, count)
    for what, worlds in (("parameters", parameters.worlds), ("drive", drive.worlds), ("state", start.worlds)):
        if worlds not in (1, count):
            raise InputError("worlds differ in number", field=what, value=worlds, allowed=f"1 or {count}")
    if start.worlds != count:
        start = start.select(np.zeros(count, int))
    began = clock.perf_counter()
    instants = np.unique(np.concatenate([at, knots(drive, at)]))
    applied = distorted(model, parameters, drive.on(instants), float(at[-1]))
    refuse_start_outside_tables(model, parameters, applied, start.x, float(at[0]))
    one = [parameters.world(w if parameters.worlds > 1 else 0) for w in range(count)]
    search = settling([(model, p) for p in one], applied, start, threads=threads)
    march = March(search, applied, tolerance if search.held.remembers else None)
    watch, said = watch_of(model, parameters, start, reference=state is None)

    def look(state: State, time: float):
        if watch is not None:
            watch.add(time, state.x, np.zeros_like(state.x))  # so that each node goes straight on

    look(start, float(at[0]))
    march.begin(start, float(at[0]), None if before is None else levels(before, float(at[0]), count))
    states = [march.state]
    look(march.state, float(at[0]))
    for i, instant in enumerate(at[1:], 1):
        for end in instants[(instants > at[i - 1]) & (instants <= instant)]:
            march.go(float(end), i)
            look(march.state, float(end))
        states.append(march.state)
        if progress:
            progress(i / (len(at) - 1))
    if watch is not None:
        watch.look()
    out = _filmed(model, parameters, drive, at, states, march, clock.perf_counter() - began)
    out.notes[1:1] = said
    return out


class March:
    """Steps from instant to instant.

    A step that ends nearly where the one before pointed to is as short as it has to be; any other is taken twice.

    Args:
        search: equilibria at the end of a step. drive: as it reaches the device.
        tolerance: of one step; None takes whole steps, unless something moves too far or is not found.
        shortest: see `SHORTEST`.

    Attributes:
        state, time: where it is. alive: [W] worlds that still have equilibria. jumps, failures: what happened.
    """

    def __init__(self, search: Settling, drive: Drive, tolerance: float | None, *, shortest: float = SHORTEST):
        self.search, self.drive, self.tolerance, self.shortest = search, drive, tolerance, shortest
        self._before: tuple[State, float] | None = None
        self._constant = [s.constant for s in drive.signals.values()]
        self._known: np.ndarray | None = None
        self.model = search.model
        self.size = float(np.ptp(self.model.position, axis=0).max()) or 1.0
        self.jumps: list[Jump] = []
        self.failures: list[Failure] = []
        self.steps, self.time = 0, 0.0
        self.alive, self._falls = np.ones(0, bool), np.zeros(0, int)
        self.state: State

    def begin(self, state: State, time: float, before: np.ndarray | None = None):
        """The first equilibria, after the drive has come on at once where the device had rested before.

        Args:
            before: level of the drive in which it had rested for ever [channels, W]; None: nothing acted on the state.
        """
        self.state, self.time = state, time
        self.alive, self._falls = np.ones(state.worlds, bool), np.zeros(state.worlds, int)
        if before is not None:
            self._from_afar(before, FOREVER)
        self._from_afar(levels(self.drive, time, state.worlds), INSTANT)

    def _from_afar(self, level: np.ndarray, dt: float):
        """Equilibria that may be far away, reached within dt [s] at the present time."""
        start = self.state
        new, found = self.search.settle(level, start, start.x, self.alive, dt=dt, time=self.time, gradual=False)
        self._take(new, found, 0)

    def go(self, end: float, frame: int):
        """On to the equilibria at an instant, in as many steps as it takes."""
        shortest, todo = self.shortest * (end - self.time), [end]
        while todo and np.any(self.alive):
            to = todo[-1]
            dt = to - self.time
            last = 0.5 * dt < shortest
            ahead = self._ahead(self._before, self.state, dt)
            whole, found = self._settle(self.state, self._before, dt, to)
            move = self._apart(self.state, whole)
            good, sudden = np.all(found | ~self.alive), np.zeros(len(found), bool)
            far = move > LARGE * self.size
            asked = np.any(far & self.alive) or (self.tolerance is not None and not self._straight(ahead, whole, dt))
            if good and asked:
                half, first = self._settle(self.state, self._before, 0.5 * dt, to - 0.5 * dt)
                whole_again, second = self._settle(half, (self.state, 0.5 * dt), 0.5 * dt, to)
                good = np.all((first & second) | ~self.alive)
                if good:
                    error = self._apart(whole, whole_again) / 3.0
                    larger = np.maximum(self._apart(self.state, half), self._apart(half, whole_again))
                    sudden = self.alive & far & (larger > SUDDEN * move)
                    good = not np.any(sudden)
                    if self.tolerance is not None:
                        whole = whole_again
                        good &= not np.any(self.alive & (error > self.tolerance * self.size))
            if not good and not last:
                todo.append(self.time + 0.5 * dt)
                continue
            lost = self.alive & ~found
            if not good:
                if np.any(lost):
                    level = levels(self.drive, to, len(found))
                    whole, found = self.search.settle(level, self.state, whole.x, self.alive, dt=dt, time=to)
                    sudden |= lost & found & (self._apart(self.state, whole) > LARGE * self.size)
                self._say(sudden, whole, frame, to)
            self._falls = np.where(lost, self._falls + 1, 0)
            self._take(whole, found & (self._falls < FALLS), frame, to)
            if np.any(sudden):  # nothing goes on as it went in a jump
                self._before = None
            todo.pop()
        self.time = end

    def _ahead(self, before: tuple[State, float] | None, now: State, dt: float) -> np.ndarray | None:
        """Positions [N, W, 3] after dt [s] if all goes on as it did in the step before; None: there was none."""
        if before is None or dt > FARTHEST * before[1]:
            return None
        return self.search.ahead(before[0], now, dt / before[1])

    def _straight(self, ahead: np.ndarray | None, new: State, dt: float) -> bool:
        """Whether the way within a step departs from a straight one by less than the tolerance, in all worlds.

        The second difference with the step before gives the curvature, and that how far the way sags.
        """
        if ahead is None or self._before is None or self.tolerance is None:
            return False
        part = 0.25 * dt / (dt + self._before[1])
        off = part * np.linalg.norm(new.x - ahead, axis=-1).max(axis=0)
        return not np.any(self.alive & (off > self.tolerance * self.size))

    def _settle(self, state: State, past: tuple[State, float] | None, dt: float, to: float):
        """The state after a step from another, and which worlds have one; `past` is where the step before began."""
        self.steps += 1
        ahead = self._ahead(past, state, dt)
        level, guess = self._levels(to, state.worlds), state.x if ahead is None else ahead
        past = None if ahead is None else past
        return self.search.settle(level, state, guess, self.alive, dt=dt, time=to, search=False, past=past)

    def _levels(self, time: float, worlds: int) -> np.ndarray:
        """Levels of the drive at a time [channels, W]; only what varies is asked again."""
        if self._known is None:
            self._known = levels(self.drive, time, worlds)
        for k, s in enumerate(self.drive.signals.values()):
            if not self._constant[k]:
                self._known[k] = np.squeeze(s(time))
        return self._known.copy()

    def _apart(self, one: State, other: State) -> np.ndarray:
        """Largest distance of a node, or change of an angle times the size, between two states [W] [m]."""
        far = np.linalg.norm(other.x - one.x, axis=-1).max(axis=0)
        return np.maximum(far, self.size * np.abs(other.angles - one.angles).max(axis=0, initial=0.0))

    def _say(self, sudden: np.ndarray, new: State, frame: int, time: float):
        names = [self.model.name("crease", c) for c in range(len(self.model.creases))]
        names += [self.model.name("bend", c) for c in range(len(self.model.bends))]
        for w in np.flatnonzero(sudden):
            turns = np.abs(new.angles[:, w] - self.state.angles[:, w])
            where = names[int(turns.argmax())] if len(turns) else "the device"
            self.jumps.append(Jump(int(w), frame, time, float(turns.max(initial=0.0)), where))

    def _take(self, new: State, found: np.ndarray, frame: int, time: float | None = None):
        """Goes on to a state; worlds without an equilibrium stay where they were and are given up."""
        for w in np.flatnonzero(self.alive & ~found):
            at = self.time if time is None else time
            where = "that it keeps" if self._falls[w] >= FALLS else "nor anywhere that it could fall to"
            cause = f"no stable equilibrium at frame {frame}, {where}"
            if self.search.torn[w]:
                cause = f"the grips tear the rigid panels before frame {frame}: no shape of theirs reaches both"
            self.failures.append(Failure(int(w), at, self._worst(int(w), at), cause))
        self.alive = self.alive & found
        out = new.copy()
        for name in ("x", "angles", "memory"):
            rest = ~self.alive
            getattr(out, name)[:, rest] = getattr(self.state, name)[:, rest]
        self._before = None if time is None else (self.state, time - self.time)
        self.state = out
        self.time = self.time if time is None else time

    def _worst(self, w: int, time: float) -> int:
        """The node with the largest force where a world was last."""
        self.search.held.batch.hold(levels(self.drive, time, self.state.worlds))
        force = self.search.held.at(self.state, time).forces.values()
        total = np.sum(list(force), axis=0)[:, w] * self.model.free
        return int(np.abs(np.nan_to_num(total, nan=np.inf)).max(axis=-1).argmax())


def knots(drive: Drive, times: np.ndarray) -> np.ndarray:
    """Instants between those given at which the samples of a drive have to be seen as well.

    Between the frames of a ramp a drive may switch; the fewest samples are taken of which straight lines stay within a
    hundredth of its range (Douglas & Peucker 1973).
    """
    out: list[float] = []
    for s in drive.signals.values():
        if s.times is None or s.values is None:
            continue
        inside = (s.times > times[0]) & (s.times < times[-1])
        t = np.unique(np.concatenate([times, s.times[inside]]))
        y = np.stack([np.ravel(s._sampled(float(k))) for k in t])
        close = KNOT * np.ptp(y, axis=0).max()
        if close == 0.0:
            continue
        cuts = np.unique(np.searchsorted(t, times))
        todo = [(a, b) for a, b in pairwise(cuts.tolist()) if b > a + 1]
        while todo:
            a, b = todo.pop()
            straight = y[a] + (y[b] - y[a]) * ((t[a + 1 : b] - t[a]) / (t[b] - t[a]))[:, None]
            off = np.abs(y[a + 1 : b] - straight).max(axis=1)
            if off.max() > close:
                c = a + 1 + int(off.argmax())
                out.append(float(t[c]))
                todo += [(p, q) for p, q in ((a, c), (c, b)) if q > p + 1]
    return np.array(sorted(set(out)))


def _filmed(model, parameters, drive, times, states: list[State], march: March, wall: float) -> QuasiStatic:
    """The frames as a trajectory."""
    held, worlds = march.search.held, states[0].worlds
    found: list[Evaluation] = []
    for t, s in zip(times, states, strict=True):
        held.batch.hold(levels(march.drive, float(t), worlds))
        found.append(held.at(s, float(t)))
    x = np.stack([s.x for s in states])
    forces = {n: np.stack([e.forces[n] for e in found]) for n in model.laws}
    work = {}
    for n in model.laws:
        spent = 0.5 * np.einsum("fnwa,fnwa->fw", forces[n][1:] + forces[n][:-1], np.diff(x, axis=0))
        work[n] = np.concatenate([np.zeros((1, worlds)), np.cumsum(spent, axis=0)])
        if not get(n).exchanges_work:
            work[n][:] = 0.0
    pulls = None
    if march.search.gripped:
        tree = march.search.tree if isinstance(march.search, SettlingPanels) else None
        total = sum(forces.values(), np.zeros_like(x))
        pulls, work[grips.WORK] = exerted_at_rest(model, march.drive, times, x, total, tree)
    contact = [e for e in model.effects if get(e).family in ("contact", "tangent")]
    zero = np.zeros_like(x)
    out = QuasiStatic(
        model=model,
        parameters=parameters,
        drive=drive,
        times=times,
        x=x,
        v=zero,
        angles=np.stack([s.angles for s in states]),
        energies={
            "kinetic": np.zeros((len(times), worlds)),
            **{n: np.stack([e.energies[n] for e in found]) for n in found[0].energies},
        },
        work=work,
        gaps=np.stack([e.gaps for e in found]),
        contact_forces=sum((forces[n] for n in contact), zero),
        failures=march.failures,
        dt=float(np.diff(times).min(initial=np.inf)) if len(times) > 1 else 0.0,
        step=TimeStep(np.inf, np.inf, 0, AT_REST),
        state=states[-1],
        wall=wall,
        grip_wrenches=pulls,
        jumps=march.jumps,
        steps=march.steps,
    )
    out.notes = [f"Quasi-static: {len(times)} frames, {march.steps} equilibria.", *(f"{j}." for j in march.jumps)]
    out.notes += [*idle_drives(model, parameters, drive), *below_the_ground(model, parameters, out.x[-1])]
    out.notes += beyond_breakdown(model, parameters, drive, float(times[-1]))
    out.notes += beyond_crease_tables(model, parameters, out.angles)
    out.notes += _left_out(out, march, states)
    return out


def _left_out(run: QuasiStatic, march: March, states: list[State]) -> list[str]:
    """Sentences on inertia and losses of the rate where they would have counted."""
    if len(run.times) < 3:
        return []
    held, worlds = march.search.held, states[0].worlds
    jumped = {j.frame for j in run.jumps}
    largest, worst = 0.0, {}
    dt = np.diff(run.times)
    rates = np.diff(run.x, axis=0) / dt[:, None, None, None]
    mass = np.broadcast_to(node_mass(run.model, run.parameters), (run.x.shape[1], worlds))
    for f in range(1, len(run.times)):
        if f in jumped:
            continue
        held.batch.hold(levels(march.drive, float(run.times[f]), worlds))
        still, moving = (held.at(states[f], float(run.times[f]), v).forces for v in (None, rates[f - 1]))
        for n in run.model.laws:
            largest = max(largest, float(np.abs(still[n]).max(initial=0.0)))
            extra = float(np.abs(moving[n] - still[n]).max(initial=0.0))
            worst[n] = max(worst.get(n, (0.0, 0)), (extra, f))
        if f > 1 and f - 1 not in jumped:
            change = (rates[f - 1] - rates[f - 2]) / (0.5 * (dt[f - 1] + dt[f - 2]))
            heavy = float(np.abs(mass[:, :, None] * change * run.model.free[:, None]).max(initial=0.0))
            worst["inertia"] = max(worst.get("inertia", (0.0, 0)), (heavy, f))
    return [
        f"{n} is left out of a quasi-static motion; before frame {f} (t = {run.times[f]:.4g} s) it would have reached "
        f"{extra / largest:.1%} of the largest force: simulate that part of the motion."
        for n, (extra, f) in worst.items()
        if largest > 0 and extra > SLOW * largest
    ]
