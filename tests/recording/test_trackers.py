"""Exports of tracking programs: the same motion in every format reads as the same recording."""

import re
import sys

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.recording import read_recording
from origami_sim.recording.trackers import detect

FRAMES, RATE = 60, 120.0


def motion(k: int, frames: int = FRAMES) -> np.ndarray:
    """Point k of a turning object (frames, 3) [m]."""
    t = np.arange(frames) / RATE
    return np.column_stack([0.1 * np.cos(3 * t + k), 0.05 * np.sin(3 * t + k), 0.02 * k + 0.01 * t])


def marker(track: str, kind: str = "marker", extra: str = "") -> str:
    return f'[channels.tip]\ntrack = "{track}"\nkind = "{kind}"\nnode = 4\n{extra}'


CAMERA = "[cameras.side]\norigin = [0.0, 0.0, 0.1]\npixel = [100, 400]\nscale = 0.001\nheight = 480\n"


@pytest.fixture
def read(tmp_path):
    """Write an export and its sidecar, and read them."""

    def write_and_read(text: str, sidecar: str, name: str = "run.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        (tmp_path / name).with_suffix(".toml").write_text(sidecar, encoding="utf-8")
        return read_recording(tmp_path / name)

    return write_and_read


def pixels(k: int) -> np.ndarray:
    """Readings (n, 2) of point k by the camera above: x to the right and z up, rows down."""
    p = motion(k)
    return np.column_stack([100 + p[:, 0] / 0.001, 400 - (p[:, 2] - 0.1) / 0.001])


def deeplabcut(animals: bool = False, score=lambda i, k: 0.95) -> str:
    points = [pixels(0), pixels(1)]
    names = ["corner", "tip"]
    rows = ["scorer," + ",".join(["net"] * 6)]
    if animals:
        rows.append("individuals," + ",".join(["left"] * 3 + ["right"] * 3))
        names = ["tip", "tip"]
    rows.append("bodyparts," + ",".join(n for n in names for _ in range(3)))
    rows.append("coords," + ",".join(["x", "y", "likelihood"] * 2))
    for i in range(FRAMES):
        cells = [f"{p[i, 0]!r},{p[i, 1]!r},{score(i, k)}" for k, p in enumerate(points)]
        rows.append(f"{i}," + ",".join(cells))
    return "\n".join(rows).replace("np.float64(", "").replace(")", "") + "\n"


@pytest.mark.parametrize("animals", [False, True])
def test_deeplabcut_in_a_camera_plane(read, animals):
    sidecar = f"[time]\nrate_hz = {RATE}\n" + CAMERA
    recording = read(deeplabcut(animals), sidecar + marker("right/tip" if animals else "tip", "marker_2d"))
    assert recording.metadata["format"] == "deeplabcut"
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / RATE)
    expected = motion(1)[:, [0, 2]] - [0.0, 0.1]
    tip = recording.channels["tip"]
    np.testing.assert_allclose(tip.values, expected, atol=1e-12)
    assert tip.unit == "m" and tip.camera is not None
    np.testing.assert_allclose(tip.camera.project(motion(1)), expected, atol=1e-12)


def test_a_low_likelihood_is_a_missing_value(read):
    text = deeplabcut(score=lambda i, k: 0.2 if i in (10, 11, 30) and k == 1 else 0.9)
    sidecar = f"allow_gaps = true\n[source]\nlikelihood = 0.6\n[time]\nrate_hz = {RATE}\n" + CAMERA
    recording = read(text, sidecar + marker("tip", "marker_2d"))
    lost = np.flatnonzero(np.isnan(recording.channels["tip"].values).any(axis=1))
    np.testing.assert_array_equal(lost, [10, 11, 30])
    assert "misses 3 values in 2 runs between others" in " ".join(recording.metadata["notes"])
    with pytest.raises(InputError, match=r"misses 3 values in 2 runs .*the longest of 2.*allow_gaps"):
        read(text, sidecar.replace("allow_gaps = true\n", "") + marker("tip", "marker_2d"))


def test_sleap_fills_frames_in_which_nothing_was_found(read):
    rows = ["track,frame_idx,instance.score,tip.x,tip.y,tip.score"]
    for i in range(FRAMES):
        for k in (0, 1):
            if (i, k) != (20, 1):
                rows.append(f"track_{k},{i + 5},0.9,{pixels(k)[i, 0]:.12g},{pixels(k)[i, 1]:.12g},0.8")
    sidecar = f"allow_gaps = true\n[time]\nrate_hz = {RATE}\n" + CAMERA + marker("track_1/tip", "marker_2d")
    recording = read("\n".join(rows) + "\n", sidecar)
    np.testing.assert_allclose(recording.times, (np.arange(FRAMES) + 5) / RATE)
    values = recording.channels["tip"].values
    assert np.flatnonzero(np.isnan(values[:, 0])).tolist() == [20]
    seen = np.arange(FRAMES) != 20
    np.testing.assert_allclose(values[seen], (motion(1)[:, [0, 2]] - [0.0, 0.1])[seen], atol=1e-9)
    with pytest.raises(InputError, match="the track 'track_1' stands twice in one frame"):
        read("\n".join([*rows, rows[-1]]) + "\n", sidecar)


MOTIVE = (
    "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global\n\n"
    ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker\n"
    ",Name,lid,lid,lid,lid,lid,lid,lid,lid:1,lid:1,lid:1\n"
    ",ID,a,a,a,a,a,a,a,b,b,b\n"
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,{axes}\n"
)


def motive(order: str = "xyz", lost: tuple[int, ...] = ()) -> str:
    """Y up: the file's (x, y, z) is the model's (x, z, -y), in mm."""
    rows = [MOTIVE.format(axes=",".join(order.upper())).rstrip("\n")]
    for i in range(FRAMES):
        x, y, z = motion(1)[i] * 1000
        file = dict(zip("xyz", (x, z, -y), strict=True))
        cells = [""] * 3 if i in lost else [f"{file[axis]:.9f}" for axis in order]
        lid = [f"{v:.9f}" for v in (file["x"], file["y"] + 5, file["z"])]
        rows.append(",".join([str(i), f"{i / RATE:.6f}", "0", "0", "0", "1", *lid, *cells]))
    return "\r\n".join("\n".join(rows).split("\n")) + "\r\n"


@pytest.mark.parametrize("order", ["xyz", "zyx"])
def test_motive_reads_units_and_the_order_of_the_axes(read, order):
    axes = '[source]\naxes = ["x", "-z", "y"]\n'
    recording = read(motive(order), axes + marker("lid:1"))
    assert recording.metadata["format"] == "motive" and recording.metadata["time_base"] == "clock"
    np.testing.assert_allclose(recording.channels["tip"].values, motion(1), atol=1e-9)
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / RATE, atol=1e-6)
    body = read(motive(order), axes + marker("lid"))
    np.testing.assert_allclose(body.channels["tip"].values, motion(1) + np.array([0.0, 0.0, 0.005]), atol=1e-9)
    moved = read(motive(order), axes.replace("[source]", "[source]\norigin = [0.0, 0.02, 0.0]") + marker("lid:1"))
    np.testing.assert_allclose(moved.channels["tip"].values, motion(1) - [0.0, 0.0, 0.02], atol=1e-9)


def test_motive_gaps_and_faults(read):
    recording = read(motive(lost=(7, 8)), "allow_gaps = true\n" + marker("lid:1"))
    assert np.flatnonzero(np.isnan(recording.channels["tip"].values[:, 0])).tolist() == [7, 8]
    with pytest.raises(InputError, match=r"unknown unit \(field 'Length Units', value 'Feet'\)"):
        read(motive().replace("Millimeters", "Feet"), marker("lid:1"))
    with pytest.raises(InputError, match=r"the file states another unit of length .*value 'm'.*allowed: mm"):
        read(motive(), marker("lid:1", extra='unit = "m"\n'))
    with pytest.raises(InputError, match=r"column 'flap\.x' is missing .*lid:1\.x"):
        read(motive(), marker("flap"))
    with pytest.raises(InputError, match="must keep a right hand a right hand"):
        read(motive(), '[source]\naxes = ["x", "z", "y"]\n' + marker("lid:1"))
    with pytest.raises(InputError, match=r"run.csv: line 12 holds no number .*value 'oops'"):
        read(motive().replace("\r\n4,", "\r\noops,"), marker("lid:1"))


def test_a_marker_under_two_types_is_told_apart(read):
    doubled = motive().replace(",Type,Rigid Body" + ",Rigid Body" * 6, ",Type" + ",Rigid Body Marker" * 7)
    doubled = doubled.replace(",Name" + ",lid" * 7, ",Name" + ",lid:1" * 7)
    recording = read(doubled, '[source]\naxes = ["x", "-z", "y"]\n' + marker("Marker/lid:1"))
    np.testing.assert_allclose(recording.channels["tip"].values, motion(1), atol=1e-9)


def plane_rows(mark: str, decimal: str = ".", points: tuple[int, ...] = (1,)) -> list[str]:
    out = []
    for i in range(FRAMES):
        cells = [f"{i / RATE:.9E}"] + [f"{v:.9E}" for k in points for v in motion(k)[i, [0, 2]]]
        out.append(mark.join(cells).replace(".", decimal))
    return out


@pytest.mark.parametrize(("mark", "decimal"), [("\t", "."), ("\t", ","), (",", "."), (";", ","), ("  ", ".")])
def test_tracker_text(read, mark, decimal):
    text = "\n".join(["mass_A", mark.join(["t", "x", "y"]), *plane_rows(mark, decimal)]) + "\n"
    recording = read(
        text,
        CAMERA.replace("scale = 0.001\nheight = 480\n", "").replace("[100, 400]", "[0, 0]").replace("0.1]", "0.0]")
        + marker("mass_A", "marker_2d", 'unit = "m"\n'),
        "run.txt",
    )
    assert recording.metadata["format"] == "tracker"
    np.testing.assert_allclose(recording.channels["tip"].values, motion(1)[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(recording.times, np.arange(FRAMES) / RATE, atol=1e-9)


def test_tracker_with_several_tracks(read):
    head = ["#multi:", "\tmass A\t\tmass B\t\t", "t\tx\ty\tx\ty\t"]
    text = "\n".join([*head, *(row + "\t" for row in plane_rows("\t", points=(0, 1)))]) + "\n"
    for name, k in (("mass A", 0), ("mass B", 1)):
        recording = read(text, "[cameras.side]\n" + marker(name, "marker_2d", 'unit = "m"\n'), "run.txt")
        np.testing.assert_allclose(recording.channels["tip"].values, motion(k)[:, [0, 2]], atol=1e-9)
    with pytest.raises(InputError, match=r"unknown unit of length .*allowed: m, cm"):
        read(text, "[cameras.side]\n" + marker("mass A", "marker_2d"), "run.txt")
    with pytest.raises(InputError, match=r"run.txt: line 8 holds no number \(field 'x', value 'lost'\)"):
        lines = text.split("\n")
        lines[7] = re.sub(r"\t[^\t]*", "\tlost", lines[7], count=1)
        read("\n".join(lines), "[cameras.side]\n" + marker("mass A", "marker_2d", 'unit = "m"\n'), "run.txt")


def test_pixels_need_a_camera_with_a_scale(read):
    rate = f"[time]\nrate_hz = {RATE}\n"
    with pytest.raises(InputError, match="channel 'tip' is in pixels: only a marker_2d of a camera with a scale"):
        read(deeplabcut(), rate + marker("tip", "marker_2d"))
    with pytest.raises(InputError, match=r"unknown camera \(field 'channels.tip.camera', value 'top'\); allowed: side"):
        read(deeplabcut(), rate + CAMERA + marker("tip", "marker_2d", 'camera = "top"\n'))
    with pytest.raises(InputError, match="right and up must be perpendicular"):
        read(deeplabcut(), rate + CAMERA + "up = [1.0, 0.0, 0.0]\n" + marker("tip", "marker_2d"))


def test_a_header_that_is_not_the_stated_format(read):
    with pytest.raises(InputError, match="the header is not that of Motive"):
        read(deeplabcut(), '[source]\nformat = "motive"\n' + marker("tip"))
    with pytest.raises(InputError, match="the header is not that of DeepLabCut"):
        read(motive(), '[source]\nformat = "deeplabcut"\n' + marker("tip"))
    with pytest.raises(InputError, match=r"unknown format .*value 'vicon'.*allowed: table, motive, deeplabcut, sleap"):
        read(motive(), '[source]\nformat = "vicon"\n' + marker("tip"))
    with pytest.raises(InputError, match="has no scores"):
        read(motive(), "[source]\nlikelihood = 0.5\n" + marker("lid"))


def test_c3d_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    (tmp_path / "run.c3d").write_bytes(b"\x02\x50" + bytes(510))
    (tmp_path / "run.toml").write_text(marker("tip"))
    with pytest.raises(InputError, match=r"need the package ezc3d, which is not installed.*origami-sim\[c3d\]"):
        read_recording(tmp_path / "run.c3d")


def test_c3d_units_labels_and_missing_points(tmp_path):
    ezc3d = pytest.importorskip("ezc3d", reason="the package ezc3d is not installed: pip install 'origami-sim[c3d]'")
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["corner", "tip"]
    points = np.ones((4, 2, FRAMES))
    for k in (0, 1):
        points[:3, k] = 1000 * motion(k).T
    content["data"]["points"] = points
    residuals = np.zeros((1, 2, FRAMES))
    residuals[0, 1, 12] = -1
    content["data"]["meta_points"]["residuals"] = residuals
    content.write(str(tmp_path / "run.c3d"))
    (tmp_path / "run.toml").write_text("allow_gaps = true\n" + marker("tip"))
    recording = read_recording(tmp_path / "run.c3d")
    values = recording.channels["tip"].values
    assert np.flatnonzero(np.isnan(values[:, 0])).tolist() == [12]
    seen = np.arange(FRAMES) != 12
    np.testing.assert_allclose(values[seen], motion(1)[seen], atol=1e-7)  # the file holds single precision
    np.testing.assert_allclose(np.diff(recording.times), 1 / RATE, rtol=1e-6)
    (tmp_path / "run.c3d").write_bytes(b"\x02\x51" + bytes(600))
    with pytest.raises(InputError, match="is no C3D file"):
        read_recording(tmp_path / "run.c3d")


def test_plain_tables_stay_plain(tmp_path):
    for text in ("t,x\n0,1\n1,2\n", "time\n0\n1\n", "a b\n", "", "t\n1\n2\n"):
        assert detect(tmp_path / "run.csv", text.encode()) == "table", text


def test_five_thousand_frames_of_twelve_markers_load(tmp_path):
    names = [f"m{k}" for k in range(12)]
    rng = np.random.default_rng(0)
    points = np.stack([motion(k, 5000) for k in range(12)], axis=1) + rng.normal(scale=1e-5, size=(5000, 12, 3))
    head = "t," + ",".join(f"{n}_{a}" for n in names for a in "xyz")
    body = np.column_stack([np.arange(5000) / RATE, points.reshape(5000, -1)])
    np.savetxt(tmp_path / "run.csv", body, fmt="%.7f", delimiter=",", header=head, comments="")
    channels = "".join(
        f'[channels.{n}]\ncolumns = ["{n}_x", "{n}_y", "{n}_z"]\nkind = "marker"\nunit = "m"\nnode = {k}\n'
        for k, n in enumerate(names)
    )
    (tmp_path / "run.toml").write_text('[time]\ncolumn = "t"\n' + channels)
    recording = read_recording(tmp_path / "run.csv")
    assert recording.frame_count == 5000 and len(recording.channels) == 12
    for k, channel in enumerate(recording.channels.values()):
        np.testing.assert_allclose(channel.values, points[:, k], atol=1e-7)
        assert channel.noise == pytest.approx(1e-5, rel=0.1)


def test_a_cell_of_a_megabyte_is_no_header(tmp_path):
    from origami_sim.recording.trackers._text import head

    assert head(b"a,b\n" + b"z" * 200_000 + b"\nc\n", 3) == [["a", "b"], [], ["c"]]
