"""Bending of a thin sheet: moments by the curvature tensor, which is found from the fold angles of any mesh."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._plate import largest, stiffnesses, weighed


@wp.func
def resultant(
    curvature: wp.vec3d,
    whole: scalar,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
    natural_11: scalar,
    natural_22: scalar,
    natural_12: scalar,
):
    k = curvature - whole * wp.vec3d(natural_11, natural_22, scalar(2.0) * natural_12)
    return weighed(k, stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26)


@wp.func
def energy(
    curvature: wp.vec3d,
    whole: scalar,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
    natural_11: scalar,
    natural_22: scalar,
    natural_12: scalar,
):
    k = curvature - whole * wp.vec3d(natural_11, natural_22, scalar(2.0) * natural_12)
    m = weighed(k, stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26)
    return scalar(0.5) * wp.dot(k, m)


FREE = (-math.inf, math.inf)

EFFECT = Effect(
    name="shell_bending",
    family="plate",
    force=resultant,
    energy=energy,
    conservative=True,
    parameters=(
        *stiffnesses("D", "N m", "bending stiffness"),
        Parameter(
            "natural_11", "k11", "1/m", 0.0, FREE, "curvature without moment, beyond that of the reference state"
        ),
        Parameter("natural_22", "k22", "1/m", 0.0, FREE, "the same, component 22"),
        Parameter("natural_12", "k12", "1/m", 0.0, FREE, "the same, twist"),
    ),
    needs=tuple(p.name for p in stiffnesses("D", "N m", "")),
    stiffness=largest,
    formula="M = D (kappa - kappa0),  D = E t^3 / (12 (1 - nu^2)) [[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]",
    source="Kirchhoff plate; Morley 1968, Grinspun et al. 2006, their edge turns combined from fold angles",
    matters="sheets that bend over many cells: rigidity and Poisson's ratio of bending are the material's on any mesh",
    confused_with="panel_bending, whose rigidity in a direction is the mesh's",
    separated_by="refining the mesh; the anticlastic curvature across a bent strip",
)
