"""Quadratic damping: loss of a crease by the square of its rate, as of air pushed aside or grease in gaps."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

FASTEST = 100.0
"""Rate [rad/s] beyond which the loss goes on linearly, so that it has a steepest slope."""


@wp.func
def moment(rate: scalar, coefficient: scalar):
    speed = wp.abs(rate)
    factor = speed
    if speed > scalar(FASTEST):
        factor = scalar(2.0) * scalar(FASTEST) - scalar(FASTEST) * scalar(FASTEST) / speed
    return -coefficient * factor * rate


EFFECT = Effect(
    name="crease_quadratic_damping",
    family="crease",
    force=moment,
    parameters=(
        Parameter(
            "coefficient", "c2", "N m s^2/rad^2", 0.0, (0.0, math.inf), "moment at a rate of 1 rad/s", typical=4e-6
        ),
    ),
    fitted=("coefficient",),
    damping=lambda p: 2 * FASTEST * p["coefficient"],
    formula="M = -c2 w |w|,  w = dtheta/dt; straight on beyond 100 rad/s",
    source="drag of a flap turning in air, c2 = rho Cd b L^4 / 8 for a flap b wide and L long, or a turbulent bearing",
    matters="light flaps that move fast; large swings decay faster than small ones",
    confused_with="viscous loss of the crease; dry friction (small swings decay faster)",
    separated_by="decay against amplitude; vacuum",
)
