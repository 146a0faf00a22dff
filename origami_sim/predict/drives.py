"""Drives as they were recorded, sampled finely enough, and as they are seen from several starts."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.drive import SAMPLES_PER_SECOND, Drive, Signal, series
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


def shifted(
    drive: Drive, starts: np.ndarray, duration: float, worlds: int, among=None, commanded: Drive | None = None
) -> Drive:
    """The drive seen from several starts [s], one rollout for each [world, start].

    Args:
        starts: (B,) or [worlds, B]. among: starts of all rollouts for which it is sampled alike (default: of these).
            commanded: before it was distorted, whose bends it keeps.
    """
    among = starts if among is None else among
    count = starts.shape[-1]
    if not np.any(among) and (count == 1 or drive.worlds == 1):
        return drive
    changed = {}
    for name, s in drive.signals.items():
        if name == "origin":
            continue
        if s.constant:
            if np.size(s.offset) > 1:
                changed[name] = np.repeat(s.offset, count)
            continue
        given = s if commanded is None else commanded[name]
        wave = Signal(amplitude=given.amplitude, frequency=given.frequency, phase=given.phase)
        sampled = np.any(given.amplitude) or s.times is not given.times
        local = wave.sampled(duration) if sampled else np.array([0.0, duration])
        if given.times is not None:
            local = np.unique(np.concatenate([local, _knots(given.times, among.ravel(), duration)]))
        each = s.each()
        own = np.broadcast_to(starts, (len(each), count)) if starts.ndim == 1 else starts
        each *= len(own) // len(each)
        columns = [np.broadcast_to(one(local + t0), local.shape) for one, t in zip(each, own, strict=True) for t0 in t]
        values = np.stack(columns, axis=1)
        changed[name] = series(local, np.tile(values, (1, worlds * count // values.shape[1])))
    age = np.ravel(drive.signals["origin"](0.0))
    ages = (np.broadcast_to(age, worlds)[:, None] + starts).ravel()
    return drive.replace(**changed, origin=ages)


def _knots(times: np.ndarray, starts: np.ndarray, duration: float) -> np.ndarray:
    """Where a series bends within a duration from any of the starts; a fine grid if that were many more places."""
    rate = min(4.0 / float(np.min(np.diff(times))), SAMPLES_PER_SECOND)
    most = max(64, int(np.ceil(rate * duration)))
    begins = np.unique(starts)
    if len(begins) <= most:
        within = [times[slice(*np.searchsorted(times, (t0, t0 + duration)))] - t0 for t0 in begins]
        exact = np.unique(np.round(np.concatenate(within), 8))
        if len(exact) <= most:
            return exact[(exact > 0.0) & (exact < duration)]
    return np.linspace(0.0, duration, most + 1)
