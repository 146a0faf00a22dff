"""What begins at rest: where the model starts, in its own equilibrium, and displacements since then."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Drive, Sheet, equilibrium, quasistatic, simulate
from origami_sim.device.scene import read_calibration
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Subject, Suspect
from origami_sim.model import State
from origami_sim.model.model_file import model_tables, read_model
from origami_sim.observation.observe import observe
from origami_sim.pattern import strip
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.rollouts import resting
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.results.run_folder import load_run, save_run
from origami_sim.scenes import magnetic_arch as arch

MM = 1e-3


@pytest.fixture(scope="module")
def bent():
    """A fold that its crease holds at 40 degrees, which starts there though its pattern is flat."""
    s = Sheet(strip([10 * MM] * 2, 20 * MM), thickness=0.5 * MM).fix(panels=[0])
    s.crease(stiffness=1e-3, rest_angle=np.radians(40), loss_time=1e-3)
    model, parameters = s.build()
    return replace(model, start=equilibrium(model, parameters).x), parameters


@pytest.fixture(scope="module")
def settings():
    coarse = {"cells": 8.0, "rows": 2.0, "triangulation": "diagonal", "relaxing_modulus": 0.0}
    return read_calibration("magnetic_arch").replace(**coarse)


def measured(values=None, field=5e-3, duration=0.06, count=31):
    """Midspan of the arch, downwards, in a field that is switched on at the first frame."""
    times = np.linspace(0, duration, count)
    along = {"node": "midspan", "direction": [0.0, 0.0, -1.0]}
    channel = Channel("midspan", "tip_displacement", np.zeros(count) if values is None else values, "m", 1e-5, along)
    drive = DriveChannel("field", np.array([0.0, 0.0, field]), "T", constant=True)
    return Recording("made", times, {"midspan": channel}, {"field": drive}, {})


def test_motions_and_equilibria_begin_where_the_model_starts(bent):
    model, parameters = bent
    assert np.array_equal(State.at_rest(model).x[:, 0], model.start)
    assert np.degrees(equilibrium(model, parameters).angles[0]) == pytest.approx(40.0)
    still = simulate(model, parameters, duration=0.02, rate=100)
    assert np.abs(still.x[-1, :, 0] - model.start).max() < 1e-9
    slow = quasistatic(model, parameters, Drive(), [0.0, 1.0])
    assert np.abs(slow.x[0, :, 0] - model.start).max() < 1e-9
    flat = replace(model, start=np.zeros((0, 3)))
    assert np.ptp(simulate(flat, parameters, duration=0.02, rate=100).creases) > 0.1
    assert flat.hash != model.hash and flat.with_effects("gravity").start.size == 0
    assert np.array_equal(model.with_effects("gravity").start, model.start)


def test_a_start_is_kept_in_files(bent, tmp_path):
    model, parameters = bent
    run = simulate(model, parameters, duration=0.01, rate=100)
    again = load_run(save_run(tmp_path / "run", run, scene="bent", replay=False).path).trajectory.model
    assert again.hash == model.hash and np.array_equal(again.start, model.start)
    tables = model_tables(model, parameters)
    read, _ = read_model({**tables, "parameters": {}}, tmp_path / "design.toml")
    assert np.array_equal(read.start, model.start)


def test_the_arch_starts_buckled_and_stays_so_without_a_field(settings):
    model, parameters, _ = arch.build(settings.replace(mode="step"))
    height = float(arch.midspan(model, model.begins))
    still = simulate(model, parameters, Drive(), duration=0.02, rate=100)
    assert height > 3.5 * MM
    assert np.abs(arch.midspan(model, still.x[:, :, 0]) - height).max() < 1e-6


def test_every_world_begins_in_its_own_equilibrium(settings):
    """Another shortening, or an effect that acts without a drive, has another shape at rest; none moves at first."""
    short = Free("", "shortening", "m", settings.shortening, 1e-5, spread=1e-4)

    def build(values):
        return arch.build(settings.replace(**values))

    subject = Subject(build, (short,))
    forward = BarRollouts(subject, [measured(field=0.0)], start="rest")
    weight = Free("gravity", "gravity_z", "m/s^2", 0.0, 1.0)
    heavy = Hypothesis((Suspect("gravity", "the body", "body", (weight,)),))
    for hypothesis, theta in ((Hypothesis(), [0.47e-3]), (Hypothesis(), [0.6e-3]), (heavy, [0.47e-3, -0.1])):
        (values,) = forward.predict(hypothesis, np.array([theta]))
        assert np.abs(values).max() < 1e-6
    given, other = (resting(*forward.world(heavy, np.array([0.47e-3, g]), ("gravity",))) for g in (0.0, -0.1))
    assert arch.midspan(forward.model, other) < arch.midspan(forward.model, given) - 1e-5


def test_what_is_predicted_from_rest_is_what_a_run_shows(settings):
    recording = measured()
    subject = Subject(lambda values: arch.build(settings), ())
    (found,) = BarRollouts(subject, [recording], start="rest").predict(Hypothesis(), np.zeros((1, 0)))
    model, parameters, _ = arch.build(settings)
    run = simulate(model, parameters, Drive(field=(0.0, 0.0, 5e-3)), duration=0.06, rate=500)
    shown = observe(run, recording)["midspan"]
    assert np.ptp(shown) > 1 * MM
    np.testing.assert_allclose(found[0, :, 0], shown, atol=1e-3 * np.ptp(shown))


def test_worlds_may_be_cut_into_parts_to_the_last_bit(settings):
    """Also where one of them asks for shorter steps than the others, or is another shape."""
    numbers = [Free("", n, "", settings[n].value, 1.0, spread=1.0) for n in ("shortening", "modulus")]

    def build(values):
        return arch.build(settings.replace(**values))

    def predicted(threads):
        subject = Subject(build, tuple(numbers))
        forward = BarRollouts(subject, [measured()], start="rest", threads=threads)
        thetas = [[0.47e-3, 4.2e6], [0.5e-3, 4.2e6], [0.47e-3, 8e6]]
        return forward.predict(Hypothesis(), np.array(thetas))[0]

    assert np.array_equal(predicted(1), predicted(2))
