"""Scenes and calibrations: what every one of them must have, and what a calibration file may not say."""

import importlib
from pathlib import Path

import pytest

from origami_sim.device import scene
from origami_sim.device.scene import is_reference, read_calibration, recordings_folder, scene_module, scene_settings
from origami_sim.errors import InputError

CALIBRATIONS = Path(importlib.import_module("origami_sim.calibrations").__path__[0])


@pytest.mark.parametrize("name", scene.NAMES)
def test_every_scene_runs_has_a_calibration_and_says_how_to_run_it(name):
    module = scene_module(name)
    assert callable(module.run)
    assert f"python -m origami_sim.scenes.{name}" in module.__doc__
    first = module.__doc__.strip().splitlines()[0]
    assert first.endswith(".")
    assert len(read_calibration(module.CALIBRATION)) > 0


@pytest.mark.parametrize("file", sorted(CALIBRATIONS.glob("*.toml")), ids=lambda p: p.stem)
def test_every_setting_says_where_it_comes_from(file):
    for s in read_calibration(file).values():
        assert s.source.strip(), s.name
        assert s.meaning.strip(), s.name
        if isinstance(s.value, float):
            assert s.unit.strip(), f"{s.name}: a number has a unit ('1' for a ratio)"
            assert s.range is None or s.range[0] < s.range[1], s.name
        else:
            assert s.unit == "", s.name


def test_unknown_scene():
    with pytest.raises(InputError, match=r"no such scene.*castle.*bifold, box, crawler"):
        scene_module("castle")


# values on the command line ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("gap=2.54mm", "gap", 0.00254),
        ("gap=0.00254", "gap", 0.00254),
        ("gap = .2 cm", "gap", 0.002),
        ("field=-50 mT", "field", -0.05),
        ("modulus=1.4MPa", "modulus", 1.4e6),
        ("modulus=1.4e6 Pa", "modulus", 1.4e6),
        ("loss_time=3ms", "loss_time", 0.003),
        ("mode=oscillate", "mode", "oscillate"),
    ],
)
def test_overrides_with_units(text, name, value):
    settings = read_calibration("box")
    changed = settings.override([text])
    assert getattr(changed, name) == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value)
    assert {n: v for n, v in changed.as_dict().items() if n != name} == {
        n: v for n, v in settings.as_dict().items() if n != name
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gapp=1mm", r"cannot apply this setting.*gapp.*patch_length"),
        ("gap", r"cannot apply this setting.*'gap'.*name=value"),
        ("gap=", r"not a number.*gap.*number in m"),
        ("gap=1.2.3", r"not a number.*gap.*1\.2\.3"),
        ("gap=wide", r"not a number.*gap.*wide"),
        ("gap=nan", r"not a number.*gap"),
        ("gap=1e999", r"not a finite number.*gap"),
        ("gap=2.54V", r"wrong unit.*gap.*'V'.*m, cm, mm, um"),
        ("gap=2 furlongs", r"wrong unit.*furlongs"),
        ("density=1 g/m^2", r"wrong unit.*density.*kg/m\^3"),
        ("gap=1km", r"wrong unit.*km"),
        ("gap=1m", r"out of its range.*gap.*1\.0.*0\.001 to 0\.006 m"),
        ("mode=slam", r"not one of the choices.*mode.*slam.*ramp, oscillate"),
    ],
)
def test_bad_overrides_are_one_sentence(text, words):
    with pytest.raises(InputError, match=words) as e:
        read_calibration("box").override([text])
    assert "box.toml" in str(e.value)
    assert "\n" not in str(e.value)


def test_replace_checks_names_and_ranges():
    with pytest.raises(InputError, match=r"no such setting.*gape"):
        read_calibration("box").replace(gape=1.0)
    with pytest.raises(InputError, match=r"out of its range.*gravity"):
        read_calibration("box").replace(gravity=-1.0)
    with pytest.raises(AttributeError):
        _ = read_calibration("box").gape


# calibration files --------------------------------------------------------------------------------------------

GOOD = '[gap]\nvalue = 1\nunit = "m"\nsource = "s"\nmeaning = "m"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[gap\n", "no valid TOML"),
        ('gap = 1\n', r"needs value, unit, source and meaning.*gap"),
        (GOOD.replace('source = "s"\n', ""), r"needs value, unit, source and meaning.*gap"),
        (GOOD + "colour = 3\n", r"unknown key.*gap\.colour.*choices"),
        (GOOD + "range = [2, 3]\n", r"out of its range.*gap.*1\.0.*2 to 3 m"),
        (GOOD + "range = [3]\n", r"a range is two numbers.*gap\.range"),
        (GOOD + "range = [3, 0]\n", r"a range is two numbers.*gap\.range"),
        (GOOD + 'range = "wide"\n', r"a range is two numbers.*gap\.range"),
        (GOOD + "choices = 1\n", r"choices are words.*gap\.choices"),
        (GOOD.replace("value = 1", "value = nan"), r"not a finite number.*gap"),
        (GOOD.replace("value = 1", "value = [1, 2]"), r"number, a word or a switch.*gap"),
        (GOOD.replace('unit = "m"', "unit = 3"), r"not a word.*gap\.unit"),
    ],
)  # fmt: skip
def test_bad_calibration_files_are_one_sentence(tmp_path, text, words):
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as e:
        read_calibration(path)
    assert str(path) in str(e.value)


def test_calibrations_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"cannot be read.*No such file"):
        read_calibration(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read"):
        read_calibration("nothing_that_ships")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no valid TOML"):
        read_calibration(binary)


def test_a_calibration_may_ask_for_an_accuracy(tmp_path):
    text = Path(read_calibration("falling_ball").file).read_text()
    file = tmp_path / "exact.toml"
    file.write_text(f"accuracy = 1e-3\n{text}")
    settings = read_calibration(file)
    assert settings.accuracy == settings.replace().accuracy == settings.with_panels("rigid").accuracy == 1e-3
    assert "accuracy" not in settings and settings.with_accuracy(None).accuracy is None
    assert scene_module("falling_ball").run(settings).trajectory.notes[0].startswith("Accuracy 0.001")
    file.write_text(f"accuracy = 'high'\n{text}")
    with pytest.raises(InputError, match=r"exact\.toml.*no such accuracy.*high"):
        read_calibration(file)


def test_a_calibration_must_fit_the_scene(tmp_path):
    module, own = scene_module("mae_crease"), tmp_path / "own.toml"
    text = (CALIBRATIONS / "mae_crease.toml").read_text()
    own.write_text(text.replace('value = 0.02\nunit = "N m/rad"', 'value = 0.03\nunit = "N m/rad"'))
    assert scene_settings(module, own).stiffness == 0.03
    with pytest.raises(InputError, match=r"lacks a setting of this scene"):
        scene_settings(module, "box")
    own.write_text(text + GOOD)
    with pytest.raises(InputError, match=r"no such setting.*gap.*length, width"):
        scene_settings(module, own)
    own.write_text(text.replace('value = 0.2\nunit = "T"', 'value = 0.2\nunit = "mT"'))
    with pytest.raises(InputError, match=r"wrong unit.*field\.unit.*mT.*allowed: T"):
        scene_settings(module, own)
    own.write_text(text.replace('value = 0.2\nunit = "T"\nrange = [-1.0, 1.0]', 'value = "strong"\nunit = "T"'))
    with pytest.raises(InputError, match=r"wrong kind of value.*field.*strong.*a number"):
        scene_settings(module, own)


def test_a_reference_is_of_its_calibration_alone():
    own = read_calibration("folding_strip")
    assert is_reference(own, "folding_strip")
    assert is_reference(own.replace(loss_time=0.001, mode="ramp"), "folding_strip")  # the motion, not where it ends
    assert not is_reference(own.replace(gap=0.003), "folding_strip")
    assert is_reference(own.replace(gap=0.003), "folding_strip", besides={"gap"})


def test_recordings_are_found_by_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("ORIGAMI_RECORDINGS", str(tmp_path))
    assert recordings_folder() == tmp_path
    monkeypatch.setenv("ORIGAMI_RECORDINGS", str(tmp_path / "none"))
    assert recordings_folder() is None
