"""Predictions by simulation: batches of rollouts that start where segments of recordings do."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.signal import savgol_filter

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.fit.noise import without_repeats
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject, Suspect
from origami_sim.hypotheses.suspects import at_several_times, told_apart
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation
from origami_sim.observation.channels import angle_mask, stacked
from origami_sim.observation.grips import refuse_unfollowed
from origami_sim.predict.begun import with_begins
from origami_sim.predict.drives import drive_of, reaching
from origami_sim.predict.filming import even, film_step, interpolated
from origami_sim.predict.measured import continuous, lateness, measured, read_until, spline
from origami_sim.predict.memories import Motion, memories
from origami_sim.predict.shots import (
    Shots,
    Simulated,
    by_geometry,
    by_length,
    joined,
    joined_poses,
    remembering,
    trembles,
)
from origami_sim.predict.starts import CAREFUL, Readings, seen_first, spans
from origami_sim.predict.stated import stated
from origami_sim.predict.thresholds import within_reach
from origami_sim.predict.track import coordinates
from origami_sim.predict.worlds import World, Worlds, distinct_motions
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.grips import motion_at, moving, ridden
from origami_sim.solve.rigid.batch import batch_of
from origami_sim.solve.statics.equilibria import equilibrium
from origami_sim.threads import default_threads, sharing, side_by_side

FASTEST = 3.0
"""Frames, as close as the closest, below which a time constant is not told from none."""

SPARE = 3
"""Frames simulated beyond a segment, for measurements that lag."""

TOGETHER, PARTS = 1024, 2
"""Rollouts that are made at once, at most, and parts into which segments are cut where no processes go in step.

With a quarter or four times as many rollouts, memory or overhead costs a twentieth more. A part costs 5 ms, so that
processes in step make one each.
"""


class Rollouts(Worlds, ABC):
    """A `Predictor` that simulates; see there for what is public.

    Args:
        subject: how to build the model. recordings: of one object.
        start: "fit" if segments have starts that are fitted, "rest" if recordings start from rest where the model
            does. threads: see `Batch`.

    Attributes:
        readings: what recordings say about the state at frames, by recording and frame, where that has been read.
    """

    panels, separate, curve = "", True, False

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, start: str = "fit", threads: int | None = None
    ):
        super().__init__(subject, recordings, threads)
        self.start = start
        self.drives = [drive_of(r, self.drive) for r in self.recordings]
        for one, drive in zip(self.recordings, self.drives, strict=True):
            refuse_unfollowed(self.model, one, drive)
        self._recorded: dict[int, Motion | None] = {}
        self.readings = Readings(self.model, self.articulation, self.recordings)
        self.local = 2 * self.articulation.size if start == "fit" else 0

    def segment(self, index: int, first: int, frames: int) -> Block:
        """The segment of so many frames of a recording that begins at a frame."""
        recording = self.recordings[index]
        values, noise = stacked(recording)
        part = slice(first, first + frames)
        arm, m = self.articulation, self.articulation.size
        pose, rates, known, found, shows = arm.reference(), np.zeros(m), np.zeros(0), None, None
        if self.start == "fit":
            found = self.readings.at(index, first)
            pose, rates, shows = found.pose, found.rates, found.tangent
            usual = np.maximum(self.readings.usual_rates(index), 1e-9)
            told = np.isfinite(found.error)
            wide = np.hypot(CAREFUL * np.where(told, found.error, 0.0), np.maximum(usual, np.abs(rates)))
            known = np.concatenate([spans(arm, self.model), wide])
        times = recording.times[part] - recording.times[first]
        read = values[part]
        kept = without_repeats(read)
        also = {"begin": seen_first(read), "shows": shows, "repeats": np.isnan(kept) & np.isfinite(read)}
        block = Block(index, first, times, kept, noise, pose, rates, known, **also)
        if found is None or first > 0:
            return block
        return stated(self, block, self.readings.usual_rates(index), found, partial(self.readings.slowest, index))

    def _shot(self, each: Sequence[Hypothesis], theta, local, wanted: list[int]) -> Prediction:
        effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
        values: dict[int, np.ndarray] = {}
        ends: dict[int, np.ndarray | None] = {}
        jobs, parts, alone = [], [], (self.threads or default_threads()) == 1
        for r in range(len(self.recordings)):
            mine = [b for b in wanted if self.blocks[b].recording == r]
            if not mine:
                continue
            worlds, impossible = self.worlds_of(each, theta, effects, r)
            first = None if local is None else local[0]
            remembered = memories(self, r, worlds, [self.blocks[b] for b in mine], first)
            for group in by_length(self.blocks, mine):
                count = sharing() if sharing() > 1 or alone else PARTS
                most = max(1, min(TOGETHER // len(worlds), -(-len(group) // count)))
                some = [group[k : k + most] for k in range(0, len(group), most)]
                cuts = self._cuts(len(worlds), count if len(some) < count else 1)
                pace = self._pace(worlds) if len(cuts) > 1 else None
                for part in some:
                    parts.append((r, part, impossible, len(cuts)))
                    for cut in cuts:
                        asked = cut, worlds[0][0], pace
                        jobs.append(partial(self._roll, r, group, part, worlds, local, remembered, asked))
        cores = -(-(self.threads or default_threads()) // max(len(jobs), 1))
        rolled = side_by_side([partial(job, cores) for job in jobs], self.threads)
        several = iter(rolled)
        for r, part, impossible, count in parts:
            made, arrived, first = joined([next(several) for _ in range(count)])
            self._keep(r, [self.blocks[b] for b in part], first)
            for n, b in enumerate(part):
                values[b], ends[b] = made[n], None if arrived is None else arrived[n]
                if impossible:
                    values[b][impossible] = np.nan
        return Prediction([values[b] for b in wanted], [ends[b] for b in wanted])

    def admitted(self, every: Sequence[Suspect]) -> list[Suspect]:
        """See `Predictor.admitted`: those with a time constant with several. See also `told_apart`."""
        shortest = FASTEST * min(film_step(r.times) for r in self.recordings)
        longest = max(float(r.times[-1] - r.times[0]) for r in self.recordings)
        every = at_several_times(within_reach(self, told_apart(every, len(self.components))), shortest, longest)
        return with_begins(every, self._unsettled(), self.articulation.creases.tolist())

    def _unsettled(self) -> dict[int, float]:
        """Recordings before which the device may have moved, and how fast it does at the first frame, over its most.

        What is let go moves no faster than its first frames tell. A swing that is recorded at its turning point would
        look the same, but few are.
        """
        out: dict[int, float] = {}
        for n, r in enumerate(self.recordings):
            if self.start != "fit" or (r.start and r.start.state != "moving") or self.recorded(n) is None:
                continue
            first = next(b for b in self.blocks if b.recording == n)
            speed = float(np.max(np.abs(first.rates) / np.maximum(self.readings.usual_rates(n), 1e-12), initial=0.0))
            out[n] = 1.0 if r.start else min(1.0, speed)
        return out

    @abstractmethod
    def step(self, hypothesis: Hypothesis, theta: np.ndarray) -> float:
        """See `Predictor.step`."""

    def _cuts(self, worlds: int, count: int) -> list[slice]:
        """Of which worlds rollouts are made together: here of all."""
        return [slice(0, worlds)]

    def _pace(self, worlds: list[World]) -> float | None:
        """The longest step of the solver [s] with which all worlds are stable."""
        return None

    def _roll(
        self,
        r: int,
        group: list[int],
        part: list[int],
        every_world: list[World],
        local,
        remembered,
        asked,
        threads: int,
    ):
        """Values [B, K, n, D] and ends [B, K, L] of worlds in blocks, and what `_keep` keeps of their rollouts.

        Batches run over worlds, then blocks. What is asked of all blocks of a group does not depend on its parts, so
        that bytes do not either.

        Args:
            asked: which worlds, the model of the first of all, and `_pace` of all.
        """
        cut, lead, pace = asked
        worlds = every_world[cut]
        local = None if local is None else local[cut]
        if remembered is not None:
            remembered = {n: m[:, cut] for n, m in remembered.items()}
        recording, every = self.recordings[r], [self.blocks[b] for b in group]
        blocks, mine = [self.blocks[b] for b in part], [group.index(b) for b in part]
        k, count = len(worlds), len(blocks)
        model, uneven, step = lead, trembles(every), film_step(recording.times)
        lasting = np.array([b.lasting for b in every]) if uneven else every[0].lasting
        ends = round(float(np.median(lasting)) / step)
        if ends and not uneven:
            step = even(step, every[0].lasting, ends)
        begins = recording.times[[b.first for b in every]] - recording.times[0]
        once = Parameters.join([p for _, p in worlds])
        late, shown = lateness(model, once, k, begins, self.start == "fit")
        longer = lateness(model, once, k, begins + lasting, self.start == "fit")[0] - late
        if uneven and ends:
            longer = longer + (lasting - ends * step)
        clocked = bool(ends and np.any(longer))
        begun = begins + late if np.any(late) else begins
        distort = [e for e in model.effects if get(e).family == "measurement"]
        times = np.stack([b.times for b in (blocks if uneven else every[:1])], axis=1)
        frames, latest = len(times), max(b.times[-1] for b in every)
        timed = any(not get(e).channels for e in distort)  # what reads angles or places has no time of its own
        even_film = np.allclose(times[:, 0], np.arange(frames) * step, atol=1e-6 * step)
        as_filmed = not timed and not uneven and even_film
        if not as_filmed:
            last = max(read_until(model, once, c, latest, shown) for c in range(len(recording.channels)))
            frames = int(np.ceil(last / step - 1e-6)) + 1 + SPARE
        starts = None if local is None else local[:, part]
        moves, of = distinct_motions(worlds, late, starts)
        some = None if starts is None else starts[moves]
        memory = None
        if remembered is not None:
            first = np.stack([remembered[b.first][:, moves] for b in blocks], axis=2)
            memory = first.reshape(len(first), -1)
        chosen = [worlds[m] for m in moves]
        frames = max(frames, ends + 2 if clocked else ends + 1)
        here = np.ix_(moves, mine) if np.any(late) else None
        shots = Shots(
            r,
            blocks,
            chosen,
            None if here is None else late[here],
            some,
            memory,
            step,
            frames,
            ends,
            clocked,
            begun,
            threads,
            lead,
            pace,
        )
        simulated = self._filmed(shots)
        raw, arrived = simulated.raw, simulated.arrived
        turning = angle_mask(recording)
        first_seen = np.tile(np.stack([_begin(b) for b in blocks]), (len(moves), 1)).T
        continuous(raw[:, : len(turning)], turning, first_seen)
        columns = (of[:, None] * count + np.arange(count)).ravel()
        channels = raw[:, :, columns]
        plain = channels[:, : len(turning)]  # without the depths
        grid = np.arange(len(raw)) * step
        if distort:
            parameters = Parameters.join([p for _, p in worlds], repeat=count)
            began = recording.start is not None and recording.start.state != "moving"  # at rest
            rested = None if as_filmed else np.tile([self.start != "fit" or (began and not b.first) for b in blocks], k)
            at = np.tile(times, (1, k)) if uneven else times[:, 0]
            values = measured(parameters, recording, distort, grid, channels, at, shown, rested=rested)
        elif as_filmed:
            values = plain[: len(times)]
        elif uneven:
            values = np.empty((len(times), *plain.shape[1:]))
            for n, own in enumerate(times.T):
                values[:, :, n::count] = spline(grid, plain[:, :, n::count])(own)
        else:
            values = spline(grid, plain)(times[:, 0])
        values = values.reshape(len(times), -1, k, count)
        tied = None
        if arrived is not None:
            near = arrived[..., columns]
            tied = (interpolated(near, longer[:, mine].ravel(), step) if clocked else near[0]).reshape(-1, k, count)
        return values.transpose(3, 2, 0, 1), None if tied is None else tied.T, simulated.first

    @abstractmethod
    def _filmed(self, shots: Shots) -> Simulated:
        """What rollouts do; `_keep` keeps what of it may be asked for again."""

    def _keep(self, r: int, blocks: Sequence[Block], first: list[tuple[tuple, np.ndarray, np.ndarray | None]]) -> None:
        """Keeps what rollouts of the first world did in blocks of a recording, see `Simulated.first`."""

    def driven(self, shots: Shots) -> Drive:
        """The drive that reaches every rollout."""
        recording, span = self.recordings[shots.recording], shots.frames * shots.step
        begins = recording.times[[b.first for b in shots.blocks]] - recording.times[0]
        given = self.drives[shots.recording]
        if shots.late is not None:
            begins = begins + shots.late
        return reaching(shots.worlds[0][0], [p for _, p in shots.worlds], given, begins, span, shots.begun)

    def state(self, shots: Shots) -> State:
        """The starts of all rollouts [world, block]."""
        worlds, blocks, local = shots.worlds, shots.blocks, shots.local
        count, model = len(blocks), worlds[0][0]
        if self.start != "fit":
            x = np.repeat(np.stack([resting(*w) for w in worlds], axis=1), count, axis=1)
            return remembering(State.at_rest(model, x.shape[1], position=x, placed=True), shots)
        m = self.articulation.size
        base, rates = joined_poses([b.pose for b in blocks]), np.stack([b.rates for b in blocks], axis=1)
        x = np.empty((len(model.position), len(worlds) * count, 3))
        v = np.empty_like(x)
        for key, mine in by_geometry([own for own, _ in worlds]).items():
            if key not in self._arms:
                self._arms[key] = Articulation(worlds[mine[0]][0])
            arm = self._arms[key]
            pose, u = base.select(np.tile(np.arange(count), len(mine))), np.tile(rates, len(mine))
            if local is not None:
                shift = local[mine].reshape(-1, 2 * m).T
                pose, u = arm.moved(pose, shift[:m]), u + shift[m:]
            at = (np.array(mine)[:, None] * count + np.arange(count)).ravel()
            x[:, at] = own_x = arm.positions(pose)
            v[:, at] = np.einsum("mnwa,mw->nwa", arm.jacobian(pose, own_x), u)
        state = State.at_rest(model, x.shape[1], position=x, placed=True)
        state.v[:] = v
        if moving(model, self.drives[shots.recording]):
            ridden(model, state, motion_at(model, self.driven(shots), 0.0, state.worlds))
        return remembering(state, shots)

    def batch(self, model: Model, parameters: Parameters, drive: Drive, state: State, **options) -> Batch:
        return batch_of(model, parameters, drive, state, among=self.shared, **{"threads": self.threads, **options})

    def own_memories(self, r: int, worlds: list[World], local: np.ndarray | None) -> dict[int, np.ndarray]:
        """Memory [M, K] by first frame of worlds that move by themselves from segment to segment; none: not known."""
        return {}

    def motion(self, r: int, world: World, local: np.ndarray | None) -> Motion | None:
        """The motion of a recording that laws remember: here the recorded one.

        Args:
            world: of whose motion. local: [B, L] shifts of all segments' starts.
        """
        return self.recorded(r)

    def recorded(self, r: int) -> Motion | None:
        """The recorded motion, smoothed; None if the channels do not tell it."""
        if r not in self._recorded:
            found = coordinates(self, r)
            self._recorded[r] = None
            if found is not None:
                q = savgol_filter(found[0], 7, 3, axis=1) if found[0].shape[1] > 7 else found[0]
                self._recorded[r] = Motion(self._placed(q))
        return self._recorded[r]

    def _placed(self, q: np.ndarray) -> np.ndarray:
        """Positions [F, N, 3] of coordinates [m, F] of a device that is held."""
        arm = self.articulation
        pose = arm.moved(arm.reference(q.shape[1]), q - arm.reference().angles)
        return np.moveaxis(arm.positions(pose), 1, 0)


def resting(model: Model, parameters: Parameters) -> np.ndarray:
    """[N, 3] where a world begins at rest: the equilibrium without a drive that is nearest to where the model starts.

    It begins in the reference state where the model states no start. If there is no such equilibrium, nan.
    """
    if not len(model.start):
        return model.position
    found = equilibrium(model, parameters, contact=False)
    return found.x if found.converged else np.full_like(model.position, np.nan)


def _begin(block: Block) -> np.ndarray:
    return block.values[0] if block.begin is None else block.begin
