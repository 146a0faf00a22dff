"""Viscous damping: Kelvin-Voigt loss of a crease."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(rate: scalar, viscosity: scalar):
    return -viscosity * rate


EFFECT = Effect(
    name="crease_viscosity",
    family="crease",
    force=moment,
    parameters=(
        Parameter(
            "viscosity", "c", "N m s/rad", 0.0, (0.0, math.inf), "beta K, with tan delta = beta omega", typical=1e-5
        ),
    ),
    fitted=("viscosity",),
    damping=lambda p: p["viscosity"],
    formula="M = -c dtheta/dt,  c = beta K",
    source="Kelvin-Voigt solid",
    matters="ring-down and phase lag of folds; silicone has tan delta 0.05-0.15 at 1-20 Hz",
    confused_with="lag of the drive; Prony relaxation at a single frequency; dry friction at a single amplitude",
    separated_by="ring-down at constant field; loop area against frequency and amplitude",
)
