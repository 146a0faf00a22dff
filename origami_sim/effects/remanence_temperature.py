"""Temperature-dependent remanence: it falls as the magnet warms."""

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._magnet import MAGNET


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    temperature: scalar,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    remanence_slope: scalar,
):
    lost = wp.min(remanence_slope * temperature, scalar(1.0)) * remanence
    return nominal.force(x1, x2, x3, field, -lost, volume, poling_1, poling_2, poling_n)


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    temperature: scalar,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    remanence_slope: scalar,
):
    lost = wp.min(remanence_slope * temperature, scalar(1.0)) * remanence
    return nominal.energy(x1, x2, x3, field, -lost, volume, poling_1, poling_2, poling_n)


EFFECT = Effect(
    name="remanence_temperature",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("remanence_slope", "alpha", "1/K", 0.0, (0.0, 0.1), "relative loss per kelvin", typical=0.002),
    ),
    fitted=("remanence_slope",),
    formula="m = (1 - alpha T) Br V / mu0,  T the temperature rise; never reversed",
    source="reversible temperature coefficient of remanence: ferrite -0.2 %/K, NdFeB -0.12 %/K (makers' data sheets)",
    matters="10 % of the torque for 50 K; all amplitudes fall alike",
    confused_with="softening of the creases in the warmth (which makes angles larger), creep",
    separated_by="a thermostat; natural frequency at each temperature",
)
