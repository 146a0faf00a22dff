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
from origami_sim.recording import Recording

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


@pytest.mark.parametrize(("factor", "said"), [(1e3, "too long"), (1e-3, "too short")])
def test_milliseconds_that_were_read_as_seconds_are_told_before_a_search(factor, said):
    right = record(panels=2, duration=2.0, rate=100)
    mistake = found(subject(2), replace(right, times=factor * right.times))
    assert mistake is not None and mistake.sentence.startswith(f"Times are 1000 times {said}: as recorded the model")
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
