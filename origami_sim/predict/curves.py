"""What a hypothesis predicts for quasi-static curves: one equilibrium for each load step, for many worlds at once."""

import copy
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject, Suspect
from origami_sim.hypotheses.spectra import with_spectra
from origami_sim.hypotheses.suspects import at_several_times, told_apart
from origami_sim.model import Model, Parameters, State
from origami_sim.model.distort import distorted
from origami_sim.observation.channels import angle_mask, stacked
from origami_sim.observation.observe import Poses, read_channel
from origami_sim.predict.drives import drive_of
from origami_sim.predict.measured import at_channel, continuous
from origami_sim.predict.thresholds import within_reach
from origami_sim.predict.track import coordinates
from origami_sim.predict.worlds import World, Worlds, distinct_motions
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.grips import moving
from origami_sim.solve.statics.settling import coupled, levels, per_world, settling
from origami_sim.solve.statics.system import System
from origami_sim.threads import told

PASSIVE = ("bars", "bar_viscosity", "panel_bending", "ogden_bars")
"""Effects that keep panels stiff; rigid panels do not need them."""

PIECES = 6
"""Blocks that a curve is cut into: contiguous stretches, each of which is held out in its turn."""

HOLD = 1e6
"""Time that a load step is given [s]: laws that relax have relaxed, laws of the rate are silent."""

TIMED = ("clock_delay", "clock_rate", "exposure", "tracker_lag")
"""Effects of the measurement that need a clock, which load steps do not have."""


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
    turning = False
    """Whether it is known how panels turn under their markers."""

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, pieces: int = PIECES, threads: int | None = None
    ):
        super().__init__(subject, recordings, threads)
        for e in self.model.effects:
            if get(e).on_body and not self.turning:
                raise InputError(
                    "curves do not tell how panels turn under a marker", field=e, allowed="recordings of a motion"
                )
        self.drives = [drive_of(self._driven(r), self._default()) for r in self.recordings]
        self._rested: dict[int, list[Drive]] = {}
        self._systems: dict[tuple[str, ...], System] = {}
        pose, rates = self.articulation.reference(), np.zeros(self.articulation.size)
        for index, r in enumerate(self.recordings):
            values, noise = stacked(r)
            for part in np.array_split(np.arange(len(r.times)), min(pieces, len(r.times) // 2)):
                times = r.times[part] - r.times[part[0]]
                self.blocks.append(Block(index, int(part[0]), times, values[part], noise, pose, rates, np.zeros(0)))

    def _default(self) -> Drive:
        """What acts where a recording states nothing."""
        return self.drive.replace(**dict.fromkeys([*self.drive.levels, "origin"], 0.0))

    def _driven(self, recording: Recording) -> Recording:
        """The recording with the drives that the simulator knows."""
        return recording

    def _shot(self, each: Sequence[Hypothesis], theta, local, wanted: list[int]) -> Prediction:
        return told(lambda: self._read_off(each, theta, wanted))  # threads share the worlds of a curve

    def _read_off(self, each: Sequence[Hypothesis], theta, wanted: list[int]) -> Prediction:
        effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
        curves, impossible = {}, {}
        for r in sorted({self.blocks[b].recording for b in wanted}):
            recording = self.recordings[r]
            worlds, impossible[r] = self.worlds_of(each, theta, effects, r)
            moves, of = distinct_motions(worlds)
            curve = self._curve(r, [worlds[m] for m in moves])
            first = np.repeat(stacked(recording)[0][0][:, None], len(moves), axis=1)
            continuous(curve[:, : len(first)], angle_mask(recording), first)
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
        several, spread over the recording, because its signature changes with it altogether; relaxation also with
        several at once. See also `told_apart`.
        """
        every = [s for s in told_apart(every, len(self.components)) if self.turning or not get(s.effect).on_body]
        every = within_reach(self, every)
        if all(r.by_step for r in self.recordings):
            return [s for s in every if not clocked(s.effect)]
        spans = [r.times - r.times[0] for r in self.recordings]
        low, high = min(float(t[2]) for t in spans), max(float(t[-1]) for t in spans)
        return with_spectra(at_several_times(every, low, high), low, high)

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

    def _system(self, model: Model, worlds) -> System | None:
        """Couplings and colours of a model, which depend on its effects only."""
        if model.panels == "rigid":
            return None
        if model.effects not in self._systems:
            self._systems[model.effects] = coupled(model, worlds[0][1], self.drives[0].held(0.0))
        return self._systems[model.effects]

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
        names = sorted({n.split("_")[0] for d in self.drives for n in d.levels if not d[n].is_zero})
        if names:
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

    Every world follows its own equilibria from step to step (see `solve.settling`). A step begins where the world was,
    moved as the nominal model moves there, with that model's tangent. Memory advances along the path, each step taking
    as long as nothing relaxes any more.
    """

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, pieces: int = PIECES, threads: int | None = None
    ):
        super().__init__(subject, recordings, pieces=pieces, threads=threads)
        self._nominal: dict[int, tuple[np.ndarray, list]] = {}

    def _other(self) -> Curves:
        out = super()._other()
        assert isinstance(out, Static)
        out._nominal = {}
        return out

    def _curve(self, r: int, worlds):
        if r not in self._nominal:
            start = self.world(Hypothesis(), np.array([f.start for f in self.subject.nominals]), ())
            states, _, tangents = self._chain(r, [start])
            self._nominal[r] = np.stack([s.x[:, 0] for s in states]), tangents
        states, alive, _ = self._chain(r, worlds, *self._nominal[r])
        drives = [joined(self._resting(r, *world)) for world in worlds] if measures_force(self.recordings[r]) else None
        return channels_of(self.recordings[r], worlds, states, alive, drives)

    # --- equilibria

    def _chain(
        self, r: int, worlds, path: np.ndarray | None = None, tangents: Sequence = ()
    ) -> tuple[list[State], np.ndarray, list]:
        """States of all worlds, step by step, whether an equilibrium was found [n, K], and tangents of the first.

        Args:
            path: [n, N, 3] of the nominal model. tangents: its factors, step by step.
        """
        model = worlds[0][0]
        steps, count = len(self.recordings[r].times), len(worlds)
        state = State.at_rest(model, count, position=np.stack([m.position for m, _ in worlds], axis=1), placed=True)
        alive = np.ones(count, bool)
        states, found, kept = [], [], []
        before = model.position
        drives = self._resting(r, model, Parameters.join([p for _, p in worlds]))
        every = per_world(drives[0], levels(drives[0], 0.0, count))
        options = {"among": self.shared, "threads": self.threads, "gripped": any(moving(model, d) for d in drives)}
        search = settling(worlds, every, state, system=self._system(model, worlds), keeping=True, **options)
        for k in range(steps):
            guess = state.x.copy()
            if path is not None and model.panels != "rigid":
                guess += (path[k] - before)[:, None]
                before = path[k]
            level = levels(drives[k], 0.0, count)
            if tangents:
                search.begin_with(tangents[k])
            state, alive = search.settle(level, state, guess, alive, dt=HOLD, time=0.0)
            states.append(state)
            found.append(alive)
            kept.append(search.tangent)
        return states, np.stack(found), kept

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


def clocked(effect: str) -> bool:
    """Whether an effect depends on how fast things happen: a parameter's unit has seconds in it (but for s^2).

    A loss that is none unless it is stated, as of a crease that yields, does not make it so.
    """
    law = get(effect)
    units = [p.unit for p in law.parameters if p.name in law.fitted or p.default != 0.0]
    return effect in TIMED or any(re.search(r"(?<![A-Za-z])s(?![A-Za-z^])", unit) for unit in units)


def measures_force(recording: Recording) -> bool:
    """Whether a channel reads a force, for which the drive of every frame is needed."""
    return any(c.kind == "force" or "grip" in c.attachment for c in recording.channels.values())


def channels_of(
    recording: Recording,
    worlds: Sequence[World],
    states: Sequence[State],
    alive: np.ndarray,
    drives: list[Drive] | None,
) -> np.ndarray:
    """Undistorted channels [n, D, K] of states of K worlds at the n frames; nan where one has no equilibrium.

    Args:
        alive: [n, K]. drives: of each world, every frame as a world; needed for forces only.
    """
    steps, columns = len(states), []
    times = np.zeros(steps) if recording.by_step else recording.times - recording.times[0]
    for w, (model, parameters) in enumerate(worlds):
        own = None if drives is None else drives[w]
        whole = State.join([s.select(np.array([w])) for s in states])
        poses = Poses(model, parameters, np.moveaxis(whole.x, 0, 1), whole.angles.T, times, whole, own)
        values = [read_channel(poses, c).reshape(steps, -1) for c in recording.channels.values()]
        columns.append(np.where(alive[:, w, None], np.concatenate(values, axis=1), np.nan))
    return np.stack(columns, axis=2)


def joined(drives: Sequence[Drive]) -> Drive:
    """Held drives of one world each as one drive of as many worlds."""
    return drives[0].replace(**{n: np.array([at_once(d, n) for d in drives]) for n in drives[0].signals})


def at_once(drive: Drive, name: str) -> float:
    """A channel of one world at time 0."""
    return float(np.ravel(drive[name](0.0))[0])


def _gained(drive: Drive, gain: float) -> Drive:
    return drive.replace(
        **{
            n: replace(drive[n], offset=gain * np.asarray(drive[n].offset), scale=gain * np.asarray(drive[n].scale))
            for n in drive.levels
        }
    )


def _interpolated(grid: np.ndarray, values: np.ndarray):
    """Values [n, d, W] as a function of times [m, W], linearly; the ends hold."""

    def read(times: np.ndarray) -> np.ndarray:
        out = np.empty((len(times), values.shape[1], values.shape[2]))
        for w in range(values.shape[2]):
            for d in range(values.shape[1]):
                out[:, d, w] = np.interp(times[:, w], grid, values[:, d, w])
        return out

    return read
