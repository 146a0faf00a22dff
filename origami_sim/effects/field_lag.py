"""Field lag: behind the command, by inductance of the coils, eddy currents or a slow amplifier."""

import numpy as np

from origami_sim.drive import CHANNELS, Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import lagging, sampled, strengths


def apply(drive: Drive, duration: float, lag: np.ndarray) -> Drive:
    channels = [*CHANNELS[:12], *strengths(drive)]
    return sampled(drive, channels, duration, lambda times, values: lagging(times, values, lag), when=lag)


EFFECT = Effect(
    name="field_lag",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(Parameter("lag", "tau", "s", 0.0, (0.0, 1.0), "time constant of the field", typical=0.01),),
    fitted=("lag",),
    formula="tau dB/dt = B_command - B",
    source="first-order lag of an electromagnet (L/R, and eddy currents in its core)",
    matters="0.05 to 0.5 s for iron-core magnets: at 1 Hz half of the amplitude can be missing",
    confused_with="viscous loss in the creases",
    separated_by="measure B(t) at the device; ring-down in constant field",
)
