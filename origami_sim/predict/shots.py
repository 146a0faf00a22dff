"""Rollouts that begin together, and what they give."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from origami_sim.fit.predictor import Block
from origami_sim.model import Model, State
from origami_sim.model.articulation import Pose
from origami_sim.predict.worlds import World


@dataclass(frozen=True, eq=False)
class Shots:
    """Rollouts that begin together: worlds times blocks of equal times.

    Attributes:
        recording: their index. blocks: (B). worlds: (K). late: [K, B] by how much later than its clock a block begins
            [s]; None: none of all is. local: [K, B, L] shifts of starts, or None. memory: [M, K B] of laws, or None.
            step: between frames [s]. frames: of each rollout. ends: the frame at which the next blocks begin; 0: none
            is tied to them. clocked: whether a clock runs fast or slow, so that they begin a little before or after
            that frame. begun: times at which these and all others of their kind begin [s]; None: these alone.
            threads: see `Batch`.
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


def of_worlds(shots: Shots, some: list[int]) -> Shots:
    """Rollouts of some worlds, none of which is late."""
    memory = shots.memory
    if memory is not None:
        memory = memory.reshape(len(memory), len(shots.worlds), -1)[:, some].reshape(len(memory), -1)
    local = None if shots.local is None else shots.local[some]
    return replace(shots, worlds=[shots.worlds[k] for k in some], local=local, memory=memory)


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


def joined(several: list[tuple]) -> tuple:
    """What `Rollouts._roll` gives of all worlds in a part of the blocks, from what it gave of some worlds each."""
    if len(several) == 1:
        return several[0]
    made = np.concatenate([values for values, *_ in several], axis=1)
    ends = [end for _, end, _ in several]
    arrived = None if ends[0] is None else np.concatenate(ends, axis=1)
    return made, arrived, several[0][2]


def by_geometry(models: Sequence[Model]) -> dict[bytes, list[int]]:
    """Which models have the same reference positions, by these."""
    out: dict[bytes, list[int]] = {}
    for n, model in enumerate(models):
        out.setdefault(model.position.tobytes(), []).append(n)
    return out


TREMBLING = 0.3
"""Part of a frame by which times of blocks may differ that are filmed together: each is read at its own times.

Where one ends is then read between frames: of a strip at 100 Hz whose clock trembles by a twentieth of a frame, rates
are off by up to 6e-4 of what is usual, less than forces of which nothing is said. Two flaps of 750 frames take 9 s, and
39 s where each segment is filmed alone. With half, that strip's ten segments are seven groups (two here); double also
groups those of a clock that trembles by a tenth (eight here).
"""


def by_length(blocks: list[Block], indices: list[int]) -> list[list[int]]:
    """Blocks that share their frame times and the time until the next, but for what a clock trembles by."""
    groups, left = [], list(indices)
    while left:
        a = blocks[left[0]]
        slack = TREMBLING * float(np.median(np.diff(a.times))) if len(a.times) > 1 else 1e-7
        near = [i for i in left if len(blocks[i].times) == len(a.times) and abs(blocks[i].lasting - a.lasting) < slack]
        times = np.stack([blocks[i].times for i in near])
        alike = np.all(np.abs(times - a.times) <= slack, axis=1)
        groups.append([i for i, same in zip(near, alike.tolist(), strict=True) if same])
        done = set(groups[-1])
        left = [i for i in left if i not in done]
    return groups


def trembles(blocks: Sequence[Block]) -> bool:
    """Whether blocks that are filmed together have times of their own, for more than rounding."""
    times, lasting = np.stack([b.times for b in blocks]), np.array([b.lasting for b in blocks])
    slack = 1e-7 * max(1.0, times[0, -1])
    apart = np.abs(times - times[0]) > slack + 1e-5 * times
    return bool(np.any(apart) or np.any(np.abs(lasting - lasting[0]) >= slack))
