"""What may be handed to `diagnose` as the model."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from origami_sim.device.scene import Setting, Settings, _parse, scene_module, scene_settings
from origami_sim.drive import Drive
from origami_sim.effects import CATALOGUE, DISTORTIONS, get
from origami_sim.errors import InputError, nearest
from origami_sim.hypotheses.hypothesis import ANCHORS, NOMINAL, Free, Subject, Suspect, factor
from origami_sim.model import Model, Parameters
from origami_sim.model.entities import WAYS, located
from origami_sim.quantities import ANY
from origami_sim.recording import Recording
from origami_sim.units import PLAIN, in_unit

STEP = 1e-3
"""Relative change of a setting that shows which parameters it is; any that rounding does not hide finds the same."""

RUN = ("duration", "rate")
"""Settings that say how long a motion is shown and how often, of which no recording tells anything."""

Source = (
    Subject
    | str
    | ModuleType
    | tuple[ModuleType, Settings]
    | tuple[Model, Parameters]
    | tuple[Model, Parameters, Drive]
)
"""A subject; the name or module of a scene, or this with settings; or a model with its parameters and its drive."""


def subject_of(source: Source, priors: Mapping[str, float | str] | None = None) -> Subject:
    """The subject of a diagnosis.

    Args:
        source: see `Source`.
        priors: standard deviations of what was known before. For a scene: by setting, see `spreads`. For a model with
            parameters: by "effect.parameter", relative ("5 %" or 0.05), one factor for all entities. For both: by
            "effect.parameter" of single creases, panels or nodes of an effect of the model, see `numbers`; and of an
            effect that may act besides, see `alignments`.

    Raises:
        InputError: no such scene, setting or parameter; a prior that is not positive; what is no model.
    """
    if isinstance(source, Subject):
        if priors:
            raise InputError("a subject states its own priors", field="priors", value=", ".join(priors))
        return source
    if isinstance(source, str):
        source = scene_module(source)
    if isinstance(source, ModuleType):
        source = (source, scene_settings(source))
    match source:
        case (ModuleType() as module, Settings() as settings):
            model, parameters, *_ = module.build(settings)
            own, further = divided(priors or {}, model)
            known, single = split(settings, own)
            subject = Subject.from_scene(module, settings, spreads=spreads(settings, known))
            return subject.tuned(numbers(single, model, parameters)).beside(alignments(further, parameters))
        case (Model() as model, Parameters() as parameters) | (Model() as model, Parameters() as parameters, Drive()):
            drive = source[2] if len(source) == 3 else None
            own, further = divided(priors or {}, model)
            plain = {n: v for n, v in own.items() if "[" not in n and _is_share(v)}
            nominals = [_factor(parameters, name, given) for name, given in plain.items()]
            rest = numbers({n: v for n, v in own.items() if n not in plain}, model, parameters)
            subject = Subject.from_model(model, parameters, drive, nominals).tuned(rest)
            return subject.beside(alignments(further, parameters))
    raise InputError(
        "this is no model",
        field="model",
        value=type(source).__name__,
        allowed="a scene, (model, parameters), (model, parameters, drive), or a Subject",
    )


def untold(subject: Subject, lost: Sequence[Suspect]) -> list[str]:
    """Notes on suspects that recordings do not tell, or not from a number of the model that is fitted anyway."""
    same = refitted_as(subject, lost)
    other = [n for n in dict.fromkeys(s.label for s in lost) if n not in same]
    said = [f"{label} (by {', '.join(names)})" for label, names in same.items()]
    out = [f"Refitted as numbers of the model, and not tested beside them: {', '.join(said)}."] if said else []
    return out + ([f"Not tested, because these recordings do not tell: {', '.join(other)}."] if other else [])


def refitted_as(subject: Subject, some: Sequence[Suspect]) -> dict[str, list[str]]:
    """Settings that a fit changes and that state the numbers of suspects at their places, by the suspects' labels."""
    start = {f.name: f.start for f in subject.nominals}
    out: dict[str, list[str]] = {}
    if not some:  # a model takes its time to be built
        return out
    _, own, *_ = subject.build(start)
    for f in subject.nominals:
        step = f.scale if f.start + f.scale <= f.upper else -f.scale
        _, other, *_ = subject.build({**start, f.name: f.start + step})
        for s in some:
            key = s.effect, s.free[0].name
            rows = np.flatnonzero(np.any(own[key] != other[key], axis=1)).tolist() if key in own else []
            if rows and (s.entities is None or set(rows) <= set(s.entities)) and f.name not in out.get(s.label, ()):
                out.setdefault(s.label, []).append(f.name)
    return out


def with_units(module: ModuleType, settings: Settings, parameters: Parameters) -> Settings:
    """The settings, with the units of plain numbers in the `build` of a device where the model tells them.

    A number without a stated unit has that of the parameters that it is, or is added to, such as the friction of the
    ground ("1"), and keeps "SI" where it is none as it stands.
    """
    out = []
    for s in settings.values():
        units: set[str] = set()
        if s.unit == ANY and isinstance(s.value, float) and s.value and np.isfinite(s.value):
            other = s.value * (1.0 + STEP)
            try:
                _, moved, *_ = module.build(settings.replace(**{s.name: other}))
            except InputError:  # at its bound
                moved = parameters
            for key in (k for k in parameters if k[0] in CATALOGUE and k in moved):
                old, new = parameters[key], moved[key]
                if old.shape == new.shape and np.any(changed := old != new):
                    by = np.abs(new - old)[changed]
                    itself = np.allclose(by, abs(other - s.value), atol=0.0)
                    units.add(get(key[0]).parameter(key[1]).unit if itself else ANY)
        unit = units.pop() if len(units) == 1 else ANY
        out.append(replace(s, unit="1" if unit == "-" else unit) if s.unit == ANY else s)
    return settings._with(out)


def divided(priors: Mapping[str, float | str], model: Model) -> tuple[dict, dict]:
    """Priors of the model's own numbers, and those that say how recorder and supply are aligned (see `alignments`)."""
    effects = {n for n, e in CATALOGUE.items() if e.family in DISTORTIONS or n not in model.effects}
    further = {n: v for n, v in priors.items() if "." in n and n.partition(".")[0] in effects}
    return {n: v for n, v in priors.items() if n not in further}, further


def alignments(
    priors: Mapping[str, float | str], parameters: Parameters | None = None, *, source: object = None
) -> list[Free]:
    """Numbers of effects that may act without being a fault, such as a clock that is late by some milliseconds.

    Args:
        priors: standard deviations by "effect.parameter", in the parameter's unit or with one ("5 ms"). The effect is
            one of the measurement, of the drive or of the whole body (gravity that is tilted).
        parameters: of the model; where it has the effect, its number is what was known.

    Raises:
        InputError: no such effect or parameter, or none that can be aligned; a value that is no positive number.
    """
    out = []
    for label, given in priors.items():
        name, _, parameter = label.partition(".")
        effect = get(name)
        can = effect.fitted if effect.family in (*DISTORTIONS, "node") else ()
        if parameter not in can or set(ANCHORS) & {p.name for p in effect.parameters}:
            allowed = ", ".join(f"{name}.{p}" for p in can) or "an effect of the measurement, the drive or all nodes"
            raise InputError(
                "not a number that can be aligned", file=source, field="priors", value=label, allowed=allowed
            )
        p = effect.parameter(parameter)
        spread = _aligned(Setting(label, p.default, p.unit, "", p.meaning), given, source)
        start = p.default
        if parameters is not None and (name, parameter) in parameters:
            start = float(parameters[name, parameter].flat[0])
        out.append(Free(NOMINAL, label, p.unit, start, 0.3 * spread, *p.bounds, spread, aligned=True))
    return out


def _aligned(s: Setting, given: float | str, source: object) -> float:
    """A standard deviation of such a number [SI]."""
    text = str(given).strip()
    allowed = f"{in_unit('a standard deviation', s.unit)}, or with a unit"
    _refuse_unitless(s, given, source)
    if s.unit == "-" and text.endswith("%"):
        return 0.01 * _positive(s.name, text[:-1], given, allowed, source)
    return _positive(
        s.name, str(_parse(s, text, None if source is None else Path(str(source)))), given, allowed, source
    )


def known_before(
    settings: Settings, recording: Recording, given: Sequence[str], model: Model, parameters: Parameters
) -> tuple[dict[str, float], list[Free], list[Free]]:
    """What is known of a scene's numbers: by the sidecar of a recording, and over that by the command line.

    Args:
        given: "name=sd" of the command line, where a number without a unit is in SI.

    Returns:
        Standard deviations [SI] of settings by name; numbers of single entities; what is aligned.

    Raises:
        InputError: what `spreads`, `numbers` and `alignments` refuse, no prior.
    """
    first = recording.metadata
    sidecar = first.get("sidecar")
    own, further = divided(first.get("priors") or {}, model)
    own, single = split(settings, own)
    out, aligned = spreads(settings, own, source=sidecar), alignments(further, parameters, source=sidecar)
    stated: dict[str, float | str] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(
                "not a prior", field="--prior", value=text, allowed="name=sd, e.g. length_1=0.5mm or mass_1=1%"
            )
        stated[name] = float(value) if _is_number(value) else value
    own, further = divided(stated, model)
    own, over = split(settings, own)
    tuned = numbers({n: v for n, v in single.items() if n not in over}, model, parameters, source=sidecar)
    tuned += numbers(over, model, parameters, source="--prior")
    aligned = [*(f for f in aligned if f.name not in further), *alignments(further, parameters, source="--prior")]
    return out | spreads(settings, own, source="--prior"), tuned, aligned


def split(settings: Settings, priors: Mapping[str, float | str]) -> tuple[dict, dict]:
    """Priors of a scene's settings, and those of parameters of its model ("crease.stiffness[hinge1]")."""
    single = {n: v for n, v in priors.items() if "." in n and n not in settings}
    return {n: v for n, v in priors.items() if n not in single}, single


def numbers(
    priors: Mapping[str, float | str], model: Model, parameters: Parameters, *, source: object = None
) -> list[Free]:
    """Numbers of some entities of an effect of the model, such as the rest angle of one crease.

    Args:
        priors: standard deviations by "effect.parameter[name]", a share ("20 %": the fit changes it by a factor) or in
            a unit ("0.02 rad": the fit adds to it). A name that several entities share stands for all of them; without
            brackets all entities are meant.

    Raises:
        InputError: no such effect, parameter or entity; a value that is no positive share or has no unit; a share of
            what is zero.
    """
    out = []
    for label, given in priors.items():
        found = located(label, model, parameters, file=source)
        now = parameters[found.effect, found.name][found.entities]
        text = str(given).strip()
        allowed = f"a share such as '20 %', or a standard deviation with a unit such as '0.02 {found.unit}'"
        if text.endswith("%"):
            if not np.any(now):
                raise InputError("no share of zero", file=source, field=f"priors.{label}", value=given, allowed=allowed)
            spread = 0.01 * _positive(label, text[:-1], given, allowed, source)
            name = label + WAYS["factor"]
            out.append(Free(NOMINAL, name, "-", 1.0, 0.3 * spread, 0.0, np.inf, spread))
            continue
        if _is_share(given):
            raise InputError(
                "needs a share or a unit", file=source, field=f"priors.{label}", value=given, allowed=allowed
            )
        setting = Setting(f"priors.{label}", 0.0, found.unit, "", label)
        spread = _positive(
            label, str(_parse(setting, text, None if source is None else Path(str(source)))), given, allowed, source
        )
        low, high = found.bounds[0] - float(now.min()), found.bounds[1] - float(now.max())
        out.append(Free(NOMINAL, label + WAYS["added"], found.unit, 0.0, 0.3 * spread, low, high, spread))
    return out


def _is_share(given: float | str) -> bool:
    """Whether a prior is a share: in per cent, or a bare number."""
    text = str(given).strip()
    return text.endswith("%") or _is_number(text)


def _is_number(text: str) -> bool:
    """Whether a text is a number without a unit."""
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", text.strip().lower()) is not None


def _factor(parameters: Parameters, name: str, given: float | str) -> Free:
    """A factor on a parameter, known to within "5 %" or 0.05."""
    owner, _, parameter = name.partition(".")
    if (owner, parameter) not in set(parameters):
        known = sorted(".".join(key) for key in parameters)
        allowed = ", ".join(known) + nearest(name, known)
        raise InputError("there is no such parameter", field="priors", value=name, allowed=allowed)
    text = str(given).strip()
    spread = _positive(name, text.removesuffix("%"), given, "0.05 or 5 %")
    return factor(name, 0.01 * spread if text.endswith("%") else spread)


def spreads(settings: Settings, priors: Mapping[str, float | str], *, source: object = None) -> dict[str, float]:
    """Standard deviations [SI] of settings: numbers in the setting's unit, "5 %" of its value, or "0.5 mm".

    Raises:
        InputError: no such setting, a setting that is a word, a value that is no positive number.
    """
    out = {}
    for name, given in priors.items():
        s = settings.get(name)
        if s is None or isinstance(s.value, (str, bool)) or name in RUN:
            numbers = [n for n, t in settings.items() if not isinstance(t.value, (str, bool)) and n not in RUN]
            raise InputError(
                "a prior is for a number of the model",
                file=source,
                field="priors",
                value=name,
                allowed=", ".join(numbers) + nearest(name, numbers),
            )
        out[name] = _spread(s, given, settings, source)
    return out


def _spread(s: Setting, given: float | str, settings: Settings, source: object) -> float:
    text = str(given).strip()
    allowed = f"{in_unit('a standard deviation', s.unit)}, with a unit, or 10% for a share of {s.value:g}"
    if text.endswith("%"):
        if not s.value:
            raise InputError("no share of zero", file=source, field=f"priors.{s.name}", value=given, allowed=s.unit)
        return _positive(s.name, text[:-1], given, allowed, source) * 0.01 * abs(float(s.value))
    _refuse_unitless(s, given, source)
    try:
        number = str(_parse(s, text, Path(str(source or settings.file))))
    except InputError as error:
        share = f"{error.allowed}, or 10% for a share of {s.value:g}"
        raise InputError(error.what, file=error.file, field=f"priors.{s.name}", value=given, allowed=share) from None
    return _positive(s.name, number, given, allowed, source)


def _refuse_unitless(s: Setting, given: float | str, source: object) -> None:
    """Refuses a text without a unit for a number that has one: "5" for a modulus, which a number 5 is in pascal."""
    if isinstance(given, str) and s.unit not in (ANY, *PLAIN) and _is_number(given):
        raise InputError(
            "a text without a unit",
            file=source,
            field=f"priors.{s.name}",
            value=given,
            allowed=f"'{given.strip()} {s.unit}', '{given.strip()} %' of the value, or the number alone, in {s.unit}",
        )


def _positive(name: str, text: str, given: object, allowed: str, source: object = None) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not (value > 0 and np.isfinite(value)):
        raise InputError("not a standard deviation", file=source, field=f"priors.{name}", value=given, allowed=allowed)
    return value
