"""Check a recording for the faults that files really have, before anything is concluded from it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.recording import CHANNEL_KINDS, scaled_differences
from origami_sim.recording.units import unit_factor

GAP_FACTOR = 1.5
"""A step longer than this many median steps is a time gap."""


@dataclass(frozen=True)
class Series:
    """Readings of one channel as they stand in the file, for the lint.

    Attributes:
        readings: (n,) or (n, d) numbers of the file; nan where a cell is empty.
        kind: a key of `CHANNEL_KINDS`.
        unit: the stated unit of `readings`.
        noise: the stated noise in `unit`, or None.
        unwrap: whether jumps of whole turns are to be removed.
    """

    readings: np.ndarray
    kind: str
    unit: str
    noise: float | None = None
    unwrap: bool = False


def lint(
    times: np.ndarray,
    series: Mapping[str, Series],
    *,
    file: object = None,
    position: Callable[[int], str] | None = None,
    allow_gaps: bool = False,
) -> list[str]:
    """Check a recording before anything is concluded from it.

    Errors: fewer than 3 frames; times missing, repeated or running backwards; a channel without 3 values; angles stated
    in rad beyond 100; a constant channel whose noise is not stated; and, unless `allow_gaps`, missing values between
    others and time steps beyond 1.5 median steps. Notes: the gaps that were allowed, missing values at the ends,
    constant channels, angles stated in deg that look like rad, angles that jump by a turn, noise that comes in bursts.

    Args:
        times: (n,) times [s].
        series: readings by channel.
        file: the file to name in errors.
        position: where a row stands in the file, e.g. row 0 -> "line 2"; counts rows from 1 when None.
        allow_gaps: whether gaps are notes instead of errors.

    Returns:
        Notes, one sentence each.
    """
    place = position or (lambda row: f"row {row + 1}")
    if len(times) < 3:
        raise InputError(f"the recording has {len(times)} frames, at least 3 are needed", file=file, field="time")
    notes = _lint_times(times, file, place, allow_gaps)
    for name, one in series.items():
        notes += _lint_missing(name, one, times, file, allow_gaps)
        notes += _lint_values(name, one, times, file)
    return notes


def _lint_times(times: np.ndarray, file: object, place: Callable[[int], str], allow_gaps: bool) -> list[str]:
    missing = np.flatnonzero(~np.isfinite(times))
    if missing.size:
        raise InputError(f"the time is missing at {place(int(missing[0]))}", file=file, field="time")
    steps = np.diff(times)
    backwards = np.flatnonzero(steps <= 0.0)
    if backwards.size:
        row = int(backwards.min())
        fault = "is repeated" if times[row] == times[row + 1] else f"runs backwards from {times[row]:.9g} s"
        raise InputError(f"the time {fault} at {place(row + 1)}", file=file, field="time", value=float(times[row + 1]))
    typical = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP_FACTOR * typical)
    if gaps.size == 0:
        return []
    first = int(gaps[0])
    sentence = (
        f"{gaps.size} time gap{'s' if gaps.size > 1 else ''} longer than {GAP_FACTOR} median steps of {typical:.6g} s, "
        f"first after t = {times[first]:.6g} s ({steps[first]:.6g} s long)"
    )
    if not allow_gaps:
        raise InputError(sentence, file=file, field="time", allowed="gaps only with allow_gaps = true in the sidecar")
    return [sentence + "."]


def _lint_missing(name: str, one: Series, times: np.ndarray, file: object, allow_gaps: bool) -> list[str]:
    lost = np.asarray(~np.isfinite(one.readings.reshape(len(times), -1)).all(axis=1))
    seen = np.flatnonzero(~lost)
    if seen.size < 3:
        raise InputError(f"channel '{name}' has {seen.size} values, at least 3 are needed", file=file, field=name)
    notes = []
    interior = np.flatnonzero(lost[seen[0] : seen[-1]]) + seen[0]
    if interior.size:
        runs = 1 + np.count_nonzero(np.diff(interior) > 1)
        sentence = (
            f"channel '{name}' misses {interior.size} values in {runs} run{'s' if runs > 1 else ''} between others, "
            f"first at t = {times[interior[0]]:.6g} s"
        )
        if not allow_gaps:
            raise InputError(sentence, file=file, field=name, allowed="gaps only with allow_gaps = true in the sidecar")
        notes.append(sentence + ".")
    if seen[0] > 0:
        notes.append(f"Channel '{name}' starts only at t = {times[seen[0]]:.6g} s.")
    if seen[-1] < len(times) - 1:
        notes.append(f"Channel '{name}' ends already at t = {times[seen[-1]]:.6g} s.")
    return notes


def _lint_values(name: str, one: Series, times: np.ndarray, file: object) -> list[str]:
    notes = []
    columns = one.readings.reshape(len(times), -1)
    largest = float(np.nanmax(np.abs(columns)))
    constant = bool((np.nanmax(columns, axis=0) == np.nanmin(columns, axis=0)).all())
    if constant and one.noise is None:
        raise InputError(
            f"channel '{name}' is constant, so that its noise cannot be estimated",
            file=file,
            field="noise",
            allowed="a stated noise, or leave the channel out",
        )
    if constant:
        notes.append(f"Channel '{name}' is constant.")
    if CHANNEL_KINDS[one.kind][0] == "angle":
        if one.unit == "rad" and largest > 100.0:
            raise InputError(
                f"channel '{name}' is stated in rad but reaches {largest:.6g}, which looks like degrees",
                file=file,
                field="unit",
                value=one.unit,
            )
        if one.unit == "deg" and not constant and largest <= 2.0 * np.pi:
            notes.append(f"Channel '{name}' is stated in deg but stays within 2 pi: this looks like radians.")
        seen = np.isfinite(columns[:, 0])
        jumps = np.flatnonzero(np.abs(np.diff(columns[seen, 0])) * unit_factor(one.unit) > np.pi)
        if jumps.size and not one.unwrap:
            when = times[seen][jumps[0] + 1]
            notes.append(f"Channel '{name}' jumps by more than half a turn at t = {when:.6g} s: unwrap = true?")
    if not constant and one.noise is None:
        bursts = _burst_ratio(times, columns)
        if bursts > 1.5:
            notes.append(
                f"The noise of channel '{name}' comes in bursts: its root mean square is {bursts:.1f} times its median "
                "level, which is the noise stated."
            )
    return notes


def _burst_ratio(times: np.ndarray, columns: np.ndarray) -> float:
    """Largest ratio, over components, of the rms of the differences to their robust estimate; 1 for white noise."""
    ratios = [1.0]
    for column in columns.T:
        scaled = scaled_differences(times, column)
        level = 1.4826 * float(np.median(np.abs(scaled))) if scaled.size else 0.0
        if level > 1e-9 * float(np.nanmax(np.abs(column))):
            ratios.append(float(np.sqrt(np.mean(scaled**2))) / level)
    return max(ratios)
