"""What is missed along a number of a model: its profile, of which a smooth model has one minimum."""

from collections.abc import Iterator

import numpy as np

from origami_sim.fit.least_squares import OWED, Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis

NUMBERS, PRIOR = 41, 2.0
"""Values of a number of the model that are tried, and within how many standard deviations of its prior.

A hundredth of a modulus known to ten moves the snap of an arch on its ramp by a swing's sixth, so that the next value
is within reach of derivatives.
"""


def along_numbers(forward: Predictor, f: Fit) -> Iterator[tuple[int, np.ndarray]]:
    """Each number of the model that moves it, and the numbers (NUMBERS, P) of a fit with its values over its prior."""
    for k, n in enumerate(forward.subject.nominals):
        if n.aligned or not np.isfinite(n.spread):
            continue
        values = n.start + PRIOR * n.spread * np.linspace(-1.0, 1.0, NUMBERS)
        thetas = np.repeat(f.theta[None], NUMBERS, axis=0)
        thetas[:, k] = np.clip(values, n.lower, n.upper)
        yield k, thetas


def missed(
    forward: Predictor, hypothesis: Hypothesis, thetas: np.ndarray, local: np.ndarray, weights: Weights
) -> np.ndarray:
    """(n,) squares that numbers (n, P) of a hypothesis leave, in white noise; infinite where they are unstable."""
    shot = forward.predict(hypothesis, thetas, np.repeat(local[None], len(thetas), axis=0))
    out = np.zeros(len(thetas))
    for block, values in zip(forward.blocks, shot, strict=True):
        gap = np.where(block.seen(), (block.values - values) / weights.deviation, 0.0)
        out += np.sum(np.where(np.isfinite(gap), gap, np.inf) ** 2, axis=(1, 2))
    return out


def several(squares: np.ndarray) -> bool:
    """Whether squares along a number have several minima, with more between them than what decides anything."""
    squares = np.minimum(squares, np.finfo(float).max)  # of what goes unstable
    lowest = np.minimum.accumulate(squares), np.minimum.accumulate(squares[::-1])[::-1]
    return bool(np.any(squares - np.maximum(*lowest) >= OWED))
