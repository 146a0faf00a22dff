"""Nonlinear crease: moment tabulated against angle, as measured or as computed by finite elements."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

KNOTS = 33
"""Knots of the table, equally spaced from angle_min to angle_max."""


@wp.func
def slope(buffer: wp.array(dtype=scalar), first: int, k: int):
    """Of the table at a knot, per knot: by five points where there are so many about it, else by three or two."""
    lo = wp.max(k - 1, 0)
    hi = wp.min(k + 1, KNOTS - 1)
    near = (buffer[first + hi] - buffer[first + lo]) / scalar(hi - lo)
    if k < 2 or k > KNOTS - 3:
        return near
    far = (buffer[first + k + 2] - buffer[first + k - 2]) / scalar(4.0)
    return (scalar(4.0) * near - far) / scalar(3.0)


@wp.func
def moment(angle: scalar, buffer: wp.array(dtype=scalar), resisting_moment: int, angle_min: scalar, angle_max: scalar):
    step = (angle_max - angle_min) / scalar(KNOTS - 1)
    s = (angle - angle_min) / step
    k = wp.clamp(int(wp.floor(s)), 0, KNOTS - 2)
    t = s - scalar(k)
    m0 = buffer[resisting_moment + k]
    m1 = buffer[resisting_moment + k + 1]
    d0 = slope(buffer, resisting_moment, k)
    d1 = slope(buffer, resisting_moment, k + 1)
    value = scalar(0.0)
    if t < scalar(0.0):  # beyond the table: straight on
        value = m0 + d0 * t
    elif t > scalar(1.0):
        value = m1 + d1 * (t - scalar(1.0))
    else:
        a = scalar(2.0) * (m0 - m1) + d0 + d1
        b = scalar(3.0) * (m1 - m0) - scalar(2.0) * d0 - d1
        value = ((a * t + b) * t + d0) * t + m0
    return -value


@wp.func
def energy(angle: scalar, buffer: wp.array(dtype=scalar), resisting_moment: int, angle_min: scalar, angle_max: scalar):
    step = (angle_max - angle_min) / scalar(KNOTS - 1)
    s = (angle - angle_min) / step
    last = wp.clamp(int(wp.floor(s)), 0, KNOTS - 2)
    total = scalar(0.0)
    for k in range(last):
        m0 = buffer[resisting_moment + k]
        m1 = buffer[resisting_moment + k + 1]
        d0 = slope(buffer, resisting_moment, k)
        d1 = slope(buffer, resisting_moment, k + 1)
        total += scalar(0.5) * (m0 + m1) + (d0 - d1) / scalar(12.0)
    t = s - scalar(last)
    m0 = buffer[resisting_moment + last]
    m1 = buffer[resisting_moment + last + 1]
    d0 = slope(buffer, resisting_moment, last)
    d1 = slope(buffer, resisting_moment, last + 1)
    if t < scalar(0.0):
        total += m0 * t + scalar(0.5) * d0 * t * t
    else:
        a = scalar(2.0) * (m0 - m1) + d0 + d1
        b = scalar(3.0) * (m1 - m0) - scalar(2.0) * d0 - d1
        u = wp.min(t, scalar(1.0))
        total += (((a / scalar(4.0) * u + b / scalar(3.0)) * u + scalar(0.5) * d0) * u + m0) * u
        if t > scalar(1.0):
            total += m1 * (t - scalar(1.0)) + scalar(0.5) * d1 * (t - scalar(1.0)) * (t - scalar(1.0))
    return total * step


def _steepest(p):
    step = (p["angle_max"] - p["angle_min"]) / (KNOTS - 1)
    return 1.5 * np.abs(np.diff(p["resisting_moment"], axis=-1)).max(axis=-1) / step


EFFECT = Effect(
    name="crease_table",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("resisting_moment", "M", "N m", 0.0, (-math.inf, math.inf), "moment needed to hold the angle", KNOTS),
        Parameter("angle_min", "theta_min", "rad", -math.pi, (-2 * math.pi, 2 * math.pi), "angle of the first knot"),
        Parameter("angle_max", "theta_max", "rad", math.pi, (-2 * math.pi, 2 * math.pi), "angle of the last knot"),
    ),
    stiffness=_steepest,
    formula="M = -M(theta), cubic between equally spaced knots, straight beyond",
    source="finite-element or measured torque-angle curve; a cubic with slopes by five points keeps the energy exact",
    matters="creases that stiffen or soften with angle (hyperelastic, mountain against valley)",
    confused_with="linear crease with another stiffness, over a small range of angles",
    separated_by="torque-angle curve over the full range",
)
