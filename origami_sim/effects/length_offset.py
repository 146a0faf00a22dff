"""Zero error of the position: what is read where the position is none."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(
    read: Read, times: np.ndarray, offset_x: np.ndarray, offset_y: np.ndarray, offset_z: np.ndarray
) -> np.ndarray:
    values = read(times)
    shift = np.stack(np.broadcast_arrays(offset_x, offset_y, offset_z))
    return values + shift[: values.shape[1]]


EFFECT = Effect(
    name="length_offset",
    family="measurement",
    force=None,
    apply=apply,
    channels=("marker", "marker_2d", "tip_displacement"),
    parameters=(
        Parameter("offset_x", "x0", "m", 0.0, (-1.0, 1.0), "constant added to the first component", typical=0.001),
        Parameter("offset_y", "y0", "m", 0.0, (-1.0, 1.0), "constant added to the second component", typical=0.0),
        Parameter("offset_z", "z0", "m", 0.0, (-1.0, 1.0), "constant added to the third component", typical=0.0),
    ),
    fitted=("offset_x", "offset_y", "offset_z"),
    formula="y = x + (x0, y0, z0), so many as the channel has components",
    source="origin of the image placed by hand; marker beside the point that it stands for",
    matters="1 mm",
    confused_with="rest angle, place of the clamp",
    separated_by="the undeformed device before the test",
)
