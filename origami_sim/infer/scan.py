"""Coarse scans of the strength of an effect, from the numbers that a model was given.

A model that lacks a strong effect follows it with numbers that are no fault of theirs, and from there no fit finds the
effect: dry friction that holds a crease back is as a weaker magnet.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.stats import chi2

from origami_sim.fit.hypothesis import Hypothesis, Suspect
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights

DOUBTED = 0.01
"""Probability, under the priors of its numbers, of a departure as far as a fit's, below which they are not believed.

It only decides where fits begin: half, double and fifty times as much change nothing in four swings. Of a crawler whose
crease friction holds, numbers were 10 and 21 deviations off.
"""

GRID = np.geomspace(1.0, 1e3, 7)
"""Strengths of an effect that are tried, in the unit in which it is screened: what first shows, up to what blocks.

The friction of that crawler is found alike with 13; with 4, ten times apart, it is not.
"""


def strained(f: Fit) -> bool:
    """Whether numbers are further from what was known than chance would take them."""
    known = sum(np.isfinite(n.spread) for n in f.free)
    return bool(known and chi2.sf(f.penalty, known) < DOUBTED)


def scanned(
    forward: Predictor, hypothesis: Hypothesis, weights: Weights, local: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """(P,) the given numbers and that strength of one effect, of a few, with which recordings are missed least.

    With the squares that are missed, over the weights; None if the model goes unstable with all of them.
    """
    first, *_ = hypothesis.free
    given = np.array([f.start for f in (*forward.subject.nominals, *hypothesis.free)])
    tried = first.start + first.scale * np.concatenate([GRID, -GRID])
    strengths = np.unique(np.clip(tried, first.lower, first.upper))
    strengths = strengths[strengths != first.start]
    thetas = np.repeat(given[None], len(strengths), axis=0)
    thetas[:, len(forward.subject.nominals)] = strengths
    shot = forward.predict(hypothesis, thetas, np.repeat(local[None], len(thetas), axis=0))
    missed = np.zeros(len(thetas))
    for block, values in zip(forward.blocks, shot, strict=True):
        gap = np.where(block.seen(), (block.values - values) / weights.deviation, 0.0)
        missed += np.sum(np.where(np.isfinite(gap), gap, np.inf) ** 2, axis=(1, 2))
    best = int(np.argmin(missed))
    return (thetas[best], float(missed[best])) if np.isfinite(missed[best]) else None


def over_their_range(
    forward: Predictor,
    suspects: Sequence[Suspect],
    weights: Weights,
    base: Fit,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[np.ndarray, float] | None]:
    """Of each suspect alone, the best of a few strengths, and the log likelihood that it gains over the refitted model.

    Both in white noise as large as what they leave; None where it gains nothing.
    """
    line = base.reweighted(weights).linear
    assert line is not None
    before = sum(float(r[line.data(n)] @ r[line.data(n)]) for n, r in enumerate(line.residual))
    count = sum(int(forward.blocks[b].seen().sum()) for b in base.blocks)
    for n, s in enumerate(suspects):
        if progress:
            progress(n / len(suspects))
        found = scanned(forward, Hypothesis((s,)), weights, base.local)
        gain = 0.5 * count * np.log(before / max(found[1], 1e-12 * before)) if found else 0.0
        yield (found[0], gain) if found and gain > 0.0 else None
