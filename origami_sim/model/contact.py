"""Contact between panels as it acts in a model: what was stated of it, or what acts where nothing was stated."""

import numpy as np

from origami_sim.model.model import SURFACE, Model, Parameters

FRICTION = 0.5
"""Coefficient of friction between panels of which none is stated: paper on paper, rubber on rubber 0.3 to 1.

Half and double change how far panels slide on each other, not that they keep each other off.
"""

CONTACT = ("touch", "touch_friction")
"""The effects by which panels touch."""


def set_contact(
    parameters: Parameters,
    thickness: np.ndarray | float,
    stiffness: np.ndarray,
    loss_time: np.ndarray,
    friction: float,
) -> None:
    """Sets how each triangle touches: its thickness [m], stiffness [N/m], loss time [s], and friction."""
    parameters.set("touch", "thickness", thickness).set("touch", "stiffness", stiffness)
    parameters.set("touch", "loss_time", loss_time)
    parameters.set("touch_friction", "friction_coefficient", friction)
    parameters.set("touch_friction", "stiffness", np.maximum(stiffness, 1e-9))
    parameters.set("touch_friction", "damping", stiffness * loss_time)


def may_touch(model: Model, parameters: Parameters) -> bool:
    """Whether panels touch as soon as they come near each other, which was neither stated nor excluded."""
    return "touch" not in model.laws and bool(np.any(parameters["surface", "thickness"] > 0))


def engaged(model: Model, parameters: Parameters, stiffer: float = 1.0) -> tuple[Model, Parameters]:
    """The model with contact between panels of which nothing was stated, as it acts where they come near each other.

    The same model and parameters, where contact was stated or excluded.

    Args:
        stiffer: factor on the stiffness; what is lost where panels meet stays the same.
    """
    if not may_touch(model, parameters):
        return model, parameters
    out = model.with_effects(*CONTACT)
    own = parameters.for_model(out)
    thickness, stiffness, loss_time = (parameters["surface", n] for n in SURFACE)
    set_contact(own, thickness, stiffer * stiffness, loss_time / np.sqrt(stiffer), FRICTION)
    return out, own
