"""The plane that a camera sees: from the model's space to metres in the picture, and from pixels to the same metres."""

from dataclasses import dataclass

import numpy as np

from origami_sim.errors import InputError


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera far away, or a calibrated plane: parallel projection onto two axes.

    Attributes:
        origin: (3,) point of the model that is seen at the reading `zero` [m].
        axes: (2, 3) orthonormal directions in the model's space of the picture's right and up.
        scale: metres per unit of the readings [m/px], or 1 when the readings are lengths.
        zero: (2,) reading at which the origin is seen.
        flip: whether the second reading counts downwards, as the rows of a picture do.
    """

    origin: np.ndarray
    axes: np.ndarray
    scale: float = 1.0
    zero: tuple[float, float] = (0.0, 0.0)
    flip: bool = False

    def __post_init__(self) -> None:
        if self.axes.shape != (2, 3) or not np.allclose(self.axes @ self.axes.T, np.eye(2), atol=1e-6):
            raise InputError("the camera's axes must be two perpendicular directions of length 1", field="axes")
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InputError("the camera's scale must be positive", field="scale", value=self.scale)

    @classmethod
    def turned(cls, origin: np.ndarray, rotation: np.ndarray, **options) -> "Camera":
        """A camera whose right and up are the model's x and z, turned by a rotation vector (3,) [rad]."""
        return cls(origin=origin, axes=rotation_matrix(rotation)[:, [0, 2]].T, **options)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (..., 2) [m] in the picture of points (..., 3) of the model [m]."""
        return (points - self.origin) @ self.axes.T

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How far points (..., 3) of the model lie before the origin's plane, towards the camera, (...) [m]."""
        return (points - self.origin) @ np.cross(self.axes[0], self.axes[1])

    def metres(self, readings: np.ndarray) -> np.ndarray:
        """Coordinates (n, 2) [m] in the picture, up positive, of readings (n, 2) in the tracker's unit."""
        return self.scale * (readings - np.asarray(self.zero)) * np.array([1.0, -1.0 if self.flip else 1.0])


def rotation_matrix(rotation: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a rotation vector (3,) [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(rotation))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = rotation / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
