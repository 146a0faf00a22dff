"""Level and colour of residuals: white stays white, filters and slow structure are found."""

import numpy as np
import pytest

from origami_sim.fit.correlated import factor, multiplied
from origami_sim.fit.residual_process import residual_process


def drawn(colour: np.ndarray, count: int = 60, length: int = 50, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    bands = factor(colour, np.arange(length))
    return list(multiplied(bands, rng.normal(size=(length, count))).T)


def test_white_noise_is_white_at_its_level():
    for seed in range(5):
        level, colour, log_prior = residual_process(drawn(np.ones(1), seed=seed), 1.0)
        assert level == pytest.approx(1.0, abs=0.05) and len(colour) == 1
        assert log_prior == pytest.approx(0.0, abs=0.02)


def test_the_noise_of_a_tracker_that_averages_is_not_taken_for_white():
    """A mean of three frames, at the level that was stated: nothing is larger, all is smoother."""
    triangle = np.array([1.0, 2.0 / 3.0, 1.0 / 3.0])
    level, colour, _ = residual_process(drawn(triangle), 1.0)
    assert level == pytest.approx(1.0, abs=0.05)
    assert colour[1:3] == pytest.approx(triangle[1:], abs=0.08)
    assert np.abs(colour[4:]).max() < 0.25  # a short filter is no finite autoregression


def test_slow_structure_is_correlated_as_it_is_and_pays_for_its_level():
    slow = 0.9 ** np.arange(50)
    level, colour, log_prior = residual_process([10.0 * c for c in drawn(slow)], 1.0)
    assert level == pytest.approx(10.0, rel=0.15)
    assert colour[:10] == pytest.approx(slow[:10], abs=0.15)
    assert log_prior < -10.0


def test_frames_that_are_missing_count_for_nothing():
    columns = drawn(0.8 ** np.arange(50))
    for c in columns:
        c[[5, 6, 30]] = np.nan
    level, colour, _ = residual_process(columns, 1.0)
    assert level == pytest.approx(1.0, abs=0.1) and colour[1] == pytest.approx(0.8, abs=0.1)


def test_a_fit_with_as_many_numbers_as_data_has_no_less_than_the_noise():
    level, *_ = residual_process([np.full(9, 1e-9)], 1.0)
    assert level == 1.0
