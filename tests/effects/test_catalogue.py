"""What every effect of the catalogue has to satisfy; a new effect file is tested without being named here."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effects.kit import ALL, INTERNAL, hinge_positions, make_model, quiet, random_rotation, start, strip

import origami_sim.effects
from origami_sim.drive import Drive
from origami_sim.effects import CATALOGUE, CONTACTS, FAMILIES, PAIRS, SHELLS
from origami_sim.errors import InputError
from origami_sim.model import Parameters, node_mass
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics.equilibria import tangent
from origami_sim.solve.timestep import stable_step

ACT_BY_DEFAULT = {"gravity", "ground"}
"""Effects that do something as soon as they are switched on; all others wait for a parameter."""

RATE_LAWS = {"coefficient", "damping", "decay_rate", "drag_coefficient", "film", "fading_speed", "impact_damping"}
RATE_LAWS |= {"loss_time", "missing_moment", "viscosity"}
"""Parameters that, at zero or at their default, make a law blind to rates."""

EPS = 1e-6
NOW = 0.3
"""An instant [s] at which effects that grow with time have begun."""

FIELD = np.array([0.4, -0.7, 0.5])
CONFIGURATIONS = ("random", "flat", "folded", "turned")


def the_drive(rotation=None, *, gradient=None):
    g = np.zeros((3, 3)) if gradient is None else gradient
    r = np.eye(3) if rotation is None else rotation
    field, gradient = tuple(r @ FIELD), (r @ g @ r.T).tolist()
    return Drive(field=field, gradient=gradient, voltage=[6200.0, 7000.0], load=0.7, temperature=20.0)


def the_model():
    base = strip(3)
    return strip(3, electrodes=np.arange(len(base.creases) + len(base.bends)) % 2)


def configuration(kind, rng):
    """A state: crumpled; flat; folded to +-pi exactly; crumpled with angles beyond a turn."""
    model = the_model()
    x = model.position.copy()
    if kind in ("random", "turned"):
        x[:, 0] = np.array([0, 1, 0.3, 1.2]).repeat(2)
        x += rng.uniform(-0.15, 0.15, x.shape)
    if kind == "folded":
        x[:, 0] = np.array([0, 1, 0.05, 1.02]).repeat(2)
    state = start(model, x=x)
    if kind == "turned":
        state.angles += 2 * np.pi * np.array([1, -1, 0, 1, -2])[:, None]
    if kind == "folded":
        assert np.abs(state.angles[:2]) == pytest.approx(math.pi, abs=0)
        state.angles[:2] = [[math.pi], [-math.pi]]
    return model, state


def sample(parameter, shape, rng):
    """Seeded values inside the bounds and of a moderate size: around the default, or where that is zero, off it."""
    low, high = parameter.bounds
    if parameter.default:
        value = parameter.default * rng.uniform(0.7, 1.3, shape)
    elif low < 0:
        value = rng.uniform(max(low, -1.5), min(high, 1.5), shape)
    else:
        value = rng.uniform(0.4 * min(high, 3.0), min(high, 3.0), shape)
    return np.clip(value, low, high)


def give(parameters, model, name, rng):
    """Random parameters for one effect."""
    effect = CATALOGUE[name]
    for p in effect.parameters:
        shape = (model.count(effect.family), 1) + ((p.knots,) if p.knots > 1 else ())
        parameters.set(name, p.name, sample(p, shape, rng))
    if effect.interacts:  # only magnets that do not touch
        parameters.set(name, "volume", 0.0, [2, 3])


def on_ground(parameters, model, state, depth):
    """Puts the ground `depth` [m] above the lowest contact point, and lets contact laws act there."""
    parameters.set("plane", "reach", 1.0)
    gaps = Batch(model, parameters, Drive(voltage=[0.0, 0.0]), state).evaluate(0.0).gaps
    parameters.set("plane", "height", float(gaps.min() + depth))


def setting(name, kind="random", seed=0):
    """Model, parameters with this effect alone, and a state."""
    rng = np.random.default_rng([seed, sum(map(ord, name))])
    model, state = configuration(kind, rng)
    parameters = quiet(model)
    give(parameters, model, name, rng)
    parameters.set("inertia", "mass", rng.uniform(0.5, 1.5, len(model.position)))
    if CATALOGUE[name].family in PAIRS:
        if kind == "folded":  # layers in one plane have no direction in which to part
            state.x[:, :, 2] += 0.02 * np.arange(len(state.x))[:, None]
        if CATALOGUE[name].family == "rub":  # needs a load
            parameters.set("touch", "stiffness", 700.0).set("touch", "thickness", 1.0)
    if CATALOGUE[name].family in CONTACTS:
        on_ground(parameters, model, state, 2e-5 if seed % 2 else -1e-5)
        if CATALOGUE[name].family != "contact":  # friction needs a load, and coefficients need friction
            parameters.set("ground", "stiffness", 700.0).set("friction", "stiffness", 300.0)
            if CATALOGUE[name].family == "tangent":
                parameters.set("coulomb", "friction_coefficient", 0.5)
    return model, parameters, state, rng


def moved(state, rng, size=1.0):
    out = state.copy()
    out.v[:] = rng.normal(size=out.v.shape) * size
    out.memory[:] = 1e-3 * rng.normal(size=out.memory.shape)
    return out


def responsible(name):
    """The effect in whose force a law shows: a friction coefficient shows in the friction."""
    return "friction" if CATALOGUE[name].family == "coefficient" else name


@pytest.mark.parametrize("name", CATALOGUE)
def test_has_prose_units_and_a_default_inside_its_bounds(name):
    effect = CATALOGUE[name]
    assert effect.family in FAMILIES
    assert effect.formula and effect.source and effect.matters
    assert bool(effect.confused_with) == bool(effect.separated_by)
    module = Path(origami_sim.effects.__file__).with_name(f"{name}.py").read_text()
    assert module.startswith('"""') and module.index("\n") > 20, "the file says what it is"
    assert len({p.name for p in effect.parameters}) == len(effect.parameters)
    for p in effect.parameters:
        assert p.symbol and p.meaning and p.unit, p
        assert p.bounds[0] <= p.default <= p.bounds[1], p
        assert p.bounds[0] < p.bounds[1] and p.knots >= 1, p
        assert np.isfinite(p.default)
        assert p.typical is None or p.bounds[0] <= p.typical <= p.bounds[1], p
    for fitted in effect.fitted[:1]:
        p = effect.parameter(fitted)
        assert p.typical, "a strength has a typical value"
        assert p.default == 0 or name in ACT_BY_DEFAULT, "a strength of zero is the default"
        assert effect.confused_with, "a suspect says what it is mistaken for"


def test_the_gpu_finds_the_forces_of_every_effect(cuda):
    """One program with the whole catalogue; skipped without a device. Only the compilers' rounding differs."""
    off = {}
    for name in ALL:
        on, largest = responsible(name), 0.0
        for seed in range(4):  # some act on one side only
            model, parameters, state, rng = setting(name, seed=seed)
            drive = the_drive(gradient=rng.normal(size=(3, 3)) if CATALOGUE[name].drives else None)
            state = moved(state, rng, 1e-6 if CATALOGUE[name].family in CONTACTS else 1.0)  # or feet rise too fast
            one, two = (Batch(model, parameters, drive, state, device=d).evaluate(NOW) for d in ("cpu", cuda))
            size = np.abs(one.forces[on]).max()
            difference = np.abs(two.forces[on] - one.forces[on]).max()
            if not difference <= 1e-10 * size:
                off[name] = difference / size
            largest = max(largest, size)
        assert largest > 0, name
    assert not off


@pytest.mark.parametrize("name", [n for n in ALL if CATALOGUE[n].energy is not None])
@pytest.mark.parametrize("kind", CONFIGURATIONS)
def test_force_is_minus_the_gradient_of_the_energy(name, kind):
    """Central differences over all coordinates; error EPS^2 f'' and roundoff U / EPS, both below 1e-6 of the force."""
    largest = 0.0
    for seed in (0, 1):
        model, parameters, state, _ = setting(name, kind, seed)
        n = model.position.size
        steps = EPS * np.concatenate([np.eye(n), -np.eye(n), np.zeros((1, n))])
        if CATALOGUE[name].family in CONTACTS:
            steps *= 0.1  # adhesion fades within micrometres
        worlds = np.moveaxis((state.x.reshape(1, n) + steps).reshape(2 * n + 1, -1, 3), 0, 1)
        many = start(model, 2 * n + 1, x=worlds)
        many.angles[:] = state.angles
        report = Batch(model, parameters, the_drive(), many).evaluate(NOW)
        u = report.energies[name]
        expected = -(u[:n] - u[n : 2 * n]) / (2 * steps.max())
        force = report.forces[name][:, -1].ravel()
        scale = np.abs(force).max()
        error = np.abs(force - expected).max()
        # where the force is zero, its second derivative is taken to be of the size of its first
        bent = max(1e-12, np.abs(u[:n] + u[n : 2 * n] - 2 * u[-1]).max())
        assert error <= 1e-6 * scale + 1e-15 / EPS * np.abs(u).max() * 50 + bent, (error / (scale or 1), scale)
        largest = max(largest, scale)
    assert kind != "random" or largest > 0, "the comparison is empty"


@pytest.mark.parametrize("name", [n for n in ALL if CATALOGUE[n].family in INTERNAL])
@pytest.mark.parametrize("kind", CONFIGURATIONS)
def test_internal_effects_have_no_net_force_and_no_net_torque(name, kind):
    largest = 0.0
    for seed in (0, 1):  # some act on one side only
        model, parameters, state, rng = setting(name, kind, seed)
        state = moved(state, rng)
        f = Batch(model, parameters, the_drive(), state).evaluate(NOW).forces[name][:, 0]
        scale = np.abs(f).max()
        assert np.abs(f.sum(0)).max() <= 1e-13 * len(f) * scale
        assert np.abs(np.cross(state.x[:, 0], f).sum(0)).max() <= 1e-12 * len(f) * scale
        largest = max(largest, scale)
    assert kind != "random" or largest > 0


def rotate_parameters(parameters, rotation):
    """Turns every vector among the parameters, that is every triple <name>_x, _y, _z."""
    out = parameters.copy()
    for owner, name in parameters:
        if name.endswith("_x"):
            keys = [(owner, f"{name[:-1]}{a}") for a in "xyz"]
            turned = np.einsum("ab,bew->aew", rotation, np.stack([out[k] for k in keys]))
            for key, value in zip(keys, turned, strict=True):
                out.set(*key, value)
    return out


def turn_state(state, model, r):
    out = state.copy()
    out.x, out.v = state.x @ r.T, state.v @ r.T
    row = 0
    for effect, memory in ((e, m) for e in CATALOGUE.values() for m in e.memory):
        for _ in range(model.count(effect.family)):
            if memory.size == 3 and not memory.own:
                out.memory[row : row + 3] = r @ state.memory[row : row + 3]
            row += memory.size
    return out


@pytest.mark.parametrize("name", ALL)
def test_forces_turn_with_the_device_and_its_surroundings(name):
    """Positions, velocities, memory, fields and gravity turned together; about the vertical where there is ground."""
    touching = CATALOGUE[name].family in CONTACTS
    show, largest = responsible(name), 0.0
    for seed in (1, 3, 5, 7):  # a foot resists backward sliding in some of them
        model, parameters, state, rng = setting(name, seed=seed)
        r = random_rotation(rng)
        if touching:
            c, s = math.cos(1.1), math.sin(1.1)
            r = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        state = moved(state, rng, 1e-4 if touching else 0.1)
        g = rng.normal(size=(3, 3))
        g = (g + g.T) / 2 if name == "field_gradient" else None
        f = Batch(model, parameters, the_drive(gradient=g), state).evaluate(NOW).forces[show]
        turned = Batch(model, rotate_parameters(parameters, r), the_drive(r, gradient=g), turn_state(state, model, r))
        after = turned.evaluate(NOW).forces[show]
        # the gap of a contact is a difference of coordinates of order one, micrometres large
        assert np.abs(after - f @ r.T).max() <= (1e-7 if touching else 1e-11) * np.abs(f).max()
        largest = max(largest, np.abs(f).max())
    assert largest > 0


@pytest.mark.parametrize("name", ALL)
def test_does_nothing_at_its_default_parameters(name):
    rng = np.random.default_rng(5)
    model, state = configuration("random", rng)
    parameters = quiet(model)
    if CATALOGUE[name].family in CONTACTS:
        on_ground(parameters, model, state, 0.1)
        if name != "ground":
            parameters.set("ground", "stiffness", 100.0)
    for p in CATALOGUE[name].parameters:
        parameters.set(name, p.name, p.default)
    state = moved(state, rng)
    state.memory[:] = 0
    forces = Batch(model, parameters, the_drive(gradient=np.eye(3)), state).evaluate(NOW).forces
    assert np.any(forces[name]) == (name in ACT_BY_DEFAULT)
    assert not np.any(forces["friction"])


@pytest.mark.parametrize("name", [n for n in ALL if CATALOGUE[n].strengths])
def test_is_passed_over_only_where_it_would_give_nothing(name):
    model, parameters, state, rng = setting(name, seed=1)
    state, drive = moved(state, rng), the_drive()
    worlds = [parameters.copy() for _ in range(len(CATALOGUE[name].strengths) + 1)]
    for k, w in enumerate(worlds):  # the last one has no strength at all
        for n, p in enumerate(CATALOGUE[name].strengths):
            w.set(name, p.name, parameters[name, p.name] if k == n else 0.0)
    state = state.select(np.zeros(len(worlds), int))
    every, skipping = (
        Batch(model, Parameters.join(worlds), drive, state, among=among).evaluate(NOW).forces[responsible(name)]
        for among in ((), model.effects)
    )
    assert np.array_equal(skipping[:, :-1], every[:, :-1])
    if not CATALOGUE[name].memory:  # which was made up
        assert np.array_equal(skipping, every)


@pytest.mark.parametrize("name", [n for n in ALL if CATALOGUE[n].fitted])
def test_a_suspect_is_silent_at_zero_strength_and_heard_at_its_typical_values(name):
    """The diagnosis compares a model with and without it by its strength alone."""
    effect, heard = CATALOGUE[name], False
    for seed in (1, 3, 5, 7):
        model, parameters, state, rng = setting(name, seed=seed)
        state = moved(state, rng, 1e-4 if effect.family in CONTACTS else 1.0)
        drive = the_drive(gradient=np.eye(3) - np.diag([0, 0, 3.0]) if name == "field_gradient" else None)
        for p in effect.parameters:
            if p.typical is not None:
                parameters.set(name, p.name, p.typical)
        off = parameters.copy().set(name, effect.fitted[0], 0.0)
        clean = state.copy()
        clean.memory[:] = 0.0
        with_it = Batch(model, parameters, drive, state).evaluate(NOW).forces[responsible(name)]
        without = Batch(model, off, drive, clean).evaluate(NOW).forces[responsible(name)]
        heard |= np.any(with_it != without)
        assert effect.family == "coefficient" or not np.any(without)
    assert heard


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("kind", [*CONFIGURATIONS, "rest"])
def test_stays_finite_when_flat_when_folded_and_at_rest(name, kind):
    model, parameters, state, rng = setting(name, "flat" if kind == "rest" else kind)
    if kind == "rest" and "rest_length" in {p.name for p in CATALOGUE[name].parameters}:
        parameters.set(name, "rest_length", np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1))
    if kind != "rest":
        state = moved(state, rng)
    report = Batch(model, parameters, the_drive(), state).evaluate(NOW)
    assert np.all(np.isfinite(report.forces[responsible(name)]))
    assert name not in report.energies or np.all(np.isfinite(report.energies[name]))


LIMITING = [n for n in ALL if CATALOGUE[n].stiffness is not None]


@pytest.mark.parametrize("name", [n for n in LIMITING if CATALOGUE[n].family in SHELLS and not CATALOGUE[n].memory])
def test_declared_stiffness_of_a_sheet_bounds_its_frequencies(name):
    """A bumpy sheet without stress: the largest eigenvalue of its tangent stays below what limits the step."""
    rng = np.random.default_rng(4)
    model = strip(3, effects=(name,))
    model = replace(model, bends=np.concatenate([model.creases, model.bends]), creases=model.creases[:0])
    model = replace(model, position=model.position + 0.1 * rng.uniform(-1, 1, model.position.shape))
    parameters = Parameters(model)
    entries = {"11": 1.5, "22": 1.0, "12": 0.3, "66": 0.6, "16": 0.1, "26": -0.2}
    for component, value in entries.items():
        parameters.set(name, f"stiffness_{component}", value)
    bound = (2 / stable_step(model, parameters).limit) ** 2
    highest = np.linalg.eigvalsh(tangent(model, parameters).toarray())[-1]
    assert bound / 10 < highest < bound


@pytest.mark.parametrize("name", [n for n in LIMITING if CATALOGUE[n].family not in SHELLS])
def test_declared_stiffness_bounds_the_slope_of_the_force(name):
    """One element: |d(force)/d(coordinate)| by differences over the whole range stays below what limits the step."""
    effect = CATALOGUE[name]
    if effect.family == "bar":
        gap = None
        model = make_model([[0, 0, 0], [1, 0, 0]], bars=[(0, 1)])
        q = np.linspace(0.95, 1.05, 401)  # bars are promised to strain by a few percent
        x = np.zeros((2, len(q), 3))
        x[1, :, 0] = q
        angles = None
    elif effect.family in ("crease", "bend"):
        gap = None
        model = make_model(np.zeros((4, 3)), **{effect.family + "s": [(0, 1, 2, 3)]})
        angles = q = np.linspace(-1.1 * math.pi, 1.1 * math.pi, 4001)
        x = np.stack([hinge_positions(a, (0.5, 1.0), (0.5, 1.0)) for a in q], axis=1)
    elif effect.family in PAIRS:  # a corner of another body over a triangle
        gap = None
        x = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0], [0.3, 0.3, 2], [0.4, 0.3, 2]]
        model = make_model(x, triangles=[(0, 1, 2), (3, 4, 5)])
        q = np.linspace(0.05, 0.15, 401)
        x = np.repeat(model.position[:, None], len(q), 1)
        x[3, :, 2] = q
        angles = None
    else:
        gap = q = np.linspace(-1e-4, 1e-4, 401)
        model = make_model([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[(0, 1, 2)], contacts=[(0, 1, 2)])
        x = np.repeat(model.position[:, None], len(q), 1)
        x[0, :, 2] = gap
        angles = None
    parameters = quiet(model, {("plane", "reach"): 1.0})
    give(parameters, model, name, np.random.default_rng(2))
    if effect.family in PAIRS:
        parameters.set("touch", "thickness", 0.1)
    state = start(model, len(q), x=x)
    if angles is not None:
        state.angles[0] = angles
    f = Batch(model, parameters, the_drive(), state).evaluate(NOW).forces[name]
    along = f[0, :, 0] if effect.family == "bar" else f[3 if effect.family in PAIRS else 0, :, 2]
    if angles is not None:  # the node l turns about a lever of one
        along = -f[3, :, 1] * np.sin(q) + f[3, :, 2] * np.cos(q)
    steepest = np.abs(np.diff(along) / np.diff(q)).max()
    declared = float(np.max(effect.stiffness(parameters.of(name))))
    if effect.memory or effect.family == "tangent":
        assert declared > 0  # their slope shows in time, see test_timestep
    else:
        assert steepest <= declared * (1.15 if name == "ogden_bars" else 1 + 1e-6), steepest / declared
        assert steepest > declared / 10


def everything(seed=7, *, rates=True):
    """All effects at once."""
    rng = np.random.default_rng(seed)
    model, state = configuration("random", rng)
    parameters = quiet(model)
    for name in ALL:  # each has numbers of its own, so that a new effect does not change those of the others
        give(parameters, model, name, np.random.default_rng([seed, *name.encode()]))
    # magnets and stacks of the same size as the rest
    for name in ("magnetic_torque", "magnetic_torque_affine", "field_gradient"):
        parameters.set(name, "volume", 1e-6)
    parameters.set("inertia", "mass", rng.uniform(0.5, 1.5, len(model.position)))
    on_ground(parameters, model, state, 0.05)
    if not rates:
        for name in ALL:
            for p in CATALOGUE[name].parameters:
                if p.name in RATE_LAWS:
                    parameters.set(name, p.name, p.bounds[1] if p.name == "fading_speed" else 0.0)
    return model, parameters, the_drive(gradient=0.1 * np.eye(3)), moved(state, rng)


@pytest.mark.slow
def test_forces_by_effect_add_up_to_the_force_that_moves_the_nodes():
    model, parameters, drive, state = everything()
    batch = Batch(model, parameters, drive, state)
    report = batch.evaluate(0.0)
    for name in ALL:
        if CATALOGUE[name].family != "coefficient" and "time" not in CATALOGUE[name].drives:
            assert np.any(report.forces[name]), name
    added = sum(report.forces.values())
    total = batch.total_force(0.0)
    batch.advance(0, 1e-4, np.inf)
    moving = node_mass(batch.model, parameters)[:, :, None] * batch.state().a
    scale = np.abs(total).max()
    assert np.abs(total - added).max() <= 1e-12 * scale
    assert np.abs(moving - added).max() <= 1e-12 * scale


def test_forces_by_effect_add_up_after_a_step_too():
    """Without rates in the laws, or the velocity predicted in the step would differ from the one reached."""
    model, parameters, drive, state = everything(rates=False)
    batch = Batch(model, parameters, drive, state)
    batch.advance(1, 1e-4, np.inf)
    added = sum(batch.evaluate(1e-4).forces.values())
    moving = node_mass(batch.model, parameters)[:, :, None] * batch.state().a
    assert np.abs(moving - added).max() <= 1e-12 * np.abs(added).max()
    assert np.abs(batch.total_force(1e-4) - added).max() <= 1e-12 * np.abs(added).max()


def test_unknown_effects_and_parameters_are_named():
    with pytest.raises(InputError, match=r"gravity.*is near.*gravitation"):
        strip(1).with_effects("gravitation")
    with pytest.raises(InputError, match=r"crease\.stiffnes.*rest_angle, stiffness"):
        Parameters(strip(1)).set("crease", "stiffnes", 1.0)


def test_what_the_seed_paper_names_as_causes_are_suspects():
    """The table of docs/diagnosis.md; effects that are written there exist and have numbers to fit."""
    page = (Path(__file__).parents[2] / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    table = page.split("What the seed paper itself names")[1].split("\n## ")[0]
    named = [n for row in table.splitlines() if row.startswith("|") for n in re.findall(r"`(\w+)`", row)]
    assert len(set(named)) >= 10
    assert not [n for n in named if n not in CATALOGUE or not CATALOGUE[n].fitted]
    assert len([e for e in CATALOGUE.values() if e.fitted]) >= 25
