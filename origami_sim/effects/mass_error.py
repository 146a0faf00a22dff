"""Mass error: a panel that is heavier or lighter than its model says, in weight and in inertia."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._weight import GRAVITY


@wp.func
def force(mass: scalar, mass_gain: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return mass_gain * mass * wp.vec3d(gravity_x, gravity_y, gravity_z)


@wp.func
def energy(x: wp.vec3d, mass: scalar, mass_gain: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return -mass_gain * mass * wp.dot(wp.vec3d(gravity_x, gravity_y, gravity_z), x)


EFFECT = Effect(
    name="mass_error",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    inertia=lambda p: p["mass_gain"] * p["mass"],
    parameters=(
        Parameter("mass_gain", "e", "-", 0.0, (-0.9, 9.0), "relative error of the mass", typical=0.1),
        *GRAVITY,
    ),
    fitted=("mass_gain",),
    formula="m' = (1 + e) m: f = e m g beside gravity, and (1 + e) m in place of m in m a = f",
    source="Newton's second law; equality of heavy and inertial mass",
    matters="density of a filled elastomer 5 to 10 %, glue and paint some per cent: a chain swings as (1 + e) says",
    confused_with="gravity and stiffness, which change a period too; a mass at the panel's edge; a length",
    separated_by="a balance; a static sag changes with weight alone, a period without gravity with inertia alone",
)
