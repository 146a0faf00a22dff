"""Voltage lag: on the stack, by resistance of electrodes and leads and capacitance of the layers."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import lagging, sampled, voltages


def apply(drive: Drive, duration: float, lag: np.ndarray) -> Drive:
    return sampled(drive, voltages(drive), duration, lambda times, values: lagging(times, values, lag), when=lag)


EFFECT = Effect(
    name="voltage_lag",
    family="drive",
    force=None,
    apply=apply,
    channels=("voltage",),
    parameters=(Parameter("lag", "RC", "s", 0.0, (0.0, 10.0), "time constant of the voltage", typical=0.01),),
    fitted=("lag",),
    formula="R C dV/dt = V_command - V",
    source="first-order charging of a capacitor; C = 0.76 nF for six layers",
    matters="4e-5 s with carbon grease, tens of milliseconds through a protective resistor of 50 megohms",
    confused_with="viscous loss, creep, dielectric relaxation",
    separated_by="record voltage and current at the stack",
)
