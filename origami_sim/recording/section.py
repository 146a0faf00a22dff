"""One table of a sidecar, whose look-ups refuse what is wrong in one sentence."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import LARGEST_NUMBER
from origami_sim.units import UNITS, unit_factor

CARRIERS = ("panel", "crease", "node", "nodes", "ground", "grip")
ATTACHMENT_KEYS = (*CARRIERS, "point", "from", "distance", "along", "height", "direction")


@dataclass(frozen=True, eq=False)
class Section:
    """One table of a sidecar; every look-up raises a sentence that names the key."""

    file: Path
    prefix: str
    values: Any
    keys: tuple[str, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.values, dict):
            self.refuse("must be a table", self.prefix.rstrip("."), self.values)
        for key in self.values:
            if key not in self.keys:
                raise InputError(
                    f"unknown key '{key}'", file=self.file, field=self.prefix + key, allowed=", ".join(self.keys)
                )

    def table(self, key: str) -> dict[str, Any]:
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self.refuse("must be a table", self.prefix + key, value)
        return value

    def text(self, key: str, default: str | None) -> str | None:
        value = self.values.get(key, default)
        if value is not None and not (isinstance(value, str) and value):
            self.refuse("must be a text", self.prefix + key, value)
        return value

    def flag(self, key: str) -> bool:
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            self.refuse("must be true or false", self.prefix + key, value)
        return value

    def number(self, key: str, default: float | None) -> Any:
        value = self.values.get(key, default)
        return default if value is None else self.check_number(key, value)

    def check_number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < LARGEST_NUMBER:
            self.refuse("must be a finite number", self.prefix + key, value)
        return float(value)  # type: ignore[arg-type]

    def quantity(self, key: str, dimension: str) -> float:
        """A number in the SI unit of a dimension, or a text with a unit of it ("12 mm"), in SI."""
        return self.check_quantity(self.prefix + key, self.values[key], dimension)

    def check_quantity(self, field: str, value: object, dimension: str) -> float:
        """The same for a value that stands in this table."""
        if not isinstance(value, str):
            return self.check_number(field.removeprefix(self.prefix), value)
        number, unit = split_quantity(value)
        if number is None:
            allowed = f"a number in {next(iter(UNITS[dimension]))}, or a text with a unit such as '1.5 mm'"
            raise InputError("not a quantity", file=self.file, field=field, value=value, allowed=allowed)
        return number * unit_factor(unit, dimension=dimension, file=self.file, field=field)

    def choice(self, key: str, allowed: Mapping[str, object]) -> str:
        value = self.values.get(key)
        if not isinstance(value, str) or value not in allowed:
            fault = f"'{key}' is missing" if value is None else f"unknown {key}"
            raise InputError(fault, file=self.file, field=self.prefix + key, value=value, allowed=", ".join(allowed))
        return value

    def unit(self, dimension: str | None, default: str | None = None) -> str:
        unit = self.text("unit", default)
        unit_factor(unit or "", dimension=dimension, file=self.file, field=self.prefix + "unit")
        return unit or ""

    def length_unit(self, kind: str) -> str | None:
        """A unit of length, "px" for a marker in a picture, or None where the file has to state it."""
        unit = self.text("unit", None)
        if unit is not None and not (unit == "px" and kind == "marker_2d"):
            unit_factor(unit, dimension="length", file=self.file, field=self.prefix + "unit")
        return unit

    def camera(self, kind: str, cameras: Mapping[str, object]) -> str | None:
        """Name of the camera of a channel; the only one when it is left out."""
        name = self.text("camera", None)
        if name is None:
            return next(iter(cameras)) if kind == "marker_2d" and len(cameras) == 1 else None
        if kind != "marker_2d":
            self.refuse("only a marker_2d has a camera", self.prefix + "camera", name)
        if name not in cameras:
            known = ", ".join(cameras) or "none is described"
            raise InputError("unknown camera", file=self.file, field=self.prefix + "camera", value=name, allowed=known)
        return name

    def vector(self, key: str, default: list[float] | None, size: int = 3) -> Any:
        value = self.values.get(key, default)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != size:
            self.refuse(f"must be {'three' if size == 3 else 'two'} numbers", self.prefix + key, value)
        return [self.check_number(key, component) for component in value]

    def direction(self) -> list[float] | None:
        vector = self.vector("direction", None)
        if vector is None:
            return None
        length = float(np.linalg.norm(vector))
        if not length > 0.0:
            self.refuse("must not be zero", self.prefix + "direction", vector)
        return [component / length for component in vector]

    def columns(self, coordinates: str | None = None) -> list[str]:
        """The columns that are named, or those of the tracked point where the kind of channel has `coordinates`."""
        if "track" in self.values:
            if "column" in self.values or "columns" in self.values:
                self.refuse("give either a track or columns", self.prefix + "track", self.values["track"])
            if coordinates is None:
                self.refuse("only a marker or a marker_2d is a track", self.prefix + "track", self.values["track"])
            return [f"{self.text('track', None)}.{axis}" for axis in coordinates or ""]
        if ("column" in self.values) == ("columns" in self.values):
            raise InputError(
                "give either 'column' or 'columns'", file=self.file, field=self.prefix + "column", allowed="one of both"
            )
        names = [self.values["column"]] if "column" in self.values else self.values["columns"]
        if not isinstance(names, list) or not names or not all(isinstance(n, str) and n for n in names):
            self.refuse("must name columns", self.prefix + "columns", names)
        if len(set(names)) != len(names):
            self.refuse("must not name a column twice", self.prefix + "columns", names)
        return names

    def attachment(self, kind: str, count: int) -> dict[str, Any]:
        """What the channel observes: at most one carrier, and the point, height or direction on it."""
        found = {key: self.values[key] for key in ATTACHMENT_KEYS if key in self.values}
        carriers = [key for key in found if key in CARRIERS]
        if len(carriers) > 1:
            self.refuse("observes one thing only", self.prefix.rstrip("."), carriers)
        for key in carriers:
            many = found[key] if key == "nodes" and isinstance(found[key], list) and found[key] else [found[key]]
            if key == "ground":
                if found[key] is not True:
                    self.refuse("must be true", self.prefix + key, found[key])
            elif (key == "nodes" and many == [found[key]]) or any(
                isinstance(one, bool) or not isinstance(one, (int, str)) or one == "" for one in many
            ):
                fault = "must be a list of names or numbers" if key == "nodes" else "must be a name or a number"
                self.refuse(fault, self.prefix + key, found[key])
            if key in ("nodes", "ground", "grip") and kind != "force" and (key, kind) != ("grip", "moment"):
                self.refuse("is only for a force", self.prefix + key, found[key])
        if "point" in found:
            point = found["point"]
            if not isinstance(point, list) or len(point) != 3:
                self.refuse("must be three coordinates in metres", self.prefix + "point", point)
            found["point"] = [self.check_number("point", coordinate) for coordinate in point]
        if "from" in found:
            named = found["from"]
            if isinstance(named, bool) or not isinstance(named, (int, str)) or named == "":
                self.refuse("must be the name or number of a crease", self.prefix + "from", named)
            if "panel" not in found or "point" in found:
                self.refuse("is for a point on a panel, in place of 'point'", self.prefix + "from", named)
        for key in ("distance", "along"):
            if key in found:
                if "from" not in found:
                    self.refuse("is measured from a crease: 'from' is missing", self.prefix + key, found[key])
                found[key] = self.quantity(key, "length")
        if "from" in found and "distance" not in found:
            self.refuse("a point measured from a crease needs its distance", self.prefix + "distance", None)
        if "height" in found:
            found["height"] = self.quantity("height", "length")
        if "direction" in found:
            if kind not in ("force", "tip_displacement") or count != 1:
                self.refuse(
                    "is only for a force or displacement of one column", self.prefix + "direction", found["direction"]
                )
            found["direction"] = self.direction()
        return found

    def label(self, key: str, column: str) -> str | float:
        value = self.values[key][column]
        if isinstance(value, str):
            return value
        return self.check_number(f"{key}.{column}", value)

    def refuse(self, fault: str, field: str, value: object) -> NoReturn:
        """Raises InputError for this key."""
        raise InputError(fault, file=self.file, field=field, value=value)


def split_quantity(text: str) -> tuple[float | None, str]:
    """Number and unit of a text such as "0.4 mrad"; None where it is none."""
    match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d.\s].*?)\s*", text)
    return (float(match[1]), match[2]) if match else (None, "")
