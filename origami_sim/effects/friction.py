"""Coulomb friction with true stick: an elastic bristle that breaks at the friction limit."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def force(
    velocity: wp.vec3d,
    slip: wp.vec3d,
    normal: wp.vec3d,
    normal_load: scalar,
    coefficient: scalar,
    bristle: wp.vec3d,
    stiffness: scalar,
    damping: scalar,
):
    stretch = bristle + slip
    stretch = stretch - normal * wp.dot(normal, stretch)
    f = -stiffness * stretch - damping * velocity
    limit = coefficient * normal_load
    size = wp.length(f)
    if size > limit:  # slip: the bristle is left at the limit
        f = f * (limit / size)
        stretch = -f / stiffness
    if normal_load <= scalar(0.0):
        stretch = wp.vec3d(scalar(0.0), scalar(0.0), scalar(0.0))
    return f, stretch


EFFECT = Effect(
    name="friction",
    family="tangent",
    force=force,
    memory=(Memory("bristle", 3),),
    parameters=(
        Parameter("stiffness", "kt", "N/m", 500.0, (1e-9, math.inf), "tangential stiffness while sticking"),
        Parameter("damping", "ct", "N s/m", 0.0, (0.0, math.inf), "tangential dashpot while sticking"),
    ),
    stiffness=lambda p: p["stiffness"],
    damping=lambda p: p["damping"],
    formula="f = -kt s - ct v,  ds/dt = v while |f| < mu fn,  |f| = mu fn while slipping",
    source="Cundall & Strack 1979; elastic-plastic bristle, no creep while sticking",
    matters="everything that walks; regularised friction creeps and is not offered",
    confused_with="adhesion",
    separated_by="tilt test; vary the load",
)
