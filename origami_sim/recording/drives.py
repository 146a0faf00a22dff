"""From the drive of a recording to the drive of a simulation."""

import re
from dataclasses import replace

import numpy as np

from origami_sim.drive import CHANNELS, PATHS, Drive, held_series, path_to
from origami_sim.drive import UNITS as CHANNEL_UNITS
from origami_sim.errors import InputError, nearest
from origami_sim.recording.placed import surrounded
from origami_sim.recording.recording import DriveChannel, Recording

UNITS = {family: unit for family, unit in CHANNEL_UNITS.items() if family != "origin"}
"""SI unit of the drives that a recording may have; `field_x`, `gradient_zx`, `voltage_1` name single components."""

SWITCH = 0.05
"""Share of a drive's range by which it changes between two rows where it is said to be switched.

Of thirteen drives (sines to 30 Hz, ramps, steps and stairs, with noise and without) half of it adds stairs of 4 %,
double leaves out those of 8 %.
"""


def applied_drive(recording: Recording, *, step: int | None = None) -> Drive:
    """What was applied, for a simulation that starts with the first frame.

    Drives are linear between their samples and keep the last value beyond the end of the recording; paths of grips
    (`grip_top`, `turn_top`) go through theirs on a cubic spline. Drives of other names (a current, gravity) are left
    out; `diagnose` refuses them.

    Args:
        recording: the recording.
        step: the frame or load step at which the drive is held; None lets it run in time.

    Raises:
        InputError: what `by_component` refuses, no such step, or a quasi-static curve without a step.
    """
    if recording.by_step and step is None:
        raise InputError("a quasi-static curve has no course in time: state the step", field="step")
    if step is not None and not 0 <= step < recording.frame_count:
        raise InputError("no such step", field="step", value=step, allowed=f"0 to {recording.frame_count - 1}")
    signals = recorded_signals(recording, step)
    groups = [int(name.removeprefix("voltage_")) for name in signals if name.startswith("voltage_")]
    applied = surrounded(Drive(voltage=[0.0] * (max(groups, default=0) + 1)), recording).replace(**signals)
    if step is None or not recording.sources:
        return applied
    return applied.held(float(recording.times[step] - recording.times[0]))


def recorded_signals(recording: Recording, step: int | None = None) -> dict:
    """Signals of what was recorded of a drive, by channel of the simulator; see `applied_drive`."""
    signals = {}
    for name, drive in recording.drive.items():
        if name.split("_")[0] in UNITS:
            signals |= _signals(name, drive, recording, step)
    return signals


def switches(recording: Recording) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times (k,) of the rows before and after each switch, of drives that were switched [s].

    Switched is what changes between two rows by more than `SWITCH` of its range, by ten times as much as it usually
    does, and by twice as much as before and after together.
    """
    out = {}
    for name, drive in recording.drive.items():
        if recording.by_step or drive.constant or name.split("_")[0] not in UNITS:
            continue
        values = np.reshape(drive.values, (len(drive.values), -1))
        change = np.pad(np.abs(np.diff(values, axis=0)), ((1, 1), (0, 0)))
        least = np.maximum(SWITCH * np.ptp(values, axis=0), 10.0 * np.median(change[1:-1], axis=0))
        rows = np.flatnonzero((change[1:-1] > np.maximum(least, 2.0 * (change[:-2] + change[2:]))).any(axis=1))
        if len(rows):
            times = recording.times if drive.times is None else drive.times
            out[name] = times[rows], times[rows + 1]
    return out


def switched_between(recording: Recording) -> list[tuple[int, int]]:
    """The frames before and after each instant at which a drive was switched that is not known to within a frame."""
    times, found = recording.times, set[tuple[int, int]]()
    frame = float(np.median(np.diff(times)))
    for before, after in switches(recording).values():
        rows = np.stack([before, after], axis=1)[np.round((after - before) / frame) >= 1.0]
        slack = 1e-6 * frame
        last, first = np.searchsorted(times, rows[:, 0] + slack) - 1, np.searchsorted(times, rows[:, 1] - slack)
        found |= {(a, b) for a, b in zip(last.tolist(), first.tolist(), strict=True) if a >= 0 and b < len(times)}
    return sorted(found)


def by_component(name: str, drive: DriveChannel, *, file: object = None) -> dict[str, np.ndarray]:
    """What a recorded drive gives each of the simulator's channels that it fills.

    Args:
        name, drive: of a recording. file: the file to name in errors.

    Returns:
        (n,) values [SI] of each channel; one where the drive is constant.

    Raises:
        InputError: a drive that the simulator does not know, in another unit, or with a wrong number of components.
    """
    family, field = name.split("_")[0], f"drive.{name}"
    columns = np.reshape(np.asarray(drive.values, float), (1 if drive.constant else len(drive.values), -1)).T
    names = [name] if name in CHANNELS or re.fullmatch(r"voltage_\d+|(grip|turn)_.+", name) else []
    if name in ("field", "gradient"):
        names = [channel for channel in CHANNELS if channel.startswith(name)]
    elif name == "voltage":
        names = [f"voltage_{k}" for k in range(len(columns))]
    if not names:
        allowed = ", ".join(UNITS) + ", or a component such as field_z, gradient_zx, voltage_1 or grip_top"
        said = allowed + nearest(name, UNITS)
        raise InputError("the simulator knows no such drive", file=file, field=field, allowed=said)
    if drive.unit != UNITS[family]:
        raise InputError("the drive has another unit", file=file, field=field, value=drive.unit, allowed=UNITS[family])
    if len(columns) != len(names):
        where = {"file": file, "field": field, "value": len(columns)}
        allowed = f"{len(names)}" + (", or one with a direction" if name == "field" else "")
        raise InputError("the drive has a wrong number of components", **where, allowed=allowed)
    return dict(zip(names, columns, strict=True))


def _signals(name: str, drive: DriveChannel, recording: Recording, step: int | None) -> dict:
    """Signals of the simulator by channel."""
    if step is not None:
        drive = replace(drive, values=drive.at(recording.times)[step], constant=True)
    components = by_component(name, drive, file=recording.metadata.get("sidecar"))
    if drive.constant:
        return {channel: float(values[0]) for channel, values in components.items()}
    family = name.partition("_")[0]
    times = recording.times if drive.times is None else drive.times
    clock = times - recording.times[0]
    if clock[0] > 0:
        raise InputError("the drive starts after the recording", field=f"drive.{name}", value=float(times[0]))
    end = 2 * max(clock[-1], recording.times[-1] - recording.times[0])
    joined = path_to if family in PATHS else held_series
    return {channel: joined(end, clock, values) for channel, values in components.items()}
