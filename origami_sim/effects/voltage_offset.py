"""Voltage offset: a voltage that is there without command, such as the amplifier's."""

from dataclasses import replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import voltages


def apply(drive: Drive, duration: float, voltage_offset: np.ndarray) -> Drive:
    if not np.any(voltage_offset):
        return drive
    driven = [c for c in voltages(drive) if not drive[c].is_zero]
    return drive.replace(**{c: replace(drive[c], offset=drive[c].offset + voltage_offset) for c in driven})


EFFECT = Effect(
    name="voltage_offset",
    family="drive",
    force=None,
    apply=apply,
    channels=("voltage",),
    parameters=(
        Parameter(
            "voltage_offset", "V0", "V", 0.0, (-5e3, 5e3), "constant voltage on every driven group", typical=100.0
        ),
    ),
    fitted=("voltage_offset",),
    formula="V = V_command + V0",
    source="offset of a high-voltage amplifier, 0.1 to 1 % of its range",
    matters="an alternating voltage then moves the device at its own frequency besides twice that",
    confused_with="charge injection",
    separated_by="reverse the polarity; a voltmeter at the stack",
)
