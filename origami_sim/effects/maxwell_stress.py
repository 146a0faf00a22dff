"""Moment of a dielectric-elastomer stack about its hinge, from the Maxwell stress of each layer."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.materials import EPS0


@wp.func
def unit_moment(
    voltage: scalar, permittivity: scalar, layer_thickness: scalar, layers: scalar, lever: scalar, width: scalar
):
    # layers of equal thickness, centred at `lever`: the sum of (z_i - z_n) is layers * lever
    e = voltage / layer_thickness
    return permittivity * scalar(EPS0) * e * e * layer_thickness * layers * lever * width


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
):
    return side * constraint * unit_moment(voltage, permittivity, layer_thickness, layers, lever, width)


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
):
    return -angle * moment(voltage, permittivity, layer_thickness, layers, lever, width, constraint, side)


PARAMETERS = (
    Parameter("permittivity", "eps_r", "-", 4.7, (1.0, 100.0), "relative permittivity"),
    Parameter("layer_thickness", "t", "m", 272.8e-6, (1e-7, 1.0), "thickness of one layer"),
    Parameter("layers", "n", "-", 0.0, (0.0, 1000.0), "number of active layers"),
    Parameter("lever", "a", "m", 0.0, (-1.0, 1.0), "middle of the active stack above the neutral axis"),
    Parameter("width", "w", "m", 0.0, (0.0, math.inf), "electroded width"),
    Parameter("constraint", "chi", "-", 1.0, (0.0, 1.0), "1 if the substrate blocks the width, 1/2 if it is free"),
    Parameter("side", "s", "-", -1.0, (-1.0, 1.0), "-1 if the stack is on the valley side, which then opens"),
)

EFFECT = Effect(
    name="maxwell_stress",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=PARAMETERS,
    formula="M = s chi w sum_i eps_r eps0 (V/t)^2 t (z_i - z_n)",
    source="Maxwell stress eps_r eps0 (V/t)^2 (seed paper Eq. 1, Pelrine et al. 1998), full pressure, plane sections",
    matters="the drive of every dielectric device; quadratic in V, even under reversal",
    confused_with="modulus, electrode thickness: constant factors",
    separated_by="passive stiffness, first natural frequency",
)
