"""Air drag of a body: quadratic, of a ball, or of a node that stands for one."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(v: wp.vec3d, air_density: scalar, drag_coefficient: scalar, area: scalar):
    return scalar(-0.5) * air_density * drag_coefficient * area * wp.length(v) * v


EFFECT = Effect(
    name="body_drag",
    family="node",
    force=force,
    parameters=(
        Parameter("air_density", "rho", "kg/m^3", 1.2, (0.0, 10.0), "density of the air", typical=1.2),
        Parameter("drag_coefficient", "Cd", "-", 0.0, (0.0, 5.0), "0.1 to 0.5 for a sphere", typical=0.4),
        Parameter("area", "A", "m^2", 0.0, (0.0, 1e3), "cross-section that this node stands for"),
    ),
    fitted=("drag_coefficient",),
    stated=("area",),
    formula="f = -(1/2) rho Cd A |v| v, the same in all directions",
    source="drag equation; spheres: Cd 0.47 at Re 1e4 to 2e5, 0.1 beyond the drag crisis (Achenbach 1972)",
    matters="a whiffle ball falls at 13 m/s after 20 m, a bowling ball loses half a per cent of its speed",
    confused_with="gravity or a length scale that is too small, drag linear in the speed",
    separated_by="independent gravity; falls from other heights; balls of one size and several masses",
)
