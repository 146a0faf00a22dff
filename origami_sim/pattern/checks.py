"""Checks that every crease pattern passes, wherever it came from."""

import math

import numpy as np

from ..errors import InputError
from .topology import area_vector

COORDINATE_LIMIT = 1e6
"""Largest coordinate accepted [m]; beyond it the file's unit is surely wrong."""
LENGTH_TOLERANCE = 1e-9
"""Shortest edge accepted, relative to the size of the pattern."""
AREA_TOLERANCE = 1e-9
"""Smallest face area accepted, relative to the square of the face's own size."""


def check_vertices(vertices, *, file=None) -> None:
    """Raise `InputError` unless all coordinates [V, 3] are finite and below `COORDINATE_LIMIT`."""
    bad = np.argwhere(~(np.abs(vertices) <= COORDINATE_LIMIT))
    if len(bad):
        v, axis = map(int, bad[0])
        raise InputError(
            "coordinate out of range",
            file=file,
            field=f"vertices_coords[{v}]",
            value=float(vertices[v, axis]),
            allowed=f"finite, within {COORDINATE_LIMIT:g} m of the origin",
        )


def check_loops(faces, vertex_count, *, file=None) -> None:
    """Raise `InputError` unless each face has 3 or more distinct, existing vertices."""
    for f, face in enumerate(faces):
        field = f"faces_vertices[{f}]"
        if len(face) < 3:
            raise InputError("face with fewer than 3 vertices", file=file, field=field, value=face)
        for v in face:
            check_index(v, vertex_count, file=file, field=field)
        if len(set(face)) < len(face):
            twice = next(v for i, v in enumerate(face) if v in face[:i])
            raise InputError("duplicate vertex in a face", file=file, field=field, value=twice)


def check_index(index, count, *, file=None, field="index") -> None:
    """Raise `InputError` unless 0 <= index < count."""
    if not 0 <= index < count:
        raise InputError("index out of range", file=file, field=field, value=index, allowed=f"0 to {count - 1}")


def check_edges(vertices, edges, *, file=None) -> None:
    """Raise `InputError` for an index out of range, a repeated edge or an edge of no length."""
    seen: dict[tuple[int, int], int] = {}
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    for e, (a, b) in enumerate(edges.tolist()):
        field = f"edges_vertices[{e}]"
        for v in (a, b):
            check_index(v, len(vertices), file=file, field=field)
        if np.linalg.norm(vertices[a] - vertices[b]) <= LENGTH_TOLERANCE * size:
            raise InputError("zero-length edge", file=file, field=field, value=[a, b])
        first = seen.setdefault((min(a, b), max(a, b)), e)
        if first != e:
            raise InputError(f"edge listed twice, first as edge {first}", file=file, field=field, value=[a, b])


def check_areas(vertices, faces, *, file=None) -> None:
    """Raise `InputError` for a face without area."""
    for f, face in enumerate(faces):
        size = float(np.ptp(vertices[list(face)], axis=0).max())
        if np.linalg.norm(area_vector(vertices, face)) <= AREA_TOLERANCE * size**2:
            raise InputError("zero-area face", file=file, field=f"faces_vertices[{f}]", value=list(face))


def check_positive(name, value) -> float:
    """Return `value` as a float; raise `InputError` unless it is a finite number above zero."""
    number = check_number(name, value)
    if number <= 0.0:
        raise InputError("size must be positive", field=name, value=value, allowed="a number above 0")
    return number


def check_count(name, value, least) -> int:
    """Return `value` as an int; raise `InputError` unless it is a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise InputError("bad count", field=name, value=value, allowed=f"a whole number of at least {least}")
    return int(value)


def check_number(name, value, *, low=-math.inf, high=math.inf, allowed="a finite number") -> float:
    """Return `value` as a float; raise `InputError` unless it is finite and in [low, high]."""
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float, np.integer, np.floating))
        or not math.isfinite(value)
    ):
        raise InputError("not a finite number", field=name, value=value, allowed=allowed)
    if not low <= value <= high:
        raise InputError("number out of range", field=name, value=value, allowed=allowed)
    return float(value)
