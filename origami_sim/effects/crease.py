"""Linear elastic crease."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(angle: scalar, stiffness: scalar, rest_angle: scalar):
    return -stiffness * (angle - rest_angle)


@wp.func
def energy(angle: scalar, stiffness: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    return scalar(0.5) * stiffness * turn * turn


EFFECT = Effect(
    name="crease",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "rotational stiffness of the whole crease"),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle without moment, valley positive"),
    ),
    stiffness=lambda p: p["stiffness"],
    formula="M = -K (theta - theta0),  K = E' w h^3 / (12 L*),  L* = g + 2 c h for an elastomer bridge of gap g",
    source="Schenk & Guest 2011; bridge length from plane finite elements (c = 0.66 for patches of 0.78 MPa)",
    matters="sets every fold angle",
    confused_with="a constant factor in the drive (remanence, permittivity), thickness tolerance",
    separated_by="passive torque-angle test; natural frequency",
)
