"""What residuals are measured by: level and correlation of each component, and the size of gaps between segments."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from origami_sim.fit.correlated import divided, factor, multiplied

DENSE = 256
"""Numbers of a segment up to which one matrix weighs them anew, instead of banded factors, which move more memory.

It decides on time alone: both agree to 4e-15. The matrix takes 0.1 of the time at 100 to 256 numbers, 0.23 at 512, 0.6
at 1,024 and 2.3 at 2,048. With half of it segments of 129 to 256 take nine times as long; double gains at longer ones.
"""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a segment in a least-squares problem: its data, its known start, its tie to the next one, in this order.

    Attributes:
        data: n D. start: L of what is known of a start that is not tied to the segment before, else 0.
        tie: L of the gap to the next segment, else 0.
        seen: [n, D] which values were measured; None: all. frames: (n,) their numbers; None: one after the other.
    """

    data: int
    start: int = 0
    tie: int = 0
    seen: np.ndarray | None = None
    frames: np.ndarray | None = None

    @property
    def count(self) -> int:
        return self.data + self.start + self.tie

    @cached_property
    def pattern(self) -> tuple[int, bytes, bytes]:
        """Equal for segments of which the same values were measured in the same frames."""
        seen, frames = self.seen, self.frames
        return self.data, b"" if seen is None else seen.tobytes(), b"" if frames is None else frames.tobytes()


@dataclass(frozen=True, eq=False)
class Weights:
    """Covariance by which residuals are whitened: of each component a stationary process within every segment.

    Attributes:
        deviation: (D,) standard deviation of each component [SI].
        colour: per component, the correlation (Q + 1,) of residuals 0 to Q frames apart; empty: there is none.
        gap: standard deviation of the gaps between tied segments, as a part of `Block.reach`.
        log_prior: log prior probability of level and colour, where residuals told them.
    """

    deviation: np.ndarray
    colour: tuple[np.ndarray, ...] = ()
    gap: float = 1.0
    log_prior: float = 0.0

    def whitened(self, values: np.ndarray, rows: Rows) -> np.ndarray:
        """Residuals [..., n, D] as (..., n D) numbers of unit variance; missing ones are zero."""
        scaled = np.nan_to_num(values) / self.deviation
        if self.colour:
            scaled = self._each(scaled, rows, divided)
        return scaled.reshape(*values.shape[:-2], values.shape[-2] * values.shape[-1])

    def restored(self, white: np.ndarray, rows: Rows) -> np.ndarray:
        """Residuals [..., n, D] [SI] of their whitened numbers (..., n D)."""
        dims = len(self.deviation)
        scaled = white.reshape(*white.shape[:-1], white.shape[-1] // dims, dims)
        if self.colour:
            scaled = self._each(scaled, rows, multiplied)
        return scaled * self.deviation

    def log_volume(self, rows: Rows) -> float:
        """Half of the log determinant of the covariance of a segment's data."""
        out = 0.0
        n = rows.data // max(len(self.deviation), 1)
        frames = np.arange(n) if rows.frames is None else rows.frames
        for d, sd in enumerate(self.deviation):
            mine = np.arange(n) if rows.seen is None else np.flatnonzero(rows.seen[:, d])
            out += len(mine) * float(np.log(sd))
            if self.colour and len(self.colour[d]) > 1 and len(mine):
                out += float(np.sum(np.log(factor(self.colour[d], frames[mine])[0])))
        return out

    def _each(self, values: np.ndarray, rows: Rows, by) -> np.ndarray:
        """Values [..., n, D], each component divided or multiplied by its factor in the frames where it was seen."""
        n, dims = values.shape[-2:]
        frames = np.arange(n) if rows.frames is None else rows.frames
        seen = np.ones((n, dims), bool) if rows.seen is None else rows.seen
        out = np.zeros(values.shape)
        for d, colour in enumerate(self.colour):
            mine = seen[:, d]
            part = values[..., mine, d]
            columns = part.reshape(-1, part.shape[-1]).T
            if len(colour) > 1 and columns.size:
                columns = by(factor(colour, frames[mine]), columns)
            out[..., mine, d] = columns.T.reshape(part.shape)
        return out

    def like(self, other: "Weights") -> bool:
        """Whether data weigh the same."""
        return self.deviation is other.deviation and self.colour is other.colour


def recast(columns: Sequence[np.ndarray], rows: Sequence[Rows], old: Weights, new: Weights) -> list[np.ndarray]:
    """Columns (r,) or [r, k] of segments for other weights."""
    out: list[np.ndarray] = [np.zeros(0)] * len(rows)
    for alike in patterns(rows):
        first, by = rows[alike[0]], None
        if not old.like(new) and first.data <= DENSE:
            by = new.whitened(old.restored(np.eye(first.data), first), first).T
        for mine in _as_long(rows, alike):
            own, whole = rows[mine[0]], np.stack([columns[n] for n in mine])
            data = whole[:, : own.data]
            if by is not None:
                whole[:, : own.data] = by @ data if data.ndim > 2 else data @ by.T
            elif not old.like(new):
                whole[:, : own.data] = np.moveaxis(
                    new.whitened(old.restored(np.moveaxis(data, 1, -1), own), own), -1, 1
                )
            whole[:, own.data + own.start :] *= old.gap / new.gap
            for n, part in zip(mine, whole, strict=True):
                out[n] = part
    return out


def _as_long(rows: Sequence[Rows], some: Sequence[int]) -> list[list[int]]:
    """Some segments, together where they have as many rows of each kind."""
    found: dict[tuple[int, int], list[int]] = {}
    for n in some:
        found.setdefault((rows[n].start, rows[n].tie), []).append(n)
    return list(found.values())


def whitened(weights: Weights, values: Sequence[np.ndarray], rows: Sequence[Rows]) -> list[np.ndarray]:
    """Residuals [..., n, D] of segments as `Weights.whitened`, together where they are whitened alike."""
    return _together(weights.whitened, values, rows)


def restored(weights: Weights, white: Sequence[np.ndarray], rows: Sequence[Rows]) -> list[np.ndarray]:
    """Whitened numbers (..., n D) of segments as residuals, see `Weights.restored`; nan where nothing was measured."""
    parts = _together(weights.restored, [w[..., : r.data] for w, r in zip(white, rows, strict=True)], rows)
    return [p if r.seen is None else np.where(r.seen, p, np.nan) for p, r in zip(parts, rows, strict=True)]


def _together(of, parts: Sequence[np.ndarray], rows: Sequence[Rows]) -> list[np.ndarray]:
    out: list[np.ndarray] = [np.zeros(0)] * len(rows)
    for mine in patterns(rows):
        for n, part in zip(mine, of(np.stack([parts[n] for n in mine]), rows[mine[0]]), strict=True):
            out[n] = part
    return out


def patterns(rows: Sequence[Rows]) -> list[list[int]]:
    """Segments that are whitened alike, together."""
    found: dict[tuple, list[int]] = {}
    for n, r in enumerate(rows):
        found.setdefault(r.pattern, []).append(n)
    return list(found.values())


def log_volume(weights: Weights, rows: Sequence[Rows]) -> float:
    """Half of the log determinant of the covariance of all data."""
    return sum(len(mine) * weights.log_volume(rows[mine[0]]) for mine in patterns(rows))
