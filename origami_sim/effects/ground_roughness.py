"""Uneven ground friction: it changes from place to place."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def coefficient(at: wp.vec3d, roughness: scalar, wave_x: scalar, wave_y: scalar, wave_z: scalar, phase: scalar):
    return scalar(0.5) * roughness * (scalar(1.0) + wp.sin(wp.dot(wp.vec3d(wave_x, wave_y, wave_z), at) + phase))


EFFECT = Effect(
    name="ground_roughness",
    family="coefficient",
    force=coefficient,
    parameters=(
        Parameter("roughness", "dmu", "-", 0.0, (0.0, 5.0), "highest minus lowest coefficient", typical=0.3),
        Parameter("wave_x", "qx", "rad/m", 600.0, (-1e5, 1e5), "2 pi over the distance of crests in x", typical=600.0),
        Parameter("wave_y", "qy", "rad/m", 0.0, (-1e5, 1e5), "the same in y", typical=0.0),
        Parameter("wave_z", "qz", "rad/m", 0.0, (-1e5, 1e5), "the same in z, on a tilted ground", typical=0.0),
        Parameter("phase", "p", "rad", 0.0, (-math.pi, math.pi), "of the wave at the origin", typical=0.0),
    ),
    fitted=("roughness", "phase"),
    formula="mu = mu_0 + dmu (1 + sin(q . x + p)) / 2",
    source="one wave of a map whose standard deviation is 5-20 % of mu",
    matters="strides that scatter from place to place, the same in every passage",
    confused_with="stick-slip; noise of the tracker",
    separated_by="shift the start by half a wave; glass plate as reference",
)
