"""Statics against closed forms and an independent reduced model."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve
from structures import flap, kresling, strip, tent, truss

from origami_sim import Sheet
from origami_sim import strip as pattern_strip
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.model import State
from origami_sim.results.run_folder import save_run
from origami_sim.solve.batch import forces
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.motion.quasistatic import quasistatic
from origami_sim.solve.statics import system
from origami_sim.solve.statics.equilibria import continuation, equilibrium, tangent
from origami_sim.view.export import export
from origami_sim.view.replay import write_replay

# --- tangent


def _shaken(model, size, seed=0):
    rng = np.random.default_rng(seed)
    return State.at_rest(model, 1, model.position + size * rng.standard_normal(model.position.shape))


def test_tangent_matches_dense_differences_of_the_forces():
    model, parameters = kresling()
    drive, state = Drive(load=0.3), _shaken(model, 0.03)
    fast = tangent(model, parameters, drive, state=state).toarray()
    # one column per world, Richardson extrapolation of three central differences
    n, h = len(model.position), 4e-3
    column = {}
    for step in (h, h / 2, h / 4):
        for sign in (1, -1):
            x = state.x + sign * step * np.eye(3 * n).reshape(n, 3, 3 * n).transpose(0, 2, 1)
            total = sum(forces(model, parameters, drive, State.at_rest(model, 3 * n, x), 0.0).forces.values())
            column[step, sign] = total.transpose(0, 2, 1).reshape(3 * n, 3 * n)
    d = [-(column[s, 1] - column[s, -1]) / (2 * s) for s in (h, h / 2, h / 4)]
    e = [(4 * d[1] - d[0]) / 3, (4 * d[2] - d[1]) / 3]
    dense = ((16 * e[1] - e[0]) / 15) * model.free.ravel()
    assert np.abs(fast - dense).max() < 1e-9 * np.abs(dense).max()


def test_tangent_of_conservative_forces_is_symmetric():
    model, parameters = kresling()
    k = tangent(model, parameters, Drive(load=0.3), state=_shaken(model, 0.03)).toarray()
    moving = model.free.ravel() > 0
    k = k[np.ix_(moving, moving)]
    assert np.abs(k - k.T).max() < 2e-11 * np.abs(k).max()


def test_tangent_of_a_truss_is_exact():
    a, h, stiffness, w = 1.0, 0.3, 100.0, 0.1
    model, parameters = truss(h, stiffness)
    x = model.position.copy()
    x[2, 2] = h - w
    k = tangent(model, parameters, state=State.at_rest(model, 1, x)).toarray()
    length, rest, z = np.hypot(a, h - w), np.hypot(a, h), h - w
    assert k[8, 8] == pytest.approx(2 * stiffness * (1 - rest / length + rest * z**2 / length**3), rel=1e-11)
    assert np.count_nonzero(k) == 5  # the apex, and two axes of either support


# --- equilibrium


def test_magnetic_crease_balances_its_torque():
    remanence, volume, side, stiffness, field = 0.13, 0.02 * 0.02 * 0.003, 0.02, 0.02, 0.2
    model, parameters = flap(side=side, stiffness=stiffness)
    _pole(parameters, remanence, volume)
    found = equilibrium(model, parameters, Drive(field=(0, 0, field)))
    torque = remanence * volume / 1.25663706212e-6 * field
    assert found.converged and found.stable
    assert stiffness * found.angles[0] == pytest.approx(torque * np.cos(found.angles[0]), rel=1e-10)
    assert np.degrees(found.angles[0]) == pytest.approx(47.788428, abs=1e-6)  # reference result
    assert np.linalg.norm(found.x[2] - [0, side / 2, 0]) == pytest.approx(side, rel=1e-12)


def _pole(parameters, remanence, volume):
    for name, value in (("remanence", remanence), ("volume", volume), ("poling_1", 1.0), ("poling_2", -0.5)):
        parameters.set("magnetic_torque", name, value)


def test_newton_converges_quadratically():
    model, parameters = kresling()
    history = equilibrium(model, parameters, Drive(load=0.2)).history
    tail = np.log(history[(history < 0.1) & (history > 1e-12)])
    slopes = np.diff(tail)[1:] / np.diff(tail)[:-1]
    assert len(slopes) and np.all(slopes > 1.8)


@pytest.mark.parametrize("field", [-0.05, -0.15])
def test_flap_in_an_opposed_field_buckles_when_the_field_wins(field):
    """K theta = m B sin(theta): flat is stable while K > m B, and beyond only the tilted states are."""
    remanence, volume, stiffness = 0.13, 1.2e-6, 0.01
    model, parameters = flap(stiffness=stiffness)
    _pole(parameters, remanence, volume)
    torque = -remanence * volume / 1.25663706212e-6 * field
    found = equilibrium(model, parameters, Drive(field=(field, 0, 0)))
    assert found.converged and found.stable
    if torque < stiffness:
        assert found.angles[0] == pytest.approx(0.0, abs=1e-9)
        return
    assert abs(found.angles[0]) > 0.5
    assert stiffness * found.angles[0] == pytest.approx(torque * np.sin(found.angles[0]), rel=1e-9)
    flat = equilibrium(model, parameters, Drive(field=(field, 0, 0)), unstable=True)
    assert flat.converged and not flat.stable
    assert flat.eigenvalues[0] == pytest.approx((stiffness - torque) / 0.02**2, rel=1e-6)
    assert "unstable" in flat.message


def test_unstable_equilibrium_is_left():
    model, parameters = truss(0.3)
    level = model.position.copy()
    level[2, 2] = 0.0
    state = State.at_rest(model, 1, level)
    found = equilibrium(model, parameters, state=state)
    assert found.stable and abs(found.x[2, 2]) == pytest.approx(0.3, rel=1e-10)
    held = equilibrium(model, parameters, state=state, unstable=True)
    assert held.converged and not held.stable and held.x[2, 2] == 0.0


def test_load_beyond_the_limit_snaps_through():
    model, parameters = truss(0.3)
    found = equilibrium(model, parameters, Drive(load=1.5))
    assert found.stable and found.x[2, 2] < -0.3
    assert found.reactions[:2, 2].sum() == pytest.approx(1.5, rel=1e-9)


def test_free_body_relaxes_with_six_neutral_modes():
    model, parameters = flap(free=True)
    parameters.set("crease", "rest_angle", 0.7)
    found = equilibrium(model, parameters)
    assert found.converged and found.stable and found.neutral == 6
    assert found.angles[0] == pytest.approx(0.7, abs=1e-10)
    assert np.allclose(found.x.mean(0), model.position.mean(0), atol=1e-9)


def test_free_body_under_a_load_has_no_equilibrium():
    model, parameters = flap(free=True)
    parameters.set("load", "force_z", -0.1)
    found = equilibrium(model, parameters, Drive(load=1.0), max_iterations=20)
    assert not found.converged and not found.stable
    assert "nothing holds the body against a net force of 0.4 N" in found.message


def test_sheet_comes_to_rest_on_the_ground():
    model, parameters = tent(stiffness=500.0)
    found = equilibrium(model, parameters)
    assert found.converged and found.stable and found.neutral == 3  # it may slide and turn about the vertical
    feet = found.x[2:, 2]
    assert feet.mean() == pytest.approx(-6 * 1e-3 * 9.80665 / (4 * 500.0), rel=1e-9)


def test_crease_folds_past_flat_folded():
    """Angles continue those of the given state, so a crease at 3.3 rad does not become one at -2.98."""
    model, parameters = flap(membrane=10.0)
    state = State.at_rest(model)
    for rest in (1.5, 3.0):
        state = equilibrium(model, parameters.set("crease", "rest_angle", rest), state=state).state
    side, end = 0.02, 3.3
    state.x[2, 0] = side * np.array([np.cos(end), 0.5, np.sin(end)])
    read = equilibrium(model, parameters, state=state, max_iterations=1)  # takes no step
    assert not read.converged and read.angles[0] == pytest.approx(end, abs=1e-6)
    found = equilibrium(model, parameters, state=state)
    assert found.converged and found.angles[0] == pytest.approx(3.0, abs=1e-9)


def test_damped_steps_find_the_same_equilibrium():
    model, parameters = kresling()
    plain = equilibrium(model, parameters, Drive(load=0.2))
    damped = equilibrium(model, parameters, Drive(load=0.2), max_iterations=plain.iterations + 1)  # from half on
    assert damped.converged and np.allclose(damped.x, plain.x, atol=1e-10)


def test_sparse_spectrum_equals_the_dense_one(monkeypatch):
    model, parameters = kresling()
    dense = equilibrium(model, parameters, Drive(load=0.2))
    monkeypatch.setattr(system, "DENSE", 0)
    sparse = equilibrium(model, parameters, Drive(load=0.2))
    assert np.allclose(sparse.eigenvalues, dense.eigenvalues, rtol=1e-8)
    crossed = continuation(model, parameters, Drive(load=1.0), max_points=13)
    assert crossed.negative[-1] == 1 and crossed.stable[0]


def _elastica(load: float) -> float:
    """Tip deflection of a cantilever of unit length and rigidity under a dead tip load across it."""
    s = np.linspace(0, 1, 200)
    solution = solve_bvp(
        lambda s, y: np.stack([y[1], -load * np.cos(y[0]), np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1], a[2]]),
        s,
        np.zeros((3, 200)),
        tol=1e-9,
        max_nodes=100_000,
    )
    return solution.y[2, -1]


def test_strip_of_hinges_converges_to_the_elastica_with_second_order():
    load, cells = 5.0, np.array([4, 8, 16])
    exact, errors = _elastica(load), []
    for n in cells:
        model, parameters = strip(n)
        found = equilibrium(model, parameters, Drive(load=load))
        assert found.converged and found.stable
        errors.append(abs(-found.x[-1, 2] - exact))
    slope = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 0.002
    assert exact == pytest.approx(0.7137915, abs=1e-7)  # hard-magnetic elastica, lambda = 5: the same equation


def test_worlds_are_solved_one_by_one_and_the_result_can_be_simulated():
    model, parameters = flap(membrane=10.0)
    parameters.set("crease", "rest_angle", np.array([[0.1, 0.2, 0.3]]))
    for world, angle in enumerate((0.1, 0.2, 0.3)):
        found = equilibrium(model, parameters, Drive(load=ramp(np.array([0.0, 1.0, 2.0]), 1.0)), time=0.5, world=world)
        assert found.angles[0] == pytest.approx(angle, abs=1e-10)
    parameters.set("inertia", "mass", 1e-3)
    run = simulate(model, parameters.world(2), duration=0.05, state=found.state)
    assert np.abs(run.angles - 0.3).max() < 1e-9


def test_bad_arguments_are_named():
    model, parameters = truss()
    with pytest.raises(InputError, match="tolerance"):
        equilibrium(model, parameters, tolerance=0.0)
    with pytest.raises(InputError, match="world"):
        equilibrium(model, parameters, world=1)
    with pytest.raises(InputError, match="ends before"):
        equilibrium(model, parameters, Drive(load=ramp(1.0, 1.0)), time=2e9)
    with pytest.raises(InputError, match="end"):
        continuation(model, parameters, Drive(), end=0.0)
    state = State.at_rest(model)
    state.x[2] = np.nan
    with pytest.raises(InputError, match="finite"):
        equilibrium(model, parameters, state=state)


# --- continuation


def test_truss_path_follows_the_closed_form_through_both_limits():
    a, h, stiffness = 1.0, 0.3, 100.0
    model, parameters = truss(h, stiffness)
    path = continuation(model, parameters, Drive(load=1.0), end=2.0)
    z, rest = path.x[:, 2, 2], np.hypot(a, h)
    load = 2 * stiffness * z * (rest / np.hypot(a, z) - 1)
    assert path.reached and path.factor[-1] == 2.0
    assert np.allclose(path.factor, load, atol=1e-9)
    crest = np.sqrt((rest / a) ** (2 / 3) - 1) * a  # dP/dz = 0
    peak = 2 * stiffness * crest * (rest / np.hypot(a, crest) - 1)
    assert np.allclose(path.factor[path.limit_points], [peak, -peak], rtol=1e-10)
    assert np.allclose(z[path.limit_points], [crest, -crest], rtol=1e-6)
    # stability is lost at the first limit and regained at the second, and nowhere else
    between = np.setdiff1d(np.arange(len(z)), path.limit_points)
    assert np.array_equal(path.negative[between] > 0, np.abs(z[between]) < crest)
    assert len(path.branch_points) == 0


def _kresling_energy(h, r, turn):
    """Strain energy per sector of the cell while it stays symmetric: top ring of radius r, turned by `turn`."""
    step = np.pi / 4

    def at(radius, angle, z):
        return np.array([radius * np.cos(angle), radius * np.sin(angle), z])

    def points(h, r, turn):
        return [at(1, i * step, 0) for i in (-1, 0, 1)] + [at(r, turn + i * step, h) for i in (-1, 0, 1)]

    def bar(length, rest):
        s = length / rest
        return 0.1 * rest * 5e3 / 4 * (s**5 / 5 - s + 0.8)

    def fold(axis_from, axis_to, left, right):
        """Dihedral angle inside the cell, 180 degrees when flat."""
        n1 = np.cross(axis_to - axis_from, left - axis_from)
        n2 = np.cross(right - axis_from, axis_to - axis_from)
        bend = np.arccos(np.clip(n1 @ n2 / np.linalg.norm(n1) / np.linalg.norm(n2), -1, 1))
        return np.pi - bend if (right - axis_from) @ n1 < 0 else np.pi + bend

    def shape(h, r, turn):
        b0, b1, b2, _, t1, t2 = points(h, r, turn)
        spans = [np.linalg.norm(e) for e in (t2 - t1, t1 - b1, t2 - b1)]
        # the diagonal b1-t2, between t1 and b2; the upright b1-t1, between b0 and t2
        return spans, [fold(b1, t2, t1, b2), fold(b1, t1, b0, t2)]

    def crease(theta, rest, length):
        edge = np.pi / 4
        mirrored = theta > np.pi
        t, t0 = (2 * np.pi - theta, 2 * np.pi - rest) if mirrored else (theta, rest)
        if t > edge:
            return 1e-3 * length * (t - t0) ** 2 / 2
        s = 2 * edge / np.pi  # moment k (edge - t0) + k s tan((t - edge) / s)
        u = (t - edge) / s
        return 1e-3 * length * ((edge - t0) ** 2 / 2 + (edge - t0) * (t - edge) - s * s * np.log(np.cos(u)))

    (rest_spans, rest_folds), (spans, folds) = shape(1.0, 1.0, np.pi / 4), shape(h, r, turn)
    energy = sum(bar(a, b) for a, b in zip(spans, rest_spans, strict=True))
    pairs = zip(folds, rest_folds, (rest_spans[2], rest_spans[1]), strict=True)
    return energy + sum(crease(theta, rest, length) for theta, rest, length in pairs)


def _kresling_gradient(q):
    q, h = np.asarray(q, float), 1e-4
    steps = h * np.eye(len(q))
    return np.array(
        [
            (
                8 * (_kresling_energy(*(q + s)) - _kresling_energy(*(q - s)))
                - _kresling_energy(*(q + 2 * s))
                + _kresling_energy(*(q - 2 * s))
            )
            / (12 * h)
            for s in steps
        ]
    )


def test_kresling_snap_through():
    model, parameters = kresling()
    path = continuation(
        model, parameters, Drive(load=1.0), move=0.03, stop=lambda factor, x: 1 - x[8:, 2].mean() > 0.86
    )
    assert path.reached
    descent = 1 - path.x[:, 8:, 2].mean(axis=1)
    load = CubicSpline(descent, path.factor)
    # Liu & Paulino 2017, re-run: points of its path
    for at, value in ((0.12501, 0.43227), (0.64205, -0.10212), (0.84746, -0.05264)):
        assert load(at) == pytest.approx(value, abs=1e-5)
    # every point against the energy of the symmetric cell, written independently
    top = path.x[:, 8]
    symmetric = np.stack([top[:, 2], np.hypot(top[:, 0], top[:, 1]), np.arctan2(top[:, 1], top[:, 0])], axis=1)
    for q, factor in zip(symmetric, path.factor, strict=True):
        assert np.allclose(_kresling_gradient(q), [-factor, 0, 0], atol=1e-8)
    # limit load and zero load, from the independent model alone
    peak, zero = path.limit_points[0], np.argmin(np.abs(path.factor[5:])) + 5

    def load_at(h):
        rest = fsolve(lambda s: _kresling_gradient([h, *s])[1:], symmetric[zero][1:], xtol=1e-12)
        return -_kresling_gradient([h, *rest])[0]

    assert np.max([load(descent[peak] + e) for e in (-1e-3, 1e-3)]) < path.factor[peak]
    assert path.factor[peak] == pytest.approx(0.43230, abs=5e-6)
    assert path.factor[path.limit_points[1]] == pytest.approx(-0.10213, abs=5e-6)
    crossing = load.roots(extrapolate=False)
    crossing = crossing[(crossing > 0.3) & (crossing < 0.6)][0]
    assert load_at(1 - crossing) == pytest.approx(0.0, abs=1e-5)
    # stable up to the limit load, unstable under a held load beyond it
    assert np.all(path.stable[:peak]) and not np.any(path.stable[peak + 1 :])
    assert f"Path: {len(path.factor)} points" in repr(path) and len(repr(path)) < 300


def test_energies_are_those_of_the_closed_form_and_their_differences_barriers():
    a, h, stiffness = 1.0, 0.3, 100.0
    model, parameters = truss(h, stiffness)
    path = continuation(model, parameters, Drive(load=1.0), end=2.0)
    z, rest = path.x[:, 2, 2], np.hypot(a, h)
    np.testing.assert_allclose(path.energies["bars"], stiffness * (np.hypot(a, z) - rest) ** 2, atol=1e-12)
    np.testing.assert_allclose(path.energies["load"], path.factor * z, atol=1e-12)
    np.testing.assert_allclose(path.energy, path.energies["bars"] + path.energies["load"])
    # without load: from one stable shape over the flat one to the other
    over = equilibrium(
        model, parameters, state=State.at_rest(model, position=model.position * [1, 1, 0]), unstable=True
    )
    up, down = (
        equilibrium(model, parameters, state=State.at_rest(model, position=model.position * [1, 1, side]))
        for side in (1.0, -1.0)
    )
    assert not over.stable and over.energy - up.energy == pytest.approx(stiffness * (a - rest) ** 2)
    assert up.energy == pytest.approx(0.0, abs=1e-20) and down.energy == pytest.approx(0.0, abs=1e-20)
    held = equilibrium(model, parameters, Drive(load=0.5))
    bars = stiffness * (np.hypot(a, held.x[2, 2]) - rest) ** 2
    acting = {n: e for n, e in held.energies.items() if e}
    assert acting == {"bars": pytest.approx(bars), "load": pytest.approx(0.5 * held.x[2, 2])}


def test_energy_of_rigid_panels_is_that_of_their_creases_and_loads():
    sheet = Sheet(pattern_strip([0.01, 0.02], 0.02), thickness="1 mm", panels="rigid").fix(panels=[0])
    model, parameters = sheet.crease(stiffness="2 mN m/rad").gravity().build()
    found = equilibrium(model, parameters)
    assert found.energies["crease"] == pytest.approx(0.5 * 2e-3 * found.angles[0] ** 2)
    assert found.energies["crease"] > 0.0 > found.energies["gravity"]


def test_a_path_is_saved_replayed_and_exported_point_by_point(tmp_path):
    sheet = Sheet(pattern_strip([0.01, 0.02], 0.02), thickness="1 mm").fix(panels=[0])
    model, parameters = sheet.crease(stiffness="2 mN m/rad").set("load", [4, 5], force_z=1e-2).build()
    path = continuation(model, parameters, Drive(load=1.0), max_points=8)
    motion = path.trajectory
    assert len(motion.times) == len(path.factor) and np.array_equal(motion.x[:, :, 0], path.x)
    assert motion.drive["load"](motion.times) == pytest.approx(path.factor)
    assert np.array_equal(motion.energies["crease"][:, 0], path.energies["crease"])
    run = save_run(tmp_path / "run", path, scene="flap")
    assert run.replay.is_file() and np.array_equal(run.trajectory.x, motion.x)
    assert write_replay(tmp_path / "p.rrd", path).is_file() and export(path, tmp_path / "p.glb").is_file()
    rest = equilibrium(model, parameters)
    for keep in (lambda: save_run(tmp_path / "no", rest, scene="flap"), lambda: export(rest, tmp_path / "no.glb")):
        with pytest.raises(InputError, match=r"has no frames.*'Equilibrium'.*a Path of continuation\(\)"):
            keep()
    assert not (tmp_path / "no").exists()
    nothing = replace(path, factor=path.factor[:0], x=path.x[:0], angles=path.angles[:0])
    with pytest.raises(InputError, match="the path has no points"):
        save_run(tmp_path / "no", nothing, scene="truss")


@pytest.mark.parametrize("solve", [equilibrium, simulate, quasistatic])
def test_a_start_of_another_shape_is_one_sentence(solve):
    model, parameters = truss()
    options = {equilibrium: {}, simulate: {"duration": 0.1}, quasistatic: {"times": [0.0, 0.1]}}[solve]
    flat = replace(State.at_rest(model), x=model.position)
    for state, said in (
        (model.position, r"is no state \(field 'state', value 'ndarray'\); allowed: State.at_rest"),
        (flat, r"another shape than the model \(field 'state.x', value \(3, 3\)\); allowed: \(3, W, 3\)"),
        (State.at_rest(kresling()[0]), r"another shape .*field 'state.x'"),
    ):
        with pytest.raises(InputError, match=said):
            solve(model, parameters, state=state, **options)


def test_path_can_be_stopped_and_continued_from_its_states():
    model, parameters = truss(0.3)
    path = continuation(model, parameters, Drive(load=1.0), stop=lambda factor, x: x[2, 2] < 0)
    assert path.reached and path.x[-1, 2, 2] < 0 and path.factor[-1] < 0.5
    again = continuation(
        model, parameters, Drive(load=1.0), start=path.factor[-1], end=-2.0, state=path.state(-1), max_points=3
    )
    assert again.x[0, 2, 2] == pytest.approx(path.x[-1, 2, 2], abs=1e-9)
    assert not again.reached and "3 points" in again.message


@pytest.mark.parametrize("lowest", [1.0, 0.0, -0.3])
def test_small_tangents_are_factored_densely_with_the_same_outcome(monkeypatch, lowest):
    rng = np.random.default_rng(3)
    q, _ = np.linalg.qr(rng.normal(size=(40, 40)))
    k = q @ np.diag(np.linspace(lowest, 5.0, 40)) @ q.T
    k, right, out = sp.csc_array(0.5 * (k + k.T)), rng.normal(size=40), []
    for most in (0, system.COMPACT):
        monkeypatch.setattr(system, "COMPACT", most)
        factor, shift = system.System.definite(k, 5.0, 0.0)
        assert isinstance(factor, system.Cholesky) == (most > 0)
        out.append((shift, factor.solve(right)))
    assert out[0][0] == out[1][0] and (out[0][0] > 0.3) == (lowest < 0)
    assert out[1][1] == pytest.approx(out[0][1], rel=2e-6 if lowest == 0 else 5e-14)
