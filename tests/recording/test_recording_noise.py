"""The noise estimate on signals whose noise is known."""

import numpy as np
import pytest

from origami_sim.recording import estimate_noise
from origami_sim.recording.units import quantity


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
    ],
)
def test_quantities_read_well(value, unit, text):
    assert quantity(value, unit) == text
