"""Plane polygons in space: the plane, simplicity, ear clipping, centroid."""

import numpy as np

from .planar import cross2, signed_area
from .topology import area_vector

TIE = 1e-9
"""Relative difference below which two diagonals count as equally long."""


def project(points) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """Project a polygon on its mean plane.

    Args:
        points: [N, 3] corners [m], in order.

    Returns:
        The [N, 2] projected corners (counter-clockwise), the largest distance from the plane [m], the [3] origin and
        the [2, 3] axes of the plane.
    """
    area = area_vector(points, range(len(points)))
    normal = area / np.linalg.norm(area)
    origin = points.mean(axis=0)
    first = points[1] - points[0]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    axes = np.array([first, np.cross(normal, first)])
    return (points - origin) @ axes.T, float(np.abs((points - origin) @ normal).max()), origin, axes


def self_intersects(corners) -> bool:
    """Tell whether two sides of a polygon [N, 2] that are not neighbours meet, or two neighbours fold back."""
    n = len(corners)
    margin = 1e-12 * np.ptp(corners, axis=0).max() ** 2
    ahead = np.roll(corners, -1, axis=0)
    back = np.roll(corners, -2, axis=0)
    turn, along = cross2(ahead - corners, back - ahead), np.sum((ahead - corners) * (back - ahead), axis=1)
    if np.any((np.abs(turn) <= margin) & (along < 0)):
        return True
    low, high = np.minimum(corners, ahead), np.maximum(corners, ahead)
    for i in range(n - 2):
        a, b, later = corners[i], ahead[i], slice(i + 2, n if i else n - 1)
        p, q = corners[later], ahead[later]
        straddles_here = cross2(b - a, p - a) * cross2(b - a, q - a) <= margin**2
        straddles_there = cross2(q - p, a - p) * cross2(q - p, b - p) <= margin**2
        apart = np.any((high[i] < low[later]) | (high[later] < low[i]), axis=1)
        if np.any(straddles_here & straddles_there & ~apart):
            return True
    return False


def clip_ears(corners, labels) -> list[tuple[int, int, int]] | None:
    """Triangulate a simple polygon, cutting at each step the ear with the shortest diagonal.

    For a convex quad this is the shorter diagonal; a tie goes to the one through the lowest label.

    Args:
        corners: [N, 2] counter-clockwise corners.
        labels: [N] numbers of the corners, used for ties.

    Returns:
        Triangles as positions in `corners`, counter-clockwise, or None if the polygon is not simple.
    """
    ring, triangles = list(range(len(corners))), []
    margin = 1e-12 * np.ptp(corners, axis=0).max() ** 2
    ears: dict[int, tuple[float, list]] = {}  # corner -> length and ends of the diagonal that cuts it off
    unknown = set(ring)
    while len(ring) > 3:
        place = {v: n for n, v in enumerate(ring)}
        around = {b: (ring[place[b] - 1], ring[(place[b] + 1) % len(ring)]) for b in unknown}
        blocked = set()
        for b, (a, c) in around.items():
            convex, free = _is_ear(corners, ring, a, b, c, margin)
            if free:
                ears[b] = (float(np.linalg.norm(corners[a] - corners[c])), sorted((labels[a], labels[c])))
            elif convex:
                blocked.add(b)  # until what lies in its triangle is cut off
        if not ears:
            return None
        shortest = min(length for length, _ in ears.values())
        _, n = min((ends, place[b]) for b, (length, ends) in ears.items() if length <= shortest * (1.0 + TIE))
        a, b, c = ring[n - 1], ring[n], ring[(n + 1) % len(ring)]
        triangles.append((a, b, c))
        del ring[n]
        for v in (a, b, c):
            ears.pop(v, None)
        unknown = (blocked | {a, c}) - {b}
    triangles.append(tuple(ring))
    return triangles if all(signed_area(corners[list(t)]) > margin for t in triangles) else None


def _is_ear(corners, ring, a, b, c, margin) -> tuple[bool, bool]:
    """Tell whether corner b is convex, and whether its triangle holds no other corner either."""
    pa, pb, pc = corners[a], corners[b], corners[c]
    if cross2(pb - pa, pc - pb) <= margin:
        return False, False
    others = corners[[v for v in ring if v not in (a, b, c)]]
    inside = (
        (cross2(pb - pa, others - pa) >= -margin)
        & (cross2(pc - pb, others - pb) >= -margin)
        & (cross2(pa - pc, others - pc) >= -margin)
    )
    return True, not inside.any()


def centroid(corners) -> np.ndarray:
    """Return the area centroid [2] of a polygon [N, 2]."""
    origin = corners[0]
    a, b = corners - origin, np.roll(corners, -1, axis=0) - origin
    weights = cross2(a, b)
    return origin + ((a + b) * weights[:, None]).sum(axis=0) / (3.0 * weights.sum())
