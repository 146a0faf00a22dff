"""A calibration is written whole, read back equal, by the scenes' reader too, and refused with one sentence."""

import math
from dataclasses import replace

import pytest

from origami_sim.calibrate.result import Calibration, Quantity, read_result, significant, table, write_calibration
from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError

RESULT = Calibration(
    "A crease, for the test",
    "origami-sim calibrate crease a.csv --moment-unit='N mm'",
    (
        Quantity("stiffness", 0.0123, "N m/rad", "crease", 'the "curve" of C:\\data', (0.012, 0.0125), (0.0, 1.0)),
        Quantity("time_1", 1e-3, "s", "first", "fit", (0.0, math.inf)),
        Quantity("material", "vhb", "", "what it is", "label"),
        Quantity("guided", True, "", "switch", "choice"),
        Quantity("resisting_moment", (-1.0, 0.0, 1.5), "N m", "law", "fit", ((-1.1, -0.9), (-0.1, 0.1), (1.4, 1.6))),
    ),
    ("only the ratio can be known",),
)


def test_round_trip(tmp_path):
    path = write_calibration(tmp_path / "crease.toml", RESULT)
    assert read_result(path) == RESULT
    settings = read_calibration(path)
    assert settings.stiffness == 0.0123 and settings["stiffness"].range == (0.0, 1.0)
    assert list(table(settings, "resisting_moment")) == [-1.0, 0.0, 1.5]
    assert settings.override(["stiffness=0.5"]).stiffness == 0.5
    assert RESULT["time_1"].value == 1e-3 and "time_1" in RESULT


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = write_calibration(tmp_path / "crease.toml", RESULT)
    before = path.read_text()
    bad = replace(RESULT, quantities=(*RESULT.quantities, Quantity("x", math.nan, "m", "m", "s")))
    with pytest.raises(InputError):
        write_calibration(path, bad)
    assert path.read_text() == before and [p.name for p in tmp_path.iterdir()] == ["crease.toml"]


def test_rounding_to_the_uncertainty():
    assert significant(0.0213456, (0.0208, 0.0219)) == "0.02135 (0.0208 to 0.0219)"
    assert significant(3.0, (-math.inf, 4.0)) == "3 (-inf to 4)"


GOOD = RESULT.quantities[0]


@pytest.mark.parametrize(
    ("quantity", "words"),
    [
        (replace(GOOD, unit="N mm"), ["not an SI unit", "stiffness", "N mm"]),
        (replace(GOOD, unit=""), ["unit of a number is missing", "stiffness"]),
        (replace(GOOD, value=math.inf), ["not a finite number", "stiffness"]),
        (replace(GOOD, interval=(0.5, 0.6)), ["does not contain the value", "0.5 to 0.6"]),
        (replace(GOOD, name="Stiffness!"), ["not a setting's name", "Stiffness!"]),
        (replace(GOOD, source=" "), ["source and its meaning", "stiffness"]),
        (replace(GOOD, name="command"), ["stands twice", "command"]),
        (Quantity("word", "a", "", "m", "s", (0.0, 1.0)), ["a word has no interval"]),
        (Quantity("t", (1.0,), "m", "m", "s"), ["2 to 100 numbers"]),
        (Quantity("t", (1.0, 2.0), "m", "m", "s", ((0.0, 2.0),)), ["one interval per number"]),
    ],
)
def test_bad_quantities_are_one_sentence(tmp_path, quantity, words):
    with pytest.raises(InputError) as error:
        write_calibration(tmp_path / "c.toml", replace(RESULT, quantities=(quantity,)))
    assert all(w in str(error.value) for w in words) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_bad_files_are_one_sentence(tmp_path):
    with pytest.raises(InputError, match="is a TOML file"):
        write_calibration(tmp_path / "c.json", RESULT)
    with pytest.raises(InputError, match="needs the command"):
        write_calibration(tmp_path / "c.toml", replace(RESULT, command=""))
    with pytest.raises(InputError, match="at least one value"):
        write_calibration(tmp_path / "c.toml", replace(RESULT, quantities=()))
    with pytest.raises(InputError, match="cannot write"):
        write_calibration(tmp_path / "no" / "c.toml", RESULT)
    with pytest.raises(InputError, match="no command that re-creates it"):
        read_result("mae_crease")
    with pytest.raises(InputError, match="no such table"):
        table(read_calibration("mae_crease"), "resisting_moment")
    with pytest.raises(InputError, match="no such result"):
        RESULT["damping"]
