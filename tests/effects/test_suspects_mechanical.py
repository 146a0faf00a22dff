"""Closed forms of the mechanical suspects: creases that rub, tire, swell or touch; gravity, leads, air and ground."""

import itertools
import math

import numpy as np
import pytest
from effects.kit import ALL, hinge, hinge_positions, lengths, make_model, quiet, slope, start
from numpy.polynomial import chebyshev
from scipy.integrate import quad

from origami_sim.drive import Drive, series
from origami_sim.effects import CATALOGUE, crease_polynomial
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.timestep import stable_step

LEVER = 0.9
"""Distance of node l of the hinge from its axis [m]."""


def under(effect, **values):
    """Parameters of one effect by (owner, name)."""
    return {(effect, name): value for name, value in values.items()}


def moments(names, values, angles, *, rate=0.0, drive=None, time=0.0):
    """Moment of these effects on the crease that goes through these angles one after the other, slowly."""
    model, state = hinge(), start(hinge())
    state.angles[0], out = angles[0], []
    batch = Batch(model, quiet(model, values), drive or Drive(), state)
    for angle in angles:
        x, along = hinge_positions(angle), np.array([0.0, -math.sin(angle), math.cos(angle)])
        if rate:
            state = batch.state()
            state.x[:, 0], state.v[3, 0] = x, LEVER * rate * along
            batch = Batch(model, quiet(model, values), drive or Drive(), state)
        else:
            batch.place(x[:, None], batch.state().angles)
        batch.step = -1
        batch.advance(0, 1e-3, np.inf)  # finds the force only, with the exact turn since the last angle
        forces = batch.evaluate(time).forces
        out.append(LEVER * sum(forces[n][3, 0] for n in names) @ along)
    return np.array(out)


def path(*turning_points, step=0.01):
    """Angles from one turning point to the next in equal steps that hit them."""
    legs = [np.linspace(a, b, round(abs(b - a) / step) + 1)[1:] for a, b in itertools.pairwise(turning_points)]
    return np.concatenate([[turning_points[0]], *legs])


def loss(angles, moment):
    """Work that went into the crease along a path [J] (trapezoidal rule)."""
    return -float(np.sum(np.diff(angles) * (moment[1:] + moment[:-1]) / 2))


# --- memory of the crease ---------------------------------------------------------------------------------------------


def test_dry_friction_sticks_slides_and_loses_the_area_of_its_loop():
    mf, s0, a = 0.3, 0.03, 0.36
    angles = path(0.0, a, -a, a, step=0.006)
    m = moments(["crease_friction"], under("crease_friction", friction_moment=mf, yield_angle=s0), angles)
    assert m[:6] == pytest.approx(-mf * angles[:6] / s0, abs=1e-13)
    assert m[6:61] == pytest.approx(-mf, abs=1e-13)
    assert m[61:72] == pytest.approx(-mf + mf * np.arange(1, 12).clip(max=10) * 0.006 / s0, abs=1e-12)
    cycle = slice(60, None)
    assert loss(angles[cycle], m[cycle]) == pytest.approx(4 * mf * (a - s0), rel=1e-12)


@pytest.mark.parametrize("dt", [0.05, 1.5])
def test_branches_of_a_crease_let_go_by_exponentials_at_any_step(dt):
    """Turned evenly by 0.6 rad within 0.4 s and held: K_i tau_i rate (1 - exp(-t / tau_i)), then exp(-t / tau_i)."""
    turn, lasts, pairs = 0.6, 0.4, ((0.8, 0.5), (0.3, 0.05), (0.2, 4.0))
    values = {
        f"{n}_{i}": v for i, pair in enumerate(pairs, 1) for n, v in zip(("stiffness", "time"), pair, strict=True)
    }
    model = hinge(effects=("crease_relaxation",), held=(0, 1, 2, 3))
    batch = Batch(model, quiet(model, under("crease_relaxation", **values)), Drive(), start(model))
    batch.advance(0, lasts, np.inf)
    for angle, step in ((turn, lasts), (turn, dt), (turn, dt)):
        batch.carry(np.stack([batch.state().x, hinge_positions(angle)[:, None]]), step)
    left = [k * t * turn / lasts * (1 - math.exp(-lasts / t)) * math.exp(-2 * dt / t) for k, t in pairs]
    assert batch.remembered()[:3, 0] == pytest.approx(left, rel=1e-6, abs=1e-12)


def ringing(values, *, angle=0.0, rate=0.0, duration=3.0, frames=200.0, drive=None):
    """A pendulum of one crease: node l turns with the inertia 0.01 LEVER^2 about the axis, which is held."""
    model = hinge(angle, held=(0, 1, 2), bars=[(3, 1), (3, 2)])
    common = {("bars", "stiffness"): 2e3, ("bars", "rest_length"): lengths(model), ("inertia", "mass"): 0.01}
    v = np.zeros((4, 3))
    v[3] = LEVER * rate * np.array([0, -math.sin(angle), math.cos(angle)])
    return simulate(
        model, quiet(model, {**common, **values}), drive, duration=duration, rate=frames, state=start(model, v=v)
    )


INERTIA = 0.01 * LEVER**2


def test_dry_friction_rings_down_linearly_and_then_holds_off_centre():
    """Each half swing loses 2 Mf / K (1 - 2 s0 / (a1 + a2)), from the work of the loop between turning points."""
    k, mf, s0 = 1.0, 0.04, 0.005
    values = {("crease", "stiffness"): k, **under("crease_friction", friction_moment=mf, yield_angle=s0)}
    run = ringing(values, angle=0.6, duration=6.0, frames=1000)
    angle = run.creases[:, 0, 0]
    turn = 1 + np.flatnonzero(np.diff(np.sign(np.diff(angle))))
    size = np.abs(angle[turn[:6]])
    # the second swing is the first that starts with the bristle at its limit
    expected = 2 * mf / k * (1 - 2 * s0 / (size[1:] + size[:-1]))
    assert -np.diff(size) == pytest.approx(expected, rel=5e-3)
    # it comes to rest on its bristle; what trembles there has no loss, but it does not creep
    first, last = angle[-1000:-500], angle[-500:]
    middle = [(part.max() + part.min()) / 2 for part in (first, last)]
    assert s0 < abs(middle[1]) < mf / k and np.ptp(last) < 2 * s0
    assert middle[0] == pytest.approx(middle[1], abs=1e-3 * s0)


def test_round_hysteresis_follows_its_closed_form_with_second_order():
    mh, s0, a = 0.3, 0.2, 0.5
    values = under("crease_hysteresis", hysteresis_moment=mh, yield_angle=s0, sharpness=1.0)
    up = path(0.0, a, step=0.01)
    exact = -mh * (1 - np.exp(-up / s0))
    errors = []
    for step in (0.02, 0.01, 0.005):
        angles = path(0.0, a, step=step)
        m = moments(["crease_hysteresis"], values, angles)
        errors.append(np.abs(m + mh * (1 - np.exp(-angles / s0))).max())
    assert slope([0.02, 0.01, 0.005], errors) == pytest.approx(2, abs=0.15)
    assert errors[1] < 1e-3 * np.abs(exact).max()
    # back along the elastic slope to zero, then again towards the other limit
    peak = 1 - math.exp(-a / s0)
    angles = path(0.0, a, -a, step=0.005)
    m = moments(["crease_hysteresis"], values, angles)[100:]
    gone = a - angles[100:]
    z = np.where(gone < peak * s0, peak - gone / s0, -(1 - np.exp(-(gone - peak * s0) / s0)))
    assert m == pytest.approx(-mh * z, abs=2e-3 * mh)


def test_sharp_hysteresis_is_dry_friction_and_every_loop_loses_energy():
    angles = path(0.0, 0.5, -0.3, 0.4, -0.5, 0.5, step=0.002)
    values = under("crease_hysteresis", hysteresis_moment=0.3, yield_angle=0.03, sharpness=20.0)
    m = moments(["crease_hysteresis"], values, angles)
    dry = moments(["crease_friction"], under("crease_friction", friction_moment=0.3, yield_angle=0.03), angles)
    assert np.abs(m - dry).max() < 0.1 * 0.3  # rounded within a tenth at the corner
    assert loss(angles, m) == pytest.approx(loss(angles, dry), rel=0.02)
    for sharpness in (1.0, 2.0, 5.0):
        wiggle = 0.3 * np.sin(np.linspace(0, 40, 801)) * np.linspace(0, 1, 801)
        m = moments(["crease_hysteresis"], {**values, ("crease_hysteresis", "sharpness"): sharpness}, wiggle)
        # passive: what was put in, less the most that the bristle can hold, never comes back
        lost = -np.concatenate([[0], np.cumsum(np.diff(wiggle) * (m[1:] + m[:-1]) / 2)])
        assert np.all(lost >= -1e-12)
        assert lost[-1] > 0.5 * 0.3 * 0.05


def test_mullins_softens_once_and_loses_the_area_under_the_virgin_curve():
    kv, s, a = 0.8, 0.3, 0.7
    angles = path(0.2, 0.2 + a, 0.2 - 0.5 * a, 0.2 + a, 0.2, step=0.001)
    m = moments(
        ["crease_mullins"],
        under("crease_mullins", virgin_stiffness=kv, softening_angle=s, rest_angle=0.2),
        angles,
    )
    phi = angles - 0.2
    first = slice(0, 701)
    assert m[first] == pytest.approx(-kv * phi[first] * s / (s + phi[first]), abs=1e-13)
    assert m[701:] == pytest.approx(-kv * phi[701:] * s / (s + a), abs=1e-13)
    area = quad(lambda q: kv * q * s / (s + q), 0, a)[0] - kv * a**2 * s / (s + a) / 2
    assert area == pytest.approx(kv * (s * (a - s * math.log(1 + a / s)) - a**2 * s / (s + a) / 2), rel=1e-12)
    assert loss(angles, m) == pytest.approx(area, rel=1e-5)
    assert abs(loss(angles[1400:], m[1400:]) - loss(angles[1400:], -kv * phi[1400:] * s / (s + a))) < 1e-12


def test_set_moves_the_rest_angle_by_a_share_of_the_largest_fold():
    k, ks, rest, a = 1.0, 0.04, 0.1, 0.8
    values = {
        **under("crease", stiffness=k, rest_angle=rest),
        **under("crease_set", set_stiffness=ks, rest_angle=rest),
    }
    angles = path(rest, rest + a, rest - 0.25, step=0.01)
    m = moments(["crease", "crease_set"], values, angles)
    back = slice(80, None)
    crossing = np.interp(0.0, m[back][:106], angles[back][:106])
    assert crossing == pytest.approx(rest + ks / k * a, rel=1e-12)  # before the other side has set
    alone = moments(["crease_set"], values, path(rest, rest + a, rest - a, rest, step=0.01))
    assert alone[-1] == pytest.approx(0.0, abs=1e-15)  # as far to the other side: undone
    closed = path(rest, rest + a, rest, step=0.01)
    assert loss(closed, moments(["crease_set"], values, closed)) == pytest.approx(ks * a**2 / 2, rel=1e-12)


# --- laws without memory ----------------------------------------------------------------------------------------------

ANGLES = np.linspace(-3.4, 3.4, 35)


def test_asymmetry_softness_and_offset():
    m = moments(["crease_asymmetry"], under("crease_asymmetry", valley_stiffness=-0.2, rest_angle=0.3), ANGLES)
    assert m == pytest.approx(0.2 * (ANGLES - 0.3).clip(min=0), abs=1e-13)
    softer = {**under("crease", stiffness=0.7, rest_angle=0.3)}
    softer |= under("crease_softness", stiffness_change=-0.2, rest_angle=0.3)
    m = moments(["crease", "crease_softness"], softer, ANGLES)
    assert m == pytest.approx(-0.5 * (ANGLES - 0.3), abs=1e-13)
    shifted = {**under("crease", stiffness=0.7, rest_angle=0.3), **under("crease_offset", offset_moment=0.07)}
    assert moments(["crease", "crease_offset"], shifted, [0.4])[0] == pytest.approx(0.0, abs=1e-15)


def test_a_taper_is_a_stiffness_that_changes_along_a_beam():
    for along, stiffness in ((-0.5, 0.35), (0.0, 0.7), (0.25, 0.875)):
        tapered = {**under("crease", stiffness=0.7, rest_angle=0.3)}
        tapered |= under("crease_taper", taper=1.0, stiffness=0.7, rest_angle=0.3, along=along)
        m = moments(["crease", "crease_taper"], tapered, ANGLES)
        assert m == pytest.approx(-stiffness * (ANGLES - 0.3), abs=1e-13)


def test_panel_softness_is_a_change_of_panel_bending():
    model = hinge(creases=(), bends=[(0, 1, 2, 3)])
    values = {**under("panel_bending", stiffness=0.7, rest_angle=0.3)}
    values |= under("panel_softness", stiffness_change=-0.2, rest_angle=0.3)
    f = Batch(model, quiet(model, values), Drive(), start(model, x=hinge_positions(1.0))).evaluate(0.0).forces
    assert f["panel_softness"] == pytest.approx(-2 / 7 * f["panel_bending"], rel=1e-13)


def test_swelling_and_temperature_follow_their_drives():
    values = under("crease_swelling", moment_rate=0.02)
    for time in (0.0, 1.5, 30.0):
        assert moments(["crease_swelling"], values, [0.4], time=time)[0] == pytest.approx(0.02 * time, abs=1e-15)
    values = under("crease_temperature", softening_rate=0.003, rest_angle=-0.2)
    for rise, felt in ((20.0, 20.0), (-35.0, -35.0), (400.0, 100.0)):
        m = moments(["crease_temperature"], values, [0.5], drive=Drive(temperature=rise))
        assert m[0] == pytest.approx(0.003 * felt * 0.7, rel=1e-13)


def test_stiffening_is_cubic_and_slows_a_swing_as_duffing_says():
    m = moments(["crease_stiffening"], under("crease_stiffening", cubic_stiffness=0.2), ANGLES)
    inside = np.abs(ANGLES) <= math.pi
    assert m[inside] == pytest.approx(-0.2 * ANGLES[inside] ** 3, abs=1e-12)
    beyond = np.abs(ANGLES[~inside])
    line = 0.2 * (math.pi**3 + 3 * math.pi**2 * (beyond - math.pi))
    assert m[~inside] == pytest.approx(-np.sign(ANGLES[~inside]) * line, abs=1e-12)
    k, k3, a = 1.0, -0.3, 0.8
    run = ringing({("crease", "stiffness"): k, ("crease_stiffening", "cubic_stiffness"): k3}, angle=a, frames=1000)
    angle, times = run.creases[:, 0, 0], run.times
    down = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    zeros = times[down] + angle[down] / (angle[down] - angle[down + 1]) * 1e-3

    def inverse_rate(t):  # quarter period with q = a sin t, which takes away the root at the turning point
        return math.sqrt(INERTIA / (k + k3 * a**2 * (1 + math.sin(t) ** 2) / 2))

    period = 4 * quad(inverse_rate, 0, math.pi / 2)[0]
    assert np.diff(zeros).mean() == pytest.approx(period, rel=1e-3)
    assert period > 1.05 * 2 * math.pi * math.sqrt(INERTIA / k)


@pytest.mark.parametrize("side", [1, -1])
def test_contact_acts_on_its_side_only(side):
    m = moments(["crease_contact"], under("crease_contact", contact_stiffness=0.6, contact_angle=side * 1.1), ANGLES)
    assert m == pytest.approx(-side * 0.6 * (side * ANGLES - 1.1).clip(min=0), abs=1e-13)
    stop = under("crease_contact", contact_stiffness=0.6, contact_angle=0.2 * side, contact_side=-side)
    m = moments(["crease_contact"], stop, ANGLES)  # keeps from closing
    assert m == pytest.approx(side * 0.6 * (0.2 - side * ANGLES).clip(min=0), abs=1e-13)


def test_a_contact_with_loss_returns_a_blow_as_hunt_and_crossley_say():
    c, k = 0.15, 0.6
    given = {**under("crease_contact", contact_stiffness=k, contact_angle=0.2, contact_loss=c)}
    for rate in (-9.0, -2.0, 0.0, 3.0):  # it never pulls
        m = moments(["crease_contact"], given, [0.1, 0.5], rate=rate)
        assert m == pytest.approx([0.0, -k * 0.3 * max(1.0 + c * rate, 0.0)], abs=1e-13)
    w0 = 4.0
    run = ringing(given, angle=0.1, rate=w0, duration=1.0, frames=2000)
    w1 = -(run.creases[-1, 0, 0] - run.creases[-11, 0, 0]) / (run.times[-1] - run.times[-11])
    assert c * (w0 + w1) == pytest.approx(math.log((1 + c * w0) / (1 - c * w1)), rel=1e-3)
    assert 0.5 * w0 < w1 < 0.8 * w0
    assert run.energy_error < 1e-3


def test_quadratic_damping_decays_as_one_over_time():
    for rate in (-250.0, -3.0, 0.0, 7.0, 250.0):
        m = moments(["crease_quadratic_damping"], under("crease_quadratic_damping", coefficient=0.2), [0.3], rate=rate)
        square = rate**2 if abs(rate) < 100 else 200 * abs(rate) - 1e4
        assert m[0] == pytest.approx(-math.copysign(0.2 * square, rate), abs=1e-10)
    c, w0 = 0.02, 3.0
    run = ringing(under("crease_quadratic_damping", coefficient=c), angle=-0.8, rate=w0, duration=1.5)
    expected = -0.8 + INERTIA / c * np.log(1 + c * w0 * run.times / INERTIA)
    assert run.creases[:, 0, 0] == pytest.approx(expected, abs=1e-3)


def test_table_of_the_discrepancy_is_exact_for_bilinear_moments():
    def law(a, w):
        return 0.1 - 0.3 * a + 0.02 * w + 0.05 * a * w

    a, w = np.meshgrid(np.linspace(-1.0, 2.0, 9), np.linspace(-3.0, 5.0, 9), indexing="ij")
    edges = {"angle_low": -1.0, "angle_high": 2.0, "rate_low": -3.0, "rate_high": 5.0}
    values = under("crease_discrepancy", missing_moment=law(a, w).ravel()[None, None], **edges)
    angles = np.linspace(-1.6, 2.6, 22)
    for rate in (-8.0, -3.0, -0.7, 2.2, 5.0, 9.0):
        expected = law(angles.clip(-1, 2), np.clip(rate, -3, 5))
        assert moments(["crease_discrepancy"], values, angles, rate=rate) == pytest.approx(expected, abs=1e-13)
    p = quiet(hinge(), values).of("crease_discrepancy")
    assert CATALOGUE["crease_discrepancy"].stiffness(p) == pytest.approx(np.abs(-0.3 + 0.05 * -3 * np.ones((1, 1))))
    assert CATALOGUE["crease_discrepancy"].damping(p) == pytest.approx((0.02 + 0.05 * 2) * np.ones((1, 1)))


def test_polynomial_of_a_crease_is_that_of_chebyshev():
    rng, ends = np.random.default_rng(3), {"middle": 0.2, "reach": 0.9, "usual": 0.7, "fastest": 6.0}
    table = np.zeros((crease_polynomial.ANGLE + 1, crease_polynomial.RATE + 1))
    for _, i, j in crease_polynomial.TERMS:
        table[i, j] = rng.normal()
    given = {name: table[i, j] for name, i, j in crease_polynomial.TERMS}
    values = under("crease_polynomial", **given, **ends)
    angles = np.linspace(-1.4, 1.8, 23)
    for rate in (-9.0, -6.0, -0.3, 0.0, 0.8, 4.0, 20.0):
        x = ((angles - 0.2) / 0.9).clip(-1, 1)
        y = np.clip(np.arcsinh(rate / 0.7) / np.arcsinh(6.0 / 0.7), -1, 1)
        expected = chebyshev.chebval2d(x, np.full_like(x, y), table)
        assert moments(["crease_polynomial"], values, angles, rate=rate) == pytest.approx(expected, abs=1e-12)
    p = quiet(hinge(), values).of("crease_polynomial")
    grid = np.linspace(-1.0, 1.0, 201)
    for axis, per, bound in ((0, 0.9, "stiffness"), (1, 0.7 * np.arcsinh(6.0 / 0.7), "damping")):
        steepest = np.abs(chebyshev.chebgrid2d(grid, grid, chebyshev.chebder(table, axis=axis))).max() / per
        assert steepest <= getattr(CATALOGUE["crease_polynomial"], bound)(p)[0, 0] < 5.0 * steepest


# --- nodes ------------------------------------------------------------------------------------------------------------


def test_tilt_is_a_turn_of_gravity_and_its_vertical_part_bears_weight():
    model, tilt = make_model([[0, 0, 0.0]]), 0.02
    lean = {("inertia", "mass"): 0.3, ("gravity", "gravity_z"): -9.80665}
    f = Batch(model, quiet(model, {**lean, ("gravity_tilt", "tilt_x"): tilt}), Drive(), start(model)).evaluate(0.0)
    total = sum(f.forces.values())[0, 0]
    exact = 0.3 * 9.80665 * np.array([math.sin(tilt), 0, -math.cos(tilt)])
    assert total == pytest.approx(exact, abs=0.3 * 9.80665 * tilt**2)
    f = Batch(model, quiet(model, {**lean, ("gravity_tilt", "tilt_z"): 1.0}), Drive(), start(model)).evaluate(0.0)
    assert np.abs(sum(f.forces.values())).max() < 1e-15


def test_tether_swings_about_its_anchor():
    model, k, m = make_model([[0.01, 0.02, 0.03]], bars=()), 0.4, 1e-3
    values = under("tether", stiffness=k, anchor_x=0.01, anchor_y=0.0, anchor_z=0.05)
    run = simulate(model, quiet(model, {**values, ("inertia", "mass"): m}), duration=1.0, dt=2e-4, rate=100)
    swing = np.cos(math.sqrt(k / m) * run.times)[:, None] * np.array([0, 0.02, -0.02])
    assert run.x[:, 0, 0] - [0.01, 0.0, 0.05] == pytest.approx(swing, abs=2e-5)


# --- ground -----------------------------------------------------------------------------------------------------------


def foot(height=0.0):
    """A node that is a foot, on two held ones."""
    x = np.array([[0, 0, height], [1, 0, height], [0, 1, height]], float)
    free = np.array([[1, 1, 1], [0, 0, 0], [0, 0, 0]])
    return make_model(x, triangles=[(0, 1, 2)], contacts=[(0, 1, 2)], free=free)


def on_foot(name, values, places, velocities=(0.0, 0.0, 0.0), memory=0.0):
    """Force of one effect on the foot at each of these places."""
    model, places = foot(), np.atleast_2d(places)
    x = np.repeat(model.position[:, None], len(places), 1)
    x[0] = places
    v = np.zeros_like(x)
    v[0] = velocities
    return (
        Batch(model, quiet(model, values), Drive(), start(model, len(places), x=x, v=v)).evaluate(0.0).forces[name][0]
    )


def heights(*z):
    return np.stack([np.zeros(len(z)), np.zeros(len(z)), z], axis=1)


def test_soft_layer_bears_before_the_ground_and_lets_feet_sink():
    values = under("ground_compliance", layer_stiffness=20.0, reach=2e-3)
    f = on_foot("ground_compliance", values, heights(3e-3, 2e-3, 1e-3, 0.0, -1e-3))[:, 2]
    assert f == pytest.approx([0, 0, 0.02, 0.04, 0.06], abs=1e-14)
    weight = {("gravity", "gravity_z"): -9.80665, ("inertia", "mass"): 1e-3, ("ground", "stiffness"): 500.0}
    model = foot(2e-3)
    rest = {("mass_damping", "decay_rate"): 150.0}
    run = simulate(model, quiet(model, {**weight, **values, **rest}), duration=0.5, rate=50)
    assert run.x[-1, 0, 0, 2] == pytest.approx(2e-3 - 9.80665e-3 / 20, rel=1e-6)


def test_film_is_squeezed_out_as_reynolds_says():
    """C d/dt [1 / (2 h^2) + h / H^3] = F + m dv/dt, exactly, for a plate pressed by a constant force."""
    film, thinnest, reach, m, force = 7e-9, 3e-4, 2e-3, 1e-3, 0.1
    values = under("squeeze_film", film=film, thinnest=thinnest, reach=reach)
    model = foot(7e-4)
    p = quiet(model, {**values, ("inertia", "mass"): m, ("load", "force_z"): [-force, 0.0, 0.0]})
    run = simulate(model, p, Drive(load=1.0), duration=0.1, rate=100)
    h, v = run.x[:, 0, 0, 2] + thinnest, run.v[:, 0, 0, 2]
    left = film * (0.5 / h**2 + h / (reach + thinnest) ** 3)
    assert left - left[0] == pytest.approx(force * run.times + m * v, abs=1e-5 * force * 0.1)
    assert h[-1] < 0.7 * h[0]


def test_film_resists_lifting_off_too():
    values = under("squeeze_film", film=1e-11, thinnest=1e-4, reach=4e-3)
    f = on_foot("squeeze_film", values, heights(-1e-4, 0.0, 1e-4, 5e-3), (0.0, 0.0, 0.02))[:, 2]
    at = [1e-11 * 0.02 * (h**-3 - 4.1e-3**-3) for h in (1e-4, 1e-4, 2e-4)]
    assert f == pytest.approx([-at[0], -at[1], -at[2], 0.0], rel=1e-12)


PRESSED = {("ground", "stiffness"): 500.0, ("friction", "stiffness"): 500.0, ("friction", "damping"): 1e6}
"""At a depth of 1 mm the load is 0.5 N; the dashpot makes every motion a sliding one."""


def test_stribeck_friction_falls_with_speed():
    values = {**PRESSED, **under("stribeck", static_excess=0.4, fading_speed=0.02)}
    values |= {("coulomb", "friction_coefficient"): 0.3}
    for speed in (1e-4, 0.01, 0.02, 0.2):
        f = on_foot("friction", values, heights(-1e-3), (speed, 0.0, 0.0))[0]
        expected = -0.5 * (0.3 + 0.4 * math.exp(-((speed / 0.02) ** 2)))
        assert f == pytest.approx([expected, 0, 0], abs=1e-12)


@pytest.mark.parametrize("pull, moves", [(0.97, False), (1.03, True)])
def test_static_friction_holds_until_its_excess_is_overcome(pull, moves):
    """A foot pulled slowly; once it goes, only kinetic friction is left and it accelerates by the difference."""
    m, load, kinetic, excess = 1e-3, 0.5, 0.3, 0.4
    values = {
        **under("stribeck", static_excess=excess, fading_speed=5e-3),
        ("coulomb", "friction_coefficient"): kinetic,
        ("ground", "stiffness"): 500.0,
        ("friction", "stiffness"): 5e4,
        ("friction", "damping"): 14.0,
        ("inertia", "mass"): m,
        ("load", "force_x"): [pull * (kinetic + excess) * load, 0.0, 0.0],
    }
    model = foot(-load / 500.0)
    model.free[0] = [1, 0, 0]
    drive = Drive(load=series(np.array([0.0, 0.2, 1.0]), np.array([[0.0], [1.0], [1.0]])))
    run = simulate(model, quiet(model, values), drive, duration=0.3, rate=100)
    x, v = run.x[:, 0, 0, 0], run.v[:, 0, 0, 0]
    if moves:
        acceleration = (pull * (kinetic + excess) - kinetic) * load / m
        assert (v[-1] - v[-4]) / 0.03 == pytest.approx(acceleration, rel=1e-6)
    else:
        # stretched bristle, and no creep on it
        assert x[-1] == pytest.approx(pull * (kinetic + excess) * load / 5e4, rel=1e-3)
        assert abs(x[-1] - x[-5]) < 1e-9


def test_rough_ground_has_a_wave_of_friction_that_is_never_negative():
    values = {**PRESSED, **under("ground_roughness", roughness=0.4, wave_x=0.0, wave_y=600.0, phase=0.7)}
    y = np.linspace(0, 2 * math.pi / 600, 41)
    places = np.stack([0.3 + 0 * y, y, -1e-3 + 0 * y], axis=1)
    f = on_foot("friction", values, places, (0.01, 0.0, 0.0))[:, 0]
    assert f == pytest.approx(-0.5 * 0.2 * (1 + np.sin(600 * y + 0.7)), abs=1e-12)
    assert f[:-1].mean() == pytest.approx(-0.1, abs=1e-12) and f.max() <= 0


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.8])
def test_rebound_of_a_lossy_foot(ratio):
    """Damped on the way in and elastic on the way out: e = exp(-zeta acos(zeta) / sqrt(1 - zeta^2))."""
    k, m, v0 = 500.0, 1e-3, 0.3
    c = ratio * 2 * math.sqrt(k * m)
    model = foot(1e-4)
    values = {("ground", "stiffness"): k, ("inertia", "mass"): m, **under("restitution", impact_damping=c)}
    v = np.zeros((3, 3))
    v[0, 2] = -v0
    run = simulate(model, quiet(model, values), duration=0.02, dt=2e-7, rate=100, state=start(model, v=v))
    rebound = run.v[-1, 0, 0, 2] / v0
    assert rebound == pytest.approx(math.exp(-ratio * math.acos(ratio) / math.sqrt(1 - ratio**2)), rel=1e-3)


# --- all of them on a device of grams and centimetres -----------------------------------------------------------------

ON_HINGES = [n for n in ALL if CATALOGUE[n].fitted and CATALOGUE[n].family == "crease" and n.startswith("crease_")]


def test_suspects_of_creases_are_stable_and_keep_the_energy_balance_at_their_typical_values():
    """A crease of 1 mN m / rad and panels of a gram, let go at 1.8 rad; a world for every suspect, and one without."""
    names = [n for n in ON_HINGES if not set(CATALOGUE[n].drives) - {"time"}]
    w = len(names) + 1
    x = 0.02 * hinge_positions(1.8)
    model = make_model(
        x,
        bars=[(0, 1), (0, 2), (1, 2), (3, 1), (3, 2)],
        creases=[(0, 1, 2, 3)],
        triangles=[(1, 2, 3), (1, 0, 2)],
    )
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 300.0,
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): 1e-3,
            ("inertia", "mass"): 5e-4,
        },
    )
    own = {q.name: p["crease", q.name][0, 0] for q in CATALOGUE["crease"].parameters}
    for i, name in enumerate(names):
        for q in CATALOGUE[name].parameters:
            values = np.full((1, w), q.default)
            values[0, i] = own.get(q.name, q.default) if q.typical is None else q.typical  # as a suspect takes it over
            p.set(name, q.name, values)
    run = simulate(model, p, Drive(), duration=1.0, rate=100, state=start(model, w), dt=0.2 * stable_step(model, p).dt)
    assert not run.failures
    energy = 0.5e-3 * 1.8**2
    balance = run.energy_balance()
    drift = np.abs(balance - balance[0]).max(0) / energy
    assert drift.max() < 5e-3, dict(zip([*names, "none"], drift, strict=True))
    # each of them is seen: the motion differs from that without by more than a degree
    seen = np.abs(run.creases[:, 0, :-1] - run.creases[:, 0, -1:]).max(0)
    assert seen.min() > math.radians(1), dict(zip(names, seen, strict=True))
