"""Clock offset: the recorder's clock is set off from that of the drive."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, clock_delay: np.ndarray) -> np.ndarray:
    return read(times - clock_delay)


EFFECT = Effect(
    name="clock_delay",
    family="measurement",
    force=None,
    apply=apply,
    channels=(),
    parameters=(Parameter("clock_delay", "d", "s", 0.0, (-1.0, 1.0), "lateness of the recording", typical=0.01),),
    fitted=("clock_delay",),
    formula="y(t) = x(t - d)",
    source="trigger delay; recordings aligned by hand",
    matters="a frame or two, 10 to 100 ms",
    confused_with="viscous loss, lag or delay of the drive",
    separated_by="a lamp in the picture that the drive switches; free ring-down: a delay leaves its decay alone",
)
