"""Linear least squares of recordings cut into segments whose starts are unknown, tied to each other or free.

A recording is predicted segment by segment, each from a start of its own (multiple shooting; Bock & Plitt 1984). Where
motion is continuous, the end of a segment is the start of the next but for a small gap, of which the standard deviation
is that of the impulses that the model lacks. With everything linear, the starts are eliminated one after the other by
orthogonal transformations (a square-root information filter; Bierman 1977, chapter 5): what is left of each segment are
its innovations, which no choice of the starts can explain, and which are independent of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.linalg.lapack import dgeqrf, dorgqr

from origami_sim.fit.chain import Chain, Eliminated
from origami_sim.fit.weights import Rows, Weights, recast


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Whitened residuals of segments, and their derivatives by numbers and starts.

    Attributes:
        rows: of each segment. residual: per segment (r,), measured minus predicted.
        tangent: per segment [r, P] derivative of what is predicted by theta / scale.
        slopes: per segment [r, L] by its own start.
        tie: per segment (L,) one over the standard deviations of the gap to the next; None where that is not tied.
        steps: (P,) changes of coordinates by which the derivatives were found.
    """

    rows: list[Rows]
    residual: list[np.ndarray]
    tangent: list[np.ndarray]
    slopes: list[np.ndarray]
    tie: list[np.ndarray | None]
    steps: np.ndarray | None = None

    def data(self, n: int) -> slice:
        """The rows of the data of a segment."""
        return slice(0, self.rows[n].data)

    @cached_property
    def _factors(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Per segment, the factors Q, R of its columns: of its own start, then of the next one."""
        out, carry = [], None
        for rows, slopes, tie in zip(self.rows, self.slopes, self.tie, strict=True):
            size, first = slopes.shape[1], 0 if carry is None else len(carry)
            both = np.zeros((first + rows.count, size * (1 if tie is None else 2)))
            if carry is not None:
                both[:first, :size] = carry
            if np.isfinite(slopes).all():
                both[first:, :size] = slopes
            if tie is not None:
                each = np.arange(size)
                both[each - size, each + size] = -tie
            q, r = _orthogonal(both)
            out.append((q, r))
            carry = r[size:, size:] if tie is not None else None
        return out

    def cleared(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Columns [c + r, ...] of each segment as innovations, without what starts explain (c rows are carried over).

        Sums of products over all segments are those of the columns with the starts projected out; each segment's are
        independent of those before, given the numbers.
        """
        left, carry = [], None
        for (q, _), part, slopes, tie in zip(self._factors, parts, self.slopes, self.tie, strict=True):
            x = part if carry is None else np.concatenate([carry, part])
            c = q.T @ x
            left.append(x - q @ c)
            carry = None if tie is None else c[slopes.shape[1] :]
        return left

    @cached_property
    def chain(self) -> Chain:
        """The tangent and the residual as a chain."""
        return Chain.of(self, self.tangent, [r[:, None] for r in self.residual])

    @cached_property
    def eliminated(self) -> Eliminated:
        """These without what starts explain."""
        return self.chain.eliminated()

    def smoothed(self, parts: Sequence[np.ndarray], found: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Columns [r, ...] of each segment, in its own rows, without what changes of the starts [L, ...] explain."""
        out = []
        for n, (part, slopes, tie) in enumerate(zip(parts, self.slopes, self.tie, strict=True)):
            rest = part - slopes @ found[n]
            if tie is not None:
                rest[len(part) - len(tie) :] += tie.reshape(-1, *[1] * (part.ndim - 1)) * found[n + 1]
            out.append(rest)
        return out

    def padded(self, n: int, columns: np.ndarray) -> np.ndarray:
        """Columns of the rows of a segment's data, with zeros for all other rows."""
        return np.concatenate([columns, np.zeros((self.rows[n].count - len(columns), *columns.shape[1:]))])

    def at(self, residual: list[np.ndarray]) -> "Linearisation":
        """The same derivatives with other residuals."""
        return self._keeping(replace(self, residual=residual))

    def beside(self, columns: list[np.ndarray], kept: int) -> "Linearisation":
        """The first `kept` columns of the tangent, and others after them."""
        joined = [np.concatenate([t[:, :kept], c], axis=1) for t, c in zip(self.tangent, columns, strict=True)]
        return self._keeping(replace(self, tangent=joined))

    def _keeping(self, other: "Linearisation") -> "Linearisation":
        """Another one of the same starts, which need not be factored again."""
        if "_factors" in self.__dict__:
            other.__dict__["_factors"] = self._factors
        return other

    def reweighted(self, old: Weights, new: Weights) -> "Linearisation":
        """The same for other weights."""
        if old is new:
            return self
        out = Linearisation(
            self.rows,
            recast(self.residual, self.rows, old, new),
            recast(self.tangent, self.rows, old, new),
            recast(self.slopes, self.rows, old, new),
            [None if t is None else t * (old.gap / new.gap) for t in self.tie],
            self.steps,
        )
        if old.like(new) and "chain" in self.__dict__:
            out.__dict__["chain"] = self.chain.regapped(old.gap / new.gap)
        return out


def _orthogonal(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors Q, R of a matrix, as numpy finds them, which takes thrice as long over a small one."""
    if not a.size:
        return np.zeros((len(a), 0)), np.zeros((0, a.shape[1]))
    count = min(a.shape)
    packed, tau, _, _ = dgeqrf(a)
    return dorgqr(packed[:, :count], tau)[0], packed[:count] * _upper(count, a.shape[1])


@cache
def _upper(rows: int, columns: int) -> np.ndarray:
    """Ones above and on the diagonal: numpy makes them anew for every matrix."""
    return np.triu(np.ones((rows, columns)))
