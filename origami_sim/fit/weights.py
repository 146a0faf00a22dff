"""What residuals are measured by: level and correlation of each component, and the size of gaps between segments."""

from dataclasses import dataclass

import numpy as np

from origami_sim.fit.correlated import divided, factor, multiplied


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


def recast(columns: np.ndarray, rows: Rows, old: Weights, new: Weights) -> np.ndarray:
    """Columns (r,) or [r, k] of a segment for other weights."""
    out = np.array(columns, float)
    if not old.like(new):
        data = np.moveaxis(out[: rows.data], 0, -1)
        out[: rows.data] = np.moveaxis(new.whitened(old.restored(data, rows), rows), -1, 0)
    out[rows.data + rows.start :] *= old.gap / new.gap
    return out
