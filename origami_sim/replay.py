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
    angles/..., energy/..., work/..., tip/..., centre/..., drive/..., measured/...   scalar series, unit in the name
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.recording import Recording
from origami_sim.solve.dynamics import Trajectory

TIMELINE = "sim_time"

COLOURS = {
    "passive": (158, 190, 219),  # clear elastomer
    "magnet": (88, 84, 96),  # dark, like iron-filled elastomer
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
}
"""Colours (red, green, blue; 0 to 255) of what is drawn."""

SERIES = ((57, 135, 229), (233, 121, 42), (46, 160, 96), (199, 70, 110), (142, 105, 214), (176, 138, 28),
          (30, 160, 172), (140, 140, 140))  # fmt: skip
"""Colours of series, readable on dark and on light."""

PLOTTED = len(SERIES)
"""Series that a plot shows at once; all others are in the file and can be added in the viewer."""

_BACKGROUND = (250, 250, 248)
_LIGHT = np.array([0.35, -0.5, 0.79])
_FOV = np.radians(55.0)  # the viewer's vertical field of view
_BLOCK = 1_000_000  # numbers per chunk

Recorded = Trajectory


class HasTrajectory(Protocol):
    """What a run read from disk offers."""

    @property
    def trajectory(self) -> Trajectory: ...


def write_replay(
    path: str | Path, source: Trajectory | HasTrajectory, *, world: int = 0, magnets: Iterable[int] | None = None,
    arms: Iterable[int] = (), tip: int | None = None, recording: Recording | None = None, title: str = "origami_sim",
) -> Path:  # fmt: skip
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
    file = Path(path).expanduser().absolute()
    if file.is_dir():
        raise InputError("is a folder; a replay is a file", file=file, allowed="a file name ending in .rrd")
    work = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        work.touch()  # rerun reports a file that cannot be made only as a log line
        with rr.RecordingStream(scene.application, recording_id=scene.identity, send_properties=False) as stream:
            stream.save(work)
            _write(scene, stream, recording)
            stream.send_blueprint(_blueprint(scene))
            stream.flush()
            stream.disconnect()
        os.replace(work, file)
    except OSError as e:
        raise InputError(f"cannot be written ({e.strerror or e})", file=file, allowed="a writable folder") from None
    finally:
        work.unlink(missing_ok=True) if work.parent.is_dir() else None
    return file


def open_replay(path: str | Path) -> subprocess.Popen:
    """Opens a replay in the viewer, in a process of its own that outlives this one.

    Raises:
        InputError: no such file, or the viewer is not installed.
    """
    return subprocess.Popen([_viewer(), str(_existing(path))], start_new_session=True)


def screenshot(
    path_rrd: str | Path, path_png: str | Path, *, time: float | None = None, width: int = 1280, height: int = 800,
    timeout: float = 120.0, note: Any = None,
) -> bool:  # fmt: skip
    """Takes a picture of a replay as the viewer shows it, without a window.

    Drawing needs a graphics driver that offers Vulkan; without a graphics card that is Mesa's lavapipe (Debian and
    Ubuntu: `apt install mesa-vulkan-drivers`). Pictures are not the same to the bit on different drivers.

    Args:
        path_rrd: a file of `write_replay`. path_png: the picture.
        time: simulated time to be shown [s] (default: where the creases are folded most).
        width, height: of the picture [px]. timeout: for the viewer [s].
        note: called with a sentence if there is no picture (default: it goes to standard error).

    Returns:
        Whether there is a picture.

    Raises:
        InputError: no such replay, not a replay, a picture that cannot be written, a size that is not positive.
    """
    source, target = _existing(path_rrd), Path(path_png).expanduser().absolute()
    if width < 1 or height < 1:
        raise InputError("a picture needs a size", field="width, height", value=(width, height), allowed=">= 1 px")
    if not target.parent.is_dir() or target.is_dir():
        raise InputError("cannot be written", file=target, allowed="a file in an existing folder")
    note = note or (lambda sentence: print(sentence, file=sys.stderr))
    with tempfile.TemporaryDirectory() as folder:
        still, picture = Path(folder) / "still.rrd", Path(folder) / "picture.png"
        _write_still(source, still, time)
        command = [_viewer(), str(still), "--headless", "--screenshot-to", str(picture), "--port", "auto",
                   "--window-size", f"{width}x{height}", "--hide-welcome-screen"]  # fmt: skip
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
            said = done.stderr + done.stdout
        except subprocess.TimeoutExpired:
            said = f"no picture within {timeout:g} s"
        if not picture.is_file():
            lines = [s.strip() for s in said.splitlines() if s.strip()]
            why = next((s for s in lines if "adapter" in s.lower() or "graphics" in s.lower()), lines[-1] if lines else "")
            note(f"no screenshot: the viewer could not draw ({why[:300]}); it needs Vulkan, on Debian and Ubuntu "
                 "`apt install mesa-vulkan-drivers`")  # fmt: skip
            return False
        try:
            shutil.copyfile(picture, target)
        except OSError as e:
            raise InputError(f"cannot be written ({e.strerror})", file=target) from None
    return True
