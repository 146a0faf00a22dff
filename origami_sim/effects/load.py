"""A force of fixed direction on a node, scaled by the drive's load factor."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(load: scalar, force_x: scalar, force_y: scalar, force_z: scalar):
    return load * wp.vec3d(force_x, force_y, force_z)


@wp.func
def energy(x: wp.vec3d, load: scalar, force_x: scalar, force_y: scalar, force_z: scalar):
    return -load * wp.dot(x, wp.vec3d(force_x, force_y, force_z))


EFFECT = Effect(
    name="load",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    parameters=tuple(
        Parameter(f"force_{a}", f"F{a}", "N", 0.0, (-math.inf, math.inf), f"force on {a} at unit load") for a in "xyz"
    ),
    formula="f = load(t) F",
    source="dead load",
    matters="weights hung on a sheet, test machines, snap-through studies",
)
