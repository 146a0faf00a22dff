"""Field and gradient of a drive's sources at a place, in the kernels and for whoever asks."""

import numpy as np
import warp as wp

from origami_sim.drive import CHANNELS, Drive
from origami_sim.drive.sources import KINDS, NUMBERS
from origami_sim.errors import InputError
from origami_sim.physics import magnetostatics
from origami_sim.physics.magnetostatics import Near

scalar = wp.float64

SIZE = len(NUMBERS)
DIPOLE, COIL, MAGNET = (wp.constant(KINDS.index(k)) for k in ("dipole", "coil", "magnet"))


@wp.struct
class Sources:
    """What makes a field from place to place.

    kind: [S]; first: drive channel of the first one's numbers; now: [9 S, W] the numbers at the present time.
    grid: [S, 4] places along the axes of a table, and where its coefficients begin; box: [S, 6] its first place and
    its steps [m]; potential: coefficients of all tables, see `FieldTable`.
    """

    kind: wp.array(dtype=wp.int32)
    first: int
    now: wp.array2d(dtype=wp.float64)
    grid: wp.array2d(dtype=wp.int32)
    box: wp.array2d(dtype=wp.float64)
    potential: wp.array(dtype=wp.float64)


@wp.struct
class Weights:
    """Five B-splines of order four in a cell, and their first and second derivatives."""

    value: wp.types.vector(length=5, dtype=scalar)
    slope: wp.types.vector(length=5, dtype=scalar)
    bend: wp.types.vector(length=5, dtype=scalar)


@wp.func
def weights(t: scalar, step: scalar):
    s = scalar(1.0) - t
    one = scalar(1.0)
    out = Weights()
    half = scalar(0.5)
    # the outer ones are powers; the inner ones by de Boor's recursion from those of order two
    a = half * s * s
    c = half * t * t
    b = one - a - c
    third = one / scalar(3.0)
    u0 = third * s * a
    u1 = third * ((t + scalar(2.0)) * a + (scalar(2.0) - t) * b)
    u2 = third * ((t + one) * b + (scalar(3.0) - t) * c)
    u3 = third * t * c
    quarter = scalar(0.25)
    out.value[0] = quarter * s * u0
    out.value[1] = quarter * ((t + scalar(3.0)) * u0 + (scalar(2.0) - t) * u1)
    out.value[2] = quarter * ((t + scalar(2.0)) * u1 + (scalar(3.0) - t) * u2)
    out.value[3] = quarter * ((t + one) * u2 + (scalar(4.0) - t) * u3)
    out.value[4] = quarter * t * u3
    r = one / step
    out.slope[0] = -r * u0
    out.slope[1] = r * (u0 - u1)
    out.slope[2] = r * (u1 - u2)
    out.slope[3] = r * (u2 - u3)
    out.slope[4] = r * u3
    r = r * r
    out.bend[0] = r * a
    out.bend[1] = r * (b - scalar(2.0) * a)
    out.bend[2] = r * (c - scalar(2.0) * b + a)
    out.bend[3] = r * (b - scalar(2.0) * c)
    out.bend[4] = r * c
    return out


@wp.func
def table(sources: Sources, n: int, at: wp.vec3d):
    """The field of a table; nan outside it."""
    out = Near()
    inside = int(1)
    for k in range(3):
        far = scalar(sources.grid[n, k] - 1) * sources.box[n, 3 + k]
        slack = scalar(1.0e-9) * far
        if not (at[k] - sources.box[n, k] >= -slack and at[k] - sources.box[n, k] <= far + slack):
            inside = int(0)
    if inside == 0:
        out.field = wp.vec3d(wp.nan, wp.nan, wp.nan)
        return out
    ux = (at[0] - sources.box[n, 0]) / sources.box[n, 3]
    uy = (at[1] - sources.box[n, 1]) / sources.box[n, 4]
    uz = (at[2] - sources.box[n, 2]) / sources.box[n, 5]
    i = wp.clamp(int(ux), 0, sources.grid[n, 0] - 2)
    j = wp.clamp(int(uy), 0, sources.grid[n, 1] - 2)
    k = wp.clamp(int(uz), 0, sources.grid[n, 2] - 2)
    wx = weights(ux - scalar(i), sources.box[n, 3])
    wy = weights(uy - scalar(j), sources.box[n, 4])
    wz = weights(uz - scalar(k), sources.box[n, 5])
    row = sources.grid[n, 2] + 3
    sheet = row * (sources.grid[n, 1] + 3)
    first = wp.vec3d()
    second = wp.mat33d()
    five = int(5) + (i - i)  # a number that the compiler does not know: unrolled, these loops take seconds to compile
    for a in range(five):
        # sums over y and z of potential, its slopes and bends
        v = scalar(0.0)
        vy = scalar(0.0)
        vz = scalar(0.0)
        vyy = scalar(0.0)
        vyz = scalar(0.0)
        vzz = scalar(0.0)
        for b in range(five):
            place = sources.grid[n, 3] + (i + a) * sheet + (j + b) * row + k
            p = scalar(0.0)
            pz = scalar(0.0)
            pzz = scalar(0.0)
            for c in range(five):
                q = sources.potential[place + c]
                p += q * wz.value[c]
                pz += q * wz.slope[c]
                pzz += q * wz.bend[c]
            v += wy.value[b] * p
            vy += wy.slope[b] * p
            vyy += wy.bend[b] * p
            vz += wy.value[b] * pz
            vyz += wy.slope[b] * pz
            vzz += wy.value[b] * pzz
        first += wp.vec3d(wx.slope[a] * v, wx.value[a] * vy, wx.value[a] * vz)
        xy = wx.slope[a] * vy
        xz = wx.slope[a] * vz
        yz = wx.value[a] * vyz
        second += wp.mat33d(wx.bend[a] * v, xy, xz, xy, wx.value[a] * vyy, yz, xz, yz, wx.value[a] * vzz)
    out.field = -first
    out.gradient = -second
    return out


@wp.func
def of_source(sources: Sources, n: int, at: wp.vec3d, w: int):
    """Field and gradient of one source."""
    out = Near()
    row = SIZE * n
    strength = sources.now[row, w]
    if strength == scalar(0.0):
        return out
    r = at - wp.vec3d(sources.now[row + 1, w], sources.now[row + 2, w], sources.now[row + 3, w])
    axis = wp.normalize(wp.vec3d(sources.now[row + 4, w], sources.now[row + 5, w], sources.now[row + 6, w]))
    radius = sources.now[row + 7, w]
    length = sources.now[row + 8, w]
    kind = sources.kind[n]
    if kind == DIPOLE:
        out.field = magnetostatics.dipole_field(r, strength * axis)
        out.gradient = magnetostatics.dipole_gradient(r, strength * axis)
    elif kind == COIL or kind == MAGNET:
        z = wp.dot(r, axis)
        rho = wp.length(r - z * axis)
        if length == scalar(0.0):
            out = magnetostatics.about(r, axis, magnetostatics.loop_field(rho, z, radius, strength))
        else:
            density = strength / length
            if kind == MAGNET:
                density = strength / scalar(magnetostatics.MU0)
            out = magnetostatics.about(r, axis, magnetostatics.winding_field(rho, z, radius, length, density))
    else:
        out = table(sources, n, r)
        out.field = strength * out.field
        out.gradient = strength * out.gradient
    return out


@wp.func
def near(sources: Sources, at: wp.vec3d, w: int):
    """Field and gradient of all sources at a place."""
    out = Near()
    for n in range(sources.kind.shape[0]):
        one = of_source(sources, n, at, w)
        out.field = out.field + one.field
        out.gradient = out.gradient + one.gradient
    return out


def upload(drive: Drive, now: wp.array, device) -> Sources:
    """The sources of a drive on a device, with room for their numbers [9 S, W]."""
    grid, box, potential, offset = [], [], [np.zeros(1)], 1
    for _, table_ in drive.placed:
        if table_ is None:
            grid.append([0, 0, 0, 0])
            box.append([0.0] * 6)
            continue
        grid.append([*table_.shape, offset])
        box.append([*(a[0] for a in table_.axes), *table_.steps])
        potential.append(table_.coefficients.ravel())
        offset += table_.coefficients.size

    def constant(a, dtype, columns=0):
        a = np.asarray(a)
        return wp.array(a.reshape(-1, columns) if columns else a, dtype=dtype, device=device)

    out = Sources()
    out.kind = constant([KINDS.index(kind) for kind, _ in drive.placed], wp.int32)
    out.first, out.now = list(drive.signals).index("source_0_strength") if drive.placed else 0, now
    out.grid, out.box = constant(grid, wp.int32, 4), constant(box, wp.float64, 6)
    out.potential = constant(np.concatenate(potential), wp.float64)
    return out


@wp.kernel
def _at(
    sources: Sources,
    places: wp.array(dtype=wp.vec3d),
    field: wp.array(dtype=wp.vec3d),
    slope: wp.array(dtype=wp.mat33d),
):
    i = wp.tid()
    found = near(sources, places[i], 0)
    field[i] = found.field
    slope[i] = found.gradient


def field_at(drive: Drive, points, time: float = 0.0, *, world: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The whole field of a drive at places.

    Args:
        points: [n, 3] [m]. time: [s]. world: of a drive that differs between worlds.

    Returns:
        Flux density [n, 3] [T] and its gradient dB_i/dx_j [n, 3, 3] [T/m]; nan outside a table.
    """
    points = np.atleast_2d(np.asarray(points, float))
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("places have three coordinates", field="points", value=points.shape, allowed="(n, 3)")

    def at(name: str) -> float:
        values = np.ravel(drive[name](time))
        return float(values[world if len(values) > 1 else 0])

    levels = [at(f"source_{k}_{n}") for k in range(len(drive.placed)) for n in NUMBERS]
    now = wp.array(np.array(levels, float).reshape(-1, 1), dtype=wp.float64, device="cpu")
    field, slope = (wp.zeros(len(points), dtype=t, device="cpu") for t in (wp.vec3d, wp.mat33d))
    places = wp.array(points, dtype=wp.vec3d, device="cpu")
    wp.launch(_at, dim=len(points), inputs=[upload(drive, now, "cpu"), places], outputs=[field, slope], device="cpu")
    uniform = np.array([at(c) for c in CHANNELS[:3]])
    gradient = np.array([at(c) for c in CHANNELS[3:12]]).reshape(3, 3)
    return field.numpy() + uniform + points @ gradient.T, slope.numpy() + gradient
