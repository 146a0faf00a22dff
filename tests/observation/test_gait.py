"""Strides: the way of the centre of mass in each cycle of a periodic drive."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Drive, Sheet, ramp, series, simulate, sine, strip
from origami_sim.observation.gait import advances, period


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        (Drive(field=(0, 0, sine(0.01, 4.0))), 0.25),
        (Drive(field=(sine(0.01, 2.0), 0.1, sine(0.01, 6.0))), 0.5),
        (Drive(field=(sine(0.01, 2.0), 0, sine(0.01, 3.0))), None),
        (Drive(field=(sine(0.01, 2.0), 0, ramp(0.1, 1.0))), None),
        (Drive(field=(0, 0, 0.1)), None),
        (Drive(field=(sine(0.0, 2.0), 0, sine(0.1, 3.0))), 1 / 3),
        (Drive(field=(0, 0, sine(0.1, 5.0)), voltage=[series([0, 1], [2.0, 2.0])]), 0.2),
    ],
)
def test_the_period_is_that_of_the_slowest_wave(drive, expected):
    assert period(drive) == (None if expected is None else pytest.approx(expected))


def walking(rate: float, frequency: float, speeds: bool = True):
    """A strip that is carried by 3 mm in each cycle, and swings by 2 mm about that."""
    sheet = Sheet(strip([0.01, 0.01], 0.02), thickness="1 mm").crease(stiffness=1e-3)
    run = simulate(*sheet.build(), duration=2.0 / rate, rate=rate)
    t, w = np.arange(int(1.0 * rate) + 1) / rate, 2 * np.pi * frequency
    x = 3e-3 * frequency * t + 2e-3 * np.sin(w * t + 0.7)
    v = 3e-3 * frequency + 2e-3 * w * np.cos(w * t + 0.7)
    place, speed = (np.broadcast_to(run.x[0], (len(t), *run.x.shape[1:])).copy() * f for f in (1.0, 0.0))
    place[..., 0] += x[:, None, None]
    speed[..., 0] += (v if speeds else 0 * v)[:, None, None]
    return replace(run, times=t, x=place, v=speed)


def test_frames_on_whole_cycles_are_exact():
    each = advances(walking(60.0, 4.0), 0.25)
    np.testing.assert_allclose(each[:, 0], 3e-3, rtol=1e-9)
    assert each.shape == (4, 3) and not np.any(np.abs(each[:, 1:]) > 1e-15)


def test_between_frames_speeds_count():
    """(w h)^4 / 384 of the amplitude at most, on either side of a cycle; straight lines are off by (w h)^2 / 8."""
    angle = 2 * np.pi * 7.0 / 60.0
    assert np.abs(advances(walking(60.0, 7.0), 1 / 7)[:, 0] - 3e-3).max() < 2 * 2e-3 * angle**4 / 384
    straight = np.abs(advances(walking(60.0, 7.0, speeds=False), 1 / 7)[:, 0] - 3e-3).max()
    assert 1e-5 < straight < 2 * 2e-3 * angle**2 / 8


def test_a_run_shorter_than_a_cycle_has_none():
    assert advances(walking(60.0, 4.0), 1.5).shape == (0, 3)
