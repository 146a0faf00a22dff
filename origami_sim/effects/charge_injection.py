"""Trapped charge: in the dielectric, a built-in voltage that does not reverse with the drive."""

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
    trapped_voltage: scalar,
):
    before = nominal.moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)
    total = voltage + trapped_voltage
    return nominal.moment(total, permittivity, layer_thickness, layers, lever, width, constraint, side) - before


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
    trapped_voltage: scalar,
):
    m = moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side, trapped_voltage)
    return -angle * m


EFFECT = Effect(
    name="charge_injection",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        *STACK,
        Parameter("trapped_voltage", "V0", "V", 0.0, (-2e4, 2e4), "voltage that the charge is worth", typical=200.0),
    ),
    fitted=("trapped_voltage",),
    formula="M = M_Maxwell(V + V0) - M_Maxwell(V), so 2 V V0 + V0^2 in place of V^2",
    source="homocharge at the electrodes (Sessler, Electrets, 1987), its field taken as uniform",
    matters="remanent moment at V = 0 and a part odd in V: 200 V on 4 kV give 10 %",
    confused_with="rest-angle drift, offset of the amplifier (which acts on all stacks alike)",
    separated_by="reverse the polarity; short the electrodes and wait",
)
