"""Straight coloured strokes of an SVG file: the tree and its styles by svgelements, curves cut into chords."""

import io
import math
import re
from collections import Counter
from dataclasses import dataclass, field
from importlib import import_module
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ..errors import InputError
from .colours import letter_of, parse_colour
from .svg_traps import defuse

SHAPES = ("line", "path", "rect", "polygon", "polyline", "circle", "ellipse")
UNSEEN = ("marker", "mask", "metadata", "foreignObject", "linearGradient", "radialGradient", "filter", "script")
"""Elements whose insides are never lines of the drawing."""
PHYSICAL = re.compile(r"[-+.\deE\s]+(mm|cm|in|pt|pc|q)\s*$", re.IGNORECASE)
METRES_PER_PIXEL = 0.0254 / 96.0
"""CSS: 96 pixels are an inch."""
CURRENT = re.compile("currentcolor", re.IGNORECASE)
UNKNOWN = "?"
MAX_DEPTH = 100
MAX_ELEMENTS = 200_000
"""Elements after <use> has been expanded; ten times the lines of the largest tessellations seen."""
MAX_CHORDS = 500
"""Chords of one curve; a full circle of the drawing's size takes 70 at the default flatness."""


@dataclass
class Drawing:
    """Strokes in user units, y downwards, and what was left out.

    Attributes:
        segments: [S, 2, 2] start and end of each straight piece.
        strokes: S pairs (assignment letter, opacity).
        origin: [2] of user coordinates, which a viewBox moves, in these units.
        metres: length of a user unit if the file states a physical size, else None.
        others: [O, 2, 2] the same of strokes in colours that are no crease colour.
        unknown: those colours. read: how many shapes by how their strokes look and what they were read as.
        skipped: elements left out. curves: how many were cut into chords.
    """

    segments: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 2)))
    strokes: list[tuple[str, float]] = field(default_factory=list)
    others: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 2)))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(2))
    metres: float | None = None
    unknown: Counter = field(default_factory=Counter)
    read: Counter = field(default_factory=Counter)
    skipped: Counter = field(default_factory=Counter)
    curves: int = 0


def _svgelements() -> Any:
    """Return the library, only now: a start without drawings need not wait for it."""
    return import_module("svgelements")


def parse_xml(data: bytes, *, file=None):
    """Return the root element; a DOCTYPE is passed over, and no entity is ever expanded or fetched.

    Raises:
        InputError: malformed XML, groups nested too deeply, or an entity declaration, which can expand without limit.
    """
    depth = 0

    def refuse(*_):
        raise InputError(
            "the file declares an entity, which is refused because it can expand without limit",
            file=file,
            allowed="SVG without <!ENTITY ...>: save it as plain SVG",
        )

    def start(name, attributes):
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise InputError("groups nested too deeply", file=file, allowed=f"{MAX_DEPTH} levels")
        builder.start(_clark(name), {_clark(key): value for key, value in attributes.items()})

    def end(name):
        nonlocal depth
        depth -= 1
        builder.end(_clark(name))

    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate(namespace_separator="}")
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(data, True)
        return builder.close()
    except InputError:
        raise
    except (expat.ExpatError, AssertionError, ValueError, LookupError) as error:
        raise InputError(f"malformed XML: {error}", file=file) from None


def _clark(name) -> str:
    return "{" + name if "}" in name else name


def _tag(element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def read_drawing(data: bytes, flatness: float, *, file=None) -> Drawing:
    """Return the strokes of an SVG file.

    Args:
        data: the file's content.
        flatness: largest distance of a curve from its chords, relative to the longest side of the drawing.
        file: named in errors.

    Raises:
        InputError: not SVG, a file that svgelements cannot read, or <use> elements that expand without end.
    """
    svg = _svgelements()
    root = parse_xml(data, file=file)
    if _tag(root) != "svg":
        raise InputError("not an SVG file: the root element is not <svg>", file=file, value=root.tag[:60])
    for parent in list(root.iter()):
        for child in [c for c in parent if _tag(c) in UNSEEN]:
            parent.remove(child)
    _refuse_explosion(root, file)
    defuse(root, file=file)
    _keep_current_colour(root)
    drawing = Drawing()
    try:
        tree = svg.SVG.parse(io.BytesIO(ElementTree.tostring(root)), reify=True, ppi=96.0, on_error="raise")
        matrix = svg.Matrix(tree.viewbox_transform) if isinstance(tree, svg.SVG) else svg.Matrix()
        pixels = math.sqrt(abs(matrix.a * matrix.d - matrix.b * matrix.c)) or 1.0
        shapes = [(s, style) for s, style in _drawn(tree, 1.0) if isinstance(s, svg.Shape)]
        paths = []
        for shape, opacity in shapes:
            stroke = _stroke(shape, drawing)
            if stroke is not None:
                paths.append((stroke[0], stroke[1] * opacity, shape.segments(transformed=True)))
        size = _extent(paths)
        segments, others = [], []
        for letter, opacity, path in paths:
            for segment in path:
                points = _chords(segment, flatness * size)
                if letter == UNKNOWN:
                    others += pairwise(points)
                    continue
                drawing.curves += len(points) > 2
                segments += pairwise(points)
                drawing.strokes += [(letter, opacity)] * max(len(points) - 1, 0)
    except RecursionError:
        raise InputError("groups nested too deeply", file=file, allowed=f"{MAX_DEPTH} levels") from None
    except Exception as error:  # a third-party parser: whatever it trips over is the file's fault
        detail = f"{type(error).__name__}: {str(error)[:120]}".rstrip(": ")
        raise InputError(f"cannot read the drawing ({detail})", file=file, allowed="well-formed SVG shapes") from None
    drawing.segments = np.array(segments, dtype=np.float64).reshape(-1, 2, 2) / pixels
    drawing.others = np.array(others, dtype=np.float64).reshape(-1, 2, 2) / pixels
    drawing.origin = np.array([matrix.e, matrix.f]) / pixels
    if any(PHYSICAL.fullmatch(root.attrib.get(name, "")) for name in ("width", "height")):
        drawing.metres = METRES_PER_PIXEL * pixels
    for tag in ("text", "image"):
        count = sum(_tag(e) == tag for e in root.iter())
        if count:
            drawing.skipped[f"<{tag}>"] += count
    return drawing


def _keep_current_colour(root) -> None:
    """Spell currentColor so that the parser leaves it: a child inherits the word, not the colour of its group."""
    for element in root.iter():
        for name in ("stroke", "style"):
            if name in element.attrib:
                element.attrib[name] = CURRENT.sub("currentcolor", element.attrib[name])
        if _tag(element) == "style" and element.text:
            element.text = CURRENT.sub("currentcolor", element.text)


def _refuse_explosion(root, file) -> None:
    """Raise `InputError` if <use> refers to itself or multiplies the drawing beyond `MAX_ELEMENTS`."""
    named = {e.attrib["id"]: e for e in root.iter() if "id" in e.attrib}
    sizes: dict = {}
    growing: set = set()

    def size(element) -> int:
        if element in growing:
            raise InputError("a <use> element refers to itself", file=file, field="use")
        if element not in sizes:
            growing.add(element)
            total = 1 + sum(size(child) for child in element)
            if _tag(element) == "use":
                link = element.attrib.get("href") or element.attrib.get("{http://www.w3.org/1999/xlink}href") or ""
                target = named.get(link[1:])
                total += size(target) if target is not None else 0
            growing.discard(element)
            sizes[element] = total
        return sizes[element]

    try:
        count = size(root)
    except RecursionError:
        raise InputError("<use> elements refer to each other too deeply", file=file, field="use") from None
    if count > MAX_ELEMENTS:
        raise InputError("too many elements", file=file, value=count, allowed=f"up to {MAX_ELEMENTS}")


def _drawn(element, opacity):
    """Yield (element, opacity so far) of a tree of svgelements."""
    own = getattr(element, "values", None) or {}
    own = own.get("attributes") or {}
    opacity *= _fraction(own.get("opacity"))
    yield element, opacity
    if isinstance(element, list):  # groups and clones
        for child in element:
            yield from _drawn(child, opacity)


def _fraction(text, default=1.0) -> float:
    """Return an opacity in [0, 1]; what is none counts as `default`, as browsers have it."""
    try:
        text = (text or "").strip()
        value = float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
    except ValueError:
        return default
    return min(max(value, 0.0), 1.0) if math.isfinite(value) else default


def _stroke(shape, drawing) -> tuple[str, float] | None:
    """Return (letter, opacity) of a shape's own stroke, `UNKNOWN` for a colour that means nothing, or None if there is
    none."""
    values = shape.values
    tag = values.get("tag", "shape")
    if values.get("visibility") in ("hidden", "collapse"):
        return None
    text = re.sub(r"\s*!important\s*$", "", values.get("stroke", "none")).strip()
    if text in ("none", "transparent", ""):
        drawing.skipped[f"<{tag}> without stroke"] += 1
        return None
    colour = parse_colour(text, values.get("color"))
    letter = letter_of(colour[:3]) if colour else None
    dashes = values.get("stroke-dasharray") or "none"
    drawing.read[f"stroke {text[:40]}" + (f" dashed {dashes[:20]}" if dashes != "none" else ""), letter] += 1
    if letter is None or colour is None:
        drawing.unknown[text[:40]] += 1
        return UNKNOWN, 1.0
    return letter, colour[3] * _fraction(values.get("stroke-opacity"))


def _extent(paths) -> float:
    """Return the longest side of the box around the ends of all segments, or 1 if there are none."""
    ends = [(p.x, p.y) for *_, path in paths for segment in path for p in (segment.start, segment.end) if p is not None]
    with np.errstate(over="ignore", invalid="ignore"):
        size = float(np.ptp(np.array(ends), axis=0).max()) if ends else 1.0
    return size if math.isfinite(size) and size > 0.0 else 1.0


def _chords(segment, tolerance) -> list[tuple[float, float]]:
    """Return the corners of the chords that stand for one segment of a path."""
    svg = _svgelements()
    if isinstance(segment, svg.Move) or segment.start is None or segment.end is None:
        return []
    if isinstance(segment, svg.Arc):
        pieces = [_chords(cubic, tolerance) for cubic in segment.as_cubic_curves()]
        return [p for n, piece in enumerate(pieces) for p in piece[min(n, 1) :]] or _ends(segment)
    if isinstance(segment, svg.CubicBezier):
        control = [segment.start, segment.control1, segment.control2, segment.end]
    elif isinstance(segment, svg.QuadraticBezier):
        control = [segment.start, segment.control, segment.end]
    else:
        return _ends(segment)
    p = np.array([(c.x, c.y) for c in control])
    bend = float(np.linalg.norm(np.diff(p, 2, axis=0), axis=1).max())
    degree = len(p) - 1
    # a chord over a parameter step h is off by h^2 / 8 of the second derivative, at most degree (degree - 1) * bend
    count = math.sqrt(degree * (degree - 1) * bend / (8.0 * tolerance))
    count = int(min(max(math.ceil(count), 1), MAX_CHORDS)) if math.isfinite(count) else 1
    t = np.linspace(0.0, 1.0, count + 1)[:, None]
    curve = sum(math.comb(degree, k) * (1 - t) ** (degree - k) * t**k * p[k] for k in range(degree + 1))
    return [(float(x), float(y)) for x, y in np.asarray(curve)]


def _ends(segment) -> list[tuple[float, float]]:
    return [(segment.start.x, segment.start.y), (segment.end.x, segment.end.y)]
