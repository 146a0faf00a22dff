"""Creases by the files that `origami-sim calibrate` writes."""

import re
from abc import abstractmethod
from pathlib import Path
from typing import Self

import numpy as np

from origami_sim.design.masses import Masses
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.files import read_toml
from origami_sim.quantities import converted

UNITS = {
    "stiffness": "N m/rad",
    "rest_angle": "rad",
    "viscosity": "N m s/rad",
    "angle_min": "rad",
    "angle_max": "rad",
    "resisting_moment": "N m",
}
"""What a file may say of a crease, and in which unit."""


class Calibrated(Masses):
    """The part of `Sheet` that takes creases from calibrations."""

    @abstractmethod
    def crease(self, creases=None, *, stiffness=None, rest_angle=None) -> Self:
        """Elastic creases, see `Sheet.crease`."""

    def crease_law(self, file: str | Path, creases=None, *, loss_time: float | str | None = None) -> Self:
        """Creases as `origami-sim calibrate crease`, `bridge` or `ring-down` found them: a table, or a stiffness.

        The moment is that of the whole crease that was measured or computed: of the same length, as no file can tell.
        A design file remembers the numbers, not the file.

        Args:
            file: that was written. creases: indices (default: all).
            loss_time: beta [s], viscosity = beta * stiffness (default: the viscosity in the file, if it has one).

        Raises:
            InputError: no such file or crease, a file that says nothing of a crease, a value in another unit.
        """
        index = self._index("crease", creases)
        given = _law(Path(file))
        tabled, where = "resisting_moment" in given, index.tolist()
        linear = {n: given[n] for n in ("stiffness", "rest_angle") if n in given}
        self.crease(where, **({"stiffness": 0.0} if tabled else linear))  # others may have the linear law
        if tabled:
            numbers = {n: given[n] for n in ("angle_min", "angle_max", "resisting_moment")}
            self.set("crease_table", where, **{n: np.asarray(v).tolist() for n, v in numbers.items()})
        viscosity = given.get("viscosity")
        if loss_time is not None:
            viscosity = converted(loss_time, "s", "loss_time") * given["stiffness"]
        if viscosity is not None:
            self.set("crease_viscosity", where, viscosity=viscosity)
        return self


def _law(file: Path) -> dict[str, float | np.ndarray]:
    """Numbers [SI] of a crease in a calibration: those of `UNITS` that it has, the table as (33,) moments."""
    data = read_toml(file)
    knots = get("crease_table").parameter("resisting_moment").knots
    out: dict[str, float | np.ndarray] = {}
    table: dict[int, float] = {}
    for name, entry in data.items():
        knot = re.fullmatch(r"resisting_moment_(\d{2})", name)
        plain = "resisting_moment" if knot else name
        if plain not in UNITS or not isinstance(entry, dict):
            continue
        value, unit = entry.get("value"), entry.get("unit")
        if unit != UNITS[plain]:
            raise InputError("wrong unit", file=file, field=f"{name}.unit", value=unit, allowed=UNITS[plain])
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise InputError("not a finite number", file=file, field=name, value=value)
        if knot:
            table[int(knot[1])] = float(value)
        else:
            out[name] = float(value)
    if table:
        missing = sorted({*range(knots)} ^ {*table})
        if missing or not {"angle_min", "angle_max"} <= set(out):
            what = f"resisting_moment_{missing[0]:02d}" if missing else "angle_min, angle_max"
            raise InputError("the table of the crease is not whole", file=file, field=what, allowed=f"{knots} moments")
        out["resisting_moment"] = np.array([table[k] for k in range(knots)])
    elif "stiffness" not in out:
        allowed = "what origami-sim calibrate crease, bridge or ring-down writes"
        raise InputError("says nothing of a crease", file=file, field="stiffness", allowed=allowed)
    return out
