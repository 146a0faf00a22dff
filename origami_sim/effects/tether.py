"""Tether: leads or threads that hold a node of the device to a place in the room."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(x: wp.vec3d, stiffness: scalar, anchor_x: scalar, anchor_y: scalar, anchor_z: scalar):
    return stiffness * (wp.vec3d(anchor_x, anchor_y, anchor_z) - x)


@wp.func
def energy(x: wp.vec3d, stiffness: scalar, anchor_x: scalar, anchor_y: scalar, anchor_z: scalar):
    way = x - wp.vec3d(anchor_x, anchor_y, anchor_z)
    return scalar(0.5) * stiffness * wp.dot(way, way)


EFFECT = Effect(
    name="tether",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "k", "N/m", 0.0, (0.0, math.inf), "stiffness of the lead at this node", typical=0.1),
        *(
            Parameter(f"anchor_{a}", f"a{a}", "m", 0.0, (-1e3, 1e3), f"{a} of the node when the lead is slack",
                      typical=0.0)
            for a in "xyz"
        ),
    ),
    fitted=("stiffness",),
    stiffness=lambda p: p["stiffness"],
    formula="f = k (a - x)",
    source="end stiffness of a loose lead, 3 E I / L^3: 0.1 N/m for 16 um x 5 mm of aluminium foil, 15 mm long",
    matters="seven leads carry 9 % of a thin bender's stiffness; a crawler pulls its wires along",
    confused_with="stiffening electrodes, friction",
    separated_by="cut a lead; drive it without wires",
)  # fmt: skip
