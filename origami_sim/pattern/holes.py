"""Panels with holes: cut into facets, so that every face of a pattern is a simple polygon."""

from .planar import closed_loops, inside_polygon, signed_area
from .topology import edge_key, face_sides


def facets_of_holes(points, edges) -> tuple[list[tuple[int, int]], int]:
    """Return edges that cut regions with holes into triangles, without new vertices, and the number of such regions.

    A region has a hole where another part of the graph lies loose inside it, or hangs in it by one vertex. Its
    triangles are those of a constrained Delaunay triangulation.

    Args:
        points: [V, 2] positions.
        edges: [E, 2] vertex pairs that meet at common vertices only.
    """
    kept, loops = closed_loops(points, edges)
    shells: list[list[int]] = []
    holes: list[list[list[int]]] = []
    loose: list[list[int]] = []
    for loop in loops:
        whole = signed_area(points[list(loop)]) > 0
        simple = _simple_loops(loop)
        outer = [s for s in simple if signed_area(points[s]) > 0]
        if whole and len(outer) == 1:
            shells.append(outer[0])
            holes.append([s for s in simple if s is not outer[0] and len(s) > 2])
        elif not whole:
            loose.append(list(loop))
    # what lies loose in a region is the hole of the smallest region around it, unless that is a part of its own
    areas = [signed_area(points[s]) for s in shells]
    for loop in loose:
        own = set(loop)
        around = [n for n, s in enumerate(shells) if not own & set(s) and inside_polygon(points[loop[0]], points[s])]
        if around:
            holes[min(around, key=lambda n: areas[n])].append(loop)
    facets, count = [], 0
    for shell, inner in zip(shells, holes, strict=True):
        if inner:
            facets += [key for key in _triangulated(points, shell, inner) if key not in kept]
            count += 1
    return list(dict.fromkeys(facets)), count


def _simple_loops(loop) -> list[list[int]]:
    """Return a loop cut into loops that pass every vertex once."""
    out, path = [], []
    for v in loop:
        if v in path:
            first = path.index(v)
            out.append(path[first:])
            path = path[:first]
        path.append(v)
    return [*out, path]


def _triangulated(points, shell, inner) -> list[tuple[int, int]]:
    """Return the edges of a triangulation of a polygon with holes, all given by their vertices."""
    from shapely import Polygon, constrained_delaunay_triangles, get_coordinates  # only here: slow to import

    number = {tuple(points[v]): v for ring in (shell, *inner) for v in ring}
    polygon = Polygon(points[shell], [points[ring] for ring in inner])
    if not polygon.is_valid:
        return []
    edges = []
    for triangle in constrained_delaunay_triangles(polygon).geoms:
        corners = [number.get(tuple(map(float, p))) for p in get_coordinates(triangle)[:3]]
        if None in corners:
            return []
        edges += [edge_key(a, b) for a, b in face_sides(corners)]
    return edges


def holes_noted(count: int, drawn: str) -> str:
    """The sentence on regions that are holes, of a pattern of "lines" or "edges"."""
    if count == 1:
        return f"1 region enclosed by border {drawn} alone was taken as a hole."
    return f"{count} regions enclosed by border {drawn} alone were taken as holes."


def cut_noted(count: int) -> str:
    """The sentence on panels that `facets_of_holes` cut."""
    panels = (
        "1 panel with a hole or a loose part in it was"
        if count == 1
        else (f"{count} panels with a hole or a loose part in them were")
    )
    return f"{panels} cut into facets."
