"""Crease patterns built from a few lengths. All lengths in metres, all angles in radians, valley folds positive.

Lengths and angles may be quantities: "20 mm", "60 deg".
"""

import math
from typing import Any

import numpy as np

from ..errors import InputError, named_arguments
from ..quantities import converted
from .assemble import assemble
from .checks import check_count, check_number, check_positive
from .crease_pattern import Pattern
from .topology import edge_key
from .triangulate import hinge_angles, triangulate

FLAT = 1e-9
"""Fold angle [rad] below which a crease has no side."""


@named_arguments
def strip(lengths, width, *, fold_angles: Any = None) -> Pattern:
    """Return a flat strip of rectangles (or trapezoids) along x, centred on y = 0, starting at x = 0.

    Args:
        lengths: panel lengths along x [m], one or more.
        width: width along y [m]: one number, or one for each of the len(lengths) + 1 stations (a taper).
        fold_angles: target fold angle [rad] of each of the len(lengths) - 1 creases, in order along x; the sign makes
            it 'V' or 'M'. None leaves the creases 'U'.

    Returns:
        Vertices 2 s and 2 s + 1 are the -y and +y corner at station s; face p is panel p.

    Raises:
        InputError: a length or width that is not positive, or a wrong number of them.
    """
    panels = [_size(f"lengths[{n}]", value) for n, value in enumerate(_sequence("lengths", lengths))]
    if np.ndim(width) and not isinstance(width, str):
        widths = [_size(f"width[{n}]", value) for n, value in enumerate(width)]
    else:
        widths = [_size("width", width)] * (len(panels) + 1)
    _check_length("width", widths, len(panels) + 1)
    x = np.concatenate([[0.0], np.cumsum(panels)])
    vertices = [(x[s], side * 0.5 * w, 0.0) for s, w in enumerate(widths) for side in (-1, 1)]
    faces = [(2 * p, 2 * p + 2, 2 * p + 3, 2 * p + 1) for p in range(len(panels))]
    creases = [(2 * s, 2 * s + 1) for s in range(1, len(panels))]
    angles = _angles("fold_angles", fold_angles, len(creases))
    return _creased(vertices, faces, _by_sign(creases, angles))


@named_arguments
def cross(base, flap_length, *, fold_angle: Any = None) -> Pattern:
    """Return a flat square base with a flap on each side: the net of a box without a lid.

    Args:
        base: side of the square [m], centred on the origin.
        flap_length: length of each flap, away from the base [m].
        fold_angle: target fold angle of the four creases [rad]; None leaves them 'U'. The box is pi / 2.

    Returns:
        Face 0 is the base; faces 1 to 4 are the flaps on its -y, +x, +y and -x side.

    Raises:
        InputError: a length that is not positive.
    """
    half, reach = 0.5 * _size("base", base), _size("flap_length", flap_length)
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    outward = [(0, -1), (1, 0), (0, 1), (-1, 0)]
    vertices, faces, creases = list(corners), [(0, 1, 2, 3)], []
    for n, (ox, oy) in enumerate(outward):
        a, b = n, (n + 1) % 4
        first = len(vertices)
        vertices += [(corners[v][0] + reach * ox, corners[v][1] + reach * oy) for v in (a, b)]
        faces.append((a, first, first + 1, b))
        creases.append((a, b))
    angles = _angles("fold_angle", None if fold_angle is None else [fold_angle] * 4, 4)
    return _creased([(x, y, 0.0) for x, y in vertices], faces, _by_sign(creases, angles))


@named_arguments
def grid(nx, ny, dx, dy) -> Pattern:
    """Return a flat sheet of nx by ny rectangles of dx by dy [m] from the origin; inner edges are 'U'.

    Vertex (row, column) is number row (nx + 1) + column; face likewise row nx + column, rows along y.

    Raises:
        InputError: a count below 1 or a size that is not positive.
    """
    nx, ny = check_count("nx", nx, 1), check_count("ny", ny, 1)
    dx, dy = _size("dx", dx), _size("dy", dy)
    vertices = [(dx * column, dy * row, 0.0) for row in range(ny + 1) for column in range(nx + 1)]
    return _creased(vertices, _grid_faces(nx, ny), {})


@named_arguments
def miura(nx, ny, a, b, gamma, *, fold_angle: Any = 0.0, target_angle: Any = None) -> Pattern:
    """Return a Miura-ori of nx by ny unit cells (2 x 2 parallelograms each), folded rigidly.

    With theta = fold_angle / 2, the inclination of the panels, a cell has height H = a sin(theta) sin(gamma), half
    length L = a sqrt(1 - sin^2(theta) sin^2(gamma)) along y, half width S = b cos(theta) tan(gamma) / q along x and
    shift V = b / q, with q = sqrt(1 + cos^2(theta) tan^2(gamma)) (Schenk and Guest 2013, PNAS 110, 3276,
    doi:10.1073/pnas.1217998110).

    Args:
        nx, ny: unit cells along x and y.
        a: side of the parallelograms along the straight creases [m], along y when flat.
        b: side along the zigzag creases [m].
        gamma: acute angle of the parallelograms [rad], in (0, pi/2).
        fold_angle: size of the fold angle of the zigzag creases in the returned shape [rad], in [0, pi).
        target_angle: the same for `fold_angles`, in [0, pi]; the straight creases take the angle that goes with it.
            None means `fold_angle`, or no target angles if that is 0.

    Returns:
        Zigzag creases alternate from row to row, 'M' on ridges and 'V' in troughs; the straight ones alternate
        along each line. Vertex (row, column) is number row (2 nx + 1) + column.

    Raises:
        InputError: a count below 1, a size that is not positive or an angle out of range.
    """
    nx, ny = check_count("nx", nx, 1), check_count("ny", ny, 1)
    a, b = _size("a", a), _size("b", b)
    gamma = _turn("gamma", gamma, low=1e-3, high=0.5 * math.pi - 1e-3, allowed="an angle in (0, pi/2) rad")
    fold_angle = _turn("fold_angle", fold_angle, low=0.0, high=math.pi - 1e-6, allowed="[0, pi) rad")
    if target_angle is None:
        target, has_target = fold_angle, fold_angle > 0.0
    else:
        target, has_target = (
            _turn("target_angle", target_angle, low=0.0, high=math.pi, allowed="[0, pi] rad"),
            True,
        )
    vertices = _miura_vertices(nx, ny, a, b, gamma, 0.5 * fold_angle)
    columns, creases = 2 * nx + 1, {}
    straight = 2.0 * math.atan2(math.sin(0.5 * target) * math.cos(gamma), math.cos(0.5 * target))
    for row in range(2 * ny + 1):
        for column in range(columns):
            here = row * columns + column
            if 0 < row < 2 * ny and column < 2 * nx:
                creases[here, here + 1] = _signed("M" if row % 2 else "V", target if has_target else math.nan)
            if 0 < column < 2 * nx and row < 2 * ny:
                letter = "V" if (row + column) % 2 else "M"
                creases[here, here + columns] = _signed(letter, straight if has_target else math.nan)
    return _creased(vertices, _grid_faces(2 * nx, 2 * ny), creases)


def _miura_vertices(nx, ny, a, b, gamma, theta) -> np.ndarray:
    q = math.sqrt(1.0 + (math.cos(theta) * math.tan(gamma)) ** 2)
    height, shift = a * math.sin(theta) * math.sin(gamma), b / q
    length = a * math.sqrt(1.0 - (math.sin(theta) * math.sin(gamma)) ** 2)
    width = b * math.cos(theta) * math.tan(gamma) / q
    return np.array(
        [
            (width * column, length * row + shift * (column % 2), height * (row % 2))
            for row in range(2 * ny + 1)
            for column in range(2 * nx + 1)
        ]
    )


@named_arguments
def waterbomb(side, *, fold_angle: Any = 0.0, target_angle: Any = None) -> Pattern:
    """Return a square folded as a waterbomb base: one vertex, four diagonal valleys and two mountains along x.

    The symmetric rigid folding in closed form: each mountain lifts by alpha = 2 atan(sin(fold_angle / 2)) from the
    xy plane, towards +z, and the diagonals rise by (1 / sqrt 2) tan(alpha / 2) per unit length.

    Args:
        side: side of the square [m], centred on the origin.
        fold_angle: size of the mountains' fold angle in the returned shape [rad], in [0, pi).
        target_angle: the same for `fold_angles`, in [0, pi); the valleys take the angle that goes with it. None
            means `fold_angle`, or no target angles if that is 0.

    Returns:
        Vertex 0 is the centre, 1 and 4 are the ends of the mountains, the others the corners of the square.

    Raises:
        InputError: a side that is not positive or an angle out of range.
    """
    side = _size("side", side)
    limit = {"low": 0.0, "high": math.pi - 1e-6, "allowed": "[0, pi) rad"}
    fold_angle = _turn("fold_angle", fold_angle, **limit)
    target = fold_angle if target_angle is None else _turn("target_angle", target_angle, **limit)
    faces = [(0, n, n % 6 + 1) for n in range(1, 7)]
    letters = {(0, n): "M" if n in (1, 4) else "V" for n in range(1, 7)}
    creases = {key: (letter, math.nan) for key, letter in letters.items()}
    pattern = _creased(_waterbomb_vertices(side, fold_angle), faces, creases)
    if target_angle is not None or fold_angle > 0.0:
        split = triangulate(pattern)
        pattern.fold_angles[split.crease_edge] = hinge_angles(_waterbomb_vertices(side, target), split.creases)
        pattern.fold_angles[pattern.edges_assigned("M")] = -target
    return pattern


def _waterbomb_vertices(side, fold_angle) -> np.ndarray:
    rise = math.sin(0.5 * fold_angle)
    alpha = 2.0 * math.atan(rise)
    half = 0.5 * side
    x, z, y = half, half * rise, half * math.sqrt(1.0 - rise**2)
    ends = half * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    mirror = np.array([-1.0, 1.0, 1.0])
    return np.array([(0, 0, 0), ends, (x, y, z), (-x, y, z), ends * mirror, (-x, -y, z), (x, -y, z)], dtype=np.float64)


@named_arguments
def kresling(n, *, radius, height, twist) -> Pattern:
    """Return a Kresling cell: two rings of n nodes, the upper one turned, joined by 2 n triangles.

    Node i is at angle 2 pi i / n of the lower ring (z = 0), node n + i at twist above it (z = height). The triangles
    are (i, i', n + i') and (i, n + i', n + i), with i' the next node, counter-clockwise seen from outside.

    Args:
        n: sides of the polygons, 3 or more.
        radius: radius of the rings [m].
        height: distance of the rings [m].
        twist: turn of the upper ring [rad], in [-pi, pi].

    Returns:
        The 2 n creases have the fold angle of this shape as rest angle, valley positive seen from outside, and the
        assignment that goes with it.

    Raises:
        InputError: n below 3, a size that is not positive or a twist out of range.
    """
    n = check_count("n", n, 3)
    radius, height = _size("radius", radius), _size("height", height)
    twist = _turn("twist", twist, low=-math.pi, high=math.pi, allowed="[-pi, pi] rad")
    turns = 2.0 * math.pi * np.arange(n) / n
    rings = [
        np.column_stack([radius * np.cos(turns + turn), radius * np.sin(turns + turn), np.full(n, z)])
        for turn, z in ((0.0, 0.0), (twist, height))
    ]
    following = [(i + 1) % n for i in range(n)]
    faces = [(i, j, n + j) for i, j in enumerate(following)] + [(i, n + j, n + i) for i, j in enumerate(following)]
    pattern = _creased(np.vstack(rings), faces, {})
    split = triangulate(pattern)
    for e, angle in zip(split.crease_edge, hinge_angles(pattern.vertices, split.creases), strict=True):
        pattern.assignments[e] = _letter(angle)
        pattern.rest_angles[e] = angle
    return pattern


def _grid_faces(nx, ny) -> list[tuple[int, ...]]:
    corners = (0, 1, nx + 2, nx + 1)
    return [tuple(row * (nx + 1) + column + c for c in corners) for row in range(ny) for column in range(nx)]


def _size(name, value) -> float:
    """Return a length above zero [m]; it may be a quantity, "20 mm"."""
    return check_positive(name, converted(value, "m", name))


def _turn(name, value, **limits) -> float:
    """Return an angle [rad]; it may be a quantity, "60 deg"."""
    return check_number(name, converted(value, "rad", name), **limits)


def _sequence(name, values) -> list:
    if np.ndim(values) != 1 or len(values) == 0:
        raise InputError("not a list of numbers", field=name, value=values, allowed="one or more numbers")
    return list(values)


def _check_length(name, values, count) -> None:
    if len(values) != count:
        raise InputError("wrong number of values", field=name, value=len(values), allowed=f"{count}")


def _angles(name, values, count) -> list[float]:
    """Return `count` checked fold angles [rad]; nan where none are given."""
    if values is None:
        return [math.nan] * count
    _check_length(name, values, count)
    return [_turn(name, v, low=-math.pi, high=math.pi, allowed="[-pi, pi] rad") for v in values]


def _letter(angle) -> str:
    return "V" if angle > FLAT else "M" if angle < -FLAT else "U"


def _by_sign(edges, angles) -> dict:
    return {edge: (_letter(angle), angle) for edge, angle in zip(edges, angles, strict=True)}


def _signed(letter, size) -> tuple[str, float]:
    return letter, size if letter == "V" else -size


def _creased(vertices, faces, creases) -> Pattern:
    """Return a pattern with the letters and fold angles of `creases` {edge: (letter, angle or nan)}; the rest 'U'."""
    pattern = assemble(vertices, faces)
    known = {edge_key(*edge): crease for edge, crease in creases.items()}
    for e, (j, k) in enumerate(pattern.edges.tolist()):
        if (j, k) in known:
            pattern.assignments[e], pattern.fold_angles[e] = known[j, k]
    pattern.notes.clear()
    return pattern
