"""Read crease patterns in the .cp format of ORIPA, Orihime and Oriedita: one line of text for each drawn line."""

import math

from ..errors import InputError
from ..files import read_bytes
from .crease_pattern import Pattern
from .drawn import listed_pattern

LETTERS = {"0": None, "1": "B", "2": "M", "3": "V", "4": None}
"""Types of lines; None: auxiliary."""


def read_cp(path, *, size=None, scale=None, merge_tolerance=None) -> Pattern:
    """Read a .cp file: `type x1 y1 x2 y2` on each line, 1 border, 2 mountain, 3 valley, 0 or 4 auxiliary.

    The format states neither lengths nor angles: the longest side is 0.2 m, and creases fold to 180 degrees. y points
    down, as on the screens of those programs.

    Args:
        path: the file.
        size: longest side of the pattern [m]. scale: length of one unit [m], instead of `size`.
        merge_tolerance: points closer than this share of the diagonal are one; None reads it off the drawing.

    Raises:
        InputError: naming the line that is no line of a drawing; or what `drawn.drawn_pattern` refuses.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is no text", file=path, allowed="lines of 'type x1 y1 x2 y2'") from None
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        ends = [_number(w) for w in words[1:]]
        if len(words) != 5 or words[0] not in LETTERS or not all(math.isfinite(x) for x in ends):
            raise InputError(
                "is no line of a crease pattern",
                file=path,
                field=f"line {number}",
                value=line.strip(),
                allowed="type x1 y1 x2 y2 with type 1 (border), 2 (mountain), 3 (valley) or 4 (auxiliary)",
            )
        lines.append((LETTERS[words[0]], ends))
    limits = {"size": size, "scale": scale, "merge_tolerance": merge_tolerance}
    return listed_pattern(lines, allowed="lines of type 1, 2 or 3", file=path, **limits)


def _number(word: str) -> float:
    """Return a coordinate, or nan for what is none."""
    try:
        return float(word)
    except ValueError:
        return math.nan
