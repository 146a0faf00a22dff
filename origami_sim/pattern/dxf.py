"""Read crease patterns drawn as DXF: lines, polylines, arcs and circles, told apart by layer and colour.

Layers whose names say what they hold come first (`MountainLine`, `valley`, `border`, `cut`), else the colour: red
mountain, blue valley, green cut, yellow facet, magenta without a target, black or white border.
"""

import colorsys
import math
import re
from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..files import read_bytes
from .colours import letter_of
from .crease_pattern import Pattern
from .drawn import drawn_pattern, note_without_folds
from .svg import FLATNESS
from .svg_drawing import MAX_CHORDS

LAYERS = (("mountain", "M"), ("valley", "V"), ("border", "B"), ("boundary", "B"), ("outline", "B"), ("cut", "C"),
          ("facet", "F"))  # fmt: skip
"""Words in the names of layers, and what their lines are."""
BASIC = {1: (255, 0, 0), 2: (255, 255, 0), 3: (0, 255, 0), 4: (0, 255, 255), 5: (0, 0, 255), 6: (255, 0, 255),
         7: (0, 0, 0), 8: (65, 65, 65), 9: (128, 128, 128)}  # fmt: skip
"""AutoCAD's first nine colours; 7 is drawn black on white and white on black."""
UNITS = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 13: 1e-6, 14: 0.1}
"""Metres of the units that `$INSUNITS` states."""
BY_LAYER = 256


def read_dxf(path, *, size=None, scale=None, merge_tolerance=None, flatness=FLATNESS) -> Pattern:
    """Read a text DXF file; lines are split where they meet, ends merged and faces found.

    Args:
        path: the file.
        size: longest side of the pattern [m]. scale: length of one unit [m], instead of `size`. Without either, the
            unit of its header holds, and 0.2 m is the longest side otherwise.
        merge_tolerance: points closer than this share of the diagonal are one; None reads it off the drawing.
        flatness: largest distance of an arc from its chords, relative to the longest side.

    Raises:
        InputError: binary DXF, broken pairs of code and value, numbers that are none, nothing in a crease colour.
    """
    pairs = _pairs(read_bytes(path), path)
    metres, colours = _header(pairs)
    curves, skipped, read = [], Counter(), Counter()
    for entity in _entities(pairs, path):
        kind = entity["kind"]
        shape = SHAPES.get(kind)
        if shape is None:
            skipped[kind] += 1
            continue
        letter, shown = _letter(entity, colours)
        read[shown, letter] += 1
        if letter is None:
            continue
        corners, bulges = shape(entity)
        if corners:
            curves.append((letter, (corners, bulges)))
    ends = np.array([p for _, (corners, _) in curves for p in corners]).reshape(-1, 2)
    notes = [f"{count} lines of {shown} were left out." for (shown, letter), count in read.items() if letter is None]
    notes += [f"{count} {kind} left out." for kind, count in skipped.items()]
    if not len(ends):
        raise InputError(
            f"no line in a crease colour{'; ' if notes else ''}{' '.join(notes)}",
            file=path,
            allowed="LINE, LWPOLYLINE, POLYLINE, ARC, CIRCLE, red or blue or on layers named mountain, valley, border",
        )
    with np.errstate(over="ignore", invalid="ignore"):
        across = float(np.ptp(ends, axis=0).max()) or 1.0
    if not math.isfinite(across):
        raise InputError("the drawing has no usable size", file=path, value=across, allowed="a finite size above 0")
    tolerance = flatness * across
    segments, strokes = [], []
    for letter, (corners, bulges) in curves:
        points = [corners[0]]
        for (a, b), bulge in zip(pairwise(corners), bulges, strict=True):
            points += _chords(a, b, bulge, tolerance)
        segments += [(a, b) for a, b in pairwise(points) if a != b]
        strokes += [(letter, 1.0)] * (len(segments) - len(strokes))
    if not segments:
        raise InputError("all lines are of no length", file=path)
    upright = np.array(segments) * [1.0, -1.0]  # drawings have y downwards
    pattern = drawn_pattern(
        upright,
        strokes,
        size=size,
        scale=scale,
        stated=metres,
        merge_tolerance=merge_tolerance,
        notes=notes,
        own=lambda points: points * [1.0, -1.0],
        file=path,
    )
    note_without_folds(read, pattern.notes)
    return pattern


def _pairs(data: bytes, path) -> list[tuple[int, str]]:
    """Return the pairs of code and value that a DXF file is made of."""
    if data.startswith(b"AutoCAD Binary DXF"):
        raise InputError("is binary DXF", file=path, allowed="DXF saved as text")
    lines = data.decode("utf-8-sig", "replace").splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    found = []
    for n in range(0, len(lines) - 1, 2):
        if not re.fullmatch(r"\s*-?[0-9]{1,4}\s*", lines[n]):
            raise InputError(
                "is no pair of code and value", file=path, field=f"line {n + 1}", value=lines[n][:40],
                allowed="a whole number, and its value on the next line",
            )  # fmt: skip
        found.append((int(lines[n]), lines[n + 1].strip()))
    return found


def _header(pairs) -> tuple[float | None, dict[str, int]]:
    """Return the length of a unit [m] or None, and the colours of the layers."""
    metres, colours, layer = None, {}, None
    for (code, value), (after, stated) in pairwise([*pairs, (0, "")]):
        if code == 9 and value == "$INSUNITS" and after == 70 and re.fullmatch(r"[0-9]{1,3}", stated):
            metres = UNITS.get(int(stated))
        if code == 0:
            layer = "" if value == "LAYER" else None
        elif code == 2 and layer == "":
            layer = value
        elif code == 62 and layer and re.fullmatch(r"-?[0-9]{1,4}", value):
            colours[layer] = abs(int(value))
    return metres, colours


def _entities(pairs, path):
    """Yield the entities: their kind, layer, colour and numbers by code; a polyline with its vertices."""
    inside, section, polyline = False, "", None
    groups: list[tuple[str, list[tuple[int, str]]]] = []
    for code, value in pairs:
        if code == 0:
            groups.append((value, []))
        elif groups:
            groups[-1][1].append((code, value))
    for kind, values in groups:
        if kind == "SECTION":
            section = dict(values).get(2, "")
        inside = section == "ENTITIES" and kind not in ("SECTION", "ENDSEC", "EOF")
        if not inside:
            continue
        entity = {"kind": kind, "layer": "0", "colour": BY_LAYER, "numbers": defaultdict(list)}
        for code, value in values:
            if code == 8:
                entity["layer"] = value
            elif code in (62, 420):
                entity["colour" if code == 62 else "true"] = int(_number(value, kind, path))
            elif 10 <= code < 60 or code in (70, 210, 220, 230):
                entity["numbers"][code].append(_number(value, kind, path))
        if kind == "POLYLINE":
            polyline = entity
            entity["corners"] = []
        elif kind == "VERTEX" and polyline is not None:
            polyline["corners"].append(entity["numbers"])
        elif kind == "SEQEND":
            if polyline is not None:
                yield polyline
            polyline = None
        else:
            yield entity


def _number(text, kind, path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError("is no number", file=path, field=kind, value=text[:40], allowed="a finite number")
    return value


def _letter(entity, colours) -> tuple[str | None, str]:
    """Return the assignment of an entity by its layer or colour, None where there is none, and how to call it."""
    name = entity["layer"].lower()
    if "true" in entity:
        rgb = tuple((entity["true"] >> shift) & 255 for shift in (16, 8, 0))
    else:
        index = entity["colour"] if entity["colour"] != BY_LAYER else colours.get(entity["layer"], 7)
        rgb = _rgb(index)
    named = [letter for word, letter in LAYERS if word in name]
    shown = f"layer '{entity['layer'][:40]}' in colour {rgb[0]},{rgb[1]},{rgb[2]}"
    return named[0] if named else letter_of(rgb), shown


def _rgb(index: int) -> tuple[int, int, int]:
    """Return a colour of AutoCAD's index: nine basic ones, 24 hues in ten shades, six greys."""
    if index in BASIC:
        return BASIC[index]
    if 10 <= index < 250:
        shade = (1.0, 0.65, 0.5, 0.3, 0.15)[index % 10 // 2]
        r, g, b = colorsys.hsv_to_rgb((index - 10) // 10 * 15 / 360.0, 0.5 if index % 2 else 1.0, shade)
        return round(255 * r), round(255 * g), round(255 * b)
    grey = {250: 51, 251: 80, 252: 105, 253: 130, 254: 190}.get(index, 0)
    return grey, grey, grey


def _line(entity):
    at = entity["numbers"]
    corners = [(_first(at, 10), _first(at, 20)), (_first(at, 11), _first(at, 21))]
    return corners, [0.0]


def _light(entity):
    at = entity["numbers"]
    corners = list(zip(at[10], at[20], strict=False))
    bulges = [*at[42], *[0.0] * len(corners)][: len(corners)] if len(at[42]) == len(corners) else [0.0] * len(corners)
    return _closed(corners, bulges, at)


def _heavy(entity):
    corners = [(_first(v, 10), _first(v, 20)) for v in entity["corners"]]
    return _closed(corners, [_first(v, 42) for v in entity["corners"]], entity["numbers"])


def _closed(corners, bulges, at):
    if len(corners) > 1 and int(_first(at, 70)) & 1:
        return [*corners, corners[0]], bulges
    return corners, bulges[: max(len(corners) - 1, 0)]


def _arc(entity):
    at = entity["numbers"]
    x, y, r = _first(at, 10), _first(at, 20), _first(at, 40)
    first, last = (0.0, 360.0) if entity["kind"] == "CIRCLE" else (_first(at, 50), _first(at, 51))
    sweep = (last - first) % 360.0 or 360.0
    turns = [math.radians(first + sweep * n / 3) for n in range(4)]
    corners = [(x + r * math.cos(t), y + r * math.sin(t)) for t in turns]
    return corners, [math.tan(math.radians(sweep) / 12)] * 3  # three arcs


SHAPES = {"LINE": _line, "LWPOLYLINE": _light, "POLYLINE": _heavy, "ARC": _arc, "CIRCLE": _arc}


def _first(numbers, code) -> float:
    return numbers[code][0] if numbers[code] else 0.0


def _chords(a, b, bulge, tolerance) -> list[tuple[float, float]]:
    """Return the corners after `a` of an arc from a to b; its bulge is the tangent of a quarter of its angle."""
    if not bulge or a == b:
        return [b]
    angle = 4.0 * math.atan(bulge)
    dx, dy = b[0] - a[0], b[1] - a[1]
    radius = math.hypot(dx, dy) / (2.0 * abs(math.sin(angle / 2.0)))
    # a chord over an angle h is off by the radius times h^2 / 8
    count = min(max(math.ceil(abs(angle) / math.sqrt(8.0 * tolerance / radius)), 1), MAX_CHORDS)
    high = 1.0 / math.tan(angle / 2.0)
    cx, cy = (a[0] + b[0] - high * dy) / 2.0, (a[1] + b[1] + high * dx) / 2.0
    turns = [angle * n / count for n in range(1, count)]
    ax, ay = a[0] - cx, a[1] - cy
    return [
        *((cx + ax * math.cos(t) - ay * math.sin(t), cy + ax * math.sin(t) + ay * math.cos(t)) for t in turns),
        b,
    ]
