"""Marker offset: beside the point of its panel that a marker stands for; it turns with the panel."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(
    read: Read, times: np.ndarray, offset_x: np.ndarray, offset_y: np.ndarray, offset_z: np.ndarray
) -> np.ndarray:
    """The marker's three components [n, 3, W]; read gives them, and after them those of the panel's three axes."""
    values = read(times)
    point, axes = values[:, :3], values[:, 3:]
    offset = np.stack(np.broadcast_arrays(offset_x, offset_y, offset_z))
    return point + np.einsum("kw,nkcw->ncw", offset, axes.reshape(len(axes), 3, 3, -1))


EFFECT = Effect(
    name="marker_offset",
    family="measurement",
    force=None,
    apply=apply,
    channels=("marker", "marker_2d"),
    on_body=True,
    parameters=(
        Parameter("offset_x", "dx", "m", 0.0, (-0.1, 0.1), "of the marker, along the model's x", typical=0.001),
        Parameter("offset_y", "dy", "m", 0.0, (-0.1, 0.1), "along the model's y", typical=0.0),
        Parameter("offset_z", "dz", "m", 0.0, (-0.1, 0.1), "along the model's z", typical=0.0),
    ),
    fitted=("offset_x", "offset_y", "offset_z"),
    formula="y = x + R d,  d in the model's axes where the panel is in the reference state, R the panel's turn since",
    source="rigid body; markers placed by hand, on the skin or the edge of a thick panel",
    matters="1 mm; it shows as the panel turns",
    confused_with="zero of the position, scale of lengths, rest angle",
    separated_by="a larger fold: the error turns with the panel; a second marker on it",
)
