"""Steps of rigid panels in a kernel: Runge-Kutta of order five with an error of order four.

Explicit (Dormand & Prince 1980), or implicit in the damping and the stiffness of joints where these would bound the
steps (Kennedy & Carpenter 2003). The last stage is the first of the next step. A step whose error is too large is taken
back, with all that it changed.
"""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.solve.kernels.tree import (
    NATURAL,
    POSE,
    Tree,
    at,
    copy,
    factorise,
    multiply,
    put,
    scalar,
    solve_lower,
    solve_upper,
    vec3,
)

PROBE = wp.constant(wp.float64(1e-6))
"""Change of a rate [rad/s], or of a speed over the device's size, from which damping is told; of angles, stiffness.

A crawler takes as long, and goes as far to nine digits, with a hundredth to a hundred times of it.
"""

LASTS = wp.constant(wp.float64(16.0))
"""Steps for which damping and stiffness count as they were found; a step that fails has them found anew.

A chain of twelve damped cells takes 1.03 times as long with half of it and 0.97 times with double: finding them costs
as much as two steps.
"""


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
    put(tree.data, k, longer)
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
        put(s, o + tree.spent + i, at(tree.tableau, (tree.stages - 1) * (tree.stages + 1) + 1) * power[i, w])
        put(s, o + tree.power0 + i, power[i, w])
    copy(s, o + tree.y0, o + tree.y, POSE + tree.bodies - 1)
    copy(s, o + tree.u0, o + tree.u, tree.rates)
    for i in range(tree.hinges):
        put(s, o + tree.angles0 + i, angles[i, w])
    for i in range(tree.memories):
        put(s, o + tree.memory0 + i, memory[i, w])
    copy(s, o + tree.feet0, o + tree.feet, 3 * tree.feet_count)


@wp.func
def is_stale(tree: Tree, w: int):
    """Whether damping and stiffness are to be found before this step; counts the steps since they were."""
    k = w * tree.width + tree.age
    left = at(tree.data, k)
    put(tree.data, k, wp.where(left > scalar(0.0), left - scalar(1.0), LASTS))
    return not (left > scalar(0.0))


@wp.func
def doubt(tree: Tree, w: int):
    """Has damping and stiffness found before the next step."""
    if tree.implicit.shape[0] > 0:
        put(tree.data, w * tree.width + tree.age, scalar(0.0))


@wp.func
def nudge_of(tree: Tree, k: int, size: scalar):
    """By how much a rate is changed to see what it is damped with: far more than rounding, far less than it matters."""
    nudge = PROBE
    if k < tree.roots:
        if wp.dot(tree.axes[k], tree.axes[k]) == scalar(0.0):
            nudge = PROBE * size
    return nudge


@wp.func
def probe(tree: Tree, k: int, size: scalar, w: int):
    """Changes a rate at a step's begin a little; the last but one changes none, and the last all angles of joints."""
    s = tree.data
    o = w * tree.width
    copy(s, o + tree.u, o + tree.u0, tree.rates)
    copy(s, o + tree.y, o + tree.y0, POSE + tree.bodies - 1)
    if k > tree.rates:
        for j in range(tree.bodies - 1):
            put(s, o + tree.y + POSE + j, at(s, o + tree.y0 + POSE + j) + PROBE)
    elif k < tree.rates:
        put(s, o + tree.u + k, at(s, o + tree.u0 + k) + nudge_of(tree, k, size))


@wp.func
def probed(tree: Tree, k: int, size: scalar, w: int):
    """Column of the damping matrix: the momentum that is lost by a rate, from the change of accelerations.

    Those without any change come before: they are not the last stage's, before which laws remembered less. First of all
    come the stiffnesses of joints, each of which feels its own angle alone; a joint that tips over has none.
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    change = o + tree.du + tree.stages * m
    if k > m:
        copy(s, o + tree.rigidity, o + tree.torque, tree.bodies - 1)
    elif k == m:
        copy(s, o + tree.damped, change, m)
        for j in range(tree.bodies - 1):
            slope = (at(s, o + tree.torque + j) - at(s, o + tree.rigidity + j)) / PROBE
            put(s, o + tree.rigidity + j, wp.max(slope, scalar(0.0)) * scalar(tree.elastic))
    else:
        nudge = nudge_of(tree, k, size)
        for i in range(m):
            put(s, change + i, (at(s, o + tree.damped + i) - at(s, change + i)) / nudge)
        multiply(s, o + tree.factor0, change, m)
        for i in range(m):
            put(s, o + tree.damping + i * m + k, at(s, change + i))


@wp.func
def begin_damped(tree: Tree, step: scalar, w: int):
    """Accelerations by damping at a step's begin, and the factor by which stages find their own.

    Both are of the mass matrix there and of the damping's symmetric part and stiffness, often of an earlier step: what
    they leave out is explicit, so that the order stays. A step for which the matrix is not positive definite has no
    number as error.
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    stiff = o + tree.stiff
    part = step * tree.implicit[1, 1]
    for i in range(m):
        lost = scalar(0.0)
        for j in range(m):
            c = scalar(0.5) * (at(s, o + tree.damping + i * m + j) + at(s, o + tree.damping + j * m + i))
            lost = lost + c * at(s, o + tree.u0 + j)
            if j <= i:
                x = part * c
                if i == j and i >= tree.roots:
                    x = x + part * part * at(s, o + tree.rigidity + i - tree.roots)
                for k in range(j):
                    x = x + at(s, o + tree.factor0 + i * m + k) * at(s, o + tree.factor0 + j * m + k)
                last = at(s, o + tree.factor0 + i * m + j)
                if i == j:
                    last = scalar(1.0) / last
                x = x + last / at(s, o + tree.factor0 + j * m + j)
                put(s, stiff + i * m + j, x)
        put(s, o + tree.damped + i, -lost)
    solve_lower(s, o + tree.factor0, o + tree.damped, m)
    solve_upper(s, o + tree.factor0, o + tree.damped, m)
    factorise(s, stiff, m, scalar(0.0))


@wp.func
def slow_down(tree: Tree, rates: int, turned: int, h: scalar, w: int):
    """Rates r and turned angles q of joints as damping and stiffness leave them in a stage of a step of h, in place.

    These are u with (M + a h C + a^2 h^2 K) u = M r - a h K q, and q + a h u.
    """
    s = tree.data
    o = w * tree.width
    part = h * tree.implicit[1, 1]
    joints = tree.bodies - 1
    multiply(s, o + tree.factor0, rates, tree.rates)
    for j in range(joints):
        i = rates + tree.roots + j
        put(s, i, at(s, i) - part * at(s, o + tree.rigidity + j) * at(s, turned + j))
    solve_lower(s, o + tree.stiff, rates, tree.rates)
    solve_upper(s, o + tree.stiff, rates, tree.rates)
    for j in range(joints):
        put(s, turned + j, at(s, turned + j) + part * at(s, rates + tree.roots + j))


@wp.func
def damp(tree: Tree, stage: int, h: scalar, w: int):
    """Rates and angles of joints at a stage of a step of h with the joints' damping and stiffness, implicitly.

    With M = L L^T: of rates r and turned angles q without the stage's own damped acceleration (u - r) / (a h) and rate
    u, see `slow_down`.
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    u = o + tree.u
    mine = o + tree.damped + stage * m
    angle = o + tree.y + POSE
    begun = o + tree.y0 + POSE
    n = POSE + tree.bodies - 1
    for i in range(m):
        x = scalar(0.0)
        for k in range(stage):
            x = x + tree.implicit[stage, k] * at(s, o + tree.damped + k * m + i)
        put(s, u + i, at(s, u + i) + h * x)
    for j in range(tree.bodies - 1):
        x = scalar(0.0)
        for k in range(stage):
            x = x + tree.implicit[stage, k] * at(s, o + tree.dy + k * n + POSE + j)
        put(s, angle + j, at(s, angle + j) - at(s, begun + j) + h * x)
    copy(s, mine, u, m)
    slow_down(tree, u, angle, h, w)
    for j in range(tree.bodies - 1):
        put(s, angle + j, at(s, angle + j) + at(s, begun + j))
    for i in range(m):
        change = at(s, u + i) - at(s, mine + i)
        put(s, mine + i, change / (h * tree.implicit[stage, stage]))


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
    copy(s, o + tree.dy, o + tree.dy + (tree.stages - 1) * n, n)
    copy(s, o + tree.du, o + tree.du + (tree.stages - 1) * tree.rates, tree.rates)
    if tree.implicit.shape[0] > 0:
        copy(s, o + tree.factor0, o + tree.factor, tree.rates * tree.rates)


@wp.func
def restart(tree: Tree, angles: wp.array2d(dtype=scalar), memory: wp.array2d(dtype=scalar), n: int, w: int):
    """Moves on from the n-th of other starts, as a batch would that begins there, with what laws remember.

    Kept are that memory, and the rates before.
    """
    s = tree.data
    o = w * tree.width
    joints = tree.bodies - 1
    first = n * (tree.memories + joints)
    put(s, o + tree.span, scalar(wp.inf))
    doubt(tree, w)
    for i in range(joints):
        tree.kept[(first + tree.memories + i) & NATURAL, w] = at(s, o + tree.u + i)
        put(s, o + tree.y + POSE + i, tree.starts[(2 * n * joints + i) & NATURAL, w])
        put(s, o + tree.u + i, tree.starts[((2 * n + 1) * joints + i) & NATURAL, w])
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
    weights = row * (tree.stages + 1) + 1
    for k in range(stages):
        x = x + at(tree.tableau, weights + k) * at(tree.data, first + k * count)
    return x


@wp.func
def go(tree: Tree, stage: int, h: scalar, w: int):
    """Coordinates and rates at a stage of a step of h."""
    s = tree.data
    o = w * tree.width
    n = POSE + tree.bodies - 1
    for i in range(tree.first_number, n):
        put(s, o + tree.y + i, at(s, o + tree.y0 + i) + h * weighted(tree, o + tree.dy + i, n, stage, stage))
    m = tree.rates
    for i in range(m):
        put(s, o + tree.u + i, at(s, o + tree.u0 + i) + h * weighted(tree, o + tree.du + i, m, stage, stage))
    if tree.implicit.shape[0] > 0 and stage < tree.stages - 1:
        damp(tree, stage, h, w)
    if stage == tree.stages - 1:
        k = o + tree.y + 3
        q = wp.normalize(wp.quatd(at(s, k), at(s, k + 1), at(s, k + 2), at(s, k + 3)))
        for i in range(4):
            put(s, k + i, q[i])


@wp.func
def error_of(tree: Tree, h: scalar, size: scalar, w: int):
    """Largest error of a step of h, in radians (shifts of the root over the device's size), by the embedded formula.

    An error of a rate counts as much as it turns within the step.
    """
    o = w * tree.width
    n = POSE + tree.bodies - 1
    m = tree.rates
    shifts = o + tree.dy + tree.stages * n
    rates = o + tree.du + tree.stages * m
    for i in range(tree.first_number, n):
        put(tree.data, shifts + i, h * weighted(tree, o + tree.dy + i, n, tree.stages, tree.stages))
    for i in range(m):
        put(tree.data, rates + i, h * weighted(tree, o + tree.du + i, m, tree.stages, tree.stages))
    if tree.implicit.shape[0] > 0:  # what is damped within the step is no error (Shampine & Baca 1984)
        slow_down(tree, rates, shifts + POSE, h, w)
    worst = scalar(0.0)
    for i in range(tree.first_number, n):
        x = wp.abs(at(tree.data, shifts + i))
        if i < 3:
            x = x / size
        worst = larger(worst, x)
    for i in range(m):
        x = wp.abs(h * at(tree.data, rates + i))
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
