"""Units: what a sidecar, a setting or a sheet may be stated in, and the factor that turns it into SI."""

import numpy as np

from origami_sim.errors import InputError

UNITS: dict[str, dict[str, float]] = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "force": {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3},
    "moment": {"N m": 1.0, "mN m": 1e-3, "uN m": 1e-6, "N mm": 1e-3},
    "flux density": {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "G": 1e-4},
    "flux density gradient": {"T/m": 1.0, "mT/m": 1e-3, "mT/mm": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3, "kV": 1e3},
    "current": {"A": 1.0, "mA": 1e-3},
    "magnetic moment": {"A m^2": 1.0, "mA m^2": 1e-3},
    "acceleration": {"m/s^2": 1.0, "g0": 9.80665},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "temperature": {"K": 1.0},
    "ratio": {"1": 1.0, "%": 1e-2},
    "area": {"m^2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6},
    "volume": {"m^3": 1.0, "cm^3": 1e-6, "mm^3": 1e-9},
    "curvature": {"1/m": 1.0, "1/cm": 1e2, "1/mm": 1e3},
    "frequency": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3},
    "rate": {"1/s": 1.0, "1/ms": 1e3},
    "angular rate": {"rad/s": 1.0, "deg/s": np.pi / 180.0},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "mass": {"kg": 1.0, "g": 1e-3, "mg": 1e-6},
    "inertia": {"kg m^2": 1.0, "g cm^2": 1e-7, "g mm^2": 1e-9},
    "density": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "areal density": {"kg/m^2": 1.0, "g/m^2": 1e-3, "g/cm^2": 10.0},
    "stiffness": {"N/m": 1.0, "mN/m": 1e-3, "N/mm": 1e3},
    "crease stiffness": {"N m/rad": 1.0, "mN m/rad": 1e-3, "uN m/rad": 1e-6, "N mm/rad": 1e-3},
    "crease viscosity": {"N m s/rad": 1.0, "mN m s/rad": 1e-3, "uN m s/rad": 1e-6, "N mm s/rad": 1e-3},
    "viscosity": {"N s/m": 1.0, "mN s/m": 1e-3},
}
"""Units by dimension with their factor to SI; the first of each dimension is the SI unit."""


PLAIN = ("", "-", "1")
"""How units of plain numbers are written."""

ANY = "SI"
"""Unit of a number whose kind nobody stated: any unit converts it, and none is said."""

_SIGNS = str.maketrans({"µ": "u", "μ": "u", "·": " ", "⋅": " ", "*": " ", "°": "deg", "²": "^2", "³": "^3"})
_TOGETHER = {unit.replace(" ", ""): unit for units in UNITS.values() for unit in units if " " in unit}


def spelled(unit: str) -> str:
    """A unit as `UNITS` spells it: "µm" is "um", "mNm/rad" and "mN·m/rad" are "mN m/rad"."""
    unit = " ".join(unit.translate(_SIGNS).split())
    return _TOGETHER.get(unit, unit)


def unit_factor(unit: str, *, dimension: str | None = None, file: object = None, field: str = "unit") -> float:
    """Factor that turns a number stated in `unit` into SI.

    Args:
        unit: the stated unit.
        dimension: a key of `UNITS` that the unit must have; any dimension when None.
        file: the file to name in the error.
        field: the field to name in the error.
    """
    candidates = _candidates(dimension)
    unit = spelled(unit)
    if unit not in candidates:
        kind = f" of {dimension}" if dimension else ""
        raise InputError(f"unknown unit{kind}", file=file, field=field, value=unit, allowed=", ".join(candidates))
    return candidates[unit]


def si_unit(unit: str) -> str:
    """The SI unit of the same dimension as `unit`, which must be known."""
    return next(next(iter(group)) for group in UNITS.values() if spelled(unit) in group)


def of_unit(text: str, unit: str) -> str:
    """A number or a range as a text, followed by its unit: "0 to 5 mm"; a plain number has none to be followed by."""
    return text if unit in (ANY, *PLAIN) else f"{text} {unit}"


def in_unit(text: str, unit: str) -> str:
    """A noun followed by the unit that it is in: "a number in mm"; a plain number is in none."""
    return text if unit in PLAIN else f"{text} in {unit}"


def with_prefix(value: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit in which `value` (SI) reads between 1 and 1000, e.g. (1e3, 'mrad') for 0.0081 rad."""
    if unit == "kg" and 0.0 < abs(value) < 1.0:
        factor, prefixed = with_prefix(1e3 * value, "g")
        return 1e3 * factor, prefixed
    first = unit.split("/")[0].split(" ")[0]
    if first in ("1", "K", "kg", ANY) or "^" in first or not np.isfinite(value) or value == 0.0:
        return 1.0, unit  # nothing that takes a prefix, or a power of it
    prefixes = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n"}
    exponent = int(np.clip(3 * np.floor(np.log10(abs(value)) / 3), -9, 9))
    if unit == "rad":
        exponent = min(exponent, 0)
    return 10.0**-exponent, prefixes[exponent] + unit


def quantity(value: float, unit: str, *, digits: int = 2) -> str:
    """A quantity in words with a readable prefix, e.g. '8.1 mrad'.

    Args:
        value: the value [SI].
        unit: its SI unit.
        digits: significant digits.
    """
    rounded = float(f"{value:.{digits - 1}e}")
    factor, prefixed = with_prefix(rounded, unit)
    number = rounded * factor
    decimals = max(digits - 1 - int(np.floor(np.log10(abs(number)))), 0) if number and np.isfinite(number) else 0
    return f"{number:.{decimals}f} {prefixed}"


def _candidates(dimension: str | None) -> dict[str, float]:
    if dimension is not None:
        return UNITS[dimension]
    return {unit: factor for group in UNITS.values() for unit, factor in group.items()}
