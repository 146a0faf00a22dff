"""Field misalignment: magnet and device are turned against each other by small angles."""

import numpy as np
from scipy.spatial.transform import Rotation

from origami_sim.drive import CHANNELS, Drive, series
from origami_sim.effects._effect import Effect, Parameter


def apply(drive: Drive, duration: float, turn_x: np.ndarray, turn_y: np.ndarray, turn_z: np.ndarray) -> Drive:
    """The field turned by the rotation vector (turn_x, turn_y, turn_z), its gradient with it."""
    turn = np.stack(np.broadcast_arrays(turn_x, turn_y, turn_z), axis=-1)
    if not np.any(turn) or all(drive[c].is_zero for c in CHANNELS[:12]):
        return drive
    r = Rotation.from_rotvec(turn).as_matrix()
    times, values = drive.series(CHANNELS[:12], duration)
    field = np.einsum("wij,jnw->inw", r, np.broadcast_to(values[:3], (3, len(times), max(len(r), values.shape[-1]))))
    gradient = values[3:].reshape(3, 3, *values.shape[1:])
    turned = {c: series(times, v) for c, v in zip(CHANNELS[:3], field, strict=True)}
    if np.any(gradient):
        gradient = np.einsum("wij,jknw,wlk->ilnw", r, np.broadcast_to(gradient, (3, 3, *field.shape[1:])), r)
        turned |= {
            c: series(times, v) for c, v in zip(CHANNELS[3:12], gradient.reshape(9, *field.shape[1:]), strict=True)
        }
    return drive.replace(**turned)


EFFECT = Effect(
    name="field_misalignment",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(
        Parameter("turn_x", "rx", "rad", 0.0, (-0.8, 0.8), "turn of the field about x", typical=0.05),
        Parameter("turn_y", "ry", "rad", 0.0, (-0.8, 0.8), "turn of the field about y", typical=0.05),
        Parameter("turn_z", "rz", "rad", 0.0, (-0.8, 0.8), "turn of the field about z", typical=0.05),
    ),
    fitted=("turn_x", "turn_y", "turn_z"),
    formula="B = R B_command,  R the rotation by (rx, ry, rz); grad B = R grad B R^T",
    source="rigid rotation of the magnet about the origin; device aligned by hand",
    matters="1 to 5 deg by hand: an even part ~ sin, saturation at 90 -+ that angle",
    confused_with="mountain-valley asymmetry, compliant dipoles, stiffening in the field",
    separated_by="rotate the magnet, not the device",
)
