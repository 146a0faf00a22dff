"""Noise that a fit implies: gaps, levels and colours under which what it leaves is most probable.

Every hypothesis is judged by its own (empirical Bayes), so that what one of them leaves is no noise to another.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from origami_sim.fit.chain import Chain
from origami_sim.fit.evidence import Group, Problem, Sets, reduced, summed
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.least_squares import OWED, Fit, settled, smoothed
from origami_sim.fit.nominal import white
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.residual_process import residual_process
from origami_sim.fit.weights import Weights, log_volume
from origami_sim.hypotheses.hypothesis import usual
from origami_sim.threads import shared

ROUNDS = 4
"""Times that levels, and then colours, follow what is left under them, at most. Without it a double chain takes 132 s
in place of 91, with the same verdict and numbers (within 0.1 %)."""


def with_own_noise(forward: Predictor, f: Fit, hyper: Hyper, known: Sequence[Weights] = ()) -> tuple[Fit, float]:
    """A fit in the most probable noise that it implies, and the squares that it promises there and does not gain.

    Noise is told by what a fit leaves, and that by the noise, so that several may suit each other. Beside those that
    follow from white noise and gaps of every size, those that suit other hypotheses (`known`) and the fit's own are
    tried. All are compared by derivatives; in the most probable ones the fit goes on by them, as far as its steps come
    true: what they promise beyond that counts for nothing. A fit that ended in coloured noise of its own goes on in it.
    Where promises do not come true, as with small gaps beside impacts, larger gaps are tried as well.
    """
    assert f.weights is not None
    found = implied(forward, f, hyper, (f.weights, *known) if f.weights.colour else known)
    larger = [gap for gap in _sizes(f, hyper) if gap > max(noise.gap for _, noise in found)]
    best, most, tried = (f, 0.0), -np.inf, list[tuple[float, float]]()
    while True:
        for log, noise in sorted(found, key=lambda each: -each[0]):
            if log <= most:
                break
            if any(noise.gap == gap and other - log < OWED for other, gap in tried):
                continue  # the same noise, reached from elsewhere
            tried.append((log, noise.gap))
            one, owed = settled(forward, f.reweighted(noise))
            if (log := log_evidence(one) - 0.5 * owed) > most:
                best, most = (one, owed), log
        if best[1] < OWED or not larger:
            return best
        found = _all_climbed(forward, f, [(white(forward, f.weights.deviation, larger.pop(0)), (False, True))])


def implied(forward: Predictor, f: Fit, hyper: Hyper, known: Sequence[Weights] = ()) -> list[tuple[float, Weights]]:
    """Log evidence of a fit in noise that it implies, and that noise, from each known one, and from white noise.

    From white noise with gaps of a size and of those beside it, none of which is better.
    """
    assert f.linear is not None and f.weights is not None
    others = [(noise, (True,)) for noise in known]
    if f.exact and f.weights.colour:
        return _all_climbed(forward, f, others)
    sizes = _sizes(f, hyper)
    place = int(np.argmax(shared([partial(log_evidence, f, gap) for gap in sizes])))
    fits: dict[int, tuple[float, Weights]] = {}
    out: list[tuple[float, Weights]] = []
    while True:
        new = [n for n in range(max(place - 1, 0), min(place + 2, len(sizes))) if n not in fits]
        begin = [white(forward, f.weights.deviation, sizes[n]) for n in new]
        found = _all_climbed(forward, f, [*((w, (False, True)) for w in begin), *others])
        fits |= zip(new, found, strict=False)
        out += found[len(new) :]
        others = []
        best = max(fits, key=lambda n: fits[n][0])
        if best == place:
            return [*fits.values(), *out]
        place = best


def _sizes(f: Fit, hyper: Hyper) -> tuple[float, ...]:
    """Sizes that gaps may have: of segments that are not tied that of its weights."""
    assert f.linear is not None and f.weights is not None
    return hyper.gaps if any(t is not None for t in f.linear.tie) else (f.weights.gap,)


def _all_climbed(
    forward: Predictor, f: Fit, begin: Sequence[tuple[Weights, Sequence[bool]]]
) -> list[tuple[float, Weights]]:
    """Log evidence of a fit in the noise that is reached from each of some, see `_climbed`, and that noise."""
    found = shared([partial(_climbed, forward, f, *one) for one in begin])
    # where nothing is better it is the same object, which others know it by
    return [(log, new or noise) for (log, new), (noise, _) in zip(found, begin, strict=True)]


def _climbed(forward: Predictor, f: Fit, noise: Weights, kinds: Sequence[bool]) -> tuple[float, Weights | None]:
    """Log evidence of a fit in the most probable noise that is reached from one, and that noise if it is another.

    What a fit leaves is less than the noise, and coloured where that is white, as segments and numbers follow the data.
    So levels and colours that are read from it are taken only while they raise the evidence, white ones first.

    Args:
        kinds: whether colours are read, or levels alone, in turn.
    """
    best, at = f.reweighted(noise), None
    log = log_evidence(best)
    for coloured in kinds:
        for _ in range(ROUNDS):
            assert best.weights is not None
            left = smoothed(forward, best, best.weights)
            new = best.reweighted(left_by(forward, left, best.weights.gap, coloured=coloured))
            if (found := log_evidence(new)) < log + OWED:
                break
            best, log, at = new, found, new.weights
    return log, at


def log_evidence(f: Fit, gap: float | None = None) -> float:
    """Log evidence of a fit in its noise, with gaps of its size or another one, without flaws and discrepancy."""
    line, own = f.linear, OwnColumns(f)
    assert line is not None and f.weights is not None
    size = gap or f.weights.gap
    chain = line.chain.columns(np.array([*own.nominal, *own.columns, -1])).regapped(f.weights.gap / size)
    cell, count = summed(own.problem(chain, len(own.columns)), 0.0, 0.0), len(own.columns)
    volume = f.weights.log_prior - log_volume(f.weights, line.rows)
    return float(cell.of(own.sets(count))[0][0]) + volume - float(np.log(size))


def left_by(forward: Predictor, residuals: list[np.ndarray], gap: float, *, coloured: bool = True) -> Weights:
    """Weights of residuals (n, D) [SI], no smaller than the measurement noise."""
    if not coloured:
        return white(forward, np.sqrt(np.nanmean(np.concatenate(residuals) ** 2, axis=0)), gap)
    found = [residual_process([r[:, d] for r in residuals], float(n)) for d, n in enumerate(forward.blocks[0].noise)]
    colour = tuple(c for _, c, _ in found)
    some = any(len(c) > 1 for c in colour)
    return Weights(np.array([d for d, *_ in found]), colour if some else (), gap, sum(p for *_, p in found))


class OwnColumns:
    """Columns of a fit's tangent: nominal numbers, then its effects', strengths first.

    Attributes:
        nominal: their indices. precision: (P,) scale over prior deviation. away: (P,) prior mean minus value, scaled.
        columns: of the effects. groups: one for each suspect.
    """

    def __init__(self, f: Fit):
        self.nominal = np.arange(len(f.free) - len(f.hypothesis.free))
        numbers = f.coordinates
        self.precision, self.away = numbers.precision, f.away
        self.columns: list[int] = []
        self.groups: list[Group] = []
        place = len(self.nominal)
        for s in f.hypothesis.suspects:
            inner = list(s.free)
            strong = [k for k, n in enumerate(inner) if n in s.strengths]
            arranged = [*strong, *(k for k in range(len(inner)) if k not in strong)]
            first, mine = inner[0], np.array([place + k for k in arranged])
            side = 1 if first.start <= first.lower else -1 if first.start >= first.upper else 0
            begin = len(self.columns)
            self.columns += mine.tolist()
            columns = tuple(range(begin, begin + len(inner)))
            spread = np.array([inner[k].spread / inner[k].scale for k in arranged])
            sizes = usual(s, [inner[k] for k in arranged])
            ends = numbers.low[mine], numbers.high[mine]
            self.groups.append(Group(columns, len(strong), -self.away[mine], side, spread, *ends, sizes))
            place += len(inner)

    def problem(self, chain: Chain, count: int) -> Problem:
        """What is left of columns `beside_numbers`, of which so many are of effects."""
        return reduced(chain, self.precision[self.nominal], self.away[self.nominal], count)

    def sets(self, count: int) -> Sets:
        """The set of all of them, in a problem of so many columns."""
        whole = tuple(range(len(self.groups)))
        return Sets.of([whole], self.groups, len(whole), count)
