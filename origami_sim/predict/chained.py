"""Segments that are tied to each other: worlds that move on from one to the next, with what laws remember."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.fit.predictor import Block
from origami_sim.model import Parameters, State
from origami_sim.model.articulation import turned_by
from origami_sim.predict.filming import even, film_step, pictured
from origami_sim.predict.memories import Motion, late_starts, rested
from origami_sim.predict.shots import Shots
from origami_sim.predict.worlds import World
from origami_sim.solve.rigid.batch import RigidBatch

if TYPE_CHECKING:
    from origami_sim.predict.rigid import RigidRollouts

Films = dict[tuple, tuple[Block, Drive, np.ndarray, np.ndarray | None]]
"""Films of segments [frames, D + k] and where they arrive [1 or 3, L], by all that they depend on.

Blocks and drives are kept, so that no other gets their number.
"""


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

    def shots(self, worlds: list[World], some: Sequence[int] = (0,), **also) -> Shots:
        """Rollouts of worlds that begin with some blocks."""
        local = None if self.local is None else np.repeat(self.local[:, some], len(worlds), axis=0)
        blocks = [self.blocks[n] for n in some]
        given = {"late": None, "memory": None, "frames": 0, "ends": 0} | also
        return Shots(self.recording, blocks, worlds, local=local, step=self.step, **given)


@dataclass(frozen=True, eq=False)
class Seen:
    """What channels see of worlds that go on from segment to segment.

    Attributes:
        first: [D + k, W, B] where segments begin. later: [F, D + k, W] from frame to frame.
        arrived: [B - 1, L, W] where those end that are tied to the next.
    """

    first: np.ndarray
    later: np.ndarray
    arrived: np.ndarray


def steady(drive: Drive) -> bool:
    """Whether a drive never changes."""
    return all(s.constant for s in drive.signals.values())


def chained_segments(forward: "RigidRollouts", r: int, local: np.ndarray | None) -> Chained | None:
    """The segments of a recording, of which each begins when the one before ends; None if they do not."""
    numbers = [n for n, b in enumerate(forward.blocks) if b.recording == r]
    blocks = [forward.blocks[n] for n in numbers]
    if forward.articulation.floating or forward.start != "fit" or not all(b.lasting for b in blocks[:-1]):
        return None
    m, shifts = forward.articulation.size, np.zeros((len(blocks), forward.local)) if local is None else local[numbers]
    angles = np.stack([b.pose.angles[:, 0] + by[:m] for b, by in zip(blocks, shifts, strict=True)])
    rates = np.stack([b.rates + by[m:] for b, by in zip(blocks, shifts, strict=True)])
    step = film_step(forward.recordings[r].times)
    lasting = [b.lasting or float(b.times[-1]) for b in blocks]
    begins = np.concatenate([[0], np.cumsum([round(t / step) for t in lasting])]).tolist()
    regular = all(even(step, t, n) == step for t, n in zip(lasting, np.diff(begins).tolist(), strict=True))
    dt = step if regular else sum(lasting) / begins[-1]
    return Chained(r, blocks, None if local is None else shifts[None], angles, rates, begins, step, dt)


def followed_worlds(
    forward: "RigidRollouts", chained: Chained, worlds: list[World], threads: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Worlds that go on from segment to segment, see `film_anew`."""
    r, count = chained.recording, len(worlds)
    (model, _), parameters = worlds[0], Parameters.join([p for _, p in worlds])
    late = late_starts(worlds)
    frames = len(forward.recordings[r].times)
    shots = chained.shots(worlds, frames=frames, late=late if np.any(late) else None)
    begin = State.at_rest(model, count, position=forward.state(shots).x, placed=True)
    begin.memory[:] = rested(forward, r, worlds, 0, begin.x[:, :1], threads)[-1].memory
    drive = forward.driven(shots)
    batch = forward.batch(model, parameters, drive, begin, tolerance=forward.blur, threads=threads)
    assert isinstance(batch, RigidBatch)
    starts = [np.repeat(a[:, :, None], count, axis=2) for a in (chained.angles, chained.rates)]
    return batch.film_anew(chained.begins[-1], chained.dt, chained.begins[:-1], *starts)


def motion_of(forward: "RigidRollouts", chained: Chained, world: World) -> Motion | None:
    """The motion of a world from segment to segment, with films of the segments; None: unstable."""
    x, turned, kept, ended = followed_worlds(forward, chained, [world])
    if not np.all(np.isfinite(x)):
        return None
    memory = {b.first: then[:, 0] for b, then in zip(chained.blocks, kept, strict=True)}
    path = np.concatenate([forward.state(chained.shots([world])).x[None, :, 0], x[:, :, 0]])
    seen = channels_of(forward, chained, [world], x, turned, ended)
    return Motion(path, memory, films_of(forward, chained, [world], kept, seen))


def channels_of(
    forward: "RigidRollouts",
    chained: Chained,
    worlds: list[World],
    x: np.ndarray,
    turned: np.ndarray,
    ended: np.ndarray,
) -> Seen | None:
    """What channels see of worlds that were followed: what they do of segments alone, but for rounding.

    None where these take steps, and see the drive at instants, of their own.
    """
    recording, blocks, (model, _) = forward.recordings[chained.recording], chained.blocks, worlds[0]
    drive, distorted = forward.drives[chained.recording], any(get(e).family == "drive" for e in model.effects)
    if chained.dt != chained.step or not steady(drive) or distorted:
        return None
    starts = forward.state(chained.shots(worlds, range(len(blocks))))
    models = [m for m, _ in worlds]
    first = pictured(models, recording, starts.x[None], starts.angles[None])[0]
    angles = turned[np.array(chained.begins[1:-1], int) - 1][:, forward.articulation.creases]
    shift = turned_by(angles - np.stack([b.pose.angles for b in blocks])[1:])
    rates = ended[1:] - np.stack([b.rates for b in blocks])[1:, :, None]
    later = pictured(models, recording, x, turned)
    return Seen(first.reshape(-1, len(worlds), len(blocks)), later, np.concatenate([shift, rates], axis=1))


def films_of(
    forward: "RigidRollouts", chained: Chained, worlds: list[World], kept: np.ndarray, seen: Seen | None
) -> Films:
    """Films of the segments of worlds that were followed; none of those that are unstable."""
    if seen is None:
        return {}
    begins, drive = chained.begins, forward.drives[chained.recording]
    stable = np.flatnonzero(np.isfinite(seen.later).all(axis=(0, 1))).tolist()
    kinds: dict[tuple[int, bool], list[int]] = {}
    for n, (block, frames) in enumerate(zip(chained.blocks, np.diff(begins).tolist(), strict=True)):
        kinds.setdefault((frames, block.lasting > 0.0), []).append(n)
    films: Films = {}
    for (frames, tied), mine in kinds.items():
        memory = kept[mine].transpose(1, 2, 0).reshape(kept.shape[1], -1)
        shots = chained.shots(worlds, mine, memory=memory, frames=frames + 1, ends=frames * tied)
        for k in stable:
            for n, key in zip(mine, forward.film_keys(shots, k), strict=True):
                raw = np.concatenate([seen.first[None, :, k, n], seen.later[begins[n] : begins[n + 1], :, k]])
                films[key] = chained.blocks[n], drive, raw, seen.arrived[None, n, :, k] if tied else None
    return films
