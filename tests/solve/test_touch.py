"""Panels that touch: stacks, closed folds, rolls, what is kept and what is refused."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from effects.kit import random_rotation

from origami_sim import Drive, Sheet, equilibrium, miura, quasistatic, ramp, simulate, strip
from origami_sim import sheet as mesh
from origami_sim.commands.cli import main
from origami_sim.errors import InputError
from origami_sim.model import State, node_mass
from origami_sim.model.bodies import rigid
from origami_sim.physics.materials import G
from origami_sim.results.run_folder import load_run, save_run
from origami_sim.solve.batch import Batch

MM = 1e-3
SMALL = [(0, 0), (20, 0), (20, 16), (0, 16)]
LARGE = [(-28, -26), (48, -26), (48, 42), (-28, 42)]


def made(pattern, *, thickness=1 * MM, stiffness=2e-3, rest_angle=None, loss_time=0.0, gravity=(0, 0, 0), held=(),
         touch=True, membrane_damping=0.02, **options):  # fmt: skip
    """A sheet with one set of effects, so that all tests share their kernels."""
    s = Sheet(pattern, thickness=thickness, triangulation="center", membrane_damping=membrane_damping)
    s.on("bar_viscosity", "panel_bending", "crease", "crease_drive").gravity(gravity).touch(**options)
    s.fix(panels=held)
    if len(s.mesh.creases):
        s.crease(stiffness=stiffness, rest_angle=rest_angle, loss_time=loss_time)
    model, parameters = s.build()
    if not touch:
        parameters.set("touch", "stiffness", 0.0)
    return model, parameters


def plates(*heights, sizes=None):
    """Rectangles at these heights [mm], the first of them large unless `sizes` says otherwise."""
    sizes = sizes or [LARGE, *[SMALL] * (len(heights) - 1)]
    corners = [(x + 0.7 * k, y + 0.4 * k, z) for k, (z, c) in enumerate(zip(heights, sizes, strict=True)) for x, y in c]
    return mesh(np.array(corners) * MM, [tuple(range(4 * k, 4 * k + 4)) for k in range(len(heights))])


def of_panel(model, p):
    return np.unique(model.triangles[model.triangle_panel == p])


def apart(model, parameters, x):
    """Least distance of two triangles of different panels that share no node, by points spread over both [m]."""
    share = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6.0
    points = np.einsum("sc,tca->tsa", share, x[model.triangles])
    least = np.inf
    for a in range(len(points)):
        for b in range(a + 1, len(points)):
            if not set(model.triangles[a]) & set(model.triangles[b]):
                least = min(least, np.linalg.norm(points[a][:, None] - points[b], axis=-1).min())
    return float(least)


@pytest.mark.parametrize(("ratio", "weight"), [(0.85, 1.0), (1.15, 1.0), (1.15, 0.5)])
def test_a_plate_that_falls_on_a_plate_sticks_below_the_friction_angle_and_slides_above_it(ratio, weight):
    """At half of the weight as well: the limit is a part of the load."""
    mu = 0.5
    tilt = math.atan(ratio * mu)
    fall = weight * G
    g = (fall * math.sin(tilt), 0, -fall * math.cos(tilt))
    model, parameters = made(plates(0, 1.3), gravity=g, held=[0], friction=mu, damping_ratio=0.5)
    run = simulate(model, parameters, duration=0.08, rate=200)
    assert not run.failures
    x = run.x[:, of_panel(model, 1), 0].mean(axis=1)
    pressed = 0.3e-3 - (x[0, 2] - x[-1, 2])
    assert -0.02 * MM < pressed < 0.0 + 1e-9  # it rests on the other's surface
    speed = (x[-1, 0] - x[-2, 0]) * 200
    if ratio < 1:
        assert abs(speed) < 1e-7  # true stick: no creep
    else:
        expected = fall * (math.sin(tilt) - mu * math.cos(tilt))
        v = np.diff(x[:, 0]) * 200
        assert (v[-1] - v[-9]) * 25 == pytest.approx(expected, rel=0.03)


def test_a_stack_of_plates_comes_to_rest_on_each_other():
    """At the default damping, and with corners on corners, where most pairs push at once."""
    corners = [(x, y, 1.1 * p) for p in range(3) for x, y in SMALL]
    pattern = mesh(np.array(corners) * MM, [tuple(range(4 * p, 4 * p + 4)) for p in range(3)])
    model, parameters = made(pattern, gravity=(0, 0, -G), held=[0])
    run = simulate(model, parameters, duration=0.1, rate=100)
    assert not run.failures
    for p in range(3):
        assert run.x[-1, of_panel(model, p), 0, 2] == pytest.approx(p * MM, abs=0.01 * MM)
    assert np.abs(run.v[-1]).max() < 1e-3
    assert run.crossings() == [0]


def flying():
    """Two plates that meet at an angle, edges and corners first, without anything that loses energy."""
    model, parameters = made(
        plates(0, 2.0, sizes=[SMALL, SMALL]), membrane_damping=0.0, friction=0.0, damping_ratio=0.0
    )
    state = State.at_rest(model)
    upper = of_panel(model, 1)
    x = state.x[upper, 0] - state.x[upper, 0].mean(axis=0)
    a, b = 0.3, 0.5
    turn = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    turn = turn @ np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    state.x[upper, 0] = x @ turn.T + np.array([12, 10, 9.0]) * MM
    state.v[upper, 0] = np.array([0.05, 0.02, -0.4]) + np.cross([3.0, -2.0, 5.0], state.x[upper, 0] - 0.01)
    return model, parameters, state


def test_energy_and_momentum_are_kept_where_nothing_is_lost():
    model, parameters, state = flying()
    mass = node_mass(model, parameters)
    errors = []
    for finer in (1, 2):
        run = simulate(model, parameters, duration=0.03, rate=100, state=state, dt=4e-6 / finer)
        m, x, v = mass[:, :, None], run.x, run.v
        assert np.ptp(v[:, of_panel(model, 0), 0, 2].mean(axis=1)) > 0.05  # they met
        impulse, spin = (m * v).sum(axis=1)[:, 0], (m * np.cross(x, v)).sum(axis=1)[:, 0]
        assert np.ptp(impulse, axis=0).max() < 1e-12 * np.abs(m * v).sum()
        assert np.ptp(spin, axis=0).max() < 1e-12 * np.abs(m * np.cross(x, v)).sum()
        total = run.energies["kinetic"] + sum(run.energies[n] for n in ("bars", "panel_bending", "touch"))
        errors.append(np.ptp(total) / run.energies["kinetic"].max())
    assert errors[0] < 2e-3
    assert errors[1] < 0.5 * errors[0]


def test_friction_between_bodies_keeps_momentum_and_turns_with_them():
    model, parameters, state = flying()
    parameters.set("touch_friction", "friction_coefficient", 0.6)
    r = random_rotation(np.random.default_rng(3))
    turned = state.copy()
    turned.x, turned.v = state.x @ r.T, state.v @ r.T
    run, other = (simulate(model, parameters, duration=0.03, rate=100, state=s, dt=1e-5) for s in (state, turned))
    m = node_mass(model, parameters)[:, :, None]
    spin = (m * np.cross(run.x, run.v)).sum(axis=1)[:, 0]
    assert run.work["touch_friction"].min() < -1e-8
    assert np.ptp(spin, axis=0).max() < 1e-11 * np.abs(m * np.cross(run.x, run.v)).sum()
    assert np.abs(run.x @ r.T - other.x).max() < 1e-9
    assert run.energy_error[0] < 1e-3


def test_worlds_do_not_depend_on_the_batch_and_a_run_may_be_continued():
    model, parameters, state = flying()
    parameters.set("touch_friction", "friction_coefficient", np.array([[0.0, 0.6]] * len(model.triangles)))
    both = simulate(model, parameters, duration=0.02, rate=100, state=state.select(np.zeros(2, int)), dt=4e-6)
    alone = simulate(model, parameters.world(1), duration=0.02, rate=100, state=state, dt=4e-6)
    assert np.array_equal(both.x[:, :, 1], alone.x[:, :, 0])
    assert np.abs(both.x[-1, :, 0] - both.x[-1, :, 1]).max() > 1e-5
    half = simulate(model, parameters.world(1), duration=0.01, rate=100, state=state, dt=4e-6)
    rest = simulate(model, parameters.world(1), duration=0.01, rate=100, state=half.state, dt=4e-6)
    assert np.array_equal(rest.x[-1], alone.x[-1])


def test_nothing_changes_where_nothing_touches():
    model, parameters, _ = flying()
    bare = model.with_effects(without=("touch", "touch_friction"))
    runs = [
        simulate(m, p, duration=0.01, rate=100, dt=4e-6, state=State.at_rest(m))
        for m, p in ((model, parameters), (bare, parameters.for_model(bare)))
    ]
    assert np.array_equal(runs[0].x, runs[1].x)
    assert not np.any(runs[0].work["touch"])


def rolled(touch):
    """A strip of twelve panels whose creases ask for 540 degrees together."""
    model, parameters = made(
        strip([8 * MM] * 12, 10 * MM), thickness=0.5 * MM, stiffness=2e-3, rest_angle=math.radians(540 / 11),
        loss_time=20e-3, held=[11], touch=touch,
    )  # fmt: skip
    return simulate(model, parameters, duration=0.18, rate=50)


def test_a_strip_that_rolls_up_by_540_degrees_does_not_pass_itself():
    free, run = rolled(False), rolled(True)
    frames = range(len(run.times))
    assert any(free.crossings(f)[0] for f in frames)
    assert not run.failures
    assert not any(run.crossings(f)[0] for f in frames)
    assert run.work["touch"].min() < 0
    assert np.degrees(run.creases[-1, :, 0].sum()) > 500
    assert apart(run.model, run.parameters, run.x[-1, :, 0]) > 0.4 * MM


def folded_miura(touch=True):
    cell = miura(1, 1, 12 * MM, 12 * MM, math.radians(60), fold_angle=math.radians(60))
    model, parameters = made(cell, thickness=0.8 * MM, stiffness=5e-5, loss_time=20e-3, touch=touch)
    sign = np.sign(parameters["crease", "rest_angle"])
    parameters.set("crease", "rest_angle", sign * math.radians(179))
    return simulate(model, parameters, duration=0.2, rate=50)


def test_a_miura_that_folds_flat_stops_at_its_thickness():
    run, free = folded_miura(), folded_miura(False)
    assert not run.failures
    assert run.crossings() == [0]
    least = apart(run.model, run.parameters, run.x[-1, :, 0])
    assert 0.72 * MM < least < 0.85 * MM
    assert apart(free.model, free.parameters, free.x[-1, :, 0]) < 0.4 * MM


def patched():
    """Two panels with patches on their inner side, 1.2 mm apart across the crease, which is turned shut."""
    s = Sheet(strip([10 * MM, 10 * MM], 12 * MM), thickness=1 * MM, triangulation="center")
    for panel in (0, 1):
        s.patch(panel, thickness=1.6 * MM, size=(8.8 * MM, 10 * MM))
    s.on("bar_viscosity", "panel_bending", "crease", "crease_drive").gravity((0, 0, 0)).touch(friction=0.0)
    s.fix(panels=[0]).crease(stiffness=1e-5, loss_time=8e-3)
    s.set("crease_drive", drive_stiffness=1e-5, target_angle=3.1)
    return s.build()


def closed_form(gap, height, thickness):
    """Fold at which the rounded borders of two patches meet [rad]."""
    across, up = 0.5 * (gap + thickness), 0.5 * (height + thickness)
    return 2 * (math.acos(0.5 * thickness / math.hypot(across, up)) - math.atan2(up, across))


@pytest.mark.slow
def test_patches_inside_a_fold_close_to_their_stop(tmp_path):
    expected = closed_form(1.2 * MM, 1 * MM, 1.6 * MM)
    model, parameters = patched()
    slow = quasistatic(model, parameters, Drive(load=ramp(1.0, 1.0)), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert not slow.failures
    assert slow.creases[-1, 0, 0] == pytest.approx(expected, abs=0.01)
    run = simulate(model, parameters, Drive(load=1.0), duration=0.02, rate=100, state=slow.state)
    assert run.creases[-1, 0, 0] == pytest.approx(slow.creases[-1, 0, 0], abs=1e-6)
    again = load_run(save_run(tmp_path / "run", run, scene="patches", replay=False).path).trajectory.model
    assert again.hash == model.hash
    assert np.array_equal(again.pad_weights, model.pad_weights)


def test_pressed_patches_push_by_the_slope_of_their_energy_and_without_torque():
    """Corners of patches lie off the panels that carry them: forces on them turn these panels, which move them."""
    model, parameters = patched()
    parameters.set("touch", "loss_time", 1e-4)
    x = model.position - model.position[model.creases[0, 1]]
    fold = closed_form(1.2 * MM, 1 * MM, 1.6 * MM) + 0.02
    turned = np.setdiff1d(of_panel(model, 1), of_panel(model, 0))
    x[turned] = np.stack([x[turned, 0] * math.cos(fold), x[turned, 1], x[turned, 0] * math.sin(fold)], axis=1)
    x = x @ random_rotation(np.random.default_rng(5)).T

    def evaluated(x, v=0.0):
        state = State.at_rest(model, position=x)
        state.v[:, 0] += v
        return Batch(model, parameters, Drive(), state).evaluate(0.0)

    force = evaluated(x).forces["touch"][:, 0]
    pressed = np.abs(force).max()
    assert pressed > 1e-4
    assert np.abs(force.sum(axis=0)).max() < 1e-10 * pressed
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-10 * pressed * np.abs(x).max()
    way, h = np.random.default_rng(6).normal(size=x.shape), 1e-9
    slope = (evaluated(x + h * way).energies["touch"] - evaluated(x - h * way).energies["touch"])[0] / (2 * h)
    assert -(force * way).sum() == pytest.approx(slope, rel=1e-5)
    spinning = evaluated(x, np.cross([3.0, -2.0, 4.0], x)).forces["touch"][:, 0]
    np.testing.assert_allclose(spinning, force, atol=1e-9 * pressed)
    closing = np.zeros_like(x)  # the second panel turns about the crease: the dashpot acts like so much more way
    closing[turned] = np.cross(x[turned], x[model.creases[0, 2]]) / (12 * MM)
    closing *= -np.sign((force * closing).sum())
    damped = evaluated(x, closing).forces["touch"][:, 0] - force
    further = evaluated(x + 1e-4 * closing).forces["touch"][:, 0] - force
    assert np.abs(damped - further).max() < 0.05 * np.abs(further).max()


def letter():
    """A panel on which two flaps are turned shut by a load factor of 1."""
    model, parameters = made(strip([9 * MM, 21 * MM, 8 * MM], 12 * MM), stiffness=1e-4, held=[1], friction=0.0,
                             loss_time=4e-3)  # fmt: skip
    return model, parameters.set("crease_drive", "drive_stiffness", 1e-4).set(
        "crease_drive", "target_angle", np.array([3.05, 3.14])
    )


def test_dynamics_statics_and_slow_motions_rest_on_the_same_contact():
    model, parameters = letter()
    slow = quasistatic(model, parameters, Drive(load=ramp(1.0, 1.0)), np.linspace(0.0, 1.0, 11))
    assert not slow.failures
    assert slow.crossings() == [0]
    end = slow.x[-1, :, 0]
    assert 0.85 * MM < apart(model, parameters, end) < MM
    found = equilibrium(model, parameters, Drive(load=1.0), state=slow.state)
    assert found.converged and found.stable
    assert np.abs(found.x - end).max() < 1e-7
    run = simulate(model, parameters, Drive(load=1.0), duration=0.3, rate=10, state=slow.state)
    assert np.abs(run.x[-1, :, 0] - end).max() < 1e-6


def test_rigid_panels_rest_on_the_same_contact():
    """In equilibria and in slow motions, from the same law; panels of the elastic sheet bend a little."""
    model, parameters = rigid(*letter())
    slow = quasistatic(model, parameters, Drive(load=ramp(1.0, 1.0)), [0.0, 0.5, 1.0])
    elastic = quasistatic(*letter(), Drive(load=ramp(1.0, 1.0)), [0.0, 0.5, 1.0])
    assert not slow.failures
    assert slow.crossings() == [0]
    assert np.abs(slow.creases[-1] - elastic.creases[-1]).max() < 0.005
    found = equilibrium(model, parameters, Drive(load=1.0), state=slow.state)
    assert found.converged and found.stable
    assert np.abs(found.angles - slow.angles[-1, :, 0]).max() < 1e-9


def swinging(*, begin, speed=0.0, gravity=0.0, thickness=1 * MM, damping_ratio=0.1):
    """A rigid panel that swings about an edge of another from a fold [deg] at a rate [rad/s]: model and state."""
    model, parameters = made(strip([20 * MM] * 2, 12 * MM), stiffness=1e-7, gravity=(0, 0, -gravity), held=[0],
                             thickness=thickness, damping_ratio=damping_ratio)  # fmt: skip
    model, parameters = rigid(model, parameters)
    x, own = model.position, np.setdiff1d(of_panel(model, 1), of_panel(model, 0))
    arm, a = x[own] - x[model.creases[0, 1]], math.radians(begin)
    position = x.copy()
    position[own] += np.stack([arm[:, 0] * (math.cos(a) - 1), 0 * arm[:, 0], arm[:, 0] * math.sin(a)], axis=1)
    state = State.at_rest(model, position=position)
    state.v[own, 0] = speed * arm[:, :1] * [-math.sin(a), 0, math.cos(a)]
    return model, parameters, state


@pytest.mark.parametrize(
    "how",
    [
        {"begin": 110, "gravity": G, "damping_ratio": 0.0},  # a trial step ends deep inside and is taken back
        {"begin": 90, "speed": 60.0, "thickness": 0.5 * MM},  # a frame is a turn and more, and nothing errs
        {"begin": 30, "speed": 30.0, "thickness": 0.3 * MM},
    ],
)
def test_rigid_panels_that_fall_shut_rebound_at_any_length_of_frames(how):
    model, parameters, state = swinging(**how)
    runs = [simulate(model, parameters, duration=0.2, rate=rate, state=state) for rate in (10, 60, 1000)]
    for run in runs:
        assert not run.failures
        assert run.crossings() == [0]
        assert np.abs(run.creases).max() < math.pi
        assert run.energy_error[0] < 1e-4
        assert run.creases[-1, 0, 0] == pytest.approx(runs[-1].creases[-1, 0, 0], abs=1e-3)
    assert np.ptp(runs[-1].creases) > 0.05


def test_rigid_panels_take_back_a_first_step_that_is_far_too_long():
    """Where masses were thrown in it says nothing of how far the panels move in the next one."""

    def ends(rate):
        s = Sheet(strip([10 * MM] * 4, 20 * MM), thickness=0.5 * MM, panels="rigid").fix(panels=[0])
        s.crease(stiffness=0.2e-3, rest_angle=math.radians(100), loss_time=20e-3).touch()
        run = simulate(*s.build(), duration=0.3, rate=rate)
        assert not run.failures
        return run.creases[-1, :, 0]

    assert np.abs(ends(60) - ends(1000)).max() < 1e-6


def test_rigid_panels_that_slam_too_hard_are_said_to_be_pressed_through():
    model, parameters, state = swinging(begin=90, speed=100.0, thickness=0.2 * MM)
    for rate in (60, 1000):
        run = simulate(model, parameters, duration=0.1, rate=rate, state=state)
        assert pressed_by(run) == pytest.approx(0.1, abs=0.005)


def test_a_given_step_too_long_for_contact_stops_rigid_panels():
    model, parameters, state = swinging(begin=110, gravity=G)
    run = simulate(model, parameters, duration=0.2, rate=60, dt=2e-3, state=state)
    assert "no step within 0.00185 s is accurate enough" in str(run.failures[0])


@pytest.mark.slow
def test_implicit_steps_come_to_rest_on_the_same_contact():
    model, parameters = letter()
    drive = Drive(load=ramp(1.0, 0.2))
    runs = [
        simulate(model, parameters, drive, duration=1.0, rate=10, **how)
        for how in ({}, {"method": "implicit", "spectral_radius": 0.5})
    ]
    assert np.abs(runs[0].x[-1] - runs[1].x[-1]).max() < 1e-6


def test_what_is_pressed_through_stops_the_world_with_a_reason():
    model, parameters = made(plates(0, 1.05), gravity=(0, 0, -G), held=[0])
    parameters.set("touch", "stiffness", 1e-3)
    run = simulate(model, parameters, duration=0.1, rate=20)
    assert len(run.failures) == 1
    assert "panel 0 and panel 1 are pressed" in str(run.failures[0])
    assert "stiffer" in str(run.failures[0])
    assert pressed_by(run) == pytest.approx(0.5, abs=0.01)


def pressed_by(run):
    """How deep the sentence of a run that stopped says that panels are pressed [mm]."""
    return float(re.search(r"are pressed ([\d.]+) mm", str(run.failures[0]))[1])


@pytest.mark.parametrize(("through", "count"), [(0.01, True), (-0.01, False)])
def test_a_corner_that_is_hardly_through_counts_as_through(through, count):
    model, parameters = made(plates(0, 1.3))
    run = simulate(model, parameters, duration=0.01, rate=100)
    upper = of_panel(model, 1)
    x = run.x[-1, upper, 0]
    run.x[-1, upper, 0, 2] = 0.1 * (x[:, 0] - x[:, 0].min()) + 0.05 * (x[:, 1] - x[:, 1].min()) - through * MM
    assert (run.crossings()[0] > 0) == count


def test_bad_input_is_refused_in_a_sentence():
    with pytest.raises(InputError, match="thickness cannot touch"):
        Sheet(plates(0, 2), thickness=1 * MM).touch(thickness=0.0)
    with pytest.raises(InputError, match=r"not negative.*friction"):
        Sheet(plates(0, 2), thickness=1 * MM).touch(friction=-1.0)
    with pytest.raises(InputError, match=r"panel 0 and panel 1 lie 0\.4 mm inside each other at the start"):
        made(plates(0, 0.6))
    with pytest.raises(InputError, match="panel 0 and panel 1 overlap at the start"):
        made(plates(0, 0))


def test_what_panels_touch_with_follows_from_their_material():
    """A gram presses one pair of 1 mm PDMS 33 um deep; a corner that lands alone keeps exp(-pi zeta) of its speed.

    Nearly, as contact does not pull: by integration of m dv/dt = max(-k (x + tau v), 0) until the corner leaves.
    """
    s = Sheet(plates(0, 5.0), thickness=1 * MM, triangulation="center").touch(friction=0.3)
    model, parameters = s.build()
    k = parameters["touch", "stiffness"][:, 0]
    assert 1e-3 * G / k == pytest.approx(32.7e-6, rel=0.01)
    assert parameters["touch", "thickness"] == pytest.approx(1 * MM)
    assert parameters["touch_friction", "friction_coefficient"] == pytest.approx(0.3)
    mass = parameters["inertia", "mass"][:, 0]
    for t, corners in enumerate(model.triangles):
        m, tau = mass[corners].mean(), parameters["touch", "loss_time"][t, 0]
        dt, x, v = 1e-3 * math.sqrt(m / k[t]), 0.0, -1.0
        while x <= 0:
            v += dt / m * max(-k[t] * (x + tau * v), 0.0)
            x += dt * v
        assert v == pytest.approx(0.73, abs=0.02)
    thin = Sheet(plates(0, 5.0), thickness=1 * MM).touch(thickness=0.4 * MM, stiffness=50.0).build()[1]
    assert thin["touch", "thickness"] == pytest.approx(0.4 * MM) and thin["touch", "stiffness"] == pytest.approx(50.0)


def test_layers_beside_a_crease_touch_at_a_fifth_of_their_way_along_the_sheet():
    """A crease in a mesh much finer than the thickness folds to 157 degrees: 2 atan(5) (docs/contact.md).

    Corners at a distance l from it are 2 l apart in the sheet and 2 l cos(fold / 2) in space.
    """
    for fold, touching in ((155.0, False), (159.0, True)):
        model, parameters = made(strip([1 * MM] * 2, 8 * MM), thickness=4 * MM)
        x = model.position - model.position[model.creases[0, 1]]
        own = np.setdiff1d(of_panel(model, 1), of_panel(model, 0))
        turned, a = x.copy(), math.radians(fold)
        turned[own] = np.stack([x[own, 0] * math.cos(a), x[own, 1], x[own, 0] * math.sin(a)], axis=1)
        report = Batch(model, parameters, Drive(), State.at_rest(model, position=turned)).evaluate(0.0)
        assert (np.abs(report.forces["touch"]).max() > 0) == touching


ROLL = '''
from origami_sim import Sheet, strip

DURATION = "0.3 s"

def build(touch="off"):
    """Four panels that turn by 100 degrees each: the last one through the first, unless they touch."""
    panels = "elastic" if touch == "stated" else "rigid"
    sheet = Sheet(strip([0.01] * 4, 0.02), thickness="0.5 mm", panels=panels).fix(panels=[0])
    sheet.crease(stiffness="0.2 mN m/rad", rest_angle="100 deg", loss_time="20 ms")
    if touch == "stated":
        sheet.touch(stiffness="1 N/mm")
    return sheet.touch(False) if touch == "off" else sheet
'''


def pierced(x, triangles):
    """Pairs of triangles without a common corner of which an edge of one passes through the other (Cramer's rule)."""

    def through(edge, corners):
        a, b = edge
        rows = np.stack([b - a, corners[0] - corners[1], corners[0] - corners[2]], axis=1)
        t, u, v = np.linalg.solve(rows, corners[0] - a) if abs(np.linalg.det(rows)) > 1e-15 else (-1.0, 0.0, 0.0)
        return 0 < t < 1 and u > 0 and v > 0 and u + v < 1

    edges = [(t[k], t[k - 1]) for t in triangles for k in range(3)]
    return sum(
        any(through(x[list(e)], x[q]) for e in edges[3 * i : 3 * i + 3])
        or any(through(x[list(e)], x[p]) for e in edges[3 * j : 3 * j + 3])
        for i, p in enumerate(triangles)
        for j, q in enumerate(triangles[:i])
        if not set(p) & set(q)
    )


def test_every_run_counts_the_pairs_that_pass_through_each_other(tmp_path, capsys):
    """In what it prints, in its JSON and in its manifest; with contact there are none."""
    device = tmp_path / "roll.py"
    device.write_text(ROLL)

    def ran(*options):
        with pytest.raises(SystemExit) as end:
            main(["run", str(device), "--out", str(tmp_path / "runs"), *options])
        assert end.value.code == 0
        return capsys.readouterr().out

    said = json.loads(ran("--json"))
    motion = load_run(said["folder"]).trajectory
    expected = pierced(motion.x[-1, :, 0], motion.model.triangles.tolist())
    assert expected > 0
    assert said["crossing_pairs"] == expected
    assert json.loads((Path(said["folder"]) / "manifest.json").read_text())["crossing_pairs"] == [expected]
    assert f"{expected} pairs of triangles through each other" in ran()
    most, when = motion.most_crossings()
    triangles = motion.model.triangles.tolist()
    assert most >= expected and most == pierced(motion.x[np.argmin(np.abs(motion.times - when)), :, 0], triangles)
    assert json.loads(ran("--json", "--set", "touch=stated"))["crossing_pairs"] == 0
    said = json.loads(ran("--json", "--set", "touch=default"))
    assert said["crossing_pairs"] == 0
    assert "panel 0 and panel 3 meet at t = 0.06" in said["notes"][0]


@pytest.mark.parametrize(("length", "least"), [(20, 0.999), (10, 0.996), (5, 0.967), (3, 0.57)])
def test_panels_pressed_shut_by_a_soft_crease_lie_a_thickness_apart(length, least):
    """Middles of two panels of 1 mm: no thickness is lost but to the crease's reach and to what it presses."""
    model, parameters = made(strip([length * MM] * 2, 20 * MM), stiffness=5e-5, rest_angle=3.14, held=[0])
    found = equilibrium(*rigid(model, parameters))
    middle = np.abs(model.position[:, 0] - 1.5 * length * MM) < 1e-9
    apart = found.x[: len(middle)][middle, 2].mean() / MM
    assert found.converged and least < apart < 1.0
