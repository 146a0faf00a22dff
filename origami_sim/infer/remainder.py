"""Whether a fit leaves more than a recorder's noise: a slow process that no effect of the catalogue gives."""

from dataclasses import replace

import numpy as np
from scipy.special import expit, logsumexp

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.recorder import recorder_weights
from origami_sim.fit.weights import Weights
from origami_sim.infer.budget import Budget, budget
from origami_sim.infer.judged import judged
from origami_sim.infer.posterior import Key, Posterior


def mismatch(p: Posterior, forward: Predictor, given: Fit, base: Fit, key: Key) -> Budget:
    """The budget of a fitted set, and how probable it is that what it leaves is real."""
    f = p.nodes[key].fit
    real, recorder = remainder(p, forward, key)
    # what is real is no noise: of that there is what is read where no motion reaches
    return replace(budget(forward, given, base, f, recorder if real > 0.5 else None), real=real)


def remainder(p: Posterior, forward: Predictor, key: Key) -> tuple[float, Weights | None]:
    """Probability that what a fitted set leaves is neither noise of the recorder nor small flaws, and that noise.

    Sets are judged in noise as coloured as what they leave, so that no effect is blamed for it. Here such a colour is
    compared with white noise and with that of a tracker, read where no motion reaches; one that neither has is of
    something that is missing, as probable beforehand as a law that the catalogue lacks. None where there is no colour.
    """
    node = p.nodes[key]
    own = node.fit.weights
    assert own is not None
    if not own.colour:
        return 0.0, None
    recorders = recorder_weights(forward, node.fit)
    judge = [judged(p, forward, key, node.fit.reweighted(w), node.owed)[0].evidence for w in recorders]
    plain = logsumexp(judge, axis=0) - np.log(len(recorders)) + p.hyper.log_cells
    coloured = float(logsumexp(node.evidence + p.hyper.log_cells)) + np.log(p.hyper.unlisted)
    missing = np.logaddexp(coloured, logsumexp(plain[~p.hyper.clean]))
    return float(expit(missing - logsumexp(plain[p.hyper.clean]))), recorders[-1]
