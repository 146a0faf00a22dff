"""Axial dashpots in the bars, which calm the membrane without touching the folding."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def tension(rate: scalar, viscosity: scalar):
    return viscosity * rate


EFFECT = Effect(
    name="bar_viscosity",
    family="bar",
    force=tension,
    parameters=(Parameter("viscosity", "c", "N s/m", 0.0, (0.0, math.inf), "dashpot constant, 2 zeta sqrt(k m)"),),
    needs=("viscosity",),
    damping=lambda p: p["viscosity"],
    formula="T = c dL/dt",
    source="Kelvin-Voigt element; c is given as a ratio of critical for each bar",
    matters="membrane ringing after contact; set as a ratio of critical because it is the first to go unstable",
    confused_with="air drag, which acts on the panels' motion instead",
    separated_by="ring-down of in-plane modes",
)
