"""Numbers of a model by their label: "crease.stiffness", or of some entities, "crease.stiffness[hinge1]"."""

import re
from dataclasses import dataclass

import numpy as np

from origami_sim.effects import CATALOGUE, CONTACTS, get
from origami_sim.errors import InputError
from origami_sim.model.model import Model, Parameters

_LABEL = re.compile(r"(\w+)\.(\w+)(?:\[(.*)\])?")
_NAMED = {"crease": "crease", "triangle": "panel", "node": "node", "panel": "panel"} | dict.fromkeys(
    CONTACTS, "contact"
)
"""Family of an effect, and what its entities are named by: the triangles of a panel have its name."""

OWNERS = {"inertia": "node", "body": "panel", "plane": "", "surface": "triangle"}
"""Owners of parameters that are no effects, and the family of their entities."""


WAYS = {"factor": " (factor)", "added": " (added)"}
"""Ways in which a fitted number changes a parameter that a model has, and how its label ends."""


@dataclass(frozen=True, eq=False)
class Number:
    """A parameter of some entities of a model.

    Attributes:
        effect, name: of the parameter. unit, bounds: of its values. entities: indices in its family.
    """

    effect: str
    name: str
    unit: str
    bounds: tuple[float, float]
    entities: np.ndarray


def located(label: str, model: Model, parameters: Parameters, *, file: object = None, field: str = "priors") -> Number:
    """The number that a label stands for; the entity in brackets is a name of the model
    (of several, if they share it) or an index.

    Raises:
        InputError: no such effect or parameter of the model, or no entity of that name.
    """
    match = _LABEL.fullmatch(label.strip())
    effect, name, entity = match.groups() if match else ("", "", None)
    if (effect, name) not in set(parameters) or parameters[effect, name].ndim > 2:
        known = sorted(".".join(key) for key in parameters if parameters[key].ndim == 2)
        raise InputError("there is no such parameter", file=file, field=field, value=label, allowed=", ".join(known))
    every = np.arange(len(parameters[effect, name]))
    unit, bounds = "", (-np.inf, np.inf)
    if effect in CATALOGUE:
        found = get(effect).parameter(name)
        unit, bounds = found.unit, found.bounds
    if entity is not None:
        every = _named(entity, effect, model, len(every), label, file, field)
    return Number(effect, name, unit, bounds, every)


def tune(parameters: Parameters, model: Model, label: str, value: float) -> None:
    """Changes, in place, the parameter that a label stands for, by a factor or an addition as its end says.

    Values stay within the bounds of the parameter.
    """
    way = "added" if label.endswith(WAYS["added"]) else "factor"
    found = located(label.removesuffix(WAYS[way]), model, parameters)
    old = parameters[found.effect, found.name][found.entities]
    new = np.clip(old + value if way == "added" else old * value, *found.bounds)
    parameters.set(found.effect, found.name, new, found.entities)


def _named(entity: str, effect: str, model: Model, count: int, label: str, file: object, field: str) -> np.ndarray:
    family = get(effect).family if effect in CATALOGUE else OWNERS.get(effect, "")
    kind = _NAMED.get(family, "")
    of = model.triangle_panel if family == "triangle" else np.arange(count)
    names = np.array([model.names[kind][k] if kind in model.names and k < len(model.names[kind]) else "" for k in of])
    chosen = np.flatnonzero(names == entity.strip())
    if not len(chosen) and kind:  # "panel 1", as tables and pictures call what has no name
        chosen = np.flatnonzero(np.array([model.name(kind, int(k)) for k in of]) == entity.strip())
    if not len(chosen) and entity.strip().isdecimal():
        chosen = np.flatnonzero(of == int(entity))
    if not len(chosen):
        allowed = ", ".join(dict.fromkeys(n for n in names if n)) or f"0 to {int(np.max(of, initial=0))}"
        raise InputError(
            f"the model has no {kind or 'entity'} of that name", file=file, field=field, value=label, allowed=allowed
        )
    return chosen
