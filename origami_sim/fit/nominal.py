"""The model without any effect, as given and refitted, and what residuals are measured by."""

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.least_squares import Fit, carried_on, fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.residual_process import level_prior
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis

GAP = 0.03
"""Gaps between segments, as a part of usual rates, with which fits are made; evidence then looks at all sizes.

It only has to be large enough for steps to be linear and small enough for segments to belong together: a third or three
times as much lead to the same fits.
"""

ROUNDS = 6
"""Times that weights are read from a fit before they are taken as they are."""

SAME = 0.1
"""Relative change of deviations below which weights have settled."""


def level(forward: Predictor, f: Fit) -> Weights:
    """White weights as large as what a fit leaves, and no smaller than the noise: to fit numbers with."""
    return white(forward, f.rms(), GAP)


def white(forward: Predictor, rms: np.ndarray, gap: float) -> Weights:
    """White weights of residuals with root mean squares (D,) [SI], no smaller than the noise."""
    noise = forward.blocks[0].noise
    deviation = np.maximum(np.nan_to_num(rms), noise)
    return Weights(deviation, (), gap, sum(level_prior(d, n) for d, n in zip(deviation, noise, strict=True)))


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
    weights = Weights(np.maximum(np.sqrt(np.nanmean(gaps**2, axis=0)), forward.blocks[0].noise), gap=GAP)
    base = _checked(fit(forward, Hypothesis(), weights, most=3, done=0.01))
    for _ in range(ROUNDS):
        new = level(forward, base)
        if np.all(np.abs(np.log(new.deviation / weights.deviation)) < SAME):
            break
        base = _checked(carried_on(forward, base.reweighted(new), most=4))
        weights = new
    base = _checked(carried_on(forward, base))
    return as_given(forward, base, weights), base, weights


def as_given(forward: Predictor, base: Fit, weights: Weights) -> Fit:
    """The model with its numbers as they were given, and starts that are fitted."""
    options = {"local": base.local, "known": base.reweighted(weights).linear, "fixed": True}
    return _checked(fit(forward, Hypothesis(), weights, most=6, done=0.01, **options))


def _checked(f: Fit) -> Fit:
    if f.failed:
        raise InputError(f"the nominal model cannot be fitted: {f.failed}", field="model")
    return f
