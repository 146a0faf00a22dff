"""Rollouts of rigid panels: recordings cut into short segments that are tied to each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.fit.hypothesis import Hypothesis, Subject
from origami_sim.fit.predictor import Block
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.articulation import Pose
from origami_sim.predict.filming import even, film, film_step, pictured
from origami_sim.predict.rollouts import (
    Motion,
    Rollouts,
    Shots,
    Simulated,
    joined_poses,
)
from origami_sim.predict.worlds import World
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid.batch import RigidBatch, Topology, check_inertia

FEWEST = 8
"""Frames of a segment, at least: as many as tell its start's rate."""

TOLERANCE = 1e-8
"""Error of a step of a rollout [rad]: far below any recorder's, and below what differences of rollouts can see.

Ten times less costs 1.6 times the steps; ten times more begins to show in derivatives. Steps end at every frame, also
where this would let them go over three: worlds that differ by a nudge then take the same steps, whose errors cancel in
differences, where steps of their own made intervals fifty times too narrow.
"""

FINEST = 1e-4
"""Part of a frame below which a rollout's step may not fall: a hypothesis that is so stiff is given up.

Rollouts take one to ten steps per frame; a tenth of it lets a wrong hypothesis take ten times as long.
"""


POINTS = 8
"""Motions that are kept: those of the last points that a fit tried."""


@dataclass(frozen=True, eq=False)
class Chained:
    """Segments of a recording, each tied to the next.

    Attributes:
        recording: its index. blocks: (B). local: [1, B, L] shifts of their starts, or None. angles, rates: [B, m] where
            they begin. begins: (B + 1,) frames at which they do, and the end. step: between frames [s]. dt: alike,
            where blocks do not last as long.
    """

    recording: int
    blocks: list[Block]
    local: np.ndarray | None
    angles: np.ndarray
    rates: np.ndarray
    begins: list[int]
    step: float
    dt: float

    def shots(self, worlds: list[World], frames: int) -> Shots:
        """Rollouts of worlds that begin with the first block."""
        local = None if self.local is None else np.repeat(self.local[:, :1], len(worlds), axis=0)
        return Shots(self.recording, self.blocks[:1], worlds, None, local, None, self.step, frames, 0)


class RigidRollouts(Rollouts):
    """A `Predictor` of devices whose panels do not visibly bend.

    Args:
        segment: length of a segment [s]; None: a recording is one segment. tied: whether a segment begins where the one
            before ends. probe: of the same model and recordings; what it has read of them is not read again. The rest
            as for `Rollouts`.

    Raises:
        InputError: what rigid panels refuse; closed loops, a root that is held in part.
    """

    panels, nudge, blur = "rigid", 0.3, TOLERANCE

    def __init__(
        self,
        subject: Subject,
        recordings: Sequence[Recording],
        *,
        segment: float | None = None,
        start: str = "fit",
        tied: bool = True,
        threads: int | None = None,
        probe: "RigidRollouts | None" = None,
    ):
        super().__init__(subject.with_rigid_panels(), recordings, start=start, threads=threads)
        if probe is not None:
            self.readings = probe.readings
        self._tree = Topology(self.model)
        self._moved: dict[tuple, tuple[Drive, Motion | None]] = {}  # a drive that is kept keeps its id
        self._films: dict[tuple, tuple[Block, Drive, np.ndarray, np.ndarray | None]] = {}
        check_tree(self._tree, self.articulation.floating)
        for index, recording in enumerate(self.recordings):
            self.blocks += self._segments(index, recording, segment, tied)

    def _segments(self, index: int, recording: Recording, segment: float | None, tied: bool) -> list[Block]:
        step, count = float(np.median(np.diff(recording.times))), len(recording.times)
        frames = count if segment is None or self.start != "fit" else max(FEWEST, round(segment / step))
        pieces = max(1, round(count / frames))
        firsts = np.arange(0, count, -(-count // pieces))  # of equal length, but for the last
        firsts = np.append(firsts[count - firsts >= min(FEWEST, count)], count)
        if self.start == "fit":
            self.read_starts(index, firsts[:-1].tolist())
        out = [self.segment(index, int(a), int(b - a)) for a, b in pairwise(firsts)]
        if not tied or self.start != "fit":
            return out
        usual = self.usual_rates(index)
        for n, (block, after) in enumerate(pairwise(out)):
            lasting = float(recording.times[after.first] - recording.times[block.first])
            # a force that is missing by chance changes rates, and coordinates by their integral
            reach = np.concatenate([usual * lasting / np.sqrt(3.0), usual])
            out[n] = replace(block, reach=reach, lasting=lasting)
        return out

    def world(self, hypothesis: Hypothesis, values: np.ndarray, effects: Sequence[str]) -> World:
        """See `Worlds.world`.

        Raises:
            InputError: masses that leave a panel without inertia; what a model refuses.
        """
        model, parameters = super().world(hypothesis, values, effects)
        check_inertia(model, self._tree, model.position, node_mass(model, parameters)[:, 0])
        return model, parameters

    def step(self, hypothesis: Hypothesis, theta: np.ndarray) -> float:
        """A frame [s], since steps adapt themselves; 0 if no model can be built."""
        try:
            self.world(hypothesis, theta, hypothesis.effects)
        except InputError:
            return 0.0
        return float(np.median(np.diff(self.recordings[0].times)))

    def _filmed(self, shots: Shots) -> Simulated:
        """See `Rollouts._filmed`; not again of the first world, if it was filmed a short while ago.

        It is the point about which derivatives are taken, where a fit has just been. Worlds are the same to the last
        digit whatever others run beside them, unless some are late, which has them all driven in another way.
        """
        keys = [] if shots.late is not None else self._film_keys(shots)
        known = [self._films[k] for k in keys if k in self._films]
        count = len(shots.blocks)
        some = bool(keys) and len(known) == len(keys)
        if not some:
            raw, arrived = self._simulated(shots)
        else:
            raw = np.stack([film for *_, film, _ in known], axis=2)
            ends = [end for *_, end in known if end is not None]
            arrived = np.stack(ends, axis=2) if ends else None
        if some and len(shots.worlds) > 1:
            others = replace(
                shots,
                worlds=shots.worlds[1:],
                local=None if shots.local is None else shots.local[1:],
                memory=None if shots.memory is None else shots.memory[:, count:],
            )
            more, beyond = self._simulated(others)
            raw = np.concatenate([raw, more], axis=2)
            arrived = None if arrived is None or beyond is None else np.concatenate([arrived, beyond], axis=2)
        if some:
            return Simulated(raw, arrived)
        ends = [None if arrived is None else arrived[:, :, n].copy() for n in range(count)]
        first = [(key, raw[:, :, n].copy(), end) for n, (key, end) in enumerate(zip(keys, ends, strict=False))]
        return Simulated(raw, arrived, first)

    def _keep(self, r: int, blocks: Sequence[Block], first: list[tuple[tuple, np.ndarray, np.ndarray | None]]) -> None:
        """See `Rollouts._keep`."""
        for block, (key, raw, end) in zip(blocks, first, strict=False):
            self._films.setdefault(key, (block, self.drives[r], raw, end))
        while len(self._films) > POINTS * len(self.blocks):
            del self._films[next(iter(self._films))]

    def _film_keys(self, shots: Shots) -> list[tuple]:
        """For each block, all that a film of the first world depends on."""
        (model, parameters), local, memory = shots.worlds[0], shots.local, shots.memory
        drive = id(self.drives[shots.recording])  # kept with the film, as blocks are, so that no other gets its number
        world = (
            drive,
            shots.recording,
            shots.step,
            shots.frames,
            shots.ends,
            shots.clocked,
            model.hash,
            parameters.hash,
        )
        return [
            (
                *world,
                id(b),
                b"" if local is None else local[0, n].tobytes(),
                b"" if memory is None else memory[:, n].tobytes(),
            )
            for n, b in enumerate(shots.blocks)
        ]

    def _simulated(self, shots: Shots) -> tuple[np.ndarray, np.ndarray | None]:
        recording, model = self.recordings[shots.recording], shots.worlds[0][0]
        parameters = Parameters.join([p for _, p in shots.worlds], repeat=len(shots.blocks))
        state = self._state(shots)
        drive = self._driven(shots, model, parameters)
        batch = self._batch(model, parameters, drive, state, tolerance=TOLERANCE, threads=shots.threads)
        if isinstance(batch, RigidBatch):
            batch.finest = FINEST
        begun, arrived, raw = 0, [], []
        stops = [shots.ends + n for n in ((0, 1, 2) if shots.clocked else (1,))] if shots.ends else []
        for frame in stops:
            raw += film(batch, recording, frame - begun, 1, shots.step, first=not begun)
            arrived.append(self._arrived(shots, batch.state()))
            begun = frame
        if shots.frames > begun:
            raw += film(batch, recording, shots.frames - begun, 1, shots.step, first=not begun)
        ends = np.stack(arrived) if arrived else None
        out = np.concatenate(raw)
        lost = batch.status() >= 0
        out[:, :, lost] = np.nan
        if ends is not None:
            ends[..., lost] = np.nan
        return out, ends

    def _batch(self, model: Model, parameters: Parameters, drive: Drive, state: State, **options) -> Batch:
        # lengths do not change how panels hang together
        return super()._batch(model, parameters, drive, state, tree=self._tree, **options)

    def _motion(self, r: int, world: World, local: np.ndarray | None) -> Motion | None:
        """See `Rollouts._motion`: of tied segments the motion of the world itself, one segment after the other.

        A point of a fit is asked for again where derivatives are taken there.
        """
        chained = self._chained(r, local)
        if chained is None:
            return super()._motion(r, world, local)
        begins = tuple((b.first, b.lasting, b.times[-1]) for b in chained.blocks)
        (model, parameters), drive = world, self.drives[r]
        starts = (
            chained.angles.tobytes(),
            chained.rates.tobytes(),
            b"" if chained.local is None else chained.local.tobytes(),
        )
        key = (r, id(drive), begins, model.hash, parameters.hash, *starts)  # shifts: by which its films are known
        if key not in self._moved:
            if len(self._moved) >= POINTS:
                del self._moved[next(iter(self._moved))]
            found = self._followed(chained, world)
            self._moved[key] = drive, super()._motion(r, world, local) if found is None else found
        motion = self._moved[key][1]
        self._films.update(motion.films if motion is not None else {})
        return motion

    def _chained(self, r: int, local: np.ndarray | None) -> Chained | None:
        """The segments of a recording, of which each begins where the one before ends; None if they do not."""
        numbers = [n for n, b in enumerate(self.blocks) if b.recording == r]
        blocks = [self.blocks[n] for n in numbers]
        if self.articulation.floating or self.start != "fit" or any(b.reach is None for b in blocks[:-1]):
            return None
        m, shifts = self.articulation.size, np.zeros((len(blocks), self.local)) if local is None else local[numbers]
        angles = np.stack([b.pose.angles[:, 0] + by[:m] for b, by in zip(blocks, shifts, strict=True)])
        rates = np.stack([b.rates + by[m:] for b, by in zip(blocks, shifts, strict=True)])
        step = film_step(self.recordings[r].times)
        lasting = [b.lasting if b.reach is not None else float(b.times[-1]) for b in blocks]
        begins = np.concatenate([[0], np.cumsum([round(t / step) for t in lasting])]).tolist()
        regular = all(even(step, t, n) == step for t, n in zip(lasting, np.diff(begins).tolist(), strict=True))
        dt = step if regular else sum(lasting) / begins[-1]
        return Chained(r, blocks, None if local is None else shifts[None], angles, rates, begins, step, dt)

    def _own_memories(self, r: int, worlds: list[World], local: np.ndarray | None) -> dict[int, np.ndarray]:
        """See `Rollouts._own_memories`: each world's segments begin where those of the first do."""
        chained = self._chained(r, local)
        if chained is None:
            return {}

        kept = self._in_parts(worlds, lambda part, threads: self._anew(chained, part, threads)[2])
        return {b.first: memory for b, memory in zip(chained.blocks, kept, strict=True)}

    def _anew(
        self, chained: Chained, worlds: list[World], threads: int = 1
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Worlds that go on from segment to segment, see `film_anew`."""
        r, count = chained.recording, len(worlds)
        shots = chained.shots(worlds, len(self.recordings[r].times))
        (model, _), parameters = worlds[0], Parameters.join([p for _, p in worlds])
        begin = State.at_rest(model, count, position=self._state(shots).x, placed=True)
        begin.memory[:] = self._rested(r, worlds, 0, begin.x[:, :1], threads)[-1].memory
        drive = self._driven(shots, model, parameters)
        batch = self._batch(model, parameters, drive, begin, tolerance=TOLERANCE, threads=threads)
        assert isinstance(batch, RigidBatch)
        batch.finest = FINEST
        starts = [np.repeat(a[:, :, None], count, axis=2) for a in (chained.angles, chained.rates)]
        return batch.film_anew(chained.begins[-1], chained.dt, chained.begins[:-1], *starts)

    def _followed(self, chained: Chained, world: World) -> Motion | None:
        """The motion of a world from segment to segment; None: unstable.

        With films of the segments, which are those of segments alone but for rounding.
        """
        r, blocks, begins = chained.recording, chained.blocks, chained.begins
        (model, _), recording = world, self.recordings[r]
        x, turned, kept, ended = self._anew(chained, [world])
        if not np.all(np.isfinite(x)):
            return None
        memory = {b.first: then[:, 0] for b, then in zip(blocks, kept, strict=True)}
        first = chained.shots([world], len(recording.times))
        starts = self._state(replace(first, blocks=blocks, local=chained.local))
        path = np.concatenate([starts.x[None, :, 0], x[:, :, 0]])
        steady = all(s.constant for s in self.drives[r].signals.values())
        if chained.dt != chained.step or not steady or any(get(e).family == "drive" for e in model.effects):
            return Motion(path, memory)  # segments alone take steps, and see the drive at instants, of their own
        at_first = pictured(model, recording, starts.x[None], starts.angles[None])[0]
        later = pictured(model, recording, x, turned)[:, :, 0]
        kinds: dict[tuple[int, int], list[int]] = {}
        for n, (block, frames) in enumerate(zip(blocks, np.diff(begins).tolist(), strict=True)):
            ends = frames if block.reach is not None else 0
            kinds.setdefault((frames + 1, ends), []).append(n)
        films = {}
        for (frames, ends), mine in kinds.items():
            shifts, then = None if chained.local is None else chained.local[:, mine], kept[mine, :, 0].T
            each = [blocks[n] for n in mine]
            own = replace(first, blocks=each, local=shifts, memory=then, frames=frames, ends=ends)
            for n, key in zip(mine, self._film_keys(own), strict=True):
                arrived, end = None, begins[n + 1]
                if ends:
                    after, q = blocks[n + 1], turned[end - 1, self.articulation.creases, 0]
                    arrived = np.append(turned_by(q - after.pose.angles[:, 0]), ended[n + 1, :, 0] - after.rates)[None]
                raw = np.concatenate([at_first[None, :, n], later[begins[n] : end]])
                films[key] = blocks[n], self.drives[r], raw, arrived
        return Motion(path, memory, films)

    def _arrived(self, shots: Shots, state: State) -> np.ndarray:
        """[L, K B] where rollouts are, as shifts of the starts of the blocks that are tied to theirs."""
        arm, count = self.articulation, len(shots.blocks)
        following = {(b.recording, b.first): b for b in self.blocks}
        frames = [b.first + len(b.times) for b in shots.blocks]
        after = [following[shots.recording, f] for f in frames]
        base = joined_poses([b.pose for b in after])
        rates = np.stack([b.rates for b in after], axis=1)
        out = np.empty((2 * arm.size, state.worlds))
        alike: dict[bytes, list[int]] = {}
        for n, (own, _) in enumerate(shots.worlds):
            alike.setdefault(own.position.tobytes(), []).append(n)
        for key, mine in alike.items():
            at = (np.array(mine)[:, None] * count + np.arange(count)).ravel()
            own, b = self._arms[key], np.tile(np.arange(count), len(mine))
            pose = own.poses_of(state.x[:, at], state.angles[:, at])
            out[: arm.size, at] = shift_between(base.select(b), pose, arm.floating)
            out[arm.size :, at] = own.rates_of(pose, state.x[:, at], state.v[:, at]) - rates[:, b]
        return out


def shift_between(base: Pose, pose: Pose, floating: bool) -> np.ndarray:
    """Small displacement [m, W] of the coordinates that leads from one pose to another; angles by less than a turn."""
    from scipy.spatial.transform import Rotation

    angles = turned_by(pose.angles - base.angles)
    if not floating:
        return angles
    turn = Rotation.from_matrix(pose.rotation @ np.swapaxes(base.rotation, 1, 2)).as_rotvec()
    return np.concatenate([(pose.centre - base.centre).T, turn.T, angles])


def turned_by(angles: np.ndarray) -> np.ndarray:
    """Differences of angles by less than a turn."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def check_tree(tree: Topology, floating: bool) -> None:
    """Refuses what has other coordinates than the fold angles of a tree and the six of a free root.

    Raises:
        InputError: closed loops; a root that is held in part.
    """
    if len(tree.row_node):
        raise InputError("panels that close a loop are predicted with bars", field="panels", allowed="elastic")
    if len(tree.turns) != 6 * floating:
        raise InputError("a panel that is held in part is predicted with bars", field="panels", allowed="elastic")
