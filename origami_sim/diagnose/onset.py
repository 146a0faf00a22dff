"""When a mismatch sets in: the first lasting departure of a recording from a fitted model.

Starts of segments and the model's numbers are fitted to all data, so that a departure leaks to the time before it. It
does not reach the innovations: what each frame adds to all that the frames before it, and what was known of the
numbers, would have predicted. For a model that holds they are white with variance one, whatever was fitted, and a
cumulative sum of their squares has a known chance to cross its threshold once. Where it crosses, the numbers and
starts are fitted again to the data before; the time itself is that of a bend in what is then left: a jump, a kick, a
force that sets in.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.fit.least_squares import Fit, Linearisation, Weights, fit, linearise

ALARM = 0.01
"""Chance of a departure being reported where there is none, over all recordings together."""

SLACK, MOST = 0.5, 16.0
"""Excess of a square over its mean that does not count, and the largest square that one frame can have."""

VAGUE = 1e3
"""Spread of a start, or of a number of which nothing is known, in units of the noise that it changes."""

BEFORE, AFTER = 0.8, 4
"""Part of a segment before an alarm from which its bend is told, and frames after it."""

SHARPER = 0.07, 0.1, 0.0
"""Part of what a jump, a kick and a force explain that does not count: late, the first two resemble a force before."""

MEMORY = 8
"""Segments before it that tell of the numbers."""

SPIKE = 8.0
"""Noise deviations from both neighbours beyond which a single value is taken for lost."""

DRAWS = 1000


@dataclass(frozen=True)
class Onset:
    """When a mismatch sets in.

    Attributes:
        time: on the recording's clock [s]; nan if there is no departure. error: standard deviation [s].
        recording: its index. alarm: when it was noticed [s].
    """

    time: float = np.nan
    error: float = np.nan
    recording: int = -1
    alarm: float = np.nan


@dataclass(frozen=True, eq=False)
class Stretch:
    """One segment in units of its noise: what is left, and what changes in numbers and start would change.

    Attributes:
        times: (n,) on the recording's clock [s].
        left: (n, D) recorded less predicted; nan where missing.
        numbers: [n, D, P] derivatives by the fitted numbers, each in units of what was known of it.
        start: [n, D, L] orthonormal changes by its start.
    """

    times: np.ndarray
    left: np.ndarray
    numbers: np.ndarray
    start: np.ndarray


def onset(
    forward,
    found: Fit,
    sigma: np.ndarray,
    *,
    weights: Weights | None = None,
    alarm: float = ALARM,
    refits: int = 3,
    seed: int = 0,
) -> Onset:
    """The first lasting departure of the recordings from a fitted model.

    The earliest alarm of the recordings counts, by the time since their beginnings.

    Args:
        forward: the segments. found: the fit; its numbers stay within what was known of them.
        sigma: (D,) standard deviations of the noise [SI]; taken larger where the residuals scatter more.
        weights: of `found`, whose derivatives are then used; else they are taken anew.
        alarm: chance of an alarm where nothing departs. refits: how often the data before an alarm are fitted again.
        seed: of the draws that set the threshold.
    """
    if found.failed or not found.blocks:
        return Onset()
    own = Weights(np.maximum(sigma, scatter(found.residuals)), 1.0)
    line = None if weights is None or found.linear is None else found.linear.reweighted(weights, own)
    stretches = dict(zip(found.blocks, stretched(forward, found, found.blocks, own, line), strict=True))
    weights, order = own, sorted(found.blocks, key=lambda b: (forward.blocks[b].recording, forward.blocks[b].first))
    height = threshold([len(s.times) for s in stretches.values()], len(sigma), alarm, seed)
    first: tuple[float, int, int, int] | None = None  # time since the beginning, recording, place in mine, frame
    for r in sorted({forward.blocks[b].recording for b in order}):
        mine = [stretches[b] for b in order if forward.blocks[b].recording == r]
        hit = crossing(innovations(mine), height)
        if hit is not None:
            since = mine[hit[0]].times[hit[1]] - forward.recordings[r].times[0]
            if first is None or since < first[0]:
                first = (float(since), r, *hit)
    if first is None:
        return Onset()
    _, r, place, frame = first
    mine = [b for b in order if forward.blocks[b].recording == r]
    for _ in range(refits):  # what departs had drawn the numbers away
        before = _fitted_before(forward, found, mine[: place + 1], frame, weights)
        hit = None
        for upto in (place + 1, len(mine)):
            if hit is None and not before.failed:
                hit = crossing(innovations(stretched(forward, before, mine[:upto], weights)), height)
        if hit is None or hit == (place, frame):
            break
        place, frame = hit
    last = forward.blocks[mine[place]].first + frame
    noticed, time, error = float(forward.recordings[r].times[last]), np.nan, np.nan
    for _ in range(2):
        anew, blocks, frame = _around(forward, found, r, last)
        clock = forward.recordings[r].times[anew.blocks[-1].first] + anew.blocks[-1].times
        until = frame if np.isnan(time) else int(np.searchsorted(clock, time - 1e-9))
        before = _fitted_before(anew, found, blocks, until, weights)
        if before.failed:
            break
        stretches = stretched(anew, before, blocks, weights)
        time, error = bend(stretches[:-1], stretches[-1], frame + AFTER)
    return Onset(time if np.isfinite(time) else noticed, error, r, noticed)


def _around(forward, found: Fit, r: int, frame: int):
    """The forward model with a segment of its own that ends soon after a frame, those before it, and the frame in it.

    An alarm soon after the start of a segment would leave too little to tell that start from what departs.
    """
    recording = forward.recordings[r]
    old = [b for b in found.blocks if forward.blocks[b].recording == r]
    longest = max(len(forward.blocks[b].times) for b in old)
    first = max(0, frame - int(BEFORE * longest))
    if forward.start == "fit":
        block = forward.segment(r, first, min(frame + AFTER + 1, len(recording.times)) - first)
        earlier = [b for b in old if forward.blocks[b].first + len(forward.blocks[b].times) <= first + 1]
    else:  # it starts from rest, once
        block = next(b for b in (forward.blocks[i] for i in old) if b.first <= frame < b.first + len(b.times))
        earlier = [b for b in old if forward.blocks[b].first < block.first]
    anew = copy.copy(forward)
    anew.blocks = [*forward.blocks, block]
    return (
        anew,
        [*sorted(earlier, key=lambda b: forward.blocks[b].first)[-MEMORY:], len(forward.blocks)],
        frame - block.first,
    )


def stretched(
    forward, found: Fit, blocks: Sequence[int], weights: Weights, line: Linearisation | None = None
) -> list[Stretch]:
    """The segments as `Stretch`es, linearised at a fit (or with derivatives that are known)."""
    if line is None:
        line = linearise(forward, found.hypothesis, found.free, found.theta, found.local, blocks, weights)
    out = []
    for n, b in enumerate(blocks):
        block = forward.blocks[b]
        shape = block.values.shape
        known = np.array([f.spread / f.scale for f in found.free])
        columns, left, slopes = (a[n][line.data(n)] for a in (line.tangent, line.residual, line.slopes))
        vague = VAGUE / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        columns = columns * np.where(np.isfinite(known), known, vague)
        times = forward.recordings[block.recording].times[block.first] + block.times
        left = np.where(np.isfinite(block.values), left.reshape(shape), np.nan)
        ways, size, _ = np.linalg.svd(slopes, full_matrices=False)  # also those that hardly show
        start = ways[:, size > 1e-7 * size.max(initial=1e-300)]
        out.append(Stretch(times, left, columns.reshape(*shape, -1), start.reshape(*shape, -1)))
    return out


def scatter(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """(D,) standard deviation of what changes from frame to frame in residuals (n, D): that of white noise."""
    fast = np.concatenate([np.diff(r, n=2, axis=0) for r in residuals])
    return 1.4826 * np.nanmedian(np.abs(fast), axis=0) / np.sqrt(6.0)


def usable(left: np.ndarray) -> np.ndarray:
    """(n, D) whether a value is there and not by itself far away from both of its neighbours, as a lost track is."""
    seen = np.isfinite(left)
    around = left[2:], left[:-2]
    with np.errstate(invalid="ignore"):
        far = np.abs(left[1:-1] - 0.5 * (around[0] + around[1])) > SPIKE
        seen[1:-1] &= ~(far & (np.abs(around[0] - around[1]) < 0.5 * SPIKE))
    return seen


def innovations(stretches: Sequence[Stretch]) -> list[np.ndarray]:
    """Per segment (n, D), what each value adds to all before it, in units of its standard deviation; nan if missing.

    The numbers are learnt from segment to segment; each start is learnt within its own.
    """
    out: list[np.ndarray] = []
    if not stretches:
        return out
    count = stretches[0].numbers.shape[2]
    mean, spread = np.zeros(count), np.eye(count)
    for s in stretches:
        size = s.start.shape[2]
        known = np.concatenate([mean, np.zeros(size)])
        doubt = np.zeros((count + size, count + size))
        doubt[:count, :count], doubt[count:, count:] = spread, VAGUE**2 * np.eye(size)
        e = np.full(s.left.shape, np.nan)
        for k, seen in enumerate(usable(s.left)):  # a Kalman filter whose state does not move
            if not np.any(seen):
                continue
            rows = np.concatenate([s.numbers[k, seen], s.start[k, seen]], axis=1)
            toward = doubt @ rows.T
            lower = np.linalg.cholesky(np.eye(len(rows)) + rows @ toward)
            e[k, seen] = np.linalg.solve(lower, s.left[k, seen] - rows @ known)
            gain = np.linalg.solve(lower, toward.T)
            known, doubt = known + gain.T @ e[k, seen], doubt - gain.T @ gain
        mean, spread = known[:count], doubt[:count, :count]
        out.append(e)
    return out


def crossing(e: Sequence[np.ndarray], height: float) -> tuple[int, int] | None:
    """Segment and frame at which the cumulative sum of the innovations' squares first exceeds a height; or None."""
    total = 0.0
    for n, part in enumerate(e):
        count = np.isfinite(part).sum(axis=1)
        excess = np.nansum(np.minimum(part**2, MOST), axis=1) - (1.0 + SLACK) * count
        for k, q in enumerate(excess):
            total = max(0.0, total + q)
            if total > height:
                return n, k
    return None


def threshold(frames: Sequence[int], components: int, alarm: float, seed: int = 0, draws: int = DRAWS) -> float:
    """Height that the cumulative sum over so many frames exceeds with chance `alarm` where nothing departs."""
    rng = np.random.default_rng(seed)
    total, highest = np.zeros(draws), np.zeros(draws)
    for _ in range(int(np.sum(frames))):
        squares = np.minimum(rng.standard_normal((components, draws)) ** 2, MOST).sum(axis=0)
        total = np.maximum(0.0, total + squares - (1.0 + SLACK) * components)
        highest = np.maximum(highest, total)
    return float(np.quantile(highest, 1.0 - alarm))


def bend(earlier: Sequence[Stretch], s: Stretch, stop: int) -> tuple[float, float]:
    """Time and standard deviation [s] of the bend in a segment that best explains what is left up to a frame.

    Before the bend there is nothing but noise and what numbers and start may change. After it come a jump of the
    channels, a kick and a force, or a force that changes, each by what the model makes of it: its response is that to a
    change of the start, taken at the time of the kick. Where no start is fitted, powers of the time since the bend
    stand for it.

    Args:
        earlier: segments before, which tell of the numbers. s: the segment. stop: the last frame that counts.
    """
    s = _cut(s, stop + 1)
    seen = usable(s.left)
    mean, root = _learnt(earlier, s.numbers.shape[2])
    y = (s.left - s.numbers @ mean)[seen]
    explained = _Explained(np.concatenate([(s.numbers @ root)[seen], VAGUE * s.start[seen]], axis=1))
    losses = SHARPER if s.start.shape[2] else (0.0, 0.0, 0.0)
    total, trials = float(explained.rest(y, y)), []
    for k in range(2, len(s.times) - 1):
        for lost, columns in zip(losses, _responses(s, k), strict=True):
            c = columns[seen]
            square, along = explained.rest(c, c), explained.rest(c, y)
            size = np.sqrt(np.maximum(np.diag(square), 0.0))
            use = size > 1e-9
            square, along = square[np.ix_(use, use)] / np.outer(size[use], size[use]), along[use] / size[use]
            value, vector = np.linalg.eigh(square)
            good = value > 1e-9
            gain = (1.0 - lost) * float(np.sum((vector.T @ along)[good] ** 2 / value[good]))
            trials.append((total - gain + np.log(len(y)) * np.count_nonzero(good), k))
    if not trials:  # a segment of a few frames, such as a piece of a short curve
        return float("nan"), float("nan")
    best, frame = min(trials)
    close = [k for left, k in trials if left < best + 4.0]
    step = float(np.median(np.diff(s.times)))
    return float(s.times[frame]), step * max(0.25 * (max(close) - min(close)), 0.3)


def _responses(s: Stretch, k: int) -> list[np.ndarray]:
    """Departures [n, D, c] that begin at frame k: a jump, a kick with a force, a force that changes."""
    n, count = s.left.shape
    since = np.maximum(np.arange(n) - k, 0.0) / max(n - 1 - k, 1)
    powers = [np.einsum("n,de->nde", np.where(since > 0, since**p, 0.0), np.eye(count)) for p in (1, 2, 3)]
    jump = np.einsum("n,de->nde", np.arange(n) >= k, np.eye(count))
    if not s.start.shape[2]:
        return [jump, *(np.concatenate(powers[p : p + 2], axis=2) for p in (0, 1))]
    kicks = _kicks(s)
    after = (np.arange(n) >= k)[:, None, None]
    force = np.cumsum(kicks[k:], axis=0)
    rising = np.cumsum(kicks[k:] * (np.arange(n - k) / n)[:, None, None], axis=0)

    def response(changes: np.ndarray) -> np.ndarray:
        """Of changes of the start [n - k, L, c] or [L, c] up to each frame."""
        whole = np.zeros((n, *changes.shape[-2:]))
        whole[k:] = changes
        return np.where(after, s.start @ whole, 0.0)

    kick, push, change = response(kicks[k]), response(force), response(rising)
    return [jump, np.concatenate([kick, push], axis=2), np.concatenate([push, change], axis=2)]


def _kicks(s: Stretch) -> np.ndarray:
    """[n, L, m]: changes of the start that at each frame leave the channels where they are and change a rate by one."""
    n, count, size = s.start.shape
    rates = np.gradient(s.start, s.times, axis=0)
    m = min(count, size // 2)
    both = np.concatenate([s.start, rates], axis=1)
    middle = both[n // 2]
    still = np.linalg.svd(middle[:count])[2][m:].T if m < size else np.zeros((size, 0))
    ways = np.linalg.svd(middle[count:] @ still)[0][:, :m]
    wanted = np.concatenate([np.zeros((count, m)), ways])
    scale = float(np.linalg.norm(s.start)) / max(float(np.linalg.norm(rates)), 1e-300)
    weight = np.repeat([1.0, scale], count)[:, None]
    return np.stack([np.linalg.pinv(weight * b, rcond=1e-6) @ (weight * wanted) for b in both])


def _cut(s: Stretch, stop: int) -> Stretch:
    return Stretch(s.times[:stop], s.left[:stop], s.numbers[:stop], s.start[:stop])


class _Explained:
    """What is left of products of values when what the columns (unit spreads) may change is taken into account.

    a' K^-1 b for the covariance K = 1 + X X', by the Woodbury identity.
    """

    def __init__(self, columns: np.ndarray):
        self.x = columns
        self.inverse = np.linalg.inv(np.eye(columns.shape[1]) + columns.T @ columns)

    def rest(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a.T @ b - (self.x.T @ a).T @ (self.inverse @ (self.x.T @ b))


def _learnt(stretches: Sequence[Stretch], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean (P,) and root [P, P] of the covariance of the numbers after these segments."""
    precision, pull = np.eye(count), np.zeros(count)
    for s in stretches:
        seen = usable(s.left)
        numbers, explained = s.numbers[seen], _Explained(VAGUE * s.start[seen])
        precision = precision + explained.rest(numbers, numbers)
        pull = pull + explained.rest(numbers, s.left[seen])
    covariance = np.linalg.inv(precision)
    return covariance @ pull, np.linalg.cholesky(0.5 * (covariance + covariance.T))


def _fitted_before(forward, found: Fit, blocks: Sequence[int], frame: int, weights: Weights) -> Fit:
    """The hypothesis fitted to the segments up to a frame of the last of them."""
    last, part = blocks[-1], slice(0, frame + 1)
    block = forward.blocks[last]
    masked = copy.copy(forward)
    masked.blocks = list(forward.blocks)
    masked.blocks[last] = replace(block, times=block.times[part], values=block.values[part])
    local = np.zeros((len(masked.blocks), found.local.shape[1]))
    local[: len(found.local)] = found.local
    return fit(masked, found.hypothesis, weights, theta=found.theta, local=local, blocks=blocks, most=4)
