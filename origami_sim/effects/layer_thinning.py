"""Layer thinning: extra Maxwell moment as the layers get thinner, to first order in the bend."""

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
    thinning: scalar,
):
    strain = side * lever * angle / hinge_length
    return (
        thinning
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
    thinning: scalar,
):
    strain = side * lever * angle / hinge_length
    return (
        thinning
        * strain
        * scalar(0.5)
        * nominal.energy(angle, voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    )


EFFECT = Effect(
    name="layer_thinning",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        *STACK,
        Parameter(
            "hinge_length", "l", "m", 0.01, (1e-6, 1e3), "length of sheet that bends with this hinge", typical=0.01
        ),
        Parameter("thinning", "k", "-", 0.0, (0.0, 10.0), "pressure gained per strain; 2 in theory", typical=2.0),
    ),
    fitted=("thinning",),
    formula="M = k e M_Maxwell,  e = s a theta / l the strain in the middle of the stack",
    source="thickness_thinning to first order: plane strain, incompressible, (1 + e)^2 - 1 = 2 e, so k = 2",
    matters="as thickness_thinning: below 1 % with many stiff layers, 6 % of the curvature with one; grows as V^4",
    confused_with="permittivity that changes with strain, softening of the stack",
    separated_by="curvature over V^2 against V^2; capacitance against strain",
)
