"""Which parts of a sheet's surface are near each other, and how near, in the kernels.

The surface is its triangles, each as thick as its panel. Two of them touch where a corner comes nearer to a triangle,
or an edge to an edge, than half of both thicknesses. Pairs that may do so soon are kept in a list per world, which is
made anew once a node has moved by half the margin within which it was made: boxes around the triangles, nested as the
sheet lies in its reference state, are fitted to the present state and compared with each other (a bounding volume
hierarchy; each corner and edge counts with one of its triangles: Curtis, Tamstorf & Manocha 2008). A pair is passed
over until the nodes have moved far enough to close its gap. So the list changes nothing but the time that it takes.
"""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.physics import kinematics
from origami_sim.solve.kernels import nearness
from origami_sim.solve.kernels.nearness import between, crossing, edge_near, from_triangle, off_edge, off_triangle

scalar = wp.float64

SHARE = wp.constant(wp.float64(0.2))
"""Distance at which parts of one sheet touch that lie near each other in it, over their distance along it.

Beside a crease two layers have to come closer than their thickness. With 0.2 a crease in a mesh finer than the
thickness folds to 157 degrees, with half of it to 169 and with double to 133; coarser panels fold until they touch.
"""

HALVINGS = 8
"""So many times the margin is halved where a list would not find room: to 1/256, where hardly anything is left."""


@wp.struct
class Skin:
    """Surface of a model, and its list of near pairs in each world.

    Attributes:
        corners: [S] triangles of the surface. owned: [S] bits of the corners (1, 2, 4) and edges (8, 16, 32) that a
            triangle stands for. body: [S] what hangs together. home: [S] the model's triangle that carries it.
        panel: [S] its panel. own: [S] thickness of a patch [m]; negative for triangles of panels.
        tree, beyond: [M] nested boxes in depth-first order: the triangle of each or -1, and the next box outside it.
        leaf: [S] box of each triangle.
        rest: [K] reference positions of the points [m]: nodes, then those that triangles carry.
        carrier, weights, lift: [K - N] nodes, shares and height [m] of points that triangles carry.
        low, high: [M, W] corners of the boxes [m]. built: [K, W] points where the list was made [m].
        points: [L, W] the four points of a pair. kind: [L, W] 0 corner and triangle, 1 edge and edge; the model's
            triangles of both sides. label: [L, W] a number that belongs to the pair alone.
        offset: [L, W] distance at which a pair touches [m]. wake: [L, W] travel of the nodes before which it does not.
        fade: [L, W] lengths of both edges over the offset.
        count: [2, W] pairs in the list; 0 no list, 1 made, 2 it found no room. span: [2, W] travel before which no
            pair touches, and after which the list is made anew [m].
        nodes: number of the model's, after which come those that triangles carry. solid: of those before the masses of
            rigid panels, which are no corners, and are not always where their panels are. margin: [m].
    """

    corners: wp.array(dtype=wp.vec3i)
    owned: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    home: wp.array(dtype=wp.int32)
    panel: wp.array(dtype=wp.int32)
    own: wp.array(dtype=wp.float64)
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
    solid: int
    margin: wp.float64


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


# pairs ----------------------------------------------------------------------------------------------------------------


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
    near = nearness.Near()
    if s.kind[row, w][0] == 0:
        near = nearness.corner_near(a, b, c, d)
    else:
        near = edge_near(a, b, c, d, s.fade[row, w])
    return near


@wp.func
def fastest(s: Skin, X: wp.array2d(dtype=wp.vec3d), V: wp.array2d(dtype=wp.vec3d), w: int):
    """Speed of the fastest point [m/s]."""
    most = scalar(0.0)
    for k in range(s.rest.shape[0]):
        if k < s.solid or k >= s.nodes:
            v = velocity(s, X, V, k, w)
            most = wp.max(most, wp.dot(v, v))
    return wp.sqrt(most)


@wp.func
def swept(s: Skin, X: wp.array2d(dtype=wp.vec3d), V: wp.array2d(dtype=wp.vec3d), row: int, h: scalar, w: int):
    """Way that a pair came in a step of h [s], over the most after which it cannot have passed unseen.

    That is its gap and half of the distance at which it touches: so far apart at the end, and closer than that in
    between, it would have been pressed too deep. Of a pair that touches only the way along its normal counts.
    """
    p = s.points[row, w]
    a = place(s, X, p[0], w)
    b = place(s, X, p[1], w)
    c = place(s, X, p[2], w)
    d = place(s, X, p[3], w)
    away = off_triangle(a, b, c, d)
    if s.kind[row, w][0] != 0:
        away = off_edge(a, b, c, d)
    gap = wp.length(away) - s.offset[row, w]
    along = wp.identity(n=3, dtype=wp.float64)
    if gap < scalar(0.0):
        along = wp.outer(nearness.unit(away), nearness.unit(away))
    va = velocity(s, X, V, p[0], w)
    vb = velocity(s, X, V, p[1], w)
    vc = velocity(s, X, V, p[2], w)
    vd = velocity(s, X, V, p[3], w)
    speed = wp.max(wp.length(along * (va - vc)), wp.length(along * (va - vd)))
    if s.kind[row, w][0] == 0:
        speed = wp.max(speed, wp.length(along * (va - vb)))
    else:
        speed = wp.max(speed, wp.max(wp.length(along * (vb - vc)), wp.length(along * (vb - vd))))
    return h * speed / (wp.max(gap, scalar(0.0)) + scalar(0.5) * s.offset[row, w])


# the list -------------------------------------------------------------------------------------------------------------


@wp.func
def touches_at(s: Skin, thick: scalar, distance_at_rest: scalar, a: int, b: int):
    """Distance at which a pair touches: half of both thicknesses, less for what lies near in one body.

    Negative for a patch and its own panel, which never do.
    """
    out = thick
    if s.body[a] == s.body[b]:
        if s.own[a] < scalar(0.0) and s.own[b] < scalar(0.0):
            out = wp.min(thick, SHARE * distance_at_rest)
        elif s.panel[a] == s.panel[b]:
            out = scalar(-1.0)
        else:  # patches stay clear of creases by their own shape
            out = wp.min(thick, distance_at_rest)
    return out


@wp.func
def thickness(s: Skin, P: wp.array(dtype=wp.float64), first: int, stride: int, a: int):
    """Thickness of a triangle of the surface."""
    out = s.own[a]
    if out < scalar(0.0):
        out = P[first + stride * s.home[a]]
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
    if offset < scalar(0.0) or distance >= offset + margin:
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
            s.fade[count, w] = wp.vec2d(one, other) / wp.max(offset, scalar(1e-30))
    return count + 1


@wp.func
def corners_of(s: Skin, a: int, b: int, thick: scalar, margin: scalar, count: int, w: int):
    """Notes the corners that triangle a stands for, against triangle b."""
    found = count
    c = s.corners[b]
    three = int(3)  # a loop that is not unrolled is compiled in a fraction of the time
    for k in range(three):
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
    three = int(3)
    for k in range(three):
        if (s.owned[a] & (8 << k)) != 0:
            n1 = s.corners[a][k]
            n2 = s.corners[a][(k + 1) % 3]
            for m in range(three):
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
            room = scalar(0.5) * (thickness(s, P, first, stride, t) + margin)
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
                    thick = scalar(0.5) * (thickness(s, P, first, stride, a) + thickness(s, P, first, stride, b))
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
def farthest(s: Skin, X: wp.array2d(dtype=wp.vec3d), w: int):
    """How far a point has moved at most since the list was made [m]; not a number if it is nowhere, or was."""
    far = scalar(0.0)
    for k in range(s.rest.shape[0]):
        if k < s.solid or k >= s.nodes:
            by = place(s, X, k, w) - s.built[k, w]
            square = wp.dot(by, by)
            if far == far and not (square <= far):
                far = square
    return wp.sqrt(far)


@wp.func
def travelled(s: Skin, X: wp.array2d(dtype=wp.vec3d), P: wp.array(dtype=wp.float64), first: int, stride: int, w: int):
    """How far a point has moved at most since the list was made [m]; makes it anew where that is too far.

    P[first + stride * t] is the thickness of the model's triangle t [m].
    """
    far = scalar(0.0)
    if s.count[1, w] > 0:
        far = farthest(s, X, w)
    if s.count[1, w] == 0 or not (far <= s.span[1, w]):
        renew(s, X, P, first, stride, w)
        far = scalar(0.0)
    return far


# what is remembered of pairs that touch -------------------------------------------------------------------------------
# memory[row]: which of two lists is the present one; memory[row + 1]: its length; then both, label and two numbers each


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


@wp.func
def free_share(
    edges: int,
    a: wp.vec3d,
    b: wp.vec3d,
    c: wp.vec3d,
    d: wp.vec3d,
    da: wp.vec3d,
    db: wp.vec3d,
    dc: wp.vec3d,
    dd: wp.vec3d,
    floor: scalar,
    most: scalar,
):
    """Share of the straight way by da to dd on which a corner and a triangle, or two edges, stay `floor` [m] apart.

    The plane across their shortest connection keeps them apart for as long as their points' speeds along it allow, from
    where the next connection is taken (conservative advancement: Mirtich 1996, section 2.3; Li, Kaufman & Jiang 2021).
    It ends at `most`, and where they are within a hundredth of the floor, or get on by no more than 1e-9 of the way.
    """
    gone = scalar(0.0)
    going = int(1)
    while going == 1:
        way = wp.vec3d()
        if edges == 0:
            way = off_triangle(a + gone * da, b + gone * db, c + gone * dc, d + gone * dd)
        else:
            way = off_edge(a + gone * da, b + gone * db, c + gone * dc, d + gone * dd)
        apart_now = wp.length(way)
        n = nearness.unit(way)
        closing = wp.max(wp.dot(n, dc), wp.dot(n, dd)) - wp.min(wp.dot(n, da), wp.dot(n, db))
        if edges == 0:
            closing = wp.max(wp.dot(n, db), wp.max(wp.dot(n, dc), wp.dot(n, dd))) - wp.dot(n, da)
        free = apart_now - floor
        if closing <= scalar(0.0) and apart_now > scalar(0.0):
            gone = scalar(1.0)
        if gone >= most or free <= scalar(0.01) * floor:  # others allow less, or it may come no nearer
            going = 0
        elif free < scalar(1e-9) * closing:
            going = 0
        else:
            gone = gone + free / closing
    return gone


# asked from outside ---------------------------------------------------------------------------------------------------


@wp.kernel(enable_backward=False)
def survey(
    s: Skin,
    X: wp.array2d(dtype=wp.vec3d),
    thick: wp.array(dtype=wp.float64),
    distance: wp.array2d(dtype=wp.float64),
    inside: wp.array2d(dtype=wp.int32),
    share: wp.array2d(dtype=wp.vec4d),
    normal: wp.array2d(dtype=wp.vec3d),
    window: wp.array2d(dtype=wp.float64),
):
    """Lists the pairs of one world anew: their distances, whether one lies over the inside of the other, see `Near`."""
    w = wp.tid()
    renew(s, X, thick, 0, 1, w)
    for row in range(s.count[0, w]):
        p = s.points[row, w]
        a = s.built[p[0], w]
        b = s.built[p[1], w]
        c = s.built[p[2], w]
        d = s.built[p[3], w]
        near = nearness.Near()
        if s.kind[row, w][0] == 0:
            near = nearness.corner_near(a, b, c, d)
            distance[row, w] = near.distance
            least = wp.min(-near.share[1], wp.min(-near.share[2], -near.share[3]))
            inside[row, w] = int(least > scalar(1e-9))
        else:
            near = edge_near(a, b, c, d, s.fade[row, w])
            distance[row, w] = between(a, b, c, d)
            ends = wp.vec2d(scalar(1e9), scalar(1e9))
            inside[row, w] = int(edge_near(a, b, c, d, ends).window > scalar(0.0))
        share[row, w] = near.share
        normal[row, w] = near.normal
        window[row, w] = near.window


@wp.kernel(enable_backward=False)
def clear(s: Skin, X: wp.array2d(dtype=wp.vec3d), finest: scalar, share: wp.array(dtype=wp.float64)):
    """Lowers share[0] to that of the straight way to positions X on which no pair comes nearer than it may.

    Pairs that touch at less than `finest` [m] are passed over. Others may close to 0.9 of the distance at which they
    touch, or by a fifth from where they are.
    """
    row = wp.tid()
    p = s.points[row, 0]
    a = s.built[p[0], 0]
    b = s.built[p[1], 0]
    c = s.built[p[2], 0]
    d = s.built[p[3], 0]
    da = place(s, X, p[0], 0) - a
    db = place(s, X, p[1], 0) - b
    dc = place(s, X, p[2], 0) - c
    dd = place(s, X, p[3], 0) - d
    gone = scalar(1.0)
    if s.offset[row, 0] >= finest:
        edges = s.kind[row, 0][0]
        now = wp.length(off_triangle(a, b, c, d))
        if edges != 0:
            now = wp.length(off_edge(a, b, c, d))
        floor = wp.min(scalar(0.9) * s.offset[row, 0], scalar(0.8) * now)
        gone = free_share(edges, a, b, c, d, da, db, dc, dd, floor, share[0])
    wp.atomic_min(share, 0, gone)
