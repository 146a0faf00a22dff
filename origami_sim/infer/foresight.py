"""What sets of effects would leave, and how probable that is in noise of its own, without a simulation.

A fit that lacks an effect leaves coloured noise, in which the effect hardly shows. So a set is judged by the noise that
it would leave itself: all is linear, the residuals that follow are looked at as those of a fit are (`implied`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.optimize import lsq_linear

from origami_sim.fit.chain import Chain, Eliminated, triangle
from origami_sim.fit.evidence import Group, Summed, beside_numbers, log_occam, summed, with_priors, without_numbers
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.implied import OwnColumns, left_by
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, log_volume, patterns
from origami_sim.infer.columns import Columns
from origami_sim.threads import shared


@dataclass(frozen=True, eq=False)
class Foresight:
    """A fit in white noise of the size of what it leaves.

    Attributes:
        own: groups of the fit's own effects. nominal: columns of the model's numbers in its tangent.
        columns: [r, C] of its own and of further effects. left: what is left of nominal numbers, effects and residual
            once the starts suit each.
        white: its problem. root: [k, P + C + 1] with the same least squares as what is left.
    """

    forward: Predictor
    fit: Fit
    own: Sequence[Group]
    nominal: np.ndarray
    columns: Columns
    left: Eliminated
    white: Summed
    root: np.ndarray

    @classmethod
    def of(cls, forward: Predictor, f: Fit, own: OwnColumns, columns: Columns, hyper: Hyper) -> "Foresight":
        """Of a fit and the columns of its own and of further effects."""
        assert f.linear is not None and f.weights is not None
        plain = Weights(f.weights.deviation, gap=f.weights.gap)
        line = f.linear.reweighted(f.weights, plain)
        columns = replace(columns, line=line, weights=plain)
        left = Chain.shared(line, lambda some: beside_numbers(line, own.nominal, some, columns.of(some))).eliminated()
        whole = with_priors(left.rows, own.precision[own.nominal], own.away[own.nominal])
        white = summed(without_numbers(whole, len(own.nominal), columns.count, -left.spread), 0.0, hyper.flaws[0])
        return cls(forward, f, own.groups, own.nominal, columns, left, white, triangle(whole))

    def gains(self, sets: Sequence[Sequence[Group]], hyper: Hyper) -> np.ndarray:
        """Log evidence that sets of effects gain over the fit, each in noise of its own."""
        every = [self.own, *sets]
        some = sorted({c for groups in every for g in groups for c in g.columns})
        parts = self._parts(some)
        (before, _), *likely = shared([partial(self._likely, groups, some, parts) for groups in every])
        return np.array([log - before + log_occam(log - before, part, hyper) for log, part in likely])

    def _parts(self, some: Sequence[int]) -> np.ndarray:
        """[R, P + k + 1] what is left of numbers, some of the effects and the residual in the data of all segments."""
        line, first = self.columns.line, len(self.nominal)
        every, by = range(len(line.rows)), np.eye(first + self.columns.count + 1)
        columns = beside_numbers(line, self.nominal, every, self.columns.of(every, some))
        starts = self.left.starts(by[:, [*range(first), *(first + c for c in some), -1]])
        smoothed = line.smoothed(columns, list(starts))
        return np.concatenate([s[: r.data] for s, r in zip(smoothed, line.rows, strict=True)])

    @cached_property
    def _seen(self) -> np.ndarray:
        """[n, D] which values were measured, in all segments."""
        return np.concatenate([self.forward.blocks[b].seen() for b in self.fit.blocks])

    def _likely(self, groups: Sequence[Group], some: Sequence[int], parts: np.ndarray) -> tuple[float, np.ndarray]:
        """Log likelihood of what is left once these effects, within bounds, and all numbers explain their part.

        And what each of the strengths changes that the fit does not have.

        Args:
            parts: what is left of some of the effects.
        """
        first = len(self.nominal)
        use = [*range(first), *(first + c for g in groups for c in g.columns)]
        mine = [*range(first), *(first + some.index(c) for g in groups for c in g.columns)]
        none = np.full(first, np.inf)
        low = np.concatenate([-none, *(np.minimum(g.bounds()[0] - g.at, -1e-12) for g in groups)])
        high = np.concatenate([none, *(np.maximum(g.bounds()[1] - g.at, 1e-12) for g in groups)])
        change = lsq_linear(self.root[:, use], self.root[:, -1], (low, high)).x
        assert self.fit.linear is not None
        plain = self.columns.weights
        rows, deviation = self.fit.linear.rows, plain.deviation
        rest = (parts[:, -1] - parts[:, mine] @ change).reshape(-1, len(deviation))
        lengths = [r.data // len(deviation) for r in rows]
        left = np.split(np.where(self._seen, rest * deviation, np.nan), np.cumsum(lengths)[:-1])
        noise = left_by(self.forward, left, plain.gap)
        out = noise.log_prior - log_volume(noise, rows)
        for alike in patterns(rows):
            out -= 0.5 * float(np.sum(noise.whitened(np.stack([left[n] for n in alike]), rows[alike[0]]) ** 2))
        new = [first + c for g in groups if g not in self.own for c in g.columns[: g.strengths]]
        return out, change[[use.index(c) for c in new]] * np.linalg.norm(self.root[:, new], axis=0)
