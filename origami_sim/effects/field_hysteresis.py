"""Field hysteresis: of an iron core, so that the field depends on where the current came from."""

import numpy as np

from origami_sim.drive import CHANNELS, Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import sampled


def play(values: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Play operator of samples [n, W]: the output follows once it is `width` [W] behind.

    Each sample clips the last output; clips that follow each other are one, so that doubling finds all (Blelloch 1990).
    """
    low, high, far = values - width, values + width, 1
    while far < len(low):
        low[far:], high[far:] = (np.clip(bound[:-far], low[far:], high[far:]) for bound in (low, high))
        far *= 2
    return np.clip(0.0, low, high)


def apply(drive: Drive, duration: float, coercive_field: np.ndarray) -> Drive:
    return sampled(drive, CHANNELS[:3], duration, lambda _, values: play(values, coercive_field), when=coercive_field)


EFFECT = Effect(
    name="field_hysteresis",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(Parameter("coercive_field", "Bc", "T", 0.0, (0.0, 0.5), "half width of the loop", typical=0.003),),
    fitted=("coercive_field",),
    formula="B = the last B kept within B_command -+ Bc, from no field at the start",
    source="play operator (Krasnoselskii & Pokrovskii 1989), by component",
    matters="1 to 5 mT of residual field; a loop against the current at any frequency",
    confused_with="friction of the creases, lag of the field",
    separated_by="plot against the measured field; 0.01 Hz loop",
)
