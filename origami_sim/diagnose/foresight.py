"""What sets of effects would leave, and how probable that is in noise of its own, without a simulation.

A fit that lacks an effect leaves coloured noise, in which the effect hardly shows. So a set is judged by the noise that
it would leave itself: all is linear, the residuals that follow are looked at as those of a fit are (`implied`).
"""

from dataclasses import dataclass

import numpy as np

from origami_sim.diagnose.implied import OwnColumns, left_by
from origami_sim.fit.evidence import Summed, log_slab, problem, summed
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights, recast


@dataclass(frozen=True, eq=False)
class Foresight:
    """A fit in white noise of the size of what it leaves.

    Attributes:
        white: its problem. root: [k, P + C + 1] with the same least squares as nominal numbers, effects and residual
            once the starts suit each. parts: per segment [n D, P + C + 1], what is left of each then, over the noise.
    """

    forward: Predictor
    fit: Fit
    weights: Weights
    white: Summed
    root: np.ndarray
    parts: list[np.ndarray]
    nominal: int
    own: int

    @classmethod
    def of(cls, forward: Predictor, f: Fit, own: OwnColumns, effects: list[np.ndarray], hyper: Hyper) -> "Foresight":
        """Of a fit and the whitened columns of its own and of further effects, per segment [r, C]."""
        assert f.linear is not None and f.weights is not None
        plain = Weights(f.weights.deviation, gap=f.weights.gap)
        line = f.linear.reweighted(f.weights, plain)
        theirs = [recast(e, r, f.weights, plain) for e, r in zip(effects, line.rows, strict=True)]
        none = [np.zeros((r.count, 0)) for r in line.rows]
        white = summed(problem(line, own.nominal, own.precision, own.away, theirs, none), 0.0, hyper.flaws[0])
        count = len(own.nominal)
        columns = [
            np.concatenate([t[:, own.nominal], e, r[:, None]], axis=1)
            for t, e, r in zip(line.tangent, theirs, line.residual, strict=True)
        ]
        known = np.zeros((count, columns[0].shape[1]))
        known[:, :count] = np.diag(own.precision[own.nominal])
        known[:, -1] = own.precision[own.nominal] * own.away[own.nominal]
        root = np.asarray(np.linalg.qr(np.concatenate([*line.cleared(columns), known]), mode="r"))
        parts = [s[: r.data] for s, r in zip(line.smoothed(columns), line.rows, strict=True)]
        return cls(forward, f, plain, white, root, parts, count, len(own.columns))

    def gain(self, columns: list[int], hyper: Hyper) -> float:
        """Log evidence that effects of these columns gain over the fit, each in noise of its own."""
        new = len([c for c in columns if c >= self.own])
        gain = self._likely(columns) - self._likely(list(range(self.own)))
        d = np.sqrt(2.0 * max(gain, 1.0) / max(new, 1))
        return gain + new * (float(log_slab(np.array(d), hyper)) + 0.5 * float(np.log(2.0 * np.pi)))

    def _likely(self, columns: list[int]) -> float:
        """Log likelihood of what is left once these columns and all numbers explain what they can."""
        use = [*range(self.nominal), *(self.nominal + c for c in columns)]
        change = np.linalg.lstsq(self.root[:, use], self.root[:, -1], rcond=1e-10)[0]
        left = []
        for b, part in zip(self.fit.blocks, self.parts, strict=True):
            seen = self.forward.blocks[b].seen()
            rest = (part[:, -1] - part[:, use] @ change).reshape(seen.shape) * self.weights.deviation
            left.append(np.where(seen, rest, np.nan))
        noise = left_by(self.forward, left, self.weights.gap)
        assert self.fit.linear is not None
        out = noise.log_prior
        for r, rows in zip(left, self.fit.linear.rows, strict=True):
            white = noise.whitened(r, rows)
            out -= 0.5 * float(white @ white) + noise.log_volume(rows)
        return out
