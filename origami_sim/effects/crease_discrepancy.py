"""No mechanism: a table of the moment that a crease lacks, against its angle and its rate."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

KNOTS = 9
"""Knots along each axis, equally spaced; the angle's index runs slowest."""


@wp.func
def moment(
    angle: scalar,
    rate: scalar,
    buffer: wp.array(dtype=scalar),
    missing_moment: int,
    angle_low: scalar,
    angle_high: scalar,
    rate_low: scalar,
    rate_high: scalar,
):
    last = scalar(KNOTS - 1)
    s = wp.clamp((angle - angle_low) / (angle_high - angle_low) * last, scalar(0.0), last)
    t = wp.clamp((rate - rate_low) / (rate_high - rate_low) * last, scalar(0.0), last)
    i = wp.min(int(wp.floor(s)), KNOTS - 2)
    j = wp.min(int(wp.floor(t)), KNOTS - 2)
    s = s - scalar(i)
    t = t - scalar(j)
    at = missing_moment + KNOTS * i + j
    here = buffer[at] + t * (buffer[at + 1] - buffer[at])
    beyond = buffer[at + KNOTS] + t * (buffer[at + KNOTS + 1] - buffer[at + KNOTS])
    return here + s * (beyond - here)


def steepest(p, axis: int, name: str) -> np.ndarray:
    """Steepest slope of the table along an axis, per crease and world."""
    values = p["missing_moment"]
    grid = values.reshape(*values.shape[:-1], KNOTS, KNOTS)
    step = (p[f"{name}_high"] - p[f"{name}_low"]) / (KNOTS - 1)
    return np.abs(np.diff(grid, axis=axis)).max(axis=(-2, -1)) / step


EFFECT = Effect(
    name="crease_discrepancy",
    family="crease",
    force=moment,
    parameters=(
        Parameter("missing_moment", "dM", "N m", 0.0, (-math.inf, math.inf), "moment by angle and rate", KNOTS * KNOTS),
        Parameter("angle_low", "theta_1", "rad", -math.pi, (-20.0, 0.0), "first angle of the table"),
        Parameter("angle_high", "theta_9", "rad", math.pi, (0.01, 20.0), "last angle of the table"),
        Parameter("rate_low", "w_1", "rad/s", -20.0, (-1e4, 0.0), "first rate of the table"),
        Parameter("rate_high", "w_9", "rad/s", 20.0, (0.01, 1e4), "last rate of the table"),
    ),
    stiffness=lambda p: steepest(p, -2, "angle"),
    damping=lambda p: steepest(p, -1, "rate"),
    formula="M = dM(theta, dtheta/dt), bilinear on 9 x 9 knots, constant beyond them",
    source="discrepancy function of Kennedy & O'Hagan 2001, on the crease instead of on the data",
    matters="what a data-driven correction can explain; the rest lies outside angle and rate of the crease",
)
