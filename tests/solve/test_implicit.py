"""Implicit steps against closed forms and the explicit solver: order, energy, stiffness, memory, contact, failures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.special import ellipj, ellipk
from structures import PLAIN, flap, kresling, lengths, model_of, strip, truss

from origami_sim.drive import Drive, ramp, series, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.solve.motion import implicit
from origami_sim.solve.motion.dynamics import Trajectory, simulate
from origami_sim.solve.statics.equilibria import equilibrium, tangent
from origami_sim.solve.timestep import stable_step

EFFECTS = (
    *PLAIN,
    "ogden_bars",
    "crease_stop",
    "crease_relaxation",
    "crease_viscosity",
    "mass_damping",
    "gravity",
    "ground",
    "coulomb",
    "friction",
)
"""One set of effects for all models here, so that they share their kernels."""

G = 9.81


def quiet(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """The model with all of EFFECTS, those that it did not have doing nothing."""
    model = replace(model, effects=EFFECTS)
    out = parameters.for_model(model)
    for owner, name, value in (
        ("gravity", "gravity_z", 0.0),
        ("ground", "stiffness", 0.0),
        ("friction", "stiffness", 1e-9),
    ):
        out.set(owner, name, value)
    return model, out


def run(model, parameters, drive=None, **options) -> Trajectory:
    out = simulate(model, parameters, drive, method="implicit", **options)
    assert not out.failures, out.failures
    return out


def order(steps, errors) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def drift(t: Trajectory) -> np.ndarray:
    """Change of the energy less the work fed in, of the first world [F] [J]."""
    balance = t.energy_balance()[:, 0]
    return balance - balance[0]


# --- a pendulum on a stiff bar ----------------------------------------------------------------------------------------

ARM = 0.1
PERIOD = 4 * ellipk(0.5) * math.sqrt(ARM / G)


def pendulum() -> tuple[Model, Parameters]:
    """A mass on a bar of 1 MN/m, released from the horizontal."""
    model = model_of([(0, 0, 0), (ARM, 0, 0)], PLAIN, bars=[(0, 1)], held=[0, (1, 1)])
    p = Parameters(model, {("bars", "stiffness"): 1e6, ("bars", "rest_length"): ARM, ("inertia", "mass"): 1e-3})
    model, p = quiet(model, p)
    return model, p.set("gravity", "gravity_z", -G)


def swing(t: np.ndarray) -> np.ndarray:
    """Positions of a rigid pendulum at times t [F, 3] (Jacobi's elliptic sine)."""
    sn = ellipj(ellipk(0.5) - math.sqrt(G / ARM) * t, 0.5)[0]
    angle = 2 * np.arcsin(math.sqrt(0.5) * sn)
    return ARM * np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=-1)


def test_pendulum_converges_with_second_order_far_above_the_explicit_limit():
    model, p = pendulum()
    limit = stable_step(model, p).limit
    steps, errors = [], []
    for n in (100, 200, 400):
        r = run(model, p, duration=PERIOD, rate=50 / PERIOD, dt=PERIOD / n)
        steps.append(r.dt)
        errors.append(np.abs(r.x[:, 1, 0] - swing(r.times)).max() / ARM)
    assert steps[-1] > 25 * limit
    assert order(steps, errors) == pytest.approx(2, abs=0.1)
    assert errors[-1] < 5e-4


def test_adapted_steps_keep_to_their_tolerance():
    model, p = pendulum()
    errors = []
    for tolerance in (1e-4, 1e-6):
        r = run(model, p, duration=PERIOD, rate=50 / PERIOD, tolerance=tolerance)
        errors.append(np.abs(r.x[:, 1, 0] - swing(r.times)).max() / ARM)
    # errors of third order per step add up to second order: a hundredth of the tolerance is 0.046 of the error
    assert errors[1] < 0.1 * errors[0] < 1e-3


@pytest.mark.slow
def test_pendulum_keeps_its_energy_over_100_periods():
    model, p = pendulum()
    r = run(model, p, duration=100 * PERIOD, rate=20 / PERIOD, dt=PERIOD / 100)
    assert np.abs(drift(r)).max() < 1e-4 * 1e-3 * G * ARM


# --- a folding crease -------------------------------------------------------------------------------------------------


def folding() -> tuple[Model, Parameters, State]:
    """A flap that is thrown up and swings on its crease; its bars are no stiffer than the explicit solver likes."""
    model, p = quiet(*flap(stiffness=0.02, membrane=1e3))
    p.set("inertia", "mass", 1e-3)
    state = State.at_rest(model)
    state.v[2, 0, 2] = 1.0
    return model, p, state


def test_crease_agrees_with_the_explicit_solver_to_second_order():
    model, p, state = folding()
    limit, end = stable_step(model, p).limit, 0.1
    exact = simulate(model, p, duration=end, rate=4 / end, state=state.copy(), dt=limit / 512)
    steps, errors = [], []
    for n in (8, 16, 32):
        r = run(model, p, duration=end, rate=4 / end, state=state.copy(), dt=limit / n)
        steps.append(r.dt)
        errors.append(np.abs(r.x - exact.x).max())
    assert np.ptp(exact.creases) > 0.15
    assert order(steps, errors) == pytest.approx(2, abs=0.1)
    explicit = simulate(model, p, duration=end, rate=4 / end, state=state.copy(), dt=limit / 32)
    assert errors[-1] < 3 * np.abs(explicit.x - exact.x).max()


@pytest.mark.parametrize("periods", [10, pytest.param(100, marks=pytest.mark.slow)])
def test_energy_of_a_swinging_crease_stays(periods):
    """At the explicit limit of the step, while the bars ring some hundred times per period of the fold."""
    model, p, state = folding()
    r = run(model, p, duration=0.2 * periods, rate=50, state=state, dt=stable_step(model, p).limit)
    assert np.count_nonzero(np.diff(np.sign(r.creases[:, 0, 0]))) >= 2 * periods
    assert np.abs(drift(r)).max() < 1e-6 * r.energies["kinetic"][0, 0]


def test_driven_and_damped_crease_agrees_with_the_explicit_solver():
    """Work of load, loss and relaxation as well as the motion, to second order."""
    model, p, state = folding()
    p.set("load", "force_z", 0.5, entities=2).set("crease_viscosity", "viscosity", 2e-5)
    p.set("crease_relaxation", "stiffness_1", 0.02).set("crease_relaxation", "time_1", 0.02)
    p.set("mass_damping", "decay_rate", 3.0)
    drive, limit, end = Drive(load=sine(1.0, 15.0)), stable_step(model, p).limit, 0.05
    options = {"duration": end, "rate": 20 / end, "drive": drive}
    exact = simulate(model, p, state=state.copy(), dt=limit / 512, **options)
    steps, errors, works = [], [], []
    for n in (16, 32, 64):
        r = run(model, p, state=state.copy(), dt=limit / n, **options)
        steps.append(r.dt)
        errors.append(np.abs(r.x - exact.x).max())
        works.append(max(np.abs(r.work[e] - exact.work[e]).max() for e in model.effects))
        assert np.abs(drift(r)).max() < 1e-6 * r.energies["kinetic"][0, 0]
    assert order(steps, errors) == pytest.approx(2, abs=0.1)
    assert order(steps, works) == pytest.approx(2, abs=0.1)


# --- stiff parts ------------------------------------------------------------------------------------------------------


def test_tape_swings_in_its_first_mode_at_1000_times_the_explicit_step():
    """Adhesive tape, 1.6 GPa, 50 um: frequency against the eigenvalue, and against the rule's own closed form."""
    modulus, thick, width, long, cells, density = 1.6e9, 50e-6, 0.019, 0.06, 12, 1000.0
    rigidity = modulus / (1 - 0.3**2) * thick**3 / 12 * width
    model, p = quiet(*strip(cells, length=long, width=width, rigidity=rigidity, membrane=modulus * thick * width))
    mass = density * thick * width * long / cells / 2
    p.set("inertia", "mass", mass).set("inertia", "mass", mass / 2, entities=[2 * cells + 2, 2 * cells + 3])
    free = np.flatnonzero(model.free.ravel())
    m = np.repeat(p["inertia", "mass"][:, 0], 3)[free]
    values, modes = eigh(tangent(model, p).toarray()[np.ix_(free, free)], np.diag(m))
    omega = math.sqrt(values[0])
    beam = 1.875104**2 * math.sqrt(rigidity / (density * thick * width * long**4))
    assert omega == pytest.approx(beam, rel=0.01)

    bent = equilibrium(model, p, Drive(load=0.03 * rigidity / long**2))
    assert bent.x[-1, 2] == pytest.approx(-0.01 * long, rel=0.02)
    limit = stable_step(model, p).limit
    for factor in (1000, 4000):
        h = factor * limit
        r = run(model, p, duration=4 * 2 * math.pi / omega, rate=1 / h, dt=h, state=bent.state)
        # higher modes do not show in this: modes are orthogonal
        z = (r.x[:, :, 0] - model.position).reshape(len(r.times), -1)[:, free] @ (m * modes[:, 0])
        up = np.flatnonzero((z[:-1] < 0) & (z[1:] >= 0))
        crossing = r.times[up] - z[up] * np.diff(r.times)[up] / (z[up + 1] - z[up])
        measured = 2 * math.pi * (len(up) - 1) / (crossing[-1] - crossing[0])
        assert measured == pytest.approx(2 / h * math.atan(omega * h / 2), rel=3e-4)
        assert measured == pytest.approx(omega, rel=1.2 * (omega * h) ** 2 / 12 + 2e-4)
        assert np.abs(z[-len(z) // 5 :]).max() == pytest.approx(np.abs(z).max(), rel=0.02)
        assert np.abs(drift(r)).max() < 1e-3 * r.energy_balance()[0, 0]


# --- snap-through -----------------------------------------------------------------------------------------------------


def test_truss_keeps_its_energy_through_the_snap():
    """Over the barrier with 2 percent to spare, at steps of half the explicit limit and of four times it."""
    model, p = quiet(*truss(rise=0.3, stiffness=100.0))
    p.set("inertia", "mass", 0.5)
    barrier = 100.0 * (math.hypot(1, 0.3) - 1) ** 2
    state = State.at_rest(model)
    state.v[2, 0, 2] = -1.02 * math.sqrt(2 * barrier / 0.5)
    limit = stable_step(model, p).limit
    options = {"duration": 8.0, "state": state}
    exact = simulate(model, p, rate=20, dt=limit / 100, **options)
    for factor in (0.5, 4.0):
        r = run(model, p, rate=20 if factor < 1 else 1 / (factor * limit), dt=factor * limit, **options)
        assert r.x[:, 2, 0, 2].min() < -0.42 and exact.x[:, 2, 0, 2].min() < -0.42
        assert np.abs(drift(r)).max() < 1e-7 * barrier
        after = r.energies["kinetic"][-1, 0] + r.energies["bars"][-1, 0]
        expected = exact.energies["kinetic"][-1, 0] + exact.energies["bars"][-1, 0]
        assert after == pytest.approx(expected, rel=1e-4)  # the explicit one's own error


def test_kresling_cell_that_snaps_shut_keeps_its_energy():
    model, p = quiet(*kresling())
    limit = stable_step(model, p).limit
    push = Drive(load=ramp(2.0, 0.5))
    r = run(model, p, push, duration=6.0, rate=10, dt=limit)
    height = r.x[:, 8:, 0, 2].mean(axis=1)
    fed = r.work["load"][-1, 0]
    exact = simulate(model, p, push, duration=6.0, rate=10, dt=limit / 16)
    assert height.min() < -0.5
    assert np.abs(drift(r)).max() < 2e-4 * fed
    assert fed == pytest.approx(exact.work["load"][-1, 0], rel=0.1)
    assert np.abs(height[:31] - exact.x[:31, 8:, 0, 2].mean(axis=1)).max() < 0.02


# --- memory -----------------------------------------------------------------------------------------------------------


def creeping() -> tuple[Model, Parameters, Drive, np.ndarray, np.ndarray]:
    """A crease with three relaxing branches under a dead load that lifts it by a milliradian."""
    model, p = quiet(*flap(stiffness=0.02))
    p.set("inertia", "mass", 1e-4).set("load", "force_z", 1e-3, entities=2)
    stiffness, times = np.array([0.01, 0.006, 0.004]), np.array([0.5, 20.0, 400.0])
    for i in range(3):
        p.set("crease_relaxation", f"stiffness_{i + 1}", stiffness[i]).set(
            "crease_relaxation", f"time_{i + 1}", times[i]
        )
    return model, p, Drive(load=ramp(1.0, 0.01)), stiffness, times


@pytest.mark.parametrize(("options", "error"), [({"dt": 0.5}, 1e-3), ({"tolerance": 1e-6}, 1.5e-3)])
def test_crease_creeps_for_1000_s_as_its_prony_series_says(options, error):
    """K theta + sum q = M and q_i' = K_i theta' - q_i / tau_i, solved by the matrix exponential."""
    model, p, drive, stiffness, times = creeping()
    r = run(model, p, drive, duration=1000.0, rate=0.1, spectral_radius=0.5, **options)
    moment, k = 1e-3 * 0.02, 0.02
    rates = np.outer(stiffness, 1 / times) / (k + stiffness.sum()) - np.diag(1 / times)
    start = stiffness * moment / (k + stiffness.sum())
    exact = np.array([(moment - (expm(rates * t) @ start).sum()) / k for t in r.times[1:]])
    assert exact[0] < 0.8 * moment / k < 0.97 * moment / k < exact[-1]
    assert np.abs(r.creases[1:, 0, 0] / exact - 1).max() < error
    assert r.creases[-1, 0, 0] == pytest.approx(exact[-1], rel=1e-5)


def sliding() -> tuple[Model, Parameters, State]:
    """A panel that lies on three feet, thrown along the ground."""
    model = model_of(
        [(0, 0, 0), (0.01, 0, 0), (0, 0.01, 0)], PLAIN, bars=[(0, 1), (1, 2), (0, 2)], triangles=[(0, 1, 2)]
    )
    model = replace(
        model,
        contacts=np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1)]),
        contact_weights=np.tile([1.0, 0, 0], (3, 1)),
        contact_offsets=np.zeros(3),
        contact_axes=np.zeros((3, 3)),
    )
    p = Parameters(
        model, {("bars", "stiffness"): 1e4, ("bars", "rest_length"): lengths(model), ("inertia", "mass"): 1e-3}
    )
    model, p = quiet(model, p)
    p.set("gravity", "gravity_z", -G).set("plane", "reach", 1.0)
    p.set("ground", "stiffness", 500.0).set("ground", "damping", 0.5)
    p.set("friction", "stiffness", 200.0).set("friction", "damping", 0.1).set("coulomb", "friction_coefficient", 0.3)
    state = State.at_rest(model)
    state.v[:, 0, 0] = 0.1
    return model, p, state


def test_memory_does_not_depend_on_the_number_of_iterations(monkeypatch):
    """Friction and relaxation with hardly a tangent, and with one for every correction."""
    for case in (sliding(), creeping()):
        model, p, rest = case[0], case[1], case[2]
        state, drive = (rest, None) if isinstance(rest, State) else (None, rest)
        results = []
        for slow in (0.5, -1.0):
            monkeypatch.setattr(implicit, "SLOW", slow)
            r = run(model, p, drive, duration=0.05, rate=100, dt=1e-3, state=state and state.copy())
            results.append(r)
        few, many = results
        assert few.notes != many.notes
        assert np.abs(few.state.memory).max() > 1e-6
        # each step ends within NEWTON of the solution
        assert np.abs(few.state.memory - many.state.memory).max() < 1e-7 * np.abs(few.state.memory).max()
        assert np.abs(few.x - many.x).max() < 1e-11


# --- contact ----------------------------------------------------------------------------------------------------------


def test_sliding_panel_stops_where_friction_says():
    model, p, state = sliding()
    limit = stable_step(model, p).limit
    exact = simulate(model, p, duration=0.2, rate=100, dt=limit / 50, state=state.copy())
    for options in ({"dt": 1e-3}, {}):
        r = run(model, p, duration=0.2, rate=100, state=state.copy(), **options)
        assert np.abs(r.x - exact.x).max() < 3e-6
        assert np.abs(r.v[-1]).max() < 1e-4
        assert r.x[-1, 0, 0, 0] == pytest.approx(0.1**2 / (2 * 0.3 * G), rel=0.02)


def test_bouncing_panel_keeps_its_energy_where_steps_resolve_the_contact():
    """The ground's spring sets in within a step; adapted steps find that."""
    model, p, _ = sliding()
    p.set("ground", "damping", 0.0)
    state = State.at_rest(model, position=model.position + np.array([0, 0, 0.01]))
    errors = []
    for tolerance in (1e-5, 1e-7):
        r = run(model, p, duration=0.5, rate=200, state=state.copy(), tolerance=tolerance)
        assert r.v[:, 0, 0, 2].max() > 0.3
        energy = sum(r.energies[n][:, 0] for n in ("kinetic", "gravity", "ground", "bars"))
        errors.append(np.abs(energy - energy[0]).max() / (3e-3 * G * 0.01))
    assert errors[0] < 0.1 and errors[1] < 0.01


# --- worlds, failures, input ------------------------------------------------------------------------------------------


def test_worlds_are_solved_as_if_alone():
    model, p, state = folding()
    p.set("crease", "stiffness", np.array([[0.01, 0.02, 0.04]]))
    p.set("load", "force_z", 0.5, entities=2)
    drive = Drive(load=sine(1.0, np.array([10.0, 15.0, 20.0])))
    all_ = run(model, p, drive, duration=0.05, rate=100, state=state.select(np.zeros(3, int)))
    for w in range(3):
        alone = run(
            model, p.world(w), implicit.one_world(drive, w), duration=0.05, rate=100, state=state.copy(), threads=1
        )
        assert np.array_equal(all_.x[:, :, w], alone.x[:, :, 0])
        assert np.array_equal(all_.state.work[:, w], alone.state.work[:, 0])
    assert len(all_.notes) == 3


def test_run_continues_where_it_stopped():
    model, p, state = folding()
    whole = run(model, p, duration=0.1, rate=100, dt=1e-3, state=state.copy())
    half = run(model, p, duration=0.05, rate=100, dt=1e-3, state=state.copy())
    rest = run(model, p, duration=0.05, rate=100, dt=1e-3, state=half.state)
    assert rest.times[0] == pytest.approx(0.05)
    assert np.abs(rest.x[-1] - whole.x[-1]).max() < 1e-9


def test_world_without_a_solution_stops_and_says_why():
    """A load without bounds in one world; the other goes on."""
    model, p, state = folding()
    p.set("load", "force_z", 1.0, entities=2)
    drive = Drive(load=series([0.0, 0.02, 0.03, 1.0], [0.0, 0.0, 1e300, 1e300], scale=np.array([0.0, 1e10])))
    r = simulate(
        model, p, drive, duration=0.05, rate=100, method="implicit", dt=2e-3, state=state.select(np.zeros(2, int))
    )
    assert [f.world for f in r.failures] == [1]
    assert 0.019 < r.failures[0].time < 0.021
    assert r.failures[0].node == 2
    assert "leads on: Newton" in str(r.failures[0])
    assert np.all(np.isfinite(r.x)) and np.array_equal(r.x[-1, :, 1], r.x[-2, :, 1])
    assert not np.array_equal(r.x[-1, :, 0], r.x[-2, :, 0])


@pytest.mark.parametrize("radius", [1.0, 0.8, 0.5, 0.0])
def test_modes_faster_than_the_step_shrink_by_the_spectral_radius(radius):
    """A mass on a spring at 1000 radians per step goes as Chung and Hulbert's matrix says; slow motion stays exact."""
    model = model_of([(0, 0, 0), (ARM, 0, 0)], PLAIN, bars=[(0, 1)], held=[0, (1, 1), (1, 2)])
    p = Parameters(model, {("bars", "stiffness"): 1.0, ("bars", "rest_length"): ARM, ("inertia", "mass"): 1.0})
    model, p = quiet(model, p)
    state = State.at_rest(model)
    state.x[1, 0, 0] += 1e-3
    fast = run(model, p, duration=30e3, rate=1e-3, dt=1e3, state=state.copy(), spectral_radius=radius)
    am, af = (2 * radius - 1) / (1 + radius), radius / (1 + radius)
    gamma, beta, h = 0.5 - am + af, 0.25 * (1 - am + af) ** 2, 1e3
    # unknowns x, v, a at the end of the step; balance (1 - am) a + am a0 = -(1 - af) x - af x0
    new = np.array([[1, 0, -beta * h**2], [0, 1, -gamma * h], [1 - af, 0, 1 - am]])
    old = np.array([[1, h, (0.5 - beta) * h**2], [0, 1, (1 - gamma) * h], [-af, 0, -am]])
    step = np.linalg.solve(new, old)
    assert np.abs(np.linalg.eigvals(step)).max() == pytest.approx(radius, abs=0.02)
    expected = [(np.linalg.matrix_power(step, n) @ (1e-3, 0.0, -1e-3))[0] for n in range(31)]
    assert np.abs(fast.x[:, 1, 0, 0] - ARM - expected).max() < 1e-8
    errors, steps = [], (0.2, 0.1, 0.05)
    for h in steps:
        slow = run(model, p, duration=10.0, rate=1.0, dt=h, state=state.copy(), spectral_radius=radius)
        errors.append(np.abs(slow.x[:, 1, 0, 0] - ARM - 1e-3 * np.cos(slow.times)).max())
    assert order(steps, errors) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"method": "magic"}, "method"),
        ({"method": "implicit", "spectral_radius": 1.5}, "spectral_radius"),
        ({"method": "implicit", "tolerance": 0.0}, "tolerance"),
        ({"method": "implicit", "dt": -1.0}, "dt"),
        ({"method": "explicit", "dt": 1.0}, "dt"),
    ],
)
def test_bad_options_are_named(options, named):
    model, p, _ = folding()
    with pytest.raises(InputError) as error:
        simulate(model, p, duration=0.1, **options)
    assert error.value.field == named
