"""Stiffness error: a crease that is softer or stiffer than thought, by debonding, thickness or electrodes."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(angle: scalar, stiffness_change: scalar, rest_angle: scalar):
    return -stiffness_change * (angle - rest_angle)


@wp.func
def energy(angle: scalar, stiffness_change: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    return scalar(0.5) * stiffness_change * turn * turn


EFFECT = Effect(
    name="crease_softness",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "stiffness_change", "dK", "N m/rad", 0.0, (-10.0, 10.0),
            "added to the crease's stiffness; above minus that", typical=-2e-4, takes="crease.stiffness",
        ),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "that of the crease", typical=0.0),
    ),
    fitted=("stiffness_change",),
    uneven=True,
    stiffness=lambda p: np.abs(p["stiffness_change"]),
    formula="M = -dK (theta - theta0)",
    source="K ~ h^3: 5 % of thickness are 15 %; a layer of grease or tape doubles D; debonding lengthens the bridge",
    matters="one crease folds more than its neighbours, at every drive by the same factor",
    confused_with="plane-strain factor, remanence, permittivity: every constant factor of the drive",
    separated_by="passive torque-angle test; natural frequency; look for a crack along the patch",
)  # fmt: skip
