"""Level and colour of what a fit leaves, as an autoregressive process."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_toeplitz

from origami_sim.fit.noise import STATED

ORDER = 12
"""Highest order of the process; the criterion chooses. Half and double of it changed no word, number or probability of
four swings."""

GRID = 512
"""Frequencies at which the spectrum is followed; a process that remembers longer than so many frames is a drift."""

NEGLIGIBLE = 1e-3
"""Correlation that is taken as none: far below what data tell of it."""


def residual_process(columns: Sequence[np.ndarray], noise: float) -> tuple[float, np.ndarray, float]:
    """Standard deviation [SI], correlation (Q + 1,) and log prior probability of residuals of one component.

    An autoregressive process is fitted to all segments together (Yule-Walker); the Bayesian information criterion
    chooses its order (Schwarz 1978), so that white noise stays white. Its level is no lower than that of the noise. The
    prior is normal in the logarithm of the level over the noise; what the criterion charges for the order is charged
    here as well.

    Args:
        columns: (n,) residuals of each segment [SI], nan where missing. noise: standard deviation of a reading [SI].
    """
    longest = max(map(len, columns))
    order = min(ORDER, longest // 3)
    products, count = autocovariance(columns, order)
    level = max(float(np.sqrt(products[0])), noise)
    log_prior = level_prior(level, noise)
    best, found = 0.0, np.zeros(0)
    for p in range(1, order + 1 if products[0] > 0.0 and count > order else 1):
        a = solve_toeplitz(products[:p], products[1 : p + 1])
        left = 1.0 - a @ products[1 : p + 1] / products[0]
        if left <= 0.0:
            break
        criterion = count * np.log(left) + p * np.log(count)
        if criterion < best:
            best, found = criterion, a
    if not len(found):
        return level, np.ones(1), log_prior
    response = np.fft.rfft(np.concatenate([[1.0], -found]), 2 * GRID)
    covariance = np.fft.irfft(1.0 / np.abs(response) ** 2)[:GRID]
    colour = covariance / covariance[0]
    last = int(np.flatnonzero(np.abs(colour) > NEGLIGIBLE)[-1])
    return level, np.ascontiguousarray(colour[: last + 1]), log_prior - 0.5 * len(found) * float(np.log(count))


def level_prior(level: float, noise: float) -> float:
    """Log prior probability of the level of residuals, normal in its logarithm over the noise of a reading."""
    return -0.5 * float(np.log(level / noise) / STATED) ** 2


def autocovariance(columns: Sequence[np.ndarray], lags: int) -> tuple[np.ndarray, int]:
    """Products (lags + 1,) of residuals that many frames apart, over all segments, per frame that was seen; these."""
    apart = np.zeros(lags)
    joined = np.concatenate([part for c in columns for part in (c, apart)])
    known = np.isfinite(joined)
    seen, filled = int(np.count_nonzero(known)) - lags * len(columns), np.where(known, joined, 0.0)
    return np.array([filled[: len(filled) - k] @ filled[k:] for k in range(lags + 1)]) / max(seen, 1), seen
