"""Triangles, hinges and bars of a crease pattern: what the mechanics is built on.

A hinge is four nodes (i, j, k, l): the axis j -> k, l the apex of the triangle on its left (the one that contains
j -> k in its counter-clockwise order), i the apex on its right. With e = xk - xj, n1 = (xi - xj) x e,
n2 = e x (xl - xj), the fold angle is phi = atan2((n1 x n2).e / |e|, n1.n2): 0 when flat, positive for a valley.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .crease_pattern import Pattern
from .polygon import centroid, clip_ears, project, self_intersects
from .topology import face_sides, open_cuts

METHODS = ("auto", "diagonal", "center")


@dataclass(frozen=True, eq=False)
class Triangulation:
    """A triangulated pattern.

    Attributes:
        vertices: [N, 3] positions [m]: the pattern's vertices, duplicates along cuts, then face centres.
        vertex_source: [N] pattern vertex of each node, -1 for a face centre.
        triangles: [T, 3] counter-clockwise node triples.
        triangle_face: [T] pattern face of each triangle.
        creases: [C, 4] hinges (i, j, k, l) on pattern edges between two faces, assigned M, V, U or B.
        crease_edge: [C] pattern edge of each crease.
        bends: [Q, 4] hinges inside a face or on 'F' and 'J' edges.
        bend_face: [Q] pattern face of each bend; on an 'F' or 'J' edge the face on its left.
        bend_edge: [Q] pattern edge of each bend, -1 for a line inside a face.
        bars: [B, 2] all mesh edges, each once, lower index first, sorted.
    """

    vertices: np.ndarray
    vertex_source: np.ndarray
    triangles: np.ndarray
    triangle_face: np.ndarray
    creases: np.ndarray
    crease_edge: np.ndarray
    bends: np.ndarray
    bend_face: np.ndarray
    bend_edge: np.ndarray
    bars: np.ndarray


def triangulate(pattern: Pattern, method="diagonal", *, planarity_tolerance=1e-3) -> Triangulation:
    """Split the faces into triangles and list the hinges and bars.

    Args:
        pattern: the crease pattern; 'C' edges separate the sheet.
        method: 'diagonal' adds no nodes: triangles by ear clipping, the shorter diagonal in quads (a tie goes to the
            one through the lowest vertex). 'center' adds a node at the centroid of each face of 4 or more corners, if
            all of it is seen from there. 'auto' does so where a face is a panel of its own, and takes diagonals where
            flat or joined edges ('F', 'J') make it a cell of a larger one.
        planarity_tolerance: largest distance of a face's corners from its mean plane, relative to the face's size.

    Raises:
        InputError: unknown method; a vertex without a face; a face that is not planar or intersects itself; faces that
            do not run the same way round.
    """
    if method not in METHODS:
        raise InputError("unknown triangulation", field="method", value=method, allowed=", ".join(METHODS))
    opened, source = open_cuts(pattern)
    unused = set(range(opened.vertex_count)).difference(v for face in opened.faces for v in face)
    if unused:
        raise InputError("vertex belongs to no face", field="vertices_coords", value=min(unused))
    centres: list[np.ndarray] = []
    triangles: list[tuple[int, ...]] = []
    triangle_face: list[int] = []
    cells = _cells(opened) if method == "auto" else set()
    for f, face in enumerate(opened.faces):
        own = "diagonal" if f in cells else method
        pieces, centre = _split_face(f, face, opened, own, opened.vertex_count + len(centres), planarity_tolerance)
        centres += centre
        triangles += pieces
        triangle_face += [f] * len(pieces)
    apex = _apexes(triangles)
    hinges = _hinges(opened, triangle_face, apex)
    bars = sorted({(min(side), max(side)) for side in apex})
    return Triangulation(
        vertices=np.vstack([opened.vertices, *centres]),
        vertex_source=np.concatenate([source, np.full(len(centres), -1, dtype=np.int64)]),
        triangles=_integers(triangles, 3),
        triangle_face=np.array(triangle_face, dtype=np.int64),
        bars=_integers(bars, 2),
        **hinges,
    )


def _cells(pattern: Pattern) -> set[int]:
    """Faces that share a flat or joined edge with another: cells of a larger panel."""
    inside = {frozenset(e) for e, a in zip(pattern.edges.tolist(), pattern.assignments, strict=True) if a in "FJ"}
    at: dict[frozenset[int], list[int]] = {}
    for f, face in enumerate(pattern.faces):
        for side in face_sides(face):
            at.setdefault(frozenset(side), []).append(f)
    return {f for side in inside for f in (at.get(side, []) if len(at.get(side, [])) > 1 else [])}


def _integers(rows, width) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, width)


def _split_face(f, face, pattern, method, next_node, tolerance):
    """Return the triangles of a face and the list of the one or no centre position [3] it needs."""
    if len(face) == 3:
        return [tuple(face)], []
    points = pattern.vertices[list(face)]
    field = f"faces_vertices[{f}]"
    corners, offset, origin, axes = project(points)
    size = np.ptp(points, axis=0).max()
    if offset > tolerance * size:
        raise InputError(
            "face is not planar",
            field=field,
            value=float(f"{offset / size:.3g}"),
            allowed=f"corners within {tolerance:g} of the face's size from its plane",
        )
    if self_intersects(corners):
        raise InputError("face intersects itself", field=field, value=list(face), allowed="simple polygons")
    middle = centroid(corners)
    spokes = corners - middle
    ahead = np.roll(spokes, -1, axis=0)
    seen = np.min(spokes[:, 0] * ahead[:, 1] - spokes[:, 1] * ahead[:, 0]) > 1e-9 * size**2
    if method != "diagonal" and seen:
        return [(a, b, next_node) for a, b in face_sides(face)], [origin + middle @ axes]
    pieces = clip_ears(corners, face)
    if pieces is None:
        raise InputError("face cannot be triangulated", field=field, value=list(face), allowed="simple polygons")
    return [tuple(face[n] for n in piece) for piece in pieces], []


def _apexes(triangles) -> dict[tuple[int, int], tuple[int, int]]:
    """Map each directed side to (apex, triangle); a side that occurs twice means inconsistent faces."""
    apex = {}
    for t, (a, b, c) in enumerate(triangles):
        for side, tip in (((a, b), c), ((b, c), a), ((c, a), b)):
            if side in apex:
                raise InputError(
                    f"two faces run the same way along the edge {side[0]}-{side[1]}",
                    field="faces_vertices",
                    allowed="faces counter-clockwise seen from one side of the sheet",
                )
            apex[side] = (tip, t)
    return apex


def _hinges(pattern, triangle_face, apex) -> dict[str, np.ndarray]:
    creases, crease_edge, bends, bend_face, bend_edge = [], [], [], [], []
    for e, (j, k) in enumerate(pattern.edges.tolist()):
        letter = pattern.assignments[e]
        if letter == "C" or (j, k) not in apex or (k, j) not in apex:
            continue
        (left, left_triangle), (right, _) = apex[j, k], apex[k, j]
        if letter in "FJ":
            bends.append((right, j, k, left))
            bend_face.append(triangle_face[left_triangle])
            bend_edge.append(e)
        else:
            creases.append((right, j, k, left))
            crease_edge.append(e)
    for (j, k), (left, t) in apex.items():
        right, other = apex.get((k, j), (-1, -1))
        if j < k and other >= 0 and triangle_face[t] == triangle_face[other]:
            bends.append((right, j, k, left))
            bend_face.append(triangle_face[t])
            bend_edge.append(-1)
    return {
        "creases": _integers(creases, 4),
        "crease_edge": np.array(crease_edge, dtype=np.int64),
        "bends": _integers(bends, 4),
        "bend_face": np.array(bend_face, dtype=np.int64),
        "bend_edge": np.array(bend_edge, dtype=np.int64),
    }


def hinge_angles(vertices, hinges) -> np.ndarray:
    """Return the fold angles [H] in [-pi, pi], valley positive, of hinges [H, 4] on `vertices` [N, 3] [m]."""
    hinges = _integers(hinges, 4)
    xi, xj, xk, xl = (vertices[hinges[:, n]] for n in range(4))
    e = xk - xj
    n1, n2 = np.cross(xi - xj, e), np.cross(e, xl - xj)
    sine = np.sum(np.cross(n1, n2) * e, axis=1) / np.linalg.norm(e, axis=1)
    return np.arctan2(sine, np.sum(n1 * n2, axis=1))
