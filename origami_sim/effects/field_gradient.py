"""Force of a field gradient on a remanent panel."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows
from origami_sim.physics.materials import MU0


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    gradient: wp.mat33d,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
):
    m = remanence * volume / scalar(MU0)
    share = wp.sqrt(wp.max(scalar(1.0) - poling_n * poling_n, scalar(0.0)))
    u = share * wp.normalize(poling_1 * (x2 - x1) + poling_2 * (x3 - x1))
    u += poling_n * wp.normalize(wp.cross(x2 - x1, x3 - x1))
    f = (m / scalar(3.0)) * (wp.transpose(gradient) * u)
    return corner_rows(f, f, f)


EFFECT = Effect(
    name="field_gradient",
    family="triangle",
    force=force,
    parameters=(
        Parameter("remanence", "Br", "T", 0.0, (-2.0, 2.0), "remanent flux density"),
        Parameter("volume", "V", "m^3", 0.0, (0.0, math.inf), "volume of magnet carried by this triangle"),
        Parameter("poling_1", "a", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the first edge"),
        Parameter("poling_2", "b", "1/m", 0.0, (-math.inf, math.inf), "in-plane poling along the second edge"),
        Parameter("poling_n", "c", "-", 0.0, (-1.0, 1.0), "share of the unit poling vector along the normal"),
    ),
    formula="f = (m . grad) B, a third at each corner; the torque law sees B at the centroid",
    source="magnetostatics: U = -m . B(x)",
    matters="1 % per cm at 0.2 T pulls a box patch with 14 mN, against 19 mN of weight",
    confused_with="gravity; drift from friction",
    separated_by="move the sample in the gap; map the field",
)
