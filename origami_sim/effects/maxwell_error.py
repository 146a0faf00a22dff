"""Strength error of a dielectric stack: it is stronger or weaker than its model says."""

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
    maxwell_gain: scalar,
):
    return maxwell_gain * nominal.moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)


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
    maxwell_gain: scalar,
):
    return maxwell_gain * nominal.energy(
        angle, voltage, permittivity, layer_thickness, layers, lever, width, constraint, side
    )


EFFECT = Effect(
    name="maxwell_error",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        *STACK,
        Parameter("maxwell_gain", "e", "-", 0.0, (-1.0, 3.0), "relative error of the moment", typical=0.1),
    ),
    fitted=("maxwell_gain",),
    uneven=True,
    formula="M = e M_Maxwell, beside M_Maxwell of maxwell_stress",
    source="half the pressure on each face (seed paper) against p = eps_r eps0 (V/t)^2: e = -1/2; overlap 1 - d / b",
    matters="1/2 for a pressure applied by halves; 5 to 10 % for misaligned or uneven electrodes, permittivity",
    confused_with="modulus and thickness of the stack, stiff electrodes: constant factors at every voltage",
    separated_by="passive stiffness, first natural frequency; capacitance; uneven electrodes act on single creases",
)
