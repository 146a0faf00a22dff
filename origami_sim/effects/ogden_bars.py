"""Hyperelastic bars of the MERLIN kind: Green-Lagrange strain, Ogden stress with exponents 5 and 1."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def tension(length: scalar, area: scalar, modulus: scalar, rest_length: scalar):
    stretch = length / rest_length
    stress = scalar(0.25) * modulus * (stretch * stretch * stretch - scalar(1.0) / stretch)
    return area * stress * stretch


@wp.func
def energy(length: scalar, area: scalar, modulus: scalar, rest_length: scalar):
    stretch = length / rest_length
    s2 = stretch * stretch
    s5 = s2 * s2 * stretch
    return scalar(0.25) * modulus * area * rest_length * (s5 / scalar(5.0) - stretch + scalar(0.8))


EFFECT = Effect(
    name="ogden_bars",
    family="bar",
    force=tension,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("area", "A", "m^2", 0.0, (0.0, math.inf), "cross-section"),
        Parameter("modulus", "E0", "Pa", 0.0, (0.0, math.inf), "Young's modulus at zero strain"),
        Parameter("rest_length", "L0", "m", 1.0, (0.0, math.inf), "unstressed length"),
    ),
    stiffness=lambda p: p["area"] * p["modulus"] / p["rest_length"],
    formula="T = A l S,  S = (E0/4)(l^3 - 1/l),  l = L / L0",
    source="Liu & Paulino 2017, nonlinear mechanics of non-rigid origami (second Piola-Kirchhoff stress S)",
    matters="bars that strain by percents, as in Kresling cells",
    confused_with="bars with another modulus, below a percent of strain",
    separated_by="load against stroke at large stretch",
)
