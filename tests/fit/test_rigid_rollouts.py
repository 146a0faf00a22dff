"""Predictions by rigid panels: tied segments of noise-free swings, devices that float, and bars that become stiff."""

from copy import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from origami_sim import diagnose
from origami_sim.design.build import Sheet
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import Subject
from origami_sim.drive import Drive, sine
from origami_sim.fit.least_squares import fit
from origami_sim.fit.predictor import Prediction
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis, scaled
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.unlisted import anywhere
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import rigid
from origami_sim.pattern import strip
from origami_sim.predict import cache, chained, memories, rollouts
from origami_sim.predict import rigid as predicted
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import hanging, subject
from tests.predict.test_switches import flap

NOISE, RATE = 1e-3, 100.0


def swung(model, parameters, *, duration=1.5, push=None) -> Recording:
    """Fold angles of a swing of rigid panels, without noise."""
    model, parameters = rigid(model, parameters)
    arm = Articulation(model)
    start = np.resize([0.9, -0.7, 0.8], arm.size)[:, None]
    state = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), start))[:, 0])
    made = simulate(model, parameters, push or Drive(), duration=duration, rate=RATE, state=state, tolerance=1e-10)
    channels = {
        f"fold{c}": Channel(f"fold{c}", "crease_angle", made.creases[:, c, 0], "rad", NOISE, {"crease": c})
        for c in range(made.creases.shape[1])
    }
    return Recording("swing", made.times, channels)


SHARP = 1e-6
"""What exact data are weighed by, in the channels' units and as a part of usual rates: far below the noise."""


def fitted(forward, **options):
    deviation = np.full(len(forward.components), SHARP)
    return fit(forward, Hypothesis(), Weights(deviation, gap=SHARP), most=20, done=0.0, **options)


def gap_of(f) -> float:
    """The largest gap between segments, as a part of what coordinates and rates usually change by."""
    return SHARP * max(
        np.abs(r[w.data + w.start :]).max(initial=0.0) for w, r in zip(f.linear.rows, f.linear.residual, strict=True)
    )


@pytest.fixture(scope="module")
def tied() -> RigidRollouts:
    return RigidRollouts(subject(3), [swung(*hanging(3))], segment=0.3)


def test_all_frames_are_compared_and_each_segment_begins_where_the_one_before_ends(tied):
    (recording,) = tied.recordings
    firsts = [b.first for b in tied.blocks]
    assert len(firsts) == 5 and firsts == list(np.cumsum([0, *(len(b.times) for b in tied.blocks)])[:-1])
    assert sum(b.seen().sum() for b in tied.blocks) == 2 * len(recording.times)
    assert [b.reach is not None for b in tied.blocks] == [True] * 4 + [False]
    for b, after in pairwise(tied.blocks):
        assert b.lasting == pytest.approx(recording.times[after.first] - recording.times[b.first])


@pytest.mark.parametrize("effect", ["", "crease_friction"])
def test_predictions_are_the_same_bytes_on_any_number_of_threads(tied, monkeypatch, effect):
    """Also where the segments are rolled out in several parts, and laws remember what was before them."""
    monkeypatch.setattr(rollouts, "TOGETHER", 10)  # three segments of three worlds
    every = tied.admitted(suspects(tied.model, tied.recordings, tied.drive, tied.parameters))
    h = Hypothesis(tuple(s for s in every if s.effect == effect and s.entities is None))
    free = [*tied.subject.nominals, *h.free]
    thetas = np.array([[f.start + k * f.scale for f in free] for k in range(3)])
    made = []
    for threads, processes in ((1, 1), (2, 1), (5, 1), (1, 2), (1, 4)):
        monkeypatch.setattr(tied, "threads", threads)
        for module in (rollouts, memories):
            monkeypatch.setattr(module, "sharing", lambda processes=processes: processes)
        for known in (tied._moved, tied._films, tied._beside):
            known.clear()
        made.append(tied.shoot(h, thetas, np.zeros((3, len(tied.blocks), tied.local))))
    assert bool(effect) == bool(len(h.suspects)) and len(made[0].values) == len(tied.blocks)
    for other in made[1:]:
        for a, b in zip((*made[0].values, *made[0].ends[:-1]), (*other.values, *other.ends[:-1]), strict=True):
            assert a is not None and b is not None and a.tobytes() == b.tobytes()


@pytest.mark.parametrize("effect", ["crease_friction", "angle_scale"])
def test_a_point_that_was_just_simulated_is_the_same_bytes_among_other_worlds(tied, effect):
    suspect = next(s for s in suspects(tied.model, tied.recordings, tied.drive) if s.effect == effect)
    hypothesis = Hypothesis((suspect,))
    theta = np.array([f.start for f in (*tied.subject.nominals, *suspect.free)])
    theta[len(tied.subject.nominals)] += suspect.free[0].scale
    worlds = np.repeat(theta[None], 3, axis=0)
    worlds[1, 0] *= 1.01
    worlds[2, len(tied.subject.nominals)] += suspect.free[0].scale
    local = np.zeros((3, len(tied.blocks), tied.local))
    tied._films.clear()
    together = tied.shoot(hypothesis, worlds, local)
    tied._films.clear()
    alone = tied.shoot(hypothesis, worlds[:1], local[:1])
    again = tied.shoot(hypothesis, worlds, local)
    for a, b, c in zip(together.values, again.values, alone.values, strict=True):
        assert np.array_equal(a, b) and np.array_equal(b[0], c[0])
    assert all(a is b or np.array_equal(a, b) for a, b in zip(together.ends, again.ends, strict=True))


def test_worlds_that_were_followed_are_not_simulated_again(tied, monkeypatch):
    """Their films, of friction and of mass that differ, are those of segments alone, but for rounding."""
    friction = next(s for s in suspects(tied.model, tied.recordings, tied.drive) if s.effect == "crease_friction")
    theta = np.array([f.start for f in (*tied.subject.nominals, *friction.free)])
    worlds = np.repeat(theta[None], 3, axis=0)
    worlds[:, len(tied.subject.nominals)] += friction.free[0].scale * np.array([1.0, 2.0, 1.0])
    worlds[2, 0] *= 1.01
    local = np.zeros((3, len(tied.blocks), tied.local))
    simulated, made = [], tied._simulated
    monkeypatch.setattr(tied, "_simulated", lambda shots: simulated.append(len(shots.worlds)) or made(shots))

    def shot():
        for known in (tied._moved, tied._films, tied._beside, simulated):
            known.clear()
        return tied.shoot(Hypothesis((friction,)), worlds, local)

    found, once = shot(), set(simulated)
    for module in (chained, predicted):
        monkeypatch.setattr(module, "channels_of", lambda *_: None)
    anew, every = shot(), set(simulated)
    assert once == set() and every == {3}
    for a, b in zip((*found.values, *found.ends[:-1]), (*anew.values, *anew.ends[:-1]), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_a_fit_of_what_is_exact_leaves_rounding(tied, monkeypatch):
    monkeypatch.setattr(tied, "blur", 1e-9)
    f = fitted(tied, fixed=True)
    assert not f.failed
    assert max(np.abs(r).max() for r in f.residuals) < 1e-7
    assert gap_of(f) < 1e-7
    (ends,) = tied.shoot(Hypothesis(), f.theta[None], f.local[None], [1]).ends
    assert ends[0] == pytest.approx(f.local[2], abs=1e-5)


def test_ends_tell_where_the_next_segment_starts_whatever_its_own_start_is(tied):
    """The shift of a start by as much as a motion missed it makes both meet."""
    starts = np.zeros((1, len(tied.blocks), tied.local))
    starts[0, 0] = [0.02, -0.01, 0.3, 0.2]
    first = tied.shoot(Hypothesis(), [np.ones(3)], starts)
    starts[0, 1] = first.ends[0][0]
    whole = RigidRollouts(subject(3), tied.recordings)
    own = starts[:, :1].copy()
    long = whole.shoot(Hypothesis(), [np.ones(3)], own).values[0][0]
    second = tied.shoot(Hypothesis(), [np.ones(3)], starts, [1]).values[0][0]
    n = tied.blocks[1].first
    assert np.abs(long[n : n + len(second)] - second).max() < 1e-6


@pytest.mark.parametrize("effect", [None, "crease_friction"])
def test_what_steps_of_the_solver_miss_shows_in_no_data(tied, monkeypatch, effect):
    """In standard deviations of all data together, of a swing without and with a friction of 0.1 mN m."""
    every = suspects(tied.model, tied.recordings, tied.drive)
    some = tuple(s for s in every if s.effect == effect)[:1]
    theta = np.array([f.start + f.scale * (f.name == "friction_moment") for s in some for f in s.free])
    theta = np.concatenate([np.ones(3), theta])
    found = []
    for finer in (1.0, 1e-3):
        monkeypatch.setattr(tied, "blur", finer * tied.blur)
        for known in (tied._moved, tied._films, tied._beside):
            known.clear()
        found.append(tied.predict(Hypothesis(some), [theta], np.zeros((1, len(tied.blocks), tied.local))))
    missed = [(a[0] - b[0]) / block.noise for a, b, block in zip(*found, tied.blocks, strict=True)]
    assert 0.0 < np.linalg.norm(np.concatenate(missed)) < (0.15 if effect else 0.003)  # 0.08 and 0.0012


def test_numbers_are_found_to_rounding_and_better_where_segments_are_tied():
    model, parameters = hanging(3)
    parameters.set("crease", "stiffness", 1.03 * parameters["crease", "stiffness"])
    recording = swung(model, parameters)
    known = subject(3)
    known = replace(known, nominals=known.nominals[:1])
    found = {}
    for tied in (True, False):
        forward = RigidRollouts(known, [recording], segment=0.3, tied=tied)
        forward.blur = 1e-9
        f = fitted(forward)
        assert f.theta[0] == pytest.approx(1.03, abs=0.1 * f.deviations()[0])
        found[tied] = f.deviations()[0]
    assert found[True] < 0.7 * found[False]  # 0.62


def test_a_segment_with_an_effect_meets_the_next_one_too(tied):
    """Friction slows each segment down: what is predicted with it, tied and in one piece, is the same."""
    every = suspects(tied.model, tied.recordings, tied.drive, tied.parameters)
    one = next(s for s in every if s.effect == "air_drag" and s.entities is None)
    theta = np.array([1.0, 1.0, 1.0, 0.8])
    hypothesis = Hypothesis((one,))
    starts = np.zeros((1, len(tied.blocks), tied.local))
    for b in range(len(tied.blocks) - 1):
        starts[0, b + 1] = tied.shoot(hypothesis, [theta], starts, [b]).ends[0][0]
    pieces = np.concatenate([v[0] for v in tied.predict(hypothesis, [theta], starts)])
    whole = RigidRollouts(tied.subject, tied.recordings).predict(hypothesis, [theta])[0][0]
    assert np.abs(pieces - whole).max() < 1e-5
    assert np.abs(whole - tied.recordings[0].channels["fold0"].values[:, None]).max() > 0.05


def test_a_clock_that_runs_fast_or_slow_is_told_of_tied_segments():
    """By its clock a segment lasts longer than it is recorded to: the next one begins there."""
    recording, rate = swung(*hanging(3)), 0.02
    slow = replace(recording, times=recording.times / (1.0 + rate))
    forward = RigidRollouts(replace(subject(3), nominals=()), [slow], segment=0.3)
    clock = next(s for s in suspects(forward.model, [slow], forward.drive) if s.effect == "clock_rate")
    weights = Weights(np.full(2, SHARP), gap=SHARP)
    f = fit(forward, Hypothesis((clock,)), weights, most=20, done=0.0)
    # films are read between frames, 0.1 rad of a swing apart
    assert f.theta[0] == pytest.approx(rate, rel=2e-3)
    assert gap_of(f) < 1e-4 and max(np.abs(r).max() for r in f.residuals) < 2e-4


def test_a_floating_device_is_followed_through_its_turns():
    """Two panels that are tossed, by markers: six coordinates of the root and a fold, tied as well."""
    sheet = Sheet(strip([0.03, 0.02], 0.02), thickness=1.5e-3, modulus=1.5e6, triangulation="center")
    sheet.crease(stiffness=2e-4).set("crease_viscosity", viscosity=1e-6)
    sheet.gravity((0.0, 0.0, -9.81))
    model, parameters = rigid(*sheet.build())
    state = State.at_rest(model, position=model.position)
    centre = model.position.mean(axis=0)
    spin, throw = np.array([3.0, -8.0, 5.0]), np.array([0.1, 0.2, 2.0])
    state.v[:, 0] = np.cross(spin, model.position - centre) + throw
    made = simulate(model, parameters, duration=0.6, rate=200.0, state=state, tolerance=1e-10)
    channels = {f"m{n}": Channel(f"m{n}", "marker", made.x[:, n, 0], "m", 1e-4, {"node": n}) for n in range(6)}
    forward = RigidRollouts(
        Subject.from_model(*sheet.build(), Drive()), [Recording("toss", made.times, channels)], segment=0.15
    )
    assert forward.articulation.floating and forward.local == 14 and len(forward.blocks) == 4
    assert all(b.reach is not None for b in forward.blocks[:-1])
    f = fitted(forward, fixed=True)
    assert max(np.abs(r).max() for r in f.residuals) < 1e-8
    assert gap_of(f) < 1e-6


def test_bars_become_rigid_panels_as_they_stiffen():
    """With the masses at the same nodes, what panels yield falls as one over their stiffness."""
    recording, apart = swung(*hanging(3), duration=0.3), []
    model, parameters = hanging(3)
    parameters.set("body", "mass", 0.0)  # masses stay at the nodes, where those of bars are
    stiff = RigidRollouts(Subject.from_model(model, parameters), [recording])
    seen = stiff.predict(Hypothesis(), [np.zeros(0)])[0][0]
    for factor in (1.0, 10.0):
        harder = parameters.copy()
        for key in (("bars", "stiffness"), ("panel_bending", "stiffness")):
            harder.set(*key, factor * parameters[key])
        bars = BarRollouts(Subject.from_model(model, harder), [recording])
        apart.append(np.abs(bars.predict(Hypothesis(), [np.zeros(0)])[0][0] - seen).max())
    assert apart[1] < 0.2 * apart[0] and apart[0] < 3 * NOISE


def test_laws_remember_the_simulated_motion_where_a_segment_starts():
    """Dry friction: segments that are tied predict what the whole motion does, from starts and memory alike."""
    model, parameters = hanging(3)
    richer = model.with_effects("crease_friction")
    rubbing = parameters.for_model(richer).set("crease_friction", "friction_moment", 2e-5)
    forward = RigidRollouts(subject(3), [swung(richer, rubbing)], segment=0.3)
    friction = next(
        s
        for s in suspects(forward.model, forward.recordings, forward.drive)
        if s.effect == "crease_friction" and s.entities is None
    )
    weights = Weights(np.full(len(forward.components), NOISE), gap=1e-3)
    begin = np.array([1.0, 1.0, 1.0, 2e-5, 0.01])
    f = fit(forward, Hypothesis((friction,)), weights, theta=begin, fixed=True, most=20)
    left = np.concatenate(f.residuals)
    assert len(forward.blocks) == 5 and np.abs(left).max() < 0.15 * NOISE


def test_worlds_side_by_side_remember_their_own_motion():
    """A panel that comes to rest against dry friction: of worlds that yield later, each stays where it stopped."""
    model, parameters = hanging(2)
    richer = model.with_effects("crease_friction")
    rubbing = parameters.for_model(richer).set("crease_friction", "friction_moment", 1e-4)
    forward = RigidRollouts(subject(2), [swung(richer, rubbing, duration=2.0)], segment=0.3)
    assert np.ptp(forward.blocks[-1].values) < 1e-3 < np.ptp(forward.blocks[0].values), "it does not come to rest"
    friction = next(
        s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == "crease_friction"
    )
    thetas = [np.array([1.0, 1.0, 1.0, 1e-4, angle]) for angle in (0.01, 0.011, 0.02)]
    together = forward.predict(Hypothesis((friction,)), thetas)
    for k, theta in enumerate(thetas):
        for values, alone in zip(together, forward.predict(Hypothesis((friction,)), [theta]), strict=True):
            np.testing.assert_allclose(values[k], alone[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["mass_1", "centre_1", "centre_2", "inertia_1", "inertia_2", "length_1"])
def test_every_number_of_a_body_moves_what_is_predicted(name):
    """Worlds whose bodies have other centres and inertia, side by side, move as each does by itself."""
    module = scene_module("pendulum_chain")
    settings = scene_settings(module)
    times = np.arange(61) / RATE
    still = {
        f"theta{k}": Channel(f"theta{k}", "panel_angle", np.full(61, np.pi - 0.3 * k), "rad", NOISE, {"panel": k})
        for k in (1, 2)
    }
    value = float(settings[name].value)
    forward = RigidRollouts(
        Subject.from_scene(module, settings, spreads={name: 0.01 * value}), [Recording("still", times, still)]
    )
    given, other = np.array([value]), np.array([1.02 * value])
    both = forward.predict(Hypothesis(), [given, other])
    alone = forward.predict(Hypothesis(), [other])
    for two, one in zip(both, alone, strict=True):
        assert two[1] == pytest.approx(one[0], abs=1e-9)
        assert np.abs(two[1] - two[0]).max() > 1e-4


def test_a_stored_prediction_is_of_the_numbers_that_were_asked_for(tied, tmp_path, monkeypatch):
    """Two numbers of one effect at one crease, of the same value."""
    monkeypatch.setattr(cache, "WORTH", 0.0)
    forward = copy(tied)
    _, *others = anywhere(forward)
    one, other = (scaled(s, [1e-4]) for s in others[:2])
    assert (one.effect, one.entities) == (other.effect, other.entities) and one.free[0].name != other.free[0].name

    def predicted(s) -> np.ndarray:
        theta = [f.start for f in (*forward.subject.nominals, *s.free)]
        theta[len(forward.subject.nominals)] = 1e-4
        return np.concatenate(forward.predict(Hypothesis((s,)), np.array([theta])), axis=1)

    fresh = [predicted(s) for s in (one, other)]
    forward.cache = cache.Cache(tmp_path)
    for _ in range(2):
        assert all(np.array_equal(predicted(s), f) for s, f in zip((one, other), fresh, strict=True))
    assert not np.allclose(*fresh, atol=1e-9) and forward.cache.found == 2


@pytest.mark.parametrize(("effect", "spread"), [("exposure", 12**-0.5), ("tracker_lag", 1.0)])
def test_a_filter_of_the_recorder_goes_on_from_segment_to_segment(effect, spread):
    """Each first frame is smoothed as all others: by half of its variance times the acceleration, after the delay."""
    forward = RigidRollouts(subject(3), [swung(*hanging(3))])
    every = suspects(forward.model, forward.recordings, forward.drive)
    (one,) = (s for s in every if s.effect == effect and s.site == "the measurement")
    plain = forward.predict(Hypothesis(), np.ones((1, 3)))
    smooth = forward.predict(Hypothesis((one,)), np.array([[1.0, 1.0, 1.0, 0.003]]))
    for block, a, b in zip(forward.blocks, plain, smooth, strict=True):
        expected = 0.5 * (spread * 0.003) ** 2 * CubicSpline(block.times, a[0])(block.times, 2)
        assert np.abs((b - a)[0] - expected)[:5].max() < 0.3 * np.abs(expected).max()


@pytest.mark.parametrize("effect", ["", "clock_rate", "exposure", "angle_scale"])
def test_segments_of_a_clock_that_trembles_are_filmed_together_and_read_at_their_own_times(effect):
    exact = swung(*hanging(3), duration=3.0)
    rng = np.random.default_rng(2)
    times = exact.times + 0.05 / RATE * rng.normal(size=len(exact.times)) * (np.arange(len(exact.times)) > 0)
    curves = {n: CubicSpline(exact.times, c.values)(times) for n, c in exact.channels.items()}
    channels = {n: replace(c, values=curves[n]) for n, c in exact.channels.items()}
    forward = RigidRollouts(subject(3), [replace(exact, times=times, channels=channels)], segment=0.5, threads=1)
    every = suspects(forward.model, forward.recordings, forward.drive)
    some = tuple(s for s in every if s.label == f"{effect} at the measurement")
    strength = {"clock_rate": 0.01, "exposure": 4e-3, "angle_scale": 0.02}.get(effect)
    theta = np.array([[f.start for f in forward.subject.nominals] + [strength] * (strength is not None)])
    local = 1e-2 * rng.normal(size=(1, len(forward.blocks), forward.local))
    together = forward.shoot(Hypothesis(some), theta, local)
    m = forward.articulation.size
    usual = np.concatenate([np.full(m, NOISE), 1e-3 * forward.readings.usual_rates(0)])
    for b, values in enumerate(together.values):
        alone = forward.shoot(Hypothesis(some), theta, local, [b])
        assert np.abs(values - alone.values[0]).max() < 0.05 * NOISE  # 0.025
        if (ends := together.ends[b]) is not None:
            assert np.abs((ends - alone.ends[0]) / usual).max() < 0.8  # 0.62


def test_predictions_lie_in_memory_as_stored_ones_do(tmp_path, monkeypatch):
    """So that a diagnosis that goes on finds the same to the last digit: sums follow the order of memory."""
    monkeypatch.setattr(cache, "WORTH", -1.0)
    forward = RigidRollouts(subject(2), [swung(*hanging(2))], segment=0.3)
    forward.cache = cache.Cache(tmp_path)
    theta = np.array([f.start for f in forward.subject.nominals])[None]
    odd = np.ones((1, 9, 50)).transpose(1, 2, 0)  # contiguous, and yet of other strides
    monkeypatch.setattr(forward, "_shot", lambda *_: Prediction([odd], [odd[:, :, 0]]))
    new, known = (forward.shoot(Hypothesis(), theta, blocks=[0]) for _ in range(2))
    assert forward.cache.found == forward.cache.computed == 1
    for a, b in ((new.values[0], known.values[0]), (new.ends[0], known.ends[0])):
        assert a is not None and b is not None and a.strides == b.strides == np.empty(a.shape).strides


def test_a_driven_segment_is_predicted_alike_whichever_others_were_before():
    """A drive is sampled alike for all segments that are simulated together: films of some are not those of all."""
    truth = Drive(field=(0.0, 0.0, sine(8e-3, 3.0)))
    motion = simulate(*flap(), truth, duration=3.0, rate=90.0)
    log = np.arange(0.0, 3.1, 0.0137)  # of the field, by a clock of its own
    field = np.stack([truth["field_z"](log)] * 3, axis=1) * [0.0, 0.0, 1.0]
    fold = Channel("fold", "crease_angle", motion.creases[:, 0, 0], "rad", NOISE, {"crease": 0})
    recording = Recording("r", motion.times, {"fold": fold}, {"field": DriveChannel("field", field, "T", False, log)})
    of = Subject.from_model(*flap(), None, [diagnose.factor("crease.stiffness", 0.05)])
    theta = np.array([[1.01]])
    alone, later = (RigidRollouts(of, [recording], segment=0.1) for _ in range(2))
    local = 1e-4 * np.ones((1, len(alone.blocks), alone.local))
    whole = alone.shoot(Hypothesis(), theta, local)
    for b in range(len(later.blocks)):
        later.shoot(Hypothesis(), theta, local, blocks=[b])
    again = later.shoot(Hypothesis(), theta, local)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(whole.values, again.values, strict=True))


def test_a_late_clock_beside_friction_is_a_late_drive_of_what_rests():
    """What friction remembers where a segment starts is that of a motion under the drive as it came, by any clock."""
    truth = Drive(field=(0.0, 0.0, sine(8e-3, 1.5)))
    motion = simulate(*flap(), truth, duration=2.0, rate=90.0)
    log = np.arange(0.0, 2.1, 0.002)
    field = np.stack([truth["field_z"](log)] * 3, axis=1) * [0.0, 0.0, 1.0]
    fold = Channel("fold", "crease_angle", motion.creases[:, 0, 0], "rad", NOISE, {"crease": 0})
    recording = Recording("r", motion.times, {"fold": fold}, {"field": DriveChannel("field", field, "T", False, log)})
    of = Subject.from_model(*flap(), None, [diagnose.factor("crease.stiffness", 0.05)])
    forward = RigidRollouts(of, [recording], segment=0.3)
    every = suspects(forward.model, forward.recordings, forward.drive)
    friction, drive, clock = (
        next(s for s in every if s.effect == name) for name in ("crease_friction", "drive_delay", "clock_delay")
    )
    theta = np.array([[1.0, 3e-5, 0.01, 0.02]])
    late, same = (forward.predict(Hypothesis((friction, s)), theta) for s in (drive, clock))
    inner = range(1, len(forward.blocks) - 1)
    assert max(np.abs(late[b] - same[b]).max() for b in inner) < 1e-3 * NOISE
    none = forward.predict(Hypothesis((friction, drive)), theta * [1.0, 1.0, 1.0, 0.0])
    assert max(np.abs(late[b] - none[b]).max() for b in inner) > 5.0 * NOISE
