"""Bi-fold, magnetic side: signs and trends of the beam solution, magnitude within a factor of two."""

import numpy as np
import pytest

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.scene import follow, read_calibration
from origami_sim.scenes import bifold

BEAM = np.array([10.9, 19.4, 25.3, 29.4])
"""Fold angle [deg] at 2.67 T times 0.025, 0.05, 0.075 and 0.1: independent beam solution."""


@pytest.fixture(scope="module")
def settings():
    return read_calibration(bifold.CALIBRATION)


def fold(settings, fields) -> np.ndarray:
    model, parameters, _ = bifold.build(settings)
    drives = [Drive(field=(0, 0, b)) for b in fields]
    angles, notes = follow(model, parameters, drives, lambda x: bifold.fold_angle(model, x, settings.side))
    assert not notes
    return np.degrees(angles)


def test_magnitude_is_that_of_the_beam_within_a_factor_of_two(settings):
    angles = fold(settings, bifold.FIELDS)
    assert np.all(angles > BEAM / 2)
    assert np.all(angles < BEAM * 2)


def test_fold_grows_less_than_the_field_and_turns_with_it(settings):
    fields = np.array([0.05, 0.1, 0.2])
    angles = fold(settings, fields)
    assert np.all(angles > 0)
    assert np.all(np.diff(angles) > 0)
    assert np.all(np.diff(angles / fields) < 0)
    np.testing.assert_allclose(fold(settings, -fields), -angles, atol=1e-5)


def test_a_stiffer_or_thicker_underlayer_folds_less(settings):
    base = fold(settings, [0.1])[0]
    assert fold(settings.replace(underlayer_modulus=1.6e6), [0.1])[0] < base
    assert fold(settings.replace(underlayer_thickness=1.2e-3), [0.1])[0] < base


def test_no_field_no_fold(settings):
    assert np.abs(fold(settings, [0.0])).max() < 1e-9


def test_dynamics_ends_where_statics_does(settings):
    outcome = bifold.run(settings)
    assert not outcome.trajectory.failures
    assert outcome.numbers["angle_deg"] == pytest.approx(fold(settings, [settings.field])[0], abs=0.1)


def test_strips_must_fill_the_sheet(settings):
    with pytest.raises(InputError, match=r"do not fill the sheet.*mae_width.*allowed: 3 de_width"):
        bifold.build(settings.replace(mae_width=0.006))
