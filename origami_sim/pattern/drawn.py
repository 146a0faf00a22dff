"""Crease patterns of drawn lines: split where they meet, their ends merged, faces found."""

import math
from collections import Counter

import numpy as np

from ..errors import InputError
from .assemble import assemble
from .checks import COORDINATE_LIMIT, check_number
from .crease_pattern import Pattern
from .holes import cut_noted, facets_of_holes, holes_noted
from .planar import SAME, drop_holes, merge_distance, moved_points, planar_faces, split_segments
from .sizing import metres_of
from .topology import edge_key, face_sides

PRIORITY = "BCMVFU"
"""Which assignment an edge keeps where lines lie on each other."""
FIRST = "the first of border, cut, mountain, valley, flat and unassigned is kept"
"""The same in words."""
NO_FOLD = "no line was read as a mountain or valley"
"""How the note begins that says so; who has nothing to fold repeats it."""
READ = {"B": "border", "C": "cut", "M": "mountain", "V": "valley", "F": "facet", "U": "crease without a target"}
"""Assignments in words."""
KINDS = 8
"""Kinds of lines that such a note names."""
MAX_SEGMENTS = 20_000
NAMED = 3
"""Places that a sentence names; half or double of them are as good."""


def note_without_folds(read: Counter, notes: list[str]) -> None:
    """Say how the lines of a drawing were read, if none of them folds.

    Args:
        read: how many lines by what they look like and their assignment, None for those left out.
        notes: list that takes the sentence.
    """
    if any(letter in ("M", "V") for _, letter in read):
        return
    kinds = [
        f"{count} of {look} {'left out' if letter is None else 'as ' + READ[letter]}"
        for (look, letter), count in read.most_common(KINDS)
    ]
    more = f", and {len(read) - KINDS} other kinds" if len(read) > KINDS else ""
    notes.append(f"{NO_FOLD}: {', '.join(kinds)}{more}.")


def listed_pattern(lines, *, allowed, size=None, scale=None, merge_tolerance=None, file=None) -> Pattern:
    """Return the pattern of a list of lines that fold by 180 degrees.

    Args:
        lines: pairs of assignment letter, or None for an auxiliary line, which is left out, and (x0, y0, x1, y1).
        allowed: what else the file could hold, if it holds no crease. The rest as for `drawn_pattern`.

    Raises:
        InputError: no crease; what `drawn_pattern` refuses.
    """
    kept = [(letter, ends) for letter, ends in lines if letter is not None]
    if not kept:
        raise InputError("has no border, mountain or valley", file=file, allowed=allowed)
    auxiliary = len(lines) - len(kept)
    return drawn_pattern(
        np.array([ends for _, ends in kept]).reshape(-1, 2, 2),
        [(letter, 1.0) for letter, _ in kept],
        size=size,
        scale=scale,
        merge_tolerance=merge_tolerance,
        notes=[f"{auxiliary} auxiliary lines were left out."] if auxiliary else [],
        file=file,
    )


def drawn_pattern(
    segments, strokes, *, size=None, scale=None, stated=None, merge_tolerance=None, notes, own=None, file=None
) -> Pattern:
    """Return the flat pattern, y upwards, of the lines of a drawing.

    Args:
        segments: [S, 2, 2] start and end of each line, in units of the drawing, y downwards.
        strokes: S pairs (assignment letter, share of 180 degrees).
        size: longest side of the pattern [m]. scale: length of one unit [m], instead of `size`. stated: the same by
            the file, or None.
        merge_tolerance: points closer than this share of the diagonal are one; None reads it off the drawing.
        notes: list that takes what was defaulted, joined or left out.
        own: turns points [N, 2] in units of the drawing, y downwards, into the coordinates of the file, in which
            places are named; None where they are the same. file: named in errors.

    Raises:
        InputError: no usable size, too many lines, or lines that enclose no face.
    """
    if merge_tolerance is not None:
        allowed = "a share of the drawing, 1e-9 to 0.05"
        check_number("merge_tolerance", merge_tolerance, low=1e-9, high=0.05, allowed=allowed)
    with np.errstate(over="ignore", invalid="ignore"):
        extent = float(np.ptp(segments.reshape(-1, 2), axis=0).max())
    if not np.isfinite(extent) or not extent > 0.0:
        raise InputError("the drawing has no usable size", file=file, value=extent, allowed="a finite size above 0")
    metres = metres_of(extent, size=size, scale=scale, stated=stated, notes=notes, file=file)
    starts, ends = (segments[:, n] * [metres, -metres] for n in (0, 1))
    everything = np.vstack([starts, ends])
    across = float(np.ptp(everything, axis=0).max())
    if not np.abs(everything).max() < COORDINATE_LIMIT or not across > 1e-9:
        allowed = f"1e-9 m or more across, within {COORDINATE_LIMIT:g} m of the origin"
        raise InputError("the drawing has no usable size", file=file, value=across, allowed=allowed)
    if len(starts) > MAX_SEGMENTS:
        raise InputError("too many line segments", file=file, value=len(starts), allowed=f"up to {MAX_SEGMENTS}")
    if merge_tolerance is None:
        tolerance = merge_distance(starts, ends)
    else:
        tolerance = merge_tolerance * float(np.linalg.norm(np.ptp(everything, axis=0)))
    long_enough = np.linalg.norm(ends - starts, axis=1) > tolerance
    strokes = [stroke for stroke, keep in zip(strokes, long_enough, strict=True) if keep]
    if not strokes:
        raise InputError("all lines are shorter than the merge tolerance", file=file, value=tolerance)

    def places(at) -> str:
        drawn = np.asarray(at).reshape(-1, 2) * [1.0, -1.0] / metres
        return _named(drawn if own is None else own(drawn), extent)

    if not long_enough.all():
        short = 0.5 * (starts + ends)[~long_enough]
        lines = "1 line" if len(short) == 1 else f"{len(short)} lines"
        notes.append(f"{lines} shorter than {tolerance / metres:.2g} left out, {places(short)}.")
    starts, ends = starts[long_enough], ends[long_enough]
    points, pieces = split_segments(starts, ends, tolerance, file=file)
    _note_joined(moved_points(starts, ends, points, pieces), points, metres, everything, places, notes)
    points, chosen = _slit(points, _edges(points, pieces, strokes, places, notes))
    facets, holed = facets_of_holes(points, np.array(list(chosen)))
    if holed:
        chosen |= {key: ("F", 1.0) for key in facets}
        notes.append(cut_noted(holed))
    found = planar_faces(points, np.array(list(chosen)), file=file)
    faces, holes = drop_holes(found, {key for key, (letter, _) in chosen.items() if letter == "B"})
    if not faces:
        raise InputError("the lines enclose no face", file=file, allowed="a closed black border")
    if holes:
        notes.append(holes_noted(holes, "lines"))
    beside = Counter(edge_key(*side) for face in faces for side in face_sides(face))
    edges = [key for key in chosen if beside[key]]
    if len(edges) < len(chosen):
        loose = [key for key in chosen if not beside[key]]
        middles = [points[list(key)].mean(axis=0) for key in loose]
        notes.append(_loose([chosen[key][0] for key in loose], chosen.values(), places(middles)))
    outer = [key for key in edges if beside[key] == 1 and chosen[key][0] not in "BC"]
    if outer:
        notes.append(f"{len(outer)} coloured edges on the outside of the sheet were taken as border.")
        chosen |= dict.fromkeys(outer, ("B", 1.0))
    used = sorted({v for face in faces for v in face})
    renumbered = {v: n for n, v in enumerate(used)}
    signs = {"M": -math.pi, "V": math.pi, "F": 0.0}
    pattern = assemble(
        np.column_stack([points[used], np.zeros(len(used))]),
        [tuple(renumbered[v] for v in face) for face in faces],
        edges=[(renumbered[a], renumbered[b]) for a, b in edges],
        assignments=[chosen[key][0] for key in edges],
        fold_angles=[signs.get(chosen[key][0], math.nan) * chosen[key][1] for key in edges],
        notes=notes,
        file=file,
    )
    pattern.accuracy = tolerance
    return pattern


def _slit(points, chosen):
    """Return points and edges in which each cut of one edge, with both ends inside the sheet, has a middle.

    Only so can its two sides part.
    """
    cuts = [key for key, (letter, _) in chosen.items() if letter == "C"]
    ends = Counter(v for key in cuts for v in key)
    ends.update(v for key, (letter, _) in chosen.items() if letter == "B" for v in key)
    halves: dict[tuple[int, int], int] = {}
    for key in cuts:
        if ends[key[0]] == ends[key[1]] == 1:
            halves[key] = len(points) + len(halves)
    if not halves:
        return points, chosen
    parted = {}
    for key, stroke in chosen.items():
        middle = halves.get(key)
        for part in [key] if middle is None else [(key[0], middle), (key[1], middle)]:
            parted[part] = stroke
    return np.vstack([points, *(points[list(key)].mean(axis=0) for key in halves)]), parted


def _named(points, extent: float) -> str:
    """Return the first of some places in words, in the coordinates of the file."""
    digits = max(0, 4 - math.ceil(math.log10(extent)))  # a thousandth of the drawing and better
    rounded = np.round(points[:NAMED], digits) + 0.0  # no zero with a sign
    shown = ", ".join(f"({x:.{digits}f}, {y:.{digits}f})" for x, y in rounded.tolist())
    return f"at {shown}" + (f" and {len(points) - NAMED} more" if len(points) > NAMED else "")


def _note_joined(moved, points, metres: float, everything, places, notes) -> None:
    """Say where lines that miss each other were joined."""
    diagonal = float(np.linalg.norm(np.ptp(everything, axis=0)))
    joined = np.flatnonzero(moved > SAME * diagonal)
    if len(joined):
        joined = joined[np.argsort(-moved[joined], kind="stable")]
        where = "a point" if len(joined) == 1 else f"{len(joined)} points"
        by = "" if len(joined) == 1 else "up to "
        notes.append(
            f"lines that miss each other were joined in {where}, by {by}{moved[joined[0]] / metres:.2g} of the "
            f"drawing's units, {places(points[joined])} (merge=)."
        )


def _loose(letters, chosen, where: str) -> str:
    """Return the sentence about line pieces of these letters, which enclose nothing."""
    folds = sum(letter in "MV" for letter in letters)
    pieces = (
        "1 line piece that encloses nothing was"
        if len(letters) == 1
        else (f"{len(letters)} line pieces that enclose nothing were")
    )
    said = f"{pieces} left out, {where}"
    if folds:
        said += "; mountains or valleys are " + ("all" if folds == len(letters) else f"{folds} of them")
    if folds and not any(letter == "B" for letter, _ in chosen):
        said += ": no border is drawn, within which they would fold"
    return f"{said}."


def _edges(points, pieces, strokes, places, notes) -> dict[tuple[int, int], tuple[str, float]]:
    """Return (letter, opacity) by edge key, one for each, the higher `PRIORITY` where lines coincide."""
    drawn = [strokes[s] for *_, s in pieces]
    stays, conflicts = foremost([piece[:2] for piece in pieces], drawn, lambda n: PRIORITY.index(drawn[n][0]))
    if conflicts:
        edges = "1 edge is" if len(conflicts) == 1 else f"{len(conflicts)} edges are"
        where = places([points[list(key)].mean(axis=0) for key in conflicts])
        notes.append(f"{edges} drawn twice in different colours or opacities, {where}; {FIRST}.")
    return {key: drawn[n] for key, n in stays.items()}


def foremost(pairs, marks, rank) -> tuple[dict[tuple[int, int], int], list[tuple[int, int]]]:
    """Return which of the edges that join the same two vertices stays, and for which others are marked otherwise.

    Args:
        pairs: vertices of each edge. marks: what each is marked with. rank: the number of an edge to its rank.

    Returns:
        The number of the edge of least rank, of equal ones the first, by edge key; and such keys.
    """
    stays: dict[tuple[int, int], int] = {}
    for n, pair in enumerate(pairs):
        key = edge_key(*pair)
        if (other := stays.setdefault(key, n)) != n:
            stays[key] = min(other, n, key=rank)
    differ = [key for n, pair in enumerate(pairs) if marks[n] != marks[stays[key := edge_key(*pair)]]]
    return stays, list(dict.fromkeys(differ))
