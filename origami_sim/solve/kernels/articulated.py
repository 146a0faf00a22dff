"""Rigid panels on hinges in a kernel: forward kinematics, mass matrix, accelerations, closed loops.

The panels form a tree. Its coordinates are the pose of the root panel, as far as that can move, and one angle for each
crease of the tree. Bodies are numbered from the root outwards, joint b - 1 carries body b. All velocities and moments
are taken about the origin O, the root's centre at that instant, in the axes of the world; composite inertias are then
plain sums (Featherstone 2008, chapters 6 and 8). Loops are closed by constraint forces (`loops`).
"""

import warp as wp

from origami_sim.physics import kinematics
from origami_sim.solve.kernels.loops import constrain
from origami_sim.solve.kernels.tree import (
    NATURAL,
    POSE,
    Tree,
    along_root,
    at,
    copy,
    factorise,
    mat33,
    mat_at,
    put,
    put_mat,
    put_vec,
    scalar,
    solve_lower,
    solve_upper,
    vec3,
    vec_at,
)


@wp.func
def outer_inertia(mass: scalar, r: vec3):
    """Inertia about the origin of a point mass at r."""
    return mass * (wp.dot(r, r) * wp.identity(n=3, dtype=scalar) - wp.outer(r, r))


@wp.func
def rotation(axis: vec3, angle: scalar):
    """Rotation by an angle about a unit axis (Rodrigues)."""
    c = wp.cos(angle)
    turn = wp.sin(angle) * axis
    return (
        c * wp.identity(n=3, dtype=scalar)
        + mat33(scalar(0.0), -turn[2], turn[1], turn[2], scalar(0.0), -turn[0], -turn[1], turn[0], scalar(0.0))
        + (scalar(1.0) - c) * wp.outer(axis, axis)
    )


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
    pose_root(tree, w)
    pose_rest(tree, w)


@wp.func
def pose_root(tree: Tree, w: int):
    """Place and velocity of the root alone."""
    s = tree.data
    o = w * tree.width
    zero = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    origin = vec_at(s, o + tree.y)
    if tree.first_body == 0:  # a root that is held stays where it is
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


@wp.func
def pose_rest(tree: Tree, w: int):
    """Places and velocities of what the root carries."""
    s = tree.data
    o = w * tree.width
    zero = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    origin = vec_at(s, o + tree.y)
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
