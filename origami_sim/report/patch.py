"""A patched calibration: the scene's settings with refitted numbers, and the effects that were found to be missing.

It is a calibration as any other, which names its device (`device = "my_flap.toml"`, from its own folder), with one
table more:

    [[effects.crease_friction]]
    site = "crease 1"               # in words; optional, like source
    entities = [1]                  # of the effect's family, or at = "hinge1" by name; left out: all of them
    friction_moment = 2.0e-5        # parameters of the effect [SI]
    yield_angle = 0.01

Parameters that are not stated are those of an effect of the scene that has one of the same name for the same family (a
magnet keeps its remanence), else their typical value. An effect that the scene already has, or that a table above has
added, keeps what is not stated; with `more = true` the numbers are added to what it has, and may be negative, and with
`times = true` they are factors on it.
"""

import json
import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from origami_sim.device.scene import DEVICE, NAMES, Settings
from origami_sim.effects import CATALOGUE, Parameter, get
from origami_sim.errors import InputError
from origami_sim.files import write_text
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect, apply, silent
from origami_sim.model import BODY, Model, Parameters
from origami_sim.model.entities import OWNERS, WAYS, located
from origami_sim.report.diagnosis import Candidate
from origami_sim.units import of_unit

_WORDS = ("site", "source", "at")
_SWITCHES = ("more", "times")
_OWNED = {
    "inertia": [("mass", "kg")],
    "body": [(n, {"mass": "kg", "centre": "m"}.get(n.split("_")[0], "kg m^2")) for n in BODY],
    "plane": [("tilt", "rad"), ("azimuth", "rad"), ("height", "m"), ("reach", "m")],
    "surface": [("thickness", "m"), ("stiffness", "N/m"), ("loss_time", "s")],
}
"""Numbers of what is no effect, and their units."""


@dataclass(frozen=True)
class Addition:
    """An effect that a calibration adds to its scene.

    Attributes:
        effect: name in the catalogue. values: its parameters [SI].
        entities: of the effect's family; None for all. site, source: for readers.
        more: whether the values are added to those that the effect has. times: whether they are factors on them.
        at: name of the entities, in place of their numbers.
    """

    effect: str
    values: Mapping[str, float] = field(default_factory=dict)
    entities: tuple[int, ...] | None = None
    site: str = ""
    source: str = ""
    more: bool = False
    times: bool = False
    at: str = ""

    @property
    def changes(self) -> bool:
        """Whether it changes what the effect has, and states nothing new."""
        return self.more or self.times


def read_additions(tree: object, file: Path) -> tuple[Addition, ...]:
    """The table `effects` of a calibration.

    Raises:
        InputError: not a table of tables, an effect or parameter that the catalogue lacks, a value out of its bounds.
    """
    if not isinstance(tree, dict):
        raise InputError("effects are tables, [effects.NAME]", file=file, field="effects", value=tree)
    out = []
    for name, entries in tree.items():
        if name not in CATALOGUE and name not in OWNERS:
            raise InputError(
                "there is no such effect", file=file, field=f"effects.{name}", allowed=", ".join(CATALOGUE)
            )
        for entry in entries if isinstance(entries, list) else [entries]:
            out.append(_addition(name, entry, file))
    return tuple(out)


def _addition(name: str, entry: object, file: Path) -> Addition:
    where = f"effects.{name}"
    if not isinstance(entry, dict):
        raise InputError("an effect is a table of its parameters", file=file, field=where, value=entry)
    known = _known(name)
    words, values, entities = {}, {}, None
    switches = {s: entry.get(s, False) for s in _SWITCHES}
    for key, value in switches.items():
        if not isinstance(value, bool):
            raise InputError("not a switch", file=file, field=f"{where}.{key}", value=value, allowed="true, false")
    changes = any(switches.values())
    if name in OWNERS and not changes:
        raise InputError(
            "is no effect: its numbers can only be changed", file=file, field=where, allowed="more = true, times = true"
        )
    if all(switches.values()) or ("at" in entry and "entities" in entry):
        fault = ("more", "times") if all(switches.values()) else ("at", "entities")
        raise InputError(f"give either {fault[0]} or {fault[1]}", file=file, field=f"{where}.{fault[0]}")
    for key, value in entry.items():
        at = f"{where}.{key}"
        if key in _WORDS:
            if not isinstance(value, str):
                raise InputError("not a word", file=file, field=at, value=value)
            words[key] = value
        elif key in _SWITCHES:
            continue
        elif key == "entities":
            whole = isinstance(value, list) and all(type(v) is int and v >= 0 for v in value)
            if not whole or not value:
                raise InputError("entities are a list of numbers", file=file, field=at, value=value, allowed="[0, ...]")
            entities = tuple(value)
        elif key not in known:
            raise InputError(
                "the effect has no such parameter",
                file=file,
                field=at,
                allowed=", ".join([*known, "entities", *_SWITCHES, *_WORDS]),
            )
        else:
            low, high = (-np.inf, np.inf) if changes else known[key].bounds
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
                raise InputError(
                    "out of its bounds",
                    file=file,
                    field=at,
                    value=value,
                    allowed=of_unit(f"{low:g} to {high:g}", known[key].unit),
                )
            values[key] = float(value)
    return Addition(name, values, entities, **switches, **words)


def _known(name: str) -> dict[str, Parameter]:
    """What a calibration may state of an effect, or change of bodies, nodes or the plane of the ground."""
    if name in OWNERS:
        free, of = (-np.inf, np.inf), f"of each {OWNERS[name] or name}"
        return {n: Parameter(n, n, unit, 0.0, free, of) for n, unit in _OWNED[name]}
    return {p.name: p for p in get(name).parameters if p.knots == 1}


def switched_on(
    additions: Sequence[Addition], model: Model, parameters: Parameters, *, file: Path | None = None
) -> tuple[Model, Parameters]:
    """Model and parameters with these effects.

    Raises:
        InputError: an entity that the model does not have; more of an effect that nothing has switched on.
    """
    additions = [_placed(a, model, parameters, file) for a in additions]
    for a in additions:
        count = _count(a.effect, model, parameters)
        if a.entities is not None and max(a.entities) >= count:
            raise InputError(
                "the model has no such entity",
                file=file,
                field=f"effects.{a.effect}.entities",
                value=max(a.entities),
                allowed=f"0 to {count - 1}",
            )
    there = {*model.effects, *OWNERS}
    new = [a for a in additions if a.effect not in there and not a.changes]
    richer = model.with_effects(*(a.effect for a in new))
    numbers = [_numbers(a) for a in new]
    missing = Hypothesis(tuple(Suspect(a.effect, a.site, "", n, a.entities) for a, n in zip(new, numbers, strict=True)))
    out = apply(parameters, missing, [f.start for n in numbers for f in n], richer)
    for a in additions:
        if a.effect not in richer.effects and a.effect not in OWNERS:
            raise InputError(
                "there is no such effect to have more of",
                file=file,
                field=f"effects.{a.effect}.{'more' if a.more else 'times'}",
                value=True,
            )
        if a.effect in there or a.changes:
            mine = np.arange(_count(a.effect, richer, out)) if a.entities is None else np.array(a.entities)
            for name, value in a.values.items():
                bounds = _known(a.effect)[name].bounds
                old = out[a.effect, name][mine]
                new_value = old + value if a.more else old * value if a.times else value
                out.set(a.effect, name, np.clip(new_value, *bounds), mine)
    return richer, out


def _count(effect: str, model: Model, parameters: Parameters) -> int:
    if effect in OWNERS:
        return len(next(iter(parameters.of(effect).values())))
    return model.count(get(effect).family)


def _placed(a: Addition, model: Model, parameters: Parameters, file: Path | None) -> Addition:
    """The same with its entities by number."""
    if not a.at:
        return a
    richer = model if a.effect in OWNERS else model.with_effects(a.effect)
    label = f"{a.effect}.{next(iter(a.values), next(iter(_known(a.effect))))}[{a.at}]"
    found = located(label, richer, parameters.for_model(richer), file=file, field=f"effects.{a.effect}.at")
    return replace(a, entities=tuple(found.entities.tolist()), at="")


def _numbers(a: Addition) -> tuple[Free, ...]:
    return tuple(
        Free(a.effect, n, get(a.effect).parameter(n).unit, v, 1.0, entities=a.entities) for n, v in a.values.items()
    )


class Finding(Protocol):
    """What is written into a calibration: of a diagnosis, or of an estimate of stated numbers; see `Diagnosis`."""

    @property
    def verdict(self) -> str: ...
    @property
    def sentence(self) -> str: ...
    @property
    def recordings(self) -> list[str]: ...
    @property
    def candidates(self) -> list[Candidate]: ...
    @property
    def patch(self) -> dict[str, float]: ...
    @property
    def changed(self) -> list[str]: ...


def patched(diagnosis: Finding) -> Candidate | None:
    """The explanation whose numbers are patched in; None where the diagnosis changes nothing."""
    values = list(diagnosis.patch.values())
    return next((c for c in diagnosis.candidates if values and [n.value for n in c.numbers] == values), None)


def additions(diagnosis: Finding, settings: Settings) -> tuple[Addition, ...]:
    """The effects that the diagnosis found missing, one for each site; see also `of_channels`."""
    return tuple(a for a in _found(diagnosis, settings) if not _of_channel(a))


def of_channels(diagnosis: Finding, settings: Settings) -> list[str]:
    """Errors of single channels that the diagnosis found: the recording's, so that no model can have them."""
    return [f"{a.effect} at {a.site}" for a in _found(diagnosis, settings) if _of_channel(a)]


def _of_channel(a: Addition) -> bool:
    return a.effect in CATALOGUE and get(a.effect).family == "measurement" and a.entities is not None


def _found(diagnosis: Finding, settings: Settings) -> tuple[Addition, ...]:
    found: dict[tuple[str, str], dict[str, float]] = {}
    source = f"diagnosis of {', '.join(diagnosis.recordings)}: {diagnosis.verdict}"
    tuned = []
    for label, value in diagnosis.patch.items():
        name, _, entities = label.partition("@")
        if name in settings:
            continue
        effect, _, parameter = name.partition(".")
        way = next((w for w in WAYS if name.endswith(WAYS[w])), None)
        if way is None:
            found.setdefault((effect, entities), {})[parameter] = value
            continue
        parameter, _, at = parameter.removesuffix(WAYS[way]).removesuffix("]").partition("[")
        factor = way == "factor"
        tuned.append(Addition(effect, {parameter: value}, source=source, more=not factor, times=factor, at=at))
    best = patched(diagnosis)
    suspected = [] if best is None else best.effects
    sites: dict[str, list[str]] = {}  # of an effect at several sites in the order of its numbers
    for effect, site in zip(suspected, [] if best is None else best.sites, strict=True):
        sites.setdefault(effect, []).append(site)
    there = {a.effect for a in settings.effects}
    for (effect, entities), values in found.items():
        if effect not in suspected and effect not in there:  # of what is aligned, the rest does nothing
            found[effect, entities] = silent(effect) | values
    return *tuned, *(
        Addition(
            effect,
            values,
            tuple(map(int, entities.split(","))) if entities else None,
            sites[effect].pop(0) if sites.get(effect) else "",
            source,
            effect in diagnosis.changed,
        )
        for (effect, entities), values in found.items()
    )


def write_patch(path: str | Path, settings: Settings, diagnosis: Finding, *, scene: str) -> Path:
    """Writes the calibration with refitted settings, their new uncertainty, and the missing effects switched on.

    Returns:
        The file; `origami-sim run SCENE --calibration FILE` and `origami-sim diagnose ... --calibration FILE` read it.
    """
    best = patched(diagnosis)
    numbers = {n.label: n for n in best.numbers} if best is not None else {}
    lines = [
        f"# {scene}, patched by a diagnosis of {', '.join(diagnosis.recordings)}: {diagnosis.verdict}.",
        *textwrap.wrap(diagnosis.sentence, 118, initial_indent="# ", subsequent_indent="# "),
        f"# Use: origami-sim run {scene} --calibration {Path(path).name}",
        *(f"# Left out, as it is an error of the recording: {e}" for e in of_channels(diagnosis, settings)),
        "",
    ]
    words = {DEVICE: _beside(scene, Path(path).parent), "panels": settings.panels, "motion": settings.motion}
    lines += [f"{n} = {_toml(w)}" for n, w in (words | {"accuracy": settings.accuracy}).items() if w is not None]
    lines.append("")
    for s in settings.values():
        value, source, uncertainty = s.value, s.source, s.uncertainty
        number = numbers.get(s.name)
        if number is not None and number.value != s.value:
            value, uncertainty = number.value, (number.low, number.high)
            source = f"refitted by a diagnosis (was {s.value:.6g}: {s.source})"
        lines += [f"[{s.name}]", f"value = {_toml(value)}", f"unit = {_toml(s.unit)}"]
        if s.range is not None:
            lines.append(f"range = {_toml(list(s.range))}")
        if s.choices:
            lines.append(f"choices = {_toml(list(s.choices))}")
        if uncertainty is not None:
            lines.append(f"uncertainty = {_toml(list(uncertainty))}")
        lines += [f"source = {_toml(source)}", f"meaning = {_toml(s.meaning)}", ""]
    for a in (*settings.effects, *additions(diagnosis, settings)):
        lines.append(f"[[effects.{a.effect}]]")
        lines += [f"{word} = {_toml(getattr(a, word))}" for word in _WORDS if getattr(a, word)]
        if a.entities is not None:
            lines.append(f"entities = {_toml(list(a.entities))}")
        lines += [f"{switch} = true" for switch in _SWITCHES if getattr(a, switch)]
        for name, value in a.values.items():
            p = _known(a.effect)[name]
            lines.append(f"{name} = {_toml(value)}  # [{p.unit}] {p.meaning}")
        lines.append("")
    return write_text(path, "\n".join(lines))


def _beside(device: str, folder: Path) -> str:
    """A device as a calibration in a folder names it: its file from there, whatever the working folder is."""
    place, function = re.fullmatch(r"(.*?)(:\w+)?", device, re.S).groups()  # type: ignore[union-attr]
    file = place and Path(place).exists() and place not in NAMES
    return Path(os.path.relpath(place, folder)).as_posix() + (function or "") if file else device


def _toml(value) -> str:
    """A TOML value; JSON's text is TOML for words, switches, finite numbers and lists of them."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
