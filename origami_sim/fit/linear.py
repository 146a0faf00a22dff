"""Linear least squares of recordings cut into segments whose starts are unknown, tied to each other or free.

A recording is predicted segment by segment, each from a start of its own (multiple shooting; Bock & Plitt 1984). Where
motion is continuous, the end of a segment is the start of the next but for a small gap, of which the standard deviation
is that of the impulses that the model lacks. With everything linear, the starts are eliminated one after the other by
orthogonal transformations (a square-root information filter; Bierman 1977, chapter 5): what is left of each segment are
its innovations, which no choice of the starts can explain, and which are independent of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from scipy.linalg.lapack import dgeqrf, dorgqr, dtrtrs

from origami_sim.fit.weights import Rows, Weights, recast
from origami_sim.threads import shared

PART = 1000
"""Rows of a long matrix that are factored together: those of 150 columns fit into a cache.

Of 32,000 by 190 in 0.6 of the time of 8,000 rows at once, by one thread; 500 and 2,000 take a fifth more.
"""

WIDE = 4000
"""Rows of a long matrix that one core factors while others do the next ones: some 20 ms of work."""


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Whitened residuals of segments, and their derivatives by numbers and starts.

    Attributes:
        rows: of each segment. residual: per segment (r,), measured minus predicted.
        tangent: per segment [r, P] derivative of what is predicted by theta / scale.
        slopes: per segment [r, L] by its own start.
        tie: per segment (L,) one over the standard deviations of the gap to the next; None where that is not tied.
        steps: (P,) changes of theta [SI] by which the derivatives were found.
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

    def _swept(self, parts: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Innovations [c + r, ...] per segment (c rows are carried over), and coefficients of the starts."""
        left, coefficients, carry = [], [], None
        for (q, _), part, slopes, tie in zip(self._factors, parts, self.slopes, self.tie, strict=True):
            x = part if carry is None else np.concatenate([carry, part])
            c = q.T @ x
            left.append(x - q @ c)
            coefficients.append(c)
            carry = None if tie is None else c[slopes.shape[1] :]
        return left, coefficients

    def cleared(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Columns [r, ...] of each segment as innovations: without what any starts could explain.

        Sums of products over all segments are those of the columns with the starts projected out; each segment's are
        independent of those before, given the numbers.
        """
        return self._swept(parts)[0]

    def starts(self, parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The changes of the starts [L, ...] that explain columns [r, ...] best."""
        return self.explained(parts)[1]

    def explained(self, parts: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Columns as innovations (`cleared`), and the changes of the starts that explain the rest (`starts`)."""
        left, coefficients = self._swept(parts)
        out: list[np.ndarray] = []
        for (_, r), c, slopes, tie in zip(
            reversed(self._factors), reversed(coefficients), reversed(self.slopes), reversed(self.tie), strict=True
        ):
            size = slopes.shape[1]
            right = c[:size] if tie is None else c[:size] - r[:size, size:] @ out[-1]
            own, told = r[:size, :size], _told(r, size)
            if not told.all():  # what nothing tells stays where it is
                right = np.where(told.reshape(-1, *[1] * (right.ndim - 1)), right, 0.0)
                own = np.where(told[:, None], own, 0.0)
                own[~told, ~told] = 1.0
            solved = dtrtrs(own, right.reshape(size, -1))[0] if right.size else right
            out.append(solved.reshape(right.shape))
        return left, out[::-1]

    def smoothed(self, parts: Sequence[np.ndarray], found: Sequence[np.ndarray] | None = None) -> list[np.ndarray]:
        """Columns [r, ...] of each segment, in its own rows, without what the best starts explain (`found`)."""
        found, out = self.starts(parts) if found is None else found, []
        for n, (part, slopes, tie) in enumerate(zip(parts, self.slopes, self.tie, strict=True)):
            rest = part - slopes @ found[n]
            if tie is not None:
                rest[len(part) - len(tie) :] += tie.reshape(-1, *[1] * (part.ndim - 1)) * found[n + 1]
            out.append(rest)
        return out

    @cached_property
    def spread(self) -> float:
        """Log determinant of the starts' precision, half of it: what eliminating them costs a marginal likelihood."""
        total = 0.0
        for (_, r), slopes, tie in zip(self._factors, self.slopes, self.tie, strict=True):
            size = slopes.shape[1]
            total += float(np.log(np.maximum(np.abs(r.diagonal()[:size]), 1e-300)).sum())
            if tie is not None:
                total -= float(np.log(tie).sum())
        return total

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
        return Linearisation(
            self.rows,
            recast(self.residual, self.rows, old, new),
            recast(self.tangent, self.rows, old, new),
            recast(self.slopes, self.rows, old, new),
            [None if t is None else t * (old.gap / new.gap) for t in self.tie],
            self.steps,
        )


def triangle(a: np.ndarray) -> np.ndarray:
    """Factor R [min(n, k), k] of a long matrix [n, k]: of its parts, and of theirs together.

    As numpy finds it but for signs of rows.
    """
    parts = [a[k : k + WIDE] for k in range(0, len(a), WIDE)] if a.size else []
    found = shared([partial(_triangle, part) for part in parts])
    return found[0] if len(found) == 1 else _triangle(np.concatenate([np.zeros((0, a.shape[1])), *found]))


def _triangle(a: np.ndarray) -> np.ndarray:
    """The same of its first rows, then of that and the next ones, and so on."""
    out = np.zeros((0, a.shape[1]))
    for first in range(0, len(a) if a.size else 0, PART):
        part = np.concatenate([out, a[first : first + PART]])
        out = np.triu(dgeqrf(part)[0][: min(part.shape)])
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


def _told(r: np.ndarray, size: int) -> np.ndarray:
    """(L,) which numbers of a start a factor R tells, of which the first `size` columns are the start's."""
    diagonal = np.abs(r.diagonal()[:size])
    return diagonal > 1e-12 * diagonal.max(initial=1e-300)
