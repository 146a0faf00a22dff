"""Permanent set: the largest folds of the past shift the rest angle of a crease."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def moment(angle: scalar, valley: scalar, mountain: scalar, set_stiffness: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    most = wp.max(valley, turn)
    least = wp.min(mountain, turn)
    return set_stiffness * (most + least), most, least


EFFECT = Effect(
    name="crease_set",
    family="crease",
    force=moment,
    memory=(Memory("valley"), Memory("mountain")),
    parameters=(
        Parameter(
            "set_stiffness", "Ks", "N m/rad", 0.0, (0.0, math.inf),
            "stiffness times the share of a fold that stays; below the crease's own", typical=1e-4,
        ),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle from which folds count", typical=0.0),
    ),
    fitted=("set_stiffness",),
    stiffness=lambda p: np.abs(p["set_stiffness"]),
    formula="M = Ks (max(phi, 0) + min(phi, 0)), of phi = theta - theta0 so far; shifts the rest angle by M / K",
    source="plastic set in proportion to the largest fold, 1-5 % of it for rubbers and more for paper and tape",
    matters="an offset at zero drive, of the sign of the larger fold, that stays after rest",
    confused_with="gravity, swelling, rest angle read wrongly",
    separated_by="leave for a day; fold as far to the other side; turn the set-up",
)  # fmt: skip
