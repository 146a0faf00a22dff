"""Compliant ground: normal force of a spring and dashpot that can only push."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, rate: scalar, stiffness: scalar, damping: scalar):
    value = scalar(0.0)
    if gap < scalar(0.0):
        value = wp.max(-stiffness * gap - damping * rate, scalar(0.0))
    return value


@wp.func
def energy(gap: scalar, stiffness: scalar):
    depth = wp.min(gap, scalar(0.0))
    return scalar(0.5) * stiffness * depth * depth


EFFECT = Effect(
    name="ground",
    family="contact",
    force=force,
    energy=energy,
    parameters=(
        Parameter("stiffness", "kn", "N/m", 500.0, (0.0, math.inf), "keep weight / kn below 10 um"),
        Parameter("damping", "cn", "N s/m", 0.0, (0.0, math.inf), "2 zeta sqrt(kn m)"),
    ),
    stiffness=lambda p: p["stiffness"],
    damping=lambda p: p["damping"],
    formula="fn = max(-kn gap - cn dgap/dt, 0) while gap < 0",
    source="penalty contact; unilateral Kelvin-Voigt",
    matters="everything that stands or walks",
    confused_with="the sheet's own compliance",
    separated_by="glass plate as reference",
)
