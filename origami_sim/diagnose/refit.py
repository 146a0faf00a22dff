"""Fits of a hypothesis to recordings: Gauss-Newton over batched rollouts, with priors, bounds and fitted starts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from origami_sim.diagnose.hypothesis import Free, Hypothesis

STEPS = (1.0, 0.4, 0.1, 0.01)
"""Fractions of a Gauss-Newton step that are tried in one batch."""

DONE = 3e-3
"""A fit ends when a step improves it by less than this part of the misfit."""


@dataclass(frozen=True, eq=False)
class Weights:
    """How much a residual counts: a standard deviation per component, and the part of samples that are independent.

    Attributes:
        deviation: (D,) [SI]. part: effective number of samples over their number, in (0, 1].
    """

    deviation: np.ndarray
    part: float = 1.0


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: what was fitted. free: the numbers, nominals first. theta: (P,) their values [SI].
        local: [B, L] fitted starts. blocks: which blocks were fitted.
        misfit: weighted sum of squares of the residuals over the fitted blocks. penalty: of the departures from priors.
        residuals: per fitted block (n, D), recorded minus predicted [SI].
        tangent: [R, P] whitened derivative of all predictions by theta (scaled), with the starts projected out.
        covariance: [P, P] of theta [SI], given the weights.
        at_bound: (P,) whether a number lies on a bound.
        failed: why the fit could not be made, or "".
    """

    hypothesis: Hypothesis
    free: tuple[Free, ...]
    theta: np.ndarray
    local: np.ndarray
    blocks: tuple[int, ...]
    misfit: float
    penalty: float
    residuals: list[np.ndarray]
    covariance: np.ndarray
    at_bound: np.ndarray
    failed: str = ""
    linear: "Linearisation | None" = None

    @property
    def cost(self) -> float:
        return self.misfit + self.penalty

    def deviations(self) -> np.ndarray:
        """(P,) standard deviations of theta."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Whitened residuals and tangents of the fitted blocks, with the starts projected out.

    Attributes:
        residual: per block (r,). tangent: per block [r, P] by theta / scale. basis: per block [r, l] orthonormal
            directions of the starts; project with `clear`. solve: per block, from projected changes to starts.
    """

    residual: list[np.ndarray]
    tangent: list[np.ndarray]
    basis: list[np.ndarray]
    starts: list[np.ndarray]

    def clear(self, b: int, columns: np.ndarray) -> np.ndarray:
        """Columns [r, ...] without what a change of the start could explain."""
        q = self.basis[b]
        return columns - q @ (q.T @ columns)


def whitened(values: np.ndarray, weights: Weights) -> np.ndarray:
    """Residuals [..., n, D] as (..., n D) numbers of unit variance; missing ones are zero."""
    scaled = np.nan_to_num(values / weights.deviation) * np.sqrt(weights.part)
    return scaled.reshape(*values.shape[:-2], values.shape[-2] * values.shape[-1])


def penalty(free: Sequence[Free], theta: np.ndarray) -> float:
    """Sum of squares of the departures from what was known before."""
    return float(
        sum(((t - f.start) / f.spread) ** 2 for f, t in zip(free, theta, strict=True) if np.isfinite(f.spread))
    )


def misfits(forward, blocks, predicted: list[np.ndarray], weights: Weights) -> np.ndarray:
    """[K, B] weighted sums of squares; infinite where a prediction failed where something was measured."""
    out = []
    for b, values in zip(blocks, predicted, strict=True):
        measured = forward.blocks[b].values
        gap = measured - values
        lost = np.any(np.isnan(values) & np.isfinite(measured), axis=(-1, -2))
        out.append(np.where(lost, np.inf, np.sum(whitened(gap, weights) ** 2, axis=-1)))
    return np.stack(out, axis=-1)


def linearise(
    forward, hypothesis: Hypothesis, free, theta, local, blocks, weights: Weights, *, fixed: bool = False
) -> Linearisation:
    """Residuals and tangents at a point; the derivatives are forward differences, all in one batch of worlds.

    Args:
        fixed: leave theta out (only the starts are to be fitted).
    """
    count = 0 if fixed else len(free)
    size = local.shape[1]
    steps = np.array([_step(f, t) for f, t in zip(free, theta, strict=True)])[:count]
    nudges = start_steps(forward)
    thetas = np.repeat(theta[None], 1 + count + size, axis=0)
    locals_ = np.repeat(local[None], 1 + count + size, axis=0)
    for p in range(count):
        thetas[1 + p, p] += steps[p]
    for i in range(size):
        locals_[1 + count + i, :, i] += nudges[i]
    predicted = forward.predict(hypothesis, thetas, locals_, blocks)
    residual, tangent, basis, starts = [], [], [], []
    for b, values in zip(blocks, predicted, strict=True):
        r = whitened(forward.blocks[b].values - values[0], weights)
        seen = np.isfinite(forward.blocks[b].values)
        change = np.where(seen, values[1:] - values[0], 0.0)
        slopes = whitened(change, weights).T
        t = slopes[:, :count] * ([f.scale for f in free[:count]] / steps) if count else slopes[:, :0]
        s = slopes[:, count:] / nudges if size else slopes[:, :0]
        if size:
            u, sv, vt = np.linalg.svd(s, full_matrices=False)
            good = sv > 1e-7 * (sv[0] if len(sv) else 1.0)
            q, back = u[:, good], vt[good].T / sv[good]
        else:
            q, back = np.zeros((len(r), 0)), np.zeros((0, 0))
        residual.append(r)
        tangent.append(t)
        basis.append(q)
        starts.append(back)
    return Linearisation(residual, tangent, basis, starts)


def start_steps(forward) -> np.ndarray:
    """Steps for derivatives by the starts: shifts [m or rad], then rates.

    A contact begins with a step of the solver, so that smaller changes of a start than a step's way do not move it.
    """
    m = forward.local // 2
    shift, rate = (1e-4, 1e-2) if len(forward.model.contacts) else (1e-6, 1e-5)
    return np.concatenate([np.full(m, shift), np.full(m, rate)]) if forward.local else np.zeros(0)


def _step(f: Free, value: float) -> float:
    """Step of a derivative: a hundredth of what is noticeable, inwards at a bound."""
    step = 0.01 * f.scale
    return -step if value + step > f.upper else step


def fit(
    forward,
    hypothesis: Hypothesis,
    weights: Weights,
    *,
    theta: np.ndarray | None = None,
    local: np.ndarray | None = None,
    blocks: Sequence[int] | None = None,
    fixed: bool = False,
    most: int = 8,
    done: float = DONE,
) -> Fit:
    """Fits nominals, the hypothesis' numbers and the starts of the blocks.

    Minimises the weighted squares of recorded minus predicted plus the squares of the departures from the priors,
    within physical bounds, by Gauss-Newton steps of which several lengths are tried in one batch. The starts are
    eliminated block by block.

    Args:
        theta, local: where to begin (default: the starts of the numbers; the blocks' own starts).
        blocks: fit these only. fixed: keep theta and fit the starts only.
    """
    blocks = tuple(range(len(forward.blocks)) if blocks is None else blocks)
    free = (*forward.subject.nominals, *hypothesis.free)
    theta = np.array([f.start for f in free] if theta is None else theta, float)
    local = np.zeros((len(forward.blocks), forward.local)) if local is None else local.copy()
    lower = np.array([f.lower for f in free])
    upper = np.array([f.upper for f in free])
    scale = np.array([f.scale for f in free])
    prior = np.array([f.scale / f.spread if np.isfinite(f.spread) else 0.0 for f in free])
    predicted = forward.predict(hypothesis, theta[None], local[None], blocks)
    best = float(misfits(forward, blocks, predicted, weights).sum()) + penalty(free, theta)
    if not np.isfinite(best):
        return _failed(hypothesis, free, theta, local, blocks, "the simulation goes unstable from the recorded start")
    line = None
    for _ in range(most):
        assert theta is not None and local is not None
        line = linearise(forward, hypothesis, free, theta, local, blocks, weights, fixed=fixed)
        if not all(np.all(np.isfinite(t)) for t in line.tangent):
            return _failed(hypothesis, free, theta, local, blocks, "a derivative is not finite")
        change = np.zeros(len(free))
        if not fixed and len(free):
            rows = [line.clear(n, line.tangent[n]) for n in range(len(blocks))]
            right = [line.clear(n, line.residual[n]) for n in range(len(blocks))]
            wanted = np.array([f.start for f in free])
            a = np.concatenate([*rows, np.diag(prior)])
            y = np.concatenate([*right, prior * (wanted - theta) / scale])
            low, high = (lower - theta) / scale, (upper - theta) / scale
            norms = np.linalg.norm(a, axis=0)
            a = np.concatenate([a, np.diag(1e-6 * np.maximum(norms, 1e-12))])
            y = np.concatenate([y, np.zeros(len(free))])
            r_, q_ = _compressed(a, y)
            found = lsq_linear(r_, q_, (np.minimum(low, -1e-12), np.maximum(high, 1e-12)))
            change = np.asarray(found.x, float)
        moves = np.zeros_like(local)
        for n, b in enumerate(blocks):
            left = line.residual[n] - line.tangent[n] @ change[: line.tangent[n].shape[1]]
            moves[b] = line.starts[n] @ (line.basis[n].T @ left) if forward.local else 0.0
        trials = np.stack([np.clip(theta + s * change * scale, lower, upper) for s in STEPS])
        starts = np.stack([local + s * moves for s in STEPS])
        predicted = forward.predict(hypothesis, trials, starts, blocks)
        per_block = misfits(forward, blocks, predicted, weights)
        costs = per_block.sum(axis=1) + [penalty(free, t) for t in trials]
        k = int(np.argmin(costs))
        if not costs[k] < best:
            break
        gain = best - costs[k]
        theta, local, best = trials[k], starts[k], float(costs[k])
        if gain < done * best:
            break
    return _finished(forward, hypothesis, free, theta, local, blocks, weights, line, fixed)


def _compressed(a: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A small system with the same least squares."""
    q, r = np.linalg.qr(a)
    return r, q.T @ y


def _finished(forward, hypothesis, free, theta, local, blocks, weights, line, fixed) -> Fit:
    predicted = forward.predict(hypothesis, theta[None], local[None], blocks)
    residuals = [forward.blocks[b].values - v[0] for b, v in zip(blocks, predicted, strict=True)]
    misfit = float(misfits(forward, blocks, predicted, weights).sum())
    scale = np.array([f.scale for f in free])
    lower, upper = np.array([f.lower for f in free]), np.array([f.upper for f in free])
    covariance = np.zeros((len(free), len(free)))
    if line is not None and not fixed and len(free):
        prior = np.array([f.scale / f.spread if np.isfinite(f.spread) else 0.0 for f in free])
        a = np.concatenate([*(line.clear(n, t) for n, t in enumerate(line.tangent)), np.diag(prior)])
        covariance = np.linalg.pinv(a.T @ a, rcond=1e-14) * np.outer(scale, scale)
    near = 1e-9 * np.maximum(scale, 1e-300)
    at_bound = (theta <= lower + near) | (theta >= upper - near)
    return Fit(
        hypothesis,
        free,
        theta,
        local,
        blocks,
        misfit,
        penalty(free, theta),
        residuals,
        covariance,
        at_bound,
        linear=line,
    )


def _failed(hypothesis, free, theta, local, blocks, why: str) -> Fit:
    n = len(free)
    return Fit(
        hypothesis, free, theta, local, blocks, np.inf, 0.0, [], np.full((n, n), np.nan), np.zeros(n, bool), failed=why
    )
