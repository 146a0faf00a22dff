"""The noise estimate on signals whose noise is known."""

import numpy as np
import pytest

from origami_sim.recording import estimate_noise, noise_report
from origami_sim.units import quantity


def signal(times):
    return 1.2 * np.cos(7.0 * times) + 0.3 * np.sin(16.0 * times) * np.exp(-0.2 * times)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
@pytest.mark.parametrize("rate", [240.0, 1000.0])
def test_white_noise_is_found_within_ten_per_cent(noise, rate):
    times = np.arange(3000) / rate
    generator = np.random.default_rng(1)
    values = signal(times) + generator.normal(scale=noise, size=times.size)
    assert estimate_noise(times, values) == pytest.approx(noise, rel=0.1)


def test_uneven_times_gaps_and_outliers_do_not_disturb_it():
    generator = np.random.default_rng(2)
    times = np.arange(4000) / 1000.0 + generator.uniform(-2e-4, 2e-4, size=4000)
    times[2000:] += 0.7
    values = signal(times) + generator.normal(scale=1e-4, size=4000)
    values[::500] += 0.2
    values[1000:1010] = np.nan
    assert estimate_noise(times, values) == pytest.approx(1e-4, rel=0.1)


def test_components_are_averaged_as_variances():
    generator = np.random.default_rng(3)
    times = np.arange(5000) / 500.0
    scales = np.array([1e-4, 1e-4, 4e-4])
    values = signal(times)[:, None] + generator.normal(size=(5000, 3)) * scales
    assert estimate_noise(times, values) == pytest.approx(np.sqrt(np.mean(scales**2)), rel=0.1)


@pytest.mark.parametrize("amplitude", [1.0, 1e-3], ids=["fast", "resting on counts"])
def test_quantisation_is_the_floor(amplitude):
    quantum = 1.57e-4
    times = np.arange(8000) / 1000.0
    values = np.round(amplitude * np.cos(3.0 * times) / quantum) * quantum
    assert estimate_noise(times, values) == pytest.approx(quantum / np.sqrt(12.0), rel=0.1)


def test_a_noiseless_signal_has_rounding_noise_only():
    times = np.arange(1000) / 1000.0
    assert 0.0 < estimate_noise(times, np.cos(3.0 * times)) < 1e-14


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0081, "rad", "8.1 mrad"),
        (1.6e-4, "rad", "160 µrad"),
        (0.09999, "m", "100 mm"),
        (25.0, "rad", "25 rad"),
        (4200.0, "rad", "4200 rad"),
        (3000.0, "V", "3.0 kV"),
        (0.0, "N", "0 N"),
        (0.52, "1/s", "0.52 1/s"),
        (8.1e-4, "kg m^2", "0.00081 kg m^2"),
        (9.7e-6, "kg", "9.7 mg"),
        (0.094, "kg", "94 g"),
        (2.5, "kg", "2.5 kg"),
        (3e-4, "N m/rad", "300 µN m/rad"),
    ],
)
def test_quantities_read_well(value, unit, text):
    assert quantity(value, unit) == text


def correlated(count: int, lag: float, seed: int = 0) -> np.ndarray:
    """First-order noise of unit standard deviation whose neighbours correlate by `lag`."""
    white = np.random.default_rng(seed).normal(size=count + 200)
    out = np.zeros(count + 200)
    for k in range(1, len(out)):
        out[k] = lag * out[k - 1] + np.sqrt(1 - lag**2) * white[k]
    return out[200:]


@pytest.mark.parametrize("lag", [0.0, 0.3, 0.6, 0.85])
def test_the_correlation_of_a_filtering_tracker_is_found(lag):
    times = np.arange(8000) / 500.0
    report = noise_report(times, signal(times) + 1e-4 * correlated(8000, lag))
    assert report.lag_1 == pytest.approx(lag, abs=0.1)
    if lag <= 0.6:  # beyond, it scatters by a third, as the docstring says
        assert report.total == pytest.approx(1e-4, rel=0.1)  # what the differences alone understate
    if lag > 0.5:
        assert report.level < 0.6e-4


@pytest.mark.parametrize(("ringing", "frequency"), [(6e-4, 14.0), (6e-4, 10.0), (2e-3, 6.0)])
def test_ringing_is_no_correlation_of_a_tracker(ringing, frequency):
    """At 200 frames per second: what rings grows up to strides of six frames as correlated noise does."""
    t = np.arange(1400) / 200.0
    swing = 0.3 * np.sin(2.0 * np.pi * t) + ringing * np.sin(2.0 * np.pi * frequency * t)
    lags = [noise_report(t, swing + 5e-4 * np.random.default_rng(s).standard_normal(1400)).lag_1 for s in range(5)]
    assert np.all(np.abs(lags) < 0.12)


def test_bursts_are_told_by_their_root_mean_square():
    times = np.arange(6000) / 500.0
    generator = np.random.default_rng(4)
    scale = np.where(generator.random(6000) < 0.05, 10e-4, 1e-4)
    report = noise_report(times, signal(times) + scale * generator.normal(size=6000))
    assert report.rms == pytest.approx(float(np.sqrt(np.mean(scale**2))), rel=0.2)
    assert report.level < 0.7 * report.rms and report.burst > 1.4


def test_segments_at_rest_show_the_noise_directly():
    times = np.arange(6000) / 500.0
    motion = np.where(times < 6.0, 0.0, signal(times) - signal(np.array([6.0])))
    report = noise_report(times, motion + 1e-4 * correlated(6000, 0.5))
    assert report.rest_frames == pytest.approx(3000, abs=200)
    assert report.rest == pytest.approx(1e-4, rel=0.1)
    assert report.rest_lag_1 == pytest.approx(0.5, abs=0.1)
    moving = noise_report(times, signal(times) + 1e-4 * correlated(6000, 0.0))
    assert moving.rest_frames < 600


def test_the_step_of_the_readings_is_stated():
    times = np.arange(3000) / 500.0
    report = noise_report(times, np.round(signal(times) / 0.01) * 0.01)
    assert report.quantum == pytest.approx(0.01, rel=0.01)
    assert noise_report(times, signal(times)).quantum == 0.0
