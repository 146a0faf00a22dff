"""Planar straight-line graphs: merge points, split segments where they meet, find the faces."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import InputError
from .topology import edge_key, face_sides

FINEST, COARSEST, APART = 1e-4, 2.5e-3, 1e-2
"""Shares of the diagonal: always merged, never merged beyond, and surely apart. Hand-drawn files miss by up to 2e-3;
half of `COARSEST` leaves slivers in them, double swallows pleats.
Half and double of `FINEST` and of `APART` fold the same of 20 public patterns."""
SAME = 0.1 * FINEST
"""Share of the diagonal within which ends of lines are at one place, but for how numbers are written. Half and double
read the same of 38 public drawings to the last bit, and count other points as joined in 13."""
CHUNK = 256
"""Segments whose neighbours are looked up at a time, so that a page of scribble needs no more memory than a pattern."""
MAX_CROSSINGS = 200_000
"""Crossings accepted; the densest tessellations seen have some 5,000, and what has more could not be folded anyway."""
ROUNDING = 1e-6
"""Share of the merging distance within which points are the same number but for rounding, some 1e-13 to 4e-10 of it.
Half and double read the same of 43 public patterns to the last bit, as do a thousandth and a thousandfold."""
MAX_NEIGHBOURS = 20_000_000
"""Neighbours of all points accepted: 0.55 GB and 2 s; half takes 0.27 GB and 1.3 s, double 1.1 GB and 5 s. Of 43 public
patterns, of which all three refuse none, the densest has 46,000."""
MAX_ROUNDS = 5
"""Times that lines are cut again after ends have been merged; two are enough for every pattern seen."""


def merge_points(points, tolerance, lines=None) -> tuple[np.ndarray, np.ndarray]:
    """Merge points closer than `tolerance` (chains of near points become one).

    Args:
        points: [N, 2] positions [m].
        tolerance: distance [m].
        lines: [N] how many lines pass through each point. Those that are merged are at the one on which most lines
            agree: that to which the others have the least distances in sum. None: at the first.

    Returns:
        The merged points [M, 2], in order of first appearance, and the index [N] of each input point in them.

    Raises:
        InputError: more than `MAX_NEIGHBOURS` points near each other.
    """
    # many lines through one place cross there in as many points, which differ by rounding only
    same = np.floor(points / (ROUNDING * tolerance))
    _, single, place = np.unique(same, axis=0, return_index=True, return_inverse=True)
    tree = cKDTree(points[single])
    if tree.count_neighbors(tree, tolerance) > MAX_NEIGHBOURS:
        raise InputError("too many points lie closer to each other than can be told apart", allowed="fewer lines")
    pairs = tree.query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(single), len(single)))
    _, label = connected_components(links, directed=False)
    best = np.arange(len(single))
    if lines is not None:
        weight = np.bincount(place.ravel(), weights=lines)
        near = 1.0 - np.linalg.norm(points[single[pairs[:, 0]]] - points[single[pairs[:, 1]]], axis=1) / tolerance
        agreed = weight + sum(
            np.bincount(pairs[:, m], weights=weight[pairs[:, n]] * near, minlength=len(single))
            for m, n in ((0, 1), (1, 0))
        )
        best = np.lexsort((single, -np.round(agreed, 9)))  # of as many, the first
    chosen = single[best[np.unique(label[best], return_index=True)[1]]]  # by label
    label = label[place.ravel()]
    _, first, index = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    at = first if lines is None else chosen
    return points[at[order]], rank[index]


def merge_distance(starts, ends) -> float:
    """Return how far apart points may lie and still be one, read off the drawing itself [its unit].

    What is meant to meet misses by the rounding of the drawing program or by the hand that drew it, and what is meant
    to be apart is much further apart: the distances of ends from their next end and from lines that pass by fall into
    two heaps. The answer lies in the widest gap (on a logarithmic scale) above `FINEST`.

    Args:
        starts, ends: [S, 2] end points.
    """
    from shapely import STRtree, distance, linestrings
    from shapely import points as as_points

    ends_of_lines = np.vstack([starts, ends])
    diagonal = float(np.linalg.norm(np.ptp(ends_of_lines, axis=0)))
    places, _ = merge_points(ends_of_lines, SAME * diagonal)
    if len(places) < 3:
        return FINEST * diagonal
    lines, dots = np.asarray(linestrings(np.stack([starts, ends], axis=1))), np.asarray(as_points(places))
    found, tree = [np.asarray(cKDTree(places).query(places, k=2)[0])[:, 1]], STRtree(lines)
    for first in range(0, len(places), CHUNK):
        dot, line = tree.query(dots[first : first + CHUNK], predicate="dwithin", distance=APART * diagonal)
        found.append(distance(dots[first + dot], lines[line]))
    apart = np.concatenate(found) / diagonal
    apart = np.unique(np.concatenate([[FINEST], apart[(apart > FINEST) & (apart < APART)], [APART]]))
    ratio = np.where(apart[:-1] <= COARSEST, apart[1:] / apart[:-1], 0.0)
    widest = int(np.argmax(ratio))
    return float(apart[widest] * min(np.sqrt(ratio[widest]), 1.25) * diagonal)


def crossing_points(starts, ends, *, file=None) -> np.ndarray:
    """Return the points [K, 2] where segments from `starts` to `ends` [S, 2] that are not parallel cross or touch.

    Raises:
        InputError: more than `MAX_CROSSINGS` of them.
    """
    from shapely import STRtree, linestrings  # only here: a start without patterns need not wait for it

    lines = np.asarray(linestrings(np.stack([starts, ends], axis=1)))
    tree, found, count = STRtree(lines), [np.empty((0, 2))], 0
    for first in range(0, len(lines), CHUNK):
        near, other = tree.query(lines[first : first + CHUNK], predicate="intersects")
        near = near + first
        near, other = near[near < other], other[near < other]
        d, e = ends[near] - starts[near], ends[other] - starts[other]
        denominator = cross2(d, e)
        parallel = np.abs(denominator) <= 1e-12 * np.linalg.norm(d, axis=1) * np.linalg.norm(e, axis=1)
        near, other, d, e = near[~parallel], other[~parallel], d[~parallel], e[~parallel]
        t = cross2(starts[other] - starts[near], e) / denominator[~parallel]
        found.append(starts[near] + np.clip(t, 0.0, 1.0)[:, None] * d)
        count += len(near)
        if count > MAX_CROSSINGS:
            raise InputError(
                "the lines cross too often to be a crease pattern",
                file=file,
                value=f"more than {MAX_CROSSINGS}",
                allowed=f"up to {MAX_CROSSINGS} crossings",
            )
    return np.vstack(found)


def split_segments(starts, ends, tolerance, *, file=None) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Cut segments wherever they meet another segment or an end point.

    Moving an end within the tolerance can make a line touch another one, so that cutting is repeated until no two
    pieces meet but at a common point.

    Args:
        starts, ends: [S, 2] end points [m].
        tolerance: points closer than this are one [m].
        file: named in errors.

    Returns:
        The points [V, 2] and the pieces (vertex, vertex, segment); overlapping segments give a piece each.

    Raises:
        InputError: more than `MAX_CROSSINGS` crossings.
    """
    rows = np.zeros((0, 3), dtype=np.int64)
    owner, points = np.arange(len(starts)), np.zeros((0, 2))
    for _ in range(MAX_ROUNDS):
        points, pieces = _split_once(starts, ends, tolerance, file)
        rows = np.array(sorted({(*edge_key(a, b), int(owner[s])) for a, b, s in pieces}), dtype=np.int64).reshape(-1, 3)
        settled = len(rows) == len(starts)  # nothing was cut any more
        starts, ends, owner = points[rows[:, 0]], points[rows[:, 1]], rows[:, 2]
        if settled or not len(rows):
            break
    return points, [(a, b, s) for a, b, s in rows.tolist()]


def _split_once(starts, ends, tolerance, file) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    from shapely import STRtree, linestrings
    from shapely import points as as_points

    crossings = crossing_points(starts, ends, file=file)
    passing = np.repeat([1.0, 2.0], [2 * len(starts), len(crossings)])
    points, _ = merge_points(np.vstack([starts, ends, crossings]), tolerance, passing)
    lines = np.asarray(linestrings(np.stack([starts, ends], axis=1)))
    vertex, segment = STRtree(lines).query(as_points(points), predicate="dwithin", distance=tolerance)
    along = np.sum((points[vertex] - starts[segment]) * (ends - starts)[segment], axis=1)
    order = np.lexsort((vertex, along, segment))
    vertex, segment = vertex[order].tolist(), segment[order].tolist()
    return points, [(a, b, s) for (a, s), (b, t) in pairwise(zip(vertex, segment, strict=True)) if s == t and a != b]


def moved_points(starts, ends, points, pieces) -> np.ndarray:
    """Return by how much lines that end at or pass through each point had to move to meet there [V].

    Args:
        starts, ends: [S, 2] lines. points, pieces: what `split_segments` made of them.
    """
    distance, nearest = cKDTree(points).query(np.vstack([starts, ends]))
    moved = np.zeros(len(points))
    np.maximum.at(moved, np.asarray(nearest), np.asarray(distance))
    rows = np.array(pieces, dtype=np.int64).reshape(-1, 3)
    along = ends - starts
    for v, s in ((rows[:, 0], rows[:, 2]), (rows[:, 1], rows[:, 2])):
        away = points[v] - starts[s]
        share = np.clip(np.sum(away * along[s], axis=1) / np.sum(along[s] ** 2, axis=1), 0.0, 1.0)
        np.maximum.at(moved, v, np.linalg.norm(away - share[:, None] * along[s], axis=1))
    return moved


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
    kept, loops = closed_loops(points, edges)
    faces = [loop for loop in loops if signed_area(points[list(loop)]) > 0]
    for face in faces:
        if len(set(face)) < len(face):
            raise InputError(f"a face touches itself at a vertex (loop {list(face[:12])})", file=file)
    _refuse_islands(points, kept, faces, file)
    return faces


def closed_loops(points, edges) -> tuple[set[tuple[int, int]], list[tuple[int, ...]]]:
    """Return the edges of a planar graph that have different regions beside them, and the loops around all regions.

    The loop around a bounded region is counter-clockwise, and so negative around a part of the graph from outside.
    """
    kept = {edge_key(a, b) for a, b in np.asarray(edges).tolist()}
    while True:
        loops = _trace_loops(points, kept)
        owner = {side: n for n, loop in enumerate(loops) for side in face_sides(loop)}
        bridges = {(a, b) for a, b in kept if owner[a, b] == owner[b, a]}
        if not bridges:
            return kept, loops
        kept -= bridges


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
