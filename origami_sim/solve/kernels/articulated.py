"""Rigid panels on hinges in a kernel: forward kinematics, mass matrix, accelerations, closed loops.

The panels form a tree. Its coordinates are the pose of the root panel, as far as that can move, and one angle for each
crease of the tree. Bodies are numbered from the root outwards, joint b - 1 carries body b. All velocities and moments
are taken about the origin O, the root's centre at that instant, in the axes of the world; composite inertias are then
plain sums (Featherstone 2008, chapters 6 and 8). Loops are closed by constraint forces.

What belongs to a world lies in one stretch of one buffer, so that threads share no memory; `Tree` has the places of its
parts in that stretch.
"""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.physics import kinematics

scalar = wp.float64
vec3 = wp.vec3d
mat33 = wp.mat33d

POSE = wp.constant(7)
"""Numbers of the root's pose before the joint angles: place of its centre, then a unit quaternion."""

NATURAL = wp.constant(0x7FFFFFFF)
"""Masked with this, an index is seen to be no negative one, and an access is spared that test."""


@wp.struct
class Tree:
    """Topology, and where in a world's stretch of the buffer its numbers lie.

    B bodies, J = B - 1 joints, d rates of the root, m = d + J rates in all, R constraint rows. Shapes are per world.
    """

    data: wp.array(dtype=scalar)  # [W width] the buffer
    width: int
    bodies: int
    roots: int
    rates: int
    rows: int
    follows: int  # 1: the root turns about its own centre
    first_body: int  # that moves: 1 where the root is held, of which all stays as it is
    first_number: int  # of the coordinates that changes: then the first joint's angle
    parent: wp.array(dtype=wp.int32)  # [B]
    body_of: wp.array(dtype=wp.int32)  # [N] body that carries a node
    moving: wp.array(dtype=wp.int32)  # nodes of the bodies that move, body after body: corners, then mass points
    corners: int  # how many of them are corners
    joint_of: wp.array(dtype=wp.int32)  # [C] joint of a crease, -1 where it closes a loop
    # [3 d + R] angular velocities of the root for unit rates, velocities of its centre besides, points about which it
    # turns where those do not move with it; then directions in which constraints hold
    axes: wp.array(dtype=vec3)
    joined: wp.array2d(dtype=wp.int32)  # [R, 3] node at which two bodies are joined, the bodies; -1: the ground
    stabilisation: scalar  # rate at which an open loop closes [1/s]
    softness: scalar  # of the constraints, relative to their mean mobility: which of redundant ones bear the load
    stages: int  # S of a step; the last is the first of the next
    tableau: wp.array(dtype=scalar)  # [(S + 1)^2] rows of time, then weights; the last row is the error's
    # [S, S] what weights of damped accelerations are more than those of others, on the diagonal their own; empty where
    # all are explicit
    implicit: wp.array2d(dtype=scalar)
    # steps at whose begin a held tree moves on from elsewhere, R of them; what memory and rates were before
    restarts: wp.array(dtype=wp.int32)
    starts: wp.array2d(dtype=scalar)  # [R 2 J, W] coordinates, then rates
    kept: wp.array2d(dtype=scalar)  # [R (M + J), W]
    # bodies
    reference: int  # [N, 3] nodes
    middle: int  # [3] the root's centre
    axis: int  # [J, 3]
    pivot: int  # [J, 3]
    start: int  # [C] crease angles in the reference state
    mass: int  # [B]
    centre: int  # [B, 3]
    inertia: int  # [B, 9] about the centre
    steady: int  # [B, 12] sum of forces on nodes that never change, and of the nodes' places times them
    # coordinates and rates, now and at the step's begin; their derivatives at the stages; length of the next step
    y: int  # [7 + J]
    u: int  # [m]
    y0: int
    u0: int
    dy: int  # [S + 1, 7 + J], the last of probes
    du: int  # [S + 1, m], the last of probes and of the error
    # where steps are implicit in damping: its matrix, accelerations by it at the stages, the factor of the mass matrix
    # at the step's begin, and that of the damped one
    damping: int  # [m, m]
    damped: int  # [S, m]
    factor0: int  # [m, m]
    stiff: int  # [m, m]
    span: int
    # what a step changes besides, to go back to
    hinges: int  # number of hinge angles
    memories: int
    feet_count: int
    effects: int
    angles0: int
    memory0: int
    feet: int  # [K, 3] contact points now
    feet0: int  # and at the step's begin
    power0: int  # [E]
    spent: int  # [E] mean power of each effect in a step, by the weights of its stages
    # of one evaluation
    turned: int  # [B, 9]
    placed: int  # [B, 3] x = turned reference + placed
    hinge: int  # [J, 3] axis now
    joint: int  # [J, 3] pivot now, from O
    omega: int  # [B, 3]
    speed: int  # [B, 3] velocity at O
    alpha: int  # [B, 3] angular acceleration if rates did not change
    gain: int  # [B, 3] the same of the body's point at O
    force: int  # [B, 3]
    moment: int  # [B, 3] about O
    torque: int  # [J]
    heavy: int  # [B] composite mass, first moment [B, 3], inertia [B, 9] about O
    first: int
    second: int
    factor: int  # [m, m] mass matrix, then its Cholesky factor
    jacobian: int  # [R, m] of the constraints
    solved: int  # [R, m] its product with the inverse factor
    gram: int  # [R, R]
    pull: int  # [R] constraint forces


PARTS = tuple(
    "reference middle axis pivot start mass centre inertia steady y u y0 u0 dy du damping damped factor0 stiff "
    "span angles0 memory0 feet feet0 power0 spent turned placed hinge joint omega speed alpha gain force moment torque "
    "heavy first second factor jacobian solved gram pull".split()
)
"""Parts of a world's stretch, in order."""


@wp.func_native(snippet="return data.data[i];")
def at(data: wp.array(dtype=scalar), i: int) -> scalar:
    """A number of the buffer, which is dense: neither stride nor sign of the index are asked for."""
    ...


@wp.func_native(snippet="data.data[i] = x;")
def put(data: wp.array(dtype=scalar), i: int, x: scalar):
    """Sets a number of the buffer."""
    ...


@wp.func
def vec_at(data: wp.array(dtype=scalar), i: int):
    return vec3(at(data, i), at(data, i + 1), at(data, i + 2))


@wp.func
def put_vec(data: wp.array(dtype=scalar), i: int, v: vec3):
    put(data, i, v[0])
    put(data, i + 1, v[1])
    put(data, i + 2, v[2])


@wp.func
def mat_at(data: wp.array(dtype=scalar), i: int):
    return wp.matrix_from_rows(vec_at(data, i), vec_at(data, i + 3), vec_at(data, i + 6))


@wp.func
def put_mat(data: wp.array(dtype=scalar), i: int, m: mat33):
    put_vec(data, i, m[0])
    put_vec(data, i + 3, m[1])
    put_vec(data, i + 6, m[2])


@wp.func
def copy(data: wp.array(dtype=scalar), target: int, source: int, count: int):
    for i in range(count):
        put(data, target + i, at(data, source + i))


@wp.func
def outer_inertia(mass: scalar, r: vec3):
    """Inertia about the origin of a point mass at r."""
    return mass * (wp.dot(r, r) * wp.identity(n=3, dtype=scalar) - wp.outer(r, r))


@wp.func
def rotation(axis: vec3, angle: scalar):
    """Rotation by an angle about a unit axis (Rodrigues)."""
    k = wp.skew(axis)
    return wp.identity(n=3, dtype=scalar) + wp.sin(angle) * k + (scalar(1.0) - wp.cos(angle)) * (k * k)


@wp.func
def along_root(tree: Tree, k: int, origin: vec3):
    """Velocity of the root's centre for a unit rate."""
    out = tree.axes[tree.roots + k]
    if tree.follows == 0:
        out = out + wp.cross(tree.axes[k], origin - tree.axes[2 * tree.roots + k])
    return out


@wp.func
def unload(tree: Tree, w: int):
    """Clears the forces that never change."""
    for k in range(12 * tree.bodies):
        put(tree.data, w * tree.width + tree.steady + k, scalar(0.0))


@wp.func
def load(tree: Tree, n: int, force: vec3, w: int):
    """Adds a force on a node that never changes to those of its body."""
    k = w * tree.width + tree.steady + 12 * tree.body_of[n]
    place = vec_at(tree.data, w * tree.width + tree.reference + 3 * n)
    put_vec(tree.data, k, vec_at(tree.data, k) + force)
    put_mat(tree.data, k + 3, mat_at(tree.data, k + 3) + wp.outer(place, force))


@wp.func
def pose(tree: Tree, w: int):
    """Places and velocities of all bodies from coordinates and rates; clears what forces are added to."""
    s = tree.data
    o = w * tree.width
    zero = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    origin = vec_at(s, o + tree.y)
    q = o + tree.y + 3
    turn = wp.quat_to_matrix(wp.normalize(wp.quatd(at(s, q), at(s, q + 1), at(s, q + 2), at(s, q + 3))))
    put_mat(s, o + tree.turned, turn)
    put_vec(s, o + tree.placed, origin - turn * vec_at(s, o + tree.middle))
    omega = zero
    speed = zero
    for k in range(tree.roots):
        rate = at(s, o + tree.u + k)
        omega = omega + rate * tree.axes[k]
        speed = speed + rate * along_root(tree, k, origin)
    gain = zero
    if tree.follows == 0:
        gain = wp.cross(omega, speed)
    put_vec(s, o + tree.omega, omega)
    put_vec(s, o + tree.speed, speed)
    put_vec(s, o + tree.alpha, zero)
    put_vec(s, o + tree.gain, gain)
    put_vec(s, o + tree.force, zero)
    put_vec(s, o + tree.moment, zero)
    for b in range(1, tree.bodies):
        p = tree.parent[b]
        j = b - 1
        up = mat_at(s, o + tree.turned + 9 * p)
        bare = vec_at(s, o + tree.axis + 3 * j)
        pivot = vec_at(s, o + tree.pivot + 3 * j)
        a = up * bare
        there = up * pivot + vec_at(s, o + tree.placed + 3 * p)
        mine = up * rotation(bare, at(s, o + tree.y + POSE + j))
        put_mat(s, o + tree.turned + 9 * b, mine)
        put_vec(s, o + tree.placed + 3 * b, there - mine * pivot)
        r = there - origin
        rate = at(s, o + tree.u + tree.roots + j)
        before = vec_at(s, o + tree.omega + 3 * p)
        swing = vec_at(s, o + tree.alpha + 3 * p)
        now = before + rate * a
        put_vec(s, o + tree.hinge + 3 * j, a)
        put_vec(s, o + tree.joint + 3 * j, r)
        put_vec(s, o + tree.omega + 3 * b, now)
        put_vec(s, o + tree.speed + 3 * b, vec_at(s, o + tree.speed + 3 * p) - rate * wp.cross(a, r))
        # both bodies accelerate alike at the pivot
        pull = vec_at(s, o + tree.gain + 3 * p) + wp.cross(swing, r) + wp.cross(before, wp.cross(before, r))
        swing = swing + rate * wp.cross(before, a)
        put_vec(s, o + tree.alpha + 3 * b, swing)
        put_vec(s, o + tree.gain + 3 * b, pull - wp.cross(swing, r) - wp.cross(now, wp.cross(now, r)))
        put(s, o + tree.torque + j, scalar(0.0))
        put_vec(s, o + tree.force + 3 * b, zero)
        put_vec(s, o + tree.moment + 3 * b, zero)


@wp.func
def place(
    tree: Tree,
    X: wp.array2d(dtype=vec3),
    V: wp.array2d(dtype=vec3),
    F: wp.array2d(dtype=vec3),
    count: int,
    w: int,
):
    """Places and velocities of the first nodes that bodies carry; clears what forces are added to."""
    s = tree.data
    o = w * tree.width
    origin = vec_at(s, o + tree.y)
    zero = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    body = int(-1)
    own = mat_at(s, o + tree.turned)
    there = zero
    omega = zero
    speed = zero
    for row in range(count):
        n = tree.moving[row & NATURAL] & NATURAL
        b = tree.body_of[n]
        if b != body:
            body = b
            own = mat_at(s, o + tree.turned + 9 * b)
            there = vec_at(s, o + tree.placed + 3 * b)
            omega = vec_at(s, o + tree.omega + 3 * b)
            speed = vec_at(s, o + tree.speed + 3 * b)
        x = own * vec_at(s, o + tree.reference + 3 * n) + there
        X[n, w] = x
        V[n, w] = speed + wp.cross(omega, x - origin)
        F[n, w] = zero


@wp.func
def gather(tree: Tree, F: wp.array2d(dtype=vec3), X: wp.array2d(dtype=vec3), count: int, w: int):
    """Adds the forces on the first nodes to those on their bodies."""
    s = tree.data
    o = w * tree.width
    origin = vec_at(s, o + tree.y)
    body = int(0)
    pull = vec_at(s, o + tree.force)
    torque = vec_at(s, o + tree.moment)
    for row in range(count):
        n = tree.moving[row & NATURAL] & NATURAL
        b = tree.body_of[n]
        if b != body:
            put_vec(s, o + tree.force + 3 * body, pull)
            put_vec(s, o + tree.moment + 3 * body, torque)
            body = b
            pull = vec_at(s, o + tree.force + 3 * b)
            torque = vec_at(s, o + tree.moment + 3 * b)
        f = F[n, w]
        pull = pull + f
        torque = torque + wp.cross(X[n, w] - origin, f)
    put_vec(s, o + tree.force + 3 * body, pull)
    put_vec(s, o + tree.moment + 3 * body, torque)


@wp.func
def accelerate(tree: Tree, stage: int, w: int):
    """Derivatives of coordinates and rates at a stage, from the forces on bodies and the moments at joints."""
    s = tree.data
    o = w * tree.width
    roots = tree.roots
    m = tree.rates
    du = o + tree.du + stage * m
    factor = o + tree.factor
    origin = vec_at(s, o + tree.y)
    for k in range(m * m):
        put(s, factor + k, scalar(0.0))
    for b in range(tree.first_body, tree.bodies):
        turn = mat_at(s, o + tree.turned + 9 * b)
        c = turn * vec_at(s, o + tree.centre + 3 * b) + vec_at(s, o + tree.placed + 3 * b) - origin
        mass = at(s, o + tree.mass + b)
        own = turn * mat_at(s, o + tree.inertia + 9 * b) * wp.transpose(turn)
        omega = vec_at(s, o + tree.omega + 3 * b)
        swing = vec_at(s, o + tree.alpha + 3 * b)
        a = vec_at(s, o + tree.gain + 3 * b) + wp.cross(swing, c) + wp.cross(omega, wp.cross(omega, c))
        pull = vec_at(s, o + tree.steady + 12 * b)
        arms = turn * mat_at(s, o + tree.steady + 12 * b + 3)  # sum of products of arm and force
        torque = vec3(arms[1, 2] - arms[2, 1], arms[2, 0] - arms[0, 2], arms[0, 1] - arms[1, 0])
        torque = torque + wp.cross(vec_at(s, o + tree.placed + 3 * b) - origin, pull)
        put_vec(s, o + tree.force + 3 * b, vec_at(s, o + tree.force + 3 * b) + pull - mass * a)
        spin = own * swing + wp.cross(omega, own * omega) + mass * wp.cross(c, a)
        put_vec(s, o + tree.moment + 3 * b, vec_at(s, o + tree.moment + 3 * b) + torque - spin)
        put(s, o + tree.heavy + b, mass)
        put_vec(s, o + tree.first + 3 * b, mass * c)
        put_mat(s, o + tree.second + 9 * b, own + outer_inertia(mass, c))
    # towards the root: what a joint carries is the sum of all beyond it
    for back in range(tree.bodies - tree.first_body):
        b = tree.bodies - 1 - back
        heavy = at(s, o + tree.heavy + b)
        first = vec_at(s, o + tree.first + 3 * b)
        second = mat_at(s, o + tree.second + 9 * b)
        force = vec_at(s, o + tree.force + 3 * b)
        moment = vec_at(s, o + tree.moment + 3 * b)
        moves = int(1)  # rates with which this body moves against the one before it
        k = int(roots + b - 1)
        if b == 0:
            moves = roots
            k = int(0)
        for _move in range(moves):
            a = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
            along = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
            load = scalar(0.0)
            if b == 0:
                a = tree.axes[k]
                along = along_root(tree, k, origin)
            else:
                a = vec_at(s, o + tree.hinge + 3 * (b - 1))
                along = wp.cross(vec_at(s, o + tree.joint + 3 * (b - 1)), a)
                load = at(s, o + tree.torque + b - 1)
            put(s, du + k, load + wp.dot(a, moment) + wp.dot(along, force))
            momentum = heavy * along + wp.cross(a, first)
            angular = wp.cross(first, along) + second * a
            i = b
            while i > 0:
                c = vec_at(s, o + tree.hinge + 3 * (i - 1))
                by = wp.dot(c, angular) + wp.dot(wp.cross(vec_at(s, o + tree.joint + 3 * (i - 1)), c), momentum)
                put(s, factor + k * m + roots + i - 1, by)
                i = tree.parent[i]
            for r in range(roots):
                by = wp.dot(tree.axes[r], angular) + wp.dot(along_root(tree, r, origin), momentum)
                put(s, factor + k * m + r, by)
            k += 1
        p = tree.parent[b]
        if p >= tree.first_body:
            put_vec(s, o + tree.force + 3 * p, vec_at(s, o + tree.force + 3 * p) + force)
            put_vec(s, o + tree.moment + 3 * p, vec_at(s, o + tree.moment + 3 * p) + moment)
            put(s, o + tree.heavy + p, at(s, o + tree.heavy + p) + heavy)
            put_vec(s, o + tree.first + 3 * p, vec_at(s, o + tree.first + 3 * p) + first)
            put_mat(s, o + tree.second + 9 * p, mat_at(s, o + tree.second + 9 * p) + second)
    factorise(s, factor, m, scalar(0.0))
    solve_lower(s, factor, du, m)
    if tree.rows > 0:
        constrain(tree, stage, w)
    solve_upper(s, factor, du, m)
    # rates of the coordinates
    dy = o + tree.dy + stage * (POSE + tree.bodies - 1)
    omega = vec_at(s, o + tree.omega)
    q = vec_at(s, o + tree.y + 3)
    last = at(s, o + tree.y + 6)
    put_vec(s, dy, vec_at(s, o + tree.speed))
    put_vec(s, dy + 3, scalar(0.5) * (last * omega + wp.cross(omega, q)))
    put(s, dy + 6, scalar(-0.5) * wp.dot(omega, q))
    copy(s, dy + POSE, o + tree.u + roots, tree.bodies - 1)


@wp.func
def factorise(s: wp.array(dtype=scalar), first: int, m: int, least: scalar):
    """Cholesky factor of a symmetric matrix [m, m] of which the lower triangle is given, in its place."""
    for i in range(m):
        for j in range(i + 1):
            x = at(s, first + i * m + j)
            for k in range(j):
                x = x - at(s, first + i * m + k) * at(s, first + j * m + k)
            if i == j:
                put(s, first + i * m + i, wp.sqrt(wp.max(x, least)))
            else:
                put(s, first + i * m + j, x / at(s, first + j * m + j))


@wp.func
def solve_lower(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Solves with a Cholesky factor [m, m], in place."""
    for i in range(m):
        x = at(s, target + i)
        for k in range(i):
            x = x - at(s, factor + i * m + k) * at(s, target + k)
        put(s, target + i, x / at(s, factor + i * m + i))


@wp.func
def solve_upper(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Solves with a transposed Cholesky factor [m, m], in place."""
    for back in range(m):
        i = m - 1 - back
        x = at(s, target + i)
        for k in range(i + 1, m):
            x = x - at(s, factor + k * m + i) * at(s, target + k)
        put(s, target + i, x / at(s, factor + i * m + i))


@wp.func
def multiply(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Multiplies with the matrix [m, m] of a Cholesky factor, in place."""
    for i in range(m):
        x = scalar(0.0)
        for k in range(i, m):
            x = x + at(s, factor + k * m + i) * at(s, target + k)
        put(s, target + i, x)
    for back in range(m):
        i = m - 1 - back
        x = scalar(0.0)
        for k in range(i + 1):
            x = x + at(s, factor + i * m + k) * at(s, target + k)
        put(s, target + i, x)


@wp.func
def constrain(tree: Tree, stage: int, w: int):
    """Adds the forces that keep loops closed to the half-solved accelerations of the open tree.

    With M = L L^T, S = J L^-T: (S S^T + soft) pull = -(bias + 2 c rate + c^2 gap + S z), z += S^T pull (Baumgarte).
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    du = o + tree.du + stage * m
    origin = vec_at(s, o + tree.y)
    total = scalar(0.0)
    for i in range(tree.rows):
        row = o + tree.jacobian + i * m
        solved = o + tree.solved + i * m
        for k in range(m):
            put(s, row + k, scalar(0.0))
        axis = tree.axes[3 * tree.roots + i]
        reference = vec_at(s, o + tree.reference + 3 * tree.joined[i, 0])
        gap = scalar(0.0)
        bias = scalar(0.0)
        here = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
        for side in range(2):
            b = int(tree.joined[i, 1 + side])
            sign = scalar(1.0)
            if side == 1:
                sign = scalar(-1.0)
            x = reference
            if b >= 0:
                x = mat_at(s, o + tree.turned + 9 * b) * reference + vec_at(s, o + tree.placed + 3 * b)
            if side == 0:
                here = x - origin
            gap += sign * wp.dot(axis, x)
            if b >= 0:
                omega = vec_at(s, o + tree.omega + 3 * b)
                a = vec_at(s, o + tree.gain + 3 * b) + wp.cross(vec_at(s, o + tree.alpha + 3 * b), here)
                bias += sign * wp.dot(axis, a + wp.cross(omega, wp.cross(omega, here)))
                for k in range(tree.roots):
                    by = along_root(tree, k, origin) + wp.cross(tree.axes[k], here)
                    put(s, row + k, at(s, row + k) + sign * wp.dot(axis, by))
            while b > 0:
                arm = here - vec_at(s, o + tree.joint + 3 * (b - 1))
                entry = row + tree.roots + b - 1
                along = wp.dot(axis, wp.cross(vec_at(s, o + tree.hinge + 3 * (b - 1)), arm))
                put(s, entry, at(s, entry) + sign * along)
                b = tree.parent[b]
        rate = scalar(0.0)
        for k in range(m):
            rate += at(s, row + k) * at(s, o + tree.u + k)
        copy(s, solved, row, m)
        solve_lower(s, o + tree.factor, solved, m)
        c = tree.stabilisation
        right = -(bias + scalar(2.0) * c * rate + c * c * gap)
        for k in range(m):
            right -= at(s, solved + k) * at(s, du + k)
        put(s, o + tree.pull + i, right)
        for j in range(i + 1):
            product = scalar(0.0)
            for k in range(m):
                product += at(s, solved + k) * at(s, o + tree.solved + j * m + k)
            put(s, o + tree.gram + i * tree.rows + j, product)
            if i == j:
                total += product
    soft = tree.softness * total / scalar(tree.rows)
    for i in range(tree.rows):
        k = o + tree.gram + i * tree.rows + i
        put(s, k, at(s, k) + soft)
    factorise(s, o + tree.gram, tree.rows, soft)
    solve_lower(s, o + tree.gram, o + tree.pull, tree.rows)
    solve_upper(s, o + tree.gram, o + tree.pull, tree.rows)
    for i in range(tree.rows):
        for k in range(m):
            z = at(s, o + tree.solved + i * m + k) * at(s, o + tree.pull + i)
            put(s, du + k, at(s, du + k) + z)


@wp.func
def fold(
    tree: Tree,
    hinges: wp.array(dtype=wp.vec4i),
    angles: wp.array2d(dtype=scalar),
    X: wp.array2d(dtype=vec3),
    V: wp.array2d(dtype=vec3),
    r: int,
    w: int,
):
    """Angle and rate of a crease: coordinates of the tree, or found from the nodes where it closes a loop."""
    j = tree.joint_of[r]
    o = w * tree.width
    angle = scalar(0.0)
    rate = scalar(0.0)
    if j >= 0:
        angle = at(tree.data, o + tree.start + r) + at(tree.data, o + tree.y + POSE + j)
        rate = at(tree.data, o + tree.u + tree.roots + j)
    else:
        n = hinges[r]
        g = kinematics.dihedral(X[n[0], w], X[n[1], w], X[n[2], w], X[n[3], w])
        angle = kinematics.unwrap(g.angle, angles[r, w])
        rate = wp.dot(g.gi, V[n[0], w]) + wp.dot(g.gj, V[n[1], w]) + wp.dot(g.gk, V[n[2], w]) + wp.dot(g.gl, V[n[3], w])
    return wp.vec2d(angle, rate)


@wp.func
def bend(
    tree: Tree,
    hinges: wp.array(dtype=wp.vec4i),
    X: wp.array2d(dtype=vec3),
    F: wp.array2d(dtype=vec3),
    r: int,
    w: int,
    moment: scalar,
):
    """Applies a crease's moment, at its joint or to the nodes."""
    j = tree.joint_of[r]
    if j >= 0:
        k = w * tree.width + tree.torque + j
        put(tree.data, k, at(tree.data, k) + moment)
    else:
        n = hinges[r]
        g = kinematics.dihedral(X[n[0], w], X[n[1], w], X[n[2], w], X[n[3], w])
        F[n[0], w] = F[n[0], w] + moment * g.gi
        F[n[1], w] = F[n[1], w] + moment * g.gj
        F[n[2], w] = F[n[2], w] + moment * g.gk
        F[n[3], w] = F[n[3], w] + moment * g.gl
