"""Eccentric weight: of a patch that sits on one side of the sheet, off the mid-plane.

Rigid panels get its inertia as well: their mass points lie off the mid-plane, and have their weight there, of which
this law then has what is not of the model's gravity (`bodies.eccentric`).
"""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.kinematics import corner_rows, normal_gradients


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    mass: scalar,
    offset: scalar,
    gravity_x: scalar,
    gravity_y: scalar,
    gravity_z: scalar,
):
    # the centre of mass is offset * n away from the mid-plane; dn = -sum (n . dx_i) grad_i
    weight = mass * wp.vec3d(gravity_x, gravity_y, gravity_z)
    t = normal_gradients(x1, x2, x3)
    return corner_rows(
        -offset * wp.dot(weight, t.g1) * t.n, -offset * wp.dot(weight, t.g2) * t.n, -offset * wp.dot(weight, t.g3) * t.n
    )


@wp.func
def energy(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    mass: scalar,
    offset: scalar,
    gravity_x: scalar,
    gravity_y: scalar,
    gravity_z: scalar,
):
    return -mass * offset * wp.dot(wp.vec3d(gravity_x, gravity_y, gravity_z), wp.normalize(wp.cross(x2 - x1, x3 - x1)))


EFFECT = Effect(
    name="eccentric_weight",
    family="triangle",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("mass", "m", "kg", 0.0, (0.0, 1e3), "mass of the patch on this triangle", typical=1e-3),
        Parameter("offset", "d", "m", 0.0, (-0.05, 0.05), "its centre of mass above the mid-plane", typical=1e-3),
        Parameter("gravity_x", "gx", "m/s^2", 0.0, (-100.0, 100.0), "acceleration of gravity along x"),
        Parameter("gravity_y", "gy", "m/s^2", 0.0, (-100.0, 100.0), "acceleration of gravity along y"),
        Parameter("gravity_z", "gz", "m/s^2", -9.80665, (-100.0, 100.0), "acceleration of gravity along z"),
    ),
    fitted=("offset",),
    formula="U = -m d g . n (the nodes already carry the weight itself)",
    source="virtual work of the offset (h + t_patch) / 2",
    matters="patches of 3 mm on a 1.3 mm sheet: gravity helps a box flap close past 75 deg",
    confused_with="rest angle of the crease",
    separated_by="turn the sheet over",
)
