"""Better starts of tied segments, by dynamic programming over those that the segments before lead to.

A measured start beside an impact has a wrong rate, from which least squares follow another bounce and stay there. Where
the segment before arrives is another candidate, and where the one before that leads through it a third, and so on. Of
all their combinations the best is found segment by segment (Viterbi 1967).
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.fit.derivatives import links
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, whitened
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

    A segment that begins within a gap's standard deviation of where the one before arrives has no other candidate.

    Args:
        residual: at the present starts.
    """
    linked = links(forward, blocks)
    tied, size = [after for _, after in linked], local.shape[1]
    if not any(tied):
        return local, 0.0
    rows = [forward.blocks[b].rows(*link) for b, link in zip(blocks, linked, strict=True)]
    reach = np.array([weights.gap * r if (r := forward.blocks[b].reach) is not None else np.ones(size) for b in blocks])
    present = local[list(blocks)]
    cost, end = np.zeros(len(blocks)), np.full((len(blocks), size), np.nan)
    for n, r in enumerate(residual):
        own = len(r) - size * tied[n]
        cost[n] = r[:own] @ r[:own]
        if tied[n]:
            end[n] = present[n + 1] - reach[n] * r[own:]
    starts, costs, ends = [present], [cost], [end]
    for _ in range(BEFORE):
        arrived = np.full_like(present, np.nan)
        arrived[1:] = ends[-1][:-1]
        apart = np.sum(((arrived - present)[1:] / reach[:-1]) ** 2, axis=1)
        some = (1 + np.flatnonzero(apart > 1.0)).tolist()  # nan is not
        if not len(some):
            break
        cost, end = np.full(len(blocks), np.inf), np.full_like(present, np.nan)
        here, asked = local.copy(), [blocks[n] for n in some]
        here[asked] = arrived[some]
        shot = forward.shoot(hypothesis, theta[None], here[None], asked)
        gaps = [forward.blocks[b].values - v[0] for b, v in zip(asked, shot.values, strict=True)]
        seen = [np.where(forward.blocks[b].seen(), gap, 0.0) for b, gap in zip(asked, gaps, strict=True)]
        white = whitened(weights, seen, [rows[n] for n in some])
        for n, gap, data, ends_at in zip(some, seen, white, shot.ends, strict=True):
            if np.all(np.isfinite(gap)):
                cost[n] = data @ data
                if tied[n] and ends_at is not None:
                    end[n] = ends_at[0]
        starts.append(arrived)
        costs.append(cost)
        ends.append(end)
    choice, squares = best_of_each(tied, reach, np.array(starts), np.array(costs), np.array(ends))
    out = local.copy()
    out[list(blocks)] = np.array(starts)[choice, np.arange(len(blocks))]
    before = sum(float(r @ r) for r in residual)
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
