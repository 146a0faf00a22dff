"""A tree of rigid panels in a kernel: where its numbers lie in a world's buffer, and linear algebra on them.

What belongs to a world lies in one stretch of one buffer, so that threads share no memory; `Tree` has the places of its
parts in that stretch.
"""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings

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
    elastic: int  # 1: steps are implicit in the joints' stiffness as well
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
    # where steps are implicit in damping and stiffness: the matrix of one, the joints' moments per angle, accelerations
    # by both at the stages, the factor of the mass matrix at the step's begin, and that of the damped one
    damping: int  # [m, m]
    rigidity: int  # [J]
    damped: int  # [S, m]
    factor0: int  # [m, m]
    stiff: int  # [m, m]
    age: int  # [1] steps for which they count
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
    gram: int  # [R, R], or [m, m] if there are more constraints than rates
    pull: int  # [R] constraint forces
    found: int  # [m] accelerations by them
    # [R, 3] how far, how fast and how much faster grips have moved what loops close to, and the root, along it
    aim: int
    # where grips move: force and moment about O of all supports, what loops add to the momenta of the coordinates
    wrench: int  # [6]
    closing: int  # [m]


PARTS = tuple(
    "reference middle axis pivot start mass centre inertia steady y u y0 u0 dy du damping rigidity damped factor0 "
    "stiff age span angles0 memory0 feet feet0 power0 spent turned placed hinge joint omega speed alpha gain force "
    "moment torque heavy first second factor jacobian solved gram pull found aim wrench closing".split()
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
def along_root(tree: Tree, k: int, origin: vec3):
    """Velocity of the root's centre for a unit rate."""
    out = tree.axes[tree.roots + k]
    if tree.follows == 0:
        out = out + wp.cross(tree.axes[k], origin - tree.axes[2 * tree.roots + k])
    return out


@wp.func
def factorise(s: wp.array(dtype=scalar), first: int, m: int, least: scalar):
    """Cholesky factor of a symmetric matrix [m, m] of which the lower triangle is given, in its place.

    Its diagonal is kept as one over what it is, so that solving divides by nothing.
    """
    for i in range(m):
        for j in range(i + 1):
            x = at(s, first + i * m + j)
            for k in range(j):
                x = x - at(s, first + i * m + k) * at(s, first + j * m + k)
            if i == j:
                put(s, first + i * m + i, scalar(1.0) / wp.sqrt(wp.max(x, least)))
            else:
                put(s, first + i * m + j, x * at(s, first + j * m + j))


@wp.func
def solve_lower(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Solves with a Cholesky factor [m, m], in place."""
    for i in range(m):
        x = at(s, target + i)
        for k in range(i):
            x = x - at(s, factor + i * m + k) * at(s, target + k)
        put(s, target + i, x * at(s, factor + i * m + i))


@wp.func
def solve_upper(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Solves with a transposed Cholesky factor [m, m], in place."""
    for back in range(m):
        i = m - 1 - back
        x = at(s, target + i)
        for k in range(i + 1, m):
            x = x - at(s, factor + k * m + i) * at(s, target + k)
        put(s, target + i, x * at(s, factor + i * m + i))


@wp.func
def multiply(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Multiplies with the matrix [m, m] of a Cholesky factor, in place."""
    for i in range(m):
        x = at(s, target + i) / at(s, factor + i * m + i)
        for k in range(i + 1, m):
            x = x + at(s, factor + k * m + i) * at(s, target + k)
        put(s, target + i, x)
    for back in range(m):
        i = m - 1 - back
        x = at(s, target + i) / at(s, factor + i * m + i)
        for k in range(i):
            x = x + at(s, factor + i * m + k) * at(s, target + k)
        put(s, target + i, x)
