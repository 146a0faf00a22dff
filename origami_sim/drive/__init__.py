"""What acts on a device from outside: fields, voltages, loads and temperatures in time, as data."""

from origami_sim.drive.drive import (
    CHANNELS,
    SAMPLES_PER_SECOND,
    UNITS,
    Drive,
    Signal,
    Value,
    as_signal,
    held_to,
    ramp,
    series,
    sine,
)

__all__ = [
    "CHANNELS",
    "SAMPLES_PER_SECOND",
    "UNITS",
    "Drive",
    "Signal",
    "Value",
    "as_signal",
    "held_to",
    "ramp",
    "series",
    "sine",
]
