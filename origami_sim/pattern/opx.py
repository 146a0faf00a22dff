"""Read crease patterns saved by ORIPA (.opx): the XML of Java beans, one bean for each drawn line."""

import math

from ..errors import InputError
from ..files import read_bytes
from .crease_pattern import Pattern
from .drawn import listed_pattern
from .svg_drawing import parse_xml

LETTERS = {0: None, 1: "B", 2: "M", 3: "V"}
"""Assignments of ORIPA's types of lines; 0 are lines of construction."""


def read_opx(path, *, size=None, scale=None, merge_tolerance=None) -> Pattern:
    """Read an .opx file of ORIPA; lines are split where they meet, ends merged and faces found.

    The format states neither lengths nor angles: the longest side is 0.2 m, and creases fold to 180 degrees. y points
    down. Beans leave out what is zero.

    Args:
        path: the file.
        size: longest side of the pattern [m]. scale: length of one unit [m], instead of `size`.
        merge_tolerance: points closer than this share of the diagonal are one; None reads it off the drawing.

    Raises:
        InputError: malformed XML, an entity, a line without numbers, or what `drawn.drawn_pattern` refuses.
    """
    root = parse_xml(read_bytes(path), file=path)
    lines, beans = [], [e for e in root.iter("object") if str(e.get("class", "")).rpartition(".")[2] == "OriLineProxy"]
    for number, bean in enumerate(beans):
        kind, *ends = (_property(bean, name, f"line {number}", path) for name in ("type", "x0", "y0", "x1", "y1"))
        if kind not in LETTERS:
            raise InputError(
                "unknown type of line", file=path, field=f"line {number}", value=kind, allowed="0, 1, 2 or 3"
            )
        lines.append((LETTERS[int(kind)], ends))
    limits = {"size": size, "scale": scale, "merge_tolerance": merge_tolerance}
    return listed_pattern(lines, allowed="lines that ORIPA has drawn", file=path, **limits)


def _property(bean, name, field, path) -> float:
    """Return a number of a bean, 0 where it states none."""
    for entry in bean.findall("void"):
        if entry.get("property") == name:
            text = "".join(entry.itertext()).strip()
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(f"'{name}' is no number", file=path, field=field, value=text[:60], allowed="a number")
            return value
    return 0.0
