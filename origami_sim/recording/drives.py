"""From the drive of a recording to the drive of a simulation."""

import numpy as np

from origami_sim.drive import Drive, series
from origami_sim.errors import InputError
from origami_sim.recording.recording import DriveChannel, Recording

UNITS = {"field": "T", "gradient": "T/m", "voltage": "V", "temperature": "K", "load": "1"}
"""SI unit of the drives that the simulator knows; `field_x`, `gradient_zx`, `voltage_1` name single components."""


def applied_drive(recording: Recording, *, step: int | None = None) -> Drive:
    """What was applied, for a simulation that starts with the first frame.

    Drives are linear between their samples and keep the last value beyond the end of the recording. Drives of other
    names (a current, gravity) are for the scene to interpret.

    Args:
        recording: the recording.
        step: the frame or load step at which the drive is held; None lets it run in time.

    Raises:
        InputError: a drive in a wrong unit or with a wrong number of components, no such step, or a quasi-static curve
            without a step.
    """
    if recording.by_step and step is None:
        raise InputError("a quasi-static curve has no course in time: state the step", field="step")
    if step is not None and not 0 <= step < recording.frame_count:
        raise InputError("no such step", field="step", value=step, allowed=f"0 to {recording.frame_count - 1}")
    signals = {}
    for name, drive in recording.drive.items():
        family = name.split("_")[0]
        if family in UNITS:
            signals |= _signals(name, family, drive, recording, step)
    groups = [int(name.removeprefix("voltage_")) for name in signals if name.startswith("voltage_")]
    return Drive(voltage=[0.0] * (max(groups, default=0) + 1)).replace(**signals)


def _signals(name: str, family: str, drive: DriveChannel, recording: Recording, step: int | None) -> dict:
    """Signals of the simulator by channel."""
    if drive.unit != UNITS[family]:
        raise InputError("the drive has another unit", field=f"drive.{name}", value=drive.unit, allowed=UNITS[family])
    held = drive.constant or step is not None
    times = recording.times if drive.times is None else drive.times
    values = drive.at(recording.times)[step or 0] if held else drive.values
    columns = np.asarray(values, float).reshape(1 if held else len(times), -1)
    known = _components(name, family, columns.shape[1])
    if known is None:
        raise InputError(
            "the drive has a wrong number of components",
            field=f"drive.{name}",
            value=columns.shape[1],
            allowed="field 3 (or one with a direction), gradient 9, others 1 per electrode group",
        )
    if held:
        return {channel: float(value) for channel, value in zip(known, columns[0], strict=True)}
    clock = times - recording.times[0]
    after = np.append(clock, max(clock[-1], recording.times[-1] - recording.times[0]) * 2 + 1.0)  # hold the end
    if clock[0] > 0:
        raise InputError("the drive starts after the recording", field=f"drive.{name}", value=float(times[0]))
    return {
        channel: series(after, np.append(column, column[-1])) for channel, column in zip(known, columns.T, strict=True)
    }


def _components(name: str, family: str, count: int) -> list[str] | None:
    """The simulator's channels that a drive of this name and number of components fills."""
    if name == "field":
        return [f"field_{i}" for i in "xyz"] if count == 3 else None
    if name == "gradient":
        return [f"gradient_{i}{j}" for i in "xyz" for j in "xyz"] if count == 9 else None
    if name == "voltage":
        return [f"voltage_{k}" for k in range(count)]
    if count != 1:
        return None
    singles = [f"field_{i}" for i in "xyz"] + [f"gradient_{i}{j}" for i in "xyz" for j in "xyz"]
    if name in (*singles, "temperature", "load"):
        return [name]
    return [name] if family == "voltage" and name.removeprefix("voltage_").isdigit() else None
