"""Noise that a fit implies: gaps, levels and colours under which what it leaves is most probable.

Every hypothesis is judged by its own (empirical Bayes), so that what one of them leaves is no noise to another.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from origami_sim.fit.chain import Chain
from origami_sim.fit.evidence import Group, Problem, Sets, reduced, summed
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.hypothesis import usual
from origami_sim.fit.least_squares import Fit, precision, smoothed
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.residual_process import residual_process
from origami_sim.fit.weights import Weights
from origami_sim.threads import shared

ROUNDS = 4
"""Times that gaps and levels follow each other, at most."""

SETTLED = 1e-3
"""Relative change of levels and colours that ends it. Half, double and zero change no word of four swings, and no
probability by more than 0.004."""


def with_own_noise(forward: Predictor, f: Fit, hyper: Hyper) -> Fit:
    """A fit judged by what it leaves itself: no simulation, all that is fitted moves linearly."""
    for _ in range(ROUNDS):
        assert f.weights is not None
        before, gap = f.weights, best_gap(f, hyper)
        f = f.reweighted(left_by(forward, smoothed(forward, f, replace(before, gap=gap)), gap))
        if _settled(before, f.weights):
            break
    return f


def _settled(a: Weights, b: Weights | None) -> bool:
    assert b is not None
    if a.gap != b.gap or [len(c) for c in a.colour] != [len(c) for c in b.colour]:
        return False
    pairs = zip((a.deviation, *a.colour), (b.deviation, *b.colour), strict=True)
    return all(np.allclose(x, y, rtol=SETTLED, atol=SETTLED * np.abs(y).max()) for x, y in pairs)


def left_by(forward: Predictor, residuals: list[np.ndarray], gap: float) -> Weights:
    """Weights of residuals (n, D) [SI], no smaller than the measurement noise."""
    found = [residual_process([r[:, d] for r in residuals], float(n)) for d, n in enumerate(forward.blocks[0].noise)]
    colour = tuple(c for _, c, _ in found)
    coloured = any(len(c) > 1 for c in colour)
    return Weights(np.array([d for d, *_ in found]), colour if coloured else (), gap, sum(p for *_, p in found))


def best_gap(f: Fit, hyper: Hyper) -> float:
    """The size of the gaps between segments under which a fit is most probable."""
    line = f.linear
    assert line is not None and f.weights is not None
    if not any(t is not None for t in line.tie):
        return f.weights.gap
    own = OwnColumns(f)
    laid = own.sets(len(own.columns))
    chain, now = line.chain.columns(np.array([*own.nominal, *own.columns, -1])), f.weights.gap

    def log_evidence(gap: float) -> float:
        cell = summed(own.problem(chain.regapped(now / gap), len(own.columns)), 0.0, 0.0)
        return float(cell.of(laid, hyper)[0][0] - np.log(gap))

    return hyper.gaps[int(np.argmax(shared([partial(log_evidence, gap) for gap in hyper.gaps])))]


class OwnColumns:
    """Columns of a fit's tangent: nominal numbers, then its effects', strengths first.

    Attributes:
        nominal: their indices. precision: (P,) scale over prior deviation. away: (P,) prior mean minus value, scaled.
        columns: of the effects. groups: one for each suspect.
    """

    def __init__(self, f: Fit):
        self.nominal = np.arange(len(f.free) - len(f.hypothesis.free))
        scale = np.array([n.scale for n in f.free])
        self.precision = precision(f.free)
        self.away = (np.array([n.start for n in f.free]) - f.theta) / scale
        self.columns: list[int] = []
        self.groups: list[Group] = []
        place = len(self.nominal)
        for s in f.hypothesis.suspects:
            inner = list(s.free)
            strong = [k for k, n in enumerate(inner) if n in s.strengths]
            arranged = [*strong, *(k for k in range(len(inner)) if k not in strong)]
            at = np.array([(f.theta[place + k] - inner[k].start) / inner[k].scale for k in arranged])
            spread = np.array([inner[k].spread / inner[k].scale for k in arranged])
            first = inner[0]
            side = 1 if first.start <= first.lower else -1 if first.start >= first.upper else 0
            begin = len(self.columns)
            self.columns += [place + k for k in arranged]
            low, high = (
                np.array([(getattr(inner[k], name) - inner[k].start) / inner[k].scale for k in arranged])
                for name in ("lower", "upper")
            )
            columns = tuple(range(begin, begin + len(inner)))
            sizes = usual(s, [inner[k] for k in arranged])
            self.groups.append(Group(columns, len(strong), at, side, spread, low, high, sizes))
            place += len(inner)

    def problem(self, chain: Chain, count: int) -> Problem:
        """What is left of columns `beside_numbers`, of which so many are of effects."""
        return reduced(chain, self.precision[self.nominal], self.away[self.nominal], count)

    def sets(self, count: int) -> Sets:
        """The set of all of them, in a problem of so many columns."""
        whole = tuple(range(len(self.groups)))
        return Sets.of([whole], self.groups, len(whole), count)
