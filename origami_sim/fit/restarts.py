"""Better starts of tied segments, by dynamic programming over those that the segments before lead to.

A measured start beside an impact has a wrong rate, from which least squares follow another bounce and stay there. Where
the segment before arrives is another candidate, and where the one before that leads through it a third. Of all their
combinations the best is found segment by segment (Viterbi 1967).
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.fit.derivatives import links, residuals
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis

BEFORE = 2
"""Segments from whose start another one is reached, at most; more only where one more gained something. With one, a
flap that rattles at a stop keeps one wrong start of three (1472 for 1382 squares); with four and ten it ends as with
two."""


def restarted(
    forward: Predictor,
    hypothesis: Hypothesis,
    theta: np.ndarray,
    local: np.ndarray,
    blocks: Sequence[int],
    weights: Weights,
    residual: list[np.ndarray],
    least: float,
) -> tuple[np.ndarray, float]:
    """Starts [B, L], each the present one or where segments before lead, and the squares that they gain.

    Args:
        residual: at the present starts. least: squares that are worth another candidate.
    """
    tied = [after for _, after in links(forward, blocks)]
    if not any(tied):
        return local, 0.0
    reach = [weights.gap * r if (r := forward.blocks[b].reach) is not None else np.inf for b in blocks]
    starts = [local]
    costs, ends = [], []
    chosen, before, gain = local, np.inf, 0.0
    for lead in range(BEFORE + 1):
        cost, end = _parted(blocks, tied, reach, starts[-1], residual)
        costs.append(cost)
        ends.append(end)
        chosen, squares = _best(blocks, tied, reach, starts, costs, ends)
        gain = 0.0 if not lead else gain + before - squares
        if lead == BEFORE or before - squares < least:
            break
        before = squares
        arrived = starts[-1].copy()
        for n, b in enumerate(blocks):
            if np.isfinite(end[n]).all():
                arrived[b + 1] = end[n]
        starts.append(arrived)
        residual = residuals(forward, hypothesis, theta, arrived, blocks, weights)
    return chosen, gain


def _parted(blocks, tied, reach, local: np.ndarray, residual: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Of residuals, the squares (B,) of each segment without its tie, and where it ends [B, L]; nan: it is not tied."""
    cost, ends = np.zeros(len(blocks)), np.full((len(blocks), local.shape[1]), np.nan)
    for n, (b, r) in enumerate(zip(blocks, residual, strict=True)):
        own = len(r) - local.shape[1] * tied[n]
        cost[n] = r[:own] @ r[:own]
        if tied[n]:
            ends[n] = local[b + 1] - reach[n] * r[own:]
    return np.where(np.isfinite(cost), cost, np.inf), ends


def _best(blocks, tied, reach, starts, costs, ends) -> tuple[np.ndarray, float]:
    """The combination of candidates of the least squares: starts [B, L] and its squares."""
    each, cost, end = np.array(starts)[:, list(blocks)], np.array(costs), np.array(ends)
    best, back = cost[:, 0], []
    for n in range(1, len(blocks)):
        gaps = np.zeros((len(each), len(each)))
        if tied[n - 1]:
            gaps = np.sum(((each[None, :, n] - end[:, None, n - 1]) / reach[n - 1]) ** 2, axis=-1)
        whole = best[:, None] + np.where(np.isfinite(gaps), gaps, np.inf)
        back.append(np.argmin(whole, axis=0))
        best = whole.min(axis=0) + cost[:, n]
    choice, out = int(np.argmin(best)), starts[0].copy()
    for n, b in reversed(list(enumerate(blocks))):
        out[b] = each[choice, n]
        choice = int(back[n - 1][choice]) if n else choice
    return out, float(best.min())
