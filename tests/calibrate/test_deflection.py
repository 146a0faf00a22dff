"""Beams calibrated by their deflection against field: the elastica, known answers, a measured beam, bad input."""

import math

import numpy as np
import pytest

from origami_sim.calibrate import command
from origami_sim.calibrate.deflection import elastica
from origami_sim.calibrate.experiment import calibration, fit_deflection, plot_fit, summary
from origami_sim.calibrate.result import read_result, write_calibration
from origami_sim.device.scene import read_calibration, recordings_folder
from origami_sim.errors import InputError
from origami_sim.physics.materials import MU0
from origami_sim.scenes import mae_cantilever

LENGTH, THICKNESS, REMANENCE, MODULUS = 0.0172, 0.00084, 0.143, 909e3
SIZE = {"length": LENGTH, "thickness": THICKNESS}
FIELDS = np.linspace(0.002, 0.05, 15)


def load(field, modulus=MODULUS):
    return 12 * REMANENCE * field / (MU0 * modulus) * (LENGTH / THICKNESS) ** 2


def curve(rng=None, noise=0.0, fields=FIELDS):
    y = elastica(load(fields))[1]
    return fields, y if rng is None else y + rng.normal(0, noise, len(y))


def test_elastica_is_the_tabulated_one():
    """Tip displacement by lambda, from a quadrature solved apart from this code."""
    x, y = elastica([0.1, 0.5, 1, 2, 5, 10, 20, 40])
    table = [0.03330, 0.16292, 0.30695, 0.51895, 0.81225, 0.98240, 1.10559, 1.19420]
    assert np.hypot(1 - x, y) == pytest.approx(table, abs=6e-6)
    x, y = elastica([37.769, -37.769], tilt=math.radians(5))
    assert np.hypot(1 - x, y) == pytest.approx([1.1345, 1.2391], abs=6e-5)
    assert elastica([1e-3])[1][0] == pytest.approx(1e-3 / 3, rel=1e-6)  # small deflections


def test_a_beam_is_mirrored_by_its_field():
    x, y = elastica([-3.0, 0.0, 3.0])
    assert y[0] == pytest.approx(-y[2], abs=1e-12)
    assert (x[1], y[1]) == pytest.approx((1.0, 0.0), abs=1e-12)


def test_modulus_or_remanence_of_a_computed_beam_without_noise():
    assert fit_deflection(*curve(), **SIZE, remanence=REMANENCE)["modulus"] == pytest.approx(MODULUS, rel=1e-6)
    assert fit_deflection(*curve(), **SIZE, modulus=MODULUS)["remanence"] == pytest.approx(REMANENCE, rel=1e-6)
    x, y = elastica(load(FIELDS))
    total = fit_deflection(FIELDS, np.hypot(1 - x, y), **SIZE, remanence=REMANENCE, measure="total")
    assert total["modulus"] == pytest.approx(MODULUS, rel=1e-6)


def test_the_chain_of_the_simulator_has_the_modulus_that_it_was_given():
    s = read_calibration("magnetic_beam").replace(cells=20.0)
    table, notes = mae_cantilever.bend(s, FIELDS[::2])
    assert not notes
    size = {"length": s.length, "thickness": s.thickness}
    found = fit_deflection(FIELDS[::2], table["y_over_l"], **size, remanence=s.remanence)
    assert found["modulus"] == pytest.approx(s.modulus, rel=0.01)


def test_tilt_of_the_field_is_found_beside_the_modulus():
    y = elastica(load(FIELDS), tilt=0.1)[1]
    found = fit_deflection(FIELDS, y, **SIZE, remanence=REMANENCE, tilted=True)
    assert (found["modulus"], found["misalignment"]) == pytest.approx((MODULUS, 0.1), rel=1e-4)


@pytest.mark.slow
def test_intervals_cover_at_their_level():
    rng = np.random.default_rng(21)
    hits = []
    for _ in range(100):
        low, high = fit_deflection(*curve(rng, 0.01), **SIZE, remanence=REMANENCE).interval("modulus")
        hits.append(low <= MODULUS <= high)
    assert abs(np.mean(hits) - 0.95) < 0.05


def test_both_parameters_are_bounded_whatever_their_units():
    """A modulus of 1e6 Pa beside a tilt of 0.1: the profile of neither may run to its end."""
    rng = np.random.default_rng(3)
    fields, y = curve(rng, 0.005)
    found = fit_deflection(fields, y, **SIZE, remanence=REMANENCE, tilted=True)
    low, high = found.interval("modulus")
    assert 0.5 * MODULUS < low < MODULUS < high < 2 * MODULUS
    assert not any("does not bound" in w for w in found.warnings)


def test_without_remanence_and_modulus_only_their_ratio_can_be_known():
    found = fit_deflection(*curve(), **SIZE)
    assert found["load_per_field"] == pytest.approx(load(1.0), rel=1e-6)
    assert len(found.warnings) == 1
    assert "only the ratio remanence/modulus can be known" in found.warnings[0]
    assert f"{REMANENCE / MODULUS:.4g} T/Pa" in found.warnings[0]
    assert fit_deflection(*curve())["load_per_field"] == pytest.approx(load(1.0), rel=1e-6)


# --- the measured beam ------------------------------------------------------------------------------------------------

BEAM = ["deflection", "magnetic_beam/beam.csv", "--field-unit=mT", "--length=17.2mm", "--thickness=0.84mm"]


@pytest.fixture
def recordings():
    folder = recordings_folder()
    if folder is None:
        pytest.skip("the real recordings are missing (set ORIGAMI_RECORDINGS)")
    return folder


def test_measured_beam(recordings, tmp_path):
    """The published modulus, 3 x 303 kPa, lies in the interval; the residual's shape is seen and said."""
    done = command.build([*BEAM, "--remanence=143mT"])
    low, high = done.fit.interval("modulus")
    assert low < 3 * 303e3 < high
    assert done.fit["modulus"] == pytest.approx(0.95e6, rel=0.01)
    assert np.abs(done.fit.y - done.fit.model).max() < 0.05
    assert any("correlated" in w for w in done.fit.warnings)
    assert plot_fit(done.fit, tmp_path / "beam.png", title=done.calibration.title).stat().st_size > 1e4
    path = write_calibration(tmp_path / "beam.toml", done.calibration)
    assert read_result(path) == done.calibration
    assert all(same for *_, same in command.again(path))


def test_measured_beam_determines_the_ratio_alone(recordings):
    done = command.build(BEAM)
    assert any("only the ratio remanence/modulus" in w for w in done.calibration.warnings)
    ratio = command.build([*BEAM, "--modulus=909kPa"]).fit["remanence"] / 909e3
    assert done.fit["load_per_field"] == pytest.approx(12 / MU0 * ratio * (17.2 / 0.84) ** 2, rel=1e-4)


def test_summary_of_a_large_number_is_rounded_to_its_uncertainty():
    found = fit_deflection(*curve(np.random.default_rng(5), 0.01), **SIZE, remanence=REMANENCE)
    text = summary(calibration(found, title="t", command="c", source="s"))
    assert text.startswith("modulus = 9.") and "e+05" in text.split("(")[0]


# --- bad input --------------------------------------------------------------------------------------------------------

Y = curve()[1]
BROKEN = np.where(np.arange(len(Y)) == 4, np.nan, Y)
ZIGZAG = np.append(FIELDS[:10], FIELDS[5:10])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fit_deflection(FIELDS[:2], Y[:2], **SIZE, remanence=0.1), ["too few points", "2", "3 or more"]),
        (lambda: fit_deflection(ZIGZAG, Y, **SIZE, remanence=0.1), ["not monotone", "point 11", "one branch"]),
        (lambda: fit_deflection(FIELDS, BROKEN, **SIZE, remanence=0.1), ["point 5", "not a finite number"]),
        (lambda: fit_deflection(FIELDS, -Y, **SIZE, remanence=0.1), ["modulus would be negative", "along the field"]),
        (lambda: fit_deflection(FIELDS, 17.2 * Y, **SIZE, remanence=0.1), ["beyond the reach", "below 1"]),
        (lambda: fit_deflection(FIELDS, 0 * Y, **SIZE, remanence=0.1), ["does not move", "infinite"]),
        (lambda: fit_deflection(FIELDS, Y, remanence=0.1), ["size is needed", "length and thickness"]),
        (lambda: fit_deflection(FIELDS, Y, length=0.1), ["size is needed", "thickness"]),
        (lambda: fit_deflection(FIELDS, Y, **SIZE, remanence=0.1, modulus=1e6), ["not both"]),
        (lambda: fit_deflection(FIELDS, Y, **SIZE, modulus=-1e6), ["must be positive", "modulus", "> 0"]),
        (lambda: fit_deflection(FIELDS, Y, measure="up"), ["no such measure", "across, total"]),
        (lambda: command.build(["deflection", "b.csv", "--field-unit=mT", "--columns=b,tip_mm"]),
         ["unit of a column is not stated", "tip_mm", "mm"]),
        (lambda: command.build([*BEAM[:3], "--length=17.2"]), ["needs a number with its unit", "--length"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(w in str(error.value) for w in words), str(error.value)
    assert "\n" not in str(error.value)


def test_columns_without_units_and_in_millimetres(tmp_path):
    file = tmp_path / "beam.csv"
    file.write_text("\n".join(["b,tip", *(f"{1e3 * b},{1e3 * LENGTH * y}" for b, y in zip(FIELDS, Y, strict=True))]))
    words = ["deflection", str(file), "--columns=b,tip"]
    with pytest.raises(InputError, match=r"unit of a column is not stated.*'b'.*mT"):
        command.build([*words, "--deflection-unit=mm", "--length=17.2mm"])
    with pytest.raises(InputError, match=r"unit of a column is not stated.*'tip'.*mm"):
        command.build([*words, "--field-unit=mT"])
    with pytest.raises(InputError, match=r"size is needed.*--length"):
        command.build([*words, "--field-unit=mT", "--deflection-unit=mm"])
    given = [*words, "--field-unit=mT", "--deflection-unit=mm", "--length=17.2mm", "--thickness=0.84mm"]
    assert command.build([*given, "--remanence=0.143T"]).fit["modulus"] == pytest.approx(MODULUS, rel=1e-5)
