"""Tracker lag: of first order, by the tracker or a smoothing filter."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read

NODES = np.polynomial.laguerre.laggauss(12)
"""Quadrature over exp(-s): exact for motions that are polynomials in time up to degree 23."""


def apply(read: Read, times: np.ndarray, tracker_lag: np.ndarray) -> np.ndarray:
    """What was before the first time is told by who reads: rest, or the motion that went on."""
    if not np.any(tracker_lag):
        return read(times)
    x, weight = NODES
    past = times - x[:, None, None] * tracker_lag
    values = read(past.reshape(-1, past.shape[-1]))
    values = values.reshape(len(x), len(times), *values.shape[1:])
    return np.einsum("k,kndw->ndw", weight, values)


EFFECT = Effect(
    name="tracker_lag",
    family="measurement",
    force=None,
    apply=apply,
    channels=(),
    parameters=(Parameter("tracker_lag", "tau", "s", 0.0, (0.0, 1.0), "time constant", typical=0.01),),
    fitted=("tracker_lag",),
    formula="tau dy/dt = x - y, as the mean of x(t - s) weighted by exp(-s / tau) / tau",
    source="exponential smoothing; Gauss-Laguerre quadrature",
    matters="5 to 50 ms; takes amplitude off fast motion as damping does",
    confused_with="viscous loss, lag of the drive",
    separated_by="a faster camera; film a pendulum of known decay",
)
