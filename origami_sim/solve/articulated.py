"""Rigid panels on hinges in a kernel: forward kinematics, mass matrix, accelerations, Dormand-Prince steps.

The panels form a tree. Its coordinates are the pose of the root panel, as far as that can move, and one angle for each
crease of the tree. Bodies are numbered from the root outwards, joint b - 1 carries body b. All velocities and moments
are taken about the origin O, the root's centre at that instant, in the axes of the world; composite inertias are then
plain sums (Featherstone 2008, chapters 6 and 8). Loops are closed by constraint forces.
"""

import warp as wp

from origami_sim import _warp, kinematics  # noqa: F401  settings

scalar = wp.float64
vec3 = wp.vec3d
mat33 = wp.mat33d

POSE = wp.constant(7)
"""Numbers of the root's pose before the joint angles: place of its centre, then a unit quaternion."""

STAGES = wp.constant(7)
"""Stages of a step; the last is the first of the next."""


@wp.struct
class Tree:
    """Topology, bodies and coordinates of W worlds; arrays [rows, W] unless stated.

    B bodies, J = B - 1 joints, d rates of the root, m = d + J rates in all, R constraint rows.
    """

    # topology, without a world
    parent: wp.array(dtype=wp.int32)  # [B]
    body_of: wp.array(dtype=wp.int32)  # [N] body that carries a node
    joint_of: wp.array(dtype=wp.int32)  # [C] joint of a crease, -1 where it closes a loop
    root_turn: wp.array(dtype=vec3)  # [d] angular velocity of the root for unit rates
    root_shift: wp.array(dtype=vec3)  # [d] velocity of its centre besides
    root_pivot: wp.array(dtype=vec3)  # [d] point about which it turns, where that does not move with it
    root_follows: int  # 1: it turns about its own centre
    row_node: wp.array(dtype=wp.int32)  # [R] node at which bodies are joined
    row_body: wp.array2d(dtype=wp.int32)  # [R, 2] the bodies; -1: the ground
    row_axis: wp.array(dtype=vec3)  # [R] direction in which they are
    stabilisation: scalar  # rate at which an open loop closes [1/s]
    softness: scalar  # of the constraints, relative to their mean mobility: which of redundant ones bear the load
    tableau: wp.array2d(dtype=scalar)  # [STAGES + 1, STAGES + 1] time, then weights; the last row is the error's
    # bodies
    reference: wp.array2d(dtype=vec3)  # [N, W]
    root_centre: wp.array2d(dtype=vec3)  # [1, W]
    axis: wp.array2d(dtype=vec3)  # [J, W]
    pivot: wp.array2d(dtype=vec3)  # [J, W]
    start: wp.array2d(dtype=scalar)  # [C, W] crease angles in the reference state
    mass: wp.array2d(dtype=scalar)  # [B, W]
    centre: wp.array2d(dtype=vec3)  # [B, W]
    inertia: wp.array2d(dtype=mat33)  # [B, W] about the centre
    # coordinates and rates, now and at the step's begin; derivatives at the stages
    y: wp.array2d(dtype=scalar)  # [7 + J, W]
    u: wp.array2d(dtype=scalar)  # [m, W]
    y0: wp.array2d(dtype=scalar)
    u0: wp.array2d(dtype=scalar)
    dy: wp.array2d(dtype=scalar)  # [STAGES (7 + J), W]
    du: wp.array2d(dtype=scalar)  # [STAGES m, W]
    span: wp.array2d(dtype=scalar)  # [1, W] length of the next step
    # what a step changes besides, to go back to: crease angles, memory, contact points
    angles0: wp.array2d(dtype=scalar)
    memory0: wp.array2d(dtype=scalar)
    feet: wp.array2d(dtype=vec3)  # [K, W] contact points at the step's begin
    feet0: wp.array2d(dtype=vec3)
    power0: wp.array2d(dtype=scalar)  # [E, W]
    spent: wp.array2d(dtype=scalar)  # [E, W] mean power of each effect in a step, by the weights of its stages
    # of one evaluation
    turned: wp.array2d(dtype=mat33)  # [B, W]
    placed: wp.array2d(dtype=vec3)  # [B, W] x = turned reference + placed
    hinge: wp.array2d(dtype=vec3)  # [J, W] axis now
    joint: wp.array2d(dtype=vec3)  # [J, W] pivot now, from O
    omega: wp.array2d(dtype=vec3)  # [B, W]
    speed: wp.array2d(dtype=vec3)  # [B, W] velocity at O
    alpha: wp.array2d(dtype=vec3)  # [B, W] accelerations if rates did not change
    gain: wp.array2d(dtype=vec3)  # [B, W] the same of the body's point at O
    force: wp.array2d(dtype=vec3)  # [B, W]
    moment: wp.array2d(dtype=vec3)  # [B, W] about O
    torque: wp.array2d(dtype=scalar)  # [J, W]
    heavy: wp.array2d(dtype=scalar)  # [B, W] composite mass, first moment, second moment about O
    first: wp.array2d(dtype=vec3)
    second: wp.array2d(dtype=mat33)
    factor: wp.array2d(dtype=scalar)  # [m m, W] mass matrix, then its Cholesky factor
    rows: wp.array2d(dtype=scalar)  # [R m, W] Jacobian of the constraints
    solved: wp.array2d(dtype=scalar)  # [R m, W] its product with the inverse factor
    gram: wp.array2d(dtype=scalar)  # [R R, W]
    pull: wp.array2d(dtype=scalar)  # [R, W] constraint forces


@wp.func
def outer_inertia(mass: scalar, r: vec3):
    """Inertia about the origin of a point mass at r."""
    return mass * (wp.dot(r, r) * wp.identity(n=3, dtype=scalar) - wp.outer(r, r))


@wp.func
def skewed(axis: vec3, angle: scalar):
    """Rotation by an angle about a unit axis (Rodrigues)."""
    s = wp.sin(angle)
    c = scalar(1.0) - wp.cos(angle)
    k = wp.skew(axis)
    return wp.identity(n=3, dtype=scalar) + s * k + c * (k * k)


@wp.func
def pose(tree: Tree, X: wp.array2d(dtype=vec3), V: wp.array2d(dtype=vec3), F: wp.array2d(dtype=vec3), w: int):
    """Places and velocities of all nodes from coordinates and rates; clears what forces are added to."""
    bodies = tree.parent.shape[0]
    roots = tree.root_turn.shape[0]
    zero = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    origin = vec3(tree.y[0, w], tree.y[1, w], tree.y[2, w])
    q = wp.quatd(tree.y[3, w], tree.y[4, w], tree.y[5, w], tree.y[6, w])
    turn = wp.quat_to_matrix(wp.normalize(q))
    tree.turned[0, w] = turn
    tree.placed[0, w] = origin - turn * tree.root_centre[0, w]
    omega = zero
    speed = zero
    for k in range(roots):
        rate = tree.u[k, w]
        omega = omega + rate * tree.root_turn[k]
        speed = speed + rate * tree.root_shift[k]
        if tree.root_follows == 0:
            speed = speed + rate * wp.cross(tree.root_turn[k], origin - tree.root_pivot[k])
    gain = zero
    if tree.root_follows == 0:
        gain = wp.cross(omega, speed)
    tree.omega[0, w] = omega
    tree.speed[0, w] = speed
    tree.alpha[0, w] = zero
    tree.gain[0, w] = gain
    tree.force[0, w] = zero
    tree.moment[0, w] = zero
    for b in range(1, bodies):
        p = tree.parent[b]
        j = b - 1
        up = tree.turned[p, w]
        a = up * tree.axis[j, w]
        at = up * tree.pivot[j, w] + tree.placed[p, w]
        own = up * skewed(tree.axis[j, w], tree.y[POSE + j, w])
        tree.turned[b, w] = own
        tree.placed[b, w] = at - own * tree.pivot[j, w]
        r = at - origin
        rate = tree.u[roots + j, w]
        before = tree.omega[p, w]
        now = before + rate * a
        tree.hinge[j, w] = a
        tree.joint[j, w] = r
        tree.omega[b, w] = now
        tree.speed[b, w] = tree.speed[p, w] - rate * wp.cross(a, r)
        swing = tree.alpha[p, w] + rate * wp.cross(before, a)
        tree.alpha[b, w] = swing
        # both bodies accelerate alike at the pivot
        there = tree.gain[p, w] + wp.cross(tree.alpha[p, w], r) + wp.cross(before, wp.cross(before, r))
        tree.gain[b, w] = there - wp.cross(swing, r) - wp.cross(now, wp.cross(now, r))
        tree.torque[j, w] = scalar(0.0)
        tree.force[b, w] = zero
        tree.moment[b, w] = zero
    for n in range(X.shape[0]):
        b = tree.body_of[n]
        x = tree.turned[b, w] * tree.reference[n, w] + tree.placed[b, w]
        X[n, w] = x
        V[n, w] = tree.speed[b, w] + wp.cross(tree.omega[b, w], x - origin)
        F[n, w] = zero


@wp.func
def along_joint(tree: Tree, j: int, w: int):
    """Velocity at O for a unit rate of a joint."""
    return wp.cross(tree.joint[j, w], tree.hinge[j, w])


@wp.func
def along_root(tree: Tree, k: int, origin: vec3):
    """Velocity of the root's centre for a unit rate."""
    out = tree.root_shift[k]
    if tree.root_follows == 0:
        out = out + wp.cross(tree.root_turn[k], origin - tree.root_pivot[k])
    return out


@wp.func
def add_rows(tree: Tree, row: int, body: int, sign: scalar, r: vec3, axis: vec3, m: int, roots: int, w: int):
    """Adds to a constraint's row the velocity of a body's point at r along an axis, for unit rates."""
    b = body
    while b > 0:
        j = b - 1
        k = row * m + roots + j
        tree.rows[k, w] = tree.rows[k, w] + sign * wp.dot(axis, wp.cross(tree.hinge[j, w], r - tree.joint[j, w]))
        b = tree.parent[b]
    origin = vec3(tree.y[0, w], tree.y[1, w], tree.y[2, w])
    for k in range(roots):
        by = along_root(tree, k, origin) + wp.cross(tree.root_turn[k], r)
        tree.rows[row * m + k, w] = tree.rows[row * m + k, w] + sign * wp.dot(axis, by)


@wp.func
def body_place(tree: Tree, body: int, n: int, w: int):
    """Where a body, or the ground, has a node."""
    out = tree.reference[n, w]
    if body >= 0:
        out = tree.turned[body, w] * tree.reference[n, w] + tree.placed[body, w]
    return out


@wp.func
def acceleration(tree: Tree, body: int, r: vec3, w: int):
    """Acceleration of a body's point at r from O if no rate changed; the ground has none."""
    out = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
    if body >= 0:
        o = tree.omega[body, w]
        out = tree.gain[body, w] + wp.cross(tree.alpha[body, w], r) + wp.cross(o, wp.cross(o, r))
    return out


@wp.func
def constrain(tree: Tree, stage: int, m: int, roots: int, w: int):
    """Adds the forces that keep loops closed to the half-solved accelerations of the open tree.

    With M = L L^T, S = J L^-T: (S S^T + soft) pull = -(bias + 2 c rate + c^2 gap + S z), z += S^T pull (Baumgarte).
    """
    count = tree.row_node.shape[0]
    origin = vec3(tree.y[0, w], tree.y[1, w], tree.y[2, w])
    total = scalar(0.0)
    for i in range(count):
        for k in range(m):
            tree.rows[i * m + k, w] = scalar(0.0)
        one = tree.row_body[i, 0]
        other = tree.row_body[i, 1]
        axis = tree.row_axis[i]
        x = body_place(tree, one, tree.row_node[i], w)
        r = x - origin
        add_rows(tree, i, one, scalar(1.0), r, axis, m, roots, w)
        if other >= 0:
            add_rows(tree, i, other, scalar(-1.0), r, axis, m, roots, w)
        gap = wp.dot(axis, x - body_place(tree, other, tree.row_node[i], w))
        rate = scalar(0.0)
        for k in range(m):
            by = tree.rows[i * m + k, w]
            rate = rate + by * tree.u[k, w]
            tree.solved[i * m + k, w] = by
        bias = wp.dot(axis, acceleration(tree, one, r, w) - acceleration(tree, other, r, w))
        solve_lower(tree, tree.solved, i * m, m, w)
        c = tree.stabilisation
        right = -(bias + scalar(2.0) * c * rate + c * c * gap)
        for k in range(m):
            right = right - tree.solved[i * m + k, w] * tree.du[stage * m + k, w]
        tree.pull[i, w] = right
        for j in range(i + 1):
            s = scalar(0.0)
            for k in range(m):
                s = s + tree.solved[i * m + k, w] * tree.solved[j * m + k, w]
            tree.gram[i * count + j, w] = s
            if i == j:
                total = total + s
    soft = tree.softness * total / scalar(count)
    for i in range(count):  # Cholesky, as in `factorise`
        for j in range(i + 1):
            s = tree.gram[i * count + j, w]
            if i == j:
                s = s + soft
            for k in range(j):
                s = s - tree.gram[i * count + k, w] * tree.gram[j * count + k, w]
            if i == j:
                tree.gram[i * count + i, w] = wp.sqrt(wp.max(s, soft))
            else:
                tree.gram[i * count + j, w] = s / tree.gram[j * count + j, w]
    for i in range(count):
        s = tree.pull[i, w]
        for k in range(i):
            s = s - tree.gram[i * count + k, w] * tree.pull[k, w]
        tree.pull[i, w] = s / tree.gram[i * count + i, w]
    for back in range(count):
        i = count - 1 - back
        s = tree.pull[i, w]
        for k in range(i + 1, count):
            s = s - tree.gram[k * count + i, w] * tree.pull[k, w]
        tree.pull[i, w] = s / tree.gram[i * count + i, w]
    for i in range(count):
        for k in range(m):
            z = tree.solved[i * m + k, w] * tree.pull[i, w]
            tree.du[stage * m + k, w] = tree.du[stage * m + k, w] + z


@wp.func
def accelerate(tree: Tree, F: wp.array2d(dtype=vec3), X: wp.array2d(dtype=vec3), stage: int, w: int):
    """Derivatives of coordinates and rates at a stage, from the forces on nodes and the moments at joints."""
    bodies = tree.parent.shape[0]
    joints = bodies - 1
    roots = tree.root_turn.shape[0]
    m = roots + joints
    origin = vec3(tree.y[0, w], tree.y[1, w], tree.y[2, w])
    for k in range(m * m):
        tree.factor[k, w] = scalar(0.0)
    for n in range(X.shape[0]):
        b = tree.body_of[n]
        f = F[n, w]
        tree.force[b, w] = tree.force[b, w] + f
        tree.moment[b, w] = tree.moment[b, w] + wp.cross(X[n, w] - origin, f)
    for b in range(bodies):
        turn = tree.turned[b, w]
        c = turn * tree.centre[b, w] + tree.placed[b, w] - origin
        mass = tree.mass[b, w]
        own = turn * tree.inertia[b, w] * wp.transpose(turn)
        o = tree.omega[b, w]
        a = tree.gain[b, w] + wp.cross(tree.alpha[b, w], c) + wp.cross(o, wp.cross(o, c))
        tree.force[b, w] = tree.force[b, w] - mass * a
        spin = own * tree.alpha[b, w] + wp.cross(o, own * o)
        tree.moment[b, w] = tree.moment[b, w] - mass * wp.cross(c, a) - spin
        tree.heavy[b, w] = mass
        tree.first[b, w] = mass * c
        tree.second[b, w] = own + outer_inertia(mass, c)
    # towards the root: what a joint carries is the sum of all beyond it
    for back in range(joints):
        b = joints - back
        j = b - 1
        p = tree.parent[b]
        a = tree.hinge[j, w]
        s = along_joint(tree, j, w)
        k = roots + j
        tree.du[stage * m + k, w] = (
            tree.torque[j, w] + wp.dot(a, tree.moment[b, w]) + wp.dot(s, tree.force[b, w])
        )
        momentum = tree.heavy[b, w] * s + wp.cross(a, tree.first[b, w])
        angular = wp.cross(tree.first[b, w], s) + tree.second[b, w] * a
        i = b
        while i > 0:
            by = wp.dot(tree.hinge[i - 1, w], angular) + wp.dot(along_joint(tree, i - 1, w), momentum)
            tree.factor[k * m + roots + i - 1, w] = by
            tree.factor[(roots + i - 1) * m + k, w] = by
            i = tree.parent[i]
        for r in range(roots):
            by = wp.dot(tree.root_turn[r], angular) + wp.dot(along_root(tree, r, origin), momentum)
            tree.factor[k * m + r, w] = by
            tree.factor[r * m + k, w] = by
        tree.force[p, w] = tree.force[p, w] + tree.force[b, w]
        tree.moment[p, w] = tree.moment[p, w] + tree.moment[b, w]
        tree.heavy[p, w] = tree.heavy[p, w] + tree.heavy[b, w]
        tree.first[p, w] = tree.first[p, w] + tree.first[b, w]
        tree.second[p, w] = tree.second[p, w] + tree.second[b, w]
    for k in range(roots):
        s = along_root(tree, k, origin)
        a = tree.root_turn[k]
        tree.du[stage * m + k, w] = wp.dot(a, tree.moment[0, w]) + wp.dot(s, tree.force[0, w])
        momentum = tree.heavy[0, w] * s + wp.cross(a, tree.first[0, w])
        angular = wp.cross(tree.first[0, w], s) + tree.second[0, w] * a
        for r in range(k + 1):
            by = wp.dot(tree.root_turn[r], angular) + wp.dot(along_root(tree, r, origin), momentum)
            tree.factor[k * m + r, w] = by
            tree.factor[r * m + k, w] = by
    factorise(tree, m, w)
    solve_lower(tree, tree.du, stage * m, m, w)
    if tree.row_node.shape[0] > 0:
        constrain(tree, stage, m, roots, w)
    solve_upper(tree, tree.du, stage * m, m, w)
    # rates of the coordinates
    first = stage * (POSE + joints)
    v = tree.speed[0, w]
    o = tree.omega[0, w]
    half = scalar(0.5)
    qx = tree.y[3, w]
    qy = tree.y[4, w]
    qz = tree.y[5, w]
    qw = tree.y[6, w]
    for i in range(3):
        tree.dy[first + i, w] = v[i]
    tree.dy[first + 3, w] = half * (qw * o[0] + o[1] * qz - o[2] * qy)
    tree.dy[first + 4, w] = half * (qw * o[1] + o[2] * qx - o[0] * qz)
    tree.dy[first + 5, w] = half * (qw * o[2] + o[0] * qy - o[1] * qx)
    tree.dy[first + 6, w] = -half * (qx * o[0] + qy * o[1] + qz * o[2])
    for j in range(joints):
        tree.dy[first + POSE + j, w] = tree.u[roots + j, w]


@wp.func
def factorise(tree: Tree, m: int, w: int):
    """Cholesky factor of the mass matrix, in its lower triangle; joints of separate branches have no entry."""
    for i in range(m):
        for j in range(i + 1):
            s = tree.factor[i * m + j, w]
            for k in range(j):
                s = s - tree.factor[i * m + k, w] * tree.factor[j * m + k, w]
            if i == j:
                tree.factor[i * m + i, w] = wp.sqrt(s)
            else:
                tree.factor[i * m + j, w] = s / tree.factor[j * m + j, w]


@wp.func
def solve_lower(tree: Tree, target: wp.array2d(dtype=scalar), first: int, m: int, w: int):
    """Solves with the factor, in place."""
    for i in range(m):
        s = target[first + i, w]
        for k in range(i):
            s = s - tree.factor[i * m + k, w] * target[first + k, w]
        target[first + i, w] = s / tree.factor[i * m + i, w]


@wp.func
def solve_upper(tree: Tree, target: wp.array2d(dtype=scalar), first: int, m: int, w: int):
    """Solves with the transposed factor, in place."""
    for back in range(m):
        i = m - 1 - back
        s = target[first + i, w]
        for k in range(i + 1, m):
            s = s - tree.factor[k * m + i, w] * target[first + k, w]
        target[first + i, w] = s / tree.factor[i * m + i, w]


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
    angle = scalar(0.0)
    rate = scalar(0.0)
    if j >= 0:
        angle = tree.start[r, w] + tree.y[POSE + j, w]
        rate = tree.u[tree.root_turn.shape[0] + j, w]
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
        tree.torque[j, w] = tree.torque[j, w] + moment
    else:
        n = hinges[r]
        g = kinematics.dihedral(X[n[0], w], X[n[1], w], X[n[2], w], X[n[3], w])
        F[n[0], w] = F[n[0], w] + moment * g.gi
        F[n[1], w] = F[n[1], w] + moment * g.gj
        F[n[2], w] = F[n[2], w] + moment * g.gk
        F[n[3], w] = F[n[3], w] + moment * g.gl


@wp.func
def next_step(step: scalar, error: scalar):
    """Length of the next step from that of a step of order five and its error over what is allowed."""
    factor = scalar(0.1)  # also where the error is not a number
    if error < scalar(1e20):
        factor = scalar(0.9) * wp.pow(wp.max(error, scalar(1e-6)), scalar(-0.2))
        factor = wp.clamp(factor, scalar(0.2), scalar(5.0))
    return step * factor


@wp.func
def fastest(tree: Tree, V: wp.array2d(dtype=vec3), w: int):
    """The node that moves fastest, or that has no number for a velocity."""
    out = int(0)
    most = scalar(-1.0)
    for n in range(V.shape[0]):
        speed = wp.dot(V[n, w], V[n, w])
        if not (speed <= most):
            most = speed
            out = n
    return out


@wp.func
def begin(
    tree: Tree,
    angles: wp.array2d(dtype=scalar),
    memory: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar),
    w: int,
):
    """Remembers where a step begins; its last stage was the first of this one."""
    for i in range(tree.spent.shape[0]):
        tree.spent[i, w] = tree.tableau[STAGES - 1, 1] * power[i, w]
        tree.power0[i, w] = power[i, w]
    for i in range(tree.y0.shape[0]):
        tree.y0[i, w] = tree.y[i, w]
    for i in range(tree.u0.shape[0]):
        tree.u0[i, w] = tree.u[i, w]
    for i in range(tree.angles0.shape[0]):
        tree.angles0[i, w] = angles[i, w]
    for i in range(tree.memory0.shape[0]):
        tree.memory0[i, w] = memory[i, w]
    for i in range(tree.feet0.shape[0]):
        tree.feet0[i, w] = tree.feet[i, w]


@wp.func
def go_back(
    tree: Tree,
    angles: wp.array2d(dtype=scalar),
    memory: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar),
    w: int,
):
    """Returns to where the step began, of which the first stage is kept."""
    for i in range(tree.spent.shape[0]):
        power[i, w] = tree.power0[i, w]
    for i in range(tree.y0.shape[0]):
        tree.y[i, w] = tree.y0[i, w]
    for i in range(tree.u0.shape[0]):
        tree.u[i, w] = tree.u0[i, w]
    for i in range(tree.angles0.shape[0]):
        angles[i, w] = tree.angles0[i, w]
    for i in range(tree.memory0.shape[0]):
        memory[i, w] = tree.memory0[i, w]
    for i in range(tree.feet0.shape[0]):
        tree.feet[i, w] = tree.feet0[i, w]


@wp.func
def carry_over(tree: Tree, work: wp.array2d(dtype=scalar), step: scalar, w: int):
    """Ends a step: its last stage is the first of the next, and its work is counted."""
    for i in range(tree.spent.shape[0]):
        work[i, w] = work[i, w] + step * tree.spent[i, w]
    last = STAGES - 1
    n = tree.y0.shape[0]
    for i in range(n):
        tree.dy[i, w] = tree.dy[last * n + i, w]
    m = tree.u0.shape[0]
    for i in range(m):
        tree.du[i, w] = tree.du[last * m + i, w]


@wp.func
def go(tree: Tree, stage: int, h: scalar, w: int):
    """Coordinates and rates at a stage of a step of h."""
    n = tree.y0.shape[0]
    for i in range(n):
        s = scalar(0.0)
        for k in range(stage):
            s = s + tree.tableau[stage, 1 + k] * tree.dy[k * n + i, w]
        tree.y[i, w] = tree.y0[i, w] + h * s
    m = tree.u0.shape[0]
    for i in range(m):
        s = scalar(0.0)
        for k in range(stage):
            s = s + tree.tableau[stage, 1 + k] * tree.du[k * m + i, w]
        tree.u[i, w] = tree.u0[i, w] + h * s
    if stage == STAGES - 1:
        q = wp.normalize(wp.quatd(tree.y[3, w], tree.y[4, w], tree.y[5, w], tree.y[6, w]))
        for i in range(4):
            tree.y[3 + i, w] = q[i]


@wp.func
def error_of(tree: Tree, h: scalar, size: scalar, w: int):
    """Largest error of a step of h, in radians (shifts of the root over the device's size), by the embedded formula.

    An error of a rate counts as much as it turns within the step.
    """
    n = tree.y0.shape[0]
    worst = scalar(0.0)
    for i in range(n):
        s = scalar(0.0)
        for k in range(STAGES):
            s = s + tree.tableau[STAGES, 1 + k] * tree.dy[k * n + i, w]
        s = wp.abs(h * s)
        if i < 3:
            s = s / size
        worst = wp.max(worst, s)
    m = tree.u0.shape[0]
    for i in range(m):
        s = scalar(0.0)
        for k in range(STAGES):
            s = s + tree.tableau[STAGES, 1 + k] * tree.du[k * m + i, w]
        s = wp.abs(h * h * s)
        if i < tree.root_turn.shape[0]:
            if wp.dot(tree.root_turn[i], tree.root_turn[i]) == scalar(0.0):
                s = s / size
        worst = wp.max(worst, s)
    return worst
