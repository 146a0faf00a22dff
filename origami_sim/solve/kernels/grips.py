"""Grips in a kernel: nodes that are held move along a path, along a direction or about an axis.

A path is a number in time, `Signal`, times a screw: what an angular velocity and a velocity at the origin lead to
within that time. Laws find the nodes where the path has them; what the grips then do is their work.
"""

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from origami_sim.drive import Drive
from origami_sim.model import Model
from origami_sim.solve.kernels.tree import (
    NATURAL,
    Tree,
    along_root,
    at,
    copy,
    mat_at,
    multiply,
    put,
    put_mat,
    put_vec,
    vec_at,
)

scalar = wp.float64
vec3 = wp.vec3d


@wp.struct
class Grips:
    """G grips with K nodes, their paths and their screws."""

    turn: wp.array(dtype=vec3)  # [G] angular velocity for a unit of the path
    along: wp.array(dtype=vec3)  # [G] velocity at the origin besides
    # [G, 5, W or 1] offset, amplitude, angular frequency and phase of a wave, factor on a series
    numbers: wp.array3d(dtype=scalar)
    first: wp.array(dtype=wp.int32)  # [G + 1] where the samples of each begin
    smooth: wp.array(dtype=wp.int32)  # [G] 1 where cubics join them
    times: wp.array(dtype=scalar)  # [S]
    values: wp.array2d(dtype=scalar)  # [S, W or 1]
    slopes: wp.array2d(dtype=scalar)  # [S, W or 1]
    nodes: wp.array(dtype=wp.int32)  # [K]
    of: wp.array(dtype=wp.int32)  # [K] grip of each
    reference: wp.array(dtype=vec3)  # [K] their places where the path is zero
    row: int  # of the work
    # rigid panels
    root: int  # grip of the root, -1 where it stands
    # [R] grip of what closes a loop to the ground, -1 where it stands, -2 between panels
    rows: wp.array(dtype=wp.int32)
    begun: wp.array2d(dtype=scalar)  # [G, W] the path where the panels were placed


@wp.func
def path(grips: Grips, g: int, t: scalar, w: int):
    """A path, its rate and its acceleration at a time."""
    own = wp.min(w, grips.numbers.shape[2] - 1)
    height = grips.numbers[g, 1, own]
    omega = grips.numbers[g, 2, own]
    angle = omega * t + grips.numbers[g, 3, own]
    out = vec3(
        grips.numbers[g, 0, own] + height * wp.sin(angle),
        height * omega * wp.cos(angle),
        -height * omega * omega * wp.sin(angle),
    )
    lo = grips.first[g]
    hi = grips.first[g + 1]
    if hi > lo:
        scale = grips.numbers[g, 4, own]
        mine = wp.min(w, grips.values.shape[1] - 1)
        low = int(lo)  # the first sample that is not before t, but for the very first
        high = int(hi - 1)
        low += 1
        while low < high:
            middle = (low + high) // 2
            if grips.times[middle] < t:
                low = middle + 1
            else:
                high = middle
        i = low
        h = grips.times[i] - grips.times[i - 1]
        s = wp.clamp((t - grips.times[i - 1]) / h, scalar(0.0), scalar(1.0))
        a = grips.values[i - 1, mine]
        b = grips.values[i, mine]
        value = a + s * (b - a)
        rate = (b - a) / h
        acceleration = scalar(0.0)
        if grips.smooth[g] == 1:
            # cubic of Hermite: the straight line, and what the slopes depart from it
            da = grips.slopes[i - 1, mine] - rate
            db = grips.slopes[i, mine] - rate
            r = scalar(1.0) - s
            value += h * s * r * (da * r - db * s)
            acceleration = (da * (scalar(6.0) * s - scalar(4.0)) + db * (scalar(6.0) * s - scalar(2.0))) / h
            rate += da * r * (r - scalar(2.0) * s) + db * s * (s - scalar(2.0) * r)
        if t < grips.times[lo] or t > grips.times[hi - 1]:
            rate = scalar(0.0)
            acceleration = scalar(0.0)
        out = out + scale * vec3(value, rate, acceleration)
    return out


@wp.func
def turned(axis: vec3, angle: scalar):
    """Rotation by an angle about an axis of length one or zero."""
    if wp.dot(axis, axis) == scalar(0.0):
        return wp.identity(n=3, dtype=scalar)
    return wp.quat_to_matrix(wp.quat_from_axis_angle(axis, angle))


@wp.func
def shifted(grips: Grips, g: int, s: scalar):
    """Where a motion by s brings the origin."""
    axis = grips.turn[g]
    v = grips.along[g]
    if wp.dot(axis, axis) == scalar(0.0):
        return s * v
    there = wp.cross(axis, v)  # a point on the axis
    return there - turned(axis, s) * there + s * wp.dot(axis, v) * axis


@wp.func
def going(grips: Grips, g: int, x: vec3):
    """Velocity of a place that goes along, for a unit rate."""
    return grips.along[g] + wp.cross(grips.turn[g], x)


@wp.func
def place(
    grips: Grips,
    X: wp.array2d(dtype=vec3),
    V: wp.array2d(dtype=vec3),
    mask: wp.array(dtype=vec3),
    work: wp.array2d(dtype=scalar),
    mass: wp.array(dtype=scalar),
    begin: int,
    stride: int,
    time: scalar,
    begins: int,
    w: int,
):
    """Puts the held axes of nodes where their path has them; counts the energy of motion that they gain."""
    one = vec3(scalar(1.0), scalar(1.0), scalar(1.0))
    gained = scalar(0.0)
    before = int(-1)
    now = vec3()
    shift = vec3()
    turn = wp.identity(n=3, dtype=scalar)
    for k in range(grips.nodes.shape[0]):
        n = grips.nodes[k] & NATURAL
        g = grips.of[k]
        if g != before:
            before = g
            now = path(grips, g, time, w)
            turn = turned(grips.turn[g], now[0])
            shift = shifted(grips, g, now[0])
        held = one - mask[n]
        x = X[n, w]
        v = V[n, w]
        there = turn * grips.reference[k] + shift
        to = x + wp.cw_mul(held, there - x)
        u = v + wp.cw_mul(held, now[1] * going(grips, g, there) - v)
        X[n, w] = to
        V[n, w] = u
        if begins == 0:
            gained += scalar(0.5) * mass[(begin + n * stride) & NATURAL] * wp.dot(u - v, u + v)
    work[grips.row, w] = work[grips.row, w] + gained


@wp.func
def count(
    grips: Grips,
    F: wp.array2d(dtype=vec3),
    V: wp.array2d(dtype=vec3),
    mask: wp.array(dtype=vec3),
    work: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar),
    half: scalar,
    w: int,
):
    """Counts the work of the grips against all laws."""
    now = scalar(0.0)
    one = vec3(scalar(1.0), scalar(1.0), scalar(1.0))
    for k in range(grips.nodes.shape[0]):
        n = grips.nodes[k] & NATURAL
        now -= wp.dot(wp.cw_mul(one - mask[n], F[n, w]), V[n, w])
    work[grips.row, w] = work[grips.row, w] + half * (power[grips.row, w] + now)
    power[grips.row, w] = now


# rigid panels ---------------------------------------------------------------------------------------------------------


@wp.func
def root(grips: Grips, tree: Tree, time: scalar, w: int):
    """Place, velocity and acceleration of the root in a grip."""
    g = grips.root
    if g < 0:
        return
    s = tree.data
    o = w * tree.width
    now = path(grips, g, time, w)
    ahead = now[0] - grips.begun[g, w]
    put_mat(s, o + tree.turned, turned(grips.turn[g], ahead))
    put_vec(s, o + tree.placed, shifted(grips, g, ahead))
    unit = going(grips, g, vec_at(s, o + tree.y))
    put_vec(s, o + tree.omega, now[1] * grips.turn[g])
    put_vec(s, o + tree.speed, now[1] * unit)
    put_vec(s, o + tree.alpha, now[2] * grips.turn[g])
    put_vec(s, o + tree.gain, now[2] * unit + now[1] * now[1] * wp.cross(grips.turn[g], unit))


@wp.func
def aim(grips: Grips, tree: Tree, time: scalar, w: int):
    """What loops to the ground have to close to: how far, how fast and how much faster their grips have moved."""
    s = tree.data
    o = w * tree.width
    origin = vec_at(s, o + tree.y)
    for i in range(tree.rows):
        g = grips.rows[i]
        if g > -2:
            axis = tree.axes[3 * tree.roots + i]
            reference = vec_at(s, o + tree.reference + 3 * tree.joined[i, 0])
            b = tree.joined[i, 1]
            here = mat_at(s, o + tree.turned + 9 * b) * reference + vec_at(s, o + tree.placed + 3 * b) - origin
            rate = wp.dot(axis, vec_at(s, o + tree.speed) + wp.cross(vec_at(s, o + tree.omega), here))
            if tree.roots > 0:  # the root's own rates are in the row
                rate = scalar(0.0)
            gap = scalar(0.0)
            gain = scalar(0.0)
            if g >= 0:
                now = path(grips, g, time, w)
                ahead = now[0] - grips.begun[g, w]
                there = turned(grips.turn[g], ahead) * reference + shifted(grips, g, ahead)
                unit = going(grips, g, there)
                gap = -wp.dot(axis, there - reference)
                rate -= now[1] * wp.dot(axis, unit)
                gain = -wp.dot(axis, now[2] * unit + now[1] * now[1] * wp.cross(grips.turn[g], unit))
            put(s, o + tree.aim + 3 * i, gap)
            put(s, o + tree.aim + 3 * i + 1, rate)
            put(s, o + tree.aim + 3 * i + 2, gain)


@wp.func
def support(grips: Grips, tree: Tree, stage: int, w: int):
    """Power of the supports, from the accelerations of a stage.

    What the momentum of all panels gains beyond all laws is the wrench of the supports, and what the coordinates gain
    beyond them is by loops; both are kept. Held velocities are those of the root, so that the power is the wrench on
    the root's motion and the loops' forces on the rates of the coordinates.
    """
    s = tree.data
    o = w * tree.width
    m = tree.rates
    du = o + tree.du + stage * m
    origin = vec_at(s, o + tree.y)
    # the root itself
    turn = mat_at(s, o + tree.turned)
    c = turn * vec_at(s, o + tree.centre) + vec_at(s, o + tree.placed) - origin
    mass = at(s, o + tree.mass)
    own = turn * mat_at(s, o + tree.inertia) * wp.transpose(turn)
    omega = vec_at(s, o + tree.omega)
    swing = vec_at(s, o + tree.alpha)
    force = vec3()
    moment = vec3()
    if tree.first_body == 1:
        a = vec_at(s, o + tree.gain) + wp.cross(swing, c) + wp.cross(omega, wp.cross(omega, c))
        pull = vec_at(s, o + tree.steady)
        arms = turn * mat_at(s, o + tree.steady + 3)
        torque = vec3(arms[1, 2] - arms[2, 1], arms[2, 0] - arms[0, 2], arms[0, 1] - arms[1, 0])
        torque = torque + wp.cross(vec_at(s, o + tree.placed) - origin, pull)
        force = mass * a - vec_at(s, o + tree.force) - pull
        moment = own * swing + wp.cross(omega, own * omega) + mass * wp.cross(c, a)
        moment = moment - vec_at(s, o + tree.moment) - torque
    else:
        force = -vec_at(s, o + tree.force)
        moment = -vec_at(s, o + tree.moment)
        first = vec_at(s, o + tree.first)
        for k in range(tree.roots):
            along = along_root(tree, k, origin)
            gained = at(s, du + k)
            force = force + gained * (at(s, o + tree.heavy) * along + wp.cross(tree.axes[k], first))
            moment = moment + gained * (wp.cross(first, along) + mat_at(s, o + tree.second) * tree.axes[k])
    # what joints carry is the sum of all beyond them, less what accelerations of the coordinates take of it
    for b in range(1, tree.bodies):
        if tree.parent[b] == 0 and tree.first_body == 1:
            force = force - vec_at(s, o + tree.force + 3 * b)
            moment = moment - vec_at(s, o + tree.moment + 3 * b)
        hinge = vec_at(s, o + tree.hinge + 3 * (b - 1))
        first = vec_at(s, o + tree.first + 3 * b)
        along = wp.cross(vec_at(s, o + tree.joint + 3 * (b - 1)), hinge)
        gained = at(s, du + tree.roots + b - 1)
        force = force + gained * (at(s, o + tree.heavy + b) * along + wp.cross(hinge, first))
        moment = moment + gained * (wp.cross(first, along) + mat_at(s, o + tree.second + 9 * b) * hinge)
    power = wp.dot(force, vec_at(s, o + tree.speed)) + wp.dot(moment, omega)
    if tree.first_body == 0:  # the root turns as it may, about what stands
        power = scalar(0.0)
    if tree.rows > 0:
        closing = o + tree.closing
        copy(s, closing, du, m)
        multiply(s, o + tree.factor, closing, m)
        for j in range(tree.bodies - 1):
            b = j + 1
            hinge = vec_at(s, o + tree.hinge + 3 * j)
            along = wp.cross(vec_at(s, o + tree.joint + 3 * j), hinge)
            load = at(s, o + tree.torque + j) + wp.dot(hinge, vec_at(s, o + tree.moment + 3 * b))
            load = load + wp.dot(along, vec_at(s, o + tree.force + 3 * b))
            k = closing + tree.roots + j
            put(s, k, at(s, k) - load)
            power += at(s, k) * at(s, o + tree.u + tree.roots + j)
        for k in range(tree.roots):
            load = wp.dot(tree.axes[k], vec_at(s, o + tree.moment))
            load = load + wp.dot(along_root(tree, k, origin), vec_at(s, o + tree.force))
            put(s, closing + k, at(s, closing + k) - load)
            power += at(s, closing + k) * at(s, o + tree.u + k)
    put_vec(s, o + tree.wrench, force)
    put_vec(s, o + tree.wrench + 3, moment)
    return power


def upload(model: Model, drive: Drive, names: Sequence[str], row: int, device) -> Grips:
    """The grips of a model on a device, with the paths that a drive gives them; those of rigid panels are set later.

    Args:
        names: channel of each grip; a grip whose channel the drive lacks stands still. row: of the work.
    """

    def constant(a, dtype):
        return wp.array(np.ascontiguousarray(a), dtype=dtype, device=device)

    signals = [drive.signals.get(n) for n in names]
    series = [s if s is not None and s.times is not None else None for s in signals]
    worlds = max([1, *(s.worlds for s in signals if s is not None)])
    numbers = np.zeros((len(names), 5, worlds))
    for out, s in zip(numbers, signals, strict=True):
        if s is not None:
            own = s.offset, s.amplitude, 2 * math.pi * np.asarray(s.frequency), s.phase, s.scale
            for line, value in zip(out, own, strict=True):
                line[:] = value
    columns = max([1, *(s.values.shape[1] for s in series if s is not None and s.values.ndim == 2)])
    times, values, slopes, first = [np.zeros(0)], [np.zeros((0, columns))], [np.zeros((0, columns))], [0]
    for s in series:
        count = 0 if s is None else len(s.times)
        first.append(first[-1] + count)
        if s is not None:
            given = s.values.reshape(count, -1), (s.values if s.slopes is None else s.slopes).reshape(count, -1)
            times.append(s.times)
            for kept, a in zip((values, slopes), given, strict=True):
                kept.append(np.broadcast_to(a, (count, columns)))
    out = Grips()
    out.turn, out.along = (constant(model.grip_screws[:, k : k + 3], vec3) for k in (0, 3))
    out.numbers, out.first = constant(numbers, scalar), constant(first, wp.int32)
    out.smooth = constant([s is not None and s.slopes is not None for s in series], wp.int32)
    out.times, out.values, out.slopes = (constant(np.concatenate(a), scalar) for a in (times, values, slopes))
    nodes = np.flatnonzero(model.grips >= 0)
    nodes = nodes[np.argsort(model.grips[nodes], kind="stable")]
    out.nodes, out.of = constant(nodes, wp.int32), constant(model.grips[nodes], wp.int32)
    out.reference, out.row, out.root = constant(model.position[nodes], vec3), row, -1
    out.rows, out.begun = constant(np.zeros(0), wp.int32), constant(np.zeros((0, 1)), scalar)
    return out
