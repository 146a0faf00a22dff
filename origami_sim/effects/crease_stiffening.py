"""Cubic stiffening: stiffness of a crease that changes with the square of the fold."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(angle: scalar, cubic_stiffness: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    inside = wp.clamp(turn, -scalar(math.pi), scalar(math.pi))
    return -cubic_stiffness * inside * inside * (scalar(3.0) * turn - scalar(2.0) * inside)


@wp.func
def energy(angle: scalar, cubic_stiffness: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    inside = wp.clamp(turn, -scalar(math.pi), scalar(math.pi))
    beyond = turn - inside
    square = inside * inside
    return cubic_stiffness * square * (scalar(0.25) * square + inside * beyond + scalar(1.5) * beyond * beyond)


EFFECT = Effect(
    name="crease_stiffening",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "cubic_stiffness", "K3", "N m/rad^3", 0.0, (-1.0, 10.0),
            "above -K / 10 of the crease's own stiffness K, it never pushes the crease away", typical=1e-4,
        ),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle without moment", typical=0.0),
    ),
    fitted=("cubic_stiffness",),
    stiffness=lambda p: 3 * math.pi**2 * np.abs(p["cubic_stiffness"]),
    formula="M = -K3 (theta - theta0)^3; straight on beyond half a turn",
    source="first odd term of a moment law: Mooney-Rivlin or Ogden bridges, ends of a wide crease that turn",
    matters="odd in the drive and as the cube of the fold, at once and in every cycle alike",
    confused_with="Mullins softening (first cycle only), saturating drive, stop",
    separated_by="torque-angle curve; stiffness about a folded state; first against second cycle",
)  # fmt: skip
