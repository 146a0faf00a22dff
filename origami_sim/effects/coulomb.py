"""Coulomb friction: of the ground, the same in all directions."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def coefficient(friction_coefficient: scalar):
    return friction_coefficient


EFFECT = Effect(
    name="coulomb",
    family="coefficient",
    force=coefficient,
    parameters=(
        Parameter("friction_coefficient", "mu", "-", 0.0, (0.0, 5.0), "Coulomb friction coefficient", typical=0.5),
    ),
    fitted=("friction_coefficient",),
    formula="|ft| <= mu fn",
    source="Coulomb 1785",
    matters="every foot; rubber 0.3-1.2",
    confused_with="adhesion, tilt",
    separated_by="tilt test",
)
