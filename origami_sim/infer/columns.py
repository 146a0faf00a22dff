"""Columns of effects in a linear problem: a fit's own, and those of signatures, whitened alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from origami_sim.fit.linear import Linearisation
from origami_sim.fit.weights import Weights, recast
from origami_sim.infer.screen import Signature


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a fit's own effects, then those of further ones.

    Attributes:
        line: of the fit. own: columns of its effects in the tangent. weights: of both.
        further: signatures of other effects. told_by: the weights of these.
    """

    line: Linearisation
    weights: Weights
    own: Sequence[int]
    further: Sequence[Signature]
    told_by: Weights

    @property
    def count(self) -> int:
        return len(self.own) + len(self._each)

    @cached_property
    def _each(self) -> list[tuple[Signature, int]]:
        """Of each further column its signature and which of its strengths it is of."""
        return [(s, k) for s in self.further for k in range(len(s.size))]

    def of(self, segments: Sequence[int], some: Sequence[int] | None = None) -> list[np.ndarray]:
        """Those [r, k] of some segments; some of them, if stated."""
        some = range(self.count) if some is None else some
        own = [self.own[c] for c in some if c < len(self.own)]
        each = [self._each[c - len(self.own)] for c in some if c >= len(self.own)]
        rows = [self.line.rows[n] for n in segments]
        more = [
            np.concatenate([np.zeros((r.count, 0)), *(s.parts[n][:, k : k + 1] for s, k in each)], axis=1)
            for n, r in zip(segments, rows, strict=True)
        ]
        more = recast(more, rows, self.told_by, self.weights)
        return [np.concatenate([self.line.tangent[n][:, own], x], 1) for n, x in zip(segments, more, strict=True)]
