"""Quasi-static motions of feet that stick and slip, against closed forms and the full dynamics.

A tent of two rigid legs on a crease, with magnets that raise it in a field, stands on feet whose friction differs
forward and backward. Whichever pair slips goes forward, against mu W / 2 of the lesser friction: so the legs' slope
follows from virtual work, and the way of a cycle from the change of the span less what bristles give way at its turns.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from origami_sim import Drive, Sheet, quasistatic, simulate, sine
from origami_sim.model import State
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import MATERIALS
from origami_sim.solve.statics.held import Held

LEG, WIDTH, THICKNESS, SLOPE, K, FIELD, MU = 0.02, 0.012, 5e-4, np.pi / 6, 3e-4, 0.01, 0.2
MOMENT = 0.1 * 60e-9 / (4e-7 * np.pi)
WEIGHT = 2 * MATERIALS["pet"].density * LEG * WIDTH * THICKNESS * 9.80665


def tent(panels, backward=0.6):
    x, z = LEG * np.cos(SLOPE), LEG * np.sin(SLOPE)
    points = [(a, y * WIDTH / 2, b) for a, b in ((-x, 0), (0, z), (x, 0)) for y in (-1, 1)]
    sheet = Sheet(assemble(points, [(0, 2, 3, 1), (2, 4, 5, 3)]), thickness=THICKNESS, material="pet", panels=panels)
    sheet.crease(stiffness=K)
    for panel, way in ((0, 1), (1, -1)):
        sheet.magnetise(panel, remanence="0.1 T", volume="60 mm^3", poling=(way * x, 0, z))
    sheet.feet([0, 1, 4, 5], height=0, friction=MU, backward=backward).ground(nodes=(), friction=MU)
    return sheet


def slope_at(field: float, way: float) -> float:
    """Slope of the legs in a field [T] while their span grows (way 1), shrinks (-1), or without friction (0)."""

    def moment(a):  # minus the derivative of the energy by the slope, and of the friction's work
        fall = WEIGHT * (LEG / 2 * np.cos(a) - THICKNESS / 2 * np.sin(a))
        spread = 2 * (LEG * np.sin(a) + THICKNESS / 2 * np.cos(a))
        return -4 * K * (a - SLOPE) - fall + 2 * MOMENT * field * np.cos(a) + way * MU * WEIGHT / 2 * spread

    return brentq(moment, 0.1, 1.0)


@pytest.fixture(scope="module", params=["rigid", "elastic"])
def cycles(request):
    """Two cycles of a second each, with 60 frames to a cycle, and the tangential stiffness of a foot."""
    model, parameters = tent(request.param).build()
    run = quasistatic(model, parameters, Drive(field=(0, 0, sine(FIELD, 1.0))), np.linspace(0, 2, 121))
    return run, float(parameters["friction", "stiffness"].mean())


def test_slipping_legs_stand_as_virtual_work_says(cycles):
    """A spring that drags its feet over the ground; within 1e-5 of its slope with bars that stretch."""
    run, _ = cycles
    assert not run.failures and not run.jumps
    slope = np.abs(run.creases[:, 0, 0]) / 2
    for frame, way in ((70, -1), (73, -1), (82, 1), (90, 1), (102, 1), (110, -1), (118, -1)):
        expected = slope_at(FIELD * np.sin(2 * np.pi * frame / 60), way)
        assert abs(expected - slope_at(FIELD * np.sin(2 * np.pi * frame / 60), 0)) > 1e-3  # friction counts
        assert slope[frame] == pytest.approx(expected, rel=3e-5)


def test_a_cycle_goes_on_by_the_change_of_span(cycles):
    """Each pair of feet is held back by twice its bristles' stretch at both turns."""
    run, stiffness = cycles
    span = run.x[60:, 4, 0, 0] - run.x[60:, 0, 0, 0]
    slope = np.abs(run.creases[60:, 0, 0]) / 2
    feet = np.ptp(span - THICKNESS * np.sin(slope))
    stride = np.diff(run.centre_of_mass()[::60, 0, 0])[-1]
    stretch = MU * WEIGHT / 4 / stiffness
    assert stride == pytest.approx(feet - 4 * stretch, rel=1e-4)
    lost = run.work["friction"][120, 0] - run.work["friction"][60, 0]
    assert lost == pytest.approx(-MU * WEIGHT / 2 * 2 * (feet - 2 * stretch), rel=3e-3)


def test_a_slow_walk_is_that_of_the_dynamics():
    model, parameters = tent("rigid").build()
    drive = Drive(field=(0, 0, sine(FIELD, 0.25)))
    slow = quasistatic(model, parameters, drive, np.linspace(0, 8, 121))
    full = simulate(model, parameters, drive, duration=8.0, rate=15.0)
    strides = [np.diff(run.centre_of_mass()[::60, 0, 0]) for run in (slow, full)]
    assert strides[0][1] == pytest.approx(strides[1][1], rel=5e-4)


def test_equal_feet_go_nowhere():
    """All feet slip at once, and nothing resists a slip of the whole."""
    model, parameters = tent("elastic", backward=None).build()
    run = quasistatic(model, parameters, Drive(field=(0, 0, sine(FIELD, 1.0))), np.linspace(0, 1, 31))
    assert not run.failures
    assert np.ptp(np.abs(run.creases[:, 0, 0])) > 0.2
    assert np.abs(run.centre_of_mass()[:, 0, 0]).max() < 1e-7


def test_feet_slip_where_others_are_held():
    """Feet that are held pull with what the others slip against: the same slopes."""
    model, parameters = tent("elastic", backward=None).fix(nodes=[0, 1], axes="x").build()
    run = quasistatic(model, parameters, Drive(field=(0, 0, sine(FIELD, 1.0))), np.linspace(0, 1, 61))
    assert not run.failures
    for frame, way in ((10, -1), (30, 1), (50, -1)):
        expected = slope_at(FIELD * np.sin(2 * np.pi * frame / 60), way)
        assert abs(run.creases[frame, 0, 0]) / 2 == pytest.approx(expected, rel=1e-3)


def test_friction_remembers_the_slip_at_any_length_of_the_step():
    """Dashpots of the ground have no share in it: within 1e-12 s they would tear the feet off."""
    model, parameters = tent("elastic").build()
    start = State.at_rest(model)
    held = Held(model, parameters, Drive(), start)
    start.x[..., 2] -= 3e-6
    moved = start.x + np.array([1e-7, 0.0, 1e-6])
    forces = [held.force(start, moved, dt, 0.0) for dt in (1e-12, 1e-3, 1e3)]
    assert np.abs(forces[0][..., 0]).max() > 0
    assert forces[0] == pytest.approx(forces[2], abs=1e-15) and forces[1] == pytest.approx(forces[2], abs=1e-15)
