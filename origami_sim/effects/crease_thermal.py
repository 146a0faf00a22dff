"""A crease that bends when warmed: the two layers of a bilayer expand differently."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.errors import InputError


@wp.func
def moment(temperature: scalar, stiffness: scalar, turn_per_kelvin: scalar):
    return stiffness * turn_per_kelvin * temperature


@wp.func
def energy(angle: scalar, temperature: scalar, stiffness: scalar, turn_per_kelvin: scalar):
    return -stiffness * turn_per_kelvin * temperature * angle


def bilayer_turn(
    length: float, thickness: tuple[float, float], modulus: tuple[float, float], expansion: tuple[float, float]
) -> float:
    """Turn per kelvin of a free bilayer crease, towards valley if the lower layer expands more [rad/K].

    kappa = 6 (alpha_1 - alpha_2) dT (1 + m)^2 / (h [3 (1 + m)^2 + (1 + m n) (m^2 + 1 / (m n))]), m = t_1 / t_2,
    n = E_1 / E_2, h = t_1 + t_2 (Timoshenko 1925, J. Opt. Soc. Am. 11, 233); turn = kappa * length.

    Args:
        length: of sheet that bends [m]. thickness, modulus, expansion: of the lower and the upper layer [m], [Pa],
            [1/K]; for a crease much wider than long both moduli over (1 - nu^2) and both expansions times (1 + nu).

    Raises:
        InputError: a length, thickness or modulus that is not positive.
    """
    for name, values in (("length", (length,)), ("thickness", thickness), ("modulus", modulus)):
        for value in values:
            if not value > 0:
                raise InputError("a bilayer needs it positive", field=name, value=value, allowed="> 0")
    m, n = thickness[0] / thickness[1], modulus[0] / modulus[1]
    shape = 6 * (1 + m) ** 2 / (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    return shape * (expansion[0] - expansion[1]) / sum(thickness) * length


EFFECT = Effect(
    name="crease_thermal",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "rotational stiffness of the bilayer"),
        Parameter(
            "turn_per_kelvin", "a", "rad/K", 0.0, (-1.0, 1.0), "free turn per kelvin, valley positive; 0 for no bilayer"
        ),
    ),
    formula="M = K a T; beside an elastic crease of the same K the rest angle moves by a T,  a = kappa L / T",
    source="Timoshenko 1925, J. Opt. Soc. Am. 11, 233 (bimetal); linear in the temperature rise T",
    matters="thermally driven folds; drift of any crease between layers that expand differently",
    confused_with="rest-angle drift, swelling of one layer",
    separated_by="a thermostat; cool back and warm again: it returns at once, drift and swelling do not",
)
