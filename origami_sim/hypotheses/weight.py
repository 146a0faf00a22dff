"""Gravity as a recording states it: an object may lie in one, hang in another and stand on its head in a third."""

import numpy as np

from origami_sim.effects import get
from origami_sim.model import Model, Parameters
from origami_sim.physics.materials import G
from origami_sim.recording import Gravity

AXES = ("gravity_x", "gravity_y", "gravity_z")


def weighed(model: Model, parameters: Parameters, gravity: Gravity | None) -> tuple[Model, Parameters]:
    """The model with gravity in the direction that was stated, in every law of it that has one.

    Where only a direction is stated, gravity is as large as the model has it in each world (so that it can be fitted),
    or standard gravity. A model without weight gets it. None leaves everything as it is.
    """
    if gravity is None:
        return model, parameters
    size = np.full((1, 1), G)
    if "gravity" in model.effects:
        size = np.linalg.norm([parameters["gravity", a] for a in AXES], axis=0)
        size = np.where(np.any(size > 0.0), size, G)
    else:
        model = model.with_effects("gravity")
        parameters = parameters.for_model(model)
    out = parameters.copy()
    for effect in model.effects:
        if AXES[0] in {p.name for p in get(effect).parameters}:
            strength = size if effect == "gravity" else size.mean(axis=0, keepdims=True)
            for axis, part in zip(AXES, gravity.direction, strict=True):
                out.set(effect, axis, part * (strength if gravity.size is None else gravity.size))
    return model, out
