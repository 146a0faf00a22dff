"""Membrane stiffness of the panels, carried by bars along the mesh edges."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def tension(length: scalar, stiffness: scalar, rest_length: scalar):
    return stiffness * (length - rest_length)


@wp.func
def energy(length: scalar, stiffness: scalar, rest_length: scalar):
    stretch = length - rest_length
    return scalar(0.5) * stiffness * stretch * stretch


EFFECT = Effect(
    name="bars",
    family="bar",
    force=tension,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "k", "N/m", 0.0, (0.0, math.inf), "axial stiffness E A / L0"),
        Parameter("rest_length", "L0", "m", 1.0, (0.0, math.inf), "unstressed length"),
    ),
    stiffness=lambda p: p["stiffness"],
    formula="T = k (L - L0),  U = k (L - L0)^2 / 2",
    source="bar-and-hinge model: Schenk & Guest 2011; Filipov, Liu, Tachi, Schenk & Paulino 2017",
    matters="keeps panels at their size; chosen stiff enough that membrane strain stays below a percent",
    confused_with="nothing at the angles seen; a soft membrane shows as panels that stretch",
    separated_by="distance between two markers of one panel under load",
)
