"""A run folder gives back what was saved, appears whole or not at all, and says what is wrong with it."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from origami_sim.drive import Drive, series, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.results import run_folder as results
from origami_sim.results.run_folder import format_table, is_run, load_run, save_run
from origami_sim.solve.motion.dynamics import Failure, Trajectory, simulate

X = 0.02 * np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 0.5, 0]], float)


def flap() -> tuple[Model, Parameters, Drive]:
    """Two triangles joined by a crease, one held; two worlds of different stiffness and field."""
    free = np.ones((4, 3))
    free[:3] = 0
    model = Model(
        position=X,
        free=free,
        bars=np.array([[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]], np.int32),
        creases=np.array([[3, 1, 2, 0]], np.int32),
        bends=np.zeros((0, 4), np.int32),
        triangles=np.array([[0, 1, 2], [1, 3, 2]], np.int32),
        triangle_panel=np.array([0, 1], np.int32),
        contacts=np.zeros((0, 3), np.int32),
        contact_weights=np.zeros((0, 3)),
        contact_offsets=np.zeros(0),
        contact_axes=np.zeros((0, 3)),
        electrodes=np.zeros(1, np.int32),
        effects=("bars", "crease", "gravity"),
        names={"crease": ("hinge",)},
    )
    p = Parameters(model)
    p.set("inertia", "mass", 1e-4).set("bars", "stiffness", 100.0).set("gravity", "gravity_z", -9.81)
    p.set("bars", "rest_length", np.linalg.norm(X[model.bars[:, 1]] - X[model.bars[:, 0]], axis=1))
    p.set("crease", "stiffness", [[1e-5, 2e-5]])
    return model, p, Drive(field=(0, sine(np.array([0.01, 0.02]), 3.0), series([0, 1, 2], [0, 0.1, 0])))


TABLES = {
    "modes": {"frequency": np.array([1.5, np.nan]), "count": [1, 2], "name": ["first", "second"]},
    "empty": {"t": []},
}
UNITS = {"frequency": "Hz", "t": "s"}
SETTINGS = {"seed": 7, "overrides": {"gap": 1e-3}, "tolerance": np.float64(np.inf)}


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    model, p, drive = flap()
    t = simulate(model, p, drive, duration=0.1, rate=50)
    t.failures.append(Failure(1, 0.05, 3, "made up"))
    t.notes.append("a note")
    return t


@pytest.fixture(scope="module")
def saved(trajectory, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "flap"
    save_run(path, trajectory, scene="flap", tables=TABLES, units=UNITS, settings=SETTINGS)
    return path


@pytest.fixture
def copy(saved, tmp_path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "run"))


def test_everything_comes_back(saved, trajectory):
    run = load_run(saved)
    t = run.trajectory
    for name in ("times", "x", "v", "angles", "gaps", "contact_forces"):
        assert np.array_equal(getattr(t, name), getattr(trajectory, name)), name
    for name in ("energies", "work"):
        ours, theirs = getattr(t, name), getattr(trajectory, name)
        assert set(ours) == set(theirs) and all(np.array_equal(ours[n], theirs[n]) for n in ours)
    assert t.model.hash == trajectory.model.hash and t.parameters.hash == trajectory.parameters.hash
    assert (t.failures, t.notes, t.dt, t.step, t.wall) == (
        trajectory.failures,
        trajectory.notes,
        trajectory.dt,
        trajectory.step,
        trajectory.wall,
    )
    for when in (0.0, 0.37, 1.4):
        assert np.array_equal(t.drive.field(when), trajectory.drive.field(when))
    assert t.drive.end == 2.0
    assert np.array_equal(t.energy_balance(), trajectory.energy_balance())


def test_a_run_can_be_continued(saved, trajectory):
    t = load_run(saved).trajectory
    ours = simulate(t.model, t.parameters, t.drive, duration=0.04, rate=50, state=t.state)
    theirs = simulate(
        trajectory.model, trajectory.parameters, trajectory.drive, duration=0.04, rate=50, state=trajectory.state.copy()
    )
    assert np.array_equal(ours.x, theirs.x)


def test_manifest_tells_what_was_run(saved, trajectory):
    def strict(word):
        raise AssertionError(f"{word} is not JSON")

    m = json.loads((saved / "manifest.json").read_text(), parse_constant=strict)
    assert (m["format"], m["scene"], m["seed"], m["overrides"]) == (1, "flap", 7, {"gap": 1e-3})
    assert m["settings"] == {"tolerance": "inf"}
    assert m["model_hash"] == trajectory.model.hash and m["parameters_hash"] == trajectory.parameters.hash
    assert m["dt"] == trajectory.dt and "limit" in m["dt_reason"]
    assert m["failures"] == [{"world": 1, "time": 0.05, "node": 3, "cause": "made up"}]
    assert {"origami-sim", "numpy", "warp-lang", "rerun-sdk"} <= set(m["versions"])
    assert m["units"]["x"] == "m" and m["wall"] > 0 and m["created"].endswith("+00:00")


def test_tables_keep_values_and_units(saved):
    run = load_run(saved)
    assert np.array_equal(run.tables["modes"]["frequency"], [1.5, np.nan], equal_nan=True)
    assert run.tables["modes"]["name"].tolist() == ["first", "second"]
    assert len(run.tables["empty"]["t"]) == 0
    assert run.units == UNITS
    schema = pq.read_schema(saved / "tables" / "modes.parquet")
    assert schema.field("frequency").metadata == {b"unit": b"Hz"}


def test_the_replay_is_there_and_nothing_else(saved):
    assert load_run(saved).replay.is_file()
    assert sorted(p.name for p in saved.parent.iterdir()) == ["flap"]
    assert sorted(p.name for p in saved.iterdir()) == ["manifest.json", "replay.rrd", "states.npz", "tables"]


def test_states_need_no_pickle(saved):
    with np.load(saved / "states.npz", allow_pickle=False) as data:
        assert all(data[n].dtype != object for n in data.files)


def test_an_earlier_run_is_replaced_and_notes_in_it_are_kept(copy, trajectory):
    (copy / "notes.md").write_text("mine")
    save_run(copy, trajectory, scene="again", replay=False)
    assert load_run(copy).manifest["scene"] == "again"
    assert load_run(copy).tables == {}
    assert (copy / "notes.md").read_text() == "mine"
    assert [p.name for p in copy.parent.iterdir()] == ["run"]


def test_files_of_others_among_the_tables_are_kept_and_are_no_tables(copy, trajectory):
    (copy / "tables" / "mine").mkdir()
    for name in ("mine.csv", "mine.parquet", "mine/notes.md"):
        (copy / "tables" / name).write_text("mine")
    save_run(copy, trajectory, scene="again", tables={"modes": {"a": [1]}}, replay=False)
    assert load_run(copy).tables.keys() == {"modes"}
    left = sorted(p.name for p in (copy / "tables").rglob("*"))
    assert left == ["mine", "mine.csv", "mine.parquet", "modes.parquet", "notes.md"]
    edit(copy, tables=...)  # a run from before the manifest listed them
    (copy / "tables" / "mine.parquet").unlink()
    assert load_run(copy).tables.keys() == {"modes"}


@pytest.mark.parametrize("text", ['{"name": "webext"}', '{"format": 1}', "[]", "{"])
def test_a_folder_with_a_manifest_of_others_is_left_alone(trajectory, tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(InputError, match="not a run"):
        results.check_writable(tmp_path)
    with pytest.raises(InputError, match="not a run"):
        save_run(tmp_path, trajectory, scene="x", replay=False)
    assert (tmp_path / "manifest.json").read_text() == text


@pytest.mark.parametrize("where", ["write_replay", "_exchange"])
def test_an_earlier_run_survives_a_save_that_fails(copy, trajectory, monkeypatch, where):
    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(results, where, fail)
    with pytest.raises(InputError, match=r"run: cannot be written \(No space left"):
        save_run(copy, trajectory, scene="again")
    assert load_run(copy).manifest["scene"] == "flap"
    assert [p.name for p in copy.parent.iterdir()] == ["run"]


def test_an_earlier_run_survives_a_second_rename_that_fails(copy, trajectory, monkeypatch):
    real = os.replace

    def replace(a, b):
        if str(a).endswith(".tmp"):
            raise OSError(5, "Input/output error")
        real(a, b)

    monkeypatch.setattr(results.os, "replace", replace)
    with pytest.raises(InputError):
        save_run(copy, trajectory, scene="again", replay=False)
    assert load_run(copy).manifest["scene"] == "flap"


def test_an_earlier_run_survives_a_kill_between_the_renames(copy):
    copy.rename(copy.with_name(".run.previous"))
    assert is_run(copy)
    assert load_run(copy).manifest["scene"] == "flap"


def test_is_run_is_false_for_what_is_incomplete(copy, tmp_path):
    assert is_run(copy)
    assert not is_run(tmp_path / "absent")
    assert not is_run(tmp_path)
    data = (copy / "states.npz").read_bytes()
    (copy / "states.npz").write_bytes(data[: len(data) // 2])
    assert not is_run(copy)


def test_targets_that_are_not_runs_are_left_alone(trajectory, tmp_path):
    file, folder = tmp_path / "file", tmp_path / "photos"
    file.write_text("x")
    folder.mkdir()
    (folder / "a.jpg").write_text("x")
    for path, words in ((file, "is a file"), (folder, "not a run"), (file / "run", "cannot be written")):
        with pytest.raises(InputError, match=words) as e:
            save_run(path, trajectory, scene="x", replay=False)
        assert str(path) in str(e.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "photos"]
    assert [p.name for p in folder.iterdir()] == ["a.jpg"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(trajectory, tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot be written"):
            save_run(tmp_path / "run", trajectory, scene="x", replay=False)
    finally:
        tmp_path.chmod(0o700)


def test_folders_that_are_not_runs(tmp_path):
    file = tmp_path / "file"
    file.write_text("x")
    for path, words in ((file, "is a file"), (tmp_path / "absent", "no such run"), (tmp_path, "no manifest")):
        with pytest.raises(InputError, match=words) as e:
            load_run(path)
        assert str(path) in str(e.value)


def edit(run: Path, **changes):
    manifest = json.loads((run / "manifest.json").read_text()) | changes
    (run / "manifest.json").write_text(json.dumps({k: v for k, v in manifest.items() if v is not ...}))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"format": 99}, "format"),
        ({"format": "1"}, "format"),
        ({"names": ...}, "names"),
        ({"dt": "small"}, "dt"),
        ({"model_hash": "0" * 16}, "model_hash"),
        ({"parameters_hash": "0" * 16}, "parameters_hash"),
    ],
)
def test_damaged_manifest_fields_are_named(copy, changes, field):
    if ... in changes.values():
        manifest = json.loads((copy / "manifest.json").read_text())
        manifest.pop(field)
        (copy / "manifest.json").write_text(json.dumps(manifest))
    else:
        edit(copy, **changes)
    with pytest.raises(InputError) as e:
        load_run(copy)
    assert e.value.field == field
    assert str(copy) in str(e.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "\x00\xff"])
def test_a_manifest_that_is_not_json(copy, text):
    (copy / "manifest.json").write_text(text)
    with pytest.raises(InputError, match=r"manifest\.json"):
        load_run(copy)


def test_an_effect_of_another_version(copy):
    edit(copy, effects=["bars", "crease", "antigravity"])
    with pytest.raises(InputError, match=r"states\.npz.*antigravity"):
        load_run(copy)


@pytest.mark.parametrize("change", ["short", "flip", "empty", "text", "missing"])
def test_damaged_states_are_named(copy, trajectory, change):
    file = copy / "states.npz"
    data = bytearray(file.read_bytes())
    if change == "missing":
        file.unlink()
    else:
        data[data.find(trajectory.x.tobytes()) + 1000] ^= 0xFF
        file.write_bytes({"short": data[: len(data) // 2], "flip": data, "empty": b"", "text": b"hello"}[change])
    with pytest.raises(InputError, match=r"states\.npz"):
        load_run(copy)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("x", None),
        ("model.bars", None),
        ("energies.kinetic", np.zeros((2, 2))),
        ("v", np.zeros((6, 4, 2))),
        ("drive.field_z.values", np.zeros(2)),
        ("parameters.crease.nonsense", np.zeros((1, 1))),
    ],
)
def test_states_that_do_not_fit_are_named(copy, name, value):
    with np.load(copy / "states.npz") as data:
        arrays = {n: data[n] for n in data.files if n != name}
    np.savez(copy / "states.npz", **arrays, **({name: value} if value is not None else {}))
    with pytest.raises(InputError, match=r"states\.npz"):
        load_run(copy)


def test_pickled_states_are_refused(copy):
    with np.load(copy / "states.npz") as data:
        arrays = {n: data[n] for n in data.files}
    np.savez(copy / "states.npz", **{**arrays, "x": np.array([{"a": 1}], dtype=object)})
    with pytest.raises(InputError) as e:
        load_run(copy)
    assert e.value.field == "x"


def test_a_damaged_table_is_named(copy):
    (copy / "tables" / "modes.parquet").write_bytes(b"PAR1 nonsense PAR1")
    with pytest.raises(InputError, match=r"modes\.parquet"):
        load_run(copy)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"tables": {"t": {"a": [1, 2], "b": [1]}}}, "t"),
        ({"tables": {"t": {"a": np.zeros((2, 2))}}}, "a"),
        ({"tables": {"../t": {"a": [1]}}}, "tables"),
        ({"settings": {"overrides": 3}}, "overrides"),
        ({"settings": {"f": object()}}, "settings"),
    ],
)
def test_what_cannot_be_kept_is_named(trajectory, tmp_path, options, field):
    with pytest.raises(InputError) as e:
        save_run(tmp_path / "run", trajectory, scene="x", replay=False, **options)
    assert e.value.field == field
    assert not (tmp_path / "run").exists()


def test_format_table():
    text = format_table(TABLES["modes"], UNITS)
    assert text.splitlines() == [
        "frequency  count  name",
        "     [Hz]",
        "---------  -----  ------",
        "      1.5      1  first",
        "      nan      2  second",
    ]
    assert format_table({"a": [1.23456789]}, digits=3).splitlines() == ["   a", "----", "1.23"]
