"""Bi-fold: either fold against the beam solution, supports, trends, and both folds in one model."""

import numpy as np
import pytest

from origami_sim.device.scene import follow, read_calibration
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.physics.materials import EPS0
from origami_sim.scenes import bifold
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import equilibrium


@pytest.fixture(scope="module")
def settings():
    return read_calibration(bifold.CALIBRATION)


def magnetic(settings, fields, **values) -> np.ndarray:
    """Angle about y [deg] with the x edges held."""
    model, parameters, _ = bifold.build(settings.replace(support="x edges", **values))
    drives = [Drive(field=(0, 0, b)) for b in fields]
    angles, notes = follow(model, parameters, drives, lambda x: bifold.fold_angles(model, x)[1])
    assert not notes
    return np.degrees(angles)


def electric(settings, support, *, stepped=None, voltage=40e3, **values) -> float:
    """Angle about x [deg], of the table's thin active layer."""
    s = settings.replace(**({"support": support} | bifold.ELECTRIC | values))
    model, parameters, _ = bifold.build(s, stepped=stepped)
    found = equilibrium(model, parameters, Drive(voltage=voltage))
    assert found.converged and found.stable, found.message
    return float(np.degrees(bifold.fold_angles(model, found.x)[0]))


# magnetic -------------------------------------------------------------------------------------------------------------


def test_magnetic_fold_is_that_of_the_beam(settings):
    np.testing.assert_allclose(magnetic(settings, bifold.FIELDS), bifold.REFERENCE, rtol=0.015)
    finer = magnetic(settings, bifold.FIELDS[[0, 3]], cells=4)
    np.testing.assert_allclose(finer, bifold.REFERENCE[[0, 3]], rtol=0.004)


def test_panels_that_bend_between_the_hinges_make_the_sheet_too_soft(settings):
    """Why earlier angles were up to 1.6 times the beam's: the diagonals bent on top of the hinges."""
    stiff, soft = (magnetic(settings, bifold.FIELDS[:1], twist=t)[0] for t in (100, 1))
    assert soft > 1.1 * stiff
    assert magnetic(settings, bifold.FIELDS[:1], twist=1000)[0] == pytest.approx(stiff, rel=0.003)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"de_width": 4e-3, "mae_width": 6.5e-3}, 29.0),
        ({"de_width": 6.5e-3, "mae_width": 2.75e-3}, 17.0),
        ({"underlayer_modulus": 1.4e6}, 25.9),
        ({"underlayer_modulus": 1.6e6}, 24.8),
        ({"active_thickness": 0.5e-3}, 25.06),
        ({"active_thickness": 0.7e-3}, 25.20),
    ],
)
def test_magnetic_fold_depends_on_the_design_as_the_beam_does(settings, values, expected):
    assert magnetic(settings, bifold.FIELDS[2:3], **values)[0] == pytest.approx(expected, rel=0.01)


def test_fold_grows_less_than_the_field_and_turns_with_it(settings):
    fields = np.array([0.05, 0.1, 0.2])
    angles = magnetic(settings, fields)
    assert np.all(angles > 0)
    assert np.all(np.diff(angles) > 0)
    assert np.all(np.diff(angles / fields) < 0)
    np.testing.assert_allclose(magnetic(settings, -fields), -angles, atol=1e-5)


def test_a_plate_folds_less_than_a_strip_but_not_as_much_as_its_modulus(settings):
    strip, plate = (magnetic(settings, [2e-3], section=section)[0] for section in ("strip", "plate"))
    assert plate == pytest.approx(strip * (1 - settings.poisson**2), rel=1e-3)


def test_no_drive_no_fold(settings):
    assert np.abs(magnetic(settings, [0.0])).max() < 1e-9


# electric -------------------------------------------------------------------------------------------------------------


def test_electric_fold_with_a_sliding_end_is_that_of_the_beam(settings):
    found = [electric(settings, "y edges sliding", underlayer_modulus=e) for e in bifold.MODULI]
    np.testing.assert_allclose(found, bifold.REFERENCE_ELECTRIC, rtol=0.025)


def test_held_ends_block_the_electric_fold(settings):
    for modulus in (250e6, 1000e6, 1e6):
        free = electric(settings, "y edges sliding", underlayer_modulus=modulus)
        assert abs(electric(settings, "y edges", underlayer_modulus=modulus)) < 1e-3 * abs(free)
    # what is left comes from panels that give way between hinges
    left = [abs(electric(settings, "y edges", underlayer_modulus=250e6, twist=t)) for t in (100, 1000, 10000)]
    assert left[1] < 0.5 * left[0]
    assert left[2] < 0.5 * left[1] or left[2] < 0.1 * left[0]


def test_the_thrust_has_to_act_at_its_height(settings):
    """Hinges in one plane give the thrust of held ends no lever, and the sheet folds as if an end could slide."""
    free = electric(settings, "y edges sliding", underlayer_modulus=500e6)
    assert electric(settings, "y edges", underlayer_modulus=500e6, stepped=False) == pytest.approx(free, rel=0.01)
    stepped = electric(settings, "y edges sliding", underlayer_modulus=500e6, stepped=True)
    assert stepped == pytest.approx(free, rel=0.005)


def test_electric_fold_goes_with_the_square_of_the_voltage(settings):
    one, two, back = (
        electric(settings, "y edges sliding", underlayer_modulus=500e6, voltage=v) for v in (2e4, 4e4, -4e4)
    )
    assert two == pytest.approx(4 * one, rel=1e-4)
    assert back == pytest.approx(two, rel=1e-9)


# both -----------------------------------------------------------------------------------------------------------------


def settled(settings, **drive) -> np.ndarray:
    """Angles about x and y [deg] of the sheet held in its middle, after a ramp."""
    model, parameters, _ = bifold.build(settings.replace(**bifold.COARSE))
    motion = simulate(model, parameters, Drive(**drive), duration=0.15, rate=20)
    assert not motion.failures
    return np.degrees(bifold.fold_angles(model, motion.x[-1, :, 0]))


def test_one_model_folds_about_x_in_a_voltage_and_about_y_in_a_field(settings):
    s = settings
    about_x, about_y = settled(s, voltage=ramp(s.voltage, 0.06))
    full, notched = (bifold.section(s, t) for t in (s.underlayer_thickness, s.notch_thickness))
    pressure = 0.5 * s.permittivity * EPS0 * (s.voltage / (s.active_thickness + s.underlayer_thickness)) ** 2
    thrust = pressure * s.active_thickness * 3 * s.de_width
    curvature = [
        thrust * at.lever / (3 * s.de_width * at.rigidity[0] + 2 * s.mae_width * at.rigidity[1])
        for at in (full, notched)
    ]
    b = s.notch_length / 2
    a = s.side / 2 - b
    rise = curvature[1] * b * (b / 2 + a) + curvature[0] * a**2 / 2
    assert about_x == pytest.approx(np.degrees(rise / (s.side / 2)), rel=0.05)
    assert abs(about_y) < 0.1 * about_x

    about_x, about_y = settled(s, field=(0, 0, ramp(s.field, 0.06)))
    assert about_y > 40
    assert abs(about_x) < 0.1


@pytest.mark.slow
def test_run_shows_both_folds_and_both_tables(settings):
    outcome = bifold.run(settings)
    assert not outcome.trajectory.failures
    assert len(outcome.summary) == 1, outcome.summary
    n = outcome.numbers
    assert n["voltage_about_x_deg"] > 4 > 0.5 > abs(n["voltage_about_y_deg"])
    assert n["field_about_y_deg"] > 40 > 0.1 > abs(n["field_about_x_deg"])
    # a sheet folded far about y cannot fold about x too
    assert n["both_about_y_deg"] > 40 > 0.1 > abs(n["both_about_x_deg"])
    table = outcome.tables["electric"]
    assert np.all(np.abs(table["held_deg"]) < 0.02 * np.abs(table["sliding_deg"]))
    motion = outcome.trajectory
    balance = motion.energy_balance()
    assert np.ptp(balance) < 0.01 * np.ptp(motion.energies["crease"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"mae_width": 0.006}, r"do not fill the sheet.*mae_width.*allowed: 3 de_width"),
        ({"de_width": 0.003, "mae_width": 0.0065, "width": 0.022, "notch_length": 0.004}, r"wider than its strip"),
        ({"underlayer_thickness": 0.0004}, r"leaves more than there is.*notch_thickness"),
    ],
)
def test_impossible_sheets_are_refused(settings, values, message):
    with pytest.raises(InputError, match=message):
        bifold.build(settings.replace(**values))


def test_unknown_support_is_refused(settings):
    with pytest.raises(InputError, match=r"support.*xy faces.*centre, x edges, y edges, y edges sliding"):
        settings.replace(support="xy faces")
