"""Strains and curvatures of a sheet's triangles in the kernels, and the forces that go with their stresses."""

import numpy as np
import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.model import Model, curvature, dihedral_angles

scalar = wp.float64


@wp.struct
class Plates:
    """Rows of `curvature.Curvature` with hinges counted from the first crease, and room for the hinges' moments.

    rest: curvature of the rows in the reference state [1/m]; moment: [H, W] [N m].
    turn: [H, W] change of the hinges' angles in this step, where a law asks for changes.
    arc_rest: [T] half the squared arcs of each triangle's edges in the reference state.
    """

    start: wp.array(dtype=wp.int32)
    hinge: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec3d)
    triangle: wp.array(dtype=wp.int32)
    whole: wp.array(dtype=wp.float64)
    share: wp.array(dtype=wp.float64)
    rest: wp.array(dtype=wp.vec3d)
    area: wp.array(dtype=wp.float64)
    shape: wp.array(dtype=wp.mat22d)
    dual: wp.array(dtype=wp.mat33d)
    side: wp.array(dtype=wp.vec3i)
    arc_start: wp.array(dtype=wp.int32)
    arc_hinge: wp.array(dtype=wp.int32)
    arc_weight: wp.array(dtype=wp.float64)
    arc_rest: wp.array(dtype=wp.vec3d)
    moment: wp.array2d(dtype=wp.float64)
    turn: wp.array2d(dtype=wp.float64)


@wp.func
def curved(p: Plates, angles: wp.array2d(dtype=wp.float64), row: int, w: int):
    """Curvature of a row that goes with angles, or its change that goes with turns."""
    k = wp.vec3d()
    for e in range(p.start[row], p.start[row + 1]):
        k += angles[p.hinge[e], w] * p.weight[e]
    return k


@wp.func
def bent(p: Plates, angles: wp.array2d(dtype=wp.float64), row: int, w: int):
    """Curvature of a row less that of the reference state: 11, 22 and twice 12 [1/m]."""
    return curved(p, angles, row, w) - p.rest[row]


@wp.func
def spread(p: Plates, row: int, w: int, moment: wp.vec3d):
    """Adds to the moments of the hinges what a row's moments [N m^2] do on them."""
    for e in range(p.start[row], p.start[row + 1]):
        h = p.hinge[e]
        p.moment[h, w] = p.moment[h, w] - wp.dot(p.weight[e], moment)


@wp.func
def arc(p: Plates, angles: wp.array2d(dtype=wp.float64), edge: int, w: int):
    """Length / sqrt(12) times the curvature along an edge."""
    q = scalar(0.0)
    for e in range(p.arc_start[edge], p.arc_start[edge + 1]):
        q += angles[p.arc_hinge[e], w] * p.arc_weight[e]
    return q


@wp.func
def arcs(p: Plates, angles: wp.array2d(dtype=wp.float64), c: int, w: int):
    """The same of the three edges of a triangle."""
    side = p.side[c]
    return wp.vec3d(arc(p, angles, side[0], w), arc(p, angles, side[1], w), arc(p, angles, side[2], w))


@wp.func
def bow(p: Plates, c: int, q: wp.vec3d):
    """Strain by which a triangle with curved edges is longer than its chords, less that of the reference state.

    An arc of length l and curvature k is longer than its chord by the share (k l)^2 / 24. Without it, flat triangles
    would have to stretch where the sheet only bends, all but those in line with the bend.
    """
    return p.dual[c] * (scalar(0.5) * wp.cw_mul(q, q) - p.arc_rest[c])


@wp.func
def unbow(p: Plates, c: int, w: int, q: wp.vec3d, n: wp.vec3d):
    """Adds to the moments of the hinges what membrane forces times the area [N m] do on the arcs of a triangle."""
    m = wp.cw_mul(q, wp.transpose(p.dual[c]) * n)
    side = p.side[c]
    for k in range(3):
        for e in range(p.arc_start[side[k]], p.arc_start[side[k] + 1]):
            h = p.arc_hinge[e]
            p.moment[h, w] = p.moment[h, w] - p.arc_weight[e] * m[k]


@wp.func
def strain(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d, shape: wp.mat22d):
    """Green's strain of a triangle: 11, 22 and twice 12."""
    f1 = shape[0, 0] * (x2 - x1) + shape[1, 0] * (x3 - x1)
    f2 = shape[0, 1] * (x2 - x1) + shape[1, 1] * (x3 - x1)
    one = scalar(1.0)
    half = scalar(0.5)
    return wp.vec3d(half * (wp.dot(f1, f1) - one), half * (wp.dot(f2, f2) - one), wp.dot(f1, f2))


@wp.func
def pull(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d, shape: wp.mat22d, n: wp.vec3d):
    """Forces on the corners, as rows, from membrane forces (second Piola-Kirchhoff) times the area [N m]."""
    f1 = shape[0, 0] * (x2 - x1) + shape[1, 0] * (x3 - x1)
    f2 = shape[0, 1] * (x2 - x1) + shape[1, 1] * (x3 - x1)
    p1 = n[0] * f1 + n[2] * f2
    p2 = n[2] * f1 + n[1] * f2
    r2 = -(shape[0, 0] * p1 + shape[0, 1] * p2)
    r3 = -(shape[1, 0] * p1 + shape[1, 1] * p2)
    return wp.matrix_from_rows(-r2 - r3, r2, r3)


def upload(model: Model, device, moments: wp.array, turns: wp.array | None = None) -> Plates:
    """The rows of a model on a device, with room for the moments and, if a law asks, the turns of its hinges [H, W]."""
    found, creases = curvature.of(model), len(model.creases)

    def constant(a, dtype):
        return wp.array(np.ascontiguousarray(a), dtype=dtype, device=device)

    p = Plates()
    p.start, p.hinge = constant(found.start, wp.int32), constant(found.hinge + creases, wp.int32)
    p.weight, p.triangle = constant(found.weight, wp.vec3d), constant(found.triangle, wp.int32)
    p.whole, p.share = constant(found.whole, wp.float64), constant(found.share, wp.float64)
    with np.errstate(invalid="ignore"):  # of hinges without triangles
        rest = dihedral_angles(model.position, model.bends)
    p.rest = constant(found.of(rest), wp.vec3d)
    p.area, p.shape = constant(found.area, wp.float64), constant(found.shape, wp.mat22d)
    p.dual, p.side = constant(found.dual, wp.mat33d), constant(found.side, wp.vec3i)
    p.arc_start, p.arc_hinge = constant(found.arc_start, wp.int32), constant(found.arc_hinge + creases, wp.int32)
    p.arc_weight = constant(found.arc_weight, wp.float64)
    p.arc_rest = constant(0.5 * found.arcs(rest)[found.side] ** 2, wp.vec3d)
    p.moment = moments
    if turns is not None:
        p.turn = turns
    return p
