"""Gain error of the field: the device gets more or less than was commanded."""

import numpy as np

from origami_sim.drive import CHANNELS, Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import scaled, strengths


def apply(drive: Drive, duration: float, field_gain: np.ndarray) -> Drive:
    channels = [*CHANNELS[:12], *strengths(drive)]
    return scaled(drive, channels, 1 + field_gain) if np.any(field_gain) else drive


EFFECT = Effect(
    name="field_gain",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(Parameter("field_gain", "e", "-", 0.0, (-1.0, 3.0), "relative error of the field", typical=0.1),),
    fitted=("field_gain",),
    formula="B = (1 + e) B_command, its gradient and the strengths of its sources alike",
    source="calibration of the coil current or of the distance between magnet and device",
    matters="5 to 20 % where the field was computed from the current and not measured",
    confused_with="remanence, crease stiffness: constant factors; it acts on all magnets alike",
    separated_by="a Hall probe in the place of the device",
)
