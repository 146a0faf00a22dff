"""What is left of panels beside the bends that creases of a thick sheet are.

A crease of a sheet of thickness t that turns by an angle theta is at the sharpest a bend whose inner side has no
radius. Its middle surface turns with the radius t / 2 and takes theta t / 2 of the sheet, half of it from either panel.
A panel that lies within theta t / 4 of its creases all over is bend only: such a sheet is too thick for it, and hinges
at the middle surface, as panels here have, would put it into its neighbours.
"""

import numpy as np

from origami_sim.pattern.polygon import project
from origami_sim.pattern.topology import area_vector, edge_key, face_sides

from .elastic import Elastic

MOST = 0.1
"""Share of a sheet's area in panels that are bend only from which on it counts as too thick to fold: slivers of a
drawing are crushed into the crease beside them. Of 43 public patterns 20 cm wide none has such a panel at 0.2 mm, and
seven have at 1 mm, with up to 6 %; half would refuse one of these, double none."""


def bend_only(sheet: Elastic, thickness: float) -> tuple[list[int], float]:
    """Return the panels that are too narrow for the thickness at the target angles, and their share of the area.

    Args:
        sheet: what is folded. thickness: of panels for which the pattern gives none [m].

    Returns:
        Numbers of faces of the pattern, and a share in [0, 1].
    """
    pattern, mesh = sheet.pattern, sheet.mesh
    turn = np.abs(sheet.target[: len(mesh.creases)]) * sheet.driven[: len(mesh.creases)]
    turns: dict[tuple[int, int], float] = {}
    for e, angle in zip(mesh.crease_edge.tolist(), turn.tolist(), strict=True):
        key = edge_key(*pattern.edges[e].tolist())
        turns[key] = max(angle, turns.get(key, 0.0))
    thick = np.where(np.isnan(pattern.thickness), thickness, pattern.thickness)
    areas = np.array([np.linalg.norm(area_vector(pattern.vertices, face)) for face in pattern.faces])
    found = []
    for f, face in enumerate(pattern.faces):
        reach = np.array([turns.get(edge_key(*side), 0.0) for side in face_sides(face)]) * thick[f] / 4.0
        corners = pattern.vertices[list(face)]
        around = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        # strips along the sides cover it only if they are as large, corners between them at most twice
        if 2.0 * (reach @ around) >= areas[f] and _covered(corners, reach):
            found.append(f)
    return found, float(areas[found].sum() / areas.sum())


def _covered(corners, reach) -> bool:
    """Tell whether every point of a polygon [K, 3] is as near to one of its sides as that one reaches [K]."""
    from shapely import LineString, Polygon, union_all  # only here: slow to import

    points = project(corners)[0]
    panel = Polygon(points)
    sides = [LineString([a, b]).buffer(r) for a, b, r in zip(points, np.roll(points, -1, axis=0), reach, strict=True)]
    return bool(panel.is_valid and panel.difference(union_all(sides)).area <= 1e-6 * panel.area)
