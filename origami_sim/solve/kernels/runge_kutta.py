"""Steps of rigid panels in a kernel: explicit Runge-Kutta of order five with an error of order four.

Dormand & Prince 1980: seven stages, of which the last is the first of the next step. A step whose error is too large is
taken back, with all that it changed.
"""

import numpy as np
import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.solve.kernels.articulated import NATURAL, POSE, STAGES, Tree, at, copy, scalar, vec3

TABLEAU = np.array(
    [
        [0, 0, 0, 0, 0, 0, 0, 0],
        [1 / 5, 1 / 5, 0, 0, 0, 0, 0, 0],
        [3 / 10, 3 / 40, 9 / 40, 0, 0, 0, 0, 0],
        [4 / 5, 44 / 45, -56 / 15, 32 / 9, 0, 0, 0, 0],
        [8 / 9, 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0, 0],
        [1, 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0, 0],
        [1, 35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0],
        [0, 71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
    ]
)
"""Times and weights of the stages, and the weights of the error (fifth less fourth order)."""


@wp.func
def step_of(tree: Tree, clock: scalar, dt: scalar, tolerance: scalar, w: int):
    """Length of the next step within one of dt, of which `clock` is over: never one that leaves a crumb."""
    left = dt - clock
    span = at(tree.data, w * tree.width + tree.span)
    if tolerance > scalar(0.0) and left > span:
        left = wp.min(span, scalar(0.5) * left)
    return left


@wp.func
def lengthen(tree: Tree, step: scalar, error: scalar, cut: int, w: int):
    """Sets the length of the next step from the error of one, over what is allowed; returns it.

    A step that was cut off by the end of a frame or a reversal says nothing against the longer ones before.
    """
    k = w * tree.width + tree.span
    factor = scalar(0.1)  # also where the error is not a number
    if error < scalar(1e20):
        factor = scalar(0.9) * wp.pow(wp.max(error, scalar(1e-6)), scalar(-0.2))
        factor = wp.clamp(factor, scalar(0.2), scalar(5.0))
    longer = step * factor
    if cut == 1:
        longer = wp.max(longer, at(tree.data, k))
    tree.data[k & NATURAL] = longer
    return longer


@wp.func
def fastest(V: wp.array2d(dtype=vec3), w: int):
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
    s = tree.data
    o = w * tree.width
    for i in range(tree.effects):
        s[(o + tree.spent + i) & NATURAL] = tree.tableau[STAGES - 1, 1] * power[i, w]
        s[(o + tree.power0 + i) & NATURAL] = power[i, w]
    copy(s, o + tree.y0, o + tree.y, POSE + tree.bodies - 1)
    copy(s, o + tree.u0, o + tree.u, tree.rates)
    for i in range(tree.hinges):
        s[(o + tree.angles0 + i) & NATURAL] = angles[i, w]
    for i in range(tree.memories):
        s[(o + tree.memory0 + i) & NATURAL] = memory[i, w]
    copy(s, o + tree.feet0, o + tree.feet, 3 * tree.feet_count)


@wp.func
def go_back(
    tree: Tree,
    angles: wp.array2d(dtype=scalar),
    memory: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar),
    w: int,
):
    """Returns to where the step began, of which the first stage is kept."""
    s = tree.data
    o = w * tree.width
    for i in range(tree.effects):
        power[i, w] = at(s, o + tree.power0 + i)
    copy(s, o + tree.y, o + tree.y0, POSE + tree.bodies - 1)
    copy(s, o + tree.u, o + tree.u0, tree.rates)
    for i in range(tree.hinges):
        angles[i, w] = at(s, o + tree.angles0 + i)
    for i in range(tree.memories):
        memory[i, w] = at(s, o + tree.memory0 + i)
    copy(s, o + tree.feet, o + tree.feet0, 3 * tree.feet_count)


@wp.func
def carry_over(tree: Tree, work: wp.array2d(dtype=scalar), step: scalar, w: int):
    """Ends a step: its last stage is the first of the next, and its work is counted."""
    s = tree.data
    o = w * tree.width
    n = POSE + tree.bodies - 1
    for i in range(tree.effects):
        work[i, w] = work[i, w] + step * at(s, o + tree.spent + i)
    copy(s, o + tree.dy, o + tree.dy + (STAGES - 1) * n, n)
    copy(s, o + tree.du, o + tree.du + (STAGES - 1) * tree.rates, tree.rates)


@wp.func
def restart(tree: Tree, angles: wp.array2d(dtype=scalar), memory: wp.array2d(dtype=scalar), n: int, w: int):
    """Moves on from the n-th of other starts, as a batch would that begins there, with what laws remember.

    Kept are that memory, and the rates before.
    """
    s = tree.data
    o = w * tree.width
    joints = tree.bodies - 1
    first = n * (tree.memories + joints)
    s[(o + tree.span) & NATURAL] = scalar(wp.inf)
    for i in range(joints):
        tree.kept[(first + tree.memories + i) & NATURAL, w] = at(s, o + tree.u + i)
        s[(o + tree.y + POSE + i) & NATURAL] = tree.starts[(2 * n * joints + i) & NATURAL, w]
        s[(o + tree.u + i) & NATURAL] = tree.starts[((2 * n + 1) * joints + i) & NATURAL, w]
    for r in range(tree.joint_of.shape[0]):
        j = tree.joint_of[r]
        if j >= 0:
            angles[r, w] = at(s, o + tree.start + r) + at(s, o + tree.y + POSE + j)
    for i in range(tree.memories):
        tree.kept[(first + i) & NATURAL, w] = memory[i, w]


@wp.func
def weighted(tree: Tree, first: int, count: int, row: int, stages: int):
    """Sum of a number's derivatives over the stages, by a row of the tableau."""
    x = scalar(0.0)
    for k in range(stages):
        x = x + tree.tableau[row, 1 + k] * at(tree.data, first + k * count)
    return x


@wp.func
def go(tree: Tree, stage: int, h: scalar, w: int):
    """Coordinates and rates at a stage of a step of h."""
    s = tree.data
    o = w * tree.width
    n = POSE + tree.bodies - 1
    for i in range(tree.first_number, n):
        s[(o + tree.y + i) & NATURAL] = at(s, o + tree.y0 + i) + h * weighted(tree, o + tree.dy + i, n, stage, stage)
    m = tree.rates
    for i in range(m):
        s[(o + tree.u + i) & NATURAL] = at(s, o + tree.u0 + i) + h * weighted(tree, o + tree.du + i, m, stage, stage)
    if stage == STAGES - 1:
        k = o + tree.y + 3
        q = wp.normalize(wp.quatd(at(s, k), at(s, k + 1), at(s, k + 2), at(s, k + 3)))
        for i in range(4):
            s[(k + i) & NATURAL] = q[i]


@wp.func
def error_of(tree: Tree, h: scalar, size: scalar, w: int):
    """Largest error of a step of h, in radians (shifts of the root over the device's size), by the embedded formula.

    An error of a rate counts as much as it turns within the step.
    """
    o = w * tree.width
    n = POSE + tree.bodies - 1
    worst = scalar(0.0)
    for i in range(tree.first_number, n):
        x = wp.abs(h * weighted(tree, o + tree.dy + i, n, STAGES, STAGES))
        if i < 3:
            x = x / size
        worst = larger(worst, x)
    m = tree.rates
    for i in range(m):
        x = wp.abs(h * h * weighted(tree, o + tree.du + i, m, STAGES, STAGES))
        if i < tree.roots:
            if wp.dot(tree.axes[i], tree.axes[i]) == scalar(0.0):
                x = x / size
        worst = larger(worst, x)
    return worst


@wp.func
def reversal(tree: Tree, h: scalar, tolerance: scalar, w: int):
    """When a hinge reverses within a step of h, by its rates, if it turns forth and back by more than it may be off.

    Laws with memory are told by how much a hinge has turned since the step's begin, so a step has to end there.
    Infinite if none does; what is left after a step to there falls with the fourth power of h.
    """
    most = tolerance
    when = scalar(wp.inf)
    for i in range(tree.roots, tree.rates):
        before = at(tree.data, w * tree.width + tree.u0 + i)
        after = at(tree.data, w * tree.width + tree.u + i)
        if before * after < scalar(0.0):
            part = before / (before - after)
            least = wp.min(part, scalar(1.0) - part)
            lost = scalar(0.5) * h * wp.abs(before - after) * least * least
            if lost > most:
                most = lost
                when = h * part
    return when


@wp.func
def larger(a: scalar, b: scalar):
    """The larger of two numbers; not a number if one is none."""
    out = a
    if a == a and not (b <= a):
        out = b
    return out
