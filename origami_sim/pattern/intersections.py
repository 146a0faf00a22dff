"""Triangles of a sheet that pass through each other, or lie on each other in one plane."""

import numpy as np

CHUNK = 2_000_000
"""Pairs tested at a time: some 500 MB."""
FEW = 300
"""Triangles up to which boxes are compared each with each: 0.6 ms, as a tree takes that has to be loaded first (30 ms).
Half loads it for half as many, double takes 8 ms where the tree takes 1.
"""
SLACK = 1e-9
"""Share of the size below which a corner lies in a plane, so that triangles that touch do not cross."""


def crossing_pairs(x, triangles, depth: float) -> np.ndarray:
    """Return the pairs [P, 2] of triangles that cross each other by more than a depth.

    Each of two triangles that cross meets the other's plane in a piece of the line common to both planes, and these
    pieces overlap (Moller 1997, doi:10.1080/10867651.1997.10487472). How deep is the least distance by which one of
    them would have to be moved along a normal to be clear of the other's plane. Triangles that only touch, share an
    edge or lie in one plane do not cross.

    Args:
        x: [N, 3] positions [m]. triangles: [T, 3] node triples. depth: [m], the sheet's thickness.
    """
    found = [_crossing(x, triangles, pairs, depth) for pairs in _near_pairs(x, triangles, 2)]
    return np.concatenate(found) if found else np.zeros((0, 2), dtype=np.int64)


def overlapping_pairs(x, triangles) -> np.ndarray:
    """Return the pairs [P, 2] of triangles that cross, or that both cover a part of one plane, as no sheet does.

    Neighbours count as well where one lies folded back on the other.

    Args:
        x: [N, 3] positions [m]. triangles: [T, 3] node triples.
    """
    found = [crossing_pairs(x, triangles, 0.0), *(_covering(x, triangles, p) for p in _near_pairs(x, triangles, 3))]
    return np.concatenate(found)


def _near_pairs(x, triangles, fewer: int):
    """Yield pairs [P, 2] of triangles whose boxes overlap, with fewer nodes in common than so many."""
    corners = x[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    for one, other in _boxes_that_meet(low, high):
        shared = (triangles[one][:, :, None] == triangles[other][:, None, :]).sum(axis=(1, 2))
        if np.any(shared < fewer):
            yield np.column_stack([one, other])[shared < fewer]


def _boxes_that_meet(low, high):
    """Yield numbers (first, second) of boxes that overlap, the first the smaller, in their order."""
    if len(low) <= FEW:
        one, other = np.triu_indices(len(low), 1)
        for low_k, high_k in zip(low.T, high.T, strict=True):
            meet = (low_k[one] <= high_k[other]) & (low_k[other] <= high_k[one])
            one, other = one[meet], other[meet]
        yield one, other
        return
    from shapely import STRtree, box  # only here: a start without large patterns need not wait for it

    boxes = np.asarray(box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    tree, step = STRtree(boxes), max(1, CHUNK // len(boxes))
    for first in range(0, len(boxes), step):
        one, other = tree.query(boxes[first : first + step])
        one = one + first
        keep = (one < other) & (low[one, 2] <= high[other, 2]) & (low[other, 2] <= high[one, 2])
        yield one[keep], other[keep]


def _covering(x, triangles, pairs) -> np.ndarray:
    """Return those of the pairs that lie in one plane and have an area in common: no side of either parts them."""
    slack = SLACK * float(np.ptp(x, axis=0).max())
    a, b = x[triangles[pairs[:, 0]]], x[triangles[pairs[:, 1]]]
    flat = np.maximum(np.abs(_heights(b, a)), np.abs(_heights(a, b))).max(axis=1) <= slack
    a, b, pairs = a[flat], b[flat], pairs[flat]
    normal, apart = _normals(a), np.zeros(len(a), bool)
    for t in (a, b):
        for k in range(3):
            side = np.cross(normal, t[:, (k + 1) % 3] - t[:, k])
            side /= np.maximum(np.linalg.norm(side, axis=1), 1e-300)[:, None]
            one, other = (np.einsum("pca,pa->pc", each, side) for each in (a, b))
            apart |= np.maximum(one.min(1) - other.max(1), other.min(1) - one.max(1)) > -slack
    return pairs[~apart]


def _crossing(x, triangles, pairs, depth) -> np.ndarray:
    a, b = x[triangles[pairs[:, 0]]], x[triangles[pairs[:, 1]]]
    slack = SLACK * float(np.ptp(x, axis=0).max())
    of_a, of_b = _heights(b, a), _heights(a, b)  # of its corners above the other's plane
    deep = np.minimum(_least(of_b), _least(of_a)) > max(depth, slack)
    a, b, of_a, of_b, pairs = a[deep], b[deep], of_a[deep], of_b[deep], pairs[deep]
    line = np.cross(_normals(a), _normals(b))
    line /= np.maximum(np.linalg.norm(line, axis=1), 1e-300)[:, None]
    origin = a[:, 0]
    (low_a, high_a), (low_b, high_b) = _piece(a, of_a, line, origin), _piece(b, of_b, line, origin)
    return pairs[np.minimum(high_a, high_b) - np.maximum(low_a, low_b) > slack]


def _normals(t) -> np.ndarray:
    n = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    return n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]


def _heights(t, other) -> np.ndarray:
    """Return the heights [P, 3] of the corners of `other` above the planes of `t`, both [P, 3, 3]."""
    return np.einsum("pca,pa->pc", other - t[:, :1], _normals(t))


def _least(heights) -> np.ndarray:
    """Return how far a triangle would have to move to be on one side; 0 if it is."""
    return np.maximum(np.minimum(heights.max(axis=1), -heights.min(axis=1)), 0.0)


def _piece(t, heights, line, origin) -> tuple[np.ndarray, np.ndarray]:
    """Return where along a line [P, 3] triangles `t` begin and end to meet a plane, from their `heights` above it."""
    low, high = np.full(len(t), np.inf), np.full(len(t), -np.inf)
    for m, n in ((0, 1), (1, 2), (2, 0)):
        h, k = heights[:, m], heights[:, n]
        through = (h * k <= 0.0) & (h != k)
        share = np.where(through, h / np.where(through, h - k, 1.0), 0.0)
        point = t[:, m] + share[:, None] * (t[:, n] - t[:, m]) - origin
        at = np.einsum("pa,pa->p", point, line)
        low, high = np.where(through, np.minimum(low, at), low), np.where(through, np.maximum(high, at), high)
    return low, high
