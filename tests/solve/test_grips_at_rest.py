"""Equilibria in grips: force is the slope of the energy along the path; arches snap under a load and not in a grip."""

import numpy as np
import pytest
from effects.kit import slope
from solve.test_grips import chain, flap

from origami_sim import (
    Drive,
    Model,
    Parameters,
    Sheet,
    continuation,
    equilibrium,
    quasistatic,
    ramp,
    series,
    simulate,
    sine,
    strip,
)
from origami_sim.errors import InputError
from origami_sim.model import State


def together(drive_of, model, parameters, at, state=None):
    """Equilibrium where a path is at a place."""
    found = equilibrium(model, parameters, drive_of(at), state=state)
    assert found.converged, found.message
    return found


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
@pytest.mark.parametrize("name", ["left", "right"])
def test_force_of_a_grip_is_the_slope_of_the_energy_along_its_path(panels, name):
    model, parameters = chain(panels)
    run = quasistatic(model, parameters, Drive(grips={name: ramp("1 mm", "1 s")}), np.linspace(0, 1, 5), tolerance=None)
    assert not run.failures
    h = 1e-6
    ends = [
        together(lambda s: Drive(grips={name: s}), model, parameters, 1e-3 + sign * h, run.state) for sign in (1, -1)
    ]
    force = (ends[0].energy - ends[1].energy) / (2 * h)
    assert abs(force) > 1e-4
    np.testing.assert_allclose(run.grip_load(name)[-1, 0], force, atol=1e-6 * np.abs(run.grip_load(name)).max())


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_moment_of_a_grip_that_turns_is_the_slope_of_the_energy(panels):
    pattern = strip([0.01] * 5, 0.01)
    at = np.round(pattern.vertices[:, 0] / 0.01).astype(int)
    pattern.vertices[:, 2] = np.array([0.0, 0.0, 0.004, 0.001, 0.0, 0.0])[at]
    sheet = Sheet(pattern, thickness=3e-4, material="pdms", panels=panels).crease(stiffness=2e-4).touch(False)
    sheet.fix(panels=[0]).grip("shaft", panels=[4], axis=(0, 1, 0), point=(0.04, 0, 0.0))
    model, parameters = sheet.build()
    run = quasistatic(
        model, parameters, Drive(turns={"shaft": ramp("0.2 rad", "1 s")}), np.linspace(0, 1, 5), tolerance=None
    )
    h = 1e-5
    ends = [
        together(lambda s: Drive(turns={"shaft": s}), model, parameters, 0.2 + sign * h, run.state) for sign in (1, -1)
    ]
    moment = (ends[0].energy - ends[1].energy) / (2 * h)
    assert abs(moment) > 1e-6
    np.testing.assert_allclose(run.grip_load("shaft")[-1, 0], moment, rtol=1e-5)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_work_of_grips_is_the_energy_gained_to_second_order(panels):
    model, parameters = chain(panels)
    drive = Drive(grips={"left": ramp("1 mm", "1 s"), "right": ramp("-0.5 mm", "1 s")})
    errors = []
    for frames in (8, 16, 32):
        run = quasistatic(model, parameters, drive, np.linspace(0, 1, frames + 1), tolerance=None)
        gained = sum(e[-1, 0] - e[0, 0] for e in run.energies.values())
        errors.append(abs(run.work["grips"][-1, 0] - gained))
        np.testing.assert_allclose(np.ptp(run.energy_balance()), errors[-1], rtol=0.5)
    assert abs(slope([4, 2, 1], errors) - 2.0) < 0.2
    assert errors[-1] < 1e-3 * abs(gained)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_an_equilibrium_far_along_the_path_is_that_of_a_slow_motion(panels):
    model, parameters = chain(panels)
    drive = Drive(grips={"left": ramp("2 mm", "1 s"), "right": ramp("1 mm", "1 s")})
    run = quasistatic(model, parameters, drive, np.linspace(0, 1, 21))
    found = equilibrium(model, parameters, drive, time=1.0)
    assert found.converged and not run.failures
    np.testing.assert_allclose(found.x, run.x[-1, :, 0], atol=1e-9)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_a_device_in_one_grip_goes_along_as_it_is(panels):
    model, parameters = flap(panels, axis=(1, 1, 0), point=(0, 0.01, 0.02))
    run = quasistatic(model, parameters, Drive(turns={"base": ramp("2 rad", "1 s")}), [0.0, 0.5, 1.0])
    np.testing.assert_allclose(run.creases, 0.0, atol=1e-9)
    np.testing.assert_allclose(run.grip_wrenches, 0.0, atol=1e-9)
    found = equilibrium(model, parameters, Drive(turns={"base": "2 rad"}))
    np.testing.assert_allclose(found.x, run.x[-1, :, 0], atol=1e-10)


def test_what_rigid_panels_leave_open_is_no_number():
    """Clamps of a chain of parallel creases may press or twist it across its plane, and nothing moves."""
    model, parameters = chain("rigid")
    run = quasistatic(model, parameters, Drive(grips={"left": ramp("1 mm", "1 s")}), [0.0, 0.5, 1.0])
    open_ = np.isnan(run.grip_wrenches)
    assert np.all(open_ == np.array([False, True, False, True, False, True]))
    total = run.grip_wrenches[:, :, 0, [0, 2]].sum(axis=1)
    np.testing.assert_allclose(total, 0.0, atol=1e-9)  # nothing else acts on it
    lone = quasistatic(*flap("rigid", gravity=True), Drive(grips={"base": ramp("1 mm", "1 s")}), [0.0, 1.0])
    weight = 9.80665 * float(lone.parameters["body", "mass"].sum())
    np.testing.assert_allclose(lone.grip_wrenches[-1, 0, 0, :3], [0, 0, weight], atol=1e-9)


# an arch that snaps ---------------------------------------------------------------------------------------------------

HALF, RISE, STIFFNESS = 0.04, 0.01, 300.0


def truss(loaded: bool):
    """Two bars on pins (von Mises), with a load of 1 N on their apex or a grip that leads it down."""
    none = np.zeros((0, 4), np.int32)
    given = {"grips": np.array([-1, -1, 0], np.int32), "grip_screws": np.array([[0.0, 0, 0, 0, 0, -1]])}
    model = Model(
        position=np.array([[-HALF, 0, 0], [HALF, 0, 0], [0, 0, RISE]]),
        free=np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, float(loaded)]]),
        bars=np.array([[0, 2], [1, 2]], np.int32), creases=none, bends=none, triangles=none[:, :3],
        triangle_panel=np.zeros(0, np.int32), contacts=none[:, :3], contact_weights=np.zeros((0, 3)),
        contact_offsets=np.zeros(0), contact_axes=np.zeros((0, 3)), electrodes=np.zeros(0, np.int32),
        effects=("bars", "load"), names={} if loaded else {"grip": ("punch",)}, **({} if loaded else given),
    )  # fmt: skip
    parameters = Parameters(model).set("bars", "rest_length", np.hypot(HALF, RISE)).set("bars", "stiffness", STIFFNESS)
    return model, parameters.set("load", "force_z", -float(loaded), [2])


def pressed(down):
    """Force [N] that the truss resists with, at a deflection of its apex [m]: twice a bar's, in its direction."""
    height = RISE - down
    length = np.hypot(HALF, height)
    return 2 * STIFFNESS * (np.hypot(HALF, RISE) - length) * height / length


def test_a_truss_is_led_by_a_grip_through_what_a_load_snaps_over():
    model, parameters = truss(loaded=False)
    drive = Drive(grips={"punch": 2.2 * RISE})
    led = continuation(model, parameters, drive, step=0.02, tolerance=1e-12)
    assert led.reached and np.all(led.stable) and not len(led.limit_points)
    motion = led.trajectory
    force, way = motion.grip_load("punch")[:, 0], motion.grip_path("punch")[:, 0]
    np.testing.assert_allclose(way, led.factor * 2.2 * RISE, atol=1e-15)
    np.testing.assert_allclose(RISE - led.x[:, 2, 2], way, atol=1e-15)
    np.testing.assert_allclose(force, pressed(way), atol=1e-10)
    assert force.min() < -0.5 * force.max()  # it has to be held back on the way

    peak = pressed(np.linspace(0, RISE, 100001)).max()
    heavy, own = truss(loaded=True)
    snapping = continuation(heavy, own, Drive(load=2 * peak), max_points=400)
    np.testing.assert_allclose(2 * peak * snapping.factor[snapping.limit_points[0]], peak, rtol=1e-6)
    slow = quasistatic(heavy, own, Drive(load=ramp(1.2 * peak, "1 s")), np.linspace(0, 1, 25))
    assert len(slow.jumps) == 1
    slowly = quasistatic(model, parameters, Drive(grips={"punch": ramp(2.2 * RISE, "1 s")}), np.linspace(0, 1, 45))
    assert not slowly.jumps and not slowly.failures
    np.testing.assert_allclose(slowly.grip_load("punch")[:, 0], pressed(slowly.grip_path("punch")[:, 0]), atol=1e-9)


# what is refused ------------------------------------------------------------------------------------------------------


def sheet(panels="elastic"):
    return Sheet(strip([0.01] * 4, 0.01), thickness=1e-3, panels=panels).crease(stiffness=1e-4)


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda s: s.grip("a", direction=(0, 0, 1)), "a grip holds no node"),
        (lambda s: s.grip("a", nodes=[], direction=(0, 0, 1)), "a grip holds no node"),
        (lambda s: s.grip("", panels=[0], direction=(0, 0, 1)), "a grip needs a name"),
        (lambda s: s.grip("a", panels=[0]), "moves along a direction or about an axis"),
        (lambda s: s.grip("a", panels=[0], direction=(0, 0, 1), axis=(0, 0, 1)), "along a direction or about an axis"),
        (lambda s: s.grip("a", panels=[0], direction=(0, 0, 0)), "has three components"),
        (lambda s: s.grip("a", panels=[0], direction=(0, 1)), "direction of a grip has three components"),
        (lambda s: s.grip("a", panels=[0], direction=(0, 0, 1), point=(1, 0, 0)), "a point is one on an axis"),
        (lambda s: s.grip("a", panels=[0, 4], direction=(0, 0, 1)), "there is no such panel"),
        (lambda s: s.grip("a", nodes=[99], direction=(0, 0, 1)), "there is no such node"),
        (lambda s: s.grip("a", nodes=[0], direction=(0, 0, 1), axes="zu"), "there is no such axis"),
        (lambda s: s.fix(panels=[0]).grip("a", panels=[1], direction=(0, 0, 1)), "what a grip moves is fixed"),
        (lambda s: s.grip("a", panels=[1], direction=(0, 0, 1)).fix(panels=[0]), "what a grip moves is fixed"),
        (lambda s: s.fix(panels=[0]).grip("a", panels=[1], axis=(0, 1, 0)), "what a grip moves is fixed"),
        (lambda s: s.grip("a", nodes=[0], direction=(0, 0, 1), axes="xy"), "moves where it does not hold"),
        (lambda s: s.grip("a", nodes=[0], axis=(0, 0, 1), axes="x"), "moves where it does not hold"),
        (
            lambda s: s.grip("a", panels=[0], direction=(0, 0, 1)).grip("b", panels=[1], direction=(1, 0, 0)),
            "is in two grips",
        ),
        (
            lambda s: s.grip("a", panels=[0], direction=(0, 0, 1)).grip("a", panels=[3], direction=(1, 0, 0)),
            "there is a grip of that name",
        ),
    ],
)
def test_grips_that_cannot_be_are_refused(state, said):
    with pytest.raises(InputError, match=said) as e:
        state(sheet())
    assert str(e.value).count("\n") == 0


def test_a_path_needs_its_grip_its_unit_and_a_start_on_it():
    model, parameters = flap("elastic")
    with pytest.raises(InputError, match=r"no such grip.*grip_base"):
        simulate(model, parameters, Drive(grips={"bass": ramp("1 mm", "1 s")}), duration=0.1)
    with pytest.raises(InputError, match=r"no such grip.*grip_base"):
        simulate(model, parameters, Drive(turns={"base": ramp("1 rad", "1 s")}), duration=0.1)
    with pytest.raises(InputError, match="wrong unit"):
        Drive(grips={"base": "1 rad"})
    with pytest.raises(InputError, match="wrong unit"):
        Drive(turns={"base": ramp("1 mm", "1 s")})
    with pytest.raises(InputError, match="paths go by the names"):
        Drive(grips="1 mm")
    with pytest.raises(InputError, match="for different numbers of worlds"):
        sine([1e-3, 2e-3], np.array([1.0, 2.0, 3.0]))
    with pytest.raises(InputError, match="only paths are smooth"):
        Drive(voltage=ramp("1 kV", "1 s", smooth=True))
    with pytest.raises(InputError, match="a grip cannot jump: it is 1 mm"):
        simulate(model, parameters, Drive(grips={"base": "1 mm"}), duration=0.1, state=State.at_rest(model))
    with pytest.raises(InputError, match="a grip cannot jump"):
        simulate(*chain(), Drive(grips={"left": "1 mm"}), duration=0.1)
    with pytest.raises(InputError, match="needs finite times"):
        quasistatic(model, parameters, Drive(grips={"base": ramp("1 mm", "1 s")}))
    with pytest.raises(InputError, match="no grip moves"):
        simulate(model, parameters, duration=0.05).grip_load("base")
    with pytest.raises(InputError, match="there is no such grip"):
        simulate(model, parameters, duration=0.05).grip_load("top")


def test_a_grip_and_a_support_share_what_the_grip_does_not_move():
    turned = sheet().fix(panels=[0]).grip("a", panels=[1], axis=(0, 1, 0), point=(0.01, 0, 0))  # about their crease
    guided = sheet().fix(nodes=range(10), axes="y").grip("a", panels=[0], direction=(1, 0, 1), axes="xz")
    assert all(len(s.build()[0].grip_screws) for s in (turned, guided))


def test_rigid_panels_follow_no_jump_of_a_velocity():
    model, parameters = flap("rigid")
    with pytest.raises(InputError, match=r"jumps at t = 0.05 s, which no rigid panel can follow"):
        simulate(model, parameters, Drive(grips={"base": ramp("1 mm", "50 ms")}), duration=0.1)
    late = series([0.03, 0.06, 0.1], [0.0, 1e-3, 0.0], smooth=True)  # a cubic spline does not begin at rest
    with pytest.raises(InputError, match=r"jumps at t = 0.03 s, which no rigid panel can follow"):
        simulate(model, parameters, Drive(grips={"base": late}), duration=0.1)
    drive, errors = Drive(grips={"base": ramp("1 mm", "50 ms", smooth=True)}), []
    for tolerance in (1e-8, 1e-12):
        errors.append(simulate(model, parameters, drive, duration=0.1, tolerance=tolerance).energy_error[0])
    assert errors[1] < min(1e-6, 0.02 * errors[0])


def test_a_rigid_panel_is_held_by_its_grip_as_a_whole():
    corners = sheet("rigid").grip("a", nodes=[0, 1], direction=(0, 0, 1)).build()
    with pytest.raises(InputError, match="held by it alone, and as a whole"):
        simulate(*corners, Drive(grips={"a": ramp("1 mm", "1 s", smooth=True)}), duration=0.1)


@pytest.mark.parametrize("how", ["simulate", "quasistatic", "equilibrium"])
def test_rigid_panels_that_grips_tear_are_named(how):
    model, parameters = chain("rigid")
    drive = Drive(grips={"left": ramp("-3 mm", "50 ms", smooth=True)})  # longer than the chain is
    if how == "equilibrium":
        found = equilibrium(model, parameters, drive, time=0.05)
        assert not found.converged and "the grips tear the rigid panels" in found.message
        return
    if how == "simulate":
        run = simulate(model, parameters, drive, duration=0.06, rate=200)
        assert "the grips tear the rigid panels: node" in run.failures[0].cause
    else:
        run = quasistatic(model, parameters, drive, np.linspace(0, 0.05, 6))
        assert "the grips tear the rigid panels" in run.failures[0].cause
    assert 0 < run.failures[0].time < 0.05
