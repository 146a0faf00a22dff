"""Noise of known level and colour on a known motion: the level is found, and what is whitened has no structure."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt
from scipy.stats import chi2

from origami_sim.errors import InputError
from origami_sim.fit.colour import MEDIAN, all_colours
from origami_sim.fit.noise import Burst, Noise, infer, noise_of, portmanteau, without_repeats
from origami_sim.recording import Camera, Channel, Recording, noise_report

RATE = 240.0
LEVEL = 1e-4
MEDIAN_VARIANCE = 1 - np.sqrt(3) / np.pi
"""Of the median of three normal numbers (David & Nagaraja 2003, Order Statistics, table 3.2)."""


def motion(t):
    return 1.2 * np.cos(7.0 * t) + 0.3 * np.sin(16.0 * t) * np.exp(-0.2 * t)


def times(n=4000):
    return np.arange(n) / RATE


def averaged(weights):
    w = np.asarray(weights, float) / np.sqrt(np.sum(np.square(weights)))
    return lambda e: np.convolve(e, w, "same")


def median_of_three(e):
    p = np.pad(e, 1, mode="edge")
    return np.median(np.stack([p[:-2], p[1:-1], p[2:]]), axis=0) / np.sqrt(MEDIAN_VARIANCE)


def low_pass(e):
    b, a = butter(2, 0.3)
    pulse = lfilter(b, a, np.r_[1.0, np.zeros(400)])
    return lfilter(b, a, e) / np.sqrt(np.sum(pulse**2))


FILTERS = {
    "white": (lambda e: e, "white"),
    "average of three": (averaged([1, 1, 1]), "average of 3 frames"),
    "average of five": (averaged(np.ones(5)), "average of 5 frames"),
    "triangle": (averaged([1, 2, 1]), "average of 2 frames, twice"),
    "bell": (averaged(np.exp(-0.5 * (np.arange(-6, 7) / 1.5) ** 2)), "bell-shaped average"),
    "exponential": (lambda e: lfilter([np.sqrt(0.75)], [1, -0.5], e), "filter of first order"),
    "median of three": (median_of_three, "median of three"),
    "low-pass": (low_pass, "filter of second order"),
}
ROUNDED = 30.0
"""Steps per deviation to which readings are rounded, as in a file."""


def noise(kind, n, seed):
    """Noise of unit deviation, rounded."""
    e = FILTERS[kind][0](np.random.default_rng(seed).normal(size=n + 400))[200:-200]
    return np.round(e * ROUNDED) / ROUNDED


SEEDS = range(6)


@pytest.fixture(scope="module")
def found():
    """Noise inferred and p-value of the whitened true noise, by kind."""
    t, out = times(), {}
    for kind in FILTERS:
        rows = []
        for seed in SEEDS:
            e = LEVEL * noise(kind, len(t), seed)
            one = infer(t, motion(t) + e)
            white = one.whiten(e, t)
            rows.append((one, portmanteau(white), float(np.std(white))))
        out[kind] = rows
    return out


@pytest.mark.parametrize("kind", FILTERS)
def test_level_within_ten_per_cent_and_the_right_colour(found, kind):
    for one, _, spread in found[kind]:
        assert one.deviation == pytest.approx(LEVEL, rel=0.1)
        assert one.error < 0.06 and not one.bursts and one.frame == pytest.approx(1 / RATE)
        assert spread == pytest.approx(1.0, abs=0.12)
    kinds = [one.kind for one, *_ in found[kind]]
    assert kinds.count(FILTERS[kind][1]) >= 4, kinds


@pytest.mark.parametrize("kind", FILTERS)
def test_the_correlation_is_that_of_the_filter(found, kind):
    long = noise(kind, 200_000, 99)
    true = np.array([np.mean(long[k:] * long[: len(long) - k]) for k in range(4)])
    for one, *_ in found[kind]:
        assert np.pad(one.colour, (0, 4))[:4] == pytest.approx(true, abs=0.06)


def test_whitened_noise_has_structure_no_more_often_than_chance(found):
    p = np.array([row[1] for rows in found.values() for row in rows])
    assert np.mean(p < 0.05) < 0.15 and np.mean(p < 0.5) < 0.66 and np.mean(p > 0.5) < 0.66
    for kind, rows in found.items():
        together = chi2.sf(-2 * np.sum(np.log([r[1] for r in rows])), 2 * len(rows))
        assert together > 1e-3, kind


def test_noise_that_is_not_whitened_has_structure():
    t = times()
    for kind in FILTERS:
        e = noise(kind, len(t), 1)
        assert kind == "white" or portmanteau(e) < 1e-6
    assert portmanteau(np.sin(t) + np.random.default_rng(0).normal(size=len(t))) < 1e-6


def test_a_slow_filter_is_followed_over_a_long_recording():
    """Half of its power lies below the frequencies that are seen: the level is known to some 4 %, and says so."""
    t, levels = times(20_000), []
    for seed in range(5):
        e = LEVEL * lfilter([0.6], [1, -0.8], np.random.default_rng(seed).normal(size=len(t)))
        one = infer(t, motion(t) + e)
        levels.append(one.deviation / LEVEL)
        assert one.kind == "filter of first order" and one.error < 0.06
        assert abs(np.log(levels[-1])) < 3 * one.error
        assert one.colour[1:4] == pytest.approx(0.8 ** np.arange(1, 4), abs=0.1)
    assert np.median(levels) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("level", [1e-6, 1e-2])
def test_level_far_below_the_motion_and_near_it(level):
    t = times()
    e = level * np.random.default_rng(3).normal(size=len(t))
    assert infer(t, motion(t) + e).deviation == pytest.approx(level, rel=0.1)


def test_residuals_with_slow_structure_keep_it():
    """What a wrong model leaves is not taken for noise, and shows after whitening."""
    t = times()
    e = LEVEL * np.random.default_rng(6).normal(size=len(t))
    left = LEVEL * (3 * np.sin(7 * t) + 2 * np.sin(14 * t + 1))
    one = infer(t, left + e)
    assert one.deviation == pytest.approx(LEVEL, rel=0.1) and one.kind == "white"
    assert portmanteau(one.whiten(left + e, t)) < 1e-9


def test_rounding_is_the_floor_and_faint_noise_beside_it_is_seen():
    t = times()
    for step in (2.0, 8.0):
        x = motion(t) + 0.2 * LEVEL * np.random.default_rng(2).normal(size=len(t))
        read = np.round(x / (step * LEVEL)) * step * LEVEL
        one = infer(t, read)
        assert one.deviation == pytest.approx(LEVEL * np.sqrt(step**2 / 12 + 0.04), rel=0.1)
        assert portmanteau(one.whiten(read - motion(t), t)) > 1e-3
    slow = np.round(1e-3 * np.cos(t) / LEVEL) * LEVEL  # rests on counts
    one = infer(t, slow)
    assert one.quantum == pytest.approx(LEVEL, rel=1e-6)
    assert one.deviation == pytest.approx(LEVEL / np.sqrt(12), rel=0.2)


def test_bursts_are_found_and_count_less():
    t, rng = times(), np.random.default_rng(5)
    e = LEVEL * rng.normal(size=len(t))
    starts = [300, 900, 1700, 2600, 3400]
    for k in starts:
        e[k : k + 50] *= 9
    one = infer(t, motion(t) + e)
    assert one.deviation == pytest.approx(LEVEL, rel=0.1) and len(one.bursts) == len(starts)
    for burst, k in zip(one.bursts, starts, strict=True):
        assert burst.first == pytest.approx(t[k], abs=6 / RATE) and burst.last == pytest.approx(t[k + 49], abs=6 / RATE)
        assert burst.factor == pytest.approx(9, rel=0.35)
    white = one.whiten(e, t)
    assert np.std(white) == pytest.approx(1.0, abs=0.06) and portmanteau(white) > 1e-3


def test_an_impact_is_no_burst_and_does_not_lift_the_noise():
    t = times()
    e = LEVEL * np.random.default_rng(7).normal(size=len(t))
    one = infer(t, motion(t) + 0.3 * np.abs(np.sin(9 * t)) + e)
    assert one.deviation == pytest.approx(LEVEL, rel=0.1) and not one.bursts


def test_gaps_and_dropped_frames():
    t, rng = times(), np.random.default_rng(8)
    e = LEVEL * noise("average of three", len(t), 8)
    lost = rng.random(len(t)) < 0.02
    lost[700:800] = True
    read = np.where(lost, np.nan, motion(t) + e)
    one, dropped = infer(t, read), infer(t[~lost], read[~lost])
    assert one.deviation == pytest.approx(LEVEL, rel=0.1) and one.kind == "average of 3 frames"
    assert dropped.deviation == pytest.approx(one.deviation) and dropped.colour == pytest.approx(one.colour)
    white = one.whiten(np.where(lost, np.nan, e), t)
    assert np.array_equal(np.isnan(white), lost)
    assert dropped.whiten(e[~lost], t[~lost]) == pytest.approx(white[~lost])
    assert portmanteau(white) > 1e-3


def test_frames_at_uneven_times():
    rng = np.random.default_rng(9)
    t = times() + rng.uniform(-0.2, 0.2, size=4000) / RATE
    e = LEVEL * noise("average of three", len(t), 9)
    one = infer(t, motion(t) + e)
    assert one.deviation == pytest.approx(LEVEL, rel=0.1) and one.kind == "average of 3 frames"
    assert portmanteau(one.whiten(e, t)) > 1e-3


def test_what_is_known_before_counts_where_there_are_few_frames():
    for n, closer in ((24, True), (4000, False)):
        t = times(n)
        read = motion(t) + LEVEL * np.random.default_rng(10).normal(size=n)
        alone, told = infer(t, read), infer(t, read, stated=5 * LEVEL)
        assert (told.deviation > 1.3 * alone.deviation) == closer
        assert told.error <= alone.error
    t = times(5)
    one = infer(t, np.zeros(5), stated=LEVEL)
    assert one.deviation > 0


def test_frequencies_that_the_object_can_reach_are_not_noise():
    t = times()
    rng = np.random.default_rng(11)
    shake = 3 * LEVEL * sosfilt(butter(6, [0.05, 0.2], "band", output="sos"), rng.normal(size=len(t)))
    read = motion(t) + shake + LEVEL * rng.normal(size=len(t))
    blind, told = infer(t, read), infer(t, read, fastest=40.0)
    assert blind.deviation > 1.5 * LEVEL and blind.error < 0.1
    assert told.band >= 40.0 and told.kind == "white"
    assert abs(np.log(told.deviation / LEVEL)) < told.error, "what is not seen is not known"


def exact(one, t):
    """The covariance matrix of a noise."""
    number = np.round(t / one.frame).astype(int)
    apart = np.abs(number[:, None] - number)
    correlation = np.append(one.colour, 0.0)
    return one.deviation**2 * correlation[np.minimum(apart, len(one.colour))]


def test_whitening_is_exact_over_gaps_in_bursts_and_with_a_systematic_error():
    t = np.delete(np.arange(80) / RATE, [7, 8, 30, 31, 32, 33, 60])
    colour = np.correlate([1.0, 1, 1, 1], [1.0, 1, 1, 1], "full")[3:] / 4
    plain = Noise(2.0, colour, 1 / RATE)
    assert plain.whiten(np.eye(len(t)), t) @ exact(plain, t) @ plain.whiten(np.eye(len(t)), t).T == pytest.approx(
        np.eye(len(t)), abs=1e-9
    )
    loud = Noise(2.0, colour, 1 / RATE, bursts=(Burst(t[10], t[20], 5.0),))
    ratio = np.ones(len(t))
    ratio[10:21] = 5.0
    w = loud.whiten(np.eye(len(t)), t)
    assert w @ (exact(plain, t) * np.outer(ratio, ratio)) @ w.T == pytest.approx(np.eye(len(t)), abs=1e-9)
    tilted = Noise(2.0, colour, 1 / RATE, systematic=3.0, band=20.0)
    w = tilted.whiten(np.eye(len(t)), t)
    smooth = tilted._smooth(t)
    assert np.mean(np.sum(smooth**2, axis=1)) == pytest.approx(9.0, rel=0.1)
    assert w @ (exact(plain, t) + smooth @ smooth.T) @ w.T == pytest.approx(np.eye(len(t)), abs=1e-8)
    column = np.random.default_rng(0).normal(size=len(t))
    assert tilted.whiten(column, t) == pytest.approx(w @ column)


def test_a_systematic_floor_does_not_average_out():
    """The information on a slow signature is bounded by the floor however many frames there are."""
    for n in (1000, 4000):
        t = times(n)
        signature = np.sin(5 * t)
        floor = Noise(1.0, frame=1 / RATE, systematic=2.0, band=4.0).whiten(signature, t)
        free = Noise(1.0, frame=1 / RATE).whiten(signature, t)
        assert free @ free == pytest.approx(n / 2, rel=0.05)
        assert floor @ floor < 4.0 * 2 * 4.0 * n / RATE  # numbers that the floor has, over its variance
    fast = np.sin(300 * t)
    left = Noise(1.0, frame=1 / RATE, systematic=2.0, band=4.0).whiten(fast, t)
    assert left @ left == pytest.approx(n / 2, rel=0.05)


def test_samples_have_the_noise_that_they_are_drawn_from():
    t = times(3000)
    colour = np.array([1.0, 0.5, 0.2])
    one = Noise(3.0, colour, 1 / RATE, bursts=(Burst(t[100], t[400], 4.0),))
    drawn = one.draw(t, np.random.default_rng(1))
    assert np.std(drawn[100:401]) == pytest.approx(12.0, rel=0.2) and np.std(drawn[500:]) == pytest.approx(3, rel=0.1)
    white = one.whiten(drawn, t)
    assert portmanteau(white) > 1e-3 and np.std(white) == pytest.approx(1.0, abs=0.05)
    assert white == pytest.approx(np.random.default_rng(1).normal(size=3000), abs=1e-9)


def test_channels_of_a_recording():
    t, rng = times(2000), np.random.default_rng(12)
    place = np.stack([motion(t), 0.5 * motion(t)], axis=1) + rng.normal(size=(2000, 2)) * [1e-4, 4e-4]
    camera = Camera(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, 1.0]]))
    angle = motion(t) + 1e-3 * rng.normal(size=2000)
    channels = {
        "m": Channel("m", "marker_2d", place, "m", 2e-4, camera=camera),
        "a": Channel("a", "panel_angle", angle, "rad", 1e-3, noise_report=noise_report(t, angle)),
    }
    found = noise_of(Recording("r", t, channels), systematic={"a": 2e-3})
    assert [n.deviation for n in found["m"]] == pytest.approx([1e-4, 4e-4], rel=0.1)
    (of_angle,) = found["a"]
    assert of_angle.deviation == pytest.approx(1e-3, rel=0.1) and of_angle.systematic == 2e-3
    left = noise_of(Recording("r", t, channels), {"a": angle - motion(t)})["a"][0]
    assert left.deviation == pytest.approx(1e-3, rel=0.1)


def test_bad_input_is_refused():
    t = times(100)
    with pytest.raises(InputError, match=r"noise needs readings.*>= 2"):
        infer(t, np.full(100, np.nan))
    with pytest.raises(InputError, match=r"increasing times"):
        infer(t[::-1], motion(t))
    with pytest.raises(InputError, match=r"stated"):
        infer(t, motion(t), stated=0.0)
    with pytest.raises(InputError, match=r"systematic"):
        infer(t, motion(t), systematic=-1.0)
    with pytest.raises(InputError, match=r"frame by frame"):
        Noise(1.0).whiten(motion(t), t[:-1])


def test_the_colours_are_a_prior_of_unit_mass_and_unit_variance():
    colours = all_colours(513)
    assert np.exp(colours.prior).sum() == pytest.approx(1.0, abs=0.1)  # but for those of too long a memory
    assert np.trapezoid(colours.power, dx=1 / 512) == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    x = median_of_three(rng.normal(size=400_000))
    assert [np.mean(x[1:] * x[:-1]), np.mean(x[2:] * x[:-2])] == pytest.approx(MEDIAN, abs=0.01)


def quantised(deviation: float, amplitude: float, period: float, rng: np.random.Generator) -> tuple:
    """Readings (400,) of a dying swing in steps of 1, its three numbers, and its derivatives by them [400, 3]."""
    t = np.arange(400)
    wave = np.array([np.sin(2 * np.pi * t / period), np.cos(2 * np.pi * t / period)]) * np.exp(-t / 200)
    design = np.column_stack([np.ones(400), *wave])
    phase = rng.uniform(0, 2 * np.pi)
    truth = np.array([rng.uniform(), amplitude * np.cos(phase), amplitude * np.sin(phase)])
    return np.round(design @ truth + deviation * rng.standard_normal(400)), truth, design


def error_over_stated(read: np.ndarray, truth: np.ndarray, design: np.ndarray, deviation: float) -> float:
    """Mean square error of least squares, over what white noise would give."""
    seen = np.isfinite(read)
    a = design[seen] / np.hypot(deviation, 1 / np.sqrt(12))
    error = np.linalg.lstsq(design[seen], read[seen])[0] - truth
    return float(np.sum((a @ error) ** 2)) / np.linalg.matrix_rank(a)


@pytest.mark.parametrize(("deviation", "amplitude", "most"), [(0.0, 0.0, 1.1), (0.02, 3.0, 1.6), (0.3, 3.0, 1.1)])
def test_readings_that_stand_on_a_step_tell_no_more_than_is_true(deviation, amplitude, most):
    rng = np.random.default_rng(5)
    every, once = [], []
    for _ in range(200):
        read, truth, design = quantised(deviation, amplitude, 200.0, rng)
        design = design if amplitude else design[:, :1]
        every.append(error_over_stated(read, truth[: design.shape[1]], design, deviation))
        once.append(
            error_over_stated(without_repeats(read[:, None])[:, 0], truth[: design.shape[1]], design, deviation)
        )
    assert np.sqrt(np.mean(once)) < most
    if deviation < 0.1:
        assert np.sqrt(np.mean(every)) > 1.5 * most  # as many readings as frames would tell too much


def test_readings_that_noise_moves_all_count():
    rng = np.random.default_rng(6)
    read = quantised(0.5, 3.0, 200.0, rng)[0][:, None]
    assert np.isfinite(without_repeats(read)).mean() > 0.95
    smooth = rng.standard_normal((400, 2))
    smooth[7, 1] = np.nan
    np.testing.assert_array_equal(without_repeats(smooth), smooth)


def test_what_stands_is_kept_in_the_middle():
    read = np.array([*range(5), *[9.0] * 21, 3.0, np.nan, *[np.nan] * 20, 4.0])[:, None]
    kept = without_repeats(read)[:, 0]
    assert np.flatnonzero(np.isfinite(kept)).tolist() == [0, 1, 2, 3, 4, 15, 26, 48]
