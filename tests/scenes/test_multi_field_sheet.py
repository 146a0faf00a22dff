"""The sheet of three fields: its shapes against chains and hinges solved apart, and its way back to flat."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.physics.materials import EPS0, MU0
from origami_sim.scenes import multi_field_sheet as sheet


@pytest.fixture(scope="module")
def settings():
    return read_calibration(sheet.CALIBRATION)


@pytest.fixture(scope="module")
def shapes(settings):
    out = {}
    for field in sheet.SHAPES:
        out[field], notes = sheet.settle(settings, field)
        assert not notes
    return out


@pytest.fixture(scope="module")
def outcome(settings):
    return sheet.run(settings)


def chain(s, field):
    """Inclinations [rad] of one row of rigid panels on torsion springs, the first held: moments balance on each."""
    n = round(s.columns)
    layers = ((s.thickness, s.modulus / (1 - s.poisson**2)),
              (s.bilayer_film_thickness, s.film_modulus / (1 - s.film_poisson**2)))  # fmt: skip
    (t1, e1), (t2, e2) = layers
    rigidity = (e1**2 * t1**4 + e2**2 * t2**4 + 2 * e1 * e2 * t1 * t2 * (2 * t1**2 + 2 * t2**2 + 3 * t1 * t2)) / (
        12 * (e1 * t1 + e2 * t2)
    )  # of two bonded layers, in closed form
    k = rigidity * s.patch_width / s.gap
    couple = s.remanence / MU0 * s.patch_length * s.patch_width * s.patch_thickness
    riser = np.arange(n) % 2 == 1

    def balance(free, b):
        angle = np.concatenate([[0.0], free])
        spring = k * np.diff(angle)
        torque = couple * b * np.where(riser, np.cos(angle), -np.sin(angle))
        return torque[1:] - spring + np.append(spring[1:], 0.0)

    at = np.zeros(n - 1)
    for share in np.linspace(0.01, 1.0, 60):
        at = fsolve(balance, at, args=(share * field,), xtol=1e-12)
    assert np.abs(balance(at, field)).max() < 1e-9 * couple * field
    return np.concatenate([[0.0], at])


def test_magnetic_field_makes_a_stair_step(settings, shapes):
    on = shapes["magnetic"]["on"]
    _, idle, right = sheet.criteria("magnetic", on)
    assert right and np.degrees(idle) < 0.1
    assert np.degrees(on.inclination[1::2]).min() > 80  # risers
    assert np.degrees(np.abs(on.inclination[2::2])).max() < 8  # treads
    steps = round(settings.columns) / 2
    assert on.size[2] == pytest.approx(steps * (settings.patch_length + settings.gap), rel=0.1)


def test_stair_step_is_the_chain_of_rigid_panels(settings, shapes):
    """Panels made rigid: folds as of the chain, and alike in all rows."""
    found, notes = sheet.settle(settings.replace(patch_stiffening=1000.0), "magnetic")
    assert not notes
    angles = np.degrees(chain(settings, settings.field))
    np.testing.assert_allclose(np.degrees(found["on"].along_y), np.diff(angles), atol=0.1)
    np.testing.assert_allclose(np.degrees(shapes["magnetic"]["on"].along_y), np.diff(angles), atol=1.5)


def test_electric_field_makes_an_accordion(settings, shapes):
    on = shapes["electric"]["on"]
    _, idle, right = sheet.criteria("electric", on)
    assert right and idle < 1e-9
    rows = np.degrees(on.rows)
    assert rows[0] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(rows[1:], rows[1] * (-1.0) ** np.arange(len(rows) - 1), atol=1e-6)
    pitch = settings.patch_width + settings.stack_length
    assert on.size[1] == pytest.approx(pitch * np.cos(on.rows).sum(), rel=1e-6)
    assert on.size[2] == pytest.approx(pitch * np.sin(on.rows[1]), rel=1e-6)


@pytest.mark.slow
def test_accordion_is_the_bending_of_a_free_stack(settings, shapes):
    """theta = p H a L / D without thinning, quadratic and even in the voltage; thinning adds to it."""
    s = settings.replace(thinning=False)
    ef = s.film_modulus / (1 - s.film_poisson**2), s.stack_film_thickness
    es = 4 * s.de_shear_modulus, s.layers * s.layer_thickness
    z = (np.arange(200000) + 0.5) / 200000 * (ef[1] + es[1])
    e = np.where(z < ef[1], ef[0], es[0])
    dz, neutral = z[1] - z[0], (e * z).sum() / e.sum()
    pressure = EPS0 * s.permittivity * (s.voltage / s.layer_thickness) ** 2
    moment = pressure * ((z - neutral) * (z > ef[1])).sum() * dz
    expected = moment / ((e * (z - neutral) ** 2).sum() * dz) * s.stack_length
    fold = {v: sheet.settle(s.replace(voltage=v), "electric")[0]["on"].along_x for v in (s.voltage, s.voltage / 2)}
    assert np.abs(fold[s.voltage][1:]) == pytest.approx(expected, rel=1e-3)
    assert fold[s.voltage][0] == pytest.approx(expected / 2, rel=1e-3)
    assert fold[s.voltage] / fold[s.voltage / 2] == pytest.approx(4.0, rel=1e-6)
    more = shapes["electric"]["on"].along_x / fold[s.voltage]
    assert np.all((more > 1.05) & (more < 1.15))
    half = sheet.settle(s.replace(pressure_share=0.5), "electric")[0]["on"].along_x
    assert half == pytest.approx(fold[s.voltage] / 2, rel=1e-6)


def test_temperature_rolls_the_sheet_up(settings, shapes):
    on = shapes["thermal"]["on"]
    _, idle, right = sheet.criteria("thermal", on)
    assert right and idle < 1e-9
    turn = sheet.bilayer(settings)[1] * settings.temperature
    np.testing.assert_allclose(on.along_y, turn, rtol=1e-6)  # nothing resists: each crease reaches its free turn
    # edges of equal chords turned by `turn` each: the ends are this far apart
    n, pitch = round(settings.columns), settings.patch_length + settings.gap
    assert on.gap == pytest.approx(pitch * abs(np.sin(n * turn / 2) / np.sin(turn / 2)), rel=1e-6)
    assert on.gap < 0.5 * pitch


def test_every_shape_goes_when_its_field_goes(shapes):
    for field, found in shapes.items():
        off = found["off"]
        assert np.abs(np.concatenate([off.along_y, off.along_x])).max() < 1e-6, field
        assert off.size[2] < 1e-9


def test_opposite_fields_fold_the_other_way(shapes):
    magnetic, thermal = shapes["magnetic"]["reversed"], shapes["thermal"]["reversed"]
    assert np.all(magnetic.inclination[1:] < 0)
    assert np.all(thermal.along_y < 0)
    np.testing.assert_allclose(thermal.along_y / shapes["thermal"]["on"].along_y, -10 / 60, rtol=1e-6)


@pytest.mark.slow
def test_cold_mirrors_the_roll_and_a_reversed_voltage_changes_nothing(settings, shapes):
    cold, notes = sheet.settle(settings.replace(temperature=-60.0), "thermal")
    assert not notes
    np.testing.assert_allclose(cold["on"].along_y, -shapes["thermal"]["on"].along_y, rtol=1e-6)
    from origami_sim.device.scene import follow

    model, parameters, _ = sheet.build(settings)
    drives = [sheet.steady(settings, "electric", sign) for sign in (1.0, -1.0)]
    x, notes = follow(model, parameters, drives, lambda x: x)
    assert not notes
    np.testing.assert_allclose(x[1], x[0], atol=1e-12)


@pytest.mark.slow
def test_the_three_fields_in_sequence(settings, outcome):
    motion, table = outcome.trajectory, outcome.tables["shapes"]
    assert not motion.failures
    assert table["shape"] == ["stair step", "accordion", "roll"]
    assert max(table["left_deg"]) < 0.01
    assert max(table["removed_deg"]) < 1e-6
    # at the end of each hold the motion has the fold of the statics
    _, creases = sheet.assembled(settings)
    for k, field in enumerate(sheet.SHAPES):
        frame = int(np.argmin(np.abs(motion.times - (6.0 * k + sheet.RAMP + sheet.HOLD))))
        lines = creases.along_x[1:] if field == "electric" else creases.along_y
        fold = np.degrees(np.abs(motion.creases[frame, lines, 0])).mean()
        assert fold == pytest.approx(table["fold_deg"][k], abs=0.3), field


@pytest.mark.slow
def test_one_field_alone_folds_and_returns(settings):
    alone = sheet.run(settings.replace(mode="electric"))
    table, motion = alone.tables["shapes"], alone.trajectory
    assert not motion.failures
    assert (table["field"], table["shape"]) == (["electric"], ["accordion"])
    assert table["left_deg"][0] < 0.01 and table["flat_after_s"][0] < 1.0
    assert motion.times[-1] == pytest.approx(6.0)
    held = int(np.argmin(np.abs(motion.times - (sheet.RAMP + sheet.HOLD))))
    worst = np.degrees(np.abs(motion.creases[held, :, 0]).max())
    assert worst == pytest.approx(table["fold_deg"][0], abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("field", ["magnetic", "thermal"])
def test_an_opposite_field_unfolds_faster(settings, outcome, field):
    alone = sheet.run(settings.replace(mode=field, unfold="reverse"))
    name = f"{field}_flat_after_s"
    assert alone.tables["shapes"]["field"] == [field]
    assert alone.tables["shapes"]["left_deg"][0] < 0.01
    assert alone.numbers[name] < outcome.numbers[name] - 0.1


def test_treads_and_risers_need_an_even_number(settings):
    with pytest.raises(InputError, match=r"treads and risers alternate.*columns.*even number"):
        sheet.build(settings.replace(columns=5.0))
