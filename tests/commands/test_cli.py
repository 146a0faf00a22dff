"""The command line: what it prints, its exit codes, and that bad input leaves everything as it was."""

import errno
import hashlib
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from origami_sim import __version__
from origami_sim.commands.progress import Bar
from origami_sim.device import scene
from origami_sim.device.scene import read_calibration, scene_module
from origami_sim.drive import Drive, series
from origami_sim.errors import InputError
from origami_sim.recording import stand_in_double_pendulum
from origami_sim.results.run_folder import load_run
from origami_sim.scenes import mae_crease
from origami_sim.solve.motion.dynamics import simulate

COMMANDS = (
    *("run", "show", "sweep", "replay", "export", "compare", "diagnose"),
    *("study", "calibrate", "effects", "stride", "demo"),
)
SIDECAR = Path(scene_module("pendulum_chain").__file__).with_name("pendulum_chain_double.toml")
QUICK = ("--set", "fold_time=0.05", "--set", "hold_time=0")


def contents(folder: Path) -> dict[str, str]:
    """Every file below a folder with the digest of its bytes."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() if p.is_file() else "folder"
        for p in sorted(folder.rglob("*"))
    }


# what it prints --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(call, command):
    code, out, _ = call(command, "--help")
    assert code == 0
    assert re.search(rf"example: origami-sim {command}\b", out)
    assert "--json" in out


def test_help_lists_commands_and_exit_codes(call):
    code, out, _ = call("--help")
    assert code == 0
    assert all(c in out for c in COMMANDS)
    assert "Exit codes" in out


def test_the_module_is_the_command_and_says_its_version(tmp_path):
    command = [sys.executable, "-m", "origami_sim", "--version"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (said.returncode, said.stdout) == (0, f"origami-sim {__version__}\n")


def test_run_box_prints_its_table_and_leaves_a_run(call, tmp_path):
    code, out, err = call("run", "box")
    assert (code, err) == (0, "")
    assert "reference_deg" in out
    assert "81.39" in out
    assert re.search(r"dt = .* of the limit .* set at node", out)
    assert re.search(r"energy balance: off by \S+ % of the energy exchanged", out)
    run = load_run(tmp_path / "runs" / "box")
    assert run.manifest["scene"] == "box"
    assert run.units["field_mT"] == "mT"
    assert run.replay.is_file()


def test_a_run_that_is_too_coarse_says_so_and_an_accuracy_mends_it(call, tmp_path):
    code, out, _ = call("run", "cube_toss", "--set", "duration=0.4")
    assert code == 0 and re.search(r"The energy balance is off by .* accuracy", out)
    code, out, _ = call("run", "cube_toss", "--set", "duration=0.4", "--accuracy", "1e-2", "--json")
    result = json.loads(out)
    assert code == 0 and result["energy_error"] < 1e-2
    assert result["notes"][0].startswith("Accuracy 0.01: halving")
    kept = load_run(tmp_path / "runs" / "cube_toss")
    assert kept.manifest["energy_error"] == kept.trajectory.energy_error.tolist() == [result["energy_error"]]
    code, out, err = call("run", "cube_toss", "--accuracy", "2")
    assert (code, out) == (2, "") and "no such accuracy" in err and "accuracy" in err


def test_overrides_reach_the_run_with_their_units(call, tmp_path):
    code, out, _ = call("run", "box", "--set", "gap=3.81mm", "--set", "gravity=0", "--json", "--out", "here")
    assert code == 0
    result = json.loads(out)
    assert result["numbers"]["flap_deg"] == pytest.approx(83, abs=0.7)
    assert result["failures"] == []
    manifest = load_run(tmp_path / "here").manifest
    assert manifest["overrides"] == {"gap": "3.81mm", "gravity": "0"}
    assert manifest["settings"]["gap"] == pytest.approx(0.00381)


def test_settings_are_listed_with_their_sources(call, tmp_path):
    code, out, _ = call("run", "box", "--settings", "--set", "gap=3mm")
    assert code == 0
    assert "gap = 0.003 m, 0.001 to 0.006" in out
    assert all(s.source in out for s in read_calibration("box").values())
    code, out, _ = call("run", "box", "--settings", "--json")
    assert json.loads(out)["gap"]["unit"] == "m"
    assert contents(tmp_path) == {}


def test_a_calibration_file_replaces_the_scenes_own(call, tmp_path):
    shipped = Path(scene.__file__).parents[2] / "calibrations" / "fold_file.toml"
    own = tmp_path / "own.toml"
    own.write_text(shipped.read_text().replace('value = "miura.fold"', 'value = "waterbomb.fold"'))
    code, out, _ = call("run", "fold_file", "--calibration", own, *QUICK)
    assert code == 0
    assert "6 creases folded" in out


def test_effects_lists_the_whole_catalogue(call):
    from origami_sim.effects import CATALOGUE

    code, out, _ = call("effects")
    assert code == 0
    for effect in CATALOGUE.values():
        assert f"{effect.name}  ({effect.family})" in out
        assert effect.formula in out
    code, out, _ = call("effects", "--json")
    assert [e["name"] for e in json.loads(out)] == list(CATALOGUE)
    assert "Infinity" not in out
    code, out, _ = call("effects", "crease")
    assert code == 0
    assert out.startswith("crease  (crease)")


def test_compare_with_a_stand_in_recording(call, tmp_path):
    recording = stand_in_double_pendulum(tmp_path / "stand_in.csv", duration=1.5)
    code, out, err = call("compare", recording, "--scene", "pendulum_chain", "--sidecar", SIDECAR, "--duration", 1)
    assert (code, err) == (0, "")
    assert "theta1" in out
    assert "fit" in out
    folder = tmp_path / "runs" / "compare"
    assert (folder / "overlay.png").stat().st_size > 10_000
    columns = load_run(folder).tables["comparison"]
    assert len(columns["time_s"]) == 1001
    code, out, _ = call(
        "compare", recording, "--scene", "pendulum_chain", "--sidecar", SIDECAR, "--duration", 0.5, "--json"
    )
    assert code == 0
    assert set(json.loads(out)["channels"]) == {"theta1", "theta2"}


def test_compare_finds_the_shipped_sidecar_from_within_the_folder(call, tmp_path, monkeypatch):
    (tmp_path / "pendulum_chain").mkdir()
    stand_in_double_pendulum(tmp_path / "pendulum_chain" / "double.csv", duration=0.5)
    monkeypatch.chdir(tmp_path / "pendulum_chain")
    code, _, err = call("compare", "double.csv", "--scene", "pendulum_chain", "--duration", 0.2)
    assert (code, err) == (0, "")


@pytest.mark.parametrize("words", [("--json", "paper"), ("paper", "--json")])
def test_calibrate_takes_json_on_either_side(call, tmp_path, words):
    (tmp_path / "article.txt").write_text("The tape is 19 mm wide.")
    code, out, _ = call("calibrate", *words, "article.txt", "--take", "width=tape is # mm wide")
    assert code == 0
    assert json.loads(out)["values"]["width"]["value"] == pytest.approx(0.019)


def test_screenshot_of_a_run(call, tmp_path):
    assert call("run", "fold_file", "--out", "here", *QUICK)[0] == 0
    code, _, err = call("replay", "here", "--screenshot", "picture.png", "--json")
    refused(call, tmp_path, ["replay", "here", "--time", "0.01"], r"'--time', value 0\.01.*with --screenshot")
    if code == 1:
        pytest.skip(err.strip() or "no renderer here")
    assert code == 0
    assert (tmp_path / "picture.png").stat().st_size > 5_000


def test_progress_is_shown_only_to_somebody_who_watches(capsys, monkeypatch):
    Bar("box")(0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    bar = Bar("box")
    bar(0.5)
    bar(0.5)
    bar(1.0)
    shown = capsys.readouterr().err
    assert shown.count("50 %") == 1
    assert re.search(r"100 % in [\d.]+ s\n$", shown)


@pytest.mark.parametrize("command", [("show",), ("sweep", "--vary", "gap=1mm"), ("compare", "x.csv", "--model")])
def test_a_pattern_is_no_device_and_what_makes_one_of_it_is_said(call, tmp_path, command):
    (tmp_path / "crane.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    code, out, err = call(command[0], *(command[1:] if command[0] == "compare" else ()), "crane.svg",
                          *(command[1:] if command[0] == "sweep" else ()))  # fmt: skip
    assert (code, out) == (2, "")
    assert "a crease pattern is no device" in err and "origami-sim run crane.svg" in err and "read_pattern" in err


def test_a_long_run_says_how_long_it_will_take(capsys, monkeypatch):
    clock = iter([0.0, 10.0, 40.0, 80.0, 400.0])
    monkeypatch.setattr("origami_sim.commands.progress.time.perf_counter", lambda: next(clock))
    bar = Bar("sheet")
    for done in (0.025, 0.1, 0.2, 1.0):  # nobody watches: once, when it has taken long
        bar(done)
    assert capsys.readouterr().err == "sheet: 10.0% done in 40 s, about 6 min left\n"
    clock = iter([0.0, 40.0])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    Bar("sheet")(0.5)
    assert "50 %, about 40 s left" in capsys.readouterr().err


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_a_run_may_follow_equilibria_for_an_hour(call, tmp_path, panels):
    """A crease that relaxes swings to its rest angle as a standard linear solid does, without inertia."""
    own = read_calibration("crease_coupon")
    branch, time = 0.5 * own.stiffness, 200.0
    file = tmp_path / "creeping.toml"
    file.write_text(
        'motion = "quasistatic"\n'
        + own.file.read_text()
        + f"\n[[effects.crease_relaxation]]\nstiffness_1 = {branch}\ntime_1 = {time}\n"
    )
    code, out, err = call("run", "crease_coupon", "--calibration", file, "--panels", panels, "--until", 3600)
    assert code == 0 and not err
    assert "Quasi-static: 121 frames" in out and "equilibria along time" in out
    run = load_run(tmp_path / "runs" / "crease_coupon")
    assert run.trajectory.times[[0, 60, -1]] == pytest.approx([0.0, 1.0, 3600.0])
    left = branch / (own.stiffness + branch) * np.exp(-run.trajectory.times / time / (1 + branch / own.stiffness))
    assert run.trajectory.creases[:, 0, 0] == pytest.approx(own.rest_angle * (1 - left), abs=2e-3)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("run", "mae_crease", "--until", "10"), "only a quasi-static motion is held on"),
        (("run", "mae_crease", "--quasistatic", "--until", "-1"), "only a quasi-static motion is held on"),
        (("run", "falling_ball", "--quasistatic"), "take no such option"),
    ],
)
def test_what_no_quasi_static_run_can_do_is_refused(call, arguments, sentence):
    code, _, err = call(*arguments)
    assert code == 2 and sentence in err


# exit codes --------------------------------------------------------------------------------------------------------


def test_code_1_where_the_answer_is_no(call, monkeypatch):
    assert call("run", "fold_file", "--out", "here", *QUICK)[0] == 0
    monkeypatch.setattr("origami_sim.view.viewer.screenshot", lambda *_, **__: False)
    code, out, _ = call("replay", "here", "--screenshot", "picture.png", "--json")
    assert code == 1
    assert json.loads(out) == {"picture": None}


def test_code_3_names_world_time_place_and_cause(call, tmp_path):
    code, out, err = call(
        "run", "fold_file", "--set", "crease_stiffness=100", "--set", "membrane=1e-5", "--json", *QUICK
    )
    assert code == 3
    sentence = r"origami-sim: world 0 went unstable at t = [\d.e-]+ s at node \d+: .+ strained by \d+%.*smaller step"
    assert re.match(sentence, err)
    assert len(err.splitlines()) == 1
    assert len(json.loads(out)["failures"]) == 1
    assert load_run(tmp_path / "runs" / "fold_file").trajectory.failures  # kept, to see what happened


def test_a_run_that_fails_leaves_an_earlier_result(call, tmp_path):
    assert call("run", "fold_file", *QUICK)[0] == 0
    before = contents(tmp_path)
    for _ in range(2):
        code, out, _ = call("run", "fold_file", "--set", "crease_stiffness=100", "--set", "membrane=1e-5", *QUICK)
        assert code == 3 and "run folder: runs/fold_file-failed" in out
    assert before.items() <= contents(tmp_path).items()
    assert load_run(tmp_path / "runs" / "fold_file-failed").trajectory.failures
    (tmp_path / "runs" / "fold_file" / "notes.txt").write_text("mine")
    assert call("run", "fold_file", *QUICK)[0] == 0  # replaces the run, and nothing else
    after = contents(tmp_path)
    assert after["runs/fold_file/manifest.json"] != before["runs/fold_file/manifest.json"]
    assert (tmp_path / "runs" / "fold_file" / "notes.txt").read_text() == "mine"


def test_code_130_and_earlier_results_untouched_after_an_interrupt(call, tmp_path):
    assert call("run", "fold_file", "--out", "here", *QUICK)[0] == 0
    before = contents(tmp_path)
    watch = "import origami_sim.commands.cli as c\nc.Bar.__call__ = lambda self, f: print(f, flush=True)\nc.main()"
    arguments = ["run", "fold_file", "--out", "here", "--set", "fold_time=100"]
    process = subprocess.Popen(
        [sys.executable, "-c", watch, *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        for _ in range(3):  # it computes
            assert process.stdout.readline().strip()
        process.send_signal(signal.SIGINT)
        process.stdout.close()
        process.stdout = None
        _, err = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 130
    assert err == "origami-sim: interrupted; earlier results are untouched.\n"
    assert contents(tmp_path) == before


def test_a_disk_that_is_full_is_one_sentence(call, monkeypatch, tmp_path):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "runs" / "positions.npy"))

    monkeypatch.setattr("origami_sim.commands.cli._save", full)
    code, _, err = call("run", "fold_file", *QUICK)
    assert (code, err) == (2, f"origami-sim: {tmp_path}/runs/positions.npy: No space left on device.\n")


def test_a_reader_that_leaves_is_no_error(tmp_path):
    code = subprocess.run(
        f"set -o pipefail; {sys.executable} -m origami_sim.commands.cli effects | head -1",
        shell=True, executable="/bin/bash", cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert code.returncode == 0
    assert code.stderr == ""


# bad input ---------------------------------------------------------------------------------------------------------


def refused(call, tmp_path, arguments, words):
    """One sentence, code 2, nothing on standard output, no file touched."""
    before = contents(tmp_path)
    code, out, err = call(*arguments)
    assert code == 2, (out, err)
    assert out == ""
    assert re.search(words, err), err
    assert err.startswith("origami-sim: ")
    assert len(err.splitlines()) == 1
    assert err.endswith(".\n")
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], r"required: COMMAND"),
        (["fly"], r"invalid choice: 'fly'.*run.*demo"),
        (["run"], r"required: scene"),
        (["run", "box", "--colour", "red"], r"unrecognized arguments: --colour red"),
        (["run", "castle"], r"no such scene.*castle.*bifold, box, crawler"),
        (["run", "box", "--set", "gapp=1mm"], r"--set: cannot apply this setting; 'gap' is near.*gapp.*gap"),
        (["run", "box", "--set", "gp=2mm"], r"--set: cannot apply this setting; 'gap' is near"),
        (["run", "box", "--calibration", "."], r"origami-sim: \.: cannot be read: it is a folder"),
        (["run", "box", "--set", "gap=1m"], r"--set: out of its range.*'gap'.*0\.001 to 0\.006 m"),
        (["run", "box", "--set", "gap=1V"], r"wrong unit.*'gap'.*'V'.*m, cm, mm"),
        (["run", "box", "--set", "thickness=-1mm"], r"out of its range.*thickness"),
        (["run", "fold_file", "--set", "material=steel"], r"not one of the choices.*steel.*pdms"),
        (["run", "box", "--calibration", "none.toml"], r"none\.toml: cannot be read"),
        (["run", "box", "--calibration", "mae_crease"], r"mae_crease\.toml: .*lacks a setting"),
        (["run", "fold_file", "--set", "pattern=none.fold"], r"none\.fold: no such file"),
        (["run", "fold_file", "--set", "pattern=none.step"], r"unknown pattern format.*\.step.*\.fold"),
        (["effects", "telekinesis"], r"no such effect.*telekinesis.*adhesion"),
        (["export", "nowhere", "--to", "a.glb"], r"nowhere: there is no such run folder"),
        (["export", "nowhere", "--to", "a.webp", "--size", "big"], r"width x height.*--size.*big.*640x400"),
        (["replay", "nowhere"], r"nowhere: there is no such replay"),
        (["stride", "box"], r"does not walk.*box.*crawler"),
        (["stride", "--cycles", "0"], r"whole cycles.*--cycles.*0"),
        (["study", "nope"], r"invalid choice: 'nope'.*crawler.*bifold"),
        (["study", "crawler", "--samples", "-3"], r"too small.*--samples.*-3.*>= 0"),
        (["study", "--json", "crawler", "--cycles", "3"], r"too small.*--cycles.*>= 4"),
        (["study", "crawler", "--json", "--calibration", "box"], r"box\.toml: .*lacks a setting"),
        (["study", "bifold", "--json", "--set", "voltage=1kV"], r"varied by the study.*voltage"),
        (["compare", "none.csv", "--scene", "pendulum_chain"], r"none\.csv.*cannot be read"),
        (["compare", "none.csv", "--scene", "box"], r"cannot replicate.*box.*pendulum_chain"),
        (["compare", "none.csv", "--scene", "pendulum_chain", "--duration", "0"], r"must be positive.*--duration"),
        (["compare", "", "--scene", "pendulum_chain"], r"cannot be read: it is a folder"),
        (["compare", "none.csv", "--scene", "pendulum_chain", "--threshold", "inf"], r"must be positive.*--threshold"),
        (["show", "box", "--out", "box.xyz"], r"is no picture.*--out.*box\.xyz.*\.png"),
        (["sweep", "box", "--vary", "gap=1mm:2mm"], r"from, to and how many values.*--vary gap.*1mm:2mm:5.*1mm,2mm"),
        (["sweep", "box", "--vary", "1mm:2mm"], r"the setting that it is of.*NAME=1mm:2mm"),
        (["show", "crane.fold"], r"no such file.*'device', value 'crane.fold'"),
        (["sweep", "box", "--vary", "gap=1mm:2mm:99999999"], r"too many values.*--vary gap.*up to 100000"),
        (["sweep", "box", "--vary", "gap=1mm,2mm", "--pareto", "mass_g,weight"], r"no such measure.*--pareto.*weight"),
        (["run", "nothing.svg", "--settings"], r"nothing\.svg: no such file"),
        (["effects", "a\0b"], r"null byte"),
        (["compare", "none.csv", "--scene", "pendulum_chain", "--threshold", "nan"], r"must be positive.*--threshold"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else "",
)
def test_bad_arguments(call, tmp_path, arguments, words):
    refused(call, tmp_path, arguments, words)


SHEET = {
    "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "faces_vertices": [[0, 1, 2], [0, 2, 3]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
    "edges_assignment": ["B", "B", "B", "B", "V"],
    "edges_foldAngle": [0, 0, 0, 0, 90],
    "frame_unit": "cm",
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vertices_coords": None}, r"vertices_coords"),
        ({"faces_vertices": [[0, 1, 2], [0, 2, 7]]}, r"faces_vertices.*7"),
        ({"vertices_coords": [[0, 0], [1, 0], [2, 0], [0, 1]]}, r"area"),
        ({"faces_vertices": [[0, 1, 2], [0, 2, 3], [2, 0, 1]]}, r"faces_vertices"),
        ({"vertices_coords": [[0, 0], [1, float("nan")], [1, 1], [0, 1]]}, r"bad\.fold: number that JSON.*NaN.*finite"),
        ({"frame_unit": "parsec"}, r"frame_unit.*parsec.*m, cm, mm"),
        ({"faces_osim:thickness": [-0.001, 0.001]}, r"thickness.*-0\.001"),
        ({"faces_osim:material": ["pdms", "steel"]}, r"steel.*pdms"),
        ({"edges_osim:stiffness": [1, 1, 1, 1, -2]}, r"stiffness.*-2"),
    ],
)
def test_malformed_patterns(call, tmp_path, change, words):
    path = tmp_path / "bad.fold"
    path.write_text(json.dumps({k: v for k, v in {**SHEET, **change}.items() if v is not None}))
    refused(call, tmp_path, ["run", "fold_file", "--set", f"pattern={path}"], words)


def test_earlier_results_survive_a_refused_run(call, tmp_path):
    assert call("run", "fold_file", *QUICK)[0] == 0
    torn = tmp_path / "torn.fold"
    torn.write_text("{")
    refused(call, tmp_path, ["run", "fold_file", "--set", f"pattern={torn}"], r"torn\.fold.*JSON")


def test_output_folders_that_cannot_be_written(call, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("mine")
    monkeypatch.setattr(mae_crease, "run", lambda *_, **__: pytest.fail("computed before the folder was checked"))
    for out, words in (
        ("file", r"file: is a file; a run is a folder"),
        ("file/below", r"file/below: cannot be written"),
        ("mine", r"mine: is a folder with other things in it"),
        ("/proc/nothing/here", r"/proc/nothing/here: cannot be written"),
    ):
        refused(call, tmp_path, ["run", "mae_crease", "--out", out], words)
    refused(call, tmp_path, ["demo", "--out", "file"], r"cannot be written")


def test_a_diagnosis_replaces_nothing_but_a_diagnosis(call, monkeypatch, tmp_path):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("origami_sim.diagnose.command.diagnose", interrupted)
    recording = stand_in_double_pendulum(tmp_path / "stand_in.csv", duration=0.5)
    (tmp_path / "stand_in.toml").write_text(SIDECAR.read_text())
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "diagnosis.json").write_text('{"patient": "me"}')
    arguments = ["diagnose", recording, "--model", "pendulum_chain", "--suspects", "magic", "--out", "mine"]
    refused(call, tmp_path, arguments, r"mine: is a folder with other things.*--out.*that of a diagnosis")
    (tmp_path / "mine" / "diagnosis.json").write_text('{"verdict": "TIE", "recordings": ["monday", "tuesday"]}')
    _, out, err = call(*arguments)
    assert "no such effect" in err and out == ""  # so nothing is replaced
    _, out, _ = call(*["air_drag" if a == "magic" else a for a in arguments])
    assert "note: replaces the report of monday, tuesday in mine." in out
    (tmp_path / "mine" / "diagnosis.json").unlink()
    (tmp_path / "mine" / ".resume").mkdir()
    assert "no such effect" in call(*arguments)[2]


def test_a_calibration_replaces_nothing_but_a_calibration(call, tmp_path):
    (tmp_path / "article.txt").write_text("The tape is 19 mm wide.")
    (tmp_path / "mine.toml").write_text('[project]\nname = "mine"\n')
    arguments = ["calibrate", "paper", "article.txt", "--take", "width=tape is # mm wide", "--out"]
    refused(call, tmp_path, [*arguments, "mine.toml"], r"mine\.toml: exists, and is not a calibration.*--out")
    for _ in range(2):
        assert call(*arguments, "ours.toml")[0] == 0


def rows(count=3000, rate=1000.0) -> list[str]:
    t = np.arange(count) / rate
    noise = np.random.default_rng(0).normal(0, 1e-4, (2, count))
    theta = np.stack([2.6 + 0.1 * np.sin(7 * t), 3.5 + 0.1 * np.cos(5 * t)]) + noise
    return [f"{a:.6f},{b:.8f},{c:.8f}" for a, b, c in zip(t, *theta, strict=True)]


@pytest.mark.parametrize(
    ("edit", "sidecar", "words"),
    [
        (lambda r: r[:1000] + r[1200:], None, r"bad\.csv.*gap"),
        (lambda r: [*r[:1000], re.sub(r",.*,", ",,", r[1000]), *r[1001:]], None, r"bad\.csv.*theta1"),
        (lambda r: [*r[:1000], "1.0,a,b", *r[1001:]], None, r"bad\.csv"),
        (lambda r: r[::-1], None, r"bad\.csv.*time"),
        (lambda r: r, ('unit = "rad"', 'unit = "mm"'), r"toml.*unit.*mm"),
        (lambda r: r, ('unit = "s"', 'unit = "fortnight"'), r"toml.*fortnight"),
        (lambda r: r, ('column = "theta1_rad"', 'column = "phi"'), r"phi"),
        (lambda r: r, ('panel = "arm1"', 'panel = "arm7"'), r"arm7.*arm1"),
    ],
    ids=["gap", "missing", "words", "backwards", "length as angle", "unit of time", "column", "attachment"],
)
def test_bad_recordings(call, tmp_path, edit, sidecar, words):
    path, toml = tmp_path / "bad.csv", tmp_path / "bad.toml"
    path.write_text("time_s,theta1_rad,theta2_rad\n" + "\n".join(edit(rows())) + "\n")
    toml.write_text(SIDECAR.read_text().replace(*(sidecar or ("", "")), 1))
    refused(call, tmp_path, ["compare", path, "--scene", "pendulum_chain", "--duration", "0.2"], words)


def test_a_window_outside_the_recording(call, tmp_path):
    recording = stand_in_double_pendulum(tmp_path / "stand_in.csv", duration=0.5)
    arguments = ["compare", recording, "--scene", "pendulum_chain", "--sidecar", SIDECAR]
    refused(call, tmp_path, [*arguments, "--start", "9"], r"window|frames|recording")
    refused(call, tmp_path, [*arguments, "--start", "nan"], r"window|frames|recording")
    refused(call, tmp_path, [*arguments, "--start", "-1"], r"stand_in\.csv: is outside.*--start.*0 to 0\.5 s")
    refused(call, tmp_path, [*arguments, "--start", "0.2", "--duration", "1e9"], r"--duration.*up to 0\.3 s")
    code, out, _ = call(*arguments, "--start", "0.4")
    assert code == 0
    assert "compared from t = 0.400 s to t = 0.500 s: 101 of 501 frames" in out


def test_a_recording_of_another_scene(call, tmp_path):
    recording = stand_in_double_pendulum(tmp_path / "stand_in.csv", duration=0.5)
    (tmp_path / "stand_in.toml").write_text(SIDECAR.read_text().replace('name = "pendulum_chain"', 'name = "box"'))
    words = r"stand_in\.toml: .*another scene.*'box'.*diagnose --model box"
    refused(call, tmp_path, ["compare", recording, "--scene", "pendulum_chain"], words)


def test_no_pickle_is_opened(call, tmp_path):
    """A run folder from elsewhere cannot run code here."""
    assert call("run", "fold_file", "--out", "here", *QUICK)[0] == 0
    states = tmp_path / "here" / "states.npz"
    with np.load(states) as given:
        arrays = dict(given)
    arrays["x"] = np.array([{"a": 1}], dtype=object)
    np.savez(states, **arrays)
    with pytest.raises(InputError, match=r"states\.npz"):
        load_run(tmp_path / "here")


# the same for the Python interface -----------------------------------------------------------------------------------


def test_drives_that_end_early_and_steps_above_the_limit():
    model, parameters, drive = mae_crease.build(read_calibration("mae_crease"))
    short = Drive(field=(0, 0, series([0.0, 0.5], [0.0, 0.1])))
    with pytest.raises(InputError, match=r"drive ends before the run does.*field_z.*0\.5.*samples up to 1 s"):
        simulate(model, parameters, short, duration=1.0)
    with pytest.raises(InputError, match=r"time step is above the stability limit.*dt.*0\.001.*0 < dt <= .*bend"):
        simulate(model, parameters, drive, duration=1.0, dt=1e-3)
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match=r"positive"):
            simulate(model, parameters, drive, duration=bad)
