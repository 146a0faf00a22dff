"""C3D (www.c3d.org), the binary format of motion capture: needs the package ezc3d (`pip install origami-sim[c3d]`).

Points are named by POINT:LABELS, lengths are in POINT:UNITS; a residual below zero marks a missing point. Analog series
are offered as columns `analog.<label>`, the mean of the samples of each frame, in the units that ANALOG:UNITS states.
"""

import importlib
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import Table
from origami_sim.recording.trackers._text import once

FORMAT = "c3d"


def matches(path: Path, data: bytes) -> bool:
    """Whether the second byte is the mark of the format, in a file of that name."""
    return path.suffix.lower() == ".c3d"


def read(path: Path, data: bytes) -> Table:
    """Columns `time` [s], `frame`, and `<label>.x`, `.y`, `.z` in the unit of the file; see the head of this file."""
    try:
        library = importlib.import_module("ezc3d")
    except ImportError:
        raise InputError(
            "C3D files need the package ezc3d, which is not installed",
            file=path,
            allowed="pip install 'origami-sim[c3d]', or export the take as CSV",
        ) from None
    if data[1:2] != b"\x50":
        raise InputError("is no C3D file", file=path)
    try:
        content = library.c3d(str(path))
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(f"is no readable C3D file: {error}", file=path) from error
    parameters, points = content["parameters"], np.asarray(content["data"]["points"], float)
    labels = [str(label).strip() for label in parameters["POINT"]["LABELS"]["value"]]
    unit = str((parameters["POINT"].get("UNITS", {}).get("value") or [""])[0]).strip()
    if unit not in ("m", "cm", "mm"):
        raise InputError("unknown unit", file=path, field="POINT:UNITS", value=unit, allowed="m, cm, mm")
    rate = float(content["header"]["points"]["frame_rate"])
    if not rate > 0:
        raise InputError("the rate must be positive", file=path, field="POINT:RATE", value=rate)
    residuals = np.asarray(content["data"]["meta_points"]["residuals"])[0]
    count = points.shape[2]
    frames = np.arange(count) + int(content["header"]["points"]["first_frame"])
    columns: dict[str, np.ndarray] = {"frame": frames.astype(float), "time": frames / rate}
    for k, label in enumerate(labels[: points.shape[1]]):
        for i, axis in enumerate("xyz"):
            once(path, columns, f"{label}.{axis}", np.where(residuals[k] < 0, np.nan, points[i, k]))
    if "ANALOG" in parameters and "LABELS" in parameters["ANALOG"]:
        samples = np.asarray(content["data"]["analogs"], float)[0]
        per_frame = samples.shape[1] // count if count else 0
        for label, series in zip(parameters["ANALOG"]["LABELS"]["value"], samples, strict=False):
            if per_frame:
                once(path, columns, f"analog.{str(label).strip()}", series.reshape(count, per_frame).mean(axis=1))
    return Table(
        file=path,
        numbers=columns,
        labels={},
        rows=np.arange(count),
        lines=lambda row: f"frame {int(frames[row])}",
        unit=unit,
        clock="time",
        frame="frame",
    )
