"""Friction error: a foot that rubs more or less than its model says, alike in all directions."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def coefficient(
    direction: wp.vec3d,
    axis: wp.vec3d,
    friction_coefficient: scalar,
    backward_excess: scalar,
    friction_gain: scalar,
):
    backward = wp.max(-wp.dot(direction, axis), scalar(0.0))
    return friction_gain * (friction_coefficient + backward_excess * backward)


EFFECT = Effect(
    name="friction_error",
    family="coefficient",
    force=coefficient,
    parameters=(
        Parameter("friction_coefficient", "mu_f", "-", 0.0, (0.0, 5.0), "Coulomb friction coefficient forward"),
        Parameter("backward_excess", "dmu", "-", 0.0, (0.0, 5.0), "mu backward minus mu forward"),
        Parameter("friction_gain", "e", "-", 0.0, (-1.0, 5.0), "relative error of the coefficient", typical=0.3),
    ),
    fitted=("friction_gain",),
    stated=("backward_excess",),
    formula="mu = e (mu_f + dmu max(-s . axis, 0)) beside coulomb and directional_friction",
    source="feet of the same form on another surface, or worn",
    matters="a crawler with one foot that slides where both should",
    confused_with="coulomb or directional_friction alone, ground tilt, the weight on the foot",
    separated_by="tilt test of each foot, forward and backward; swap the feet",
)
