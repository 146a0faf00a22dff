"""Scenes: a device with its calibration, what it computes and the table that it prints."""

import functools
import importlib
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError, nearest
from origami_sim.files import read_toml
from origami_sim.model import Model, Parameters, State
from origami_sim.model.bodies import rigid
from origami_sim.quantities import ANY, parsed
from origami_sim.solve.motion.accuracy import check_accuracy
from origami_sim.solve.motion.dynamics import Trajectory, simulate
from origami_sim.solve.motion.frames import check_frames, check_memory
from origami_sim.solve.motion.quasistatic import quasistatic
from origami_sim.solve.statics.equilibria import equilibrium
from origami_sim.units import of_unit

if TYPE_CHECKING:
    from origami_sim.recording import Recording
    from origami_sim.report.patch import Addition

NAMES: tuple[str, ...] = importlib.import_module("origami_sim.scenes").NAMES
"""The scenes that ship with the package."""

DEVICE = "device"
"""Word of a calibration that says of which scene or device file its settings are."""

_KEYS = {"value", "unit", "range", "choices", "source", "meaning", "uncertainty"}
_BESIDE_STATICS = {
    "mode", "frequency", "loss_time", "decay_rate", "membrane_damping", "cells", "hinges", "motion_cells",
    "motion_hinges", "twist",
}  # fmt: skip


@dataclass(frozen=True)
class Setting:
    """One number (or word) of a calibration: SI value, unit, where it comes from and how far it may vary.

    `uncertainty` is the 95 % interval in which the value was known to lie; None if it is taken as given.
    """

    name: str
    value: float | str | bool
    unit: str
    source: str
    meaning: str
    range: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    uncertainty: tuple[float, float] | None = None


class Settings(Mapping[str, Setting]):
    """The settings of a calibration; values are attributes: settings.gap."""

    def __init__(
        self,
        settings: Sequence[Setting],
        file: Path,
        effects: "Sequence[Addition]" = (),
        panels: str | None = None,
        motion: str | None = None,
        until: float | None = None,
        accuracy: float | None = None,
    ):
        self._settings = {s.name: s for s in settings}
        self.file, self.panels, self.motion, self.until = file, panels, motion, until
        self.effects = tuple(effects)
        """Effects that the calibration adds to those of the scene."""
        self.accuracy = accuracy if accuracy is None else check_accuracy(accuracy, file)
        """Accuracy of the scene's motion (see `simulate`); None: with the default step."""
        if panels not in (None, "elastic", "rigid"):
            raise InputError("no such panels", file=file, field="panels", value=panels, allowed="elastic, rigid")
        if motion not in (None, "dynamic", "quasistatic"):
            raise InputError("no such motion", file=file, field="motion", value=motion, allowed="dynamic, quasistatic")
        if until is not None and not (motion == "quasistatic" and until > 0 and np.isfinite(until)):
            raise InputError(
                "only a quasi-static motion is held on", field="until", value=until, allowed="> 0 s, and --quasistatic"
            )

    def _with(self, settings: Sequence[Setting] | None = None, **changes) -> "Settings":
        kept = {n: getattr(self, n) for n in ("file", "effects", "panels", "motion", "until", "accuracy")}
        return Settings(list(self.values()) if settings is None else settings, **{**kept, **changes})

    def __getitem__(self, name: str) -> Setting:
        return self._settings[name]

    def __iter__(self):
        return iter(self._settings)

    def __len__(self):
        return len(self._settings)

    def __getattr__(self, name: str):
        try:
            return self.__dict__["_settings"][name].value
        except KeyError:
            raise AttributeError(name) from None

    def replace(self, **values) -> "Settings":
        """A copy with other values (SI), checked against their ranges."""
        out = []
        for s in self._settings.values():
            out.append(
                _checked(Setting(**{**s.__dict__, "value": values.pop(s.name)}), self.file) if s.name in values else s
            )
        for name in values:
            raise InputError("there is no such setting", file=self.file, field=name, allowed=", ".join(self._settings))
        return self._with(out)

    @property
    def how(self) -> dict[str, Any]:
        """How it moves, as a design file keeps it."""
        return {"motion": self.motion, "until": self.until, "accuracy": self.accuracy}

    def with_panels(self, panels: str | None) -> "Settings":
        """A copy for a device with "rigid" or "elastic" panels (None: as the scene builds them)."""
        return self._with(panels=panels)

    def with_motion(self, motion: str | None, until: float | None = None) -> "Settings":
        """A copy for a "dynamic" or "quasistatic" motion (None: dynamic), the latter held on `until` [s]."""
        return self._with(motion=motion, until=until)

    def with_accuracy(self, accuracy: float | None) -> "Settings":
        """A copy of which the motion is simulated to an accuracy (None: with the default step)."""
        return self._with(accuracy=accuracy if accuracy is None else check_accuracy(accuracy))

    def override(self, assignments: Sequence[str], source: str | Path | None = None) -> "Settings":
        """A copy with `name=value` assignments applied; a value may carry a unit (gap=2.54mm), else it is SI.

        Errors name the `source` of the assignments (default: the file of the settings).
        """
        if source is not None:
            changed = self._with(file=Path(source)).override(assignments)
            return self._with(list(changed.values()))
        values = {}
        for text in assignments:
            name, equals, given = (part.strip() for part in text.partition("="))
            if not equals or name not in self._settings:
                near = "" if name in self._settings else nearest(name, self._settings)
                raise InputError(
                    f"cannot apply this setting{near}",
                    file=self.file,
                    field=name,
                    value=text,
                    allowed="name=value with name one of " + ", ".join(self._settings),
                )
            values[name] = _parse(self._settings[name], given, self.file)
        return self.replace(**values)

    def as_dict(self) -> dict:
        return {n: s.value for n, s in self._settings.items()}


def _parse(setting: Setting, text: str, file: Path | None):
    if isinstance(setting.value, bool):
        if text.lower() not in ("true", "false"):
            raise InputError("not a switch", file=file, field=setting.name, value=text, allowed="true, false")
        return text.lower() == "true"
    if isinstance(setting.value, str):
        return text
    return float(parsed(text, setting.unit, file=file, field=setting.name))


def _checked(s: Setting, file: Path) -> Setting:
    if s.choices and s.value not in s.choices:
        raise InputError("not one of the choices", file=file, field=s.name, value=s.value, allowed=", ".join(s.choices))
    if isinstance(s.value, (int, float)) and not isinstance(s.value, bool):
        if not np.isfinite(s.value):
            raise InputError("not a finite number", file=file, field=s.name, value=s.value)
        if s.range and not s.range[0] <= s.value <= s.range[1]:
            raise InputError(
                "out of its range",
                file=file,
                field=s.name,
                value=s.value,
                allowed=of_unit(f"{s.range[0]:g} to {s.range[1]:g}", s.unit),
            )
    return s


def read_calibration(source: str | Path) -> Settings:
    """Reads a calibration: a TOML file, or the name of one that ships with the package.

    Every table is one setting with `value`, `unit` (SI; "" for words), `source`, `meaning` and optionally `range`,
    `choices` and `uncertainty`. The table `effects` adds effects to those of the scene (see `diagnose.patch`), and the
    words `panels` ("rigid", "elastic") and `motion` ("dynamic", "quasistatic") say how it moves, the number `accuracy`
    how accurately (see `simulate`). The word `device` says of which scene or device file the settings are (see
    `device.modelled`).

    Raises:
        InputError: no such file, malformed TOML, a missing or unknown key, a value outside its range, an effect or a
            parameter that is not in the catalogue.
    """
    path = Path(source)
    if re.fullmatch(r"\w+", str(source)):
        path = Path(str(resources.files("origami_sim.calibrations") / f"{source}.toml"))
    data = read_toml(path)
    additions: Sequence[Addition] = ()
    if "effects" in data:
        from origami_sim.report.patch import read_additions

        additions = read_additions(data.pop("effects"), path)
    given = {word: data.pop(word, None) for word in ("panels", "motion", "accuracy")}
    if isinstance(data.get(DEVICE), str):  # a table is a setting of that name
        del data[DEVICE]
    return Settings([_setting(name, table, path) for name, table in data.items()], path, additions, **given)


def scene_settings(module: ModuleType, calibration: str | Path | None = None) -> Settings:
    """The settings of a scene: its own calibration, or a file that gives all of the same settings in the same units.

    What `origami-sim calibrate` wrote takes the place of those settings that it has; see `taken`.

    A scene may have a series of like parts (`SERIES`, the settings of one); a calibration may then state further ones
    (`mass_3` and all others of part 3).

    Raises:
        InputError: what `read_calibration` refuses; a setting that is missing, unknown or in another unit.
    """
    own = own_settings(module)
    if calibration is None:
        return own
    given = read_calibration(calibration)
    if CALIBRATED in given and CALIBRATED not in own:
        names, _ = taken(own, given)
        return Settings([replace(given[n], range=own[n].range) if n in names else own[n] for n in own], given.file)
    series = _series(module, given)
    own = Settings([*own.values(), *(replace(own[f"{n}_1"], name=f"{n}_{k}") for n, k in series)], own.file)
    for name in own:
        if name not in given:
            raise InputError("the calibration lacks a setting of this scene", file=given.file, field=name)
        if given[name].unit != own[name].unit and ANY not in (given[name].unit, own[name].unit):
            raise InputError(
                "wrong unit", file=given.file, field=f"{name}.unit", value=given[name].unit, allowed=own[name].unit
            )
        if isinstance(given[name].value, str) != isinstance(own[name].value, str):
            raise InputError(
                "wrong kind of value",
                file=given.file,
                field=name,
                value=given[name].value,
                allowed="a word" if isinstance(own[name].value, str) else "a number",
            )
        if isinstance(given[name].value, bool) and not isinstance(own[name].value, bool):
            raise InputError("a switch is no number", file=given.file, field=name, value=given[name].value)
    for name in given:
        if name not in own:
            raise InputError("this scene has no such setting", file=given.file, field=name, allowed=", ".join(own))
    return given


def taken(own: Settings, given: Settings) -> tuple[list[str], list[str]]:
    """Which settings of a scene a file of `origami-sim calibrate` gives, and what else it holds.

    Raises:
        InputError: none, or one in another unit.
    """
    names = [n for n in own if n in given]
    if not names:
        raise InputError(
            "nothing that was calibrated is a setting of this scene",
            file=given.file,
            field=", ".join(n for n in [*given][:4]),
            allowed=f"{', '.join(own)}; Sheet.crease_law(FILE) in a device of yours",
        )
    for n in names:
        if given[n].unit != own[n].unit and ANY not in (given[n].unit, own[n].unit):
            allowed = own[n].unit
            raise InputError("wrong unit", file=given.file, field=f"{n}.unit", value=given[n].unit, allowed=allowed)
    tables = {re.sub(r"_\d\d$", "", n): None for n in given if n not in own and n != CALIBRATED}
    return names, list(tables)


def own_settings(module: ModuleType) -> Settings:
    """The settings of a scene's own calibration, or those that the `build` of a device has."""
    own = getattr(module, "SETTINGS", None)
    return read_calibration(module.CALIBRATION) if own is None else own


def settings_of(module: ModuleType, given: Collection[str]) -> set[str]:
    """Names that a calibration of a scene has to state, as many parts of its series as it states."""
    return set(own_settings(module)) | {f"{n}_{k}" for n, k in _series(module, given)}


def _series(module: ModuleType, given: Collection[str]) -> list[tuple[str, int]]:
    """Settings of the further parts of a scene's series of which a calibration states any, by name and number."""
    names = getattr(module, "SERIES", ())
    own = own_settings(module)
    found = [re.fullmatch(rf"({'|'.join(names)})_([1-9]\d?)", n) for n in given] if names else []
    last = max((int(m[2]) for m in found if m), default=0)
    return [(n, k) for k in range(1, last + 1) for n in names if f"{n}_{k}" not in own]


def is_reference(s: Settings, calibration: str, besides: Collection[str] = ()) -> bool:
    """Whether a reference solution for a shipped calibration is one for these settings.

    It is if no effect was added and all values are those of the calibration, `besides` some and those that decide only
    the motion and the mesh.
    """
    own = read_calibration(calibration)
    return not s.effects and all(
        s[n].value == own[n].value for n in own if n not in _BESIDE_STATICS and n not in besides
    )


def _setting(name: str, table: object, path: Path) -> Setting:
    if not isinstance(table, dict) or not {"value", "unit", "source", "meaning"} <= set(table):
        raise InputError("a setting needs value, unit, source and meaning", file=path, field=name)
    unknown = set(table) - _KEYS
    if unknown:
        raise InputError("unknown key", file=path, field=f"{name}.{min(unknown)}", allowed=", ".join(sorted(_KEYS)))
    for key in ("unit", "source", "meaning"):
        if not isinstance(table[key], str):
            raise InputError("not a word", file=path, field=f"{name}.{key}", value=table[key])
    value = table["value"]
    if not isinstance(value, (int, float, str, bool)):
        raise InputError("a setting is a number, a word or a switch", file=path, field=name, value=value)
    if isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    limits, choices = table.get("range"), table.get("choices", [])
    if limits is not None:
        numbers = isinstance(limits, list) and all(isinstance(v, (int, float)) for v in limits)
        if not numbers or len(limits) != 2 or not limits[0] <= limits[1]:
            raise InputError(
                "a range is two numbers", file=path, field=f"{name}.range", value=limits, allowed="[smallest, largest]"
            )
        limits = (float(limits[0]), float(limits[1]))
    if not isinstance(choices, list) or not all(isinstance(c, str) for c in choices):
        raise InputError("choices are words", file=path, field=f"{name}.choices", value=choices)
    spread = table.get("uncertainty")
    if spread is not None:
        numbers = isinstance(spread, list) and all(isinstance(v, (int, float)) for v in spread)
        if not numbers or len(spread) != 2 or not spread[0] <= spread[1]:
            raise InputError(
                "an uncertainty is two numbers",
                file=path,
                field=f"{name}.uncertainty",
                value=spread,
                allowed="[low, high], a 95 % interval",
            )
        spread = (float(spread[0]), float(spread[1]))
    setting = Setting(
        name,
        value,
        table["unit"],
        table["source"],
        table["meaning"],
        limits,
        tuple(choices),
        spread,
    )
    return _checked(setting, path)


@dataclass
class Outcome:
    """What a scene computed.

    Attributes:
        trajectory: the run that the replay shows.
        tables: name -> column -> values. units: column -> unit, for all tables.
        summary: sentences to print below the tables.
        numbers: headline numbers by name, for machines.
    """

    trajectory: Trajectory
    tables: dict[str, dict[str, np.ndarray | list]]
    units: dict[str, str] = field(default_factory=dict)
    summary: list[str] = field(default_factory=list)
    numbers: dict[str, float] = field(default_factory=dict)


CALIBRATED = "command"
"""Setting by which files of `origami-sim calibrate` are known: the command that wrote them."""

Progress = Callable[[float], None]

HELD = 60
"""Frames of a quasi-static motion after the end of a scene's own: 17 per decade up to an hour after a second."""


def follow(
    model: Model, parameters: Parameters, drives: Sequence[Drive], measure: Callable[[np.ndarray], np.ndarray | float]
) -> tuple[np.ndarray, list[str]]:
    """Follows an equilibrium over a series of drives.

    Returns:
        `measure` of the positions [N, 3] at each drive, nan where no equilibrium was found; a sentence for each such
        drive.
    """
    state, values, notes = None, [], []
    for n, drive in enumerate(drives):
        found = equilibrium(model, parameters, drive, state=state)
        value = np.asarray(measure(found.x), float)
        if found.converged:
            state = found.state
        else:
            value = np.full_like(value, np.nan)
            notes.append(f"no equilibrium in row {n + 1} of the table: {found.message}")
        values.append(value)
    return np.array(values), notes


def motion_of(
    s: Settings,
    model: Model,
    parameters: Parameters,
    drive: Drive,
    *,
    duration: float,
    rate: float,
    progress: Progress | None = None,
    state: State | None = None,
    **options,
) -> Trajectory:
    """The motion that a scene shows: `simulate`, or `quasistatic` where its settings ask for that.

    A quasi-static motion that is held on after the scene's `duration` [s] has frames at even ratios of time from there.

    Raises:
        InputError: what `simulate` and `quasistatic` refuse, frames that are not positive or find no memory; a step or
            an accuracy given for a quasi-static motion.
    """
    if s.motion != "quasistatic":
        return simulate(
            model,
            parameters,
            drive,
            duration=duration,
            rate=rate,
            accuracy=s.accuracy,
            progress=progress,
            state=state,
            **options,
        )
    if options or s.accuracy is not None:
        raise InputError(
            "equilibria along time take no such option",
            field="motion",
            value="quasistatic",
            allowed="dynamic",
        )
    check_frames(duration, rate, s.file)
    check_memory(model, max(parameters.worlds, drive.worlds), duration, rate)
    end = s.until or duration
    times = np.arange(round(duration * rate) + 1) / rate
    if end < times[-1]:
        times = np.append(times[times < end * (1 - 1e-9)], end)
    elif end > times[-1]:
        times = np.concatenate([times, np.geomspace(times[-1], end, HELD + 1)[1:]])
    return quasistatic(model, parameters, drive, times, state=state, progress=progress)


def scene_module(name: str) -> ModuleType:
    """The module of a shipped scene, of which `build` adds the effects of its calibration; InputError naming them."""
    if name not in NAMES:
        raise InputError("there is no such scene", field="scene", value=name, allowed=", ".join(NAMES))
    module = importlib.import_module(f"origami_sim.scenes.{name}")
    if not hasattr(module.build, "__wrapped__"):
        setattr(module, "build", extended(module.build))  # noqa: B010  a module has no declared attributes
    return module


def check_recorded_scene(recording: "Recording", scene: str, option: str) -> None:
    """Refuses a recording of which the sidecar says that it is of another scene; `option` would take that one."""
    found = recording.metadata.get("scene") or {}
    stated = found.get("name")
    if stated is not None and stated != scene:
        raise InputError(
            "the recording is of another scene",
            file=recording.metadata.get("sidecar"),
            field="scene.name",
            value=stated,
            allowed=f"{option} {found.get('stated') or stated}, or a sidecar for {scene}",
        )


def recorded_model(recording: "Recording", option: str) -> str:
    """The scene or design file that the sidecar of a recording names, for who names none with `option`.

    Raises:
        InputError: it names none, or one of Python code: that is executed only if the user names it.
    """
    sidecar = recording.metadata.get("sidecar")
    stated = (recording.metadata.get("scene") or {}).get("stated")
    if stated is None:
        allowed = f"a scene ({', '.join(NAMES)}), my_flap.py, or model = ... in the sidecar"
        raise InputError(
            "neither the command nor the sidecar names a model", file=sidecar, field=option, allowed=allowed
        )
    if stated in NAMES:
        return stated
    beside = Path(str(sidecar)).parent / stated
    if stated.endswith(".toml"):  # a design, in which nothing is executed
        return str(beside)
    named = stated if re.search(r"(?<!\.py):\w+$", stated) else str(beside)
    raise InputError(
        "the model is Python code, which is executed only if you name it yourself",
        file=sidecar,
        field="model",
        value=stated,
        allowed=f"{option} {named}",
    )


def extended(build: Callable) -> Callable:
    """A scene's `build` that switches on what the calibration adds."""

    @functools.wraps(build)
    def extended(s: Settings, **options):
        model, parameters, *rest = build(s, **options)
        if s.panels == "rigid":
            model, parameters = rigid(model, parameters)
        if s.effects:
            from origami_sim.report.patch import switched_on

            model, parameters = switched_on(s.effects, model, parameters, file=s.file)
        return (model, parameters, *rest)

    return extended


def recordings_folder() -> Path | None:
    """Folder of real recordings: $ORIGAMI_RECORDINGS, or shared/recordings beside the checkout; None if absent."""
    given = os.environ.get("ORIGAMI_RECORDINGS")
    candidates = [Path(given)] if given else [p / "shared" / "recordings" for p in Path(__file__).resolve().parents[:4]]
    return next((p for p in candidates if p.is_dir()), None)
