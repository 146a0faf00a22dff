"""Strain-dependent permittivity: it falls as the layers are stretched."""

import warp as wp

from origami_sim.effects import maxwell_stress as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._stack import STACK


@wp.func
def moment(
    angle: scalar,
    voltage: scalar,
    permittivity: scalar,
    layer_thickness: scalar,
    layers: scalar,
    lever: scalar,
    width: scalar,
    constraint: scalar,
    side: scalar,
    hinge_length: scalar,
    permittivity_slope: scalar,
):
    strain = side * lever * angle / hinge_length
    return (
        -permittivity_slope
        * strain
        * nominal.moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    )


@wp.func
def energy(
    angle: scalar,
    voltage: scalar,
    permittivity: scalar,
    layer_thickness: scalar,
    layers: scalar,
    lever: scalar,
    width: scalar,
    constraint: scalar,
    side: scalar,
    hinge_length: scalar,
    permittivity_slope: scalar,
):
    strain = side * lever * angle / hinge_length
    return (
        -permittivity_slope
        * strain
        * scalar(0.5)
        * nominal.energy(angle, voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    )


EFFECT = Effect(
    name="strain_permittivity",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        *STACK,
        Parameter(
            "hinge_length", "l", "m", 0.01, (1e-6, 1e3), "length of sheet that bends with this hinge", typical=0.01
        ),
        Parameter("permittivity_slope", "c", "-", 0.0, (-5.0, 5.0), "relative loss per strain", typical=0.5),
    ),
    fitted=("permittivity_slope",),
    formula="M = -c e M_Maxwell,  e = s a theta / l the strain in the middle of the stack",
    source="eps = eps_r (1 - c (lambda - 1)), Wissler & Mazza 2007 (VHB 4910); electrostriction is a constant factor",
    matters="takes from, or with c < 0 adds to, the part that grows as V^4; with one soft layer some percent",
    confused_with="thinning of the layers (of opposite sign), leakage",
    separated_by="capacitance against strain, imposed without voltage",
)
