"""Quasi-static motions with a clock, against closed forms, exact integrals and the full dynamics."""

import numpy as np
import pytest
from effects.kit import slope
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from structures import truss

from origami_sim import Drive, Sheet, equilibrium, miura, quasistatic, ramp, series, simulate, strip
from origami_sim.errors import InputError
from origami_sim.solve.motion.quasistatic import knots

K, BRANCH, TIME, MOMENT = 2e-3, 3e-3, 7.0, 1e-3
"""A standard linear solid: spring, spring of the Maxwell branch [N m/rad], its time [s]; and a moment upon it [N m]."""

RETARDATION = TIME * (K + BRANCH) / K


def hinge(panels="rigid", *effects, **relaxation):
    """A panel on a crease of a held one; the load is a moment upon it."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, panels=panels)
    sheet.fix(panels=[0]).crease(stiffness=K).on("crease_drive", *effects)
    sheet.set("crease_drive", drive_stiffness=MOMENT, target_angle=1.0)
    if relaxation is not None and "crease_relaxation" in effects:
        sheet.set("crease_relaxation", **(relaxation or {"stiffness_1": BRANCH, "time_1": TIME}))
    return sheet.build()


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_a_hinge_creeps_as_a_standard_linear_solid(panels):
    model, parameters = hinge(panels, "crease_relaxation")
    times = np.concatenate([[0.0], np.geomspace(0.5, 300.0, 20)])
    run = quasistatic(model, parameters, Drive(load=1.0), times)
    expected = MOMENT / K - (MOMENT / K - MOMENT / (K + BRANCH)) * np.exp(-times / RETARDATION)
    # bars give way as well, and by that much they turn further at all times
    close = 1e-4 if panels == "rigid" else 1e-4 + 0.01 * expected[-1]
    assert np.abs(run.creases[:, 0, 0] - expected).max() < close
    assert run.creases[0, 0, 0] == pytest.approx(MOMENT / (K + BRANCH), rel=1e-9 if panels == "rigid" else 0.01)
    assert not run.failures and not run.jumps


def test_a_smooth_ramp_is_followed_to_second_order():
    model, parameters = hinge("rigid", "crease_relaxation")
    end, errors, intervals = 20.0, [], np.array([10, 20, 40, 80])
    lag = (1 - K / (K + BRANCH)) * RETARDATION
    for n in intervals:
        t = np.linspace(0.0, end, n + 1)
        run = quasistatic(model, parameters, Drive(load=ramp(1.0, end)), t, tolerance=None)
        expected = MOMENT / end / K * (t - lag * (1 - np.exp(-t / RETARDATION)))
        errors.append(np.abs(run.creases[:, 0, 0] - expected).max())
    assert slope(1.0 / intervals, errors) == pytest.approx(2.0, abs=0.1)


def test_steps_follow_their_tolerance():
    model, parameters = hinge("rigid", "crease_relaxation")
    times = np.array([0.0, 60.0, 300.0])
    expected = MOMENT / K - (MOMENT / K - MOMENT / (K + BRANCH)) * np.exp(-times / RETARDATION)
    runs = [quasistatic(model, parameters, Drive(load=1.0), times, tolerance=t) for t in (1e-4, 1e-6)]
    errors = [np.abs(r.creases[:, 0, 0] - expected).max() for r in runs]
    assert errors[0] < 1e-3 and errors[1] < 1e-5
    assert runs[0].steps < runs[1].steps


def test_a_moment_relaxes_at_a_held_angle():
    """A hinge that is 1e6 times as stiff holds the angle; what is missing to the first moment has relaxed."""
    model, parameters = hinge("rigid", "crease_relaxation")
    stiff = 1e6 * K
    parameters.set("crease", "stiffness", stiff)
    parameters.set("crease_drive", "drive_stiffness", 0.3 * stiff)
    times = np.array([0.0, 3.0, 10.0, 100.0])
    run = quasistatic(model, parameters, Drive(load=1.0), times)
    angle = run.creases[:, 0, 0]
    assert angle == pytest.approx(0.3, rel=1e-5)
    # balance: stiff (0.3 - angle) is the branch's moment
    held = stiff * (0.3 - angle)
    assert held == pytest.approx(BRANCH * 0.3 * np.exp(-times / TIME), rel=1e-3, abs=1e-3 * BRANCH)


def test_everything_has_relaxed_where_the_device_had_rested():
    model, parameters = hinge("rigid", "crease_relaxation")
    rested = quasistatic(model, parameters, Drive(load=1.0), [0.0, 5.0], before=Drive(load=1.0))
    assert rested.creases[:, 0, 0] == pytest.approx(MOMENT / K, rel=1e-9)
    times = np.array([0.0, 10.0, 1e3])
    recovering = quasistatic(model, parameters, Drive(load=0.0), times, before=Drive(load=1.0))
    left = MOMENT / K - MOMENT / (K + BRANCH)
    assert recovering.creases[:, 0, 0] == pytest.approx(left * np.exp(-times / RETARDATION), abs=1e-4)


def test_slow_polarisation_follows_a_ramp_exactly():
    """A tenth of the moment follows the rest with a time constant: linear in the square of the voltage."""
    model, parameters = hinge("rigid", "maxwell_stress", "dielectric_relaxation")
    stack = {"permittivity": 4.5, "layer_thickness": 5e-5, "layers": 1.0, "lever": 5e-4, "width": 0.02}
    for owner in ("maxwell_stress", "dielectric_relaxation"):
        for name, value in stack.items():
            parameters.set(owner, name, value)
    parameters.set("dielectric_relaxation", "slow_share", 0.1).set("dielectric_relaxation", "polarisation_time", 40.0)
    t = np.linspace(0.0, 100.0, 26)
    volts = series(np.linspace(0.0, 100.0, 2001), 1500.0 * np.sqrt(np.linspace(0.0, 1.0, 2001)))
    run = quasistatic(model, parameters, Drive(voltage=volts), t, tolerance=None)
    fast = equilibrium(model.with_effects(without=("dielectric_relaxation",)), parameters, Drive(voltage=1500.0)).angles
    part = fast[0] / 100.0
    expected = part * t + 0.1 * part * (t - 40.0 * (1 - np.exp(-t / 40.0)))
    assert np.abs(run.creases[:, 0, 0] - expected).max() < 1e-9


def test_a_slow_supply_is_sampled_over_an_hour():
    """Lag of the supply over an hour, with a step of the voltage between two frames."""
    model, parameters = hinge("rigid", "maxwell_stress", "voltage_lag")
    for name, value in {"permittivity": 4.5, "layer_thickness": 5e-5, "layers": 1.0, "lever": 5e-4}.items():
        parameters.set("maxwell_stress", name, value)
    parameters.set("maxwell_stress", "width", 0.02).set("voltage_lag", "lag", 9.0)
    t = np.array([0.0, 90.0, 103.0, 110.0, 120.0, 150.0, 600.0, 3600.0])
    volts = series([0.0, 100.0, 100.001, 3600.0], [0.0, 0.0, 1500.0, 1500.0])
    run = quasistatic(model, parameters, Drive(voltage=volts), t)
    full = equilibrium(model.with_effects(without=("voltage_lag",)), parameters, Drive(voltage=1500.0)).angles[0]
    expected = full * np.where(t < 100, 0.0, 1 - np.exp(-(t - 100.0) / 9.0)) ** 2
    assert np.abs(run.creases[:, 0, 0] - expected).max() < 1e-6


def test_the_full_dynamics_agree_where_the_ramp_is_slow():
    model, parameters = hinge("rigid", "crease_relaxation", "crease_viscosity", stiffness_1=BRANCH, time_1=0.2)
    parameters.set("crease_viscosity", "viscosity", 2e-6)
    drive = Drive(load=ramp(1.0, 1.0))
    run = simulate(model, parameters, drive, duration=1.5, rate=20.0)
    slow = quasistatic(model, parameters, drive, run.times)
    assert np.abs(run.creases - slow.creases).max() < 1e-3 * slow.creases.max() + 2e-6 / K
    assert np.abs(slow.creases - np.interp(run.times, [0, 1, 1.5], [0, 0.5, 0.5])[:, None, None]).max() > 0.05


def test_rounded_hysteresis_follows_its_equation():
    """Bouc-Wen: loops of the moment, and the angle from an independent integration."""
    model, parameters = hinge("rigid", "crease_hysteresis")
    mh, s0 = 5e-4, 0.1
    parameters.set("crease_hysteresis", "hysteresis_moment", mh).set("crease_hysteresis", "yield_angle", s0)
    load = series([0.0, 1.0, 3.0, 4.0], [0.0, 1.0, -1.0, 0.0])
    run = quasistatic(model, parameters, Drive(load=load), np.linspace(0.0, 4.0, 33), tolerance=1e-6)

    def rates(t, y):
        dm = MOMENT * np.interp(t, [0, 1, 1, 3, 3, 4], [1, 1, -1, -1, 1, 1])
        slope_ = lambda way: 1 - abs(y[1]) if y[1] * way > 0 else 1.0  # noqa: E731
        turn = dm / (K + mh / s0 * slope_(np.sign(dm)))
        return [turn, slope_(np.sign(dm)) * turn / s0]

    expected = []
    y = [0.0, 0.0]
    for a, b in ((0.0, 1.0), (1.0, 3.0), (3.0, 4.0)):
        inside = run.times[(run.times >= a) & (run.times <= b)]
        ends = (a + 1e-12, b - 1e-12)
        found = solve_ivp(rates, ends, y, "DOP853", np.clip(inside, *ends), rtol=1e-10, atol=1e-12)
        expected.append(found.y[0][0 if a == 0 else 1 :])
        y = found.y[:, -1]
    assert np.abs(run.creases[:, 0, 0] - np.concatenate(expected)).max() < 2e-4


def test_a_snap_is_said():
    """A shallow truss under a growing load: it follows the closed form to the limit load and then snaps."""
    half, height, stiffness = 1.0, 0.3, 100.0
    model, parameters = truss(height, stiffness)
    rest = np.hypot(half, height)

    def load(z):
        length = np.hypot(half, z)
        return 2 * stiffness * (rest / length - 1) * z

    limit = minimize_scalar(lambda z: -load(z), bounds=(0.0, height), method="bounded").x
    times = np.linspace(0.0, 1.5 * load(limit), 16)
    run = quasistatic(model, parameters, Drive(load=series([0.0, 100.0], [0.0, 100.0])), times)
    (jump,) = run.jumps
    assert times[jump.frame - 1] < load(limit) <= times[jump.frame]
    assert jump.time == pytest.approx(load(limit), abs=1e-2 * (times[1] - times[0]))
    assert f"jumps before frame {jump.frame}" in run.notes[1]
    branches = [(limit, height) if f < load(limit) else (-2.0, -height) for f in times]
    expected = [brentq(lambda z, f=f: load(z) - f, *b) for f, b in zip(times, branches, strict=True)]
    assert run.x[:, 2, 0, 2] == pytest.approx(expected, abs=1e-8)
    assert not run.failures


def test_worlds_do_not_depend_on_each_other():
    model, parameters = hinge("rigid", "crease_relaxation")
    parameters.set("crease_relaxation", "time_1", np.array([[3.0, 30.0]]))
    times = np.linspace(0.0, 20.0, 5)
    both = quasistatic(model, parameters, Drive(load=1.0), times, tolerance=None)
    for w in (0, 1):
        one = quasistatic(model, parameters.world(w), Drive(load=1.0), times, tolerance=None)
        assert np.abs(one.angles[:, :, 0] - both.angles[:, :, w]).max() < 1e-9


def test_what_is_left_out_is_said():
    model, parameters = hinge("rigid", "crease_viscosity")
    parameters.set("crease_viscosity", "viscosity", 1e-3)
    run = quasistatic(model, parameters, Drive(load=ramp(1.0, 2.0)), np.linspace(0, 2, 9))
    assert any("crease_viscosity is left out" in n for n in run.notes)


def test_a_drive_between_frames_is_seen():
    wave = series(np.linspace(0, 10, 1001), np.where(np.linspace(0, 10, 1001) > 4.3, 1.0, 0.0))
    found = knots(Drive(load=wave), np.array([0.0, 5.0, 10.0]))
    assert found == pytest.approx([4.3, 4.31])
    assert len(knots(Drive(load=ramp(1.0, 5.0)), np.array([0.0, 5.0, 10.0]))) == 0


def test_a_world_without_an_equilibrium_is_reported():
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, panels="rigid")
    model, parameters = sheet.crease(stiffness=K).gravity().build()
    run = quasistatic(model, parameters, Drive(), [0.0, 1.0])
    assert run.failures and "frame 0" in str(run.failures[0])


def test_a_world_that_falls_at_every_step_is_given_up():
    """A crease that is wound up by more than a turn has no equilibrium within the half turn that is searched."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, panels="rigid").crease(stiffness=K).fix(panels=[0])
    sheet.set("crease_offset", offset_moment=7.5 * K).on("crease_drive")
    sheet.set("crease_drive", drive_stiffness=1e-4, target_angle=1.0)
    run = quasistatic(*sheet.build(), Drive(load=ramp(1.0, 9.0)), np.arange(10.0))
    assert "at frame 1, that it keeps" in run.failures[0].cause
    assert "22 equilibria" in run.notes[0]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"times": []}, "finite times"),
        ({"times": [0.0, 2.0, 1.0]}, "times must increase"),
        ({"times": [0.0, 1.0], "tolerance": -1.0}, "positive tolerance"),
        ({"times": [0.0, 9.0], "drive": Drive(load=series([0.0, 1.0], [0.0, 1.0]))}, "drive ends"),
    ],
)
def test_bad_input_is_refused(options, sentence):
    model, parameters = hinge()
    with pytest.raises(InputError, match=sentence):
        quasistatic(model, parameters, **options)


def test_rigid_panels_in_a_loop_creep_from_one_equilibrium_to_another():
    """At once the branches are springs, at last they are gone: both ends are equilibria of elastic creases."""
    sheet = Sheet(miura(1, 1, 0.02, 0.02, np.pi / 3, fold_angle=np.pi / 4), thickness=1e-3, panels="rigid")
    sheet.fix(panels=[0]).crease(stiffness=K).on("crease_relaxation", "crease_drive")
    sheet.set("crease_relaxation", stiffness_1=BRANCH, time_1=TIME)
    model, parameters = sheet.build()
    parameters.set("crease_drive", "drive_stiffness", MOMENT)
    parameters.set("crease_drive", "target_angle", 1.0, entities=0)
    run = quasistatic(model, parameters, Drive(load=1.0), [0.0, 5.0, 20.0, 1e5])
    plain = model.with_effects(without=("crease_relaxation",))
    ends = []
    for stiffness in (K + BRANCH, K):
        one = parameters.for_model(plain).set("crease", "stiffness", stiffness)
        ends.append(equilibrium(plain, one, Drive(load=1.0)).angles)
    assert run.creases[[0, -1], :, 0] == pytest.approx(np.array(ends), abs=1e-7)
    assert np.all(np.diff(run.creases[:, 0, 0]) > 0) and not run.failures
