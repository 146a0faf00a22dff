"""Dry friction between panels: an elastic bristle that goes with both and breaks at the friction limit."""

import math

import warp as wp

from origami_sim.effects import friction as ground
from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def force(
    velocity: wp.vec3d,
    slip: wp.vec3d,
    normal: wp.vec3d,
    normal_load: scalar,
    bristle: wp.vec3d,
    friction_coefficient: scalar,
    stiffness: scalar,
    damping: scalar,
):
    return ground.force(velocity, slip, normal, normal_load, friction_coefficient, bristle, stiffness, damping)


EFFECT = Effect(
    name="touch_friction",
    family="rub",
    force=force,
    # two lists of a label and two numbers for each pair that touches, and which of them is the present one
    memory=(Memory("bristle", size=2 * 3 * 4, base=2 + 2 * 3 * 32),),
    parameters=(
        Parameter("friction_coefficient", "mu", "-", 0.0, (0.0, 5.0), "Coulomb friction coefficient", typical=0.5),
        Parameter("stiffness", "kt", "N/m", 500.0, (1e-9, math.inf), "tangential stiffness while sticking"),
        Parameter("damping", "ct", "N s/m", 0.0, (0.0, math.inf), "tangential dashpot while sticking"),
    ),
    fitted=("friction_coefficient",),
    stated=("stiffness",),
    stiffness=lambda p: p["stiffness"] * (p["friction_coefficient"] > 0),
    damping=lambda p: p["damping"] * (p["friction_coefficient"] > 0),
    formula="f = -kt s - ct v,  ds/dt = v while |f| < mu fn,  |f| = mu fn while slipping; s turns with the pair",
    source="as the ground's friction; Cundall & Strack 1979",
    matters="stacks and packed folds that hold or slide; loss where panels rub",
    confused_with="coulomb at the ground, crease_friction",
    separated_by="tilt one panel with another on it until that slides: tan(angle) = mu",
)
