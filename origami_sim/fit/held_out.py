"""Held-out error: of each fold of the data, with numbers that all others tell."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.derivatives import links
from origami_sim.fit.evidence import ROUNDS, least_within, sharpness
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.implied import OwnColumns
from origami_sim.fit.least_squares import OWED, Fit, carried_on, fit, penalty, settled
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, restored
from origami_sim.hypotheses.coordinates import Coordinates
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.recording import Recording
from origami_sim.threads import shared

FOLDS = 5
"""Folds of a single recording: contiguous stretches, so that neighbours do not give each other away."""

LEVEL = 0.02
"""Relative difference up to which two drives are of one level."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well a fit predicts what it was not fitted to.

    Attributes:
        folds: [F, D] root mean squares of the residuals [SI], by fold; nan where nothing was seen.
        seen: [F, D] numbers of values.
    """

    folds: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(cls, forward: Predictor, parts: Sequence[Sequence[int]], residuals: Sequence[list[np.ndarray]]) -> "HeldOut":
        """From residuals (n, D) [SI] of the segments of each fold."""
        squares, seen = [], []
        for part, each in zip(parts, residuals, strict=True):
            values = np.concatenate(
                [np.where(forward.blocks[b].seen(), r, np.nan) for b, r in zip(part, each, strict=True)]
            )
            squares.append(np.nansum(values**2, axis=0))
            seen.append(np.sum(np.isfinite(values), axis=0))
        count = np.array(seen)
        return cls(np.sqrt(np.divide(squares, count, out=np.full(count.shape, np.nan), where=count > 0)), count)

    @property
    def rms(self) -> np.ndarray:
        """(D,) over all folds [SI]."""
        squares = np.nansum(np.square(self.folds) * self.seen, axis=0)
        return np.sqrt(squares / np.maximum(self.seen.sum(axis=0), 1))


def estimated(forward: Predictor, f: Fit, alike: Weights) -> HeldOut:
    """Errors with numbers from all other folds, by a Gauss-Newton step from the full fit; starts are adapted.

    Args:
        alike: the noise, and the gaps between segments, to which starts are adapted: the same for all that is compared.
            In noise of its own, a model that is far off may leave its segments freely, and a good one may not.
    """
    line, weights = f.linear, f.weights
    assert line is not None and weights is not None
    judged, parts, rest = line.reweighted(weights, alike), folds(forward, f.blocks), []
    chain = judged.eliminated
    for part, (step, _) in zip(parts, without(f, parts), strict=True):
        starts = list(chain.starts(np.append(-step, 1.0)[:, None])[:, :, 0])
        left = judged.smoothed([r - t @ step for r, t in zip(judged.residual, judged.tangent, strict=True)], starts)
        rest.append(restored(alike, [left[n] for n in part], [judged.rows[n] for n in part]))
    return HeldOut.of(forward, [[f.blocks[n] for n in part] for part in parts], rest)


def refitted(forward: Predictor, f: Fit) -> list[Fit]:
    """Fits of the same numbers to all but each fold, by simulation; see `folds`. They have no residuals.

    Strengths have the normal prior of the evidence, at its mode: what only the fold that is left out tells of one is
    not known.

    Raises:
        InputError: a fit without a fold fails.
    """
    parts = folds(forward, f.blocks)
    steps, sharp = zip(*without(f, parts), strict=True)
    known = [_known_by(f, s) for s in sharp]
    found = shared([partial(_refitted, forward, *one) for one in zip(known, parts, steps, strict=True)])
    return [replace(new, hypothesis=k.hypothesis, free=k.free) for new, k in zip(found, known, strict=True)]


def _refitted(forward: Predictor, f: Fit, part: Sequence[int], step: np.ndarray) -> Fit:
    """A fit to all but some segments, begun by a step of the coordinates (P,); without what is large."""
    rest = [n for n in range(len(f.blocks)) if n not in part]
    if rest and len(f.free):
        found, owed = settled(forward, _among(forward, f, rest))
        found = carried_on(forward, found) if owed >= OWED else found
    else:
        found = replace(f, theta=f.coordinates.values(f.coordinates.of(f.theta) + step))
    if found.failed:
        raise InputError(f"a fit without a part of the data fails: {found.failed}")
    return replace(found, linear=None, residuals=[])


def predicted(forward: Predictor, fits: Sequence[Fit], alike: Weights) -> HeldOut:
    """Errors of fits without each fold on that fold, by simulation; only its starts are adapted.

    Args:
        alike: as for `estimated`.

    Raises:
        InputError: a simulation fails.
    """
    parts = folds(forward, range(len(forward.blocks)))
    jobs = [partial(_predicted, forward, f, alike, part) for part, f in zip(parts, fits, strict=True)]
    return HeldOut.of(forward, parts, shared(jobs))


def _predicted(forward: Predictor, f: Fit, alike: Weights, part: Sequence[int]) -> list[np.ndarray]:
    """Residuals (n, D) [SI] of some segments with the numbers of a fit."""
    found = fit(forward, f.hypothesis, alike, theta=f.theta, local=f.local, blocks=part, fixed=True)
    if found.failed:
        raise InputError(f"what is left out cannot be predicted: {found.failed}")
    return found.residuals


def _known_by(f: Fit, sharp: np.ndarray) -> Fit:
    """A fit of which numbers have normal priors about zero, one over the deviations (P,) of which are these."""
    free = tuple(replace(n, spread=n.scale / float(s)) if s > 0.0 else n for n, s in zip(f.free, sharp, strict=True))
    place, suspects = len(f.free) - len(f.hypothesis.free), []
    for s in f.hypothesis.suspects:
        suspects.append(replace(s, free=free[place : place + len(s.free)]))
        place += len(s.free)
    own = penalty(Coordinates(free), f.theta)
    return replace(f, hypothesis=Hypothesis(tuple(suspects)), free=free, penalty=own, exact=False)


def _among(forward: Predictor, f: Fit, some: Sequence[int]) -> Fit:
    """A fit to some of its segments, where it ended: those that follow others now have starts of their own."""
    line, blocks = f.linear, [f.blocks[n] for n in some]
    assert line is not None
    of = {"rows": [], "residual": [], "tangent": [], "slopes": [], "tie": []}
    for n, b, link in zip(some, blocks, links(forward, blocks), strict=True):
        block, old = forward.blocks[b], line.rows[n]
        new = block.rows(*link)
        pieces = {"residual": -f.local[b] / block.known, "tangent": 0.0, "slopes": np.diag(1.0 / block.known)}
        for name, start in pieces.items():
            whole = getattr(line, name)[n]
            first = whole[old.data : old.data + old.start]
            if new.start and not old.start:
                first = np.broadcast_to(np.asarray(start), (new.start, *whole.shape[1:]))
            of[name].append(np.concatenate([whole[: old.data], first, whole[old.count - new.tie : old.count]]))
        of["rows"].append(new)
        of["tie"].append(line.tie[n] if new.tie else None)
    made = Linearisation(**of, steps=line.steps)
    misfit = float(sum(r @ r for r in made.residual))
    return replace(f, linear=made, blocks=tuple(blocks), misfit=misfit)


def without(f: Fit, parts: Sequence[Sequence[int]], hyper: Hyper = HYPER) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Changes of the coordinates (P,) of a fit's numbers without each of some parts of its segments, by one step.

    With them, one over the deviations (P,) of the normal priors there. It is the mode of the normal model that the
    evidence is of, within the bounds: what all other segments do not tell of a strength, its prior does. Nothing if a
    part is all of the data: its errors are those of the fit.
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
        if not width or len(part) == len(cleared):  # without anything there is nothing to refit
            yield np.zeros(width), known
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
        yield step, sharp


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
