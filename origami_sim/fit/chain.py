"""Tied segments as a chain of few rows, of which the starts are eliminated for any size of the gaps.

A start reaches as many combinations of a segment's data as it has numbers, and other segments only through the gaps. So
all else is condensed once. What is left is a block-bidiagonal least squares, in which every other start is eliminated
at once, then every other one of those that remain (cyclic reduction; Golub & Van Loan 2013, section 4.5), by orthogonal
transformations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgeqrf

from origami_sim.threads import shared

if TYPE_CHECKING:
    from origami_sim.fit.linear import Linearisation

PART = 1000
"""Rows of a long matrix that are factored together: those of 150 columns fit into a cache.

Of 32,000 by 190 in 0.6 of the time of 8,000 rows at once, by one thread; 500 and 2,000 take a fifth more.
"""

WIDE = 4000
"""Rows of a long matrix that one core factors while others do the next ones: some 20 ms of work. It decides on time and
rounding alone."""

SEGMENTS = 30
"""Segments that one core condenses while others do the next ones: some 20 ms of work.

Twice as many leave cores idle where a recording has 200 segments; half of them take as long together.
"""


@dataclass(frozen=True, eq=False)
class Chain:
    """Columns of S segments, of which the starts have L numbers, in the rows that these reach, and in all others.

    Attributes:
        slopes: [S, L, L] of the rows of the data that a start reaches, by it. own: [S, L, k] these rows.
        ends: [S, L, L] of the rows of the gaps. over: [S, L, k] these rows. tie: [S, L] as in a `Linearisation`; zero
            where a segment is not tied to the next.
        beyond: [., k] a triangle with the same least squares as all rows that no start reaches.
    """

    slopes: np.ndarray
    own: np.ndarray
    ends: np.ndarray
    over: np.ndarray
    tie: np.ndarray
    beyond: np.ndarray

    @classmethod
    def of(cls, line: "Linearisation", *columns: Sequence[np.ndarray]) -> "Chain":
        """Columns [r, k] of all segments of a linearisation, beside each other."""
        return cls._joined(line, [_condensed(line, columns, range(len(line.rows)))])

    @classmethod
    def shared(cls, line: "Linearisation", columns: Callable[[Sequence[int]], Sequence[np.ndarray]]) -> "Chain":
        """The same of many columns, which processes that go in step make and condense together.

        Args:
            columns: gives those [r, k] of some segments.
        """
        segments = range(len(line.rows))
        parts = [segments[n : n + SEGMENTS] for n in range(0, len(segments), SEGMENTS)]

        def condensed(part: Sequence[int]) -> tuple[np.ndarray, ...]:
            return _condensed(line, [columns(part)], part)

        return cls._joined(line, shared([partial(condensed, part) for part in parts]))

    @classmethod
    def _joined(cls, line: "Linearisation", parts: Sequence[tuple[np.ndarray, ...]]) -> "Chain":
        slopes, own, ends, over, beyond = (np.concatenate(each) for each in zip(*parts, strict=True))
        tie = np.array([np.zeros(slopes.shape[1]) if t is None else t for t in line.tie])
        return cls(slopes, own, ends, over, tie, _triangle(beyond))

    def regapped(self, share: float) -> "Chain":
        """The same for gaps whose size is one over so much of what it was."""
        return replace(self, ends=share * self.ends, over=share * self.over, tie=share * self.tie)

    def columns(self, some: np.ndarray) -> "Chain":
        """Some of the columns."""
        return replace(self, own=self.own[:, :, some], over=self.over[:, :, some], beyond=self.beyond[:, some])

    def eliminated(self) -> "Eliminated":
        """The columns without what starts explain."""
        tied, size = np.flatnonzero(self.tie.any(axis=1)), self.slopes.shape[1]
        if not len(tied):
            return Eliminated(self.beyond, _log_determinant(self.slopes), [], self.slopes, self.own)
        before = np.concatenate([self.slopes, self.ends], axis=1)
        after = np.concatenate([np.zeros_like(self.ends), -self.tie[:, :, None] * np.eye(size)], axis=1)
        rows = np.concatenate([self.own, self.over], axis=1)
        left, levels, spread = [self.beyond], [], -float(np.log(self.tie[tied]).sum())
        while len(rows) > 1:  # a segment and the next one become one
            even = slice(0, len(rows) // 2 * 2, 2)
            odd, rest = slice(1, None, 2), slice(len(rows) // 2 * 2, None)
            none = np.zeros_like(before[odd])
            both = [_below(after[even], before[odd]), _below(before[even], none), _below(none, after[odd])]
            q, r = np.linalg.qr(np.concatenate(both, axis=2), mode="complete")
            joined = np.swapaxes(q, 1, 2) @ _below(rows[even], rows[odd])
            left.append(joined[:, 3 * size :].reshape(-1, rows.shape[2]))
            levels.append((r[:, :size], joined[:, :size]))
            spread += _log_determinant(r[:, :size, :size])
            kept = slice(size, 3 * size)
            before = np.concatenate([r[:, kept, size : 2 * size], before[rest]])
            after = np.concatenate([r[:, kept, 2 * size :], after[rest]])
            rows = np.concatenate([joined[:, kept], rows[rest]])
        q, r = np.linalg.qr(before, mode="complete")
        joined = np.swapaxes(q, 1, 2) @ rows
        left.append(joined[0, size:])
        first = r[:, :size]
        return Eliminated(np.concatenate(left), spread + _log_determinant(first), levels, first, joined[:, :size])


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Columns of a chain without what starts explain.

    Attributes:
        rows: [., k] columns with the same least squares. spread: half of the log determinant of the starts' precision,
            less that of the gaps: what eliminating them costs a marginal likelihood.
        levels: the factors [n, L, 3 L] by which every other start follows from those beside it, and columns [n, L, k].
        slopes, own: the factor and columns of the starts that are left.
    """

    rows: np.ndarray
    spread: float
    levels: list[tuple[np.ndarray, np.ndarray]]
    slopes: np.ndarray
    own: np.ndarray

    def starts(self, by: np.ndarray) -> np.ndarray:
        """The changes of the starts [S, L, ...] that explain sums of the columns by weights [k, ...] best."""
        found = _solved(self.slopes, self.own @ by)
        for factor, columns in reversed(self.levels):
            size, pairs = factor.shape[1], len(factor)
            following = np.concatenate([found[1:], np.zeros_like(found[:1])])[:pairs]
            beside = np.concatenate([found[:pairs], following], axis=1)
            middle = _solved(factor[:, :, :size], columns @ by - factor[:, :, size:] @ beside)
            both = np.stack([found[:pairs], middle], axis=1).reshape(2 * pairs, *found.shape[1:])
            found = np.concatenate([both, found[pairs:]])
        return found


def _solved(factors: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions [n, L, ...] with triangular factors [n, L, L]; what these do not tell stays where it is, at zero."""
    diagonal = np.abs(np.diagonal(factors, axis1=1, axis2=2))
    told = diagonal > 1e-12 * diagonal.max(axis=1, initial=1e-300, keepdims=True)
    known = np.where(told[:, :, None], factors, np.eye(factors.shape[1]))
    return np.linalg.solve(known, np.where(told[:, :, None], right, 0.0))


def _condensed(
    line: "Linearisation", columns: Sequence[Sequence[np.ndarray]], segments: Sequence[int]
) -> tuple[np.ndarray, ...]:
    """Of columns [r, k] of some segments the rows that starts reach, with slopes, and a triangle of all others."""
    size, count = line.slopes[segments[0]].shape[1], sum(some[0].shape[1] for some in columns)
    slopes, ends = np.zeros((2, len(segments), size, size))
    own, over = np.zeros((2, len(segments), size, count))
    beyond, alike = [np.zeros((0, count))], {}
    for place, n in enumerate(segments):
        alike.setdefault(line.rows[n].count - line.rows[n].tie, []).append((place, n))
    for length, mine in alike.items():
        places = [place for place, _ in mine]
        slope = np.stack([line.slopes[n][:length] for _, n in mine])
        part = np.concatenate([np.stack([some[place][:length] for place in places]) for some in columns], axis=2)
        slope[~np.isfinite(slope).all(axis=(1, 2))] = 0.0
        q, r = np.linalg.qr(slope)
        reached = np.swapaxes(q, 1, 2) @ part
        slopes[places, : r.shape[1]], own[places, : r.shape[1]] = r, reached
        part -= q @ reached
        beyond.append(part.reshape(-1, count))
    for place, n in enumerate(segments):
        if line.rows[n].tie:
            slope = line.slopes[n]
            ends[place] = slope[-size:] if np.isfinite(slope).all() else 0.0
            over[place] = np.concatenate([some[place][-size:] for some in columns], axis=1)
    return slopes, own, ends, over, _triangle(np.concatenate(beyond))


def _below(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rows of pairs, those of the first above those of the second."""
    return np.concatenate([a, b], axis=1)


def _log_determinant(factors: np.ndarray) -> float:
    """Log of the product of the diagonals of factors [n, L, L], or of their sizes."""
    return float(np.log(np.maximum(np.abs(np.diagonal(factors, axis1=1, axis2=2)), 1e-300)).sum())


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
