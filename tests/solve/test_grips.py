"""Held nodes that move along a path: base excitation, test machines, and what their grips exert."""

from dataclasses import replace

import numpy as np
import pytest
from effects.kit import slope
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from origami_sim import Drive, Model, Parameters, Sheet, ramp, series, simulate, sine, strip
from origami_sim.model import State
from origami_sim.model.bodies import body_of

G = 9.80665
LENGTHS = (0.02, 0.03)
STIFFNESS = 2e-3


def flap(panels="rigid", *, grip="grip", damping=0.0, gravity=False, **where):
    """A flap on a crease of a base that is held, or in a grip that goes up and down unless told otherwise."""
    sheet = Sheet(strip(list(LENGTHS), width=0.02), thickness=1e-3, material="pdms", panels=panels)
    sheet.crease(stiffness=STIFFNESS, loss_time=damping)
    if gravity:
        sheet.gravity()
    if grip == "fix":
        return sheet.fix(panels=[0]).build()
    return sheet.grip("base", panels=[0], **(where or {"direction": (0, 0, 1)})).build()


def chain(panels="rigid", *, gravity=None, gripped=True, lengths=(0.01,) * 5, width=0.01):
    """Panels between two clamps, a closed loop, which starts folded: flat it would be at a dead centre."""
    pattern, slopes = strip(list(lengths), width), np.array([0.0, 0.5, -0.4, -0.2, 0.0])
    steps = np.stack([np.cos(slopes), np.sin(slopes)], axis=1) * np.array(lengths)[:, None]
    stations = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    at = np.round(pattern.vertices[:, 0] / lengths[0]).astype(int)
    pattern.vertices[:, [0, 2]] = stations[at]
    sheet = Sheet(pattern, thickness=3e-4, material="pdms", panels=panels)
    sheet.crease(stiffness=2e-4, rest_angle=np.resize([0.5, -1.0, -0.2, 0.5], len(lengths) - 1), loss_time=2e-3)
    sheet.touch(False)
    if gravity is not None:
        sheet.gravity(gravity)
    last = len(lengths) - 1
    if not gripped:
        return sheet.fix(panels=[0, last]).build()
    sheet.grip("left", panels=[0], direction=(1, 0, 0)).grip("right", panels=[last], direction=(-1, 0, 0))
    return sheet.build()


def mass_on_spring(stiffness=30.0, mass=2e-3, length=0.05):
    """A mass on a bar whose other end is in a grip that moves along it."""
    none = np.zeros((0, 4), np.int32)
    model = Model(
        position=np.array([[0.0, 0, 0], [length, 0, 0]]), free=np.array([[0.0, 0, 0], [1, 0, 0]]),
        bars=np.array([[0, 1]], np.int32), creases=none, bends=none, triangles=none[:, :3],
        triangle_panel=np.zeros(0, np.int32), contacts=none[:, :3], contact_weights=np.zeros((0, 3)),
        contact_offsets=np.zeros(0), contact_axes=np.zeros((0, 3)), electrodes=np.zeros(0, np.int32), effects=("bars",),
        names={"grip": ("shaker",)}, grips=np.array([0, -1], np.int32), grip_screws=np.array([[0.0, 0, 0, 1, 0, 0]]),
    )  # fmt: skip
    parameters = Parameters(model).set("bars", "rest_length", length).set("bars", "stiffness", stiffness)
    return model, parameters.set("inertia", "mass", mass)


def shaken_mass(t, stiffness=30.0, mass=2e-3, amplitude=1e-3, omega=2 * np.pi * 12.0):
    """Displacement of a mass at rest whose base moves as A sin(omega t), from the undamped equation of motion."""
    own = np.sqrt(stiffness / mass)
    height = amplitude * own**2 / (own**2 - omega**2)
    return height * (np.sin(omega * t) - omega / own * np.sin(own * t))


# a shaken base -------------------------------------------------------------------------------------------------------


def test_mass_on_a_shaken_spring_follows_the_closed_form_to_second_order():
    model, parameters = mass_on_spring()
    errors = []
    steps = np.array([8e-5, 4e-5, 2e-5])
    for dt in steps:
        run = simulate(
            model, parameters, Drive(grips={"shaker": sine("1 mm", "12 Hz")}), duration=0.2, rate=250, dt=float(dt)
        )
        moved = run.x[:, 1, 0, 0] - 0.05
        errors.append(np.abs(moved - shaken_mass(run.times)).max())
    assert abs(slope(steps, errors) - 2.0) < 0.1
    assert errors[-1] < 1e-6 * 0.05
    # the force on the base is that which its own mass needs, and the spring's
    base = 1e-3 * np.sin(2 * np.pi * 12 * run.times)
    needed = -2e-3 * (2 * np.pi * 12) ** 2 * base - 30.0 * (moved - base)
    np.testing.assert_allclose(run.grip_load("shaker")[:, 0], needed, atol=1e-5 * np.abs(needed).max())


@pytest.mark.parametrize("method", ["explicit", "implicit"])
def test_work_of_the_grip_closes_the_energy_balance(method):
    model, parameters = flap("elastic", damping=3e-3, gravity=True)
    drive = Drive(grips={"base": sine("1 mm", "20 Hz")})
    run = simulate(model, parameters, drive, duration=0.2, rate=200, method=method)
    without = run.energy_balance() + run.work["grips"]
    assert run.energy_error < (1e-3 if method == "explicit" else 1e-8)
    assert np.ptp(without) > 100 * np.ptp(run.energy_balance())  # which it would not without that work


def test_both_solvers_of_bars_agree_on_a_shaken_flap():
    model, parameters = flap("elastic", damping=3e-3, gravity=True)
    drive = Drive(grips={"base": sine("1 mm", "20 Hz")})
    one = simulate(model, parameters, drive, duration=0.1, rate=200, accuracy=1e-4)
    other = simulate(model, parameters, drive, duration=0.1, rate=200, method="implicit", tolerance=1e-6)
    np.testing.assert_allclose(other.creases, one.creases, atol=3e-4)
    np.testing.assert_allclose(other.grip_load("base"), one.grip_load("base"), atol=5e-3 * one.grip_load("base").max())


def fold_by_lagrange(body, hinge, path, times):
    """Fold angle of a flap whose hinge line (along y) follows hinge(s), which turns by angle(s): SciPy's DOP853."""
    mass, arm, inertia, place, angle = body

    def rates(t, y):
        s, ds, dds = path(t)
        turn = angle * np.array([s, ds, dds])
        c, n = np.cos(turn[0]), np.sin(turn[0])
        # the hinge, turned about the origin or shifted upwards
        if angle:
            there, across = np.array([c * place[0], n * place[0]]), np.array([-n * place[0], c * place[0]])
            pull = turn[2] * across - turn[1] ** 2 * there
        else:
            pull = np.array([0.0, dds])
        about = y[0] + turn[0]
        normal = np.array([-np.sin(about), np.cos(about)])
        whole = inertia + mass * arm**2
        return [y[1], -(STIFFNESS * y[0] + mass * arm * normal @ pull) / whole - turn[2]]

    start = [0.0, hinge]
    found = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, method="DOP853", rtol=1e-12, atol=1e-14)
    return found.y[0]


def about(model, parameters):
    """Mass, distance of its centre from the hinge and inertia of the flap, and where its hinge is."""
    centre, tensor = body_of(parameters, 1)
    hinge = model.position[model.creases[0, 1]]
    return float(parameters["body", "mass"][1, 0]), float(centre[0] - hinge[0]), float(tensor[1, 1]), hinge


def sine_path(amplitude, frequency):
    w = 2 * np.pi * frequency
    return lambda t: (amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w**2 * np.sin(w * t))


@pytest.mark.parametrize("turning", [False, True])
def test_rigid_flap_on_a_shaken_base_follows_lagranges_equation(turning):
    where = {"axis": (0, -1, 0)} if turning else {}
    model, parameters = flap(**where)
    mass, arm, inertia, hinge = about(model, parameters)
    height, often = (0.3, 3.0) if turning else (2e-3, 15.0)
    path = sine_path(height, often)
    moved = {"turns" if turning else "grips": {"base": sine(height, often)}}
    # the base starts with a blow, to which the flap answers at once: no moment acts at the hinge
    whole = inertia + mass * arm**2
    speed = path(0.0)[1]
    blow = -(mass * arm * hinge[0] / whole + 1.0) * speed if turning else -mass * arm / whole * speed
    run = simulate(model, parameters, Drive(**moved), duration=0.4, rate=250)
    truth = fold_by_lagrange((mass, arm, inertia, hinge, float(turning)), blow, path, run.times)
    assert np.ptp(truth) > 0.1
    np.testing.assert_allclose(run.creases[:, 0, 0], truth, atol=1e-7)
    assert run.energy_error < 1e-7


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
@pytest.mark.parametrize("where", [{"direction": (1, 0, 2)}, {"axis": (0, 1, 1), "point": (0.01, 0, 0.02)}])
def test_what_a_grip_exerts_is_what_momentum_gains(panels, where):
    """Newton and Euler for the whole device: force and moment are the rates of its momenta, less weight."""
    model, parameters = flap(panels, gravity=True, damping=2e-3, **where)
    turning = "axis" in where
    path = {"base": sine(0.2 if turning else 1e-3, 8.0)}
    run = simulate(
        model, parameters, Drive(**{"turns" if turning else "grips": path}), duration=0.1, rate=4000,
        **({"dt": 2e-5} if panels == "elastic" else {}),
    )  # fmt: skip
    mass = parameters["inertia", "mass"][:, 0]
    x, v = run.x[:, :, 0], run.v[:, :, 0]
    momentum = np.einsum("n,fna->fa", mass, v)
    angular = np.einsum("n,fna->fa", mass, np.cross(x, v))
    weight = np.einsum("n,fna->fa", mass, np.broadcast_to([0, 0, -G], x.shape))
    tilt = np.einsum("n,fna->fa", mass, np.cross(x, np.broadcast_to([0, 0, -G], x.shape)))
    force = CubicSpline(run.times, momentum)(run.times, 1) - weight
    moment = CubicSpline(run.times, angular)(run.times, 1) - tilt
    held = x[:, model.grips == 0].mean(axis=1)
    if turning:
        along = np.array(where["axis"]) / np.sqrt(2.0)
        on = np.array(where["point"])
        held = on + ((held - on) @ along)[:, None] * along
    given = run.grip_wrenches[:, 0, 0]
    inner = slice(20, -20)
    close = 2e-2 if panels == "elastic" else 1e-4
    np.testing.assert_allclose(given[inner, :3], force[inner], atol=close * np.abs(force).max())
    moment = moment - np.cross(held, force)
    np.testing.assert_allclose(given[inner, 3:], moment[inner], atol=close * np.abs(moment).max())


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_panels_between_grips_that_fall_alike_feel_no_weight(panels):
    """In a frame that accelerates evenly there is a field of gravity more, and nothing else."""
    a = 5.0
    model, parameters = chain(panels)
    times = np.linspace(0.0, 0.1, 11)
    path = series(times, 0.5 * a * times**2, smooth=True)
    opposite = series(times, -0.5 * a * times**2, smooth=True)
    run = simulate(model, parameters, Drive(grips={"left": path, "right": opposite}), duration=0.1, rate=100)
    still = simulate(*chain(panels, gravity=(-a, 0, 0), gripped=False), duration=0.1, rate=100)
    np.testing.assert_allclose(run.creases, still.creases, atol=1e-6)
    ahead = 0.5 * a * run.times[:, None, None] ** 2 * np.array([1.0, 0, 0])
    np.testing.assert_allclose(run.x[:, :, 0] - ahead, still.x[:, :, 0], atol=1e-8)
    assert run.energy_error < (1.5 * still.energy_error if panels == "elastic" else 1e-6)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_grip_of_constant_velocity_moves_the_frame_alone(panels):
    """Galilei: in still vacuum the motion is that of a base at rest."""
    model, parameters = flap(panels, damping=2e-3, direction=(1, 2, 2))
    start = State.at_rest(model)
    speed = 0.3 * np.array([1, 2, 2]) / 3
    first = replace(start, v=start.v + speed)
    parameters.set("crease", "rest_angle", 0.6)
    run = simulate(
        model, parameters, Drive(grips={"base": series([0, 1], [0, 0.3])}), duration=0.1, rate=200, state=first
    )
    still = simulate(model, parameters, duration=0.1, rate=200)
    np.testing.assert_allclose(run.creases, still.creases, atol=1e-9)
    np.testing.assert_allclose(run.x - run.times[:, None, None, None] * speed, still.x, atol=1e-10)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_a_grip_that_stands_changes_nothing(panels):
    plain, stood = (
        simulate(*flap(panels, grip=g, damping=2e-3, gravity=True), duration=0.05, rate=200) for g in ("fix", "grip")
    )
    idle = simulate(*flap(panels, damping=2e-3, gravity=True), Drive(grips={"base": 0.0}), duration=0.05, rate=200)
    for run in (stood, idle):
        for name in ("x", "v", "angles"):
            np.testing.assert_array_equal(getattr(run, name), getattr(plain, name))
        assert run.grip_wrenches is None


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_a_device_that_a_grip_holds_altogether_moves_with_it(panels):
    sheet = Sheet(strip(list(LENGTHS), width=0.02), thickness=1e-3, material="pdms", panels=panels)
    sheet.crease(stiffness=STIFFNESS).gravity().grip("base", panels=[0, 1], direction=(0, 0, 1))
    model, parameters = sheet.build()
    run = simulate(model, parameters, Drive(grips={"base": sine("1 mm", "10 Hz")}), duration=0.1, rate=400)
    lift, _, pull = sine_path(1e-3, 10.0)(run.times)
    moved = run.x - run.x[0]
    np.testing.assert_allclose(moved, lift[:, None, None, None] * np.broadcast_to([0, 0, 1], moved.shape), atol=1e-12)
    weight = parameters["inertia", "mass"].sum() * (G + pull)
    np.testing.assert_allclose(run.grip_load("base")[:, 0], weight, atol=1e-9)
    assert run.energy_error < 1e-2


def test_motion_goes_on_in_its_grip_from_a_state():
    model, parameters = flap("elastic", damping=2e-3)
    drive = Drive(grips={"base": sine("1 mm", "20 Hz")})
    whole = simulate(model, parameters, drive, duration=0.1, rate=200)
    first = simulate(model, parameters, drive, duration=0.05, rate=200)
    then = simulate(model, parameters, drive, duration=0.05, rate=200, state=first.state)
    np.testing.assert_array_equal(then.x[-1], whole.x[-1])
    np.testing.assert_allclose(then.work["grips"][-1], whole.work["grips"][-1], rtol=1e-12)


def test_loops_of_rigid_panels_go_on_from_a_state_as_fast_as_they_were():
    model, parameters = chain("rigid")
    drive = Drive(grips={"left": ramp("1 mm", "0.1 s", smooth=True)})
    first = simulate(model, parameters, drive, duration=0.05, rate=200)
    then = simulate(model, parameters, drive, duration=0.01, rate=200, state=first.state)
    np.testing.assert_allclose(then.v[0], first.v[-1], atol=1e-13)


def test_worlds_may_differ_in_their_paths():
    model, parameters = flap(damping=2e-3)
    drive = Drive(grips={"base": sine(np.array([1e-3, 2e-3]), np.array([10.0, 20.0]))})
    both = simulate(model, parameters, drive, duration=0.1, rate=200)
    for w, (height, often) in enumerate(((1e-3, 10.0), (2e-3, 20.0))):
        one = simulate(model, parameters, Drive(grips={"base": sine(height, often)}), duration=0.1, rate=200)
        np.testing.assert_array_equal(both.x[:, :, [w]], one.x)
        np.testing.assert_array_equal(both.grip_wrenches[:, :, [w]], one.grip_wrenches)


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_the_gpu_moves_grips_as_the_cpu_does(cuda, panels):
    model, parameters = flap(panels, damping=0.01)
    drive = Drive(grips={"base": sine("2 mm", "8 Hz")})
    runs = [simulate(model, parameters, drive, duration=0.3, rate=100, device=device) for device in ("cpu", cuda)]
    assert np.abs(runs[0].x - runs[1].x).max() < 1e-7
    assert np.abs(runs[0].grip_wrenches - runs[1].grip_wrenches).max() < 1e-4 * np.abs(runs[0].grip_wrenches).max()
