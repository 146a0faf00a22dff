"""How large a pattern is: what the user says, else what the file says, else a sheet of a hand's size."""

from ..errors import InputError
from ..quantities import converted
from .checks import check_positive

DEFAULT_SIZE = 0.2
"""Longest side of a pattern whose file states no physical length [m]: a sheet of origami paper."""


def metres_of(extent, *, size=None, scale=None, stated=None, notes, file=None) -> float:
    """Return the length of one unit of a drawing [m] and note where it comes from.

    Args:
        extent: longest side of the drawing, in its own unit.
        size: longest side wanted [m]. scale: length of one unit wanted [m]. Both as a number or as text with a unit.
        stated: length of one unit by the file [m], or None.
        notes: list that takes the sentence. file: named in errors.

    Raises:
        InputError: both size and scale, or one that is no length above 0.
    """
    if size is not None and scale is not None:
        raise InputError("size and scale exclude each other", file=file, field="scale", value=scale, allowed="one")
    if scale is not None:
        return check_positive("scale", converted(scale, "m", "scale"))
    if size is not None:
        return check_positive("size", converted(size, "m", "size")) / extent
    if stated is not None:
        notes.append(f"the file states its size: one unit is {stated * 1e3:.6g} mm.")
        return stated
    notes.append(f"no physical size in the file: the longest side is taken as {DEFAULT_SIZE:g} m (size=, scale=).")
    return DEFAULT_SIZE / extent
