"""Remanence error: a magnet that is stronger or weaker than its model says."""

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
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    remanence_gain: scalar,
):
    return nominal.force(x1, x2, x3, field, remanence_gain * remanence, volume, poling_1, poling_2, poling_n)


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    remanence_gain: scalar,
):
    return nominal.energy(x1, x2, x3, field, remanence_gain * remanence, volume, poling_1, poling_2, poling_n)


EFFECT = Effect(
    name="remanence_error",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("remanence_gain", "e", "-", 0.0, (-1.0, 3.0), "relative error of the moment", typical=0.1),
    ),
    fitted=("remanence_gain",),
    uneven=True,
    formula="U = -e m . B, beside -m . B of magnetic_torque",
    source="rigid moment of another size; demagnetising field: M = Mr + chi (H - N M), Joseph & Schloemann 1965",
    matters="weak magnetising field, volume fraction, demagnetising factor (-0.3 to -2 % in plane)",
    confused_with="crease stiffness, modulus, calibration of the field: constant factors",
    separated_by="natural frequency, a known weight; samples of other aspect ratio; a Hall probe at the patch",
)
