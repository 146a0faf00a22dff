"""Rollouts against closed forms, orders of convergence, and the promises made to a batch of worlds."""

import math
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from effects.kit import HINGE, hinge, lengths, make_model, quiet, slope, start, strip
from scipy.integrate import quad
from solve.runs import G, run

from origami_sim.drive import Drive, ramp, series, sine
from origami_sim.errors import InputError
from origami_sim.model import State
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.timestep import stable_step

# --- energy -----------------------------------------------------------------------------------------------------------


def ringing_sheet():
    """A free sheet of bars, creases and bending lines, thrown into large motion."""
    model = strip(3)
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 300.0,
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): 3.0,
            ("crease", "rest_angle"): 0.6,
            ("panel_bending", "stiffness"): 6.0,
            ("inertia", "mass"): 0.05,
        },
    )
    v = 0.5 * np.random.default_rng(4).normal(size=model.position.shape)
    return model, p, start(model, v=v)


def swinging_hinge():
    """A free hinge swinging over a radian: nonlinear, but its motion stays regular."""
    model = hinge(1.0)
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 300.0,
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): 3.0,
            ("crease", "rest_angle"): 0.4,
            ("inertia", "mass"): 0.05,
        },
    )
    return model, p, start(model, v=0.3 * np.random.default_rng(4).normal(size=(4, 3)))


@pytest.mark.parametrize("fraction", [pytest.param(0.2, marks=pytest.mark.slow), 0.8])
def test_energy_error_has_no_trend_over_1e5_steps(fraction):
    """The drift of a linear fit over the whole run is a small part of the oscillation that it is fitted through."""
    model, p, state = swinging_hinge()
    long = run(model, p, state=state, steps=100_000, dt=fraction * stable_step(model, p).limit, frames=2000)
    assert np.ptp(long.creases) > 1.0
    energy = long.energy_balance()[:, 0]
    trend = np.polyfit(long.times, energy, 1)[0] * long.times[-1]
    assert energy.std() < 5e-3 * energy[0]
    assert abs(trend) < 0.02 * energy.std()
    thirds = np.array_split(energy, 3)
    assert thirds[2].std() == pytest.approx(thirds[0].std(), rel=0.02)


def test_energy_error_of_a_crumpling_sheet_stays_bounded():
    """In chaotic motion the oscillation changes as energy spreads over the modes, but it does not grow away."""
    model, p, state = ringing_sheet()
    long = run(model, p, state=state, steps=100_000, dt=0.4 * stable_step(model, p).limit, frames=2000)
    energy = long.energy_balance()[:, 0]
    assert np.abs(energy / energy[0] - 1).max() < 0.02


def test_energy_error_is_of_second_order():
    model, p, state = ringing_sheet()
    limit = stable_step(model, p).limit
    steps, errors = [], []
    for n in (1, 2, 4, 8):
        r = run(model, p, state=state, steps=400 * n, dt=0.2 * limit / n, frames=400)
        steps.append(r.dt)
        errors.append(np.std(r.energy_balance()))
    assert slope(steps, errors) == pytest.approx(2, abs=0.1)


def test_momentum_and_angular_momentum_of_a_free_sheet_are_kept():
    model, p, state = ringing_sheet()
    r = run(model, p, state=state, steps=20_000, dt=0.5 * stable_step(model, p).limit, frames=4)
    momentum = 0.05 * r.v[:, :, 0].sum(1)
    spin = 0.05 * np.cross(r.x[:, :, 0], r.v[:, :, 0]).sum(1)
    for kept, scale in ((momentum, 0.05 * np.abs(r.v).sum()), (spin, np.abs(spin).max())):
        assert np.abs(kept - kept[0]).max() < 1e-11 * scale


def test_energy_less_the_work_fed_in_is_kept():
    """Free fall of a sheet with gravity, loads, a field on a magnet and damping."""
    model, p, state = ringing_sheet()
    p.set("gravity", "gravity_z", -G).set("load", "force_x", np.linspace(-0.2, 0.3, len(model.position)))
    p.set("crease_viscosity", "viscosity", 0.02).set("mass_damping", "decay_rate", 0.3)
    for name, value in (("remanence", 0.1), ("volume", 1e-6), ("poling_1", 1.0)):
        p.set("magnetic_torque", name, value)
    drive = Drive(load=sine(1.0, 2.0), field=(0.1, sine(2.0, 3.0), 0.3))
    steps, errors = [], []
    for n in (1, 2, 4):
        dt = 0.2 * stable_step(model, p).limit / n
        r = run(model, p, state=state, steps=600 * n, dt=dt, frames=600, drive=drive)
        balance = r.energy_balance()
        steps.append(r.dt)
        errors.append(np.std(balance))
        exchanged = max(np.ptp(w) for w in r.work.values())
    assert exchanged > 0.1
    assert errors[-1] < 1e-4 * exchanged
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)  # the work is summed by trapezoids


# --- closed forms in the air ------------------------------------------------------------------------------------------


def test_projectile_is_exact():
    model = make_model([[0.0, 0, 0]])
    v = np.array([[1.0, -2.0, 3.0]])
    r = simulate(
        model,
        quiet(model, {("gravity", "gravity_z"): -G, ("gravity", "gravity_x"): 0.4}),
        duration=2.0,
        rate=60,
        state=start(model, v=v),
    )
    t = r.times[:, None]
    assert np.abs(r.x[:, 0, 0] - (v * t + 0.5 * np.array([[0.4, 0, -G]]) * t**2)).max() < 1e-12
    assert np.abs(r.v[:, 0, 0] - (v + np.array([[0.4, 0, -G]]) * t)).max() < 1e-12


def test_damped_oscillator_converges_with_second_order():
    k, c, m, x0, v0, end = 40.0, 0.3, 0.1, 0.1, 0.5, 1.0
    model = make_model([[0, 0, 0], [1, 0, 0]], bars=[(0, 1)], free=[[0, 0, 0], [1, 0, 0]])
    p = quiet(model, {("bars", "stiffness"): k, ("bar_viscosity", "viscosity"): c, ("inertia", "mass"): m})
    beta = c / (2 * m)
    omega = math.sqrt(k / m - beta**2)
    exact = 1 + math.exp(-beta * end) * (x0 * math.cos(omega * end) + (v0 + beta * x0) / omega * math.sin(omega * end))
    counts = np.array([200, 400, 800, 1600])
    errors = []
    for n in counts:
        state = start(model, x=[[0, 0, 0], [1 + x0, 0, 0]], v=[[0, 0, 0], [v0, 0, 0]])
        errors.append(abs(run(model, p, steps=int(n), dt=end / n, state=state).x[-1, 1, 0, 0] - exact))
    assert slope(end / counts, errors) == pytest.approx(2, abs=0.15)
    assert errors[-1] < 1e-5


def test_falling_plate_reaches_the_terminal_velocity_of_the_drag_law():
    """v = v_t tanh(g t / v_t), v_t = sqrt(2 m g / (rho Cd A))."""
    model = make_model([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]], triangles=[(0, 1, 2)])
    p = quiet(model, {("inertia", "mass"): 1e-3, ("air_drag", "drag_coefficient"): 1.2, ("gravity", "gravity_z"): -G})
    r = simulate(model, p, duration=2.0, rate=10, dt=1e-4)
    terminal = math.sqrt(2 * 3e-3 * G / (1.2 * 1.2 * 0.02))
    assert np.abs(r.v[:, :, 0, 2] + terminal * np.tanh(G * r.times / terminal)[:, None]).max() < 1e-5 * terminal
    assert r.v[-1, 0, 0, 2] == pytest.approx(-terminal, rel=1e-3)


def test_mass_damping_decays_exponentially():
    model = make_model([[0.0, 0, 0]])
    r = simulate(
        model,
        quiet(model, {("mass_damping", "decay_rate"): 3.0}),
        duration=1.0,
        rate=10,
        dt=1e-4,
        state=start(model, v=[[1.0, 0, 0]]),
    )
    assert r.v[:, 0, 0, 0] == pytest.approx(np.exp(-3.0 * r.times), rel=3e-7)  # (alpha dt)^2 alpha t


# --- creases ----------------------------------------------------------------------------------------------------------


def flap(angle, **options):
    """A mass at node l on stiff bars, turning about a held axis at a radius of 0.9."""
    return hinge(angle, held=(0, 1, 2), bars=[(3, 1), (3, 2)], **options)


def test_ring_down_has_the_logarithmic_decrement_of_kelvin_and_voigt():
    """I theta'' + c theta' + K theta = 0 with I = m r^2: delta = 2 pi zeta / sqrt(1 - zeta^2)."""
    k, m, zeta = 0.02, 0.01, np.array([0.02, 0.05, 0.1])
    model = flap(0.0)
    inertia = m * 0.81
    c = 2 * zeta * math.sqrt(k * inertia)
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 50.0,
            ("bars", "rest_length"): lengths(model),
            ("inertia", "mass"): m,
            ("crease", "stiffness"): k,
            ("crease_viscosity", "viscosity"): c[None],
        },
    )
    v = np.zeros((4, 3))
    v[3, 2] = 0.05
    period = 2 * math.pi / math.sqrt(k / inertia)
    r = simulate(model, p, duration=6 * period, rate=400 / period, state=start(model, 3, v=v))
    for w in range(3):
        a = r.creases[:, 0, w]
        peaks = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])) + 1
        parabolas = [np.polyfit([-1, 0, 1], a[i - 1 : i + 2], 2) for i in peaks]
        heights = [np.polyval(f, -f[1] / (2 * f[0])) for f in parabolas]
        decrement = -np.polyfit(np.arange(len(heights)), np.log(heights), 1)[0]
        assert decrement == pytest.approx(2 * math.pi * zeta[w] / math.sqrt(1 - zeta[w] ** 2), rel=2e-3)


BRANCHES = ((0.5, 0.05), (0.8, 0.4), (0.3, 3.0))


def relaxing():
    model = hinge(0.2, held=(0, 1, 2, 3), bars=(), effects=("crease_relaxation",))
    p = quiet(
        model,
        {
            ("crease_relaxation", f"{n}_{i + 1}"): b[j]
            for i, b in enumerate(BRANCHES)
            for j, n in enumerate(("stiffness", "time"))
        },
    )
    return model, p


def relaxation_moment(trajectory):
    return -trajectory.state.memory[:3, 0].sum()


def test_prony_series_relaxes_exactly_after_a_step_in_angle():
    """A step of 0.7 rad leaves K_i 0.7 in each branch; M(t) = sum K_i 0.7 exp(-t / tau_i)."""
    model, p = relaxing()
    state = start(model)
    state.memory[:3, 0] = [0.7 * k for k, _ in BRANCHES]
    for end in (0.1, 1.0, 5.0):
        r = simulate(model, p, duration=end, rate=1 / end, dt=1e-3, state=state)
        expected = -sum(0.7 * k * math.exp(-end / tau) for k, tau in BRANCHES)
        assert relaxation_moment(r) == pytest.approx(expected, rel=1e-11)


def test_prony_series_follows_a_ramp_with_second_order():
    """A held node keeps the velocity it is given, which turns the flap in a known way: quadrature is the reference."""
    model, p = relaxing()
    x0, speed, end = model.position[3], np.array([0, -0.6, 0.9]), 0.5

    def angle(t):
        return math.atan2(x0[2] + speed[2] * t, x0[1] + speed[1] * t)

    def rate(t):
        y, z = x0[1:] + speed[1:] * t
        return (speed[2] * y - speed[1] * z) / (y * y + z * z)

    exact = -sum(
        quad(lambda t, k=k, tau=tau: k * math.exp((t - end) / tau) * rate(t), 0, end, epsabs=1e-13)[0]
        for k, tau in BRANCHES
    )
    v = np.zeros((4, 3))
    v[3] = speed
    counts = np.array([50, 100, 200, 400])
    errors = []
    for n in counts:
        r = run(model, p, steps=int(n), dt=end / n, state=start(model, v=v))
        assert r.creases[-1, 0, 0] == pytest.approx(angle(end), abs=1e-12)
        errors.append(abs(relaxation_moment(r) - exact))
    assert slope(end / counts, errors) == pytest.approx(2, abs=0.15)


def test_angle_counts_turns_in_a_rollout():
    """A flap spinning freely: the angle grows by omega t through several turns, and the crease stores their energy."""
    model = flap(0.0)
    p = quiet(model, {("bars", "stiffness"): 1e5, ("bars", "rest_length"): lengths(model), ("inertia", "mass"): 0.01})
    v = np.zeros((4, 3))
    v[3, 2] = 0.9 * 10.0
    r = simulate(model, p, duration=3.0, rate=50, state=start(model, v=v))
    assert r.creases[-1, 0, 0] > 4 * 2 * math.pi
    assert np.abs(np.diff(r.creases[:, 0, 0]) - 0.2).max() < 1e-3
    assert r.creases[-1, 0, 0] == pytest.approx(30.0, rel=1e-4)  # bars stretch by 1e-5 under the spin


# --- worlds -----------------------------------------------------------------------------------------------------------


def busy(worlds):
    """A sheet that drops, is driven by field and voltage and rubs on the ground, different in every world."""
    rng = np.random.default_rng(9)
    model = strip(3, height=0.06)
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 400.0,
            ("bars", "rest_length"): lengths(model),
            ("bar_viscosity", "viscosity"): 0.05,
            ("crease", "stiffness"): rng.uniform(0.5, 2.0, (len(model.creases), worlds)),
            ("crease", "rest_angle"): rng.uniform(-1, 1, (1, worlds)),
            ("crease_table", "resisting_moment"): rng.uniform(-0.1, 0.1, (1, worlds, 33)),
            ("panel_bending", "stiffness"): 4.0,
            ("crease_viscosity", "viscosity"): 0.01,
            ("inertia", "mass"): 0.05,
            ("crease_relaxation", "stiffness_1"): 0.5,
            ("crease_relaxation", "time_1"): 0.1,
            ("gravity", "gravity_z"): -G,
            ("ground", "stiffness"): 300.0,
            ("ground", "damping"): 0.5,
            ("plane", "reach"): 0.1,
            ("friction", "stiffness"): 300.0,
            ("coulomb", "friction_coefficient"): rng.uniform(0.1, 0.9, (1, worlds)),
            ("directional_friction", "backward_excess"): 0.2,
            ("magnetic_torque", "remanence"): 0.1,
            ("magnetic_torque", "volume"): 1e-6,
            ("magnetic_torque", "poling_1"): rng.uniform(0.5, 1.5, (1, worlds)),
            ("air_drag", "drag_coefficient"): 1.0,
            ("maxwell_stress", "layers"): 3.0,
            ("maxwell_stress", "lever"): 1e-3,
            ("maxwell_stress", "width"): 0.5,
        },
    )
    times = np.linspace(0, 10, 301)
    drive = Drive(
        field=(0.2, sine(rng.uniform(0.5, 2, worlds), 3.0), series(times, np.sin(7 * times))),
        voltage=sine(1000.0, 2.0),
        load=0.0,
    )
    return model, p, drive


def one_world(model, p, drive, w):
    alone = p.copy()
    for key in alone:
        if alone[key].shape[1] > 1:
            alone._values[key] = alone[key][:, [w]].copy()
    y = sine(float(drive["field_y"].amplitude[w]), 3.0)
    return model, alone, Drive(field=(0.2, y, drive["field_z"]), voltage=drive["voltage_0"])


BUSY = {"duration": 0.25, "rate": 40.0, "dt": 5e-4}


def same(a, b, worlds=slice(None)):
    """Bit for bit."""
    for name in ("x", "v", "contact_forces"):
        assert getattr(a, name)[..., worlds, :].tobytes() == getattr(b, name).tobytes(), name
    for name in ("angles", "gaps"):
        assert getattr(a, name)[..., worlds].tobytes() == getattr(b, name).tobytes(), name
    for name in a.energies:
        assert a.energies[name][:, worlds].tobytes() == b.energies[name].tobytes(), name
    for name in a.work:
        assert a.work[name][:, worlds].tobytes() == b.work[name].tobytes(), name


def test_every_world_equals_its_run_alone_bit_for_bit():
    model, p, drive = busy(5)
    together = simulate(model, p, drive, **BUSY)
    assert not together.failures
    assert together.gaps.min() < 0 < np.abs(together.contact_forces).max()
    assert len({together.x[..., w, :].tobytes() for w in range(5)}) == 5
    for w in range(5):
        same(together, simulate(*one_world(model, p, drive, w), **BUSY), slice(w, w + 1))


def test_results_do_not_depend_on_threads_and_repeat():
    model, p, drive = busy(7)
    first = simulate(model, p, drive, **BUSY, threads=1)
    for threads in (1, 2, 3, 7):
        same(first, simulate(model, p, drive, **BUSY, threads=threads))


def test_a_run_continues_from_its_state_as_if_it_had_not_stopped():
    model, p, drive = busy(3)
    whole = simulate(model, p, drive, **{**BUSY, "duration": 0.5})
    half = simulate(model, p, drive, **BUSY)
    before = half.state.copy()
    rest = simulate(model, p, drive, **BUSY, state=half.state)
    for name in ("x", "v", "angles", "gaps", "contact_forces"):
        assert getattr(whole, name)[11:].tobytes() == getattr(rest, name)[1:].tobytes(), name
    for name in ("x", "v", "a", "angles", "memory", "work"):
        assert getattr(whole.state, name).tobytes() == getattr(rest.state, name).tobytes(), name
        assert getattr(before, name).tobytes() == getattr(half.state, name).tobytes(), "the state given is not changed"
    assert rest.times == pytest.approx(whole.times[10:], rel=1e-14)


def test_an_unstable_world_is_reported_and_leaves_the_others_alone():
    """World 1 is pulled apart; the step suits the stiffness, so only the load is at fault."""
    model, p, _ = busy(3)
    good = simulate(model, p, Drive(load=ramp(1.0, 0.1)), **BUSY)
    load = np.zeros((len(model.position), 3))
    load[-1, 1] = 1e7
    bad = simulate(model, p.copy().set("load", "force_x", load), Drive(load=ramp(1.0, 0.1)), **BUSY)
    assert [f.world for f in bad.failures] == [1]
    failure = bad.failures[0]
    assert failure.node == len(model.position) - 1 and 0 < failure.time < 0.1
    for word in ("world 1", "node 7", "bar", "strained by", "smaller"):
        assert word in str(failure)
    for w in (0, 2):
        assert bad.x[..., w, :].tobytes() == good.x[..., w, :].tobytes()
        assert bad.v[..., w, :].tobytes() == good.v[..., w, :].tobytes()
    late = np.flatnonzero(bad.times > failure.time)
    assert np.all(bad.x[late, :, 1] == bad.x[late[0], :, 1]), "a failed world stands still"


def test_not_a_number_is_a_failure_with_that_cause():
    model = strip(1)
    p = quiet(model, {("bars", "stiffness"): 100.0, ("bars", "rest_length"): lengths(model)})
    x = np.repeat(model.position[:, None], 2, 1)
    x[0, 1] = x[1, 1]  # a bar of no length has no direction
    r = simulate(model, p, duration=0.1, rate=20, state=start(model, 2, x=x))
    assert [f.world for f in r.failures] == [1]
    assert "not a number" in str(r.failures[0])
    assert np.all(np.isfinite(r.x[:, :, 0]))


@pytest.mark.parametrize(
    "options, words",
    [
        ({"dt": 1.0}, ["dt", "above the stability limit", "bar"]),
        ({"dt": -1e-3}, ["dt", "positive"]),
        ({"dt": float("nan")}, ["dt"]),
        ({"duration": 0.0}, ["duration", "> 0"]),
        ({"rate": float("inf")}, ["rate"]),
        ({"duration": 0.01}, ["duration", "0.025 s"]),
        ({"drive": Drive(voltage=series([0, 0.1], [0, 1]))}, ["voltage_0", "ends before", "0.1"]),
        ({"drive": Drive(field=(0, sine(np.ones(4), 1.0), 0))}, ["number of worlds", "1 or 4"]),
        ({"device": "cuda:99"}, ["cuda:99", "cpu"]),
    ],
    ids=lambda v: None if isinstance(v, dict) else "-".join(v),
)
def test_bad_input_is_named(options, words):
    model, p, drive = busy(3)
    with pytest.raises(InputError) as e:
        simulate(model, p, **{"drive": drive, "duration": 0.25, "rate": 40.0, **options})
    for word in words:
        assert word in str(e.value)


def test_worlds_of_state_and_parameters_must_match():
    model, p, drive = busy(3)
    with pytest.raises(InputError, match="another number of worlds"):
        simulate(model, p, drive, **BUSY, state=start(model, 2))


def test_too_few_electrode_groups_are_named():
    model = hinge(electrodes=[2], **{k: v for k, v in HINGE.items() if k not in ("bars", "triangles", "creases")})
    with pytest.raises(InputError, match=r"electrode.*>= 3"):
        simulate(model, quiet(model), Drive(voltage=[1.0, 2.0]), duration=0.1)


def test_gpu_follows_the_cpu(cuda):
    """1000 steps: only the compilers' rounding differs."""
    model, p, drive = busy(4)
    options = {"duration": 0.5, "rate": 20.0, "dt": 5e-4}
    a, b = simulate(model, p, drive, **options), simulate(model, p, drive, **options, device=cuda)
    assert a.times[-1] / a.dt == pytest.approx(1000)
    assert not a.failures and not b.failures
    size = np.abs(a.x - a.x.mean(1, keepdims=True)).max()
    assert np.abs(a.x - b.x).max() <= 1e-9 * size
    assert np.abs(a.angles - b.angles).max() <= 1e-9 * np.abs(a.angles).max()
    same(b, simulate(model, p, drive, **options, device=cuda))


def test_on_the_cpu_no_two_worlds_share_a_cache_line():
    """Threads that write into one line take it from each other at every step."""
    model, p, drive = busy(3)
    batch = Batch(model, p, drive, State.at_rest(model, 3))
    written = [a for a in vars(batch).values() if isinstance(a, wp.array) and a.ndim == 2 and a.shape[-1] == 3]
    assert len(written) == 9  # x, v, a, f, angles, memory, work, power, status
    for a in written:
        world = [a.numpy()[:, w] for w in range(3)]
        first, last = np.array([np.lib.array_utils.byte_bounds(x) for x in world]).T
        assert np.all(first[1:] - last[:-1] >= 64)
        a.numpy()[:] = 1  # a view: what is set on the host is what the kernels see
        assert np.all(a.numpy() == 1)


def test_models_that_share_a_program_move_as_with_their_own():
    """Laws that a model lacks do nothing there, wherever they stand; its memory and its work stay its own."""
    model, p, _ = ringing_sheet()
    few = replace(model, effects=("bars", "crease", "panel_bending", "crease_friction", "mass_damping"))
    p = p.for_model(few).set("crease_friction", "friction_moment", 0.02).set("mass_damping", "decay_rate", 0.3)
    s = State.at_rest(few)
    s.v[:] = 0.1 * np.random.default_rng(4).normal(size=s.v.shape)
    among = ("crease_relaxation", "mass_damping", "adhesion", "dipole_interaction", *few.effects[:4], "gravity")
    own, shared = Batch(few, p, Drive(), s), Batch(few, p, Drive(), s, among=among)
    names = [e.name for e in shared.program.effects]
    assert names == [*among[:-1]], "gravity acts at its default, and is left to models that have it"
    for batch in (own, shared):
        batch.advance(2000, 1e-4, np.inf)
    a, b = own.state(), shared.state()
    assert a.memory.shape == b.memory.shape and np.any(a.memory) and np.all(a.work[-2:] < 0.0)
    for name in ("x", "v", "memory", "work", "angles"):
        assert getattr(b, name) == pytest.approx(getattr(a, name), rel=1e-13, abs=1e-15), name  # measured: the same
    f, g = own.evaluate(0.2), shared.evaluate(0.2)
    assert list(f.forces) == list(g.forces) == list(few.effects) and list(f.energies) == list(g.energies)
    other = replace(few, effects=few.effects[:3])
    assert Batch(other, p.for_model(other), Drive(), State.at_rest(other), among=among).program is shared.program
