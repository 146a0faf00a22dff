"""Forces that act now and then: stretches of a recording that a fit misses by more than the others.

Noise of a recorder is alike throughout, or comes in bursts that neighbouring frames show. A push of some frames is
neither: it is as smooth as the motion, and leaves most stretches alone. Averaged over all of them it would pass for the
slow noise of a tracker.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logsumexp

from origami_sim.fit.hyper import HYPER
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.residual_process import ORDER, autocovariance

ROUNDS = 60
"""Steps of expectation and maximisation; two levels that differ have settled long before: half and double
change nothing of the odds of 121 of pushes."""

FEWEST = 8
"""Stretches of which two kinds are told. In 300 drawings of noise of 4 to 19 stretches the probability of two kinds is
at most 0.33; with half as few 0.48, with double 0.27."""


@dataclass(frozen=True, eq=False)
class Bursts:
    """Stretches of two kinds.

    Attributes:
        odds: log likelihood ratio of two levels of what is missed to one, less what more numbers cost (Schwarz 1978).
        level: (D,) deviations in the quiet stretches [SI]. share: of the stretches that are missed by more.
        times: so many times the level of the others.
    """

    odds: float
    level: np.ndarray
    share: float = 0.0
    times: float = 1.0

    @property
    def probability(self) -> float:
        """That forces act now and then, if that is as probable beforehand as a law that the catalogue lacks."""
        return float(expit(self.odds + np.log(HYPER.unlisted)))


def bursts(f: Fit) -> Bursts:
    """Whether a fit misses some stretches by more than others, though neighbouring frames scatter alike in all."""
    level = np.nan_to_num(f.rms())
    best = Bursts(-np.inf, level)
    for d in range(len(level)):
        columns = [r[:, d] for r in f.residuals if np.isfinite(r[:, d]).sum() > ORDER]
        smooth = _two_levels(columns)
        if smooth is None or smooth[0] <= best.odds:
            continue
        rough = _two_levels([c[2:] - 2.0 * c[1:-1] + c[:-2] for c in columns])
        if rough is None or rough[0] < 0.0:
            odds, quiet, share, times = smooth
            best = Bursts(odds, np.where(np.arange(len(level)) == d, quiet, best.level), share, times)
    return best


def _two_levels(columns: list[np.ndarray]) -> tuple[float, float, float, float] | None:
    """Log odds of two levels, the lower one, the share of segments with the higher one, and their ratio.

    Mean squares of segments are gamma distributed, with as many degrees of freedom as their correlation leaves.
    """
    columns = [c for c in columns if np.isfinite(c).sum() > 2]
    if len(columns) < FEWEST:
        return None
    square = np.array([float(np.nanmean(np.square(c))) for c in columns])
    covariance, _ = autocovariance(columns, min(ORDER, min(len(c) for c in columns) - 1))
    if square.min() <= 0.0 or covariance[0] <= 0.0:
        return None
    alike = 1.0 + 2.0 * float(np.sum((covariance[1:] / covariance[0]) ** 2))
    half = np.array([np.isfinite(c).sum() / alike / 2.0 for c in columns])

    def log_density(variance: float | np.ndarray) -> np.ndarray:
        return -half * (np.log(variance) + square / variance)

    one = float(np.sum(log_density(np.average(square, weights=half))))
    levels, share = np.quantile(square, [0.25, 0.95]), np.array([0.8, 0.2])
    log = np.stack([log_density(v) for v in levels]) + np.log(share)[:, None]
    for _ in range(ROUNDS):
        weight = np.exp(log - logsumexp(log, axis=0)) * half
        levels = np.maximum(weight @ square / np.maximum(weight.sum(axis=1), 1e-300), 1e-300)
        share = np.clip((weight / half).mean(axis=1), 1e-6, 1.0)
        log = np.stack([log_density(v) for v in levels]) + np.log(share)[:, None]
    two = float(np.sum(logsumexp(log, axis=0)))
    low, high = np.sort(np.sqrt(levels))
    return two - one - np.log(len(columns)), float(low), float(share[np.argmax(levels)]), float(high / low)
