"""Gravity: weight of the nodes."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(mass: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return mass * wp.vec3d(gravity_x, gravity_y, gravity_z)


@wp.func
def energy(x: wp.vec3d, mass: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return -mass * wp.dot(wp.vec3d(gravity_x, gravity_y, gravity_z), x)


EFFECT = Effect(
    name="gravity",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("gravity_x", "gx", "m/s^2", 0.0, (-10.0, 10.0), "acceleration of gravity along x", typical=0.0),
        Parameter("gravity_y", "gy", "m/s^2", 0.0, (-10.0, 10.0), "acceleration of gravity along y", typical=0.0),
        Parameter(
            "gravity_z", "gz", "m/s^2", -9.80665, (-10.0, 10.0), "acceleration of gravity along z", typical=-9.80665
        ),
    ),
    fitted=("gravity_z", "gravity_x", "gravity_y"),
    formula="f = m g",
    source="-",
    matters="1 % of the torque on a box flap at 0.2 T, 20 % at 10 mT; 1.5 times the stiffness of the cantilever",
    confused_with="rest-angle drift, magnetic dipole offset at zero field",
    separated_by="turn the set-up by 90 and 180 degrees",
)
