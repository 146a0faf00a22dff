"""Incidence of faces and edges: face sides, consistent orientation, missing edges, opened cuts."""

from collections import defaultdict, deque
from dataclasses import replace

import numpy as np

from ..errors import InputError
from .crease_pattern import Pattern


def face_sides(face):
    """Yield the directed sides (a, b) of a vertex loop."""
    return zip(face, (*face[1:], face[0]), strict=True)


def edge_key(a, b) -> tuple[int, int]:
    """Return the vertex pair of an undirected edge, smaller index first."""
    return (a, b) if a < b else (b, a)


def sides_of_edges(faces, *, file=None) -> dict[tuple[int, int], list[tuple[int, bool]]]:
    """Map each edge key to its (face, the face runs from the smaller to the larger vertex) entries.

    Raises `InputError` for an edge with three or more faces.
    """
    sides = defaultdict(list)
    for f, face in enumerate(faces):
        for a, b in face_sides(face):
            sides[edge_key(a, b)].append((f, a < b))
    for (a, b), entries in sides.items():
        if len(entries) > 2:
            raise InputError(
                f"non-manifold edge: faces {', '.join(str(f) for f, _ in entries)} share the edge {a}-{b}",
                file=file,
                field="faces_vertices",
                allowed="at most 2 faces per edge",
            )
    return dict(sides)


def area_vector(vertices, face) -> np.ndarray:
    """Return the [3] area vector [m^2] of a polygon (Newell's sum), along its counter-clockwise normal."""
    points = vertices[list(face)]
    centred = points - points[0]
    return 0.5 * np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)


def orient_faces(vertices, faces, *, file=None) -> tuple[list[tuple[int, ...]], list[int]]:
    """Turn the faces of each connected component the same way round.

    An unfolded component in the xy plane becomes counter-clockwise seen from +z; any other one keeps the way of
    most of its faces.

    Args:
        vertices: [V, 3] positions [m].
        faces: vertex loops.
        file: named in errors.

    Returns:
        The oriented faces and the indices of those that were reversed.

    Raises:
        InputError: a non-manifold edge, or a component that has no consistent orientation (a Moebius band).
    """
    neighbours = defaultdict(list)
    for entries in sides_of_edges(faces, file=file).values():
        if len(entries) == 2:
            (f, forward_f), (g, forward_g) = entries
            neighbours[f].append((g, forward_f == forward_g))
            neighbours[g].append((f, forward_f == forward_g))
    turned: dict[int, bool] = {}
    for start in range(len(faces)):
        if start in turned:
            continue
        component = _relative_turns(start, neighbours, file)
        if _majority_is_wrong(vertices, faces, component):
            component = {f: not turn for f, turn in component.items()}
        turned |= component
    oriented = [tuple(reversed(face)) if turned[f] else tuple(face) for f, face in enumerate(faces)]
    return oriented, sorted(f for f, turn in turned.items() if turn)


def _relative_turns(start, neighbours, file) -> dict[int, bool]:
    turned, queue = {start: False}, deque([start])
    while queue:
        f = queue.popleft()
        for g, opposed in neighbours[f]:
            turn = turned[f] != opposed
            if g not in turned:
                turned[g] = turn
                queue.append(g)
            elif turned[g] != turn:
                raise InputError(
                    f"faces {f} and {g} cannot be oriented consistently (a Moebius band)",
                    file=file,
                    field="faces_vertices",
                    allowed="an orientable sheet",
                )
    return turned


def _majority_is_wrong(vertices, faces, component) -> bool:
    areas = np.array([area_vector(vertices, faces[f]) * (-1.0 if turn else 1.0) for f, turn in component.items()])
    total = np.linalg.norm(areas, axis=1).sum()
    if abs(areas[:, 2].sum()) > (1.0 - 1e-9) * total:
        return bool(areas[:, 2].sum() < 0.0)
    return 2 * sum(component.values()) > len(component)


def edges_from_faces(faces) -> np.ndarray:
    """Return the [E, 2] int64 face sides, each once, in the order in which the faces list them."""
    return np.array(list(dict.fromkeys(edge_key(a, b) for face in faces for a, b in face_sides(face))), dtype=np.int64)


def open_cuts(pattern: Pattern) -> tuple[Pattern, np.ndarray]:
    """Separate the sheet along its 'C' edges by duplicating the vertices where the two sides part.

    The vertices and edges of `pattern` keep their indices; duplicates, and the second side of each cut, follow them.
    The tip of a cut inside the sheet stays one vertex.

    Returns:
        The opened pattern and vertex_source [V'], the vertex of `pattern` behind each vertex. Unknown per-vertex
        and per-edge keys in `extra` are left out of an opened pattern, since they no longer fit.
    """
    cuts = {edge_key(*map(int, pattern.edges[e])) for e in pattern.edges_assigned("C")}
    sides = sides_of_edges(pattern.faces)
    cut_pairs = [key for key in sides if key in cuts and len(sides[key]) == 2]
    if not cut_pairs:
        return pattern, np.arange(pattern.vertex_count)
    corners = {v for key in cut_pairs for v in key}
    groups = _corner_groups(pattern.faces, sides, cuts, corners)
    source = list(range(pattern.vertex_count))
    renamed: dict[tuple[int, int], int] = {}
    for v in sorted(corners):
        for group in groups[v][1:]:
            renamed |= {(f, v): len(source) for f in group}
            source.append(v)
    faces = [tuple(renamed.get((f, v), v) for v in face) for f, face in enumerate(pattern.faces)]
    return _with_opened_edges(pattern, faces, np.array(source), renamed, sides), np.array(source)


def _corner_groups(faces, sides, cuts, corners):
    """Group the faces around each vertex of `corners` that are joined by edges other than cuts."""
    joined = defaultdict(lambda: defaultdict(list))
    for key, entries in sides.items():
        if key not in cuts and len(entries) == 2:
            f, g = entries[0][0], entries[1][0]
            for v in key:
                joined[v][f].append(g)
                joined[v][g].append(f)
    around = defaultdict(list)
    for f, face in enumerate(faces):
        for v in face:
            around[v].append(f)
    groups = {}
    for v in corners:
        seen, groups[v] = set(), []
        for f in around[v]:
            if f in seen:
                continue
            group, stack = [], [f]
            seen.add(f)
            while stack:
                here = stack.pop()
                group.append(here)
                fresh = [g for g in joined[v][here] if g not in seen]
                seen.update(fresh)
                stack.extend(fresh)
            groups[v].append(group)
    return groups


def _with_opened_edges(pattern, faces, source, renamed, sides):
    """Rename the ends of the edges by the first face beside them; append the second side of opened cuts."""
    edges, second_side = [], []
    for e, (a, b) in enumerate(pattern.edges.tolist()):
        entries = sides.get(edge_key(a, b), [])
        named = [(renamed.get((f, a), a), renamed.get((f, b), b)) for f, _ in entries] or [(a, b)]
        edges.append(named[0])
        if len(named) == 2 and named[0] != named[1]:
            second_side.append((e, named[1]))
    copies = [*range(len(edges)), *(e for e, _ in second_side)]
    fitting = {k: v for k, v in pattern.extra.items() if not k.startswith(("vertices_", "edges_"))}
    return replace(
        pattern,
        vertices=pattern.vertices[source],
        faces=faces,
        edges=np.array(edges + [pair for _, pair in second_side], dtype=np.int64),
        assignments=[pattern.assignments[e] for e in copies],
        fold_angles=pattern.fold_angles[copies],
        stiffness=pattern.stiffness[copies],
        rest_angles=pattern.rest_angles[copies],
        extra=fitting,
    )
