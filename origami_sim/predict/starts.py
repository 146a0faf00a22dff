"""Where a segment of a recording starts: coordinates and rates read from its channels, and how well they are known."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np

from origami_sim.model import Model
from origami_sim.model.articulation import Articulation, Pose
from origami_sim.observation.channels import angle_mask, channel_values, stacked
from origami_sim.observation.rates import local_line
from origami_sim.predict.track import placed
from origami_sim.recording import Recording
from origami_sim.threads import shared

CAREFUL = 6.0
"""A rate that was read from a recording is known within so many of its standard deviations.

The reading only says where fits begin; the data themselves decide. Twice or half as much changes no fit.
"""

NEAR = 4
"""Frames from where a segment begins within which its start has to be seen."""

READ = 30
"""Starts that one core reads while others read others: some 50 ms of work."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What a recording says about the state at one of its frames.

    Attributes:
        pose: coordinates. rates: (m,) of the coordinates. error: (m,) standard deviation of the rates; infinite where
            no channel tells them. shown: (m,) the same of the coordinates, from one frame. tangent: [D, m] derivatives
            of the channels by the coordinates.
    """

    pose: Pose
    rates: np.ndarray
    error: np.ndarray
    shown: np.ndarray
    tangent: np.ndarray


class Readings:
    """What recordings say about the state at frames, each read once.

    Args:
        model, arm: the device and its coordinates. recordings: of it.
    """

    def __init__(self, model: Model, arm: Articulation, recordings: Sequence[Recording]):
        self.model, self.arm, self.recordings = model, arm, recordings
        self._found: dict[tuple[int, int], Reading] = {}
        self._usual: dict[int, np.ndarray] = {}

    def at(self, index: int, frame: int) -> Reading:
        """The state at a frame of a recording."""
        self.read(index, [frame])
        return self._found[index, frame]

    def slowest(self, index: int) -> Reading:
        """The state at the first frame with the rates that are least told from rest, see `local_line`."""
        recording = self.recordings[index]
        return read_start(self.model, self.arm, recording, *stacked(recording), 0, slowest=True)

    def read(self, index: int, frames: Sequence[int]) -> None:
        """Reads the state at frames of a recording, where that has not been done, into `readings`."""
        recording = self.recordings[index]
        values, noise = stacked(recording)
        new = [k for k in frames if (index, k) not in self._found]

        def read(part: list[int]) -> list[Reading]:
            return [read_start(self.model, self.arm, recording, values, noise, k) for k in part]

        found = shared([partial(read, new[k : k + READ]) for k in range(0, len(new), READ)])
        self._found.update(zip(((index, k) for k in new), chain.from_iterable(found), strict=True))

    def usual_rates(self, index: int) -> np.ndarray:
        """(m,) root mean square of the rates of the coordinates in a recording, where channels tell them.

        What no channel tells is taken to move as fast as what they do tell, a radian as a device's size.
        """
        if index not in self._usual:
            arm, count = self.arm, len(self.recordings[index].times)
            picked = np.unique(np.linspace(0, count - 1, 24).astype(int)).tolist()
            self.read(index, picked)
            found = [self._found[index, k] for k in picked]
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
        pose = self.arm.reference()
        _, tangent = channel_tangent(self.model, self.arm, recording, pose, values[first])
        by = tangent / noise[:, None]
        return bool(np.linalg.matrix_rank(by[near]) == np.linalg.matrix_rank(by[ever]))


def read_start(
    model: Model, arm: Articulation, recording: Recording, values, noise, first: int, *, slowest: bool = False
) -> Reading:
    """The state at a frame, from a local polynomial of the channels and the pose of rigid panels that fits it best."""
    level, slope, error = local_line(recording.times, values, noise, first, slowest=slowest)
    pose = placed(model, arm, recording, level)
    weight = np.where(np.isfinite(level), 1.0 / noise, 0.0)
    sought = arm.sought(channel_tangent(model, arm, recording, pose, level)[1] * weight[:, None])
    for _ in range(30):
        now, tangent = channel_tangent(model, arm, recording, pose, level)
        gap = np.where(np.isfinite(level), level - now, 0.0)
        by = arm.inverse(tangent * weight[:, None], sought, 1e-8) @ (gap * weight)
        size = np.abs(by[arm.shifts :]).max(initial=0.0)  # shifts are linear, however long
        pose = arm.moved(pose, (by * min(1.0, 1.0 / (size + 1e-12)))[:, None])
        if size < 1e-10:
            break
    _, tangent = channel_tangent(model, arm, recording, pose, level)
    weight = np.where(np.isfinite(slope), 1.0 / noise, 0.0)
    inverse = arm.inverse(tangent * weight[:, None], sought, 1e-8)
    rates = inverse @ (np.nan_to_num(slope) * weight)
    spread = np.linalg.norm(inverse * np.where(weight > 0.0, error * weight, 0.0), axis=1)
    told = np.einsum("md,dm->m", inverse, tangent * weight[:, None]) > 0.9  # by the channels
    shown = np.where(told, np.linalg.norm(inverse, axis=1), np.inf)
    return Reading(pose, rates, np.where(told, spread, np.inf), shown, tangent)


def channel_tangent(model: Model, arm: Articulation, recording: Recording, pose: Pose, near: np.ndarray):
    """Channels (D,) of a pose, turned as in `near`, and their derivatives by the coordinates [D, m]."""
    m, step = arm.size, 1e-6
    by = np.concatenate([np.zeros((m, 1)), step * np.eye(m), -step * np.eye(m)], axis=1)
    x = arm.positions(arm.moved(pose.select([0] * (2 * m + 1)), by))
    values = channel_values(model, recording, x[None], None)[0]
    plus, minus = values[:, 1 : m + 1], values[:, m + 1 :]
    turning = angle_mask(recording)
    jump = np.where(turning[:, None], 2 * np.pi * np.round((plus - minus) / (2 * np.pi)), 0.0)
    now = values[:, 0]
    now = now + np.where(turning, 2 * np.pi * np.round((np.nan_to_num(near) - now) / (2 * np.pi)), 0.0)
    return now, (plus - minus - jump) / (2 * step)


def seen_first(values: np.ndarray) -> np.ndarray:
    """(D,) the first of the values (n, D) that is not missing; nan if all are."""
    seen = np.isfinite(values)
    return values[np.argmax(seen, axis=0), np.arange(values.shape[1])]


def spans(arm: Articulation, model: Model) -> np.ndarray:
    """(m,) how far coordinates may plausibly be off: a radian, or the size of the device [m]."""
    size = float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0
    out = np.ones(arm.size)
    out[: arm.shifts] = size
    return out
