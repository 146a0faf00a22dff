"""Length units that pattern files may name."""

from ..errors import InputError

LENGTH_UNITS = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "in": 0.0254,
    "ft": 0.3048,
    "pt": 0.0254 / 72.0,
    "unit": 1.0,
}
"""Metres per unit; 'unit' is a file without a physical scale, taken as metre."""


def metres_per(unit, *, file=None, field="unit") -> float:
    """Return the metres in one `unit`; raise `InputError` for an unknown unit."""
    if not isinstance(unit, str) or unit not in LENGTH_UNITS:
        shown = unit if isinstance(unit, str) else type(unit).__name__
        raise InputError("unknown length unit", file=file, field=field, value=shown, allowed=", ".join(LENGTH_UNITS))
    return LENGTH_UNITS[unit]
