"""Evidence of a linear Gaussian model: how probable recordings are under a set of added effects.

About a fit, whitened residuals are

    e = N dn + H dh + G_J a + sum_j b_j g_j + D c + noise

with nominal numbers N, the fit's own effects H, further effects G_J, *flaws* b (every suspect of the catalogue acts a
little in every device), a *discrepancy* c that is smooth in each channel, and one in the forces, which is the variance
of the gaps between tied segments (see `linear`). All priors are normal but those of strengths, which are mixtures of
normals on the scale of detectability d'. So all that is unknown is summed out in closed form, in Laplace's
approximation for strengths (MacKay 1992; Kennedy & O'Hagan 2001; George & McCulloch 1997).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import erfcx, log_ndtr

from origami_sim.fit.chain import Chain
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.linear import Linearisation

ROUNDS = 4
"""Times that the mode of strengths is found, each with the prior's curvature at the last one.

Without the curvature two effects that look the same would have a volume far beyond what the prior gives them.
"""

STILL = 1e-9
"""Deviations of a number, all others given, that a turn of the search for the mode within bounds moves it, or would
still move it, where it ends. The log evidence is then off by the square of that: half and double change it by less than
rounding does.
"""

AT_BOUND = 1e-5
"""Part of its scale up to which a number lies on a bound. A solver that stays within bounds ended an exposure 1.2e-9
from one; all others of two pendulums lie on theirs or are farther than 1e-3. Half and double change nothing.
"""


@dataclass(frozen=True, eq=False)
class Group:
    """Columns of one effect in a linear problem.

    Attributes:
        columns: their indices. strengths: how many of them, the first ones, are strengths.
        at: (k,) values where the problem is linearised, from where they begin, over the scale of the column.
        side: 1 or -1 where physics allows one sign of the strengths, else 0.
        spread: (k,) prior standard deviations of the shapes about where they begin, over the scale.
        low, high: (k,) bounds from where they begin, over the scale; None: there are none.
        usual: (k,) strengths as they usually are, over the scale; infinite where that depends on the device.
        whole: columns of what the strengths do from where they begin, and by how much of each; None: `columns`, `at`.
    """

    columns: tuple[int, ...]
    strengths: int
    at: np.ndarray
    side: int
    spread: np.ndarray
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    usual: np.ndarray | None = None
    whole: tuple[tuple[int, ...], np.ndarray] | None = None

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest values (k,) of the columns."""
        none = np.full(len(self.columns), np.inf)
        return -none if self.low is None else self.low, none if self.high is None else self.high

    def sizes(self) -> np.ndarray:
        """Usual values (k,) of the columns, infinite where there are none."""
        return np.full(len(self.columns), np.inf) if self.usual is None else self.usual

    @cached_property
    def laid(self) -> np.ndarray:
        """[8, k] what `Sets` are laid out from, in the order of its attributes."""
        place = np.arange(len(self.columns))
        strength = place < self.strengths
        side = np.where(strength, self.side, 0)
        return np.array([self.columns, self.at, self.spread, side, strength, *self.bounds(), self.sizes()], float)


@dataclass(frozen=True, eq=False)
class Problem:
    """One linearisation, for one size of the gaps: Gram matrices of all columns with the nominal numbers projected out.

    Attributes:
        gram: [C + K + 1, C + K + 1] of the columns of effects (C), of the channels' discrepancy (K), of the residual.
        columns: C. constant: of the log evidence.
    """

    gram: np.ndarray
    columns: int
    constant: float


def problem(
    line: Linearisation,
    nominal: np.ndarray,
    precision: np.ndarray,
    away: np.ndarray,
    effects: list[np.ndarray],
    smooth: list[np.ndarray],
) -> Problem:
    """Eliminates starts and nominal numbers.

    Args:
        nominal: indices of the nominal numbers' columns in the tangent. precision: (P,) scale over prior standard
            deviation of all numbers. away: (P,) prior mean minus value, over the scale.
        effects: per segment [r, C]. smooth: per segment [r, K].
    """
    more = [np.concatenate(both, axis=1) for both in zip(effects, smooth, strict=True)]
    chain = Chain.of(line, beside_numbers(line, nominal, range(len(line.rows)), more))
    return reduced(chain, precision[nominal], away[nominal], effects[0].shape[1])


def reduced(chain: Chain, precision: np.ndarray, away: np.ndarray, columns: int) -> Problem:
    """The problem of columns `beside_numbers`, of which so many are of effects; see `with_priors`."""
    left = chain.eliminated()
    return without_numbers(with_priors(left.rows, precision, away), len(precision), columns, -left.spread)


def beside_numbers(
    line: Linearisation, nominal: np.ndarray, segments: Sequence[int], columns: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Of each of some segments [r, P + k + 1]: columns of nominal numbers, others [r, k], and the residual."""
    return [
        np.concatenate([line.tangent[n][:, nominal], x, line.residual[n][:, None]], axis=1)
        for n, x in zip(segments, columns, strict=True)
    ]


def with_priors(rows: np.ndarray, precision: np.ndarray, away: np.ndarray) -> np.ndarray:
    """Rows, and below them one for what is known of each of the numbers, whose columns come first."""
    p = len(precision)
    below = np.zeros((p, rows.shape[1]))
    below[:, :p] = np.diag(precision)
    below[:, -1] = precision * away
    return np.concatenate([rows, below])


def without_numbers(whole: np.ndarray, p: int, columns: int, constant: float) -> Problem:
    """The problem that is left of rows [., P + C + K + 1] once the first P columns are eliminated.

    Numbers without a prior have a very wide one, the same for all hypotheses.
    """
    if not p:
        return Problem(whole.T @ whole, columns, constant)
    q, r = np.linalg.qr(whole[:, :p])
    size = np.abs(np.diag(r))
    keep = size > 1e-10 * size.max(initial=1e-300)
    rest = whole[:, p:] - q[:, keep] @ (q[:, keep].T @ whole[:, p:])
    return Problem(rest.T @ rest, columns, constant - float(np.sum(np.log(size[keep]))))


@dataclass(frozen=True, eq=False)
class Sets:
    """Sets of groups that have as many columns each, laid out for `Summed.of`.

    Attributes:
        columns: [n, k]. at, spread, side, low, high, usual: [n, k] of the columns, see `Group`. strength: [n, k] if it
            is one.
        back: [n, C] values of the strengths that the problem is linearised with and that a set lacks.
    """

    columns: np.ndarray
    at: np.ndarray
    spread: np.ndarray
    side: np.ndarray
    strength: np.ndarray
    low: np.ndarray
    high: np.ndarray
    usual: np.ndarray
    back: np.ndarray

    @classmethod
    def of(cls, sets: Sequence[tuple[int, ...]], groups: Sequence[Group], own: int, count: int) -> "Sets":
        """Lays out sets of groups, of which the first `own` are those that a problem of `count` columns is about."""

        used = sorted({g for row in sets for g in row})
        ends = np.cumsum([0, *(len(groups[g].columns) for g in used)]).tolist()
        place = {g: range(*span) for g, span in zip(used, pairwise(ends), strict=True)}
        index = np.array([[c for g in row for c in place[g]] for row in sets], int).reshape(len(sets), -1)

        each = np.concatenate([np.zeros((8, 0)), *(groups[g].laid for g in used)], axis=1)[:, index]
        back = np.zeros((len(sets), count))
        for k in range(own):
            g = groups[k]
            lacks = np.array([k not in row for row in sets])
            columns, values = g.whole or (g.columns[: g.strengths], g.at[: g.strengths])
            back[np.ix_(lacks, np.array(columns, int))] = values
        columns, at, spread, side, strength, low, high, usual = each
        return cls(columns.astype(int), at, spread, side, strength > 0.0, low, high, usual, back)


@dataclass(frozen=True, eq=False)
class Summed:
    """Problems with flaws and discrepancy summed out: Gram matrices of effects and residual, and what they are about.

    Attributes:
        gram: [..., C + 1, C + 1]. log: [...] constants of the log evidence.
    """

    gram: np.ndarray
    log: np.ndarray | float

    @classmethod
    def join(cls, each: "Sequence[Summed]") -> "Summed":
        """Several that are judged together."""
        return cls(np.stack([one.gram for one in each]), np.stack([one.log for one in each]))

    def of(self, sets: Sets, hyper: Hyper = HYPER) -> tuple[np.ndarray, np.ndarray]:
        """Log evidence [..., n] of sets, and values [..., n, k] of their columns."""
        # what the residual would be without what a set lacks
        gram, right, square = self.gram[..., :-1, :-1], self.gram[..., :-1, -1], self.gram[..., -1, -1, None]
        known = np.asarray(self.log)[..., None]
        n, k = sets.columns.shape
        if np.any(sets.back):
            own = np.flatnonzero(np.any(sets.back, axis=0))
            back = sets.back[:, own]
            lacking = back @ gram[..., own, :]
            square = square + np.sum(back * (2.0 * right[..., None, own] + lacking[..., own]), axis=-1)
            b = right[..., sets.columns] + lacking[..., np.arange(n)[:, None], sets.columns]
        else:
            b = right[..., sets.columns]
        if not k:
            return known - 0.5 * square + np.zeros(n), b
        a = gram[..., sets.columns[:, :, None], sets.columns[:, None, :]]
        norm = np.sqrt(np.maximum(a[..., range(k), range(k)], 1e-12))
        # shapes have normal priors about where they began; strengths a wide one, so that what does not show is finite
        wide = np.where(np.isfinite(sets.spread), sets.spread, 1e6)
        tight = np.where(sets.strength, norm / hyper.slabs[-1], 1.0 / wide)
        full, value, move, force = a, sets.at, sets.at, np.zeros_like(sets.at)
        for turn in range(ROUNDS):
            if turn:  # as narrow as the normals are that a strength of this size may come from
                tight = np.where(sets.strength, sharpness(value, norm, sets.usual, hyper), tight)
            full = a + np.eye(k) * (tight**2)[..., None, :]
            move, force = least_within(full, b - sets.at * tight**2, sets.low - sets.at, sets.high - sets.at)
            value = sets.at + move
        inverse = np.linalg.inv(full)
        sd = np.sqrt(np.maximum(inverse[..., range(k), range(k)], 1e-300))
        # of what lies beyond a bound there is no probability: of a tail that begins there, what is left is the rest
        inside = np.where(sets.side != 0, log_ndtr(sets.side * value / sd), 0.0)
        inside = np.where(force != 0.0, np.log(0.5 * erfcx(np.abs(force) * sd / np.sqrt(2.0))), inside)
        inside = inside + np.where(sets.side != 0, np.log(2.0), 0.0)
        left = square + np.sum(move * ((a @ move[..., None])[..., 0] - 2.0 * b), axis=-1)
        out = known - 0.5 * left - 0.5 * np.linalg.slogdet(full)[1] + 0.5 * k * np.log(2 * np.pi)
        slab = log_slab(value * norm, hyper) + np.log(norm)
        shape = -0.5 * np.log(2 * np.pi) + np.log(tight) - 0.5 * (value * tight) ** 2
        out += np.sum(np.where(sets.strength, slab, shape), axis=-1)
        # what is far beyond the usual is less probable: a Cauchy density times the one on the scale of detectability
        far = np.log1p((value / sets.usual) ** 2) + log_usual(sets.usual * norm, hyper)
        return out + np.sum(inside - far, axis=-1), value

    def lost(self, groups: Sequence[Group], lacking: Sequence[int]) -> float:
        """Squares over the noise that a fit misses more without some groups, all others refitted within bounds."""
        return self._missed(groups, lacking) - self._missed(groups, ())

    def _missed(self, groups: Sequence[Group], lacking: Sequence[int]) -> float:
        """Squares that groups miss, priors of their shapes included, without some of them."""
        columns = [c for g in groups for c in g.columns]
        at, spread = np.concatenate([g.at for g in groups]), np.concatenate([g.spread for g in groups])
        strength = np.concatenate([np.arange(len(g.columns)) < g.strengths for g in groups])
        gone = np.concatenate([np.full(len(g.columns), n in lacking) for n, g in enumerate(groups)])
        back = np.where(gone & strength, at, 0.0)
        gram, right, square = self.gram[columns][:, columns], self.gram[columns, -1], self.gram[-1, -1]
        square = square + back @ (2.0 * right + gram @ back)
        known = np.where(strength, 0.0, 1.0 / spread) ** 2
        a = gram + np.diag(known + 1e-12 * np.diag(gram) + 1e-300)
        slope, free = right + gram @ back - known * at, ~gone
        low, high = (np.concatenate(ends) - at for ends in zip(*(g.bounds() for g in groups), strict=True))
        few = a[free][:, free], slope[free], low[free], high[free]
        move = least_within(*(part[None] for part in few))[0][0]
        return float(square + known[free] @ at[free] ** 2 + move @ (few[0] @ move - 2.0 * few[1]))


def summed(p: Problem, smooth: float, flaws: float, held: Sequence[int] = ()) -> Summed:
    """Sums out flaws and a discrepancy of the channels whose sizes are standard deviations of noise, see `Hyper`.

    Args:
        held: columns that have no flaw, see `without_flaws`: at a bound it would take them beyond, and others are there
            twice.
    """
    c, k = p.columns, len(p.gram) - 1 - p.columns
    norms = np.sqrt(np.maximum(np.diag(p.gram)[:c], 1e-12))
    share = flaws / np.sqrt(max(c, 1))
    scale = np.concatenate([np.where(norms > 1e-5, share / norms, 0.0), np.full(k, smooth)])
    scale[list(held)] = 0.0
    u = p.gram[: c + k, : c + k] * scale[:, None] * scale
    rows = [*range(c), len(p.gram) - 1]
    cross = p.gram[: c + k][:, rows] * scale[:, None]
    m = np.eye(c + k) + u
    root = np.linalg.cholesky(m)
    by = solve_triangular(root, cross, lower=True, check_finite=False)
    gram = p.gram[np.ix_(rows, rows)] - by.T @ by
    return Summed(gram, p.constant - float(np.sum(np.log(np.diag(root)))))


def on_bound(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Whether numbers over their scales lie on a bound, as near as a solver gets that stays within."""
    return (values <= low + AT_BOUND) | (values >= high - AT_BOUND)


def without_flaws(groups: Sequence[Group]) -> list[int]:
    """Columns of groups that are linearised at one of their bounds, and of what their strengths do as a whole."""
    held = [c for g in groups for c, on in zip(g.columns, on_bound(g.at, *g.bounds()), strict=True) if on]
    return held + [c for g in groups if g.whole for c in g.whole[0]]


def log_slabs(d: np.ndarray, hyper: Hyper) -> np.ndarray:
    """Log densities [..., s] of a strength at detectability d' under each of the normals, times their shares."""
    widths = np.array(hyper.slabs)
    log = -0.5 * (d[..., None] / widths) ** 2 - np.log(widths) - 0.5 * np.log(2 * np.pi)
    return log + np.log(hyper.shares)


def log_slab(d: np.ndarray, hyper: Hyper) -> np.ndarray:
    """Log density of a strength at detectability d': a mixture of normals."""
    log = log_slabs(d, hyper)
    most = log.max(axis=-1, keepdims=True)
    return most[..., 0] + np.log(np.exp(log - most).sum(axis=-1))  # what scipy does, in less than half its time


def log_occam(gain: float, part: np.ndarray, hyper: Hyper) -> float:
    """Log evidence that strengths cost which gain so much log likelihood: of each, its prior over how sharp it is.

    Args:
        part: (k,) what each of them changes, in any unit.
    """
    d = np.sqrt(2.0 * max(gain, 0.0)) * np.abs(part) / max(float(np.linalg.norm(part)), 1e-300)
    return float(np.sum(log_slab(d, hyper) + 0.5 * np.log(2.0 * np.pi)))


def log_usual(c: np.ndarray, hyper: Hyper) -> np.ndarray:
    """Log of the mean of 1 / (1 + (d/c)^2) over strengths d: the part of them that is usual, if that is d' = c."""
    widths = np.array(hyper.slabs)
    ratio = np.where(np.isfinite(c), c, 1.0)[..., None] / widths
    share = (ratio * np.sqrt(np.pi / 2) * erfcx(ratio / np.sqrt(2.0))) @ hyper.shares
    return np.where(np.isfinite(c), np.log(share), 0.0)


def least_within(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where x' A x / 2 - b' x is least within bounds, and its slope there: none but in numbers that a bound holds.

    A sweep over coordinates finds which numbers are held, and a Newton step up to the next bound moves the others, in
    turn (as in gradient projection, More & Toraldo 1991): no turn makes it worse. All problems at once, of which
    scipy's `lsq_linear` solves one at a time.

    Args:
        a: [..., n, k, k]. b: [..., n, k]. low, high: [n, k].
    """
    x, slope = np.linalg.solve(a, b[..., None])[..., 0], np.zeros_like(b)
    low, high = np.broadcast_to(low, x.shape), np.broadcast_to(high, x.shape)
    met = np.nonzero(np.any((x < low) | (x > high), axis=-1))
    if not len(met[0]):
        return x, slope
    a, b, low, high = a[met], b[met], low[met], high[met]
    found, k = np.clip(x[met], low, high), x.shape[-1]
    known, root, going = (a, b, low, high), np.sqrt(np.diagonal(a, axis1=1, axis2=2)), np.arange(len(a))
    for _ in range(2 * k):
        a, b, low, high = (v[going] for v in known)
        before = found[going]
        y = before.copy()
        for i in range(k):
            force = b[:, i] - np.sum(a[:, i] * y, axis=-1)
            y[:, i] = np.clip(y[:, i] + force / a[:, i, i], low[:, i], high[:, i])
        held = (y <= low) | (y >= high)
        force = np.where(held, 0.0, b - (a @ y[..., None])[..., 0])
        free = np.where(held[:, :, None] | held[:, None, :], np.eye(k), a)
        step = np.linalg.solve(free, force[..., None])[..., 0]
        room = np.where(step > 0, high - y, y - low) / np.maximum(np.abs(step), 1e-200)
        y = np.clip(y + step * np.minimum(1.0, room.min(axis=-1, initial=1.0, where=~held))[:, None], low, high)
        found[going] = y
        pull = (b - (a @ y[..., None])[..., 0]) / root[going]
        led = (np.abs(pull) > STILL) & np.where(pull > 0, y < high, y > low)
        moved = np.abs(y - before) * root[going] > STILL
        going = going[np.any(led, axis=-1) & np.any(moved, axis=-1)]
        if not len(going):
            break
    a, b, low, high = known
    x[met] = found
    slope[met] = np.where((found <= low) | (found >= high), b - (a @ found[..., None])[..., 0], 0.0)
    return x, slope


def sharpness(value: np.ndarray, norm: np.ndarray, usual: np.ndarray, hyper: Hyper) -> np.ndarray:
    """One over the standard deviation of the normal prior of a strength that turned out to have this value.

    Args:
        norm: detectability of a strength of one. usual: strengths as they usually are.
    """
    return np.hypot(norm * _narrow(value * norm, hyper), np.sqrt(2.0) / np.hypot(usual, value))


def _narrow(d: np.ndarray, hyper: Hyper) -> np.ndarray:
    """One over the root mean square width of the normals, each as probable as it is at detectability d'."""
    log = log_slabs(d, hyper)
    share = np.exp(log - log.max(axis=-1, keepdims=True))
    return np.sqrt(share @ (1.0 / np.square(hyper.slabs)) / share.sum(axis=-1))
