"""What the noise of a channel is like: its level, bursts, counts, correlation and what segments at rest show."""

from dataclasses import dataclass
from math import comb

import numpy as np

from origami_sim.recording.recording import estimate_noise, quantisation, scaled_differences

GAUSSIAN = 1.4826
"""Median absolute deviation of a normal distribution times this is its standard deviation."""

REST_FRAMES = 40
"""Frames of the windows that are tested for rest."""

ORDER = 6
"""Order of the differences."""

FEWEST = 50
"""Differences that a correlation needs."""

STILL = 1.5
"""Variance of differences over half a stride more, over what the stride's correlation says, from which motion shows.

Of motion it is 130 times as much there as at the stride, where less than 0.4 % of the variance is motion then.
"""

WALK = 1.15
"""The same of the shortest stride, over that of a random walk, for scatter: 2 % of its variance is motion then."""


@dataclass(frozen=True)
class NoiseReport:
    """The noise of one channel in its SI unit, the root mean square over components.

    Attributes:
        level: standard deviation by the median of high-frequency differences: what a frame has most of the time.
        rms: the same by their root mean square: larger than `level` where the noise comes in bursts.
        quantum: step of the readings; 0 where none shows.
        lag_1: correlation of the noise of neighbouring frames; 0 for white noise, positive where a tracker filters,
            nan where it cannot be told.
        total: `level` corrected for that correlation: the standard deviation of first-order autoregressive noise with
            these differences.
        rest: standard deviation in the segments at rest; nan where there is none.
        rest_lag_1: correlation of neighbouring frames there; nan where there is no rest.
        rest_frames: frames at rest.
    """

    level: float
    rms: float
    quantum: float
    lag_1: float
    total: float
    rest: float
    rest_lag_1: float
    rest_frames: int

    @property
    def burst(self) -> float:
        """Root mean square over level: 1 for Gaussian noise."""
        return self.rms / self.level if self.level > 0 else 1.0


def noise_report(times: np.ndarray, values: np.ndarray) -> NoiseReport:
    """Describes the noise of a channel from the data alone.

    The differences are those of `estimate_noise`. How much larger they are between frames further apart (every second,
    fourth or sixth) gives the correlation of the noise, if it is of first order: the variance of a difference with
    weights c is sum_j (c * c)_j r^|j|. Motion grows with the sixth power of the stride. So a stride is used only if one
    half longer again shows what this correlation says; the shortest, if that grows no faster than a random walk. A
    low-pass filter that removes the highest frequencies altogether shows as a correlation near 1, where `total` is a
    rough guess only: over 8000 frames it scatters by 3 % at a correlation of 0.6 and by a third at 0.85.
    Rest is a run of frames in which windows of 40 spread like the noise of the differences and have no trend: there
    the noise is measured directly, and the correlation needs no assumption.

    Args:
        times: (n,) increasing times [s]. values: (n,) or (n, d) measured values; nan where missing.
    """
    columns = np.asarray(values, float).reshape(len(times), -1)
    level = estimate_noise(times, values)
    rows = [_column(times, column) for column in columns.T]
    rms, _, total = (_mean(np.array(part)) for part in zip(*rows, strict=True))
    total = max(total, level) if np.isfinite(total) else level
    lags = np.array([r[1] for r in rows])
    lag_1 = float(np.nanmean(lags)) if np.isfinite(lags).any() else float("nan")
    steps = [quantisation(column) for column in columns.T]
    rest, rest_lag_1, frames = _rest(columns, total)
    return NoiseReport(
        level=level,
        rms=max(rms, level) if np.isfinite(rms) else level,
        quantum=max(steps),
        lag_1=lag_1,
        total=total,
        rest=rest,
        rest_lag_1=rest_lag_1,
        rest_frames=frames,
    )


def _mean(values: np.ndarray) -> float:
    """Root mean square of the finite ones; nan if there is none."""
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if seen.size else float("nan")


def _column(times: np.ndarray, column: np.ndarray) -> tuple[float, float, float]:
    """Root mean square of the differences, correlation and corrected standard deviation of one component."""
    scaled = scaled_differences(times, column)
    steps = np.diff(times)
    rms = float(np.sqrt(np.mean(scaled**2))) if scaled.size else float("nan")
    if scaled.size < FEWEST or np.ptp(steps) > 0.1 * np.median(steps):
        return rms, float("nan"), float("nan")
    variances = {k: _strided_variance(column, k) for k in (1, 2, 3, 4, 6, 9)}
    base = variances[1]
    grown = {k: v / base if base > 0 else np.inf for k, v in variances.items()}
    grid = np.linspace(-0.9, 0.98, 189)
    said = {k: _variance(grid, k) / _variance(grid, 1) for k in variances}
    out = float("nan"), float("nan")
    for k, beyond in ((2, 3), (4, 6), (6, 9)):
        lag_1 = float(np.interp(grown[k], said[k], grid))
        if not grown[beyond] < (WALK * beyond if k == 2 else STILL * np.interp(lag_1, grid, said[beyond])):
            break
        out = lag_1, float(np.sqrt(variances[k] / _variance(np.array([lag_1]), k)[0]))
    return rms, *out


def _strided_variance(column: np.ndarray, stride: int) -> float:
    """Variance, by the median, of sixth differences over frames `stride` apart; 1 for white noise of unit variance."""
    for _ in range(ORDER):
        column = column[stride:] - column[:-stride]
    seen = column[np.isfinite(column)]
    if seen.size < FEWEST:
        return float("nan")
    return (GAUSSIAN * float(np.median(np.abs(seen)))) ** 2 / comb(2 * ORDER, ORDER)


def _variance(lag_1: np.ndarray, stride: int) -> np.ndarray:
    """The same for first-order noise of unit variance whose neighbours correlate by lag_1 (k,)."""
    terms = [(-1) ** j * comb(2 * ORDER, ORDER + j) * lag_1 ** abs(j * stride) for j in range(-ORDER, ORDER + 1)]
    return np.sum(terms, axis=0) / comb(2 * ORDER, ORDER)


def _rest(columns: np.ndarray, level: float) -> tuple[float, float, int]:
    """Standard deviation, lag-1 correlation and number of frames at rest.

    A window is at rest when the means of its thirds differ no more than noise (correlated up to some ten frames)
    explains, in every component.
    """
    size = REST_FRAMES
    windows = len(columns) // size
    if windows == 0 or not level > 0:
        return float("nan"), float("nan"), 0
    blocks = columns[: windows * size].reshape(windows, size, -1)
    thirds = np.stack([blocks[:, k * size // 4 : (k + 1) * size // 4].mean(axis=1) for k in range(4)], axis=1)
    centred = blocks - blocks.mean(axis=1, keepdims=True)
    inside = np.sqrt((centred**2).mean(axis=1))
    still = (np.ptp(thirds, axis=1) < 3.0 * level).all(axis=1) & (inside < 3.0 * level).all(axis=1)
    if not still.any():
        return float("nan"), float("nan"), 0
    held = centred[still]
    variance = float((held**2).mean()) * size / (size - 1)
    if variance == 0.0:
        return 0.0, float("nan"), int(still.sum()) * size
    # the mean of each window is removed, which lowers every covariance by the variance of that mean
    lag = float((held[:, 1:] * held[:, :-1]).mean()) / float((held**2).mean())
    return float(np.sqrt(variance)), lag, int(still.sum()) * size
