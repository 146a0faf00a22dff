"""Dipole interaction: remanent panels in each other's field."""

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._magnet import MAGNET, poled
from origami_sim.physics.kinematics import corner_rows, normal_gradients
from origami_sim.physics.materials import MU0


@wp.func
def magnet(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    offset: scalar,
):
    moment = (remanence * volume / scalar(MU0)) * poled(x1, x2, x3, poling_1, poling_2, poling_n)
    return moment, (x1 + x2 + x3) / scalar(3.0) + offset * wp.normalize(wp.cross(x2 - x1, x3 - x1))


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    stray: wp.vec3d,
    stray_gradient: wp.mat33d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    offset: scalar,
):
    moment, _ = magnet(x1, x2, x3, remanence, volume, poling_1, poling_2, poling_n, offset)
    pull = stray_gradient * moment
    t = normal_gradients(x1, x2, x3)
    third = pull / scalar(3.0)
    lever = offset * t.n
    pulls = corner_rows(
        third - wp.dot(pull, t.g1) * lever,
        third - wp.dot(pull, t.g2) * lever,
        third - wp.dot(pull, t.g3) * lever,
    )
    return pulls + nominal.force(x1, x2, x3, stray, remanence, volume, poling_1, poling_2, poling_n)


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    stray: wp.vec3d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
):
    # a pair is met from both sides
    whole = nominal.energy(x1, x2, x3, stray, remanence, volume, poling_1, poling_2, poling_n)
    return scalar(0.5) * whole


EFFECT = Effect(
    name="dipole_interaction",
    family="triangle",
    force=force,
    energy=energy,
    magnet=magnet,
    conservative=True,
    parameters=(
        *MAGNET,
        Parameter("offset", "e", "m", 0.0, (-1.0, 1.0), "of the magnet along the panel's normal"),
        Parameter(
            "coupling", "c", "-", 0.0, (0.0, 3.0), "share of the point dipoles' field; 1: all of it", typical=1.0
        ),
    ),
    fitted=("coupling",),
    formula="U = c mu0 / (4 pi r^3) (m1 . m2 - 3 (m1 . r)(m2 . r) / r^2), each triangle a dipole in its middle",
    source="Jackson 1999, section 5.6; panels that touch and are poled alike are one magnet",
    matters="2 % of the torque at 0.2 T, a tenth at 10 to 20 mT near closure; 0.6 deg of a box flap without field",
    confused_with="gravity, rest angles; it does not turn round with the field",
    separated_by="take one panel's magnet away; its relative weight falls as 1/B",
)
