"""Predictions by simulation: batches of rollouts that start where segments of recordings do."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain

import numpy as np
from scipy.signal import savgol_filter

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject, Suspect
from origami_sim.hypotheses.suspects import at_several_times, told_apart
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation, Pose
from origami_sim.model.distort import distorted
from origami_sim.predict.begun import begins, with_begins
from origami_sim.predict.channels import angle_mask, stacked
from origami_sim.predict.drives import drive_of, shifted
from origami_sim.predict.filming import even, film_step, interpolated
from origami_sim.predict.measured import continuous, lateness, measured, read_until, spline
from origami_sim.predict.starts import CAREFUL, NEAR, Reading, channel_tangent, read_start, seen_first, spans
from origami_sim.predict.stated import stated
from origami_sim.predict.thresholds import within_reach
from origami_sim.predict.track import coordinates
from origami_sim.predict.worlds import World, Worlds, distinct_memories, distinct_motions, lasting
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid.batch import batch_of
from origami_sim.solve.statics.equilibria import equilibrium
from origami_sim.threads import T, default_threads, shared, sharing, side_by_side

LEAD = 1500
"""Frames between two segments along which laws with memory are carried, at most; the motion there is as recorded."""

FASTEST = 3.0
"""Frames, as close as the closest, below which a time constant is not told from none."""

SPARE = 3
"""Frames simulated beyond a segment, for measurements that lag."""

TOGETHER, PARTS = 1024, 2
"""Rollouts that are made at once, at most, and parts into which segments are cut where no processes go in step.

With a quarter or four times as many rollouts, memory or overhead costs a twentieth more. A part costs 5 ms, so that
processes in step make one each.
"""

READ = 30
"""Starts that one core reads while others read others: some 50 ms of work."""


@dataclass(frozen=True, eq=False)
class Shots:
    """Rollouts that begin together: worlds times blocks of equal times.

    Attributes:
        recording: their index. blocks: (B). worlds: (K). late: [K, B] by how much later than its clock a block begins
            [s]; None: none of all is. local: [K, B, L] shifts of starts, or None. memory: [M, K B] of laws, or None.
            step: between frames [s]. frames: of each rollout. ends:
            the frame at which the next blocks begin; 0: none is tied to them. clocked: whether a clock runs fast or
            slow, so that they begin a little before or after that frame. begun: times at which these and all others of
            their kind begin [s]; None: these alone. threads: see `Batch`.
        model: of the first of all worlds that were asked for together. pace: longest step of the solver with which all
            of these are stable [s]; None: not asked.
    """

    recording: int
    blocks: list[Block]
    worlds: list[World]
    late: np.ndarray | None
    local: np.ndarray | None
    memory: np.ndarray | None
    step: float
    frames: int
    ends: int
    clocked: bool = False
    begun: np.ndarray | None = None
    threads: int | None = None
    model: Model | None = None
    pace: float | None = None


@dataclass(frozen=True, eq=False)
class Simulated:
    """What rollouts do, before anything measures it.

    Attributes:
        raw: [frames, D + k, K B] channels and depths. arrived: [1, L, K B] ends of tied blocks, or None. If
            `Shots.clocked`, [3, L, K B]: a frame before, where the next begins as recorded, and a frame after.
        first: what may be asked for again, of the first world in each block: what it depends on, [frames, D + k] and
            [1 or 3, L] or None.
    """

    raw: np.ndarray
    arrived: np.ndarray | None = None
    first: list[tuple[tuple, np.ndarray, np.ndarray | None]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Motion:
    """What laws remember where segments start.

    Attributes:
        positions: [F, N, 3] of all frames [m]. memory: (M,) of the world that moved so, by first frame, where known.
        films: of its segments, where known, see `RigidRollouts`.
    """

    positions: np.ndarray
    memory: dict[int, np.ndarray] = field(default_factory=dict)
    films: dict[tuple, tuple] = field(default_factory=dict)


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
        self._recorded: dict[int, Motion | None] = {}
        self.readings: dict[tuple[int, int], Reading] = {}
        self._usual: dict[int, np.ndarray] = {}
        self.local = 2 * self.articulation.size if start == "fit" else 0

    # --- segments

    def segment(self, index: int, first: int, frames: int) -> Block:
        """The segment of so many frames of a recording that begins at a frame."""
        recording = self.recordings[index]
        values, noise = stacked(recording)
        part = slice(first, first + frames)
        arm, m = self.articulation, self.articulation.size
        pose, rates, known, found, shows = arm.reference(), np.zeros(m), np.zeros(0), None, None
        if self.start == "fit":
            self.read_starts(index, [first])
            found = self.readings[index, first]
            pose, rates, shows = found.pose, found.rates, found.tangent
            usual = np.maximum(self.usual_rates(index), 1e-9)
            told = np.isfinite(found.error)
            wide = np.hypot(CAREFUL * np.where(told, found.error, 0.0), np.maximum(usual, np.abs(rates)))
            known = np.concatenate([spans(arm, self.model), wide])
        times = recording.times[part] - recording.times[first]
        begin = seen_first(values[part])
        block = Block(index, first, times, values[part].copy(), noise, pose, rates, known, begin=begin, shows=shows)
        if found is None or first > 0:
            return block
        return stated(self, block, self.usual_rates(index), found.error, found.shown)

    def read_starts(self, index: int, frames: Sequence[int]) -> None:
        """Reads the state at frames of a recording, where that has not been done, into `readings`."""
        recording = self.recordings[index]
        values, noise = stacked(recording)
        new = [k for k in frames if (index, k) not in self.readings]

        def read(part: list[int]) -> list[Reading]:
            return [read_start(self.model, self.articulation, recording, values, noise, k) for k in part]

        found = shared([partial(read, new[k : k + READ]) for k in range(0, len(new), READ)])
        self.readings.update(zip(((index, k) for k in new), chain.from_iterable(found), strict=True))

    def usual_rates(self, index: int) -> np.ndarray:
        """(m,) root mean square of the rates of the coordinates in a recording, where channels tell them.

        What no channel tells is taken to move as fast as what they do tell, a radian as a device's size.
        """
        if index not in self._usual:
            arm, count = self.articulation, len(self.recordings[index].times)
            picked = np.unique(np.linspace(0, count - 1, 24).astype(int)).tolist()
            self.read_starts(index, picked)
            found = [self.readings[index, k] for k in picked]
            size = spans(arm, self.model)
            rates = np.stack([np.where(np.isfinite(f.error), f.rates, np.nan) for f in found]) / size
            squares = np.array([np.mean(r[np.isfinite(r)] ** 2) if np.any(np.isfinite(r)) else np.nan for r in rates.T])
            most = np.nanmax(squares) if np.any(np.isfinite(squares)) else 1.0
            self._usual[index] = np.sqrt(np.where(np.isfinite(squares), squares, most)) * size
        return self._usual[index]

    def tells(self, recording: Recording, values, noise, first: int) -> bool:
        """Whether what was seen near a frame tells all coordinates that the channels can tell."""
        near = np.isfinite(values[max(0, first - NEAR) : first + NEAR + 1]).any(axis=0)
        ever = np.isfinite(values).any(axis=0)
        if np.array_equal(near, ever):
            return True
        pose = self.articulation.reference()
        _, tangent = channel_tangent(self.model, self.articulation, recording, pose, values[first])
        by = tangent / noise[:, None]
        return bool(np.linalg.matrix_rank(by[near]) == np.linalg.matrix_rank(by[ever]))

    # --- predictions

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
            memories = self._memories(r, worlds, [self.blocks[b] for b in mine], first)
            for group in _by_length(self.blocks, mine):
                count = sharing() if sharing() > 1 or alone else PARTS
                most = max(1, min(TOGETHER // len(worlds), -(-len(group) // count)))
                some = [group[k : k + most] for k in range(0, len(group), most)]
                cuts = self._cuts(len(worlds), count if len(some) < count else 1)
                pace = self._pace(worlds) if len(cuts) > 1 else None
                for part in some:
                    parts.append((r, part, impossible, len(cuts)))
                    for cut in cuts:
                        asked = cut, worlds[0][0], pace
                        jobs.append(partial(self._roll, r, group, part, worlds, local, memories, asked))
        cores = -(-(self.threads or default_threads()) // max(len(jobs), 1))
        rolled = side_by_side([partial(job, cores) for job in jobs], self.threads)
        several = iter(rolled)
        for r, part, impossible, count in parts:
            made, arrived, first = _joined([next(several) for _ in range(count)])
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
            speed = float(np.max(np.abs(first.rates) / np.maximum(self.usual_rates(n), 1e-12), initial=0.0))
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
        self, r: int, group: list[int], part: list[int], every_world: list[World], local, memories, asked, threads: int
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
        if memories is not None:
            memories = {n: m[:, cut] for n, m in memories.items()}
        recording, every = self.recordings[r], [self.blocks[b] for b in group]
        blocks, mine = [self.blocks[b] for b in part], [group.index(b) for b in part]
        k, count = len(worlds), len(blocks)
        model, times, lasting = lead, every[0].times, every[0].lasting
        step = film_step(recording.times)
        ends = round(lasting / step)
        if ends:
            step = even(step, lasting, ends)
        begins = recording.times[[b.first for b in every]] - recording.times[0]
        once = Parameters.join([p for _, p in worlds])
        late, shown = lateness(model, once, k, begins, self.start == "fit")
        longer = lateness(model, once, k, begins + lasting, self.start == "fit")[0] - late
        clocked = bool(ends and np.any(longer))
        begun = begins + late if np.any(late) else begins
        distort = [e for e in model.effects if get(e).family == "measurement"]
        frames = len(times)
        timed = any(not get(e).channels for e in distort)  # what reads angles or places has no time of its own
        as_filmed = not timed and np.allclose(times, np.arange(frames) * step, atol=1e-6 * step)
        if not as_filmed:
            last = max(read_until(model, once, c, times[-1], shown) for c in range(len(recording.channels)))
            frames = int(np.ceil(last / step - 1e-6)) + 1 + SPARE
        starts = None if local is None else local[:, part]
        moves, of = distinct_motions(worlds, late, starts)
        some = None if starts is None else starts[moves]
        memory = None
        if memories is not None:
            first = np.stack([memories[b.first][:, moves] for b in blocks], axis=2)
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
            rested = None if as_filmed else self.start != "fit"
            values = measured(parameters, recording, distort, grid, channels, times, shown, rested=rested)
        elif as_filmed:
            values = plain[: len(times)]
        else:
            values = spline(grid, plain)(times)
        values = values.reshape(len(times), -1, k, count)
        tied = None
        if arrived is not None:
            near = arrived[..., columns]
            tied = (interpolated(near, longer[:, mine].ravel(), step) if clocked else near[0]).reshape(-1, k, count)
        # as stored ones lie in memory: sums depend on it in their last digit
        ends = None if tied is None else np.ascontiguousarray(tied.T)
        return np.ascontiguousarray(values.transpose(3, 2, 0, 1)), ends, simulated.first

    @abstractmethod
    def _filmed(self, shots: Shots) -> Simulated:
        """What rollouts do; `_keep` keeps what of it may be asked for again."""

    def _keep(self, r: int, blocks: Sequence[Block], first: list[tuple[tuple, np.ndarray, np.ndarray | None]]) -> None:
        """Keeps what rollouts of the first world did in blocks of a recording, see `Simulated.first`."""

    def _driven(self, shots: Shots, model: Model, parameters: Parameters) -> Drive:
        """The drive that reaches every rollout."""
        recording, span = self.recordings[shots.recording], shots.frames * shots.step
        begins = recording.times[[b.first for b in shots.blocks]] - recording.times[0]
        given = self.drives[shots.recording]
        if shots.late is not None:
            drive = shifted(given, (begins + shots.late).ravel(), span, 1, shots.begun)
        else:
            drive = shifted(given, begins, span, len(shots.worlds), shots.begun)
        return distorted(model, parameters, drive, span)

    def _state(self, shots: Shots) -> State:
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
        alike: dict[bytes, list[int]] = {}
        for n, (own, _) in enumerate(worlds):
            alike.setdefault(own.position.tobytes(), []).append(n)
        for key, mine in alike.items():
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
        return remembering(state, shots)

    def _memories(
        self, r: int, worlds: list[World], wanted: Sequence[Block], local: np.ndarray | None
    ) -> dict[int, np.ndarray] | None:
        """Memory [M, K] of the laws where segments start, by first frame; None: no memory.

        It is that of the first world's motion up to there (`_motion`), of which starts are shifted by local [B, L]. All
        nodes are held and carried along it: the laws feel the motion without changing it. Before that they rest. What
        carrying straight from frame to frame does wrong to the first world, whose memory is known, it does to all.
        What does not fade is that of each world's own motion, where that can be followed: with dry friction a swing
        turns elsewhere, and rests elsewhere, if that yields elsewhere or the arm is heavier.
        """
        model = worlds[0][0]
        # also of segments not asked for
        every = np.unique([b.first for b in (*self.blocks, *wanted) if b.recording == r])
        if not (size := len(State.at_rest(model).memory)):
            return None
        if not np.any(every) and not begins(model, Parameters.join([p for _, p in worlds])):
            return None
        motion = self._motion(r, worlds[0], local)
        if motion is None:
            return None
        rows = lasting(model)
        follows = len(rows) > 0 and bool(motion.memory)
        some, of = distinct_motions(worlds) if follows else distinct_memories(worlds)
        worlds, others = [worlds[k] for k in some], range(1, len(some))
        asked = every[every <= max(b.first for b in wanted)]
        own = self._own_memories(r, worlds[1:], local) if follows and others else {}
        if not own.keys() >= set(asked.tolist()):
            return {first: memory[:, of] for first, memory in self._carried(r, worlds, motion, asked).items()}
        # of worlds that are followed only what fades is carried
        along, out = [0, *others] if len(rows) < size else [0], dict[int, np.ndarray]()
        for first, carried in self._carried(r, [worlds[k] for k in along], motion, asked).items():
            memory = np.empty((size, len(worlds)))
            memory[:, along] = carried
            memory[rows, 1:] = own[first][rows]
            out[first] = memory[:, of]
        return out

    def _carried(self, r: int, worlds: list[World], motion: Motion, asked: np.ndarray) -> dict[int, np.ndarray]:
        """Memory [M, K] at frames that are asked for, of worlds that are carried along the motion of the first."""
        if len(worlds) == 1 and motion.memory.keys() >= set(asked.tolist()):
            return {n: motion.memory[n][:, None] for n in asked.tolist()}
        path = motion.positions[:, :, None]
        step = float(np.median(np.diff(self.recordings[r].times)))

        def carry(near: np.ndarray, part: list[World], threads: int) -> np.ndarray:
            """[n, M, k] at frames that are near each other."""
            begin = max(int(near[0]) - LEAD, 0)
            held = self._rested(r, part, begin, path[begin], threads)
            rested = held[-1].memory[None]
            if near[-1] <= begin:
                return rested
            batch = self._batch(*held, supports=part[0][0], threads=threads)
            later = batch.carry(path[begin : near[-1] + 1], step, (near[near > begin] - begin).tolist())
            return np.concatenate([rested, later])[-len(near) :]

        out: dict[int, np.ndarray] = {}
        for near in np.split(asked, np.flatnonzero(np.diff(asked) > LEAD) + 1):  # carried from one to the next
            found = np.concatenate([part for _, part in self._in_parts(worlds, partial(carry, near))], axis=2)
            for first, carried in zip(near.tolist(), found, strict=True):
                if first in motion.memory:
                    carried = carried + (motion.memory[first][:, None] - carried[:, :1])
                    carried[:, 0] = motion.memory[first]  # to the last digit, so that its film is known again
                out[first] = carried
        return out

    def _in_parts(self, worlds: list[World], make: Callable[[list[World], int], T]) -> list[tuple[list[World], T]]:
        """What is made of worlds, of some of them by each process, on so many cores."""
        cuts = np.array_split(np.arange(len(worlds)), min(sharing(), len(worlds)))
        parts = [[worlds[k] for k in cut] for cut in cuts]
        cores = -(-(self.threads or default_threads()) // len(parts))
        return list(zip(parts, shared([partial(make, part, cores) for part in parts]), strict=True))

    def _own_memories(self, r: int, worlds: list[World], local: np.ndarray | None) -> dict[int, np.ndarray]:
        """Memory [M, K] by first frame of worlds that move by themselves from segment to segment; none: not known."""
        return {}

    def _rested(
        self, r: int, worlds: list[World], frame: int, x: np.ndarray, threads: int = 1
    ) -> tuple[Model, Parameters, Drive, State]:
        """Worlds held at positions [N, 1, 3], where they have rested, driven as from a frame of a recording on.

        At the first frame with what `begins` says beside.
        """
        model, parameters = worlds[0][0], Parameters.join([p for _, p in worlds])
        times = self.recordings[r].times - self.recordings[r].times[0]
        step = float(np.median(np.diff(times)))
        span = float(times[-1] - times[frame]) + step
        drive = distorted(model, parameters, shifted(self.drives[r], times[[frame]], span, len(worlds)), span)
        held = replace(model, free=np.zeros_like(model.free))
        state = State.at_rest(held, len(worlds), position=np.repeat(x, len(worlds), axis=1))
        one = {"supports": model, "threads": threads}
        batch = self._batch(held, parameters, drive.held(0.0), state, **one)
        batch.carry(np.stack([x, x]), LEAD * step)
        rested, motion = batch.remembered(), self.recorded(r)
        moved = begins(model, parameters) if not frame and motion is not None else []
        if moved:  # as unknown as the start's angles are
            assert motion is not None
            batch = self._batch(held, parameters, drive, replace(state, memory=rested), **one)
            path = motion.positions[:, :, None]
            usual = batch.carry(path, step, range(1, len(path)))
            for rows, given in moved:
                rested[rows] += given * np.abs(usual[:, rows]).max(axis=0)
        return held, parameters, drive, replace(state, memory=rested)

    def _batch(self, model: Model, parameters: Parameters, drive: Drive, state: State, **options) -> Batch:
        return batch_of(model, parameters, drive, state, among=self.shared, **{"threads": self.threads, **options})

    def _motion(self, r: int, world: World, local: np.ndarray | None) -> Motion | None:
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


def remembering(state: State, shots: Shots) -> State:
    """The state with the memory that the laws have there."""
    if shots.memory is not None:
        state.memory[:] = shots.memory
    return state


def joined_poses(poses: Sequence[Pose]) -> Pose:
    """Poses as one of as many worlds."""
    return Pose(
        np.concatenate([p.rotation for p in poses]),
        np.concatenate([p.centre for p in poses]),
        np.concatenate([p.angles for p in poses], axis=1),
    )


def _joined(several: list[tuple]) -> tuple:
    """What `_roll` returns for a part of the blocks, of all worlds, from what it returned for some of these each."""
    if len(several) == 1:
        return several[0]
    made = np.concatenate([values for values, *_ in several], axis=1)
    ends = [end for _, end, _ in several]
    arrived = None if ends[0] is None else np.concatenate(ends, axis=1)
    return made, arrived, several[0][2]


def _begin(block: Block) -> np.ndarray:
    return block.values[0] if block.begin is None else block.begin


def _by_length(blocks: list[Block], indices: list[int]) -> list[list[int]]:
    """Blocks that share their frame times, and the time until the next."""
    groups, left = [], list(indices)
    while left:
        a = blocks[left[0]]
        slack, kind = 1e-7 * max(1.0, a.times[-1]), (len(a.times), a.reach is None)
        near = [i for i in left if (len((b := blocks[i]).times), b.reach is None) == kind]
        near = [i for i in near if abs(blocks[i].lasting - a.lasting) < slack]
        times = np.stack([blocks[i].times for i in near])
        alike = np.all(np.abs(times - a.times) <= slack + 1e-5 * times, axis=1)
        groups.append([i for i, same in zip(near, alike.tolist(), strict=True) if same])
        done = set(groups[-1])
        left = [i for i in left if i not in done]
    return groups
