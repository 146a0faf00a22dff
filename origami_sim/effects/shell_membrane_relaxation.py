"""Viscoelastic relaxation of a sheet that stretches: three Maxwell branches (Prony series) beside its elasticity."""

import warp as wp

from origami_sim.effects._effect import Effect, scalar
from origami_sim.effects._plate import branches, instantaneous, maxwell, memories, stiffnesses


@wp.func
def resultant(
    change: wp.vec3d,
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
    n, p1, p2, p3 = maxwell(
        change, dt, q1, q2, q3,
        stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26,
        share_1, time_1, share_2, time_2, share_3, time_3,
    )  # fmt: skip
    return n, p1, p2, p3


EFFECT = Effect(
    name="shell_membrane_relaxation",
    family="membrane",
    force=resultant,
    memory=memories(),
    parameters=(*stiffnesses("A", "N/m", "membrane stiffness"), *branches()),
    fitted=("share_1", "time_1"),
    stated=("stiffness_11", "stiffness_22", "stiffness_66"),
    needs=("share_1", "share_2", "share_3"),
    stiffness=instantaneous,
    formula="N = A sum q_i,  dq_i/dt = g_i dE/dt - q_i / tau_i",
    source=(
        "generalised Maxwell solid of which all moduli relax alike (standard linear solid with one branch); exact "
        "exponential update (Simo & Hughes 1998, ch. 10)"
    ),
    matters=(
        "arches and buckled sheets between clamps: to flatten them is to compress them, so that the loss of a snap is "
        "this one as much as that of bending"
    ),
    confused_with="relaxation in bending, drag of the air",
    separated_by="decay of modes that stretch the sheet against that of modes that only bend it",
)
