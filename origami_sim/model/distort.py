"""The drive as it reaches the device: what leads, magnets and supplies make of what was commanded."""

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.model.model import Model, Parameters


def distorted(model: Model, parameters: Parameters, drive: Drive, duration: float) -> Drive:
    """The drive after all "drive" effects of the model, in their order, up to `duration` [s]."""
    for name in model.effects:
        effect = get(name)
        if effect.family == "drive" and effect.apply is not None:
            drive = effect.apply(drive, duration, **{n: v[0] for n, v in parameters.of(name).items()})
    return drive
