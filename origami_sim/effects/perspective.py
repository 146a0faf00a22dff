"""Camera perspective: of a near camera, so that what comes towards it looks larger."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read

NEAREST = 0.05
"""Part of the distance to the camera at which a point is seen at the least; nothing is behind the camera."""


def apply(
    read: Read, times: np.ndarray, nearness: np.ndarray, centre_right: np.ndarray, centre_up: np.ndarray
) -> np.ndarray:
    """Right and up [n, 2 or 3, W] of a picture, scaled about its centre; the third, towards the camera, stays."""
    values = read(times)
    if values.shape[1] < 3:  # no depth is known: all in the plane of the ruler
        return values
    larger = 1.0 / np.maximum(1.0 - nearness * values[:, 2], NEAREST) - 1.0
    centre = np.stack(np.broadcast_arrays(centre_right, centre_up))
    seen = values.copy()
    seen[:, :2] += (values[:, :2] - centre) * larger[:, None]
    return seen


EFFECT = Effect(
    name="perspective",
    family="measurement",
    force=None,
    apply=apply,
    channels=("marker_2d",),
    parameters=(
        Parameter("nearness", "1/d", "1/m", 0.0, (0.0, 10.0), "inverse of the camera's distance", typical=1.0),
        Parameter("centre_right", "cx", "m", 0.0, (-2.0, 2.0), "place that the camera faces, right", typical=0.0),
        Parameter("centre_up", "cy", "m", 0.0, (-2.0, 2.0), "place that the camera faces, up", typical=0.0),
    ),
    fitted=("nearness", "centre_right", "centre_up"),
    formula="y = c + (x - c) / (1 - z / d),  z towards the camera from the plane of the ruler",
    source="pinhole camera (Hartley & Zisserman, Multiple View Geometry, 2004, ch. 6) that faces the point c",
    matters="10 mm towards a camera at 1 m are 1 %; folds that leave the plane of the picture",
    confused_with="length scale, tilt of the camera, stiffness of folds that come towards it",
    separated_by="a longer lens from farther away; the device turned about the plumb line",
)
