"""The model without any effect, as given and refitted, and what residuals are measured by."""

from collections.abc import Sequence

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.hypothesis import Hypothesis
from origami_sim.fit.least_squares import Fit, carried_on, fit
from origami_sim.fit.linear import Weights
from origami_sim.fit.predictor import Predictor

GAP = 0.03
"""Gaps between segments, as a part of usual rates, with which fits are made; evidence then looks at all sizes.

It only has to be large enough for steps to be linear and small enough for segments to belong together: a third or three
times as much lead to the same fits.
"""

ROUNDS = 6
"""Times that weights are read from a fit before they are taken as they are."""

SAME = 0.1
"""Relative change of deviations below which weights have settled."""


def weights_from(forward: Predictor, f: Fit, gap: float = GAP) -> Weights:
    """Weights from what a fit leaves: as large as that, not below the measurement noise, and with its memory."""
    noise = forward.blocks[0].noise
    rms = np.sqrt(np.nanmean(np.concatenate(f.residuals) ** 2, axis=0))
    deviation = np.maximum(np.nan_to_num(rms), noise)
    coloured = np.any(rms > 1.5 * noise)
    return Weights(deviation, 1.0 / memory([r / deviation for r in f.residuals]) if coloured else 1.0, gap)


def memory(residuals: Sequence[np.ndarray]) -> float:
    """Correlation time of residuals in samples: 1 + twice the sum of the autocorrelation up to its first zero."""
    longest = max(len(r) for r in residuals)
    lags = min(longest - 1, 400)
    sums, counts = np.zeros(lags + 1), np.zeros(lags + 1)
    for r in residuals:
        filled = np.nan_to_num(r - np.nanmean(r, axis=0))
        n = len(filled)
        size = 1 << int(np.ceil(np.log2(2 * n)))
        f = np.fft.rfft(filled, size, axis=0)
        acf = np.fft.irfft(f * np.conj(f), size, axis=0)[: min(n, lags + 1)].sum(axis=1)
        sums[: len(acf)] += acf
        counts[: len(acf)] += filled.shape[1] * (n - np.arange(len(acf)))
    rho = sums / np.maximum(counts, 1)
    if rho[0] <= 0:
        return 1.0
    rho = rho / rho[0]
    crossing = np.flatnonzero(rho < 0.05)
    stop = crossing[0] if len(crossing) else len(rho)
    return float(max(1.0, 1.0 + 2.0 * rho[1:stop].sum()))


def nominal_fits(forward: Predictor) -> tuple[Fit, Fit, Weights]:
    """The nominal model as given (only starts fitted) and refitted, and the weights of the second.

    Large misfits count little at first, so that numbers do not leave their priors to follow what is no fault of theirs.

    Raises:
        InputError: a model that cannot be simulated or fitted.
    """
    theta = np.array([f.start for f in forward.subject.nominals])
    rough = forward.predict(Hypothesis(), theta[None], np.zeros((1, len(forward.blocks), forward.local)))
    if any(np.any(np.isnan(v[0])) for v in rough):
        raise InputError(
            "the nominal model goes unstable on this recording", field="model", allowed="a model that can be simulated"
        )
    gaps = np.concatenate([b.values - v[0] for b, v in zip(forward.blocks, rough, strict=True)])
    weights = Weights(np.maximum(np.sqrt(np.nanmean(gaps**2, axis=0)), forward.blocks[0].noise), 1.0, GAP)
    base = _checked(fit(forward, Hypothesis(), weights, most=3, done=0.01))
    for _ in range(ROUNDS):
        new = weights_from(forward, base)
        if unchanged(weights, new):
            break
        base = _checked(carried_on(forward, base.reweighted(weights, new), new, most=4))
        weights = new
    base = _checked(carried_on(forward, base, weights))
    return as_given(forward, base, weights), base, weights


def unchanged(old: Weights, new: Weights) -> bool:
    """Whether weights have settled."""
    return bool(np.all(np.abs(np.log(new.deviation / old.deviation)) < SAME))


def as_given(forward: Predictor, base: Fit, weights: Weights) -> Fit:
    """The model with its numbers as they were given, and starts that are fitted."""
    options = {"local": base.local, "known": base.linear, "fixed": True}
    return _checked(fit(forward, Hypothesis(), weights, most=6, done=0.01, **options))


def _checked(f: Fit) -> Fit:
    if f.failed:
        raise InputError(f"the nominal model cannot be fitted: {f.failed}", field="model")
    return f
