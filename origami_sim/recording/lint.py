"""Check a recording for the faults that files really have, before anything is concluded from it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.recording import CHANNEL_KINDS, Recording, quantisation, scaled_differences
from origami_sim.units import quantity, unit_factor

SAME = 1e-9
"""Part of the median step by which two times differ that are one: rounding of a digitised table."""

GAP_FACTOR = 1.5
"""A step longer than this many median steps is a time gap."""

LARGE = 20.0
"""Metres that a marker of an origami hardly travels: beyond, the unit is suspected."""

FROZEN = 25
"""Equal values in a row, in a channel that is otherwise noisy, that look like a tracker holding its last value."""

SWAP_JUMP, SWAP_FIT = 8.0, 0.25
"""Two tracks are swapped where both leave their course by so many times their usual deviation, and the other one's
course explains them with at most this share of the error."""


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
    allow_swaps: bool = False,
    by_step: bool = False,
) -> list[str]:
    """Check a recording before anything is concluded from it.

    Errors: fewer than 3 frames; times missing, repeated or running backwards; a channel without 3 values; angles stated
    in rad beyond 100; a constant channel whose noise is not stated; unless `allow_gaps`, missing values between
    others and time steps beyond 1.5 median steps; unless `allow_swaps`, markers that exchange their names. Notes: what
    was allowed, missing values at the ends, constant channels, angles stated in deg that look like rad and the reverse,
    lengths that look like a wrong unit, angles that jump by a turn, quantised readings, values that stand still, noise
    that comes in bursts.

    Args:
        times: (n,) times [s].
        series: readings by channel.
        file: the file to name in errors.
        position: where a row stands in the file, e.g. row 0 -> "line 2"; counts rows from 1 when None.
        allow_gaps: whether gaps are notes instead of errors.
        allow_swaps: whether swapped markers are notes instead of errors.
        by_step: whether rows are load steps, of which three without a course in time are enough.

    Returns:
        Notes, one sentence each.
    """
    place = position or (lambda row: f"row {row + 1}")
    if len(times) < 3:
        raise InputError(f"the recording has {len(times)} frames, at least 3 are needed", file=file, field="time")
    notes = _lint_times(times, file, place, allow_gaps)
    for name, one in series.items():
        notes += _lint_missing(name, one, times, file, allow_gaps, by_step)
        notes += _lint_values(name, one, times, file, by_step)
        if by_step and one.noise is None:
            notes.append(
                f"The noise of channel '{name}' is the roughness of {len(times)} load steps, an upper bound: "
                "state it if it is known."
            )
    return notes if by_step else notes + _lint_swaps(series, times, file, allow_swaps)


def lint_report(recording: Recording) -> str:
    """What is known of a recording before anything is concluded from it: size, noise by channel, drive, and notes."""
    span = recording.times[-1] - recording.times[0]
    length = (
        f"{recording.frame_count} load steps" if recording.by_step else f"{recording.frame_count} frames, {span:.6g} s"
    )
    lines = [f"{recording.name}: {length}"]
    for channel in recording.channels.values():
        lines.append(f"  {channel.name} ({channel.kind}): noise {quantity(channel.noise, channel.unit)}")
        known = channel.noise_report
        if known is not None:
            parts = [f"median level {quantity(known.level, channel.unit)}", f"rms {quantity(known.rms, channel.unit)}"]
            if np.isfinite(known.lag_1):
                parts.append(f"lag-1 correlation {known.lag_1:.2f} (then {quantity(known.total, channel.unit)})")
            if known.quantum > 0.0:
                parts.append(f"step {quantity(known.quantum, channel.unit)}")
            if known.rest_frames:
                parts.append(f"at rest {quantity(known.rest, channel.unit)} over {known.rest_frames} frames")
            lines[-1] += f"; from the data: {', '.join(parts)}"
    for drive in recording.drive.values():
        lines.append(f"  drive {drive.name} [{drive.unit}]: {'constant' if drive.constant else 'varies'}")
    return "\n".join([*lines, *(f"note: {note}" for note in recording.metadata.get("notes", ()))])


def repeated(times: np.ndarray) -> np.ndarray:
    """(n,) whether a time is that of the row before; digitised tables differ by rounding only."""
    steps = np.diff(times)
    return np.concatenate([[False], np.abs(steps) <= SAME * float(np.median(np.abs(steps)))])[: len(times)]


def _lint_times(times: np.ndarray, file: object, place: Callable[[int], str], allow_gaps: bool) -> list[str]:
    missing = np.flatnonzero(~np.isfinite(times))
    if missing.size:
        raise InputError(f"the time is missing at {place(int(missing[0]))}", file=file, field="time")
    steps = np.diff(times)
    same = SAME * float(np.median(np.abs(steps)))
    backwards = np.flatnonzero(steps <= same)
    if backwards.size:
        row = int(backwards.min())
        repeats = bool(abs(steps[row]) <= same)
        fault = "is repeated" if repeats else f"runs backwards from {times[row]:.9g} s"
        if not repeats and np.unique(times).size == times.size:
            place_, count = place(row + 1), backwards.size
            raise InputError(
                f"the time {fault} at {place_}: the rows are not sorted ({count} of {len(steps)} steps run backwards)",
                file=file,
                field="time",
                value=float(times[row + 1]),
            )
        allowed = "repeats only with allow_repeats = true in the sidecar" if repeats else None
        raise InputError(
            f"the time {fault} at {place(row + 1)}",
            file=file,
            field="time",
            value=float(times[row + 1]),
            allowed=allowed,
        )
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


def _at(time: float | np.ndarray, by_step: bool) -> str:
    """An instant of a recording in words."""
    return f"load step {float(time):.6g}" if by_step else f"t = {float(time):.6g} s"


def _lint_missing(name: str, one: Series, times: np.ndarray, file: object, gaps: bool, steps: bool) -> list[str]:
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
            f"first at {_at(times[interior[0]], steps)}"
        )
        if runs > 1:
            lengths = np.diff(np.flatnonzero(np.diff(np.concatenate([[-2], interior, [len(times) + 2]])) > 1))
            sentence += f", the longest of {lengths.max()}"
        if not gaps:
            raise InputError(sentence, file=file, field=name, allowed="gaps only with allow_gaps = true in the sidecar")
        notes.append(sentence + ".")
    if seen[0] > 0:
        notes.append(f"Channel '{name}' starts only at {_at(times[seen[0]], steps)}.")
    if seen[-1] < len(times) - 1:
        notes.append(f"Channel '{name}' ends already at {_at(times[seen[-1]], steps)}.")
    return notes


def _lint_values(name: str, one: Series, times: np.ndarray, file: object, by_step: bool) -> list[str]:
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
        turned = float((np.nanmax(columns, axis=0) - np.nanmin(columns, axis=0)).max()) * unit_factor(one.unit)
        if one.kind == "crease_angle" and one.unit in ("rad", "mrad") and turned > 2.0 * np.pi:
            notes.append(
                f"Channel '{name}' is stated in {one.unit} but turns by {turned:.4g} rad, more than a crease can: this "
                "looks like degrees."
            )
        if one.unit == "deg" and not constant and largest <= 2.0 * np.pi:
            notes.append(f"Channel '{name}' is stated in deg but stays within 2 pi: this looks like radians.")
        seen = np.isfinite(columns[:, 0])
        jumps = np.flatnonzero(np.abs(np.diff(columns[seen, 0])) * unit_factor(one.unit) > np.pi)
        if jumps.size and not one.unwrap:
            when = times[seen][jumps[0] + 1]
            notes.append(f"Channel '{name}' jumps by more than half a turn at {_at(when, by_step)}: unwrap = true?")
    elif one.kind != "force" and one.unit != "px":
        spread = float((np.nanmax(columns, axis=0) - np.nanmin(columns, axis=0)).max()) * unit_factor(one.unit)
        if spread > LARGE:
            notes.append(
                f"Channel '{name}' is stated in {one.unit} and moves by {spread:.4g} m: this looks like millimetres "
                "or pixels."
            )
    if not constant:
        notes += _lint_levels(name, one, columns, times, by_step)
    if not constant and one.noise is None:
        bursts = _burst_ratio(times, columns)
        if bursts > 1.5:
            notes.append(
                f"Channel '{name}' is now and then {bursts:.1f} times as rough (root mean square) as in most frames, "
                "whose level is the noise said above: bursts, impacts, or steps that are faster than the frames."
            )
    return notes


def _lint_levels(name: str, one: Series, columns: np.ndarray, times: np.ndarray, by_step: bool) -> list[str]:
    """Notes on readings that come in steps, and on values that stand still while a tracker has lost the point."""
    quantum = max(quantisation(column) for column in columns.T)
    if quantum > 0.0:
        return [f"The readings of channel '{name}' come in steps of {quantum:.4g} {one.unit}."]
    held = (np.diff(columns, axis=0) == 0.0).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
    starts, lengths = edges[::2], edges[1::2] - edges[::2] + 1
    if not (lengths >= FROZEN).any():
        return []
    k = int(np.argmax(lengths))
    return [
        f"Channel '{name}' stands still for {lengths[k]} frames from {_at(times[starts[k]], by_step)} although it is "
        "noisy elsewhere: was the point lost there?"
    ]


def _lint_swaps(series: Mapping[str, Series], times: np.ndarray, file: object, allow_swaps: bool) -> list[str]:
    """Pairs of tracks of which each leaves its own course and takes up the other's, at the same frame."""
    tracks: dict[tuple[str, int, str], list[str]] = {}
    for name, one in series.items():
        if one.kind in ("marker", "marker_2d"):
            tracks.setdefault((one.kind, one.readings.shape[1], one.unit), []).append(name)
    notes = []
    for names in tracks.values():
        for k, first in enumerate(names):
            for second in names[k + 1 :]:
                when = swaps(times, series[first].readings, series[second].readings)
                if when.size == 0:
                    continue
                more = f" and {when.size - 1} times more" if when.size > 1 else ""
                sentence = f"markers '{first}' and '{second}' seem to exchange names at t = {when[0]:.6g} s{more}"
                if not allow_swaps:
                    raise InputError(
                        sentence,
                        file=file,
                        field=first,
                        allowed="tracks that keep their point, or allow_swaps = true in the sidecar",
                    )
                notes.append(sentence[0].upper() + sentence[1:] + ".")
    return notes


def swaps(times: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Times (k,) at which two tracks (n, d) exchange their identity.

    Each point is predicted from its two frames before, at constant velocity. A swap is a frame where both points miss
    their own prediction by more than `SWAP_JUMP` times the usual miss, while the other's prediction misses by less than
    `SWAP_FIT` of that. Frames in which one is missing are left out, so that an exchange behind an occlusion is seen.
    """
    seen = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    t, a, b = times[seen], first[seen], second[seen]
    if len(t) < 6:
        return np.zeros(0)
    share = ((t[2:] - t[1:-1]) / (t[1:-1] - t[:-2]))[:, None]
    predicted_a, predicted_b = (p[1:-1] + share * (p[1:-1] - p[:-2]) for p in (a, b))

    def miss(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.linalg.norm(p[2:] - q, axis=1)

    own_a, own_b = miss(a, predicted_a), miss(b, predicted_b)
    crossed = np.maximum(miss(a, predicted_b), miss(b, predicted_a))
    # long occlusions make every prediction poor: the miss may grow with the square of the time bridged
    usual = np.maximum(np.median(np.maximum(own_a, own_b)), 1e-12) * np.maximum(share[:, 0], 1.0) ** 2
    jumped = (np.minimum(own_a, own_b) > SWAP_JUMP * usual) & (crossed < SWAP_FIT * np.minimum(own_a, own_b))
    found = np.flatnonzero(jumped)
    kept = [
        k for i, k in enumerate(found) if i == 0 or k - found[i - 1] > 2
    ]  # the frame after a swap is off course too
    return t[2:][kept]


def _burst_ratio(times: np.ndarray, columns: np.ndarray) -> float:
    """Largest ratio, over components, of the rms of the differences to their robust estimate; 1 for white noise."""
    ratios = [1.0]
    for column in columns.T:
        scaled = scaled_differences(times, column)
        level = 1.4826 * float(np.median(np.abs(scaled))) if scaled.size else 0.0
        if level > 1e-9 * float(np.nanmax(np.abs(column))):
            ratios.append(float(np.sqrt(np.mean(scaled**2))) / level)
    return max(ratios)
