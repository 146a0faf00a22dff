"""Whether a walker still does what it did: strides by cycle against a stored reference and the paper."""

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import metadata, resources
from pathlib import Path

import numpy as np

from origami_sim.device.scene import Settings
from origami_sim.errors import InputError
from origami_sim.observation.gait import summary

PAPER = 25.0
"""Stride that the seed paper reports for its crawler [mm per cycle]."""


def settings_hash(settings: Settings) -> str:
    """Digest of all values of a calibration."""
    return hashlib.sha256(json.dumps(settings.as_dict(), sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Report:
    """Comparison with a stored reference; lengths in mm.

    Attributes:
        name: of the reference. strides, expected: by cycle, as far as both go.
        now, then: mean, spread and trend of the steady cycles, of this run and of the reference.
        tolerance: allowed difference of any of them. paper: the published stride, or None.
        same_settings: whether the calibration is the stored one; None if it was not given.
        passed: whether every stride, the mean, the spread and the trend lie within the tolerance.
    """

    name: str
    strides: tuple[float, ...]
    expected: tuple[float, ...]
    now: dict[str, float]
    then: dict[str, float]
    tolerance: float
    paper: float | None
    same_settings: bool | None
    passed: bool

    def table(self) -> dict[str, np.ndarray]:
        """By cycle: stride, reference and difference [mm]."""
        a, b = np.array(self.strides), np.array(self.expected)
        return {"cycle": np.arange(1, len(a) + 1), "stride_mm": a, "reference_mm": b, "difference_mm": a - b}

    def to_json(self) -> dict:
        """Everything, as plain values."""
        return asdict(self)

    def text(self) -> str:
        """A small table and what it says."""
        lines = [f"{'':8}{'now':>9}{'stored':>9}{'change':>9}   [mm per cycle]"]
        lines += [f"{k:8}{self.now[k]:9.3f}{self.then[k]:9.3f}{self.now[k] - self.then[k]:+9.3f}"
                  for k in ("mean", "spread", "trend")]  # fmt: skip
        lines.append(
            f"{self.name}: " + ("within" if self.passed else "NOT within") + f" {self.tolerance:g} mm of the reference"
        )
        if self.same_settings is False:
            lines.append("the settings differ from those of the reference")
        if self.paper:
            lines.append(f"paper: {self.paper:g} mm per cycle; this run {self.now['mean'] / self.paper - 1:+.1%}")
        return "\n".join(lines)


def _file(name: str, folder: Path | None) -> Path:
    return (folder or Path(str(resources.files("origami_sim.calibrations")))) / f"{name}_stride.json"


def reference(name: str, *, folder: Path | None = None) -> dict:
    """Stored strides of a scene (JSON beside the calibrations).

    Raises:
        InputError: there is none, or it is malformed.
    """
    path = _file(name, folder)
    try:
        data = json.loads(path.read_text())
        if not data["strides_mm"] or not data["tolerance_mm"] > 0:
            raise ValueError
    except OSError:
        raise InputError(
            "has no stored strides", file=path, allowed="store them with origami_sim.studies.strides.store"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError("is not a stored reference", file=path, allowed="strides_mm and tolerance_mm > 0") from None
    return data


def check(name: str, strides: Sequence[float] | np.ndarray, *, settings: Settings | None = None,
          folder: Path | None = None) -> Report:  # fmt: skip
    """Compares strides by cycle [m] with the stored reference of that name, over the cycles that both have."""
    data = reference(name, folder=folder)
    n = min(len(strides), len(data["strides_mm"]))
    if n < 1:
        raise InputError("there are no strides to compare", field="strides", allowed="one or more cycles")
    a, b = (tuple(float(x) for x in row[:n]) for row in (1e3 * np.asarray(strides, float), data["strides_mm"]))
    now, then, tolerance = summary(a), summary(b), float(data["tolerance_mm"])
    differences = [*np.subtract(a, b), *(now[k] - then[k] for k in ("mean", "spread", "trend"))]
    same = None if settings is None else settings_hash(settings) == data.get("settings")
    within = bool(np.all(np.abs(differences) <= tolerance))  # false for nan
    return Report(name, a, b, now, then, tolerance, data.get("paper_mm"), same, within)


def store(name: str, strides: Sequence[float] | np.ndarray, *, settings: Settings, tolerance: float = 0.5,
          paper: float | None = PAPER,
          folder: Path | None = None) -> Path:  # fmt: skip
    """Writes a reference in one step and returns its file: strides by cycle (given in m), settings, versions."""
    path = _file(name, folder)
    data = {
        "strides_mm": [round(1e3 * float(x), 4) for x in strides], "tolerance_mm": tolerance, "paper_mm": paper,
        "settings": settings_hash(settings), "values": settings.as_dict(),
        "versions": {p: metadata.version(p) for p in ("origami-sim", "warp-lang", "numpy")},
    }  # fmt: skip
    part = path.with_suffix(".part")
    try:
        part.write_text(json.dumps(data, indent=1) + "\n")
        os.replace(part, path)
    except OSError as e:
        raise InputError(f"cannot be written ({e.strerror})", file=path) from None
    return path
