"""The box: flap angle against field, by statics and by dynamics brought to rest (independent lumped solution)."""

import numpy as np
import pytest

from origami_sim.device.scene import follow, read_calibration
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.scenes import box
from origami_sim.solve.motion.dynamics import simulate

FIELDS = np.array([0.010, 0.020, 0.050, 0.100, 0.150, 0.200])
LUMPED = np.array([20.4, 38.6, 62.0, 74.0, 78.8, 81.4])
"""Inclination [deg] at FIELDS: K (theta - theta0) = m B cos(theta) - weight, solved apart from this code."""


@pytest.fixture(scope="module")
def settings():
    return read_calibration(box.CALIBRATION)


def statics(settings, fields=FIELDS) -> np.ndarray:
    angles, notes = box.flap_angles(settings, fields)
    assert not notes
    return np.degrees(angles)


def test_statics_gives_the_reference(settings):
    angles = statics(settings)
    np.testing.assert_allclose(angles, LUMPED[:, None] + np.zeros(4), atol=0.5)
    assert np.ptp(angles, axis=1).max() < 0.05


def test_dynamics_comes_to_rest_at_the_reference(settings):
    """All fields at once: a world for each."""
    model, parameters, _ = box.build(settings)
    motion = simulate(model, parameters, Drive(field=(0, 0, ramp(FIELDS, 2.0))), duration=3.0, rate=10)
    assert not motion.failures
    assert motion.energies["kinetic"][-1].max() < 1e-12
    faces = box.pattern(settings).faces
    angles = np.degrees([box.inclination(motion.x[-1, :, w], faces) for w in range(len(FIELDS))])
    np.testing.assert_allclose(angles, LUMPED[:, None] + np.zeros(4), atol=0.5)
    assert np.ptp(angles, axis=1).max() < 0.05
    np.testing.assert_allclose(angles, statics(settings), atol=1e-3)


@pytest.mark.parametrize(("change", "expected"), [({"modulus": 1.4e6}, 81.9), ({"modulus": 1.6e6}, 80.9)])
def test_a_softer_sheet_folds_further(settings, change, expected):
    assert statics(settings.replace(**change), FIELDS[-1:]).mean() == pytest.approx(expected, abs=0.5)


def test_without_weight_field_reversal_mirrors_the_box(settings):
    weightless = settings.replace(gravity=0.0)
    up, down = statics(weightless), statics(weightless, -FIELDS)
    assert up[-1].mean() == pytest.approx(81.31, abs=0.1)
    np.testing.assert_allclose(down, -up, atol=1e-6)


def test_weight_helps_flaps_that_fold_downwards(settings):
    up, down = statics(settings), statics(settings, -FIELDS)
    weightless = statics(settings.replace(gravity=0.0))
    assert np.all(-down > weightless)
    assert np.all(up[:4] < weightless[:4])  # past about 75 deg the patch inside leans over the crease


def test_gap_makes_the_hinge_softer(settings):
    """Fold at 0.2 T for gaps of 1.27, 2.54, 3.81 and 5.08 mm: 78, 81, 83, 84.5 deg (lumped, rounded)."""
    angles = [statics(settings.replace(gap=gap), FIELDS[-1:]).mean() for gap in (1.27e-3, 2.54e-3, 3.81e-3, 5.08e-3)]
    np.testing.assert_allclose(angles, [78, 81, 83, 84.5], atol=0.7)


def test_an_oscillating_field_folds_the_box_both_ways(settings):
    outcome = box.run(settings.replace(mode="oscillate", field=0.05))
    motion = outcome.trajectory
    assert not motion.failures
    faces = box.pattern(settings).faces
    mean = np.array([box.inclination(x, faces).mean() for x in motion.x[:, :, 0]])
    field = 0.05 * np.sin(2 * np.pi * motion.times)
    strong = np.abs(field) > 0.025
    assert np.all(np.sign(mean[strong]) == np.sign(field[strong]))
    assert np.degrees(np.abs(mean)).max() < 90


def test_the_table_has_the_reference_beside_it(settings):
    outcome = box.run(settings)
    assert outcome.numbers["largest_difference_deg"] < 0.5
    assert outcome.numbers["flap_deg"] == pytest.approx(81.4, abs=0.5)
    np.testing.assert_allclose(outcome.tables["flap_angle"]["reference_deg"], LUMPED)


def test_the_reference_is_left_out_where_it_is_of_another_box(settings):
    outcome = box.run(settings.replace(gap=0.004))
    assert outcome.tables["flap_angle"].keys() == {"field_mT", "flap_deg", "spread_deg"}
    assert outcome.numbers.keys() == {"flap_deg"}


# --- the crease by finite elements ------------------------------------------------------------------------------------


def lumped(settings, fields) -> np.ndarray:
    """Inclination [deg] of a rigid flap on the tabulated moment, without weight: M(theta) = m B cos(theta)."""
    from scipy.interpolate import CubicSpline
    from scipy.optimize import brentq

    from origami_sim.calibrate.result import table
    from origami_sim.physics.materials import MU0

    law = read_calibration("crease_bridge")
    moment = table(law, "resisting_moment") * settings.patch_width / law.width
    spline = CubicSpline(np.linspace(law.angle_min, law.angle_max, len(moment)), moment)
    volume = settings.patch_length * settings.patch_width * settings.patch_thickness
    couple = settings.remanence / MU0 * volume
    return np.degrees([brentq(lambda a, b=b: spline(a) - couple * b * np.cos(a), -1.6, 1.6) for b in fields])


def test_crease_by_finite_elements_folds_a_little_further(settings):
    """The reference's linear crease is up to 1.6 deg stiffer towards the patches, and alike away from them."""
    fe = settings.replace(crease_law="finite_elements", gravity=0.0)
    up, down = statics(fe), statics(fe, -FIELDS)
    np.testing.assert_allclose(up, lumped(fe, FIELDS)[:, None] + np.zeros(4), atol=0.05)
    np.testing.assert_allclose(down, lumped(fe, -FIELDS)[:, None] + np.zeros(4), atol=0.05)
    linear = statics(settings.replace(gravity=0.0))
    assert np.all((up - linear > 0.4) & (up - linear < 1.7))
    assert np.abs(-down - linear).max() < 0.3


def test_default_crease_is_that_of_finite_elements_at_rest(settings):
    """End correction 0.66 of the default against the 0.674 of the shipped finite elements."""
    from origami_sim.physics.materials import bridge_stiffness

    linear = bridge_stiffness(
        settings.modulus, settings.patch_width, settings.thickness, settings.gap, poisson=settings.poisson,
        end_correction=settings.end_correction,
    )  # fmt: skip
    assert box.slope_at_rest(box.bridge_law(settings)) == pytest.approx(linear, rel=0.01)


def test_a_bridge_without_finite_elements_is_refused(settings):
    with pytest.raises(InputError, match=r"another bridge.*'gap'.*0\.00254 m"):
        box.build(settings.replace(crease_law="finite_elements", gap=3.81e-3))


@pytest.mark.slow
def test_a_small_box_closes_until_its_patches_meet(settings):
    """Below the angle at which they meet nothing changes; above, it stands there but for what contact gives way."""
    small = settings.replace(base=0.022)
    stop = np.degrees(box.closed(small))
    assert 60 < stop < 70
    assert np.degrees(box.closed(settings)) > 90 and "touch" not in box.build(settings)[0].laws
    model, parameters, _ = box.build(small)
    parameters.set("touch", "stiffness", 25 * parameters["touch", "stiffness"])
    faces = box.pattern(small).faces
    drives = [Drive(field=(0, 0, b)) for b in FIELDS]
    angles, notes = follow(model, parameters, drives, lambda x: box.inclination(x, faces))
    assert not notes
    angles = np.degrees(angles)
    np.testing.assert_allclose(angles[:3], LUMPED[:3, None] + np.zeros(4), atol=0.5)
    assert np.all((angles[3:] > stop) & (angles[3:] < stop + 0.6))  # pressed in by the moment over the stiffness
    assert np.ptp(angles, axis=1).max() < 0.05


def test_without_touch_it_closes_through_its_patches(settings):
    small = settings.replace(base=0.022)
    np.testing.assert_allclose(statics(small.replace(touch="off"))[-1], LUMPED[-1], atol=0.5)
