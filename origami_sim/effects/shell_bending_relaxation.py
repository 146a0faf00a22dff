"""Viscoelastic relaxation of a sheet that bends: three Maxwell branches (Prony series) beside its elasticity."""

import warp as wp

from origami_sim.effects._effect import Effect, scalar
from origami_sim.effects._plate import maxwell, relaxation


@wp.func
def resultant(
    change: wp.vec3d,
    whole: scalar,
    dt: scalar,
    q1: wp.vec3d,
    q2: wp.vec3d,
    q3: wp.vec3d,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
    share_1: scalar,
    time_1: scalar,
    share_2: scalar,
    time_2: scalar,
    share_3: scalar,
    time_3: scalar,
):
    p1 = q1
    p2 = q2
    p3 = q3
    m = wp.vec3d()
    if whole > scalar(0.0):  # the variation across lines is no strain of the material and vanishes with the mesh
        m, p1, p2, p3 = maxwell(
            change, dt, q1, q2, q3,
            stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26,
            share_1, time_1, share_2, time_2, share_3, time_3,
        )  # fmt: skip
    return m, p1, p2, p3


EFFECT = Effect(
    name="shell_bending_relaxation",
    family="plate",
    force=resultant,
    **relaxation("D", "N m", "bending stiffness"),
    formula="M = D sum q_i,  dq_i/dt = g_i dkappa/dt - q_i / tau_i",
    matters="elastomer strips that swing or snap; VHB loses half its moment in 10 s",
    confused_with="relaxation in stretching, drag of the air, slow drift of the load",
    separated_by="ring-down of a strip with a free end, which only bends; hold at constant load, then recovery",
)
