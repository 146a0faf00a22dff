"""Intervals of fitted numbers that count what effects too small to be told, and a discrepancy, would do to them."""

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from origami_sim.fit.implied import OwnColumns
from origami_sim.fit.least_squares import Fit
from origami_sim.infer.posterior import Key, Node, Posterior


def widened(p: Posterior, key: Key) -> Fit:
    """A fit whose intervals count flaws and discrepancy."""
    node = p.nodes[key]
    f = node.fit
    own = len(f.free) - len(f.hypothesis.free)
    if not f.hypothesis.suspects:
        return f
    sd = deviations(node, p)
    plain = f.spread
    wider = np.ones(len(f.free))
    wider[own:] = np.maximum(sd, plain[own:]) / np.maximum(plain[own:], 1e-300)
    return replace(f, wider=wider)


def deviations(node: Node, p: Posterior) -> np.ndarray:
    """Standard deviations of the coordinates of the numbers of a fit's effects, in the order of its numbers.

    Their variances are the mean over all sizes of flaws and discrepancy.
    """
    own = OwnColumns(node.fit)
    count, first = len(own.columns), len(own.nominal)
    spread = np.concatenate([g.spread for g in own.groups])
    strength = np.concatenate([np.arange(len(g.columns)) < g.strengths for g in own.groups])
    known = np.where(strength | ~np.isfinite(spread), 0.0, 1.0 / spread) ** 2
    log = node.evidence + p.hyper.log_cells
    variance = np.zeros(count)
    for cell, weight in zip(node.grid, np.exp(log - logsumexp(log)), strict=True):
        if cell is not None:
            cover = np.linalg.pinv(cell.gram[:count, :count] + np.diag(known), rcond=1e-14)
            variance += weight * np.maximum(np.diag(cover), 0.0)
    out = np.zeros(count)
    out[np.array(own.columns) - first] = np.sqrt(variance)
    return out
