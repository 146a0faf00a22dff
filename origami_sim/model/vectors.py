"""Products of vectors in space."""

import numpy as np


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product (..., 3) of vectors a and b (..., 3), which broadcast.

    As `numpy.cross`, which takes four times as long for a few vectors.
    """
    (a0, a1, a2), (b0, b1, b2) = (a[..., 0], a[..., 1], a[..., 2]), (b[..., 0], b[..., 1], b[..., 2])
    first = a1 * b2 - a2 * b1
    out = np.empty((*first.shape, 3))
    out[..., 0], out[..., 1], out[..., 2] = first, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return out
