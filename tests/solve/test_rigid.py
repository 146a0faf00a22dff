"""Rigid panels in reduced coordinates, against independent rigid-body solutions and against bars."""

from dataclasses import replace

import numpy as np
import pytest
from effects.kit import slope
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from origami_sim import Drive, Sheet, equilibrium, grid, miura, simulate, strip, waterbomb
from origami_sim.errors import InputError
from origami_sim.model import State, dihedral_angles
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import body_of, mass_points, rigid
from origami_sim.solve.batch import Batch
from origami_sim.solve.rigid.batch import RigidBatch, batch_of

G = 9.80665


def hanging(lengths=(0.04, 0.2, 0.15), width=0.03, *, panels="rigid", **options):
    """A chain of plates that hangs from a held mount."""
    pattern = strip(list(lengths), width)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)
    sheet = Sheet(pattern, thickness=2e-3, material="aluminium", triangulation="center", panels=panels, **options)
    return sheet.fix(panels=[0]).gravity()


def folded(model, angles, rates=None, worlds=1):
    """A state of these fold angles [rad] and rates [rad/s], the root where it is."""
    arm = Articulation(model)
    pose = replace(arm.reference(worlds), angles=np.tile(np.array(angles, float)[:, None], worlds))
    x = arm.positions(pose)
    state = State.at_rest(model, worlds, x)
    if rates is not None:
        by = arm.jacobian(pose, x)[-len(angles) :]
        state.v[:] = np.einsum("mnwa,m->nwa", by, rates)
    return state


def double_pendulum(model, parameters, angles, times, viscosity=(0.0, 0.0)):
    """Fold angles of a two-arm chain from Lagrange's equations in absolute angles [len(times), 2]."""
    body = [body_of(parameters, p) for p in (1, 2)]
    (m1, m2), top = parameters["body", "mass"][1:, 0], -0.04
    length = 0.2
    a1, a2 = top - body[0][0][2], top - length - body[1][0][2]
    i1, i2 = (b[1][1, 1] for b in body)

    def rates(_, y):
        p, q, dp, dq = y
        coupling = m2 * length * a2
        mass = np.array([[i1 + m1 * a1**2 + m2 * length**2, coupling * np.cos(p - q)], [0, i2 + m2 * a2**2]])
        mass[1, 0] = mass[0, 1]
        turn = coupling * np.sin(p - q)
        c1, c2 = viscosity
        right = [
            -turn * dq**2 - (m1 * a1 + m2 * length) * G * np.sin(p) - c1 * dp + c2 * (dq - dp),
            turn * dp**2 - m2 * a2 * G * np.sin(q) - c2 * (dq - dp),
        ]
        return [dp, dq, *np.linalg.solve(mass, right)]

    y0 = [angles[0], sum(angles), 0.0, 0.0]
    y = solve_ivp(rates, (0, times[-1]), y0, "DOP853", times, rtol=1e-12, atol=1e-12).y
    return np.stack([y[0], y[1] - y[0]], axis=1)


def test_a_chain_swings_as_lagranges_equations_say():
    model, parameters = hanging().set("crease_viscosity", viscosity=np.array([2e-4, 1e-4])).build()
    run = simulate(model, parameters, duration=2.0, rate=100.0, state=folded(model, [1.2, 0.7]))
    expected = double_pendulum(model, parameters, [1.2, 0.7], run.times, (2e-4, 1e-4))
    assert np.abs(run.creases[:, :, 0] - expected).max() < 1e-8
    balance = run.energy_balance()
    assert np.ptp(balance) < 1e-9 * run.energies["kinetic"].max()


def test_a_given_step_is_of_order_five():
    model, parameters = hanging().build()
    state = folded(model, [1.2, 0.7])
    expected = double_pendulum(model, parameters, [1.2, 0.7], np.array([0.0, 1.0]))[-1]
    steps = np.array([0.005, 0.004, 0.0025])
    errors = []
    for dt in steps:
        run = simulate(model, parameters, duration=1.0, rate=10.0, state=state, dt=dt)
        assert run.dt == pytest.approx(dt)
        errors.append(np.abs(run.creases[-1, :, 0] - expected).max())
    assert slope(steps, errors) == pytest.approx(5.0, abs=0.6)
    assert errors[-1] < 1e-6


@pytest.mark.slow
def test_bars_come_to_it_as_they_stiffen():
    """Chain of plates with bars 16 times stiffer each time: the difference falls as 1/stiffness."""
    rigid_model, rigid_parameters = hanging().build()
    expected = simulate(rigid_model, rigid_parameters, duration=0.5, rate=50.0, state=folded(rigid_model, [0.8, 0.4]))
    errors, factors = [], np.array([1e-4, 4e-4, 1.6e-3])
    for factor in factors:
        model, parameters = hanging(panels="elastic", membrane=factor, membrane_damping=0.0).build()
        parameters.set("panel_bending", "stiffness", parameters["panel_bending", "stiffness"] * 1e2)
        run = simulate(model, parameters, duration=0.5, rate=50.0, state=folded(model, [0.8, 0.4]))
        errors.append(np.abs(run.creases - expected.creases).max())
    assert slope(factors, errors) == pytest.approx(-1.0, abs=0.25)


def test_a_free_body_tumbles_as_eulers_equations_say():
    """An asymmetric plate without forces, turning about its middle axis: it flips (Euler; Dzhanibekov)."""
    sheet = Sheet(grid(1, 1, 0.1, 0.06), thickness=4e-3, material="aluminium", panels="rigid")
    model, parameters = sheet.build()
    centre, inertia = body_of(parameters, 0)
    omega = np.array([0.02, 9.0, 0.05]) if inertia[0, 0] < inertia[1, 1] else np.array([9.0, 0.02, 0.05])
    state = State.at_rest(model)
    state.v[:, 0] = np.cross(omega, model.position - centre) + np.array([0.3, 0.0, 0.1])
    run = simulate(model, parameters, duration=3.0, rate=50.0, state=state, tolerance=1e-12)

    def rates(_, y):
        turn = Rotation.from_quat(y[:4])
        w = turn.inv().apply(y[4:])
        dw = turn.apply(np.linalg.solve(inertia, -np.cross(w, inertia @ w)))
        q = np.concatenate([0.5 * (y[3] * y[4:] + np.cross(y[4:], y[:3])), [-0.5 * y[:3] @ y[4:]]])
        return np.concatenate([q, dw])

    y = solve_ivp(rates, (0, 3), [0, 0, 0, 1, *omega], "DOP853", run.times, rtol=1e-12, atol=1e-13).y
    for f, t in enumerate(run.times):
        x = Rotation.from_quat(y[:4, f]).apply(model.position - centre) + centre + t * np.array([0.3, 0.0, 0.1])
        assert np.abs(run.x[f, :, 0] - x).max() < 1e-8
    middle = 0 if inertia[0, 0] > inertia[1, 1] else 1
    across = np.array([Rotation.from_quat(q).as_matrix()[middle, middle] for q in y[:4].T])
    assert across.min() < -0.9 or np.ptp(across) > 0.1, "it has to flip, or nothing was tested"


def test_a_free_chain_keeps_momentum_angular_momentum_and_energy():
    sheet = Sheet(strip([0.05, 0.08, 0.06], 0.04), thickness=2e-3, triangulation="center", panels="rigid")
    sheet.patch(2, thickness=3e-3).crease(stiffness=np.array([3e-3, 2e-3]))
    model, parameters = sheet.build()
    state = folded(model, [0.6, -0.9], [3.0, -5.0])
    state.v[:] += np.cross([1.0, 2.0, -1.5], state.x) + np.array([0.2, 0.1, 0.4])
    run = simulate(model, parameters, duration=2.0, rate=20.0, state=state, tolerance=1e-12)
    mass = parameters["inertia", "mass"][:, 0, None]
    for f in range(len(run.times)):
        x, v = run.x[f, :, 0], run.v[f, :, 0]
        assert (mass * v).sum(0) == pytest.approx((mass * run.v[0, :, 0]).sum(0), abs=1e-9 * mass.sum())
        spin = (mass * np.cross(x, v)).sum(0)
        assert spin == pytest.approx((mass * np.cross(run.x[0, :, 0], run.v[0, :, 0])).sum(0), abs=2e-11)
    assert np.ptp(run.energy_balance()) < 1e-8 * run.energies["kinetic"].max()
    edges = np.linalg.norm(run.x[:, 0, 0] - run.x[:, 1, 0], axis=-1)
    assert np.ptp(edges) < 1e-12


def test_a_body_hangs_from_its_crease_by_its_own_inertia_off_the_plane():
    """Small swings of a plate that is heavy on one side: a physical pendulum about its own rest angle."""
    sheet = hanging((0.04, 0.1)).body(1, mass=0.05, centre=(0.03, 0.0, -0.11), inertia=(9e-5, 8e-5, 3e-5))
    model, parameters = sheet.build()
    arm = np.hypot(0.03, 0.07)
    rest = np.arctan2(0.03, 0.07)
    inertia = 8e-5 + 0.05 * arm**2
    period = 2 * np.pi * np.sqrt(inertia / (0.05 * G * arm))
    sign = 1.0
    for trial in (rest, -rest):  # which way the fold angle counts
        run = simulate(model, parameters, duration=0.01, rate=1000.0, state=folded(model, [trial]))
        if np.abs(np.ptp(run.creases)) < 1e-9:
            sign = np.sign(trial)
    run = simulate(model, parameters, duration=4 * period, rate=400.0, state=folded(model, [sign * rest + 1e-4]))
    swing = run.creases[:, 0, 0] - sign * rest
    expected = 1e-4 * np.cos(2 * np.pi * run.times / period)
    assert np.abs(swing - expected).max() < 1e-8


@pytest.mark.parametrize("held", [True, False])
def test_an_eccentric_weight_has_its_inertia(held):
    """The law moves the centre of a panel's mass: the same motion as of a body whose centre is stated there."""
    offset = 0.02

    def run(lift, law):
        free = Sheet(strip([0.05, 0.08, 0.06], 0.04), thickness=2e-3, panels="rigid").gravity()
        sheet = hanging((0.04, 0.2, 0.15)) if held else free
        model, parameters = sheet.build()
        centre, inertia = body_of(parameters, 2)
        mass, normal = parameters["body", "mass"][2, 0], panel_normal(model, 2)
        sheet.body(2, mass=mass, centre=centre + lift * normal, inertia=inertia)
        model, parameters = sheet.build()
        if law:
            model = model.with_effects("eccentric_weight")
            parameters = parameters.for_model(model)
            mine = np.flatnonzero(model.triangle_panel == 2)
            parameters.set("eccentric_weight", "mass", mass / len(mine), mine)
            parameters.set("eccentric_weight", "offset", law, mine)
        state = folded(model, [0.9, -0.5], [1.0, 3.0])
        half = simulate(model, parameters, duration=0.3, rate=50.0, state=state, tolerance=1e-12)
        rest = simulate(model, parameters, duration=0.3, rate=50.0, state=half.state, tolerance=1e-12)
        assert np.ptp(rest.energy_balance()) < 1e-8 * rest.energies["kinetic"].max()
        corners = len(model.position) - len(model.carriers)
        return np.concatenate([half.x, rest.x])[:, :corners], np.concatenate([half.creases, rest.creases])

    (x, angles), (stated, expected) = run(0.0, offset), run(offset, 0.0)
    assert np.abs(angles - expected).max() < 1e-8
    assert np.abs(x - stated).max() < 1e-8
    assert np.abs(angles - run(0.0, 0.0)[1]).max() > 0.01


def test_an_eccentric_weight_swings_by_a_gravity_of_its_own():
    """Small swings of a plate that nothing else pulls at: the moment of the weight, and the inertia that it adds."""
    offset = 0.02
    model, parameters = hanging((0.04, 0.1)).build()
    model = model.with_effects("eccentric_weight", without=("gravity",))
    parameters, mine = parameters.for_model(model), np.flatnonzero(model.triangle_panel == 1)
    centre, inertia = body_of(parameters, 1)
    mass, normal = parameters["body", "mass"][1, 0], panel_normal(model, 1)
    parameters.set("eccentric_weight", "mass", mass / len(mine), mine).set("eccentric_weight", "offset", offset, mine)
    for axis, g in zip("xyz", G * normal, strict=True):
        parameters.set("eccentric_weight", f"gravity_{axis}", g)
    arm = np.hypot(offset, centre[2] + 0.04)
    period = 2 * np.pi * np.sqrt((inertia[1, 1] + mass * arm**2) / (mass * offset * G))
    run = simulate(model, parameters, duration=2 * period, rate=100.0, state=folded(model, [1e-4]))
    assert np.abs(run.creases[:, 0, 0] - 1e-4 * np.cos(2 * np.pi * run.times / period)).max() < 1e-8


def panel_normal(model, panel):
    a, b, c = model.position[model.triangles[np.flatnonzero(model.triangle_panel == panel)[0]]]
    return np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))


@pytest.mark.parametrize("held", ["line", "point", "plane"])
def test_a_panel_held_at_some_nodes_turns_about_them(held):
    sheet = Sheet(grid(1, 1, 0.1, 0.06), thickness=2e-3, material="aluminium", panels="rigid").gravity()
    model, parameters = sheet.build()
    edge = np.flatnonzero(np.isclose(model.position[:, 0], 0.0) & (np.arange(len(model.position)) < 4))
    if held == "line":
        sheet.fix(nodes=edge)
    elif held == "point":
        sheet.fix(nodes=edge[:1])
    else:
        sheet.fix(nodes=range(4), axes="y")
    model, parameters = sheet.build()
    run = simulate(model, parameters, duration=0.5, rate=40.0, tolerance=1e-12)
    mass = parameters["inertia", "mass"][:, 0]
    fall = np.einsum("n,fn->f", mass, run.x[:, :, 0, 2] - run.x[0, :, 0, 2])
    kinetic = 0.5 * np.einsum("n,fna->f", mass, run.v[:, :, 0] ** 2)
    assert kinetic + G * fall == pytest.approx(0.0, abs=1e-9 * kinetic.max())
    assert kinetic.max() > 0.01
    if held == "plane":
        assert run.x[-1, 0, 0, 2] == pytest.approx(run.x[0, 0, 0, 2] - 0.5 * G * 0.25, abs=1e-9)
        return
    assert run.x[:, edge[0]] == pytest.approx(np.tile(run.x[0, edge[0]], (len(run.x), 1, 1)), abs=1e-12)
    if held == "line":
        assert run.x[:, edge[1]] == pytest.approx(np.tile(run.x[0, edge[1]], (len(run.x), 1, 1)), abs=1e-12)
        body = body_of(parameters, 0)
        about = body[1][1, 1] + mass.sum() * body[0][0] ** 2
        speed = np.sqrt(-2 * G * fall[5] / about)  # of a physical pendulum
        assert np.linalg.norm(run.v[5, 3, 0]) == pytest.approx(speed * np.linalg.norm(run.x[0, 3, 0, [0, 2]]), rel=1e-9)


def test_creases_with_memory_move_as_in_bars():
    """Friction and relaxation in a hinge: the same laws, the same motion as stiff bars give."""
    runs = {}
    for panels in ("rigid", "elastic"):
        sheet = hanging((0.04, 0.1), panels=panels, membrane=1e-3).crease(stiffness=2e-3, rest_angle=0.0)
        sheet.set("crease_friction", friction_moment=1e-3, yield_angle=0.01)
        sheet.set("crease_relaxation", stiffness_1=2e-3, time_1=0.1)
        model, parameters = sheet.build()
        runs[panels] = simulate(model, parameters, duration=0.6, rate=100.0, state=folded(model, [1.0]))
    assert runs["rigid"].creases == pytest.approx(runs["elastic"].creases, abs=2e-4)
    assert runs["rigid"].work["crease_friction"][-1] == pytest.approx(
        runs["elastic"].work["crease_friction"][-1], rel=1e-3
    )
    assert np.ptp(runs["rigid"].energy_balance()) < 1e-6


def test_a_block_sticks_below_the_friction_angle_and_slides_above():
    for tilt, coefficient in ((0.2, 0.3), (0.3, 0.2)):
        sheet = Sheet(grid(1, 1, 0.04, 0.04), thickness=4e-3, panels="rigid").gravity()
        for corner in ((0, 0, 0), (0.04, 0, 0), (0.04, 0.04, 0), (0, 0.04, 0)):
            sheet.contact(0, corner)
        sheet.set("ground", stiffness=2000.0, damping=2.0).set("friction", stiffness=2000.0, damping=2.0)
        sheet.set("coulomb", friction_coefficient=coefficient)
        model, parameters = sheet.build()
        parameters.set("plane", "tilt", tilt).set("plane", "reach", 1e-4)
        x = Rotation.from_rotvec([0, -tilt, 0]).apply(model.position)
        run = simulate(model, parameters, duration=0.6, rate=100.0, state=State.at_rest(model, position=x))
        assert not run.failures
        along = run.centre_of_mass()[:, 0] @ [np.cos(tilt), 0, np.sin(tilt)]
        if tilt < np.arctan(coefficient):
            assert abs(along[-1] - along[30]) < 1e-9
        else:
            a = G * (np.sin(tilt) - coefficient * np.cos(tilt))
            speed = (along[-1] - along[-11]) / 0.1
            assert speed == pytest.approx(-a * (run.times[-1] - 0.05), rel=5e-3)


def test_worlds_do_not_depend_on_each_other_nor_on_threads():
    model, parameters = hanging().build()
    states = [folded(model, [a, 0.3]) for a in (0.2, 1.0, 1.9)]
    together = RigidBatch(model, parameters, Drive(), State.join(states), threads=2)
    x, _ = together.film(5, 1, 0.02, np.inf)
    for w, state in enumerate(states):
        alone = RigidBatch(model, parameters, Drive(), state, threads=1)
        assert np.array_equal(alone.film(5, 1, 0.02, np.inf)[0][:, :, 0], x[:, :, w])


def test_a_run_goes_on_from_its_last_state():
    model, parameters = hanging().build()
    whole = simulate(model, parameters, duration=1.0, rate=50.0, state=folded(model, [1.0, -0.5]))
    half = simulate(model, parameters, duration=0.5, rate=50.0, state=folded(model, [1.0, -0.5]))
    rest = simulate(model, parameters, duration=0.5, rate=50.0, state=half.state)
    assert rest.creases[-1] == pytest.approx(whole.creases[-1], abs=1e-8)
    assert rest.times[-1] == pytest.approx(1.0)


def test_mass_points_have_the_body():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(9, 3)) * [3, 1, 0.2]
    centre = points.mean(0)
    spread = (points - centre).T @ (points - centre) * 0.7 / 9
    inertia = np.trace(spread) * np.eye(3) - spread
    found = mass_points(0.7, centre, inertia)
    assert found.mean(0) == pytest.approx(centre)
    r = found - centre
    assert 0.7 / 4 * r.T @ r == pytest.approx(spread)


def test_a_panel_is_the_slab_that_it_is():
    sheet = Sheet(grid(1, 1, 0.1, 0.06), thickness=4e-3, density=1000.0, panels="rigid")
    sheet.patch(0, thickness=2e-3, size=(0.02, 0.04), centre=(0.03, 0.02, 0.0), density=3000.0, side=-1)
    _, parameters = sheet.build()
    centre, inertia = body_of(parameters, 0)
    slab, patch = 0.1 * 0.06 * 4e-3 * 1000, 0.02 * 0.04 * 2e-3 * 3000
    x1, x2 = np.array([0.05, 0.03, 0.0]), np.array([0.03, 0.02, -3e-3])
    middle = (slab * x1 + patch * x2) / (slab + patch)
    assert centre == pytest.approx(middle)
    expected = np.zeros((3, 3))
    for m, x, (a, b, c) in ((slab, x1, (0.1, 0.06, 4e-3)), (patch, x2, (0.02, 0.04, 2e-3))):
        r = x - middle
        expected += m / 12 * np.diag([b**2 + c**2, a**2 + c**2, a**2 + b**2]) + m * (
            (r @ r) * np.eye(3) - np.outer(r, r)
        )
    assert inertia == pytest.approx(expected, abs=1e-12)


def test_forces_are_those_of_the_same_nodes_in_bars():
    """Gravity and the crease's moment do the same virtual work on the rigid model as on its elastic twin."""
    model, parameters = hanging(panels="elastic").crease(stiffness=0.01).build()
    other, own = rigid(model, parameters)
    arm, state = Articulation(other), folded(other, [0.5, 0.3])
    by = arm.jacobian(replace(arm.reference(), angles=np.array([[0.5], [0.3]])), state.x)
    f = Batch(other, own, Drive(), state).evaluate(0.0).forces
    elastic = folded(model, [0.5, 0.3])
    g = Batch(model, parameters, Drive(), elastic).evaluate(0.0).forces
    by_bars = Articulation(model).jacobian(
        replace(Articulation(model).reference(), angles=np.array([[0.5], [0.3]])), elastic.x
    )
    for name in ("gravity", "crease"):
        one, two = np.einsum("mnwa,nwa->m", by, f[name]), np.einsum("mnwa,nwa->m", by_bars, g[name])
        assert one == pytest.approx(two, rel=1e-9)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Sheet(strip([0.1], 0.05), thickness=1e-3, panels="soft"), ["panels", "soft", "elastic, rigid"]),
        (lambda: hanging().set("maxwell_membrane").build(), ["neither bend nor stretch", "maxwell_membrane"]),
        (lambda: hanging().body(1, mass=0.1, centre=(0, 0, -0.1), inertia=(1e-5, 1e-5, 9e-5)), ["no body has", "sum"]),
        (lambda: hanging().body(1, mass=-0.1, centre=(0, 0, -0.1), inertia=(1e-5, 1e-5, 1e-5)), ["positive mass"]),
        (
            lambda: simulate(*hanging().build(), duration=0.1, method="implicit"),
            ["rigid panels need no implicit steps"],
        ),
    ],
)
def test_what_no_rigid_panel_is_is_refused(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(w in str(error.value) for w in words), str(error.value)


def test_held_panels_are_carried_for_the_memory_of_their_laws():
    model, parameters = hanging((0.04, 0.1)).set("crease_friction", friction_moment=1e-3, yield_angle=0.01).build()
    held = replace(model, free=np.zeros_like(model.free))
    path = np.stack([folded(model, [a]).x[:, 0] for a in np.linspace(0.0, 0.5, 6)])
    batch = batch_of(held, parameters, Drive(), folded(model, [0.0]))
    batch.carry(path[:, :, None], 0.01)
    assert np.abs(batch.state().memory).max() > 0
    assert batch.state().x[:, 0] == pytest.approx(path[-1], abs=1e-12)


def test_rigid_panels_rest_where_moments_balance():
    """One magnetic crease, K theta = m B cos theta; and a chain that hangs with rest angles, at rest from there on."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, panels="rigid").fix(panels=[0]).crease(stiffness=0.02)
    sheet.magnetise(1, remanence=0.13, volume=0.02 * 0.02 * 0.003, poling=(1, 0, 0))
    model, parameters = sheet.build()
    found = equilibrium(model, parameters, Drive(field=(0, 0, 0.2)))
    assert found.converged and found.stable
    assert np.degrees(found.angles[0]) == pytest.approx(47.788428, abs=1e-6)

    chain = hanging().crease(stiffness=0.05, rest_angle=np.array([0.5, -0.3]))
    model, parameters = chain.build()
    found = equilibrium(model, parameters)
    run = simulate(model, parameters, duration=0.3, rate=50.0, state=found.state)
    assert np.abs(found.angles).min() > 0.01
    assert np.abs(run.creases - run.creases[0]).max() < 1e-9
    model, parameters = hanging().crease(stiffness=1e-4).build()
    folded_back = folded(model, [np.pi - 0.02, 0.01])  # one panel in another
    upside_down = equilibrium(model, parameters, state=folded_back, unstable=True, contact=False)
    assert upside_down.converged and not upside_down.stable


@pytest.mark.parametrize("pattern", [miura(1, 1, 0.03, 0.03, 1.0, fold_angle=0.8), waterbomb(0.06, fold_angle=0.6)])
def test_closed_loops_stay_closed_and_keep_their_energy(pattern):
    sheet = Sheet(pattern, thickness=5e-4, panels="rigid").crease(stiffness=1e-3)
    model, parameters = sheet.build()
    parameters.set("crease", "rest_angle", 1.2 * parameters["crease", "rest_angle"])
    run = simulate(model, parameters, duration=0.5, rate=100.0)
    assert not run.failures and np.ptp(run.creases) > 0.1
    corners = model.triangles
    sides = [np.linalg.norm(x[corners] - x[np.roll(corners, 1, axis=1)], axis=-1) for x in run.x[:, :, 0]]
    assert np.ptp(np.array(sides), axis=0).max() < 1e-10
    assert np.ptp(run.energy_balance()) < 1e-6 * run.energies["kinetic"].max()


def test_a_miura_vertex_folds_as_its_closed_form_says():
    """Flat-foldable vertices of degree four: tan of half of one fold over tan of half of the other is constant."""
    model, parameters = (
        Sheet(miura(1, 1, 0.03, 0.03, 1.0, fold_angle=0.8), thickness=5e-4, panels="rigid")
        .crease(stiffness=1e-3)
        .build()
    )
    parameters.set("crease", "rest_angle", 1.3 * parameters["crease", "rest_angle"])
    run = simulate(model, parameters, duration=0.3, rate=100.0)
    half = np.abs(np.tan(0.5 * run.creases[:, :, 0]))
    ratio = half.min(axis=1) / half.max(axis=1)
    assert np.ptp(half[:, 0]) > 0.05
    assert ratio == pytest.approx(ratio[0], rel=1e-9)


@pytest.mark.parametrize("cells", [1, 2])
def test_a_miura_rests_where_its_energy_along_its_one_motion_is_least(cells):
    """Rest angles that no folded state meets: the minimum over the closed form's single parameter."""
    sides = (0.03, 0.03, 1.0)
    sheet = Sheet(miura(cells, cells, *sides, fold_angle=0.8), thickness=5e-4, panels="rigid")
    model, parameters = sheet.crease(stiffness=1e-3).build()
    count = len(model.creases)
    rng = np.random.default_rng(4)
    stiffness = parameters["crease", "stiffness"][:, 0] * rng.uniform(0.5, 2.0, count)
    rest = 1.5 * parameters["crease", "rest_angle"][:, 0] + rng.normal(scale=0.2, size=count)
    parameters.set("crease", "stiffness", stiffness).set("crease", "rest_angle", rest)

    def folds(theta):
        shape = Sheet(miura(cells, cells, *sides, fold_angle=theta), thickness=5e-4).mesh
        return dihedral_angles(shape.vertices, shape.creases)

    least = minimize_scalar(
        lambda t: 0.5 * np.sum(stiffness * (folds(t) - rest) ** 2), bounds=(0.2, 2.5), options={"xatol": 1e-10}
    )
    found = equilibrium(model, parameters)
    assert found.converged and found.stable, found.message
    # the energy is flat at its minimum, so that a search of it knows its place only to the root of rounding
    assert found.angles[:count] == pytest.approx(folds(least.x), abs=1e-6)
    assert abs(least.x - 0.8) > 0.1


def test_a_panel_that_turns_about_a_held_edge_hangs_from_it():
    """A pendulum of two panels, pulled sideways: each link points along weight and pull, and the edge stays."""
    sheet = Sheet(strip([0.03, 0.02], 0.02), thickness=1e-3, panels="rigid", triangulation="center")
    model, parameters = sheet.crease(stiffness=0.0).gravity((3.0, 0, -4.0)).fix(nodes=[0, 1]).build()
    found = equilibrium(model, parameters)
    assert found.converged and found.stable, found.message
    assert found.x[:2] == pytest.approx(model.position[:2], abs=1e-12)
    assert found.x[4] - found.x[0] == pytest.approx(0.05 * np.array([0.6, 0.0, -0.8]), abs=1e-9)


def test_an_arch_of_rigid_panels_held_at_both_ends_sags_to_rest():
    """A chain of equal links between two walls under its weight: the links' slopes go up in equal steps."""
    angles = np.array([0.9, 0.5, -0.5, -0.9])  # of the links
    nodes = np.concatenate(
        [[[0.0, 0.0]], np.cumsum(0.05 * np.stack([np.cos(angles), -np.sin(angles)], axis=1), axis=0)]
    )
    pattern = strip([0.02, *[0.05] * 4, 0.02], 0.03)
    line = np.concatenate([[[-0.02, 0.0]], nodes, [nodes[-1] + [0.02, 0.0]]])
    pattern.vertices[:, 0], pattern.vertices[:, 2] = np.repeat(line[:, 0], 2), np.repeat(line[:, 1], 2)
    sheet = Sheet(pattern, thickness=1e-3, panels="rigid").fix(panels=[0, 5]).gravity().crease(stiffness=0.0)
    found = equilibrium(*sheet.build())
    assert found.converged and found.stable, found.message
    x = found.state.x[2:12:2, 0]
    links = np.diff(x, axis=0)
    assert np.linalg.norm(links, axis=1) == pytest.approx(0.05, abs=1e-9)
    assert x[-1] == pytest.approx(pattern.vertices[10], abs=1e-9)
    slopes = -links[:, 2] / links[:, 0]  # tangents of a hanging chain of equal weights fall by equal steps
    assert np.diff(slopes) == pytest.approx(np.diff(slopes)[0], rel=1e-6)
    assert slopes[0] == pytest.approx(-slopes[-1], rel=1e-6) and slopes[0] > 0.5


@pytest.mark.parametrize("case", ["chain", "loop", "ground"])
def test_the_gpu_follows_the_cpu(cuda, case):
    """Only the compilers' rounding differs, which no step's error estimate sees."""
    options = {"duration": 0.5, "rate": 50.0, "dt": 2e-3}
    if case == "chain":
        model, parameters = hanging().crease(stiffness=2e-3).set("crease_friction", friction_moment=1e-4).build()
        state = State.join([folded(model, [a, 0.3]) for a in (0.2, 1.0, 1.9)])
    elif case == "loop":
        sheet = Sheet(miura(1, 1, 0.03, 0.03, 1.0, fold_angle=0.8), thickness=5e-4, panels="rigid")
        model, parameters = sheet.crease(stiffness=1e-3).build()
        parameters.set("crease", "rest_angle", 1.2 * parameters["crease", "rest_angle"])
        state = State.at_rest(model, 3)
    else:
        sheet = Sheet(strip([0.03, 0.03], 0.03), thickness=2e-3, panels="rigid").crease(stiffness=2e-3).gravity()
        for corner in ((0, -0.015, 0), (0, 0.015, 0), (0.06, -0.015, 0), (0.06, 0.015, 0)):
            sheet.contact(0 if corner[0] == 0 else 1, corner)
        sheet.set("ground", stiffness=500.0, damping=0.5).set("friction", stiffness=500.0, damping=0.5)
        model, parameters = sheet.set("coulomb", friction_coefficient=0.3).build()
        state = State.at_rest(model, 3)
        options["dt"] = 1e-4
    one, two = (simulate(model, parameters, state=state, **options, device=d) for d in ("cpu", cuda))
    assert not one.failures and not two.failures
    assert np.ptp(one.x, axis=0).max() > 1e-4
    assert np.abs(one.x - two.x).max() <= 1e-9 * np.ptp(one.x, axis=(0, 1, 2)).max()
    adaptive = [simulate(model, parameters, state=state, duration=0.2, rate=50.0, device=d) for d in ("cpu", cuda)]
    assert np.abs(adaptive[0].x - adaptive[1].x).max() <= 1e-7 * np.ptp(one.x, axis=(0, 1, 2)).max()


def rubs(tolerance: float, moment: float = 2e-4, yields: float = 3e-3) -> np.ndarray:
    """Angles (100, 2) of a swing of two hinges with dry friction."""
    sheet = hanging((0.03, 0.03, 0.03)).crease(stiffness=2e-4)
    sheet.set("crease_friction", friction_moment=moment, yield_angle=yields)
    model, parameters = sheet.build()
    batch = RigidBatch(model, parameters, Drive(), folded(model, [0.9, -0.7]), tolerance=tolerance)
    return batch.film(100, 1, 0.02, np.inf)[1][:, :2, 0]


def test_a_step_hides_no_reversal_from_a_law_with_memory():
    """Swings with dry friction: what a hinge turns forth and back within a step is no turn to the bristle."""
    exact = rubs(1e-13)
    assert np.ptp(exact, axis=0).min() > 0.5
    errors = [np.abs(rubs(t) - exact).max() for t in (1e-8, 1e-10)]
    assert errors[0] < 1e-4 and errors[1] < 1e-5


def test_a_motion_changes_smoothly_where_a_hinge_reverses_within_a_step():
    """Differences by ever smaller changes of a friction agree: steps end at a reversal, whichever world it is in."""
    changes = np.array([1e-5, 3e-5, 1e-4])
    plain = rubs(1e-8, yields=3e-4)
    slopes = [(rubs(1e-8, 2e-4 * (1.0 + c), 3e-4) - plain) / c for c in changes]
    size = np.abs(slopes[-1]).max()
    assert all(np.abs(s - slopes[-1]).max() < 0.01 * size for s in slopes)


def rubbing_swing():
    sheet = hanging((0.03, 0.03, 0.03)).crease(stiffness=2e-4)
    sheet.set("crease_friction", friction_moment=2e-4, yield_angle=3e-3)
    model, parameters = sheet.build()
    return model, parameters, Drive(), folded(model, [0.9, -0.7])


def test_a_held_sheet_starts_anew_with_what_its_laws_remember():
    """A swing that is put back where it just was goes on as if nothing had been done."""
    given = model, *_ = rubbing_swing()
    whole, cut = (RigidBatch(*given) for _ in range(2))
    for batch in (whole, cut):
        batch.film(20, 1, 0.01, np.inf)
    arm, state = Articulation(model), cut.state()
    pose = arm.poses_of(state.x, state.angles)
    rates = arm.rates_of(pose, state.x, state.v)
    _, other, kept, before = cut.film_anew(30, 0.01, [0], pose.angles[None], rates[None])
    one = whole.film(30, 1, 0.01, np.inf)[1]
    assert np.ptp(one, axis=0).max() > 0.5
    assert np.abs(one - other).max() < 1e-6
    assert np.abs(before[0] - rates).max() < 1e-9 < np.abs(rates).max()
    assert np.abs(kept[0] - state.memory).max() < 1e-12 < np.abs(kept[0]).max()
    floating = Sheet(strip([0.03, 0.03], 0.03), thickness=2e-3, panels="rigid").crease(stiffness=2e-3)
    free = RigidBatch(*(made := floating.build()), Drive(), State.at_rest(made[0]))
    with pytest.raises(InputError, match=r"only a sheet that is held.*restart"):
        free.film_anew(1, 0.01, [0], np.zeros((1, 1, 1)), np.zeros((1, 1, 1)))


def again_and_again(device: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Films and memories of two swings that start anew twice, in one launch and in one for each start."""
    model, parameters, drive, state = rubbing_swing()
    state, moved = State.join([state, folded(model, [0.4, 0.2])]), np.array([[0.3, -0.2], [0.1, 0.5]])
    when, angles, rates = [7, 19], np.stack([moved, -moved]), np.stack([4.0 * moved, moved])
    one, other = (RigidBatch(model, parameters, drive, state, device=device, tolerance=1e-8) for _ in range(2))
    _, film, kept, _ = one.film_anew(30, 0.01, when, angles, rates)
    parts, memories = [other.film(7, 1, 0.01, np.inf)[1]], []
    for n, frames in enumerate((12, 11)):
        memories.append(other.remembered())
        parts.append(other.film_anew(frames, 0.01, [0], angles[n : n + 1], rates[n : n + 1])[1])
    return [film, np.concatenate(parts)], [kept, np.stack(memories)]


def test_starts_anew_in_one_launch():
    for one, other in again_and_again("cpu"):
        assert np.ptp(one) > 0.0 and np.array_equal(one, other)


def test_starts_anew_on_a_gpu(cuda):
    for here, there in zip(again_and_again("cpu"), again_and_again(cuda), strict=True):
        assert np.array_equal(*there)
        assert np.abs(here[0] - there[0]).max() < 1e-6 * np.abs(here[0]).max()
