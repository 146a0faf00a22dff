"""Magnetic stiffening: a crease of a magnetic elastomer is stiffer, or softer, in a field."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def added(field: wp.vec3d, stiffness: scalar, field_gain: scalar, half_field: scalar):
    b2 = wp.dot(field, field)
    return stiffness * field_gain * b2 / (b2 + half_field * half_field)


@wp.func
def moment(
    angle: scalar, field: wp.vec3d, stiffness: scalar, rest_angle: scalar, field_gain: scalar, half_field: scalar
):
    return -added(field, stiffness, field_gain, half_field) * (angle - rest_angle)


@wp.func
def energy(
    angle: scalar, field: wp.vec3d, stiffness: scalar, rest_angle: scalar, field_gain: scalar, half_field: scalar
):
    turn = angle - rest_angle
    return scalar(0.5) * added(field, stiffness, field_gain, half_field) * turn * turn


EFFECT = Effect(
    name="field_stiffening",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "that of the crease without field"),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "that of the crease"),
        Parameter(
            "field_gain", "g", "-", 0.0, (-0.9, 10.0), "relative change of stiffness in a strong field", typical=1.0
        ),
        Parameter("half_field", "Bh", "T", 0.2, (1e-6, 5.0), "field at which half of the change is reached"),
    ),
    fitted=("field_gain",),
    stiffness=lambda p: p["stiffness"] * np.abs(p["field_gain"]),
    formula="M = -K g B^2 / (B^2 + Bh^2) (theta - theta0)",
    source="magnetorheological effect, Jolly, Carlson & Munoz 1996: quadratic in B, then saturated",
    matters="0 to 5 % for remanent particles at 0.2 T, for iron tens of percent in rubber, up to three times in "
    "soft elastomers (a mean-field model, arXiv:2501.09353); even in B",
    confused_with="compliant dipoles, misaligned field, mountain-valley asymmetry",
    separated_by="natural frequency against a field along the magnetisation",
)
