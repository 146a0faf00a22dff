"""Read crease patterns drawn in the SVG convention of Origami Simulator (https://origamisimulator.org).

Stroke colours: black border, red mountain, blue valley, green cut, yellow facet (flat), magenta undriven. Opacity
times 180 degrees is the target fold angle of mountains and valleys.
"""

import numpy as np

from ..errors import InputError
from ..files import read_bytes
from .checks import check_number
from .crease_pattern import Pattern
from .drawn import drawn_pattern, note_without_folds
from .planar import APART, crossing_points
from .svg_drawing import read_drawing

FLATNESS = 1e-3
"""Largest distance of a curve from its chords, relative to the drawing's longest side: some 9 chords for a quarter
circle as wide as half the sheet. Half of it makes 1.4 times as many panels along a curve, double 0.7 times."""


def read_svg(path, *, size=None, scale=None, merge_tolerance=None, flatness=FLATNESS) -> Pattern:
    """Read an SVG crease pattern; lines are split where they meet, ends merged and faces found.

    Args:
        path: the file.
        size: longest side of the pattern [m]. scale: length of one user unit [m], instead of `size`. Without either,
            a width or height in a physical unit (mm, cm, in, pt) holds, and 0.2 m is the longest side otherwise.
        merge_tolerance: points closer than this are one, relative to the drawing's diagonal; None reads it off the
            drawing (see `planar.merge_distance`).
        flatness: largest distance of a curve from the chords that stand for it, relative to the longest side.

    Returns:
        A flat pattern in the plane z = 0, y upwards. Colours and elements left out are told in `notes`.

    Raises:
        InputError: malformed XML, an entity, bad numbers, or nothing usable in the drawing.
    """
    check_number("flatness", flatness, low=1e-9, high=0.05, allowed="a share of the drawing, 1e-9 to 0.05")
    drawing = read_drawing(read_bytes(path), flatness, file=path)
    if not drawing.strokes:
        colours = ", ".join(drawing.unknown) or "none"
        raise InputError(
            "no line in a crease colour",
            file=path,
            field="stroke",
            value=colours,
            allowed="black, red, blue, green, yellow, magenta",
        )
    notes: list[str] = []
    border = np.zeros((0, 2, 2)) if any(letter in "BC" for letter, _ in drawing.strokes) else _outline(drawing)
    if len(border):
        notes.append(f"no border in black: the outline in {', '.join(drawing.unknown)} was taken as border.")
        drawing.unknown.clear()
    _note_leftovers(drawing, notes)
    pattern = drawn_pattern(
        np.concatenate([drawing.segments, border]),
        [*drawing.strokes, *[("B", 1.0)] * len(border)],
        size=size,
        scale=scale,
        stated=drawing.metres,
        merge_tolerance=merge_tolerance,
        notes=notes,
        own=lambda points: points - drawing.origin,
        file=path,
    )
    note_without_folds(drawing.read, pattern.notes)
    return pattern


def _outline(drawing) -> np.ndarray:
    """Return the outline [S, 2, 2] of what lines in unknown colours enclose, if all others lie in it, else nothing."""
    from shapely import get_coordinates, linestrings, multipoints, polygonize, union_all  # only here: slow to import

    nothing = np.zeros((0, 2, 2))
    if not len(drawing.others) or not np.isfinite(drawing.others).all() or not np.isfinite(drawing.segments).all():
        return nothing
    try:
        crossing_points(drawing.others[:, 0], drawing.others[:, 1])
    except InputError:  # scribble
        return nothing
    lines = union_all(linestrings(drawing.others))
    sheet = union_all(polygonize([lines]))
    across = float(np.ptp(drawing.segments.reshape(-1, 2), axis=0).max())
    ends = multipoints(drawing.segments.reshape(-1, 2))
    if sheet.geom_type != "Polygon" or not sheet.buffer(APART * across).covers(ends):
        return nothing
    rings = [get_coordinates(ring) for ring in (sheet.exterior, *sheet.interiors)]  # pyright: ignore
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


def _note_leftovers(drawing, notes) -> None:
    if drawing.curves:
        notes.append(f"{drawing.curves} curves were cut into chords.")
    for colour, count in drawing.unknown.items():
        notes.append(f"{count} shapes in the unknown colour {colour} were left out.")
    for what, count in drawing.skipped.items():
        notes.append(f"{count} {what} left out.")
