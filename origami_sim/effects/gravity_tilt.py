"""Gravity tilt: it does not point where it was said, as on a tilted table or where a body floats in part."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

G = 9.80665


@wp.func
def force(mass: scalar, tilt_x: scalar, tilt_y: scalar, tilt_z: scalar):
    return mass * scalar(G) * wp.vec3d(tilt_x, tilt_y, tilt_z)


@wp.func
def energy(x: wp.vec3d, mass: scalar, tilt_x: scalar, tilt_y: scalar, tilt_z: scalar):
    return -mass * scalar(G) * wp.dot(x, wp.vec3d(tilt_x, tilt_y, tilt_z))


EFFECT = Effect(
    name="gravity_tilt",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("tilt_x", "ex", "rad", 0.0, (-3.0, 3.0), "lean of gravity towards x", typical=0.02),
        Parameter("tilt_y", "ey", "rad", 0.0, (-3.0, 3.0), "lean of gravity towards y", typical=0.0),
        Parameter("tilt_z", "ez", "rad", 0.0, (-3.0, 3.0), "lean towards z, or share of weight borne", typical=0.0),
    ),
    fitted=("tilt_x", "tilt_y"),
    across="gravity",
    needs=("tilt_x", "tilt_y", "tilt_z"),
    formula="f = m g0 (ex, ey, ez), beside gravity",
    source="small angles, across gravity; along it, Archimedes",
    matters="1 degree acts as 0.017 of friction coefficient: drift in a direction fixed to the room; folds that lean",
    confused_with="directional feet (fixed to the body), rest angle, field gradient",
    separated_by="turn the device on the table; turn the table",
)
