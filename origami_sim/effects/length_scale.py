"""Scale error of the length: all lengths are read too large or too small alike."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, length_scale: np.ndarray) -> np.ndarray:
    return read(times) * (1 + length_scale)


EFFECT = Effect(
    name="length_scale",
    family="measurement",
    force=None,
    apply=apply,
    channels=("marker", "marker_2d", "tip_displacement"),
    parameters=(Parameter("length_scale", "e", "-", 0.0, (-0.5, 0.5), "relative error of lengths", typical=0.03),),
    fitted=("length_scale",),
    formula="y = (1 + e) x, about the origin",
    source="ruler in another plane than the motion: a distance error dz / z",
    matters="1 to 5 % with one camera",
    confused_with="size of the device, amplitude of the drive",
    separated_by="a length known in the plane of the motion; distances between markers of one rigid panel",
)
