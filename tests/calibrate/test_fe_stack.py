"""Notched dielectric stack by finite elements against plane sections of an Ogden stack (physics notes, 2b)."""

import math
import sys

import numpy as np
import pytest

from origami_sim.errors import InputError

pytest.importorskip("skfem", reason="scikit-fem is not installed (the [fe] extra)")

from origami_sim.calibrate.fe_stack import EPS0, Stack, _StackSection, fold, free_turn

VOLTAGES = [500.0, 1000.0, 2000.0, 3000.0, 4000.0]
BENDER = {
    1: [0.3960, 1.5905, 6.469, 14.975, 27.740],
    5: [0.0451, 0.1806, 0.7228, 1.6277, 2.8974],
}
"""Curvature with thinning [1/m] by layers of tape: independent computation, three-term Ogden, plane sections."""


@pytest.mark.parametrize("tapes", BENDER)
def test_bender_curvature_with_thinning(tapes):
    bare = Stack(6e-3, notch_layers=tapes, arm_layers=tapes, arm=0.0, active=1.0)
    found = free_turn(bare, VOLTAGES) / bare.notch
    assert found == pytest.approx(BENDER[tapes], rel=3e-3)


def test_pressure_is_the_full_maxwell_stress():
    assert 4.7 * EPS0 * (4000 / 272.8e-6) ** 2 == pytest.approx(8947, rel=1e-4)


def test_tangent_with_a_field_is_the_derivative_of_the_forces():
    section = _StackSection(Stack(10e-3), 1)
    section.electric[:] = 1e4
    rng = np.random.default_rng(0)
    u, du = rng.normal(size=section.size) * 1e-6, rng.normal(size=section.size) * 1e-11
    stiffness = section.assemble(u)[1]
    difference = (section.assemble(u + du)[0] - section.assemble(u - du)[0]) / 2
    assert np.abs(difference - stiffness @ du).max() < 1e-8 * np.abs(stiffness @ du).max()


def test_notch_folds_about_quadratically_and_the_arms_bend_little():
    found = fold(Stack(10e-3), VOLTAGES[1:])
    assert np.degrees(found.curvature * 0.045) == pytest.approx([0.37, 1.47, 3.31, 5.89], rel=0.01)
    exponent = np.polyfit(np.log(found.voltage), np.log(found.notch), 1)[0]
    assert exponent == pytest.approx(2.05, abs=0.03)
    assert np.degrees(found.notch[-1]) == pytest.approx(
        12.30, rel=0.5
    )  # plane sections leave out the ends of the notch


def test_notch_acts_longer_than_it_is_by_the_same_length():
    """The elastomer over the arms' ends bends too: the notch acts as if it were longer, whatever its length."""
    bare = Stack(6e-3, notch_layers=1, arm_layers=1, arm=0.0)
    assert free_turn(bare, [1000.0])[0] / bare.notch * 0.010 == pytest.approx(math.radians(0.72), rel=0.01)
    curvature = free_turn(bare, [1000.0])[0] / bare.notch
    excess = [fold(Stack(n), [1000.0]).notch[0] / curvature - n for n in (8e-3, 12e-3)]
    assert excess[0] == pytest.approx(excess[1], rel=0.02)
    assert 1.0 < excess[0] / bare.height < 2.5
    longer = fold(Stack(8e-3, arm=14e-3), [1000.0]).notch[0] / curvature - 8e-3
    assert longer == pytest.approx(excess[0], rel=0.02)
    finer = fold(Stack(8e-3), [1000.0], fineness=2).notch[0] / curvature - 8e-3
    assert finer == pytest.approx(excess[0], rel=0.02)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Stack(-1e-3), ["positive dimensions", "notch"]),
        (lambda: Stack(1e-2, notch_layers=0), ["keeps some tape", "1 to 5"]),
        (lambda: Stack(1e-2, notch_layers=6), ["not more than the arms", "1 to 5"]),
        (lambda: Stack(1e-2, active=0.0), ["active"]),
        (lambda: free_turn(Stack(1e-2), [1000.0, 500.0]), ["voltages must rise"]),
        (lambda: free_turn(Stack(1e-2), [math.nan]), ["voltages must rise"]),
    ],
)
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(w in str(error.value) for w in words) and "\n" not in str(error.value)


def test_without_scikit_fem_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(InputError, match=r"origami-sim\[fe\]"):
        free_turn(Stack(1e-2), [100.0])
