"""Panel flexibility error: panels that bend more, or less, than thought."""

import math

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects.crease_softness import energy, moment

EFFECT = Effect(
    name="panel_softness",
    family="bend",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "stiffness_change", "dk", "N m/rad", 0.0, (-10.0, 10.0),
            "added to the stiffness of one bending line; above minus that", typical=-2e-4,
        ),
        Parameter("rest_angle", "phi0", "rad", 0.0, (-math.pi, math.pi), "that of the line", typical=0.0),
    ),
    fitted=("stiffness_change",),
    uneven=True,
    stiffness=lambda p: np.abs(p["stiffness_change"]),
    formula="M = -dk (phi - phi0)",
    source="plate hinge, see panel_bending",
    matters="tip of a panel turns further than its root, by 3 degrees over a box flap at 0.2 T; base that bends",
    confused_with="crease softness",
    separated_by="image of the panel's shape; glue the base to a plate",
)  # fmt: skip
