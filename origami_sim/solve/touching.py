"""Which parts of a sheet's surface are near each other, and how near, in the kernels.

The surface is its triangles, each as thick as its panel. Two of them touch where a corner comes nearer to a triangle,
or an edge to an edge, than half of both thicknesses. Pairs that may do so soon are kept in a list per world, which is
made anew once a node has moved by half the margin within which it was made: boxes around the triangles, nested as the
sheet lies in its reference state, are fitted to the present state and compared with each other (a bounding volume
hierarchy; each corner and edge counts with one of its triangles: Curtis, Tamstorf & Manocha 2008). A pair is passed over
until the nodes have moved far enough to close its gap. So the list changes nothing but the time that it takes.
"""

import warp as wp

from origami_sim import _warp, kinematics  # noqa: F401  settings

scalar = wp.float64

SHARE = wp.constant(wp.float64(0.2))
"""Distance at which parts of one sheet touch that lie near each other in it, over their distance along it.

Beside a crease two layers have to come closer than their thickness. With 0.2 a crease in a mesh finer than the
thickness folds to 157 degrees, with half of it to 169 and with double to 133; coarser panels fold until they touch.
"""

HALVINGS = 8
"""So many times the margin is halved where a list would not find room: to 1/256, where hardly anything is left."""

PARALLEL = wp.constant(wp.float64(0.01))
"""Squared sine of the angle from which on two edges count as crossing (6 degrees); below, corners carry the load.

The law fades in up to there, so that the force stays the gradient of an energy. Half and double change nothing that
corners against triangles do not hold as well.
"""

TINY = wp.constant(wp.float64(1e-30))


@wp.struct
class Skin:
    """Surface of a model, and its list of near pairs in each world.

    Attributes:
        corners: [S] triangles of the surface. owned: [S] bits of the corners (1, 2, 4) and edges (8, 16, 32) that a
            triangle stands for. body: [S] what hangs together. home: [S] the model's triangle that carries it.
        tree, beyond: [M] nested boxes in depth-first order: the triangle of each or -1, and the next box outside it.
        leaf: [S] box of each triangle.
        rest: [K] reference positions of the points [m]: nodes, then those that triangles carry.
        carrier, weights, lift: [K - N] nodes, shares and height [m] of points that triangles carry.
        low, high: [M, W] corners of the boxes [m]. built: [K, W] points where the list was made [m].
        points: [L, W] the four points of a pair. kind: [L, W] 0 corner and triangle, 1 edge and edge; the model's
            triangles of both sides. label: [L, W] a number that belongs to the pair alone.
        offset: [L, W] distance at which a pair touches [m]. wake: [L, W] travel of the nodes before which it cannot [m].
        fade: [L, W] lengths of both edges over the offset.
        count: [2, W] pairs in the list; 0 no list, 1 made, 2 it found no room. span: [2, W] travel before which no
            pair touches, and after which the list is made anew [m].
        margin: [m].
    """

    corners: wp.array(dtype=wp.vec3i)
    owned: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    home: wp.array(dtype=wp.int32)
    tree: wp.array(dtype=wp.int32)
    beyond: wp.array(dtype=wp.int32)
    leaf: wp.array(dtype=wp.int32)
    rest: wp.array(dtype=wp.vec3d)
    carrier: wp.array(dtype=wp.vec3i)
    weights: wp.array(dtype=wp.vec3d)
    lift: wp.array(dtype=wp.float64)
    low: wp.array2d(dtype=wp.vec3d)
    high: wp.array2d(dtype=wp.vec3d)
    built: wp.array2d(dtype=wp.vec3d)
    points: wp.array2d(dtype=wp.vec4i)
    kind: wp.array2d(dtype=wp.vec3i)
    label: wp.array2d(dtype=wp.float64)
    offset: wp.array2d(dtype=wp.float64)
    wake: wp.array2d(dtype=wp.float64)
    fade: wp.array2d(dtype=wp.vec2d)
    count: wp.array2d(dtype=wp.int32)
    span: wp.array2d(dtype=wp.float64)
    nodes: int
    margin: wp.float64


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


# points ---------------------------------------------------------------------------------------------------------------


@wp.func
def place(s: Skin, X: wp.array2d(dtype=wp.vec3d), k: int, w: int):
    """A point of the surface."""
    if k < s.nodes:
        return X[k, w]
    c = s.carrier[k - s.nodes]
    share = s.weights[k - s.nodes]
    x1 = X[c[0], w]
    x2 = X[c[1], w]
    x3 = X[c[2], w]
    n = wp.normalize(wp.cross(x2 - x1, x3 - x1))
    return share[0] * x1 + share[1] * x2 + share[2] * x3 + s.lift[k - s.nodes] * n


@wp.func
def velocity(s: Skin, X: wp.array2d(dtype=wp.vec3d), V: wp.array2d(dtype=wp.vec3d), k: int, w: int):
    """Its velocity; or from accelerations that part of its own which is linear in them."""
    if k < s.nodes:
        return V[k, w]
    c = s.carrier[k - s.nodes]
    share = s.weights[k - s.nodes]
    t = kinematics.normal_gradients(X[c[0], w], X[c[1], w], X[c[2], w])
    v1 = V[c[0], w]
    v2 = V[c[1], w]
    v3 = V[c[2], w]
    turn = wp.dot(t.n, v1) * t.g1 + wp.dot(t.n, v2) * t.g2 + wp.dot(t.n, v3) * t.g3
    return share[0] * v1 + share[1] * v2 + share[2] * v3 - s.lift[k - s.nodes] * turn


@wp.func
def push(s: Skin, X: wp.array2d(dtype=wp.vec3d), F: wp.array2d(dtype=wp.vec3d), k: int, force: wp.vec3d, w: int):
    """Adds a force on a point to those on the nodes."""
    if k < s.nodes:
        F[k, w] = F[k, w] + force
    else:
        c = s.carrier[k - s.nodes]
        share = s.weights[k - s.nodes]
        t = kinematics.normal_gradients(X[c[0], w], X[c[1], w], X[c[2], w])
        lever = s.lift[k - s.nodes] * t.n
        F[c[0], w] = F[c[0], w] + share[0] * force - wp.dot(force, t.g1) * lever
        F[c[1], w] = F[c[1], w] + share[1] * force - wp.dot(force, t.g2) * lever
        F[c[2], w] = F[c[2], w] + share[2] * force - wp.dot(force, t.g3) * lever


# distances ------------------------------------------------------------------------------------------------------------


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
def from_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
    """Distance of a point from a triangle."""
    w = nearest(p, a, b, c)
    return wp.length(p - w[0] * a - w[1] * b - w[2] * c)


@wp.func
def between(p1: wp.vec3d, p2: wp.vec3d, q1: wp.vec3d, q2: wp.vec3d):
    """Distance of two edges (Ericson 2005, section 5.1.9)."""
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
    return wp.length(r + s * d1 - t * d2)


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


@wp.func
def distance(s: Skin, X: wp.array2d(dtype=wp.vec3d), row: int, w: int):
    """Distance of a pair of the list now; infinite for edges that do not cross."""
    p = s.points[row, w]
    a = place(s, X, p[0], w)
    b = place(s, X, p[1], w)
    c = place(s, X, p[2], w)
    d = place(s, X, p[3], w)
    out = scalar(0.0)
    if s.kind[row, w][0] == 0:
        out = from_triangle(a, b, c, d)
    else:
        out = crossing(a, b, c, d)
    return out


@wp.func
def look(s: Skin, X: wp.array2d(dtype=wp.vec3d), row: int, w: int):
    """A pair of the list as it lies now."""
    p = s.points[row, w]
    a = place(s, X, p[0], w)
    b = place(s, X, p[1], w)
    c = place(s, X, p[2], w)
    d = place(s, X, p[3], w)
    near = Near()
    if s.kind[row, w][0] == 0:
        near = corner_near(a, b, c, d)
    else:
        near = edge_near(a, b, c, d, s.fade[row, w])
    return near


# the list -------------------------------------------------------------------------------------------------------------


@wp.func
def touches_at(s: Skin, thick: scalar, distance_at_rest: scalar, a: int, b: int):
    """Distance at which a pair touches: half of both thicknesses, less for what lies near in one body."""
    out = thick
    if s.body[a] == s.body[b]:
        out = wp.min(thick, SHARE * distance_at_rest)
    return out


@wp.func
def note(
    s: Skin,
    kind: int,
    points: wp.vec4i,
    sides: wp.vec2i,
    label: scalar,
    distance: scalar,
    offset: scalar,
    margin: scalar,
    count: int,
    w: int,
):
    """Puts a pair into the list if it is near; returns the number of pairs that are."""
    if distance >= offset + margin:
        return count
    if count < s.points.shape[0]:
        s.points[count, w] = points
        s.kind[count, w] = wp.vec3i(kind, s.home[sides[0]], s.home[sides[1]])
        s.label[count, w] = label
        s.offset[count, w] = offset
        s.wake[count, w] = scalar(0.5) * (distance - offset)
        if kind == 1:
            one = wp.length(s.rest[points[1]] - s.rest[points[0]])
            other = wp.length(s.rest[points[3]] - s.rest[points[2]])
            s.fade[count, w] = wp.vec2d(one, other) / wp.max(offset, TINY)
    return count + 1


@wp.func
def corners_of(s: Skin, a: int, b: int, thick: scalar, margin: scalar, count: int, w: int):
    """Notes the corners that triangle a stands for, against triangle b."""
    found = count
    c = s.corners[b]
    for k in range(3):
        n = s.corners[a][k]
        if (s.owned[a] & (1 << k)) != 0 and n != c[0] and n != c[1] and n != c[2]:
            distance = from_triangle(s.built[n, w], s.built[c[0], w], s.built[c[1], w], s.built[c[2], w])
            if distance < thick + margin:
                before = from_triangle(s.rest[n], s.rest[c[0]], s.rest[c[1]], s.rest[c[2]])
                offset = touches_at(s, thick, before, a, b)
                size = wp.float64(3 * s.corners.shape[0] + s.rest.shape[0])
                label = scalar(1.0) + scalar(2.0) * (wp.float64(n) * size + wp.float64(b))
                points = wp.vec4i(n, c[0], c[1], c[2])
                found = note(s, 0, points, wp.vec2i(a, b), label, distance, offset, margin, found, w)
    return found


@wp.func
def edges_of(s: Skin, a: int, b: int, thick: scalar, margin: scalar, count: int, w: int):
    """Notes the edges that triangle a stands for, against those of triangle b."""
    found = count
    for k in range(3):
        if (s.owned[a] & (8 << k)) != 0:
            n1 = s.corners[a][k]
            n2 = s.corners[a][(k + 1) % 3]
            for m in range(3):
                o1 = s.corners[b][m]
                o2 = s.corners[b][(m + 1) % 3]
                apart = n1 != o1 and n1 != o2 and n2 != o1 and n2 != o2
                if (s.owned[b] & (8 << m)) != 0 and apart:
                    distance = between(s.built[n1, w], s.built[n2, w], s.built[o1, w], s.built[o2, w])
                    if distance < thick + margin:
                        before = between(s.rest[n1], s.rest[n2], s.rest[o1], s.rest[o2])
                        offset = touches_at(s, thick, before, a, b)
                        size = wp.float64(3 * s.corners.shape[0] + s.rest.shape[0])
                        label = scalar(2.0) + scalar(2.0) * (wp.float64(3 * a + k) * size + wp.float64(3 * b + m))
                        points = wp.vec4i(n1, n2, o1, o2)
                        found = note(s, 1, points, wp.vec2i(a, b), label, distance, offset, margin, found, w)
    return found


@wp.func
def apart(s: Skin, one: int, other: int, w: int):
    """Whether two boxes do not meet."""
    l1 = s.low[one, w]
    h1 = s.high[one, w]
    l2 = s.low[other, w]
    h2 = s.high[other, w]
    return l1[0] > h2[0] or l2[0] > h1[0] or l1[1] > h2[1] or l2[1] > h1[1] or l1[2] > h2[2] or l2[2] > h1[2]


@wp.func
def fit(
    s: Skin, P: wp.array(dtype=wp.float64), first: int, stride: int, margin: scalar,
    w: int,
):  # fmt: skip
    """Fits the boxes to the present state, inner ones after what is in them."""
    last = s.tree.shape[0] - 1
    for row in range(s.tree.shape[0]):
        i = last - row
        t = s.tree[i]
        if t >= 0:
            room = scalar(0.5) * (P[first + stride * s.home[t]] + margin)
            around = wp.vec3d(room, room, room)
            a = s.built[s.corners[t][0], w]
            b = s.built[s.corners[t][1], w]
            c = s.built[s.corners[t][2], w]
            s.low[i, w] = wp.min(wp.min(a, b), c) - around
            s.high[i, w] = wp.max(wp.max(a, b), c) + around
        else:
            other = s.beyond[i + 1]
            s.low[i, w] = wp.min(s.low[i + 1, w], s.low[other, w])
            s.high[i, w] = wp.max(s.high[i + 1, w], s.high[other, w])


@wp.func
def listed(
    s: Skin, P: wp.array(dtype=wp.float64), first: int, stride: int, margin: scalar,
    w: int,
):  # fmt: skip
    """Makes the list of pairs nearer than the margin; returns their number, which may be more than find room."""
    fit(s, P, first, stride, margin, w)
    count = int(0)
    for a in range(s.corners.shape[0]):
        i = int(0)
        while i < s.tree.shape[0]:
            if apart(s, s.leaf[a], i, w):
                i = s.beyond[i]
            else:
                b = s.tree[i]
                if b > a:
                    thick = scalar(0.5) * (P[first + stride * s.home[a]] + P[first + stride * s.home[b]])
                    if thick > scalar(0.0):
                        count = corners_of(s, a, b, thick, margin, count, w)
                        count = corners_of(s, b, a, thick, margin, count, w)
                        count = edges_of(s, a, b, thick, margin, count, w)
                i += 1
    return count


@wp.func
def renew(s: Skin, X: wp.array2d(dtype=wp.vec3d), P: wp.array(dtype=wp.float64), first: int, stride: int, w: int):
    """Makes the list anew, within a smaller margin where it finds no room."""
    for k in range(s.rest.shape[0]):
        s.built[k, w] = place(s, X, k, w)
    room = s.points.shape[0]
    margin = s.margin
    count = listed(s, P, first, stride, margin, w)
    halved = int(0)
    while count > room and halved < HALVINGS:
        margin = scalar(0.5) * margin
        halved += 1
        count = listed(s, P, first, stride, margin, w)
    s.count[1, w] = 1
    if count > room:
        s.count[1, w] = 2
        count = room
    s.count[0, w] = count
    soonest = scalar(0.5) * margin
    for row in range(count):
        soonest = wp.min(soonest, s.wake[row, w])
    s.span[0, w] = soonest
    s.span[1, w] = scalar(0.5) * margin


@wp.func
def travelled(s: Skin, X: wp.array2d(dtype=wp.vec3d), P: wp.array(dtype=wp.float64), first: int, stride: int, w: int):
    """How far a point has moved at most since the list was made [m]; makes it anew where that is too far.

    P[first + stride * t] is the thickness of the model's triangle t [m].
    """
    far = scalar(0.0)
    if s.count[1, w] > 0:
        for k in range(s.rest.shape[0]):
            by = place(s, X, k, w) - s.built[k, w]
            far = wp.max(far, wp.dot(by, by))
        far = wp.sqrt(far)
    if s.count[1, w] == 0 or not (far <= s.span[1, w]):
        renew(s, X, P, first, stride, w)
        far = scalar(0.0)
    return far


# what is remembered of pairs that touch -------------------------------------------------------------------------------
# memory[row]: which of two lists is the present one; memory[row + 1]: its length; then both lists, label and two numbers


@wp.func
def present(memory: wp.array2d(dtype=wp.float64), row: int, w: int):
    """The present list: 0 or 1."""
    which = int(0)
    if memory[row, w] > scalar(0.5):
        which = 1
    return which


@wp.func
def remembered(memory: wp.array2d(dtype=wp.float64), row: int, room: int, w: int):
    """Number of entries in the present list."""
    return wp.clamp(int(memory[row + 1, w]), 0, room)


@wp.func
def recall(memory: wp.array2d(dtype=wp.float64), row: int, room: int, length: int, cursor: int, label: scalar, w: int):
    """Entry of a pair in the present list, -1 if it has none. The search begins where the last one ended."""
    begin = row + 2 + 3 * room * present(memory, row, w)
    out = int(-1)
    k = int(0)
    while k < length and out < 0:
        i = (cursor + k) % length
        if memory[begin + 3 * i, w] == label:
            out = i
        k += 1
    return out


@wp.func
def node(s: Skin, k: int):
    """A node at a point, or that carries it."""
    out = k
    if k >= s.nodes:
        out = s.carrier[k - s.nodes][0]
    return out


# asked from outside ---------------------------------------------------------------------------------------------------


@wp.kernel(enable_backward=False)
def survey(
    s: Skin,
    X: wp.array2d(dtype=wp.vec3d),
    thickness: wp.array(dtype=wp.float64),
    distance: wp.array2d(dtype=wp.float64),
    inside: wp.array2d(dtype=wp.int32),
):
    """Lists the pairs of one world anew; their distances, and whether one lies over the inside of the other."""
    w = wp.tid()
    renew(s, X, thickness, 0, 1, w)
    for row in range(s.count[0, w]):
        p = s.points[row, w]
        a = s.built[p[0], w]
        b = s.built[p[1], w]
        c = s.built[p[2], w]
        d = s.built[p[3], w]
        if s.kind[row, w][0] == 0:
            share = nearest(a, b, c, d)
            distance[row, w] = wp.length(a - share[0] * b - share[1] * c - share[2] * d)
            inside[row, w] = int(wp.min(share) > scalar(1e-9))
        else:
            distance[row, w] = between(a, b, c, d)
            ends = wp.vec2d(scalar(1e9), scalar(1e9))
            inside[row, w] = int(edge_near(a, b, c, d, ends).window > scalar(0.0))
