"""Membrane of a thin sheet: constant strain in every triangle, at any rotation, with the arcs of its curved edges."""

import warp as wp

from origami_sim.effects._effect import Effect, scalar
from origami_sim.effects._plate import largest, stiffnesses, weighed


@wp.func
def resultant(
    strain: wp.vec3d,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
):
    return weighed(strain, stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26)


@wp.func
def energy(
    strain: wp.vec3d,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
):
    n = weighed(strain, stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26)
    return scalar(0.5) * wp.dot(strain, n)


EFFECT = Effect(
    name="shell_membrane",
    family="membrane",
    force=resultant,
    energy=energy,
    conservative=True,
    parameters=stiffnesses("A", "N/m", "membrane stiffness"),
    needs=tuple(p.name for p in stiffnesses("A", "N/m", "")),
    stiffness=largest,
    formula="N = A E,  E = (F^T F - 1) / 2 and (k l)^2 / 24 along edges of curvature k and length l,  "
    "A = Y t / (1 - nu^2) [[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]] with Young's modulus Y",
    source="St. Venant-Kirchhoff membrane on linear triangles (Turner, Clough, Martin & Topp 1956)",
    matters="sheets that stretch or shear; converges to the plane-stress solution on any mesh, as bars do not",
    confused_with="nothing at the angles seen; a soft membrane shows as panels that stretch",
    separated_by="distance between two markers of one panel under load",
)
