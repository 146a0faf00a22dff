"""Gain error of the amplifier: the stack gets more or less voltage than was commanded."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import scaled, voltages


def apply(drive: Drive, duration: float, voltage_gain: np.ndarray) -> Drive:
    return scaled(drive, voltages(drive), 1 + voltage_gain) if np.any(voltage_gain) else drive


EFFECT = Effect(
    name="voltage_gain",
    family="drive",
    force=None,
    apply=apply,
    channels=("voltage",),
    parameters=(Parameter("voltage_gain", "e", "-", 0.0, (-1.0, 3.0), "relative error of the voltage", typical=0.05),),
    fitted=("voltage_gain",),
    formula="V = (1 + e) V_command",
    source="gain of a high-voltage amplifier, divider of its monitor",
    matters="1 to 5 %, twice that in the moment",
    confused_with="permittivity, electrode overlap, modulus: constant factors; it acts on all stacks alike",
    separated_by="a voltmeter at the stack",
)
