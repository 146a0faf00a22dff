"""Comparison of fitted hypotheses: held-out scores, evidence, probabilities.

All hypotheses are compared with the same weights and one effective sample size. The held-out score of a fold is that of
its blocks when the numbers are fitted to all other blocks; only the starts of the held-out blocks are adapted, by the
same rule for every hypothesis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import lsq_linear

from origami_sim.fit.hypothesis import PLAUSIBLE, Hypothesis
from origami_sim.fit.least_squares import Fit, Weights
from origami_sim.recording import Recording

FOLDS = 5
"""Folds of a single recording: contiguous stretches, so that neighbours do not give each other away."""

LEVEL = 0.02
"""Relative difference up to which two drives are of one level."""

SIMPLER = 1.0
"""Log evidence that a number beside an effect's strength costs at least."""

TEMPERATURE = 3.0
"""By which log evidence is divided before it becomes a probability; larger is more careful."""


@dataclass(frozen=True, eq=False)
class Score:
    """How well a hypothesis predicts what it was not fitted to.

    Attributes:
        held_out: (B,) log score of each block (of stretches, if there is one only), up to a constant shared by all
            hypotheses.
        rms: (D,) root mean square of the held-out residual [SI].
        squares: (B,) whitened sum of squares of each block, if only the stretch of its recording that it lies in is
            held out.
        evidence: log evidence: minus half the cost, minus what the numbers cost, see `penalty_of`.
    """

    held_out: np.ndarray
    rms: np.ndarray
    evidence: float
    squares: np.ndarray


def weights_from(forward, fits: Sequence[Fit], *, floor: bool = True) -> Weights:
    """Weights from the residuals of the best fit: its size, not below the measurement noise, and its memory."""
    best = min((f for f in fits if not f.failed), key=lambda f: f.cost)
    residuals = np.concatenate([r for r in best.residuals])
    rms = np.sqrt(np.nanmean(residuals**2, axis=0))
    noise = forward.blocks[0].noise
    deviation = np.maximum(rms, noise) if floor else rms
    return Weights(deviation, 1.0 / memory([r / deviation for r in best.residuals]))


def memory(residuals: Sequence[np.ndarray]) -> float:
    """Correlation time of residuals in samples: 1 + twice the sum of the autocorrelation up to its first zero."""
    longest = max(len(r) for r in residuals)
    lags = min(longest - 1, 400)
    sums, counts = np.zeros(lags + 1), np.zeros(lags + 1)
    for r in residuals:
        filled = np.nan_to_num(r - np.nanmean(r, axis=0))
        n = len(filled)
        size = 1 << int(np.ceil(np.log2(2 * n)))
        f = np.fft.rfft(filled, size, axis=0)
        acf = np.fft.irfft(f * np.conj(f), size, axis=0)[: min(n, lags + 1)].sum(axis=1)
        sums[: len(acf)] += acf
        counts[: len(acf)] += filled.shape[1] * (n - np.arange(len(acf)))
    rho = sums / np.maximum(counts, 1)
    if rho[0] <= 0:
        return 1.0
    rho = rho / rho[0]
    crossing = np.flatnonzero(rho < 0.05)
    stop = crossing[0] if len(crossing) else len(rho)
    return float(max(1.0, 1.0 + 2.0 * rho[1:stop].sum()))


def effective_samples(forward, fit: Fit, weights: Weights) -> float:
    """Number of independent samples in the fitted blocks."""
    return float(sum(np.isfinite(forward.blocks[b].values).sum() for b in fit.blocks) * weights.part)


def folds(forward, blocks: Sequence[int]) -> list[list[int]]:
    """Positions (within `blocks`) of each fold: whole recordings, or contiguous stretches of a single one.

    Recordings of one drive level are left out together, if there are others: repeats tell what they are to predict.
    """
    recordings = [forward.blocks[b].recording for b in blocks]
    distinct = sorted(set(recordings))
    if len(distinct) == 1:
        return stretches(forward, blocks)
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


def stretches(forward, blocks: Sequence[int]) -> list[list[int]]:
    """Positions (within `blocks`) of contiguous stretches of each recording; none if there is one block only."""
    recordings = np.array([forward.blocks[b].recording for b in blocks])
    out = []
    for r in sorted(set(recordings.tolist())):
        mine = np.flatnonzero(recordings == r)
        out += [list(map(int, part)) for part in np.array_split(mine, min(FOLDS, len(mine)))]
    return out if len(out) > 1 else []


def score(forward, fit: Fit, weights: Weights) -> Score:
    """Held-out score by one Gauss-Newton step of every leave-one-fold-out fit from the full fit.

    The linearisation of the full fit is exact for small changes of the numbers; leaving out a fold changes them by
    about a standard deviation. A single block is cut into stretches, of which the others tell its start.

    Args:
        weights: those of the fit.
    """
    line = fit.linear
    assert line is not None
    dims = len(weights.deviation)
    scale = np.array([f.scale for f in fit.free])
    known = np.diag([f.scale / f.spread if np.isfinite(f.spread) else 0.0 for f in fit.free])
    away = known @ ((np.array([f.start for f in fit.free]) - fit.theta) / scale)
    low = (np.array([f.lower for f in fit.free]) - fit.theta) / scale
    high = (np.array([f.upper for f in fit.free]) - fit.theta) / scale
    cut = len(fit.blocks) == 1
    if cut:
        own = slice(line.data(0).stop, None)  # what is known of its start
        known = block_diag(line.slopes[0][own], known)
        away = np.concatenate([line.residual[0][own], away])
        low, high = (np.concatenate([np.full(forward.local, v), b]) for v, b in ((-np.inf, low), (np.inf, high)))
        line = line.cut(FOLDS, dims)
    tangent = [line.clear(n, t) for n, t in enumerate(line.tangent)]
    cleared = [line.clear(n, r) for n, r in enumerate(line.residual)]

    def without(part: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """A change of theta / scale that leaves out a fold, and the root of the numbers' precision."""
        rows = [tangent[n] for n in range(len(tangent)) if n not in part]
        right = [cleared[n] for n in range(len(tangent)) if n not in part]
        a = np.concatenate([*rows, known])
        a = np.concatenate([a, np.diag(1e-6 * np.maximum(np.linalg.norm(a, axis=0), 1e-12))])
        y = np.concatenate([*right, away, np.zeros(len(low))])
        q, r = np.linalg.qr(a)
        return lsq_linear(r, q.T @ y, (np.minimum(low, -1e-12), np.maximum(high, 1e-12))).x, r

    held_out = np.array([-0.5 * float(c @ c) for c in cleared])
    left, near = [c.copy() for c in cleared], [c.copy() for c in cleared]
    several = len({forward.blocks[b].recording for b in fit.blocks}) > 1
    apart = [[n] for n in range(len(left))] if cut else folds(forward, fit.blocks)
    for part in apart if len(low) else []:
        step, root = without(part)
        for n in part:
            left[n] = cleared[n] - tangent[n] @ step
            held_out[n] = _predictive(left[n], tangent[n], root)
    for part in stretches(forward, fit.blocks) if several and len(low) else []:
        step, _ = without(part)
        for n in part:
            near[n] = cleared[n] - tangent[n] @ step
    squares = np.concatenate([v[line.data(n)].reshape(-1, dims) ** 2 for n, v in enumerate(left)]) / weights.part
    seen = np.concatenate([np.isfinite(r) for r in fit.residuals])
    rms = np.sqrt(squares.sum(0) / np.maximum(seen.sum(0), 1)) * weights.deviation
    n = max(effective_samples(forward, fit, weights), 2.0)
    told = np.diag(np.linalg.qr(np.concatenate([*tangent, known]), mode="r"))
    price = penalty_of(fit.hypothesis, told[len(told) - len(fit.hypothesis.free) :], n)
    whole = np.array([float(v[line.data(n)] @ v[line.data(n)]) for n, v in enumerate(near if several else left)])
    return Score(held_out, rms, -0.5 * fit.cost - price, whole)


def penalty_of(hypothesis: Hypothesis, known: np.ndarray, samples: float) -> float:
    """What the numbers of a hypothesis cost in log evidence: that of BIC, less for those of which the data tell little.

    An effect is as likely at few sites as at many.

    Args:
        known: how precisely each number is known, prior included, given those before it [1 / scale].
        samples: effective number of samples.
    """
    price, k = 0.0, 0
    for s in hypothesis.suspects:
        price += 0.5 * np.log(samples) + np.log(s.sites)
        narrowed = (PLAUSIBLE * known[k + 1 : k + len(s.free)]) ** 2
        price += 0.5 * float(np.sum(np.log(np.clip(narrowed, np.exp(2.0 * SIMPLER), samples))))
        k += len(s.free)
    return price


def _predictive(residual: np.ndarray, tangent: np.ndarray, root: np.ndarray) -> float:
    """Log density of a held-out residual (r,), with the uncertainty of the numbers that it was predicted with.

    Args:
        tangent: [r, P] by the numbers. root: [P, P] whose root' root is their precision.
    """
    spread = np.linalg.solve(root.T, tangent.T)  # [P, r]; the prediction's covariance is spread' spread
    inner = np.eye(len(spread)) + spread @ spread.T
    by = spread @ residual
    return -0.5 * float(residual @ residual - by @ np.linalg.solve(inner, by) + np.linalg.slogdet(inner)[1])


def probabilities(scores: Sequence[float], temperature: float = TEMPERATURE) -> np.ndarray:
    """Softmax of log evidences, tempered."""
    a = np.asarray(scores, float) / temperature
    a = np.where(np.isfinite(a), a, -np.inf)
    e = np.exp(a - a.max())
    return e / e.sum()


def reproducible(a: Score, b: Score) -> bool:
    """Whether a predicts held-out data better than b, and not by luck in one place.

    The gain must come from at least two blocks (if there are as many), and what other blocks lose must be a small part
    of it. A standard error over blocks would not do: an effect of large motions gains nothing where the motion has
    died.
    """
    d = a.held_out - b.held_out
    enough = np.count_nonzero(d > 1.0) >= min(2, len(d))
    return bool(d.sum() > 4.0 and enough and -d[d < 0].sum() < 0.5 * d[d > 0].sum())


def nearer(a: Score, b: Score) -> bool:
    """Whether a predicts held-out stretches with a smaller error than b, but for the block that it misses most.

    A number that mostly one block, or one recording, tells is badly known when that is left out.
    """
    rest = np.arange(len(a.squares)) != np.argmax(a.squares - b.squares) if len(a.squares) > 2 else slice(None)
    return bool(a.squares[rest].sum() < b.squares[rest].sum())


def together(f: Fit) -> float:
    """What several effects do together, less what starts take up, over what each of them does alone: squares.

    1 for effects that show in different places; near 0 where they cancel, linearised at the fit.
    """
    assert f.linear is not None
    own = len(f.free) - len(f.hypothesis.free)
    whole = np.concatenate([f.linear.clear(n, t) for n, t in enumerate(f.linear.tangent)])
    firsts = own + np.cumsum([0, *(len(s.free) for s in f.hypothesis.suspects[:-1])])
    each = whole[:, firsts] * [(f.theta[k] - f.free[k].start) / f.free[k].scale for k in firsts]
    return float(np.sum(each.sum(axis=1) ** 2) / max(np.sum(each**2), 1e-300))


WORTH, BEHIND = 25.0, 5.0
"""Log evidence by which an explanation with one more effect must be ahead, or else is put behind.

Errors that nobody lists add up to what looks like another effect. In opened sealed cases of a single effect, a second
one that was not there was ahead by 8 to 11, 16 and 18; one that was there by 36 or more.
"""


def better(a: Score, b: Score) -> bool:
    """Whether an explanation with more effects is worth it: what is held out must ask for them, and be nearer."""
    return reproducible(a, b) and nearer(a, b) and a.evidence > b.evidence + WORTH


def supported(fits: Sequence[Fit], scores: Mapping[int, Score]) -> list[float]:
    """Evidence of each fit; several effects that are no better than fewer of them fall below those."""
    out = []
    for f in fits:
        evidence = scores[id(f)].evidence
        mine = {s.label for s in f.hypothesis.suspects}
        for g in fits:
            inner = {s.label for s in g.hypothesis.suspects}
            if inner and inner < mine:
                if not better(scores[id(f)], scores[id(g)]):
                    evidence = min(evidence, scores[id(g)].evidence - BEHIND)
        out.append(evidence)
    return out


def difference(a: Score, b: Score) -> tuple[float, float]:
    """Held-out log score of a over b, and the standard error of that difference over blocks."""
    d = a.held_out - b.held_out
    return float(d.sum()), float(np.sqrt(len(d)) * d.std(ddof=1)) if len(d) > 1 else np.inf
