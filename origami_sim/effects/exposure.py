"""Motion blur: of an exposure or a moving average, each value a mean over the time before it."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read

NODES = np.polynomial.legendre.leggauss(6)
"""Quadrature over -1 to 1: exact for motions that are polynomials in time up to degree 11."""


def apply(read: Read, times: np.ndarray, exposure: np.ndarray) -> np.ndarray:
    """What was before the first time is told by who reads: rest, or the motion that went on."""
    if not np.any(exposure):
        return read(times)
    x, weight = NODES
    past = times - (0.5 * (1 + x))[:, None, None] * exposure
    values = read(past.reshape(-1, past.shape[-1]))
    values = values.reshape(len(x), len(times), *values.shape[1:])
    return np.einsum("k,kndw->ndw", weight / 2, values)


EFFECT = Effect(
    name="exposure",
    family="measurement",
    force=None,
    apply=apply,
    channels=(),
    parameters=(Parameter("exposure", "w", "s", 0.0, (0.0, 1.0), "length of the average", typical=0.02),),
    fitted=("exposure",),
    formula="y(t) = mean of x from t - w to t",
    source="exposure of a camera, moving average of a tracker; Gauss-Legendre quadrature",
    matters="a frame, 10 to 40 ms; takes (w omega)^2 / 24 off the amplitude of a sine and delays it by w / 2",
    confused_with="viscous loss, lag of the drive",
    separated_by="a faster camera; film a pendulum of known decay",
)
