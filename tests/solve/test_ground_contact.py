"""Rollouts on the ground against closed forms: bounce, friction on a slope, adhesion."""

import math

import numpy as np
import pytest
from effects.kit import lengths, make_model, quiet, start
from solve.runs import G

from origami_sim import Sheet, strip
from origami_sim.drive import Drive, ramp
from origami_sim.model import State
from origami_sim.model.clearance import gaps
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import equilibrium


def plate(**options):
    """Three nodes falling flat, a contact point under each."""
    x = [[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]]
    return make_model(
        x, bars=[(0, 1), (1, 2), (2, 0)], triangles=[(0, 1, 2)], contacts=[(0, 1, 2), (1, 2, 0), (2, 0, 1)], **options
    )


def test_undamped_bounce_returns_to_its_height_and_damped_one_with_the_restitution_of_its_dashpot():
    """e = exp(-beta / omega (pi - arctan(2 beta omega / (omega^2 - beta^2)))) for a dashpot that cannot pull."""
    m, k, zeta = 1e-3, 500.0, np.array([0.0, 0.05, 0.2, 0.5])
    model = plate()
    p = quiet(
        model,
        {
            ("inertia", "mass"): m,
            ("ground", "stiffness"): k,
            ("plane", "reach"): 1.0,
            ("ground", "damping"): (2 * zeta * math.sqrt(k * m))[None],
        },
    )
    omega0 = math.sqrt(k / m)
    beta, omega = zeta * omega0, omega0 * np.sqrt(1 - zeta**2)
    restitution = np.exp(-beta / omega * (math.pi - np.arctan2(2 * beta * omega, omega**2 - beta**2)))
    x = model.position + np.array([0, 0, 1e-4])
    v = np.tile([0, 0, -0.3], (3, 1))
    r = simulate(model, p, duration=0.02, rate=1000, dt=2e-6, state=start(model, 4, x=x, v=v))
    assert r.v[-1, 0, :, 2] == pytest.approx(0.3 * restitution, rel=5e-4)  # the dashpot sets in with a jump: omega dt
    assert r.energy_balance()[-1] == pytest.approx(r.energy_balance()[0], rel=1e-3)


def test_drop_under_gravity_bounces_back_without_loss():
    model = plate()
    p = quiet(
        model,
        {
            ("inertia", "mass"): 1e-3,
            ("ground", "stiffness"): 800.0,
            ("plane", "reach"): 1.0,
            ("gravity", "gravity_z"): -G,
        },
    )
    height = 5e-3
    state = start(model, x=model.position + np.array([0, 0, height]))
    r = simulate(model, p, duration=1.0, rate=5000, dt=1e-5, state=state)
    z = r.x[:, 0, 0, 2]
    tops = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
    assert len(tops) > 10
    assert tops == pytest.approx(height, rel=1e-3)
    deepest = 1e-3 * G / 800 * (1 + math.sqrt(1 + 2 * 800 * height / (1e-3 * G)))
    assert z.min() == pytest.approx(-deepest, rel=1e-3)


TILT = 0.3


def block_on_a_slope(friction):
    """A tetrahedron of stiff bars whose three feet stand on a ground tilted by TILT about y, one world per friction."""
    c, s = math.cos(TILT), math.sin(TILT)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    side = 0.02
    feet = side * np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.866, 0]])
    x = np.vstack([feet, [side * 0.5, side * 0.289, 0.005]]) @ turn.T
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    model = make_model(x, bars=edges, triangles=[(0, 1, 2)], contacts=[(0, 1, 2), (1, 2, 0), (2, 0, 1)])
    values = {
        ("bars", "stiffness"): 3e3,
        ("bars", "rest_length"): lengths(model),
        ("bar_viscosity", "viscosity"): 0.3,
        ("inertia", "mass"): 1e-3,
        ("gravity", "gravity_z"): -G,
        ("plane", "tilt"): TILT,
        ("plane", "reach"): 1e-2,
        ("ground", "stiffness"): 1500.0,
        ("ground", "damping"): 0.8,
        ("friction", "stiffness"): 1500.0,
        ("friction", "damping"): 0.8,
        ("coulomb", "friction_coefficient"): np.atleast_2d(friction),
    }
    return model, quiet(model, values), np.array([c, 0, s])


def test_block_sticks_for_ten_seconds_just_below_the_friction_angle():
    """Creep is measured from t = 1 s on, when the bristles have taken up the load and the settling has rung down."""
    model, p, up_slope = block_on_a_slope(math.tan(TILT) * np.array([1.03, 1.2, 2.0]))
    r = simulate(model, p, duration=10.0, rate=10)
    along = r.x[..., :] @ up_slope
    creep = along[10:] - along[10]
    assert not r.failures
    assert np.abs(creep).max() < 1e-6
    assert np.abs(creep).max() < 1e-9  # measured: it does not move at all
    assert np.abs(along[-1] - along[0]).max() < 50e-6


def test_block_slides_above_the_friction_angle_with_the_closed_form_acceleration():
    mu = np.array([0.0, 0.1, 0.2, 0.28])
    model, p, up_slope = block_on_a_slope(mu)
    r = simulate(model, p, duration=2.0, rate=50)
    assert not r.failures
    place = r.centre_of_mass()[25:] @ up_slope
    acceleration = 2 * np.polyfit(r.times[25:], place, 2)[0]
    expected = -G * (math.sin(TILT) - mu * math.cos(TILT))
    assert acceleration == pytest.approx(expected, rel=1e-3)


def test_directional_friction_brakes_forward_and_backward_sliding_differently():
    """mu_f along the body's axis, mu_f + dmu against it, mu_f across it."""
    mu, excess = 0.2, 0.5
    model = plate(axes=[[-1, 1, 0], [0, -1, 1], [1, 0, -1]])
    # the axis is node 0 -> node 1 for every foot, whatever corner its triangle starts with
    axes = np.array([[-1.0, 1, 0], [1, 0, -1], [0, -1, 1]])
    model = plate(axes=axes)
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 1e3,
            ("bars", "rest_length"): lengths(model),
            ("inertia", "mass"): 1e-3,
            ("gravity", "gravity_z"): -G,
            ("ground", "stiffness"): 1000.0,
            ("ground", "damping"): 0.5,
            ("plane", "reach"): 1e-2,
            ("friction", "stiffness"): 1000.0,
            ("coulomb", "friction_coefficient"): mu,
            ("directional_friction", "backward_excess"): excess,
        },
    )
    v = np.zeros((3, 3, 3))
    v[:, 0, 0], v[:, 1, 0], v[:, 2, 1] = 1.0, -1.0, 1.0
    x = model.position - [0, 0, 1e-3 * G / 1000.0]  # in its static imprint
    r = simulate(model, p, duration=0.1, rate=100, dt=1e-5, state=start(model, 3, x=x, v=v))
    velocity = r.v[2:].mean(1)
    slowing = [np.polyfit(r.times[2:], velocity[:, w, c], 1)[0] for w, c in ((0, 0), (1, 0), (2, 1))]
    assert slowing == pytest.approx([-mu * G, (mu + excess) * G, -mu * G], rel=2e-3)


def test_adhesion_lets_go_at_its_pull_off_force():
    pull_off = 0.05
    pull = np.linspace(0.9, 1.1, 21)
    model = plate()
    p = quiet(
        model,
        {
            ("bars", "stiffness"): 1e3,
            ("bars", "rest_length"): lengths(model),
            ("inertia", "mass"): 1e-3,
            ("ground", "stiffness"): 2000.0,
            ("ground", "damping"): 1.0,
            ("mass_damping", "decay_rate"): 20.0,
            ("adhesion", "pull_off"): pull_off,
            ("adhesion", "reach"): 5e-5,
            ("plane", "reach"): 1e-2,
            ("load", "force_z"): pull_off * pull[None],
        },
    )
    r = simulate(model, p, Drive(load=ramp(1.0, 0.5)), duration=1.0, rate=20)
    lifted = r.x[-1, 0, :, 2] > 1e-4
    assert not r.failures
    assert np.all(lifted == (pull > 1.0 + 1e-9)) or np.abs(pull[np.argmax(lifted)] - 1.0) <= 0.01
    assert lifted[-1] and not lifted[0]


def sled(**ground):
    sheet = Sheet(strip([0.01] * 4, 0.02), thickness=1e-3, material="pdms", panels=ground.pop("panels", "elastic"))
    return sheet.crease(stiffness=5e-3).ground(**ground).build()


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_a_sled_may_slide_on_level_ground_and_friction_is_named(panels):
    """Three motions along the ground cost nothing: no instability, and friction, which is left out, would hold them."""
    found = equilibrium(*sled(panels=panels, friction=0.5))
    assert found.converged and found.stable and found.neutral == 3
    assert found.frictionless and "Friction on the ground is left out: it would hold" in found.message
    assert "3 neutral modes" in repr(found) and "rad" in repr(found) and len(repr(found)) < 400
    assert not equilibrium(*sled(panels=panels, friction=0.0)).frictionless


def test_a_slope_has_no_rest_without_friction_and_that_is_said():
    found = equilibrium(*sled(friction=0.5, tilt=0.1), max_iterations=50)
    assert not found.converged and "Friction on the ground is left out, which may hold" in found.message


def test_rigid_panels_that_turn_far_on_their_way_are_judged_by_a_symmetric_tangent():
    """A sled that is put down at an angle lies down, and may slide as one may that lay before."""
    model, parameters = sled(panels="rigid", friction=0.0)
    turn = np.array([[np.cos(0.4), 0.0, np.sin(0.4)], [0.0, 1.0, 0.0], [-np.sin(0.4), 0.0, np.cos(0.4)]])
    placed = (model.position - model.position.mean(axis=0)) @ turn.T + [0.0, 0.0, 0.008]
    found = equilibrium(model, parameters, state=State.at_rest(model, position=placed))
    assert found.converged and found.stable and found.neutral == 3
    assert np.ptp(found.x[:, 2]) < 2e-3  # thickness and sink


@pytest.mark.parametrize("slope", [0.1, 0.6])
def test_a_sled_lies_on_a_slope_by_its_weight_and_falls_onto_a_tilted_ground(slope):
    """Level ground and tilted weight: at rest below the angle of friction, g (sin - mu cos) above it."""
    weight = (-G * math.sin(slope), 0.0, -G * math.cos(slope))
    sheet = Sheet(strip([0.01] * 4, 0.02), thickness=1e-3, material="pdms", triangulation="diagonal")
    sheet.crease(stiffness=5e-3, loss_time=3e-3)
    lying = simulate(*sheet.gravity(weight).ground(friction=0.5).build(), duration=0.2)
    downhill = max(0.0, math.sin(slope) - 0.5 * math.cos(slope))
    assert -lying.v[-1, :, 0, 0].mean() == pytest.approx(0.2 * G * downhill, rel=1e-5, abs=1e-12)
    model, parameters = sled(friction=0.5, tilt=slope)
    gap = gaps(model, parameters, model.position[:, None])
    assert gap.min() == pytest.approx(0.0, abs=1e-12)  # not inside, and not lying on it
    assert gap.max() == pytest.approx(0.04 * math.sin(slope), rel=1e-9)
