"""The rerun viewer: open a replay, take its picture, read its series back."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time as clock
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from origami_sim.errors import InputError

TIMELINE = "sim_time"
"""Timeline of replays [s]."""

BAR = 37
"""Height of the viewer's menu, which is cut off pictures [points]."""


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
        why = _photograph(source, picture, time, width, height + BAR, timeout)
        if why:
            sentence = f"no screenshot: {why}"
            note(sentence) if note else print(sentence, file=sys.stderr)
            return False
        try:
            with Image.open(picture) as image:  # the viewer draws two pixels per point
                bar = round(BAR * image.width / width)  # it warns there of whatever draws
                shown = image.convert("RGB").crop((0, bar, image.width, image.height))
                shown.resize((width, height), Image.Resampling.BOX).save(target, format="PNG")
        except OSError as e:
            raise InputError(f"cannot be written ({e.strerror or e})", file=target) from None
    return True


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
