"""Angles and rates of a recording at an instant, to start a simulation from."""

from dataclasses import dataclass

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.recording import Channel, Recording

DEGREE = 3
"""Degree of the local polynomial."""

FEWEST_FRAMES = DEGREE + 4
"""Frames that a window must hold, so that scatter about the quintic is left."""

WIDENING = 1.5
"""Factor between the windows that are tried."""


@dataclass(frozen=True)
class AngleEstimate:
    """Angle and rate of one channel at one instant.

    Attributes:
        angle: angle [rad].
        rate: angular rate [rad/s].
        angle_error: standard error of `angle` [rad].
        rate_error: standard error of `rate` [rad/s].
    """

    angle: float
    rate: float
    angle_error: float
    rate_error: float


def initial_angles(recording: Recording, t0: float, *, half_window: float | None = None) -> dict[str, AngleEstimate]:
    """Angle and rate of every angle channel at t0, by least squares with a cubic over |t - t0| <= half_window.

    The standard errors hold two parts. Noise: independent between frames, of the channel's stated size or of the
    scatter about a quintic over the same window, whichever is larger. Truncation: how far cubic and quintic differ
    beyond what noise explains. Without `half_window` the window is widened, per channel and in steps of 1.5, until
    cubic and quintic differ by two standard deviations, and then is taken two steps narrower, where the truncation is
    a fifth or less per step. At the ends of the recording the window is one-sided and the errors several times larger:
    start a little inside.

    Args:
        recording: the recording.
        t0: the instant [s].
        half_window: half width of the window [s]; chosen from the data when None.

    Returns:
        An estimate per angle channel.
    """
    if half_window is not None and not half_window > 0.0:
        raise InputError("the window must have a positive width", field="half_window", value=half_window)
    if not recording.times[0] <= t0 <= recording.times[-1]:
        raise InputError(
            "the instant lies outside the recording",
            field="t0",
            value=t0,
            allowed=f"{recording.times[0]:g} s to {recording.times[-1]:g} s",
        )
    angles = {name: channel for name, channel in recording.channels.items() if channel.is_angle}
    if not angles:
        raise InputError("the recording has no angle channel", field="channels", value=sorted(recording.channels))
    offsets = recording.times - t0
    if half_window is not None:
        return {name: _estimate(channel, offsets, half_window) for name, channel in angles.items()}
    return {name: _estimate(channel, offsets, _half_window(channel, offsets)) for name, channel in angles.items()}


def _half_window(channel: Channel, offsets: np.ndarray) -> float:
    """Half width [s] chosen from the data, as `initial_angles` tells; `offsets` (n,) are relative to t0 [s]."""
    distances = np.sort(np.abs(offsets[np.isfinite(channel.values)]))
    half_window = distances[min(2 * FEWEST_FRAMES, distances.size) - 1]
    while half_window < distances[-1]:
        comparison = _compare_degrees(channel, offsets, WIDENING**2 * half_window)
        if (comparison.difference**2 > 4.0 * comparison.difference_variance).any():
            break
        half_window *= WIDENING
    return float(half_window)


@dataclass(frozen=True, eq=False)
class _Degrees:
    """Cubic and quintic over one window; arrays (2,) hold angle [rad] and rate times the half width [rad]."""

    cubic: np.ndarray
    cubic_variance: np.ndarray
    difference: np.ndarray
    difference_variance: np.ndarray


def _compare_degrees(channel: Channel, offsets: np.ndarray, half_window: float) -> _Degrees:
    used = (np.abs(offsets) <= half_window * (1.0 + 1e-9)) & np.isfinite(channel.values)
    count = int(np.count_nonzero(used))
    if count < FEWEST_FRAMES:
        raise InputError(
            f"channel '{channel.name}' has {count} frames in the window, {FEWEST_FRAMES} are needed",
            field="half_window",
            value=half_window,
        )
    scaled, values = offsets[used] / half_window, channel.values[used]
    cubic, cubic_unit_variance, _ = _fit(scaled, values, DEGREE)
    quintic, quintic_unit_variance, scatter = _fit(scaled, values, DEGREE + 2)
    variance = max(channel.noise, scatter) ** 2
    return _Degrees(
        cubic=cubic,
        cubic_variance=variance * cubic_unit_variance,
        difference=cubic - quintic,
        difference_variance=variance * (quintic_unit_variance - cubic_unit_variance),
    )


def _estimate(channel: Channel, offsets: np.ndarray, half_window: float) -> AngleEstimate:
    fit = _compare_degrees(channel, offsets, half_window)
    truncation = np.maximum(fit.difference**2 - fit.difference_variance, 0.0)
    errors = np.sqrt(fit.cubic_variance + truncation)
    return AngleEstimate(
        angle=float(fit.cubic[0]),
        rate=float(fit.cubic[1] / half_window),
        angle_error=float(errors[0]),
        rate_error=float(errors[1] / half_window),
    )


def _fit(scaled: np.ndarray, values: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Value and slope at zero (2,), their variances for unit noise (2,), and the scatter about the polynomial."""
    design = np.vander(scaled, degree + 1, increasing=True)
    inverse = np.linalg.pinv(design)
    coefficients = inverse @ values
    residual = values - design @ coefficients
    scatter = float(np.sqrt(residual @ residual / (len(values) - degree - 1)))
    return coefficients[:2], np.sum(inverse[:2] ** 2, axis=1), scatter
