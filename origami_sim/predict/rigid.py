"""Rollouts of rigid panels: recordings cut into short segments that are tied to each other."""

from collections import ChainMap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.articulation import Articulation
from origami_sim.predict.chained import (
    Films,
    Seen,
    chained_segments,
    channels_of,
    films_of,
    followed_worlds,
    motion_of,
    steady,
)
from origami_sim.predict.filming import film
from origami_sim.predict.memories import Motion, in_parts
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.shots import Shots, Simulated, by_geometry, joined_poses, of_worlds
from origami_sim.predict.starts import spans
from origami_sim.predict.worlds import World, lasting
from origami_sim.recording import Recording
from origami_sim.recording.drives import switched_between
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid.batch import RigidBatch
from origami_sim.solve.rigid.damping import overdamped
from origami_sim.solve.rigid.topology import Topology, check_inertia

FEWEST = 8
"""Frames of a segment, at least: as many as tell its start's rate."""

TOLERANCE = 1e-8
"""Error of a step of a rollout [rad], or part of the device's size, where it is not known what the data show.

Ten times less costs 1.6 times the steps. Steps end at every frame, also where the error would let them go over three:
worlds that differ by a nudge then take the same steps, whose errors cancel in differences; steps of their own made
intervals fifty times too narrow.
"""

UNSEEN = 0.003
"""Error of a step, over the smallest shift that all data together show.

On seven devices of the battery predictions are then off by up to 0.2 standard deviations of all data together; with a
friction of 0.1 mN m by 0.1 to 0.3, with a relaxation of 0.3 mN m/rad by 0.1 to 1.2. With three times as much, in 0.8 to
1.1 times the time of a rollout, friction is off by 0.2 to 0.6, and a scale of all moments looks known to 0.85 of its
prior where nothing tells it (here to 1.00). A tenth takes up to 1.5 times the time. Laws with memory turn over within a
step, so that predictions are rough in their parameters by a few such errors, and fits end where they are rough: of a
swing that rubs (11,001 frames, noise of 9 urad) fits of the same effects end within 5.5 of log evidence with steps
wrong by 1e-8 rad, within 2.3 with 8e-10; this asks for 2e-10. Much finer is no better where noise is coarse, as worlds
then part in how many steps they take: with a thirtieth, the scale of all moments of another box looked known to 0.15 %
where priors alone tell it, to 1.5 %.
"""

FADES, FADED = (100.0, 30.0, 10.0, 3.0), 0.05
"""Larger errors of a step that an overdamped device may take, over `UNSEEN`'s, and what they may change in all data
[standard deviations]: a quarter of what steps of `UNSEEN` change elsewhere.

Where motions fade within frames the errors of steps do, too. A chain of twelve cells (1,251 frames) takes 0.3 of the
time; with half of it as well, and with double.
"""

TOUCHING = 1e-7
"""The same of devices that touch the ground, whose derivatives are as uncertain with 1e-8 as with 1e-6.

Friction holds a little earlier or later in a nudged world: they are off by 1 to 15 %, at times by half and more; with
1e-11 and a third of the nudge they differ by 1 to 6 % on two crawlers, so smaller steps alone mend little. Feet that
chatter end 0.02 to 0.2 mm off (a device of 40 mm), with ten times more 0.1 to 0.4 mm, with a tenth, which takes 1.6 to
2.1 times as long, 0.004 to 0.05 mm.
"""

FINEST = 1e-4
"""Part of a frame below which a rollout's step may not fall: a hypothesis that is so stiff is given up.

Rollouts take one to ten steps per frame; a tenth of it lets a wrong hypothesis take ten times as long.
"""

POINTS = 8
"""Motions that are kept: those of the last points that a fit tried."""


class RigidRollouts(Rollouts):
    """A `Predictor` of devices whose panels do not visibly bend.

    Args:
        segment: length of a segment [s]; None: a recording is one segment. tied: whether a segment begins where the one
            before ends. probe: of the same model and recordings; what it has read of them is not read again. The rest
            as for `Rollouts`.

    Attributes:
        notes: on segments that begin from a start of their own, as a drive was switched before them and its log does
            not tell when to within a frame.

    Raises:
        InputError: what rigid panels refuse; closed loops, a root that is held in part.
    """

    panels, nudge = "rigid", 0.3

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
        frame = max(float(np.median(np.diff(r.times))) for r in self.recordings)
        self._overdamped = overdamped(self.model, self.parameters, self._tree, frame)
        self.blur = TOUCHING if len(self.model.contacts) else TOLERANCE
        self._moved: dict[tuple, tuple[Drive, Motion | None]] = {}  # a drive that is kept keeps its id
        self._films: Films = {}
        self.notes: list[str] = []
        self._beside: dict[int, Films] = {}  # of what was followed last beside the first world, by recording
        check_tree(self._tree, self.articulation)
        for index, recording in enumerate(self.recordings):
            self.blocks += self._segments(index, recording, segment, tied)
        if not len(self.model.contacts):
            self.blur = self._unseen()

    def _unseen(self) -> float:
        """The error of a step that no data show, see UNSEEN; TOLERANCE where segments do not begin as recorded."""
        unit = spans(self.articulation, self.model)
        shown = [b.seen().sum(axis=0) / b.noise**2 @ (b.shows * unit) ** 2 for b in self.blocks if b.shows is not None]
        blur = UNSEEN / float(np.sqrt(np.max(np.sum(shown, axis=0)))) if shown else TOLERANCE
        return self._fading(blur) if self._overdamped else blur

    def _fading(self, least: float) -> float:
        """The largest error of a step by which predictions of the model as given hardly differ."""
        theta = np.array([[f.start for f in self.subject.nominals]])

        def predicted(blur: float) -> list[np.ndarray]:
            self.blur, self._films, self._moved = blur, {}, {}  # what is known is known by all but it
            return self.predict(Hypothesis(), theta)

        fine = predicted(least)
        for more in FADES:
            gaps = zip(self.blocks, fine, predicted(more * least), strict=True)
            if sum(np.sum(np.where(b.seen(), (v - u) / b.noise, 0.0) ** 2) for b, u, v in gaps) <= FADED**2:
                return more * least
        self._films, self._moved = {}, {}
        return least

    def _segments(self, index: int, recording: Recording, segment: float | None, tied: bool) -> list[Block]:
        step, count = float(np.median(np.diff(recording.times))), len(recording.times)
        frames = count if segment is None or self.start != "fit" else max(FEWEST, round(segment / step))
        unsure = switched_between(recording) if tied and self.start == "fit" else []
        anew, firsts = [0], []
        for _, first in unsure:
            if min(first - anew[-1], count - first) >= FEWEST:
                anew.append(first)
        for begin, end in pairwise([*anew, count]):
            pieces = max(1, round((end - begin) / frames))
            own = np.arange(begin, end, -(-(end - begin) // pieces))  # of equal length, but for the last
            firsts += own[end - own >= min(FEWEST, end - begin)].tolist()
        if self.start == "fit":
            self.readings.read(index, firsts)
        out = [self.segment(index, a, b - a) for a, b in pairwise([*firsts, count])]
        if not tied or self.start != "fit":
            return out
        usual = self.readings.usual_rates(index)
        for n, (block, after) in enumerate(pairwise(out)):
            lasting = float(recording.times[after.first] - recording.times[block.first])
            # a force that is missing by chance changes rates, and coordinates by their integral
            reach = np.concatenate([usual * lasting / np.sqrt(3.0), usual])
            out[n] = replace(block, reach=None if after.first in anew else reach, lasting=lasting)
        if (count := len(anew) - 1) > 0:
            self.notes.append(
                f"'{recording.name}': the log does not tell within a frame when the drive was switched. After each of "
                f"{count} switch{'es' * (count > 1)} the motion is compared from a start that is fitted."
            )
        doubt = [k for last, first in unsure if first in anew for k in range(last + 1, first)]
        return [b.without(np.isin(b.first + np.arange(len(b.times)), doubt)) for b in out] if doubt else out

    def abruptly(self) -> "RigidRollouts | None":
        """See `Predictor.abruptly`: with gaps as the same chance forces make them."""
        if all(b.reach is None for b in self.blocks):
            return None
        out = RigidRollouts(self.subject, self.recordings, segment=0.0, threads=self.threads, probe=self)
        out.abrupt, longest = True, max(b.lasting for b in self.blocks)
        for n, b in enumerate(out.blocks):
            if b.reach is not None:
                out.blocks[n] = replace(b, reach=b.reach * np.sqrt(b.lasting / longest))
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
        """See `Rollouts._filmed`; not again of worlds of which films are known.

        These are the point about which derivatives are taken, where a fit has just been, and what was followed. Worlds
        are the same to the last digit whatever others run beside them, unless some are late, which has them all driven
        in another way.
        """
        if shots.late is not None:
            return Simulated(*self._simulated(shots))
        films, every = ChainMap(self._films, self._beside.get(shots.recording, {})), range(len(shots.worlds))
        known = [k for k in every if all(key in films for key in self.film_keys(shots, k))]
        new = [k for k in every if k not in known]
        made: dict[int, tuple[np.ndarray, np.ndarray | None]] = {}
        for k in known:
            found = [films[key] for key in self.film_keys(shots, k)]
            ends = [end for *_, end in found if end is not None]
            made[k] = np.stack([film for *_, film, _ in found], axis=2), np.stack(ends, axis=2) if ends else None
        if new:
            raw, arrived = self._simulated(of_worlds(shots, new) if known else shots)
            ends = [None] * len(new) if arrived is None else np.split(arrived, len(new), axis=2)
            made |= zip(new, zip(np.split(raw, len(new), axis=2), ends, strict=True), strict=True)
        raw = np.concatenate([made[k][0] for k in every], axis=2)
        ends = [end for k in every if (end := made[k][1]) is not None]
        first = []
        if new and not new[0]:
            raw_first, end = made[0]
            first = [
                (key, raw_first[:, :, n].copy(), None if end is None else end[:, :, n].copy())
                for n, key in enumerate(self.film_keys(shots, 0))
            ]
        return Simulated(raw, np.concatenate(ends, axis=2) if ends else None, first)

    def _keep(self, r: int, blocks: Sequence[Block], first: list[tuple[tuple, np.ndarray, np.ndarray | None]]) -> None:
        """See `Rollouts._keep`."""
        for block, (key, raw, end) in zip(blocks, first, strict=False):
            self._films.setdefault(key, (block, self.drives[r], raw, end))
        while len(self._films) > POINTS * len(self.blocks):
            del self._films[next(iter(self._films))]

    def film_keys(self, shots: Shots, k: int) -> Iterator[tuple]:
        """For each block, all that a film of a world depends on."""
        (model, parameters), local, memory = shots.worlds[k], shots.local, shots.memory
        asked = (shots.recording, shots.step, shots.frames, shots.ends, shots.clocked)
        drive = self.drives[shots.recording]
        sampled = b"" if shots.begun is None or steady(drive) else shots.begun.tobytes()  # alike for all that go along
        world = (id(drive), *asked, sampled, model.hash, parameters.hash)
        for n, b in enumerate(shots.blocks):
            start = b"" if local is None else local[k, n].tobytes()
            yield *world, id(b), start, b"" if memory is None else memory[:, k * len(shots.blocks) + n].tobytes()

    def _simulated(self, shots: Shots) -> tuple[np.ndarray, np.ndarray | None]:
        recording, model = self.recordings[shots.recording], shots.worlds[0][0]
        parameters = Parameters.join([p for _, p in shots.worlds], repeat=len(shots.blocks))
        state = self.state(shots)
        drive = self.driven(shots)
        batch = self.batch(model, parameters, drive, state, tolerance=self.blur, threads=shots.threads)
        begun, arrived, raw, models = 0, [], [], [m for m, _ in shots.worlds]
        stops = [shots.ends + n for n in ((0, 1, 2) if shots.clocked else (1,))] if shots.ends else []
        for frame in stops:
            raw += film(batch, recording, frame - begun, 1, shots.step, models, first=not begun)
            arrived.append(self._arrived(shots, batch.state()))
            begun = frame
        if shots.frames > begun:
            raw += film(batch, recording, shots.frames - begun, 1, shots.step, models, first=not begun)
        ends = np.stack(arrived) if arrived else None
        out = np.concatenate(raw)
        lost = batch.status() >= 0
        out[:, :, lost] = np.nan
        if ends is not None:
            ends[..., lost] = np.nan
        return out, ends

    def batch(self, model: Model, parameters: Parameters, drive: Drive, state: State, **options) -> Batch:
        # lengths do not change how panels hang together
        known = {"tree": self._tree, "implicit": self._overdamped}
        out = super().batch(model, parameters, drive, state, **known, **options)
        if isinstance(out, RigidBatch):
            out.finest = FINEST
        return out

    def motion(self, r: int, world: World, local: np.ndarray | None) -> Motion | None:
        """See `Rollouts.motion`: of tied segments the motion of the world itself, one segment after the other.

        A point of a fit is asked for again where derivatives are taken there.
        """
        chained = chained_segments(self, r, local)
        if chained is None:
            return super().motion(r, world, local)
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
            found = motion_of(self, chained, world)
            self._moved[key] = drive, super().motion(r, world, local) if found is None else found
        motion = self._moved[key][1]
        self._films.update(motion.films if motion is not None else {})
        return motion

    def own_memories(self, r: int, worlds: list[World], local: np.ndarray | None) -> dict[int, np.ndarray]:
        """See `Rollouts.own_memories`: each world's segments begin where those of the first do.

        Their films are known then, too, where nothing is remembered that fades.
        """
        chained = chained_segments(self, r, local)
        if chained is None:
            return {}
        lasts = len(lasting(worlds[0][0])) == sum(size for *_, size in worlds[0][0].memories)

        def followed(part: list[World], threads: int) -> tuple[np.ndarray, Seen | None]:
            x, turned, kept, ended = followed_worlds(self, chained, part, threads)
            return kept, channels_of(self, chained, part, x, turned, ended) if lasts else None

        self._beside[r], each = {}, []
        for part, (kept, seen) in in_parts(self, worlds, followed):
            self._beside[r] |= films_of(self, chained, part, kept, seen)
            each.append(kept)
        return {b.first: memory for b, memory in zip(chained.blocks, np.concatenate(each, axis=2), strict=True)}

    def _arrived(self, shots: Shots, state: State) -> np.ndarray:
        """[L, K B] where rollouts are, as shifts of the starts of the blocks that are tied to theirs."""
        arm, count = self.articulation, len(shots.blocks)
        following = {(b.recording, b.first): b for b in self.blocks}
        frames = [b.first + len(b.times) for b in shots.blocks]
        after = [following[shots.recording, f] for f in frames]
        base = joined_poses([b.pose for b in after])
        rates = np.stack([b.rates for b in after], axis=1)
        out = np.empty((2 * arm.size, state.worlds))
        for key, mine in by_geometry([own for own, _ in shots.worlds]).items():
            at = (np.array(mine)[:, None] * count + np.arange(count)).ravel()
            own, b = self._arms[key], np.tile(np.arange(count), len(mine))
            pose = own.poses_of(state.x[:, at], state.angles[:, at])
            out[: arm.size, at] = arm.shift_between(base.select(b), pose)
            out[arm.size :, at] = own.rates_of(pose, state.x[:, at], state.v[:, at]) - rates[:, b]
        return out


def check_tree(tree: Topology, arm: Articulation) -> None:
    """Refuses what has other coordinates than folds of a tree and those of a root that is free, or moves in a plane.

    Raises:
        InputError: closed loops; a root that is held in part.
    """
    if len(tree.row_node):
        raise InputError("panels that close a loop are predicted with bars", field="panels", allowed="elastic")
    if len(tree.turns) != len(arm.motions):
        raise InputError("a panel that is held in part is predicted with bars", field="panels", allowed="elastic")
