"""The folding strip against rigid patches on lumped hinges, solved apart from this code; reversal; the accordion."""

import numpy as np
import pytest
from scipy.optimize import root

from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.scenes import folding_strip as strip
from origami_sim.solve.motion.dynamics import simulate

FIELDS = np.array([0.02, 0.05, 0.1, 0.2])
END = np.array([37.4, 54.7, 66.0, 75.3])
INNER = np.array([5.4, 23.1, 43.3, 61.2])
MEAN = np.array([21.4, 38.9, 54.7, 68.3])
"""Angles [deg] of four patches at FIELDS: the project's reference solution."""


@pytest.fixture(scope="module")
def settings():
    return read_calibration(strip.CALIBRATION)


def lumped(patches: int, fields) -> np.ndarray:
    """Inclinations [deg] of free rigid patches on hinges: K (2 th_i - th_i-1 - th_i+1) = s_i m B cos th_i."""
    length = 2.54e-3 + 2 * 0.66 * 1.27e-3
    stiffness = 1.5e6 / (1 - 0.49**2) * 19.05e-3 * 1.27e-3**3 / 12 / length
    moment = 0.130 / (4e-7 * np.pi) * 11.43e-3 * 19.05e-3 * 3.175e-3
    sign = (-1.0) ** np.arange(patches)
    bending = np.zeros((patches, patches))
    for i in range(patches - 1):
        bending[i : i + 2, i : i + 2] += [[1, -1], [-1, 1]]
    angle, out, before = 0.1 * sign, [], 1e-3
    for b in fields:
        for step in np.geomspace(before, b, 12):

            def moments(a, b=step):
                return bending @ a - sign * moment / stiffness * b * np.cos(a)

            angle = root(moments, angle, tol=1e-12).x
            assert np.abs(moments(angle)).max() < 1e-9
        before = b
        out.append(np.degrees(angle))
    return np.array(out)


def folds(settings, fields) -> np.ndarray:
    angles, notes = strip.fold(settings, fields)
    assert not notes
    return np.degrees(angles)


def test_the_reference_solution():
    angles = np.abs(lumped(4, FIELDS))
    np.testing.assert_allclose(angles[:, [0, 3]], END[:, None] + np.zeros(2), atol=0.06)
    np.testing.assert_allclose(angles[:, [1, 2]], INNER[:, None] + np.zeros(2), atol=0.06)


def test_unequal_folding(settings):
    angles = folds(settings, FIELDS)
    np.testing.assert_array_equal(np.sign(angles), np.tile([1, -1, 1, -1], (4, 1)))
    np.testing.assert_allclose(angles, lumped(4, FIELDS), atol=0.15)
    size = np.abs(angles)
    end, inner = size[:, [0, 3]].mean(1), size[:, [1, 2]].mean(1)
    np.testing.assert_allclose(end / inner, END / INNER, rtol=0.03)
    np.testing.assert_allclose(size.mean(1), MEAN, atol=0.1)
    assert (end / inner)[[0, -1]] == pytest.approx([6.9, 1.23], rel=0.03)


@pytest.mark.parametrize("patches", [2, 6])
def test_other_numbers_of_patches(settings, patches):
    np.testing.assert_allclose(
        folds(settings.replace(patches=float(patches)), FIELDS), lumped(patches, FIELDS), atol=0.2
    )


def test_angles_are_odd_in_the_field_and_return_to_flat(settings):
    up = folds(settings, [0.05, 0.2, 0.05, 0.0])
    down = folds(settings, [-0.05, -0.2, -0.05, 0.0])
    np.testing.assert_allclose(down, -up, atol=1e-7)
    np.testing.assert_allclose(up[2], up[0], atol=1e-6)
    np.testing.assert_allclose(up[3], 0.0, atol=1e-6)
    there_and_back = folds(settings, [0.2, 0.0, -0.2, 0.0, 0.2])
    np.testing.assert_allclose(there_and_back[4], there_and_back[0], atol=1e-6)
    np.testing.assert_allclose(there_and_back[2], -there_and_back[0], atol=1e-6)


@pytest.mark.parametrize("patches", [4, 6])
def test_accordion_in_motion(settings, patches):
    """Every other crease is a valley at +B and a mountain at -B, and the floating strip does not drift."""
    chosen = settings.replace(patches=float(patches))
    model, parameters, drive = strip.build(chosen)
    motion = simulate(model, parameters, drive, duration=8.0, rate=10)
    assert not motion.failures
    creases = motion.creases[:, :, 0]
    up, down = (int(np.argmin(np.abs(motion.times - t))) for t in (2.0, 6.0))
    signs = (-1.0) ** np.arange(patches - 1)
    order = np.argsort(model.position[model.creases[:, 1], 0])
    for frame, sense in ((up, -1.0), (down, 1.0)):
        np.testing.assert_array_equal(np.sign(creases[frame, order]), sense * signs)
    np.testing.assert_allclose(creases[down], -creases[up], atol=2e-3)
    angles = np.degrees(strip.inclinations(chosen, motion.x[up, :, 0]))
    np.testing.assert_allclose(angles, folds(chosen, [0.05, 0.2])[-1], atol=0.3)
    assert np.abs(motion.centre_of_mass() - motion.centre_of_mass()[0]).max() < 1e-9


def test_an_odd_number_of_patches_is_refused(settings):
    with pytest.raises(InputError, match="even number"):
        strip.build(settings.replace(patches=3.0))


def test_run(settings):
    outcome = strip.run(settings)
    assert not outcome.trajectory.failures
    table = outcome.tables["fold_angle"]
    np.testing.assert_allclose(table["end_deg"], table["reference_end_deg"], atol=0.15)
    assert outcome.numbers["left_deg"] < 0.1
