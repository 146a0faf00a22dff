"""Build a checked `Pattern` from faces and whatever edge data is known."""

import numpy as np

from .checks import check_areas, check_edges, check_loops, check_vertices
from .crease_pattern import Pattern
from .topology import edge_key, edges_from_faces, orient_faces, sides_of_edges


def assemble(
    vertices,
    faces,
    *,
    edges=None,
    assignments=None,
    fold_angles=None,
    stiffness=None,
    rest_angles=None,
    thickness=None,
    materials=None,
    notes=None,
    extra=None,
    file=None,
) -> Pattern:
    """Return a `Pattern` with faces consistently oriented, all face sides listed, and what is unknown defaulted.

    Sides missing from `edges` are appended. Missing assignments become 'B' beside one face and 'U' beside two; a 'B'
    between two faces becomes 'U'. 'F' edges without a fold angle get 0. Each of these is told in the notes.

    Args:
        vertices: [V, 3] positions [m].
        faces: vertex loops.
        edges: [E, 2] vertex pairs, or None to take the sides of the faces.
        assignments: E letters or None for unknown ones, or None.
        fold_angles, rest_angles: [E] angles [rad] or None.
        stiffness: [E] crease stiffness [N m/rad] or None.
        thickness: [F] panel thickness [m] or None.
        materials: F names, or None.
        notes, extra: as in `Pattern`.
        file: named in errors.

    Raises:
        InputError: see `checks` and `orient_faces`.
    """
    notes = list(notes or [])
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    check_vertices(vertices, file=file)
    check_loops(faces, len(vertices), file=file)
    given = 0 if edges is None else len(edges)
    edges = np.asarray(edges if given else [], dtype=np.int64).reshape(-1, 2)
    edges = np.vstack([edges, _missing_sides(edges, faces)])
    check_edges(vertices, edges, file=file)
    check_areas(vertices, faces, file=file)
    sides = sides_of_edges(faces, file=file)
    faces, reversed_faces = orient_faces(vertices, faces, file=file)
    if reversed_faces:
        notes.append(f"{_list(reversed_faces, 'face')} reversed, to run counter-clockwise like the rest.")
    if given and len(edges) > given:
        notes.append(f"{len(edges) - given} face sides were not listed as edges and were added.")

    letters = [*(assignments or [None] * given), *[None] * (len(edges) - given)]
    letters = _default_letters(letters, edges, sides, notes)
    angles = _padded(fold_angles, len(edges))
    angles[[letter == "F" and np.isnan(angle) for letter, angle in zip(letters, angles, strict=True)]] = 0.0
    return Pattern(
        vertices=vertices,
        faces=faces,
        edges=edges,
        assignments=letters,
        fold_angles=angles,
        stiffness=_padded(stiffness, len(edges)),
        rest_angles=_padded(rest_angles, len(edges)),
        thickness=_padded(thickness, len(faces)),
        materials=list(materials) if materials is not None else [None] * len(faces),
        notes=notes,
        extra=dict(extra or {}),
    )


def _missing_sides(edges, faces) -> np.ndarray:
    listed = {edge_key(a, b) for a, b in edges.tolist()}
    missing = [pair for pair in edges_from_faces(faces).tolist() if tuple(pair) not in listed]
    return np.array(missing, dtype=np.int64).reshape(-1, 2)


def _default_letters(letters, edges, sides, notes) -> list[str]:
    counts = [len(sides.get(edge_key(a, b), ())) for a, b in edges.tolist()]
    unknown = [e for e, letter in enumerate(letters) if letter is None]
    inner_borders = [e for e, letter in enumerate(letters) if letter == "B" and counts[e] == 2]
    outer_creases = [e for e, letter in enumerate(letters) if letter in ("M", "V") and counts[e] == 1]
    loose = [e for e, count in enumerate(counts) if count == 0]
    if unknown:
        notes.append(f"{_list(unknown, 'edge')} without an assignment: taken as 'B' beside one face, 'U' beside two.")
    if inner_borders:
        notes.append(f"{_list(inner_borders, 'edge')} assigned 'B' between two faces: taken as 'U'.")
    if outer_creases:
        notes.append(f"{_list(outer_creases, 'edge')} assigned 'M' or 'V' beside one face only: no hinge there.")
    if loose:
        notes.append(f"{_list(loose, 'edge')} beside no face: nothing is built there.")
    default = {e: "U" if counts[e] == 2 else "B" for e in (*unknown, *inner_borders)}
    return [default[e] if e in default else letter for e, letter in enumerate(letters)]


def _padded(values, count) -> np.ndarray:
    padded = np.full(count, np.nan)
    if values is not None:
        padded[: len(values)] = values
    return padded


def _list(indices, noun) -> str:
    shown = ", ".join(map(str, indices[:8])) + (f" and {len(indices) - 8} more" if len(indices) > 8 else "")
    return f"{noun}{'s' * (len(indices) > 1)} {shown}"
