"""What a calibration found: values with unit, interval and provenance, in the schema of the calibration files."""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.files import read_toml
from origami_sim.pattern.files import write_atomic
from origami_sim.units import UNITS

COMMAND = "command"
"""Name of the setting that holds the command which re-creates the file."""

_SI = {next(iter(units)) for units in UNITS.values()} | {
    "",
    "N m/rad",
    "N m s/rad",
    "N/m",
    "kg",
    "kg m^2",
    "kg/m^3",
    "m^2",
    "1/s",
    "1/s^2",
    "1/m",
    "1/T",
    "V/m",
    "Hz",
    "rad/s",
    "F/m",
}
"""SI units that a result may state."""

_KNOT = re.compile(r"(.+)_(\d{2})")


@dataclass(frozen=True)
class Quantity:
    """One result.

    Attributes:
        name: of the setting, as the effects and scenes call it.
        value: number [SI], word, switch, or (n,) numbers of a table.
        unit: SI unit; "1" for ratios, "" for words and switches.
        meaning: what it is. source: where it comes from.
        interval: (low, high) [SI] of the confidence stated in `source`; (n, 2) for a table; None where there is none.
            An end may be infinite where the curve does not bound the value.
        range: (low, high) [SI] within which a user may override the value; None for no limit.
    """

    name: str
    value: float | str | bool | tuple[float, ...]
    unit: str
    meaning: str
    source: str
    interval: tuple[float, float] | tuple[tuple[float, float], ...] | None = None
    range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Calibration:
    """A calibration.

    Attributes:
        title: first line of the file. command: command line that re-creates it. quantities: what was found.
        warnings: sentences on what the data cannot tell; written as comments.
    """

    title: str
    command: str
    quantities: tuple[Quantity, ...]
    warnings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Quantity:
        """The quantity of that name; raises InputError naming the others."""
        for q in self.quantities:
            if q.name == name:
                return q
        known = ", ".join(q.name for q in self.quantities)
        raise InputError("there is no such result", field="name", value=name, allowed=known)

    def __contains__(self, name: str) -> bool:
        return any(q.name == name for q in self.quantities)


def write_calibration(path: str | Path, result: Calibration) -> Path:
    """Writes a calibration as TOML, whole or not at all; `scene.read_calibration` and `read_result` read it back.

    A table of n numbers becomes n settings NAME_00, NAME_01, ... The interval is the setting's `uncertainty`, two
    numbers [low, high]. The command is the setting `command`.

    Returns:
        The path written.

    Raises:
        InputError: not a .toml path, a name twice or malformed, an unknown unit, a value that is not finite, an
            interval that does not contain its value, no command.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise InputError("a calibration is a TOML file", field="path", value=str(path), allowed="NAME.toml")
    if not result.command.strip():
        raise InputError("a calibration needs the command that re-creates it", file=path, field=COMMAND)
    if not result.quantities:
        raise InputError("a calibration needs at least one value", file=path)
    lines = [f"# {_line(result.title)}", *(f"# Warning: {_line(w)}" for w in result.warnings)]
    seen = {COMMAND}
    for q in result.quantities:
        _check(q, path)
        for item in _flat(q):
            if item.name in seen:
                raise InputError("this name stands twice", file=path, field=item.name)
            seen.add(item.name)
            lines += ["", f"[{item.name}]", f"value = {_toml(item.value)}", f"unit = {_toml(item.unit)}"]
            if item.range is not None:
                lines.append(f"range = {_toml(item.range)}")
            if item.interval is not None:
                lines.append(f"uncertainty = {_toml(item.interval)}")
            lines += [f"source = {_toml(item.source)}", f"meaning = {_toml(item.meaning)}"]
    lines += ["", f"[{COMMAND}]", f"value = {_toml(result.command)}", 'unit = ""', 'source = "this calibration"']
    lines += ['meaning = "command line that re-creates this file"', ""]
    write_atomic(path, "\n".join(lines).encode())
    return path


def read_result(path: str | Path) -> Calibration:
    """Reads a calibration written by `write_calibration`, with its intervals, tables and warnings.

    Raises:
        InputError: whatever `scene.read_calibration` refuses; no command; a malformed uncertainty.
    """
    settings = read_calibration(path)
    text = settings.file.read_text()
    data = read_toml(settings.file)
    if COMMAND not in settings:
        raise InputError(
            "has no command that re-creates it", file=settings.file, field=COMMAND, allowed="a written calibration"
        )
    flat = []
    for name, s in settings.items():
        if name == COMMAND:
            continue
        given = data[name].get("uncertainty")
        if given is not None and not (isinstance(given, list) and len(given) == 2):
            raise InputError(
                "an uncertainty is two numbers", file=settings.file, field=name, value=given, allowed="[low, high]"
            )
        interval = None if given is None else (float(given[0]), float(given[1]))
        flat.append(Quantity(name, s.value, s.unit, s.meaning, s.source, interval, s.range))
    head = [line[2:] for line in text.splitlines() if line.startswith("# ")]
    warnings = tuple(h.removeprefix("Warning: ") for h in head if h.startswith("Warning: "))
    title = head[0] if head and not head[0].startswith("Warning: ") else ""
    return Calibration(title, settings.as_dict()[COMMAND], tuple(_folded(flat)), warnings)


def table(settings, name: str) -> np.ndarray:
    """(n,) the table NAME_00, NAME_01, ... of a calibration read by `scene.read_calibration` [SI].

    Raises:
        InputError: there is no such table, or a knot is missing.
    """
    found = {int(m[2]): n for n in settings if (m := _KNOT.fullmatch(n)) and m[1] == name}
    if len(found) < 2 or sorted(found) != list(range(len(found))):
        raise InputError("there is no such table", file=settings.file, field=name, allowed=f"{name}_00, {name}_01, ...")
    return np.array([settings[found[k]].value for k in range(len(found))])


def significant(value: float, interval: tuple[float, float] | None) -> str:
    """A number rounded to its uncertainty, e.g. '0.0213 (0.0209 to 0.0218)'."""
    if interval is None or not all(map(math.isfinite, interval)) or interval[1] <= interval[0]:
        text = f"{value:.4g}"
        return text if interval is None else f"{text} ({interval[0]:.3g} to {interval[1]:.3g})"
    digits = 1 - math.floor(math.log10((interval[1] - interval[0]) / 4))
    leading = math.floor(math.log10(max(abs(value), abs(interval[0]), abs(interval[1]))))
    figures = max(digits + leading, 0) + 1
    return f"{value:.{figures}g} ({interval[0]:.{figures}g} to {interval[1]:.{figures}g})"


def _flat(q: Quantity) -> Sequence[Quantity]:
    if not isinstance(q.value, tuple):
        return [q]
    intervals: Any = q.interval or (None,) * len(q.value)
    return [
        Quantity(f"{q.name}_{k:02d}", v, q.unit, f"{q.meaning}, knot {k} of {len(q.value)}", q.source, i, q.range)
        for k, (v, i) in enumerate(zip(q.value, intervals, strict=True))
    ]


def _folded(flat: Sequence[Quantity]) -> list[Quantity]:
    groups: dict[str, list[Quantity]] = {}
    for q in flat:
        match = _KNOT.fullmatch(q.name)
        groups.setdefault(match[1] if match else q.name, []).append(q)
    out = []
    for name, members in groups.items():
        expected = [f"{name}_{k:02d}" for k in range(len(members))]
        if len(members) < 2 or [m.name for m in members] != expected:
            out += members
            continue
        first = members[0]
        intervals: Any = tuple(m.interval for m in members)
        values: Any = tuple(m.value for m in members)
        out.append(
            Quantity(
                name,
                values,
                first.unit,
                first.meaning.removesuffix(f", knot 0 of {len(members)}"),
                first.source,
                None if None in intervals else intervals,
                first.range,
            )
        )
    return out


def _check(q: Quantity, path: Path) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", q.name):
        raise InputError("not a setting's name", file=path, field=q.name, allowed="lower-case letters, digits and _")
    if q.unit not in _SI:
        raise InputError("not an SI unit", file=path, field=q.name, value=q.unit, allowed=", ".join(sorted(_SI - {""})))
    numeric = not isinstance(q.value, (str, bool))
    if numeric and not q.unit:
        raise InputError("the unit of a number is missing", file=path, field=q.name, allowed="an SI unit, or '1'")
    if not numeric and q.interval is not None:
        raise InputError("a word has no interval", file=path, field=q.name, value=q.value)
    if not q.source.strip() or not q.meaning.strip():
        raise InputError("a value needs its source and its meaning", file=path, field=q.name)
    if isinstance(q.value, tuple):
        if not 2 <= len(q.value) <= 100:
            raise InputError("a table has 2 to 100 numbers", file=path, field=q.name, value=len(q.value))
        if q.interval is not None and len(q.interval) != len(q.value):
            raise InputError(
                "a table needs one interval per number", file=path, field=q.name, value=len(q.interval),
                allowed=str(len(q.value)),
            )  # fmt: skip
    item: Any
    for item in _flat(q):
        if numeric and not math.isfinite(item.value):
            raise InputError("not a finite number", file=path, field=item.name, value=item.value)
        if item.interval is not None and not item.interval[0] <= item.value <= item.interval[1]:
            raise InputError(
                "the interval does not contain the value", file=path, field=item.name, value=item.value,
                allowed=f"{item.interval[0]:g} to {item.interval[1]:g}",
            )  # fmt: skip


def _line(text: str) -> str:
    return " ".join(text.split())


def _toml(value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(_toml(float(v)) for v in value) + "]"
    return repr(float(value))
