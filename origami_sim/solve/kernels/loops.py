"""Loops of rigid panels in a kernel: the accelerations that keep them closed."""

import warp as wp

from origami_sim.solve.kernels.tree import (
    Tree,
    along_root,
    at,
    copy,
    factorise,
    mat_at,
    put,
    scalar,
    solve_lower,
    solve_upper,
    vec3,
    vec_at,
)


@wp.func
def constrain(tree: Tree, stage: int, w: int):
    """Adds the forces that keep loops closed to the half-solved accelerations of the open tree.

    With M = L L^T, S = J L^-T: z += S^T (S S^T + soft)^-1 r, r = -(bias + 2 c rate + c^2 gap + S z) (Baumgarte).
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    du = o + tree.du + stage * m
    origin = vec_at(s, o + tree.y)
    for i in range(tree.rows):
        row = o + tree.jacobian + i * m
        solved = o + tree.solved + i * m
        for k in range(m):
            put(s, row + k, scalar(0.0))
        axis = tree.axes[3 * tree.roots + i]
        reference = vec_at(s, o + tree.reference + 3 * tree.joined[i, 0])
        gap = at(s, o + tree.aim + 3 * i)
        bias = at(s, o + tree.aim + 3 * i + 2)
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
        rate = at(s, o + tree.aim + 3 * i + 1)
        for k in range(m):
            rate += at(s, row + k) * at(s, o + tree.u + k)
        copy(s, solved, row, m)
        if tree.rows > m:
            half_solve(s, o + tree.factor, solved, m)
        else:
            solve_lower(s, o + tree.factor, solved, m)
        c = tree.stabilisation
        right = -(bias + scalar(2.0) * c * rate + c * c * gap)
        for k in range(m):
            right -= at(s, solved + k) * at(s, du + k)
        put(s, o + tree.pull + i, right)
    if tree.rows > m:
        close_many(tree, du, o, m)
    else:
        close(tree, du, o, m)


@wp.func
def close(tree: Tree, du: int, o: int, m: int):
    """Adds S^T (S S^T + soft)^-1 r to the half-solved accelerations, of fewer constraints than rates."""
    s = tree.data
    total = scalar(0.0)
    for i in range(tree.rows):
        for j in range(i + 1):
            product = scalar(0.0)
            for k in range(m):
                product += at(s, o + tree.solved + i * m + k) * at(s, o + tree.solved + j * m + k)
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
def close_many(tree: Tree, du: int, o: int, m: int):
    """The same of more constraints than rates, as (S^T S + soft)^-1 S^T r, which a sheet's many loops make far smaller.

    Softness does not bound what rounding adds in directions that no constraint knows, so that the result is projected
    on the others, twice: each time 1e-16 over the softness of it is left.
    """
    s = tree.data
    gram = o + tree.gram
    found = o + tree.found
    for k in range(m * m):
        put(s, gram + k, scalar(0.0))
    i = int(0)
    while i < tree.rows:  # three rows at once: an end of a crease
        row = o + tree.solved + i * m
        first = leading(s, row, m)
        if i + 2 < tree.rows:
            first = wp.min(first, wp.min(leading(s, row + m, m), leading(s, row + 2 * m, m)))
            for a in range(first, m):
                each = vec3(at(s, row + a), at(s, row + m + a), at(s, row + 2 * m + a))
                entry = gram + a * m
                for b in range(first, a + 1):
                    x = each[0] * at(s, row + b) + each[1] * at(s, row + m + b) + each[2] * at(s, row + 2 * m + b)
                    put(s, entry + b, at(s, entry + b) + x)
            i += 3
        else:
            for a in range(first, m):
                c1 = at(s, row + a)
                for b in range(first, a + 1):
                    put(s, gram + a * m + b, at(s, gram + a * m + b) + c1 * at(s, row + b))
            i += 1
    total = scalar(0.0)
    for k in range(m):
        total += at(s, gram + k * m + k)
    soft = tree.softness * total / scalar(tree.rows)
    for k in range(m):
        put(s, gram + k * m + k, at(s, gram + k * m + k) + soft)
    factorise(s, gram, m, soft)
    for turn in range(3):
        if turn > 0:
            for i in range(tree.rows):
                put(s, o + tree.pull + i, dot(s, o + tree.solved + i * m, found, m))
        for k in range(m):
            put(s, found + k, scalar(0.0))
        for i in range(tree.rows):
            c = at(s, o + tree.pull + i)
            for k in range(m):
                put(s, found + k, at(s, found + k) + c * at(s, o + tree.solved + i * m + k))
        solve_lower(s, gram, found, m)
        solve_upper(s, gram, found, m)
    for k in range(m):
        put(s, du + k, at(s, du + k) + at(s, found + k))


@wp.func
def leading(s: wp.array(dtype=scalar), row: int, m: int):
    """How many numbers of a row are zero before the first other: rates of what carries the whole of a loop."""
    k = int(0)
    while k < m and at(s, row + k) == scalar(0.0):
        k += 1
    return k


@wp.func
def dot(s: wp.array(dtype=scalar), a: int, b: int, count: int):
    """Inner product of two stretches, by four sums at a time, which do not wait for each other."""
    w = scalar(0.0)
    x = scalar(0.0)
    y = scalar(0.0)
    z = scalar(0.0)
    k = int(0)
    while k + 3 < count:
        w += at(s, a + k) * at(s, b + k)
        x += at(s, a + k + 1) * at(s, b + k + 1)
        y += at(s, a + k + 2) * at(s, b + k + 2)
        z += at(s, a + k + 3) * at(s, b + k + 3)
        k += 4
    while k < count:
        w += at(s, a + k) * at(s, b + k)
        k += 1
    return (w + x) + (y + z)


@wp.func
def half_solve(s: wp.array(dtype=scalar), factor: int, target: int, m: int):
    """Solves with a Cholesky factor [m, m], in place, from the first number on that is not zero."""
    first = leading(s, target, m)
    for i in range(first, m):
        x = at(s, target + i) - dot(s, factor + i * m + first, target + first, i - first)
        put(s, target + i, x * at(s, factor + i * m + i))
