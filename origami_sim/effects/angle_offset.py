"""Zero error of the angle: what an encoder or camera reads where the angle is none."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, angle_offset: np.ndarray) -> np.ndarray:
    return read(times) + angle_offset


EFFECT = Effect(
    name="angle_offset",
    family="measurement",
    force=None,
    apply=apply,
    channels=("panel_angle", "crease_angle"),
    parameters=(
        Parameter("angle_offset", "a", "rad", 0.0, (-1.0, 1.0), "constant added to every angle", typical=0.03),
    ),
    fitted=("angle_offset",),
    formula="y = x + a",
    source="camera not upright, encoder zeroed by eye",
    matters="1 to 3 deg",
    confused_with="rest angle, gravity, residual field",
    separated_by="a plumb line in the picture; the flat sheet before the test",
)
