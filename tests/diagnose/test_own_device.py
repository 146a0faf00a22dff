"""A calibration that a diagnosis patched, of a device of one's own: it names its device and is used with it again."""

import json
import textwrap
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.design.design_file import write_design
from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.diagnose import command
from origami_sim.errors import InputError
from origami_sim.hypotheses.subject import with_units
from origami_sim.report.patch import write_patch

FLAP = """
from origami_sim import Drive, Sheet, ramp, strip

DURATION = "0.1 s"

def build(stiffness="2 mN m/rad", field="50 mT", friction=0.2, factor=1.5):
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm")
    sheet.patch(1, thickness=factor * 2e-3, poling=(1, 0, 0)).crease(stiffness=stiffness, loss_time="3 ms")
    sheet.feet([0, 1], friction=friction).ground(friction=friction).fix(panels=[0])
    return sheet, Drive(field=(0, 0, ramp(field, "0.05 s")))
"""
SIDECAR = """
[time]
column = "t"
unit = "s"
[channels.fold]
column = "angle"
kind = "crease_angle"
unit = "rad"
noise = 1e-3
crease = 0
[scene]
name = "flap.py"
overrides = { stiffness = 0.0025 }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A device file, a recording of it that states its stiffness, and the folder of a diagnosis."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flap.py").write_text(FLAP)
    rows = [f"{t:.3f},{0.01 * np.sin(60 * t):.6f}" for t in np.arange(20) / 200]
    (tmp_path / "swing.csv").write_text("\n".join(["t,angle", *rows]))
    (tmp_path / "swing.toml").write_text(textwrap.dedent(SIDECAR))
    (tmp_path / "runs" / "d").mkdir(parents=True)
    return tmp_path


def patch(device: str, **numbers):
    """What a diagnosis writes of a device with these numbers."""
    module = device_module(device)
    settings = scene_settings(module).replace(**numbers)
    found = SimpleNamespace(patch={}, candidates=[], recordings=["swing"], verdict="ADEQUATE", sentence="Noise.")
    units = with_units(module, settings, module.build(settings)[1])
    return write_patch("runs/d/patched.toml", units, found, scene=device)  # type: ignore[arg-type]


def handed(monkeypatch) -> list:
    """What the command hands to the diagnosis, which is left out."""
    out = []

    def stop(*arguments, **_):
        out.append(arguments)
        raise InputError("stopped here")

    monkeypatch.setattr(command, "diagnose", stop)
    return out


def test_units_of_plain_numbers_are_those_of_what_they_are(folder):
    tree = tomllib.loads(patch("flap.py").read_text())
    assert tree["friction"]["unit"] == "1" and tree["stiffness"]["unit"] == "N m/rad"
    assert tree["factor"]["unit"] == "SI"  # of masses, inertias and magnets in turn: nothing tells its own
    assert tree["device"] == "../../flap.py"


def test_a_device_is_compared_with_what_was_patched(folder, call):
    patched = str(patch("flap.py", stiffness=0.021))
    given = ("compare", "swing.csv", "--model", "flap.py", "--duration", "0.05", "--json")
    by_hand = json.loads(call(*given, "--set", "stiffness=0.021")[1])
    code, out, err = call(*given, "--calibration", patched)
    assert (code, err) == (0, "") and json.loads(out) == by_hand != json.loads(call(*given)[1])


def test_a_python_device_that_only_a_calibration_names_is_not_executed(folder, call):
    patched = str(patch("flap.py"))
    (folder / "flap.py").write_text("raise SystemExit(99)")
    for name in ("compare", "diagnose"):
        code, _, err = call(name, "swing.csv", "--model", patched)
        assert code == 2 and "executed only if you name it yourself" in err and err.count("\n") == 1
        assert f"--model flap.py --calibration {patched}" in err
    code, _, err = call("run", patched)
    assert code == 2 and "is a calibration, not a device (field 'device', value '../../flap.py'); allowed: fl" in err
    assert f"flap.py --calibration {patched}" in err


def test_a_calibration_stands_for_its_design_file(folder, call, monkeypatch):
    module = device_module("flap.py")
    sheet, drive = module.raw(scene_settings(module))
    write_design(folder / "flap.toml", sheet, drive, duration=0.1)
    sidecar = (folder / "swing.toml").read_text().split("[scene]")[0]
    (folder / "swing.toml").write_text(sidecar)
    patched = str(patch("flap.toml", duration=0.2))
    code, out, err = call("compare", "swing.csv", "--model", patched, "--duration", "0.05")
    assert (code, err) == (0, "") and "fold" in out
    found = handed(monkeypatch)
    assert call("diagnose", "swing.csv", "--model", patched, "--prior", "crease.stiffness=20%")[0] == 2
    assert found[0][0].name == "flap"
    assert "model would be overwritten" in call("diagnose", "swing.csv", "--model", patched, "--out", "runs/d")[2]
    code, _, err = call("compare", "swing.csv", "--model", patched, "--calibration", patched)
    assert code == 2 and "is a calibration already" in err


def test_a_calibration_beside_a_device_is_over_the_overrides_of_the_sidecar(folder, call, monkeypatch):
    found, patched = handed(monkeypatch), str(patch("flap.py", stiffness=0.021))
    given = ("diagnose", "swing.csv", "--model", "flap.py", "--prior", "stiffness=20%")
    assert call(*given)[0] == 2
    code, out, _ = call(*given, "--calibration", patched)
    assert code == 2 and "overrides are left out: --calibration states" in out
    assert [f[0].nominals[0].start for f in found] == [0.0025, 0.021]


def test_a_calibration_without_its_device_is_told_how_to_be_used(folder, call):
    file = patch("flap.py")
    file.write_text(file.read_text().replace('device = "../../flap.py"', ""))
    code, _, err = call("compare", "swing.csv", "--model", str(file))
    assert code == 2 and "is a calibration, not a device" in err and "my_flap.py, or a scene, with --calib" in err
    (folder / "swing.toml").write_text((folder / "swing.toml").read_text().split("[scene]")[0])
    code, _, err = call("diagnose", "swing.csv", "--model", str(file))
    assert code == 2 and "a calibration of no scene" in err and f"or --model my_flap.py --calibration {file}" in err


def test_what_is_patched_is_diagnosed_and_compared_again(folder, call):
    """From a drive in quantities to the patch and back, with what the search has found at once."""
    (folder / "swing.toml").write_text((folder / "swing.toml").read_text().split("[scene]")[0])
    given = ("diagnose", "swing.csv", "--model", "flap.py", "--prior", "stiffness=20%", "--limit", "1e-9")
    quick = ("--suspects", "crease_friction", "--out")
    assert call(*given, *quick, "runs/one")[0] >= 10
    patched = "runs/one/patched.toml"
    tree = tomllib.loads((folder / patched).read_text())
    assert tree["device"] == "../../flap.py" and tree["friction"]["unit"] == "1"
    assert call(*given, "--calibration", patched, *quick, "runs/two")[0] >= 10
    assert call("compare", "swing.csv", "--model", "flap.py", "--calibration", "runs/two/patched.toml")[0] == 0


def test_a_calibration_that_names_no_device_is_refused_by_a_sentence(folder, call):
    file = patch("flap.py")
    file.write_text(file.read_text().replace("../../flap.py", "nowhere"))
    code, _, err = call("compare", "swing.csv", "--model", str(file))
    assert code == 2 and "its device is neither a scene nor a device file (field 'device', value 'nowhere')" in err
