"""What acts on a device from outside: fields, voltages, loads and temperatures in time, as data."""

from origami_sim.drive.drive import (
    CHANNELS,
    PATHS,
    SAMPLES_PER_SECOND,
    UNITS,
    Drive,
    Signal,
    Value,
    as_signal,
    held_series,
    held_to,
    path_to,
    ramp,
    series,
    sine,
)

__all__ = [
    "CHANNELS",
    "PATHS",
    "SAMPLES_PER_SECOND",
    "UNITS",
    "Drive",
    "Signal",
    "Value",
    "as_signal",
    "held_series",
    "held_to",
    "path_to",
    "ramp",
    "series",
    "sine",
]
