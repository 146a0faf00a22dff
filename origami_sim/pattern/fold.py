"""Read and write crease patterns as FOLD 1.2 (https://github.com/edemaine/fold).

Angles are degrees in the file and radians in a `Pattern`; coordinates and thickness are in the file's `frame_unit`.
Our own keys: `edges_osim:stiffness` [N m/rad], `edges_osim:restAngle` [deg], `faces_osim:thickness` [frame_unit] and
`faces_osim:material`.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..files import read_bytes
from .assemble import assemble
from .checks import check_vertices
from .crease_pattern import ASSIGNMENTS, Pattern
from .drawn import FIRST, PRIORITY, foremost
from .files import write_atomic
from .fold_json import Frame, main_frame, parse_json, resolve_frame
from .holes import cut_noted, facets_of_holes, holes_noted
from .noding import is_planar, node_edges
from .planar import drop_holes, planar_faces
from .sizing import metres_of
from .topology import edge_key, sides_of_edges
from .triangulate import hinge_angles, triangulate
from .units import metres_per

OWN_KEYS = (
    "vertices_coords",
    "edges_vertices",
    "edges_assignment",
    "edges_foldAngle",
    "edges_osim:stiffness",
    "edges_osim:restAngle",
    "faces_vertices",
    "faces_osim:thickness",
    "faces_osim:material",
)
"""Keys that become fields of `Pattern`; every other key goes to `extra`."""
ORIENTATION_KEYS = ("faces_edges", "faces_faces", "edges_faces", "vertices_faces", "faceOrders")
"""Derived keys that a reversed face makes wrong."""
EDGE_NUMBERS = ("faces_edges", "vertices_edges", "edgeOrders")
"""Keys that hold numbers of edges."""
VERTEX_NUMBERS = ("vertices_vertices",)
"""Keys without a meaning here that hold numbers of vertices."""
PLANARITY_TOLERANCE = 1e-4
"""Distance from the common plane, relative to the pattern's size, up to which faces are derived."""
ROUNDING = 1e-4
"""Degrees beyond half a turn that are rounding, of angles computed in single precision or written with few digits; no
fold is meant to go there, so half and double change nothing else."""
PI = 2e-3
"""Distance from pi of a largest fold angle, in degrees, at which radians are suspected: pi written with two digits is
off by 1.6e-3, and angles meant in degrees are whole or computed. Half misses those two digits; double is as good."""
RADIANS_PER_DEGREE = np.pi / 180.0


def read_fold(path, *, frame=None, size=None, scale=None) -> Pattern:
    """Read a FOLD file; what had to be defaulted or derived is told in `notes`.

    Args:
        path: the file.
        frame: 0 for the key frame, k for the k-th of `file_frames`, with inheritance; None for the key frame, or the
            first crease pattern where the key frame has no vertices or is a folded form.
        size: longest side of the pattern [m]. scale: length of one unit of the file [m], instead of `size`. Without
            either, `frame_unit` holds, and 0.2 m is the longest side if the file does not give it.

    Returns:
        The pattern in metres and radians. Mountains and valleys without an angle fold to -180 and +180 degrees; in a
        folded form, to the angle that it shows. Keys without a meaning here are kept in `extra`; `write_fold` writes
        them back.

    Raises:
        InputError: naming the file, field, value and what is allowed.
    """
    document = parse_json(read_bytes(path), file=path)
    return fold_pattern(document, frame=frame, size=size, scale=scale, file=path)


def fold_pattern(document: dict, *, frame=None, size=None, scale=None, file=None) -> Pattern:
    """Turn parsed FOLD into a `Pattern`; see `read_fold`. `file` is named in errors."""
    if frame is None:
        frame = main_frame(document, file=file)
    keys = resolve_frame(document, frame, file=file)
    data, notes = Frame(keys, file), []
    if keys.get("frame_unit") is None:
        keys["frame_unit"] = "unit"
    stated = metres_per(keys["frame_unit"], file=file, field="frame_unit")
    vertices = data.coordinates()
    with np.errstate(over="ignore", invalid="ignore"):  # what is too large is refused below, once its unit is known
        extent = float(np.ptp(vertices, axis=0).max()) or 1.0
    if keys["frame_unit"] == "unit":
        keys["frame_unit"] = "m"
        scale = metres_of(extent, size=size, scale=scale, notes=notes, file=file)
    elif size is None and scale is None:
        scale = stated
    else:
        scale = metres_of(extent, size=size, scale=scale, notes=notes, file=file)
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = vertices * scale
    check_vertices(vertices, file=file)
    edges, faces = data.loops("edges_vertices", size=2), data.loops("faces_vertices")
    if not edges and not faces:
        raise InputError(
            "neither edges nor faces given", file=file, field="edges_vertices", allowed="at least one face"
        )
    count = len(edges or ())
    letters = data.choices("edges_assignment", count, ASSIGNMENTS)
    fold_angles = _angles(data, "edges_foldAngle", count)
    rest_angles = _angles(data, "edges_osim:restAngle", count)
    stiffness = data.numbers("edges_osim:stiffness", count, 0.0, np.inf, "0 or more [N m/rad]")
    listed = _Edges(edges or [], letters, fold_angles, rest_angles, stiffness)
    if edges:
        kept = _distinct(listed, notes)
        if len(kept) < count:
            listed = listed.taken(kept)
            _keep_edges(keys, kept, count)
    _note_angles(listed.letters, listed.fold_angles, notes)
    if not edges:
        notes.append("edges_vertices is not given: edges are the sides of the faces.")
    if not faces:
        vertices, listed, faces = _derived_faces(vertices, listed, keys, notes, file)
    vertices, listed, faces = _without_strays(vertices, listed, faces, keys, notes)
    count = len(listed.pairs)
    thickness = data.numbers(
        "faces_osim:thickness", len(faces), 0.0, np.inf, "a thickness above 0, in frame_unit", open_low=True
    )
    pattern = assemble(
        vertices,
        faces,
        edges=listed.pairs,
        assignments=listed.letters,
        fold_angles=listed.fold_angles,
        stiffness=listed.stiffness,
        rest_angles=listed.rest_angles,
        thickness=None if thickness is None else thickness * scale,
        materials=data.names("faces_osim:material", len(faces)),
        notes=notes,
        extra=_extra(document, keys, frame, notes),
        file=file,
    )
    _fit_extra(pattern, faces, count)
    _default_angles(pattern)
    return pattern


def _default_angles(pattern) -> None:
    """Give mountains and valleys without an angle that of the shape, or half a turn where the pattern is flat."""
    sides = {"M": -np.pi, "V": np.pi}
    beside = sides_of_edges(pattern.faces)
    open_ones = [
        e
        for e in pattern.edges_assigned("MV").tolist()
        if np.isnan(pattern.fold_angles[e]) and len(beside[edge_key(*pattern.edges[e].tolist())]) == 2
    ]
    if not open_ones:
        return
    pattern.fold_angles[open_ones] = [sides[pattern.assignments[e]] for e in open_ones]
    centred = pattern.vertices - pattern.vertices.mean(axis=0)
    extent = np.linalg.norm(centred, axis=1).max()
    if np.linalg.svd(centred, compute_uv=False)[-1] <= PLANARITY_TOLERANCE * extent * np.sqrt(len(centred)):
        pattern.notes.append(f"{len(open_ones)} mountains and valleys without a fold angle: taken as 180 degrees.")
        return
    try:
        split = triangulate(pattern, planarity_tolerance=0.1)
    except InputError:  # no plane faces, so no angles between them; whoever builds the sheet will hear of it
        return
    shown = dict(zip(split.crease_edge.tolist(), hinge_angles(split.vertices, split.creases), strict=True))
    clear = [e for e in open_ones if 0.05 < abs(shown[e]) < np.pi - 0.05]
    turned = sum(np.sign(shown[e]) * sides[pattern.assignments[e]] for e in clear) < 0
    if turned:  # the file looks at the other side of its faces
        swap = {"M": "V", "V": "M"}
        pattern.assignments[:] = [swap.get(letter, letter) for letter in pattern.assignments]
        pattern.fold_angles *= -1.0
        pattern.notes.append("mountains and valleys are seen from the other side of the faces: exchanged.")
    for e in open_ones:
        if abs(shown[e]) < np.pi - 0.05:  # a flat fold has no side of its own: the letter's
            pattern.fold_angles[e] = shown[e]
    pattern.notes.append(f"{len(open_ones)} mountains and valleys without a fold angle: taken from the folded form.")


def _angles(data, field, count):
    most = 180.0 + ROUNDING
    degrees = data.numbers(field, count, -most, most, "-180 to 180 degrees")
    return None if degrees is None else np.clip(degrees, -180.0, 180.0) * RADIANS_PER_DEGREE


@dataclass
class _Edges:
    """The edges of a file: vertex pairs, and what is known of each, or None where nothing is."""

    pairs: list
    letters: Sequence[str | None] | None
    fold_angles: np.ndarray | None
    rest_angles: np.ndarray | None
    stiffness: np.ndarray | None

    def taken(self, which: list[int], pairs: list | None = None) -> "_Edges":
        """Return some of the edges, or, with other pairs, pieces of them."""
        angles = (self.fold_angles, self.rest_angles, self.stiffness)
        known = (None if a is None else a[which] for a in angles)
        return _Edges(
            [self.pairs[e] for e in which] if pairs is None else pairs,
            self.letters and [self.letters[e] for e in which],
            *known,
        )

    def with_facets(self, pairs: list) -> "_Edges":
        """Return the edges and flat ones that follow them."""
        more = len(pairs)
        known = (self.fold_angles, self.rest_angles, self.stiffness)
        longer = (None if a is None else np.append(a, np.full(more, np.nan)) for a in known)
        letters = self.letters or [None] * len(self.pairs)
        return _Edges([*self.pairs, *pairs], [*letters, *"F" * more], *longer)

    def rank(self, e: int) -> tuple[int, bool]:
        """Return which of edges that lie on each other stays: the first in `PRIORITY`, and of these one with an
        angle."""
        letter = PRIORITY.find((self.letters[e] if self.letters else None) or "U")
        missing = self.fold_angles is None or bool(np.isnan(self.fold_angles[e]))
        return letter if letter >= 0 else len(PRIORITY), missing


def _distinct(listed: _Edges, notes) -> list[int]:
    """Return which edges stay, in order, if of those between the same two vertices one does."""
    stays, differ = foremost(listed.pairs, listed.letters or "U" * len(listed.pairs), listed.rank)
    if len(stays) < len(listed.pairs):
        contrary = f", {len(differ)} of them with different letters; {FIRST}" if differ else ""
        more = len(listed.pairs) - len(stays)
        edges = "1 edge was listed twice and is" if more == 1 else f"{more} edges were listed more than once and are"
        notes.append(f"{edges} one{contrary}.")
    return sorted(stays.values())


def _keep_edges(keys, kept, count) -> None:
    """Shorten the lists of all edges to those that are kept; drop those that number edges."""
    for key, value in list(keys.items()):
        if key in EDGE_NUMBERS:
            del keys[key]
        elif key.startswith("edges_") and isinstance(value, list) and len(value) == count:
            keys[key] = [value[e] for e in kept]


def _note_angles(letters, fold_angles, notes) -> None:
    """Say of angles against their letters, and of angles that look like radians."""
    letters = letters if letters is not None else [None] * len(() if fold_angles is None else fold_angles)
    angles = np.full(len(letters), np.nan) if fold_angles is None else fold_angles
    odd = [
        e
        for e, (letter, angle) in enumerate(zip(letters, angles, strict=True))
        if (letter == "M" and angle > 0) or (letter == "V" and angle < 0)
    ]
    if odd:
        shown = ", ".join(f"{e} ('{letters[e]}', {np.degrees(angles[e]):+.6g} deg)" for e in odd[:3])
        more = f" and {len(odd) - 3} more" if len(odd) > 3 else ""
        edges, are = ("edge", "is") if len(odd) == 1 else ("edges", "are")
        notes.append(
            f"{len(odd)} {edges} with a fold angle against the letter, where mountains are negative: {shown}{more}; "
            f"both {are} kept, and the angle is what folds."
        )
    largest = float(np.degrees(np.abs(angles[~np.isnan(angles)]).max(initial=0.0)))
    if abs(largest - np.pi) < PI:
        notes.append(
            f"the largest fold angle is {largest:.6g} deg, as pi: edges_foldAngle is in degrees; of radians write "
            "180 / pi times as much."
        )


def _derived_faces(vertices, listed: _Edges, keys, notes, file):
    """Return vertices, edges and the bounded faces of the planar graph of a flat pattern.

    Edges that cross, overlap or end at each other without a common vertex are cut there, as the lines of a drawing are.
    """
    size = np.ptp(vertices, axis=0).max()
    middle = vertices.mean(axis=0)
    axes = np.linalg.svd(vertices - middle, full_matrices=False)[2] if len(vertices) > 2 else np.eye(3)
    if np.abs((vertices - middle) @ axes[2]).max() > PLANARITY_TOLERANCE * size:
        raise InputError(
            "the pattern is not flat, so its faces cannot be derived",
            file=file,
            field="faces_vertices",
            allowed="faces_vertices given, or all vertices in one plane",
        )
    plane = _plane_axes(axes[2])
    points, pairs = (vertices - middle) @ plane.T, np.array(listed.pairs, dtype=np.int64)
    if not is_planar(points, pairs):
        marks = listed.letters or "U" * len(pairs)
        points, pieces, owner = node_edges(points, pairs, marks, listed.rank, file=file)
        notes.append(
            f"edges cross or overlap: {len(pairs)} edges between {len(vertices)} vertices were cut where they meet "
            f"into {len(pieces)} between {len(points)}."
        )
        listed, vertices = listed.taken(owner, pieces), points @ plane + middle
        _keep_edges(keys, owner, len(pairs))
        for key in [k for k in keys if k.startswith("vertices_")]:
            del keys[key]
        pairs = np.array(pieces, dtype=np.int64)
    facets, holed = facets_of_holes(points, pairs)
    if holed:
        notes.append(cut_noted(holed))
        for key, value in keys.items():
            if key.startswith("edges_") and isinstance(value, list) and len(value) == len(pairs):
                keys[key] = [*value, *[None] * len(facets)]
        listed = listed.with_facets(facets)
        pairs = np.array(listed.pairs, dtype=np.int64)
    found = planar_faces(points, pairs, file=file)
    letters = listed.letters or []
    borders = {edge_key(*pair) for pair, letter in zip(listed.pairs, letters, strict=False) if letter == "B"}
    faces, holes = drop_holes(found, borders)
    if not faces:
        raise InputError(
            "the edges enclose no face", file=file, field="edges_vertices", allowed="at least one closed face"
        )
    notes.append(f"faces_vertices is not given: {len(faces)} faces derived from the edges.")
    if holes:
        notes.append(holes_noted(holes, "edges"))
    return vertices, listed, faces


def _without_strays(vertices, listed: _Edges, faces, keys, notes):
    """Return vertices, edges and faces without the vertices that belong to no face, and the edges to them."""
    used = sorted({v for face in faces for v in face if 0 <= v < len(vertices)})
    if len(used) == len(vertices):
        return vertices, listed, faces
    number = {v: n for n, v in enumerate(used)}
    kept = [e for e, pair in enumerate(listed.pairs) if all(v in number for v in pair)]
    strays, count = len(vertices) - len(used), len(listed.pairs)
    loose = f", and {count - len(kept)} edges to them," if len(kept) < count else ""
    notes.append(f"{strays} vertices that belong to no face{loose} were left out.")
    _keep_edges(keys, kept, count)
    for key, value in list(keys.items()):
        if key in VERTEX_NUMBERS:
            del keys[key]
        elif key.startswith("vertices_") and isinstance(value, list) and len(value) == len(vertices):
            keys[key] = [value[v] for v in used]
    pairs = [tuple(number[v] for v in listed.pairs[e]) for e in kept]
    return vertices[used], listed.taken(kept, pairs), [tuple(number[v] for v in face) for face in faces]


def _plane_axes(normal) -> np.ndarray:
    """Return [2, 3] right-handed axes of a plane, such that its normal points up; x and y for the xy plane."""
    normal = normal * (-1.0 if normal[np.argmax(np.abs(normal))] < 0 else 1.0)
    guide = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    first = guide - (guide @ normal) * normal
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def _extra(document, keys, frame, notes) -> dict:
    extra = {key: value for key, value in document.items() if key.startswith("file_") and key != "file_spec"}
    extra |= {key: value for key, value in keys.items() if key not in OWN_KEYS}
    if frame != 0:
        extra = {k: v for k, v in extra.items() if k not in ("file_frames", "frame_parent", "frame_inherit")}
        notes.append(f"frame {frame} was read on its own: the other frames of the file are not kept.")
    return extra


def _fit_extra(pattern, faces, edge_count) -> None:
    """Lengthen unknown per-edge lists for edges that were added; drop lists that a reversed face made wrong."""
    added = pattern.edge_count - edge_count
    if edge_count and added:
        for key, value in pattern.extra.items():
            if key.startswith("edges_") and isinstance(value, list) and len(value) == edge_count:
                pattern.extra[key] = value + [None] * added
    if [tuple(face) for face in faces] != pattern.faces:
        dropped = [key for key in ORIENTATION_KEYS if pattern.extra.pop(key, None) is not None]
        if dropped:
            pattern.notes.append(f"{', '.join(dropped)} dropped, because faces were reversed.")


def write_fold(pattern: Pattern, path) -> None:
    """Write a FOLD 1.2 file, atomically, with the keys kept in `extra`; reading it back gives the same pattern.

    Coordinates are in `pattern.extra['frame_unit']`, in metres if that is not there.

    Raises:
        InputError: the file cannot be written, or `extra` holds what JSON cannot.
    """
    document = pattern_fold(pattern)
    try:
        lines = [f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in document.items()]
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"the pattern cannot be written as JSON: {error}", file=path, field="extra") from None
    write_atomic(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode("ascii"))


def pattern_fold(pattern: Pattern) -> dict:
    """Return a pattern as a FOLD document; see `write_fold`."""
    extra = {"frame_unit": "m"} | pattern.extra
    scale = metres_per(extra["frame_unit"], field="frame_unit")
    flat = not pattern.vertices[:, 2].any()
    coordinates = _divided(pattern.vertices[:, :2] if flat else pattern.vertices, scale)
    document = {
        "file_spec": 1.2,
        **extra,
        "vertices_coords": coordinates.tolist(),
        "edges_vertices": pattern.edges.tolist(),
        "edges_assignment": list(pattern.assignments),
        "faces_vertices": [list(map(int, face)) for face in pattern.faces],
    }
    optional = {
        "edges_foldAngle": _degrees(pattern.fold_angles),
        "edges_osim:stiffness": pattern.stiffness,
        "edges_osim:restAngle": _degrees(pattern.rest_angles),
        "faces_osim:thickness": _divided(pattern.thickness, scale),
    }
    for key, values in optional.items():
        if not np.isnan(values).all():
            document[key] = [None if np.isnan(value) else value for value in values.tolist()]
    if any(name is not None for name in pattern.materials):
        document["faces_osim:material"] = list(pattern.materials)
    return document


def _degrees(angles) -> np.ndarray:
    return np.clip(_divided(angles, RADIANS_PER_DEGREE), -180.0, 180.0)


def _divided(values, factor) -> np.ndarray:
    """Return values / factor, chosen among its neighbours so that multiplying by `factor` gives `values` back."""
    result = np.asarray(values / factor, dtype=np.float64)
    rounded = np.array([float(f"{x:.14g}") for x in result.ravel()]).reshape(result.shape)
    for candidate in (np.nextafter(result, np.inf), np.nextafter(result, -np.inf), rounded):
        result = np.where(candidate * factor == values, candidate, result)
    return result
