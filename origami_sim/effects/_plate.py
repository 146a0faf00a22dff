"""Stiffness matrices of sheets: six numbers that weigh strains or curvatures 11, 22 and twice 12."""

import math
from collections.abc import Mapping

import numpy as np
import warp as wp

from origami_sim.effects._effect import Parameter, scalar

COMPONENTS = ("11", "22", "12", "66", "16", "26")
"""Entries of the matrix that are parameters; 6 stands for the shear (Jones 1999, Mechanics of Composite Materials)."""


@wp.func
def weighed(k: wp.vec3d, s11: scalar, s22: scalar, s12: scalar, s66: scalar, s16: scalar, s26: scalar):
    return wp.vec3d(
        s11 * k[0] + s12 * k[1] + s16 * k[2],
        s12 * k[0] + s22 * k[1] + s26 * k[2],
        s16 * k[0] + s26 * k[1] + s66 * k[2],
    )


def stiffnesses(symbol: str, unit: str, meaning: str) -> tuple[Parameter, ...]:
    """The six parameters of a symmetric matrix, zero at first."""
    low = {"11": 0.0, "22": 0.0, "66": 0.0}
    return tuple(
        Parameter(f"stiffness_{c}", symbol + c, unit, 0.0, (low.get(c, -math.inf), math.inf), f"{meaning} {c}")
        for c in COMPONENTS
    )


def matrix(parameters: Mapping[str, np.ndarray]) -> np.ndarray:
    """The matrices [..., 3, 3] of parameters [...]."""
    a, b, c, d, e, f = (np.asarray(parameters[f"stiffness_{k}"]) for k in COMPONENTS)
    return np.stack([np.stack(r, axis=-1) for r in ((a, c, e), (c, b, f), (e, f, d))], axis=-2)


def largest(parameters: Mapping[str, np.ndarray]) -> np.ndarray:
    """Largest stiffness of any strain of unit norm (11^2 + 22^2 + 2 12^2): an eigenvalue in Mandel's notation."""
    scale = np.sqrt([1.0, 1.0, 2.0])
    return np.abs(np.linalg.eigvalsh(matrix(parameters) * scale[:, None] * scale)).max(axis=-1)
