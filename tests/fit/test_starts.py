"""Starts that recordings tell, clocks that are late, and drives as they reach segments of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim.diagnose import Subject
from origami_sim.diagnose.arrange import steady
from origami_sim.diagnose.menu import menu
from origami_sim.diagnose.prepare import prepared
from origami_sim.drive import Drive, ramp, series, sine
from origami_sim.drive.refining import refined
from origami_sim.drive.starts import shifted
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model import Parameters
from origami_sim.observation.rates import local_line
from origami_sim.predict.at_rest import starting
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.drives import reaching
from origami_sim.predict.measured import lateness
from origami_sim.predict.starts import seen_first
from origami_sim.recording import Recording
from origami_sim.recording.possible import Possible
from origami_sim.recording.recording import DriveChannel
from tests.diagnose.strips import hanging, record, subject

SMALL = {"duration": 3.0, "panels": 3, "rate": 100}


def test_a_rate_is_known_as_well_as_the_recording_tells():
    rng, times, sigma = np.random.default_rng(0), np.arange(200) / 200.0, 1e-3
    found = []
    for _ in range(200):
        values = (0.3 * np.sin(4.0 * times) + sigma * rng.normal(size=200))[:, None]
        _, slope, error = local_line(times, values, np.array([sigma]), 100)
        found.append((slope[0] - 1.2 * np.cos(2.0)) / error[0])
    assert np.std(found) == pytest.approx(1.0, rel=0.15) and abs(np.mean(found)) < 0.5


@pytest.mark.parametrize("driven", ["ramp", "step", "released"])
@pytest.mark.parametrize("sigma", [5e-5, 5e-4, 2e-3])
@pytest.mark.parametrize("frequency", [1.5, 4.0, 10.0])
def test_what_begins_at_rest_is_not_told_from_rest(driven, sigma, frequency):
    """Undamped motions from rest; the window about a frame grows until it holds a part of a swing."""
    rng, times, w = np.random.default_rng(1), np.arange(200) / 200.0, 2.0 * np.pi * frequency
    swing = {"ramp": times - np.sin(w * times) / w, "step": 1.0 - np.cos(w * times), "released": np.cos(w * times)}
    most = {False: 0.0, True: 0.0}
    for _ in range(50):
        values = (0.2 * swing[driven] + sigma * rng.normal(size=200))[:, None]
        for slowest in most:
            _, slope, error = local_line(times, values, np.array([sigma]), 0, slowest=slowest)
            most[slowest] = max(most[slowest], abs(slope[0] / error[0]))
    assert most[True] < 5.0 and most[True] <= most[False]


def test_the_slowest_rate_still_tells_what_moves():
    rng, times, sigma = np.random.default_rng(1), np.arange(200) / 200.0, 1e-4
    values = (0.3 * np.sin(4.0 * times) + sigma * rng.normal(size=200))[:, None]
    _, slope, error = local_line(times, values, np.array([sigma]), 0, slowest=True)
    assert slope[0] / error[0] > 6.0 and slope[0] == pytest.approx(1.2, abs=4 * error[0])


def test_the_first_value_that_is_not_missing_tells_the_turn():
    values = np.array([[np.nan, 1.0, np.nan], [5.0, 2.0, np.nan], [6.0, 3.0, np.nan]])
    np.testing.assert_array_equal(seen_first(values), [5.0, 1.0, np.nan])


@pytest.mark.parametrize("effect", ["clock_rate", "clock_delay", "tracker_lag", "exposure", "angle_scale"])
def test_a_clock_that_runs_fast_is_off_by_more_in_every_segment_and_a_delay_is_not(effect):
    """What the drive does in a segment is asked of the time at which it was recorded."""
    forward = BarRollouts(subject(3), [record(**SMALL)], segment=0.5)
    begins = np.array([0.0, 1.0, 2.5])
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == effect]
    if not every:
        pytest.skip(f"no {effect} of fold angles")
    each, value = [Hypothesis(), Hypothesis((every[0],))], 0.01 if effect == "clock_rate" else 0.02
    theta = [np.ones(3), np.array([1.0, 1.0, 1.0, value])]
    worlds = [forward.world(h, t, (effect,)) for h, t in zip(each, theta, strict=True)]
    late, _ = lateness(worlds[0][0], Parameters.join([p for _, p in worlds]), 2, begins, True)
    assert np.array_equal(late[0], [0.0] * 3)
    behind = {"clock_delay": 0.02, "tracker_lag": 0.02, "exposure": 0.01}.get(effect, 0.0)  # its mean
    expected = 0.01 * begins if effect == "clock_rate" else np.full(3, -behind)
    assert late[1] == pytest.approx(expected, abs=1e-12)


def driven(start: str, phase: float = 0.0, duration: float = 3.0, rate: int = 100) -> BarRollouts:
    """The strip with magnets in a field of 1 Hz."""
    model, parameters = hanging(3)
    model = model.with_effects("magnetic_torque")
    parameters = parameters.for_model(model)
    parameters.set("magnetic_torque", "remanence", 0.05)
    parameters.set("magnetic_torque", "volume", parameters["inertia", "mass"].sum() / 3000.0 / len(model.triangles))
    parameters.set("magnetic_torque", "poling_n", 1.0)
    drive = Drive(field=(0.0, 0.0, sine(0.02, 1.0, phase=phase)))
    recordings = prepared([record(**SMALL | {"duration": duration, "rate": rate})], 400.0)
    return BarRollouts(Subject.from_model(model, parameters, drive), recordings, start=start)


def delayed(forward: BarRollouts, delay: float) -> np.ndarray:
    """[n, D] what a camera whose clock is late sees of the first segment."""
    every = suspects(forward.model, forward.recordings, forward.drive)
    (one,) = (s for s in every if s.effect == "clock_delay" and s.site == "the measurement")
    starts = np.zeros((1, len(forward.blocks), forward.local))
    return forward.predict(Hypothesis((one,)), np.array([[delay]]), starts, [0])[0][0]


@pytest.mark.slow
def test_a_late_camera_sees_rest_before_the_motion_and_an_early_one_more_of_it():
    seen, longer = delayed(driven("rest"), 0.0), delayed(driven("rest", duration=3.5), 0.0)
    assert np.ptp(seen) > 0.02
    late = delayed(driven("rest"), 0.2)
    np.testing.assert_allclose(late[:20], seen[:1].repeat(20, axis=0), atol=1e-9)
    np.testing.assert_allclose(late[20:], seen[:-20], atol=1e-9)
    np.testing.assert_allclose(delayed(driven("rest"), -0.2), longer[20:][: len(seen)], atol=1e-9)


def test_a_late_camera_and_a_drive_that_is_as_late_are_one_where_starts_are_fitted():
    for delay in (0.2, -0.2):
        late = delayed(driven("fit"), delay)
        same = delayed(driven("fit", phase=-2 * np.pi * delay), 0.0)
        assert np.ptp(late - delayed(driven("fit"), 0.0)) > 0.01
        np.testing.assert_allclose(late, same, atol=1e-5)  # the shifted drive is one of samples


@pytest.mark.parametrize("start", ["fit", "rest"])
def test_many_worlds_may_share_a_clock(start):
    """All worlds have one delay where only starts are to be fitted, and as many as worlds where it is."""
    forward = driven(start)
    every = suspects(forward.model, forward.recordings, forward.drive)
    (one,) = (s for s in every if s.effect == "clock_delay" and s.site == "the measurement")
    starts = np.zeros((3, len(forward.blocks), forward.local))
    shared, apart = (
        forward.predict(Hypothesis((one,)), np.array(t)[:, None], starts)[0] for t in ([0.1, 0.1, 0.1], [0.1, 0.0, 0.1])
    )
    np.testing.assert_array_equal(shared[0], shared[1])
    np.testing.assert_allclose(apart[[0, 2]], shared[[0, 2]], atol=1e-12)
    assert np.ptp(apart[1] - apart[0]) > 1e-3


def seen_by(forward: BarRollouts, values: np.ndarray) -> Recording:
    """A recording of the strip with these readings [n, D], 1 mrad of noise and the field."""
    (swing,), rng = forward.recordings, np.random.default_rng(0)
    channels = {
        n: replace(c, values=values[:, k] + 1e-3 * rng.normal(size=len(values)), noise=1e-3)
        for k, (n, c) in enumerate(swing.channels.items())
    }
    field = DriveChannel("field", np.stack([forward.drive["field_z"](swing.times)] * 3, axis=1) * [0, 0, 1], "T", False)
    return replace(swing, channels=channels, drive={"field": field})


def test_a_motion_that_is_under_way_within_a_few_frames_began_at_rest():
    """A field that is on at once; the same a while later, and from another angle, did not."""
    forward = driven("rest", phase=np.pi / 2, rate=400)
    values = delayed(forward, 0.0)
    assert np.abs(values[4] - values[0]).max() > 5e-3, "five deviations within four frames"
    swing = seen_by(forward, values)
    assert starting(forward.subject, [swing]) == "rest"
    assert starting(forward.subject, [swing.window(0.5, 2.5)]) == "fit"
    assert starting(forward.subject, [seen_by(forward, values + 0.2)]) == "fit"


def test_what_begins_at_rest_is_cut_where_small_differences_grow():
    """The strip as it hangs, and upside down, where weak creases let it fall."""
    still = record(panels=3, duration=1.0, size=0.0)
    assert steady(subject(3), [still], 1.0, 1)
    model, parameters = hanging(3)
    parameters.set("gravity", "gravity_z", -parameters["gravity", "gravity_z"])
    assert not steady(Subject.from_model(model, parameters, None, []), [still], 1.0, 1)


@pytest.mark.parametrize(
    ("wave", "smooth"),
    [
        (lambda t: 0.02 * np.sin(15.0 * t), True),
        (lambda t: np.round(0.02 * np.sin(15.0 * t), 5), True),
        (lambda t: np.where(t % 0.5 < 0.25, 1.0, 0.0), False),
        (lambda t: np.sin(t) + 0.05 * np.random.default_rng(0).normal(size=len(t)), False),
    ],
)
def test_only_smooth_drives_are_refined(wave, smooth):
    times = np.arange(240) / 120.0
    t, values = refined(times, wave(times))
    assert len(t) == (6 * 239 + 1 if smooth else 240)
    if smooth:
        between = np.linspace(0.05, 1.9, 999)
        true = 0.02 * np.sin(15.0 * between)
        cut = np.abs(np.interp(between, times, wave(times)) - true).max()
        assert np.abs(np.interp(between, t, values) - true).max() < 0.2 * cut


def test_a_drive_seen_from_several_starts_keeps_its_bends():
    """A ramp's end, the steps of a recorded drive, and a wave on a series; at many starts a fine grid is enough."""
    frames = np.arange(101) * 0.01
    steps = series(frames, 0.02 * np.sign(np.sin(40.0 * frames)))
    wave = replace(ramp(0.2, 0.5), amplitude=0.01, frequency=3.0)
    for signal, error in ((ramp(0.2, 1.0), 1e-15), (steps, 1e-15), (wave, 2e-7)):
        drive, starts, at = Drive(field=(0, 0, signal)), np.array([0.88, 0.3, 0.41]), np.linspace(0.0, 0.11, 500)
        seen = shifted(drive, starts, 0.11, 2)["field_z"](at[:, None])
        assert seen.shape == (500, 6) and np.array_equal(seen[:, :3], seen[:, 3:])
        truth = np.stack([signal(at + t0) for t0 in starts], axis=1)
        assert np.abs(seen[:, :3] - truth).max() < error
    many = np.linspace(0.85, 0.95, 300)
    drive = Drive(field=(0, 0, ramp(0.2, 1.0)))
    seen = shifted(drive, many, 0.11, 1)["field_z"](at[:, None])
    assert np.abs(seen - [[drive["field_z"](t + t0) for t0 in many] for t in at]).max() < 1e-4


def test_what_distorts_a_drive_remembers_what_was_before_a_start():
    """A field that is switched off at 1 s, late or lagging: segments that begin just after it still feel it."""
    switched = series(np.array([0.0, 0.999, 1.0, 3.0]), np.array([0.02, 0.02, 0.0, 0.0]))
    model, parameters = hanging(3)
    model = model.with_effects("drive_delay", "field_lag")
    each = [parameters.for_model(model) for _ in range(3)]
    each[1].set("drive_delay", "delay", 0.05)
    each[2].set("field_lag", "lag", 0.1)
    starts, at = np.array([0.5, 1.02, 1.2]), np.linspace(0.0, 0.3, 301)
    drive = Drive(field=(0, 0, switched))
    seen = reaching(model, each, drive, starts, 0.3)["field_z"](at[:, None]).reshape(301, 3, 3)
    late = np.stack([switched(at + t0 - 0.05) for t0 in starts], axis=1)
    lagging = np.stack([0.02 * np.exp(-np.maximum(at + t0 - 1.0, 0.0) / 0.1) for t0 in starts], axis=1)
    assert np.abs(seen[:, 0] - np.stack([switched(at + t0) for t0 in starts], axis=1)).max() < 1e-12
    assert np.abs(seen[:, 1] - late).max() < 3e-8  # times of bends are rounded to 10 ns, and one is at a sample
    assert seen[0, 1, 1] == pytest.approx(0.02)
    assert np.abs(seen[:, 2] - lagging).max() < 1e-4  # it is switched off within 1 ms
    own = starts + np.array([[0.0], [0.01], [0.02]])  # worlds that are seen by clocks of their own
    seen = reaching(model, each, drive, own, 0.3)["field_z"](at[:, None]).reshape(301, 3, 3)
    lagging = np.stack([0.02 * np.exp(-np.maximum(at + t0 - 1.0, 0.0) / 0.1) for t0 in own[2]], axis=1)
    assert np.abs(seen[:, 2] - lagging).max() < 1e-4
    assert np.abs(seen[:, 0] - np.stack([switched(at + t0) for t0 in own[0]], axis=1)).max() < 1e-12


def test_experiments_hold_a_drive_and_turn_the_set_up_upside_down():
    forward = driven("rest")
    trials = {t.what: t.forward for t in menu(forward, Possible(tilt=np.pi))}
    held = trials["a step of field to its highest level, held"].drives[0]["field_z"]
    assert np.abs(held(np.array([0.0, 1.3]))) == pytest.approx(0.02, rel=1e-4) and held(0.0) == held(1.3)
    turned = trials["the set-up upside down"].subject.build({})[1]
    given = forward.parameters["gravity", "gravity_z"]
    assert turned["gravity", "gravity_z"] == pytest.approx(-given) and np.all(given < 0)
    assert turned["gravity", "gravity_x"] == pytest.approx(0.0, abs=1e-9)


def test_no_segment_starts_where_its_start_is_not_seen():
    given = prepared([record(**SMALL)], 200.0)[0]
    assert len(given.times) > 260
    gap = slice(140, 240)

    def starts(names):
        channels = {
            n: replace(c, values=np.where(np.isin(np.arange(len(c.values)), np.r_[gap]), np.nan, c.values))
            if n in names
            else c
            for n, c in given.channels.items()
        }
        return [b.first for b in BarRollouts(subject(3), [replace(given, channels=channels)], segment=0.25).blocks]

    whole, some = starts([]), starts(list(given.channels)[:1])
    seen = [n for n in whole if not gap.start + 4 <= n < gap.stop - 4]
    assert len(seen) < len(whole)
    assert starts(given.channels) == some == seen, "each crease is told by its own channel only"


def test_a_drive_that_is_switched_keeps_its_instants_from_many_starts():
    """On a grid of 0.5 ms a step of the voltage was smeared, and starts that are late were driven in another way."""
    switched = series([0.0, 0.999999, 1.0, 2.0], [0.0, 0.0, 3000.0, 3000.0])
    starts = np.arange(180) / 90.0 + np.array([[0.0], [1.234e-4], [7.7e-5]])
    seen = shifted(Drive(voltage=switched), starts, 0.0333, 3).signals["voltage_0"]
    local = np.linspace(0.0, 0.0333, 7001)
    assert seen.times is not None and seen.values is not None
    for k, start in enumerate(starts.ravel()):
        wrong = np.abs(np.interp(local, seen.times, seen.values[:, k]) - switched(local + start)) > 10.0
        assert wrong.mean() * 0.0333 < 1e-5, "seconds within which the voltage is another"
