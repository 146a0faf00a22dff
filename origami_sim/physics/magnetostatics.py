"""Fields of magnetic dipoles, circular loops, coils and cylinders, shared by the composed kernels."""

import math

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.physics.materials import MU0

scalar = wp.float64

_SCALE = MU0 / (4.0 * math.pi)
_LOOP = MU0 / math.pi
_HALF_PI = 0.5 * math.pi


@wp.func
def dipole_field(r: wp.vec3d, moment: wp.vec3d):
    """Flux density [T] at r [m] from a dipole of that moment [A m^2] (Jackson 1999, eq. 5.56)."""
    square = wp.dot(r, r)
    along = scalar(3.0) * wp.dot(moment, r) / square
    return (scalar(_SCALE) / (square * wp.sqrt(square))) * (along * r - moment)


@wp.func
def dipole_gradient(r: wp.vec3d, moment: wp.vec3d):
    """Its gradient dB_i/dx_j [T/m], symmetric and without trace."""
    square = wp.dot(r, r)
    along = wp.dot(moment, r)
    both = wp.outer(moment, r) + wp.outer(r, moment) - (scalar(5.0) * along / square) * wp.outer(r, r)
    both += along * wp.identity(n=3, dtype=scalar)
    return (scalar(3.0) * scalar(_SCALE) / (square * square * wp.sqrt(square))) * both


@wp.struct
class Near:
    """Flux density [T] and its gradient dB_i/dx_j [T/m] at a place."""

    field: wp.vec3d
    gradient: wp.mat33d


@wp.struct
class Round:
    """A field with an axis of symmetry: along it, and away from it over the distance; and how they change along it.

    along [T], away over distance [T/m], d along / d z [T/m], d away / d z [T/m].
    """

    along: scalar
    away: scalar
    stretch: scalar
    turn: scalar


@wp.struct
class Elliptic:
    """Complete elliptic integrals K and E of parameter m, and (1 - m / 2 - E / K) / m^2, which has no cancellation."""

    k: scalar
    e: scalar
    rest: scalar


@wp.func
def elliptic(q: scalar):
    """Of m = 1 - q, by the arithmetic-geometric mean (Abramowitz & Stegun 17.6)."""
    m = scalar(1.0) - q
    b = wp.sqrt(q)
    a = scalar(0.5) * (scalar(1.0) + b)
    c = scalar(0.25) / a  # of c_n = (a_(n-1) - b_(n-1)) / 2 over m
    b = wp.sqrt(b)
    rest = c * c
    weight = scalar(1.0)
    rounds = int(0)
    while rounds < 8:
        rounds += 1
        mean = scalar(0.5) * (a + b)
        b = wp.sqrt(a * b)
        a = mean
        c = m * c * c / (scalar(4.0) * a)
        weight *= scalar(2.0)
        rest += weight * c * c
    out = Elliptic()
    out.k = scalar(_HALF_PI) / a
    out.rest = rest
    out.e = out.k * (scalar(1.0) - scalar(0.5) * m - m * m * rest)
    return out


@wp.func
def cel(kc: scalar, p: scalar, c: scalar, s: scalar):
    """Integral of (c cos^2 + s sin^2) / ((cos^2 + p sin^2) sqrt(cos^2 + kc^2 sin^2)) over a quarter (Bulirsch 1965)."""
    root = wp.sqrt(p)
    top = c
    low = s / root
    k = kc
    em = scalar(1.0)
    kk = k
    g = scalar(2.0)  # any but k
    going = int(1)
    while going == 1:
        f = top
        top += low / root
        g = kk / root
        low = scalar(2.0) * (low + f * g)
        root = g + root
        g = em
        em = k + em
        going = int(0)
        if wp.abs(g - k) > g * scalar(1.0e-10):
            going = int(1)
            k = scalar(2.0) * wp.sqrt(kk)
            kk = k * em
    return scalar(_HALF_PI) * (low + top * em) / (em * (em + root))


@wp.func
def loop_field(rho: scalar, z: scalar, radius: scalar, current: scalar):
    """A circular loop of current [A] at the distance rho from its axis and z above it (Simpson et al. 2001)."""
    a = radius
    one = scalar(1.0)
    half = scalar(0.5)
    near = (a - rho) * (a - rho) + z * z
    far = (a + rho) * (a + rho) + z * z
    far_root = wp.sqrt(far)
    q = near / far
    m = one - q
    c = scalar(_LOOP) * current
    e = elliptic(q)
    a2 = a * a
    p2 = rho * rho
    z2 = z * z
    r2 = p2 + z2
    out = Round()
    out.along = half * c / (near * far_root) * ((a2 - r2) * e.e + near * e.k)
    out.away = scalar(8.0) * c * a2 * z * e.k * (scalar(0.25) - (one - half * m) * e.rest) / (near * far * far_root)
    cube = near * near * far * far_root
    six = scalar(6.0)
    out.stretch = (
        half * c * z / cube * ((six * a2 * (p2 - z2) - scalar(7.0) * a2 * a2 + r2 * r2) * e.e + near * (a2 - r2) * e.k)
    )
    if rho > scalar(1.0e-4) * a:
        d = (p2 - a2) * (p2 - a2)
        first = d * (p2 + a2) + scalar(2.0) * z2 * (a2 * a2 - six * a2 * p2 + p2 * p2) + z2 * z2 * (a2 + p2)
        out.turn = half * c / (rho * cube) * (first * e.e - near * (d + z2 * (p2 + a2)) * e.k)
    else:  # first order in rho, from the field on the axis
        s = a2 + z2
        out.turn = scalar(0.75) * scalar(MU0) * current * a2 * rho * (s - scalar(5.0) * z2) / (s * s * s * wp.sqrt(s))
    return out


@wp.func
def end_field(rho: scalar, z: scalar, radius: scalar):
    """What one end of a long winding adds to the field inside and out, for a flux density of one."""
    a = radius
    far = (a + rho) * (a + rho) + z * z
    root = wp.sqrt(far)
    q = ((a - rho) * (a - rho) + z * z) / far
    e = elliptic(q)
    gamma = (a - rho) / (a + rho)
    if wp.abs(gamma) < scalar(1.0e-9):  # the winding itself, where the field along it jumps
        gamma = scalar(1.0e-9)
    out = Round()
    out.along = a / (a + rho) * (z / root) * cel(wp.sqrt(q), gamma * gamma, scalar(1.0), gamma)
    out.away = -scalar(8.0) * a * a / (far * root) * e.k * e.rest
    return out


@wp.func
def winding_field(rho: scalar, z: scalar, radius: scalar, length: scalar, density: scalar):
    """A thin winding of that length about its middle, of current per length [A/m] (Derby & Olbert 2010).

    Its changes along the axis are the fields of the loops at its ends.
    """
    up = z + scalar(0.5) * length
    down = z - scalar(0.5) * length
    top = end_field(rho, up, radius)
    bottom = end_field(rho, down, radius)
    first = loop_field(rho, up, radius, density)
    last = loop_field(rho, down, radius, density)
    scale = scalar(_LOOP) * density
    out = Round()
    out.along = scale * (top.along - bottom.along)
    out.away = scale * (top.away - bottom.away)
    out.stretch = first.along - last.along
    out.turn = rho * (first.away - last.away)
    return out


@wp.func
def about(r: wp.vec3d, axis: wp.vec3d, f: Round):
    """Field and gradient at r from the middle of what is symmetric about an axis; div B = 0 and curl B = 0."""
    z = wp.dot(r, axis)
    beside = r - z * axis
    rho = wp.length(beside)
    e = wp.vec3d()
    if rho > scalar(0.0):
        e = beside / rho
    out = Near()
    out.field = f.along * axis + f.away * beside
    away = -f.stretch - f.away  # of the distance
    axes = wp.outer(axis, axis)
    across = wp.identity(n=3, dtype=scalar) - axes
    out.gradient = f.stretch * axes + f.turn * (wp.outer(e, axis) + wp.outer(axis, e)) + f.away * across
    out.gradient += (away - f.away) * wp.outer(e, e)
    return out
