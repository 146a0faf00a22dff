"""Thrust of a dielectric elastomer along its strip: the membrane's share of the Maxwell stress."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar
from origami_sim.physics.materials import EPS0


@wp.func
def tension(
    voltage: scalar, permittivity: scalar, layer_thickness: scalar, layers: scalar, width: scalar, constraint: scalar
):
    e = voltage / layer_thickness
    return -constraint * permittivity * scalar(EPS0) * e * e * layer_thickness * layers * width


@wp.func
def energy(
    length: scalar,
    voltage: scalar,
    permittivity: scalar,
    layer_thickness: scalar,
    layers: scalar,
    width: scalar,
    constraint: scalar,
):
    return length * tension(voltage, permittivity, layer_thickness, layers, width, constraint)


EFFECT = Effect(
    name="maxwell_membrane",
    family="bar",
    force=tension,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("permittivity", "eps_r", "-", 4.7, (1.0, 100.0), "relative permittivity"),
        Parameter("layer_thickness", "t", "m", 272.8e-6, (1e-7, 1.0), "thickness of one layer"),
        Parameter("layers", "n", "-", 0.0, (0.0, 1000.0), "number of active layers"),
        Parameter("width", "w", "m", 0.0, (0.0, math.inf), "electroded width that the bar stands for"),
        Parameter("constraint", "chi", "-", 1.0, (0.0, 1.0), "1 if the width is blocked, 1/2 if it is free"),
    ),
    formula="T = -chi w n t eps_r eps0 (V/t)^2",
    source="Maxwell stress eps_r eps0 (V/t)^2 (seed paper Eq. 1, Pelrine et al. 1998), full pressure, plane sections",
    matters="where the ends are held: the thrust against them takes the moment off, and may buckle the sheet",
    confused_with="maxwell_stress, thermal expansion, a pre-stretch",
    separated_by="force on a clamp against voltage; letting one end slide",
)
