"""The notched dielectric actuator: angles of notch and arms, exponent, localisation."""

import numpy as np
import pytest

from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.scenes import de_fold as fold
from origami_sim.solve.motion.dynamics import simulate

VOLTAGES = np.array([1000.0, 2000.0, 3000.0, 4000.0])
NOTCH = np.array([0.72, 2.91, 6.70, 12.30])
ARMS = np.array([0.37, 1.47, 3.31, 5.89])
"""[deg] at VOLTAGES: the project's reference solution."""


@pytest.fixture(scope="module")
def settings():
    return read_calibration(fold.CALIBRATION)


def angles(settings, voltages=VOLTAGES) -> dict[str, np.ndarray]:
    table, notes = fold.fold(settings, voltages)
    assert not notes
    return table


def test_angles(settings):
    table = angles(settings)
    np.testing.assert_allclose(table["notch_deg"], NOTCH, rtol=0.001, atol=0.005)
    np.testing.assert_allclose(table["arms_deg"], ARMS, rtol=0.001, atol=0.005)
    assert table["total_deg"][-1] == pytest.approx(18.2, abs=0.1)


def test_fold_and_bend_have_different_exponents(settings):
    table = angles(settings)
    assert fold.exponent(VOLTAGES, table["notch_deg"]) == pytest.approx(2.05, abs=0.02)
    assert fold.exponent(VOLTAGES, table["arms_deg"]) == pytest.approx(2.0, abs=0.01)


def test_the_fold_is_in_the_notch(settings):
    """A sixth of the length has two thirds of the angle; without a notch the strip bends alike everywhere."""
    table = angles(settings, [4000.0])
    assert table["notch_deg"][0] / table["total_deg"][0] == pytest.approx(0.676, abs=0.005)
    assert table["localisation"][0] == pytest.approx(12.30 / 10 / (5.89 / 45), rel=0.005)
    even = angles(settings.replace(notch_tape_layers=5.0), [4000.0])
    assert even["localisation"][0] == pytest.approx(1.0, abs=1e-6)


def test_best_tape_in_the_notch(settings):
    """Flat optimum between a quarter and a half of a layer: 13.5 deg."""
    by_layers = [
        angles(settings.replace(notch_tape_layers=n), [4000.0])["notch_deg"][0] for n in (0.1, 0.25, 0.5, 1.0, 2.0)
    ]
    assert max(by_layers[1:3]) == pytest.approx(13.5, abs=0.1)
    assert max(by_layers) == by_layers[1]
    assert by_layers[2:] == sorted(by_layers[2:], reverse=True)


def test_mesh(settings):
    one, fine = (angles(settings.replace(hinges=h), [4000.0]) for h in (1.0, 8.0))
    for name in ("notch_deg", "arms_deg"):
        assert one[name][0] == pytest.approx(fine[name][0], rel=1e-6)


def test_a_notch_longer_than_the_electrode_is_refused(settings):
    with pytest.raises(InputError, match="notch"):
        fold.build(settings.replace(notch_length=0.05, electrode_length=0.04))


def test_motion_comes_to_rest_in_the_equilibrium(settings):
    quiet = settings.replace(decay_rate=25.0)
    model, parameters, drive = fold.build(quiet, hinges=quiet.motion_hinges)
    motion = simulate(model, parameters, drive, duration=2.5, rate=10)
    assert not motion.failures
    turn = np.degrees(fold.turns(fold.segments(quiet, quiet.motion_hinges), motion.x[-1, :, 0]))
    assert turn[1] == pytest.approx(12.30, abs=0.05)
    assert turn[0] + turn[2] == pytest.approx(5.89, abs=0.05)


def test_run(settings):
    outcome = fold.run(settings)
    assert not outcome.trajectory.failures
    table = outcome.tables["fold_angle"]
    np.testing.assert_allclose(table["notch_deg"], table["reference_notch_deg"], rtol=0.002, atol=0.005)


# --- the notch by finite elements, the paper's pressure ---------------------------------------------------------------


@pytest.mark.parametrize("section", ["ogden", "linear"])
def test_notch_by_finite_elements(settings, section):
    """The fold of the finite elements at 4 kV, the arms as before, the same exponent; the stiffness is theirs too."""
    law = read_calibration("crease_notch")
    fe = settings.replace(notch_law="finite_elements", section=section)
    table, plain = angles(fe), angles(settings.replace(section=section))
    within = 0.01 if section == "ogden" else 0.03
    assert table["notch_deg"][-1] == pytest.approx(np.degrees(law.notch_angle), rel=within)
    np.testing.assert_allclose(table["notch_deg"] / plain["notch_deg"], law.effective_length / law.notch, rtol=1e-6)
    np.testing.assert_allclose(table["arms_deg"], plain["arms_deg"], rtol=1e-9)
    assert fold.exponent(VOLTAGES, table["notch_deg"]) == pytest.approx(law.exponent, abs=0.015)
    assert np.degrees(law.arm_curvature) * 0.045 == pytest.approx(table["arms_deg"][-1], rel=0.01)
    from origami_sim.scenes.de_bender import section as cross_section

    rigidity = cross_section(settings, settings.notch_tape_layers).rigidity
    assert rigidity * settings.width / fold.effective_length(fe) == pytest.approx(law.stiffness, rel=0.01)


def test_a_notch_without_finite_elements_is_refused(settings):
    for change in ({"notch_length": 0.012}, {"notch_tape_layers": 2.0}, {"tape_layers": 4.0}):
        with pytest.raises(InputError, match=rf"another notch.*'{next(iter(change))}'"):
            fold.build(settings.replace(notch_law="finite_elements", **change))


def test_half_the_pressure_of_the_paper_folds_about_half_as_far(settings):
    """A pressure of half the Maxwell stress on both faces is half the stress: a factor of two less at small angles."""
    half, full = (angles(settings.replace(pressure_share=p), VOLTAGES[:2])["notch_deg"] for p in (0.5, 1.0))
    np.testing.assert_allclose(half / full, 0.5, rtol=0.02)
    assert np.all(half < full / 2)  # the layers thin less
