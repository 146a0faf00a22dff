"""Non-uniform field: stronger at one place than at another; pull on magnets, another torque off the origin."""

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._magnet import MAGNET, poled
from origami_sim.physics.kinematics import corner_rows
from origami_sim.physics.materials import MU0


@wp.func
def along(a: wp.vec3d, field: wp.vec3d, field_slope: scalar):
    # G a, with G = slope |B| (3 b b^T - 1) / 2 along the unit vector b: symmetric and without trace, as curl and
    # divergence of a field vanish
    strength = wp.length(field)
    b = wp.normalize(field)
    return scalar(0.5) * field_slope * strength * (scalar(3.0) * wp.dot(b, a) * b - a)


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
    field_slope: scalar,
):
    centre = (x1 + x2 + x3) / scalar(3.0)
    extra = along(centre, field, field_slope)
    u = poled(x1, x2, x3, poling_1, poling_2, poling_n)
    pull = (remanence * volume / (scalar(3.0) * scalar(MU0))) * along(u, field, field_slope)
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
    field_slope: scalar,
):
    centre = (x1 + x2 + x3) / scalar(3.0)
    extra = along(centre, field, field_slope)
    return nominal.energy(x1, x2, x3, extra, remanence, volume, poling_1, poling_2, poling_n)


EFFECT = Effect(
    name="field_nonuniformity",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("field_slope", "g", "1/m", 0.0, (-100.0, 100.0), "relative rise along the field", typical=1.0),
    ),
    fitted=("field_slope",),
    formula="B(x) = B + G x,  G = g |B| (3 b b^T - 1) / 2,  b = B / |B|; U = -m . G x, so f = G m and m x G x",
    source="first order of a field on its axis of symmetry, div B = 0 and curl B = 0; commanded field at the origin",
    matters="1 % per cm at 0.2 T pulls a box patch with 14 mN, against 19 mN of weight",
    confused_with=(
        "gravity, drift by friction, remanence that differs between panels; field_slope, of a coil at rest: here what "
        "makes the field turns with it, as a magnet that is carried around the sample"
    ),
    separated_by="move the sample in the gap; map the field",
)
