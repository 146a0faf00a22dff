"""Starts that an experimenter states: they reach the prediction, and are checked against the data."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Sheet, simulate, strip
from origami_sim.diagnose import Subject, factor
from origami_sim.errors import InputError
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording import Channel, Recording, Start
from tests.diagnose.strips import record, subject

RELEASED = record(panels=3, duration=1.0, rate=100, noise=1e-3)


def first_block(recording: Recording):
    return RigidRollouts(subject(3), [recording], segment=0.3).blocks[0]


def stating(**start) -> Recording:
    return replace(RELEASED, start=Start(**start))


def test_what_is_released_has_no_rates_and_stated_angles():
    read = first_block(RELEASED).pose.angles[0, 0]
    block = first_block(stating(state="released", angles={"0": read + 1e-3}, sd=5e-3))
    m = len(block.rates)
    assert not np.any(block.rates) and block.pose.angles[0, 0] == pytest.approx(read + 1e-3)
    assert block.known[0] == 5e-3 and block.known[1] == 1.0  # nothing is stated of the second
    assert np.all(block.known[m:] < 0.1 * first_block(RELEASED).known[m:]), "what it gains in a frame of 10 ms"


def test_a_hand_may_let_go_up_to_a_frame_late():
    """Frames that are half as far apart tell the instant, and so the rates, twice as well."""
    coarse = replace(record(panels=3, duration=1.0, rate=100, noise=1e-3), start=Start("released"))
    fine = replace(record(panels=3, duration=1.0, rate=200, noise=1e-3), start=Start("released"))
    sd = [first_block(r).known[-2:] for r in (coarse, fine)]
    assert sd[0] == pytest.approx(2.0 * sd[1], rel=0.1)  # 2.02 and 2.16: rates are read from fewer frames


def test_a_stated_rate_is_as_well_known_as_it_says():
    block = first_block(stating(state="released", rate_sd=0.02))
    np.testing.assert_allclose(block.known[len(block.rates) :], 0.02)


def test_what_is_moving_is_read():
    moving, plain = first_block(stating(state="moving")), first_block(RELEASED)
    np.testing.assert_array_equal(moving.rates, plain.rates)
    np.testing.assert_array_equal(moving.known, plain.known)


def test_an_equilibrium_is_the_models_and_not_the_flat_sheet():
    hung = record(panels=3, duration=1.0, rate=100, noise=1e-3, size=0.0)
    block = first_block(replace(hung, start=Start("equilibrium")))
    assert not np.any(block.rates)
    np.testing.assert_allclose(block.pose.angles, 0.0, atol=1e-6)  # a strip that hangs straight rests so
    assert np.all(block.known[: len(block.rates)] < 0.05)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ({"state": "released", "angles": {"0": 0.2}, "sd": 1e-3}, "contradict the stated start"),
        ({"state": "released", "angles": {"lid": 0.2}, "sd": 1e-3}, "no such crease"),
        ({"state": "equilibrium"}, "contradict the stated start"),
    ],
)
def test_a_start_that_cannot_be_is_one_sentence(start, said):
    with pytest.raises(InputError, match=said):
        first_block(stating(**start))


def test_a_start_at_rest_of_what_moves_is_refused():
    late = record(panels=3, duration=1.0, rate=100, noise=5e-5).only(slice(20, None))
    with pytest.raises(InputError, match=r"contradict a start at rest: crease 0 moves at 2\.28 rad/s"):
        first_block(replace(late, start=Start("released")))
    # eight frames of more noise do not tell, and longer windows may bend: the rates are free as far as these say
    noisy = record(panels=3, duration=1.0, rate=100, noise=1e-3).only(slice(20, None))
    found, read = (first_block(replace(noisy, start=Start(state))) for state in ("released", "moving"))
    m = len(read.rates)
    assert np.any(np.abs(read.rates) > 0.3) and not np.any(found.rates)
    assert np.all(found.known[m:] > 0.5 * np.abs(read.rates))


def sagging(noise: float = 1e-4):
    """A heavy flap on a lossy crease that sags from flat within 30 ms and then rests, at 100 frames per second."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, material="pet", panels="rigid").fix(panels=[0])
    model, parameters = sheet.crease(stiffness=2e-3, loss_time=0.01).gravity((0, 0, -9.80665)).build()
    run = simulate(model, parameters, duration=2.0, rate=100)
    fold = run.creases[:, 0, 0] + noise * np.random.default_rng(3).standard_normal(len(run.times))
    channel = Channel("fold", "crease_angle", fold, "rad", noise, {"crease": 0})
    recording = Recording("sag", run.times, {"fold": channel})
    known = Subject.from_model(model, parameters, None, [factor("crease.stiffness", 0.05)])
    return known, replace(recording, start=Start("released"))


def test_what_the_model_shows_after_a_release_does_not_contradict_it():
    """A sag that is over within the windows from which rates are read, of a device that hardly moves later."""
    known, recording = sagging()
    read = RigidRollouts(known, [recording], segment=0.5).readings.slowest(0)
    assert np.abs(read.rates[0]) > 6 * read.error[0] + 0.1
    block = RigidRollouts(known, [recording], segment=0.5).blocks[0]
    assert not np.any(block.rates) and block.known[1] < np.abs(read.rates[0])
