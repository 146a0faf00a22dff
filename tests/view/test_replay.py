"""The replay file holds the numbers of the trajectory, opens with its views, and can be photographed."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from origami_sim.drive import Drive, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.recording import Channel, Recording
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.timestep import TimeStep
from origami_sim.view.film import Film
from origami_sim.view.palette import COLOURS
from origami_sim.view.replay import axis_numbers, write_replay
from origami_sim.view.viewer import TIMELINE, open_replay, read_series, screenshot

FRAMES, WORLDS, SIDE = 13, 2, 0.02
FIELD, FREQUENCY = 0.06, 2.0
TRIANGLES = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
AMPLITUDES = np.radians([80.0, 40.0])  # of the fold, in the two worlds


def bifold(contacts: bool = True) -> Model:
    """Two square panels joined by a crease along y; the flap carries a magnet and two contact points."""
    x = SIDE * np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [-1, 1, 0], [1, 0, 0], [1, 1, 0]], float)
    free = np.ones((6, 3))
    free[:4] = 0
    triangles = np.array(TRIANGLES, np.int32)
    bars = sorted({tuple(sorted((t[i], t[(i + 1) % 3]))) for t in TRIANGLES for i in range(3)})
    k = 2 if contacts else 0
    return Model(
        position=x,
        free=free,
        bars=np.array(bars, np.int32),
        creases=np.array([[5, 1, 2, 0]], np.int32),
        bends=np.array([[1, 0, 2, 3], [4, 1, 5, 2]], np.int32),
        triangles=triangles,
        triangle_panel=np.array([0, 0, 1, 1], np.int32),
        contacts=triangles[[2, 2]][:k],
        contact_weights=np.array([[0.0, 1, 0], [0, 0, 1]])[:k],
        contact_offsets=np.full(k, -2e-4),
        contact_axes=np.tile([-50.0, 50, 0], (k, 1)),
        electrodes=np.zeros(3, np.int32),
        effects=("bars", "crease", "gravity", "magnetic_torque", *(("ground",) if contacts else ())),
        names={"panel": ("base", "flap"), "crease": ("hinge",)},
    )


def swing(contacts: bool = True) -> Trajectory:
    """A prescribed rotation of the flap about the crease, with made-up energies and forces: no solver needed."""
    model = bifold(contacts)
    p = Parameters(model)
    for t, (a, b) in ((2, (1.0, 0.0)), (3, (0.0, 1.0))):
        edges = model.position[model.triangles[t, 1:]] - model.position[model.triangles[t, 0]]
        a, b = np.linalg.lstsq(edges.T, np.array([1.0, 0, 0]), rcond=None)[0]
        p.set("magnetic_torque", "poling_1", a, [t]).set("magnetic_torque", "poling_2", b, [t])
        p.set("magnetic_torque", "remanence", 0.13, [t]).set("magnetic_torque", "volume", 3e-7, [t])
    p.set("plane", "height", -0.005)
    times = np.arange(FRAMES) / 60.0
    angle = AMPLITUDES * np.sin(2 * np.pi * times[:, None] / times[-1])  # [F, W]
    x = np.broadcast_to(model.position[None, :, None], (FRAMES, 6, WORLDS, 3)).copy()
    for node, y in ((4, 0.0), (5, SIDE)):
        x[:, node] = np.stack([SIDE * np.cos(angle), np.full_like(angle, y), SIDE * np.sin(angle)], axis=-1)
    forces = np.zeros_like(x)
    if contacts:
        forces[:, 4:, :, 2] = 2e-3 * np.maximum(-np.sin(angle), 0)[:, None]
    angles = np.zeros((FRAMES, 3, WORLDS))
    angles[:, 0] = angle
    energy = 1e-4 * angle**2
    state = State.at_rest(model, WORLDS)
    return Trajectory(
        model=model,
        parameters=p,
        drive=Drive(field=(0, 0, sine(FIELD, FREQUENCY))),
        times=times,
        x=x,
        v=np.zeros_like(x),
        angles=angles,
        energies={"kinetic": 0.1 * energy, "crease": energy, "gravity": -energy},
        work={n: 2 * energy if n == "magnetic_torque" else 0 * energy for n in model.effects},
        gaps=np.where(np.sin(angle)[:, None] < 0, -1e-6, 1e-3).repeat(len(model.contacts), axis=1),
        contact_forces=forces,
        failures=[],
        dt=1e-4,
        step=TimeStep(2e-4, 1e-4, 5, "bar 8 (bars)"),
        state=state,
    )


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    return swing()


@pytest.fixture(scope="module")
def file(trajectory, tmp_path_factory) -> Path:
    return write_replay(tmp_path_factory.mktemp("replay") / "swing.rrd", trajectory, world=1, title="swing")


def columns(file: Path, entity: str, component: str) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times [s] and values per frame of a component, from the file."""
    times, values = [], []
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and component in batch.schema.names:
            if TIMELINE in batch.schema.names:
                times += (batch[TIMELINE].cast("int64").to_numpy() * 1e-9).tolist()
            values += [np.array(row.as_py()) for row in batch[component]]
    return np.array(times), values


def series_name(file: Path, entity: str) -> str:
    return str(columns(file, entity, "SeriesLines:names")[1][0][0])


def run_rerun(*arguments: str) -> subprocess.CompletedProcess:
    command = [str(Path(sys.executable).with_name("rerun")), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_vertices_are_the_trajectory(file, trajectory):
    times, frames = columns(file, "/sheet/faces", "Mesh3D:vertex_positions")
    assert times == pytest.approx(trajectory.times, abs=1e-9)
    for f in (0, 3, FRAMES - 1):
        expected = trajectory.x[f, :, 1][np.array(TRIANGLES).ravel()]
        assert frames[f] == pytest.approx(expected, abs=1e-8)
    _, (indices,) = columns(file, "/sheet/faces", "Mesh3D:triangle_indices")
    assert indices.tolist() == np.arange(12).reshape(4, 3).tolist()


def test_nothing_static_hides_what_moves(file):
    """In rerun a static value wins over every later one: what moves must not be static as well."""
    for chunk in RrdReader(file).stream():
        names = chunk.to_record_batch().schema.names
        if chunk.is_static and chunk.entity_path == "/sheet/faces":
            assert not {"Mesh3D:vertex_positions", "Mesh3D:vertex_colors"} & set(names)


def test_series_have_lengths_values_and_units(file, trajectory):
    found = {path.lstrip("/"): (times, values) for path, times, values in read_series(file)}
    assert found["angles/0000_hinge"][1] == pytest.approx(np.degrees(trajectory.creases[:, 0, 1]))
    assert series_name(file, "/angles/0000_hinge") == "hinge (deg)"
    assert found["drive/field_z"][1] == pytest.approx(1e3 * FIELD * np.sin(2 * np.pi * FREQUENCY * trajectory.times))
    assert series_name(file, "/drive/field_z") == "field z (mT)"
    tip = 1e3 * (trajectory.x[:, 4, 1] - trajectory.x[0, 4, 1])
    assert found["tip/z"][1] == pytest.approx(tip[:, 2])
    assert series_name(file, "/tip/z") == "tip z (mm)"
    # 0.1 mJ at most: shown in microjoules
    assert found["energy/crease"][1] == pytest.approx(1e6 * trajectory.energies["crease"][:, 1])
    assert series_name(file, "/energy/crease") == "crease (µJ)"
    assert found["work/magnetic_torque"][1] == pytest.approx(1e6 * trajectory.work["magnetic_torque"][:, 1])
    assert "work/crease" not in found and "drive/field_x" not in found
    for times, values in found.values():
        assert len(times) == len(values) == FRAMES
        assert times == pytest.approx(trajectory.times, abs=1e-9)


def test_millijoules_when_they_suit(tmp_path):
    t = swing()
    t.energies = {n: 100 * v for n, v in t.energies.items()}
    file = write_replay(tmp_path / "a.rrd", t)
    assert series_name(file, "/energy/crease") == "crease (mJ)"


def test_magnet_arrows_turn_with_the_panel(file, trajectory):
    _, vectors = columns(file, "/magnets", "Arrows3D:vectors")
    angle = trajectory.creases[:, 0, 1]
    for f in (0, 3, 9):
        assert len(vectors[f]) == 2  # one panel, an arrow on each face
        for v in vectors[f]:
            assert v / np.linalg.norm(v) == pytest.approx([np.cos(angle[f]), 0, np.sin(angle[f])], abs=1e-5)


def test_negative_remanence_turns_the_arrow(tmp_path):
    t = swing(contacts=False)
    t.parameters.set("magnetic_torque", "remanence", [[0.0], [0.0], [-0.13], [-0.13]])
    _, vectors = columns(write_replay(tmp_path / "a.rrd", t), "/magnets", "Arrows3D:vectors")
    assert vectors[0][0][0] < 0


def test_field_arrow_follows_the_field(file, trajectory):
    _, vectors = columns(file, "/field", "Arrows3D:vectors")
    lengths = np.array([v[0][2] for v in vectors])
    field = np.sin(2 * np.pi * FREQUENCY * trajectory.times)
    assert lengths == pytest.approx(lengths[np.argmax(field)] * field / field.max(), rel=1e-4, abs=1e-7)
    _, labels = columns(file, "/field/value", "Points3D:labels")
    assert labels[0][0] == "B = 0 mT"


def test_colours_tell_magnets_from_arms(trajectory, tmp_path):
    file = write_replay(tmp_path / "a.rrd", trajectory, arms=[0])
    _, frames = columns(file, "/sheet/faces", "Mesh3D:vertex_colors")
    rgb = np.stack([(frames[0] >> shift) & 255 for shift in (24, 16, 8)], axis=-1) / 255
    for rows, kind in ((slice(0, 6), "arm"), (slice(6, 12), "magnet")):
        base = np.array(COLOURS[kind]) / 255
        ratio = rgb[rows] / base
        assert np.ptp(ratio) < 0.02 and 0.5 < ratio.mean() <= 1  # the colour, only darker


def test_contact_forces_return_to_their_points(trajectory):
    """Forces that were put on the nodes by a point off the mid-plane are found again, friction included."""
    t = swing()
    f, k, m = 9, 0, t.model
    force = np.array([3e-3, -1e-3, 5e-3])
    corners = t.x[f, m.contacts[k], 0]
    step, given = 1e-7, np.zeros((6, 3))

    def point(c):
        n = np.cross(c[1] - c[0], c[2] - c[0])
        return m.contact_weights[k] @ c + m.contact_offsets[k] * n / np.linalg.norm(n)

    for corner in range(3):  # virtual work by central differences
        for axis in range(3):
            d = np.zeros((3, 3))
            d[corner, axis] = step
            given[m.contacts[k, corner], axis] = force @ (point(corners + d) - point(corners - d)) / (2 * step)
    t.contact_forces[f, :, 0] = given
    t.gaps[f, :, 0] = (-1e-6, 1e-3)
    points, found = Film(t, 0, None, (), None, "x").contact_arrows()
    assert found[f, 0] == pytest.approx(force, rel=1e-6)
    assert not found[f, 1].any()
    assert points[f, 0] == pytest.approx(point(corners))


def test_recording_is_shown_with_gaps(trajectory, tmp_path):
    times = np.linspace(0, 0.2, 7)
    markers = np.full((7, 3), 0.01)
    markers[3] = np.nan
    angle = np.full(7, 0.5)
    recording = Recording(
        "r",
        times,
        {
            "m1": Channel("m1", "marker", markers, "m", 1e-4),
            "hinge": Channel("hinge", "crease_angle", angle, "rad", 1e-3),
        },
    )
    file = write_replay(tmp_path / "a.rrd", trajectory, recording=recording)
    when, positions = columns(file, "/markers/m1", "Points3D:positions")
    assert when == pytest.approx(times, abs=1e-9)
    assert [len(p) for p in positions] == [1, 1, 1, 0, 1, 1, 1]
    assert dict((p, v) for p, _, v in read_series(file))["/measured/hinge"] == pytest.approx(np.degrees(angle))


def test_blueprint_has_a_camera_and_the_plots(file):
    reader = RrdReader(file)
    (blueprint,) = reader.blueprints()
    text = "\n".join(c.format(width=400) for c in reader.stream(store=blueprint))
    for expected in (
        "EyeControls3D:position",
        "swing (m)",
        "Crease angles (deg)",
        "Energies and work (µJ)",
        "Displacement (mm)",
        "Field (mT)",
        TIMELINE,
    ):
        assert expected in text, expected


def test_the_same_run_has_the_same_identity(file, trajectory, tmp_path):
    def identity(path):
        (entry,) = RrdReader(path).recordings()
        return entry.application_id, entry.recording_id

    again = write_replay(tmp_path / "a.rrd", trajectory, world=1, title="swing")
    other = write_replay(tmp_path / "b.rrd", trajectory, world=0, title="swing")
    assert identity(again) == identity(file) != identity(other)


def test_the_file_passes_rerun_verify(file):
    done = run_rerun("rrd", "verify", str(file))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("contacts", [True, False])
def test_a_world_that_failed_is_still_written(contacts, tmp_path):
    t = swing(contacts)
    t.x[5:, :, 0] = np.nan
    file = write_replay(tmp_path / "a.rrd", t)
    _, frames = columns(file, "/sheet/faces", "Mesh3D:vertex_positions")
    assert np.all(np.isfinite(np.array(frames)))
    assert frames[-1] == pytest.approx(frames[4])


def test_a_plot_of_what_does_not_change_warns_of_nothing(trajectory, tmp_path, capfd):
    still = replace(trajectory, x=np.repeat(trajectory.x[:1], len(trajectory.x), axis=0), drive=Drive(),
                    angles=np.repeat(trajectory.angles[:1], len(trajectory.angles), axis=0))  # fmt: skip
    write_replay(tmp_path / "still.rrd", still)
    said = capfd.readouterr()
    assert not said.out and not said.err


def test_bad_requests_name_the_field(trajectory, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("x")
    for field, options in (
        ("world", {"world": 2}),
        ("magnets", {"magnets": [2]}),
        ("arms", {"arms": [-1]}),
        ("tip", {"tip": 6}),
    ):
        with pytest.raises(InputError) as e:
            write_replay(tmp_path / "a.rrd", trajectory, **options)
        assert e.value.field == field
    for path in (blocked / "a.rrd", tmp_path):
        with pytest.raises(InputError, match=str(path)):
            write_replay(path, trajectory)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]  # nothing half-written is left


def test_bad_files_are_named(file, tmp_path):
    text = tmp_path / "text.rrd"
    text.write_text("not a replay")
    for path in (tmp_path / "absent.rrd", tmp_path, text):
        for call in (lambda p=path: screenshot(p, tmp_path / "a.png"), lambda p=path: open_replay(p)):
            with pytest.raises(InputError, match=str(path)):
                call()
    with pytest.raises(InputError, match="missing"):
        screenshot(file, tmp_path / "missing" / "a.png")
    with pytest.raises(InputError, match="320 x 200"):
        screenshot(file, tmp_path / "a.png", width=0)


@pytest.mark.parametrize("time", [-1.0, 99.0, float("nan")])
def test_times_outside_of_the_recording_are_refused(file, tmp_path, time):
    with pytest.raises(InputError, match=r"swing\.rrd: is outside of the recording.*allowed: 0 to [\d.]+ s"):
        screenshot(file, tmp_path / "a.png", time=time)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a display is always there")
def test_without_a_display_a_picture_is_suggested(file, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=r"no display.*--screenshot"):
        open_replay(file)


def test_screenshot_without_a_renderer_says_so(file, tmp_path, monkeypatch):
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, "/nonexistent")
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    said = []
    assert not screenshot(file, tmp_path / "a.png", note=said.append)
    assert not (tmp_path / "a.png").exists()
    assert "mesa-vulkan-drivers" in said[0]


def test_screenshot_shows_the_sheet(file, tmp_path):
    said = []
    if not screenshot(file, tmp_path / "a.png", width=800, height=500, note=said.append):
        pytest.skip(said[0])
    picture = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"), float)
    assert picture.shape == (500, 800, 3)
    view = picture[80:460, 20:420]  # the inside of the 3D view

    def share(kind):
        """Of the pixels, those with the hue of a colour at a brightness that shading gives."""
        base = np.array(COLOURS[kind], float)
        scale = (view @ base) / (base @ base)
        distance = np.linalg.norm(view - scale[..., None] * base, axis=-1)
        return float(np.mean((distance < 10) & (scale > 0.5) & (scale < 1.05)))

    assert view.std() > 10  # not blank
    assert share("passive") > 0.01
    assert share("magnet") > 0.01


@pytest.mark.parametrize(
    "ends, numbers", [((-25.0, 100.0), 1), ((-31.25, 106.25), 2), ((-2.0, 8.0), 9), ((0.0, 5.0), 4)]
)
def test_numbers_at_an_axis_are_counted_as_the_viewer_writes_them(ends, numbers):
    assert axis_numbers(*ends) == numbers
