"""The sidecar of a recording: what the columns of its table mean, in TOML.

    name = "double pendulum, run 1"     # the file's stem when left out
    description = "..."                 # also source, licence: free text, kept in the metadata
    allow_gaps = false                  # true: missing values and time gaps become notes instead of errors

    [select]                            # optional: keep the rows where the column has this value
    toss = 12

    [time]                              # left out: rows are load steps 0, 1, 2, ...
    column = "time_s"
    unit = "s"                          # s, ms, us, min
    rate_hz = 1000                      # optional; checked against the column, or the time base when there is no column

    [channels.theta1]                   # the name that the simulation's observer uses
    column = "theta1_rad"               # or columns = ["x", "y", "z"]
    kind = "panel_angle"                # panel_angle, crease_angle, marker, marker_2d, tip_displacement, force
    unit = "rad"                        # of the column
    noise = 1e-4                        # standard deviation in `unit`; estimated from the data when left out
    sign = 1                            # value = sign * (reading - offset)
    offset = 0.0                        # reading at zero, in `unit`, e.g. the encoder zero
    unwrap = false                      # true: remove jumps of whole turns from an angle
    panel = "arm1"                      # what is observed: panel, crease or node (name or number) and, on a panel,
    point = [0.0, 0.0, 0.01]            # the body point [m]

    [drive.field]                       # optional: what was applied
    columns = ["bx", "by", "bz"]        # or column, or value = [0.0, 0.0, 5.0] for a constant
    unit = "mT"

    [scene]
    name = "pendulum_chain"             # the scene that simulates this object
    overrides = { arm1_mass = 0.09 }    # arguments of its build()

Any other key is an error. Units: see `origami_sim.recording.units`.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.recording import CHANNEL_KINDS
from origami_sim.recording.table import LARGEST_NUMBER, Table, first_line, read_bytes
from origami_sim.recording.units import unit_factor

_TOP_KEYS = ("name", "description", "source", "licence", "allow_gaps", "select", "time", "channels", "drive", "scene")
_TIME_KEYS = ("column", "unit", "rate_hz")
_CHANNEL_KEYS = ("column", "columns", "kind", "unit", "noise", "sign", "offset", "unwrap")
_ATTACHMENT_KEYS = ("panel", "crease", "node", "point")
_DRIVE_KEYS = ("column", "columns", "value", "unit")
_SCENE_KEYS = ("name", "overrides")


@dataclass(frozen=True, eq=False)
class Sidecar:
    """A checked sidecar: every key known, every value of its type, every unit known."""

    file: Path
    name: str | None
    free_text: dict[str, str]
    allow_gaps: bool
    select: dict[str, Any]
    time: dict[str, Any]
    channels: dict[str, dict[str, Any]]
    drive: dict[str, dict[str, Any]]
    scene: dict[str, Any]

    @classmethod
    def read(cls, path: Path) -> "Sidecar":
        """Read and check a sidecar; InputError names the first key that is wrong."""
        try:
            tree = tomllib.loads(read_bytes(path).decode("utf-8"))
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"is no valid TOML: {first_line(error)}", file=path) from error
        top = _Section(path, "", tree, _TOP_KEYS)
        channels = top.table("channels")
        if not channels:
            raise InputError("no channel is described", file=path, field="channels")
        time = _Section(path, "time.", top.table("time"), _TIME_KEYS)
        rate = time.number("rate_hz", None)
        if rate is not None and rate <= 0.0:
            raise InputError("the rate must be positive", file=path, field="time.rate_hz", value=rate)
        if "time" in tree and rate is None and "column" not in time.values:
            raise InputError("the time needs a column or a rate_hz", file=path, field="time")
        scene = _Section(path, "scene.", top.table("scene"), _SCENE_KEYS)
        return cls(
            file=path,
            name=top.text("name", None),
            free_text={key: text for key in ("description", "source", "licence") if (text := top.text(key, None))},
            allow_gaps=top.flag("allow_gaps"),
            select={column: top.label("select", column) for column in top.table("select")},
            time={"column": time.text("column", None), "unit": time.unit("time", default="s"), "rate_hz": rate},
            channels={name: _channel_spec(path, name, table) for name, table in channels.items()},
            drive={name: _drive_spec(path, name, table) for name, table in top.table("drive").items()},
            scene={"name": scene.text("name", None), "overrides": scene.table("overrides")} if scene.values else {},
        )

    @property
    def columns(self) -> list[str]:
        """Numeric columns that the file must have."""
        specs = [*self.channels.values(), *self.drive.values()]
        named = [column for spec in specs for column in spec["columns"]]
        time = [self.time["column"]] if self.time["column"] is not None else []
        return list(dict.fromkeys(time + named))

    @property
    def time_base(self) -> str:
        """Where the times come from: 'column', 'rate' or 'step'."""
        if self.time["column"] is not None:
            return "column"
        return "rate" if self.time["rate_hz"] is not None else "step"

    def times(self, table: Table) -> np.ndarray:
        """(n,) times [s], or step numbers."""
        if self.time["column"] is not None:
            return table.numbers[self.time["column"]] * unit_factor(self.time["unit"])
        return np.arange(len(table.rows)) / (self.time["rate_hz"] or 1.0)

    def check_rate(self, times: np.ndarray) -> None:
        """Raise where the stated rate and the time column differ by more than one per cent."""
        rate = self.time["rate_hz"]
        measured = 1.0 / float(np.median(np.diff(times)))
        if rate is not None and abs(measured - rate) > 0.01 * rate:
            raise InputError(
                f"the stated rate is not that of the time column, {measured:.6g} Hz",
                file=self.file,
                field="time.rate_hz",
                value=rate,
            )


def _channel_spec(path: Path, name: str, table: object) -> dict[str, Any]:
    section = _Section(path, f"channels.{name}.", table, _CHANNEL_KEYS + _ATTACHMENT_KEYS)
    kind = section.choice("kind", CHANNEL_KINDS)
    dimension, counts = CHANNEL_KINDS[kind]
    columns = section.columns()
    if len(columns) not in counts:
        raise InputError(
            f"a channel of kind '{kind}' cannot have {len(columns)} columns",
            file=path,
            field=section.prefix + "columns",
            value=columns,
            allowed=" or ".join(str(count) for count in counts),
        )
    noise = section.number("noise", None)
    if noise is not None and noise <= 0.0:
        raise InputError("the noise must be positive", file=path, field=section.prefix + "noise", value=noise)
    sign = section.number("sign", 1.0)
    if sign not in (1.0, -1.0):
        raise InputError("unknown sign", file=path, field=section.prefix + "sign", value=sign, allowed="1, -1")
    unwrap = section.flag("unwrap")
    if unwrap and dimension != "angle":
        raise InputError("only an angle can be unwrapped", file=path, field=section.prefix + "unwrap")
    return {
        "columns": columns,
        "kind": kind,
        "unit": section.unit(dimension),
        "noise": noise,
        "sign": sign,
        "offset": section.number("offset", 0.0),
        "unwrap": unwrap,
        "attachment": section.attachment(),
    }


def _drive_spec(path: Path, name: str, table: object) -> dict[str, Any]:
    section = _Section(path, f"drive.{name}.", table, _DRIVE_KEYS)
    value = section.values.get("value")
    if value is None:
        return {"columns": section.columns(), "value": None, "unit": section.unit(None)}
    if "column" in section.values or "columns" in section.values:
        raise InputError("a drive has columns or a value, not both", file=path, field=f"drive.{name}")
    for component in value if isinstance(value, list) and value else [value]:
        section.check_number("value", component)
    return {"columns": [], "value": value, "unit": section.unit(None)}


@dataclass(frozen=True, eq=False)
class _Section:
    """One table of a sidecar; every look-up raises a sentence that names the key."""

    file: Path
    prefix: str
    values: Any
    keys: tuple[str, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.values, dict):
            self._refuse("must be a table", self.prefix.rstrip("."), self.values)
        for key in self.values:
            if key not in self.keys:
                raise InputError(
                    f"unknown key '{key}'", file=self.file, field=self.prefix + key, allowed=", ".join(self.keys)
                )

    def table(self, key: str) -> dict[str, Any]:
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self._refuse("must be a table", self.prefix + key, value)
        return value

    def text(self, key: str, default: str | None) -> str | None:
        value = self.values.get(key, default)
        if value is not None and not (isinstance(value, str) and value):
            self._refuse("must be a text", self.prefix + key, value)
        return value

    def flag(self, key: str) -> bool:
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            self._refuse("must be true or false", self.prefix + key, value)
        return value

    def number(self, key: str, default: float | None) -> Any:
        value = self.values.get(key, default)
        return default if value is None else self.check_number(key, value)

    def check_number(self, key: str, value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < LARGEST_NUMBER:
            self._refuse("must be a finite number", self.prefix + key, value)
        return float(value)  # type: ignore[arg-type]

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

    def columns(self) -> list[str]:
        if ("column" in self.values) == ("columns" in self.values):
            raise InputError(
                "give either 'column' or 'columns'", file=self.file, field=self.prefix + "column", allowed="one of both"
            )
        names = [self.values["column"]] if "column" in self.values else self.values["columns"]
        if not isinstance(names, list) or not names or not all(isinstance(n, str) and n for n in names):
            self._refuse("must name columns", self.prefix + "columns", names)
        if len(set(names)) != len(names):
            self._refuse("must not name a column twice", self.prefix + "columns", names)
        return names

    def attachment(self) -> dict[str, Any]:
        """What the channel observes: at most one of panel, crease, node, and the point on it."""
        found = {key: self.values[key] for key in _ATTACHMENT_KEYS if key in self.values}
        carriers = [key for key in found if key != "point"]
        if len(carriers) > 1:
            self._refuse("observes one thing only", self.prefix.rstrip("."), carriers)
        for key in carriers:
            if isinstance(found[key], bool) or not isinstance(found[key], (int, str)) or found[key] == "":
                self._refuse("must be a name or a number", self.prefix + key, found[key])
        if "point" in found:
            point = found["point"]
            if not isinstance(point, list) or len(point) != 3:
                self._refuse("must be three coordinates in metres", self.prefix + "point", point)
            found["point"] = [self.check_number("point", coordinate) for coordinate in point]
        return found

    def label(self, key: str, column: str) -> str | float:
        value = self.values[key][column]
        if isinstance(value, str):
            return value
        return self.check_number(f"{key}.{column}", value)

    def _refuse(self, fault: str, field: str, value: object) -> None:
        raise InputError(fault, file=self.file, field=field, value=value)
