"""What the laws of dielectric stacks have in common."""

import math

from origami_sim.effects._effect import Parameter

STACK = (
    Parameter("permittivity", "eps_r", "-", 4.7, (1.0, 100.0), "relative permittivity"),
    Parameter("layer_thickness", "t", "m", 272.8e-6, (1e-7, 1.0), "thickness of one layer"),
    Parameter("layers", "n", "-", 0.0, (0.0, 1000.0), "number of active layers"),
    Parameter("lever", "a", "m", 0.0, (-1.0, 1.0), "middle of the active stack above the neutral axis"),
    Parameter("width", "w", "m", 0.0, (0.0, math.inf), "electroded width"),
    Parameter("constraint", "chi", "-", 1.0, (0.0, 1.0), "1 if the substrate blocks the width, 1/2 if it is free"),
    Parameter("side", "s", "-", -1.0, (-1.0, 1.0), "-1 if the stack is on the valley side, which then opens"),
)
"""The stack of a hinge. A suspect that is added to a model takes over the values of its `maxwell_stress`: parameters
that are not fitted are copied from an effect of the same family that has one of the same name."""
