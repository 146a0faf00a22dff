"""Asymmetric stiffness: a crease that is stiffer as a valley than as a mountain, or softer."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(angle: scalar, valley_stiffness: scalar, rest_angle: scalar):
    return -valley_stiffness * wp.max(angle - rest_angle, scalar(0.0))


@wp.func
def energy(angle: scalar, valley_stiffness: scalar, rest_angle: scalar):
    turn = wp.max(angle - rest_angle, scalar(0.0))
    return scalar(0.5) * valley_stiffness * turn * turn


EFFECT = Effect(
    name="crease_asymmetry",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "valley_stiffness", "Ka", "N m/rad", 0.0, (-10.0, 10.0),
            "stiffness added on the valley side; above minus the crease's own", typical=2e-4,
        ),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle where it changes", typical=0.0),
    ),
    fitted=("valley_stiffness",),
    stiffness=lambda p: np.abs(p["valley_stiffness"]),
    formula="M = -Ka max(theta - theta0, 0)",
    source="one-sided patches, notches and tapes: the two signs differ by 5-30 %",
    matters="folds of opposite sign differ under opposite drives: even in the drive",
    confused_with="a tilted field (smooth, as the cosine), particles that turn in the matrix",
    separated_by="turn the device over",
)  # fmt: skip
