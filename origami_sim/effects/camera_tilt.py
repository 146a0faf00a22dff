"""Camera tilt: its axes are turned against those of the device."""

import numpy as np
from scipy.spatial.transform import Rotation

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, tilt_x: np.ndarray, tilt_y: np.ndarray, tilt_z: np.ndarray) -> np.ndarray:
    """Positions turned by the rotation vector (tilt_x, tilt_y, tilt_z); without a depth only tilt_z is seen."""
    values = read(times)
    tilt = np.stack(np.broadcast_arrays(tilt_x, tilt_y, tilt_z), axis=-1)
    if values.shape[1] == 2:
        tilt = tilt * [0.0, 0.0, 1.0]
    size = values.shape[1]
    r = Rotation.from_rotvec(tilt).as_matrix()[:, :size, :size]
    return np.einsum("wij,njw->niw", r, np.broadcast_to(values, (*values.shape[:2], len(r))))


EFFECT = Effect(
    name="camera_tilt",
    family="measurement",
    force=None,
    apply=apply,
    channels=("marker", "marker_2d"),
    parameters=(
        Parameter("tilt_z", "rz", "rad", 0.0, (-0.8, 0.8), "turn about z", typical=0.03),
        Parameter("tilt_y", "ry", "rad", 0.0, (-0.8, 0.8), "turn about y", typical=0.0),
        Parameter("tilt_x", "rx", "rad", 0.0, (-0.8, 0.8), "turn about x", typical=0.0),
    ),
    fitted=("tilt_z", "tilt_y", "tilt_x"),
    formula="y = R x,  R the rotation by (rx, ry, rz) about the origin",
    source="rigid transform between camera and device axes",
    matters="1 to 3 deg by hand",
    confused_with="tilted ground, misaligned field, direction of gravity",
    separated_by="a plumb line or the flat device in the picture",
)
