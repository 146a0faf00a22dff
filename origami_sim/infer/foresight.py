"""What sets of effects would leave, and how probable that is in noise of its own, without a simulation.

A fit that lacks an effect leaves coloured noise, in which the effect hardly shows. So a set is judged by the noise that
it would leave itself: all is linear, the residuals that follow are looked at as those of a fit are (`implied`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.optimize import lsq_linear

from origami_sim.fit.chain import Chain, triangle
from origami_sim.fit.evidence import Group, Summed, beside_numbers, log_occam, summed, with_priors, without_numbers
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, log_volume, patterns, recast
from origami_sim.infer.implied import OwnColumns, left_by
from origami_sim.threads import shared


@dataclass(frozen=True, eq=False)
class Foresight:
    """A fit in white noise of the size of what it leaves.

    Attributes:
        own: groups of the fit's own effects. numbers: of the model, whose columns come first.
        white: its problem. root: [k, P + C + 1] with the same least squares as nominal numbers, effects and residual
            once the starts suit each. parts: [R, P + C + 1], what is left then of each in the data of all segments,
            over the noise.
    """

    forward: Predictor
    fit: Fit
    weights: Weights
    own: Sequence[Group]
    numbers: int
    white: Summed
    root: np.ndarray
    parts: np.ndarray

    @classmethod
    def of(cls, forward: Predictor, f: Fit, own: OwnColumns, effects: list[np.ndarray], hyper: Hyper) -> "Foresight":
        """Of a fit and the whitened columns of its own and of further effects, per segment [r, C]."""
        assert f.linear is not None and f.weights is not None
        plain = Weights(f.weights.deviation, gap=f.weights.gap)
        line = f.linear.reweighted(f.weights, plain)
        theirs = recast(effects, line.rows, f.weights, plain)
        columns, count = beside_numbers(line, own.nominal, theirs), len(own.nominal)
        left = Chain.shared(line, columns).eliminated()
        whole = with_priors(left.rows, own.precision[own.nominal], own.away[own.nominal])
        root = triangle(whole)
        white = summed(without_numbers(whole, count, theirs[0].shape[1], -left.spread), 0.0, hyper.flaws[0])
        smoothed = line.smoothed(columns, list(left.starts(np.eye(whole.shape[1]))))
        parts = np.concatenate([s[: r.data] for s, r in zip(smoothed, line.rows, strict=True)])
        return cls(forward, f, plain, own.groups, count, white, root, parts)

    def gains(self, sets: Sequence[Sequence[Group]], hyper: Hyper) -> np.ndarray:
        """Log evidence that sets of effects gain over the fit, each in noise of its own."""
        likely = shared([partial(self._likely, groups) for groups in sets])
        return np.array([log - self._before + log_occam(log - self._before, part, hyper) for log, part in likely])

    @cached_property
    def _before(self) -> float:
        return self._likely(self.own)[0]

    @cached_property
    def _seen(self) -> np.ndarray:
        """[n, D] which values were measured, in all segments."""
        return np.concatenate([self.forward.blocks[b].seen() for b in self.fit.blocks])

    def _likely(self, groups: Sequence[Group]) -> tuple[float, np.ndarray]:
        """Log likelihood of what is left once these effects, within bounds, and all numbers explain their part.

        And what each of the strengths changes that the fit does not have.
        """
        use = [*range(self.numbers), *(self.numbers + c for g in groups for c in g.columns)]
        none = np.full(self.numbers, np.inf)
        low = np.concatenate([-none, *(np.minimum(g.bounds()[0] - g.at, -1e-12) for g in groups)])
        high = np.concatenate([none, *(np.maximum(g.bounds()[1] - g.at, 1e-12) for g in groups)])
        change = lsq_linear(self.root[:, use], self.root[:, -1], (low, high)).x
        assert self.fit.linear is not None
        rows, deviation = self.fit.linear.rows, self.weights.deviation
        rest = (self.parts[:, -1] - self.parts[:, use] @ change).reshape(-1, len(deviation))
        lengths = [r.data // len(deviation) for r in rows]
        left = np.split(np.where(self._seen, rest * deviation, np.nan), np.cumsum(lengths)[:-1])
        noise = left_by(self.forward, left, self.weights.gap)
        out = noise.log_prior - log_volume(noise, rows)
        for mine in patterns(rows):
            out -= 0.5 * float(np.sum(noise.whitened(np.stack([left[n] for n in mine]), rows[mine[0]]) ** 2))
        new = [self.numbers + c for g in groups if g not in self.own for c in g.columns[: g.strengths]]
        return out, change[[use.index(c) for c in new]] * np.linalg.norm(self.root[:, new], axis=0)
