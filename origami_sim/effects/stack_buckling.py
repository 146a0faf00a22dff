"""Stack buckling: moment lost where the electroded area lifts off its substrate above a threshold voltage."""

import warp as wp

from origami_sim.effects import maxwell_stress as nominal
from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.effects._stack import STACK


@wp.func
def moment(
    voltage: scalar,
    permittivity: scalar,
    layer_thickness: scalar,
    layers: scalar,
    lever: scalar,
    width: scalar,
    constraint: scalar,
    side: scalar,
    lost_share: scalar,
    buckling_voltage: scalar,
):
    buckled = scalar(0.0)
    if wp.abs(voltage) > buckling_voltage:
        ratio = buckling_voltage / voltage
        buckled = scalar(1.0) - ratio * ratio
    m = nominal.moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    return -lost_share * buckled * m


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
    lost_share: scalar,
    buckling_voltage: scalar,
):
    return -angle * moment(
        voltage, permittivity, layer_thickness, layers, lever, width, constraint, side, lost_share, buckling_voltage
    )


EFFECT = Effect(
    name="stack_buckling",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        *STACK,
        Parameter("lost_share", "f", "-", 0.0, (0.0, 1.0), "share of the thrust beyond buckling lost", typical=0.5),
        Parameter(
            "buckling_voltage",
            "Vc",
            "V",
            4550.0,
            (1.0, 1e5),
            "voltage at which it buckles",
            typical=3000.0,
            threshold="voltage",
        ),
    ),
    fitted=("lost_share", "buckling_voltage"),
    formula="M = -f (1 - Vc^2 / V^2) M_Maxwell for |V| > Vc: a buckled strip carries its buckling thrust and no more",
    source="clamped strip, thrust p H against 4 pi^2 D / b^2; post-buckling at constant thrust for f = 1",
    matters="above about 4.5 kV for a 15 mm wide area bonded at its edges only",
    confused_with="pull-in and breakdown, leakage, saturation by friction",
    separated_by="profile of the surface at rising and falling voltage",
)
