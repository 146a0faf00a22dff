"""Closed forms of the laws, effect by effect, measured on the nodes of small models."""

import math

import numpy as np
import pytest
from effects.kit import hinge, hinge_positions, lengths, make_model, quiet, random_rotation, start
from scipy.integrate import quad
from scipy.optimize import brentq

from origami_sim.drive import Drive
from origami_sim.model import dihedral_angles
from origami_sim.solve.batch import Batch, forces
from origami_sim.solve.motion.dynamics import simulate

EPS0, MU0 = 8.8541878128e-12, 1.25663706212e-6
LEVER = 0.9
"""Distance of node l of the hinge from its axis [m]."""


def under(effect, **values):
    """Parameters of one effect by (owner, name)."""
    return {(effect, name): value for name, value in values.items()}


def report(model, values, *, drive=None, x=None, v=None, angles=None, worlds=1):
    state = start(model, worlds, x=x, v=v)
    if angles is not None:
        state.angles[:] = angles
    return forces(model, quiet(model, values), drive or Drive(), state, 0.0)


def hinge_moment(name, values, angles, drive=None):
    """Moment of one effect on the crease, as a force times a lever, at each of these angles."""
    angles = np.atleast_1d(angles)
    x = np.stack([hinge_positions(a) for a in angles], axis=1)
    f = report(hinge(), values, drive=drive, x=x, angles=angles[None], worlds=len(angles)).forces[name][3]
    return LEVER * (-np.sin(angles) * f[:, 1] + np.cos(angles) * f[:, 2])


UNIT_STACK = {"permittivity": 1.0, "layer_thickness": 1.0, "layers": 1.0, "lever": 1.0, "width": 1.0, "side": 1.0}
"""Gives a moment of 1 N m at UNIT_VOLTAGE."""

UNIT_VOLTAGE = 1 / math.sqrt(EPS0)


# --- dihedral angle ---------------------------------------------------------------------------------------------------


def reference_angle(x):
    """Angle from the continuation of the right panel to the left one about the axis, from perpendicular parts."""
    i, j, k, m = x
    e = (k - j) / np.linalg.norm(k - j)
    u, w = (p - j - e * ((p - j) @ e) for p in (i, m))
    return math.atan2(np.cross(-u, w) @ e, -u @ w)


SWEEP = np.array([-math.pi, -3.14159, -3.0, -1.7, -1e-9, 0.0, 1e-9, 0.3, 1.5, math.pi / 2, 2.8, 3.14159, math.pi])


def test_dihedral_angle_is_the_angle_built_in():
    rng = np.random.default_rng(0)
    r = random_rotation(rng)
    x = np.stack([hinge_positions(a) @ r.T + rng.normal(size=3) for a in SWEEP], axis=1)
    found = report(hinge(), {}, x=x, angles=SWEEP[None], worlds=len(SWEEP)).angles[0]
    assert np.abs(found - SWEEP).max() < 1e-14 * 10
    assert np.abs(np.sin(dihedral_angles(x, hinge().creases)[0] - SWEEP)).max() < 1e-14


def test_small_angles_are_exact_to_rounding():
    """By a series below 1/32, by the arctangent beyond; a coefficient in single precision would be off by 1e-11."""
    small = np.concatenate([np.geomspace(1e-12, 0.04, 200), 1 / 32 + 1e-9 * np.linspace(-1, 1, 21)])
    angles = np.concatenate([small, -small, np.pi - small])
    x = np.stack([hinge_positions(a) for a in angles], axis=1)
    exact = np.array([math.atan2(*sines(x[:, w])) for w in range(len(angles))])
    found = report(hinge(), {}, x=x, angles=angles[None], worlds=len(angles)).angles[0]
    assert np.abs(found / exact - 1).max() < 1e-15


def sines(x: np.ndarray) -> tuple[float, float]:
    """Sine and cosine of the angle of a hinge, up to a common factor, as the laws find them."""
    e, ri, rl = x[2] - x[1], x[0] - x[1], x[3] - x[1]
    n1, n2 = np.cross(ri, e), np.cross(e, rl)
    return float(ri @ n2 * np.linalg.norm(e)), float(n1 @ n2)


@pytest.mark.parametrize("apexes", [((0.4, 0.9), (0.6, 0.8)), ((1.7, 0.3), (-0.4, 1.2))], ids=["acute", "obtuse"])
def test_dihedral_gradient_matches_central_differences(apexes):
    """Measured with a moment of exactly 1 N m, so that the forces are the gradient."""
    unit = under("maxwell_stress", **UNIT_STACK)
    r = random_rotation(np.random.default_rng(1))
    for angle in SWEEP:
        x = hinge_positions(angle, *apexes) @ r.T
        f = report(hinge(), unit, drive=Drive(voltage=UNIT_VOLTAGE), x=x, angles=angle).forces["maxwell_stress"]
        numeric = np.zeros((4, 3))
        h = 1e-6
        for n, c in np.ndindex(4, 3):
            up, down = x.copy(), x.copy()
            up[n, c] += h
            down[n, c] -= h
            difference = reference_angle(up) - reference_angle(down)
            numeric[n, c] = (difference - 2 * math.pi * round(difference / (2 * math.pi))) / (2 * h)
        assert np.abs(f[:, 0] - numeric).max() < 1e-7 * 10 ** (apexes[0][1] < 0.5), angle


def test_angle_stays_continuous_through_several_turns():
    model = hinge()
    batch = Batch(model, quiet(model, {("crease", "stiffness"): 2.0}), Drive(), start(model))
    for angle in [*np.arange(0, 20, 0.4), *np.arange(20, -15, -0.7)]:
        batch.place(hinge_positions(angle)[:, None], batch.state().angles)
        now = batch.evaluate(0.0)
        assert now.angles[0, 0] == pytest.approx(angle, abs=1e-13)
        assert now.energies["crease"][0] == pytest.approx(angle**2, abs=1e-11)


# --- creases ----------------------------------------------------------------------------------------------------------


def test_crease_and_panel_bending_are_linear():
    angles = np.linspace(-3.5, 3.5, 29)
    values = {("crease", "stiffness"): 0.7, ("crease", "rest_angle"): 0.4}
    assert hinge_moment("crease", values, angles) == pytest.approx(-0.7 * (angles - 0.4), abs=1e-13)
    model = hinge(creases=(), bends=[(0, 1, 2, 3)])
    f = report(
        model, {("panel_bending", "stiffness"): 0.7, ("panel_bending", "rest_angle"): 0.4}, x=hinge_positions(1.0)
    ).forces["panel_bending"][3, 0]
    assert LEVER * np.linalg.norm(f) == pytest.approx(0.7 * 0.6, rel=1e-13)


TABLE_ANGLES = np.linspace(-math.pi, math.pi, 33)


def test_tabulated_line_is_the_linear_crease():
    """A cubic through points of a line is that line, in the table and beyond; energies differ by a constant."""
    angles = np.linspace(-4.0, 4.0, 33)
    table = {("crease_table", "resisting_moment"): (0.7 * (TABLE_ANGLES - 0.2))[None, None]}
    linear = {("crease", "stiffness"): 0.7, ("crease", "rest_angle"): 0.2}
    expected = hinge_moment("crease", linear, angles)
    assert hinge_moment("crease_table", table, angles) == pytest.approx(expected, abs=1e-13)
    x = np.stack([hinge_positions(a) for a in angles], axis=1)
    both = report(hinge(), {**table, **linear}, x=x, angles=angles[None], worlds=len(angles)).energies
    assert np.ptp(both["crease_table"] - both["crease"]) < 1e-13


def test_tabulated_curve_has_third_order_error_and_the_energy_of_its_moment():
    def law(a):
        return 0.3 * np.sin(a) + 0.05 * a**3

    angles = np.linspace(-2.9, 2.9, 41)
    table = {("crease_table", "resisting_moment"): law(TABLE_ANGLES)[None, None]}
    moments = -hinge_moment("crease_table", table, angles)
    step = TABLE_ANGLES[1] - TABLE_ANGLES[0]
    assert np.abs(moments - law(angles))[4:-4].max() < step**3 * 0.3 / 6
    x = np.stack([hinge_positions(a) for a in angles], axis=1)
    u = report(hinge(), table, x=x, angles=angles[None], worlds=len(angles)).energies["crease_table"]
    work = [quad(lambda a: -hinge_moment("crease_table", table, a)[0], angles[20], a)[0] for a in angles[18:23]]
    assert u[18:23] - u[20] == pytest.approx(np.array(work), abs=1e-9)


def stop_moment(angle, ks, begin):
    """tan barrier, straight on beyond a slope of 30."""
    s = 2 / math.pi * (math.pi - begin)
    u = (abs(angle) - begin) / s
    if u <= 0:
        return 0.0
    last = min(u, math.atan(math.sqrt(30)))
    return -math.copysign(ks * s * (math.tan(last) - last + 30 * (u - last)), angle)


def test_crease_stop_is_smooth_odd_and_nothing_before_it_begins():
    angles = np.linspace(-math.pi, math.pi, 201)
    m = hinge_moment("crease_stop", under("crease_stop", stop_stiffness=0.2, stop_angle=2.6), angles)
    assert m == pytest.approx(np.array([stop_moment(a, 0.2, 2.6) for a in angles]), abs=1e-13)
    assert m == pytest.approx(-m[::-1], abs=1e-13)
    assert not np.any(m[np.abs(angles) < 2.6])


def test_crease_stop_holds_against_a_strong_closing_moment():
    """The fold settles where the barrier balances the moment, short of pi."""
    closing = 0.5
    model = hinge(0.5, held=(0, 1, 2), bars=[(3, 1), (3, 2)])
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 2e3,
            ("bars", "rest_length"): lengths(model),
            ("inertia", "mass"): 0.01,
            ("crease_viscosity", "viscosity"): 0.3,
            **under("crease_stop", stop_stiffness=1.0, stop_angle=2.8),
            **under("maxwell_stress", **UNIT_STACK),
            ("maxwell_stress", "width"): closing,
        },
    )
    run = simulate(model, p, Drive(voltage=UNIT_VOLTAGE), duration=3.0, rate=50)
    expected = brentq(lambda a: stop_moment(a, 1.0, 2.8) + closing, 2.8, math.pi)
    assert run.creases.max() < math.pi
    assert run.creases[-1, 0, 0] == pytest.approx(expected, abs=1e-6)


# --- dielectrics ------------------------------------------------------------------------------------------------------

VHB = {"permittivity": 4.7, "layer_thickness": 272.8e-6, "layers": 6.0}
STACK = {**VHB, "width": 0.015, "constraint": 0.5, "side": -1.0}


def test_maxwell_moment_closed_form_even_and_quadratic():
    values = under("maxwell_stress", **STACK, lever=0.9e-3)
    volts = np.array([-4000.0, 1000, 2000, 4000])
    m = np.array([hinge_moment("maxwell_stress", values, 0.3, Drive(voltage=v))[0] for v in volts])
    pressure = 4.7 * EPS0 * (4000 / 272.8e-6) ** 2
    assert pressure == pytest.approx(8.947e3, rel=1e-3)  # physics.md 1.2
    assert m[3] == pytest.approx(-0.5 * 0.015 * pressure * 6 * 272.8e-6 * 0.9e-3, rel=1e-12)
    assert m[0] == m[3]
    assert np.polyfit(np.log(volts[1:]), np.log(-m[1:]), 1)[0] == pytest.approx(2, abs=1e-12)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_thinning_excess_is_that_of_stretched_layers(side):
    """p = p0 (1 + kappa z)^2 in each layer (physics.md 2b), summed here with an independent loop over layers."""
    t, first, length, zn, volts = 272.8e-6, 62e-6, 2.5e-3, 0.2e-3, 4000.0
    stack = {**STACK, "side": side}
    thin = under("thickness_thinning", **stack, first=first, hinge_length=length, neutral=zn)
    z = first + (np.arange(6) + 0.5) * t
    flat = under("maxwell_stress", **stack, lever=z.mean() - zn)
    for angle in (-0.05, 0.02, 0.07):
        kappa = side * angle / length
        p0 = 4.7 * EPS0 * (volts / t) ** 2
        total = side * 0.5 * 0.015 * sum(p0 * (1 + kappa * h) ** 2 * t * (h - zn) for h in z)
        both = [
            hinge_moment(n, {**flat, **thin}, angle, Drive(voltage=volts))[0]
            for n in ("maxwell_stress", "thickness_thinning")
        ]
        assert sum(both) == pytest.approx(total, rel=1e-12)
        ratio = both[1] / both[0]
        stack_height = first + 6 * t
        # to first order the excess is about kappa H (physics.md 2b); 4/3 for a stack reaching down to the axis
        assert 0.8 < ratio / (kappa * stack_height) < 2.0


# --- magnets ----------------------------------------------------------------------------------------------------------

TRIANGLE = np.array([[0.1, 0.0, 0.2], [1.1, 0.2, -0.1], [0.3, 0.8, 0.4]])
MAGNET = {"remanence": 0.13, "volume": 6.9e-7}
FIELD = np.array([0.05, -0.12, 0.2])


def triangle():
    return make_model(TRIANGLE, triangles=[(0, 1, 2)])


@pytest.mark.parametrize("share", [0.0, 0.6, -1.0])
@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_magnetic_torque_is_m_cross_b_without_net_force(share, stretch):
    x = TRIANGLE * stretch
    values = under("magnetic_torque", **MAGNET, poling_1=0.7, poling_2=-0.4, poling_n=share)
    f = report(triangle(), values, drive=Drive(field=tuple(FIELD)), x=x).forces["magnetic_torque"][:, 0]
    d = 0.7 * (x[1] - x[0]) - 0.4 * (x[2] - x[0])
    n = np.cross(x[1] - x[0], x[2] - x[0])
    direction = math.sqrt(1 - share**2) * d / np.linalg.norm(d) + share * n / np.linalg.norm(n)
    m = 0.13 * 6.9e-7 / MU0 * direction
    scale = np.abs(f).max()
    assert np.abs(f.sum(0)).max() < 1e-14 * scale * 10
    assert np.cross(x, f).sum(0) == pytest.approx(np.cross(m, FIELD), abs=1e-13 * scale)


def test_affine_torque_grows_with_the_stretch_and_agrees_at_rest():
    e1, e2 = TRIANGLE[1] - TRIANGLE[0], TRIANGLE[2] - TRIANGLE[0]
    a, b = np.array([0.7, -0.4]) / np.linalg.norm(0.7 * e1 - 0.4 * e2)  # unit vector at rest
    values = under("magnetic_torque_affine", **MAGNET, poling_1=a, poling_2=b)
    for stretch in (1.0, 1.3):
        x = TRIANGLE * stretch
        f = report(triangle(), values, drive=Drive(field=tuple(FIELD)), x=x).forces["magnetic_torque_affine"][:, 0]
        m = 0.13 * 6.9e-7 / MU0 * (a * e1 + b * e2) * stretch
        scale = np.abs(f).max()
        assert np.abs(f.sum(0)).max() < 1e-14 * scale
        assert np.cross(x, f).sum(0) == pytest.approx(np.cross(m, FIELD), abs=1e-13 * scale)


GRADIENT = np.array([[0.8, 0.3, -0.2], [0.3, -0.5, 0.4], [-0.2, 0.4, -0.3]])
"""Symmetric and without trace, as the gradient of a field in free space must be [T/m]."""


def test_field_gradient_gives_m_grad_b():
    values = under("field_gradient", **MAGNET, poling_1=0.7, poling_2=-0.4, poling_n=0.6)
    f = report(triangle(), values, drive=Drive(gradient=GRADIENT.tolist())).forces["field_gradient"][:, 0]
    d = 0.7 * (TRIANGLE[1] - TRIANGLE[0]) - 0.4 * (TRIANGLE[2] - TRIANGLE[0])
    n = np.cross(TRIANGLE[1] - TRIANGLE[0], TRIANGLE[2] - TRIANGLE[0])
    m = 0.13 * 6.9e-7 / MU0 * (0.8 * d / np.linalg.norm(d) + 0.6 * n / np.linalg.norm(n))
    assert f.sum(0) == pytest.approx(GRADIENT @ m, rel=1e-13)


def test_torque_and_gradient_force_together_derive_from_the_dipole_energy():
    """U = -m . B(centroid): the torque sees the field there, the gradient adds the pull."""
    poling = {**MAGNET, "poling_1": 0.7, "poling_2": -0.4, "poling_n": 0.6}
    values = {(e, k): v for e in ("magnetic_torque", "field_gradient") for k, v in poling.items()}
    h = 1e-6
    steps = h * np.concatenate([np.eye(9), -np.eye(9), np.zeros((1, 9))])
    x = np.moveaxis((TRIANGLE.ravel() + steps).reshape(19, 3, 3), 0, 1)
    r = report(triangle(), values, drive=Drive(field=tuple(FIELD), gradient=GRADIENT.tolist()), x=x, worlds=19)
    u = r.energies["magnetic_torque"]
    total = (r.forces["magnetic_torque"] + r.forces["field_gradient"])[:, -1].ravel()
    assert total == pytest.approx(-(u[:9] - u[9:18]) / (2 * h), abs=1e-9 * np.abs(total).max())


# --- bars, weights, air -----------------------------------------------------------------------------------------------


def bar_tension(values, stretch, rate=0.0):
    model = make_model([[0, 0, 0], [2, 0, 0]], bars=[(0, 1)])
    r = report(model, values, x=[[0, 0, 0], [2 * stretch, 0, 0]], v=[[0, 0, 0], [rate, 0.3, 0]])
    return {n: f[0, 0, 0] for n, f in r.forces.items()}


def test_bars_and_their_viscosity():
    values = {("bars", "stiffness"): 30.0, ("bars", "rest_length"): 2.0, ("bar_viscosity", "viscosity"): 0.7}
    tension = bar_tension(values, 1.1, rate=0.4)
    assert tension["bars"] == pytest.approx(30 * 0.2, rel=1e-13)
    assert tension["bar_viscosity"] == pytest.approx(0.28, rel=1e-13)


def test_ogden_bar_follows_its_law_and_starts_with_youngs_modulus():
    values = {("ogden_bars", "area"): 2e-6, ("ogden_bars", "modulus"): 1.5e6, ("ogden_bars", "rest_length"): 2.0}
    for s in (0.8, 1.0, 1.5):
        assert bar_tension(values, s)["ogden_bars"] == pytest.approx(3.0 * 0.25 * (s**4 - 1), abs=1e-12)
    h = 1e-6
    stiffness = (bar_tension(values, 1 + h)["ogden_bars"] - bar_tension(values, 1 - h)["ogden_bars"]) / (4 * h)
    assert stiffness == pytest.approx(3.0 / 2.0, rel=1e-9)  # E A / L0


def test_eccentric_weight_is_the_torque_of_an_offset_mass():
    values = {("eccentric_weight", "mass"): 0.02, ("eccentric_weight", "offset"): 0.003}
    f = report(triangle(), values).forces["eccentric_weight"][:, 0]
    n = np.cross(TRIANGLE[1] - TRIANGLE[0], TRIANGLE[2] - TRIANGLE[0])
    torque = np.cross(0.003 * n / np.linalg.norm(n), [0, 0, -0.02 * 9.80665])
    assert np.abs(f.sum(0)).max() < 1e-18
    assert np.cross(TRIANGLE, f).sum(0) == pytest.approx(torque, abs=1e-17)


def test_air_drag_of_a_plate():
    x = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0]])
    plate = make_model(x, triangles=[(0, 1, 2)])
    r = report(plate, under("air_drag", drag_coefficient=1.1), v=np.tile([5.0, -2, -3], (3, 1)))
    assert r.forces["air_drag"].sum(0)[0] == pytest.approx([0, 0, 0.5 * 1.2 * 1.1 * 0.03 * 9], rel=1e-13)


def test_air_drag_of_a_flap_that_turns_about_its_edge():
    """Moment 1/8 rho Cd w L^4 rate^2, and force 1/6 rho Cd w L^3 rate^2."""
    wide, long, rate = 0.3, 0.2, 7.0
    x = np.array([[0, 0, 0], [wide, 0, 0], [wide, long, 0], [0, long, 0]])
    flap = make_model(x, triangles=[(0, 1, 2), (0, 2, 3)])
    f = report(flap, under("air_drag", drag_coefficient=1.1), v=rate * x[:, [0, 0, 1]] * [0, 0, 1]).forces["air_drag"]
    assert f.sum(0)[0, 2] == pytest.approx(-1.2 * 1.1 * wide * long**3 * rate**2 / 6, rel=1e-12)
    assert np.cross(x, f.reshape(4, 3)).sum(0)[0] == pytest.approx(-1.2 * 1.1 * wide * long**4 * rate**2 / 8, rel=1e-12)


def test_loads_weights_and_mass_damping():
    model = make_model([[0, 0, 0.0]])
    values = {
        ("load", "force_x"): 2.0,
        ("gravity", "gravity_z"): -9.80665,
        ("inertia", "mass"): 0.3,
        ("mass_damping", "decay_rate"): 1.5,
    }
    f = report(model, values, drive=Drive(load=-0.4), v=[[0.0, 7.0, 0.0]]).forces
    assert f["load"][0, 0] == pytest.approx([-0.8, 0, 0])
    assert f["gravity"][0, 0] == pytest.approx([0, 0, -0.3 * 9.80665])
    assert f["mass_damping"][0, 0] == pytest.approx([0, -1.5 * 0.3 * 7, 0])


# --- ground -----------------------------------------------------------------------------------------------------------


def foot(values, gaps, rates=0.0, tilt=0.0):
    """Normal force of contact laws on one foot at each of these gaps."""
    gaps = np.atleast_1d(gaps)
    up = np.array([-math.sin(tilt), 0, math.cos(tilt)])
    model = make_model([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[(0, 1, 2)], contacts=[(0, 1, 2)])
    x = np.repeat(model.position[:, None], len(gaps), 1)
    x[0] = up * gaps[:, None]
    v = np.zeros_like(x)
    v[0] = up * rates
    r = report(model, {**values, ("plane", "reach"): 1.0, ("plane", "tilt"): tilt}, x=x, v=v, worlds=len(gaps))
    assert r.gaps[0] == pytest.approx(gaps, abs=1e-16)
    return {n: r.forces[n][0] @ up for n in ("ground", "adhesion")}


def test_ground_pushes_and_never_pulls():
    gaps, rates = np.array([1e-3, -1e-3, -1e-3, -1e-3])[:, None], np.array([0.0, 0.0, 0.3, -0.3])[:, None]
    values = {("ground", "stiffness"): 400.0, ("ground", "damping"): 2.0}
    for tilt in (0.0, 0.2):
        n = foot(values, gaps[:, 0], rates, tilt)["ground"]
        assert n == pytest.approx([0.0, 0.4, 0.0, 1.0], abs=1e-13)


def test_adhesion_pulls_up_to_its_limit_and_fades():
    values = {("adhesion", "pull_off"): 0.3, ("adhesion", "reach"): 4e-5}
    pull = foot(values, [-1e-4, 0.0, 1e-5, 2e-5, 4e-5, 1e-4])["adhesion"]
    assert pull == pytest.approx([-0.3, -0.3, -0.225, -0.15, 0, 0], abs=1e-12)


def test_a_crease_table_follows_a_smooth_law_to_the_fourth_power_of_its_spacing():
    angles = np.linspace(-2.0, 2.0, 41)
    table = {("crease_table", "resisting_moment"): np.sin(2 * TABLE_ANGLES)[None, None]}
    spacing = TABLE_ANGLES[1] - TABLE_ANGLES[0]
    assert -hinge_moment("crease_table", table, angles) == pytest.approx(
        np.sin(2 * angles), abs=(2 * spacing) ** 4 / 300
    )
