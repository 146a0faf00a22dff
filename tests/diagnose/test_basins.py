"""What snaps: fits of it end in many basins, and the loss that calms it is found all the same."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Drive, diagnose, ramp, simulate
from origami_sim.device.scene import read_calibration
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Free, Subject
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.basins import calmest, settled
from origami_sim.infer.profile import several
from origami_sim.observation.observe import observe
from origami_sim.predict.bars import BarRollouts
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.scenes import magnetic_arch as arch

NOISE, DECAY, MODULUS = 0.1e-3, 30.0, 4.05e6
"""Of the readings [m]; loss of the made object [1/s], and its modulus [Pa], where 4.2 MPa is thought."""

SUSPECTS = ("mass_damping", "field_hysteresis", "length_scale", "tracker_lag")


@pytest.fixture(scope="module")
def settings():
    coarse = {"cells": 8.0, "rows": 2.0, "triangulation": "diagonal", "relaxing_modulus": 0.0, "clamp_tilt": 1e-3}
    return read_calibration("magnetic_arch").replace(**coarse)


def recorded(settings, name, end, duration):
    """A ramp of the field, or a step, of an arch with a loss, its midspan read at 100 frames per second."""
    model, parameters, _ = arch.build(settings.replace(modulus=MODULUS, decay_rate=DECAY))
    drive = Drive(field=(0.0, 0.0, ramp(end, duration) if name == "ramp" else end))
    run = simulate(model, parameters, drive, duration=duration, rate=400)
    times = np.arange(0.0, duration, 0.01)
    along = {"node": "midspan", "direction": [0.0, 0.0, -1.0]}
    channel = Channel("midspan", "tip_displacement", np.zeros(len(times)), "m", NOISE, along)
    values = np.array([0.0, end]) if name == "ramp" else np.array([end, end])
    field = DriveChannel(
        "field", np.outer(values, [0.0, 0.0, 1.0]), "T", constant=False, times=np.array([0.0, duration])
    )
    bare = Recording(name, times, {"midspan": channel}, {"field": field}, {})
    seen = observe(run, bare)["midspan"] + NOISE * np.random.default_rng(3).normal(size=len(times))
    return replace(bare, channels={"midspan": replace(channel, values=seen)})


@pytest.fixture(scope="module")
def recordings(settings):
    return [recorded(settings, "step", 7.5e-3, 0.3), recorded(settings, "ramp", 9e-3, 0.6)]


@pytest.fixture(scope="module")
def subject(settings):
    return Subject(
        lambda values: arch.build(settings.replace(**values)),
        (Free("", "modulus", "Pa", settings.modulus, 1e5, 1e6, 1e7, 0.1 * settings.modulus),),
    )


@pytest.mark.slow
def test_a_loss_that_calms_an_arch_is_found_where_no_derivative_promises_it(recordings, subject):
    forward = BarRollouts(subject, recordings, start="rest")
    given, base, _ = nominal_fits(forward)
    assert base.rms()[0] > 5 * NOISE
    better, rough = settled(forward, base)
    assert rough and better.rms()[0] <= base.rms()[0]
    every = forward.admitted(suspects(forward.model, recordings, forward.drive, forward.parameters))
    every = [s for s in every if s.effect in SUSPECTS]
    calm = calmest(forward, every, given, better)
    assert calm is not None
    best = min(calm.fits.values(), key=lambda f: f.cost)
    assert [s.effect for s in best.hypothesis.suspects] == ["mass_damping"]
    assert best.theta == pytest.approx([MODULUS, DECAY], rel=0.05)
    assert best.rms()[0] < 1.2 * NOISE


def test_one_minimum_is_told_from_several():
    x = np.linspace(-1.0, 2.0, 41)
    for smooth in (100 * x**2, np.abs(x), x, np.full(41, 3.0)):
        assert not several(smooth)
    assert several(100 * x**2 + 20 * np.cos(30 * x)) and not several(100 * x**2 + 0.1 * np.cos(30 * x))
    assert not several(np.where(x < 0.5, 3.0 - x, np.inf))
    assert several(np.where(np.abs(x) < 0.1, np.inf, 3.0))


@pytest.mark.slow
def test_the_diagnosis_of_an_arch_names_its_loss(recordings, subject):
    found = diagnose(subject, recordings, catalogue=SUSPECTS)
    assert found.verdict == "MECHANISM" and found.chosen == ["mass_damping at the body"]
    (number,) = [n for n in found.candidates[0].numbers if n.label.endswith("decay_rate")]
    assert number.low < DECAY < number.high
    assert found.error_after[0] < 1.3 * NOISE < found.error_before[0]
