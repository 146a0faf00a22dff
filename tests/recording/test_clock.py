"""Time stamps that were rounded when they were written down."""

import numpy as np
import pytest

from origami_sim.recording.clock import even_times


@pytest.mark.parametrize(
    ("rate", "first", "form", "within"),
    [
        (150.0, 0.0, "%.6g", 1e-7),  # of stamps that are off by 3e-6 s
        (150.0, 0.0, "%.4f", 1e-6),  # 3e-5
        (240.0, 0.0, "%.3f", 2e-5),  # 5e-4
        (119.88, 3.7, "%.5g", 1e-5),  # 5e-5
        (29.97, 0.0, "%.2f", 1e-3),  # 5e-3
    ],
)
def test_rounded_stamps_are_those_of_an_even_clock(rate, first, form, within):
    times = first + np.arange(600) / rate
    printed = np.array([float(form % t) for t in times])
    read = even_times(printed)
    assert np.abs(read - times).max() < within < 0.25 * np.abs(printed - times).max()
    assert read[0] == printed[0]


def test_frames_may_be_missing_and_stamps_cut_off():
    times = np.delete(np.arange(600) / 150.0, [5, 6, 100])
    for printed in (np.round(times, 4), np.floor(times * 1e4) / 1e4):
        read = even_times(printed)
        assert np.abs(read - times - np.mean(read - times)).max() < 1e-6


def test_a_clock_that_trembles_is_read_as_it_is():
    rng = np.random.default_rng(0)
    times = np.round(np.arange(600) / 150.0 + rng.normal(0.0, 2e-5, 600), 6)
    assert even_times(times) is times
    exact = 5.0 + np.arange(60) / 100.0
    assert even_times(exact) is exact
