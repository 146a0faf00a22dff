"""Impact damping: of a foot that lands, a dashpot on the way in, so that it rebounds more slowly than it came."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, rate: scalar, impact_damping: scalar):
    value = scalar(0.0)
    if gap < scalar(0.0):
        value = impact_damping * wp.max(-rate, scalar(0.0))
    return value


EFFECT = Effect(
    name="restitution",
    family="contact",
    force=force,
    parameters=(
        Parameter("impact_damping", "ci", "N s/m", 0.0, (0.0, math.inf), "2 zeta sqrt(kn m) of one foot", typical=0.1),
    ),
    fitted=("impact_damping",),
    damping=lambda p: p["impact_damping"],
    formula="fn = ci max(-dgap/dt, 0) while gap < 0; restitution exp(-zeta acos(zeta) / sqrt(1 - zeta^2))",
    source="half a Kelvin-Voigt contact: it takes energy while loading and never pulls; rubber rebounds with 0-0.3",
    matters="hops and rattles of snapping gaits; step that changes with the damping assumed",
    confused_with="friction, loss in the creases",
    separated_by="drop test; high-speed video; sweep of the frequency",
)
