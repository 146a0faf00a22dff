"""Sheets that relax: a standard linear solid held, swung and rung down, against its closed forms."""

import numpy as np
import pytest
from solve.sheets import mesh, rimmed_end

from origami_sim import Drive, InputError, Sheet, State, equilibrium, quasistatic, series, simulate
from origami_sim.pattern import sheet
from origami_sim.solve.statics.held import Held
from origami_sim.solve.timestep import stable_step

E, THICKNESS, DENSITY = 1e6, 1e-3, 1000.0
SHARE, TIME = 0.5, 0.02


def elastic(x, triangles, relaxation=((SHARE, TIME),), poisson=0.3):
    s = Sheet(sheet(x, triangles), thickness=THICKNESS, modulus=E, density=DENSITY, membrane_damping=0.0)
    return s.shell(poisson=poisson, relaxation=relaxation)


def led(kind, shape, time, relaxation=((SHARE, TIME),)):
    """Force [N, 3] of the elasticity and of the branches after a flat sheet was led evenly to a shape in a time [s]."""
    x, triangles = mesh(kind, 4, size=(0.1, 0.1))
    model, parameters = elastic(x, triangles, relaxation).build()
    start = State.at_rest(model)
    held = Held(model, parameters, Drive(), start)
    end = held.after(start, shape(x)[:, None], time, 0.0)
    report = held.at(end, time)
    sums = {n: report.forces[f"shell_{n}"][:, 0] for n in ("membrane", "bending")}
    return sums, {n: report.forces[f"shell_{n}_relaxation"][:, 0] for n in sums}, (held, end)


def stretched(x):
    return x * [1.0 + 1e-4, 1.0 - 5e-5, 1.0] + 3e-5 * x[:, [1, 0, 2]] * [1, 1, 0]


def bent(x):
    return x + np.array([0, 0, 1.0]) * (0.01 * x[:, :1] ** 2 - 0.004 * x[:, :1] * x[:, 1:2])


@pytest.mark.parametrize("kind", ["diagonal", "crossed", "random"])
@pytest.mark.parametrize(("name", "shape"), [("membrane", stretched), ("bending", bent)])
def test_a_strain_that_grows_evenly_is_resisted_as_by_a_maxwell_branch(name, shape, kind):
    """By g A eps tau / t (1 - exp(-t / tau)): forces of an even strain or curvature are alike but for a factor."""
    for time in (1e-3 * TIME, TIME, 10 * TIME):
        still, relaxing, _ = led(kind, shape, time)
        factor = SHARE * TIME / time * (1 - np.exp(-time / TIME))
        size = np.abs(still[name]).max()
        assert size > 0
        # strains grow with the square of the displacements, too; of an even curvature there is no difference
        tolerance = (2e-3 if name == "membrane" else 1e-5) * factor * size
        np.testing.assert_allclose(relaxing[name], factor * still[name], atol=tolerance)


def test_branches_add_up_and_a_hold_lets_go_with_each_time():
    pairs = ((0.5, 0.02), (0.2, 0.2), (0.1, 2.0))
    still, relaxing, (held, end) = led("crossed", stretched, 1e-6, pairs)
    for time in (0.0, 0.05, 0.5):
        now = held.after(end, end.x, time, 0.0) if time else end
        f = held.at(now, 1.0).forces["shell_membrane_relaxation"][:, 0]
        factor = sum(g * np.exp(-time / tau) for g, tau in pairs)
        np.testing.assert_allclose(f, factor * still["membrane"], atol=2e-3 * factor * np.abs(f).max() + 1e-12)
    assert np.abs(relaxing["membrane"]).max() > 0


def cantilever(cells=12, **options):
    x, triangles = rimmed_end("crossed", cells, 2, 0.16)
    x = x * 0.05
    s = elastic(x, triangles, poisson=0.0, **options)
    return s.fix(nodes=np.flatnonzero(x[:, 0] < 1e-9)).build()


def first_mode(model):
    """Shape of a cantilever's first mode at the nodes, and its angular frequency without loss [rad/s]."""
    k = 1.8751040687119611
    u = k * np.clip(model.position[:, 0] / model.position[:, 0].max(), 0, None)
    sigma = (np.cos(k) + np.cosh(k)) / (np.sin(k) + np.sinh(k))
    shape = np.cosh(u) - np.cos(u) - sigma * (np.sinh(u) - np.sin(u))
    length = model.position[:, 0].max()
    return shape / np.abs(shape).max(), k**2 / length**2 * np.sqrt(E * THICKNESS**2 / (12 * DENSITY))


def root(frequency, share, time):
    """Of s^2 + w^2 (1 + g s tau / (1 + s tau)) = 0, the one that swings."""
    every = np.roots([time, 1.0, frequency**2 * time * (1 + share), frequency**2])
    return every[np.argmax(every.imag)]


def test_a_strip_rings_down_as_a_standard_linear_solid():
    """Rate and frequency of the first mode of a cantilever of which bending relaxes, by the characteristic equation."""
    model, parameters = cantilever(relaxation=((SHARE, TIME),))
    shape, frequency = first_mode(model)
    found = root(frequency, SHARE, TIME)
    state = State.at_rest(model)
    state.v[:, 0, 2] = 1e-3 * shape * frequency * model.free[:, 2]
    motion = simulate(model, parameters, Drive(), state=state, duration=1.2 * 2 * np.pi / found.imag, rate=2000.0)
    tip = np.argmax(model.position[:, 0])
    z = motion.x[:, tip, 0, 2]
    # v = d/dt of a damped swing that begins with a speed, and a branch that is at rest: both of its roots
    every = np.roots([TIME, 1.0, frequency**2 * TIME * (1 + SHARE), frequency**2])
    speed = 1e-3 * frequency
    # z(0) = 0, z' = v, z'' = 0
    weights = np.linalg.solve(np.array([every**0, every, every**2]), np.array([0.0, speed, 0.0]))
    exact = (weights[:, None] * np.exp(every[:, None] * motion.times)).sum(axis=0).real
    assert np.abs(z - exact).max() < 0.02 * np.abs(exact).max()
    assert np.abs(z - speed / frequency * np.sin(frequency * motion.times)).max() > 0.2 * np.abs(exact).max()


@pytest.mark.parametrize("which", ["membrane", "bending"])
def test_energy_is_kept_but_for_what_the_branches_take(which):
    model, parameters = cantilever(6)
    parameters.set(f"shell_{'bending' if which == 'membrane' else 'membrane'}_relaxation", "share_1", 0.0)
    state = State.at_rest(model)
    x = model.position[:, 0]
    along = 0 if which == "membrane" else 2
    state.v[:, 0, along] = 0.01 * (x / x.max()) ** 2 * model.free[:, 0]
    drift = []
    for step in (0.4, 0.2, 0.1):
        dt = step * stable_step(model, parameters).limit
        motion = simulate(model, parameters, Drive(), state=state, duration=0.05, rate=500.0, dt=dt)
        taken = -motion.work[f"shell_{which}_relaxation"].min()
        assert taken > 0.01 * motion.energies["kinetic"].max()
        drift.append(np.ptp(motion.energy_balance()) / motion.energies["kinetic"].max())
    assert drift[-1] < 2e-3 and drift[-1] < drift[0] / 8, "of second order"


def test_the_implicit_solver_and_the_explicit_one_agree():
    model, parameters = cantilever(6)
    shape, _ = first_mode(model)
    state = State.at_rest(model)
    state.v[:, 0, 2] = 0.05 * shape * model.free[:, 2]
    options = {"state": state, "duration": 0.02, "rate": 500.0}
    explicit = simulate(model, parameters, Drive(), **options)
    implicit = simulate(model, parameters, Drive(), method="implicit", dt=1e-4, **options)
    assert not implicit.failures
    size = np.abs(explicit.x - model.position[:, None]).max()
    assert np.abs(implicit.x - explicit.x).max() < 0.01 * size


def test_slow_loads_find_the_elastic_sheet_and_fast_ones_the_stiffer_one():
    model, parameters = cantilever(6)
    model = model.with_effects("load")
    parameters = parameters.for_model(model)
    tip = np.flatnonzero(model.position[:, 0] > model.position[:, 0].max() - 1e-9)
    parameters.set("load", "force_z", 1e-5, tip)
    ends = {}
    for name, time in (("fast", 1e-4 * TIME), ("slow", 1e3 * TIME)):
        run = quasistatic(model, parameters, Drive(load=series([0.0, time], [0.0, 1.0])), [0.0, time])
        ends[name] = run.x[-1, tip, 0, 2].mean()
    assert ends["slow"] / ends["fast"] == pytest.approx(1 + SHARE, rel=0.01)


@pytest.mark.parametrize("given", [((0.5,),), ((0.5, 0.0),), ((-0.1, 1.0),), ((0.1, 1.0),) * 4, 0.3, (("a", 1),)])
def test_what_is_no_branch_is_refused(given):
    with pytest.raises(InputError, match=r"no sheet relaxes like this.*at most 3 pairs"):
        elastic(*mesh("diagonal", 2), relaxation=given)


def test_quasistatic_sheets_bend_as_equilibria_do():
    """Nodes that are all held while they are led do not clamp the sheet."""
    model, parameters = cantilever(6, relaxation=())
    model = model.with_effects("load")
    parameters = parameters.for_model(model)
    tip = np.flatnonzero(model.position[:, 0] > model.position[:, 0].max() - 1e-9)
    parameters.set("load", "force_z", 1e-5, tip)
    found = equilibrium(model, parameters, Drive(load=1.0))
    run = quasistatic(model, parameters, Drive(load=1.0), [0.0, 1.0])
    assert found.converged and found.x[tip, 2].min() > 1e-3
    np.testing.assert_allclose(run.x[-1, :, 0], found.x, atol=1e-7)
