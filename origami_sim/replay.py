"""Replays for the rerun viewer. Every rerun call of the project is in this file, because its interface still moves.

What a replay holds, on the timeline `sim_time` [s]; geometry is in metres, z up:

    sheet/faces            the panels, shaded flat: passive, magnetised, arms
    sheet/outlines         edges of the panels
    sheet/creases          fold lines, in the colours of the angle plot
    magnets                poling direction of each magnetised panel
    field                  flux density; the arrow's length follows it
    contacts               contact forces
    ground, scale          the ground plane (if there are contacts) and a scale bar
    markers/...            markers of a recording
    before/..., after/..., channels/...   of a diagnosis: simulations over the recorded outlines; components
    angles/..., energy/..., work/..., tip/..., centre/..., drive/..., measured/...   scalar series, unit in the name
"""

import hashlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from PIL import Image
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient
from scipy.sparse import coo_array
from scipy.sparse.linalg import lsqr

from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.recording import Recording
from origami_sim.solve.dynamics import Trajectory

TIMELINE = "sim_time"

COLOURS = {
    "passive": (158, 190, 219),  # clear elastomer
    "magnet": (104, 100, 114),  # dark, like iron-filled elastomer
    "arm": (226, 180, 104),
    "ground": (226, 226, 221),
    "grid": (200, 200, 194),
    "outline": (60, 66, 74),
    "crease": (60, 66, 74),
    "poling": (206, 44, 44),
    "field": (24, 98, 214),
    "contact": (16, 140, 84),
    "marker": (236, 84, 164),
    "scale": (60, 66, 74),
    "label": (255, 255, 255),  # on the viewer's grey
}
"""Colours (red, green, blue; 0 to 255) of what is drawn."""

SERIES = (
    (57, 135, 229),
    (233, 121, 42),
    (46, 160, 96),
    (199, 70, 110),
    (142, 105, 214),
    (176, 138, 28),
    (30, 160, 172),
    (140, 140, 140),
)
"""Colours of series, readable on dark and on light."""

PLOTTED = len(SERIES)
"""Series that a plot shows at once; all others are in the file and can be added in the viewer."""

_BACKGROUND = (250, 250, 248)
_LIGHT = np.array([0.35, -0.5, 0.79])
_BLOCK = 1_000_000  # numbers per chunk


class HasTrajectory(Protocol):
    """What a run read from disk offers."""

    @property
    def trajectory(self) -> Trajectory: ...


def write_replay(
    path: str | Path,
    source: Trajectory | HasTrajectory,
    *,
    world: int = 0,
    magnets: Iterable[int] | None = None,
    arms: Iterable[int] = (),
    tip: int | None = None,
    recording: Recording | None = None,
    title: str = "origami_sim",
) -> Path:
    """Writes one world of a run as a replay that opens with a fixed camera and its plots.

    The file's identity depends only on what it shows (title, model, parameters, world), so a replay written again
    takes the earlier one's place in a viewer. It is written beside `path` and then moved there.

    Args:
        path: the .rrd file. source: a trajectory, or a run that has one. world: which of its worlds.
        magnets: panels to colour as magnets (default: triangles that carry remanence).
        arms: panels to colour as arms. tip: node whose displacement is plotted (default: the one that moves most).
        recording: measured channels to be shown with the simulation.
        title: of the recording in the viewer.

    Raises:
        InputError: no such world, panel or node; a file that cannot be written.
    """
    trajectory = source if isinstance(source, Trajectory) else source.trajectory
    scene = _Scene(trajectory, world, magnets, arms, tip, title)
    with _writing(path, scene.application, scene.identity) as stream:
        stream.send_blueprint(_blueprint(scene, _write(scene, stream, recording)))
    return Path(path).expanduser().absolute()


@contextmanager
def _writing(path: str | Path, application: str, identity: str) -> Iterator[rr.RecordingStream]:
    """A stream into a file that appears complete or not at all."""
    file = Path(path).expanduser().absolute()
    if file.is_dir():
        raise InputError("is a folder; a replay is a file", file=file, allowed="a file name ending in .rrd")
    work = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        work.touch()  # rerun reports a file that cannot be made only as a log line
        with rr.RecordingStream(application, recording_id=identity, send_properties=False) as stream:
            stream.save(work)
            yield stream
            stream.flush()
            stream.disconnect()
        os.replace(work, file)
    except OSError as e:
        raise InputError(f"cannot be written ({e.strerror or e})", file=file, allowed="a writable folder") from None
    finally:
        work.unlink(missing_ok=True) if work.parent.is_dir() else None


def open_replay(path: str | Path) -> subprocess.Popen:
    """Opens a replay in the viewer, in a process of its own that outlives this one.

    Raises:
        InputError: no such file, no display to show it on, or the viewer is not installed.
    """
    file = _existing(path)
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("there is no display to open the viewer on", file=file, allowed="--screenshot PNG, a picture")
    return subprocess.Popen([_viewer(), str(file), "--bind", "127.0.0.1"], start_new_session=True)


def screenshot(
    path_rrd: str | Path,
    path_png: str | Path,
    *,
    time: float | None = None,
    width: int = 1280,
    height: int = 800,
    timeout: float = 60.0,
    note: Callable[[str], object] | None = None,
) -> bool:
    """Takes a picture of a replay as the viewer shows it, without a window.

    A viewer without a window is started, sent to the time and asked for pictures until two in a row are the same,
    because it loads and lays out over several frames.

    Drawing needs a graphics driver that offers Vulkan; without a graphics card that is Mesa's lavapipe (Debian and
    Ubuntu: `apt install mesa-vulkan-drivers`). Pictures are not the same to the bit on different drivers.

    Args:
        path_rrd: a file of `write_replay`. path_png: the picture.
        time: simulated time to be shown [s] (default: where the creases are furthest from where they began).
        width, height: of the picture [px]. timeout: for the viewer to come up, and again to settle [s].
        note: called with a sentence if there is no picture (default: it goes to standard error).

    Returns:
        Whether there is a picture.

    Raises:
        InputError: no such replay, not a replay, a time outside of it, a picture that cannot be written, a size below
            320 x 200.
    """
    source, target = _existing(path_rrd), Path(path_png).expanduser().absolute()
    if width < 320 or height < 200:
        raise InputError("too small a picture", field="width, height", value=(width, height), allowed=">= 320 x 200")
    if not target.parent.is_dir() or target.is_dir():
        raise InputError("cannot be written", file=target, allowed="a file in an existing folder")
    if time is None:
        time = _most_folded(source)
    elif (span := _span(source)) and not span[0] <= time <= 1.00001 * span[1]:  # as rounded below
        allowed = f"{span[0]:g} to {span[1]:g} s"
        raise InputError("is outside of the recording", file=source, field="time", value=time, allowed=allowed)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.png"
        why = _photograph(source, picture, time, width, height, timeout)
        if why:
            sentence = f"no screenshot: {why}"
            note(sentence) if note else print(sentence, file=sys.stderr)
            return False
        try:
            with Image.open(picture) as image:  # the viewer draws two pixels per point
                image.convert("RGB").resize((width, height), Image.Resampling.BOX).save(target, format="PNG")
        except OSError as e:
            raise InputError(f"cannot be written ({e.strerror or e})", file=target) from None
    return True


# the viewer -----------------------------------------------------------------------------------------------------------


def _viewer() -> str:
    """The `rerun` command of this environment, else the one on the path."""
    beside = Path(sys.executable).with_name("rerun")
    found = str(beside) if beside.is_file() else shutil.which("rerun")
    if not found:
        raise InputError("the viewer is not installed", field="rerun", allowed="pip install rerun-sdk")
    return found


def _existing(path: str | Path) -> Path:
    file = Path(path).expanduser().absolute()
    if not file.is_file():
        raise InputError(
            "is a folder, not a replay" if file.is_dir() else "there is no such replay",
            file=file,
            allowed="an .rrd file",
        )
    try:
        with open(file, "rb") as f:
            start = f.read(3)
    except OSError as e:
        raise InputError(f"cannot be read ({e.strerror})", file=file) from None
    if start != b"RRF":
        raise InputError("is not a replay", file=file, allowed="an .rrd file")
    return file


def _photograph(source: Path, picture: Path, time: float, width: int, height: int, timeout: float) -> str:
    """Writes the picture; returns why not."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    command = [
        _viewer(),
        str(source),
        "--headless",
        "--port",
        str(port),
        "--bind",
        "127.0.0.1",
        "--window-size",
        f"{width}x{height}",
        "--hide-welcome-screen",
    ]
    log = picture.with_suffix(".log")
    # the viewer shows its log as notices on top of the picture
    environment = {**os.environ, "RUST_LOG": "error", "NO_COLOR": "1"}
    with open(log, "w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, env=environment, start_new_session=True)
    try:
        client = _connect(process, port, timeout)
        if client is None:
            said = log.read_text(errors="replace")
            if "render context" in said or "adapter" in said.lower():
                return (
                    "no graphics driver offers Vulkan; on Debian and Ubuntu `apt install mesa-vulkan-drivers` "
                    "draws without a graphics card"
                )
            what = f"did not come up within {timeout:g} s" if process.poll() is None else "ended by itself"
            first = next((line.strip()[:200] for line in said.splitlines() if line.strip()), "it said nothing")
            return f"the viewer {what} ({first})"
        return _settle(client, picture, time, timeout)
    finally:
        _end(process)


def _connect(process: subprocess.Popen, port: int, timeout: float) -> ViewerClient | None:
    """A client once the viewer has the recording open; None if the viewer ended or is too slow."""
    until = clock.monotonic() + timeout
    while clock.monotonic() < until and process.poll() is None:
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.set_time(TIMELINE, duration=0.0, play_state="paused")
            return client
        except Exception:  # whatever it is called in this version: not up, or nothing open yet
            clock.sleep(0.1)
    return None


def _settle(client: ViewerClient, picture: Path, time: float, timeout: float) -> str:
    until, last = clock.monotonic() + timeout, b""
    try:
        while clock.monotonic() < until:
            client.set_time(TIMELINE, duration=float(time), play_state="paused")
            clock.sleep(0.4)
            client.save_screenshot(str(picture))
            now = picture.read_bytes()
            if now == last:
                return ""
            last = now
    except Exception as e:
        return f"the viewer failed ({(str(e).splitlines() or [type(e).__name__])[0][:200]})"
    return "" if last else f"the viewer drew nothing within {timeout:g} s"


def _end(process: subprocess.Popen):
    """Ends the viewer that this module started; the `rerun` command runs it as a child of its own."""
    if process.poll() is None:
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGTERM)
        else:
            process.terminate()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(5.0)


def _most_folded(source: Path) -> float:
    """Time at which the sum of |angle - first angle| over the creases is largest [s]; the last time without creases."""
    try:
        times, total = np.zeros(1), 0.0
        for path, when, values in read_series(source):
            if path.startswith("/angles/"):
                total, times = total + np.abs(values - values[0]), when
            elif not np.any(total):
                times = when[-1:]
        return float(times[np.argmax(total)])
    except (ValueError, RuntimeError) as e:
        raise InputError(f"is damaged ({e})", file=source) from None


def _span(source: Path) -> tuple[float, float] | None:
    """First and last time of a replay [s]; None if nothing in it has a time."""
    try:
        batches = [chunk.to_record_batch() for chunk in RrdReader(source).stream()]
    except (ValueError, RuntimeError) as e:
        raise InputError(f"is damaged ({e})", file=source) from None
    times = [b[TIMELINE].cast("int64").to_numpy() * 1e-9 for b in batches if TIMELINE in b.schema.names]
    return (min(t.min() for t in times), max(t.max() for t in times)) if times else None


def read_series(path: str | Path) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Scalar series of a replay: entity path, times [F] [s], values [F] in the unit of the series' name.

    Raises:
        InputError: no such file, not a replay.
    """
    for chunk in RrdReader(_existing(path)).stream():
        batch = chunk.to_record_batch()
        if TIMELINE in batch.schema.names and "Scalars:scalars" in batch.schema.names:
            times = batch[TIMELINE].cast("int64").to_numpy() * 1e-9
            yield chunk.entity_path, times, batch["Scalars:scalars"].flatten().to_numpy()


# what is drawn --------------------------------------------------------------------------------------------------------


class _Scene:
    """The geometry and the numbers of one world, in the order in which they are drawn. Lengths [m], times [s]."""

    def __init__(
        self,
        trajectory: Trajectory,
        world: int,
        magnets: Iterable[int] | None,
        arms: Iterable[int],
        tip: int | None,
        title: str,
    ):
        worlds = trajectory.x.shape[2]
        if not 0 <= world < worlds:
            raise InputError("there is no such world", field="world", value=world, allowed=f"0 to {worlds - 1}")
        self.trajectory, self.model, self.world, self.title = trajectory, trajectory.model, world, title
        self.times = np.asarray(trajectory.times, float)
        self.x = np.asarray(trajectory.x[:, :, world], float)
        if not np.all(np.isfinite(self.x)):  # a world that failed: keep what was sound
            sound = np.isfinite(self.x).all(axis=(1, 2))
            if not sound.any():
                raise InputError("no frame of this world has finite positions", field="world", value=world)
            self.x = self.x[np.maximum.accumulate(np.where(sound, np.arange(len(self.x)), sound.argmax()))]
        if tip is not None and not 0 <= tip < self.x.shape[1]:
            raise InputError("there is no such node", field="tip", value=tip, allowed=f"0 to {self.x.shape[1] - 1}")
        self.moments = self._moments()
        self.kinds = self._kinds(magnets, arms)
        self.tip = tip if tip is not None else self._tip()
        digest = hashlib.sha256(repr((title, self.model.hash, trajectory.parameters.hash, world)).encode())
        self.identity = digest.hexdigest()[:32]
        self.application = f"origami_sim {title}" if title != "origami_sim" else title
        self._bounds()

    # sizes ----------------------------------------------------------------------------------------------------------

    def _bounds(self):
        low, high = self.x.min(axis=(0, 1)), self.x.max(axis=(0, 1))
        frame = np.ptp(self.x, axis=1).max(axis=0)
        self.size = float(max(frame.max(), 1e-9))  # of the device
        self.low, self.high = low, high
        self.step = _nice(0.25 * self.size)  # of the scale bar and the ground's grid
        self.across = 0 if high[0] - low[0] >= 0.8 * (high[1] - low[1]) else 1  # axis that lies across the view
        self.up, self.height = self.ground()

    def value(self, owner: str, name: str) -> np.ndarray:
        """Values [entity] of a parameter in this world."""
        p = self.trajectory.parameters[owner, name]
        return p[:, min(self.world, p.shape[1] - 1)]

    def ground(self) -> tuple[np.ndarray, float]:
        """Normal (3,) and height along it [m] of the ground."""
        tilt, azimuth, height = (float(self.value("plane", n)[0]) for n in ("tilt", "azimuth", "height"))
        s = np.sin(tilt)
        return np.array([-s * np.cos(azimuth), -s * np.sin(azimuth), np.cos(tilt)]), height

    # panels -----------------------------------------------------------------------------------------------------------

    def _moments(self) -> np.ndarray:
        """[F, T, 3] remanence times volume [T m^3] of each triangle, along its poling."""
        corners = self.x[:, self.model.triangles]
        out = np.zeros((*corners.shape[:2], 3))
        edge_1, edge_2 = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
        for name in self.model.effects:
            known = {p.name for p in get(name).parameters}
            if get(name).family != "triangle" or not {"remanence", "volume", "poling_1", "poling_2"} <= known:
                continue
            a, b = self.value(name, "poling_1"), self.value(name, "poling_2")
            c = self.value(name, "poling_n") if "poling_n" in known else np.zeros_like(a)
            d = a[:, None] * edge_1 + b[:, None] * edge_2
            if "poling_n" in known:  # rotation only: the in-plane part keeps its share
                d = _unit(d) * np.sqrt(np.maximum(1 - c**2, 0))[:, None]
            d = d + c[:, None] * _unit(np.cross(edge_1, edge_2))
            out += (self.value(name, "remanence") * self.value(name, "volume"))[:, None] * d
        return out

    def _kinds(self, magnets: Iterable[int] | None, arms: Iterable[int]) -> list[str]:
        """[T] kind of each triangle, a key of COLOURS."""
        panels = self.model.triangle_panel
        kinds = np.full(len(panels), "passive", dtype=object)
        last = int(panels.max(initial=-1))
        for name, given in (("arms", arms), ("magnets", magnets)):
            for p in given or ():
                if not 0 <= p <= last:
                    raise InputError("there is no such panel", field=name, value=p, allowed=f"0 to {last}")
                kinds[panels == p] = "arm" if name == "arms" else "magnet"
        if magnets is None:
            kinds[np.abs(self.moments[0]).sum(-1) > 0] = "magnet"
        return kinds.tolist()

    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners [F, 3T, 3] and shaded colours [F, 3T, 3] (0 to 255): every triangle has its own corners, and its
        brightness follows the angle between its normal and the light, the same on both sides."""
        corners = self.x[:, self.model.triangles]
        normal = _unit(np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]))
        brightness = 0.58 + 0.42 * np.abs(normal @ (_LIGHT / np.linalg.norm(_LIGHT)))
        base = np.array([COLOURS[k] for k in self.kinds], float).reshape(-1, 3)
        colours = np.repeat((base * brightness[:, :, None]).round().astype(np.uint8), 3, axis=1)
        return corners.reshape(len(self.x), -1, 3), colours

    def outlines(self) -> np.ndarray:
        """[E, 2] nodes of the panels' edges that are no creases."""
        return _outlines(self.model)

    def arrows(self) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Origins and vectors [F, 2P, 3] [m] of the poling on both faces of P magnetised panels, and names."""
        panels = self.model.triangle_panel
        magnetised = np.unique(panels[np.abs(self.moments[0]).sum(-1) > 0])
        corners = self.x[:, self.model.triangles]
        cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        area = 0.5 * np.linalg.norm(cross, axis=-1)
        origins, vectors, labels = [], [], []
        drawn: list[tuple[np.ndarray, np.ndarray]] = []
        for p in magnetised.tolist():
            t = panels == p
            weight = np.linalg.norm(self.moments[0, t], axis=-1)
            centre = np.einsum("t,fti->fi", weight / weight.sum(), corners[:, t].mean(axis=2))
            lift = 0.02 * self.size * _unit(cross[:, t].sum(axis=1))  # off the face, or the face would hide it
            length = max(0.55 * np.sqrt(area[0, t].sum()), 0.1 * self.size)
            direction = _unit(self.moments[:, t].sum(axis=1))
            if any(d @ direction[0] > 0.9 and np.linalg.norm(c - centre[0]) < 1.4 * length for c, d in drawn):
                continue  # a finely divided magnet: its neighbour's arrow tells
            drawn.append((centre[0], direction[0]))
            vector = length * direction
            for side in (1.0, -1.0):  # one arrow on each face, so that one shows from wherever one looks
                origins.append(centre + side * lift - 0.5 * vector)
                vectors.append(vector)
                labels.append(self.model.name("panel", p))
        empty = np.zeros((0, len(self.x), 3))
        return (
            np.moveaxis(np.array(origins).reshape(-1, *empty.shape[1:]), 0, 1),
            np.moveaxis(np.array(vectors).reshape(-1, *empty.shape[1:]), 0, 1),
            labels,
        )

    def _tip(self) -> int:
        """The node that moves furthest from where it began."""
        return int(np.linalg.norm(self.x - self.x[0], axis=-1).max(axis=0).argmax())

    # drive and contacts ---------------------------------------------------------------------------------------------

    def channel(self, name: str) -> np.ndarray:
        """[F] a drive channel in this world."""
        value = self.trajectory.drive[name](self.times[:, None])
        return np.broadcast_to(value, (len(self.times), max(value.shape[1], self.world + 1)))[:, self.world]

    def contact_arrows(self) -> tuple[np.ndarray, np.ndarray]:
        """Points [F, K, 3] [m] of the contacts and the forces there [F, K, 3] [N].

        The trajectory has forces by node; a force f on a point p = sum w_i x_i + o n of a triangle puts
        w_i f - o (g_i . f) n on its nodes (n the normal, g_i the gradients of the barycentric coordinates). This is
        solved for f, by least squares, over the points that are within reach of the ground.
        """
        m, forces = self.model, self.trajectory.contact_forces[:, :, self.world]
        corners = self.x[:, m.contacts]
        cross = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        normal, double_area = _unit(cross), np.linalg.norm(cross, axis=-1)[:, :, None, None]
        opposite = np.roll(corners, -2, axis=2) - np.roll(corners, -1, axis=2)
        gradients = np.cross(normal[:, :, None], opposite) / double_area
        points = np.einsum("kc,fkci->fki", m.contact_weights, corners) + m.contact_offsets[:, None] * normal
        lever = m.contact_offsets[:, None, None, None] * normal[:, :, None, :, None] * gradients[:, :, :, None, :]
        blocks = m.contact_weights[:, :, None, None] * np.eye(3) - lever  # [F, K, 3 corners, 3, 3]
        touching = self.trajectory.gaps[:, :, self.world] <= self.value("plane", "reach")[0]
        out = np.zeros_like(points)
        for f in np.flatnonzero(touching.any(axis=1) & np.any(forces != 0, axis=(1, 2))):
            active = np.flatnonzero(touching[f])
            full = (len(active), 3, 3, 3)
            rows = np.broadcast_to(3 * m.contacts[active, :, None, None] + np.arange(3)[:, None], full)
            columns = np.broadcast_to(3 * np.arange(len(active))[:, None, None, None] + np.arange(3), full)
            matrix = coo_array(
                (blocks[f, active].ravel(), (rows.ravel(), columns.ravel())),
                shape=(3 * len(m.position), 3 * len(active)),
            )
            used = np.unique(rows)
            if len(active) <= 60:
                solved = np.linalg.lstsq(matrix.tocsr()[used].toarray(), forces[f].ravel()[used], rcond=1e-10)[0]
            else:
                solved = lsqr(matrix.tocsr(), forces[f].ravel(), atol=1e-8, btol=1e-8)[0]
            out[f, active] = solved.reshape(-1, 3)
        return points, out


def _outlines(model: Model) -> np.ndarray:
    """[E, 2] nodes of the panels' edges that are no creases."""
    count: dict[tuple[int, int], dict[int, int]] = {}
    for panel, nodes in zip(model.triangle_panel.tolist(), model.triangles.tolist(), strict=True):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            edge = (min(nodes[a], nodes[b]), max(nodes[a], nodes[b]))
            sides = count.setdefault(edge, {})
            sides[panel] = sides.get(panel, 0) + 1
    creases = {(min(j, k), max(j, k)) for _, j, k, _ in model.creases.tolist()}
    edges = [e for e, sides in count.items() if 1 in sides.values() and e not in creases]
    return np.array(edges, int).reshape(-1, 2)


def _unit(v: np.ndarray) -> np.ndarray:
    """v / |v| along the last axis, zero where v is."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, length, out=np.zeros_like(v), where=length > 0)


def _nice(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(k for k in (1, 2, 5) if k * power <= value * (1 + 1e-9)))


_PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))


def _scaled(unit: str, largest: float, usual: str) -> tuple[str, float]:
    """Unit with prefix and factor: the usual prefix for 1 to 10,000 of it, else one that suits."""
    factors = dict(_PREFIXES)
    if largest == 0 or 1.0 <= largest * factors[usual] <= 1e4:
        return usual + unit, factors[usual]
    prefix, factor = next(((p, f) for p, f in _PREFIXES if largest * f >= 1.0), _PREFIXES[-1])
    return prefix + unit, factor


def _length_text(metres: float) -> str:
    unit, factor = _scaled("m", metres, "m")
    return f"{metres * factor:g} {unit}"


# the file -------------------------------------------------------------------------------------------------------------


@dataclass
class _Plot:
    """A time series view: its name and the series that it shows at first."""

    name: str
    paths: list[str] = field(default_factory=list)


@dataclass
class _Writer:
    """A stream with the plots that were made for it."""

    stream: rr.RecordingStream
    plots: list[_Plot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def moving(self, path: str, times: np.ndarray, archetype, static: dict | None = None, **values: np.ndarray):
        """Sends an entity of which `values` [F, n, ...] change with time and `static` do not."""
        if static:
            self.stream.log(path, archetype.from_fields(**static), static=True)
        count = next(iter(values.values())).shape[1]
        if not count:
            return
        rows = max(1, _BLOCK // max(v[0].size for v in values.values()))
        for i in range(0, len(times), rows):
            part = slice(i, i + rows)
            flat = {n: v[part].reshape(-1, *v.shape[2:]) for n, v in values.items()}
            for n in ("vertex_positions", "strips", "vectors", "origins"):
                if n in flat:
                    flat[n] = flat[n].astype(np.float32)
            lengths = np.full(len(times[part]), count)
            rr.send_columns(
                path,
                [rr.TimeColumn(TIMELINE, duration=times[part])],
                archetype.columns(**flat).partition(lengths),
                recording=self.stream,
            )

    def series(
        self,
        path: str,
        name: str,
        times: np.ndarray,
        values: np.ndarray,
        colour: Sequence[int],
        *,
        points: bool = False,
    ):
        """Sends a scalar series; `name` ends with its unit in brackets."""
        style = (
            rr.SeriesPoints(names=name, colors=[colour], marker_sizes=[2.0])
            if points
            else rr.SeriesLines(names=name, colors=[colour], widths=[1.5])
        )
        self.stream.log(path, style, static=True)
        rr.send_columns(
            path, [rr.TimeColumn(TIMELINE, duration=times)], rr.Scalars.columns(scalars=values), recording=self.stream
        )


def _write(scene: _Scene, stream: rr.RecordingStream, recording: Recording | None) -> _Writer:
    out = _Writer(stream)
    stream.send_recording_name(scene.title)
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    colours = _write_angles(scene, out)
    _write_sheet(scene, out, colours)
    _write_surroundings(scene, out)
    _write_motion(scene, out)
    _write_energies(scene, out)
    _write_drive(scene, out)
    if recording is not None:
        _write_recording(recording, scene, out)
    _write_notes(scene, out)
    return out


def _chosen(values: Sequence[np.ndarray], count: int = PLOTTED) -> list[int]:
    """The `count` series with the largest ranges, in their own order."""
    ranges = [float(np.ptp(v)) if len(v) else 0.0 for v in values]
    return sorted(sorted(range(len(values)), key=lambda i: -ranges[i])[:count])


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name) or "_"


def _write_angles(scene: _Scene, out: _Writer) -> list[tuple[int, int, int]]:
    """Crease angles; returns the colour of each crease."""
    angles = np.degrees(scene.trajectory.creases[:, :, scene.world])
    shown = _chosen(list(angles.T))
    colours = [COLOURS["crease"]] * angles.shape[1]
    plot = _Plot("Crease angles (deg)")
    names = scene.model.names.get("crease", ())
    for c in range(angles.shape[1]):
        name = scene.model.name("crease", c)
        path = f"/angles/{c:04d}_{_slug(name)}"
        if names.count(name) > 1:  # creases of one region
            name += f" {c}"
        colour = SERIES[shown.index(c)] if c in shown else SERIES[-1]
        out.series(path, f"{name} (deg)", scene.times, angles[:, c], colour)
        if c in shown:
            colours[c] = colour
            plot.paths.append(path)
    if plot.paths:
        out.plots.append(plot)
    if angles.shape[1] > len(shown):
        out.notes.append(f"The angle plot shows the {len(shown)} of {angles.shape[1]} creases that move most.")
    return colours


def _write_sheet(scene: _Scene, out: _Writer, crease_colours: list[tuple[int, int, int]]):
    corners, colours = scene.faces()
    count = corners.shape[1]
    # whatever is static would hide later values of the same field, so only what never changes is
    out.moving(
        "sheet/faces",
        scene.times,
        rr.Mesh3D,
        static={"triangle_indices": np.arange(count, dtype=np.uint32).reshape(-1, 3)},
        vertex_positions=corners,
        vertex_colors=colours,
    )
    edges = scene.outlines()
    thin, thick = rr.Radius.ui_points(0.8), rr.Radius.ui_points(2.0)
    out.moving(
        "sheet/outlines",
        scene.times,
        rr.LineStrips3D,
        static={"radii": [thin], "colors": [COLOURS["outline"]]},
        strips=scene.x[:, edges],
    )
    out.moving(
        "sheet/creases",
        scene.times,
        rr.LineStrips3D,
        static={"radii": [thick], "colors": crease_colours},
        strips=scene.x[:, scene.model.creases[:, 1:3]],
    )
    origins, vectors, labels = scene.arrows()
    if labels:
        out.moving(
            "magnets",
            scene.times,
            rr.Arrows3D,
            static={"radii": [0.008 * scene.size], "colors": [COLOURS["poling"]]},
            origins=origins,
            vectors=vectors,
        )
        out.notes.append("Red arrows: poling of the magnets (length means nothing).")


def _write_surroundings(scene: _Scene, out: _Writer):
    """Ground, scale bar, contact forces, field."""
    right, _, _, _ = _camera(scene)
    if len(scene.model.contacts):
        _write_ground(scene, out)
        points, forces = scene.contact_arrows()
        size = np.linalg.norm(forces, axis=-1)
        if np.any(size > 0):
            typical = float(np.percentile(size[size > 0], 90))
            scale = 0.35 * scene.size / typical
            unit, factor = _scaled("N", typical, "m")
            shown = size > 1e-3 * typical
            out.moving(
                "contacts",
                scene.times,
                rr.Arrows3D,
                static={"radii": [0.006 * scene.size], "colors": [COLOURS["contact"]]},
                origins=points,
                vectors=np.where(shown[:, :, None], scale * forces, 0.0),
            )
            out.notes.append(
                f"Green arrows: contact forces, {_length_text(scene.step)} of arrow for "
                f"{scene.step / scale * factor:.3g} {unit}."
            )
    corner = (scene.low + scene.high) / 2 - 0.5 * scene.step * right
    below = scene.height if len(scene.model.contacts) else scene.low[2] - 0.12 * scene.size
    near = np.array([0.0, -1.0, 0.0]) if scene.across == 0 else np.array([1.0, 0.0, 0.0])
    corner += near * (0.5 * abs((scene.high - scene.low) @ near) + 0.25 * scene.size)
    corner[2] = below + 0.002 * scene.size
    if len(scene.model.contacts):
        corner += scene.up * (scene.height + 0.002 * scene.size - corner @ scene.up)
    out.stream.log(
        "scale",
        rr.LineStrips3D(
            [np.stack([corner, corner + scene.step * right])],
            radii=rr.Radius.ui_points(2.5),
            colors=[COLOURS["scale"]],
        ),
        static=True,
    )
    out.stream.log(
        "scale/value",
        rr.Points3D(
            [corner + 0.5 * scene.step * right],
            radii=[0.0],
            colors=[COLOURS["label"]],
            labels=[_length_text(scene.step)],
            show_labels=True,
        ),
        static=True,
    )
    field = np.stack([scene.channel(f"field_{i}") for i in "xyz"], axis=1)
    size = np.linalg.norm(field, axis=1)
    if size.max() > 0:
        unit, factor = _scaled("T", float(size.max()), "m")
        origin = _field_origin(scene)
        vectors = (0.6 * scene.size / size.max() * field)[:, None, :]
        out.moving(
            "field",
            scene.times,
            rr.Arrows3D,
            static={"radii": [0.014 * scene.size], "colors": [COLOURS["field"]]},
            origins=np.broadcast_to(origin, vectors.shape),
            vectors=vectors,
        )
        out.moving(
            "field/value",
            scene.times,
            rr.Points3D,
            static={
                "positions": [origin],
                "radii": [0.015 * scene.size],
                "colors": [COLOURS["label"]],
                "show_labels": [True],
            },
            labels=np.array([[f"B = {factor * b:.0f} {unit}"] for b in size]),
        )
        out.notes.append(f"Blue arrow: flux density, longest for {factor * size.max():.3g} {unit}.")


def _field_origin(scene: _Scene) -> np.ndarray:
    right, _, _, _ = _camera(scene)
    centre = (scene.low + scene.high) / 2
    return centre - right * (0.5 * abs((scene.high - scene.low) @ right) + 0.35 * scene.size)


def _write_ground(scene: _Scene, out: _Writer):
    """A rectangle with grid lines on the ground plane, around where the device goes."""
    step, margin = scene.step, 0.8 * scene.size
    low, high = (np.floor((scene.low - margin) / step) * step)[:2], (np.ceil((scene.high + margin) / step) * step)[:2]

    def on_plane(points: np.ndarray, lift: float) -> np.ndarray:
        z = (scene.height + lift - points @ scene.up[:2]) / scene.up[2]
        return np.concatenate([points, z[..., None]], axis=-1).astype(np.float32)

    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    lift = 1e-3 * scene.size
    out.stream.log(
        "ground/plane",
        rr.Mesh3D(
            vertex_positions=on_plane(corners, -lift),
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            vertex_colors=[COLOURS["ground"]] * 4,
        ),
        static=True,
    )
    lines = [np.array([(v, low[1]), (v, high[1])]) for v in np.arange(low[0], high[0] + step / 2, step)]
    lines += [np.array([(low[0], v), (high[0], v)]) for v in np.arange(low[1], high[1] + step / 2, step)]
    out.stream.log(
        "ground/grid",
        rr.LineStrips3D(on_plane(np.array(lines), 0.0), radii=rr.Radius.ui_points(0.5), colors=[COLOURS["grid"]]),
        static=True,
    )


def _write_motion(scene: _Scene, out: _Writer):
    """Displacements of the tip and of the centre of mass."""
    centre = scene.trajectory.centre_of_mass()[:, scene.world]
    centre = np.where(np.isfinite(centre), centre, 0.0)
    held = not np.all(scene.model.free)  # then the tip says it all
    plot = _Plot("Displacement")
    out.notes.append(f"Tip: node {scene.tip}.")
    tip = scene.x[:, scene.tip] - scene.x[0, scene.tip]
    moved = {"tip": tip, "centre": centre - centre[0]}
    largest = max(float(np.abs(d).max()) for d in moved.values())
    unit, factor = _scaled("m", largest, "m")
    for (what, d), dim in zip(moved.items(), (1.0, 0.6), strict=True):
        for i, axis in enumerate("xyz"):
            colour = tuple(int(c * dim + 90 * (1 - dim)) for c in SERIES[i])
            name = f"{'tip' if what == 'tip' else 'centre of mass'} {axis} ({unit})"
            path = f"/{what}/{axis}"
            out.series(path, name, scene.times, factor * d[:, i], colour)
            if np.ptp(d[:, i]) > 0.02 * largest and (what == "tip" or not held):
                plot.paths.append(path)
    plot.name += f" ({unit})"
    if largest > 0:
        out.plots.append(plot)


def _write_energies(scene: _Scene, out: _Writer):
    """Energies of the effects that have any, and the work of those that exchange it."""
    t, w = scene.trajectory, scene.world
    found = [("energy", n, v[:, w]) for n, v in t.energies.items()]
    found += [("work", n, v[:, w]) for n, v in t.work.items() if n in t.model.effects and get(n).exchanges_work]
    found = [(kind, n, v) for kind, n, v in found if np.all(np.isfinite(v)) and np.any(v != 0)]
    if not found:
        return
    unit, factor = _scaled("J", max(float(np.abs(v).max()) for *_, v in found), "m")
    # an effect's work and its energy tell the same twice; the plot shows the one that the balance counts
    counted = [kind == "work" or n == "kinetic" or not get(n).exchanges_work for kind, n, _ in found]
    shown = _chosen([v if c else np.zeros(1) for (*_, v), c in zip(found, counted, strict=True)], 5)
    shown = [i for i in shown if counted[i]]
    plot = _Plot(f"Energies and work ({unit})")
    for i, (kind, name, values) in enumerate(found):
        path = f"/{kind}/{_slug(name)}"
        label = f"{'work: ' if kind == 'work' else ''}{name.replace('_', ' ')} ({unit})"
        colour = SERIES[shown.index(i)] if i in shown else SERIES[-1]
        out.series(path, label, scene.times, factor * values, colour)
        if i in shown:
            plot.paths.append(path)
    out.plots.append(plot)


_DRIVES = (
    ("field_", "Field", "T", "m"),
    ("gradient_", "Field gradient", "T/m", ""),
    ("voltage_", "Voltage", "V", ""),
    ("temperature", "Temperature rise", "K", ""),
    ("load", "Load factor", "-", ""),
)


def _write_drive(scene: _Scene, out: _Writer):
    """Every drive channel that is not zero throughout, a plot for each kind."""
    for prefix, title, unit, usual in _DRIVES:
        values = {n: scene.channel(n) for n in scene.trajectory.drive.signals if n.startswith(prefix)}
        values = {n: v for n, v in values.items() if np.any(v != 0)}
        if not values:
            continue
        largest = max(float(np.abs(v).max()) for v in values.values())
        unit, factor = (unit, 1.0) if unit == "-" else _scaled(unit, largest, usual)
        plot = _Plot(f"{title} ({unit})")
        for i, (name, v) in enumerate(values.items()):
            out.series(
                f"/drive/{name}", f"{name.replace('_', ' ')} ({unit})", scene.times, factor * v, SERIES[i % len(SERIES)]
            )
            plot.paths.append(f"/drive/{name}")
        plot.paths = plot.paths[:PLOTTED]
        out.plots.append(plot)


_MEASURED = {"angle": ("deg", 180.0 / np.pi), "length": ("mm", 1e3), "force": ("mN", 1e3)}


def _write_recording(recording: Recording, scene: _Scene, out: _Writer):
    """Markers as points in space, all other channels as measured series."""
    for channel in recording.channels.values():
        values = np.asarray(channel.values, float).reshape(len(recording.times), -1)
        if channel.kind == "marker":
            seen = np.isfinite(values).all(axis=1)
            path = f"markers/{_slug(channel.name)}"
            out.stream.log(
                path,
                rr.Points3D.from_fields(
                    colors=[COLOURS["marker"]], radii=[0.015 * scene.size], labels=[channel.name], show_labels=False
                ),
                static=True,
            )
            rr.send_columns(
                path,
                [rr.TimeColumn(TIMELINE, duration=recording.times)],
                rr.Points3D.columns(positions=values[seen].astype(np.float32)).partition(seen.astype(int)),
                recording=out.stream,
            )
            continue
        kind = "angle" if channel.is_angle else "force" if channel.kind == "force" else "length"
        unit, factor = _MEASURED[kind]
        plot = next((p for p in out.plots if channel.kind == "crease_angle" and p.name.startswith("Crease")), None)
        plot = plot or next((p for p in out.plots if p.name == f"Measured {kind}s ({unit})"), None)
        if plot is None:
            plot = _Plot(f"Measured {kind}s ({unit})")
            out.plots.append(plot)
        for i, column in enumerate(values.T):
            suffix = "" if values.shape[1] == 1 else f" {'xyz'[i]}"
            path = f"/measured/{_slug(channel.name + suffix)}"
            seen = np.isfinite(column)
            out.series(
                path,
                f"measured {channel.name}{suffix} ({unit})",
                recording.times[seen],
                factor * column[seen],
                COLOURS["marker"] if values.shape[1] == 1 else SERIES[i],
                points=True,
            )
            plot.paths.append(path)


def _write_notes(scene: _Scene, out: _Writer):
    t = scene.trajectory
    kinds = {"passive": "light blue: passive sheet", "magnet": "dark: magnetised", "arm": "sand: arms"}
    used = [text for kind, text in kinds.items() if kind in scene.kinds]
    lines = [
        f"# {scene.title}",
        "",
        f"World {scene.world} of {t.x.shape[2]}; {len(t.times)} frames, {t.times[0]:g} s to {t.times[-1]:g} s; "
        f"{t.step if t.dt == t.step.dt else f'dt = {t.dt:.3g} s'}.",
        "",
        "Coordinates in metres, z up; time in seconds.",
        "",
        f"- Panels: {', '.join(used)}.",
        *(f"- {n}" for n in out.notes),
        *(["- Thick lines: creases, in the colours of the angle plot."] if len(t.model.creases) else []),
        *(f"- **{f}**" for f in t.failures if f.world == scene.world),
        *(f"- {n}" for n in t.notes),
        "",
        f"Effects: {', '.join(t.model.effects)}.",
    ]
    out.stream.log("notes", rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN), static=True)


WALK = 3.0
"""Extent of all frames, in sizes of the device, beyond which the camera follows it."""


def _camera(scene: _Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Direction to the right of the picture, camera position, point looked at, radius of what is to be seen [m]."""
    right = np.array([1.0, 0.0, 0.0]) if scene.across == 0 else np.array([0.0, 1.0, 0.0])
    towards = np.array([0.45, -1.0, 0.55]) if scene.across == 0 else np.array([1.0, 0.45, 0.55])
    towards /= np.linalg.norm(towards)
    radius = 0.5 * float(np.linalg.norm(scene.high - scene.low)) + 0.2 * scene.size
    target = (scene.low + scene.high) / 2
    return right, target + 1.9 * radius * towards, target, radius


def _blueprint(scene: _Scene, out: _Writer) -> rrb.Blueprint:
    _, eye, target, _ = _camera(scene)
    controls = rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0))
    if np.linalg.norm(scene.high - scene.low) > WALK * scene.size:  # it walks away: the camera goes along
        start = scene.x[0].mean(axis=0)
        near = start + (eye - target) / np.linalg.norm(eye - target) * 1.6 * scene.size
        controls = rrb.EyeControls3D(
            position=near, look_target=start, eye_up=(0.0, 0.0, 1.0), tracking_entity="/sheet/faces"
        )
    space = rrb.Spatial3DView(
        origin="/",
        name=f"{scene.title} (m)",
        background=_BACKGROUND,
        line_grid=False,
        contents=[
            "+ /sheet/**",
            "+ /magnets/**",
            "+ /field/**",
            "+ /contacts/**",
            "+ /ground/**",
            "+ /scale/**",
            "+ /markers/**",
        ],
        eye_controls=controls,
    )
    about = rrb.TextDocumentView(origin="/notes", name="About")
    start, end = float(scene.times[0]), float(scene.times[-1])
    # the legend lies on the plot, so room is left for it beside the curves
    room = [rr.TimeRangeBoundary.absolute(seconds=t) for t in (start, end + 0.5 * (end - start))]
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=room[0], end=room[1]))
    plots = [
        rrb.TimeSeriesView(
            origin="/",
            name=p.name,
            contents=[f"+ {path}" for path in p.paths],
            axis_x=axis,
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )
        for p in out.plots
    ]
    left = rrb.Tabs(space, about)
    duration = end - start
    time = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        play_state="Playing",
        loop_mode="All",
        playback_speed=min(1.0, duration / 4.0) if duration > 0 else 1.0,
    )
    root = rrb.Horizontal(left, rrb.Vertical(*plots), column_shares=[11, 9]) if plots else left
    return rrb.Blueprint(root, rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"), time)


# overlays of a diagnosis ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Overlay:
    """A recorded object and simulations of it, frame by frame.

    Attributes:
        model: topology. times: [F] [s]. recorded: [F, N, 3] node positions that the channels tell [m].
        films: "before" and "after": [F, N, 3] simulated [m].
        creases: the same names: [F, C] what parts the fold angles from the recorded [rad].
        panels: [F, P] rms distance of the panels' nodes from where they were recorded [m].
        note: a sentence on the simulations.
    """

    model: Model
    times: np.ndarray
    recorded: np.ndarray
    films: Mapping[str, np.ndarray]
    creases: Mapping[str, np.ndarray]
    panels: Mapping[str, np.ndarray]
    note: str = ""


class Compared(Protocol):
    """A component of a recording with predictions, as a diagnosis holds it."""

    component: str
    unit: str
    times: list[float]
    recorded: list[float]
    before: list[float]
    after: list[float]


RIGHT, WRONG = (172, 196, 216), (206, 44, 44)
"""Colours of what agrees with the recording, and of what is furthest from it."""


def write_overlay(path: str | Path, overlay: Overlay, series: Sequence[Compared], *, title: str) -> Path:
    """Writes a replay of two views, before and after, each with the recorded object as outlines on top.

    Creases and panels are coloured by what parts them from the recording, on one scale for both views.

    Args:
        path: the .rrd file. overlay: the frames. series: components to be plotted. title: shown in the viewer.

    Raises:
        InputError: a file that cannot be written.
    """
    digest = hashlib.sha256(repr((title, overlay.model.hash)).encode() + overlay.recorded.tobytes())
    with _writing(path, "origami_sim diagnosis", digest.hexdigest()[:32]) as stream:
        out = _Writer(stream)
        stream.send_recording_name(title)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        widest = [
            float(np.percentile(g["before"], 98)) if g["before"].size else 0.0
            for g in (overlay.creases, overlay.panels)
        ]
        for name, x in overlay.films.items():
            _write_film(overlay, name, x, widest, out)
        _write_series(series, out)
        unit, factor = _scaled("m", widest[1], "m")
        text = (
            f"# {title}\n\nPink: the recorded object, as its channels tell. Solid: the simulation, as given (before) "
            "and with the best explanation (after).\n\nColours say what parts them, blue: nothing. Full red are "
            f"{np.degrees(widest[0]):.2g} deg at a crease, {factor * widest[1]:.2g} {unit} at a panel, in both views."
            f"\n\n{overlay.note}"
        )
        stream.log("notes", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        stream.send_blueprint(_overlay_blueprint(overlay, out))
    return Path(path).expanduser().absolute()


def _write_film(overlay: Overlay, name: str, x: np.ndarray, widest: Sequence[float], out: _Writer):
    model, times = overlay.model, overlay.times
    corners = x[:, model.triangles]
    normal = _unit(np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]))
    brightness = 0.58 + 0.42 * np.abs(normal @ (_LIGHT / np.linalg.norm(_LIGHT)))
    faces = _mixed(overlay.panels[name][:, model.triangle_panel], widest[1]) * brightness[:, :, None]
    out.moving(
        f"{name}/faces",
        times,
        rr.Mesh3D,
        static={"triangle_indices": np.arange(3 * len(model.triangles), dtype=np.uint32).reshape(-1, 3)},
        vertex_positions=corners.reshape(len(x), -1, 3),
        vertex_colors=np.repeat(faces.round().astype(np.uint8), 3, axis=1),
    )
    out.moving(
        f"{name}/creases",
        times,
        rr.LineStrips3D,
        static={"radii": [rr.Radius.ui_points(4.0)]},
        strips=x[:, model.creases[:, 1:3]],
        colors=_mixed(overlay.creases[name], widest[0]).round().astype(np.uint8),
    )
    edges = np.concatenate([_outlines(model), model.creases[:, 1:3]])
    for who, positions, colour, width in (
        ("outlines", x, COLOURS["outline"], 0.8),
        ("recorded", overlay.recorded, COLOURS["marker"], 1.8),
    ):
        out.moving(
            f"{name}/{who}",
            times,
            rr.LineStrips3D,
            static={"radii": [rr.Radius.ui_points(width)], "colors": [colour]},
            strips=positions[:, edges],
        )


def _mixed(gap: np.ndarray, widest: float) -> np.ndarray:
    """Colours [..., 3] between RIGHT and WRONG."""
    share = np.clip(gap / widest, 0.0, 1.0)[..., None] if widest > 0 else np.zeros((*gap.shape, 1))
    return np.array(RIGHT) + share * (np.array(WRONG, float) - RIGHT)


def _write_series(series: Sequence[Compared], out: _Writer):
    """Recorded and simulated components, and what is left; plots for the two that are most wrong before."""
    wrong = [float(np.nanstd(np.subtract(t.recorded, t.before)) / (np.nanstd(t.recorded) or 1.0)) for t in series]
    shown = np.argsort(wrong)[::-1][:2]
    for n, t in enumerate(series):
        usual = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "N": ("mN", 1e3)}
        unit, factor = usual.get(t.unit, (t.unit, 1.0))
        times, every = np.asarray(t.times, float), slice(None, None, max(1, len(t.times) // 3000))
        recorded = factor * np.asarray(t.recorded, float)
        plots = _Plot(f"{t.component} ({unit})"), _Plot(f"{t.component}: recorded less simulated ({unit})")
        for who, colour in (("recorded", COLOURS["marker"]), ("before", SERIES[1]), ("after", SERIES[0])):
            values = recorded if who == "recorded" else factor * np.asarray(getattr(t, who), float)
            kinds = [("", values, plots[0])] + [("left_", recorded - values, plots[1])] * (who != "recorded")
            for kind, y, plot in kinds:
                seen = np.isfinite(y)
                path = f"/channels/{_slug(t.component)}/{kind}{who}"
                label = f"{who} ({unit})"
                out.series(path, label, times[seen][every], y[seen][every], colour, points=who == "recorded")
                plot.paths.append(path)
        if n in shown:
            out.plots += plots


def _overlay_blueprint(overlay: Overlay, out: _Writer) -> rrb.Blueprint:
    every = np.concatenate([overlay.recorded, *overlay.films.values()])
    low, high = every.min(axis=(0, 1)), every.max(axis=(0, 1))
    across = 0 if high[0] - low[0] >= 0.8 * (high[1] - low[1]) else 1
    towards = _unit(np.array([0.45, -1.0, 0.35]) if across == 0 else np.array([1.0, 0.45, 0.35]))
    target, radius = (low + high) / 2, 0.5 * float(np.linalg.norm(high - low))
    controls = rrb.EyeControls3D(position=target + 2.0 * radius * towards, look_target=target, eye_up=(0.0, 0.0, 1.0))
    views = [
        rrb.Spatial3DView(
            origin="/",
            name={"before": "Before: as given", "after": "After: best explanation"}.get(name, name) + " (m)",
            background=_BACKGROUND,
            line_grid=False,
            contents=[f"+ /{name}/**"],
            eye_controls=controls,
        )
        for name in overlay.films
    ]
    plots = [
        rrb.TimeSeriesView(
            origin="/",
            name=p.name,
            contents=[f"+ {path}" for path in p.paths],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )
        for p in out.plots
    ]
    about = rrb.TextDocumentView(origin="/notes", name="About")
    below = rrb.Horizontal(*plots, about)
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(*views), below, row_shares=[5, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="Playing", loop_mode="All"),
    )
