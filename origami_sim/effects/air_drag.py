"""Quadratic drag of the air on a panel moving along its normal."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.kinematics import corner_rows


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
    double_area = wp.cross(x2 - x1, x3 - x1)
    n = wp.normalize(double_area)
    c = scalar(-0.25) * air_density * drag_coefficient * wp.length(double_area) / scalar(3.0)
    u1 = wp.dot(v1, n)
    u2 = wp.dot(v2, n)
    u3 = wp.dot(v3, n)
    return corner_rows(c * wp.abs(u1) * u1 * n, c * wp.abs(u2) * u2 * n, c * wp.abs(u3) * u3 * n)


EFFECT = Effect(
    name="air_drag",
    family="triangle",
    force=force,
    parameters=(
        Parameter("air_density", "rho", "kg/m^3", 1.2, (0.0, 10.0), "density of the air", typical=1.2),
        Parameter("drag_coefficient", "Cd", "-", 0.0, (0.0, 5.0), "about 1.2 for a plate across the flow", typical=1.2),
    ),
    fitted=("drag_coefficient",),
    formula="f = -(1/2) rho Cd A |vn| vn n, a third at each corner",
    source="drag equation for a flat plate",
    matters="0.07 % of the crawler's weight; first-order for light paper",
    confused_with="crease viscosity (linear in rate)",
    separated_by="decay against amplitude; vacuum",
)
