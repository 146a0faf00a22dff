"""What a hypothesis predicts for the recordings: batches of rollouts that all start where the recordings do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from origami_sim.diagnose.articulation import Articulation, Pose
from origami_sim.diagnose.channels import (
    angle_mask,
    channel_values,
    component_names,
    depths,
    marked,
    stacked,
    turned_axes,
)
from origami_sim.diagnose.hypothesis import (
    Hypothesis,
    Subject,
    Suspect,
    along_every_axis,
    apply,
    at_several_times,
    suspects,
    told_apart,
)
from origami_sim.diagnose.track import coordinates, placed
from origami_sim.distort import distorted
from origami_sim.drive import SAMPLES_PER_SECOND, Drive, Signal, series
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.recording import Recording, by_component
from origami_sim.solve.batch import Batch
from origami_sim.solve.timestep import gradient_norms, stable_step

CALM = 0.04
"""Time at the start of a segment in which panels are damped, at most [s].

A segment starts with flat panels, because markers do not show how they bend. Real panels bend under their load; without
the damping they would begin to ring. What is measured in that time is not compared.
"""

SHORTER = (0.0, 1 / 8, 1 / 4, 1 / 2)
"""Parts of that time of which the first is taken that does not change what follows."""

UNSEEN = 0.5
"""Norm of a change of all predictions, in standard deviations, that does not matter."""

RATIO = 0.3
"""Damping of panels in that time, as a ratio of critical for each bar and bending line."""

CAREFUL, TRUSTED = 6.0, 0.05
"""A rate that was read from a recording is known within so many of its standard deviations, and such a part of it."""

POSSIBLE = 2.0
"""Standard deviations within which a rate that a window tells is possible."""

LEAD = 1500
"""Frames between two segments along which laws with memory are carried, at most; the motion there is as recorded."""

SOFTER = (100.0, 30.0, 10.0)
"""By how much softer panels may be where only derivatives are asked for: the solver's step grows with the root."""

ALIKE = 0.05
"""Part of the motion by which softer panels may change it."""

STIFFNESS = {"bars": "stiffness", "panel_bending": "stiffness"}
CALMING = {"bar_viscosity": "bars", "panel_viscosity": "panel_bending"}
VISCOSITY = {"bar_viscosity": "viscosity", "panel_viscosity": "viscosity"}
"""What keeps panels in shape, and what calms them."""

FASTEST = 3.0
"""Frames below which a time constant is not told from none."""

NEAR = 4
"""Frames from where a segment begins within which its start has to be seen."""

SPARE = 3
"""Frames simulated beyond a segment, for measurements that lag."""

ROUNDING = 1e-9
"""Lateness [s] that is due to rounding; worlds without any share one drive."""

STEADY, GENTLE, UNDONE = 64, 1e-3, 6
"""Frames after which a measurement shows a steady motion's rate; part of the rate that is tried; passes to undo it."""


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of a recording that is simulated from a start of its own.

    Attributes:
        recording: index of the recording. first: index of its first frame. times: (n,) since that frame [s].
        values: (n, D) all components of all channels [SI]; nan where missing.
        noise: (D,) their standard deviations.
        pose, rates: what the recording says about the start: coordinates and their rates [m].
        known: (L,) standard deviations of that: of the coordinates (of which the data themselves say more), the rates.
        line: (2, D) value and rate of the components at the first frame, and towards: [m, D] from these rates to those
            of the coordinates; nothing where the start is not read from the recording.
        begin: (D,) what was measured at the first frame, which tells the turn of angles.
    """

    recording: int
    first: int
    times: np.ndarray
    values: np.ndarray
    noise: np.ndarray
    pose: Pose
    rates: np.ndarray
    known: np.ndarray
    line: np.ndarray | None = None
    towards: np.ndarray | None = None
    begin: np.ndarray | None = None


class Forward:
    """Predictions for segments of recordings of one object.

    Args:
        subject: how to build the model. recordings: of one object.
        segment: length of a segment [s]; None: each recording is one segment.
        start: "fit" if every segment has a start of its own that is fitted (coordinates and rates), "rest" if the
            recording starts from rest in the model's reference state.
        most: at most so many segments of each recording, evenly spread; None: all.
        threads: see `Batch`.

    Attributes:
        blocks: the segments. local: number of local numbers of each segment (start coordinates, then rates).
        components: names of the D components. softness: of panels where only derivatives are asked for.
        calm: time for which panels are damped at the start of a segment [s].
        separate: whether a segment is predicted without those before it, so that few of them take less time.
        shared: effects of the program that all hypotheses share: compiling one for each took longer than running them.
    """

    softness, calm, separate = 1.0, 0.0, True

    def __init__(
        self,
        subject: Subject,
        recordings: Sequence[Recording],
        *,
        segment: float | None = None,
        start: str = "fit",
        most: int | None = None,
        calm: float = CALM,
        threads: int | None = None,
    ):
        self.subject, self.recordings, self.start, self.threads = subject, list(recordings), start, threads
        self.values = {f.name: f.start for f in subject.nominals}
        self.model, self.parameters, self.drive = subject.build(self.values)
        self.articulation = Articulation(self.model)
        self.shared = shared(self.model, self.recordings, self.drive, self.parameters)
        self._drives = [drive_of(r, self.drive) for r in self.recordings]
        self._given = np.array([f.start for f in subject.nominals])
        self._settles = start == "fit" and self.articulation.size > 6 * self.articulation.floating
        self.calm = calm if self._settles else 0.0
        self._calm: dict[int, int] = {}
        self._softly: dict[int, int] = {}  # softer panels ring for longer; what is compared does not change
        self._paths: dict[int, np.ndarray | None] = {}
        self._built: dict[tuple, tuple[Model, Parameters]] = {}
        self._arms: dict[bytes, Articulation] = {self.model.position.tobytes(): self.articulation}
        self.components = component_names(self.recordings[0])
        self.blocks: list[Block] = []
        for index, recording in enumerate(self.recordings):
            self.blocks += self._segments(index, recording, segment, most)
        self.local = 2 * self.articulation.size if start == "fit" else 0

    # --- segments

    def _segments(self, index: int, recording: Recording, segment: float | None, most: int | None) -> list[Block]:
        values, noise = stacked(recording)
        step = float(np.median(np.diff(recording.times)))
        frames = len(recording.times) if segment is None else max(8, round(segment / step) + 1)
        calm = self._calm[index] = min(int(np.ceil(self.calm / step)), frames // 4)
        self._softly[index] = min(int(np.ceil((CALM if self._settles else 0.0) / step)), frames // 4)
        firsts = np.arange(0, max(1, len(recording.times) - frames + 1), max(1, frames - 1 - calm))
        if most is not None and len(firsts) > most:
            firsts = firsts[np.round(np.linspace(0, len(firsts) - 1, most)).astype(int)]
        if self.start == "fit":
            told = [self._tells(recording, values, noise, int(first)) for first in firsts]
            firsts = firsts[told] if any(told) else firsts
        return [self.segment(index, int(first), frames) for first in firsts]

    def segment(self, index: int, first: int, frames: int) -> Block:
        """The segment of so many frames of a recording that begins at a frame."""
        recording = self.recordings[index]
        values, noise = stacked(recording)
        part = slice(first, first + frames)
        begun: tuple = (self.articulation.reference(), np.zeros(self.articulation.size), np.zeros(0))
        if self.start == "fit":
            begun = self._initial(recording, values, noise, first)
        times = recording.times[part] - recording.times[first]
        compared = values[part].copy()
        compared[: self._calm[index]] = np.nan
        return Block(index, first, times, compared, noise, *begun, begin=seen_first(values[part]))

    def _tells(self, recording: Recording, values, noise, first: int) -> bool:
        """Whether what was seen near a frame tells all coordinates that the channels can tell."""
        near = np.isfinite(values[max(0, first - NEAR) : first + NEAR + 1]).any(axis=0)
        ever = np.isfinite(values).any(axis=0)
        if np.array_equal(near, ever):
            return True
        _, tangent = self._channel_tangent(recording, self.articulation.reference(), values[first])
        by = tangent / noise[:, None]
        return bool(np.linalg.matrix_rank(by[near]) == np.linalg.matrix_rank(by[ever]))

    def _initial(self, recording: Recording, values, noise, first: int) -> tuple:
        """From pose to towards of a `Block`, from a local polynomial of the channels."""
        level, slope, error = local_line(recording.times, values, noise, first)
        arm, pose = self.articulation, placed(self.model, self.articulation, recording, level)
        weight = np.where(np.isfinite(level), 1.0 / noise, 0.0)
        sought = arm.sought(self._channel_tangent(recording, pose, level)[1] * weight[:, None])
        for _ in range(30):
            now, tangent = self._channel_tangent(recording, pose, level)
            gap = np.where(np.isfinite(level), level - now, 0.0)
            by = arm.inverse(tangent * weight[:, None], sought, 1e-8) @ (gap * weight)
            size = np.abs(by).max(initial=0.0)
            pose = arm.moved(pose, (by * min(1.0, 1.0 / (size + 1e-12)))[:, None])
            if size < 1e-10:
                break
        _, tangent = self._channel_tangent(recording, pose, level)
        weight = np.where(np.isfinite(slope), 1.0 / noise, 0.0)
        inverse = arm.inverse(tangent * weight[:, None], sought, 1e-8)
        rates = inverse @ (np.nan_to_num(slope) * weight)
        spread = np.linalg.norm(inverse * np.where(weight > 0.0, error * weight, 0.0), axis=1)
        told = np.einsum("md,dm->m", inverse, tangent * weight[:, None]) > 0.9  # by the channels
        spread = np.where(told, np.maximum(np.hypot(CAREFUL * spread, TRUSTED * rates), 1e-9), np.inf)
        line = np.nan_to_num(np.stack([level, slope]))
        return pose, rates, np.concatenate([np.full(arm.size, np.inf), spread]), line, inverse * weight

    def _channel_tangent(self, recording: Recording, pose: Pose, near: np.ndarray):
        """Channels (D,) of a pose, turned as in `near`, and their derivatives by the coordinates [D, m]."""
        arm, step = self.articulation, 1e-6
        m = arm.size
        by = np.concatenate([np.zeros((m, 1)), step * np.eye(m), -step * np.eye(m)], axis=1)
        x = arm.positions(arm.moved(pose.select([0] * (2 * m + 1)), by))
        values = channel_values(self.model, recording, x[None], None)[0]
        plus, minus = values[:, 1 : m + 1], values[:, m + 1 :]
        turning = angle_mask(recording)
        jump = np.where(turning[:, None], 2 * np.pi * np.round((plus - minus) / (2 * np.pi)), 0.0)
        now = values[:, 0]
        now = now + np.where(turning, 2 * np.pi * np.round((np.nan_to_num(near) - now) / (2 * np.pi)), 0.0)
        return now, (plus - minus - jump) / (2 * step)

    def told(self, hypothesis: Hypothesis, theta: np.ndarray) -> np.ndarray:
        """[B, L] the starts that recordings tell if they were measured as a hypothesis says, as shifts from their own.

        A scale of the measurement scales the recorded rates too; it is undone by fixed-point steps.
        """
        out = np.zeros((len(self.blocks), self.local))
        if not self.local:
            return out
        try:
            model, parameters = self._world(hypothesis, theta, hypothesis.effects)
        except InputError:
            return out
        distort = [e for e in model.effects if get(e).family == "measurement" and not get(e).on_body]
        if not distort:
            return out
        for r, recording in enumerate(self.recordings):
            mine = [b for b, block in enumerate(self.blocks) if block.recording == r and block.line is not None]
            if not mine:
                continue
            lines = np.stack([self.blocks[b].line for b in mine], axis=2)  # type: ignore[arg-type]  # [2, D, W]
            x = np.concatenate([self.articulation.positions(self.blocks[b].pose) for b in mine], axis=1)
            deep = depths(self.model, recording, x[None])
            grid = np.arange(STEADY + 2) * float(np.median(np.diff(recording.times)))
            all_alike, now = Parameters.join([parameters], repeat=len(mine)), np.zeros(1)
            rate = lines[1].copy()
            for _ in range(UNDONE):
                motion = lines[0] + GENTLE * rate * (grid[:, None, None] - grid[STEADY // 2])
                motion = np.concatenate([motion, np.repeat(deep, len(grid), axis=0)], axis=1)
                seen = self._measured(all_alike, recording, distort, grid, motion, grid, now)
                half = STEADY // 2
                rate += lines[1] - (seen[half + 1] - seen[half - 1]) / (grid[half + 1] - grid[half - 1]) / GENTLE
            for n, b in enumerate(mine):
                out[b, self.local // 2 :] = self.blocks[b].towards @ rate[:, n] - self.blocks[b].rates
        return out

    # --- predictions

    def built(self, values: Mapping[str, float]) -> tuple[Model, Parameters]:
        """Model and parameters for values of the nominals, remembered; of measurements one row for each channel."""
        key = tuple(values.items())
        if key not in self._built:
            if len(self._built) > 500:
                self._built.clear()
            model, parameters, _ = self.subject.build(values)
            model = replace(model, channels=max(len(r.channels) for r in self.recordings))
            self._built[key] = model, parameters.for_model(model)
        return self._built[key]

    def predict(
        self,
        hypothesis: Hypothesis | Sequence[Hypothesis],
        theta: Sequence[np.ndarray] | np.ndarray,
        local: np.ndarray | None = None,
        blocks: Sequence[int] | None = None,
        *,
        soft: bool = False,
    ) -> list[np.ndarray]:
        """Predicted channels of each block: a list of [K, n, D].

        Args:
            hypothesis: one for all K, or one for each.
            theta: K times the nominals, then the hypothesis' numbers [SI].
            local: [K, B, L] start coordinates (as a shift from the block's own) and rates, for all blocks.
            blocks: which to predict (default all).
            soft: with softer panels (see `soften`), for derivatives; not if a hypothesis is about panels' stiffness.

        A world that goes unstable, or of whose numbers no model can be built, gives nan.
        """
        wanted = range(len(self.blocks)) if blocks is None else blocks
        each = [hypothesis] * len(theta) if isinstance(hypothesis, Hypothesis) else list(hypothesis)
        effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
        softness = self._softness(soft, effects)
        worlds, impossible = self._worlds(each, theta, effects)
        out: dict[int, np.ndarray] = {}
        for r in range(len(self.recordings)):
            mine = [b for b in wanted if self.blocks[b].recording == r]
            for group in _by_length(self.blocks, mine):
                for b, values in zip(group, self._roll(r, group, worlds, local, softness), strict=True):
                    out[b] = values
                    out[b][impossible] = np.nan
        return [out[b] for b in wanted]

    def admitted(self, every: Sequence[Suspect]) -> list[Suspect]:
        """The suspects that these recordings can be asked about; those with a time constant with several.

        See also `told_apart`.
        """
        frame = float(np.median(np.diff(self.recordings[0].times)))
        longest = max(float(r.times[-1] - r.times[0]) for r in self.recordings)
        every = along_every_axis(told_apart(every, len(self.components)))
        return at_several_times(every, FASTEST * frame, longest)

    def calming(self) -> float:
        """The time for which panels must be damped so that longer makes no difference to what follows [s]."""
        longest, theta = dict(self._calm), self._given[None]
        starts = np.zeros((1, len(self.blocks), self.local))
        if not self.calm:
            return 0.0
        damped = self.predict(Hypothesis(), theta, starts)
        found = self.calm
        for part in SHORTER:
            self._calm = {r: int(np.ceil(part * frames)) for r, frames in longest.items()}
            less = self.predict(Hypothesis(), theta, starts)
            gap = [(a[0] - b[0])[longest[k.recording] + 1 :] for a, b, k in zip(damped, less, self.blocks, strict=True)]
            if np.sum((np.concatenate(gap) / self.blocks[0].noise) ** 2) < UNSEEN**2:
                found = part * self.calm
                break
        self._calm = longest
        return found

    def soften(self) -> None:
        """Finds how much softer panels may be for derivatives: at most so much that the motion stays the same.

        Panels that bend when the device moves, and numbers of the model that say how stiff they are, forbid it.
        """
        theta, starts = self._given[None], np.zeros((1, len(self.blocks), self.local))
        if not self._rigid():
            return
        exact = self.predict(Hypothesis(), theta, starts)
        noise = self.blocks[0].noise
        motion = np.concatenate([b.values - np.nanmean(b.values, axis=0) for b in self.blocks]) / noise
        for self.softness in SOFTER:
            other = self.predict(Hypothesis(), theta, starts, soft=True)
            gap = np.concatenate([a[0] - b[0] for a, b in zip(exact, other, strict=True)]) / noise
            if np.mean(gap**2) <= ALIKE**2 * np.nanmean(motion**2):
                return
        self.softness = 1.0

    def _rigid(self) -> bool:
        """Whether no number of the model changes what keeps panels in shape."""
        kept = [k for k in (STIFFNESS | VISCOSITY).items() if k in self.parameters]
        for f in self.subject.nominals:
            other = self.built(
                self.values | {f.name: f.start + (f.scale if f.start + f.scale <= f.upper else -f.scale)}
            )[1]
            if any(np.any(self.parameters[k] != other[k]) for k in kept):
                return False
        return True

    def step(self, hypothesis: Hypothesis, theta: np.ndarray, *, soft: bool = False) -> float:
        """The solver's step for one world, a frame at most [s]; 0 if no model can be built. See `predict`."""
        frame = float(np.median(np.diff(self.recordings[0].times)))
        try:
            model, parameters = self._world(hypothesis, theta, hypothesis.effects)
        except InputError:
            return 0.0
        eased = softened(model, parameters, self._softness(soft, hypothesis.effects))
        return min(frame, stable_step(model, eased).dt)

    def _softness(self, soft: bool, effects: Sequence[str]) -> float:
        """By how much softer panels are in a program with these effects."""
        return self.softness if soft and not any(map(stiff, effects)) else 1.0

    def _worlds(self, each: Sequence[Hypothesis], theta, effects: Sequence[str]):
        """The worlds of `predict`, and which of them stand for numbers of which no model can be built."""
        worlds, impossible = [], []
        for k, (h, t) in enumerate(zip(each, theta, strict=True)):
            try:
                worlds.append(self._world(h, t, effects))
            except InputError:  # such as an inertia that no masses give
                impossible.append(k)
                worlds.append(self._world(Hypothesis(), self._given, effects))
        return worlds, impossible

    def _world(self, hypothesis: Hypothesis, values: np.ndarray, effects: Sequence[str]) -> tuple[Model, Parameters]:
        """The model with these effects, and the parameters of one world."""
        count = len(self.subject.nominals)
        names = [f.name for f in self.subject.nominals]
        model, parameters = self.built(dict(zip(names, map(float, values[:count]), strict=True)))
        if not effects:
            return model, parameters
        richer = model.with_effects(*effects)
        return richer, apply(parameters, hypothesis, values[count:], richer)

    def _roll(
        self,
        r: int,
        group: list[int],
        worlds: list[tuple[Model, Parameters]],
        local,
        softness: float,
    ) -> list[np.ndarray]:
        """[K, n, D] for blocks of equal length of one recording; the batch runs over worlds, then over blocks."""
        recording, blocks = self.recordings[r], [self.blocks[b] for b in group]
        k, count = len(worlds), len(blocks)
        model = worlds[0][0]
        parameters = Parameters.join([p for _, p in worlds], repeat=count)
        times = blocks[0].times
        step = float(np.median(np.diff(recording.times)))
        begins = recording.times[[b.first for b in blocks]] - recording.times[0]
        once = Parameters.join([p for _, p in worlds])
        late, shown = self._late(model, once, k, begins)
        last = max(self._ends(model, once, c, times[-1], shown) for c in range(len(recording.channels)))
        frames = int(np.ceil(last / step - 1e-6)) + 1 + SPARE
        starts = None if local is None else local[:, group]
        moves, of = distinct_motions(worlds, late, starts)
        raw = self._film(
            r,
            blocks,
            [worlds[m] for m in moves],
            late[moves],
            None if starts is None else starts[moves],
            frames,
            softness,
        )
        turning = angle_mask(recording)
        continuous(raw[:, : len(turning)], turning, np.tile(np.stack([_begin(b) for b in blocks]), (len(moves), 1)).T)
        channels = raw[:, :, (of[:, None] * count + np.arange(count)).ravel()]
        plain = channels[:, : len(turning)]  # without the depths
        grid = np.arange(frames) * step
        distort = [e for e in model.effects if get(e).family == "measurement"]
        if distort:
            values = self._measured(parameters, recording, distort, grid, channels, times, shown)
        elif np.allclose(times, grid[: len(times)], atol=1e-6 * step):
            values = plain[: len(times)]
        else:
            values = spline(grid, plain)(times)
        values = values.reshape(len(times), -1, k, count)
        return [np.moveaxis(values[:, :, :, b], 2, 0) for b in range(count)]

    def _film(
        self,
        r: int,
        blocks: list[Block],
        worlds: list[tuple[Model, Parameters]],
        late,
        local,
        frames: int,
        softness: float,
    ) -> np.ndarray:
        """Channels and depths [frames, D + k, W] as they are, before anything measures them."""
        recording, model, count = self.recordings[r], worlds[0][0], len(blocks)
        parameters = softened(model, Parameters.join([p for _, p in worlds], repeat=count), softness)
        step = float(np.median(np.diff(recording.times)))
        begins = recording.times[[b.first for b in blocks]] - recording.times[0]
        if np.any(late):
            drive = shifted(self._drives[r], (begins + late).ravel(), frames * step, 1)
        else:
            drive = shifted(self._drives[r], begins, frames * step, len(worlds))
        drive = distorted(model, parameters, drive, frames * step)
        state = self._state(model, worlds, blocks, local)
        memory = self._memory(r, worlds, blocks)
        if memory is not None:
            state.memory[:] = memory
        chosen = stable_step(model, parameters)
        substeps = max(1, int(np.ceil(step / chosen.dt * (1 - 1e-12))))
        raw: list[np.ndarray] = []
        calm = min((self._calm if softness == 1.0 else self._softly)[r], frames - 1)
        if calm:
            quiet, damped = calmed(model, parameters)
            finer = max(substeps, int(np.ceil(step / stable_step(quiet, damped).dt * (1 - 1e-12))))
            batch = self._batch(quiet, damped, drive, _with_effects(state, quiet))
            raw += filmed(batch, recording, calm + 1, finer, step)
            state = _with_effects(batch.state(), model, step=calm * substeps)
        batch = self._batch(model, parameters, drive, state)
        raw += filmed(batch, recording, frames - sum(map(len, raw)), substeps, step, first=not calm)
        out = np.concatenate(raw)
        out[:, :, batch.status() >= 0] = np.nan
        return out

    def _late(self, model: Model, parameters: Parameters, worlds: int, begins: np.ndarray):
        """How late recordings are.

        A start that is fitted is that of the first frame, however late it was taken: the drive is late there, and the
        motion is read from there on. A clock that runs fast or slow is off by more in each segment, and so is the drive
        that acts there. Within a segment the reading of the motion takes care of it.

        Returns:
            by how much later than its clock says a recording's frames at `begins` were taken [K, B], and the time since
            its start at which the motion of a segment is read first (K,) [s].
        """
        clock = self._clock(model, parameters, worlds, None, [-1e3, 0.0, *begins])
        late = (clock[2:] - clock[1] - begins[:, None]).T
        shown = np.zeros(worlds)
        if self.start == "fit":
            shown = self._clock(model, parameters, worlds, None, [0.0])[0]
            late += shown[:, None]
        return np.where(np.abs(late) > ROUNDING, late, 0.0), shown

    def _ends(self, model, parameters, channel: int, last: float, shown: np.ndarray) -> float:
        """Time since its start until which the motion of a segment is read [s]."""
        clock = self._clock(model, parameters, len(shown), channel, [0.0, last])
        return max(last, float(np.max(clock[1] - shown)))

    def _clock(self, model: Model, parameters: Parameters, worlds: int, channel: int | None, times) -> np.ndarray:
        """[n, K] what a clock in the picture would show at frames at `times` [n], by a channel or (None) by all."""
        rows = np.repeat(np.array(times)[:, None], worlds, axis=1)
        out = rows.copy()
        for name in model.effects:
            effect = get(name)
            if effect.family != "measurement" or effect.channels or effect.apply is None:
                continue  # what reads angles or places has no time of its own
            given = at_channel(parameters, name, channel, worlds)
            out += effect.apply(lambda t: t[:, None], rows, **given)[:, 0] - rows
        return out

    def _state(self, model: Model, worlds, blocks: list[Block], local) -> State:
        """The starts of all worlds [theta, block]."""
        count = len(blocks)
        if self.start != "fit":
            x = np.repeat(np.stack([m.position for m, _ in worlds], axis=1), count, axis=1)
            return State.at_rest(model, x.shape[1], position=x)
        m = self.articulation.size
        base = Pose(
            np.concatenate([b.pose.rotation for b in blocks]),
            np.concatenate([b.pose.centre for b in blocks]),
            np.concatenate([b.pose.angles for b in blocks], axis=1),
        )
        rates = np.stack([b.rates for b in blocks], axis=1)
        xs, vs = [], []
        for n, (own, _) in enumerate(worlds):
            key = own.position.tobytes()
            if key not in self._arms:
                self._arms[key] = Articulation(own)
            arm = self._arms[key]
            pose = arm.moved(base, local[n, :, :m].T) if local is not None else base
            u = rates + local[n, :, m:].T if local is not None else rates
            x = arm.positions(pose)
            xs.append(x)
            vs.append(np.einsum("mnwa,mw->nwa", arm.jacobian(pose, x), u))
        state = State.at_rest(model, count * len(worlds), position=np.concatenate(xs, axis=1))
        state.v[:] = np.concatenate(vs, axis=1)
        return state

    def _memory(self, r: int, worlds: list[tuple[Model, Parameters]], blocks: list[Block]) -> np.ndarray | None:
        """Memory [M, W] of the laws where the segments start: that of the recorded motion up to there; None: no memory.

        All nodes are held and carried along as recorded, from segment to segment, so that the laws feel the motion
        without changing it. Before that they rest.
        """
        model, parameters = worlds[0][0], Parameters.join([p for _, p in worlds])
        every = np.unique([b.first for b in self.blocks if b.recording == r])  # also of segments not asked for
        if not len(State.at_rest(model).memory) or not np.any(every):
            return None
        path = self._path(r)
        if path is None:
            return None
        times = self.recordings[r].times - self.recordings[r].times[0]
        step = float(np.median(np.diff(times)))
        held = replace(model, free=np.zeros_like(model.free))

        def rested(frame: int) -> Batch:
            """The worlds held as they were at a frame, where they have rested, driven as from there on."""
            span = float(times[-1] - times[frame]) + step
            drive = distorted(model, parameters, shifted(self._drives[r], times[[frame]], span, len(worlds)), span)
            state = State.at_rest(held, len(worlds), position=np.repeat(path[frame][:, None], len(worlds), axis=1))
            batch = self._batch(held, parameters, drive.held(0.0), state)
            batch.carry(path[[frame, frame], :, None], LEAD * step)
            return self._batch(held, parameters, drive, replace(state, memory=batch.state().memory))

        out: dict[int, np.ndarray] = {}
        last, batch = -LEAD - 1, None
        for first in map(int, every[every <= max(b.first for b in blocks)]):
            if batch is None or first - last > LEAD:
                last = max(first - LEAD, 0)
                batch = rested(last)
            if first > last:
                batch.carry(path[last : first + 1, :, None], step)
            last, out[first] = first, batch.state().memory
        return np.stack([out[b.first] for b in blocks], axis=2).reshape(len(out[last]), -1)

    def _batch(self, model: Model, parameters: Parameters, drive: Drive, state: State) -> Batch:
        return Batch(model, parameters, drive, state, threads=self.threads, among=self.shared)

    def _path(self, r: int) -> np.ndarray | None:
        """Positions [F, N, 3] of the recorded motion, smoothed; None if the channels do not give them."""
        if r not in self._paths:
            found = coordinates(self, r)
            self._paths[r] = None
            if found is not None:
                q = savgol_filter(found[0], 7, 3, axis=1) if found[0].shape[1] > 7 else found[0]
                arm = self.articulation
                pose = arm.moved(arm.reference(q.shape[1]), q - arm.reference().angles)
                self._paths[r] = np.moveaxis(arm.positions(pose), 1, 0)
        return self._paths[r]

    def _measured(self, parameters, recording, distort, grid, channels, times, shown) -> np.ndarray:
        """Channels [n, D, W] as distorted measurements show them; what is `shown` first (K,) is the grid's start."""
        worlds = channels.shape[2]
        shown = np.repeat(shown, worlds // len(shown))
        at = np.repeat(times[:, None], worlds, axis=1)
        distort = sorted(distort, key=lambda name: not get(name).on_body)
        parts, row, deep = [], 0, len(angle_mask(recording))
        axes = deep + sum(c.kind == "marker_2d" for c in recording.channels.values())
        for index, channel in enumerate(recording.channels.values()):
            width = 1 if channel.values.ndim == 1 else channel.values.shape[1]
            rows = [*range(row, row + width)]
            if channel.kind == "marker_2d":  # until it is measured, a picture has a depth
                rows, deep = [*rows, deep], deep + 1
            if get(distort[0]).on_body and channel in marked(recording):
                rows, axes = [*rows, *range(axes, axes + 9)], axes + 9
            reader = _reader(grid, channels[:, rows], shown, rested=self.start != "fit")
            for name in distort:
                effect = get(name)
                if effect.channels and channel.kind not in effect.channels:
                    continue
                reader = _wrapped(effect, reader, at_channel(parameters, name, index, worlds))
            parts.append(reader(at)[:, :width])
            row += width
        return np.concatenate(parts, axis=1)


def at_channel(parameters: Parameters, name: str, channel: int | None, worlds: int) -> dict[str, np.ndarray]:
    """Parameters (W,) of a measurement effect at one channel; None: what all have in common, the least of one sign."""
    values = parameters.of(name)
    if channel is None:
        row = {n: np.maximum(v.min(axis=0), 0.0) + np.minimum(v.max(axis=0), 0.0) for n, v in values.items()}
    else:
        row = {n: v[channel] for n, v in values.items()}
    return {n: np.broadcast_to(v, (worlds,)) for n, v in row.items()}


def distinct_motions(
    worlds: Sequence[tuple[Model, Parameters]], *more: np.ndarray | None
) -> tuple[list[int], np.ndarray]:
    """Worlds of which no two move alike, and (K,) which of them each world moves like: a measurement moves nothing.

    Args:
        more: what else makes worlds differ, [K, ...] each.
    """
    shown = {e for e in worlds[0][0].effects if get(e).family == "measurement"}
    found: dict[tuple, int] = {}
    first, of = [], []
    for k, (model, parameters) in enumerate(worlds):
        felt = b"".join(parameters[p].tobytes() for p in parameters if p[0] not in shown)
        key = (model.position.tobytes(), felt, *(m[k].tobytes() for m in more if m is not None))
        if key not in found:
            found[key] = len(first)
            first.append(k)
        of.append(found[key])
    return first, np.array(of)


def shared(model: Model, recordings: Sequence[Recording], drive: Drive, parameters: Parameters) -> tuple[str, ...]:
    """The effects of a model, all that may be suspected, and those that calm panels."""
    every = suspects(model, recordings, drive, parameters)
    return tuple(dict.fromkeys([*model.effects, *(s.effect for s in every), *CALMING]))


def calmed(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """The same model with damped panels; folding is not damped."""
    added = [e for e, of in CALMING.items() if of in model.effects]
    quiet = model.with_effects(*added)
    out = parameters.for_model(quiet)
    with np.errstate(divide="ignore"):
        mobility = np.any(model.free, axis=1)[:, None] / parameters["inertia", "mass"]
        if "bars" in model.effects:
            lighter = 1.0 / np.maximum(mobility[model.bars].sum(axis=1), 1e-300)
            dashpot = 2 * RATIO * np.sqrt(parameters["bars", "stiffness"] * np.minimum(lighter, 1e300))
            out.set("bar_viscosity", "viscosity", out["bar_viscosity", "viscosity"] + dashpot)
        if "panel_bending" in model.effects:
            nodes, slopes = gradient_norms(model, "bend")
            inertia = 1.0 / np.maximum((mobility[nodes] * slopes[:, :, None] ** 2).sum(axis=1), 1e-300)
            dashpot = 2 * RATIO * np.sqrt(parameters["panel_bending", "stiffness"] * np.minimum(inertia, 1e300))
            out.set("panel_viscosity", "viscosity", out["panel_viscosity", "viscosity"] + dashpot)
    return quiet, out


def stiff(effect: str) -> bool:
    """Whether an effect is about what keeps panels in shape."""
    return get(effect).family in ("bar", "bend")


def softened(model: Model, parameters: Parameters, by: float) -> Parameters:
    """The same parameters with panels softer by a factor, damped by the same ratio of critical."""
    if by == 1.0:
        return parameters
    out = parameters.copy()
    for names, power in ((STIFFNESS, 1.0), (VISCOSITY, 0.5)):
        for owner, name in names.items():
            if owner in model.effects:
                out.set(owner, name, parameters[owner, name] / by**power)
    return out


FILMED = 64e6
"""Bytes of positions that are kept before they are read."""


def filmed(batch: Batch, recording: Recording, frames: int, substeps: int, step: float, *, first: bool = True):
    """Channels of the next frames and what else is asked of markers (`_pictured`), in parts [f, D + k, W].

    With the present state as the first frame, if `first`.
    """
    model, out, left = batch.model, [], frames
    lengths = np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1)
    limit = 0.5 * lengths.min(initial=np.inf) * substeps / step
    if first:
        batch.advance(0, step / substeps, limit)
        x, angles = batch.motion()
        out.append(_pictured(model, recording, x[None], angles[None]))
        left -= 1
    most = max(1, int(FILMED / (24 * len(model.position) * batch.worlds)))
    while left > 0:
        part = min(left, most)
        out.append(_pictured(model, recording, *batch.film(part, substeps, step / substeps, limit)))
        left -= part
    return out


def _pictured(model: Model, recording: Recording, x: np.ndarray, angles: np.ndarray | None) -> np.ndarray:
    """All components, the depth of every marker in a picture and, if asked for, every marker's axes, [F, D + k, W]."""
    parts = [channel_values(model, recording, x, angles), depths(model, recording, x)]
    if any(get(e).on_body for e in model.effects):
        parts.append(turned_axes(model, recording, x))
    return np.concatenate(parts, axis=1)


def _with_effects(state: State, model: Model, step: int | None = None) -> State:
    """A state for a model whose further effects have no memory; work is counted anew."""
    count = len(model.laws)
    return replace(
        state.copy(),
        work=np.zeros((count, state.worlds)),
        power=np.zeros((count, state.worlds)),
        step=state.step if step is None else step,
    )


def _wrapped(effect, inner, given):
    return lambda t: effect.apply(inner, t, **given)


def _reader(grid: np.ndarray, values: np.ndarray, shown: np.ndarray, *, rested: bool):
    """values [F, d, W] as a function of times [n, W], of which `shown` (W,) is the grid's start.

    Before it the motion rested, or went on as it began; many worlds may share a column.
    """
    curve = spline(grid, values)

    def at(times: np.ndarray) -> np.ndarray:
        since = times - shown
        columns, inverse = since[:, :1], np.zeros(since.shape[1], int)
        if np.any(since != columns):
            columns, inverse = np.unique(since, axis=1, return_inverse=True)
        out = np.empty((len(times), values.shape[1], values.shape[2]))
        for c in range(columns.shape[1]):
            mine = np.flatnonzero(inverse.ravel() == c)
            part = curve if columns.shape[1] == 1 else spline(grid, values[:, :, mine])
            inside = np.clip(columns[:, c], grid[0], grid[-1])
            out[:, :, mine] = part(inside)
            outside = columns[:, c] - inside
            for n in np.flatnonzero(outside if not rested else outside > 0):
                rate = part(inside[n : n + 1], 1)[0]
                out[n][:, mine] += outside[n] * rate
        return out

    return at


def spline(grid: np.ndarray, values: np.ndarray):
    """Cubic spline through [F, ...]; where a value is not finite, the whole curve is nan."""
    bad = ~np.all(np.isfinite(values), axis=0)
    curve = CubicSpline(grid, np.where(bad, 0.0, values), axis=0)
    return lambda t, order=0: np.where(bad, np.nan, curve(t, order))


def seen_first(values: np.ndarray) -> np.ndarray:
    """(D,) the first of the values (n, D) that is not missing; nan if all are."""
    seen = np.isfinite(values)
    return values[np.argmax(seen, axis=0), np.arange(values.shape[1])]


def _begin(block: Block) -> np.ndarray:
    return block.values[0] if block.begin is None else block.begin


def _by_length(blocks: list[Block], indices: list[int]) -> list[list[int]]:
    """Blocks that share their frame times."""
    groups: list[list[int]] = []
    for i in indices:
        for g in groups:
            a, b = blocks[g[0]].times, blocks[i].times
            if len(a) == len(b) and np.allclose(a, b, atol=1e-7 * max(1.0, a[-1])):
                g.append(i)
                break
        else:
            groups.append([i])
    return groups


def continuous(channels: np.ndarray, turning: np.ndarray, first: np.ndarray) -> None:
    """Makes angles [F, D, W] continuous in time, in place, starting in the turn of `first` [D, W]."""
    a = np.unwrap(np.nan_to_num(channels[:, turning]), axis=0)
    target = np.nan_to_num(first[turning])
    a += 2 * np.pi * np.round((target - a[0]) / (2 * np.pi))
    channels[:, turning] = np.where(np.isfinite(channels[:, turning]), a, np.nan)


def local_line(
    times: np.ndarray, values: np.ndarray, noise: np.ndarray, first: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, rate and its standard deviation (D,) at a frame, from a cubic over a window.

    The window grows while its cubic fits, and its rate is within what each smaller one left possible: what a cubic
    bends away from shows there before it shows in the scatter (Goldenshluger & Nemirovski 1997).
    """
    level, slope, error = np.full((3, values.shape[1]), np.nan)
    for d in range(values.shape[1]):
        half, low, high = 4, -np.inf, np.inf
        while half <= 64 and half <= len(times):
            lo, hi = max(0, first - half), min(len(times), first + half + 1)
            if hi - lo < 2 * half and lo == 0:
                hi = min(len(times), lo + 2 * half)
            half *= 2
            good = np.flatnonzero(np.isfinite(values[lo:hi, d])) + lo
            if len(good) < 6:
                continue
            t = times[good] - times[first]
            span = np.abs(t).max() or 1.0
            design = np.vander(t / span, 4, increasing=True)
            fit, *_ = np.linalg.lstsq(design, values[good, d], rcond=None)
            scatter = np.sqrt(np.sum((values[good, d] - design @ fit) ** 2) / (len(good) - 4))
            doubt = max(scatter, noise[d]) * np.linalg.norm(np.linalg.pinv(design)[1]) / span
            rate = fit[1] / span
            bent = scatter > 1.5 * noise[d]
            low, high = max(low, rate - POSSIBLE * doubt), min(high, rate + POSSIBLE * doubt)
            if np.isfinite(level[d]) and (bent or low > high):
                break
            level[d], slope[d], error[d] = fit[0], rate, doubt
            if bent:
                break
    return level, slope, error


def drive_of(recording: Recording, default: Drive) -> Drive:
    """The drive that was recorded, over the model's own.

    Raises:
        InputError: what `by_component` refuses, or a drive that this model lacks.
    """
    changed: dict[str, Signal] = {}
    file = recording.metadata.get("sidecar")
    for name, drive in recording.drive.items():
        clock = (recording.times if drive.times is None else drive.times) - recording.times[0]
        for channel, values in by_component(name, drive, file=file).items():
            if channel not in default.signals:
                raise InputError(
                    "the model has no such drive channel",
                    file=file,
                    field=f"drive.{name}",
                    value=channel,
                    allowed=", ".join(default.signals),
                )
            changed[channel] = Signal(offset=float(values[0])) if drive.constant else series(*refined(clock, values))
    return default.replace(**changed)


FINER = 6
"""Samples that replace one of a smooth drive."""


def refined(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """More samples of a smooth drive, by a cubic spline: lines between samples would cut its peaks.

    Every other sample is predicted from those between; a spline must do so five times better than lines. A drive
    with steps, or one as noisy as it is curved, is left as it is.
    """
    if len(times) < 16 or np.any(np.diff(times) <= 0):
        return times, values
    even, odd = slice(None, None, 2), slice(1, 2 * ((len(times) - 1) // 2), 2)
    line = np.interp(times[odd], times[even], values[even]) - values[odd]
    curve = CubicSpline(times[even], values[even])(times[odd]) - values[odd]
    if np.abs(curve).max() > 0.2 * np.abs(line).max():
        return times, values
    fine = np.interp(np.arange(FINER * (len(times) - 1) + 1) / FINER, np.arange(len(times)), times)
    return fine, CubicSpline(times, values)(fine)


def shifted(drive: Drive, starts: np.ndarray, duration: float, repeat: int) -> Drive:
    """The drive seen from several starts [s], one world for each; the set of worlds is repeated."""
    if not np.any(starts):
        return drive
    changed = {}
    for name, s in drive.signals.items():
        if s.times is None and not np.any(s.amplitude):
            continue
        wave = Signal(offset=s.offset, amplitude=s.amplitude, frequency=s.frequency, phase=s.phase)
        local = wave.sampled(duration) if np.any(s.amplitude) else np.array([0.0, duration])
        if s.times is not None:
            local = np.unique(np.concatenate([local, _knots(s.times, starts, duration)]))
        values = np.stack([np.broadcast_to(np.squeeze(s(local + t0)), local.shape) for t0 in starts], axis=1)
        changed[name] = series(local, np.tile(values, (1, repeat)))
    return drive.replace(**changed)


def _knots(times: np.ndarray, starts: np.ndarray, duration: float) -> np.ndarray:
    """Where a series bends within a duration from any of the starts; a fine grid if that were many more places."""
    rate = min(4.0 / float(np.min(np.diff(times))), SAMPLES_PER_SECOND)
    most = max(64, int(np.ceil(rate * duration)))
    begins = np.unique(starts)
    if len(begins) <= most:
        within = [times[slice(*np.searchsorted(times, (t0, t0 + duration)))] - t0 for t0 in begins]
        exact = np.unique(np.round(np.concatenate(within), 8))
        if len(exact) <= most:
            return exact[(exact > 0.0) & (exact < duration)]
    return np.linspace(0.0, duration, most + 1)
