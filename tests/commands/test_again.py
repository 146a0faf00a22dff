"""A run folder makes its run again, whatever became of the file of the device, or says what does."""

import json
import shutil

import numpy as np
import pytest

from origami_sim.results.run_folder import load_run

FLAP = """
from origami_sim import Drive, Sheet, ramp, strip
DURATION = 0.2
def build(gap="2 mm", field="20 mT"):
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", material="pdms", triangulation="center")
    sheet.patch(1, thickness="3 mm", poling=(1, 0, 0))
    sheet.crease(stiffness="2 mN m/rad", loss_time="3 ms").gravity().fix(panels=[0])
    return sheet, Drive(field=(0, 0, ramp(field, 0.1)))
"""


@pytest.fixture
def call(call, tmp_path):
    """Runs a command line in a folder with the file of a flap."""
    (tmp_path / "flap.py").write_text(FLAP)
    return call


@pytest.mark.parametrize(
    "how", [(), ("--panels", "rigid"), ("--accuracy", "1e-2"), ("--quasistatic", "--until", "5")], ids=str
)
def test_a_run_is_made_again_from_its_folder_without_the_file_of_its_device(call, tmp_path, how):
    assert call("run", "flap.py", "--set", "field=30mT", "--set", "duration=0.15", *how, "--out", "runs/first")[0] == 0
    shutil.copytree("runs/first", "runs/second")
    made = (tmp_path / "runs/second/states.npz").stat().st_mtime_ns
    (tmp_path / "flap.py").unlink()
    assert call("run", "runs/second")[0] == 0
    assert (tmp_path / "runs/second/states.npz").stat().st_mtime_ns > made and not (tmp_path / "runs/flap").exists()
    first, second = load_run("runs/first"), load_run("runs/second")
    assert np.array_equal(first.trajectory.times, second.trajectory.times)
    assert np.array_equal(first.trajectory.x, second.trajectory.x)
    assert first.manifest["parameters_hash"] == second.manifest["parameters_hash"]
    assert first.manifest["device"]["given"] == "flap.py" and len(first.manifest["device"]["sha256"]) == 64
    assert call("show", "runs/first")[0] == 0  # as any device


@pytest.mark.parametrize("own", ["run", "scene"])
def test_what_no_folder_holds_says_which_command_makes_it_again(call, tmp_path, own):
    if own == "run":
        with open("flap.py", "a") as f:
            f.write("def run(s, progress=None):\n"
                    "    from origami_sim import simulate\n    from origami_sim.device.scene import Outcome\n"
                    "    return Outcome(simulate(*build()[0].build(), duration=0.1), {})\n")  # fmt: skip
    given, sets = ("flap.py", "field=30mT") if own == "run" else ("crease_coupon", "rest_angle=0.3")
    assert call("run", given, "--set", sets, "--out", "here")[0] == 0
    assert json.loads((tmp_path / "here" / "manifest.json").read_text())["device"]["why"]
    code, out, err = call("run", "here")
    assert (code, out) == (2, "")
    assert f"origami-sim run {given} --set {sets}" in err and "does not make its run again" in err


def test_an_earlier_device_does_not_stay_in_a_folder(call):
    assert call("run", "flap.py", "--out", "here")[0] == 0
    assert call("run", "crease_coupon", "--out", "here")[0] == 0
    assert call("run", "here")[0] == 2


@pytest.mark.parametrize(("given", "said"), [("", "no such scene"), (".", "no device.toml"), ("x" * 300, "")])
def test_what_is_no_run_folder_is_refused_in_a_sentence(call, given, said):
    code, out, err = call("run", given)
    assert (code, out) == (2, "") and said in err and err.count("\n") == 1


def test_a_design_file_says_how_it_moves(call, tmp_path):
    assert call("show", "flap.py", "--save", "flap.toml")[0] == 0
    text = (tmp_path / "flap.toml").read_text()
    (tmp_path / "flap.toml").write_text(text.replace("[run]", '[run]\nmotion = "quasistatic"\nuntil = "5 s"'))
    assert call("show", "flap.toml", "--save", "again.toml")[0] == 0
    assert call("run", "again.toml", "--out", "here")[0] == 0
    assert load_run("here").trajectory.times[-1] == 5.0
    for line, said in (('motion = "jump"', "no such motion"), ("until = 5.0", "only a quasi-static motion"),
                       ("accuracy = -1.0", "accuracy"), ("pace = 1.0", "pace")):  # fmt: skip
        (tmp_path / "flap.toml").write_text(text.replace("[run]", f"[run]\n{line}"))
        code, _, err = call("run", "flap.toml")
        assert code == 2 and said in err and "flap.toml" in err
