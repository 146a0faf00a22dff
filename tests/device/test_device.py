"""Devices as files: run, shown, compared and saved by the name of a file; only what is named is executed."""

import copy
import dataclasses
import json
import re
import textwrap

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.design.design_file import read_design, write_design
from origami_sim.device.device import device_module, lasting
from origami_sim.device.scene import scene_settings
from origami_sim.drive import Drive, ramp, series, sine
from origami_sim.errors import InputError
from origami_sim.hypotheses.subject import spreads
from origami_sim.pattern import kresling, miura, strip, uncreased
from origami_sim.quantities import parsed, si
from origami_sim.recording import read_recording
from origami_sim.recording.sidecar import Sidecar
from origami_sim.results.run_folder import load_run
from origami_sim.solve.motion.dynamics import simulate

FLAP = '''
"""A flap of mine."""
from origami_sim import Drive, Sheet, ramp, strip

DURATION = "0.2 s"

def build(gap="2 mm", field="50 mT", parts=2, held=True):
    """Builds it.

    Args:
        gap: between base and patch. field: at the end of the ramp.
    """
    sheet = Sheet(strip([0.01, gap + 0.018] + [0.01] * (parts - 2), 0.02), thickness="1 mm", triangulation="center")
    sheet.patch(1, thickness="3 mm", size=("18 mm", "20 mm"), poling=(1, 0, 0))
    sheet.crease(stiffness="2 mN m/rad", loss_time="3 ms").gravity()
    if held:
        sheet.fix(panels=[0])
    return sheet, Drive(field=(0, 0, ramp(field, "0.1 s")))
'''


@pytest.fixture
def flap(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_flap.py").write_text(FLAP)
    return tmp_path / "my_flap.py"


# quantities ----------------------------------------------------------------------------------------------------------


def test_quantities_are_si():
    assert si("2.54 mm") == pytest.approx(2.54e-3) and si("2.54mm").unit == "m"
    assert si("-1e-3 T") == -1e-3 and si("20 %") == pytest.approx(0.2)
    assert parsed("5 1/s", "1/s") == 5.0
    assert copy.deepcopy(si("2 mm")).unit == "m"
    for text, said in (("mm", "not a number"), ("2 mn", "unknown unit"), ("", "not a number")):
        with pytest.raises(InputError, match=said):
            si(text)


def test_a_sheet_in_quantities_is_the_sheet_in_si():
    words = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", modulus="1.2 MPa", density="1.1 g/cm^3")
    words.crease([0], stiffness=["2 mN m/rad"], rest_angle="10 deg", loss_time="3 ms").set(
        "mass_damping", decay_rate="0.5 1/s"
    )
    numbers = Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3, modulus=1.2e6, density=1100.0)
    numbers.crease([0], stiffness=[2e-3], rest_angle=np.radians(10), loss_time=3e-3)
    numbers.set("mass_damping", decay_rate=0.5)
    assert words.build()[1].hash == numbers.build()[1].hash


def test_motions_take_quantities():
    built = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm").crease(stiffness="1 mN m/rad").fix(panels=[0]).build()
    assert (
        simulate(*built, duration="50 ms", rate="100 Hz").times.tolist()
        == simulate(*built, duration=0.05, rate=100.0).times.tolist()
    )
    with pytest.raises(InputError, match="wrong unit"):
        simulate(*built, duration="50 mm")


# files ---------------------------------------------------------------------------------------------------------------


def test_arguments_of_build_are_settings(flap):
    module = device_module("my_flap.py")
    settings = scene_settings(module)
    assert settings.as_dict() == {"gap": 0.002, "field": 0.05, "parts": 2.0, "held": True, "duration": 0.2, "rate": 60}
    assert [settings[n].unit for n in ("gap", "field", "parts")] == ["m", "T", "1"]
    assert settings["gap"].meaning == "between base and patch"
    assert settings["field"].meaning == "at the end of the ramp"
    model, _, drive = module.build(settings.override(["gap=3mm", "parts=3"], "--set"))
    assert model.panel_count == 3 and np.ptp(model.position[:, 0]) == pytest.approx(0.041)
    assert drive["field_z"](1.0) == 0.05
    with pytest.raises(InputError, match="whole number"):
        module.build(settings.replace(parts=2.5))


def test_run_a_file(flap, call, tmp_path):
    code, out, err = call("run", "my_flap.py", "--set", "gap=3mm")
    assert (code, err) == (0, "")
    assert "crease 0 turns the furthest, by " in out
    run = load_run(tmp_path / "runs" / "my_flap")
    assert run.trajectory.times[-1] == pytest.approx(0.2)
    assert run.manifest["overrides"] == {"gap": "3mm"}
    code, out, _ = call("run", "my_flap.py", "--settings")
    assert code == 0 and "gap = 0.002 m" in out
    code, _, err = call("run", "my_flap.py", "--set", "gpa=3mm")
    assert code == 2 and "'gap' is near" in err
    assert call("run", "my_flap.py:build", "--set", "parts=3", "--json", "--panels", "rigid")[0] == 0


def test_a_module_and_its_function(flap, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path)
    assert device_module("my_flap:build").__name__ == "my_flap"
    with pytest.raises(InputError, match=r"no biuld\(\); 'build' is near"):
        device_module("my_flap:biuld")
    with pytest.raises(InputError, match="cannot be imported"):
        device_module("no_such_module:build")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", r"defines no build\(\)"),
        ("def build(:\n", r"SyntaxError.*line 1"),
        ("import no_such_thing\n", r"ModuleNotFoundError.*line 1"),
        ("def build():\n    return 1 / 0\n", r"ZeroDivisionError.*line 2"),
        ("def build():\n    return 5\n", r"returns something else.*int"),
        ("def build(panels=3):\n    return 5\n", r"meaning in calibrations.*panels"),
        ("def build(gap):\n    return 5\n", r"needs a default.*gap"),
        ("def build(gap=" + "9" * 400 + "):\n    return 5\n", r"a default is too large.*gap"),
        ("from origami_sim import *\ndef build():\n    return Sheet(strip([1], 1), thickness='1 mn')\n", r"wrong unit"),
    ],
)
def test_a_bad_file_is_one_sentence(text, said, call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.py").write_text(text)
    code, out, err = call("run", "bad.py")
    assert code == 2 and out == ""
    assert re.search(said, err) and err.startswith("origami-sim: bad.py: ") and err.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_there_is_no_such_device(call):
    code, _, err = call("run", "bxo")
    assert code == 2 and "'box' is near" in err
    assert "no such device file" in call("show", "nothere.py")[2]


def test_duration_follows_the_drive():
    assert lasting(Drive(field=(0, 0, ramp(0.1, 2.0)))) == 3.0
    assert lasting(Drive(field=(0, sine(0.1, 2.0), sine(0.1, 0.5)))) == 10.0
    assert lasting(Drive()) == 1.0


# recordings ----------------------------------------------------------------------------------------------------------


def record(folder, name: str = "my_flap.py"):
    """A recording of the flap with a softer hinge."""
    module = device_module(str(folder / "my_flap.py"))
    model, parameters, drive = module.build(scene_settings(module))
    motion = simulate(model, parameters.set("crease", "stiffness", 1.8e-3), drive, duration=0.2, rate=200)
    rows = [f"{t:.6f},{a:.9f}" for t, a in zip(motion.times, motion.creases[:, 0, 0], strict=True)]
    (folder / "swing.csv").write_text("\n".join(["t,angle", *rows]))
    (folder / "swing.toml").write_text(
        textwrap.dedent(f"""
        [time]
        column = "t"
        unit = "s"
        [channels.hinge]
        column = "angle"
        kind = "crease_angle"
        unit = "rad"
        noise = 1e-3
        crease = 0
        [scene]
        name = "{name}"
        overrides = {{ gap = 0.002 }}
        """)
    )


def test_a_sidecar_names_a_device_and_executes_nothing(flap, tmp_path):
    (tmp_path / "evil.py").write_text("raise SystemExit(99)")
    record(tmp_path, "evil.py")
    assert Sidecar.read(tmp_path / "swing.toml").scene["name"] == "evil"


def test_compare_with_the_folder_of_a_run_as_with_its_file(flap, call, tmp_path):
    record(tmp_path)
    assert call("run", "my_flap.py", "--set", "duration=0.1", "--out", "here")[0] == 0
    code, stated, _ = call("compare", "swing.csv", "--model", "my_flap.py", "--duration", "0.1", "--json")
    assert code == 0
    (tmp_path / "my_flap.py").write_text("raise SystemExit(99)")
    code, kept, err = call("compare", "swing.csv", "--model", "here", "--duration", "0.1", "--json")
    assert (code, err) == (0, "") and json.loads(kept) == json.loads(stated)


def test_compare_with_a_file(flap, call, tmp_path):
    record(tmp_path)
    code, out, err = call("compare", "swing.csv", "--model", "my_flap.py", "--duration", "0.1")
    assert (code, err) == (0, "")
    assert "hinge" in out
    record(tmp_path, "other.py")
    code, _, err = call("compare", "swing.csv", "--model", "my_flap.py")
    assert code == 2 and "of another scene" in err
    sidecar = (tmp_path / "swing.toml").read_text()
    steps = sidecar[: sidecar.index("[time]")] + sidecar[sidecar.index("[channels") :]
    (tmp_path / "swing.toml").write_text(steps.replace("other.py", "my_flap.py"))
    code, _, err = call("compare", "swing.csv", "--model", "my_flap.py")
    assert code == 2 and "load steps without times" in err and "origami-sim diagnose compares curves" in err


@pytest.mark.parametrize(("phase", "stated"), [(0.0, ""), (1.0, ""), (1.0, "[start]\nstate = 'released'\n")])
def test_a_comparison_begins_where_the_recording_does(flap, tmp_path, phase, stated):
    """A free swing is not laid over a device at rest: it begins at the recorded angle and rate, or as is stated."""
    record(tmp_path)
    times = np.arange(100) / 200
    rows = [f"{t:.6f},{0.4 * np.cos(20 * t + phase):.9f}" for t in times]
    (tmp_path / "swing.csv").write_text("\n".join(["t,angle", *rows]))
    (tmp_path / "swing.toml").write_text((tmp_path / "swing.toml").read_text() + stated)
    module = device_module(str(tmp_path / "my_flap.py"))
    motion, _ = module.replicate(scene_settings(module), read_recording(tmp_path / "swing.csv"))
    assert motion.creases[0, 0, 0] == pytest.approx(0.4 * np.cos(phase), abs=1e-3)
    tip = np.linalg.norm(motion.v[0, :, 0], axis=1).max() / 0.02  # of the flap's length
    assert tip == pytest.approx(0.0 if stated else 8 * np.sin(phase), abs=0.1)


def test_diagnose_takes_a_file(flap, tmp_path):
    from origami_sim.diagnose.command import model_of
    from origami_sim.recording import read_dataset

    record(tmp_path)
    module, settings = model_of("my_flap.py", read_dataset([tmp_path / "swing.csv"]))
    assert module.__name__ == "my_flap" and settings.gap == 0.002
    with pytest.raises(InputError, match=r"--model names by its file, my_flap\.py"):
        model_of("box", read_dataset([tmp_path / "swing.csv"]))


# designs -------------------------------------------------------------------------------------------------------------


def whole() -> Sheet:
    """A sheet with a statement of every kind."""
    sheet = Sheet(strip([0.01, 0.02, 0.02], [0.02, 0.02, 0.015, 0.015]), thickness="1 mm", triangulation="center")
    sheet.patch(1, thickness="2 mm", poling=np.array([1, 0, 0]), size=(0.01, 0.01), side=-1).panel([2], rigidity=1e-3)
    sheet.crease([0], stiffness="2 mN m/rad", loss_time="3 ms").electrode([1], layers=4, notch="3 mm", group=1)
    sheet.gravity().mass([0, 1], "0.1 g").point_mass(2, 1e-3, (0.04, 0, 0), offset="1 mm")
    sheet.feet([0, 1, 6, 7], friction=0.2, backward=0.5).ground(tilt="2 deg").name("crease", ["a", "b"])
    sheet.contact(1, (0.02, 0, 0), name="belly")
    return sheet.set("mass_damping", decay_rate=0.5).on("crease_stop").fix(nodes=iter([3]), axes="y")


def test_a_design_is_read_as_it_was_written(tmp_path):
    drive = Drive(field=(sine(0.01, 2.0, phase=0.1), 0, ramp("50 mT", 0.5)), voltage=[100.0, series([0, 1], [0, 5])])
    path = write_design(tmp_path / "whole.toml", whole(), drive, duration=0.3, rate=30.0, about='a "test"\n')
    found = read_design(path)
    assert (found.duration, found.rate, found.about) == (0.3, 30.0, 'a "test"\n')
    (model, parameters), (again, numbers) = whole().build(), found.sheet.build()
    assert again.hash == model.hash and numbers.hash == parameters.hash and again.names == model.names
    for name, signal in drive.signals.items():
        for t in (0.0, 0.2, 0.77):
            assert found.drive[name](t) == signal(t), name
    second = write_design(
        tmp_path / "second.toml", found.sheet, found.drive, duration=0.3, rate=30.0, about='a "test"\n'
    )
    assert second.read_text() == path.read_text()


@pytest.mark.parametrize("pattern", [miura(2, 2, 0.02, 0.02, 1.0, fold_angle=0.4), kresling(5, radius=0.02, height=0.02,
                                                                                          twist=0.5)])  # fmt: skip
def test_folded_patterns_are_kept_to_the_last_bit(pattern, tmp_path):
    sheet = Sheet(pattern, thickness=1e-4, material="paper").crease(stiffness=1e-3)
    assert read_design(write_design(tmp_path / "p.toml", sheet)).sheet.pattern.equals(pattern)


BY_HAND = """
about = "a magnetic flap"
pattern = { strip = { lengths = ["10 mm", "20 mm"], width = "20 mm" } }
sheet = { thickness = "1 mm", triangulation = "center" }
statements = [
  { patch = { panel = 1, thickness = "3 mm", poling = [1, 0, 0] } },
  { crease = { stiffness = "2 mN m/rad", loss_time = "3 ms" } },
  { fix = { panels = [0] } },
]
[drive]
field_z = { ramp = "50 mT", duration = "0.1 s" }
[run]
duration = "0.2 s"
"""


def test_a_design_by_hand_runs(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flap.toml").write_text(BY_HAND)
    code, out, _ = call("run", "flap.toml", "--json")
    assert code == 0 and json.loads(out)["numbers"]["largest_turn_deg"] > 20


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("patch =", "pacth =", r"statements\[1\].*|'patch' is near"),
        ("poling =", "poleing =", r"'poling' is near.*statements\[1\].patch"),
        ("strip =", "stirp =", r"'strip' is near"),
        ("field_z", "feild_z", r"'field_z' is near"),
        ("[run]", "[rum]", r"'run' is near"),
        ('"50 mT"', '"50 mm"', r"wrong unit.*drive.field_z"),
        ("panel = 1,", "panel = 9,", r"no such panel"),
        ("panel = 1,", "", r"lacks a value.*patch.panel"),
        ("patch = {", "build = {", r"no such thing"),
        ("patch = {", "__init__ = {", r"no such thing"),
        ("[1, 0, 0]", '["a", 0, 0]', r"poling|stated so"),
        ("sheet = {", "sheets = {", r"'sheet' is near"),
    ],
)
def test_a_bad_design_is_one_sentence(old, new, said, tmp_path):
    path = tmp_path / "bad.toml"
    assert old in BY_HAND
    path.write_text(BY_HAND.replace(old, new))
    with pytest.raises(InputError, match=said) as e:
        read_design(path)
    assert str(e.value).startswith(str(path))


# show ----------------------------------------------------------------------------------------------------------------


def test_show_draws_numbers_and_saves_the_design(flap, call, tmp_path):
    code, out, err = call("show", "my_flap.py", "--set", "parts=3", "--save", "flap.toml", "--out", "flap.png")
    assert (code, err) == (0, "")
    assert (tmp_path / "flap.png").read_bytes()[1:4] == b"PNG"
    assert re.search(r"1\s+panel 1\s+2, 3, 4, 5, 9\s+\(1, 0, 0\)", out)
    assert read_design(tmp_path / "flap.toml").sheet.pattern.face_count == 3
    code, out, _ = call("show", "box", "--json", "--out", "box.png")
    assert json.loads(out)["creases"]["name"] == ["hinge +x", "hinge +y", "hinge -x", "hinge -y"]
    assert call("show", "box", "--save", "box.txt")[0] == 2


@pytest.mark.parametrize("scene", ["crawler", "de_fold", "cube_toss"])
def test_show_draws_scenes(scene, call, tmp_path):
    code, out, err = call("show", scene, "--json", "--out", tmp_path / "x.png")
    assert (code, err) == (0, "") and (tmp_path / "x.png").stat().st_size > 10000
    if scene == "de_fold":
        assert json.loads(out)["creases"]["marks"][0] == "flat, electrodes of group 0"


def test_a_shell_of_two_rigidities_is_saved_whole(tmp_path):
    """With the stiffness by which the turn of their line is shared: all else alike, the hash would differ."""
    sheet = Sheet(uncreased(strip([0.01, 0.02], 0.01)), thickness=1e-3).panel([1], rigidity=1e-3).shell()
    model, parameters = sheet.build()
    assert model.plates.shape == (len(model.triangles), 6)
    path = write_design(tmp_path / "shell.toml", (model, parameters), Drive())
    again, numbers, _ = device_module(str(path)).build(scene_settings(device_module(str(path))))
    assert again.hash == model.hash != dataclasses.replace(model, plates=model.plates[:0]).hash
    assert numbers.hash == parameters.hash


@pytest.mark.parametrize("scene", ["box", "crawler", "de_fold", "cube_toss", "bifold", "multi_field_sheet"])
def test_scenes_are_saved_whole(scene, tmp_path):
    module = device_module(scene)
    settings = scene_settings(module)
    model, parameters, drive, *_ = module.build(settings)
    path = write_design(tmp_path / f"{scene}.toml", (model, parameters), drive)
    again, numbers, waves = device_module(str(path)).build(scene_settings(device_module(str(path))))
    assert again.hash == model.hash and numbers.hash == parameters.hash
    assert all(waves[n](0.37) == s(0.37) for n, s in drive.signals.items())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[model]\n", "[model]\nfoo = 1\n", "unknown key.*model.foo"),
        ("bars = [\n  [0, 1]", "bars = [\n  [0, 99]", "points nowhere.*99"),
        ("bars = [\n  [0, 1]", "bars = [\n  [0, 1.5]", "whole numbers"),
        ("bars = [\n  [0, 1]", "bars = [\n  [0, 1, 2]", "rows of one length"),
        ('effects = ["', 'effects = ["no_such", "', "no such effect"),
        ('panels = "elastic"', 'panels = "soft"', "no such panels"),
        ("triangle_panel = [", "triangle_panel = [0, ", "another number of rows"),
        ("[parameters.crease]\n", "[parameters.crease]\nfoo = 1.0\n", "no such parameter"),
        (
            "[parameters.crease]\n",
            "[parameters.crease]\nstiffness = -1.0\n",
            "Cannot overwrite|out of bounds|not valid",
        ),
    ],
)
def test_a_bad_model_is_one_sentence(old, new, said, tmp_path):
    module = device_module("mae_crease")
    path = write_design(tmp_path / "m.toml", module.build(scene_settings(module))[:2])
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said) as e:
        read_design(path)
    assert str(e.value).startswith(str(path))


# models that a sidecar names -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stated", "option"), [("my_flap.py", "my_flap.py"), ("my_flap:build", "my_flap:build")])
def test_code_that_only_a_sidecar_names_is_not_executed(flap, call, tmp_path, stated, option):
    record(tmp_path)
    (tmp_path / "my_flap.py").write_text("raise SystemExit(99)")
    side = (tmp_path / "swing.toml").read_text().replace('name = "my_flap.py"\n', "")
    (tmp_path / "swing.toml").write_text(f'model = "{stated}"\n{side}')
    for command in ("compare", "diagnose"):
        code, _, err = call(command, "swing.csv")
        assert code == 2 and "executed only if you name it" in err and option in err and err.count("\n") == 1


def test_a_module_here_is_found_by_its_function(flap, call, tmp_path):
    record(tmp_path, "my_flap:build")
    code, out, err = call("compare", "swing.csv", "--model", "my_flap:build", "--duration", "0.1")
    assert (code, err) == (0, "") and "hinge" in out


def test_a_sidecar_that_names_no_model_says_what_is_missing(flap, call, tmp_path):
    record(tmp_path)
    side = (tmp_path / "swing.toml").read_text().replace('name = "my_flap.py"\n', "")
    (tmp_path / "swing.toml").write_text(side)
    code, _, err = call("compare", "swing.csv")
    assert code == 2 and "neither the command nor the sidecar names a model" in err


def test_a_pattern_is_no_argument_of_the_sheet(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(
        'pattern = { strip = { lengths = [0.01], width = 0.01 } }\nsheet = { thickness = 1e-3, pattern = "x" }'
    )
    with pytest.raises(InputError, match=r"sheet\.pattern"):
        read_design(file)


def test_the_age_of_a_device_is_a_channel_of_a_design(tmp_path):
    file = tmp_path / "a.toml"
    text = "pattern = { strip = { lengths = [0.01, 0.01], width = 0.01 } }\nsheet = { thickness = 1e-3 }\n[drive]\n"
    file.write_text(text + 'origin = "1 min"\n')
    assert read_design(file).drive["origin"](0.0) == pytest.approx(60.0)
    file.write_text(text + "source_0_x = 1\n")
    with pytest.raises(InputError, match="source_0_x"):
        read_design(file)


def test_a_panel_that_turns_past_half_a_turn_is_noted():
    """A heavy flap without a ground falls below its base and is pulled on from there."""
    from origami_sim import Drive, Sheet, ramp, simulate, strip
    from origami_sim.device.device import outcome_of

    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3, triangulation="center").patch(
        1, thickness=3e-3, poling=(1, 0, 0)
    )
    sheet.crease(stiffness=1e-4, loss_time=0.003).gravity().fix(panels=[0])
    notes = []
    for field in (0.0, 0.1):
        motion = simulate(*sheet.touch(False).build(), Drive(field=(ramp(-field, 0.1), 0, 0)), duration=1.0)
        notes.append(" ".join(outcome_of(motion).summary))
    assert "past half a turn" in notes[1] and "Sheet.touch(False)" in notes[1]
    assert "past half a turn" not in notes[0]


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda s: s.patch(1, thickness=True), r"a switch is no number.*thickness"),
        (lambda s: s.patch(1, thickness="1 mm", poling="x"), "Sheet.patch cannot be stated so"),
        (lambda s: s.fix(panels=[0.5]), "given by its number.*0.5"),
        (lambda s: s.fix(nodes=["hinge"]), "given by its number"),
        (lambda s: s.fix(nodes=np.array([True, False])), "given by its number"),
        (lambda s: s.fix(), "nothing is held"),
        (lambda s: s.crease([0.5], stiffness=1e-3), "given by its number"),
        (lambda s: s.gravity().set("ground", stiffness=True), "a switch is no number.*ground.stiffness"),
    ],
)
def test_statements_refuse_what_is_no_number(state, said):
    from origami_sim import Sheet, strip

    with pytest.raises(InputError, match=said):
        state(Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm"))
    with pytest.raises(InputError, match="a switch is no number"):
        Sheet(strip([0.01, 0.02], 0.02), thickness=True)


def test_what_is_held_may_be_a_number_a_range_or_a_set():
    from origami_sim import Sheet, strip

    def sheet():
        return Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", triangulation="diagonal").crease(stiffness=1e-3)

    held = [sheet().fix(nodes=n).build()[0].free for n in (range(4), {0, 1, 2, 3}, np.arange(4), [0, 1, 2, 3])]
    held.append(sheet().fix(panels=0).build()[0].free)
    assert all(np.array_equal(h, held[0]) for h in held) and not held[0][:4].any() and held[0][4:].all()


def test_a_field_has_three_components_and_names_the_wrong_one():
    from origami_sim import Drive

    for field in (0.05, "50 mT", (0, 1)):
        with pytest.raises(InputError, match="three components"):
            Drive(field=field)
    with pytest.raises(InputError, match=r"field_z.*mm"):
        Drive(field=(0, 0, "5 mm"))


def test_feet_without_a_ground_are_noted():
    from origami_sim import Sheet, simulate, strip

    notes = []
    for ground in (False, True):
        sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", triangulation="center").crease(stiffness=1e-3)
        sheet.feet([0, 1, 4, 5])
        notes.append(simulate(*(sheet.ground() if ground else sheet).build(), duration=0.02).notes)
    assert "no ground that they could touch" in " ".join(notes[0]) and not notes[1]


def test_of_a_periodic_drive_the_furthest_turn_is_told(call, tmp_path):
    """After whole periods nothing is left of what it turned."""
    (tmp_path / "wave.py").write_text("""
from origami_sim import Drive, Sheet, sine, strip
DURATION = "2 s"
RATE = 50
def build(field="5 mT", parts=4):
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", panels="rigid").fix(panels=[0])
    sheet.magnetise(1, remanence="0.1 T", volume="60 mm^3", poling=(1, 0, 0))
    return sheet.crease(stiffness="2 mN m/rad", loss_time="10 ms"), Drive(field=(0, 0, sine(field, "1 Hz")))
""")
    code, out, _ = call("run", "wave.py", "--json")
    numbers = json.loads(out)["numbers"]
    # slow: K angle = m B
    assert abs(numbers["largest_turn_deg"]) == pytest.approx(
        np.degrees(0.1 * 60e-9 / (4e-7 * np.pi) * 5e-3 / 2e-3), 0.05
    )
    assert numbers["largest_turn_at_s"] % 0.5 == pytest.approx(0.25, abs=0.03)
    code, out, _ = call("run", "wave.py")
    assert code == 0 and re.search(
        r"crease 0 turns the furthest, by -?0\.6\d deg at t = \S+ s; -?0\.\d\d deg are left", out
    )
    code, out, _ = call("run", "wave.py", "--settings")
    assert "parts = 4\n" in out and "field = 0.005 T\n" in out
    code, _, err = call("run", "wave.py", "--set", "parts=many")
    assert code == 2 and "allowed: a number." in err
    code, _, err = call("run", "wave.py", "--until", "0")
    assert code == 2 and "only a quasi-static motion is held on (field 'until', value 0.0)" in err


def test_how_long_a_motion_is_shown_has_no_prior(flap, tmp_path):
    settings = scene_settings(device_module("my_flap.py"))
    for name in ("rate", "duration"):
        with pytest.raises(InputError, match=rf"for a number of the model .*'{name}'\); allowed: gap, field, parts\."):
            spreads(settings, {name: "10%"})
    assert spreads(settings, {"gap": "10%"}) == {"gap": pytest.approx(2e-4)}
