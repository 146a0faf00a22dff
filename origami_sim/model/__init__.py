"""The discrete model that everything else is about: nodes, hinges and triangles, their numbers and their state."""

from origami_sim.model.model import (
    ALIKE,
    BODY,
    GRIPS,
    PADS,
    STATED,
    SURFACE,
    Model,
    Parameters,
    State,
    beside,
    carried_sides,
    check_state,
    dihedral_angles,
    magnets,
    node_mass,
)

__all__ = [
    "ALIKE",
    "BODY",
    "GRIPS",
    "PADS",
    "STATED",
    "SURFACE",
    "Model",
    "Parameters",
    "State",
    "beside",
    "carried_sides",
    "check_state",
    "dihedral_angles",
    "magnets",
    "node_mass",
]
