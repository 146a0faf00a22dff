"""Thermal creases: the bilayer's turn against layers solved one by one, the law, and a crease at rest."""

import math

import numpy as np
import pytest
from effects.kit import hinge, lengths, quiet
from effects.test_laws import hinge_moment, under

from origami_sim.drive import Drive, ramp
from origami_sim.effects.crease_thermal import bilayer_turn
from origami_sim.errors import InputError
from origami_sim.solve.motion.dynamics import simulate


def free_curvature(thickness, modulus, expansion, slices=21000):
    """Curvature per kelvin of a free stack: no net force, no net moment of E (e0 - kappa z - alpha), by summation."""
    h = sum(thickness)
    z = (np.arange(slices) + 0.5) * h / slices
    lower = z < thickness[0]
    e, a = np.where(lower, *modulus), np.where(lower, *expansion)
    matrix = [[e.sum(), -(e * z).sum()], [(e * z).sum(), -(e * z * z).sum()]]
    return np.linalg.solve(matrix, [(e * a).sum(), (e * a * z).sum()])[1]


@pytest.mark.parametrize(
    ("thickness", "modulus"),
    [((1e-3, 1e-3), (2e6, 2e6)), ((4e-4, 1e-4), (1.5e6, 8e6)), ((1e-4, 6e-4), (3e6, 1e6))],
)
def test_timoshenko_is_the_free_stack(thickness, modulus):
    expansion = (3e-4, 2e-5)
    length = 0.012
    expected = free_curvature(thickness, modulus, expansion) * length
    assert bilayer_turn(length, thickness, modulus, expansion) == pytest.approx(expected, rel=1e-6)
    assert expected > 0  # the lower layer gets longer: the sheet's ends rise


def test_equal_layers_bend_by_three_halves():
    """kappa = 3/2 (alpha_1 - alpha_2) / h, the textbook case."""
    assert bilayer_turn(1.0, (5e-4, 5e-4), (1e6, 1e6), (3e-4, 1e-4)) == pytest.approx(1.5 * 2e-4 / 1e-3, rel=1e-12)


def test_moment_is_proportional_to_the_temperature_whatever_the_angle():
    values = under("crease_thermal", stiffness=0.02, turn_per_kelvin=-0.013)
    angles = np.array([-3.0, 0.0, 0.4, 2.0])
    for rise in (-15.0, 0.0, 40.0):
        found = hinge_moment("crease_thermal", values, angles, Drive(temperature=rise))
        assert found == pytest.approx(-0.02 * 0.013 * rise, abs=1e-15)


def test_elastic_crease_comes_to_rest_at_the_turn_and_returns_on_cooling():
    """Half-way through warm, at the end cool: the angle follows a T."""
    model = hinge(held=(0, 1, 2), bars=[(3, 1), (3, 2)])
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 2e3,
            ("bars", "rest_length"): lengths(model),
            ("inertia", "mass"): 0.01,
            ("crease", "stiffness"): 0.5,
            ("crease_viscosity", "viscosity"): 0.1,
            **under("crease_thermal", stiffness=0.5, turn_per_kelvin=0.02),
        },
    )
    warm = simulate(model, p, Drive(temperature=ramp(60.0, 1.0)), duration=4.0, rate=10)
    assert warm.creases[-1, 0, 0] == pytest.approx(1.2, abs=1e-6)
    cool = simulate(model, p, Drive(temperature=ramp(0.0, 1.0, start=60.0)), duration=4.0, rate=10)
    assert cool.creases[-1, 0, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.abs(cool.creases).max() > 0.5


@pytest.mark.parametrize("bad", [{"length": 0.0}, {"thickness": (1e-3, -1e-3)}, {"modulus": (math.nan, 1.0)}])
def test_a_bilayer_without_size_is_refused(bad):
    given = {"length": 0.01, "thickness": (1e-3, 1e-3), "modulus": (1e6, 1e6), "expansion": (1e-4, 0.0), **bad}
    with pytest.raises(InputError, match=f"bilayer.*{next(iter(bad))}.*> 0"):
        bilayer_turn(**given)
