"""Whitening of numbers that are correlated over a few frames: banded Cholesky factors of their correlation."""

from functools import lru_cache

import numpy as np
from scipy.linalg import cholesky_banded, lapack

from origami_sim.errors import InputError


def factor(correlation: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor, by diagonals [Q + 1, m], of the correlation matrix of readings in some frames.

    Args:
        correlation: (Q + 1,) of readings 0 to Q frames apart; beyond Q there is none. frames: (m,) increasing numbers.

    Raises:
        InputError: no process has this correlation.
    """
    correlation = correlation[: frames[-1] - frames[0] + 1]
    made = _factor(np.asarray(correlation, float).tobytes(), np.asarray(frames, np.int64).tobytes())
    return np.frombuffer(made).reshape(len(correlation), len(frames))


@lru_cache(maxsize=1024)
def _factor(colour: bytes, frames: bytes) -> bytes:
    correlation, number = np.frombuffer(colour), np.frombuffer(frames, np.int64)
    q, m = len(correlation), len(number)
    bands = np.zeros((q, m))
    for d in range(min(q, m)):
        apart = number[d:] - number[: m - d]
        bands[d, : m - d] = np.where(apart < q, correlation[np.minimum(apart, q - 1)], 0.0)
    for rounding in (0.0, 1e-8, 1e-6, 1e-4):  # a correlation that was cut off may be no correlation by that much
        try:
            bands[0] = 1.0 + rounding
            return np.ascontiguousarray(cholesky_banded(bands, lower=True)).tobytes()
        except np.linalg.LinAlgError:
            continue
    raise InputError("no noise has this correlation", field="colour", value=correlation[:4].tolist())


def divided(bands: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Columns [m, k] of correlated numbers as independent ones: divided by their factor."""
    return lapack.dtbtrs(bands, np.asfortranarray(columns), uplo="L")[0]


def multiplied(bands: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Columns [m, k] of independent numbers as correlated ones: multiplied by their factor."""
    out = bands[0][:, None] * columns
    for d in range(1, len(bands)):
        out[d:] += bands[d, :-d, None] * columns[:-d]
    return out
