"""Mistakes in the channels of a recording end a diagnosis with a sentence, and nothing else does."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from strips import record, subject
from test_curves import COUPON, REST, SETTINGS, K, torque

from origami_sim.diagnose import Options, Subject, diagnose
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.axes import missed, mistaken
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.mistakes import clocked, driven, scaled, slips
from origami_sim.recording import Recording
from tests.diagnose import slow_motions

ONE = Options(threads=1)


def found(of: Subject, recording: Recording):
    return mistaken(of, [recording], ONE, arranged(of, [recording], ONE)[0])


def with_values(recording: Recording, values) -> Recording:
    channels = {n: replace(c, values=values[n]) for n, c in recording.channels.items()}
    return replace(recording, channels=channels)


def test_a_torque_that_is_counted_the_other_way_round_is_no_physics():
    coupon = Subject.from_scene(COUPON, SETTINGS, spreads={"stiffness": 0.2 * K, "rest_angle": 0.02})
    right = torque(lambda q: K * (q - REST) + 0.3 * K * (q - REST) ** 3)
    wrong = with_values(right, {"moment": -right.channels["moment"].values})
    d = diagnose(coupon, wrong, ONE)
    assert d.verdict == "UNTESTABLE" and not d.chosen and not d.patch
    assert "Channel moment: the reading is counted the other way round" in d.sentence and "sign = -1" in d.sentence
    assert diagnose(coupon, right, ONE).verdict == "MECHANISM"  # a wrong law is no wrong sign


@pytest.mark.parametrize("exchange", [False, True])
def test_exchanged_channels_are_told_from_a_missing_effect(exchange):
    strip = subject(3)
    recording = record({"crease_friction": {"friction_moment": (4e-6, [0])}}, panels=3, duration=3.0)
    names = list(recording.channels)
    assert found(strip, recording) is None
    if exchange:
        other = dict(zip(names, reversed(names), strict=True))
        mistake = found(strip, with_values(recording, {n: recording.channels[other[n]].values for n in names}))
        assert mistake is not None and mistake.given > 3.0 * mistake.changed
        assert f"Channels {names[0]} and {names[1]} are exchanged" in mistake.sentence


CLOCKS = [
    (1e3, "1000 times too long, as ms stated as s"),
    (1.0 / 60.0, "60 times too short, as min stated as s"),
    (1e-3, "1000 times too short:"),
]


@pytest.mark.parametrize(("factor", "said"), CLOCKS)
def test_milliseconds_that_were_read_as_seconds_are_told_before_a_search(factor, said):
    right = record(panels=2, duration=2.0, rate=100)
    mistake = found(subject(2), replace(right, times=factor * right.times))
    assert mistake is not None and mistake.sentence.startswith(f"Times are {said}")
    assert "[time]" in mistake.sentence and found(subject(2), right) is None


def test_a_recording_of_another_device_is_no_mistake_of_axes():
    recording = record(panels=3, duration=3.0)
    noise = {n: np.random.default_rng(k).normal(size=len(recording.times)) for k, n in enumerate(recording.channels)}
    assert found(subject(3), with_values(recording, noise)) is None


def test_a_model_that_goes_unstable_explains_nothing():
    """As a slow gait does whose times are read as a thousandth of what they are."""
    blocks = [SimpleNamespace(values=np.array([[0.0], [2.0]]), noise=np.ones(1))]
    subject = SimpleNamespace(nominals=())
    for one, given in ((np.nan, np.inf), (1.0, 1.0)):
        lost = SimpleNamespace(
            subject=subject, blocks=blocks, local=0, predict=lambda *_, v=one: [np.full((1, 2, 1), v)]
        )
        assert missed(cast(Any, lost)) == (given, 1.0)


def test_a_clock_that_the_model_as_given_hides_shows_once_it_is_refitted():
    slow = clocked(1e3)(record(panels=2, duration=1.0, rate=100))
    forward = arranged(subject(2), [slow], ONE)[0]
    mistake = mistaken(subject(2), [slow], ONE, forward, nominal_fits(forward)[1])
    assert mistake is not None and "as recorded the refitted model misses" in mistake.sentence
    assert mistake.sentence.startswith("Times are 1000 times too long") and mistake.changed < 1.5


def test_degrees_that_were_stated_as_radians_are_no_scale():
    right = record(panels=2, duration=1.0, rate=100)
    names = list(right.channels)
    wrong = replace(scaled(names, 180.0 / np.pi)(right), metadata={"units": dict.fromkeys(names, "rad")})
    mistake = found(subject(2), wrong)
    assert mistake is not None and "57.3 times too large, as deg stated as rad" in mistake.sentence
    assert 'State unit = "deg" of the channel' in mistake.sentence and mistake.changed < 2.0
    for off in (0.2, 0.5, 2.0, 5.0):
        assert found(subject(2), scaled(names, off)(right)) is None


def test_radians_that_were_stated_as_degrees_are_told_by_a_drive():
    right = slow_motions.recording(slow_motions.angles(slow_motions.times()))
    mistake = found(slow_motions.flap(), scaled(["fold"], np.pi / 180.0)(right))
    assert mistake is not None and "57.3 times too small" in mistake.sentence


CASES = [(1e3, {}, "too large, as mT stated as T"), (1e-3, {"branch": 1e-4}, "too small: as recorded")]


@pytest.mark.parametrize(("factor", "missing", "said"), CASES)
def test_a_drive_in_another_unit_is_no_gain(factor, missing, said):
    right = slow_motions.recording(slow_motions.angles(slow_motions.times(), **missing))
    mistake = found(slow_motions.flap(), driven("field", factor)(right))
    assert mistake is not None and mistake.sentence.startswith(f"Drive field is 1000 times {said}")
    assert "under [drive.field]" in mistake.sentence


@pytest.mark.parametrize("off", [0.0, 0.2, 5.0])
def test_a_drive_that_is_off_by_a_factor_is_no_mistaken_unit(off):
    right = slow_motions.recording(slow_motions.angles(slow_motions.times()))
    assert found(slow_motions.flap(), driven("field", off)(right)) is None


def test_a_drive_that_was_switched_off_is_no_mistaken_unit():
    still = slow_motions.recording(slow_motions.angles(slow_motions.times(), level=0.0))
    drive = slow_motions.recording(slow_motions.angles(slow_motions.times())).drive
    assert found(slow_motions.flap(), replace(still, drive=drive)) is None


def test_pixels_have_no_unit_to_mistake():
    right = record(panels=2, duration=1.0, rate=100)
    pixels = replace(right, metadata={"units": dict.fromkeys(right.channels, "px")})
    of = [[s.what for s in slips(r, None) if "reading is" in s.what and "times too" in s.what] for r in (right, pixels)]
    assert len(of[0]) == 2 and not of[1]
