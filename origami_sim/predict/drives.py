"""Drives as they were recorded, sampled finely enough, and as they reach rollouts from several starts."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.drive import Drive, Signal, series
from origami_sim.drive.starts import shifted
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.model.distort import distorted
from origami_sim.recording import Recording, by_component
from origami_sim.recording.placed import surrounded


def drive_of(recording: Recording, default: Drive) -> Drive:
    """The drive and the sources that were recorded, over the model's own.

    Raises:
        InputError: what `by_component` refuses, or a drive that this model lacks.
    """
    changed: dict[str, Signal] = {}
    default = surrounded(default, recording)
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


def reaching(
    model: Model, each: Sequence[Parameters], given: Drive, starts: np.ndarray, duration: float, among=None
) -> Drive:
    """The drive that reaches worlds in rollouts from several starts [world, start].

    What distorts it acts on the whole recording, so that a lag or hysteresis remembers what was before a start.

    Args:
        each: parameters of the worlds (K). starts: (B,) or, of each world its own, [K, B] [s]. duration: of a rollout
            [s]. among: starts of all rollouts for which it is sampled alike (default: of these).
    """
    among = starts if among is None else among
    whole = distorted(model, Parameters.join(each), given, float(np.max(among)) + duration)
    return shifted(whole, starts, duration, len(each), among, given)
