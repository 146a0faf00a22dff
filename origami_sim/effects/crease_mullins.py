"""Mullins softening: of a crease, by the largest fold that it has seen."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def moment(angle: scalar, largest: scalar, virgin_stiffness: scalar, softening_angle: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    new = wp.max(largest, wp.abs(turn))
    return -virgin_stiffness * turn * softening_angle / (softening_angle + new), new


EFFECT = Effect(
    name="crease_mullins",
    family="crease",
    force=moment,
    memory=(Memory("largest"),),
    parameters=(
        Parameter(
            "virgin_stiffness", "Kv", "N m/rad", 0.0, (0.0, math.inf), "stiffness that folding destroys", typical=3e-4
        ),
        Parameter("softening_angle", "s", "rad", 0.3, (0.01, 10.0), "largest fold that halves it", typical=0.3),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle from which folds count", typical=0.0),
    ),
    fitted=("virgin_stiffness", "softening_angle"),
    stiffness=lambda p: p["virgin_stiffness"],
    formula="M = -Kv phi s / (s + largest |phi| so far),  phi = theta - theta0",
    source="damage by the largest past strain (Mullins 1969; Ogden & Roxburgh 1999), beside the stiffness that lasts",
    matters="filled elastomers lose 10-40 % of their stiffness on the first fold; not recovered in minutes",
    confused_with="creep (recovers); debonding",
    separated_by="cycles of growing amplitude: only new maxima change anything; first cycle against second",
)
