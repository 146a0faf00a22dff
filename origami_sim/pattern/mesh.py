"""Crease patterns from triangle meshes (OBJ, STL) and meshes back to files, by trimesh."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import read_bytes
from .assemble import assemble
from .crease_pattern import Pattern
from .files import write_atomic
from .polygon import clip_ears, project
from .sizing import metres_of
from .topology import edge_key, sides_of_edges
from .triangulate import hinge_angles, triangulate
from .units import metres_per

FORMATS = (".obj", ".stl")
COPLANAR = 1e-4
"""Fold angle [rad] below which two triangles are one flat panel (STL stores single precision)."""


def read_mesh(path, *, unit="m", size=None, scale=None) -> Pattern:
    """Read an OBJ or STL file as a pattern in its rest shape.

    Every triangle becomes a face. An edge between coplanar triangles is 'F'; any other one is 'U', with the signed
    fold angle of the mesh (valley positive) as rest angle. STL vertices at the same place are merged; OBJ vertices
    keep their numbers.

    Args:
        path: the file, .obj or .stl.
        unit: length unit of the coordinates, which the formats do not tell.
        size: longest side of the mesh [m]. scale: length of one unit [m]. Either instead of `unit`.

    Raises:
        InputError: unreadable or empty mesh, unknown suffix or unit, or anything `checks` refuses.
    """
    import trimesh  # only here: slow to import

    suffix = _suffix(path)
    stated = metres_per(unit)
    data = read_bytes(path)
    if not (suffix == ".stl" and _binary_stl(data)):
        _check_text(data, path, suffix)  # trimesh would guess another encoding, where a package for that is installed
    try:
        mesh = trimesh.load(str(path), file_type=suffix[1:], process=False, force="mesh", skip_materials=True)
    except Exception as error:  # a third-party parser: whatever it trips over is the file's fault
        raise InputError(f"cannot read the mesh ({type(error).__name__}: {str(error)[:120]})", file=path) from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError("no triangles in the mesh", file=path)
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:  # OBJ vertices of two numbers
        raise InputError("a vertex has not three coordinates", file=path, field="v", allowed="v x y z")
    if suffix == ".stl":
        vertices, triangles = _merged(vertices, triangles)
    notes = []
    if size is None and scale is None:
        scale = stated
        notes.append(f"the format has no unit: coordinates are taken in '{unit}'.")
    else:
        scale = metres_of(float(np.ptp(vertices, axis=0).max()) or 1.0, size=size, scale=scale, notes=notes, file=path)
    faces = [tuple(map(int, face)) for face in triangles]
    pattern = assemble(vertices * scale, faces, file=path)
    notes += [note for note in pattern.notes if "without an assignment" not in note]
    pattern.notes[:] = notes
    split = triangulate(pattern)
    for e, angle in zip(split.crease_edge, hinge_angles(pattern.vertices, split.creases), strict=True):
        if abs(angle) < COPLANAR:
            pattern.assignments[e], pattern.fold_angles[e] = "F", 0.0
        else:
            pattern.rest_angles[e] = angle
    return pattern


def _suffix(path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InputError("unknown mesh format", file=path, field="suffix", value=suffix, allowed=", ".join(FORMATS))
    return suffix


def _binary_stl(data: bytes) -> bool:
    """Whether bytes are as long as a binary STL file of as many triangles as they state."""
    return len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _check_text(data: bytes, path, suffix: str):
    """Refuses bytes that are no text in UTF-8.

    Raises:
        InputError: names the file.
    """
    try:
        data.decode()
    except UnicodeDecodeError:
        kind = {".stl": "neither binary nor ASCII STL", ".obj": "not text in UTF-8"}[suffix]
        raise InputError(f"cannot read the mesh: it is {kind}", file=path) from None


def _merged(vertices, triangles) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices at exactly the same place, numbered by first appearance."""
    _, first, index = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[index.reshape(-1)][triangles]


def sheet(vertices, faces) -> Pattern:
    """Return a sheet without creases: all inner edges are 'F', so that it bends over its whole surface.

    Args:
        vertices: [V, 3] positions [m]. faces: vertex loops, of triangles or polygons.

    Raises:
        InputError: anything `checks` refuses.
    """
    return uncreased(assemble(vertices, [tuple(map(int, face)) for face in faces]))


def uncreased(pattern: Pattern) -> Pattern:
    """Return the pattern with its unassigned edges made flat, such as those of `grid`: a sheet that bends all over.

    Folds of a sheet that is not flat become its rest angles.
    """
    out = replace(pattern, assignments=list(pattern.assignments), fold_angles=pattern.fold_angles.copy())
    for e in pattern.edges_assigned("U"):
        out.assignments[e], out.fold_angles[e] = "F", 0.0
    out.notes = [note for note in pattern.notes if "without an assignment" not in note]
    return out


def cut(pattern: Pattern, edges) -> Pattern:
    """Return the pattern with slits: the sheet parts along these edges, whose ends stay joined within the sheet.

    Args:
        edges: their indices, or pairs of vertices.

    Raises:
        InputError: no such edge, or one on the border.
    """
    out, found = replace(pattern, assignments=list(pattern.assignments), fold_angles=pattern.fold_angles.copy()), {}
    for e, (a, b) in enumerate(pattern.edges.tolist()):
        found[edge_key(a, b)] = e
    sides = sides_of_edges(pattern.faces)
    for edge in edges:
        e = found.get(edge_key(*map(int, edge)), -1) if np.ndim(edge) else int(edge)
        if not 0 <= e < pattern.edge_count or len(sides.get(edge_key(*pattern.edges[e].tolist()), ())) < 2:
            raise InputError(
                "only an edge between two panels can be cut",
                field="edges",
                value=[*map(int, edge)] if np.ndim(edge) else e,
                allowed=f"0 to {pattern.edge_count - 1}, or two vertices of an inner edge",
            )
        out.assignments[e], out.fold_angles[e] = "C", np.nan
    return out


def write_mesh(vertices, faces, path) -> None:
    """Write a mesh as OBJ or STL, atomically; polygons are split into triangles.

    Args:
        vertices: [N, 3] positions [m].
        faces: loops of 3 or more vertex indices.
        path: the file, .obj or .stl.

    Raises:
        InputError: unknown suffix, a face that cannot be split, or a file that cannot be written.
    """
    import trimesh  # only here: slow to import

    suffix = _suffix(path)
    vertices = np.asarray(vertices, dtype=np.float64)
    triangles = []
    for f, face in enumerate(faces):
        loop = [int(v) for v in face]
        pieces = [(0, 1, 2)] if len(loop) == 3 else clip_ears(project(vertices[loop])[0], loop)
        if pieces is None:
            raise InputError("face cannot be triangulated", field=f"faces[{f}]", value=loop, allowed="simple polygons")
        triangles += [[loop[n] for n in piece] for piece in pieces]
    mesh = trimesh.Trimesh(vertices=vertices, faces=np.array(triangles).reshape(-1, 3), process=False)
    options = {"digits": 12, "include_normals": False, "header": None} if suffix == ".obj" else {}
    data = mesh.export(file_type=suffix[1:], **options)
    write_atomic(path, data.encode() if isinstance(data, str) else bytes(data))
