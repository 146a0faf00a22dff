"""The observer: channels of a simulated run, against the positions that they come from."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.observe import channel_frames, observe
from origami_sim.recording import Channel, Recording
from origami_sim.scene import read_calibration
from origami_sim.scenes import pendulum_chain


@pytest.fixture(scope="module")
def motion():
    s = read_calibration(pendulum_chain.CALIBRATION).replace(duration=0.5)
    return pendulum_chain.swing(s, rate=200.0)


def channel(kind, values, unit="rad", **attachment) -> Channel:
    return Channel(name="c", kind=kind, values=np.asarray(values, float), unit=unit, noise=1e-4, attachment=attachment)


def recording(times, *channels) -> Recording:
    return Recording(name="test", times=np.asarray(times, float), channels={c.name: c for c in channels})


def test_panel_angles_follow_the_direction_of_the_panel(motion):
    """Upright is 0, towards +x positive: hanging at the calibration's angle."""
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    start = read_calibration("pendulum_chain").angle_1
    assert np.cos(angle[0]) == pytest.approx(np.cos(start), abs=1e-9)
    assert np.sin(angle[0]) == pytest.approx(np.sin(start), abs=1e-9)
    assert np.abs(np.diff(angle)).max() < 0.5  # continuous
    by_number = channel_frames(motion, channel("panel_angle", [0.0], panel=1))
    np.testing.assert_array_equal(angle, by_number)


def test_crease_angle_is_that_of_the_run(motion):
    found = channel_frames(motion, channel("crease_angle", [0.0], crease=1))
    np.testing.assert_array_equal(found, motion.creases[:, 1, 0])


def test_marker_and_tip(motion):
    marker = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", node=4))
    np.testing.assert_array_equal(marker, motion.x[:, 4, 0])
    tip = channel_frames(motion, channel("tip_displacement", [0.0, 0.0], unit="m", node=4))
    np.testing.assert_allclose(tip, np.linalg.norm(marker - marker[0], axis=1), atol=1e-15)


def test_angles_start_in_the_turn_of_the_recording(motion):
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    seen = channel("panel_angle", np.full(3, angle[0] + 6 * np.pi + 0.1), panel="arm1")
    found = observe(motion, recording([7.0, 7.1, 7.2], seen))["c"]
    assert found[0] == pytest.approx(angle[0] + 6 * np.pi, abs=1e-9)


def test_frames_between_those_of_the_run_are_interpolated(motion):
    times = np.linspace(0, 0.4, 57)
    seen = channel("panel_angle", np.full(57, 2.6), panel="arm1")
    found = observe(motion, recording(times, seen))["c"]
    angle = channel_frames(motion, seen)
    np.testing.assert_allclose(found, np.interp(times, motion.times, angle), atol=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            channel("panel_angle", [0.0, 0.0], panel="arm7"),
            r"nothing of that name.*channels\.c\.panel.*arm7.*arm1, arm2",
        ),
        (channel("panel_angle", [0.0, 0.0], panel=9), r"nothing of that name.*9"),
        (channel("crease_angle", [0.0, 0.0], crease=5), r"nothing of that name.*crease.*5.*0 to 1"),
        (channel("marker", np.zeros((2, 3)), unit="m", node=999), r"nothing of that name.*node.*999"),
        (channel("marker", np.zeros((2, 3)), unit="m"), r"nothing of that name"),
    ],
)
def test_channels_that_the_model_lacks(motion, given, words):
    with pytest.raises(InputError, match=words):
        observe(motion, recording([0.0, 0.1], given))


def test_a_run_shorter_than_the_recording(motion):
    with pytest.raises(InputError, match=r"run is shorter than the recording.*0\.5.*2 s"):
        observe(motion, recording([0.0, 2.0], channel("crease_angle", [0.0, 0.0], crease=0)))
