"""What a fit leaves is told from noise, and from noise that a tracker has coloured."""

from dataclasses import replace

import numpy as np
import pytest
from test_curves import MOMENT_NOISE, REST, K, coupon, torque
from test_unlisted import SMALL, searched

from origami_sim.diagnose import diagnose
from origami_sim.infer.remainder import mismatch
from origami_sim.verdict.decide import decide
from tests.diagnose.strips import record

NOISE = 2e-3


@pytest.mark.parametrize(("waves", "word"), [(0.0, "ADEQUATE"), (1.5, "UNKNOWN")])
def test_waves_in_a_torque_curve_are_real(waves, word):
    """No law of the catalogue makes a moment that waves with the angle; it is 1.5 times the noise."""
    amplitude = np.sqrt(2.0) * waves * MOMENT_NOISE
    found = diagnose(coupon(), [torque(lambda q: K * (q - REST) + amplitude * np.sin(8.0 * q))])
    assert found.verdict == word


def averaged(rng, count: int) -> np.ndarray:
    """White noise, over five frames."""
    return np.convolve(rng.normal(size=count + 4), np.ones(5) / np.sqrt(5.0), "valid")


def shaken(rng, count: int) -> np.ndarray:
    """White noise, and as much of a wave of 12 frames whose phase wanders."""
    phase = 2.0 * np.pi * np.arange(count) / 12.0 + np.cumsum(0.2 * rng.normal(size=count))
    return rng.normal(size=count) + np.sqrt(2.0) * np.sin(phase)


@pytest.mark.parametrize(("noise", "real"), [(averaged, False), (shaken, True)])
def test_a_wave_is_real_and_what_a_tracker_averages_is_not(noise, real):
    made, rng = record(noise=1e-6, **SMALL), np.random.default_rng(5)
    noisy = {n: c.values + NOISE * noise(rng, len(c.values)) for n, c in made.channels.items()}
    channels = {n: replace(c, values=noisy[n], noise=NOISE) for n, c in made.channels.items()}
    forward, given, base, found = searched(replace(made, channels=channels), "air_drag")
    assert any(len(c) > 1 for c in found.nodes[frozenset()].fit.weights.colour)
    left = mismatch(found, forward, given, base, frozenset())
    assert (left.real > 0.9) == real
    assert (left.real < 0.5) != real
    assert (left.rest > 0.5) == real and left.named == 0.0
    assert (decide(found, lambda key: left).word == "UNKNOWN") == real
