"""Colours of strokes: CSS Color 4 (https://www.w3.org/TR/css-color-4), and which assignment each stands for."""

import colorsys
import math
import re
from importlib import import_module

BLACK, GREY = 0.25, 0.25
"""Below this brightness a stroke is black, below this saturation it has no hue."""
HUES = ((0, 20, "M"), (45, 75, "F"), (90, 165, "C"), (195, 265, "V"), (285, 335, "U"), (340, 360, "M"))
"""Degrees of hue that count as red, yellow, green, blue, magenta: wide enough for the inks of drawing programs
(#ED1C24, #FFF200, #00A651, #0072BC, #EC008C), while orange, cyan and violet stay unknown."""
TURNS = {"deg": 1.0, "grad": 0.9, "rad": 180.0 / math.pi, "turn": 360.0, "": 1.0}
"""Degrees of the units of a hue."""
FUNCTION = re.compile(r"(rgb|hsl)a?\(\s*(.*?)\s*\)", re.IGNORECASE | re.DOTALL)
NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(%|deg|grad|rad|turn)?", re.IGNORECASE)


def parse_colour(text: str, current: str | None = None) -> tuple[int, int, int, float] | None:
    """Return red, green and blue in 0 to 255 and the opacity of a CSS colour, or None if it is none.

    Args:
        text: a name, #rgb, #rrggbb (each with an opacity or without), rgb(), rgba(), hsl(), hsla() with commas or
            blanks, numbers or percentages, or currentColor.
        current: what the property `color` says where the text is currentColor; black where it says nothing.
    """
    text = text.strip()
    if text.lower() == "currentcolor":
        return (0, 0, 0, 1.0) if current is None or _current(current) else parse_colour(current)
    if function := FUNCTION.fullmatch(text):
        return _function(function[1].lower(), function[2])
    named = re.fullmatch(r"[a-zA-Z]+", text) is not None
    if not named and re.fullmatch(r"#(?:[0-9a-fA-F]{3,4}|[0-9a-fA-F]{6}|[0-9a-fA-F]{8})", text) is None:
        return None
    try:
        colour = import_module("svgelements").Color(text)  # only now: a start without drawings need not wait for it
        red, green, blue, opacity = colour.red, colour.green, colour.blue, colour.opacity
    except (ValueError, TypeError, AttributeError):
        return None
    if None in (red, green, blue, opacity):
        return None
    if named and (red, green, blue) == (0, 0, 0) and text.lower() != "black":
        return None  # what svgelements does not know it makes black
    return int(red), int(green), int(blue), float(opacity)


def letter_of(colour) -> str | None:
    """Return the assignment of a stroke colour (r, g, b), or None: Origami Simulator's six and what is near them."""
    hue, saturation, value = colorsys.rgb_to_hsv(*(c / 255.0 for c in colour))
    if value < BLACK:
        return "B"
    if saturation < GREY:
        return None
    hue *= 360.0
    near = [letter for low, high, letter in HUES if low <= hue <= high]
    return near[0] if near and value * saturation > GREY else None


def _current(text: str) -> bool:
    return text.strip().lower() in ("", "currentcolor", "inherit")


def _function(kind: str, inside: str) -> tuple[int, int, int, float] | None:
    """Return the colour of the arguments of rgb() or hsl(): three and an opacity, after a comma or a slash."""
    if "," in inside:
        parts = [p.strip() for p in inside.split(",")]
    else:
        colour, slash, opacity = inside.partition("/")
        parts = [*colour.split(), *([opacity.strip()] if slash else [])]
        if len(parts) != 3 + len(slash):
            return None
    numbers = [_number(p) for p in parts]
    if len(numbers) not in (3, 4) or any(n is None for n in numbers):
        return None
    (a, unit), (b, of_b), (c, of_c), *rest = [n for n in numbers if n is not None]
    opacity, of_opacity = rest[0] if rest else (1.0, "")
    if any(u not in ("", "%") for u in (of_b, of_c, of_opacity)):
        return None
    opacity = _clipped(opacity / 100.0 if of_opacity == "%" else opacity)
    if kind == "rgb":
        if unit not in ("", "%"):
            return None
        shares = [_clipped(x / 100.0 if u == "%" else x / 255.0) for x, u in ((a, unit), (b, of_b), (c, of_c))]
    else:
        if unit == "%":
            return None
        # without a sign saturation and lightness are percentages as well
        shares = colorsys.hls_to_rgb(a * TURNS[unit] / 360.0 % 1.0, _clipped(c / 100.0), _clipped(b / 100.0))
    red, green, blue = (round(255.0 * s) for s in shares)
    return red, green, blue, opacity


def _number(text: str) -> tuple[float, str] | None:
    """Return a number and its unit; `none` is zero."""
    if text.lower() == "none":
        return 0.0, ""
    match = NUMBER.fullmatch(text)
    if match is None or not math.isfinite(float(match[1])):
        return None
    return float(match[1]), (match[2] or "").lower()


def _clipped(share: float) -> float:
    return min(max(share, 0.0), 1.0)
