"""What the laws of remanent panels have in common."""

import math

import warp as wp

from origami_sim.effects._effect import Parameter, scalar


@wp.func
def poled(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d, poling_1: scalar, poling_2: scalar, poling_n: scalar):
    """Unit vector of the magnetisation, carried by the rotation of the panel."""
    share = wp.sqrt(wp.max(scalar(1.0) - poling_n * poling_n, scalar(0.0)))
    in_plane = wp.normalize(poling_1 * (x2 - x1) + poling_2 * (x3 - x1))
    return share * in_plane + poling_n * wp.normalize(wp.cross(x2 - x1, x3 - x1))


@wp.func
def along_poling(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
):
    """Component of the field along the unit poling vector [T]."""
    return wp.dot(field, poled(x1, x2, x3, poling_1, poling_2, poling_n))


MAGNET = (
    Parameter("remanence", "Br", "T", 0.0, (-2.0, 2.0), "as for magnetic_torque"),
    Parameter("volume", "V", "m^3", 0.0, (0.0, math.inf), "volume of magnet carried by this triangle"),
    Parameter("poling_1", "a", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the first edge x2 - x1"),
    Parameter("poling_2", "b", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the second edge x3 - x1"),
    Parameter("poling_n", "c", "-", 0.0, (-1.0, 1.0), "share of the unit poling vector along the normal"),
)
"""The magnet of a panel. A suspect that is added to a model takes over the values of its `magnetic_torque`: parameters
that are not fitted are copied from an effect of the same family that has one of the same name."""
