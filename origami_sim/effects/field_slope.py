"""Field gradient: along the field or across; torque away from the origin, and pull on magnets."""

import math

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._magnet import MAGNET, poled
from origami_sim.physics.kinematics import corner_rows
from origami_sim.physics.materials import MU0


@wp.func
def along(a: wp.vec3d, field: wp.vec3d, slope: wp.vec3d, narrowing: scalar, across: wp.vec3d):
    # G a; G is symmetric and without trace, as curl and divergence of a field vanish
    strength = wp.length(field)
    b = wp.normalize(field)
    rise = wp.dot(slope, b)
    aside = slope - rise * b
    out = wp.dot(b, a) * (rise * b + aside) + wp.dot(aside, a) * b
    rest = a - wp.dot(b, a) * b
    p = across - wp.dot(across, b) * b
    if wp.length(p) > scalar(1.0e-6) * wp.length(across):
        p = wp.normalize(p)
        part = wp.dot(p, rest) * p
        out = out - rise * ((scalar(1.0) - narrowing) * (rest - part) + narrowing * part)
    else:  # a field along the axis of the folds has no plane of motion
        out = out - scalar(0.5) * rise * rest
    return strength * out


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
    slope_x: scalar,
    slope_y: scalar,
    slope_z: scalar,
    narrowing: scalar,
    across_x: scalar,
    across_y: scalar,
    across_z: scalar,
):
    slope = wp.vec3d(slope_x, slope_y, slope_z)
    across = wp.vec3d(across_x, across_y, across_z)
    extra = along((x1 + x2 + x3) / scalar(3.0), field, slope, narrowing, across)
    u = poled(x1, x2, x3, poling_1, poling_2, poling_n)
    pull = (remanence * volume / (scalar(3.0) * scalar(MU0))) * along(u, field, slope, narrowing, across)
    torque = nominal.force(x1, x2, x3, extra, remanence, volume, poling_1, poling_2, poling_n)
    return torque + corner_rows(pull, pull, pull)


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
    slope_x: scalar,
    slope_y: scalar,
    slope_z: scalar,
    narrowing: scalar,
    across_x: scalar,
    across_y: scalar,
    across_z: scalar,
):
    slope = wp.vec3d(slope_x, slope_y, slope_z)
    across = wp.vec3d(across_x, across_y, across_z)
    extra = along((x1 + x2 + x3) / scalar(3.0), field, slope, narrowing, across)
    return nominal.energy(x1, x2, x3, extra, remanence, volume, poling_1, poling_2, poling_n)


EFFECT = Effect(
    name="field_slope",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("slope_x", "sx", "1/m", 0.0, (-100.0, 100.0), "relative rise of the strength along x", typical=1.0),
        Parameter("slope_y", "sy", "1/m", 0.0, (-100.0, 100.0), "along y", typical=0.0),
        Parameter("slope_z", "sz", "1/m", 0.0, (-100.0, 100.0), "along z", typical=0.0),
        Parameter(
            "narrowing", "rho", "-", 0.5, (0.0, 1.0),
            "share of the closing in that happens across the plane of motion: 1/2 round, 0 long pole pieces",
            typical=0.5,
        ),
        Parameter("across_x", "px", "-", 0.0, (-math.inf, math.inf), "across the plane of motion (of any length)"),
        Parameter("across_y", "py", "-", 1.0, (-math.inf, math.inf), "along y"),
        Parameter("across_z", "pz", "-", 0.0, (-math.inf, math.inf), "along z"),
    ),
    fitted=("slope_x", "slope_z", "slope_y", "narrowing"),
    needs=("slope_x", "slope_y", "slope_z"),
    formula=(
        "B(x) = B + G x,  G = |B| [q b^T + b q^T + (s . b) (b b^T - (1 - rho) t t^T - rho p p^T)],  b = B / |B|, "
        "q = s - (s . b) b, p across the plane of motion, t = p x b: |B(x)| = |B| (1 + s . x); f = G m and m x G x"
    ),
    source=(
        "first order of a field off the centre of its magnet, div B = 0 and curl B = 0 (Jackson 1999, ch. 5): a sample "
        "beside the axis of a round coil sees q, above its middle s . b with rho = 1/2"
    ),
    matters="1 cm off the middle of a coil pair of 10 cm: 1 % per cm; at 0.2 T that pulls a patch with 14 mN",
    confused_with="direction of the field, rest angle, gravity, remanence that differs between panels",
    separated_by="move the sample in the gap: an error of the device goes with it; map the field with a Hall probe",
)  # fmt: skip
