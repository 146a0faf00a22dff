"""What the laws of masses have in common: the acceleration of gravity that acts on them."""

from origami_sim.effects._effect import Parameter

GRAVITY = tuple(
    Parameter(f"gravity_{a}", f"g{a}", "m/s^2", 0.0, (-100.0, 100.0), f"as of gravity, along {a}") for a in "xyz"
)
"""Zero unless stated: a suspect that is added to a model takes over the values of its `gravity`; where the model has
none, as of a horizontal rig, a mass is inertia alone."""
