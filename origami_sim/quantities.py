"""Quantities with a unit, as on the command line: "2.54 mm" is a length. Everything behind this edge is SI."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.units import ANY, PLAIN, UNITS, in_unit, spelled

_TEXT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d.\s].*|1/.*)?")
_FACTORS = {unit: (kind, factor) for kind, units in UNITS.items() for unit, factor in units.items()}


class Quantity(float):
    """A number in SI that remembers the SI unit that it was stated in; arithmetic makes it a plain number."""

    unit: str

    def __new__(cls, value: float, unit: str) -> "Quantity":
        out = super().__new__(cls, value)
        out.unit = unit
        return out

    def __getnewargs__(self) -> tuple[float, str]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return float(self), self.unit


def si(text: str | float) -> Quantity:
    """The number in SI that a quantity stands for: si("2.54 mm") is 0.00254, and `.unit` is "m".

    Raises:
        InputError: not a number, a unit that nobody knows.
    """
    if isinstance(text, str):
        return parsed(text)
    return text if isinstance(text, Quantity) else Quantity(text, ANY)


def parsed(text: str, unit: str = ANY, *, file: object = None, field: str | None = None) -> Quantity:
    """A number with an optional unit, in SI; without a unit of its own it is in `unit`.

    Args:
        unit: the SI unit that its unit has to convert to; "SI" for any.

    Raises:
        InputError: not a number, or a unit of another kind.
    """
    match = _TEXT.fullmatch(text.strip())
    if not match:
        wanted = "a number, with a unit if need be" if unit == ANY else in_unit("a number", unit)
        raise InputError("not a number", file=file, field=field, value=text, allowed=wanted)
    number, given = float(match[1]), spelled(match[2] or "")
    if not given or given == unit:
        return Quantity(number, unit)
    if unit == ANY:
        if given not in _FACTORS:
            raise InputError("unknown unit", file=file, field=field, value=given, allowed=", ".join(_FACTORS))
        kind, factor = _FACTORS[given]
        return Quantity(number * factor, next(iter(UNITS[kind])))
    kind = _FACTORS.get("1" if unit in PLAIN else unit, ("", 1.0))[0]
    if given not in _FACTORS or _FACTORS[given][0] != kind:
        allowed = ", ".join(UNITS.get(kind, {unit: 1.0}))
        raise InputError("wrong unit", file=file, field=field, value=given, allowed=allowed)
    return Quantity(number * _FACTORS[given][1], unit)


def _stated(text: str, unit: str, field: str) -> Quantity:
    """A text that is a quantity with a unit of its own, unless what it is of has none."""
    out, match = parsed(text, unit, field=field), _TEXT.fullmatch(text.strip())
    if unit not in (ANY, *PLAIN) and match is not None and not match[2]:
        allowed = f"a text such as '{text.strip()} {unit}', or the number alone, which is in {unit}"
        raise InputError("a text without a unit", field=field, value=text, allowed=allowed)
    return out


def converted(value: Any, unit: str, field: str) -> Any:
    """A value in which every text is a quantity, in SI; numbers and what is no number pass through as they are.

    A text states its unit, where what it is of has one: "30" for 30 m is refused, and 30 is taken.

    Raises:
        InputError: a text that is no quantity of this unit or has none, true or false.
    """
    if isinstance(value, (bool, np.bool_)):
        raise InputError("a switch is no number", field=field, value=bool(value), allowed="a number, or a quantity")
    if isinstance(value, str):
        return _stated(value, unit, field)
    if isinstance(value, np.ndarray) and value.dtype.kind in "US":
        return np.array([_stated(str(v), unit, field) for v in value.flat], float).reshape(value.shape)
    if isinstance(value, Sequence) and any(isinstance(v, (str, Sequence, np.ndarray)) for v in value):
        return [converted(v, unit, field) for v in value]
    return value
