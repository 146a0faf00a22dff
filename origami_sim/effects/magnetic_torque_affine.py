"""Torque on a remanent panel whose magnetisation is carried along by the whole deformation gradient."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows
from origami_sim.physics.materials import MU0


@wp.func
def force(field: wp.vec3d, remanence: scalar, volume: scalar, poling_1: scalar, poling_2: scalar):
    m = remanence * volume / scalar(MU0)
    f2 = (m * poling_1) * field
    f3 = (m * poling_2) * field
    return corner_rows(-f2 - f3, f2, f3)


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
):
    m = remanence * volume / scalar(MU0)
    return -m * wp.dot(field, poling_1 * (x2 - x1) + poling_2 * (x3 - x1))


EFFECT = Effect(
    name="magnetic_torque_affine",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("remanence", "Br", "T", 0.0, (-2.0, 2.0), "remanent flux density at rest"),
        Parameter("volume", "V", "m^3", 0.0, (0.0, math.inf), "volume of magnet carried by this triangle"),
        Parameter("poling_1", "a", "1/m", 0.0, (-math.inf, math.inf), "unit poling vector along the first edge"),
        Parameter("poling_2", "b", "1/m", 0.0, (-math.inf, math.inf), "unit poling vector along the second edge"),
    ),
    formula="U = -(V / mu0) F Br . B",
    source="Zhao, Kim, Cheng, Liu & Zhao 2019 (F-based magnetisation)",
    matters="for comparison: differs from the rotation-based law by the membrane stretch, below 3 % here",
    confused_with="remanence",
    separated_by="elongation of a strip in a field along its poling",
)
