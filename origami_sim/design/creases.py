"""Elastic creases of a sheet: stated, from target angles, or by the files that `origami-sim calibrate` writes."""

import re
from pathlib import Path
from typing import Self

import numpy as np

from origami_sim.design.masses import Masses
from origami_sim.design.statements import statement
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.files import read_toml
from origami_sim.model import dihedral_angles
from origami_sim.quantities import converted

TARGET = "target"
"""The word for rest angles that are the pattern's target angles."""

DRIVEN = ("crease_drive", "crease_table")
"""Effects that have angles of their own."""

UNITS = {
    "stiffness": "N m/rad",
    "rest_angle": "rad",
    "viscosity": "N m s/rad",
    "angle_min": "rad",
    "angle_max": "rad",
    "resisting_moment": "N m",
}
"""What a file may say of a crease, and in which unit."""


class Creases(Masses):
    """The part of `Sheet` that knows its elastic creases: as stated, as in the pattern, or as calibrated."""

    _crease_stiffness: np.ndarray
    _rest: np.ndarray
    _rest_stated: np.ndarray
    _viscous_creases: tuple[float, float]

    @statement(stiffness="N m/rad", share="1", loss_time="s")
    def crease(
        self,
        creases=None,
        *,
        stiffness=None,
        rest_angle=None,
        share: float = 1.0,
        loss_time: float | None = None,
        damping_ratio: float | None = None,
    ) -> Self:
        """Elastic creases, with a Kelvin-Voigt loss if asked for.

        Args:
            creases: indices (default: all). stiffness: [N m/rad].
            rest_angle: [rad], or "target" for the target fold angles of the pattern, where it has them (default: the
                rest angles of the pattern, else the angles of its shape).
            share: with "target", of the way from the angles of the pattern's shape to its targets, 0 to 1.
            loss_time: beta [s], viscosity = beta * stiffness (tan delta = beta omega), for all creases.
            damping_ratio: instead of loss_time, a ratio of critical for the crease with the lighter panel swinging.

        Raises:
            InputError: a sheet without creases, no such crease, a value out of its bounds, a target of creases that the
                pattern gives none.
        """
        self.on("crease")
        index = self._index("crease", creases)
        if creases is None and not len(index):
            allowed = "a pattern with folds between its faces; Sheet.panel() and Sheet.shell() state how panels bend"
            raise InputError("the sheet has no creases", field="creases", allowed=allowed)
        for name, value in (("loss_time", loss_time), ("damping_ratio", damping_ratio)):
            if value is not None and not 0 <= value < np.inf:
                raise InputError("a loss cannot be negative", field=name, value=value, allowed=">= 0")
        if stiffness is not None:
            if not np.all(np.asarray(stiffness, float) >= 0):
                raise InputError(
                    "a crease stiffness cannot be negative", field="stiffness", value=stiffness, allowed=">= 0"
                )
            self._crease_stiffness[index] = stiffness
        if isinstance(rest_angle, str) and rest_angle == TARGET:
            self._rest_at_targets(index, share)
        elif share != 1.0:
            raise InputError("is of target angles", field="share", value=share, allowed="with rest_angle='target'")
        elif rest_angle is not None:
            if isinstance(rest_angle, str) and rest_angle.strip().isalpha():
                raise InputError("no rest angle", field="rest_angle", value=rest_angle, allowed="'30 deg', 'target'")
            self._rest[index] = converted(rest_angle, "rad", "rest_angle")
            self._rest_stated[index] = True
        if loss_time is not None or damping_ratio is not None:
            self._viscous_creases = (loss_time or 0.0, damping_ratio or 0.0)
            self.on("crease_viscosity")
        return self

    def _rest_at_targets(self, index: np.ndarray, share: float) -> None:
        """Makes the pattern's target angles, or a share of the way to them, the rest angles of these creases."""
        if not isinstance(share, float | int) or not 0.0 <= share <= 1.0:
            raise InputError("no share of a fold", field="share", value=share, allowed="0 to 1")
        target = self._targets()[index]
        given = ~np.isnan(target)
        if not given.any():
            raise InputError(
                "the pattern gives these creases no target angle",
                field="rest_angle",
                value=TARGET,
                allowed="an angle, or a pattern with target angles (target_angle=, opacity in SVG, edges_foldAngle)",
            )
        shape = dihedral_angles(self.mesh.vertices, self.mesh.creases)[index]
        self._rest[index[given]] = (shape + share * (target - shape))[given]
        self._rest_stated[index] = True

    def _targets(self) -> np.ndarray:
        """Target fold angles of the creases by the pattern [rad]; nan where it gives none."""
        return self.pattern.fold_angles[self.mesh.crease_edge]

    def unused_targets(self) -> list[str]:
        """A sentence on target fold angles of the pattern at which no crease rests and nothing drives it; or none."""
        stated = any(name == "rest_angle" or effect in DRIVEN for effect, name, *_ in self._settings)
        if stated or {"crease", "crease_yield"}.isdisjoint(self._effects):
            return []
        target, shape = self._targets(), dihedral_angles(self.mesh.vertices, self.mesh.creases)
        count = int(np.sum(~self._rest_stated & ~np.isnan(target) & ~np.isclose(target, shape)))
        if not count:
            return []
        which = "1 crease a target angle" if count == 1 else f"{count} creases target angles"
        return [
            f"The pattern gives {which}, which nothing uses: creases rest as it is drawn. Sheet.crease("
            "rest_angle='target') makes them rest angles, share=0.5 beside it those of half the fold."
        ]

    def crease_law(self, file: str | Path, creases=None, *, loss_time: float | str | None = None) -> Self:
        """Creases as `origami-sim calibrate crease`, `bridge` or `ring-down` found them: a table, or a stiffness.

        The moment is that of the whole crease that was measured or computed: of the same length, as no file can tell.
        A design file remembers the numbers, not the file.

        Args:
            file: that was written. creases: indices (default: all).
            loss_time: beta [s], viscosity = beta * stiffness (default: the viscosity in the file, if it has one).

        Raises:
            InputError: no such file or crease, a file that says nothing of a crease, a loss time where it has no
                stiffness, a value in another unit.
        """
        index = self._index("crease", creases)
        given = _law(Path(file))
        tabled, where = "resisting_moment" in given, index.tolist()
        if loss_time is not None and "stiffness" not in given:
            allowed = "a file with a stiffness, or no loss time"
            raise InputError(
                "a loss time needs a stiffness", file=file, field="loss_time", value=loss_time, allowed=allowed
            )
        if tabled:
            self.crease(where, stiffness=0.0)  # others may have the linear law
            numbers = {n: given[n] for n in ("angle_min", "angle_max", "resisting_moment")}
            self.set("crease_table", where, **{n: np.asarray(v).tolist() for n, v in numbers.items()})
        else:
            self.crease(where, stiffness=given.get("stiffness"), rest_angle=given.get("rest_angle"))
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
