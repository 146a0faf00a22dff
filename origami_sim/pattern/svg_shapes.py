"""SVG syntax: the element tree, transforms, colours, lengths and the straight shapes as polylines."""

import math
import re
from xml.etree.ElementTree import TreeBuilder
from xml.parsers import expat

import numpy as np

from ..errors import InputError

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
CURVES = {"C": "cubic", "S": "cubic", "Q": "quadratic", "T": "quadratic", "A": "arc"}
METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6, "q": 2.5e-4}
"""Metres per physical CSS unit."""
NAMED = {
    "black": (0, 0, 0),
    "red": (255, 0, 0),
    "blue": (0, 0, 255),
    "green": (0, 128, 0),
    "lime": (0, 255, 0),
    "yellow": (255, 255, 0),
    "magenta": (255, 0, 255),
    "fuchsia": (255, 0, 255),
}


def parse_xml(data: bytes, *, file=None):
    """Return the root element; raise `InputError` for malformed XML or any DOCTYPE or entity declaration."""

    def refuse(*_):
        raise InputError(
            "the file declares a DOCTYPE or an entity, which is refused because it can expand without limit",
            file=file,
            allowed="SVG without <!DOCTYPE ...>: delete that line",
        )

    builder = TreeBuilder()
    parser = expat.ParserCreate(namespace_separator="}")
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(data, True)
        return builder.close()
    except InputError:
        raise
    except (expat.ExpatError, AssertionError, ValueError, LookupError) as error:
        raise InputError(f"malformed XML: {error}", file=file) from None


def parse_number(text, field, *, file=None) -> float:
    """Return a plain SVG number, px suffix allowed; raise `InputError` for anything else."""
    match = NUMBER.fullmatch(text.strip().removesuffix("px").strip())
    value = float(match[0]) if match else math.nan
    if not math.isfinite(value):
        raise InputError("not a number", file=file, field=field, value=text[:60], allowed="a plain number or px")
    return value


def parse_numbers(text, field, *, file=None) -> list[float]:
    """Return the numbers of a comma- or blank-separated list; raise `InputError` if anything else is in it."""
    rest = NUMBER.sub(" ", text).replace(",", " ").strip()
    values = [float(number) for number in NUMBER.findall(text)]
    if rest or not all(map(math.isfinite, values)):
        raise InputError("not a list of numbers", file=file, field=field, value=text[:60], allowed="finite numbers")
    return values


def parse_length(text) -> tuple[float, str] | None:
    """Split a CSS length into its value and lower-case unit ('' or 'px', 'mm', ...), or None if it is not one."""
    match = re.fullmatch(rf"\s*({NUMBER.pattern})\s*([a-zA-Z%]*)\s*", text or "")
    return (float(match[1]), match[2].lower()) if match and math.isfinite(float(match[1])) else None


def parse_color(text) -> tuple[int, int, int] | None:
    """Return the (r, g, b) bytes of a CSS colour, or None if it is none that we know."""
    text = text.strip().lower()
    if text in NAMED:
        return NAMED[text]
    if re.fullmatch(r"#[0-9a-f]{3}", text):
        text = "#" + "".join(2 * digit for digit in text[1:])
    if re.fullmatch(r"#[0-9a-f]{6}", text):
        return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)
    match = re.fullmatch(r"rgb\(\s*(\d+)\s*,\s*(\d+)\s*,\s*(\d+)\s*\)", text)
    return (int(match[1]), int(match[2]), int(match[3])) if match else None


def parse_transform(text, *, file=None) -> np.ndarray:
    """Return the [3, 3] matrix of an SVG transform list (matrix, translate, scale, rotate)."""
    total = np.eye(3)
    names = "matrix, translate, scale or rotate"
    if re.sub(r"\w+\s*\([^()]*\)", "", text).replace(",", "").strip():
        raise InputError("malformed transform", file=file, field="transform", value=text[:60], allowed=names)
    for name, arguments in re.findall(r"(\w+)\s*\(([^()]*)\)", text):
        step = _transform_matrix(name, parse_numbers(arguments, "transform", file=file))
        if step is None:
            raise InputError("unsupported transform", file=file, field="transform", value=text[:60], allowed=names)
        total = total @ step
    return total


def _transform_matrix(name, values) -> np.ndarray | None:
    match (name, values):
        case ("matrix", [a, b, c, d, e, f]):
            return np.array([[a, c, e], [b, d, f], [0, 0, 1]])
        case ("translate", [x]):
            return _translation(x, 0.0)
        case ("translate", [x, y]):
            return _translation(x, y)
        case ("scale", [x]):
            return np.diag([x, x, 1.0])
        case ("scale", [x, y]):
            return np.diag([x, y, 1.0])
        case ("rotate", [angle]):
            return _rotation(angle)
        case ("rotate", [angle, x, y]):
            return _translation(x, y) @ _rotation(angle) @ _translation(-x, -y)
    return None


def _translation(x, y) -> np.ndarray:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _rotation(degrees) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def shape_polylines(tag, attributes, *, file=None) -> list[list[tuple[float, float]]]:
    """Return the polylines, in user units, of a line, rect, polygon, polyline or path."""

    def get(name):
        return parse_number(attributes.get(name, "0"), f"{tag} {name}", file=file)

    if tag == "line":
        return [[(get("x1"), get("y1")), (get("x2"), get("y2"))]]
    if tag == "rect":
        x, y, w, h = get("x"), get("y"), get("width"), get("height")
        if w <= 0 or h <= 0:
            raise InputError("rect without area", file=file, field="rect width/height", value=[w, h])
        if get("rx") > 0 or get("ry") > 0:
            raise InputError("rect with rounded corners", file=file, field="rx", allowed="straight lines")
        return [[(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)]]
    if tag == "path":
        return path_polylines(attributes.get("d", ""), file=file)
    values = parse_numbers(attributes.get("points", ""), f"{tag} points", file=file)
    if len(values) % 2:
        raise InputError("odd number of coordinates", file=file, field=f"{tag} points", value=len(values))
    points = list(zip(values[::2], values[1::2], strict=True))
    return [points + points[:1] if tag == "polygon" else points]


def path_polylines(d, *, file=None) -> list[list[tuple[float, float]]]:
    """Return the polylines of path data with M, L, H, V and Z, absolute or relative; curves are refused by name."""
    lines: list[list[tuple[float, float]]] = []
    x = y = 0.0
    pieces = re.findall(r"([a-df-zA-DF-Z])([^a-df-zA-DF-Z]*)", d)
    if re.sub(r"[a-df-zA-DF-Z][^a-df-zA-DF-Z]*", "", d).strip():
        raise InputError("path data does not start with a command", file=file, field="path d", value=d[:60])
    for letter, text in pieces:
        command, relative = letter.upper(), letter.islower()
        if command in CURVES:
            raise InputError(
                f"path with a curve ({CURVES[command]}, command '{letter}')",
                file=file,
                field="path d",
                value=d[:60],
                allowed="straight commands M L H V Z",
            )
        width = {"M": 2, "L": 2, "H": 1, "V": 1, "Z": 0}.get(command)
        values = parse_numbers(text, "path d", file=file)
        if width is None or (len(values) % width or not values if width else values) or (command != "M" and not lines):
            raise InputError("malformed path data", file=file, field="path d", value=d[:60], allowed="M L H V Z")
        if command == "Z":
            x, y = lines[-1][0]
            lines[-1].append((x, y))
            continue
        for n in range(0, len(values), width):
            along_x, along_y = command != "V", command != "H"
            new_x = values[n] + (x if relative else 0.0) if along_x else x
            new_y = values[n + width - 1] + (y if relative else 0.0) if along_y else y
            x, y = new_x, new_y
            if command == "M" and n == 0:
                lines.append([(x, y)])
            else:
                lines[-1].append((x, y))
    return lines
