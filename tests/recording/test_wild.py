"""Wild frames are found, and nothing that a device does is taken for one."""

import numpy as np
import pytest

from origami_sim.recording.wild import wild_frames

T = np.arange(600) / 120.0
SWING = 0.8 * np.cos(2 * np.pi * 2.0 * T) * np.exp(-0.3 * T)


@pytest.mark.parametrize("size", [0.1, 1.0])
@pytest.mark.parametrize("run", [1, 2, 3])
def test_wild_frames_are_found_wherever_they_are(run, size):
    """Of their neighbours, hardly ever one is lost with them."""
    rng, missed, lost = np.random.default_rng(run), 0, 0
    for _ in range(20):
        values = SWING + rng.normal(0.0, 0.005, 600)
        at = 20 + 30 * rng.choice(18, 4, replace=False)
        off = np.zeros(600, bool)
        for a in at:
            off[a : a + run] = True
        values[off] += np.repeat(rng.choice([-1.0, 1.0], 4), run) * size * rng.uniform(1.0, 2.0, 4 * run)
        found = wild_frames(T, values, 0.005)
        missed += np.count_nonzero(off & ~found)
        lost += np.count_nonzero(found & ~off)
    assert missed == 0 and lost <= 2  # of 80 runs


def test_one_component_makes_a_marker_wild_and_missing_frames_are_no_frames():
    values = np.stack([SWING, 0.1 * T, 0.0 * T], axis=1)
    values[100] += [0.0, 0.0, 0.2]
    values[200:202] = np.nan
    values[202] += 0.3
    assert np.flatnonzero(wild_frames(T, values, 0.002)).tolist() == [100, 202]


def test_blows_steps_and_bursts_are_no_wild_frames():
    rng = np.random.default_rng(0)
    bouncing = 0.3 * np.abs(np.sin(2 * np.pi * 1.1 * T))  # corners of a path
    snapping = np.where(T > 2.503, 0.5, -0.5)
    fast = 0.5 * np.sin(2 * np.pi * 31.0 * T)  # four frames to a period
    ringing = np.where(T > 1.0, 0.4 * np.exp(-8.0 * (T - 1.0)) * np.sin(2 * np.pi * 24.0 * (T - 1.0)), 0.0)
    walk = np.cumsum(rng.normal(0.0, 0.01, 600))
    for values in (bouncing, snapping, fast, ringing, walk, np.zeros(600)):
        for noise in (0.0, 1e-4):
            assert not wild_frames(T, values + rng.normal(0.0, noise, 600), noise).any()


def test_noise_that_is_stated_much_too_small_does_not_make_frames_wild():
    values = SWING + np.random.default_rng(3).normal(0.0, 0.01, 600)
    assert np.count_nonzero(wild_frames(T, values, 1e-6)) <= 1


def test_neighbours_across_a_gap_in_time_tell_nothing():
    times = T.copy()
    times[300:] += 0.2
    assert not wild_frames(times, np.where(times > times[299], 0.9, 0.0) + SWING, 1e-3).any()
    assert not wild_frames(T[:5], SWING[:5], 1e-3).any()


def test_what_follows_a_switch_of_the_drive_is_a_motion():
    """A blow at a known time, that damps within three frames: wild, unless it is said that something was switched."""
    values = np.zeros(600)
    values[300:303] = [0.5, -0.3, 0.1]
    values += np.random.default_rng(0).normal(0.0, 0.005, 600)
    assert wild_frames(T, values, 0.005).any()
    assert not wild_frames(T, values, 0.005, [T[299]]).any()
    assert wild_frames(T, values, 0.005, [T[100]]).any()
