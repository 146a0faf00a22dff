"""Markers in a picture: what the diagnosis reads of them, and a camera that stands too near."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim.diagnose import diagnose
from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.observation.attachments import body_point
from origami_sim.observation.observe import observe
from origami_sim.predict.bars import BarRollouts
from origami_sim.recording import Camera, Channel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import hanging, subject

NEAR, NOISE = 0.3, 5e-5
SIDE = Camera(np.array([0.0, 0.015, -0.05]), np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]))
"""It sees the strip, which swings along x, from between front and side: folds come towards it, and their sign shows."""


def swing(*, distance: float = np.inf, duration: float = 3.0, noise: float = NOISE) -> tuple[Recording, object]:
    """A strip of three panels as a pinhole camera at a distance sees two corners of each moving panel."""
    model, parameters = hanging(3)
    arm, rng = Articulation(model), np.random.default_rng(0)
    state = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), np.array([[0.8], [-0.5]])))[:, 0])
    motion = simulate(model, parameters, Drive(), duration=duration, rate=100, state=state)
    channels = {}
    for n, (panel, side) in enumerate([(1, -1.0), (1, 1.0), (2, -1.0), (2, 1.0)]):
        attached = {"panel": panel, "point": [0.0, 0.012 * side, 0.0]}
        name = f"m{n}"
        channel = Channel(name, "marker_2d", np.zeros((len(motion.times), 2)), "m", noise, attached, SIDE)
        x, y, z = (body_point(model, motion.x[:, :, 0], channel) - SIDE.origin).T
        away = distance - (0.8 * x - 0.6 * y)
        larger = 1.0 if distance == np.inf else distance / away
        seen = np.stack([0.6 * x + 0.8 * y, z], axis=1) * np.reshape(larger, (-1, 1))
        seen += noise * rng.normal(size=seen.shape)
        channels[name] = Channel(name, "marker_2d", seen, "m", noise, attached, SIDE)
    return Recording("picture", motion.times, channels), motion


def near(forward: BarRollouts) -> Hypothesis:
    every = suspects(forward.model, forward.recordings, forward.drive)
    return Hypothesis((next(s for s in every if s.label == "perspective at the measurement"),))


@pytest.mark.parametrize("distance", [np.inf, NEAR])
def test_pictures_are_what_a_pinhole_camera_sees_of_the_markers(distance):
    """To rounding, beside the same motion read as markers in space."""
    recording, _ = swing(distance=distance, duration=0.4, noise=1e-7)
    forward = BarRollouts(subject(3), [recording], start="fit")
    nominal = [f.start for f in forward.subject.nominals]
    theta = np.array([*nominal, 1 / distance, 0.01, -0.02])
    (seen,) = forward.predict(near(forward), theta[None])
    spatial = {
        n: replace(c, kind="marker", camera=None, values=np.zeros((len(recording.times), 3)))
        for n, c in recording.channels.items()
    }
    beside = BarRollouts(subject(3), [replace(recording, channels=spatial)], start="fit")
    beside.blocks[0] = replace(beside.blocks[0], pose=forward.blocks[0].pose, rates=forward.blocks[0].rates)
    (whole,) = beside.predict(Hypothesis(), np.array([nominal]))
    x, y, z = np.moveaxis(whole[0].reshape(len(recording.times), 4, 3) - SIDE.origin, 2, 0)
    larger = 1 / (1 - (0.8 * x - 0.6 * y) / distance)
    exact = np.stack([0.01 + (0.6 * x + 0.8 * y - 0.01) * larger, -0.02 + (z + 0.02) * larger], axis=2)
    np.testing.assert_allclose(seen[0], exact.reshape(len(exact), 8), atol=1e-12)


def test_a_run_is_observed_through_a_near_camera():
    recording, motion = swing(distance=NEAR, duration=0.4, noise=1e-9)
    model = motion.model.with_effects("perspective")
    motion.model, parameters = model, motion.parameters.for_model(model)
    parameters.set("perspective", "nearness", 1 / NEAR)
    motion.parameters = parameters
    for name, values in observe(motion, recording).items():
        np.testing.assert_allclose(values, recording.channels[name].values, atol=1e-8)


def test_perspective_is_suspected_of_pictures_only():
    recording, _ = swing(duration=0.4)
    forward = BarRollouts(subject(3), [recording], start="fit")
    sites = [s.site for s in suspects(forward.model, [recording], forward.drive) if s.effect == "perspective"]
    assert sites == ["the measurement", *(f"channel m{n}" for n in range(4))]
    assert get("perspective").channels == ("marker_2d",)
    angle = Channel("fold", "crease_angle", np.zeros(41), "rad", 1e-3, {"crease": 0})
    folds = Recording("folds", recording.times, {"fold": angle})
    assert "perspective" not in {s.effect for s in suspects(forward.model, [folds], forward.drive)}


@pytest.mark.slow
def test_a_camera_that_is_too_near_is_named_with_its_distance():
    recording, _ = swing(distance=NEAR)
    catalogue = ("perspective", "length_scale", "camera_tilt", "crease_friction", "crease_stiffening")
    found = diagnose(subject(3), [recording], catalogue=catalogue)
    assert found.verdict == "MEASUREMENT" and found.chosen[0].startswith("perspective")
    number = next(n for n in found.candidates[0].numbers if n.label == "perspective.nearness")
    assert 1 / number.value == pytest.approx(NEAR, rel=0.1)
