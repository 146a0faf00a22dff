"""Temperature-dependent stiffness: of a crease, which falls, or rises, with temperature."""

import math

import numpy as np
import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

LARGEST = 100.0
"""Temperature rise [K] of either sign beyond which the stiffness stays: the law is linear, real elastomers are not."""


@wp.func
def stiffness(temperature: scalar, softening_rate: scalar):
    return -softening_rate * wp.clamp(temperature, -scalar(LARGEST), scalar(LARGEST))


@wp.func
def moment(angle: scalar, temperature: scalar, softening_rate: scalar, rest_angle: scalar):
    return -stiffness(temperature, softening_rate) * (angle - rest_angle)


@wp.func
def energy(angle: scalar, temperature: scalar, softening_rate: scalar, rest_angle: scalar):
    turn = angle - rest_angle
    return scalar(0.5) * stiffness(temperature, softening_rate) * turn * turn


EFFECT = Effect(
    name="crease_temperature",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "softening_rate", "b", "N m/(rad K)", 0.0, (-1.0, 1.0), "stiffness lost per kelvin of rise", typical=2e-5
        ),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "that of the crease", typical=0.0),
    ),
    fitted=("softening_rate",),
    stiffness=lambda p: LARGEST * np.abs(p["softening_rate"]),
    formula="M = b T (theta - theta0), T the rise of temperature, at most 100 K",
    source="VHB loses 1-3 % of its modulus per kelvin, rubber above its glass transition gains 0.3 %",
    matters="slow drift of every amplitude with the room or with warm coils",
    confused_with="creep, Mullins softening, loss of remanence (0.2 %/K)",
    separated_by="log the temperature; thermostat; passive torque-angle test warm and cold",
)
