"""Rate-independent hysteresis (Bouc-Wen): of a crease, with a rounded loop, as of friction that yields gradually."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def slope(z: scalar, way: scalar, sharpness: scalar):
    value = scalar(1.0)
    if z * way > scalar(0.0):
        value = scalar(1.0) - wp.pow(wp.min(wp.abs(z), scalar(1.0)), sharpness)
    return value


@wp.func
def moment(turn: scalar, z: scalar, hysteresis_moment: scalar, yield_angle: scalar, sharpness: scalar):
    part = turn / yield_angle
    # Heun's rule, cut off at the limits that the exact solution keeps
    first = slope(z, turn, sharpness)
    ahead = wp.clamp(z + part * first, scalar(-1.0), scalar(1.0))
    new = z + part * scalar(0.5) * (first + slope(ahead, turn, sharpness))
    new = wp.clamp(new, scalar(-1.0), scalar(1.0))
    return -hysteresis_moment * new, new


EFFECT = Effect(
    name="crease_hysteresis",
    family="crease",
    force=moment,
    memory=(Memory("z"),),
    parameters=(
        Parameter("hysteresis_moment", "Mh", "N m", 0.0, (0.0, math.inf), "half height of the loop", typical=1e-4),
        Parameter("yield_angle", "s0", "rad", 0.1, (0.03, 3.0), "moment over slope; below: dry friction", typical=0.1),
        Parameter("sharpness", "n", "-", 1.0, (1.0, 20.0), "1 round; large: the corners of dry friction", typical=1.0),
    ),
    fitted=("hysteresis_moment", "yield_angle"),
    stiffness=lambda p: p["hysteresis_moment"] / p["yield_angle"],
    formula="M = -Mh z,  s0 dz/dtheta = 1 - |z|^n while z grows in size, 1 while it shrinks",
    source="Bouc 1967, Wen 1976 with beta = gamma = 1/2, where it cannot create energy (Erlicher & Point 2004)",
    matters="paper, filled elastomers, grease between layers: 2-15 % of the crease's own moment",
    confused_with="viscous loss, relaxation; dry friction at the feet",
    separated_by="loops at 0.01 Hz; loops of growing amplitude; hang the device so that nothing touches",
)
