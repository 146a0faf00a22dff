"""A marker that is not where it was said to be on its panel."""

import re
from dataclasses import replace

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.diagnose import Subject, diagnose
from origami_sim.diagnose.arrange import arranged, starting
from origami_sim.diagnose.options import Options
from origami_sim.diagnose.prepare import prepared
from origami_sim.drive import Drive, ramp
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import rigid
from origami_sim.observation.observe import observe
from origami_sim.pattern import strip
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording import Camera, Channel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import hanging, subject

NOISE = 1e-4


def filmed(lift: float, down: float) -> Recording:
    """A swing of two panels in a picture; the last marker is lifted off its panel (x), and glued too high (z).

    Panels are rigid, as the diagnosis takes them: those of bars move the place along the panel by 13 um in the mean of
    six drawings, as much as its interval is wide to either side.
    """
    model, parameters = rigid(*hanging(3))
    arm, rng = Articulation(model), np.random.default_rng(0)
    start = arm.positions(arm.moved(arm.reference(), np.array([[0.9], [-0.7]])))[:, 0]
    made = simulate(model, parameters, Drive(), duration=3.0, rate=100, state=State.at_rest(model, position=start))
    camera = Camera(np.zeros(3), np.eye(3)[[0, 2]])

    def recorded(last: dict) -> Recording:
        blank = np.zeros((len(made.times), 2))
        places = {"m1": {"panel": 1, "point": [0.0, 0.0, -0.012]}, "m2": {"panel": 2} | last}
        channels = {n: Channel(n, "marker_2d", blank, "m", NOISE, at, camera=camera) for n, at in places.items()}
        return Recording("film", made.times, channels)

    true = observe(made, recorded({"point": [0.0, 0.0, -0.012 + down], "height": lift}))
    said = recorded({"point": [0.0, 0.0, -0.012]})
    seen = {n: replace(c, values=true[n] + NOISE * rng.normal(size=c.values.shape)) for n, c in said.channels.items()}
    return replace(said, channels=seen)


@pytest.mark.parametrize(
    "lift, down, words",
    [
        (1.5e-3, 0.5e-3, r"offset x 1\.[45]"),
        pytest.param(0.0, 1.5e-3, r"offset z 1\.[45]", marks=pytest.mark.slow),
    ],
)
def test_a_marker_beside_its_place_is_the_measurement(lift, down, words):
    """Whatever the direction: each component is screened by itself, and the one that is told best is named."""
    recording = filmed(lift, down)
    every = suspects(hanging(3)[0], [recording], Drive())
    assert [s.site for s in every if s.effect == "marker_offset"] == ["channel m1", "channel m2"]
    wrong = ("marker_offset", "length_offset", "length_scale", "crease_offset")
    found = diagnose(subject(3), [recording], catalogue=wrong)
    assert found.verdict == "MEASUREMENT" and found.chosen[0] == "marker_offset at channel m2"
    assert re.search(words, found.sentence)
    numbers = {n.label: n for n in found.candidates[0].numbers}
    for axis, truth in (("x", lift), ("z", down)):
        n = numbers[f"marker_offset.offset_{axis}"]
        assert n.value == pytest.approx(truth, abs=2e-5) and n.low < truth < n.high


def test_a_marker_beside_its_place_and_a_wrong_origin_add_up():
    """Of the marker that is in its place only the origin is wrong."""
    recording = filmed(1.5e-3, 0.5e-3)
    forward, _ = arranged(subject(3), prepared([recording], 200.0), Options())
    every = suspects(forward.model, [recording], forward.drive)
    beside, origin = (next(s for s in every if s.effect == e) for e in ("marker_offset", "length_offset"))
    values = {beside.free: [1e-3, 0.0, 0.0], origin.free: [2e-3, 0.0, 0.0]}

    def predicted(*some: Suspect) -> np.ndarray:
        given = [f.start for f in forward.subject.nominals]
        theta = np.array([*given, *(v for s in some for v in values[s.free])])
        shot = forward.predict(Hypothesis(some), theta[None], np.zeros((1, len(forward.blocks), forward.local)))
        return np.concatenate([v[0] for v in shot])

    none, both = predicted(), predicted(beside, origin)
    np.testing.assert_allclose(both - none, predicted(beside) + predicted(origin) - 2.0 * none, atol=1e-12)
    assert np.all(np.abs(both - none).max(axis=0)[[0, 2]] > 1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_markers_that_scatter_across_the_plane_of_the_motion_do_not_hide_that_it_began_at_rest(seed):
    model, parameters = hanging(3)
    loaded = model.with_effects("load")
    pushed = parameters.for_model(loaded).set("load", "force_x", 2e-3, [int(np.argmin(model.position[:, 2]))])
    push = Drive(load=ramp(1.0, 1.0))
    made = simulate(loaded, pushed, push, duration=1.0, rate=100)
    rng, nodes = np.random.default_rng(seed), np.argsort(model.position[:, 2])[:4]
    channels = {
        f"n{n}": Channel(
            f"n{n}", "marker", made.x[:, n, 0] + NOISE * rng.normal(size=(101, 3)), "m", NOISE, {"node": int(n)}
        )
        for n in nodes
    }
    subject = Subject.from_model(loaded, pushed, push)
    assert starting(subject, [Recording("pushed", made.times, channels)]) == "rest"


def test_a_marker_from_a_hinge_stays_on_its_body_beside_worlds_of_other_lengths():
    """Worlds of several lengths run in one batch: each is read by its own geometry, as where it runs alone."""

    def build(values):
        lengths = [0.02, values["length"], 0.04]
        sheet = Sheet(strip(lengths, 0.02), thickness=1e-3, panels="rigid").crease(stiffness=1e-3)
        model, parameters = sheet.name("crease", ["upper", "lower"]).fix(panels=[0]).build()
        return model, parameters, Drive()

    free = Free("nominal", "length", "m", 0.05, 1e-3, spread=1e-3)
    times = np.arange(60) / 100.0
    at = {"panel": 1, "from": "upper", "distance": 0.03}
    flat = np.tile([0.05, 0.01, 0.0], (60, 1))
    recording = Recording("film", times, {"m": Channel("m", "marker", flat, "m", NOISE, at)})
    forward = RigidRollouts(Subject(build, (free,), "device", build), [recording])
    one, other = np.array([0.05]), np.array([0.055])
    beside, alone = (forward.shoot(Hypothesis(), thetas) for thetas in ([one, other], [other]))
    assert np.array_equal(beside.values[0][1], alone.values[0][0])
    assert np.abs(beside.values[0][1] - beside.values[0][0]).max() < 1e-16, "flat, it is where it was"
