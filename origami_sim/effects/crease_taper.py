"""Taper: the stiffness of a beam changes evenly from its first to its last end."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(angle: scalar, taper: scalar, stiffness: scalar, rest_angle: scalar, along: scalar):
    return -taper * along * stiffness * (angle - rest_angle)


@wp.func
def energy(angle: scalar, taper: scalar, stiffness: scalar, rest_angle: scalar, along: scalar):
    turn = angle - rest_angle
    return scalar(0.5) * taper * along * stiffness * turn * turn


EFFECT = Effect(
    name="crease_taper",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "taper", "tau", "-", 0.0, (-2.0, 2.0),
            "stiffness at the last end less that at the first, over the crease's own; at most 2, which leaves none at "
            "one end", typical=0.2,
        ),
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "that of the crease"),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "that of the crease", typical=0.0),
        Parameter(
            "along", "s", "-", 0.0, (-0.5, 0.5), "place along the beam: -1/2 at its first end, 1/2 at its last",
            typical=0.5,
        ),
    ),
    fitted=("taper",),
    stiffness=lambda p: np.abs(p["taper"] * p["along"] * p["stiffness"]),
    formula="M = -tau s K (theta - theta0)",
    source="K ~ h^3: a mould that is 2 % thicker at one end and 2 % thinner at the other makes 12 %",
    matters="a beam bends more towards one end than a uniform one, at every drive by the same factor",
    confused_with="a softer or stiffer stretch, remanence that varies along the beam",
    separated_by="the shape of the bent beam: markers along it; thickness measured at both ends",
)  # fmt: skip
