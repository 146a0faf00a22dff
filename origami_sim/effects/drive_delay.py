"""Drive delay: all drives reach the device late by the same time."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import at, sampled


def apply(drive: Drive, duration: float, delay: np.ndarray) -> Drive:
    def late(times: np.ndarray, values: np.ndarray) -> np.ndarray:
        return at(times, values, times[:, None] - delay)

    return sampled(drive, list(drive.signals), duration, late, when=delay)


EFFECT = Effect(
    name="drive_delay",
    family="drive",
    force=None,
    apply=apply,
    channels=("drive",),
    parameters=(
        Parameter("delay", "d", "s", 0.0, (0.0, 1.0), "dead time; the first value holds for so long", typical=0.01),
    ),
    fitted=("delay",),
    formula="u(t) = u_command(t - d)",
    source="dead time of amplifiers, communication and logging",
    matters="milliseconds in hardware, a video frame and more where logs are aligned by hand",
    confused_with="viscous loss, lag of the field, a camera whose clock is off",
    separated_by="one instrument for drive and motion; frequency sweep: the phase grows without bound",
)
