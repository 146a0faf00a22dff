"""Air drag: quadratic, of a panel that moves along its normal."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows

TINY = wp.constant(scalar(1e-300))
"""Square of an area [m^4] that is smaller than that of any triangle: one without an area feels nothing."""


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    v1: wp.vec3d,
    v2: wp.vec3d,
    v3: wp.vec3d,
    air_density: scalar,
    drag_coefficient: scalar,
):
    d = wp.cross(x2 - x1, x3 - x1)  # twice the area, along the normal
    # at the middles of the sides, whose forces go to both ends: exact for a panel that turns about one of its edges
    s12 = wp.dot(v1 + v2, d)
    s23 = wp.dot(v2 + v3, d)
    s31 = wp.dot(v3 + v1, d)
    # (1/2) rho Cd (A / 3) |vn| vn / 2 with A = |d| / 2 and vn = s / (2 |d|), of which a division by |d|^2 is left
    c = air_density * drag_coefficient * scalar(-1.0) / (scalar(96.0) * wp.max(wp.dot(d, d), TINY))
    f12 = c * wp.abs(s12) * s12
    f23 = c * wp.abs(s23) * s23
    f31 = c * wp.abs(s31) * s31
    return corner_rows((f12 + f31) * d, (f12 + f23) * d, (f23 + f31) * d)


EFFECT = Effect(
    name="air_drag",
    family="triangle",
    force=force,
    parameters=(
        Parameter("air_density", "rho", "kg/m^3", 1.2, (0.0, 10.0), "density of the air", typical=1.2),
        Parameter(
            "drag_coefficient",
            "Cd",
            "-",
            0.0,
            (0.0, 20.0),  # plates that swing by less than their width: up to about 10 (Keulegan & Carpenter 1958)
            "about 1.2 for a plate across a steady flow, several times as much in swings smaller than its width",
            typical=1.2,
        ),
    ),
    fitted=("drag_coefficient",),
    formula="f = -(1/2) rho Cd A |vn| vn n, a third at the middle of each side",
    source="drag equation for a flat plate; small swings: Keulegan & Carpenter 1958, J. Res. NBS 60, 423",
    matters="0.07 % of the crawler's weight; first-order for light paper",
    confused_with="crease viscosity (linear in rate)",
    separated_by="decay against amplitude; vacuum",
)
