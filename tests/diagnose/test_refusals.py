"""`origami-sim diagnose`: exit codes, and what it refuses in one sentence."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnose.swings import SIDECAR, WAVE, T, main, recorded_drive, single, swing, table

from origami_sim.diagnose import EXIT, command
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.report.patch import Addition, read_additions, switched_on


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return swing(tmp_path_factory.mktemp("recorded"))


MARKERS = """\
[time]
column = "time_s"
[channels.a]
columns = ["ax", "ay", "az"]
kind = "marker"
unit = "{unit}"
node = 4
[channels.b]
columns = ["bx", "by", "bz"]
kind = "marker"
unit = "m"
node = 5
"""


def markers(swap: bool) -> dict:
    rng = np.random.default_rng(0)
    place = {"a": (0.02 * np.sin(9 * T), 0 * T, -0.2 + 0 * T), "b": (0.02 * np.sin(9 * T), 0.02 + 0 * T, -0.2 + 0 * T)}
    out = {f"{n}{i}": v + 1e-5 * rng.normal(size=60) for n, p in place.items() for i, v in zip("xyz", p, strict=True)}
    if swap:
        for i in "xyz":
            a, b = out["a" + i].copy(), out["b" + i].copy()
            out["a" + i][30:], out["b" + i][30:] = b[30:], a[30:]
    return out


def hole(values: np.ndarray) -> np.ndarray:
    return np.where((np.arange(60) > 20) & (np.arange(60) < 30), np.nan, values)


def sorted_wrong(times: np.ndarray) -> np.ndarray:
    return np.concatenate([times[:30], times[40:], times[30:40]])


DRIVE = SIDECAR + '[drive.field_z]\ntimes = [0.0, 0.5]\nvalues = [0.0, 0.1]\nunit = "T"\n'
CREASE = SIDECAR.replace('"panel_angle"', '"crease_angle"').replace('panel = "arm1"', "crease = 7")
BAD = {
    "a marker that is missing": (T, {"ax": WAVE}, MARKERS.format(unit="m"), "'ay' is missing"),
    "swapped markers": (T, markers(True), MARKERS.format(unit="m"), "exchange names"),
    "a wrong unit": (T, markers(False), MARKERS.format(unit="V"), "unknown unit of length"),
    "radians that are degrees": (T, {"theta1_rad": 57.3 * WAVE}, SIDECAR, "looks like degrees"),
    "a time that stands twice": (np.repeat(T[:30], 2), {"theta1_rad": WAVE}, SIDECAR, "is repeated"),
    "times that run backwards": (sorted_wrong(T), {"theta1_rad": WAVE}, SIDECAR, "backwards"),
    "missing values": (T, {"theta1_rad": hole(WAVE)}, SIDECAR, "misses 9 values"),
    "a drive that ends early": (T, {"theta1_rad": WAVE}, DRIVE, "does not cover the recording"),
    "a crease that the scene lacks": (T, {"theta1_rad": WAVE}, CREASE, "channels.theta1.crease', value 7"),
    "two frames": (T[:2], {"theta1_rad": WAVE[:2]}, SIDECAR, "2 frames"),
    "a few frames": (T[:9], {"theta1_rad": WAVE[:9]}, SIDECAR, "too short"),
    "hardly a value": (
        T,
        {"theta1_rad": np.where(np.arange(60) % 58 < 2, WAVE, np.nan)},
        "allow_gaps = true\n" + SIDECAR,
        "at least 16 with a value",
    ),
    "a channel without a value": (T, {"theta1_rad": np.nan * WAVE}, SIDECAR, "has 0 values"),
    "millimetres for metres": (
        T,
        {n: 1e3 * v for n, v in markers(False).items()},
        MARKERS.format(unit="m"),
        "farther than anything that is held",
    ),
    "metres for millimetres": (
        T,
        {n: 1e-3 * v for n, v in markers(False).items()},
        MARKERS.format(unit="m"),
        "are 2e-05 m apart, on the model's panel 0.02 m",
    ),
    "a drive in a wrong unit": (T, {"theta1_rad": WAVE}, DRIVE.replace('"T"', '"V"'), "unknown unit of flux density"),
    "a drive with a hole": (
        T,
        {"theta1_rad": WAVE, "b": hole(WAVE)},
        SIDECAR + '[drive.field_z]\ncolumn = "b"\nunit = "T"\n',
        "misses a value",
    ),
    "a panel that is not named": (
        T,
        {"theta1_rad": WAVE},
        SIDECAR.replace('panel = "arm1"\n', ""),
        "a panel_angle needs a panel",
    ),
    "constant data": (T, {"theta1_rad": 0 * T + 3.0}, SIDECAR, "is constant"),
    "another scene": (T, {"theta1_rad": WAVE}, SIDECAR.replace("pendulum_chain", "box"), "another scene"),
    "a prior of nothing": (T, {"theta1_rad": WAVE}, SIDECAR.replace("mass_1", "weight"), "weight"),
    "an override of nothing": (T, {"theta1_rad": WAVE}, SIDECAR.replace("mass_2", "load_2"), "load_2"),
    "a scene that does not exist": (T, {"theta1_rad": WAVE}, SIDECAR.replace("pendulum_chain", "chian"), "not exist"),
    "a drive that nothing knows": (
        T,
        {"theta1_rad": WAVE},
        SIDECAR + '[drive.current]\nvalue = 1.0\nunit = "A"\n',
        "knows no such drive (field 'drive.current'); allowed: field, gradient, voltage",
    ),
    "a field without a direction": (
        T,
        {"theta1_rad": WAVE, "b": 1e-3 * T},
        SIDECAR + '[drive.field]\ncolumn = "b"\nunit = "T"\n',
        "wrong number of components (field 'drive.field', value 1); allowed: 3, or one with a direction",
    ),
    "degrees read as a crease's radians": (
        T,
        {"theta1_rad": 25 * WAVE},
        CREASE.replace("crease = 7", "crease = 0"),
        "degrees read as radians?",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_recordings_are_one_sentence(case, tmp_path, capfd):
    times, columns, sidecar, said = BAD[case]
    path = table(tmp_path / "bad.csv", times, columns, sidecar)
    assert main("diagnose", path, "--model", "pendulum_chain", "--out", tmp_path / "out") == 2
    err = [line for line in capfd.readouterr().err.splitlines() if line.startswith("origami-sim: ")]
    assert len(err) == 1
    assert said in err[0]
    assert str(tmp_path / "bad.") in err[0]  # the table or its sidecar
    assert err[0].endswith(".")
    assert not [p for p in (tmp_path / "out").rglob("*") if p.is_file()]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--model", "nothing"), "there is no such scene"),
        (("--model", "nothing.toml"), "cannot be read"),
        (("--model", "pendulum_chain", "--suspects", "magic"), "no such effect"),
        (("--model", "pendulum_chain", "--prior", "mass_1"), "not a prior"),
        (("--model", "pendulum_chain", "--prior", "mass_1=-1%"), "not a standard deviation"),
        (("--model", "pendulum_chain", "--prior", "mass_1=2 mm"), "wrong unit"),
        (
            ("--model", "pendulum_chain", "--prior", "mass_1=10percent"),
            "allowed: kg, g, mg, or 10% for a share",
        ),
        (("--model", "pendulum_chain", "--prior", "nothing=1"), "for a number of the model"),
        (("--model", "pendulum_chain", "--prior", "clock_delay.delay=5ms"), "clock_delay.clock_delay"),
        (("--model", "pendulum_chain", "--prior", "clock_delay.clock_delay=5mm"), "wrong unit"),
        (("--model", "pendulum_chain", "--prior", "clock_delay.clock_delay=-5ms"), "not a standard deviation"),
        (("--model", "pendulum_chain", "--set", "gravity=0"), "--set: out of its range"),
        (("--model", "pendulum_chain", "--set", "weight=1"), "--set: cannot apply"),
        (("--model", "pendulum_chain", "--segment", "0"), "must be positive"),
        (("--model", "pendulum_chain", "--panels", "soft"), "invalid choice: 'soft'"),
        (("--model", "pendulum_chain", "--out", "taken"), "is a file"),
        (("--model", "pendulum_chain", "--out", "/proc/x"), "/proc/x: cannot be written"),
        (("--model", "pendulum_chain", "--out", 300 * "x"), "cannot be written"),
        (("--model", "patched.toml", "--out", "."), "the model would be overwritten (field '--out'"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, said, recorded, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("")
    assert main("diagnose", recorded, *arguments) == 2
    err = capfd.readouterr().err.strip()
    assert len(err.splitlines()) == 1
    assert said in err
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_a_calibration_of_no_scene_is_refused(recorded, tmp_path, capfd):
    own = tmp_path / "own.toml"
    own.write_text('[gap]\nvalue = 1.0\nunit = "m"\nsource = "s"\nmeaning = "m"\n')
    assert main("diagnose", recorded, "--model", own, "--out", tmp_path / "out") == 2
    assert "calibration of no scene" in capfd.readouterr().err


def test_recordings_that_do_not_belong_together_are_refused(recorded, tmp_path, capfd):
    other = table(
        tmp_path / "other.csv", T, {"x": WAVE}, SIDECAR.replace("theta1_rad", "x").replace("theta1", "theta9")
    )
    assert main("diagnose", recorded, other, "--model", "pendulum_chain", "--out", tmp_path / "out") == 2
    assert "different channels" in capfd.readouterr().err


def test_help_states_every_exit_code(capfd):
    assert main("diagnose", "--help") == 0
    out = re.sub(r"\s+", " ", capfd.readouterr().out)
    for verdict, code in EXIT.items():
        assert f"{code} {verdict}" in out
    assert "example: origami-sim diagnose" in out


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        (3, "effects are tables"),
        ({"magic": {}}, "no such effect"),
        ({"crease_friction": 3}, "a table of its parameters"),
        ({"crease_friction": {"friction": 1.0}}, "no such parameter"),
        ({"crease_friction": {"friction_moment": -1.0}}, "out of its bounds"),
        ({"crease_friction": {"friction_moment": "much"}}, "out of its bounds"),
        ({"crease_friction": {"entities": [0.5]}}, "a list of numbers"),
        ({"crease_friction": {"site": 3}}, "not a word"),
    ],
)
def test_bad_effects_of_a_calibration_are_one_sentence(tree, said):
    with pytest.raises(InputError, match=said):
        read_additions(tree, Path("own.toml"))


def test_entities_that_the_model_lacks_are_refused():
    module, s = single()
    with pytest.raises(InputError, match=r"no such entity.*effects.crease_friction.entities.*value 5"):
        switched_on([Addition("crease_friction", {"friction_moment": 1e-3}, (5,))], *module.build(s)[:2])


def test_the_start_can_be_chosen_but_not_rest_for_segments():
    chosen = {"segment": None, "panels": "auto", "motion": "auto", "thorough": False, "start_at": "fit", "limit": None}
    plain = SimpleNamespace(motion=None)
    assert command.options_of(SimpleNamespace(**chosen), plain).start == "fit"  # type: ignore[arg-type]
    assert command.options_of(SimpleNamespace(**chosen | {"start_at": None, "segment": 1.0}), plain).start is None  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"starts of their own.*--start-at.*no --segment"):
        command.options_of(SimpleNamespace(**chosen | {"start_at": "rest", "segment": 1.0}), plain)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "values", "unit", "said"),
    [
        ("field", np.ones(20), "T", "value 1.; allowed: 3, or one with a direction"),
        ("field", np.ones((20, 2)), "T", "value 2.; allowed: 3"),
        ("field", np.ones((20, 4)), "T", "value 4.; allowed: 3"),
        ("field", np.ones((20, 3)), "V", "another unit .*'V'.; allowed: T"),
        ("gradient", np.ones((20, 3)), "T/m", "value 3.; allowed: 9"),
        ("temperature", np.ones((20, 2)), "K", "value 2.; allowed: 1"),
        ("current", np.ones(20), "A", "knows no such drive"),
        ("field_q", np.ones(20), "T", "knows no such drive"),
        ("voltage_3", np.ones(20), "V", "the model has no such drive channel .*voltage_3"),
    ],
)
def test_drives_that_cannot_be_are_refused(name, values, unit, said):
    from origami_sim.predict.drives import drive_of

    recording = recorded_drive(name, values, unit)
    recording.metadata["sidecar"] = "r.toml"
    with pytest.raises(InputError, match=said) as caught:
        drive_of(recording, Drive())
    assert str(caught.value).startswith("r.toml: ")
