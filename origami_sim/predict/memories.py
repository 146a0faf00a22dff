"""What laws with memory remember where segments of a recording start."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.fit.predictor import Block
from origami_sim.model import Model, Parameters, State
from origami_sim.predict.begun import begins
from origami_sim.predict.drives import reaching
from origami_sim.predict.measured import lateness
from origami_sim.predict.worlds import World, distinct_memories, distinct_motions, lasting
from origami_sim.threads import T, default_threads, shared, sharing

if TYPE_CHECKING:
    from origami_sim.predict.rollouts import Rollouts

LEAD = 1500
"""Frames between two segments along which laws with memory are carried, at most; the motion there is as recorded."""


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


def memories(
    forward: "Rollouts", r: int, worlds: list[World], wanted: Sequence[Block], local: np.ndarray | None
) -> dict[int, np.ndarray] | None:
    """Memory [M, K] of the laws where segments start, by first frame; None: no memory.

    It is that of the first world's motion up to there (`Rollouts.motion`), of which starts are shifted by local
    [B, L]. All nodes are held and carried along it: the laws feel the motion without changing it. Before that they
    rest. What carrying straight from frame to frame does wrong to the first world, whose memory is known, it does to
    all. What does not fade is that of each world's own motion, where that can be followed: with dry friction a swing
    turns elsewhere, and rests elsewhere, if that yields elsewhere or the arm is heavier.
    """
    model = worlds[0][0]
    # also of segments not asked for
    every = np.unique([b.first for b in (*forward.blocks, *wanted) if b.recording == r])
    if not (size := len(State.at_rest(model).memory)):
        return None
    if not np.any(every) and not begins(model, Parameters.join([p for _, p in worlds])):
        return None
    motion = forward.motion(r, worlds[0], local)
    if motion is None:
        return None
    rows = lasting(model)
    follows = len(rows) > 0 and bool(motion.memory)
    some, of = distinct_motions(worlds, late_starts(worlds)) if follows else distinct_memories(worlds)
    worlds, others = [worlds[k] for k in some], range(1, len(some))
    asked = every[every <= max(b.first for b in wanted)]
    own = forward.own_memories(r, worlds[1:], local) if follows and others else {}
    if not own.keys() >= set(asked.tolist()):
        return {first: memory[:, of] for first, memory in _carried(forward, r, worlds, motion, asked).items()}
    # of worlds that are followed only what fades is carried
    along, out = [0, *others] if len(rows) < size else [0], dict[int, np.ndarray]()
    for first, carried in _carried(forward, r, [worlds[k] for k in along], motion, asked).items():
        memory = np.empty((size, len(worlds)))
        memory[:, along] = carried
        memory[rows, 1:] = own[first][rows]
        out[first] = memory[:, of]
    return out


def late_starts(worlds: list[World]) -> np.ndarray:
    """[K, 1] by how much later than their clock says first frames were taken, see `lateness`: the drive is late there.

    Of worlds that go on from segment to segment; a clock that runs fast is off by more in later ones.
    """
    model, count = worlds[0][0], len(worlds)
    if all(get(e).family != "measurement" for e in model.effects):
        return np.zeros((count, 1))
    return lateness(model, Parameters.join([p for _, p in worlds]), count, np.zeros(1), True)[0]


def _carried(
    forward: "Rollouts", r: int, worlds: list[World], motion: Motion, asked: np.ndarray
) -> dict[int, np.ndarray]:
    """Memory [M, K] at frames that are asked for, of worlds that are carried along the motion of the first."""
    if len(worlds) == 1 and motion.memory.keys() >= set(asked.tolist()):
        return {n: motion.memory[n][:, None] for n in asked.tolist()}
    path = motion.positions[:, :, None]
    step = float(np.median(np.diff(forward.recordings[r].times)))

    def carry(near: np.ndarray, part: list[World], threads: int) -> np.ndarray:
        """[n, M, k] at frames that are near each other."""
        begin = max(int(near[0]) - LEAD, 0)
        held = rested(forward, r, part, begin, path[begin], threads)
        at_rest = held[-1].memory[None]
        if near[-1] <= begin:
            return at_rest
        batch = forward.batch(*held, supports=part[0][0], threads=threads)
        later = batch.carry(path[begin : near[-1] + 1], step, (near[near > begin] - begin).tolist())
        return np.concatenate([at_rest, later])[-len(near) :]

    out: dict[int, np.ndarray] = {}
    for near in np.split(asked, np.flatnonzero(np.diff(asked) > LEAD) + 1):  # carried from one to the next
        found = np.concatenate([part for _, part in in_parts(forward, worlds, partial(carry, near))], axis=2)
        for first, carried in zip(near.tolist(), found, strict=True):
            if first in motion.memory:
                carried = carried + (motion.memory[first][:, None] - carried[:, :1])
                carried[:, 0] = motion.memory[first]  # to the last digit, so that its film is known again
            out[first] = carried
    return out


def in_parts(
    forward: "Rollouts", worlds: list[World], make: Callable[[list[World], int], T]
) -> list[tuple[list[World], T]]:
    """What is made of worlds, of some of them by each process, on so many cores."""
    cuts = np.array_split(np.arange(len(worlds)), min(sharing(), len(worlds)))
    parts = [[worlds[k] for k in cut] for cut in cuts]
    cores = -(-(forward.threads or default_threads()) // len(parts))
    return list(zip(parts, shared([partial(make, part, cores) for part in parts]), strict=True))


def rested(
    forward: "Rollouts", r: int, worlds: list[World], frame: int, x: np.ndarray, threads: int = 1
) -> tuple[Model, Parameters, Drive, State]:
    """Worlds held at positions [N, 1, 3], where they have rested, driven as from a frame of a recording on.

    At the first frame with what `begins` says beside.
    """
    model, parameters = worlds[0][0], Parameters.join([p for _, p in worlds])
    times = forward.recordings[r].times - forward.recordings[r].times[0]
    step = float(np.median(np.diff(times)))
    span = float(times[-1] - times[frame]) + step
    drive = reaching(model, [p for _, p in worlds], forward.drives[r], times[[frame]], span)
    held = replace(model, free=np.zeros_like(model.free))
    state = State.at_rest(held, len(worlds), position=np.repeat(x, len(worlds), axis=1))
    one = {"supports": model, "threads": threads}
    batch = forward.batch(held, parameters, drive.held(0.0), state, **one)
    batch.carry(np.stack([x, x]), LEAD * step)
    memory, motion = batch.remembered(), forward.recorded(r)
    moved = begins(model, parameters) if not frame and motion is not None else []
    if moved:  # as unknown as the start's angles are
        assert motion is not None
        batch = forward.batch(held, parameters, drive, replace(state, memory=memory), **one)
        path = motion.positions[:, :, None]
        usual = batch.carry(path, step, range(1, len(path)))
        for rows, given in moved:
            memory[rows] += given * np.abs(usual[:, rows]).max(axis=0)
    return held, parameters, drive, replace(state, memory=memory)
