"""Saturation of the field: a core or an amplifier gives less than is commanded, the less the stronger it is."""

import numpy as np

from origami_sim.drive import CHANNELS, Drive, series
from origami_sim.effects._effect import Effect, Parameter

FIELD, WITH_GRADIENT = CHANNELS[:3], CHANNELS[:12]


def apply(drive: Drive, duration: float, field_saturation: np.ndarray) -> Drive:
    moving = [c for c in WITH_GRADIENT if not drive[c].is_zero]
    square = [c for c in moving if c in FIELD]
    if not (np.any(field_saturation) and square):
        return drive
    times, values = drive.series(moving, duration)
    strength = sum(v * v for c, v in zip(moving, values, strict=True) if c in square)
    part = 1.0 / np.sqrt(1.0 + field_saturation * strength)
    return drive.replace(**{c: series(times, part * v) for c, v in zip(moving, values, strict=True)})


EFFECT = Effect(
    name="field_saturation",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(
        Parameter(
            "field_saturation", "s", "1/T^2", 0.0, (0.0, 1e8), "one over the square of the field it tends to",
            typical=100.0,
        ),
    ),
    fitted=("field_saturation",),
    formula="B = B_command / sqrt(1 + s |B_command|^2), its gradient alike; at most 1 / sqrt(s)",
    source="smooth saturation of a core or an amplifier; as Bs tanh(B / Bs) to third order with s = 2 / (3 Bs^2)",
    matters="a core that lets through 0.1 T at most: 2 % less than commanded at 20 mT, 11 % at 50 mT",
    confused_with="gain of the field (the same part at any strength); stiffness that grows with the field",
    separated_by="a Hall probe in the place of the device, at half and at full current",
)  # fmt: skip
