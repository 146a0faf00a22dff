"""Noise of a recorder that averages over frames, whose slow part neighbouring frames do not show."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.noise import Noise, infer
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.residual_process import autocovariance, level_prior
from origami_sim.fit.weights import Weights
from origami_sim.threads import shared

FILTER = 10
"""Frames over which recorders average, at most: trackers take medians of 3 and means of up to 7.

What is slower than twice as many has the spectral density of what is between once and twice as many, if it is noise. A
motion has to be slower than that. Seven objects with nothing missing are left at 0.96 to 1.05 times the noise (0.96 to
1.12 with 5, 0.96 to 1.01 with 20). Of two of them neighbouring frames, of a tracker that averages over 5, show a third
to a quarter. An asymmetry of d' 48 leaves 1.15 times the noise of a box (1.25, 1.11). No word of four swings changes.
"""


def fast_noise(forward: Predictor, f: Fit) -> np.ndarray:
    """(D,) standard deviations of what a fit leaves, what is slower than a filter up to the density of what is not.

    It is no less than the noise that was stated or read. Of load steps, which have no time, it is that.
    """
    noise, whole = forward.blocks[0].noise, [] if timeless(forward) else joined(forward, f)
    return np.array([flat_level([r[:, d] for r in whole], float(n)) if whole else n for d, n in enumerate(noise)])


def beyond_motion(forward: Predictor, whole: Sequence[np.ndarray], components: Sequence[int]) -> list[Noise]:
    """Noise of some components, read from series at the frequencies that no motion reaches, see `infer`."""
    rows = np.concatenate(whole)  # one recorder: what recordings leave follows on each other
    rows = rows[np.isfinite(rows).any(axis=1)]  # a lost frame would part a spectrum, as a long gap does
    times, noise = float(np.median(np.diff(forward.blocks[0].times))) * np.arange(len(rows)), forward.blocks[0].noise
    return shared([partial(infer, times, rows[:, d], stated=float(noise[d])) for d in components])


def recorder_weights(forward: Predictor, f: Fit) -> list[Weights]:
    """Noise that a recorder may have, of which a fit would leave nothing else: white, or as a tracker colours it.

    White noise is as large as what is left; that of a tracker is read where no motion reaches (see `infer`), and of
    load steps, which have no time, white noise as large as neighbouring points show.
    """
    own, noise = f.weights, forward.blocks[0].noise
    assert own is not None

    def of(level: np.ndarray, colour: tuple[np.ndarray, ...] = ()) -> Weights:
        prior = sum(level_prior(float(a), float(n)) for a, n in zip(level, noise, strict=True))
        return Weights(level, colour, own.gap, prior)

    if timeless(forward):
        rough = [np.diff(r, 2, axis=0) / np.sqrt(6.0) for r in f.residuals if len(r) > 2]
        level = np.sqrt(np.nanmean(np.concatenate(rough) ** 2, axis=0)) if rough else noise
        return [of(own.deviation), of(np.maximum(np.nan_to_num(level), noise))]
    found = beyond_motion(forward, joined(forward, f), range(len(noise)))
    level = np.maximum([n.deviation for n in found], noise)
    return [of(own.deviation), of(level, tuple(n.colour for n in found))]


def timeless(forward: Predictor) -> bool:
    """Whether all recordings are of load steps."""
    return all(r.by_step for r in forward.recordings)


def joined(forward: Predictor, f: Fit) -> list[np.ndarray]:
    """Residuals (n, D) of segments that follow each other, as one."""
    out: list[list[np.ndarray]] = []
    ends = None
    for b, r in zip(f.blocks, f.residuals, strict=True):
        block = forward.blocks[b]
        if ends == (block.recording, block.first):
            out[-1].append(r)
        else:
            out.append([r])
        ends = block.recording, block.first + len(r)
    return [np.concatenate(parts) for parts in out]


def flat_level(columns: Sequence[np.ndarray], noise: float) -> float:
    """Standard deviation of a process whose density is flat below the fastest that a recorder's filter passes.

    Args:
        columns: (n,) residuals, nan where missing. noise: the least that it is.
    """
    if max(len(c) for c in columns) < 4 * FILTER:
        return noise
    lags = 8 * FILTER  # so that the lines of the spectrum (Parzen's window) are half a band wide
    covariance, u = autocovariance(columns, lags)[0], np.arange(lags + 1) / lags
    window = np.where(u <= 0.5, 1.0 - 6.0 * u**2 + 6.0 * u**3, 2.0 * (1.0 - u) ** 3)
    frequency = np.linspace(0.0, 0.5, 4 * lags + 1)
    waves = np.cos(2.0 * np.pi * np.outer(np.arange(1, lags + 1), frequency))
    density = np.maximum(covariance[0] + 2.0 * (window * covariance)[1:] @ waves, 0.0)
    slow, next_ = frequency <= 0.5 / FILTER, (frequency > 0.5 / FILTER) & (frequency <= 1.0 / FILTER)
    density[slow] = np.minimum(density[slow], density[next_].mean())
    return max(float(np.sqrt(2.0 * np.trapezoid(density, frequency))), noise)
