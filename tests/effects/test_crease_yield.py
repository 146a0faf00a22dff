"""A crease that yields: return map, springback and rate against closed forms, in every solver."""

import itertools
import math

import numpy as np
import pytest
from effects.kit import hinge, hinge_positions, quiet, start
from effects.test_suspects_mechanical import loss, moments, path, under
from scipy.integrate import solve_ivp

from origami_sim.design.build import Sheet
from origami_sim.device.scene import read_calibration
from origami_sim.drive import Drive, series
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.pattern import strip
from origami_sim.physics.materials import material, yielding_crease
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.motion.quasistatic import quasistatic

K, MY, REST = 0.8, 0.2, 0.1
LAWS = ["crease", "crease_yield"]


def numbers(**values):
    given = {"stiffness": K, "rest_angle": REST, "yield_moment": MY, **values}
    return {**under("crease", stiffness=K, rest_angle=REST), **under("crease_yield", **given)}


def springback(fold, hardening):
    """What is left of a fold that is let go."""
    return fold - (MY + hardening * (K * fold - MY)) / K


@pytest.mark.parametrize("hardening", [0.0, 0.25])
@pytest.mark.parametrize("step", [0.01, 0.35])
def test_a_fold_springs_back_by_its_moment_over_the_stiffness(hardening, step):
    """At any step: the map returns to the yield limit exactly."""
    fold = 1.05
    angles = path(REST, REST + fold, REST, step=step)
    m = moments(LAWS, numbers(softening=1 - hardening), angles)
    top = round(fold / step)
    up = angles[: top + 1] - REST
    assert m[: top + 1] == pytest.approx(-np.minimum(K * up, MY + hardening * (K * up - MY)), abs=1e-14)
    left = springback(fold, hardening)
    elastic = angles > REST + fold - 2 * MY / K  # shorter than until it yields backwards
    elastic[:top] = False
    assert m[elastic] == pytest.approx(-K * (angles[elastic] - REST - left), abs=1e-14)


@pytest.mark.parametrize("isotropic", [0.0, 0.4, 1.0])
def test_the_way_back_yields_by_bauschinger_or_by_both_limits_alike(isotropic):
    """Elastic range after a fold: twice the first moment, and twice the isotropic share of the hardening."""
    s, fold = 0.6, 1.2
    angles = path(REST, REST + fold, REST - 1.0, step=0.002)
    m = moments(LAWS, numbers(softening=s, isotropic=isotropic), angles)
    h = K * (1 - s) / s
    plastic = (K * fold - MY) / (K + h)
    top = round(fold / 0.002)
    back = top + np.argmax(np.diff(m[top:]) < 0.9 * K * 0.002)
    width = -(m[top] - m[back])
    assert width == pytest.approx(2 * (MY + isotropic * h * plastic), abs=2.1 * K * 0.002)
    assert np.diff(m[back + 2 :]) == pytest.approx(K * (1 - s) * 0.002, abs=1e-13)


def test_a_closed_loop_costs_what_yielding_costs():
    """Without hardening, 2 My for every turn beyond the elastic range."""
    a = 0.9
    loop = path(REST + a, REST - a, REST + a, step=0.005)
    m = moments(LAWS, numbers(softening=1.0), np.concatenate([path(REST, REST + a, step=0.005), loop[1:]]))
    assert loss(loop, m[-len(loop) :]) == pytest.approx(2 * MY * (2 * a - 2 * MY / K), rel=1e-4)


@pytest.mark.parametrize("dt", [0.05, 0.4])
def test_viscous_flow_is_exact_for_even_rates_at_any_step(dt):
    """An independent integration of Perzyna's law: loading, holding, and unloading while it still flows."""
    s, eta, isotropic = 0.7, 0.5, 0.3
    h = K * (1 - s) / s
    corners, at = np.array([0.0, 1.2, 2.0, 3.6]), np.array([0.0, 0.8, 0.8, -0.6])

    def rates(t, y):
        p, gone = y
        way = K * (np.interp(t, corners, at) - p) - (1 - isotropic) * h * p
        flow = max(abs(way) - MY - isotropic * h * gone, 0.0) / eta
        return [math.copysign(flow, way), flow]

    y, expected, times = [0.0, 0.0], [0.0], np.arange(0.0, 3.6 + 1e-9, dt)
    for a, b in itertools.pairwise(times):
        y = solve_ivp(rates, (a, b), y, rtol=1e-10, atol=1e-13, max_step=0.01).y[:, -1]
        expected.append(y[0])
    values = numbers(softening=s, viscosity=eta, isotropic=isotropic)
    model = hinge(effects=tuple(LAWS), held=(0, 1, 2, 3))
    parameters, state = quiet(model, values), start(hinge(effects=tuple(LAWS)), x=hinge_positions(REST))
    state.angles[0], found = REST, [0.0]
    batch = Batch(model, parameters, Drive(), state)
    batch.advance(0, dt, np.inf)
    for t in times[1:]:
        angle = REST + np.interp(t, corners, at)
        before = batch.state()
        x = hinge_positions(angle)[:, None]
        batch.carry(np.stack([before.x, x]), dt)
        found.append(batch.remembered()[0, 0])
    # kinematic and isotropic hardening part when the flow turns round, which happens inside a step
    assert found == pytest.approx(expected, abs=2e-9 if dt == 0.05 else 1e-8)


def device(panels):
    """A flap of 20 mm on a crease that yields at a third of the load's moment."""
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3, triangulation="center", panels=panels)
    sheet.crease(stiffness="2 mN m/rad", damping_ratio=0.3).yields(moment="0.5 mN m", hardening=0.2).fix(panels=[0])
    return sheet.set("crease_drive", drive_stiffness=1.5e-3, target_angle=1.0).build()


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_a_flap_keeps_its_fold_in_slow_and_in_full_dynamics(panels):
    model, parameters = device(panels)
    drive = Drive(load=series([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 0.0]))
    k, my, top, hardening = 2e-3, 5e-4, 1.5e-3, 0.2
    fold = my / k + (top - my) / (hardening * k)
    slow = quasistatic(model, parameters, drive, np.linspace(0.0, 3.0, 13)).creases[:, 0, 0]
    assert slow[4] == pytest.approx(fold, rel=1e-5)
    # unloaded by more than 2 My, it yields backwards: the last 2 My of moment are elastic
    left = fold - 2 * my / k - (top - 2 * my) / (hardening * k)
    assert slow[-1] == pytest.approx(left, abs=1e-5)
    if panels == "rigid":
        run = simulate(model, parameters, drive, duration=3.0, rate=4.0)
        # the ramp begins and ends at once, which throws the flap by its rate over its frequency
        frequency = np.sqrt(hardening * k / (1010 * 1e-3 * 0.02 * 0.02**3 / 3))
        assert run.creases[-1, 0, 0] == pytest.approx(left, abs=top / (hardening * k) / frequency)
        assert run.energy_error is not None and run.energy_error < 5e-3


def test_a_strip_of_sheet_springs_back_as_a_bent_plate_does():
    """Gardiner 1957, R / Rf = 4 q^3 - 3 q + 1 with q = R sigma / (E h): the crease has its limit for sharp folds."""
    modulus, sigma, width, h, length = 4.8e9, 98e6, 0.02, 1e-4, 4e-4
    k, plastic = yielding_crease(modulus, sigma, width, h, length)
    for fold, off in ((math.pi, 3e-4), (2.0, 2e-3)):
        q = length / fold * sigma / (modulus * h)
        exact = fold * (4 * q**3 - 3 * q + 1)
        assert fold - plastic / k == pytest.approx(exact, rel=off)


def test_film_and_paper_know_their_yield_moment():
    for name, stress in (("pet", 98e6), ("paper", 20e6)):
        sheet = Sheet(strip([0.01, 0.02, 0.01], 0.03), thickness="0.1 mm", material=name).crease(stiffness="2 mN m/rad")
        _, p = sheet.yields([1], hardening=0.1).build()
        assert p["crease_yield", "yield_moment"][:, 0] == pytest.approx([0.0, stress * 0.03 * 1e-8 / 4])
        assert p["crease_yield", "softening"][:, 0] == pytest.approx([0.0, 0.9])
        assert p["crease_yield", "stiffness"][:, 0] == pytest.approx(2e-3)


def test_what_is_refused_says_so_and_designs_remember():
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3).crease(stiffness="2 mN m/rad")
    with pytest.raises(InputError, match=r"panels stay elastic, only creases yield.*a crease in the pattern"):
        sheet.yields(panels=[1], moment="1 mN m")
    with pytest.raises(InputError, match="no such hardening"):
        sheet.yields(moment="1 mN m", hardening=1.0)
    with pytest.raises(InputError, match=r"moment.*N m"):
        sheet.yields(moment="1 mm")
    with pytest.raises(InputError, match="out of bounds"):
        sheet.yields(moment=-1.0).build()
    with pytest.raises(InputError, match=r"no yield stress: state the moment.*pdms.*paper, pet"):
        sheet.yields()
    with pytest.raises(InputError, match=r"a crease has no stiffness.*crease 0.*Sheet\.crease"):
        Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3, material="pet").yields().build()
    assert sheet.statements[-1] == ("yields", {"moment": -1.0})
    assert get("crease_yield").fitted[0] == "softening"


def test_the_stiffness_of_a_published_fold_goes_with_the_bending_of_its_sheet():
    """Two numbers of one test, by two routes: the fold's stiffness times its length is the film's bending rigidity."""
    s = read_calibration("fold_tests")
    plane_modulus = s.mylar_stiffness * s.mylar_length * 12 / s.mylar_thickness**3
    film = material("pet")
    assert plane_modulus == pytest.approx(film.modulus / (1 - film.poisson**2), rel=0.25)
    thick = {s.mylar_length: s.mylar_thickness, s.mylar_length_350: 0.35e-3, s.mylar_length_500: 0.5e-3}
    for length, thickness in thick.items():
        assert length / thickness == pytest.approx(200, rel=0.15)
