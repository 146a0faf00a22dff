"""The surface of a model: its triangles, nested in boxes as they lie in the reference state, and which parts touch."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import warp as wp
from scipy.sparse.csgraph import connected_components

from origami_sim.model import Model, Parameters, carried_sides
from origami_sim.solve.kernels import touching
from origami_sim.solve.program.compose_touch import DEEPEST

MARGIN = 0.25
"""Distance within which pairs are listed beyond that at which they touch, over the median edge.

The list is made anew when a point has moved by half of it. Half makes twice as many lists, double has half as many with
more pairs in each; the result is the same.
"""

ROOM = 32
"""Pairs per triangle for which a list has room. What finds no room is listed within a smaller margin."""

LEAST_ROOM = 256
"""Pairs for which it has room in any case: more than a few triangles can make."""


PRESSED = "pressed"
"""The word by which it is told of a world that it stopped because its panels lie too deep in each other."""


@dataclass(frozen=True)
class Surface:
    """What the kernels need of a model's surface, see `touching.Skin`."""

    corners: np.ndarray
    owned: np.ndarray
    body: np.ndarray
    home: np.ndarray
    tree: np.ndarray
    beyond: np.ndarray
    leaf: np.ndarray
    rest: np.ndarray
    panel: np.ndarray
    own: np.ndarray
    carrier: np.ndarray
    weights: np.ndarray
    lift: np.ndarray
    margin: float


def surface(model: Model) -> Surface:
    """The surface of a model."""
    whole = (model.triangles, model.triangle_panel, model.pad_triangles, _links(model))
    real = (model.position, model.pad_weights, model.pad_heights, model.pad_thickness)
    given = [np.asarray(a, np.int32).tobytes() for a in whole], [np.asarray(a, float).tobytes() for a in real]
    return _surface(*map(tuple, given))


@functools.lru_cache(maxsize=16)
def _surface(whole: tuple[bytes, ...], real: tuple[bytes, ...]) -> Surface:
    triangles, panels, carried, links = (np.frombuffer(a, np.int32) for a in whole)
    nodes, weights, lift, thickness = (np.frombuffer(a, float) for a in real)
    nodes, weights, triangles = nodes.reshape(-1, 3), weights.reshape(-1, 3), triangles.reshape(-1, 3)
    carrier = triangles[carried].reshape(-1, 3)
    a, b, c = (nodes[carrier[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    points = np.einsum("pk,pka->pa", weights, nodes[carrier]) + lift[:, None] * normal
    rest = np.concatenate([nodes, points])
    first = len(nodes) + 4 * np.arange(len(thickness))[:, None, None]
    pads = (first + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    corners = np.concatenate([triangles, pads]).astype(np.int32)
    home = np.concatenate([np.arange(len(triangles)), np.repeat(carried[::4], 2)]).astype(np.int32)
    tree, beyond, leaf = _boxes(rest[corners].mean(axis=1)) if len(corners) else (np.zeros(0, np.int32),) * 3
    edges = nodes[triangles] - nodes[np.roll(triangles, -1, axis=1)]
    median = float(np.median(np.linalg.norm(edges, axis=-1))) if len(triangles) else 1.0
    return Surface(
        corners=corners,
        owned=_owned(corners),
        body=_bodies(triangles, len(nodes), links.reshape(-1, 2))[home],
        home=home,
        tree=tree,
        beyond=beyond,
        leaf=leaf,
        rest=rest,
        panel=panels[home].astype(np.int32),
        own=np.concatenate([np.full(len(triangles), -1.0), np.repeat(thickness, 2)]),
        carrier=carrier,
        weights=weights,
        lift=lift,
        margin=MARGIN * median,
    )


def upload(model: Model, room: Callable[..., wp.array], device, pairs: int | None = None) -> Any:
    """The surface of a model on a device, with the lists of its worlds.

    Args:
        room: makes an array [*shape, W], see `Batch`. pairs: for which a list has room.
    """
    found = surface(model)

    def constant(a, dtype):
        return wp.array(np.ascontiguousarray(a), dtype=dtype, device=device)

    s = touching.Skin()
    s.nodes, s.solid, s.margin = len(model.position), len(model.position) - len(model.carriers), found.margin
    s.corners = constant(found.corners, wp.vec3i)
    for name in ("owned", "body", "home", "panel", "tree", "beyond", "leaf"):
        setattr(s, name, constant(getattr(found, name), wp.int32))
    s.rest = constant(found.rest, wp.vec3d)
    s.carrier, s.weights = constant(found.carrier, wp.vec3i), constant(found.weights, wp.vec3d)
    s.lift, s.own = constant(found.lift, wp.float64), constant(found.own, wp.float64)
    boxes, points = max(len(found.tree), 1), max(len(found.rest), 1)
    pairs = pairs or LEAST_ROOM + ROOM * len(found.corners)
    s.low, s.high = room(boxes, dtype=wp.vec3d), room(boxes, dtype=wp.vec3d)
    s.built = room(points, dtype=wp.vec3d)
    s.points, s.kind = room(pairs, dtype=wp.vec4i), room(pairs, dtype=wp.vec3i)
    s.label, s.offset, s.wake = (room(pairs, dtype=wp.float64) for _ in range(3))
    s.fade = room(pairs, dtype=wp.vec2d)
    s.count, s.span = room(2, dtype=wp.int32), room(2, dtype=wp.float64)
    return s


@dataclass(frozen=True)
class Pairs:
    """Pairs of the surface that are near each other.

    Attributes:
        nodes: [P, 12] of a corner and a triangle, or of two edges; each thrice, or those of the triangle that carries
            a patch's corner. edges: [P] whether edges.
        sides: [P, 2] triangles. offset: [P] distance at which they touch [m]. distance: [P] [m].
        inside: [P] whether a corner lies over the inside of the triangle, or an edge crosses that of the other.
        points: [P, 4] nodes, and after them the corners of patches. share: [P, 4]: the distance's gradient by a point
            is share * normal. normal: [P, 3] towards the first part. window: [P] weight of the pair.
    """

    nodes: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    offset: np.ndarray
    distance: np.ndarray
    inside: np.ndarray
    points: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    window: np.ndarray
    skin: Any

    def clear(self, x: np.ndarray, finest: float = 0.0) -> float:
        """Largest share of the straight way to positions x [N, 3] on which none of the pairs comes too near.

        Pairs that touch at less than `finest` [m] do not count.
        What touches at its end is pressed by no more than a tenth of its thickness, or a fifth more than before.
        """
        if not len(self.offset):
            return 1.0
        share = wp.ones(1, dtype=wp.float64, device="cpu")
        inputs = [self.skin, _one(x[:, None], wp.vec3d), wp.float64(finest), share]
        wp.launch(touching.clear, dim=len(self.offset), inputs=inputs, device="cpu")
        return float(share.numpy()[0])


def near_pairs(
    model: Model, parameters: Parameters, x: np.ndarray, *, world: int = 0, margin: float = 0.0, owner: str = "touch"
) -> Pairs:
    """Pairs of one world at positions x [N, 3] [m] that touch, or are no farther apart than a margin [m] above.

    Their thickness is that of the effect, or of the "surface", by which they would touch if nothing else is stated.
    """
    thick = parameters[owner, "thickness"]
    thick = thick[:, world if thick.shape[1] > 1 else 0]
    room = LEAST_ROOM + ROOM * len(model.triangles)
    while True:
        s = upload(model, _room, "cpu", room)
        s.margin = margin
        distance, window = (_room(room, dtype=wp.float64) for _ in range(2))
        inside, share, normal = (_room(room, dtype=t) for t in (wp.int32, wp.vec4d, wp.vec3d))
        given = _one(x[:, None], wp.vec3d), _one(thick, wp.float64)
        wp.launch(touching.survey, dim=1, inputs=[s, *given, distance, inside, share, normal, window], device="cpu")
        count, whole = s.count.numpy()[:, 0]
        if whole == 1 and s.span.numpy()[1, 0] == 0.5 * margin:
            break
        room *= 4

    def rows(a: wp.array) -> np.ndarray:
        return a.numpy()[:count, 0].copy()

    kind, points = rows(s.kind), rows(s.points)
    own = np.repeat(np.arange(len(model.position))[:, None], 3, axis=1)
    nodes = np.concatenate([own, surface(model).carrier])[points].reshape(-1, 12)
    return Pairs(
        nodes, kind[:, 0] == 1, kind[:, 1:], rows(s.offset), rows(distance), rows(inside) > 0,
        points, rows(share), rows(normal), rows(window), s,
    )  # fmt: skip


def _room(*shape: int, dtype) -> wp.array:
    return wp.zeros((*shape, 1), dtype=dtype, device="cpu")


def _one(a: np.ndarray, dtype) -> wp.array:
    return wp.array(np.ascontiguousarray(a), dtype=dtype, device="cpu")


def clear_share(model: Model, parameters: Parameters, x: np.ndarray, d: np.ndarray, *, world: int = 0) -> float:
    """Largest share of a move d [N, 3] from positions x [N, 3] on which nothing passes through anything else."""
    far = float(np.linalg.norm(d, axis=-1).max(initial=0.0))
    if not (far > 0 and np.isfinite(far)) or "touch" not in model.laws:
        return 1.0
    margin = (4 if len(model.pad_triangles) else 2) * far
    return near_pairs(model, parameters, x, world=world, margin=margin).clear(x + d)


def too_deep(model: Model, parameters: Parameters, x: np.ndarray, world: int) -> str:
    """Why panels that touch stop a world at positions x [N, 3], in a sentence; empty if they do not."""
    found = near_pairs(model, parameters, x, world=world)
    deep = found.offset - found.distance
    if not len(deep):
        return ""
    worst = int((deep / found.offset).argmax())
    one, other = (model.name("panel", p) for p in sorted(model.triangle_panel[found.sides[worst]].tolist()))
    if deep[worst] > DEEPEST * found.offset[worst]:
        return (
            f"{one} and {other} are {PRESSED} {deep[worst] * 1e3:.3g} mm into each other, of "
            f"{found.offset[worst] * 1e3:.3g} mm between their middle planes; touch stiffer (Sheet.touch) or load less"
        )
    room = LEAST_ROOM + ROOM * len(model.triangles)
    if len(deep) > min(room, 32 + 4 * len(model.triangles)):
        return f"{len(deep)} pairs touch, of which {one} and {other}: more than there is room for; take a coarser mesh"
    return ""


def _owned(corners: np.ndarray) -> np.ndarray:
    """Bits of the corners and edges that each triangle stands for: those that no triangle before it has."""
    out = np.zeros(len(corners), np.int32)
    seen: set[tuple[int, ...]] = set()
    for t, nodes in enumerate(corners.tolist()):
        for k in range(3):
            for bit, key in ((1 << k, (nodes[k],)), (8 << k, tuple(sorted((nodes[k], nodes[(k + 1) % 3]))))):
                if key not in seen:
                    seen.add(key)
                    out[t] |= bit
    return out


def _links(model: Model) -> np.ndarray:
    """[C, 2] a corner of each panel beside a crease that has nodes of its own; else none."""
    beside = carried_sides(model)
    if not len(beside):
        return beside
    panels, first = np.unique(model.triangle_panel, return_index=True)
    return model.triangles[first[np.searchsorted(panels, beside)], 0].astype(np.int32)


def _bodies(corners: np.ndarray, nodes: int, links: np.ndarray) -> np.ndarray:
    """Number of the body that each triangle belongs to: those that share a node, or a link [L, 2] of nodes, are one."""
    if not len(corners):
        return np.zeros(0, np.int32)
    one = np.concatenate([np.repeat(corners[:, 0], 2), links[:, 0]])
    other = np.concatenate([corners[:, 1:].ravel(), links[:, 1]])
    joined = sp.coo_array((np.ones(len(one)), (one, other)), shape=(nodes, nodes))
    return connected_components(joined, directed=False)[1][corners[:, 0]].astype(np.int32)


def _boxes(middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes in depth-first order (triangle or -1; the next box outside), and the box of each triangle.

    Each box is halved along its longest side, by number of triangles.
    """
    tree, beyond = [], []
    leaf = np.zeros(len(middle), np.int32)

    def split(mine: np.ndarray):
        i = len(tree)
        tree.append(-1)
        beyond.append(0)
        if len(mine) == 1:
            tree[i] = int(mine[0])
            leaf[mine[0]] = i
        else:
            along = int(np.ptp(middle[mine], axis=0).argmax())
            order = mine[np.argsort(middle[mine, along], kind="stable")]
            half = len(order) // 2
            split(order[:half])
            split(order[half:])
        beyond[i] = len(tree)

    split(np.arange(len(middle)))
    return np.array(tree, np.int32), np.array(beyond, np.int32), leaf
