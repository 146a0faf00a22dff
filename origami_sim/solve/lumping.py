"""Moments of inertia of elastic panels whose mass sits at their corners: by how much they are too large."""

from collections import Counter

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from origami_sim.model import Model, Parameters
from origami_sim.model.bodies import body_of, second_moments

LUMPED = 0.1
"""Part by which moments of inertia may be too large, summed over creases, before a note says so.

Masses at its corners make that of a rectangle 0.5 too large, those of chains of two, three and four panels 0.17, 0.08
and 0.05. Half notes chains of three, double lets those of two pass, which swing 6 and 22 % too slowly.
"""


def lumped_masses(model: Model, parameters: Parameters) -> list[str]:
    """The crease about which what hangs on it has far too large a moment of inertia.

    Panels that are joined by lines which are no creases are one body. Of panels that close loops nothing is said.
    """
    if model.panels == "rigid" or ("body", "mass") not in parameters or not len(model.creases):
        return []
    sides = _sides(model)
    lines = np.sort(np.concatenate([model.creases, model.bends])[:, 1:3], axis=1).tolist()
    if any(len(sides.get((j, k), ())) != 2 for j, k in lines):  # a hinge between bars alone
        return []
    count, of = connected_components(_graph(_between(sides, model.bends), model.panel_count), directed=False)
    joints = {tuple(pair): c for c, pair in enumerate(of[_between(sides, model.creases)].tolist())}
    joints |= {(b, a): c for (a, b), c in joints.items()}
    graph = _graph(np.array(list(joints)), count)
    islands, island = connected_components(graph, directed=False)
    if any(a == b for a, b in joints) or len(joints) != 2 * (count - islands):
        return []
    at_corners = _at_corners(model, parameters, sides)
    bodies, corners = _moments(model, parameters, at_corners)
    true, lumped = (np.array([m[of == n].sum(axis=0) for n in range(count)]) for m in (bodies, corners))
    held, moving = (np.any(on[model.triangles], axis=(1, 2)) for on in (model.free == 0, model.free != 0))
    holds, moves = (np.bincount(of[model.triangle_panel[on]], minlength=count) for on in (held, moving))
    found: list[tuple[float, float, int]] = []
    for n in range(islands):
        mine = np.flatnonzero(island == n)
        order, parent = breadth_first_order(graph, mine[np.argmax(holds[mine])], directed=False)
        for body in order[:0:-1].tolist():
            crease = joints[int(parent[body]), body]
            if moves[body]:
                found.append((_about(model, crease, true[body]), _about(model, crease, lumped[body]), crease))
            for beyond in (true, lumped, moves):
                beyond[parent[body]] += beyond[body]
    if sum(made for _, made, _ in found) <= (1.0 + LUMPED) * sum(own for own, *_ in found):
        return []
    own, made, crease = max(found, key=lambda one: one[1] - one[0])
    pieces = np.bincount(model.triangle_panel[moving & at_corners[model.triangle_panel]])
    better = "panels='rigid' has it" if pieces.max() == 1 else "triangulation='center' and panels='rigid' have it"
    return [
        f"The mass of panels sits at their corners, so that the moment of inertia about {model.name('crease', crease)} "
        f"is {made / own - 1.0:.0%} too large, and what hangs on it swings {np.sqrt(made / own) - 1.0:.0%} slower: "
        f"{better} right."
    ]


def _sides(model: Model) -> dict[tuple[int, int], list[int]]:
    """Panels of the triangles on both sides of each line between two nodes."""
    out: dict[tuple[int, int], list[int]] = {}
    for nodes, panel in zip(model.triangles.tolist(), model.triangle_panel.tolist(), strict=True):
        for j, k in zip(nodes, [*nodes[1:], nodes[0]], strict=True):
            out.setdefault((min(j, k), max(j, k)), []).append(panel)
    return out


def _between(sides: dict[tuple[int, int], list[int]], hinges: np.ndarray) -> np.ndarray:
    """[n, 2] panels that hinges join."""
    return np.array([sides[min(j, k), max(j, k)] for _, j, k, _ in hinges.tolist()], int).reshape(-1, 2)


def _graph(pairs: np.ndarray, count: int) -> coo_array:
    return coo_array((np.ones(len(pairs)), tuple(pairs.reshape(-1, 2).T)), shape=(count, count))


def _at_corners(model: Model, parameters: Parameters, sides: dict[tuple[int, int], list[int]]) -> np.ndarray:
    """[P] whether a panel's mass is at its corners, by a third of each triangle, and was not chosen to be right.

    It was if there is a node in its middle, or where nodes that touch no such panel have other masses.
    """
    panels, triangles = model.triangle_panel, model.triangles
    once = [(p, line) for line, beside in sides.items() for p, times in Counter(beside).items() if times == 1]
    border = {(p, n) for p, line in once for n in line}
    each = zip(panels.tolist(), triangles.tolist(), strict=True)
    middle = {p for p, nodes in each if any((p, n) not in border for n in nodes)}
    chosen = np.isin(np.arange(model.panel_count), list(middle))
    share = np.repeat(_thirds(model, parameters), 3)
    mass = np.bincount(triangles.ravel(), share, minlength=len(model.position))
    other = ~np.isclose(mass, parameters["inertia", "mass"][:, 0], rtol=1e-6)
    other[triangles[chosen[panels]]] = False
    chosen[panels[np.any(other[triangles], axis=1)]] = True
    return ~chosen


def _thirds(model: Model, parameters: Parameters) -> np.ndarray:
    """[T] a third of each triangle's part of its panel's mass [kg]."""
    a, b, c = (model.position[model.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    panels = model.triangle_panel
    return parameters["body", "mass"][panels, 0] * area / np.bincount(panels, area)[panels] / 3.0


def _moments(model: Model, parameters: Parameters, at_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """[P, 4, 4] sums of m (x, 1) (x, 1)^T of panels: of their bodies, and of masses at corners where they are there."""
    true = np.zeros((model.panel_count, 4, 4))
    for panel, mass in enumerate(parameters["body", "mass"][:, 0].tolist()):
        centre, tensor = body_of(parameters, panel)
        at = np.append(centre, 1.0)
        true[panel] = mass * np.outer(at, at)
        true[panel, :3, :3] += second_moments(tensor)
    x = np.append(model.position, np.ones((len(model.position), 1)), axis=1)[model.triangles]
    made = np.zeros_like(true)
    np.add.at(made, model.triangle_panel, np.einsum("t,tka,tkb->tab", _thirds(model, parameters), x, x))
    return true, np.where(at_corners[:, None, None], made, true)


def _about(model: Model, crease: int, moments: np.ndarray) -> float:
    """Moment of inertia about a crease [kg m^2]."""
    _, j, k, _ = model.creases[crease]
    along = model.position[k] - model.position[j]
    along = along / np.linalg.norm(along)
    shift = np.append(np.eye(3), -model.position[j][:, None], axis=1)
    second = shift @ moments @ shift.T
    return float(np.trace(second) - along @ second @ along)
