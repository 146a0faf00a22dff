"""Loss of a panel that bends: a dashpot on every bending line."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(rate: scalar, viscosity: scalar):
    return -viscosity * rate


EFFECT = Effect(
    name="panel_viscosity",
    family="bend",
    force=moment,
    parameters=(Parameter("viscosity", "c", "N m s/rad", 0.0, (0.0, math.inf), "dashpot constant, 2 zeta sqrt(K I)"),),
    needs=("viscosity",),
    damping=lambda p: p["viscosity"],
    formula="M = -c dtheta/dt",
    source="Kelvin-Voigt plate on the bending lines of a panel",
    matters="panels that ring after an impact or a sudden start",
    confused_with="loss in the creases",
    separated_by="a panel struck with its creases clamped",
)
