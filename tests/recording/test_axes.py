"""Mirrored pictures and reversed angles are found, and nothing else is taken for one."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.recording import Camera, Channel, Recording
from origami_sim.recording.axes import mistaken_axes

TIMES = np.arange(400) / 100.0
CAMERA = Camera(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, 1.0]]))
NOISE = 2e-4


def swing(length, phase=0.0):
    angle = 0.9 * np.cos(5.0 * TIMES + phase) * np.exp(-0.1 * TIMES) + 0.2
    return np.stack([length * np.sin(angle), -length * np.cos(angle)], axis=1)


TRUTH = {"tip": swing(0.3), "middle": swing(0.15, 0.2)}


def recorded(change, *, truth=None, noise=NOISE, seed=0):
    rng = np.random.default_rng(seed)
    channels = {
        n: Channel(n, "marker_2d", change(v) + rng.normal(size=v.shape) * noise, "m", noise, camera=CAMERA)
        for n, v in (truth or TRUTH).items()
    }
    return Recording("film", TIMES, channels)


CHANGES = {
    "left to right": (lambda v: v * [-1, 1] + [0.4, 0.0], "mirrored: right points the other way"),
    "upside down": (lambda v: v * [1, -1] + [0.0, 0.3], "mirrored: up points the other way"),
    "turned by 180 degrees": (lambda v: -v, "turned: right and up point the other way"),
    "exchanged": (lambda v: v[:, ::-1], "mirrored: the axes right and up are exchanged"),
    "turned by 90 degrees": (lambda v: v[:, ::-1] * [-1, 1], "turned: the axes right and up are exchanged, and"),
}


@pytest.mark.parametrize("kind", CHANGES)
def test_wrong_axes_of_a_picture_are_found_and_undone(kind):
    change, words = CHANGES[kind]
    recording = recorded(change)
    (found,) = mistaken_axes(recording, TRUTH)
    assert words in found.sentence and found.channels == ("tip", "middle")
    assert found.changed == pytest.approx(np.sqrt(2) * NOISE, rel=0.1)
    for name, channel in recording.channels.items():
        assert found.corrected(channel.values) == pytest.approx(TRUTH[name], abs=6 * NOISE)


def test_a_right_picture_is_left_alone_however_wrong_the_model_is():
    recording = recorded(lambda v: v)
    assert not mistaken_axes(recording, TRUTH)
    for phase in np.linspace(-2.0, 2.0, 9):  # out of step; in opposite phase throughout is a mirror image
        assert not mistaken_axes(recording, {"tip": swing(0.3, phase), "middle": swing(0.15, phase + 0.2)})
    assert not mistaken_axes(recording, {n: v * 1.4 for n, v in TRUTH.items()})
    assert not mistaken_axes(recording, {n: 0 * v for n, v in TRUTH.items()})
    assert not mistaken_axes(recording, {})


def test_noise_and_a_motion_along_one_line_say_nothing_of_axes():
    still = {n: 0 * v for n, v in TRUTH.items()}
    for seed in range(20):
        assert not mistaken_axes(recorded(lambda v: v, truth=still, seed=seed), still)
    line = {"tip": np.stack([0.1 * np.sin(5 * TIMES), 0 * TIMES], axis=1)}
    assert not mistaken_axes(recorded(lambda v: v * [1, -1], truth=line), line)
    (found,) = mistaken_axes(recorded(lambda v: v * [-1, 1], truth=line), line)
    assert found.order == (0, 1) and found.signs == (-1, 1)


def test_a_mirrored_picture_is_seen_through_a_model_that_is_a_tenth_off_and_through_gaps():
    recording = recorded(lambda v: v * [-1, 1])
    recording.channels["tip"].values[50:200] = np.nan
    rough = {n: v * 1.1 for n, v in TRUTH.items()}
    (found,) = mistaken_axes(recording, rough)
    assert found.signs == (-1, 1) and found.given > 5 * found.changed


def test_a_reversed_angle_and_exchanged_axes_in_space():
    angle = 0.5 * np.sin(3 * TIMES)
    place = np.stack([np.sin(3 * TIMES), np.cos(2 * TIMES), TIMES], axis=1)
    channels = {
        "fold": Channel("fold", "crease_angle", 0.1 - angle, "rad", 1e-3),
        "good": Channel("good", "crease_angle", angle, "rad", 1e-3),
        "m": Channel("m", "marker", place[:, [0, 2, 1]] * [1, 1, -1], "m", 1e-3),
    }
    found = mistaken_axes(Recording("r", TIMES, channels), {"fold": angle, "good": angle, "m": place})
    assert [f.channels for f in found] == [("fold",), ("m",)]
    assert "counted the other way round" in found[0].sentence
    assert found[1].corrected(channels["m"].values) == pytest.approx(place)
    assert found[1].sentence.startswith("Channel m: the frame of reference is turned: the axes y and z are exchanged")


def test_a_prediction_of_another_shape_is_refused():
    with pytest.raises(InputError, match=r"predicted\.tip.*\(400, 2\)"):
        mistaken_axes(recorded(lambda v: v), {"tip": TRUTH["tip"][:, 0]})
