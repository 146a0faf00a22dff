"""Panel contact: a spring and dashpot between what comes nearer than both thicknesses allow."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, rate: scalar, stiffness: scalar, loss_time: scalar):
    return wp.max(-stiffness * (gap + loss_time * rate), scalar(0.0))


@wp.func
def energy(gap: scalar, stiffness: scalar):
    return scalar(0.5) * stiffness * gap * gap


EFFECT = Effect(
    name="touch",
    family="pair",
    force=force,
    energy=energy,
    parameters=(
        Parameter(
            "thickness", "h", "m", 0.0, (0.0, math.inf), "of the panel; surfaces touch half of it off its middle"
        ),
        Parameter("stiffness", "kp", "N/m", 0.0, (0.0, math.inf), "of each pair that touches", typical=100.0),
        Parameter("loss_time", "tau", "s", 0.0, (0.0, math.inf), "dashpot over spring; 2 zeta sqrt(m / kp)"),
    ),
    fitted=("stiffness",),
    stated=("thickness",),
    stiffness=lambda p: p["stiffness"],
    damping=lambda p: p["stiffness"] * p["loss_time"],
    formula="fn = max(-kp (gap + tau dgap/dt), 0) while gap < 0,  gap = distance of the middle planes - (h1 + h2) / 2",
    source="penalty between corners and triangles and between edges: Bridson, Fedkiw & Anderson 2002; their "
    "distances are unsigned, so what is pressed by more than half of the thickness is refused, not passed through",
    matters="folds that close on other panels, rolls, stacks, boxes; nothing where no two panels come near",
    confused_with="crease_stop, crease_contact, stiffening creases",
    separated_by="put paper of known thickness between the panels; film the moment of closing",
)
