"""Poling error: a magnet that is poled in another direction than its model says."""

import math

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._magnet import MAGNET
from origami_sim.physics.materials import MU0


@wp.func
def first_axis(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d, poling_1: scalar, poling_2: scalar):
    # the poling's direction in the plane; of a magnet poled along the normal the first edge, so that it can lean too
    d = poling_1 * (x2 - x1) + poling_2 * (x3 - x1)
    if wp.length(d) == scalar(0.0):
        d = x2 - x1
    return wp.normalize(d)


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
    turn: scalar,
    lean: scalar,
):
    e1 = first_axis(x1, x2, x3, poling_1, poling_2)
    n = wp.normalize(wp.cross(x2 - x1, x3 - x1))
    p1 = poling_1
    p2 = poling_2
    if p1 == scalar(0.0) and p2 == scalar(0.0):
        p1 = scalar(1.0)
    rise = wp.asin(wp.clamp(poling_n, scalar(-1.0), scalar(1.0)))
    along = wp.cos(turn) * wp.cos(rise + lean) - wp.cos(rise)
    up = wp.cos(turn) * wp.sin(rise + lean) - poling_n
    aside = wp.sin(turn)
    none = scalar(0.0)
    one = scalar(1.0)
    # U = -m (along e1 + up n + aside n x e1) . B, by e1 with n held and by n with e1 held
    by_axis = along * field + aside * wp.cross(field, n)
    by_normal = up * field + aside * wp.cross(e1, field)
    out = nominal.force(x1, x2, x3, by_axis, remanence, volume, p1, p2, none)
    return out + nominal.force(x1, x2, x3, by_normal, remanence, volume, p1, p2, one)


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
    turn: scalar,
    lean: scalar,
):
    m = remanence * volume / scalar(MU0)
    e1 = first_axis(x1, x2, x3, poling_1, poling_2)
    n = wp.normalize(wp.cross(x2 - x1, x3 - x1))
    rise = wp.asin(wp.clamp(poling_n, scalar(-1.0), scalar(1.0)))
    poled = wp.cos(turn) * (wp.cos(rise + lean) * e1 + wp.sin(rise + lean) * n) + wp.sin(turn) * wp.cross(n, e1)
    return -m * wp.dot(field, poled - wp.cos(rise) * e1 - poling_n * n)


EFFECT = Effect(
    name="poling_error",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("turn", "phi", "rad", 0.0, (-math.pi, math.pi), "in the panel's plane about its normal", typical=0.1),
        Parameter("lean", "psi", "rad", 0.0, (-math.pi, math.pi), "out of the plane, towards the normal", typical=0.0),
    ),
    fitted=("turn", "lean"),
    formula=(
        "U = -m (u' - u) . B beside magnetic_torque,  u' = cos(phi) (cos(eps + psi) e1 + sin(eps + psi) n) + "
        "sin(phi) n x e1, with u = cos(eps) e1 + sin(eps) n"
    ),
    source="the moment of magnetic_torque (Danas & Reis 2024, arXiv 2403.03096), rigidly turned within its panel",
    matters="patches poled by hand in a magnet: 5 deg; cos(theta + psi) for cos(theta) shifts where torque ends",
    confused_with="direction of the field, rest angle, remanence: at one field direction they differ by the fold alone",
    separated_by="turn the field about the device; a patch alone on a thread turns until it is parallel to the field",
)
