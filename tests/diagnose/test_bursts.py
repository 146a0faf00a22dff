"""Forces that act now and then, and noise that does not."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from origami_sim.fit.bursts import bursts


def fitted(residuals):
    """What `bursts` asks of a fit."""
    whole = np.concatenate(residuals)
    return SimpleNamespace(residuals=residuals, rms=lambda: np.sqrt(np.nanmean(whole**2, axis=0)))


def noise(count: int, colour: float = 0.0) -> list[np.ndarray]:
    rng = np.random.default_rng([0, count])  # whatever else is tested by the same process
    return [2e-3 * lfilter([1.0], [1.0, -colour], rng.normal(size=(40, 2)), axis=0) for _ in range(count)]


@pytest.mark.parametrize("count", [4, 8, 40, 200])
@pytest.mark.parametrize("colour", [0.0, 0.6, 0.9])
def test_noise_is_alike_throughout_whatever_its_colour(count, colour):
    assert bursts(fitted(noise(count, colour))).probability < 0.5


def test_pushes_are_told_with_their_share_and_size():
    """Bumps of ten frames, five times the noise, in a quarter of the stretches of one channel."""
    residuals = noise(40)
    for r in residuals[::4]:
        r[10:20, 1] += 1e-2 * np.sin(np.pi * np.arange(10) / 10)
    found = bursts(fitted(residuals))
    assert found.odds > 40.0 and found.share == pytest.approx(0.25, abs=0.01)
    assert found.level == pytest.approx(2e-3 * np.ones(2), rel=0.03)
    assert found.times == pytest.approx(np.sqrt(1.0 + 25.0 * 5.0 / 40.0), rel=0.05)


def test_bursts_of_a_recorder_are_no_forces():
    residuals = noise(40)
    for r in residuals[::4]:
        r *= 3.0
    assert bursts(fitted(residuals)).odds == -np.inf


def test_what_is_missing_does_not_matter():
    residuals = noise(40)
    residuals[3][5:20, 0] = np.nan
    residuals[4][:] = np.nan
    assert bursts(fitted(residuals)).probability < 0.5
