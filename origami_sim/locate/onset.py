"""Since when a refitted model departs from a recording."""

import numpy as np

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.nominal import GAP
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights

LASTING = 2
"""Segments in a row that have to depart, or else one by `ALONE`: a mishap of the recorder shows in one, and little."""

ALONE = 20.0
"""Standard deviations from which a segment departs alone, as in a push."""

FAR = 4.0
"""Standard deviations of noise from which a segment's squares, or a frame, depart."""


def onset(forward: Predictor, f: Fit, recording: int = 0) -> float:
    """Time at which a fit first departs lastingly from a recording [s]; nan: never, or from the start.

    Innovations of each segment are what no start explains, given all before it; they are compared with the noise."""
    line = f.reweighted(Weights(forward.blocks[0].noise, gap=GAP)).linear
    assert line is not None
    mine = [n for n, b in enumerate(f.blocks) if forward.blocks[b].recording == recording]
    if len(mine) < 2 * LASTING:
        return float("nan")
    left = line.cleared(line.residual)
    excess = []
    for n in mine:
        count = max(forward.blocks[f.blocks[n]].seen().sum() - line.slopes[n].shape[1], 1)
        excess.append((float(left[n] @ left[n]) - count) / np.sqrt(2.0 * count))
    far = np.array(excess) > FAR
    alone = np.array(excess) > ALONE
    runs = [k for k in range(len(far)) if alone[k] or (k + LASTING <= len(far) and np.all(far[k : k + LASTING]))]
    if not runs or runs[0] == 0:
        return float("nan")
    block = forward.blocks[f.blocks[mine[runs[0]]]]
    return float(forward.recordings[recording].times[block.first] - forward.recordings[recording].times[0])
