"""The step bound against dense eigenvalues of the numerically differentiated forces, and against long runs."""

import numpy as np
import pytest
from effects.kit import HINGE, hinge, hinge_positions, make_model, quiet, start, strip

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Parameters
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.timestep import SAFETY, TimeStep, stable_step

LOADED = Drive(load=1.0)
RNG = np.random.default_rng(7)


def bars_only():
    model = strip(3)
    return model, quiet(
        model,
        {
            ("bars", "stiffness"): RNG.uniform(200, 4000, len(model.bars)),
            ("bars", "rest_length"): rest(model),
            ("inertia", "mass"): RNG.uniform(0.01, 0.1, len(model.position)),
        },
    )


def rest(model):
    return np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1)


def hinges_only():
    model = strip(3)
    return model, quiet(
        model,
        {
            ("crease", "stiffness"): RNG.uniform(1, 5, len(model.creases)),
            ("panel_bending", "stiffness"): RNG.uniform(1, 9, len(model.bends)),
            ("inertia", "mass"): RNG.uniform(0.01, 0.1, len(model.position)),
        },
    )


def sheet():
    model, p = bars_only()
    return model, p.set("crease", "stiffness", 40.0).set("panel_bending", "stiffness", 90.0)


def damped_sheet():
    model, p = sheet()
    return model, p.set("crease_viscosity", "viscosity", 0.4).set("bar_viscosity", "viscosity", 4.0).set(
        "mass_damping", "decay_rate", 30.0
    )


def viscous_hinges():
    model, p = hinges_only()
    return model, p.set("crease_viscosity", "viscosity", 2.0)


def drag_only():
    model = strip(2)
    return model, quiet(model, {("mass_damping", "decay_rate"): 250.0})


def contact():
    """Three nodes of bars resting on stiff ground with one offset contact point, pressed in."""
    x = [[0, 0, -0.011], [1, 0, -0.01], [0.2, 0.9, -0.012]]
    model = make_model(
        x,
        bars=[(0, 1), (1, 2), (2, 0)],
        triangles=[(0, 1, 2)],
        contacts=[(0, 1, 2), (1, 2, 0), (2, 0, 1)],
        weights=[[1, 0, 0], [1, 0, 0], [0.6, 0.3, 0.1]],
        offsets=[0, 0, -0.05],
    )
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 100.0,
            ("bars", "rest_length"): rest(model),
            ("inertia", "mass"): 0.02,
            ("ground", "stiffness"): [[3000.0], [2000.0], [1000.0]],
            ("plane", "reach"): 0.1,
        },
    )
    # pressed by just the forces that the ground gives back
    push = Batch(model, p, LOADED, start(model)).total_force(0.0)
    for a, f in zip("xyz", np.moveaxis(-push, 2, 0), strict=True):
        p.set("load", f"force_{a}", f)
    return model, p


def damped_contact():
    model, p = contact()
    return model, p.set("ground", "damping", 2.0)


def differentiated(model, parameters):
    """Mass, stiffness and damping matrices of the free coordinates, by central differences of the total force."""
    n = model.position.size
    h = 1e-6 * np.concatenate([np.eye(n), -np.eye(n)])
    moved = np.moveaxis((model.position.ravel() + h).reshape(2 * n, -1, 3), 0, 1)
    out = []
    for x, v in ((moved, None), (None, np.moveaxis(h.reshape(2 * n, -1, 3), 0, 1))):
        batch = Batch(model, parameters, Drive(), start(model, 2 * n, x=x, v=v))
        f = np.moveaxis(batch.total_force(0.0), 1, 0).reshape(2 * n, n)
        slopes = -(f[:n] - f[n:]).T / 2e-6
        out.append(slopes)
    free = np.flatnonzero(model.free.ravel())
    mass = np.repeat(np.broadcast_to(parameters["inertia", "mass"], (len(model.position), 1))[:, 0], 3)[free]
    return mass, *(m[np.ix_(free, free)] for m in out)


def spectral_radius(mass, stiffness, damping, dt):
    """Of one step: kick, drift and kick, with the damping taken at the velocity predicted from the old acceleration."""
    n = len(mass)
    one, k, c = np.eye(n), stiffness / mass[:, None], damping / mass[:, None]
    drift = np.hstack([one, dt * one, 0.5 * dt**2 * one])
    predicted = np.hstack([0 * one, one, dt * one])
    a = -k @ drift - c @ predicted
    v = np.hstack([0 * one, one, 0.5 * dt * one]) + 0.5 * dt * a
    return np.abs(np.linalg.eigvals(np.vstack([drift, v, a]))).max()


def exact_limit(mass, stiffness, damping, guess):
    low, high = 0.5 * guess, 4 * guess
    for _ in range(40):
        dt = 0.5 * (low + high)
        # rigid motion has the double root 1, which roundoff splits by its square root
        low, high = (dt, high) if spectral_radius(mass, stiffness, damping, dt) < 1 + 2e-4 else (low, dt)
    return low


def test_limit_of_bars_is_that_of_their_norms():
    """The bound is the largest eigenvalue of the stiffnesses, all taken positive, over the masses."""
    model, parameters = bars_only()
    m = np.broadcast_to(parameters["inertia", "mass"], (len(model.position), 1))[:, 0]
    k = np.zeros((len(m), len(m)))
    free = model.free.max(axis=1)
    for (p, q), stiffness in zip(model.bars, parameters["bars", "stiffness"][:, 0], strict=True):
        ends = np.zeros(len(m))
        ends[[p, q]] = free[[p, q]]
        k += stiffness * np.outer(ends, ends)
    exact = 2 / np.sqrt(np.linalg.eigvalsh(k / np.sqrt(m) / np.sqrt(m)[:, None]).max())
    limit = stable_step(model, parameters).limit
    assert 0.95 * exact < limit <= exact * (1 + 1e-12)
    assert limit > 1.1 * 2 / np.sqrt((k.sum(1) / m).max())  # plain row sums would ask for smaller steps


def test_worlds_do_not_change_each_others_bound():
    model, one = sheet()
    _, other = sheet()
    other.set("bars", "stiffness", 3.0 * other["bars", "stiffness"])
    alone = [stable_step(model, p).limit for p in (one, other)]
    assert stable_step(model, Parameters.join([one, other])).limit == pytest.approx(min(alone), rel=0.02)


UNDAMPED = [bars_only, hinges_only, sheet, contact]
DAMPED = [damped_sheet, viscous_hinges, drag_only, damped_contact]


@pytest.mark.parametrize("case", UNDAMPED, ids=lambda c: c.__name__)
def test_limit_is_safe_and_at_most_three_times_too_small(case):
    model, parameters = case()
    mass, k, c = differentiated(model, parameters)
    root = np.sqrt(mass)
    exact = 2 / np.sqrt(np.linalg.eigvalsh((k + k.T) / 2 / root / root[:, None]).max())
    limit = stable_step(model, parameters).limit
    assert np.abs(c).max() < 1e-9
    assert exact / 3 <= limit <= exact * (1 + 1e-6), limit / exact


@pytest.mark.parametrize("case", DAMPED, ids=lambda c: c.__name__)
def test_limit_with_damping_is_safe_and_at_most_three_times_too_small(case):
    model, parameters = case()
    limit = stable_step(model, parameters).limit
    assert np.isfinite(limit)
    exact = exact_limit(*differentiated(model, parameters), limit)
    assert exact / 3 <= limit <= exact * (1 + 1e-3), limit / exact


@pytest.mark.parametrize("apexes", [((0.4, 0.9), (0.6, 0.8)), ((1.7, 0.3), (-0.7, 0.3)), ((1.7, 0.3), (-0.4, 1.2))])
@pytest.mark.parametrize("angle", [0.0, 1.5, 3.0, 3.14])
def test_limit_of_the_flat_reference_holds_at_every_fold_angle(apexes, angle):
    """Apexes beyond the ends of the axis are the hard case: there the axis nodes feel a folded hinge more."""
    values = {("crease", "stiffness"): 1.0, ("crease", "rest_angle"): angle, ("inertia", "mass"): 0.01}
    flat, folded = (make_model(hinge_positions(a, *apexes), **HINGE) for a in (0.0, angle))
    mass, k, _ = differentiated(folded, quiet(folded, values))
    exact = 2 / np.sqrt(np.linalg.eigvalsh((k + k.T) / 2 / mass[0]).max())
    limit = stable_step(flat, quiet(flat, values)).limit
    assert exact / 4 <= limit <= exact * (1 + 1e-6), limit / exact


def relaxing():
    """A hinge held together by its Maxwell branches alone."""
    model = hinge(0.3, held=(0, 1, 2), bars=())
    return model, quiet(
        model,
        {
            ("crease_relaxation", "stiffness_1"): 2.0,
            ("crease_relaxation", "stiffness_2"): 3.0,
            ("crease_relaxation", "time_1"): 1e3,
            ("crease_relaxation", "time_2"): 0.5,
            ("inertia", "mass"): 0.01,
        },
    )


def sticking():
    """A foot held in the plane by its bristle alone."""
    model, _ = contact()
    free = np.zeros_like(model.position)
    free[0, :2] = 1
    model = make_model(model.position, free=free, triangles=[(0, 1, 2)], contacts=[(0, 1, 2)])
    return model, quiet(
        model,
        {
            ("ground", "stiffness"): 300.0,
            ("coulomb", "friction_coefficient"): 5.0,
            ("friction", "stiffness"): 900.0,
            ("inertia", "mass"): 0.01,
        },
    )


@pytest.mark.parametrize("case", [*UNDAMPED, *DAMPED, relaxing, sticking], ids=lambda c: c.__name__)
def test_ten_thousand_steps_at_the_limit_stay_bounded(case):
    model, parameters = case()
    dt = 0.99 * stable_step(model, parameters).limit
    v = np.random.default_rng(3).normal(size=model.position.shape) * model.free
    v -= v.mean(0) * (model.free.min() > 0)  # no drift of the whole
    state = start(model, v=1e-6 * v / dt)
    run = simulate(model, parameters, LOADED, dt=dt, duration=10_000 * dt, rate=1 / (100 * dt), state=state)
    assert not run.failures
    speed = np.abs(run.v).max((1, 2, 3))
    assert speed.max() <= 10 * speed[0]


def test_default_step_is_a_fraction_of_the_limit_and_names_its_cause():
    model, parameters = sheet()
    step = stable_step(model, parameters)
    assert step.dt == SAFETY * step.limit and 0.0 < step.dt < step.limit
    assert "(bars)" in step.cause
    assert str(step.node) in str(step) and step.cause in str(step)
    assert str(TimeStep(np.inf, np.inf, 0, "")) == "nothing limits the time step"


def test_single_spring_and_dashpot_have_the_closed_form_limit():
    """dt = 2/omega (sqrt(1 + 4 zeta^2) - 2 zeta) for one free node on one bar."""
    k, c, m = 50.0, 0.7, 0.02
    model = make_model([[0, 0, 0], [1, 0, 0]], bars=[(0, 1)], free=[[0, 0, 0], [1, 0, 0]])
    p = quiet(model, {("bars", "stiffness"): k, ("bar_viscosity", "viscosity"): c, ("inertia", "mass"): m})
    omega = np.sqrt(k / m)
    zeta = c / (2 * m * omega)
    assert stable_step(model, p).limit == pytest.approx(2 / omega * (np.sqrt(1 + 4 * zeta**2) - 2 * zeta), rel=1e-12)
    assert spectral_radius(np.array([m]), np.array([[k]]), np.array([[c]]), 1.01 * stable_step(model, p).limit) > 1


@pytest.mark.parametrize("c", [0.0, 0.7])
def test_the_step_that_is_taken_is_stable_where_the_limit_is_exact(c):
    """One node on one spring: the bound is the limit itself, so any step beyond it rings up, whatever it is called."""
    k, m = 50.0, 0.02
    model = make_model([[0, 0, 0], [1, 0, 0]], bars=[(0, 1)], free=[[0, 0, 0], [1, 0, 0]])
    p = quiet(model, {("bars", "stiffness"): k, ("bar_viscosity", "viscosity"): c, ("inertia", "mass"): m})
    dt = stable_step(model, p).dt
    assert dt < 2 / np.sqrt(k / m)
    assert spectral_radius(np.array([m]), np.array([[k]]), np.array([[c]]), dt) <= 1 + 1e-12
    assert simulate(model, p, Drive(), duration=10 * dt, rate=1 / dt, state=start(model)).dt <= dt


def test_limit_is_that_of_the_worst_world():
    model, p = bars_only()
    softer = p.copy().set("bars", "stiffness", p["bars", "stiffness"] * np.array([0.1, 1.0, 0.5]))
    assert stable_step(model, softer).limit == stable_step(model, p).limit


def test_worlds_that_do_not_match_are_named():
    model, p = bars_only()
    p.set("bars", "stiffness", np.ones((1, 2))).set("crease", "stiffness", np.ones((1, 3)))
    with pytest.raises(InputError, match=r"bars\.stiffness|crease\.stiffness"):
        simulate(model, p, duration=0.1)


def test_no_stiffness_means_no_limit():
    model = make_model(hinge_positions(0.5), bars=[(0, 1)])
    assert stable_step(model, quiet(model)).limit == np.inf
