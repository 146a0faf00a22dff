"""Soft magnet: iron or a soft filler that a field magnetises, with the field of its own poles against it."""

import math

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows
from origami_sim.physics.materials import MU0


@wp.func
def polarised(b: wp.vec3d, susceptibility: scalar, n: wp.vec3d, saturation: scalar):
    """Polarisation mu0 M [T] along the patch's axes in a field b along them, with demagnetising factors n."""
    one = scalar(1.0)
    # the share c = M / H solves c (1 + chi h / Js) = chi, with h = |b_i / (1 + n_i c)|; from below by Newton
    c = scalar(0.0)
    change = one
    rounds = int(0)
    while rounds < 60 and wp.abs(change) > scalar(1.0e-15) * c:
        rounds += 1
        h = wp.vec3d(b[0] / (one + n[0] * c), b[1] / (one + n[1] * c), b[2] / (one + n[2] * c))
        size = wp.length(h)
        fall = scalar(0.0)
        if size > scalar(0.0):
            for i in range(3):
                fall += n[i] * h[i] * h[i] / (one + n[i] * c)
            fall = fall / size
        bend = susceptibility / saturation
        change = (susceptibility - c * (one + bend * size)) / (one + bend * (size - c * fall))
        c += change
    return wp.vec3d(c * b[0] / (one + n[0] * c), c * b[1] / (one + n[1] * c), c * b[2] / (one + n[2] * c))


@wp.func
def stored(polarisation: scalar, susceptibility: scalar, saturation: scalar):
    """Integral of mu0 H over the polarisation [T^2]."""
    t = polarisation / saturation
    share = t * t * (scalar(0.5) + t * (scalar(1.0) / scalar(3.0) + t * (scalar(0.25) + t * scalar(0.2))))
    if t > scalar(1.0e-3):
        share = -t - wp.log(scalar(1.0) - t)
    return saturation * saturation / susceptibility * share


@wp.func
def axes(x1: wp.vec3d, x2: wp.vec3d, x3: wp.vec3d, poling_1: scalar, poling_2: scalar):
    """The patch's axes as rows: its first one, across it in the panel, and the panel's normal."""
    u = wp.normalize(poling_1 * (x2 - x1) + poling_2 * (x3 - x1))
    normal = wp.normalize(wp.cross(x2 - x1, x3 - x1))
    return wp.matrix_from_rows(u, wp.cross(normal, u), normal)


@wp.func
def factors(demagnetising_1: scalar, demagnetising_2: scalar):
    """Demagnetising factors along the axes, of which the sum is one."""
    rest = scalar(1.0) - demagnetising_1 - demagnetising_2
    return wp.vec3d(demagnetising_1, demagnetising_2, wp.max(rest, scalar(0.0)))


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    gradient: wp.mat33d,
    susceptibility: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    saturation: scalar,
    demagnetising_1: scalar,
    demagnetising_2: scalar,
):
    out = corner_rows(wp.vec3d(), wp.vec3d(), wp.vec3d())
    if susceptibility > scalar(0.0):
        a = axes(x1, x2, x3, poling_1, poling_2)
        j = polarised(a * field, susceptibility, factors(demagnetising_1, demagnetising_2), saturation)
        u = wp.vec3d(a[0, 0], a[0, 1], a[0, 2])
        normal = wp.vec3d(a[2, 0], a[2, 1], a[2, 2])
        # the polarisation is where the energy is least, so its changes cost nothing: the force is that of a magnet
        turned = j[0] * field + j[1] * wp.cross(field, normal)
        tilted = j[2] * field + j[1] * wp.cross(u, field)
        out = nominal.force(x1, x2, x3, turned, scalar(1.0), volume, poling_1, poling_2, scalar(0.0))
        out = out + nominal.force(x1, x2, x3, tilted, scalar(1.0), volume, poling_1, poling_2, scalar(1.0))
        pull = wp.transpose(gradient) * (wp.transpose(a) * j)
        third = (volume / (scalar(3.0) * scalar(MU0))) * pull
        out = out + corner_rows(third, third, third)
    return out


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    susceptibility: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    saturation: scalar,
    demagnetising_1: scalar,
    demagnetising_2: scalar,
):
    out = scalar(0.0)
    if susceptibility > scalar(0.0):
        b = axes(x1, x2, x3, poling_1, poling_2) * field
        n = factors(demagnetising_1, demagnetising_2)
        j = polarised(b, susceptibility, n, saturation)
        poles = scalar(0.5) * wp.dot(j, wp.cw_mul(n, j))
        out = volume / scalar(MU0) * (stored(wp.length(j), susceptibility, saturation) + poles - wp.dot(j, b))
    return out


EFFECT = Effect(
    name="soft_magnet",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "susceptibility", "chi", "-", 0.0, (0.0, 1e6), "of the material at small fields: relative permeability - 1",
            typical=1.0,
        ),
        Parameter("volume", "V", "m^3", 0.0, (0.0, math.inf), "volume of soft magnet carried by this triangle"),
        Parameter("poling_1", "a", "1/m", 0.0, (-math.inf, math.inf), "the patch's first axis along x2 - x1"),
        Parameter("poling_2", "b", "1/m", 0.0, (-math.inf, math.inf), "the patch's first axis along x3 - x1"),
        Parameter("saturation", "Js", "T", 2.15, (0.01, 3.0), "saturation polarisation; 2.15 of iron", typical=0.6),
        Parameter(
            "demagnetising_1", "N1", "-", 0.0, (0.0, 1.0), "demagnetising factor along the first axis", typical=0.2
        ),
        Parameter(
            "demagnetising_2", "N2", "-", 0.0, (0.0, 1.0), "across it in the panel; the rest of 1 is the normal's",
            typical=0.15,
        ),
    ),
    fitted=("susceptibility",),
    formula=(
        "U = -V max over J of (J . B - sum N_i J_i^2 / 2 - w(|J|)) / mu0,  w the integral of mu0 H: "
        "J = chi h / (1 + chi h / Js) along h = B - N J;  f = (m . grad) B and m x B,  m = J V / mu0"
    ),
    source=(
        "Froehlich's magnetisation curve (Bozorth 1951, ch. 11), one demagnetising factor for each axis as in an "
        "ellipsoid; those of a prism: Aharoni 1998; force by virtual work at the least energy"
    ),
    matters="iron-filled elastomers; a soft share in a remanent patch turns long panels along any field, at 20 mT by "
    "1/100 and at 0.2 T by 1/10 of a remanence of 0.1 T",
    confused_with="dipoles that turn in the field, misalignment of the field, a field that differs from place to place",
    separated_by="reverse the field: what is induced does not change; demagnetise the patch",
)  # fmt: skip
