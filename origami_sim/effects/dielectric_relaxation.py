"""Dielectric relaxation: polarisation that follows the voltage only slowly."""

import warp as wp

from origami_sim.effects import maxwell_stress as nominal
from origami_sim.effects._effect import Effect, Memory, Parameter, scalar
from origami_sim.effects._lag import following
from origami_sim.effects._stack import STACK


@wp.func
def moment(
    dt: scalar,
    voltage: scalar,
    slow_moment: scalar,
    full_moment: scalar,
    permittivity: scalar,
    layer_thickness: scalar,
    layers: scalar,
    lever: scalar,
    width: scalar,
    constraint: scalar,
    side: scalar,
    slow_share: scalar,
    polarisation_time: scalar,
):
    full = nominal.moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    now = following(slow_moment, full_moment, full, dt, polarisation_time)
    return slow_share * now, now, full


EFFECT = Effect(
    name="dielectric_relaxation",
    family="crease",
    force=moment,
    memory=(Memory("slow_moment"), Memory("full_moment")),
    parameters=(
        *STACK,
        Parameter("slow_share", "d", "-", 0.0, (0.0, 1.0), "slow share, beyond the permittivity given", typical=0.1),
        Parameter("polarisation_time", "tau", "s", 1.0, (1e-6, 1e6), "its time constant", typical=0.5),
    ),
    fitted=("slow_share", "polarisation_time"),
    formula="M = d q,  tau dq/dt = M_Maxwell - q",
    source="Debye relaxation of the permittivity, with the moment as its measure: 4.2 at kilohertz, 4.7 at rest (VHB)",
    matters="after a step of voltage the moment creeps up by 10 %",
    confused_with="creep of the elastomer, leakage, slow supply",
    separated_by="current into the stack after a step; alternating drive; passive creep test",
)
