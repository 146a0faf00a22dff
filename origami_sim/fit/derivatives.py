"""Residuals of a hypothesis and their derivatives, by forward differences over a batch of worlds."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import qr

from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Prediction, Predictor
from origami_sim.fit.weights import Rows, Weights, whitened
from origami_sim.hypotheses.coordinates import Coordinates
from origami_sim.hypotheses.hypothesis import Free, Hypothesis

SMALL, ABOVE = 1.0, 10.0
"""Whitened norm of a change that derivatives are found by, at most, and over the solver's own error, at least.

All data and all ties between segments together show a change of one standard deviation. By changes of the size of an
effect itself, the scale of all moments of a rubbing swing looked known to 0.2 %, where it is known to 2.4 %; by changes
that only data limit, that of a flap in a coil with gaps of 1e-4 to 0.25 % and 5 % off, where it is known to 0.9 %.
Half and double of either number change intervals by a twentieth.
"""

LARGEST = 0.01
"""Part of what is plausible by which a start is changed at most. Half and double change no word of four swings, and
probabilities by 0.003 and 0.03."""


def linearise(
    forward: Predictor,
    hypothesis: Hypothesis,
    free: Sequence[Free],
    theta: np.ndarray,
    local: np.ndarray,
    blocks: Sequence[int],
    weights: Weights,
    *,
    fixed: bool = False,
    known: Linearisation | None = None,
    kept: int = 0,
    residual: list[np.ndarray] | None = None,
    steps: np.ndarray | None = None,
    axes: np.ndarray | None = None,
) -> Linearisation:
    """Residuals and tangents at a point; the derivatives are forward differences, all in one batch of worlds.

    Args:
        fixed: leave theta out (only the starts are to be fitted).
        known: derivatives at a near point, by the starts and by the first `kept` numbers, that need not be taken anew.
        residual: whitened residuals at this point, if they are known.
        steps: (k,) those of the first numbers' coordinates that were small enough at a near point.
        axes: [P, P] changes of coordinates, each a row, to take the derivatives along; None: one after the other.
    """
    count = 0 if fixed else len(free)
    kept = min(kept, count) if known is not None else 0
    size = 0 if known is not None else forward.local
    fresh = count - kept
    numbers = Coordinates(free)
    steps = first_steps(forward, numbers, theta, steps)[:count]
    nudges = start_steps(forward, weights, blocks) if size else np.zeros((len(blocks), 0))
    if residual is None:
        residual = residuals(forward, hypothesis, theta, local, blocks, weights)
    rows = [forward.blocks[b].rows(*link) for b, link in zip(blocks, links(forward, blocks), strict=True)]

    moves = np.eye(count, len(free))[kept:] * np.append(steps, np.zeros(len(free) - count))
    oblique = axes is not None and not kept
    if oblique:
        moves = np.array(axes)

    def differences(some: np.ndarray, starts: int) -> list[np.ndarray]:
        """Per block, whitened changes [k + starts, r] by moves [k, P] of coordinates, and by steps of the starts."""
        thetas = np.repeat(theta[None], 1 + len(some) + starts, axis=0)
        locals_ = np.repeat(local[None], len(thetas), axis=0)
        moved = numbers.values(numbers.of(theta) + some)
        thetas[1 : 1 + len(some)] = np.where(some != 0.0, moved, theta)
        for i in range(starts):
            locals_[1 + len(some) + i, blocks, i] += nudges[:, i]
        if len(thetas) == 1:
            return [np.zeros((0, r.count)) for r in rows]
        return changed(forward, forward.shoot(hypothesis, thetas, locals_, blocks), weights, blocks)

    changes = differences(moves, size)
    lost = np.flatnonzero(np.any([np.any(~np.isfinite(c[:fresh]), axis=1) for c in changes], axis=0))
    if len(lost):  # numbers of which no model can be built: the other way there may be one
        moves[lost] *= -1.0
        for c, new in zip(changes, differences(moves[lost], 0), strict=True):
            c[lost] = new
    least = small(forward, weights, blocks)
    large = np.sqrt(sum(np.sum(c[:fresh] ** 2, axis=1) for c in changes))
    bent = np.flatnonzero(np.nan_to_num(large) > least)
    if len(bent):
        moves[bent] *= 0.5 * least / large[bent][:, None]  # so that they need not be halved again nearby
        for c, new in zip(changes, differences(moves[bent], 0), strict=True):
            c[bent] = new
    if oblique:
        back = np.linalg.inv(moves).T
        tangent = [c[:fresh].T @ back for c in changes]
    else:
        steps[kept:] = np.diag(moves[:, kept:])
        tangent = [c[:fresh].T / steps[kept:] for c in changes]
    if known is not None:
        return replace(known.at(residual).beside(tangent, kept), steps=steps)
    slopes, tie = [], []
    for b, own, c, nudge in zip(blocks, rows, changes, nudges, strict=True):
        block = forward.blocks[b]
        slope = c[fresh:].T / nudge[:size]
        if own.start:
            slope[own.data : own.data + own.start] = np.diag(1.0 / block.known)
        slopes.append(slope)
        tie.append(1.0 / (weights.gap * block.reach) if own.tie and block.reach is not None else None)
    return Linearisation(rows, residual, tangent, slopes, tie, steps)


def along(forward: Predictor, numbers: Coordinates, theta: np.ndarray, line: Linearisation, least: float) -> np.ndarray:
    """Changes [P, P] of coordinates, one in each row, to take derivatives along at a point near a linearisation.

    They are principal axes of what data and priors tell, for numbers far enough from their bounds, and change by one
    standard deviation, or by less where the data show more. So derivatives along each are equally far above the errors
    of the solver. Derivatives by single numbers nearly cancel along a mass and all moments of a swing, and what is left
    of them is their errors.

    Args:
        least: whitened norm of a change that is small enough.
    """
    at, steps = numbers.of(theta), first_steps(forward, numbers, theta, line.steps)
    a = np.concatenate([line.eliminated.rows[:, :-1], np.diag(numbers.precision)])
    size = np.linalg.norm(a, axis=0)
    inner, weak = np.flatnonzero(size > 0.0), np.zeros((0, len(theta)))
    while len(inner):
        _, s, vt = np.linalg.svd(a[:, inner] / size[inner], full_matrices=False)
        own = vt / np.maximum(s, 1e-12)[:, None] / size[inner]
        reach = np.abs(own).max(axis=0, initial=0.0)
        free = (at[inner] - reach > numbers.low[inner]) & (at[inner] + reach < numbers.high[inner])
        if free.all():
            raw = np.sqrt(sum(np.sum((t[:, inner] @ own.T) ** 2, axis=0) for t in line.tangent))
            own *= np.minimum(1.0, 0.5 * least / np.maximum(raw, 1e-300))[:, None]
            weak = np.zeros((len(own), len(theta)))
            weak[:, inner] = own
            break
        inner = inner[free]
    if not len(weak):
        return np.diag(steps)
    _, _, order = qr(weak / steps, pivoting=True, mode="economic")
    single = np.sort(order[len(weak) :])
    return np.concatenate([weak, np.diag(steps)[single]])


def small(forward: Predictor, weights: Weights, blocks: Sequence[int]) -> float:
    """Norm of a whitened change that is small enough to be linear, and far above the solver's own error."""
    each = [forward.blocks[b] for b in blocks]
    shown = float(np.sum(sum(b.seen().sum(axis=0) for b in each) / weights.deviation**2))
    shown += sum(float(np.sum((weights.gap * b.reach) ** -2.0)) for b in each if b.reach is not None)
    return max(SMALL, ABOVE * forward.blur * float(np.sqrt(shown)))


def links(forward: Predictor, blocks: Sequence[int]) -> list[tuple[bool, bool]]:
    """Whether each of these blocks is tied to the one before and to the one after it, if that is among them."""
    asked = set(blocks)

    def tied(b: int) -> bool:
        return b >= 0 and b in asked and b + 1 in asked and forward.blocks[b].reach is not None

    return [(tied(b - 1), tied(b)) for b in blocks]


def _rows(forward: Predictor, blocks: Sequence[int], among: Sequence[int]) -> list[Rows]:
    """Rows of some blocks of those that are tied to each other."""
    tied = dict(zip(among, links(forward, among), strict=True))
    return [forward.blocks[b].rows(*tied[b]) for b in blocks]


def changed(
    forward: Predictor, shot: Prediction, weights: Weights, blocks: Sequence[int], among: Sequence[int] | None = None
) -> list[np.ndarray]:
    """Per block, whitened changes [K - 1, r] of what is predicted, from the first world to each of the others.

    Args:
        among: blocks to which these are tied (default: to each other).
    """
    out, every, rows = [], [forward.blocks[b] for b in blocks], _rows(forward, blocks, among or blocks)
    gaps = [np.where(b.seen(), v[1:] - v[0], 0.0) for b, v in zip(every, shot.values, strict=True)]
    white = whitened(weights, gaps, rows)
    for block, own, gap, data, ends in zip(every, rows, gaps, white, shot.ends, strict=True):
        data[np.any(np.isnan(gap), axis=(1, 2))] = np.nan
        parts = [data, np.zeros((len(data), own.start))]
        if own.tie and ends is not None and block.reach is not None:
            parts.append((ends[1:] - ends[0]) / (weights.gap * block.reach))
        out.append(np.concatenate(parts, axis=1))
    return out


def residuals(
    forward: Predictor,
    hypothesis: Hypothesis,
    theta: np.ndarray,
    local: np.ndarray,
    blocks: Sequence[int],
    weights: Weights,
    among: Sequence[int] | None = None,
) -> list[np.ndarray]:
    """Whitened residuals of blocks, their starts and gaps; nan where a prediction failed. See `changed` for `among`."""
    shot = forward.shoot(hypothesis, theta[None], local[None], blocks)
    out, every, rows = [], [forward.blocks[b] for b in blocks], _rows(forward, blocks, among or blocks)
    gaps = [np.where(b.seen(), b.values - v[0], 0.0) for b, v in zip(every, shot.values, strict=True)]
    white = whitened(weights, gaps, rows)
    for b, block, own, gap, data, ends in zip(blocks, every, rows, gaps, white, shot.ends, strict=True):
        parts = [data if np.all(np.isfinite(gap)) else np.full(len(data), np.nan)]
        if own.start:
            parts.append(-local[b] / block.known)
        if own.tie and ends is not None and block.reach is not None:
            parts.append((local[b + 1] - ends[0]) / (weights.gap * block.reach))
        out.append(np.concatenate(parts))
    return out


def start_steps(forward: Predictor, weights: Weights, blocks: Sequence[int]) -> np.ndarray:
    """Steps [B, L] for derivatives by the starts of blocks: shifts [m or rad], then rates.

    All data of a segment show one by a standard deviation, if nothing else acts. Over less, laws that stick and slip
    have kinks that do not matter, but moved the log evidence by two. A contact begins with a step of the solver, so
    that smaller changes of a start than a step's way do not move it.
    """
    out = np.zeros((len(blocks), forward.local))
    for n, b in enumerate(blocks):
        block = forward.blocks[b]
        if block.shows is None:
            continue
        shift = np.sqrt(block.seen().sum(axis=0) / weights.deviation**2 @ block.shows**2)
        precision = np.concatenate([shift, shift * block.times[-1] / np.sqrt(3.0)])
        out[n] = small(forward, weights, [b]) / np.hypot(precision, 1.0 / block.known)
        out[n] = np.minimum(out[n], LARGEST * block.known)
    if len(forward.model.contacts):
        m = forward.local // 2
        out = np.maximum(out, np.concatenate([np.full(m, 1e-4), np.full(m, 1e-2)]))
    return out


def first_steps(
    forward: Predictor, numbers: Coordinates, theta: np.ndarray, near: np.ndarray | None = None
) -> np.ndarray:
    """(P,) steps of coordinates for derivatives: what is noticeable, or those `near` first; inwards at a bound."""
    steps = np.full(len(theta), forward.nudge)
    if near is not None:
        steps[: len(near)] = np.abs(near)
    return np.where(numbers.of(theta) + steps > numbers.high, -steps, steps)
