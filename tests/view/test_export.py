"""Exports hold the frames of the run: glTF, OBJ and FOLD read back, pictures that move, and one sentence if not."""

import builtins
import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.pattern import hinge_angles, read_fold, triangulate
from origami_sim.results.run_folder import save_run
from origami_sim.solve.motion.dynamics import Failure
from origami_sim.view.export import between, export, until_failure
from origami_sim.view.film import Film
from origami_sim.view.interactive import figure, scripts
from origami_sim.view.palette import COLOURS
from origami_sim.view.picture import Artist, nearest_frame
from tests.view.test_replay import AMPLITUDES, FRAMES, TRIANGLES, swing


@pytest.fixture(scope="module")
def motion():
    return swing()


def opened(path) -> tuple[dict, bytes]:
    """JSON and binary part of a GLB."""
    data = path.read_bytes()
    assert data[:4] == b"glTF" and int.from_bytes(data[8:12], "little") == len(data)
    size = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + size]), data[20 + size + 8 :]


def array(document: dict, binary: bytes, accessor: int) -> np.ndarray:
    a = document["accessors"][accessor]
    view = document["bufferViews"][a["bufferView"]]
    wide = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[a["type"]]
    kind = np.float32 if a["componentType"] == 5126 else np.uint8
    return np.frombuffer(binary, kind, a["count"] * wide, view["byteOffset"]).reshape(a["count"], wide)


def test_gltf_keyframes_are_the_frames(motion, tmp_path):
    document, binary = opened(export(motion, tmp_path / "a.glb", world=1))
    primitive = document["meshes"][0]["primitives"][0]
    base = array(document, binary, primitive["attributes"]["POSITION"])
    (animation,) = document["animations"]
    times = array(document, binary, animation["samplers"][0]["input"])[:, 0]
    weights = array(document, binary, animation["samplers"][0]["output"]).reshape(len(times), -1)
    targets = np.array([array(document, binary, t["POSITION"]) for t in primitive["targets"]])
    assert times == pytest.approx(motion.times, abs=1e-6)
    for f in (0, 4, FRAMES - 1):
        shown = base + np.einsum("t,tvi->vi", weights[f], targets)
        assert shown == pytest.approx(motion.x[f, :, 1][np.array(TRIANGLES).ravel()], abs=1e-7)
    assert {c["target"]["node"] for c in animation["channels"]} == {0, 1}
    assert trimesh.load(tmp_path / "a.glb").geometry


def test_obj_and_fold_of_a_frame(motion, tmp_path):
    at = float(motion.times[3])
    mesh = trimesh.load(export(motion, tmp_path / "a.obj", at=at), process=False)
    assert np.asarray(mesh.vertices) == pytest.approx(motion.x[3, :, 0], abs=1e-9)
    printed = trimesh.load(export(motion, tmp_path / "a.stl", at=at))
    assert len(printed.faces) == len(TRIANGLES) and printed.area == pytest.approx(mesh.area)
    pattern = read_fold(export(motion, tmp_path / "a.fold", at=at, title="swing"), scale=1.0)
    assert pattern.vertices == pytest.approx(motion.x[3, :, 0], abs=1e-12)
    (valley,) = pattern.edges_assigned("V")
    assert pattern.fold_angles[valley] == pytest.approx(motion.creases[3, 0, 0])
    split = triangulate(pattern)
    angle = hinge_angles(pattern.vertices, split.creases)[list(split.crease_edge).index(valley)]
    assert angle == pytest.approx(motion.creases[3, 0, 0], abs=1e-9)
    assert len(pattern.edges_assigned("F")) == 2 and len(pattern.edges_assigned("B")) == 6


def test_one_frame_is_the_most_folded_by_default(motion):
    film = Film(motion)
    assert nearest_frame(film, None) == np.abs(motion.creases[:, 0, 0]).argmax()
    assert nearest_frame(film, float(motion.times[5]) + 0.004) == 5


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_moving_pictures_move(motion, tmp_path, suffix):
    file = export(motion, tmp_path / f"a{suffix}", width=160, height=100)
    with Image.open(file) as film:
        assert film.size == (160, 100) and film.n_frames > 5  # pyright: ignore[reportAttributeAccessIssue]
        first = np.asarray(film.convert("RGB"), float)
        film.seek(3)
        assert np.abs(np.asarray(film.convert("RGB"), float) - first).max() > 60


def test_mp4_needs_a_library_and_says_so(motion, tmp_path, monkeypatch):
    real = builtins.__import__
    monkeypatch.setattr(
        builtins, "__import__", lambda n, *a, **k: (_ for _ in ()).throw(ImportError) if n == "av" else real(n, *a, **k)
    )
    with pytest.raises(InputError, match=r"PyAV.*pip install av"):
        export(motion, tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


def test_mp4_with_the_library(motion, tmp_path):
    av = pytest.importorskip("av")
    with av.open(str(export(motion, tmp_path / "a.mp4", width=161, height=100))) as film:
        (stream,) = film.streams.video
        assert (stream.width, stream.height) == (160, 100)
        assert sum(1 for _ in film.decode(stream)) == FRAMES


def test_part_of_a_motion(motion):
    cut = between(motion, float(motion.times[2]), float(motion.times[6]))
    assert len(cut.times) == len(cut.x) == len(cut.energies["crease"]) == 5
    with pytest.raises(InputError, match="no frame of the run"):
        between(motion, 5.0, 6.0)


def failed(motion, at: float):
    """The same motion as a run that failed at a time: what follows repeats the last sound frame."""
    x, last = motion.x.copy(), int(np.searchsorted(motion.times, at, side="right")) - 1
    x[last + 1 :] = x[last]
    return replace(motion, x=x, failures=[Failure(1, at, 4, "no equilibrium is found")]), last


@pytest.mark.parametrize("between_frames", [0.0, 0.004])
def test_a_film_ends_where_its_world_failed(motion, tmp_path, between_frames):
    run, last = failed(motion, float(motion.times[5]) + between_frames)
    assert last == 5
    document, binary = opened(export(run, tmp_path / "a.glb", world=1))
    times = array(document, binary, document["animations"][0]["samplers"][0]["input"])[:, 0]
    assert times == pytest.approx(run.times[:6], abs=1e-6)
    sound, binary = opened(export(run, tmp_path / "b.glb", world=0))
    times = array(sound, binary, sound["animations"][0]["samplers"][0]["input"])[:, 0]
    assert len(times) == FRAMES
    with pytest.raises(InputError, match=r"outside of the run.*0 to 0\.0833333 s"):
        export(run, tmp_path / "a.obj", at=float(run.times[8]), world=1)
    artist = Artist(Film(until_failure(run, 1), world=1))
    assert "the run failed here" in artist._said(5) and "the run failed here" not in artist._said(4)
    before = between(until_failure(run, 1), None, float(run.times[3]))
    assert not before.failures and "the run failed here" not in Artist(Film(before, world=1))._said(3)


def test_a_run_that_fails_at_once_shows_its_first_frame(motion):
    assert len(until_failure(failed(motion, 0.0)[0], 1).times) == 1


def test_the_command_says_where_a_film_ends(motion, call, tmp_path):
    run, _ = failed(motion, float(motion.times[5]))
    save_run(tmp_path / "run", run, scene="swing")
    code, out, _ = call("export", "run", "--to", "a.stl", "--world", "1")
    assert code == 0 and "note: the run failed: world 1 went unstable at t = 0.0833333 s" in out
    code, out, _ = call("export", "run", "--to", "a.glb", "--world", "1")
    assert code == 0 and "note: it ends where the run failed: world 1 went unstable at t = 0.0833333 s" in out
    code, out, _ = call("export", "run", "--to", "a.stl", "--world", "0", "--json")
    assert code == 0 and json.loads(out)["failures"] == []
    code, _, err = call("export", "run", "--to", "a.xyz")
    assert code == 2 and "no such format (field '--to', value 'a.xyz')" in err


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("a.xyz", {}, r"no such format.*\.glb"),
        ("a", {}, "no such format"),
        ("none/a.glb", {}, "no such folder"),
        ("a.glb", {"at": 0.1}, "time of one frame"),
        ("a.fold", {"at": 9.0}, r"outside of the run.*0 to"),
        ("a.fold", {"at": float("nan")}, "outside of the run"),
        ("a.obj", {"colour": "strain"}, "option of pictures"),
        ("a.png", {"width": 5}, "no such size"),
        ("a.webp", {"seconds": -1.0}, "no such length"),
        ("a.webp", {"colour": "heat"}, "no such colouring.*strain"),
        ("a.glb", {"world": 2}, "no such world"),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_said_and_nothing_is_left(motion, tmp_path, name, options, said):
    with pytest.raises(InputError, match=said):
        export(motion, tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def share(picture: np.ndarray, kind: str, distance: float = 12.0) -> float:
    """Of the pixels, those with the hue of a colour at a brightness that shading gives."""
    base = np.array(COLOURS[kind], float)
    scale = (picture @ base) / (base @ base)
    away = np.linalg.norm(picture - scale[..., None] * base, axis=-1)
    return float(np.mean((away < distance) & (scale > 0.5) & (scale < 1.05)))


def test_a_picture_shows_panels_magnets_and_the_crease_as_what_it_is(motion):
    shown = np.asarray(Artist(Film(motion), labels=False).frame(3), float)
    for kind in ("passive", "magnet", "field"):
        assert share(shown, kind) > 0.002, kind
    unlit = swing()
    unlit.drive = Drive()  # the field's arrow is as blue as a valley, that of the poling as red as a mountain
    unlit.parameters.set("magnetic_torque", "remanence", 0.0)
    artist = Artist(Film(unlit), labels=False)
    valley, mountain = (np.asarray(artist.frame(f), float) for f in (3, 9))
    for kind, shown, other in (("valley", valley, mountain), ("mountain", mountain, valley)):
        assert share(shown, kind) > 1e-4 > share(other, kind), kind


def test_strain_is_that_of_the_triangles():
    t = swing()
    t.x[5] = t.model.position[:, None] * [1.02, 1.0, 1.0]
    assert Film(t).strains()[5] == pytest.approx(0.5 * (1.02**2 - 1), rel=1e-9)
    t.x[5] = t.model.position[:, None] * [1.0, 0.97, 1.0]
    assert Film(t).strains()[5] == pytest.approx(0.5 * (0.97**2 - 1), rel=1e-9)
    assert Film(t).strains()[3] == pytest.approx(0, abs=1e-12)  # folding does not strain
    assert np.asarray(Artist(Film(t), colour="strain", labels=False).frame(5)).std() > 5


def test_a_view_for_a_page_holds_its_data_and_nothing_from_elsewhere(motion):
    page = figure(Film(motion, title="</script><b>")) + scripts()
    assert "http" not in page.replace("http://www.w3.org", "") and "</script><b>" not in page
    data = json.loads(page.split("application/json'>")[1].split("</script>")[0])
    assert len(data["times"]) == FRAMES and data["nodes"] == 6
    import base64

    x = np.frombuffer(base64.b64decode(data["x"]), "<u2").reshape(FRAMES, 6, 3) * data["step"] + data["low"]
    assert x == pytest.approx(motion.x[:, :, 0], abs=data["step"])


def test_what_models_and_runs_say_of_themselves(motion):
    assert repr(motion) == f"<Trajectory: {FRAMES} frames, 0 to 0.2 s, 2 worlds, dt = 0.0001 s, 1 crease>"
    assert "2 elastic panels, 1 crease, 6 nodes, 2 contacts" in repr(motion.model)
    assert "image/webp" in motion._repr_html_() and "image/png" in motion.model._repr_html_()
    assert AMPLITUDES.size == 2


def test_plots_have_axes_that_can_be_read(motion):
    drawn = motion.plot(world=1)
    drawn.canvas.draw()
    for axes in drawn.axes:
        low, high = axes.get_ylim()
        assert sum(low <= t <= high for t in axes.get_yticks()) >= 3
    labels = [a.get_ylabel() for a in drawn.axes]
    assert labels == ["fold angle [deg]", "node 4 [mm]", "field [mT]"]
    angle = drawn.axes[0].lines[0].get_ydata()
    assert np.asarray(angle) == pytest.approx(np.degrees(motion.creases[:, 0, 1]))
    texts = {t.get_text() for t in motion.model.plot().axes[0].texts}
    assert {"0", "1", "2", "3", "4", "5"} <= texts
