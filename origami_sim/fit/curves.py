"""What a hypothesis predicts for quasi-static curves: one equilibrium for each load step, for many worlds at once."""

import copy
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from origami_sim.distort import distorted
from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.fit.channels import angle_mask, stacked
from origami_sim.fit.drives import drive_of
from origami_sim.fit.hypothesis import Hypothesis, Subject, Suspect, along_every_axis, at_several_times, told_apart
from origami_sim.fit.measured import at_channel, continuous
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.fit.rollouts import distinct_motions
from origami_sim.fit.track import coordinates
from origami_sim.fit.worlds import Worlds
from origami_sim.model import Model, Parameters, State
from origami_sim.observe import Poses, read_channel
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics import equilibrium
from origami_sim.solve.system import NULL_SHIFT, THREADED, Cholesky, Factor, System

PASSIVE = ("bars", "bar_viscosity", "panel_bending", "ogden_bars")
"""Effects that keep panels stiff; rigid panels do not need them."""

PIECES = 6
"""Blocks that a curve is cut into: contiguous stretches, each of which is held out in its turn."""

HOLD = 1e6
"""Time that a load step is given [s]: laws that relax have relaxed, laws of the rate are silent."""

TIMED = ("clock_delay", "clock_rate", "exposure", "tracker_lag")
"""Effects of the measurement that need a clock, which load steps do not have."""

CLOSE = 1e-10
"""A Newton step shorter than this part of the device ends the search for an equilibrium."""

FAR = 0.1
"""Longest Newton step, as a part of the device."""

ROUNDS = 12
ITERATIONS = 12
"""Tangents of a load step, and Broyden's steps with each."""


@dataclass(frozen=True, eq=False)
class Balance:
    """Moments that are missing along a curve.

    Attributes:
        names: of the m coordinates. times: (n,) or load steps. q: [m, n] coordinates. missing, error: [m, n] moments
            and their standard deviations [N m]. against: what else to show them against, (n,) by channel.
    """

    names: list[str]
    times: np.ndarray
    q: np.ndarray
    missing: np.ndarray
    error: np.ndarray
    against: dict[str, np.ndarray]


class Curves(Worlds, ABC):
    """What curves have in common: no starts to fit, all blocks of a recording in one pass. See `Predictor`.

    Args:
        subject: how to build the model. recordings: of one object. pieces: blocks of each curve.
    """

    separate, start, local, panels, curve = False, "rest", 0, "", True

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, pieces: int = PIECES, threads: int | None = None
    ):
        super().__init__(subject, recordings, threads)
        for e in self.model.effects:
            if get(e).on_body:
                raise InputError(
                    "curves do not tell how panels turn under a marker", field=e, allowed="recordings of a motion"
                )
        silent = self.drive.replace(**dict.fromkeys(self.drive.signals, 0.0))
        self.drives = [drive_of(self._driven(r), silent) for r in self.recordings]
        self._rested: dict[int, list[Drive]] = {}
        pose, rates = self.articulation.reference(), np.zeros(self.articulation.size)
        for index, r in enumerate(self.recordings):
            values, noise = stacked(r)
            for part in np.array_split(np.arange(len(r.times)), min(pieces, len(r.times) // 2)):
                times = r.times[part] - r.times[part[0]]
                self.blocks.append(Block(index, int(part[0]), times, values[part], noise, pose, rates, np.zeros(0)))

    def _driven(self, recording: Recording) -> Recording:
        """The recording with the drives that the simulator knows."""
        return recording

    def _shot(self, each: Sequence[Hypothesis], theta, local, wanted: list[int]) -> Prediction:
        effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
        curves, impossible = {}, {}
        for r in sorted({self.blocks[b].recording for b in wanted}):
            recording = self.recordings[r]
            worlds, impossible[r] = self.worlds_of(each, theta, effects, r)
            moves, of = distinct_motions(worlds)
            curve = self._curve(r, [worlds[m] for m in moves])
            first = np.repeat(stacked(recording)[0][0][:, None], len(moves), axis=1)
            continuous(curve, angle_mask(recording), first)
            curves[r] = self._read(worlds, recording, curve[:, :, of])
        out = []
        for b in wanted:
            block = self.blocks[b]
            rows = slice(block.first, block.first + len(block.times))
            out.append(np.moveaxis(curves[block.recording][rows], 2, 0).copy())
            out[-1][impossible[block.recording]] = np.nan
        return Prediction(out, [None] * len(out))

    def step(self, hypothesis: Hypothesis, theta: np.ndarray) -> float:
        """Curves have no time step: 1, or 0 if no model can be built."""
        try:
            self.world(hypothesis, theta, hypothesis.effects)
        except InputError:
            return 0.0
        return 1.0

    def admitted(self, every: Sequence[Suspect]) -> list[Suspect]:
        """The suspects that curves can be asked about.

        Load steps have no clock: what needs one is left out. In time, an effect with a time constant is suspected with
        several, spread over the recording, because its signature changes with it altogether. See also `told_apart`.
        """
        every = [s for s in told_apart(every, len(self.components)) if not get(s.effect).on_body]
        every = along_every_axis(every)
        if all(r.by_step for r in self.recordings):
            return [s for s in every if not clocked(s.effect)]
        spans = [r.times - r.times[0] for r in self.recordings]
        low, high = min(float(t[2]) for t in spans), max(float(t[-1]) for t in spans)
        return at_several_times(every, low, high)

    @abstractmethod
    def _curve(self, r: int, worlds: list[tuple[Model, Parameters]]) -> np.ndarray:
        """Undistorted channels [n, D, K] of a recording."""
        ...

    def _read(self, worlds, recording: Recording, curve: np.ndarray) -> np.ndarray:
        """The channels [n, D, K] as distorted measurements show them."""
        model, parameters = worlds[0][0], Parameters.join([p for _, p in worlds])
        names = [e for e in model.effects if get(e).family == "measurement" and not (recording.by_step and e in TIMED)]
        out, row = curve.copy(), 0
        at = np.repeat(recording.times[:, None], len(worlds), axis=1)
        for index, channel in enumerate(recording.channels.values()):
            part = slice(row, row + (1 if channel.values.ndim == 1 else channel.values.shape[1]))
            row = part.stop
            for name in names:
                effect = get(name)
                if effect.apply is None or (effect.channels and channel.kind not in effect.channels):
                    continue
                given = at_channel(parameters, name, index, len(worlds))
                known = out[:, part].copy()
                read = (lambda t, v=known: v) if recording.by_step else _interpolated(recording.times, known)
                out[:, part] = effect.apply(read, at, **given)
        return out

    def _resting(self, r: int, model: Model, parameters: Parameters) -> list[Drive]:
        """The drive of each load step as it reaches the device, held; what distorts it may remember earlier steps."""
        steps = len(self.recordings[r].times)
        commanded = self.drives[r]
        drive = distorted(model, parameters, commanded, float(steps - 1))
        if drive is not commanded:
            return [drive.held(float(k)) for k in range(steps)]
        if id(commanded) not in self._rested:
            self._rested[id(commanded)] = [commanded.held(float(k)) for k in range(steps)]
        return self._rested[id(commanded)]

    @abstractmethod
    def balance(self, hypothesis: Hypothesis, theta: np.ndarray) -> list[Balance]:
        """Residual moments by recording; none where they cannot be told."""
        ...

    def menu(self, levels: Sequence[float]) -> list[tuple[str, "Curves"]]:
        """Experiments like those recorded that a user could make: what, and its predictions.

        Args:
            levels: of the drives, over those that were recorded.
        """
        out: list[tuple[str, Curves]] = [("repeat the same curve", self._other())]
        if any(not s.is_zero for d in self.drives for s in d.signals.values()):
            names = sorted({n.split("_")[0] for d in self.drives for n, s in d.signals.items() if not s.is_zero})
            for gain in levels:
                words = "reversed" if gain == -1.0 else f"at {gain:g} times the level"
                other = self._other()
                other.drives = [_gained(d, gain) for d in self.drives]
                out.append((f"{' and '.join(names)} {words}", other))
        return out

    def _other(self) -> "Curves":
        out = copy.copy(self)
        out.blocks, out._built = list(self.blocks), {}
        return out


class Static(Curves):
    """Predictions for curves by load step (`recording.by_step`): chains of equilibria.

    Every world follows its own equilibria from step to step. A step begins where the world was, moved as the nominal
    model moves there; a tangent is improved by Broyden's updates as long as each step halves the one before, and then
    taken anew. A world that this does not bring to a stable rest is left to `statics.equilibrium`. Memory advances
    along the path, each step taking as long as nothing relaxes any more.
    """

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, pieces: int = PIECES, threads: int | None = None
    ):
        super().__init__(subject, recordings, pieces=pieces, threads=threads)
        self._systems: dict[tuple[str, ...], System] = {}
        self._nominal: dict[int, np.ndarray] = {}

    def _other(self) -> Curves:
        out = super()._other()
        assert isinstance(out, Static)
        out._nominal = {}
        return out

    def _curve(self, r: int, worlds):
        if r not in self._nominal:
            start = self.world(Hypothesis(), np.array([f.start for f in self.subject.nominals]), ())
            self._nominal[r] = self._chain(r, [start], None)[0][:, 0]
        x, angles, alive = self._chain(r, worlds, self._nominal[r])
        recording = self.recordings[r]
        steps = len(recording.times)
        columns = []
        for w, (model, parameters) in enumerate(worlds):
            state = drive = None
            if any(c.kind == "force" for c in recording.channels.values()):
                drive = joined(self._resting(r, model, parameters))
                state = State.at_rest(model, steps, position=np.moveaxis(x[:, w], 0, 1))
                state.angles = angles[:, w].T.copy()
            poses = Poses(model, parameters, x[:, w], angles[:, w], np.zeros(steps), state, drive)
            values = [read_channel(poses, c).reshape(steps, -1) for c in recording.channels.values()]
            columns.append(np.where(alive[:, w, None], np.concatenate(values, axis=1), np.nan))
        return np.stack(columns, axis=2)

    # --- equilibria

    def _chain(self, r: int, worlds, path: np.ndarray | None):
        """Positions [n, K, N, 3], hinge angles [n, K, H] and whether an equilibrium was found [n, K]."""
        model = worlds[0][0]
        steps, count = len(self.recordings[r].times), len(worlds)
        state = State.at_rest(model, count, position=np.stack([m.position for m, _ in worlds], axis=1))
        alive = np.ones(count, bool)
        xs, all_angles, found = [], [], []
        before = model.position
        drives = self._resting(r, model, Parameters.join([p for _, p in worlds]))
        search = _Search(self, self._system(model, worlds), worlds, drives[0], state)
        for k in range(steps):
            guess = state.x.copy()
            if path is not None:
                guess += (path[k] - before)[:, None]
                before = path[k]
            state, alive = search.settle(drives[k], state, guess, alive)
            xs.append(np.moveaxis(state.x, 1, 0))
            all_angles.append(state.angles.T)
            found.append(alive)
        return np.stack(xs), np.stack(all_angles), np.stack(found)

    def _system(self, model: Model, worlds) -> System:
        """Couplings and colours of a model, which depend on its effects only."""
        if model.effects not in self._systems:
            drive = Drive(voltage=[0.0] * self.drives[0].groups)
            self._systems[model.effects] = System(model, worlds[0][1], drive, State.at_rest(model))
        return self._systems[model.effects]

    # --- equation error

    def balance(self, hypothesis: Hypothesis, theta: np.ndarray) -> list[Balance]:
        """At the recorded angles: the moments that balance each crease beyond what the model gives."""
        found = []
        for r, recording in enumerate(self.recordings):
            given = coordinates(self, r)
            if given is None:
                return []
            q, noise = given
            model, parameters = self.world(hypothesis, theta, hypothesis.effects)
            model = model.with_effects(without=tuple(e for e in PASSIVE if e in model.effects))
            parameters = parameters.for_model(model)
            drives = self._resting(r, model, parameters)
            # the recorded angles, and each of them a little further, for the error of the moment
            moves = np.concatenate([np.zeros((1, len(q))), 1e-5 * np.eye(len(q))])
            moments = np.stack([self._moments(model, parameters, joined(drives), q + m[:, None]) for m in moves])
            slope = (moments[1:] - moments[0]) / 1e-5
            error = np.sqrt(np.einsum("jkn,j->kn", slope**2, noise**2))
            levels = {n: np.array([at_once(d, n) for d in drives]) for n in drives[0].signals}
            against = {n: v for n, v in levels.items() if np.ptp(v) > 0}
            found.append(Balance(self.articulation.names(), recording.times, q, moments[0], error, against))
        return found

    def _moments(self, model: Model, parameters: Parameters, drive: Drive, q: np.ndarray) -> np.ndarray:
        """Missing moments [m, n] at held coordinates [m, n]."""
        arm = self.articulation
        pose = arm.moved(arm.reference(q.shape[1]), q - arm.reference().angles)
        x = arm.positions(pose)
        state = State.at_rest(model, q.shape[1], position=x)
        force = Batch(model, parameters, drive, state, threads=self.threads, among=self.shared).total_force(0.0)
        return -np.einsum("mnwa,nwa->mw", arm.jacobian(pose, x), force)


class _Search:
    """Equilibria of all worlds, load step after load step.

    Args:
        forward: whose worlds they are. drive: of the first load step, held, as it reaches the device. state: in which
            all begin.
    """

    def __init__(self, forward: Static, system: System, worlds, drive: Drive, state: State):
        self.system, self.worlds, self.threads, self.shared = system, worlds, forward.threads, forward.shared
        self.model = worlds[0][0]
        self.remembers = any(get(e).memory for e in self.model.laws)
        self.drive, self.state = drive, state
        # held nodes: the integrator moves them as it is told, and laws with memory advance
        still = replace(self.model, free=np.zeros_like(self.model.free))
        every = drive.replace(**{n: s.offset + np.zeros(state.worlds) for n, s in drive.signals.items()})
        parameters = Parameters.join([p for _, p in worlds])
        threads = 1 if state.worlds < 64 else self.threads
        self.batch = Batch(still, parameters, every, state, threads=threads, among=self.shared)
        self.free = system.free
        self._moved: dict[int, Batch] = {}

    def _levels(self, drive: Drive) -> np.ndarray:
        """What a held drive gives in each world [channels, W]."""
        return np.stack([np.broadcast_to(s.offset, (len(self.worlds),)) for s in drive.signals.values()])

    def force(self, x: np.ndarray) -> np.ndarray:
        """Forces on the free axes [F, W] at positions [N, W, 3], reached from the step's beginning."""
        b, s = self.batch, self.state
        if not self.remembers:
            b.place(x, s.angles)
        else:
            moved(b, s, (x - s.x) / HOLD, HOLD)
        f = b.total_force(0.0)
        return np.moveaxis(f, 1, 2).reshape(-1, x.shape[1])[self.free]

    def settle(self, drive: Drive, state: State, x: np.ndarray, alive: np.ndarray) -> tuple[State, np.ndarray]:
        """The state at the equilibria of a load step, and which worlds have one.

        Args:
            state: in which the last load step left them. x: [N, W, 3] the guess.
        """
        self.drive, self.state, self.levels = drive, state, self._levels(drive)
        self.batch.hold(self.levels)
        x, done = self._newton(x, alive, ROUNDS)
        lost = alive & ~done
        if np.any(lost):
            x, lost = self._searched(x, lost)
            if self.remembers and np.any(lost):  # found with the memory of the step's beginning
                x, again = self._newton(x, lost, ROUNDS)
                lost &= again
            done |= lost
        alive = alive & done
        self.force(np.where(alive[None, :, None], x, self.state.x))
        out = self.batch.state()
        out.v[:], out.a[:] = 0.0, 0.0
        out.step, out.status = -1, np.full_like(out.status, -1)
        return out, alive

    def _newton(self, x: np.ndarray, wanted: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions after so many rounds, each with a tangent of its own, and which worlds came to rest."""
        size, done = self.system.size, np.zeros(len(wanted), bool)
        for _ in range(rounds):
            factors, stable = self._factors(x, wanted & ~done)
            going = np.array([f is not None for f in factors])
            if not np.any(going):
                break
            s = self._solved(factors, self.force(x), going)
            past, before = [s], np.full(len(wanted), np.inf)
            for _ in range(ITERATIONS):
                large = np.abs(s).max(axis=0, initial=0.0)
                going &= large < 0.5 * before  # else a new tangent serves better; false for nan
                before = large
                far = going & (large > FAR * size)
                if np.any(far):  # no further than this without a new tangent
                    x = x + self._spread(np.where(far, s * _over(np.full_like(large, FAR * size), large), 0.0))
                    going &= ~far
                x = x + self._spread(np.where(going, s, 0.0))
                close = going & (large < CLOSE * size)
                done |= close & stable
                going &= ~close
                if not np.any(going):
                    break
                z = self._solved(factors, self.force(x), going)
                with np.errstate(all="ignore"):  # of worlds that go no further
                    for a, b in pairwise(past):  # Broyden's first method (Kelley 1995, ch. 7)
                        z = z + b * _over(np.sum(a * z, axis=0), np.sum(a * a, axis=0))
                    last = past[-1]
                    s = z / (1.0 - _over(np.sum(last * z, axis=0), np.sum(last * last, axis=0)))
                past.append(s)
        return x, done

    def _searched(self, x: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Equilibria of these worlds by a search of their own, from where the last step left them; which have one."""
        x, found = x.copy(), np.zeros_like(lost)
        model = self.model.with_effects(without=tuple(e for e in self.model.effects if e not in self.model.laws))
        for w in np.flatnonzero(lost):
            drive = self.drive.replace(
                **{n: float(np.broadcast_to(s.offset, lost.shape)[w]) for n, s in self.drive.signals.items()}
            )
            state = self.state.select(np.array([w]))
            one = equilibrium(model, self.worlds[w][1].for_model(model), drive, state=state)
            if one.converged:
                x[:, w], found[w] = one.x, True
        return x, found

    def _solved(self, factors, f: np.ndarray, going: np.ndarray) -> np.ndarray:
        out = np.zeros_like(f)
        for w in np.flatnonzero(going):
            out[:, w] = factors[w].solve(f[:, w])
        return out

    def _spread(self, s: np.ndarray) -> np.ndarray:
        """Values on the free axes [F, W] as [N, W, 3]."""
        out = np.zeros((self.model.position.size, s.shape[1]))
        out[self.free] = s
        return np.moveaxis(out.reshape(-1, 3, s.shape[1]), 2, 1)

    def _factors(self, x: np.ndarray, alive: np.ndarray) -> tuple[list[Cholesky | Factor | None], np.ndarray]:
        """Factors of the tangent of every world, shifted where it is not positive definite, and where it is [W]."""
        y = self.system
        y.follow(x)
        out: list[Cholesky | Factor | None] = [None] * x.shape[1]
        stable = np.zeros(x.shape[1], bool)
        for w in np.flatnonzero(alive):
            batch, copies = self._copies(int(w)), np.full(y.moves.shape[1], w)
            angles, memory = self.state.angles[:, copies], self.state.memory[:, copies]
            batch.place(x[:, w, None] + y.moves, angles, memory)
            k = y.assembled(batch.total_force(0.0))
            if not np.all(np.isfinite(k.data)):
                continue
            largest = float(np.abs(k.data).max(initial=0.0)) or 1.0
            out[w], shift = y.definite(k, largest, 0.0)
            stable[w] = shift <= NULL_SHIFT * largest * (1 + 1e-9)
        return out, stable

    def _copies(self, w: int) -> Batch:
        """A batch of copies of a world, from whose differences its tangent comes."""
        count = self.system.moves.shape[1]
        if w not in self._moved or self._moved[w].worlds != count:
            drive = self.drive.replace(**dict(zip(self.drive.signals, self.levels[:, w], strict=True)))
            threads = 1 if count * len(self.model.position) < THREADED else self.threads
            state = self.state.select(np.full(count, w))
            self._moved[w] = Batch(self.model, self.worlds[w][1], drive, state, threads=threads, among=self.shared)
        self._moved[w].hold(self.levels[:, [w]])
        return self._moved[w]


def clocked(effect: str) -> bool:
    """Whether an effect depends on how fast things happen: a parameter's unit has seconds in it (but for s^2)."""
    return effect in TIMED or any(re.search(r"(?<![A-Za-z])s(?![A-Za-z^])", p.unit) for p in get(effect).parameters)


def moved(batch: Batch, start: State, velocity: np.ndarray, dt: float):
    """Moves held nodes from a state at a velocity [N, W, 3] for dt [s]; memory advances, and they are then at rest."""
    batch.place(start.x, start.angles, start.memory)
    onward(batch, velocity, dt)
    batch._v.zero_()


def onward(batch: Batch, velocity: np.ndarray, dt: float):
    """One step of dt [s] of held nodes from where they are, at a velocity [N, W, 3]."""
    batch._overwrite(batch._v, velocity)
    batch._a.zero_()
    batch._status.fill_(-1)
    batch.advance(1, dt, np.inf)


def joined(drives: Sequence[Drive]) -> Drive:
    """Held drives of one world each as one drive of as many worlds."""
    return drives[0].replace(**{n: np.array([at_once(d, n) for d in drives]) for n in drives[0].signals})


def at_once(drive: Drive, name: str) -> float:
    """A channel of one world at time 0."""
    return float(np.ravel(drive[name](0.0))[0])


def _gained(drive: Drive, gain: float) -> Drive:
    return drive.replace(
        **{
            n: replace(s, offset=gain * np.asarray(s.offset), scale=gain * np.asarray(s.scale))
            for n, s in drive.signals.items()
        }
    )


def _over(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a / b, 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)


def _interpolated(grid: np.ndarray, values: np.ndarray):
    """Values [n, d, W] as a function of times [m, W], linearly; the ends hold."""

    def read(times: np.ndarray) -> np.ndarray:
        out = np.empty((len(times), values.shape[1], values.shape[2]))
        for w in range(values.shape[2]):
            for d in range(values.shape[1]):
                out[:, d, w] = np.interp(times[:, w], grid, values[:, d, w])
        return out

    return read
