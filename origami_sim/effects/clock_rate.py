"""Clock rate error: the recorder's clock runs fast or slow."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, clock_rate: np.ndarray) -> np.ndarray:
    return read(times[:1] + (times - times[:1]) * (1 + clock_rate))


EFFECT = Effect(
    name="clock_rate",
    family="measurement",
    force=None,
    apply=apply,
    channels=(),
    parameters=(
        Parameter(
            "clock_rate", "e", "-", 0.0, (-0.2, 0.2), "time that passes per recorded time, less one", typical=0.01
        ),
    ),
    fitted=("clock_rate",),
    formula="y(t) = x(t0 + (1 + e) (t - t0))",
    source="frame rate of a camera taken as nominal; 29.97 for 30 frames per second is 0.1 %",
    matters="0.01 to 1 %: phase against the drive grows through the recording",
    confused_with="natural frequency: stiffness or mass",
    separated_by="a clock in the picture; length of the drive's period in the recording",
)
