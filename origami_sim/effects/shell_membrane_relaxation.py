"""Viscoelastic relaxation of a sheet that stretches: three Maxwell branches (Prony series) beside its elasticity."""

from origami_sim.effects._effect import Effect
from origami_sim.effects._plate import maxwell, relaxation

EFFECT = Effect(
    name="shell_membrane_relaxation",
    family="membrane",
    force=maxwell,
    **relaxation("A", "N/m", "membrane stiffness"),
    formula="N = A sum q_i,  dq_i/dt = g_i dE/dt - q_i / tau_i",
    matters=(
        "arches and buckled sheets between clamps: to flatten them is to compress them, so that the loss of a snap is "
        "this one as much as that of bending"
    ),
    confused_with="relaxation in bending, drag of the air",
    separated_by="decay of modes that stretch the sheet against that of modes that only bend it",
)
