"""Read a pattern that is to be folded: near-coincident points merged where panels could not close otherwise.

A vertex that a drawing program, or a hand, has split into two close ones leaves creases that end at odd vertices, which
no fold angles close. The right distance of merging shows in the pattern itself: it is the one at which the targets
close best.
"""

from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.pattern import DRAWN, Pattern, read_pattern, triangulate
from origami_sim.pattern.intersections import overlapping_pairs
from origami_sim.quantities import converted

from .consistency import vertices
from .elastic import Elastic

DISTANCES = (2.5e-4, 5e-4, 1e-3, 1.4e-3, 2e-3, 2.8e-3, 4e-3, 5.6e-3)
"""Distances tried, as shares of the drawing's diagonal: 0.1 to 2 mm on a sheet of 20 cm. Half and double of
all fold the same of 20 public patterns."""
OPEN = np.radians(30.0)
"""Gap at a vertex from which on it may be one half of a split one: those leave 180 degrees, drawings that are only
inexact some 5 to 25. Half and double fold the same of 20 public patterns."""
CLOSE = 1e-2
"""Length of an edge, over the sheet's longest side, that may join the halves of a split vertex. Half
and double fold the same of 20 public patterns."""
BETTER = 0.5
"""Share of the sum of all gaps below which another distance is taken: mending leaves a tenth to a half of them, while
merging true detail of a curved pattern leaves nine tenths. Half gives the crane, which cannot fold flat as drawn,
another compromise; double, which takes what closes worse, folds the same of 20."""
KEPT = 0.5
"""Share of the panels that mending has to leave. Half changes nothing in 20 public patterns; double forbids mending,
and the crane ends otherwise."""


def read(
    path: str | Path,
    *,
    size: float | str | None = None,
    scale: float | str | None = None,
    merge: float | str | None = None,
) -> Pattern:
    """Read a pattern from a file and mend what keeps its panels from closing; see `pattern.read_pattern`.

    Args:
        path: FOLD file or drawing.
        size: longest side [m], or text as "15 cm". scale: length of one unit [m], likewise, instead of it.
        merge: of drawings: points closer than this share of the diagonal are one, or text as "0.2 %"; None finds it.

    Returns:
        The pattern, with a note if points were merged.

    Raises:
        InputError: as `read_pattern`; a number of another unit; `merge` for a file that is no drawing; panels of a flat
            pattern that overlap.
    """
    if not isinstance(path, str | Path):
        raise InputError("is no file", field="path", value=type(path).__name__, allowed="the path of a pattern")
    merge = None if merge is None else converted(merge, "1", "merge")
    drawing = DRAWN.get(Path(path).suffix.lower())
    if merge is not None:
        if drawing is None:
            allowed = ", ".join(DRAWN)
            raise InputError(
                "only drawings have points to merge", file=path, field="merge", value=merge, allowed=allowed
            )
        return drawing(path, size=size, scale=scale, merge_tolerance=merge)
    pattern = read_pattern(path, size=size, scale=scale)
    if drawing is None:
        _refuse_overlap(pattern, path)
        return pattern
    gap, split = _gaps(pattern)
    if not split:
        return pattern
    best, least, chosen = pattern, BETTER * gap, None
    for distance in DISTANCES:
        try:
            other = drawing(path, size=size, scale=scale, merge_tolerance=distance)
            gap, _ = _gaps(other)
        except InputError:  # points merged that should not be: no pattern any more
            continue
        if gap < least and len(other.faces) > KEPT * len(pattern.faces):
            best, least, chosen = other, gap, distance
    if chosen is not None:
        across = chosen * float(np.linalg.norm(np.ptp(best.vertices, axis=0)))
        best.notes.append(
            f"points within {across * 1e3:.2g} mm of each other or of a line were taken to meet, since the panels "
            f"close best so: {pattern.vertex_count} vertices before, {best.vertex_count} after (merge=)."
        )
    return best


def _refuse_overlap(pattern: Pattern, path):
    """A crease pattern in a plane lies beside itself; layers belong to a folded form."""
    if np.ptp(pattern.vertices[:, 2]) > 0 or "foldedForm" in (pattern.extra.get("frame_classes") or ()):
        return
    mesh = triangulate(pattern)
    found = overlapping_pairs(mesh.vertices, mesh.triangles)
    if len(found):
        one, other = sorted(mesh.triangle_face[found[0]].tolist())
        raise InputError(
            f"panel {one} and panel {other} overlap",
            file=path,
            field="vertices_coords",
            allowed="panels beside each other, or frame_classes with foldedForm",
        )


def _gaps(pattern: Pattern) -> tuple[float, bool]:
    """Return the sum of the gaps of all vertices [rad], and whether one of them looks split.

    Curved creases leave gaps that bent panels close; they are not counted.
    """
    sheet = Elastic(pattern)
    short = set(sheet.bars[sheet.lengths < CLOSE].ravel().tolist())
    found = [v for v in vertices(sheet) if v.creases and not v.curved]
    return float(sum(v.gap for v in found)), any(v.gap > OPEN and v.node in short for v in found)
