"""Thermal lag: the device warms and cools later than its surroundings."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import lagging, sampled


def apply(drive: Drive, duration: float, lag: np.ndarray) -> Drive:
    return sampled(drive, ["temperature"], duration, lambda times, values: lagging(times, values, lag), when=lag)


EFFECT = Effect(
    name="temperature_lag",
    family="drive",
    force=None,
    apply=apply,
    channels=("temperature",),
    parameters=(Parameter("lag", "tau", "s", 0.0, (0.0, 1e4), "time constant of the temperature", typical=1.0),),
    fitted=("lag",),
    formula="tau dT/dt = T_command - T",
    source="lumped heat capacity and film coefficient: tau = rho c h / (2 alpha), Biot number below 0.1",
    matters="75 s for a millimetre of elastomer in still air (10 W/m^2 K on both sides), seconds on a heated plate",
    confused_with="creep of the creases",
    separated_by="a thermocouple in the sheet",
)
