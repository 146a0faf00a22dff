"""Nothing loses a verdict: what fails, or ends the process, after it costs only what was not computed yet."""

import json
import os
import signal
import time as clock
import tomllib
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
from diagnose.swings import QUICK, main, swing
from diagnose.test_report import example

from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import EXIT, Keep, command
from origami_sim.diagnose.later import Part, add
from origami_sim.errors import InputError
from origami_sim.report import diagnosis


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return swing(tmp_path_factory.mktemp("recorded"), duration=3.0)


def stopped_at(name: str, by):
    shown = command.Progress.__call__

    def told(self, stage, part):
        shown(self, stage, part)
        if stage == name:
            by()

    return told


def test_a_search_that_ends_at_its_limit_has_a_verdict_and_goes_on_with_more_time(
    recorded, tmp_path, capfd, monkeypatch
):
    out = tmp_path / "out"
    arguments = ("diagnose", recorded, "--model", "pendulum_chain", "--out", out, *QUICK)
    assert main(*arguments, "--limit", "1e-9") == EXIT["TIE"]  # before suspects are simulated
    early, said = json.loads((out / "diagnosis.json").read_text()), capfd.readouterr()
    assert early["ended"] and not early["experiments"] and "effects" not in early["patch"]
    assert "Not decided yet: " in said.out and "suspects were not simulated" in said.out
    assert "do not tell" not in said.out
    passed = [0.0]
    with monkeypatch.context() as m:
        fake = SimpleNamespace(perf_counter=lambda: clock.perf_counter() + passed[0])
        m.setattr(import_module("origami_sim.diagnose.diagnose"), "clock", fake)
        m.setattr(command.Progress, "__call__", stopped_at("search", lambda: passed.append(passed.pop() + 1e6)))
        assert main(*arguments, "--limit", "1e5") == EXIT["TIE"]  # before a set is fitted
    early, said = json.loads((out / "diagnosis.json").read_text()), capfd.readouterr()
    assert early["ended"] and early["verdict"] == "TIE" and "crease_friction" not in str(early["patch"])
    assert "search, so far no effect" in said.err
    assert "Not decided yet. " in said.out and "dry friction" in said.out and "its limit of 100000 s" in said.out
    assert main(*arguments) == EXIT["MECHANISM"]
    assert not json.loads((out / "diagnosis.json").read_text())["ended"]
    assert "so far crease_friction at hinge1" in capfd.readouterr().err
    assert not (out / ".resume").exists()


def test_a_verdict_outlives_the_process_and_all_that_fails_after_it(recorded, tmp_path, monkeypatch, capfd):
    out = tmp_path / "out"
    arguments = ("diagnose", recorded, "--model", "pendulum_chain", "--out", out, *QUICK)
    out.mkdir()
    (out / ".resume").mkdir()  # of an earlier one, with a page that is not of what is found now
    (out / "report.html").write_text("old")
    before = signal.getsignal(signal.SIGTERM)
    with monkeypatch.context() as m:
        m.setattr(command.Progress, "__call__", stopped_at("baselines", lambda: os.kill(os.getpid(), signal.SIGTERM)))
        assert main(*arguments) == 130
    assert signal.getsignal(signal.SIGTERM) is before
    said = capfd.readouterr().err
    assert "interrupted after the verdict, MECHANISM" in said and "the same command goes on" in said
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "MECHANISM" and found["unfinished"] == ["baselines"]
    assert found["places"] and found["candidates"] and not found["baselines"]
    assert "crease_friction" in tomllib.loads((out / "patched.toml").read_text())["effects"]
    assert {p.name for p in out.iterdir()} == {"diagnosis.json", "patched.toml", "replay.rrd", ".resume"}

    def crash(*_):
        raise RuntimeError("no memory for that")

    (out / "report.html").mkdir()  # so that the page cannot be written
    (out / "report.html" / "taken").write_text("")
    (out / "replay.rrd").unlink()
    (out / "replay.rrd").mkdir()
    monkeypatch.setattr(import_module("origami_sim.diagnose.diagnose"), "baselines", crash)
    assert main(*arguments) == EXIT["MECHANISM"]
    printed = capfd.readouterr().out
    again = json.loads((out / "diagnosis.json").read_text())
    assert again["unfinished"] == [] and again["sentence"] == found["sentence"]
    for part in ("Baselines could not be told (RuntimeError: no memory for that)", "The page", "The replay"):
        assert [n for n in again["notes"] if n.startswith(part)] and f"note: {part}" in printed
    assert "report: " + str(out / "diagnosis.json") in printed


def test_each_part_is_handed_over_when_it_is_there():
    found, seen = example(), []

    def full():
        raise MemoryError

    def interrupted():
        raise KeyboardInterrupt

    parts = [
        Part("one", "One could not be told", lambda: {"onset": 3.0}),
        Part("two", "Two could not be told", full),
        Part("three", "Three could not be told", lambda: {"onset": 4.0}),
    ]
    add(found, parts, lambda *_: None, lambda d: seen.append((d.onset, d.unfinished)))
    assert [u for _, u in seen] == [["one", "two", "three"], ["two", "three"], ["three"], []]
    assert [o for o, _ in seen][1:] == [3.0, 3.0, 4.0]
    assert found.notes[-1] == "Two could not be told (MemoryError)."
    with pytest.raises(KeyboardInterrupt):
        add(found, [Part("end", "", interrupted)], lambda *_: None, lambda _: None)


def test_parts_that_are_made_side_by_side_are_handed_over_together():
    found, keep, seen = example(), Keep(), []
    parts = [
        Part("one", "One could not be told", lambda: {"onset": 3.0}, alone=True),
        Part("two", "Two could not be told", lambda: 1 / 0, alone=True),  # type: ignore[arg-type]
        Part("film", "The film could not be made", lambda: {"films": [Path("film")]}, alone=True, of=keep),
        Part("three", "Three could not be told", lambda: {"onset": 4.0}),
    ]
    add(found, parts, lambda *_: None, lambda d: seen.append((d.onset, d.unfinished)))
    assert [u for _, u in seen] == [["one", "two", "film", "three"], ["three"], []]
    assert [o for o, _ in seen][1:] == [3.0, 4.0] and keep.films == [Path("film")]
    assert found.notes[-1] == "Two could not be told (ZeroDivisionError: division by zero)."


def files(folder: Path, keep: Keep) -> command.Files:
    return command.Files(folder, scene_settings(scene_module("pendulum_chain")), "pendulum_chain", keep)


def test_predictions_make_room_for_a_verdict_where_the_disk_is_full(tmp_path, monkeypatch):
    stored = tmp_path / "out" / ".resume"
    stored.mkdir(parents=True)
    (stored / "one.npz").write_bytes(b"large")
    write = diagnosis.write_text

    def full(path, text):
        if stored.exists():
            raise OSError(28, "No space left on device")
        return write(path, text)

    monkeypatch.setattr(diagnosis, "write_text", full)
    found = example()
    made = files(tmp_path / "out", Keep(stored))
    made(found)
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == found.verdict
    assert not stored.exists() and made.folder == tmp_path / "out"


def test_a_folder_that_cannot_be_written_any_more_is_replaced(tmp_path, monkeypatch):
    taken = tmp_path / "out"
    taken.write_text("")
    found = example()
    made = files(taken, Keep())
    monkeypatch.setattr(command.tempfile, "tempdir", str(tmp_path))
    made(found)
    made(found)
    there = json.loads((made.folder / "diagnosis.json").read_text())
    assert made.folder.parent == tmp_path and made.folder != taken
    assert [n for n in there["notes"] if n.startswith(f"{taken} cannot be written")] == [found.notes[-1]]
    monkeypatch.setattr(command.tempfile, "tempdir", str(taken))  # nor anywhere else
    made = files(taken, Keep())
    made(found)
    assert found.notes[-1].endswith("Only what is printed is left.") and made.made == {"replays": []}


def test_a_patch_that_cannot_be_made_is_a_note(tmp_path, monkeypatch):
    def odd(*_, **__):
        raise InputError("out of its bounds", field="stiffness")

    monkeypatch.setattr(command, "write_patch", odd)
    found = example()
    files(tmp_path, Keep())(found)
    there = json.loads((tmp_path / "diagnosis.json").read_text())
    assert there["notes"][-1].startswith("The patched calibration could not be written (out of its bounds")
