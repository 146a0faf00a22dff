"""Field of a magnetic dipole, shared by the composed kernels."""

import math

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.materials import MU0

scalar = wp.float64

_SCALE = MU0 / (4.0 * math.pi)


@wp.func
def dipole_field(r: wp.vec3d, moment: wp.vec3d):
    """Flux density [T] at r [m] from a dipole of that moment [A m^2] (Jackson 1999, eq. 5.56)."""
    square = wp.dot(r, r)
    along = scalar(3.0) * wp.dot(moment, r) / square
    return (scalar(_SCALE) / (square * wp.sqrt(square))) * (along * r - moment)


@wp.func
def dipole_gradient(r: wp.vec3d, moment: wp.vec3d):
    """Its gradient dB_i/dx_j [T/m], symmetric and without trace."""
    square = wp.dot(r, r)
    along = wp.dot(moment, r)
    both = wp.outer(moment, r) + wp.outer(r, moment) - (scalar(5.0) * along / square) * wp.outer(r, r)
    both += along * wp.identity(n=3, dtype=scalar)
    return (scalar(3.0) * scalar(_SCALE) / (square * square * wp.sqrt(square))) * both
