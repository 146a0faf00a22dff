"""Bending of a panel about the lines that triangulate it."""

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
    name="panel_bending",
    family="bend",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "k", "N m/rad", 0.0, (0.0, math.inf), "stiffness of one bending line"),
        Parameter("rest_angle", "phi0", "rad", 0.0, (-math.pi, math.pi), "angle without moment"),
    ),
    stiffness=lambda p: p["stiffness"],
    formula="M = -k (phi - phi0),  k = D e^2 / (A1 + A2),  D = E t^3 / (12 (1 - nu^2))",
    source="plate hinges on the two triangles of areas A1, A2 that share the line of length e",
    matters="thin or soft panels under magnetic torque: 3 deg over a box flap at 0.2 T",
    confused_with="crease softness",
    separated_by="image of the panel's shape",
)
