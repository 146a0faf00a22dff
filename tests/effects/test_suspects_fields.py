"""Closed forms of the suspected effects of magnets and dielectric stacks, measured on the nodes of small models."""

import math

import numpy as np
import pytest
from effects.kit import hinge, hinge_positions, make_model, quiet, random_rotation, start

from origami_sim.drive import Drive, series
from origami_sim.effects import CATALOGUE
from origami_sim.physics.materials import EPS0, MU0
from origami_sim.solve.batch import forces
from origami_sim.solve.motion.dynamics import simulate

MAGNETIC = (
    "magnetic_torque", "remanence_error", "magnetic_compliance", "demagnetisation", "magnetic_viscosity",
    "remanence_temperature", "field_nonuniformity",
)  # fmt: skip
DIELECTRIC = (
    "crease", "maxwell_stress", "thickness_thinning", "maxwell_error", "layer_thinning", "strain_permittivity",
    "charge_injection", "dielectric_relaxation", "stack_buckling", "field_stiffening",
)  # fmt: skip
BR, VOLUME = 0.1, 2e-7
MOMENT = BR * VOLUME / MU0
MAGNET = {"remanence": BR, "volume": VOLUME, "poling_1": 1.0}
STACK = {
    "permittivity": 3.0, "layer_thickness": 1e-4, "layers": 4.0, "lever": 3e-4, "width": 0.02, "constraint": 0.5,
    "side": -1.0,
}  # fmt: skip
VOLTAGE = 2000.0
MAXWELL = -0.5 * 0.02 * 4 * 3.0 * EPS0 * (VOLTAGE / 1e-4) ** 2 * 1e-4 * 3e-4
LEVER = 0.9
"""Distance of node l of the hinge from its axis [m]."""


def under(effect, **values):
    return {(effect, name): value for name, value in values.items()}


# --- magnets: one triangle with its poling along the first edge -------------------------------------------------------


def plate(held=()):
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.8, 0]])
    free = np.ones_like(x)
    free[list(held)] = 0.0
    return make_model(x, triangles=[(0, 1, 2)], effects=MAGNETIC, free=free)


def torque(name, field, values, *, temperature=0.0, memory=None, rotation=None):
    """Torque of one effect on the plate about its normal and its in-plane axes [N m]."""
    model = plate()
    r = np.eye(3) if rotation is None else rotation
    state = start(model, x=model.position @ r.T)
    if memory is not None:
        state.memory[:] = memory
    drive = Drive(field=tuple(r @ field), temperature=temperature)
    f = forces(model, quiet(model, under(name, **MAGNET, **values)), drive, state, 0.0).forces[name][:, 0]
    return np.cross(state.x[:, 0], f).sum(0) @ r


@pytest.mark.parametrize(
    ("name", "values", "temperature", "factor"),
    [
        ("remanence_error", {"remanence_gain": -0.3}, 0.0, -0.3),
        ("remanence_temperature", {"remanence_slope": 0.002}, 50.0, -0.1),
        ("remanence_temperature", {"remanence_slope": 0.002}, -50.0, 0.1),
        ("remanence_temperature", {"remanence_slope": 0.1}, 50.0, -1.0),
    ],
)
def test_a_changed_remanence_changes_the_torque_in_proportion(name, values, temperature, factor):
    field = np.array([0.05, -0.12, 0.07])
    found = torque(name, field, values, temperature=temperature, rotation=random_rotation(np.random.default_rng(3)))
    assert found == pytest.approx(factor * MOMENT * np.cross([1, 0, 0], field), rel=1e-12, abs=1e-18)


def test_compliant_dipoles_lower_the_torque_as_their_formula_says():
    """m B sin a (1 - (B / B*) cos a) with the torque of magnetic_torque; nothing across the field; even in B."""
    b, saturation = 0.2, 0.93
    for a in np.linspace(-3, 3, 13):
        field = b * np.array([math.cos(a), math.sin(a), 0.0])
        whole = torque("magnetic_torque", field, {})[2]
        extra = torque("magnetic_compliance", field, {"dipole_compliance": 1 / saturation})[2]
        expected = MOMENT * b * math.sin(a) * (1 - b / saturation * math.cos(a))
        assert whole + extra == pytest.approx(expected, rel=1e-12, abs=1e-16)
        reverse = torque("magnetic_compliance", -field, {"dipole_compliance": 1 / saturation})[2]
        assert reverse == pytest.approx(extra, rel=1e-12, abs=1e-16)
    across = torque("magnetic_compliance", np.array([0, b, 0]), {"dipole_compliance": 1.0})
    assert np.abs(across).max() < 1e-18


@pytest.mark.parametrize("sign", [1, -1])
def test_demagnetisation_is_lost_at_the_peak_and_not_regained(sign):
    """Loss c (|B| - B0) of the largest opposing field so far; aligned fields and small ones do no harm."""
    model = plate(held=(0, 1, 2))
    given = {**MAGNET, "remanence": sign * BR, "loss": 2.0, "threshold": 0.1}
    parameters = quiet(model, under("demagnetisation", **given))
    times = np.arange(6) * 0.01
    field = sign * np.array([0.0, 0.5, -0.09, -0.15, -0.12, 0.5])
    run = simulate(model, parameters, Drive(field=(series(times, field), 0, 0)), duration=0.05, dt=1e-4, rate=100)
    lost = float(run.state.memory[0, 0])
    assert lost == pytest.approx(2.0 * (0.15 - 0.1), rel=1e-9)
    at = np.array([0.0, 0.2, 0.0])
    assert torque("demagnetisation", at, {"loss": 2.0, "threshold": 0.1}, memory=lost)[2] == pytest.approx(
        -lost * MOMENT * 0.2, rel=1e-12
    )
    whole = torque("demagnetisation", np.array([-10.0, 0.2, 0]), {"loss": 2.0, "threshold": 0.1})[2]
    assert whole == pytest.approx(-MOMENT * 0.2, rel=1e-12), "no more can be lost than there is"


def test_magnetic_after_effect_follows_three_decades():
    """In a constant field q_i = tanh(B / Bs) (1 - exp(-t / tau_i)): exact at every step size."""
    model = plate(held=(0, 1, 2))
    given = {**MAGNET, "after_effect": 0.05, "shortest_time": 0.01, "reversing_field": 0.04}
    parameters = quiet(model, under("magnetic_viscosity", **given))
    for dt in (1e-3, 5e-3):
        run = simulate(model, parameters, Drive(field=(-0.03, 0.1, 0)), duration=0.2, dt=dt, rate=10)
        q = run.state.memory[1:4, 0]  # after the one of demagnetisation
        expected = math.tanh(-0.03 / 0.04) * (1 - np.exp(-0.2 / (0.01 * np.array([1, 10, 100]))))
        assert q == pytest.approx(expected, rel=1e-9)


def test_a_nonuniform_field_pulls_a_magnet_along_its_moment():
    """Along the field m g B towards the stronger field, across it -m g B / 2. A box patch at 1 % per cm: 14 mN."""
    patch, field, slope = 71.52e-3, 0.2, 1.0
    model = plate()
    values = {"remanence": 1.0, "volume": patch * MU0, "poling_1": 1.0, "field_slope": slope}
    for direction, share in (([1.0, 0, 0], 1.0), ([0, 0, 1.0], -0.5)):
        drive = Drive(field=tuple(field * np.array(direction)))
        report = forces(model, quiet(model, under("field_nonuniformity", **values)), drive, start(model), 0.0)
        net = report.forces["field_nonuniformity"][:, 0].sum(0)
        assert net == pytest.approx([share * patch * slope * field, 0, 0], abs=1e-15)
    assert patch * slope * field == pytest.approx(14.3e-3, rel=1e-3)


# --- creases of a hinge -----------------------------------------------------------------------------------------------


def moment(name, values, angle=0.3, **drive):
    """Moment of one effect on the crease, as a force times a lever."""
    model = hinge(effects=DIELECTRIC)
    state = start(model, x=hinge_positions(angle))
    f = forces(model, quiet(model, under(name, **values)), Drive(**drive), state, 0.0).forces[name][3, 0]
    return LEVER * (-math.sin(angle) * f[1] + math.cos(angle) * f[2])


def test_half_the_pressure_is_half_the_moment():
    assert moment("maxwell_stress", STACK, voltage=VOLTAGE) == pytest.approx(MAXWELL, rel=1e-12)
    half = moment("maxwell_error", {**STACK, "maxwell_gain": -0.5}, voltage=VOLTAGE)
    assert half == pytest.approx(-0.5 * MAXWELL, rel=1e-12)


def test_thinning_is_that_of_thickness_thinning_to_first_order():
    """Four layers about the same middle: the moments differ by the mean square of their levers."""
    length, angle = 0.01, 1e-4
    lumped = moment("layer_thinning", {**STACK, "hinge_length": length, "thinning": 2.0}, angle, voltage=VOLTAGE)
    strain = -3e-4 * angle / length
    assert lumped == pytest.approx(2 * strain * MAXWELL, rel=1e-9)
    thin = {k: v for k, v in STACK.items() if k != "lever"}
    exact = moment(
        "thickness_thinning", {**thin, "first": 1e-4, "hinge_length": length, "neutral": 0.0}, angle, voltage=VOLTAGE
    )
    spread = np.mean((np.array([1.5, 2.5, 3.5, 4.5]) / 3) ** 2)
    assert exact == pytest.approx(lumped * spread, rel=1e-5)


def test_permittivity_falls_in_proportion_to_the_strain():
    given = {**STACK, "hinge_length": 0.005, "permittivity_slope": 0.4}
    for angle in (-0.5, 0.2, 1.1):
        strain = -3e-4 * angle / 0.005
        assert moment("strain_permittivity", given, angle, voltage=VOLTAGE) == pytest.approx(
            -0.4 * strain * MAXWELL, rel=1e-11
        )


def test_trapped_charge_adds_a_remanent_and_an_odd_part():
    given = {**STACK, "trapped_voltage": 150.0}
    up, down, none = (moment("charge_injection", given, voltage=v) for v in (VOLTAGE, -VOLTAGE, 0.0))
    unit = MAXWELL / VOLTAGE**2
    assert none == pytest.approx(unit * 150.0**2, rel=1e-10)
    assert (up - down) / 2 == pytest.approx(unit * 2 * VOLTAGE * 150.0, rel=1e-11)
    assert (up + down) / 2 == pytest.approx(unit * 150.0**2, rel=1e-9)


def test_slow_polarisation_approaches_its_share():
    model = hinge(effects=DIELECTRIC, held=(0, 1, 2, 3))
    given = {**STACK, "slow_share": 0.2, "polarisation_time": 0.03}
    parameters = quiet(model, under("dielectric_relaxation", **given))
    for dt in (1e-3, 5e-3):
        run = simulate(model, parameters, Drive(voltage=VOLTAGE), duration=0.1, dt=dt, rate=10)
        slow = run.state.memory[0, 0]
        assert slow == pytest.approx(MAXWELL * (1 - math.exp(-0.1 / 0.03)), rel=1e-9)
    state = start(model)
    state.memory[0] = slow
    f = forces(model, parameters, Drive(voltage=VOLTAGE), state, 0.0).forces["dielectric_relaxation"][3, 0]
    assert LEVER * f[2] == pytest.approx(0.2 * slow, rel=1e-12)


def test_a_buckled_stack_keeps_its_buckling_moment():
    """With f = 1 the whole moment stays at that of the threshold; below it nothing is lost; even in V."""
    given = {**STACK, "lost_share": 1.0, "buckling_voltage": 1200.0}
    for v in (VOLTAGE, -VOLTAGE):
        whole = moment("maxwell_stress", STACK, voltage=v) + moment("stack_buckling", given, voltage=v)
        assert whole == pytest.approx(MAXWELL * (1200.0 / VOLTAGE) ** 2, rel=1e-12)
    assert moment("stack_buckling", given, voltage=1199.0) == 0
    assert abs(moment("stack_buckling", given, voltage=1200.1)) < 2e-4 * abs(MAXWELL)


def test_a_field_stiffens_the_crease_up_to_its_gain():
    given = {"stiffness": 2e-3, "rest_angle": 0.1, "field_gain": 0.3, "half_field": 0.2}
    for b, share in ((0.0, 0.0), (0.2, 0.5), (0.4, 0.8), (1e4, 1.0)):
        direction = random_rotation(np.random.default_rng(1))[0]
        found = moment("field_stiffening", given, 0.7, field=tuple(b * direction))
        assert found == pytest.approx(-2e-3 * 0.3 * share * 0.6, rel=1e-8, abs=1e-18)


def test_the_field_at_a_crease_is_that_in_the_middle_of_its_axis():
    given = {"stiffness": 2e-3, "field_gain": 1.0, "half_field": 0.2}
    gradient = np.zeros((3, 3))
    gradient[2, 0] = gradient[0, 2] = 0.4  # the axis runs from 0 to 1 along x: 0.2 T in its middle
    model = hinge(effects=(*DIELECTRIC, "field_gradient"))
    state = start(model, x=hinge_positions(0.7))
    parameters = quiet(model, under("field_stiffening", **given))
    f = forces(model, parameters, Drive(gradient=gradient.tolist()), state, 0.0).forces["field_stiffening"][3, 0]
    assert LEVER * (-math.sin(0.7) * f[1] + math.cos(0.7) * f[2]) == pytest.approx(-2e-3 * 0.5 * 0.7, rel=1e-11)


def test_every_suspect_takes_its_magnet_or_stack_from_the_nominal_law():
    """The diagnosis copies parameters by name: those of a magnet or a stack must carry the same names and bounds."""
    for names, nominal in ((MAGNETIC, "magnetic_torque"), (DIELECTRIC, "maxwell_stress")):
        for name in names:
            effect = CATALOGUE[name]
            shared = {p.name for p in effect.parameters} & {p.name for p in CATALOGUE[nominal].parameters}
            assert effect.family == CATALOGUE[nominal].family
            if name not in ("crease", "field_stiffening", "thickness_thinning"):
                assert shared == {p.name for p in CATALOGUE[nominal].parameters}
            for p in shared:
                assert effect.parameter(p).bounds == CATALOGUE[nominal].parameter(p).bounds
                assert effect.parameter(p).unit == CATALOGUE[nominal].parameter(p).unit
            assert not shared & set(effect.fitted)
