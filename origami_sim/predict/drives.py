"""Drives as they were recorded, sampled finely enough, and as they are seen from several starts."""

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.drive import SAMPLES_PER_SECOND, Drive, Signal, series
from origami_sim.errors import InputError
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


def shifted(drive: Drive, starts: np.ndarray, duration: float, repeat: int, among: np.ndarray | None = None) -> Drive:
    """The drive seen from several starts [s], one world for each; the set of worlds is repeated.

    Args:
        among: starts of all worlds for which it is sampled alike (default: of these).
    """
    among = starts if among is None else among.ravel()
    if not np.any(among):
        return drive
    changed = {}
    for name, s in drive.signals.items():
        if s.times is None and not np.any(s.amplitude):
            continue
        wave = Signal(offset=s.offset, amplitude=s.amplitude, frequency=s.frequency, phase=s.phase)
        local = wave.sampled(duration) if np.any(s.amplitude) else np.array([0.0, duration])
        if s.times is not None:
            local = np.unique(np.concatenate([local, _knots(s.times, among, duration)]))
        values = np.stack([np.broadcast_to(np.squeeze(s(local + t0)), local.shape) for t0 in starts], axis=1)
        changed[name] = series(local, np.tile(values, (1, repeat)))
    age = np.squeeze(drive.signals["origin"](0.0))
    return drive.replace(**changed, origin=age + np.tile(starts, repeat))


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
