"""Results: a run is a folder with a manifest, the states, tables and a replay, written all at once or not at all.

    manifest.json   what was run: versions, seed, scene, hashes, overrides, time step and why, wall time, failures
    states.npz      every frame, and the model, parameters and drive from which the run can be repeated or continued
    device.toml     of runs of the command line, the device with their settings, where a design file holds it
    tables/*.parquet  one file per table; the unit of a column is its field metadata "unit"
    replay.rrd      for the viewer

Nothing is pickled, so a run folder from elsewhere is safe to open.
"""

import json
import os
import platform
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from origami_sim.drive import Drive, Signal
from origami_sim.drive.gridded import FieldTable
from origami_sim.errors import InputError, unwritable
from origami_sim.model import GRIPS, PADS, Model, Parameters, State
from origami_sim.solve.motion.dynamics import Failure, Trajectory
from origami_sim.solve.timestep import TimeStep
from origami_sim.view.film import HasTrajectory, trajectory_of
from origami_sim.view.replay import write_replay

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT = 1
"""Version of the folder's layout; a reader refuses a newer one."""

MANIFEST, STATES, TABLES, REPLAY = "manifest.json", "states.npz", "tables", "replay.rrd"

_PACKAGES = ("origami-sim", "warp-lang", "numpy", "scipy", "rerun-sdk", "pyarrow")
_FRAMES = ("times", "x", "v", "angles", "gaps", "contact_forces")
_SIGNAL = tuple(f.name for f in fields(Signal))
_LATER = (*PADS, *GRIPS, "start")
_MODEL = tuple(
    f.name for f in fields(Model) if f.name not in ("effects", "names", "channels", "panels", "carriers", *_LATER)
)
_REQUIRED = {
    "format": int,
    "scene": str,
    "created": str,
    "versions": dict,
    "model_hash": str,
    "parameters_hash": str,
    "effects": list,
    "names": dict,
    "drive": list,
    "dt": float,
    "time_step": dict,
    "wall": float,
    "failures": list,
    "notes": list,
    "overrides": dict,
    "settings": dict,
}


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run on disk, read back.

    Attributes:
        path: its folder.
        manifest: what was run (see the keys in manifest.json).
        trajectory: all frames, with model, parameters, drive and final state: it can be replayed or continued.
        tables: name -> column -> values. units: column -> unit.
    """

    path: Path
    manifest: dict[str, Any]
    trajectory: Trajectory
    tables: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        tables = f", tables {', '.join(self.tables)}" if self.tables else ""
        return f"<Run of {self.manifest['scene']} in {self.path}: {self.trajectory!r}{tables}>"

    def _repr_html_(self) -> str:
        return self.trajectory._repr_html_()

    def plot(self, *, world: int = 0) -> "Figure":
        """Fold angles, displacement and drive over time, as a Matplotlib figure."""
        return self.trajectory.plot(world=world)

    @property
    def replay(self) -> Path:
        """The file for the viewer; it is missing if the run was saved without one."""
        return self.path / REPLAY


def save_run(
    path: str | Path,
    trajectory: Trajectory | HasTrajectory,
    *,
    scene: str,
    tables: Mapping[str, Mapping[str, Sequence | np.ndarray]] | None = None,
    units: Mapping[str, str] | None = None,
    settings: Mapping[str, Any] | None = None,
    replay: Mapping[str, Any] | bool = True,
) -> Run:
    """Writes a run folder. It appears complete or not at all; an earlier run there is replaced only then.

    Files in an earlier run folder that are not part of a run (notes, pictures) are kept.

    Args:
        path: the folder; its parents are made. trajectory: a motion, or a path of equilibria, a point a second.
        scene: name of what was simulated.
        tables: name -> column -> values, all columns of a table equally long.
        units: column -> unit, for all tables; absent or "" for plain numbers and words.
        settings: JSON values for the manifest; "seed", "overrides" (a mapping) and "device" get keys of their own.
        replay: whether to write the replay too, or options for it (world, magnets, arms, tip, recording, title).

    Raises:
        InputError: the folder cannot be written, is a file or is not a run; a table whose columns differ in length or
            are not numbers or words; settings that are not JSON.
    """
    target, trajectory = Path(path).expanduser().absolute(), trajectory_of(trajectory)
    settings = dict(settings or {})
    manifest = _manifest(trajectory, scene, settings) | {"tables": sorted(tables or {})}
    sheets = {name: _table(name, columns, units or {}) for name, columns in (tables or {}).items()}
    text = _json(manifest, target / MANIFEST)
    with _writing(target):
        _recover(target)
        _check_target(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".tmp", dir=target.parent))
        try:
            work.chmod(0o755)
            with open(work / STATES, "wb") as f:
                np.savez(f, allow_pickle=False, **_arrays(trajectory))
            for name, sheet in sheets.items():
                (work / TABLES).mkdir(exist_ok=True)
                pq.write_table(sheet, (work / TABLES / f"{name}.parquet").absolute())  # 'a:b' alone would be an address
            if replay is not False:
                options = replay if isinstance(replay, Mapping) else {}
                write_replay(work / REPLAY, trajectory, **{"title": scene, **options})
            (work / MANIFEST).write_text(text, encoding="utf-8")
            _exchange(work, target)
        finally:
            shutil.rmtree(work, ignore_errors=True)
    return load_run(target)


def check_writable(path: str | Path):
    """Refuses, before anything is computed, a folder into which `save_run` could not write.

    Raises:
        InputError: it cannot be written, is a file, or holds other things than a run.
    """
    target = Path(path).expanduser().absolute()
    with _writing(target):
        _check_target(target)
        existing = next(p for p in target.parents if p.exists())
        os.rmdir(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".tmp", dir=existing))


def load_run(path: str | Path) -> Run:
    """Reads a run folder.

    Raises:
        InputError: no such folder, a file, not a run folder, a newer format, a damaged or incomplete manifest, states
            or table, an effect or a parameter that this version does not have; it names the file and the field.
    """
    folder = Path(path).expanduser().absolute()
    with suppress(OSError):
        _recover(folder)
    if not folder.is_dir():
        what = "is a file, not a run folder" if folder.exists() else "there is no such run folder"
        raise InputError(what, file=folder, allowed=f"a folder with {MANIFEST} and {STATES}")
    if not (folder / MANIFEST).is_file():
        raise InputError("is not a run folder: there is no manifest", file=folder, allowed=f"a folder with {MANIFEST}")
    manifest = _read_manifest(folder / MANIFEST)
    trajectory = _read_states(folder / STATES, manifest)
    tables, units = {}, {}
    for file in _table_files(folder, manifest):
        try:
            sheet = pq.read_table(file.absolute())
        except (OSError, pa.ArrowException) as e:
            raise InputError(f"is damaged ({_first_line(e)})", file=file, field=file.stem) from None
        tables[file.stem] = {n: sheet[n].to_numpy() for n in sheet.column_names}
        units |= {f.name: f.metadata[b"unit"].decode() for f in sheet.schema if f.metadata and b"unit" in f.metadata}
    return Run(folder, manifest, trajectory, tables, units)


def is_run(path: str | Path) -> bool:
    """Whether a complete run folder of a readable format is there; a sweep that resumes skips these."""
    folder = Path(path).expanduser().absolute()
    try:
        _recover(folder)
        _read_manifest(folder / MANIFEST)
        with zipfile.ZipFile(folder / STATES) as z:  # reads the directory at the end of the file: it is complete
            return "times.npy" in z.namelist()
    except (InputError, OSError, zipfile.BadZipFile):
        return False


def format_table(
    columns: Mapping[str, Sequence | np.ndarray], units: Mapping[str, str] | None = None, *, digits: int = 4
) -> str:
    """A table as plain text: names, units in brackets, a rule, then numbers to `digits` significant digits.

    Numbers are aligned right, words left.

    Raises:
        InputError: columns of different lengths or with more than one axis.
    """
    units = units or {}
    values = _equal_columns("table", columns)
    cells = []
    for name, column in values.items():
        unit = units.get(name, "")
        words = column.dtype.kind not in "fiu"
        body = [str(v) if words or column.dtype.kind in "iu" else f"{v:.{digits}g}" for v in column.tolist()]
        width = max(map(len, (name, f"[{unit}]" if unit else "", *body)))
        align = str.ljust if words else str.rjust
        cells.append([align(t, width) for t in (name, f"[{unit}]" if unit else "", "-" * width, *body)])
    rows = ["  ".join(row).rstrip() for row in zip(*cells, strict=True)]
    if not any(units.get(n) for n in values):
        del rows[1:2]
    return "\n".join(rows)


# what is written ------------------------------------------------------------------------------------------------------


def _manifest(trajectory: Trajectory, scene: str, settings: dict[str, Any]) -> dict[str, Any]:
    t, step = trajectory, trajectory.step
    seed, overrides = settings.pop("seed", None), settings.pop("overrides", {})
    if not isinstance(overrides, Mapping):
        raise InputError("overrides map a name to a value", field="overrides", value=overrides, allowed="a mapping")
    return {
        "format": FORMAT,
        "scene": scene,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **{p: _version(p) for p in _PACKAGES}},
        "seed": seed,
        "overrides": dict(overrides),
        **({"device": settings.pop("device")} if "device" in settings else {}),
        "settings": settings,
        "model_hash": _with_plain_names(t.model).hash,
        "parameters_hash": t.parameters.hash,
        "effects": list(t.model.effects),
        "names": {k: list(v) for k, v in t.model.names.items()},
        "drive": list(t.drive.signals),
        **({"sources": [kind for kind, _ in t.drive.placed]} if t.drive.placed else {}),
        "worlds": t.state.worlds,
        "frames": len(t.times),
        "dt": float(t.dt),
        "dt_reason": str(step),
        "time_step": {"limit": step.limit, "dt": step.dt, "node": step.node, "cause": step.cause},
        "energy_error": t.energy_error,
        "crossing_pairs": t.crossings().tolist(),
        "wall": float(t.wall),
        "steps": t.state.step,
        "failures": [{"world": f.world, "time": f.time, "node": f.node, "cause": f.cause} for f in t.failures],
        "notes": list(t.notes),
        "units": {
            "times": "s",
            "x": "m",
            "v": "m/s",
            "angles": "rad",
            "energies": "J",
            "work": "J",
            "gaps": "m",
            "contact_forces": "N",
        },
    }


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _json(manifest: dict[str, Any], file: Path) -> str:
    out = {}
    for name, value in manifest.items():
        try:
            out[name] = _plain(value)
        except TypeError as e:
            raise InputError(
                f"cannot be kept as JSON ({e})",
                file=file,
                field=name,
                allowed="numbers, words, switches, lists and mappings of them",
            ) from None
    return json.dumps(out, indent=2, allow_nan=False) + "\n"


def _plain(value):
    """The value in JSON's types; infinities and nan, which JSON lacks, as words that float() reads."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, str | int | float):
        return value
    raise TypeError(f"{type(value).__name__} {value!r}")


def _with_plain_names(model: Model) -> Model:
    """The model as it will be read back: names in a dict of tuples, which the hash depends on."""
    return replace(model, names={k: tuple(v) for k, v in model.names.items()})


def _arrays(t: Trajectory) -> dict[str, np.ndarray]:
    out: dict[str, Any] = {n: a for n in (*_FRAMES, "grip_wrenches") if (a := getattr(t, n)) is not None}
    out |= {f"energies.{n}": v for n, v in t.energies.items()} | {f"work.{n}": v for n, v in t.work.items()}
    out |= {f"model.{n}": getattr(t.model, n) for n in (*_MODEL, *_LATER, "channels", "panels", "carriers")}
    out |= {f"parameters.{owner}.{name}": t.parameters[owner, name] for owner, name in t.parameters}
    for channel, signal in t.drive.signals.items():
        out |= {f"drive.{channel}.{n}": v for n in _SIGNAL if (v := getattr(signal, n)) is not None}
    for k, (_, table) in enumerate(t.drive.placed):
        out |= {f"table.{k}.{n}": getattr(table, n) for n in ("x", "y", "z", "values") if table is not None}
    out |= {f"state.{f.name}": getattr(t.state, f.name) for f in fields(State)}
    return {n: np.asarray(v) for n, v in out.items()}


def _equal_columns(name: str, columns: Mapping[str, Sequence | np.ndarray]) -> dict[str, np.ndarray]:
    out = {}
    for column, given in columns.items():
        values = np.asarray(given)
        if values.dtype == object:
            values = np.array([str(v) for v in given])
        if values.ndim != 1:
            rows = "one value per row"
            raise InputError(f"a column of table '{name}' has one axis", field=column, value=values.shape, allowed=rows)
        out[column] = values
    lengths = {c: len(v) for c, v in out.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of table '{name}' differ in length", field=name, value=lengths)
    return out


def _table(name: str, columns: Mapping[str, Sequence | np.ndarray], units: Mapping[str, str]) -> pa.Table:
    if not name or name != Path(name).name or name.startswith("."):
        raise InputError("a table's name is a file name", field="tables", value=name, allowed="letters, digits, -, _")
    arrays = {c: pa.array(v) for c, v in _equal_columns(name, columns).items()}
    return pa.Table.from_arrays(
        list(arrays.values()),
        schema=pa.schema(
            [pa.field(c, a.type, metadata={"unit": units[c]} if units.get(c) else None) for c, a in arrays.items()]
        ),
    )


# the folder -----------------------------------------------------------------------------------------------------------


@contextmanager
def _writing(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as e:
        raise unwritable(e, file=target, allowed="a writable folder") from None


def _check_target(target: Path):
    if target.exists() and not target.is_dir():
        raise InputError("is a file; a run is a folder", file=target, allowed="a new folder, or an earlier run")
    if target.is_dir() and any(target.iterdir()) and _earlier(target) is None:
        raise InputError(
            "is a folder with other things in it, not a run",
            file=target,
            allowed="a new or empty folder, or an earlier run",
        )


def _earlier(folder: Path) -> dict[str, Any] | None:
    """The manifest of a run, however old or damaged the rest of it is; None if it is that of something else."""
    try:
        found = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    ours = isinstance(found, dict) and isinstance(found.get("format"), int) and isinstance(found.get("scene"), str)
    return found if ours else None


def _table_files(folder: Path, manifest: dict[str, Any]) -> list[Path]:
    """Those that the manifest lists; of a run from before it did, every Parquet file."""
    names = manifest.get("tables")
    if not isinstance(names, list):
        return sorted((folder / TABLES).glob("*.parquet"))
    return [folder / TABLES / f"{name}.parquet" for name in names]


def _previous(target: Path) -> Path:
    return target.with_name(f".{target.name}.previous")


def _recover(target: Path):
    """Puts back an earlier run that was set aside by a save that was killed between its two renames."""
    if _previous(target).is_dir() and not target.exists():
        os.replace(_previous(target), target)


def _exchange(work: Path, target: Path):
    """Puts `work` in the place of `target`. Folders cannot be swapped, so there is a moment without either; whoever
    looks next puts the earlier one back."""
    previous = _previous(target)
    if target.is_dir():
        ours = {target / n for n in (MANIFEST, STATES, REPLAY)} | set(_table_files(target, _earlier(target) or {}))

        def left_out(folder: str, names: list[str]) -> list[str]:
            here, new = Path(folder), work / Path(folder).relative_to(target)
            return [n for n in names if here / n in ours or (new / n).is_file()]

        shutil.copytree(target, work, ignore=left_out, symlinks=True, dirs_exist_ok=True)
        with suppress(OSError):  # no table, and nothing of others
            (work / TABLES).rmdir()
        shutil.rmtree(previous, ignore_errors=True)
        os.replace(target, previous)
    try:
        os.replace(work, target)
    except OSError:
        _recover(target)
        raise
    shutil.rmtree(previous, ignore_errors=True)


# what is read ---------------------------------------------------------------------------------------------------------


def _first_line(e: Exception) -> str:
    return (str(e).splitlines() or [type(e).__name__])[0]


def _read_manifest(file: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(file.read_text(encoding="utf-8"))
    except OSError as e:
        raise InputError(f"cannot be read ({e.strerror})", file=file) from None
    except (ValueError, RecursionError) as e:  # JSON and UTF-8, and what is nested deeply
        raise InputError(f"is not valid JSON ({_first_line(e)})", file=file) from None
    if not isinstance(manifest, dict):
        raise InputError("a manifest is a JSON object", file=file, value=type(manifest).__name__)
    for name, kind in _REQUIRED.items():
        value = manifest.get(name)
        if not isinstance(value, kind) and not (kind is float and isinstance(value, int)):
            what = "a field is missing" if value is None else "a field has the wrong type"
            raise InputError(what, file=file, field=name, value=value, allowed=kind.__name__)
    if not 1 <= manifest["format"] <= FORMAT:
        raise InputError(
            "was written by a newer version",
            file=file,
            field="format",
            value=manifest["format"],
            allowed=f"1 to {FORMAT}",
        )
    return manifest


def _read_states(file: Path, manifest: dict[str, Any]) -> Trajectory:
    arrays = _Arrays({}, file)
    try:
        with np.load(file, allow_pickle=False) as data:
            if not isinstance(data, np.lib.npyio.NpzFile):
                raise ValueError("not a zip of arrays")
            for name in data.files:
                arrays.current = name
                arrays.values[name] = data[name]
    except FileNotFoundError:
        raise InputError("is missing", file=file) from None
    except (OSError, ValueError, EOFError, KeyError, AttributeError, RuntimeError, zipfile.BadZipFile, zlib.error) as e:
        raise InputError(f"is damaged ({_first_line(e)})", file=file, field=arrays.current) from None
    try:
        return _trajectory(arrays, manifest)
    except InputError as e:
        if e.file is not None:
            raise
        raise InputError(f"does not fit this version: {e}", file=file) from None
    except (TypeError, ValueError, LookupError, OverflowError) as e:
        raise InputError(f"does not fit its manifest ({_first_line(e)})", file=file) from None


@dataclass
class _Arrays:
    values: dict[str, np.ndarray]
    file: Path
    current: str | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise InputError("an array is missing", file=self.file, field=name)
        return self.values[name]

    def under(self, prefix: str) -> dict[str, np.ndarray]:
        """Arrays whose names begin with `prefix`, by the rest of their names."""
        return {n.removeprefix(prefix): v for n, v in self.values.items() if n.startswith(prefix)}


def _field_table(given: dict[str, np.ndarray]) -> FieldTable | None:
    return FieldTable(given["x"], given["y"], given["z"], given["values"]) if given else None


def _trajectory(arrays: _Arrays, manifest: dict[str, Any]) -> Trajectory:
    given: dict[str, Any] = {n: arrays[f"model.{n}"] for n in _MODEL}
    given["channels"] = int(arrays.values.get("model.channels", 1))
    if "model.carriers" in arrays.values:  # runs with rigid panels have them
        given |= {"panels": str(arrays["model.panels"]), "carriers": arrays["model.carriers"]}
    given |= {n: arrays[f"model.{n}"] for n in _LATER if f"model.{n}" in arrays.values}
    model = _with_plain_names(Model(**given, effects=tuple(manifest["effects"]), names=manifest["names"]))
    parameters = Parameters(model)  # first, because it names an effect that this version lacks
    if model.hash != manifest["model_hash"]:
        raise InputError(
            "is not the model of the manifest beside it",
            file=arrays.file,
            field="model_hash",
            value=model.hash,
            allowed=manifest["model_hash"],
        )
    for key, value in arrays.under("parameters.").items():
        owner, _, name = key.partition(".")
        if owner == "inertia" and model.panels == "rigid":  # corners of rigid panels have no mass of their own
            parameters.replace(owner, name, value)
        else:
            parameters.set(owner, name, value)
    if parameters.hash != manifest["parameters_hash"]:
        raise InputError(
            "has not the parameters of the manifest beside it",
            file=arrays.file,
            field="parameters_hash",
            value=parameters.hash,
            allowed=manifest["parameters_hash"],
        )
    drive = Drive()
    drive.signals = {c: _signal(arrays.under(f"drive.{c}.")) for c in manifest["drive"]}
    tables = [arrays.under(f"table.{k}.") for k in range(len(manifest.get("sources", ())))]
    drive.placed = tuple(zip(manifest.get("sources", ()), (_field_table(t) for t in tables), strict=True))
    frames = {n: arrays[n] for n in _FRAMES}
    count = len(frames["times"])
    energies, work = arrays.under("energies."), arrays.under("work.")
    for name, a in {**frames, **energies, **work}.items():
        if a.ndim < 1 or len(a) != count:
            raise InputError(
                "has another number of frames than times",
                file=arrays.file,
                field=name,
                value=a.shape,
                allowed=f"({count}, ...)",
            )
    shape = (count, len(model.position), arrays["state.x"].shape[1], 3)
    for name in ("x", "v", "contact_forces"):
        if frames[name].shape != shape:
            raise InputError(
                "has the wrong shape",
                file=arrays.file,
                field=name,
                value=frames[name].shape,
                allowed=f"{shape}",
            )
    state: dict[str, Any] = {n: a if n != "step" else int(a) for n, a in arrays.under("state.").items()}
    step = manifest["time_step"]
    return Trajectory(
        model=model,
        parameters=parameters,
        drive=drive,
        **frames,
        energies=energies,
        work=work,
        failures=[Failure(**f) for f in manifest["failures"]],
        dt=float(manifest["dt"]),
        step=TimeStep(float(step["limit"]), float(step["dt"]), int(step["node"]), str(step["cause"])),
        state=State(**state),
        wall=float(manifest["wall"]),
        notes=list(manifest["notes"]),
        energy_error=None if (error := manifest.get("energy_error")) is None else np.array(error, float),
        grip_wrenches=arrays.values.get("grip_wrenches"),
    )


def _signal(values: dict[str, np.ndarray]) -> Signal:
    given: dict[str, Any] = {n: v if v.ndim else float(v) for n, v in values.items()}
    return Signal(**given)
