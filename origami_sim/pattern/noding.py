"""Edges that cross, overlap or join vertices at one place: cut where they meet, as drawn lines are."""

import numpy as np

from ..errors import InputError
from .checks import check_edges
from .drawn import foremost
from .planar import check_planar_graph, merge_distance, split_segments

MAX_EDGES = 20_000
"""Edges that are cut, as many as lines of a drawing."""


def is_planar(points, edges) -> bool:
    """Tell whether edges [E, 2] meet at common vertices of `points` [V, 2] only, and all have a length."""
    try:
        check_edges(points, edges)
        check_planar_graph(points, edges)
    except InputError:
        return False
    return True


def node_edges(points, edges, marks, rank, *, file=None) -> tuple[np.ndarray, list[tuple[int, int]], list[int]]:
    """Cut edges where they meet and make one of vertices that are one within the accuracy of the file.

    Args:
        points: [V, 2] positions. edges: [E, 2] vertex pairs.
        marks: what each edge is marked with. rank: the number of an edge to its rank; where edges lie on each other the
            one of least rank stays.
        file: named in errors.

    Returns:
        The points, the pieces as vertex pairs, and the edge that each is a piece of.

    Raises:
        InputError: too many edges or crossings, or none longer than the accuracy of the file.
    """
    if len(edges) > MAX_EDGES:
        raise InputError(
            "too many edges cross or overlap",
            file=file,
            field="edges_vertices",
            value=len(edges),
            allowed=f"up to {MAX_EDGES}, or faces_vertices given",
        )
    starts, ends = points[edges[:, 0]], points[edges[:, 1]]
    tolerance = merge_distance(starts, ends)
    long_enough = np.flatnonzero(np.linalg.norm(ends - starts, axis=1) > tolerance)
    if not len(long_enough):
        raise InputError("all edges are of no length", file=file, field="edges_vertices", allowed="some length")
    nodes, pieces = split_segments(starts[long_enough], ends[long_enough], tolerance, file=file)
    owner = [int(long_enough[s]) for *_, s in pieces]
    stays, _ = foremost([piece[:2] for piece in pieces], [marks[e] for e in owner], lambda n: rank(owner[n]))
    return nodes, list(stays), [owner[n] for n in stays.values()]
