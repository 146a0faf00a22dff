"""Held-out error: of each stretch of the data, with numbers that all others tell."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from origami_sim.fit.least_squares import Fit, precision
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, restored
from origami_sim.recording import Recording

FOLDS = 5
"""Folds of a single recording: contiguous stretches, so that neighbours do not give each other away."""

LEVEL = 0.02
"""Relative difference up to which two drives are of one level."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well a fit predicts what it was not fitted to.

    Attributes:
        rms: (D,) root mean square of the residual [SI]. folds: [F] mean squares over the noise, by fold.
    """

    rms: np.ndarray
    folds: np.ndarray


def held_out(forward: Predictor, f: Fit, alike: Weights) -> HeldOut:
    """Errors with numbers from all other folds, by one Gauss-Newton step from the full fit; starts are adapted.

    Args:
        alike: the noise, and the gaps between segments, to which starts are adapted: the same for all that is compared.
            In noise of its own, a model that is far off may leave its segments freely, and a good one may not.
    """
    line, weights = f.linear, f.weights
    assert line is not None and weights is not None
    judged, dims, parts = line.reweighted(weights, alike), len(weights.deviation), folds(forward, f.blocks)
    squares, seen, folds_ = np.zeros(dims), np.zeros(dims), []
    chain = judged.chain.eliminated()
    for part, step in zip(parts, steps_without(f, parts), strict=True):
        starts = list(chain.starts(np.append(-step, 1.0)[:, None])[:, :, 0])
        left = judged.smoothed([r - t @ step for r, t in zip(judged.residual, judged.tangent, strict=True)], starts)
        own, count = np.zeros(dims), np.zeros(dims)
        rest = restored(alike, [left[n] for n in part], [judged.rows[n] for n in part])
        for n, r in zip(part, rest, strict=True):
            seen_here = forward.blocks[f.blocks[n]].seen()
            own += np.sum(np.where(seen_here, r, 0.0) ** 2, axis=0)
            count += seen_here.sum(axis=0)
        folds_.append(float(np.mean(own / np.maximum(count, 1) / forward.blocks[0].noise ** 2)))
        squares, seen = squares + own, seen + count
    return HeldOut(np.sqrt(squares / np.maximum(seen, 1)), np.array(folds_))


def steps_without(f: Fit, parts: Sequence[Sequence[int]]) -> Iterator[np.ndarray]:
    """Changes of the numbers (P,) of a fit, over their scales, without each of some parts of its segments.

    One Gauss-Newton step within the bounds. Nothing if the fit left the numbers as they were.
    """
    line = f.linear
    assert line is not None
    width = line.tangent[0].shape[1]
    cleared = line.cleared([np.column_stack([t, r]) for t, r in zip(line.tangent, line.residual, strict=True)])
    scale, prior = np.array([n.scale for n in f.free]), precision(f.free)
    away = prior * ((np.array([n.start for n in f.free]) - f.theta) / scale)
    low, high = ((np.array([getattr(n, end) for n in f.free]) - f.theta) / scale for end in ("lower", "upper"))
    for part in parts:
        if not width:
            yield np.zeros(0)
            continue
        rows = [cleared[n] for n in range(len(cleared)) if n not in part]
        a = np.concatenate([*(r[:, :-1] for r in rows), np.diag(prior)])
        y = np.concatenate([*(r[:, -1] for r in rows), away])
        a = np.concatenate([a, np.diag(1e-6 * np.maximum(np.linalg.norm(a, axis=0), 1e-12))])
        y = np.concatenate([y, np.zeros(width)])
        q, r = np.linalg.qr(a)
        yield lsq_linear(r, q.T @ y, (np.minimum(low, -1e-12), np.maximum(high, 1e-12))).x


def folds(forward: Predictor, blocks: Sequence[int]) -> list[list[int]]:
    """Positions (within `blocks`) of each fold: whole recordings, or contiguous stretches of a single one.

    Recordings of one drive level are left out together, if there are others: repeats tell what they are to predict.
    """
    recordings = [forward.blocks[b].recording for b in blocks]
    distinct = sorted(set(recordings))
    if len(distinct) == 1:
        return [list(map(int, part)) for part in np.array_split(np.arange(len(blocks)), min(FOLDS, len(blocks)))]
    levels: list[list[int]] = []
    for d in distinct:
        own = forward.recordings[d]
        near = next((e for e in levels if same_level(forward.recordings[e[0]], own)), None)
        if near is None:
            levels.append([d])
        else:
            near.append(d)
    apart = levels if len(levels) > 1 else [[d] for d in distinct]
    return [[n for n, r in enumerate(recordings) if r in level] for level in apart]


def same_level(a: Recording, b: Recording) -> bool:
    """Whether two recordings have the same drives, each as strong (within `LEVEL`); without a drive, never."""

    def size(r: Recording) -> dict[str, float]:
        return {n: float(np.abs(c.values).max(initial=0.0)) for n, c in r.drive.items()}

    one, other = size(a), size(b)
    return bool(one) and one.keys() == other.keys() and all(np.isclose(one[n], other[n], LEVEL, 0.0) for n in one)
