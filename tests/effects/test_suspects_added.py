"""Closed forms of masses, of the direction of magnets, of fields that grow along a line, of aging and of encoders."""

import math

import numpy as np
import pytest
from effects.kit import hinge, hinge_positions, make_model, quiet, random_rotation, start
from effects.test_rigid_catalogue import the_model
from effects.test_suspects_fields import MAGNET, MOMENT, plate, under

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Parameters, node_mass
from origami_sim.physics.materials import MU0
from origami_sim.solve.batch import Batch, forces
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.timestep import stable_step

LEVER = 0.9
"""Distance of node l of the hinge from its axis [m]."""

G = {"gravity_x": 0.7, "gravity_y": -1.1, "gravity_z": -9.8}


# --- masses -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["explicit", "implicit"])
@pytest.mark.parametrize(("effect", "strength", "factor"), [("mass_error", 0.44, 1.44), ("added_mass", 1.25e-3, 3.5)])
def test_a_heavier_node_swings_more_slowly_on_its_spring(method, effect, strength, factor):
    """cos(w t), w = sqrt(k / m'), with m' = (1 + e) m or m + dm."""
    k, m = 0.2, 5e-4
    model = make_model([[0.0, 0, 0]], effects=("tether", effect))
    values = {("tether", "stiffness"): k, ("tether", "anchor_z"): 0.01, ("inertia", "mass"): m}
    parameters = quiet(model, {**values, (effect, get(effect).fitted[0]): strength})
    run = simulate(model, parameters, duration=0.5, dt=2e-4, rate=100, method=method)
    w = math.sqrt(k / (factor * m))
    assert run.x[:, 0, 0, 2] == pytest.approx(0.01 * (1 - np.cos(w * run.times)), abs=1e-5)
    assert run.energies["kinetic"].max() == pytest.approx(0.5 * k * 0.01**2, rel=1e-2)
    light = parameters.copy().set(effect, get(effect).fitted[0], 0.0)
    assert stable_step(model, parameters).limit / stable_step(model, light).limit == pytest.approx(math.sqrt(factor))


def test_heavy_and_inertial_mass_are_equal():
    """Whatever is added, all of it falls as everything does."""
    model = make_model([[0.0, 0, 0], [1, 0, 0]], effects=("gravity", "mass_error", "added_mass"))
    parameters = quiet(model, {("inertia", "mass"): 1e-3})
    for name in model.effects:
        for key, value in G.items():
            parameters.set(name, key, value)
    parameters.set("mass_error", "mass_gain", [-0.4, 0.7]).set("added_mass", "added", [0.0, 3e-3])
    assert node_mass(model, parameters)[:, 0] == pytest.approx([0.6e-3, 4.7e-3])
    run = simulate(model, parameters, duration=0.3, dt=1e-3, rate=100)
    fall = 0.5 * run.times[-1] ** 2 * np.array(list(G.values()))
    assert run.x[-1, :, 0] - run.x[0, :, 0] == pytest.approx(np.stack([fall, fall]), rel=1e-9)
    assert np.ptp(run.energy_balance()) < 1e-12


def test_a_node_keeps_some_mass():
    model = make_model([[0.0, 0, 0]], effects=("mass_error", "added_mass"))
    parameters = Parameters(model).set("mass_error", "mass_gain", -0.9)
    assert node_mass(model, parameters)[0, 0] == pytest.approx(0.1)
    with pytest.raises(InputError, match=r"mass_error.mass_gain.*-0\.9 to 9"):
        parameters.set("mass_error", "mass_gain", -1.0)
    with pytest.raises(InputError, match=r"added_mass.added"):
        parameters.set("added_mass", "added", -1e-3)


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_a_mass_at_the_end_of_a_panel_adds_its_moment_of_inertia(panels):
    """A held panel and one on its crease: K theta'' = -K theta / (I + m r^2), with the mass at two corners at r = 1."""
    k, each, added = 0.3, 0.05, 0.02
    x = np.array([[i, j, 0.0] for i in range(3) for j in (0.0, 1.0)])
    free = np.ones_like(x)
    free[:4] = 0.0
    if panels == "elastic":  # the corners of the swinging panel are all that moves
        bars = {"bars": [(2, 4), (3, 5), (4, 5), (2, 5)]}
        effects = ("crease", "bars", "panel_bending", "added_mass")
        bars["bends"] = [(4, 2, 5, 3)]
    else:
        bars, effects = {}, ("crease", "added_mass")
    triangles = [(0, 2, 3), (0, 3, 1), (2, 4, 5), (2, 5, 3)]
    model = make_model(x, creases=[(5, 2, 3, 0)], triangles=triangles, free=free, effects=effects, **bars)
    model = type(model)(**{**vars(model), "triangle_panel": np.array([0, 0, 1, 1]), "panels": panels})
    parameters = quiet(model, {("inertia", "mass"): each, ("crease", "stiffness"): k})
    if panels == "elastic":
        length = np.linalg.norm(np.diff(x[model.bars], axis=1)[:, 0], axis=-1)
        parameters.set("bars", "rest_length", length).set("bars", "stiffness", 2e4)
        parameters.set("panel_bending", "stiffness", 2e3)
    parameters.set("added_mass", "added", added, [4, 5])
    state = start(model, v=np.array([[0, 0, 0]] * 4 + [[0, 0, 0.02]] * 2, float))
    run = simulate(model, parameters, duration=2.0, rate=50, state=state)
    w = math.sqrt(k / (2 * (each + added)))
    assert np.abs(run.creases[:, 0, 0]) == pytest.approx(np.abs(0.02 / w * np.sin(w * run.times)), abs=2e-6)


def test_a_heavier_rigid_panel_has_more_inertia_about_its_own_centre():
    """Its four mass points, and nothing else, scale by 1 + e."""
    model = the_model()
    parameters = quiet(model, {("inertia", "mass"): np.linspace(0.5, 1.5, len(model.position))})
    mine = np.unique(model.triangles[model.triangle_panel == 2])
    parameters.set("mass_error", "mass_gain", 0.3, mine)
    ratio = node_mass(model, parameters)[:, 0] / parameters["inertia", "mass"][:, 0]
    assert ratio[mine] == pytest.approx(1.3) and np.delete(ratio, mine) == pytest.approx(1.0)


# --- magnets ----------------------------------------------------------------------------------------------------------


def resultant(model, values, drive, x):
    """Sum of the forces [N] and torque about the origin [N m] of all effects."""
    f = sum(forces(model, quiet(model, values), drive, start(model, x=x), 0.0).forces.values())[:, 0]
    return f.sum(0), np.cross(x, f).sum(0)


@pytest.mark.parametrize("normal", [0.0, 0.6, -1.0])
def test_a_magnet_poled_otherwise_feels_the_torque_of_its_true_direction(normal):
    """m u' x B with u' by rotations: the lean about -e2, then the turn towards e2."""
    rng = np.random.default_rng(8)
    model, field, r = plate(), np.array([0.05, -0.12, 0.07]), random_rotation(rng)
    share = math.sqrt(1 - normal**2)
    poling = {"poling_1": 1.0, "poling_n": normal} if share else {"poling_1": 0.0, "poling_n": normal}
    magnet = {**MAGNET, **poling}
    for turn, lean in ((0.3, 0.0), (0.0, -0.4), (1.1, 0.7), (-2.0, 2.5)):
        values = under("magnetic_torque", **magnet) | under("poling_error", **magnet, turn=turn, lean=lean)
        x = model.position @ r.T
        f, torque = resultant(plate_with("magnetic_torque", "poling_error"), values, Drive(field=tuple(r @ field)), x)
        rise = math.asin(normal) + lean
        u = np.array([math.cos(turn) * math.cos(rise), math.sin(turn), math.cos(turn) * math.sin(rise)])
        assert torque @ r == pytest.approx(MOMENT * np.cross(u, field), rel=1e-12, abs=1e-17)
        assert np.abs(f).max() < 1e-12 * np.abs(torque).max()
    assert np.linalg.norm(u) == pytest.approx(1.0)


def plate_with(*effects):
    return make_model(plate().position, triangles=[(0, 1, 2)], effects=effects)


def gradient(field, **values):
    """G [T/m] of field_slope, column by column from the pull on magnets poled along x, y and z at the origin."""
    model = plate_with("field_slope")
    x, columns = model.position - model.position.mean(0), []
    for poling in ({"poling_1": 1.0}, {"poling_1": -0.2, "poling_2": 1.0}, {"poling_n": 1.0, "poling_1": 0.0}):
        given = under("field_slope", **{**MAGNET, **poling}, **values)
        columns.append(resultant(model, given, Drive(field=tuple(field)), x)[0] / MOMENT)
    return np.stack(columns, axis=1)


ROUND, FLAT = {"narrowing": 0.5}, {"narrowing": 0.0}


@pytest.mark.parametrize("shape", [ROUND, FLAT, {"narrowing": 0.8}])
def test_a_field_slope_is_free_of_curl_and_divergence_and_rises_as_stated(shape):
    rng = np.random.default_rng(2)
    for _ in range(4):
        field, slope = rng.normal(size=3) * 0.1, rng.normal(size=3)
        stated = dict(zip(("slope_x", "slope_y", "slope_z"), slope, strict=True))
        g = gradient(field, **stated, **shape)
        size = np.abs(g).max()
        assert np.abs(g - g.T).max() < 1e-12 * size and abs(np.trace(g)) < 1e-12 * size
        b = field / np.linalg.norm(field)
        assert b @ g == pytest.approx(np.linalg.norm(field) * slope, rel=1e-11)
        assert gradient(-field, **stated, **shape) == pytest.approx(-g, rel=1e-12)


def test_a_field_slope_in_the_plane_of_motion():
    """Long pole pieces: quadrupole field in x-z alone; round ones: half of the closing in lies across the plane."""
    up = (0.0, 0.0, 0.1)
    assert gradient(up, slope_z=2.0, **FLAT) == pytest.approx(0.2 * np.diag([-1.0, 0.0, 1.0]), abs=1e-15)
    assert gradient(up, slope_z=2.0, **ROUND) == pytest.approx(0.2 * np.diag([-0.5, -0.5, 1.0]), abs=1e-15)
    shear = np.array([[0, 0, 1.0], [0, 0, 0], [1, 0, 0]])
    assert gradient(up, slope_x=3.0, **FLAT) == pytest.approx(0.3 * shear, abs=1e-15)
    turned = gradient(up, slope_z=2.0, across_x=1.0, across_y=0.0, **FLAT)
    assert turned == pytest.approx(0.2 * np.diag([0.0, -1.0, 1.0]), abs=1e-15)
    along = gradient((0.0, 0.1, 0.0), slope_y=2.0, **FLAT)  # along the folds there is no plane of motion
    assert along == pytest.approx(0.2 * np.diag([-0.5, 1.0, -0.5]), abs=1e-15)


def test_a_field_slope_pulls_and_turns_a_magnet_off_the_origin():
    """f = G m, torque about the origin x c f + m x (G c)."""
    model, r = plate_with("field_slope"), random_rotation(np.random.default_rng(5))
    field, stated = np.array([0.04, 0.0, 0.09]), {"slope_x": 1.3, "slope_z": -0.7, "narrowing": 0.2}
    x = model.position @ r.T + [0.3, -0.1, 0.2]
    f, torque = resultant(model, under("field_slope", **MAGNET, **stated), Drive(field=tuple(field)), x)
    g, m, c = gradient(field, **stated), MOMENT * r[:, 0], x.mean(0)
    assert f == pytest.approx(g @ m, rel=1e-11)
    assert torque == pytest.approx(np.cross(c, g @ m) + np.cross(m, g @ c), rel=1e-11)
    assert MOMENT == pytest.approx(MAGNET["remanence"] * MAGNET["volume"] / MU0)


# --- creases ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [0.0, 0.5, 9.0, 99.0])
def test_the_rest_angle_of_an_aging_crease_moves_as_far_in_every_decade(time):
    k, rest, drift, onset = 0.7, 0.3, 0.1, 1.0
    values = under("crease", stiffness=k, rest_angle=rest)
    values |= under("crease_aging", stiffness=k, drift=drift, onset=onset)
    now = rest + drift * math.log(1 + time / onset)
    for angle in (now, now + 0.2):
        model = hinge(effects=("crease", "crease_aging"))
        state = start(model, x=hinge_positions(angle))
        f = sum(Batch(model, quiet(model, values), Drive(), state).evaluate(time).forces.values())[3, 0]
        moment = LEVER * (-math.sin(angle) * f[1] + math.cos(angle) * f[2])
        assert moment == pytest.approx(-k * (angle - now), abs=1e-13)


# --- the measurement --------------------------------------------------------------------------------------------------


def test_an_eccentric_encoder_errs_once_a_turn_and_not_at_its_zero():
    amplitude, phase = 0.02, 0.7
    angle = np.linspace(0, 4 * np.pi, 401)
    read = get("angle_eccentricity").apply(
        lambda _: angle[:, None, None], angle[:, None], np.array([amplitude * math.cos(phase)]),
        np.array([amplitude * math.sin(phase)]),
    )[:, 0, 0]  # fmt: skip
    error = read - angle
    assert error == pytest.approx(amplitude * (np.sin(angle + phase) - math.sin(phase)), abs=1e-14)
    assert error[0] == 0.0 and error[:201] == pytest.approx(error[200:], abs=1e-14)
    assert np.ptp(error) == pytest.approx(2 * amplitude, rel=1e-3)
