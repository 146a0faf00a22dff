"""Signals, sources of a field and drives as TOML files state them: designs, and sidecars of recordings.

field_z = "50 mT"                                                   # a number, a quantity, or a wave:
field_z = { ramp = "50 mT", duration = "1 s" }
field_z = { sine = "50 mT", frequency = "2 Hz" }
field_z = { times = [0, 1], values = ["0 mT", "50 mT"] }
sources = [ { coil = { current = "2 A", radius = "50 mm", position = [0, 0, { ramp = "30 mm", duration = 1 }] } } ]
"""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from origami_sim.drive.drive import PATHS, UNITS, Drive, Signal, ramp, series, sine
from origami_sim.drive.sources import STRENGTHS, coil, coil_pair, dipole, field_table, flattened, magnet
from origami_sim.errors import InputError, nearest
from origami_sim.quantities import converted

_WAVES = {"ramp": (ramp, "final"), "sine": (sine, "amplitude")}


@contextmanager
def stated_in(path: Path, said: str, field: str | None = None) -> Iterator[None]:
    """Whatever inside refuses what a file states becomes a sentence that names the file."""
    try:
        yield
    except InputError as e:
        if e.file is not None:
            raise
        raise InputError(str(e), file=path) from None
    except (TypeError, ValueError, IndexError, OverflowError) as e:  # a list where a number belongs, and the like
        raise InputError(f"{said} ({e})", file=path, field=field) from None


def as_table(value: Any, key: str, path: Path) -> dict[str, Any]:
    """A value that has to be a table."""
    if not isinstance(value, dict):
        raise InputError("is a table", file=path, field=key, value=value, allowed="{ name = value, ... }")
    return value


def check_known(name: str, known, field: str, path: Path) -> None:
    """Refuses a name that is none of those known, with the nearest of them."""
    if name not in known:
        raise InputError(
            f"there is no such thing{nearest(name, known)}", file=path, field=field, value=name,
            allowed=", ".join(known),
        )  # fmt: skip


def called(function: Callable, arguments: Any, field: str, path: Path) -> Any:
    """A function with arguments of a file; those that it does not have are refused."""
    given = dict(as_table(arguments, field, path))
    parameters = inspect.signature(function).parameters
    free = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
    listed = next((n for n, p in parameters.items() if p.kind is p.VAR_POSITIONAL), None)
    for name in given:
        if not free:
            check_known(name, parameters, field, path)
    for name, p in parameters.items():
        if p.default is p.empty and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL) and name not in given:
            raise InputError("lacks a value", file=path, field=f"{field}.{name}")
    positional = given.pop(listed, ()) if listed else ()
    try:
        return function(*positional, **given)
    except (TypeError, ValueError, LookupError, AttributeError) as e:  # a value of another type than its own
        if isinstance(e, InputError):
            raise
        raise InputError(f"cannot be stated so ({e})", file=path, field=field, value=arguments) from None


_SOURCES = {"dipole": dipole, "coil": coil, "coil_pair": coil_pair, "magnet": magnet, "table": field_table}


def read_sources(listed: Any, path: Path, *, read: Callable[[Any, str, str, Path], Any] | None = None) -> tuple:
    """The sources of a list [ { coil = { ... } }, ... ], one after the other; tables of fields lie beside the file.

    Args:
        listed: as the file states it. path: the file, named in errors.
        read: what takes a number or a wave, its SI unit, field and file (default: `read_signal`).

    Raises:
        InputError: no list of sources, or what they refuse.
    """
    allowed = "[ { coil = { ... } }, ... ]"
    if not isinstance(listed, list):
        raise InputError("sources are a list", file=path, field="drive.sources", value=listed, allowed=allowed)
    return flattened([_source(entry, n, path, read or read_signal) for n, entry in enumerate(listed, 1)])


def _source(entry: Any, number: int, path: Path, read: Callable[[Any, str, str, Path], Any]) -> Any:
    """One source, or a pair."""
    field = f"drive.sources[{number}]"
    if not isinstance(entry, dict) or len(entry) != 1:
        raise InputError("is no source", file=path, field=field, value=entry, allowed="{ coil = { ... } }")
    kind, arguments = next(iter(entry.items()))
    check_known(kind, _SOURCES, field, path)
    given = dict(as_table(arguments, f"{field}.{kind}", path))
    strength, unit = STRENGTHS.get(kind, ("current", "A"))
    units = {strength: unit, "position": "m", "radius": "m", "length": "m", "axis": "1"}
    for name, unit in units.items():
        if isinstance(given.get(name), list):
            given[name] = [read(v, unit, f"{field}.{name}", path) for v in given[name]]
        elif isinstance(given.get(name), dict):
            given[name] = read(given[name], unit, f"{field}.{name}", path)
    if "file" in given:
        given["table"] = path.parent / str(given.pop("file"))
    return called(_SOURCES[kind], given, f"{field}.{kind}", path)


def read_drive(given: dict[str, Any], path: Path) -> Drive:
    """A drive of the table that has its channels and sources."""
    sources = read_sources(given.get("sources", []), path)
    given = {n: v for n, v in given.items() if n != "sources"}
    groups = [int(n.removeprefix("voltage_")) for n in given if n.removeprefix("voltage_").isdecimal()]
    plain = Drive(voltage=[0.0] * (max(groups, default=0) + 1))
    signals = {}
    for name, value in given.items():
        if name.partition("_")[0] not in PATHS:
            check_known(name, plain.signals, "drive", path)
        signals[name] = read_signal(value, UNITS[name.partition("_")[0]], f"drive.{name}", path)
    return plain.replace(**signals).with_sources(sources)


def read_signal(value: Any, unit: str, field: str, path: Path) -> Any:
    """A number, a quantity or a wave, in SI."""
    if not isinstance(value, dict):
        return converted(value, unit, field)
    for kind, (wave, first) in _WAVES.items():
        if kind in value:
            rest = {n: converted(v, unit, field) if n in ("start", "offset") else v for n, v in value.items()}
            amount = converted(rest.pop(kind), unit, field)
            return called(wave, {first: amount, **rest}, field, path)
    if "times" in value and set(value) <= {"times", "values", "scale", "smooth"}:
        values = converted(value.get("values", []), unit, field)
        return called(series, {**value, "values": values}, field, path)
    whole = {n: converted(v, unit, field) if n in ("offset", "amplitude") else v for n, v in value.items()}
    return called(Signal, whole, field, path)
