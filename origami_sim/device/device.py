"""A device is a shipped scene, a Python file with `build()`, an import path, or a design file; all are used alike.

    def build(gap="2 mm", field="50 mT"):      # its arguments are its settings: --set gap=3mm
        ...
        return sheet, Drive(field=(0, 0, ramp(field, 1.0)))

`build` returns a `Sheet` or (model, parameters), alone or with a drive. Beside it a file may state `DURATION` and
`RATE` of its motion, and a `run(settings, progress)` or `replicate(settings, recording, progress)` of its own; a
`build` that takes `Settings` states its `CALIBRATION`, as scenes do.

Nothing is executed but a file or module that the user names: a sidecar only says which device its recording is of.
"""

import importlib
import importlib.util
import inspect
import json
import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.design.design_file import Design, is_design, read_design
from origami_sim.device.begun import begun, filmed
from origami_sim.device.scene import (
    DEVICE,
    NAMES,
    Outcome,
    Progress,
    Setting,
    Settings,
    extended,
    motion_of,
    read_calibration,
    scene_module,
)
from origami_sim.drive import Drive, as_signal
from origami_sim.errors import InputError, nearest
from origami_sim.files import PATTERNS, read_toml
from origami_sim.model import Model, Parameters, State
from origami_sim.quantities import ANY, Quantity, converted, parsed
from origami_sim.recording import Recording, recorded_signals
from origami_sim.recording.placed import surrounded
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.motion.quasistatic import quasistatic
from origami_sim.units import UNITS, spelled

SETTLE = 1.0
"""Seconds that a device is simulated for after its ramps have ended, unless it says how long.

Creases of centimetre devices swing out in some tenths of a second. Half may show them swing, double costs time.
"""

PERIODS = 5
"""Periods of its slowest wave that a device is simulated for, unless it says how long."""

PAST = 1.0
"""Degrees past half a turn by which panels on soft creases may swing without a note: some tenths are elastic.

Half notes what is pressed flat by strong magnets, double lets a panel of 3 cm pass by half a millimetre more.
"""

KEPT = "device.toml"
"""Design file in a run folder, of the device as it was run."""

_LAST = 1e8
"""Instants beyond it [s] stand for ever, as the end of a `ramp` does."""


_WORDS = ("panels", "motion", "accuracy", "effects")
"""What calibrations state beside settings."""


def device_module(given: str) -> ModuleType:
    """The device of a name, as a module with `build(settings)`, `run(settings, progress)` and settings, as scenes are.

    Args:
        given: a scene's name; a Python file, "my_flap.py", or one of its functions, "my_flap.py:half_open"; a module
            that can be imported, "package.module:function"; a design file, "my_flap.toml"; the folder of a run.

    Raises:
        InputError: there is none, it cannot be loaded, or it has no `build`.
    """
    if given in NAMES:
        return scene_module(given)
    place, _, function = given.rpartition(":") if re.search(r":\w+$", given) else (given, "", "")
    path = Path(place)
    if place and path.is_dir() and not function:
        return _run_again(path)
    if path.suffix == ".toml" and not function:
        _refuse_calibration(path)
        return _module(path.stem, path, _designed(read_design(path)), {})
    if path.suffix == ".py":
        if not path.is_file():
            raise InputError("there is no such device file", file=path)
        return _of(_executed(path), path, path.stem, function or "build")
    if function:
        if os.getcwd() not in sys.path:  # a module here is one, after everything installed
            sys.path.append(os.getcwd())
        try:
            found = importlib.import_module(place)
        except (ImportError, ValueError) as e:
            raise InputError(f"the module cannot be imported ({e})", field="device", value=place) from None
        except (Exception, SystemExit) as e:  # the module's own code
            raise InputError(
                f"the module cannot be imported ({type(e).__name__}: {e})", field="device", value=place
            ) from e
        return _of(found, Path(found.__file__ or place), place.rpartition(".")[2], function)
    if path.suffix.lower() in PATTERNS:
        fault = "a crease pattern is no device: it states no thickness, supports or drive"
        raise InputError(
            fault if path.is_file() else "there is no such file",
            field="device",
            value=given,
            allowed=f"origami-sim run {given}, which folds it, or my_flap.py with build(), of "
            f"Sheet(read_pattern('{given}'), thickness='1 mm')",
        )
    beside = f"; '{given}.py' is here, and named with its suffix" if Path(f"{given}.py").is_file() else ""
    raise InputError(
        f"there is no such scene{beside or nearest(given, NAMES)}",
        field="scene",
        value=given,
        allowed=f"{', '.join(NAMES)}, a file such as my_flap.py, or module:function",
    )


def is_device(given: str) -> bool:
    """Whether a name is of a device file, a module's function or a design, not of a scene or a calibration of one."""
    if given.endswith(".toml"):
        return is_design(Path(given))
    if given and given not in NAMES and Path(given).is_dir():
        return True
    return bool(re.search(r"\.py$|:\w+$", given))


def modelled(given: str, calibration: str | None, option: str) -> tuple[str, str | None]:
    """The device and the calibration that a name stands for: of a calibration that names its device, both.

    A patched calibration of a diagnosis names the scene or device file that its settings are of, beside itself.

    Args:
        given: a scene, a device, or a calibration. calibration: that the user gives beside it, or None.
        option: of the command line, such as "--model", in the error.

    Returns:
        What `device_module` takes, and the calibration; as given where it is no calibration or names no device.

    Raises:
        InputError: a device of Python code, which is executed only if the user names it; two calibrations.
    """
    file = Path(given)
    if file.suffix != ".toml" or not file.is_file() or is_design(file):
        return given, calibration
    stated = read_toml(file).get(DEVICE)
    if not isinstance(stated, str):
        return given, calibration
    if calibration is not None:
        fault, allowed = "is a calibration already", f"{option} {stated}, or no --calibration"
        raise InputError(fault, file=file, field="--calibration", value=calibration, allowed=allowed)
    if stated in NAMES:
        return stated, given
    beside = file.parent / stated
    if beside.is_dir() or (stated.endswith(".toml") and is_design(beside)):  # a design, in which nothing is executed
        return os.path.relpath(beside), given
    code = stated if re.search(r"(?<!\.py):\w+$", stated) else os.path.relpath(beside)
    raise InputError(
        "its device is Python code, which is executed only if you name it yourself"
        if re.search(r"\.py$|:\w+$", stated)
        else "its device is neither a scene nor a device file",
        file=file,
        field=DEVICE,
        value=stated,
        allowed=f"{option} {code} --calibration {given}",
    )


def _refuse_calibration(path: Path) -> None:
    """Refuses a file of settings where a device is asked for, and says how to state both."""
    data = {} if not path.is_file() or is_design(path) else read_toml(path)
    named = data.get(DEVICE)
    tables = [t for t in data.values() if isinstance(t, dict)]
    if isinstance(named, str) or any({"value", "unit", "source"} <= set(t) for t in tables):
        device = "my_flap.py, or a scene, with"
        if isinstance(named, str):
            device = named if named in NAMES else os.path.relpath(path.parent / named)
        allowed = f"{device} --calibration {path}"
        raise InputError("is a calibration, not a device", file=path, field=DEVICE, value=named, allowed=allowed)


def _run_again(folder: Path) -> ModuleType:
    """The device of a run, as its folder keeps it, by the name of what was run.

    Raises:
        InputError: it keeps none; with what makes the run again, if its manifest says so.
    """
    made, why, name = "the file of the device, or its name", f"there is no {KEPT} in it", folder.absolute().name
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        name = str(manifest["scene"])
        how, sets = manifest["device"], "".join(f" --set {n}={v}" for n, v in manifest["overrides"].items())
        asked = [f"--{n} {how[n]}" for n in ("panels", "until", "accuracy", "calibration") if how[n] is not None]
        asked += ["--quasistatic"] * (how["motion"] == "quasistatic")
        made, why = " ".join([f"origami-sim run {how['given']}{sets}", *asked]), how["why"] or "it lost its device"
    except (OSError, ValueError, LookupError, TypeError, AttributeError):  # no run, one of another kind, or damaged
        pass
    file = folder / KEPT
    if not file.is_file():
        raise InputError(f"the folder does not make its run again ({why})", file=folder, allowed=made)
    return _module(name, file, _designed(read_design(file)), {})


def _executed(path: Path) -> ModuleType:
    """The module of a file, which is executed once for each state of it."""
    name = f"_device_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    folder = str(path.resolve().parent)
    if folder not in sys.path:  # for what lies beside it, after everything installed
        sys.path.append(folder)
    try:
        spec.loader.exec_module(module)
    except InputError:
        raise
    except (Exception, SystemExit) as e:
        raise InputError(f"the device cannot be loaded: {_where(e, path)}", file=path) from e
    return module


def _where(error: BaseException, path: Path) -> str:
    """What went wrong in a user's file, and in which line of it."""
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).resolve() == path.resolve():
            line = trace.tb_lineno
        trace = trace.tb_next
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {message}" + (f", line {line}" if line else "")


def _of(found: ModuleType, path: Path, name: str, function: str) -> ModuleType:
    build = getattr(found, function, None)
    if not callable(build):
        known = [n for n, f in vars(found).items() if inspect.isfunction(f) and f.__module__ == found.__name__]
        raise InputError(
            f"the file defines no {function}(){nearest(function, known)}",
            file=path,
            field=function,
            allowed="a function that returns a Sheet, or (model, parameters, drive)",
        )
    return _module(name, path, build, vars(found))


def _module(name: str, path: Path, build: Callable, own: Mapping[str, Any]) -> ModuleType:
    """A module as those of scenes, of what a device's file states."""
    out: Any = ModuleType(name.replace(".", "_"), own.get("__doc__") or build.__doc__)
    out.__file__, out.given = str(path), build
    if "CALIBRATION" in own:
        beside = path.parent / str(own["CALIBRATION"])
        out.SETTINGS = read_calibration(beside if beside.is_file() else own["CALIBRATION"])

        def raw(s: Settings, **options):
            return _parts(build(s, **options))

    else:
        out.SETTINGS, defaults = _settings(build, path, own)
        if stated := getattr(build, "stated", None):
            how = {"motion": stated.motion, "until": stated.until, "accuracy": stated.accuracy}
            out.SETTINGS = Settings([*out.SETTINGS.values()], path, **how)

        def raw(s: Settings, **options):
            given = {n: _as(s[n].value, d, n, path) for n, d in defaults.items()}
            return _parts(build(**{**given, **options}))

    def whole(s: Settings, **options):
        try:
            parts = raw(s, **options)
            out.noted = parts[0].unused_targets() if parts and isinstance(parts[0], Sheet) else []
            return built(tuple(parts), path)
        except InputError as e:
            raise e if e.file is not None else InputError(str(e), file=path) from None
        except (Exception, SystemExit) as e:
            raise InputError(f"build() fails: {_where(e, path)}", file=path) from e

    def timed(s: Settings, model: Model, parameters: Parameters, drive: Drive, **options) -> Trajectory:
        duration = float(s.duration) if "duration" in s and s.duration else lasting(drive)
        return motion_of(s, model, parameters, drive, duration=duration, rate=_rate(s), **options)

    def run(s: Settings, progress: Progress | None = None) -> Outcome:
        model, parameters, drive, *_ = out.build(s)
        motion = timed(s, model, parameters, drive, progress=progress)
        motion.notes += out.noted
        return outcome_of(motion)

    def replicate(s: Settings, recording: Recording, progress: Progress | None = None) -> tuple[Trajectory, Settings]:
        """What was recorded, from where it begins, in the drive that was recorded over the device's own."""
        model, parameters, drive, *_ = out.build(s)
        told = {n: as_signal(v, name=n) for n, v in recorded_signals(recording).items()}
        told = {n: v for n, v in told.items() if n in drive.signals or not v.is_zero}  # of what a device lacks: nothing
        drive = surrounded(drive, recording).replace(**told)
        s = s.with_motion(recording.motion or s.motion)
        if s.motion == "quasistatic":
            rested = recording.start is not None and recording.start.state == "equilibrium"
            times, before = recording.times - recording.times[0], drive.held(0.0) if rested else None
            return quasistatic(model, parameters, drive, times, before=before, progress=progress), s

        def roll(state: State | None, part: Recording, told: Progress | None = None) -> Trajectory:
            (duration, rate), worlds = filmed(part), 1 if state is None else state.worlds
            each = Parameters.join([parameters], repeat=worlds)
            return motion_of(s, model, each, drive, duration=duration, rate=rate, progress=told, state=state)

        return roll(begun(model, parameters, drive, recording, roll), recording, progress), s

    out.raw, out.build = raw, extended(whole)
    out.run, out.own_run = own.get("run", run), "run" in own
    out.replicate = own.get("replicate", replicate)
    for optional in ("draw", "walk", "SERIES"):
        if optional in own:
            setattr(out, optional, own[optional])
    return out


def _rate(s: Settings) -> float:
    return float(s.rate) if "rate" in s else 60.0


def _settings(build: Callable, path: Path, own: Mapping[str, Any]) -> tuple[Settings, dict[str, Any]]:
    """The settings that the arguments of a `build` are, and their defaults."""
    settings, defaults = [], {}
    meaning = _meanings(build)
    for name, p in inspect.signature(build).parameters.items():
        if p.kind in (p.VAR_KEYWORD, p.VAR_POSITIONAL):
            continue
        if p.default is p.empty:
            raise InputError(
                "an argument of build() needs a default, which is its setting",
                file=path,
                field=name,
                allowed=f'def build({name}="2 mm"), or a CALIBRATION beside it',
            )
        if name in _WORDS:
            raise InputError(
                "this word has a meaning in calibrations", file=path, field=name, allowed="another name of the argument"
            )
        if isinstance(p.default, int) and abs(p.default) > sys.float_info.max:
            raise InputError("a default is too large", file=path, field=name, allowed="below 1e308")
        value, unit = valued(p.default)
        if value is not None:
            defaults[name] = p.default
            means = meaning.get(name, "an argument of build()")
            settings.append(Setting(name, value, _unit_said(means) if unit == ANY else unit, path.name, means))
    run = {"duration": ("s", own.get("DURATION", 0.0), "of the motion; 0: as long as the drive takes"),
           "rate": ("Hz", own.get("RATE", 60.0), "frames per second")}  # fmt: skip
    for name, (unit, value, what) in run.items():
        if name not in defaults:
            settings.append(Setting(name, float(converted(value, unit, name.upper())), unit, path.name, what))
    return Settings(settings, path), defaults


def valued(default: Any) -> tuple[float | str | bool | None, str]:
    """Value and SI unit of an argument's default; None for what no setting can be."""
    if isinstance(default, bool):
        return default, ""
    if isinstance(default, Quantity):
        return float(default), default.unit
    if isinstance(default, (int, float, np.number)):
        return float(default), "1" if isinstance(default, (int, np.integer)) else ANY
    if isinstance(default, str):
        try:
            number = parsed(default)
        except InputError:
            return default, ""
        return float(number), number.unit
    return None, ""


def _unit_said(meaning: str) -> str:
    """The SI unit in brackets that a meaning states of a number without one, "of the magnet [A m^2]"."""
    said = spelled("".join(re.findall(r"\[([^\[\]]+)\]", meaning)[-1:]))
    return said if any(said == next(iter(group)) for group in UNITS.values()) else ANY


def _as(value: Any, default: Any, name: str, path: Path) -> Any:
    """A setting as the argument that it was: a whole number stays one."""
    if isinstance(default, bool) or isinstance(value, str):
        return value
    if isinstance(default, int):
        if value != round(value):
            raise InputError("must be a whole number", file=path, field=name, value=value)
        return round(value)
    return value


def _meanings(build: Callable) -> dict[str, str]:
    """What the docstring of a function says of its arguments, "name: meaning." in the lines after "Args:"."""
    _, _, text = (inspect.getdoc(build) or "").partition("Args:")
    found = re.findall(r"(\w+): (.+?)(?=[.;]? +\w+: |[.;]?$)", " ".join(text.split("\n\n")[0].split()))
    return {name: meaning.rstrip(".") for name, meaning in found}


def _designed(design: Design) -> Callable:
    def build(duration: float = design.duration, rate: float = design.rate):
        source = design.source
        return (source, design.drive) if isinstance(source, Sheet) else (*source, design.drive)

    build.__doc__ = design.about or None
    build.stated = design  # type: ignore[attr-defined]
    return build


def _parts(given: Any) -> list:
    """What a `build` returned, one by one."""
    parts = list(given) if isinstance(given, tuple) else [given]
    if parts and isinstance(parts[0], Design):
        source = parts[0].source
        parts[:1] = [*((source,) if isinstance(source, Sheet) else source), parts[0].drive]
    return parts


def built(given: Any, path: str | Path) -> tuple:
    """Model, parameters, drive and whatever follows, of what a `build` returned.

    Raises:
        InputError: naming the file, it returned something else.
    """
    parts = _parts(given)
    if parts and isinstance(parts[0], Sheet):
        parts[:1] = parts[0].build()
    right = len(parts) > 1 and isinstance(parts[0], Model) and isinstance(parts[1], Parameters)
    if not right or (len(parts) > 2 and not isinstance(parts[2], Drive)):
        raise InputError(
            "build() returns something else",
            file=path,
            field="build",
            value=", ".join(type(p).__name__ for p in parts),
            allowed="Sheet; Sheet, Drive; Model, Parameters; Model, Parameters, Drive",
        )
    if len(parts) == 2:
        assert isinstance(parts[0], Model)
        parts.append(Drive(voltage=[0.0] * (int(parts[0].electrodes.max(initial=0)) + 1)))
    return tuple(parts)


def source_of(module: ModuleType, settings: Settings) -> Sheet | tuple[Model, Parameters]:
    """What a design file of a device holds: its sheet, as it was stated, or its model and parameters."""
    first = module.raw(settings)[0] if hasattr(module, "raw") else None
    if isinstance(first, Sheet) and not settings.effects and settings.panels is None:
        return first
    model, parameters, *_ = module.build(settings)
    return model, parameters


def lasting(drive: Drive) -> float:
    """Seconds that a drive takes: its ramps and SETTLE, or PERIODS of its slowest wave."""
    ends, periods = [0.0], [0.0]
    for s in drive.signals.values():
        if s.times is not None:
            ends.append(float(np.max(s.times[s.times < _LAST], initial=0.0)))
        moving = (np.asarray(s.frequency) != 0) & (np.asarray(s.amplitude) != 0)
        if np.any(moving):
            periods.append(float(1.0 / np.min(np.broadcast_to(np.abs(s.frequency), moving.shape)[moving])))
    return max(max(ends) + SETTLE, PERIODS * max(periods))


def outcome_of(motion: Trajectory) -> Outcome:
    """What any device shows of a motion: the fold angles of its creases, and where it went if it has a ground."""
    model, angles = motion.model, np.degrees(motion.creases[:, :, 0])
    tables: dict[str, dict[str, np.ndarray | list]] = {}
    summary, numbers = [], {"duration_s": float(motion.times[-1])}
    if angles.shape[1]:
        names = [model.name("crease", c) for c in range(angles.shape[1])]
        far = angles[np.abs(angles - angles[0]).argmax(axis=0), np.arange(len(names))]
        tables["creases"] = {"crease": names, "start_deg": angles[0], "furthest_deg": far, "end_deg": angles[-1]}
        when, most = np.unravel_index(np.abs(angles - angles[0]).argmax(), angles.shape)
        turn, at = float(angles[when, most] - angles[0, most]), float(motion.times[when])
        left = float(angles[-1, most] - angles[0, most])
        numbers |= {"largest_turn_deg": turn, "largest_turn_at_s": at, "left_turn_deg": left}
        end = "the end" if when == len(angles) - 1 else f"t = {at:.3g} s; {left:z.2f} deg are left at the end"
        summary.append(f"{names[most]} turns the furthest, by {turn:z.2f} deg at {end}")
        past = int(np.abs(far).argmax())
        if abs(far[past]) > 180.0 + PAST:
            summary.append(
                f"{names[past]} turns past half a turn, to {far[past]:.1f} deg: panels that do not lie beside each "
                "other have passed through; Sheet.touch(False) lets them, and Sheet.ground() holds them from below."
            )
    for name in model.names.get("grip", ()) if motion.grip_wrenches is not None else ():
        load, turns = motion.grip_load(name)[:, 0], f"turn_{name}" in motion.drive.signals
        if np.all(np.isfinite(load)):
            unit = "N m" if turns else "N"
            numbers |= {f"{name}_least_load": float(load.min()), f"{name}_largest_load": float(load.max())}
            summary.append(f"{name} exerts {load.min():.3g} to {load.max():.3g} {unit} along its path")
    if len(model.contacts) and "ground" in model.laws:
        went = (motion.centre_of_mass()[-1, 0] - motion.centre_of_mass()[0, 0]) * 1e3
        numbers |= {f"moved_{a}_mm": float(v) for a, v in zip("xyz", went, strict=True)}
        summary.append(f"its centre of mass moves by ({went[0]:.2f}, {went[1]:.2f}, {went[2]:.2f}) mm")
    return Outcome(motion, tables, summary=summary, numbers=numbers)
