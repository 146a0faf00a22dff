"""Fits of a hypothesis to recordings: Gauss-Newton over batched rollouts, with priors, bounds and fitted starts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from origami_sim.fit.derivatives import along, linearise, residuals, small
from origami_sim.fit.evidence import on_bound
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.restarts import restarted
from origami_sim.fit.weights import Weights, restored
from origami_sim.hypotheses.coordinates import Coordinates
from origami_sim.hypotheses.hypothesis import Free, Hypothesis

STEPS = (1.0, 0.4, 0.1, 0.01)
"""Fractions of a Gauss-Newton step that are tried, until one keeps its promise."""

CHORD = (1.0, 0.4)
"""The same while derivatives of an earlier point are in use; if none of them helps, the derivatives are taken anew."""

FAITHFUL = 0.7
"""Part of the promised improvement with which a step must come true for its derivatives to be used again.

What the next step by them promises may be the rest of that at most: more says that they converge too slowly.
"""

SHORT = 0.2
"""Part of a step up to which it is too short to be bent."""

SLOWEST, UTMOST = 2.5, 10.0
"""How many times smaller than where a fit begins the solver's step may become, and than without any suspect."""

STALE, OWN, ALL = range(3)
"""Which derivatives belong to the present point: none, those by the hypothesis' own numbers, all."""

OWED = 1.0
"""Squares over the noise, or log evidence, that a fit has to gain by going on: less decides nothing."""

DONE = 3e-3
"""A fit ends when a step improves it by less than this part of what it misses beyond the noise, or than OWED."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: what was fitted. free: the numbers, nominals first. theta: (P,) their values [SI].
        local: [B, L] fitted starts. blocks: which blocks were fitted.
        misfit: weighted sum of squares of the residuals over the fitted blocks and of the departures of their starts.
        penalty: of the departures from priors.
        residuals: per fitted block (n, D), recorded minus predicted [SI].
        tangent: [R, P] whitened derivative of all predictions by theta (scaled), with the starts projected out.
        at_bound: (P,) whether a number lies on a bound.
        failed: why the fit could not be made, or "".
        wider: (P,) by how much effects that are too small to be told widen what is known of theta; None: not asked.
        exact: whether all derivatives are those of the place where the fit ended.
        weights: what residuals were measured by.
    """

    hypothesis: Hypothesis
    free: tuple[Free, ...]
    theta: np.ndarray
    local: np.ndarray
    blocks: tuple[int, ...]
    misfit: float
    penalty: float
    residuals: list[np.ndarray]
    at_bound: np.ndarray
    failed: str = ""
    linear: "Linearisation | None" = None
    wider: np.ndarray | None = None
    exact: bool = False
    weights: "Weights | None" = None

    @property
    def cost(self) -> float:
        return self.misfit + self.penalty

    @cached_property
    def coordinates(self) -> Coordinates:
        """In which the numbers were fitted."""
        return Coordinates(self.free)

    @property
    def away(self) -> np.ndarray:
        """(P,) from the coordinates of the numbers to where they begin."""
        return -self.coordinates.of(self.theta)

    @property
    def strain(self) -> np.ndarray:
        """(P,) how far the numbers are from what was known before, in its standard deviations; nan: nothing was."""
        known = self.coordinates.precision
        return np.where(known > 0.0, np.abs(self.away) * known, np.nan)

    @cached_property
    def covariance(self) -> np.ndarray:
        """[P, P] of the coordinates, given the weights; zero if the numbers were not fitted."""
        count = len(self.free)
        if self.linear is None:
            return np.full((count, count), np.nan)
        if not self.linear.tangent[0].shape[1]:
            return np.zeros((count, count))
        a = np.concatenate([self.linear.eliminated.rows[:, :-1], np.diag(self.coordinates.precision)])
        root = np.linalg.pinv(a, rcond=1e-7)
        return root @ root.T

    def rms(self) -> np.ndarray:
        """(D,) root mean square of the residuals [SI]; nan where nothing was seen."""
        return np.sqrt(np.nanmean(np.concatenate(self.residuals) ** 2, axis=0))

    @property
    def spread(self) -> np.ndarray:
        """(P,) standard deviations of the coordinates."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0)) * (1.0 if self.wider is None else self.wider)

    def deviations(self) -> np.ndarray:
        """(P,) standard deviations of theta [SI]."""
        return self.spread * self.coordinates.slopes(self.theta)

    def intervals(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends (P,) of the 95 % intervals of theta, within the bounds."""
        at, reach = self.coordinates.of(self.theta), 1.96 * self.spread
        return self.coordinates.values(at - reach), self.coordinates.values(at + reach)

    def reweighted(self, new: Weights) -> "Fit":
        """The same numbers, judged with other weights."""
        assert self.linear is not None and self.weights is not None
        line = self.linear.reweighted(self.weights, new)
        misfit = float(sum(r @ r for r in line.residual))
        return replace(self, linear=line, misfit=misfit, weights=new)


def penalty(numbers: Coordinates, theta: np.ndarray) -> float:
    """Sum of squares of the departures from what was known before."""
    known = numbers.precision > 0.0
    return float(np.sum((numbers.of(theta)[known] * numbers.precision[known]) ** 2))


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
    rough: float = 0.0,
    known: Linearisation | None = None,
    kept: int = 0,
    begin: Linearisation | None = None,
    exact: bool = False,
) -> Fit:
    """Fits nominals, the hypothesis' numbers and the starts of the blocks.

    Minimises the weighted squares of recorded minus predicted plus the squares of the departures from what is known,
    within physical bounds, by Gauss-Newton steps that are bent and shortened while they do not keep their promise. The
    starts are eliminated block by block. Derivatives are used again as long as the steps that they give keep theirs.
    Where the fit ends, segments begin anew from where those before lead, if that is better (see `restarted`).

    Args:
        theta, local: where to begin (default: the starts of the numbers; the blocks' own starts).
        blocks: fit these only. fixed: keep theta and fit the starts only.
        rough: part of all that is missed which a step has to gain; for fits that are carried on with other weights.
        known: derivatives at a near point with the same weights, of which the first `kept` numbers' hold here too, and
            steps of the first numbers, or of all, that are small enough.
        begin: residuals and all derivatives of the point where the fit begins; `exact` if none is of a point before.
    """
    blocks = tuple(range(len(forward.blocks)) if blocks is None else blocks)
    free = (*forward.subject.nominals, *hypothesis.free)
    theta = np.array([f.start for f in free] if theta is None else theta, float)
    local = np.zeros((len(forward.blocks), forward.local)) if local is None else local.copy()
    numbers, width = Coordinates(free), 0 if fixed else len(free)

    line: Linearisation | None = begin

    def derived(theta, local, near: Linearisation | None, residual) -> Linearisation:
        steps = line.steps if line else known.steps if known else None
        axes = None
        if begin and near is None and width:
            axes = along(forward, numbers, theta, line or begin, small(forward, weights, blocks))
        also = {"known": near, "kept": kept if near else 0, "residual": residual, "steps": steps, "axes": axes}
        return linearise(forward, hypothesis, free, theta, local, blocks, weights, fixed=fixed, **also)

    def at(theta, local) -> tuple[float, list[np.ndarray], np.ndarray, np.ndarray]:
        """A point: its cost, its residuals, itself."""
        gaps = residuals(forward, hypothesis, theta, local, blocks, weights)
        cost = sum(float(r @ r) for r in gaps) + penalty(numbers, theta)
        return cost if np.isfinite(cost) else np.inf, gaps, theta, local

    def too_slow(theta, least: float) -> bool:
        return bool(width) and forward.step(hypothesis, theta) < least

    line = line or derived(theta, local, known, None)
    own = 0 < kept < width
    level = (ALL if exact else STALE) if begin else ALL if known is None else OWN if own else STALE
    best, doubts = sum(float(r @ r) for r in line.residual) + penalty(numbers, theta), 0
    if not np.isfinite(best):
        return _failed(hypothesis, free, theta, local, blocks, "the simulation goes unstable from the recorded start")
    step = forward.step(hypothesis, theta)
    slowest = min(step, forward.step(Hypothesis(), theta[: len(forward.subject.nominals)]) / UTMOST)
    slow = max(step / SLOWEST, slowest)
    floor, before = sum(np.isfinite(forward.blocks[b].values).sum() for b in blocks), np.inf

    def restart() -> bool:
        """Goes on from better starts of segments, if there are any."""
        nonlocal best, local, line, level, before
        assert theta is not None and local is not None and line is not None
        other, more = restarted(forward, hypothesis, theta, local, blocks, weights, line.residual)
        if more < max(OWED, rough * best):
            return False
        best, gaps, _, local = at(theta, other)
        line, level, before = derived(theta, local, None, gaps), ALL, np.inf
        return True

    for n in range(most):
        assert theta is not None and local is not None
        if not all(np.all(np.isfinite(t)) for t in line.tangent):
            return _failed(hypothesis, free, theta, local, blocks, "a derivative is not finite")
        change, moves, hoped = _proposed(forward, numbers, theta, local, blocks, line)
        enough = max(OWED, done * (best - floor), rough * best)
        whole, gain, found = best - hoped, 0.0, None
        if whole < enough and (level > STALE or not width):
            trial, start = numbers.values(numbers.of(theta) + change), local + moves
            # what the last step promises decides nothing, but fits that all take it can be compared
            if not too_slow(trial, slow) and (last := at(trial, start))[0] < best:
                best, gaps, theta, local = last
                line = line.at(gaps)
            if restart():
                continue
            break
        trying = STEPS if level == ALL or not n else CHORD
        straight = 0.0
        for part in trying:
            trial, start = numbers.values(numbers.of(theta) + part * change), local + part * moves
            # a strength far beyond what is needed can ask for very small steps of the solver
            # (or be of no model at all)
            if hypothesis.suspects and too_slow(trial, slow if part > trying[-1] else slowest):
                continue
            there = at(trial, start)
            owed = FAITHFUL * whole * part * (2.0 - part)
            straight = max(straight, best - there[0])
            if trying is STEPS and part > SHORT and best - owed <= there[0] < np.inf:
                # a curved valley: the way is bent by what predictions differ from what the derivatives said
                # (geodesic acceleration, Transtrum & Sethna 2012)
                more, moved, reach = _proposed(forward, numbers, trial, start, blocks, line.at(there[1]))
                bend = more - (1.0 - part) * change
                aside = numbers.values(numbers.of(trial) + bend)
                longer = np.linalg.norm(bend) > np.linalg.norm(part * change)
                if reach < min(there[0], best - gain) and not longer and not too_slow(aside, slow):
                    there = min(there, at(aside, start + moved - (1.0 - part) * moves), key=lambda p: p[0])
            if best - there[0] > gain:
                found, gain = there, best - there[0]
            if best - there[0] > owed:
                break
        faithful, stuck = straight > FAITHFUL * whole, gain < enough
        lagging, before = level == STALE and whole > (1.0 - FAITHFUL) * before, whole
        if stuck and level == ALL:
            if restart():
                continue
            break
        if found is not None:
            best, gaps, theta, local = found
            line = line.at(gaps)
        level = STALE
        if stuck or lagging or not faithful:  # first the hypothesis' own derivatives are renewed, then all
            doubts += 1
            level = OWN if own and doubts == 1 else ALL
            line = derived(theta, local, line if level == OWN else None, line.residual)
    else:
        if most:
            restart()
    if width and level == STALE:  # the intervals are those of the place where the fit ended
        line = derived(theta, local, line, line.residual)
    if not all(np.all(np.isfinite(t)) for t in line.tangent):
        return _failed(hypothesis, free, theta, local, blocks, "a derivative is not finite where the fit ends")
    out = _finished(forward, hypothesis, free, theta, local, blocks, weights, line)
    return replace(out, exact=level == ALL)


def carried_on(forward, f: Fit, *, most: int = 8) -> Fit:
    """A fit carried on from where it ended, with the derivatives and weights that it has."""
    assert f.weights is not None
    given = {"theta": f.theta, "local": f.local, "blocks": f.blocks, "begin": f.linear, "exact": f.exact}
    return fit(forward, f.hypothesis, f.weights, **given, most=most)


def renewed(forward, f: Fit) -> Fit:
    """A fit with all derivatives taken anew where it ended; a fit itself uses them as long as its steps come true."""
    assert f.weights is not None and f.linear is not None
    also = {"residual": f.linear.residual, "steps": f.linear.steps}
    if len(f.free):
        also["axes"] = along(forward, f.coordinates, f.theta, f.linear, small(forward, f.weights, f.blocks))
    line = linearise(forward, f.hypothesis, f.free, f.theta, f.local, f.blocks, f.weights, **also)
    if not all(np.all(np.isfinite(t)) for t in line.tangent):
        return f
    out = _finished(forward, f.hypothesis, f.free, f.theta, f.local, f.blocks, f.weights, line)
    return replace(out, exact=True)


def converged(forward, f: Fit) -> Fit:
    """A fit carried on by derivatives that are taken where it is, until these promise nothing."""
    f = f if f.exact else renewed(forward, f)
    if f.cost - promised(forward, f) >= OWED:
        f = carried_on(forward, f)
        f = f if f.failed or f.exact else renewed(forward, f)
    return f


def smoothed(forward, f: Fit, weights: Weights) -> list[np.ndarray]:
    """Residuals (n, D) [SI] of a fit's segments with the starts and numbers that suit other weights, linearly."""
    assert f.linear is not None and f.weights is not None
    line = f.linear.reweighted(f.weights, weights)
    width = line.tangent[0].shape[1]
    change, moves, _ = _proposed(forward, f.coordinates, f.theta, f.local, f.blocks, line)
    left = [r - t @ change[:width] for r, t in zip(line.residual, line.tangent, strict=True)]
    return restored(weights, line.smoothed(left, list(moves[list(f.blocks)])), line.rows)


def promised(forward, f: Fit) -> float:
    """The cost that one more step promises a fit, by the derivatives that it has."""
    assert f.linear is not None
    return _proposed(forward, f.coordinates, f.theta, f.local, f.blocks, f.linear)[2]


def settled(forward, f: Fit, most: int = 8) -> tuple[Fit, float]:
    """A fit after further steps by the derivatives that it has, and the squares that these promise and do not gain.

    Where gaps are small a step breaks ties by its curvature, which the next one mends. So steps are whole, and need not
    gain one by one (a watchdog, Chamberlain et al. 1982), as long as each misses less than the one before.
    """
    assert f.weights is not None
    at, best, least = f, f, np.inf
    for n in range(most + 1):
        assert at.linear is not None
        change, moves, hoped = _proposed(forward, at.coordinates, at.theta, at.local, at.blocks, at.linear)
        least = hoped if at is best else least
        if n == most or best.cost - hoped < OWED:
            break
        theta, local = at.coordinates.values(at.coordinates.of(at.theta) + change), at.local + moves
        line = at.linear.at(residuals(forward, f.hypothesis, theta, local, f.blocks, f.weights))
        before, at = at, _finished(forward, f.hypothesis, f.free, theta, local, f.blocks, f.weights, line)
        if not at.cost < (before.cost if n else np.inf):
            break
        best = min(best, at, key=lambda one: one.cost)
    return best, max(best.cost - least, 0.0)


def _proposed(
    forward, numbers: Coordinates, theta, local, blocks, line: Linearisation
) -> tuple[np.ndarray, np.ndarray, float]:
    """A Gauss-Newton step within the bounds: of coordinates (P,), of the starts [B, L], and the cost it promises."""
    at, prior, width = numbers.of(theta), numbers.precision, line.tangent[0].shape[1]
    change = np.zeros(len(theta))
    chain = line.eliminated
    whole = chain.rows
    if width:
        a = np.concatenate([whole[:, :-1], np.diag(prior)])
        y = np.concatenate([whole[:, -1], -prior * at])
        a = np.concatenate([a, np.diag(1e-6 * np.maximum(np.linalg.norm(a, axis=0), 1e-12))])
        y = np.concatenate([y, np.zeros(len(theta))])
        q, r = np.linalg.qr(a)  # a small system with the same least squares
        low, high = numbers.low - at, numbers.high - at
        change = np.asarray(lsq_linear(r, q.T @ y, (np.minimum(low, -1e-12), np.maximum(high, 1e-12))).x, float)
    left = np.append(-change[:width], 1.0)  # what columns and residual add up to after the step
    moves = np.zeros_like(local)
    if forward.local:
        moves[list(blocks)] = chain.starts(left[:, None])[:, :, 0]
    promised = float(np.sum((prior * (at + change)) ** 2) + np.sum((whole @ left) ** 2))
    return change, moves, promised


def _finished(forward, hypothesis, free, theta, local, blocks, weights, line) -> Fit:
    residuals = restored(weights, line.residual, line.rows)
    misfit = float(sum(r @ r for r in line.residual))
    numbers = Coordinates(free)
    at_bound = on_bound(numbers.of(theta), numbers.low, numbers.high)
    return Fit(
        hypothesis,
        free,
        theta,
        local,
        blocks,
        misfit,
        penalty(numbers, theta),
        residuals,
        at_bound,
        linear=line,
        weights=weights,
    )


def _failed(hypothesis, free, theta, local, blocks, why: str) -> Fit:
    return Fit(hypothesis, free, theta, local, blocks, np.inf, 0.0, [], np.zeros(len(free), bool), failed=why)
