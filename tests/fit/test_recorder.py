"""Noise of a recorder, told by what fits leave of all recordings."""

from types import SimpleNamespace

import numpy as np

from origami_sim.fit.recorder import flat_level, recorder_weights
from origami_sim.fit.weights import Weights
from origami_sim.infer.recorder import recorder_noise


def left_over(seed: int, recordings: int):
    """A fit that leaves noise of unit deviation, smoothed over three frames, in recordings of 145 frames each."""
    rng = np.random.default_rng(seed)
    rows = [np.convolve(rng.normal(size=147), [1, 2, 1], "valid")[:, None] / np.sqrt(6.0) for _ in range(recordings)]
    blocks = [
        SimpleNamespace(recording=n, first=0, noise=np.full(1, 0.3), times=np.arange(145) / 120.0, values=rows[n])
        for n in range(recordings)
    ]
    weights = Weights(np.ones(1), (np.ones(1),), 4, 0.0)
    return SimpleNamespace(recordings=[SimpleNamespace(by_step=False)], blocks=blocks), SimpleNamespace(
        weights=weights, blocks=list(range(recordings)), residuals=rows
    )


def test_all_recordings_tell_the_level_of_a_smoothing_tracker():
    """A third of it was read from neighbouring frames: the more is left over, the less that counts."""
    error = {}
    for n in (1, 4):
        found = [recorder_weights(*left_over(seed, n))[1] for seed in range(12)]
        assert all(w.colour[0][1] > 0.3 for w in found)
        error[n] = np.abs(np.mean([w.deviation[0] for w in found]) - 1.0)
    assert error[4] < 0.05 and error[4] < 0.3 * error[1]


def test_a_lost_frame_parts_no_spectrum():
    """Frames without a value are passed over: what is told is what the others tell without them."""
    forward, f = left_over(3, 4)
    lost = [np.delete(r, 70, axis=0) for r in f.residuals]
    shorter = SimpleNamespace(weights=f.weights, blocks=f.blocks, residuals=lost)
    for r in f.residuals:
        r[70] = np.nan
    one, other = (recorder_weights(forward, fit)[1] for fit in (f, shorter))
    assert np.array_equal(one.deviation, other.deviation) and np.array_equal(one.colour[0], other.colour[0])


def test_what_rings_within_a_filter_is_no_noise():
    """A flap that rings in eight frames is far above what is read where no motion reaches; an average is not."""
    forward, f = left_over(5, 4)
    averaged = recorder_noise(forward, f)[0]
    assert 0.85 < averaged < 1.15
    t, rng = np.arange(600), np.random.default_rng(2)
    ring = 0.3 * rng.normal(size=600) + 12.0 * np.exp(-t / 50.0) * np.sin(2.0 * np.pi * t / 8.0)
    f.blocks, f.residuals = [0], [ring[:, None]]
    assert flat_level([ring], 0.3) > 1.5 and 0.25 < recorder_noise(forward, f)[0] < 0.4
    f.residuals = [2.0 * rng.normal(size=(600, 1))]  # of a prediction that is rough beside quiet readings
    forward.blocks[0].values = 0.3 * rng.normal(size=(600, 1))
    assert 0.25 < recorder_noise(forward, f)[0] < 0.4
