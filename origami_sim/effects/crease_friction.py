"""Dry friction: of a crease, an elastic bristle that yields at a moment and then slides, at any rate alike."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def moment(turn: scalar, bristle: scalar, friction_moment: scalar, yield_angle: scalar):
    stretch = wp.clamp(bristle + turn, -yield_angle, yield_angle)
    return -friction_moment * stretch / yield_angle, stretch


EFFECT = Effect(
    name="crease_friction",
    family="crease",
    force=moment,
    memory=(Memory("bristle"),),
    parameters=(
        Parameter("friction_moment", "Mf", "N m", 0.0, (0.0, math.inf), "moment while sliding", typical=1e-4),
        Parameter("yield_angle", "s0", "rad", 0.01, (1e-6, 0.03), "turn to sliding; beyond: hysteresis", typical=0.01),
    ),
    fitted=("friction_moment", "yield_angle"),
    stiffness=lambda p: p["friction_moment"] / p["yield_angle"],
    formula="M = -Mf s / s0,  ds/dt = dtheta/dt while |s| < s0, else 0",
    source="Prandtl's elastic-plastic element (Coulomb friction with true stick), exact at any step",
    matters="layers, leads or pins that rub: dead band at small drive, a loop whose width does not know the rate",
    confused_with="viscous loss (width grows with the rate), relaxation, lag of the drive",
    separated_by="cycles at a hundredth of the rate; ring-down decays linearly instead of exponentially",
)
