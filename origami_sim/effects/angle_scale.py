"""Scale error of the angle: all angles are read too large or too small alike."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, angle_scale: np.ndarray) -> np.ndarray:
    return read(times) * (1 + angle_scale)


EFFECT = Effect(
    name="angle_scale",
    family="measurement",
    force=None,
    apply=apply,
    channels=("panel_angle", "crease_angle"),
    parameters=(Parameter("angle_scale", "e", "-", 0.0, (-0.5, 0.5), "relative error of angles", typical=0.03),),
    fitted=("angle_scale",),
    formula="y = (1 + e) x",
    source="sensitivity of a sensor; camera that looks along another axis than the hinge's, to first order",
    matters="1 to 5 %",
    confused_with="constant factors: stiffness, remanence, permittivity",
    separated_by="angles known from a template",
)
