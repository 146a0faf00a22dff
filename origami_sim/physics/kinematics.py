"""Geometry shared by the laws and the solvers: dihedral angles, panel normals, contact points, and their gradients."""

import math

import warp as wp

from origami_sim import _warp  # noqa: F401  settings

scalar = wp.float64


@wp.struct
class Hinge:
    """Dihedral angle [rad] of a crease (0 flat, valley positive, in (-pi, pi]) and its gradient at the four nodes."""

    angle: scalar
    gi: wp.vec3d
    gj: wp.vec3d
    gk: wp.vec3d
    gl: wp.vec3d


@wp.struct
class Tangents:
    """Unit normal of a triangle and the in-plane gradients [1/m] of its three barycentric coordinates."""

    n: wp.vec3d
    g1: wp.vec3d
    g2: wp.vec3d
    g3: wp.vec3d


@wp.func
def turned(y: scalar, x: scalar):
    """atan2(y, x); of small angles, such as those of flat panels, by its series, exact to rounding and quicker."""
    t = y / x
    u = t * t
    if u < scalar(0.0009765625) and x > scalar(0.0):
        # literals, not fractions: an expression inside scalar() would be single precision
        s = (scalar(0.1111111111111111) * u - scalar(0.14285714285714285)) * u + scalar(0.2)
        return t + (t * u) * (s * u - scalar(0.3333333333333333))
    return wp.atan2(y, x)


@wp.func
def dihedral(xi: wp.vec3d, xj: wp.vec3d, xk: wp.vec3d, xl: wp.vec3d):
    """Angle about the axis j-k; l is the apex left of the axis, i the one right of it (seen from the top)."""
    h = Hinge()
    e = xk - xj
    ri = xi - xj
    rl = xl - xj
    n1 = wp.cross(ri, e)
    n2 = wp.cross(e, rl)
    ee = wp.dot(e, e)
    length = wp.sqrt(ee)
    # (n1 x n2) . e / |e|, where n1 x n2 = e (ri . n2)
    h.angle = turned(wp.dot(ri, n2) * length, wp.dot(n1, n2))
    h.gi = n1 * (length / wp.dot(n1, n1))
    h.gl = n2 * (length / wp.dot(n2, n2))
    inverse = scalar(1.0) / ee
    ai = wp.dot(ri, e) * inverse
    al = wp.dot(rl, e) * inverse
    h.gj = -(scalar(1.0) - ai) * h.gi - (scalar(1.0) - al) * h.gl
    h.gk = -ai * h.gi - al * h.gl
    return h


@wp.func
def unwrap(angle: scalar, before: scalar):
    """The angle, shifted by whole turns to lie within half a turn of its earlier value."""
    turn = scalar(2.0) * scalar(math.pi)  # an expression inside scalar() would be single precision
    out = angle
    if wp.abs(before - angle) > scalar(math.pi):
        out = angle + turn * wp.round((before - angle) / turn)
    return out


@wp.func
def normal_gradients(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d):
    t = Tangents()
    c = wp.cross(x2 - x1, x3 - x1)
    inverse = scalar(1.0) / wp.length(c)  # of twice the area
    t.n = c * inverse
    t.g1 = wp.cross(t.n, x3 - x2) * inverse
    t.g2 = wp.cross(t.n, x1 - x3) * inverse
    t.g3 = wp.cross(t.n, x2 - x1) * inverse
    return t


@wp.func
def corner_rows(f1: wp.vec3d, f2: wp.vec3d, f3: wp.vec3d):
    return wp.matrix_from_rows(f1, f2, f3)


@wp.func
def corner(rows: wp.mat33d, i: int):
    return wp.vec3d(rows[i, 0], rows[i, 1], rows[i, 2])


@wp.func
def plane_normal(tilt: scalar, azimuth: scalar):
    """Upward normal of a ground that rises by `tilt` in the horizontal direction `azimuth` [rad]."""
    s = wp.sin(tilt)
    return wp.vec3d(-s * wp.cos(azimuth), -s * wp.sin(azimuth), wp.cos(tilt))


@wp.func
def unit_or_zero(a: wp.vec3d):
    length = wp.length(a)
    out = wp.vec3d(scalar(0.0), scalar(0.0), scalar(0.0))
    if length > scalar(0.0):
        out = a / length
    return out
