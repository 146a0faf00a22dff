"""Ground compliance: a soft layer, or pads under the feet, that bears the weight before the hard ground does."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, layer_stiffness: scalar, reach: scalar):
    return layer_stiffness * wp.max(reach - gap, scalar(0.0))


@wp.func
def energy(gap: scalar, layer_stiffness: scalar, reach: scalar):
    depth = wp.max(reach - gap, scalar(0.0))
    return scalar(0.5) * layer_stiffness * depth * depth


EFFECT = Effect(
    name="ground_compliance",
    family="contact",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("layer_stiffness", "kl", "N/m", 0.0, (0.0, math.inf), "of the layer under one foot", typical=30.0),
        Parameter("reach", "t", "m", 1e-3, (1e-6, 0.1), "thickness of the layer", typical=1e-3),
    ),
    fitted=("layer_stiffness", "reach"),
    stiffness=lambda p: p["layer_stiffness"],
    formula="fn = kl max(t - gap, 0), beside the hard ground at gap 0",
    source="elastic layer (Winkler); rubber mat, paper, dust: 1e3 to 1e5 N/m per foot, felt far less",
    matters="smaller stride, later lift-off, feet that sink by the weight over kl",
    confused_with="the sheet's own compliance, adhesion",
    separated_by="glass plate as reference",
)
