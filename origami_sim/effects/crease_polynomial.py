"""A moment by angle and rate that no law of the catalogue gives: a polynomial, and no mechanism."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

ANGLE, RATE = 9, 9
"""Highest orders in the angle or the rate alone.

Of four flaps with a moment that the catalogue lacks (a ratchet, detents, an even one, a loss that falls with speed) all
are told from laws of the catalogue. With 5 the first two are not; with 18 all are, and two predict held-out data as
badly as the model as given."""


@wp.func
def area_sinh(x: scalar):
    size = wp.abs(x)
    return wp.sign(x) * wp.log(size + wp.sqrt(size * size + scalar(1.0)))


@wp.func
def moment(
    angle: scalar,
    rate: scalar,
    constant: scalar,
    angle_1: scalar,
    angle_2: scalar,
    angle_3: scalar,
    angle_4: scalar,
    angle_5: scalar,
    angle_6: scalar,
    angle_7: scalar,
    angle_8: scalar,
    angle_9: scalar,
    rate_1: scalar,
    rate_2: scalar,
    rate_3: scalar,
    rate_4: scalar,
    rate_5: scalar,
    rate_6: scalar,
    rate_7: scalar,
    rate_8: scalar,
    rate_9: scalar,
    both_11: scalar,
    both_12: scalar,
    both_21: scalar,
    middle: scalar,
    reach: scalar,
    usual: scalar,
    fastest: scalar,
):
    one = scalar(1.0)
    x = wp.clamp((angle - middle) / reach, -one, one)
    y = wp.clamp(area_sinh(rate / usual) / area_sinh(fastest / usual), -one, one)
    x2 = scalar(2.0) * x * x - one
    x3 = scalar(2.0) * x * x2 - x
    x4 = scalar(2.0) * x * x3 - x2
    x5 = scalar(2.0) * x * x4 - x3
    x6 = scalar(2.0) * x * x5 - x4
    x7 = scalar(2.0) * x * x6 - x5
    x8 = scalar(2.0) * x * x7 - x6
    x9 = scalar(2.0) * x * x8 - x7
    y2 = scalar(2.0) * y * y - one
    y3 = scalar(2.0) * y * y2 - y
    y4 = scalar(2.0) * y * y3 - y2
    y5 = scalar(2.0) * y * y4 - y3
    y6 = scalar(2.0) * y * y5 - y4
    y7 = scalar(2.0) * y * y6 - y5
    y8 = scalar(2.0) * y * y7 - y6
    y9 = scalar(2.0) * y * y8 - y7
    by_angle = angle_1 * x + angle_2 * x2 + angle_3 * x3 + angle_4 * x4 + angle_5 * x5
    by_angle += angle_6 * x6 + angle_7 * x7 + angle_8 * x8 + angle_9 * x9
    by_rate = rate_1 * y + rate_2 * y2 + rate_3 * y3 + rate_4 * y4 + rate_5 * y5
    by_rate += rate_6 * y6 + rate_7 * y7 + rate_8 * y8 + rate_9 * y9
    return constant + by_angle + by_rate + both_11 * x * y + both_12 * x * y2 + both_21 * x2 * y


TERMS = (
    ("constant", 0, 0),
    *((f"angle_{n}", n, 0) for n in range(1, ANGLE + 1)),
    *((f"rate_{n}", 0, n) for n in range(1, RATE + 1)),
    ("both_11", 1, 1),
    ("both_12", 1, 2),
    ("both_21", 2, 1),
)
"""Names of the coefficients, and their orders in the angle and in the rate."""


def _steepest(p, axis: int):
    """Bound of the slope against x or y: |T_n'| <= n^2 and |T_n| <= 1."""
    return sum(term[axis] ** 2 * np.abs(p[term[0]]) for term in TERMS)


EFFECT = Effect(
    name="crease_polynomial",
    family="crease",
    force=moment,
    parameters=(
        *(
            Parameter(name, f"M{i}{j}", "N m", 0.0, (-math.inf, math.inf), f"coefficient of T{i}(x) T{j}(y)")
            for name, i, j in TERMS
        ),
        Parameter("middle", "theta_m", "rad", 0.0, (-20.0, 20.0), "angle in the middle of the range"),
        Parameter("reach", "theta_r", "rad", math.pi, (0.001, 20.0), "half of the range of angles"),
        Parameter(
            "usual", "w_0", "rad/s", 2.0, (0.001, 1e4), "rate up to which y goes with the rate, beyond with its log"
        ),
        Parameter("fastest", "w_r", "rad/s", 20.0, (0.001, 1e4), "largest rate"),
    ),
    needs=tuple(name for name, *_ in TERMS),
    stiffness=lambda p: _steepest(p, 1) / p["reach"],
    damping=lambda p: _steepest(p, 2) / (p["usual"] * np.arcsinh(p["fastest"] / p["usual"])),
    formula="M = sum_ij Mij Ti(x) Tj(y),  x = (theta - theta_m) / theta_r,  y = asinh(w / w_0) / asinh(w_r / w_0); "
    "constant beyond |x|, |y| = 1",
    source="Chebyshev polynomials; a discrepancy (Kennedy & O'Hagan 2001) that is a moment of the crease",
    matters="how much a law of angle and rate could still explain at a crease that the catalogue does not name",
)
