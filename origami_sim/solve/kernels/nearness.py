"""Distances of corners from triangles and of edges from each other, and how they go with their four points."""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.physics import kinematics

scalar = wp.float64

PARALLEL = wp.constant(wp.float64(0.01))
"""Squared sine of the angle from which on two edges count as crossing (6 degrees); below, corners carry the load.

The law fades in up to there, so that the force stays the gradient of an energy. Half and double change nothing that
corners against triangles do not hold as well.
"""

TINY = wp.constant(wp.float64(1e-30))


@wp.struct
class Near:
    """A pair as it lies: distance [m], unit normal towards its first part, and how both go with its four points.

    share: the distance's gradient is share[k] * normal. window, w0 to w3: weight of the pair, and its gradient [1/m].
    j0 to j3: slip per velocity of the points; a rigid motion of the pair slips by nothing.
    t1, t2: tangents that go with the pair.
    """

    distance: wp.float64
    normal: wp.vec3d
    share: wp.vec4d
    window: wp.float64
    w0: wp.vec3d
    w1: wp.vec3d
    w2: wp.vec3d
    w3: wp.vec3d
    j0: wp.mat33d
    j1: wp.mat33d
    j2: wp.mat33d
    j3: wp.mat33d
    t1: wp.vec3d
    t2: wp.vec3d


@wp.func
def nearest(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Weights of the corners of a triangle at its point that is nearest to p (Ericson 2005, section 5.1.5)."""
    ab = b - a
    ac = c - a
    d1 = wp.dot(ab, p - a)
    d2 = wp.dot(ac, p - a)
    d3 = wp.dot(ab, p - b)
    d4 = wp.dot(ac, p - b)
    d5 = wp.dot(ab, p - c)
    d6 = wp.dot(ac, p - c)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    zero = scalar(0.0)
    one = scalar(1.0)
    out = wp.vec3d(one, zero, zero)
    if d1 <= zero and d2 <= zero:
        out = wp.vec3d(one, zero, zero)
    elif d3 >= zero and d4 <= d3:
        out = wp.vec3d(zero, one, zero)
    elif d6 >= zero and d5 <= d6:
        out = wp.vec3d(zero, zero, one)
    elif vc <= zero and d1 >= zero and d3 <= zero:
        t = d1 / (d1 - d3)
        out = wp.vec3d(one - t, t, zero)
    elif vb <= zero and d2 >= zero and d6 <= zero:
        t = d2 / (d2 - d6)
        out = wp.vec3d(one - t, zero, t)
    elif va <= zero and d4 - d3 >= zero and d5 - d6 >= zero:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        out = wp.vec3d(zero, one - t, t)
    else:
        inverse = one / (va + vb + vc)
        out = wp.vec3d(va * inverse, vb * inverse, vc * inverse)
    return out


@wp.func
def off_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Shortest way from a triangle to a point."""
    w = nearest(p, a, b, c)
    return p - w[0] * a - w[1] * b - w[2] * c


@wp.func
def from_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Distance of a point from a triangle."""
    return wp.length(off_triangle(p, a, b, c))


@wp.func
def off_edge(p1: wp.vec3d, p2: wp.vec3d, q1: wp.vec3d, q2: wp.vec3d):
    """Shortest way from the second of two edges to the first (Ericson 2005, section 5.1.9)."""
    d1 = p2 - p1
    d2 = q2 - q1
    r = p1 - q1
    a = wp.dot(d1, d1)
    e = wp.dot(d2, d2)
    f = wp.dot(d2, r)
    c = wp.dot(d1, r)
    b = wp.dot(d1, d2)
    zero = scalar(0.0)
    one = scalar(1.0)
    denominator = a * e - b * b
    s = zero
    if denominator > TINY:
        s = wp.clamp((b * f - c * e) / denominator, zero, one)
    t = (b * s + f) / wp.max(e, TINY)
    if t < zero:
        t = zero
        s = wp.clamp(-c / wp.max(a, TINY), zero, one)
    elif t > one:
        t = one
        s = wp.clamp((b - c) / wp.max(a, TINY), zero, one)
    return r + s * d1 - t * d2


@wp.func
def between(p1: wp.vec3d, p2: wp.vec3d, q1: wp.vec3d, q2: wp.vec3d):
    """Distance of two edges."""
    return wp.length(off_edge(p1, p2, q1, q2))


@wp.func
def smooth(x: scalar):
    """0 below 0, 1 above 1, and smooth in between."""
    y = wp.clamp(x, scalar(0.0), scalar(1.0))
    return y * y * (scalar(3.0) - scalar(2.0) * y)


@wp.func
def smooth_slope(x: scalar):
    y = wp.clamp(x, scalar(0.0), scalar(1.0))
    return scalar(6.0) * y * (scalar(1.0) - y)


@wp.func
def unit(a: wp.vec3d):
    return a / wp.max(wp.length(a), TINY)


@wp.func
def corner_near(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """A corner p and a triangle."""
    near = Near()
    share = nearest(p, a, b, c)
    apart = p - share[0] * a - share[1] * b - share[2] * c
    near.distance = wp.length(apart)
    near.normal = unit(apart)
    near.share = wp.vec4d(scalar(1.0), -share[0], -share[1], -share[2])
    near.window = scalar(1.0)
    # the triangle carries a point beside p along: slip is p's motion against that
    t = kinematics.normal_gradients(a, b, c)
    height = wp.dot(p - a, t.n)
    l2 = wp.dot(p - a, t.g2)
    l3 = wp.dot(p - a, t.g3)
    one = wp.identity(n=3, dtype=wp.float64)
    near.j0 = one
    near.j1 = (l2 + l3 - scalar(1.0)) * one + height * wp.outer(t.g1, t.n)
    near.j2 = -l2 * one + height * wp.outer(t.g2, t.n)
    near.j3 = -l3 * one + height * wp.outer(t.g3, t.n)
    along = b - a
    near.t1 = unit(along - near.normal * wp.dot(near.normal, along))
    near.t2 = wp.cross(near.normal, near.t1)
    return near


@wp.func
def edge_near(p1: wp.vec3d, p2: wp.vec3d, q1: wp.vec3d, q2: wp.vec3d, fade: wp.vec2d):
    """An edge p1-p2 that crosses over an edge q1-q2.

    It fades out towards the ends of both, within the distance at which they touch, where corners take over.
    """
    near = Near()
    one = scalar(1.0)
    e = p2 - p1
    f = q2 - q1
    r = p1 - q1
    a = wp.dot(e, e)
    b = wp.dot(e, f)
    c = wp.dot(f, f)
    d = a * c - b * b
    sine = d / wp.max(a * c, TINY)
    near.window = scalar(0.0)
    if sine > scalar(1e-12):
        s = (b * wp.dot(f, r) - c * wp.dot(e, r)) / d
        t = (a * wp.dot(f, r) - b * wp.dot(e, r)) / d
        if s > scalar(0.0) and s < one and t > scalar(0.0) and t < one:
            apart = r + s * e - t * f
            near.distance = wp.length(apart)
            near.normal = unit(apart)
            near.share = wp.vec4d(one - s, s, t - one, -t)
            s0 = smooth(s * fade[0])
            s1 = smooth((one - s) * fade[0])
            t0 = smooth(t * fade[1])
            t1 = smooth((one - t) * fade[1])
            m = smooth(sine / PARALLEL)
            near.window = s0 * s1 * t0 * t1 * m
            by_s = (smooth_slope(s * fade[0]) * s1 - s0 * smooth_slope((one - s) * fade[0])) * fade[0] * t0 * t1 * m
            by_t = (smooth_slope(t * fade[1]) * t1 - t0 * smooth_slope((one - t) * fade[1])) * fade[1] * s0 * s1 * m
            by_m = smooth_slope(sine / PARALLEL) / PARALLEL * s0 * s1 * t0 * t1
            # ds = (b r2 - c r1) / d and dt = (a r2 - b r1) / d, where r1, r2 change what is zero at the nearest points
            s1st = (by_s * (-c) + by_t * (-b)) / d  # of the window by r1
            s2nd = (by_s * b + by_t * a) / d
            sine_e = scalar(2.0) * b / (a * c) * (b / a * e - f)  # of sine by e
            sine_f = scalar(2.0) * b / (a * c) * (b / c * f - e)
            near.w0 = s1st * ((one - s) * e - apart) + s2nd * ((one - s) * f) - by_m * sine_e
            near.w1 = s1st * (s * e + apart) + s2nd * (s * f) + by_m * sine_e
            near.w2 = s1st * ((t - one) * e) + s2nd * ((t - one) * f - apart) - by_m * sine_f
            near.w3 = s1st * (-t * e) + s2nd * (-t * f + apart) + by_m * sine_f
            across = wp.cross(e, f)
            size = wp.length(across)
            lever = wp.dot(apart, across) / (size * size)
            unity = wp.identity(n=3, dtype=wp.float64)
            flat = unity - wp.outer(near.normal, near.normal)
            by_e = lever * flat * wp.skew(f)
            by_f = -lever * flat * wp.skew(e)
            near.j0 = (one - s) * unity - by_e
            near.j1 = s * unity + by_e
            near.j2 = (t - one) * unity - by_f
            near.j3 = -t * unity + by_f
            near.t1 = unit(e)
            near.t2 = wp.cross(near.normal, near.t1)
    return near


@wp.func
def crossing(p1: wp.vec3d, p2: wp.vec3d, q1: wp.vec3d, q2: wp.vec3d):
    """Distance of two edges where they cross over each other, seen along it; infinite where they do not."""
    e = p2 - p1
    f = q2 - q1
    r = p1 - q1
    a = wp.dot(e, e)
    b = wp.dot(e, f)
    c = wp.dot(f, f)
    er = wp.dot(e, r)
    fr = wp.dot(f, r)
    d = a * c - b * b
    s = b * fr - c * er
    t = a * fr - b * er
    out = scalar(wp.inf)
    if s > scalar(0.0) and s < d and t > scalar(0.0) and t < d:
        out = wp.length(r + (s / d) * e - (t / d) * f)
    return out
