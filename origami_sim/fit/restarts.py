"""Better starts of tied segments, by dynamic programming over those that the segments before lead to.

A measured start beside an impact has a wrong rate, from which least squares follow another bounce and stay there. Where
the segment before arrives is another candidate, and where the one before that leads through it a third, and so on. Of
all their combinations the best is found segment by segment (Viterbi 1967).
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.fit.derivatives import links, residuals
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis

BEFORE = 4
"""Segments from whose start another one is reached, at most.

A flap that rattles at a stop ends with 1472 squares with one and 1382 with two, four and ten; one at a stiffer stop, in
segments of eight frames, with 1901 with two and 1169 with four and eight.
"""


def restarted(
    forward: Predictor,
    hypothesis: Hypothesis,
    theta: np.ndarray,
    local: np.ndarray,
    blocks: Sequence[int],
    weights: Weights,
    residual: list[np.ndarray],
) -> tuple[np.ndarray, float]:
    """Starts [B, L], each the present one or where segments before lead, and the squares that they gain.

    A segment that begins within a gap's standard deviation of where the one before arrives has no other candidate. Half
    and double of that change no word about two flaps at a stop.

    Args:
        residual: at the present starts.
    """
    tied, size = [after for _, after in links(forward, blocks)], local.shape[1]
    if not any(tied):
        return local, 0.0
    every = np.array(blocks)
    reach = np.array([weights.gap * r if (r := forward.blocks[b].reach) is not None else np.ones(size) for b in blocks])
    starts, costs, ends, before = [], [], [], sum(float(r @ r) for r in residual)
    here, some = local, np.arange(len(blocks))
    for lead in range(BEFORE + 1):
        if lead:
            here = local.copy()
            here[every[1:]] = np.where(np.isfinite(ends[-1][:-1]), ends[-1][:-1], local[every[1:]])
            apart = np.sum(((here - local)[every[1:]] / reach[:-1]) ** 2, axis=1)
            some = 1 + np.flatnonzero(apart > 1.0)
            if not len(some):
                break
            asked = every[some].tolist()
            residual = residuals(forward, hypothesis, theta, here, asked, weights, among=blocks)
        cost, end = np.full(len(blocks), np.inf), np.full((len(blocks), size), np.nan)
        for n, r in zip(some.tolist(), residual, strict=True):
            own = len(r) - size * tied[n]
            if np.all(np.isfinite(r)):
                cost[n] = r[:own] @ r[:own]
                end[n] = here[blocks[n] + 1] - reach[n] * r[own:] if tied[n] else np.nan
        starts.append(here[every])
        costs.append(cost)
        ends.append(end)
    choice, squares = best_of_each(tied, reach, np.array(starts), np.array(costs), np.array(ends))
    out = local.copy()
    out[every] = np.array(starts)[choice, np.arange(len(blocks))]
    return out, before - squares


def best_of_each(
    tied: Sequence[bool], reach: np.ndarray, starts: np.ndarray, costs: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, float]:
    """Which of several candidates of each segment (S,) are best together, and their squares.

    Args:
        tied: (S,) whether the next segment is tied to this one. reach: [S, L] standard deviations of the gaps.
        starts: [C, S, L]. costs: [C, S] squares of the segments' data; infinite: there is no such candidate.
        ends: [C, S, L] where they arrive.
    """
    best, back = costs[:, 0], []
    for n in range(1, len(tied)):
        gaps = np.zeros((len(starts), len(starts)))
        if tied[n - 1]:
            gaps = np.sum(((starts[None, :, n] - ends[:, None, n - 1]) / reach[n - 1]) ** 2, axis=-1)
        whole = best[:, None] + np.where(np.isfinite(gaps), gaps, np.inf)
        back.append(np.argmin(whole, axis=0))
        best = whole.min(axis=0) + costs[:, n]
    choice = [int(np.argmin(best))]
    for before in reversed(back):
        choice.append(int(before[choice[-1]]))
    return np.array(choice[::-1]), float(best.min())
