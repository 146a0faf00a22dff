"""What may be wrong: numbers that a fit may change, and effects that may have been left out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from origami_sim.device.scene import Settings
from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.model import Model, Parameters
from origami_sim.model.bodies import rigid
from origami_sim.model.entities import tune
from origami_sim.model.places import across, along_creases

SEPARATOR = " + "
"""Between the effects of one explanation in its label."""

NOMINAL = ""
"""Owner of the numbers of the model that was given, as opposed to those of an effect that is suspected."""


@dataclass(frozen=True)
class Free:
    """One number that a fit may change.

    Attributes:
        owner: NOMINAL for a setting of the model, else the effect. name: the setting or parameter.
        start: where fits begin. scale: a change that is noticeable. lower, upper: physical bounds.
        spread: standard deviation of what was known before; infinite if nothing was.
        power: of its coordinate: 1 is the number itself, 1/2 its root, 0 its logarithm; scale and spread of these two
            are those of the coordinate, see `Coordinates`.
        entities: entities of the effect's family that share the number; None for all. recording: likewise (index).
        aligned: whether it says how recorder or supply are aligned, named "effect.parameter"; see `Subject.beside`.
    """

    owner: str
    name: str
    unit: str
    start: float
    scale: float
    lower: float = -np.inf
    upper: float = np.inf
    spread: float = np.inf
    entities: tuple[int, ...] | None = None
    aligned: bool = False
    recording: int | None = None
    power: float = 1.0

    @property
    def label(self) -> str:
        own = f"{self.owner}.{self.name}" if self.owner else self.name
        return own if self.recording is None else f"{own} of recording {self.recording + 1}"

    @property
    def nodes(self) -> int:
        """Nodes that have so much each, of a mass that is added; 1 of other numbers."""
        return len(self.entities) if self.entities and self.unit == "kg" and get(self.owner).family == "node" else 1


@dataclass(frozen=True)
class Suspect:
    """An effect at a site, with the numbers to fit.

    Attributes:
        effect: name in the catalogue. site: where, in words. kind: crease, panel, body, ground, drive or measurement.
        free: numbers to fit, the strength first.
        entities: entities of the family; None for all. sites: of how many sites, equally likely, it is at
            one.
        more: whether the model has the effect, and more or less of it is suspected.
        stretch: whether the site is a stretch of a beam, not one crease or panel.
        fixed: parameters that it gives a value, besides.
    """

    effect: str
    site: str
    kind: str
    free: tuple[Free, ...]
    entities: tuple[int, ...] | None = None
    sites: int = 1
    more: bool = False
    stretch: bool = False
    fixed: tuple[tuple[str, float], ...] = ()

    @property
    def label(self) -> str:
        return f"{self.effect} at {self.site}"

    @property
    def form(self) -> tuple:
        """What tells it from other suspects of the search: where it is, and where its numbers begin."""
        return self.label, (*((f.name, f.start) for f in self.free), *self.fixed)

    @property
    def strengths(self) -> tuple[Free, ...]:
        """The strength, and what else is a component of it: an offset has three."""
        first, *rest = self.free
        return first, *(f for f in rest if f.unit == first.unit and not f.start)


def usual(suspect: Suspect, numbers: Sequence["Free"]) -> np.ndarray:
    """Strengths that an effect usually has, over their scales; infinite where that depends on the device.

    Moments, forces, masses, lengths and rates depend on how large, stiff and fast a device is. Ratios, angles, voltages
    and fields do not, nor do recorders and supplies; numbers that are no strengths have priors of their own.
    """
    effect, strong = get(suspect.effect), suspect.strengths
    common = effect.family in ("measurement", "drive")
    first = effect.parameter(suspect.free[0].name).typical or 0.0

    def size(f: Free) -> float:
        typical = abs(effect.parameter(f.name).typical or first)
        known = f in strong and typical and (common or not set(f.unit) & set("Nkgms"))
        return typical / f.scale if known else np.inf

    return np.array([size(f) for f in numbers])


def distinct_sites(a: Suspect, b: Suspect) -> bool:
    """Whether both can act at once, each with numbers of its own: one value per crease, panel or channel."""
    if a.effect != b.effect:
        return True
    if a.entities is None or b.entities is None:
        return False
    return not set(a.entities) & set(b.entities)


@dataclass(frozen=True)
class Hypothesis:
    """The nominal model with these effects added (none: the nominal model, refitted)."""

    suspects: tuple[Suspect, ...] = ()

    @property
    def label(self) -> str:
        return SEPARATOR.join(s.label for s in self.suspects) or "nominal"

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(s.effect for s in self.suspects))

    @property
    def free(self) -> tuple[Free, ...]:
        return tuple(f for s in self.suspects for f in s.free)

    def plus(self, suspect: Suspect) -> "Hypothesis":
        return Hypothesis((*self.suspects, suspect))


Build = Callable[[Mapping[str, float]], tuple[Model, Parameters, Drive]]


@dataclass(frozen=True)
class Subject:
    """The object under suspicion: how to build its model for any values of its uncertain numbers.

    Attributes:
        build: from values by name [SI] to model, parameters (one world) and drive.
        nominals: the uncertain numbers with what was known of them.
        name: for reports.
        build_rigid: the same with rigid panels; None: those of what `build` gives.
    """

    build: Build
    nominals: tuple[Free, ...]
    name: str = "model"
    build_rigid: Build | None = None

    def with_rigid_panels(self) -> "Subject":
        """The same object with panels that do not bend (see `bodies.rigid`)."""

        def build(values: Mapping[str, float]):
            model, parameters, drive = self.build(values)
            return *rigid(model, parameters), drive

        made = self.build_rigid or build
        return Subject(made, self.nominals, self.name, made)

    @classmethod
    def from_scene(
        cls, module, settings: Settings, *, spreads: Mapping[str, float] | None = None, name: str = ""
    ) -> "Subject":
        """The subject of a scene: settings with an uncertainty, or a spread given here, are uncertain."""
        nominals = []
        for s in settings.values():
            spread = (spreads or {}).get(s.name)
            if spread is None and s.uncertainty is not None:
                spread = (s.uncertainty[1] - s.uncertainty[0]) / 3.92
            if not spread or isinstance(s.value, (str, bool)):
                continue
            low, high = s.range or (-np.inf, np.inf)
            nominals.append(Free(NOMINAL, s.name, s.unit, s.value, max(0.3 * spread, 1e-12), low, high, spread))

        def build(values: Mapping[str, float]):
            changed = {n: float(v) for n, v in values.items() if v != settings[n].value}
            return module.build(settings.replace(**changed) if changed else settings)[:3]

        return cls(build, tuple(nominals), name or module.__name__.rpartition(".")[2])

    @classmethod
    def from_model(
        cls, model: Model, parameters: Parameters, drive: Drive | None = None, nominals: Sequence[Free] = ()
    ) -> "Subject":
        """A subject of fixed geometry; a nominal's name is "effect.parameter", scaled for all of its entities.

        Its value is a factor on the given parameters (start 1).
        """

        def built(make: Callable[[], tuple[Model, Parameters]]) -> Build:
            def build(values: Mapping[str, float]):
                own, given = make()
                out = given.copy()
                for name, factor in values.items():
                    owner, _, parameter = name.partition(".")
                    if factor != 1.0:
                        old = given[owner, parameter]
                        there = np.flatnonzero(np.any(old.reshape(len(old), -1) != 0.0, axis=1))  # bodies have masses
                        out.set(owner, parameter, old[there] * factor, there)
                return own, out, drive or Drive()

            return build

        stiff = cache(lambda: rigid(model, parameters))
        return cls(built(lambda: (model, parameters)), tuple(nominals), build_rigid=built(stiff))

    def tuned(self, numbers: Sequence[Free]) -> "Subject":
        """The same with numbers that change a parameter of some entities of the model; see `entities.tune`."""
        own = {f.name: f.start for f in numbers}

        def tuned(made: Build) -> Build:
            def build(values: Mapping[str, float]):
                model, parameters, drive = made({n: v for n, v in values.items() if n not in own})
                out = parameters.copy()
                for label, start in own.items():
                    if values.get(label, start) != start:
                        tune(out, model, label, values[label])
                return model, out, drive

            return build

        return self._changed(tuned, numbers) if numbers else self

    def _changed(self, change: Callable[[Build], Build], numbers: Sequence[Free]) -> "Subject":
        """The same with numbers of which a change of what is built makes use."""
        stiff = change(self.with_rigid_panels().build)
        return Subject(change(self.build), (*self.nominals, *numbers), self.name, stiff)

    def beside(self, numbers: Sequence[Free]) -> "Subject":
        """The same with effects that act in any case, as strongly as the fit says: such as a clock that may be late.

        A number is named "effect.parameter" and holds for all of the effect's entities.
        """
        owners = dict.fromkeys(f.name.partition(".")[0] for f in numbers)
        own = {f.name: f.start for f in numbers}

        def beside(made: Build) -> Build:
            def build(values: Mapping[str, float]):
                model, parameters, drive = made({n: v for n, v in values.items() if n not in own})
                lacking = [e for e in owners if e not in model.effects]
                richer = model.with_effects(*lacking)
                out = apply(parameters, Hypothesis(tuple(Suspect(e, "", "", ()) for e in lacking)), (), richer)
                for effect in lacking:
                    for name, value in silent(effect).items():
                        out.set(effect, name, value)
                for label, start in own.items():
                    effect, _, name = label.partition(".")
                    out.set(effect, name, np.clip(values.get(label, start), *get(effect).parameter(name).bounds))
                return richer, out, drive

            return build

        return self._changed(beside, numbers) if numbers else self


def silent(effect: str) -> dict[str, float]:
    """Values of an effect's fitted numbers with which it does nothing: its strength, and what else has that unit."""
    fitted = [get(effect).parameter(n) for n in get(effect).fitted]
    return {p.name: p.default for p in fitted if p.unit == fitted[0].unit}


def factor(name: str, spread: float) -> Free:
    """A nominal parameter "effect.parameter" of `Subject.from_model`, known to within a relative `spread`."""
    return Free(NOMINAL, name, "-", 1.0, 0.3 * spread, 0.0, np.inf, spread)


PLAUSIBLE = 10.0
"""How far a number beside an effect's strength may plausibly be from its typical value: in units of that, or by which
factor, if it is a positive scale."""

ANCHORS = ("anchor_x", "anchor_y", "anchor_z")
"""Parameters of a node that stand for its reference position."""

ACROSS = ("across_x", "across_y", "across_z")
"""Parameters that stand for the direction across the plane in which the device folds."""

ALONG = "along"
"""Parameter of a crease that stands for its place along a beam, from -1/2 to 1/2."""

FORM: dict[str, Callable[[Model], np.ndarray | float]] = {
    **{name: lambda model, n=n: model.position[:, n] for n, name in enumerate(ANCHORS)},
    **{name: lambda model, n=n: float(across(model)[n]) for n, name in enumerate(ACROSS)},
    ALONG: along_creases,
}
"""Parameters that follow from the form of a device: it is tied where it was when it was undeformed, for instance."""


def apply(
    parameters: Parameters, hypothesis: Hypothesis, values: Sequence[float] | np.ndarray, model: Model
) -> Parameters:
    """Parameters for the model with the hypothesis' effects, with the fitted numbers in place.

    Parameters that are not fitted are copied from an effect of the model that has one of the same name for the same
    family (a suspect's magnet is the panel's magnet); else they get their typical value, else their default. What else
    is a strength of the effect, as another component of a vector, is zero, and further numbers have their defaults.
    """
    out = parameters.for_model(model)
    given = [n for n in model.effects if any(owner == n for owner, _ in parameters)]
    for s in hypothesis.suspects:
        effect = get(s.effect)
        if s.effect in given:
            continue
        fitted = {f.name for f in s.free} | silent(s.effect).keys() | {*effect.further}
        for p in effect.parameters:
            if p.name in fitted:
                continue
            if p.name in FORM:
                out.set(s.effect, p.name, FORM[p.name](model))
                continue
            donor = next(
                (
                    n
                    for n in given
                    if get(n).family == effect.family
                    and any(q.name == p.name and q.knots == p.knots for q in get(n).parameters)
                ),
                None,
            )
            if donor is not None:
                out.set(s.effect, p.name, parameters[donor, p.name])
            elif p.typical is not None:
                out.set(s.effect, p.name, p.typical)
    index = 0
    for s in hypothesis.suspects:
        for name, value in s.fixed:
            out.set(s.effect, name, value, None if s.entities is None else np.array(s.entities))
        for f in s.free:
            bounds = get(s.effect).parameter(f.name).bounds
            if s.more:  # or less, of what the model has
                mine = slice(None) if s.entities is None else np.array(s.entities)
                out.set(
                    s.effect, f.name, np.clip(parameters[s.effect, f.name][mine] + values[index], *bounds), s.entities
                )
                index += 1
                continue
            value = float(np.clip(values[index], *bounds))
            mine = s.entities if f.recording is None else f.entities
            out.set(s.effect, f.name, value, None if mine is None else np.array(mine))
            index += 1
    return out


def along_each_axis(s: Suspect) -> list[Suspect]:
    """A suspect with each of its strengths first: what only one of them does."""
    out = []
    for f in s.strengths:
        rest = (replace(g, spread=PLAUSIBLE * g.scale) if g is s.free[0] else g for g in s.free if g is not f)
        out.append(replace(s, free=(replace(f, spread=np.inf), *rest)))
    return out


def scaled(suspect: Suspect, scales: Sequence[float] | np.ndarray) -> Suspect:
    """The suspect with other scales for its strengths."""
    of = {id(f): abs(float(scale)) for f, scale in zip(suspect.strengths, scales, strict=True)}
    return replace(suspect, free=tuple(replace(f, scale=of.get(id(f), f.scale)) for f in suspect.free))
