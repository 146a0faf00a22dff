"""The catalogue of physical effects: every module of this folder that defines EFFECT."""

import importlib
import pkgutil

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.effects._effect import (
    CONTACTS,
    DISTORTIONS,
    DRIVES,
    FAMILIES,
    HINGES,
    PAIRS,
    SHELLS,
    Effect,
    Memory,
    Parameter,
    scalar,
)
from origami_sim.errors import InputError, nearest

__all__ = [
    "CATALOGUE", "CONTACTS", "DISTORTIONS", "DRIVES", "FAMILIES", "HINGES", "PAIRS", "SHELLS", "Effect", "Memory",
    "Parameter", "get", "scalar",
]  # fmt: skip


def _discover() -> dict[str, Effect]:
    found = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")):
        effect = importlib.import_module(f"{__name__}.{module}").EFFECT
        if effect.name != module:
            raise ValueError(f"effects/{module}.py defines the effect '{effect.name}'; name the file after it")
        found[effect.name] = effect
    return found


CATALOGUE: dict[str, Effect] = _discover()
"""All effects by name."""


def get(name: str) -> Effect:
    """The effect of that name; raises InputError naming the catalogue if there is none."""
    if name not in CATALOGUE:
        fault = f"there is no such effect{nearest(name, CATALOGUE)}"
        raise InputError(fault, field="effect", value=name, allowed=", ".join(CATALOGUE))
    return CATALOGUE[name]
