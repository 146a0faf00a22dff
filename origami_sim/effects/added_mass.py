"""Added mass: at a point, a marker, a screw, a drop of glue or the end of a wire that nobody wrote down."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._weight import GRAVITY


@wp.func
def force(added: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return added * wp.vec3d(gravity_x, gravity_y, gravity_z)


@wp.func
def energy(x: wp.vec3d, added: scalar, gravity_x: scalar, gravity_y: scalar, gravity_z: scalar):
    return -added * wp.dot(wp.vec3d(gravity_x, gravity_y, gravity_z), x)


EFFECT = Effect(
    name="added_mass",
    family="node",
    force=force,
    energy=energy,
    conservative=True,
    inertia=lambda p: p["added"],
    parameters=(
        Parameter(
            "added", "m", "kg", 0.0, (0.0, math.inf),
            "mass at each node of the place: at both ends of an edge half of it", typical=2e-4,
        ),
        *GRAVITY,
    ),
    fitted=("added",),
    formula="f = m g, and m beside the node's own mass in m a = f",
    source="Newton's second law for a point mass; rigid panels carry it at its place (parallel axes: m r^2)",
    matters="a marker of 0.2 g at the end of a panel of 2 g and 20 mm: a third more inertia about the crease",
    confused_with="mass of the whole panel, its length, stiffness of the crease, a tether's weight",
    separated_by="a balance; hang the panel both ways round; add a known mass at the same place and compare",
)  # fmt: skip
