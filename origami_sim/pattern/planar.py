"""Planar straight-line graphs: merge points, split segments where they meet, find the faces."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import InputError
from .topology import edge_key, face_sides


def merge_points(points, tolerance) -> tuple[np.ndarray, np.ndarray]:
    """Merge points closer than `tolerance` (chains of near points become one, at the place of the first).

    Args:
        points: [N, 2] positions [m].
        tolerance: distance [m].

    Returns:
        The merged points [M, 2], in order of first appearance, and the index [N] of each input point in them.
    """
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, label = connected_components(links, directed=False)
    _, first, index = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return points[first[order]], rank[index]


def crossing_points(starts, ends) -> np.ndarray:
    """Return the points [K, 2] where segments from `starts` to `ends` [S, 2] that are not parallel cross or touch."""
    found = [np.empty((0, 2))]
    directions = ends - starts
    for s in range(len(starts) - 1):
        d, others = directions[s], directions[s + 1 :]
        offset = starts[s + 1 :] - starts[s]
        denominator = cross2(d, others)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = cross2(offset, others) / denominator
            u = cross2(offset, d) / denominator
        parallel = np.abs(denominator) <= 1e-12 * np.linalg.norm(d) * np.linalg.norm(others, axis=1)
        hit = ~parallel & (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
        found.append(starts[s] + t[hit, None] * d)
    return np.vstack(found)


def split_segments(starts, ends, tolerance) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Cut segments wherever they meet another segment or an end point.

    Args:
        starts, ends: [S, 2] end points [m].
        tolerance: points closer than this are one [m].

    Returns:
        The points [V, 2] and the pieces (vertex, vertex, segment); overlapping segments give a piece each.
    """
    points, _ = merge_points(np.vstack([starts, ends, crossing_points(starts, ends)]), tolerance)
    tree, pieces = cKDTree(points), []
    for s, (a, b) in enumerate(zip(starts, ends, strict=True)):
        length = np.linalg.norm(b - a)
        near = np.sort(tree.query_ball_point(0.5 * (a + b), 0.5 * length + 2.0 * tolerance))
        along = (points[near] - a) @ (b - a) / length
        aside = np.abs(cross2(points[near] - a, (b - a) / length))
        on = (aside <= tolerance) & (along >= -tolerance) & (along <= length + tolerance)
        chain = near[on][np.argsort(along[on], kind="stable")].tolist()
        pieces += [(u, v, s) for u, v in pairwise(chain)]
    return points, pieces


def check_planar_graph(points, edges, *, file=None) -> None:
    """Raise `InputError` if two of the edges [E, 2] meet anywhere but at a common vertex of `points` [V, 2]."""
    size = np.ptp(points, axis=0).max()
    starts, ends = points[edges[:, 0]], points[edges[:, 1]]
    for e in range(len(edges) - 1):
        a, b, c, d = starts[e], ends[e], starts[e + 1 :], ends[e + 1 :]
        margin = 1e-9 * size * size
        c_side, d_side = cross2(b - a, c - a), cross2(b - a, d - a)
        a_side, b_side = cross2(d - c, a - c), cross2(d - c, b - c)
        apart = (np.minimum(c_side, d_side) > margin) | (np.maximum(c_side, d_side) < -margin)
        apart |= (np.minimum(a_side, b_side) > margin) | (np.maximum(a_side, b_side) < -margin)
        for other in (np.nonzero(~apart)[0] + e + 1).tolist():
            if _meet_wrongly(points, edges[e].tolist(), edges[other].tolist(), 1e-9 * size):
                raise InputError(
                    f"edges {e} and {other} cross or overlap, so the faces cannot be derived",
                    file=file,
                    field="edges_vertices",
                    value=[edges[e].tolist(), edges[other].tolist()],
                    allowed="edges that meet at common vertices only, or faces_vertices given",
                )


def _meet_wrongly(points, first, second, tolerance) -> bool:
    """Tell whether two segments share a point other than a common vertex."""
    common = set(first) & set(second)
    for (a, b), loose in ((first, second), (second, first)):
        along = points[b] - points[a]
        length = np.linalg.norm(along)
        for v in loose:
            t = (points[v] - points[a]) @ along / length
            on_line = abs(cross2(along / length, points[v] - points[a])) <= tolerance
            if v not in common and on_line and -tolerance <= t <= length + tolerance:
                return True
    if common:
        return False
    (a, b), (c, d) = points[first], points[second]
    return bool(cross2(b - a, c - a) * cross2(b - a, d - a) < 0 and cross2(d - c, a - c) * cross2(d - c, b - c) < 0)


def planar_faces(points, edges, *, file=None) -> list[tuple[int, ...]]:
    """Return the bounded faces of a planar graph, counter-clockwise; edges that enclose nothing are skipped.

    Args:
        points: [V, 2] positions.
        edges: [E, 2] vertex pairs that meet at common vertices only.
        file: named in errors.

    Raises:
        InputError: a face touches itself at a vertex, or contains another part of the graph (a hole).
    """
    kept = {edge_key(a, b) for a, b in np.asarray(edges).tolist()}
    while True:
        loops = _trace_loops(points, kept)
        owner = {side: n for n, loop in enumerate(loops) for side in face_sides(loop)}
        bridges = {(a, b) for a, b in kept if owner[a, b] == owner[b, a]}
        if not bridges:
            break
        kept -= bridges
    faces = [loop for loop in loops if signed_area(points[list(loop)]) > 0]
    for face in faces:
        if len(set(face)) < len(face):
            raise InputError(f"a face touches itself at a vertex (loop {list(face[:12])})", file=file)
    _refuse_islands(points, kept, faces, file)
    return faces


def _trace_loops(points, kept) -> list[tuple[int, ...]]:
    around = defaultdict(list)
    for a, b in sorted(kept):
        around[a].append(b)
        around[b].append(a)
    following = {}
    for v, others in around.items():
        offsets = points[others] - points[v]
        ring = [others[n] for n in np.argsort(np.arctan2(offsets[:, 1], offsets[:, 0]), kind="stable")]
        following |= {(u, v): (v, ring[n - 1]) for n, u in enumerate(ring)}
    loops, seen = [], set()
    for side in following:
        loop = []
        while side not in seen:
            seen.add(side)
            loop.append(side[0])
            side = following[side]
        if loop:
            loops.append(tuple(loop))
    return loops


def _refuse_islands(points, kept, faces, file) -> None:
    """Raise `InputError` if one connected part of the graph lies inside a face of another."""
    if not kept:
        return
    pairs = np.array(sorted(kept))
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, part = connected_components(links, directed=False)
    parts, first = np.unique(part[pairs[:, 0]], return_index=True)
    if len(parts) == 1:
        return
    for face in faces:
        for p, v in zip(parts, pairs[first, 0], strict=True):
            if p != part[face[0]] and inside_polygon(points[v], points[list(face)]):
                raise InputError(
                    f"the face {list(face[:12])} has another part of the pattern, at vertex {v}, loose inside it",
                    file=file,
                    allowed="faces without holes: join the inner part to the rest by an edge",
                )


def inside_polygon(point, polygon) -> bool:
    """Tell whether a [2] point lies inside a polygon [N, 2] (even-odd rule)."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    straddles = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    a, b = a[straddles], b[straddles]
    crossings = a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.count_nonzero(crossings > point[0]) % 2)


def signed_area(polygon) -> float:
    """Return the area of a polygon [N, 2], positive if counter-clockwise."""
    centred = polygon - polygon[0]
    return 0.5 * float(cross2(centred, np.roll(centred, -1, axis=0)).sum())


def cross2(a, b):
    """Return the scalar cross product of 2D vectors, over the last axis."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def drop_holes(faces, borders) -> tuple[list[tuple[int, ...]], int]:
    """Drop faces enclosed by border edges alone, each of which has another face on its far side.

    Args:
        faces: vertex loops.
        borders: edge keys assigned 'B'.

    Returns:
        The remaining faces and the number dropped.
    """
    count = defaultdict(int)
    for face in faces:
        for a, b in face_sides(face):
            count[edge_key(a, b)] += 1
    kept = [f for f in faces if not all(edge_key(*s) in borders and count[edge_key(*s)] == 2 for s in face_sides(f))]
    return kept, len(faces) - len(kept)
