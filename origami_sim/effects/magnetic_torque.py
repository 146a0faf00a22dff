"""Torque of a field on a remanent panel, magnetisation carried by the rotation only."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows, normal_gradients
from origami_sim.physics.materials import MU0


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
):
    m = remanence * volume / scalar(MU0)
    d = poling_1 * (x2 - x1) + poling_2 * (x3 - x1)
    length = wp.length(d)
    in_plane = wp.vec3d(scalar(0.0), scalar(0.0), scalar(0.0))
    if length > scalar(0.0):
        u = d / length
        share = wp.sqrt(wp.max(scalar(1.0) - poling_n * poling_n, scalar(0.0)))
        in_plane = (m * share / length) * (field - u * wp.dot(u, field))
    f2 = poling_1 * in_plane
    f3 = poling_2 * in_plane
    f1 = -f2 - f3
    if poling_n != scalar(0.0):
        t = normal_gradients(x1, x2, x3)
        f1 -= (m * poling_n * wp.dot(field, t.g1)) * t.n
        f2 -= (m * poling_n * wp.dot(field, t.g2)) * t.n
        f3 -= (m * poling_n * wp.dot(field, t.g3)) * t.n
    return corner_rows(f1, f2, f3)


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
):
    m = remanence * volume / scalar(MU0)
    d = poling_1 * (x2 - x1) + poling_2 * (x3 - x1)
    share = wp.sqrt(wp.max(scalar(1.0) - poling_n * poling_n, scalar(0.0)))
    n = wp.normalize(wp.cross(x2 - x1, x3 - x1))
    return -m * wp.dot(field, share * wp.normalize(d) + poling_n * n)


EFFECT = Effect(
    name="magnetic_torque",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("remanence", "Br", "T", 0.0, (-2.0, 2.0), "remanent flux density along the poling direction"),
        Parameter("volume", "V", "m^3", 0.0, (0.0, math.inf), "volume of magnet carried by this triangle"),
        Parameter("poling_1", "a", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the first edge x2 - x1"),
        Parameter("poling_2", "b", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the second edge x3 - x1"),
        Parameter("poling_n", "c", "-", 0.0, (-1.0, 1.0), "share of the unit poling vector along the normal"),
    ),
    formula="U = -m . B,  |m| = Br V / mu0 constant, direction a (x2 - x1) + b (x3 - x1) and normal",
    source="rotation-based hard magnet: Mukherjee, Rambausek & Danas 2021; Danas & Reis 2024 (arXiv 2403.03096)",
    matters="the drive of every magnetic device; torque m B cos(theta)",
    confused_with="crease stiffness: only their ratio shows in a static angle",
    separated_by="natural frequency, or a known weight",
)
