"""Read crease patterns drawn in the SVG convention of Origami Simulator (https://origamisimulator.org).

Stroke colours: black border, red mountain, blue valley, green cut, yellow facet (flat), magenta undriven. Opacity
times 180 degrees is the target fold angle of mountains and valleys.
"""

import math
import re
from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .assemble import assemble
from .checks import COORDINATE_LIMIT
from .crease_pattern import Pattern
from .files import read_bytes
from .planar import drop_holes, planar_faces, split_segments
from .svg_shapes import (
    METRES,
    parse_color,
    parse_length,
    parse_number,
    parse_numbers,
    parse_transform,
    parse_xml,
    shape_polylines,
)
from .topology import edge_key, face_sides
from .units import metres_per

STROKES = {
    (0, 0, 0): "B",
    (255, 0, 0): "M",
    (0, 0, 255): "V",
    (0, 128, 0): "C",
    (0, 255, 0): "C",
    (255, 255, 0): "F",
    (255, 0, 255): "U",
}
PRIORITY = "BCMVFU"
"""Which assignment an edge keeps where lines lie on each other."""
CONTAINERS = ("svg", "g", "a", "switch")
STRAIGHT = ("line", "path", "rect", "polygon", "polyline")
ROUND = ("circle", "ellipse")
MAX_DEPTH = 100
MAX_SEGMENTS = 20_000


@dataclass(frozen=True)
class Style:
    """Presentation inherited down the tree: transform, stroke, the opacities so far and whether it is drawn."""

    transform: np.ndarray
    stroke: str = "none"
    opacity: float = 1.0
    stroke_opacity: float = 1.0
    drawn: bool = True


class Drawing:
    """Straight coloured strokes collected from an SVG tree, in user units."""

    def __init__(self, file):
        self.file = file
        self.starts: list = []
        self.ends: list = []
        self.strokes: list[tuple[str, float]] = []
        self.unknown: Counter = Counter()
        self.skipped: Counter = Counter()
        self.rules: dict[str, str] = {}

    def visit(self, element, style, depth=0) -> None:
        """Collect the strokes of `element` and what is inside it."""
        if depth > MAX_DEPTH:
            raise InputError("groups nested too deeply", file=self.file, allowed=f"{MAX_DEPTH} levels")
        tag = element.tag.rpartition("}")[2]
        style = self.restyled(element.attrib, style)
        if not style.drawn:
            return
        if tag in CONTAINERS:
            for child in element:
                self.visit(child, style, depth + 1)
        elif tag in STRAIGHT + ROUND:
            self.add_shape(tag, element.attrib, style)
        elif tag in ("use", "image", "text"):
            self.skipped[f"<{tag}>"] += 1

    def restyled(self, attributes, style) -> Style:
        """Return the style that an element with these attributes has inside a parent of `style`."""
        own = dict(attributes)
        for name in attributes.get("class", "").split():
            own |= _declarations(self.rules.get(name, ""))
        own |= _declarations(attributes.get("style", ""))
        transform = style.transform
        if "transform" in attributes:
            transform = transform @ parse_transform(attributes["transform"], file=self.file)
        hidden = own.get("display") == "none" or own.get("visibility") in ("hidden", "collapse")
        return Style(
            transform=transform,
            stroke=style.stroke if own.get("stroke", "inherit") == "inherit" else own["stroke"],
            opacity=style.opacity * self.opacity(own, "opacity", 1.0),
            stroke_opacity=self.opacity(own, "stroke-opacity", style.stroke_opacity),
            drawn=style.drawn and not hidden,
        )

    def opacity(self, own, name, default) -> float:
        """Return an opacity as a fraction, limited to [0, 1] as SVG does."""
        text = own.get(name, "inherit").strip()
        if text == "inherit":
            return default
        value = parse_number(text.removesuffix("%"), name, file=self.file) / (100.0 if text.endswith("%") else 1.0)
        return min(max(value, 0.0), 1.0)

    def add_shape(self, tag, attributes, style) -> None:
        """Add the segments of one shape, or remember why it was left out."""
        if style.stroke.strip() in ("none", "transparent"):
            self.skipped[f"<{tag}> without stroke"] += 1
            return
        colour = parse_color(style.stroke)
        letter = STROKES.get(colour) if colour else None
        if letter is None:
            self.unknown[style.stroke[:40]] += 1
            return
        if tag in ROUND:
            raise InputError(f"<{tag}> is a curve", file=self.file, field=tag, allowed="straight lines")
        opacity = style.opacity * style.stroke_opacity
        for polyline in shape_polylines(tag, attributes, file=self.file):
            points = np.array([(x, y, 1.0) for x, y in polyline]).reshape(-1, 3) @ style.transform.T
            for start, end in zip(points[:-1, :2], points[1:, :2], strict=True):
                self.starts.append(start)
                self.ends.append(end)
                self.strokes.append((letter, opacity))


def _declarations(text) -> dict[str, str]:
    pairs = (part.partition(":") for part in text.split(";") if ":" in part)
    return {name.strip().lower(): value.replace("!important", "").strip() for name, _, value in pairs}


def read_svg(path, *, unit=None, merge_tolerance=None) -> Pattern:
    """Read an SVG crease pattern; lines are split where they meet, ends merged and faces found.

    Args:
        path: the file.
        unit: length of one user unit ('mm', 'cm', 'in', ...). None takes it from a physical width or height with a
            viewBox, and one millimetre otherwise.
        merge_tolerance: points closer than this are one [m]; None means 1e-4 of the drawing's diagonal.

    Returns:
        A flat pattern in the plane z = 0, y upwards. Colours and elements left out are told in `notes`.

    Raises:
        InputError: malformed XML, a DOCTYPE, curves, bad numbers, or nothing usable in the drawing.
    """
    root = parse_xml(read_bytes(path), file=path)
    if root.tag.rpartition("}")[2] != "svg":
        raise InputError("not an SVG file: the root element is not <svg>", file=path, value=root.tag[:60])
    drawing = Drawing(path)
    for sheet in root.iter():
        if sheet.tag.rpartition("}")[2] == "style":
            rules = re.findall(r"([^{}]*)\{([^{}]*)\}", sheet.text or "")
            drawing.rules |= {c: body for names, body in rules for c in re.findall(r"\.([\w-]+)", names)}
    notes: list[str] = []
    scale = _scale(root.attrib, unit, notes, path)
    drawing.visit(root, Style(transform=np.eye(3)))
    _note_leftovers(drawing, notes)
    if not drawing.strokes:
        colours = ", ".join(drawing.unknown) or "none"
        raise InputError(
            "no line in a crease colour",
            file=path,
            field="stroke",
            value=colours,
            allowed="black, red, blue, green, yellow, magenta",
        )
    return _pattern(drawing, scale, merge_tolerance, notes)


def _scale(attributes, unit, notes, file) -> float:
    """Return metres per user unit and note where it comes from."""
    if unit is not None:
        return metres_per(unit)
    box = parse_numbers(attributes.get("viewBox", ""), "viewBox", file=file)
    scales = []
    if len(box) == 4:
        for name, extent in (("width", box[2]), ("height", box[3])):
            value, suffix = parse_length(attributes.get(name)) or (0.0, "")
            if suffix in METRES and value > 0 and extent > 0:
                scales.append(value * METRES[suffix] / extent)
    if not scales:
        notes.append("no physical size in the file: one SVG unit is taken as 1 mm.")
        return 1e-3
    notes.append(f"one SVG unit is {min(scales) * 1e3:.6g} mm, from the physical size and the viewBox.")
    return min(scales)


def _note_leftovers(drawing, notes) -> None:
    for colour, count in drawing.unknown.items():
        notes.append(f"{count} shapes in the unknown colour {colour} were left out.")
    for what, count in drawing.skipped.items():
        notes.append(f"{count} {what} left out.")


def _pattern(drawing, scale, merge_tolerance, notes) -> Pattern:
    file = drawing.file
    starts, ends = (np.array(p) * [scale, -scale] for p in (drawing.starts, drawing.ends))
    everything = np.vstack([starts, ends])
    size = float(np.ptp(everything, axis=0).max())
    if not np.abs(everything).max() < COORDINATE_LIMIT or not size > 1e-9:
        allowed = f"1e-9 m or more across, within {COORDINATE_LIMIT:g} m of the origin"
        raise InputError("the drawing has no usable size", file=file, value=size, allowed=allowed)
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0)))
    if len(starts) > MAX_SEGMENTS:
        raise InputError("too many line segments", file=file, value=len(starts), allowed=f"up to {MAX_SEGMENTS}")
    tolerance = 1e-4 * diagonal if merge_tolerance is None else _tolerance(merge_tolerance, diagonal)
    long_enough = np.linalg.norm(ends - starts, axis=1) > tolerance
    strokes = [stroke for stroke, keep in zip(drawing.strokes, long_enough, strict=True) if keep]
    if not strokes:
        raise InputError("all lines are shorter than the merge tolerance", file=file, value=tolerance)
    points, pieces = split_segments(starts[long_enough], ends[long_enough], tolerance)

    chosen = _edges(pieces, strokes, notes)
    found = planar_faces(points, np.array(list(chosen)), file=file)
    faces, holes = drop_holes(found, {key for key, (letter, _) in chosen.items() if letter == "B"})
    if not faces:
        raise InputError("the lines enclose no face", file=file, allowed="a closed black border")
    if holes:
        notes.append(f"{holes} regions enclosed by border lines alone were taken as holes.")
    beside = Counter(edge_key(*side) for face in faces for side in face_sides(face))
    edges = [key for key in chosen if beside[key]]
    if len(edges) < len(chosen):
        notes.append(f"{len(chosen) - len(edges)} line pieces that enclose nothing were left out.")
    outer = [key for key in edges if beside[key] == 1 and chosen[key][0] not in "BC"]
    if outer:
        notes.append(f"{len(outer)} coloured edges on the outside of the sheet were taken as border.")
        chosen |= dict.fromkeys(outer, ("B", 1.0))
    used = sorted({v for face in faces for v in face})
    renumbered = {v: n for n, v in enumerate(used)}
    signs = {"M": -math.pi, "V": math.pi, "F": 0.0}
    return assemble(
        np.column_stack([points[used], np.zeros(len(used))]),
        [tuple(renumbered[v] for v in face) for face in faces],
        edges=[(renumbered[a], renumbered[b]) for a, b in edges],
        assignments=[chosen[key][0] for key in edges],
        fold_angles=[signs.get(chosen[key][0], math.nan) * chosen[key][1] for key in edges],
        notes=notes,
        file=file,
    )


def _tolerance(value, diagonal) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < 0.1 * diagonal:
        allowed = f"above 0 and below a tenth of the drawing ({0.1 * diagonal:.3g} m)"
        raise InputError("bad merge tolerance", field="merge_tolerance", value=value, allowed=allowed)
    return float(value)


def _edges(pieces, strokes, notes) -> dict[tuple[int, int], tuple[str, float]]:
    """Return (letter, opacity) by edge key, one for each, the higher `PRIORITY` where lines coincide."""
    chosen: dict[tuple[int, int], tuple[str, float]] = {}
    conflicts = set()
    for a, b, s in pieces:
        key, stroke = edge_key(a, b), strokes[s]
        other = chosen.setdefault(key, stroke)
        if other != stroke:
            conflicts.add(key)
            chosen[key] = min(other, stroke, key=lambda st: PRIORITY.index(st[0]))
    if conflicts:
        notes.append(f"{len(conflicts)} edges are drawn twice in different colours or opacities: {PRIORITY} in order.")
    return chosen
