"""Held-out error: of each stretch of the data, with numbers that all others tell."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from origami_sim.fit.evidence import ROUNDS, least_within, sharpness
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.implied import OwnColumns
from origami_sim.fit.least_squares import Fit
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
    """Errors with numbers from all other folds, by a Gauss-Newton step from the full fit; starts are adapted.

    Args:
        alike: the noise, and the gaps between segments, to which starts are adapted: the same for all that is compared.
            In noise of its own, a model that is far off may leave its segments freely, and a good one may not.
    """
    line, weights = f.linear, f.weights
    assert line is not None and weights is not None
    judged, dims, parts = line.reweighted(weights, alike), len(weights.deviation), folds(forward, f.blocks)
    squares, seen, folds_ = np.zeros(dims), np.zeros(dims), []
    chain = judged.eliminated
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


def steps_without(f: Fit, parts: Sequence[Sequence[int]], hyper: Hyper = HYPER) -> Iterator[np.ndarray]:
    """Changes of the coordinates (P,) of a fit's numbers without each of some parts of its segments.

    The mode of the normal model that the evidence is of, within the bounds: what all other segments do not tell of a
    strength, its prior does. Nothing if the fit left the numbers as they were.
    """
    line, own, numbers = f.linear, OwnColumns(f), f.coordinates
    assert line is not None
    width, nominal = line.tangent[0].shape[1], own.nominal
    cleared = line.cleared([np.column_stack([t, r]) for t, r in zip(line.tangent, line.residual, strict=True)])
    known, value = numbers.precision, numbers.of(f.theta)
    low, high = numbers.low - value, numbers.high - value
    strong = np.array([own.columns[c] for g in own.groups for c in g.columns[: g.strengths]], int)
    usual = np.concatenate([np.zeros(0), *(g.sizes()[: g.strengths] for g in own.groups)])
    none = np.zeros(width)
    none[strong] = value[strong]
    for part in parts:
        if not width:
            yield np.zeros(0)
            continue
        rows = np.concatenate([cleared[0][:0], *(cleared[n] for n in range(len(cleared)) if n not in part)])
        size = np.linalg.norm(rows[:, :-1], axis=0)
        least = np.maximum(1e-6 * size, max(1e-9 * size.max(initial=0.0), 1e-18))  # of what nothing tells
        q, r = np.linalg.qr(np.concatenate([rows[:, :-1], np.diag(least)]))
        right = q.T @ np.append(rows[:, -1], -least * none)
        given = np.concatenate([r[:, nominal], np.diag(known[nominal])])
        told = np.concatenate([r[:, strong], np.zeros((len(nominal), len(strong)))])
        basis = np.linalg.qr(given)[0]
        norm = np.maximum(np.linalg.norm(told - basis @ (basis.T @ told), axis=0), 1e-12)
        sharp, step = known.copy(), np.zeros(width)
        for turn in range(ROUNDS):
            found = (value + step)[strong]
            sharp[strong] = sharpness(found, norm, usual, hyper) if turn else norm / hyper.slabs[-1]
            a = np.concatenate([r, np.diag(sharp)])
            size = np.linalg.norm(a, axis=0)
            gram, y = (a / size).T @ (a / size), (a / size).T @ np.concatenate([right, -sharp * value])
            step = least_within(gram[None, None], y[None, None], low * size, high * size)[0][0, 0] / size
        yield step


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
