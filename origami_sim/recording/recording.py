"""What was measured: channels over time with noise, drive and attachment, whatever wrote the file."""

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.drive.sources import Source
from origami_sim.errors import InputError
from origami_sim.recording.camera import Camera

if TYPE_CHECKING:
    from origami_sim.recording.noise import NoiseReport
    from origami_sim.recording.stated import Gravity, Start

CHANNEL_KINDS: dict[str, tuple[str, tuple[int, ...]]] = {
    "panel_angle": ("angle", (1,)),
    "crease_angle": ("angle", (1,)),
    "marker": ("length", (3,)),
    "marker_2d": ("length", (2,)),
    "tip_displacement": ("length", (1, 2, 3)),
    "force": ("force", (1, 2, 3)),
    "moment": ("moment", (1,)),
}
"""Dimension and allowed component counts of each kind of channel.

- panel_angle: absolute rotation of a panel about the hinge axis.
- crease_angle: fold angle between the two panels of a crease.
- marker: point on the body, 3D. marker_2d: the same in a camera plane, in metres, right and up.
- tip_displacement: how far a point moved since the first frame: the distance, the part along a direction, or a vector.
- force: of the support, the ground or a grip (along its path) on the object: along a direction, or a vector.
- moment: applied to a crease to hold it, positive towards valley.
"""

DIFFERENCE_ORDER = 6
"""Order of the differences from which the noise is estimated."""


@dataclass(frozen=True, eq=False)
class Channel:
    """One measured quantity.

    Attributes:
        name: channel name, shared with the simulation's observer.
        kind: a key of `CHANNEL_KINDS`.
        values: (n,) or (n, d) measured values [SI]; nan where the tracker lost it.
        unit: SI unit of `values`.
        noise: standard deviation of one measured value (of one component of a vector) [SI].
        attachment: what on the model is observed, e.g. {"panel": "arm1"} or {"panel": 0, "point": [x, y, z]}.
        camera: the camera plane in which a `marker_2d` is measured.
        noise_report: what the data show about the noise, whether or not it is stated; None for a channel made by hand.
    """

    name: str
    kind: str
    values: np.ndarray
    unit: str
    noise: float
    attachment: dict = field(default_factory=dict)
    camera: Camera | None = None
    noise_report: "NoiseReport | None" = None

    @property
    def is_angle(self) -> bool:
        """Whether the channel measures an angle."""
        return CHANNEL_KINDS[self.kind][0] == "angle"


@dataclass(frozen=True, eq=False)
class DriveChannel:
    """One known input that was applied while recording.

    Attributes:
        name: drive channel name.
        values: series (n,) or (n, d), or a constant () or (d,) [SI].
        unit: SI unit of `values`.
        constant: whether `values` holds throughout instead of per frame.
        times: (m,) times of the values on the recording's clock [s] where the drive was sampled on its own; None where
            it has one value per frame.
    """

    name: str
    values: np.ndarray
    unit: str
    constant: bool
    times: np.ndarray | None = None

    def at(self, times: np.ndarray) -> np.ndarray:
        """The drive at these times [s], (n,) or (n, d) [SI]; linear between the samples of a drive with its own times.

        Raises:
            InputError: times before or after the drive's own, or another number of them than its values.
        """
        if self.constant:
            return np.broadcast_to(self.values, (len(times), *np.shape(self.values)))
        if self.times is None:
            if len(self.values) != len(times):
                raise InputError("the drive has one value per frame", field=self.name, value=len(times))
            return self.values
        if times[0] < self.times[0] or times[-1] > self.times[-1]:
            raise InputError(
                f"the drive '{self.name}' does not cover the recording",
                field=f"drive.{self.name}",
                value=[float(self.times[0]), float(self.times[-1])],
                allowed=f"samples from {times[0]:g} s to {times[-1]:g} s",
            )
        columns = self.values.reshape(len(self.times), -1)
        out = np.stack([np.interp(times, self.times, column) for column in columns.T], axis=1)
        return out.reshape(len(times), *self.values.shape[1:])


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Channels of one measurement, on one time base.

    Attributes:
        name: name of the recording.
        times: (n,) strictly increasing [s]; the step index where the sidecar states no time (load steps).
        channels: measured channels by name.
        drive: applied inputs by name; empty for a free motion.
        metadata: source file and checksum, scene, notes of the lint, and what else the sidecar tells.
        gravity: which way it pointed; None: as the model has it.
        start: how the motion begins at the first frame; None if that is not stated.
        motion: "dynamic", or "quasistatic" where inertia does not count; None if that is not stated.
        sources: magnets, coils and tables around the device, on the recording's clock; none: as the model has them.
    """

    name: str
    times: np.ndarray
    channels: dict[str, Channel]
    drive: dict[str, DriveChannel] = field(default_factory=dict)
    metadata: dict = field(default_factory=dict)
    gravity: "Gravity | None" = None
    start: "Start | None" = None
    motion: str | None = None
    sources: tuple[Source, ...] = ()

    def __repr__(self) -> str:
        driven = f"; driven by {', '.join(self.drive)}" if self.drive else ""
        span = f"{self.times[0]:g} to {self.times[-1]:g}" if len(self.times) else "none"
        return f"<Recording {self.name}: {len(self.times)} frames, {span}; {', '.join(self.channels)}{driven}>"

    def __post_init__(self) -> None:
        for what, text in (("name", self.name), *(("channels", name) for name in self.channels)):
            if re.search(r"[\x00-\x1f\x7f]", text):  # it stands in comments and tables of what is written
                raise InputError(
                    "a name must have no control characters", file=self.metadata.get("sidecar"), field=what, value=text
                )
        for channel in self.channels.values():
            if channel.kind not in CHANNEL_KINDS:
                raise InputError(
                    f"channel '{channel.name}' has an unknown kind",
                    field="kind",
                    value=channel.kind,
                    allowed=", ".join(CHANNEL_KINDS),
                )
            if len(channel.values) != len(self.times):
                raise InputError(
                    f"channel '{channel.name}' has {len(channel.values)} values but there are {len(self.times)} times"
                )

    @property
    def by_step(self) -> bool:
        """Whether `times` counts the load steps of a quasi-static curve instead of seconds."""
        return self.metadata.get("time_base") == "step"

    @property
    def frame_count(self) -> int:
        """Number of frames n."""
        return len(self.times)

    def window(self, t0: float, t1: float) -> "Recording":
        """The frames with t0 <= t <= t1 [s], on the same time axis (not shifted to zero, not resampled)."""
        slack = 1e-9 * max(abs(t0), abs(t1))
        keep = (self.times >= t0 - slack) & (self.times <= t1 + slack)
        if not keep.any():
            raise InputError(
                f"no frame between {t0:g} s and {t1:g} s",
                field="window",
                allowed=f"{self.times[0]:g} s to {self.times[-1]:g} s",
            )
        return self.only(keep)

    def only(self, keep: np.ndarray | slice) -> "Recording":
        """Some of the frames, on the same time axis; a drive with a clock of its own stays whole.

        Frames without the first are of a motion that has begun: nothing is known of their start.
        """
        times = self.times[keep]
        return replace(
            self,
            times=times,
            start=self.start if len(times) and times[0] == self.times[0] else None,
            channels={k: replace(c, values=c.values[keep]) for k, c in self.channels.items()},
            drive={
                k: d if d.constant or d.times is not None else replace(d, values=d.values[keep])
                for k, d in self.drive.items()
            },
        )


def estimate_noise(times: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of the measurement noise, estimated from the data alone.

    Divided differences of order 6 annihilate every quintic, so that a motion which is smooth over seven frames
    vanishes and white noise is left. Each is scaled to unit variance for unit white noise; their median absolute
    deviation (times 1.4826, the Gaussian factor) ignores the windows in which the motion is not smooth (an impact, a
    snap). Uneven sampling is exact; windows across a gap (steps differing more than 3 times) are left out.

    The result is at least quantum/sqrt(12) where the readings dwell on quantised levels (a tenth of the steps are zero;
    the quantum is the smallest repeated nonzero step), because a sensor resting on one count shows no noise at all,
    and at least the rounding of the numbers.

    What it is not: noise correlated over more than seven frames (drift, a filtered tracker) is not seen, noise that
    comes in bursts is represented by its median level, and below about ten frames per oscillation the motion leaks in
    and the estimate is too large.

    Args:
        times: (n,) strictly increasing times [s].
        values: (n,) or (n, d) measured values; nan where missing.

    Returns:
        Standard deviation in the unit of `values`, the root mean square over components.
    """
    columns = np.asarray(values, dtype=float).reshape(len(times), -1)
    estimates = [max(_difference_noise(times, column), _quantum_noise(column)) for column in columns.T]
    return float(np.sqrt(np.mean(np.square(estimates))))


def scaled_differences(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Divided differences of order 6, scaled to the standard deviation of white noise in `values`.

    Args:
        times: (n,) strictly increasing times [s].
        values: (n,) measured values; windows that touch a nan are left out.

    Returns:
        (m,) scaled differences, m <= n - 6. Fewer than seven values lower the order.
    """
    order = min(DIFFERENCE_ORDER, len(times) - 1)
    step = np.diff(times)
    typical = np.median(step)
    if np.allclose(step, typical, rtol=1e-6, atol=0.0):
        weights = [(-1.0) ** k * comb(order, k) / np.sqrt(comb(2 * order, order)) for k in range(order + 1)]
        scaled = np.convolve(values, weights, mode="valid")
    else:
        weight, even = _uneven_weights((times - times[0]).tobytes(), order)
        scaled = np.einsum("mk,mk->m", weight, np.lib.stride_tricks.sliding_window_view(values, order + 1))
        if even.any():
            scaled = scaled[even]
    return scaled[np.isfinite(scaled)]


@lru_cache(maxsize=4)
def _uneven_weights(times: bytes, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights (m, order + 1) of scaled divided differences at uneven times, and where the steps are alike (m,).

    Every channel of a recording has the same ones: they are kept by the bytes of the times.
    """
    seconds = np.frombuffer(times)
    step = np.diff(seconds)
    frames = np.lib.stride_tricks.sliding_window_view(seconds / np.median(step), order + 1)
    spans = frames[:, :, None] - frames[:, None, :] + np.eye(order + 1)
    weight = 1.0 / np.prod(spans, axis=2)
    weight /= np.linalg.norm(weight, axis=1, keepdims=True)
    steps = np.lib.stride_tricks.sliding_window_view(step, order)
    return weight, steps.max(axis=1) <= 3.0 * steps.min(axis=1)


def _difference_noise(times: np.ndarray, values: np.ndarray) -> float:
    seen = np.isfinite(values)
    scaled = scaled_differences(times, values)
    if scaled.size == 0:  # no seven consecutive frames: difference across the holes
        scaled = scaled_differences(times[seen], values[seen])
    rounding = np.finfo(float).eps * np.abs(values[seen]).max(initial=np.finfo(float).tiny)
    return max(1.4826 * float(np.median(np.abs(scaled))) if scaled.size else 0.0, float(rounding))


def quantisation(values: np.ndarray) -> float:
    """Step of readings (n,) that dwell on quantised levels, in their unit; 0 where none shows.

    A tenth of the changes between frames must be zero; the step is the smallest change that is repeated.
    """
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    least = rounding(values)
    moved = np.sort(steps[steps > least])
    if moved.size < 2 or np.count_nonzero(steps <= least) < 0.1 * steps.size:
        return 0.0
    repeated = np.flatnonzero(np.diff(moved) <= 0.01 * moved[:-1])
    return float(moved[repeated[0]]) if repeated.size else 0.0


def rounding(values: np.ndarray) -> float:
    """By how much equal readings among values (n,) may differ, as means of them do; in their unit."""
    return 8.0 * float(np.finfo(float).eps) * float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _quantum_noise(values: np.ndarray) -> float:
    return quantisation(values) / float(np.sqrt(12.0))
