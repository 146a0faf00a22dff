"""Files that are traps are one sentence, and a full disk keeps what was computed."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from origami_sim.calibrate.curves import read_columns
from origami_sim.calibrate.stated import read_text
from origami_sim.commands import cli
from origami_sim.design.design_file import is_design, read_design
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.drive.gridded import FieldTable
from origami_sim.errors import DiskFull, InputError, unwritable
from origami_sim.files import LARGEST_TOML, read_bytes, read_toml, write_text
from origami_sim.pattern import read_mesh, read_svg
from origami_sim.recording import read_recording
from origami_sim.recording.dataset import read_dataset
from origami_sim.recording.stand_in import stand_in_double_pendulum, write_stand_in_sidecar
from origami_sim.results import rescue
from origami_sim.results.run_folder import load_run
from tests.view.test_replay import swing

SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"><rect width="9" height="9" stroke="#000"/>'
    "{}</svg>"
)


def refused(call, *arguments, **options) -> str:
    """The sentence with which something is refused: one line, not long."""
    with pytest.raises(InputError) as e:
        call(*arguments, **options)
    assert "\n" not in str(e.value) and len(str(e.value)) < 2000
    return str(e.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system here")
def test_devices_and_pipes_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "list.toml").write_text('recordings = ["pipe.csv"]\n')
    said = refused(read_dataset, tmp_path / "list.toml")
    assert "pipe.csv" in said and "a device, a pipe or a socket" in said
    (tmp_path / "list.toml").write_text(f'recordings = ["{os.devnull}"]\n')
    assert "a device" in refused(read_dataset, tmp_path / "list.toml")
    assert "a folder" in refused(read_bytes, tmp_path)
    assert "too large" in refused(read_bytes, tmp_path / "list.toml", 5)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system here")
@pytest.mark.parametrize("read", [read_design, read_text, lambda p: read_columns(p, {}), FieldTable.read])
def test_no_reader_waits_for_a_pipe(tmp_path, read):
    os.mkfifo(tmp_path / "pipe.toml")
    assert "a device, a pipe or a socket" in refused(read, tmp_path / "pipe.toml")
    assert not is_design(tmp_path / "pipe.toml")


def test_a_design_that_is_a_trap(tmp_path):
    (tmp_path / "trap.toml").write_text(".".join("a" * 50_000) + " = 1")
    assert "nested too deeply" in refused(read_design, tmp_path / "trap.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "[" * 100_000, "nested too deeply"),
        ("a = " + "{b=" * 50_000, "nested too deeply"),
        (".".join("a" * 100_000) + " = 1", "nested too deeply"),
        ("[" + ".".join("a" * 100_000) + "]", "nested too deeply"),
        ("a = " + "9" * 10_000, "no valid TOML"),
        ("a = [1, {b = " + "9" * 400 + "}]", "beyond 64 bits"),
        ("a = = 1", "no valid TOML"),
        ("#" * (LARGEST_TOML + 1), "too large"),
    ],
)  # fmt: skip
def test_toml_that_is_a_trap(tmp_path, text, said):
    (tmp_path / "a.toml").write_text(text)
    assert said in refused(read_toml, tmp_path / "a.toml")


def test_toml_with_long_texts_is_read(tmp_path):
    (tmp_path / "a.toml").write_text('about = """\n' + "." * 300 + '\n"""\n# ' + "." * 300 + "\nx = 1.5\n")
    assert read_toml(tmp_path / "a.toml")["x"] == 1.5


def test_a_switch_is_no_number(tmp_path):
    box = scene_module("box")
    text = scene_settings(box).file.read_text().replace("value = 0.01143", "value = true", 1)
    (tmp_path / "box.toml").write_text(text)
    assert "a switch is no number (field 'patch_length'" in refused(scene_settings, box, tmp_path / "box.toml")


def test_a_table_of_many_columns_is_one_sentence(tmp_path):
    stand_in = stand_in_double_pendulum(tmp_path / "a.csv", duration=0.05)
    write_stand_in_sidecar(stand_in)
    more = 20_000
    rows = stand_in.read_text().splitlines()
    wide = [rows[0] + "," + ",".join(f"c{k}" for k in range(more)), *(r + ",1" * more for r in rows[1:])]
    stand_in.write_text("\n".join(wide) + "\n")
    recording = read_recording(stand_in)
    assert recording.frame_count == len(rows) - 1
    stand_in.write_text("\n".join(wide).replace("time_s", "t_s", 1) + "\n")
    assert "'time_s' is missing" in refused(read_recording, stand_in)


def test_a_vertex_of_two_numbers(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n")
    assert "a.obj" in refused(read_mesh, tmp_path / "a.obj")


@pytest.mark.parametrize("header", ["track,frame_idx", "track,frame_idx,instance.score,tip.x,tip.y,tip.score\n"])
def test_a_tracker_file_of_only_a_header(tmp_path, header):
    (tmp_path / "a.csv").write_text(header)
    side = '[time]\nrate_hz = 30.0\n[cameras.side]\n[channels.tip]\ntrack = "tip"\nkind = "marker_2d"\nnode = 4\n'
    (tmp_path / "a.toml").write_text(side)
    assert "the file has no rows" in refused(read_recording, tmp_path / "a.csv")


@pytest.mark.parametrize(
    "body",
    [
        "<style>" + "z" * 200_000 + "</style>",
        "<style>.m{stroke:#f00}" + "}" * 200_000 + "</style>",
        '<path d="M0 0 L9 9' + " z" * 200_000 + '" stroke="#f00"/>',
    ],
)  # fmt: skip
def test_drawings_on_which_a_parser_would_work_for_hours(tmp_path, body):
    (tmp_path / "a.svg").write_text(SVG.format(body))
    assert read_svg(tmp_path / "a.svg").face_count >= 1


def test_words_of_a_megabyte_are_cut_in_sentences():
    said = str(InputError("no such thing\nat all", field="x" * 10**6, value="y" * 10**6, allowed="z" * 10**6))
    assert len(said) < 2500 and "\n" not in said and said.startswith("no such thing at all (field 'xxx")


def full(*_, **__):
    raise unwritable(OSError(errno.ENOSPC, "No space left on device"), file="runs/box")


def test_a_full_disk_keeps_what_was_computed(tmp_path, monkeypatch):
    motion, notes, real = swing(), [], rescue.save_run
    with pytest.raises(DiskFull):
        full()

    def no_room_here(folder, trajectory, **options):
        return full() if tmp_path / "disk" in folder.parents else real(folder, trajectory, **options)

    def no_room_for_the_replay(folder, trajectory, *, replay=True, **options):
        return full() if replay is not False else real(folder, trajectory, replay=False, **options)

    target = tmp_path / "disk" / "swing"
    monkeypatch.setattr(rescue.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(rescue, "save_run", no_room_for_the_replay)
    assert rescue.save_somewhere(target, motion, note=notes.append, scene="swing") == target
    assert "all but the replay" in notes.pop() and not load_run(target).replay.exists()

    monkeypatch.setattr(rescue, "save_run", no_room_here)
    kept = rescue.save_somewhere(target, motion, note=notes.append, scene="swing")
    assert kept is not None and kept.parent == tmp_path and str(kept) in notes.pop()
    assert np.array_equal(load_run(kept).trajectory.x, motion.x)

    monkeypatch.setattr(rescue, "save_run", full)
    assert rescue.save_somewhere(target, motion, note=notes.append, scene="swing") is None
    assert "only what is printed is left" in notes.pop()


def test_what_was_computed_is_printed_before_the_disk_is_told_to_be_full(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rescue, "save_run", full)
    monkeypatch.setattr(rescue.tempfile, "tempdir", str(tmp_path))
    with pytest.raises(SystemExit) as e:
        cli.main(
            ["run", "fold_file", "--out", str(tmp_path / "run"), "--set", "fold_time=0.05", "--set", "hold_time=0"]
        )
    out, err = capsys.readouterr()
    assert e.value.code == 2 and "run folder: none" in out and "No space left" in err


def test_a_text_is_written_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    path = write_text(tmp_path / "new" / "a.toml", "one")

    def full(self, target):
        raise OSError("no space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="no space"):
        write_text(path, "two")
    assert path.read_text() == "one"
    assert [p.name for p in path.parent.iterdir()] == ["a.toml"]
