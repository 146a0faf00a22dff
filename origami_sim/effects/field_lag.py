"""Lag of the field behind the command: inductance of the coils, eddy currents, a slow amplifier."""

import numpy as np

from origami_sim.drive import CHANNELS, Drive, series
from origami_sim.effects._effect import Effect, Parameter


def lagging(times: np.ndarray, values: np.ndarray, lag: np.ndarray) -> np.ndarray:
    """First-order lag of sampled values [n, W] with time constants [W] [s], exact for values linear between samples."""
    lag = np.maximum(lag, 1e-9)
    out = np.empty(np.broadcast_shapes(values.shape, (1, len(lag))))
    out[0] = values[0]
    for n, h in enumerate(np.diff(times)):
        decay = np.exp(-h / lag)
        slope = (values[n + 1] - values[n]) / h
        out[n + 1] = values[n + 1] - slope * lag + (out[n] - values[n] + slope * lag) * decay
    return out


def apply(drive: Drive, duration: float, lag: np.ndarray) -> Drive:
    if not np.any(lag):
        return drive
    moving = [c for c in CHANNELS[:3] if not drive[c].is_zero]
    if not moving:
        return drive
    times, values = drive.series(moving, duration)
    return drive.replace(**{c: series(times, lagging(times, v, lag)) for c, v in zip(moving, values, strict=True)})


EFFECT = Effect(
    name="field_lag",
    family="drive",
    force=None,
    apply=apply,
    parameters=(Parameter("lag", "tau", "s", 0.0, (0.0, 1.0), "time constant of the field", typical=0.01),),
    fitted=("lag",),
    formula="tau dB/dt = B_command - B",
    source="first-order lag of an electromagnet (L/R, and eddy currents in its core)",
    matters="0.05 to 0.5 s for iron-core magnets: at 1 Hz half of the amplitude can be missing",
    confused_with="viscous loss in the creases",
    separated_by="measure B(t) at the device; ring-down in constant field",
)
