"""A design file: pattern, sheet, statements and drive of a device in one readable TOML file.

    about = "a magnetic flap"
    pattern = { strip = { lengths = ["10 mm", "20 mm"], width = "20 mm" } }     # or fold = "my.fold", or [pattern]
    sheet = { thickness = "1 mm", material = "pdms" }                           # the arguments of Sheet
    statements = [                                                              # its methods, in order
      { patch = { panel = 1, thickness = "3 mm", poling = [1, 0, 0] } },
      { crease = { stiffness = "2 mN m/rad", loss_time = "3 ms" } },
      { fix = { panels = [0] } },
    ]
    [drive]                                                                     # channels of a Drive
    field_z = { ramp = "50 mT", duration = "1 s" }          # or a number, { sine = ..., frequency = ... },
    sources = [ { coil = { current = "2 A", radius = "50 mm", turns = 100, position = [0, 0, "40 mm"] } } ]
    [run]                                                   # or { times = [...], values = [...] }
    duration = "2 s"

`pattern` may also be vertices, faces and edges, as `write_design` leaves them. Nothing in the file is executed: names
are those of the builders of patterns and of the statements of `Sheet`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim import pattern as patterns
from origami_sim.design.build import Sheet
from origami_sim.drive import CHANNELS, Drive, Signal
from origami_sim.drive.drive_file import as_table, called, check_known, read_drive, stated_in
from origami_sim.drive.sources import NUMBERS, STRENGTHS
from origami_sim.errors import InputError, nearest
from origami_sim.files import read_toml, write_text
from origami_sim.model import Model, Parameters
from origami_sim.model.model_file import model_tables, read_model
from origami_sim.pattern import Pattern, read_pattern
from origami_sim.pattern.assemble import assemble
from origami_sim.quantities import converted

_KEYS = ("about", "pattern", "sheet", "statements", "model", "names", "parameters", "drive", "run")
_BUILDERS: dict[str, Callable[..., Pattern]] = {
    n: getattr(patterns, n) for n in ("strip", "cross", "grid", "miura", "waterbomb", "kresling")
}
_ANGLES = ("gamma", "twist", "fold_angle", "fold_angles", "target_angle")
_EDGES = ("fold_angles", "stiffness", "rest_angles")
_STATEMENTS = (
    *("on", "set", "crease", "yields", "shell", "panel", "patch", "magnetise", "soften", "fix", "name"),
    *("gravity", "body", "mass", "point_mass", "contact", "underside", "feet", "ground", "touch"),
    *("electrode", "hinge", "mitre", "grip"),
)


@dataclass
class Design:
    """A sheet as it was stated, or a model, and what drives it.

    Attributes:
        source: the sheet, or model and parameters.
        duration, rate: of its motion [s], [1/s]; duration 0: as long as the drive takes. about: free text.
        motion: "dynamic" or "quasistatic", the latter held on `until` [s]. accuracy: of a dynamic one, see `simulate`.
    """

    source: Sheet | tuple[Model, Parameters]
    drive: Drive
    duration: float = 0.0
    rate: float = 60.0
    about: str = ""
    motion: str | None = None
    until: float | None = None
    accuracy: float | None = None

    @property
    def sheet(self) -> Sheet:
        """The sheet; InputError where the design is a model."""
        if not isinstance(self.source, Sheet):
            raise InputError("the design is a model, no sheet", field="sheet")
        return self.source


def is_design(path: Path) -> bool:
    """Whether a TOML file states a sheet and its pattern, as calibrations and sidecars do not."""
    try:
        data = read_toml(path)
    except InputError:
        return False
    sheet = data["sheet"] if isinstance(data.get("sheet"), dict) else {}
    model = data["model"] if isinstance(data.get("model"), dict) else {}
    return ("pattern" in data and "thickness" in sheet) or "position" in model


def read_design(path: str | Path) -> Design:
    """Reads a design file.

    Raises:
        InputError: no such file, malformed TOML, an unknown key, pattern or statement, or what those refuse.
    """
    path = Path(path)
    data = read_toml(path)
    for key in data:
        if key not in _KEYS:
            raise InputError(f"unknown key{nearest(key, _KEYS)}", file=path, field=key, allowed=", ".join(_KEYS))
    with stated_in(path, "is no design"):
        source = read_model(data, path) if "model" in data else _sheet(data, path)
        run = as_table(data.get("run", {}), "run", path)
        for key in run:
            check_known(key, ("duration", "rate", "motion", "until", "accuracy"), "run", path)
        lasts = float(converted(run.get("duration", 0.0), "s", "run.duration"))
        rate = float(converted(run.get("rate", 60.0), "Hz", "run.rate"))
        _check_run(lasts, rate)
        if "until" in run and run.get("motion") != "quasistatic":
            allowed = 'motion = "quasistatic" beside it'
            raise InputError(
                "only a quasi-static motion is held on", field="run.until", value=run["until"], allowed=allowed
            )
        return Design(
            source,
            read_drive(as_table(data.get("drive", {}), "drive", path), path),
            lasts,
            rate,
            str(data.get("about", "")),
            run.get("motion"),
            run.get("until") and float(converted(run["until"], "s", "run.until")),
            run.get("accuracy") and float(converted(run["accuracy"], "1", "run.accuracy")),
        )


def _check_run(duration: float, rate: float) -> None:
    """Refuses a duration [s] that is negative, and frames per second that are not positive."""
    if not 0 <= duration < np.inf:
        raise InputError("a run lasts no such time", field="run.duration", value=duration, allowed=">= 0 s")
    if not 0 < rate < np.inf:
        raise InputError("a run needs frames", field="run.rate", value=rate, allowed="> 0 frames per second")


def write_design(
    path: str | Path,
    source: Sheet | tuple[Model, Parameters],
    drive: Drive | None = None,
    *,
    duration: float = 0.0,
    rate: float = 60.0,
    about: str = "",
    motion: str | None = None,
    until: float | None = None,
    accuracy: float | None = None,
) -> Path:
    """Writes a sheet as it was stated, or a model, and its drive, as a file that `read_design` and commands read.

    Quantities stay as they were stated. What was changed in a sheet by other means than its methods is not in the file;
    a model with its parameters is whole.

    Returns:
        The file.

    Raises:
        InputError: a drive or parameters whose worlds differ, a negative duration, a rate that is not positive.
    """
    _check_run(duration, rate)
    lines = [f"about = {_toml(about)}"] if about else []
    if isinstance(source, Sheet):
        given = {n: v for n, v in source.made.items() if v is not None}
        lines += [f"sheet = {_toml(given)}", "statements = ["]
        lines += [f"  {_toml({name: arguments})}," for name, arguments in source.statements]
        lines += ["]"]
    lines += ["", "[run]", f"duration = {_toml(duration)}", f"rate = {_toml(rate)}"]
    how = {"motion": motion, "until": until, "accuracy": accuracy}
    lines += [*(f"{n} = {_toml(v)}" for n, v in how.items() if v is not None), "", "[drive]"]
    drive = drive or Drive()
    signals = {n: s for n, s in drive.signals.items() if not n.startswith("source_")}
    if drive.placed:
        lines += ["sources = [", *(f"  {_toml(s)}," for s in _sources(drive)), "]"]
    for name, s in signals.items():
        if s.worlds > 1:
            raise InputError("a design has one drive", field=name, value=f"{s.worlds} worlds", allowed="one world")
        if not s.is_zero or (name.startswith("voltage_") and len(signals) > len(CHANNELS) + 1):
            lines.append(f"{name} = {_toml(_signal(s))}")
    tables = {"pattern": _pattern_table(source.pattern)} if isinstance(source, Sheet) else model_tables(*source)
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(line for n, v in table.items() for line in _rows(n, v))]
    lines.append("")
    return write_text(path, "\n".join(lines))


# reading --------------------------------------------------------------------------------------------------------------


def _sheet(data: Mapping[str, Any], path: Path) -> Sheet:
    for key in ("pattern", "sheet"):
        if not isinstance(data.get(key), dict):
            raise InputError(f"a design needs a {key}", file=path, field=key, allowed=f"{key} = {{ ... }}")
    if "pattern" in data["sheet"]:
        raise InputError("a pattern is no argument of the sheet", file=path, field="sheet.pattern", allowed="[pattern]")
    sheet = called(Sheet, {"pattern": _pattern(data["pattern"], path), **data["sheet"]}, "sheet", path)
    for number, entry in enumerate(_list(data.get("statements", []), path), 1):
        name, arguments = next(iter(entry.items()))
        check_known(name, _STATEMENTS, f"statements[{number}]", path)
        called(getattr(sheet, name), arguments, f"statements[{number}].{name}", path)
    return sheet


def _list(value: Any, path: Path) -> list[dict[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(v, dict) and len(v) == 1 for v in value):
        raise InputError(
            "statements are a list of a method each",
            file=path,
            field="statements",
            allowed="[ { crease = { stiffness = ... } }, ... ]",
        )
    return value


def _pattern(given: dict[str, Any], path: Path) -> Pattern:
    if "vertices" in given:
        _check_all(given, ("vertices", "faces", "edges", "assignments", *_EDGES, "thickness", "materials"), path)
        edges = given.get("edges")
        listed = {n: np.array(given[n], float) for n in _EDGES if n in given}
        return assemble(
            converted(given["vertices"], "m", "pattern.vertices"),
            [tuple(f) for f in given.get("faces", [])],
            edges=edges,
            assignments=given.get("assignments"),
            thickness=given.get("thickness"),
            materials=[m or None for m in given["materials"]] if "materials" in given else None,
            **listed,
        )
    if "fold" in given:
        _check_all(given, ("fold", "size", "scale"), path)
        lengths = {n: converted(given[n], "m", f"pattern.{n}") for n in ("size", "scale") if n in given}
        return read_pattern(path.parent / str(given["fold"]), **lengths)
    if len(given) != 1:
        raise InputError(
            "a pattern is a builder, a file, or vertices and faces",
            file=path,
            field="pattern",
            value=list(given),
            allowed=", ".join([*_BUILDERS, "fold", "vertices"]),
        )
    name, arguments = next(iter(given.items()))
    check_known(name, _BUILDERS, "pattern", path)
    values = as_table(arguments, f"pattern.{name}", path)
    in_si = {n: converted(v, "rad" if n in _ANGLES else "m", f"pattern.{name}.{n}") for n, v in values.items()}
    return called(_BUILDERS[name], in_si, f"pattern.{name}", path)


def _check_all(given: Mapping[str, Any], known: tuple[str, ...], path: Path) -> None:
    for name in given:
        check_known(name, known, "pattern", path)


# writing --------------------------------------------------------------------------------------------------------------


def _signal(s: Signal) -> Any:
    """A signal as the file states it."""
    if s.times is not None and s.values is not None and not s.is_zero and not np.any(s.amplitude):
        if np.array_equal(s.values, [0, 1, 1]) and s.times[-1] > 1e8:
            start, rise = float(s.offset), float(s.scale)
            return {"ramp": start + rise, "duration": s.times[1], **({"start": start} if start else {})}
        if not np.any(s.offset) and s.slopes is None:
            return {"times": s.times, "values": s.values, **({"scale": s.scale} if s.scale != 1.0 else {})}
    if s.times is None and np.any(s.amplitude):
        rest = {n: getattr(s, n) for n in ("phase", "offset") if np.any(getattr(s, n))}
        return {"sine": s.amplitude, "frequency": s.frequency, **rest}
    if s.times is None:
        return s.offset
    names = ("offset", "amplitude", "frequency", "phase", "times", "values", "scale")
    return {n: getattr(s, n) for n in names} | ({} if s.slopes is None else {"slopes": s.slopes})


def _sources(drive: Drive) -> list[dict[str, Any]]:
    """The sources of a drive as the file states them."""
    out = []
    for k, (kind, table) in enumerate(drive.placed):
        numbers = {n: drive[f"source_{k}_{n}"] for n in NUMBERS}
        if any(s.worlds > 1 for s in numbers.values()):
            raise InputError("a design has one drive", field=f"source {k}", value="several worlds", allowed="one world")
        stated: dict[str, Any] = {STRENGTHS[kind][0]: _signal(numbers["strength"])}
        stated["position"] = [_signal(numbers[n]) for n in "xyz"]
        if kind == "table":
            if table is None or table.file is None:
                raise InputError(
                    "a table of a field needs a file", field=f"source {k}", allowed="FieldTable.write(path)"
                )
            stated["file"] = str(Path(table.file).resolve())
        else:
            stated["axis"] = [_signal(numbers[f"axis_{n}"]) for n in "xyz"]
            stated |= {n: _signal(numbers[n]) for n in ("radius", "length") if kind != "dipole"}
        out.append({kind: stated})
    return out


def _pattern_table(p: Pattern) -> dict[str, Any]:
    out = {"vertices": p.vertices, "faces": p.faces, "edges": p.edges, "assignments": list(p.assignments)}
    out |= {n: getattr(p, n) for n in (*_EDGES, "thickness") if not np.all(np.isnan(getattr(p, n)))}
    return {**out, "materials": [m or "" for m in p.materials]} if any(p.materials) else out


def _rows(name: str, value: Any) -> list[str]:
    """Lines of a key; of an array with two axes a row a line."""
    nested = isinstance(value, (list, np.ndarray)) and len(value) and isinstance(value[0], (list, tuple, np.ndarray))
    return [f"{name} = [", *(f"  {_toml(v)}," for v in value), "]"] if nested else [f"{name} = {_toml(value)}"]


def _toml(value: Any) -> str:
    """A value as TOML text; numbers to the last bit."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in escaped) + '"'
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{k} = {_toml(v)}" for k, v in value.items() if v is not None)
        return f"{{ {inner} }}" if inner else "{}"
    return "[" + ", ".join(_toml(v) for v in value) + "]"
