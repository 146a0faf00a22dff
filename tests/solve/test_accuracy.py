"""The energy balance that every run reports, and steps that follow from an accuracy."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solve.structures import model_of

from origami_sim import Drive, Sheet, rigid, simulate, strip
from origami_sim.device.device import device_module
from origami_sim.errors import InputError
from origami_sim.model import Parameters, State
from origami_sim.solve.motion.accuracy import HALVINGS, SLIGHT, SOUND, exchanges, extent, refined, sentence


def flap(loss_time=0.0):
    """A magnetic flap of 1 MPa on a held base, and the step of the field that drives it."""
    sheet = Sheet(strip([0.01, 0.02], width=0.02), thickness=1e-3, modulus=1e6, triangulation="center")
    sheet.patch(1, thickness=3e-3, poling=(1, 0, 0))
    sheet.crease(stiffness=2e-3, loss_time=loss_time).gravity().fix(panels=[0])
    return *sheet.build(), Drive(field=(0, 0, 0.1))


def tethered(stiffness=4.0, mass=0.25):
    """A ball on a spring of 4 rad/s, let go 1 m from its rest."""
    model = model_of([[1.0, 0.0, 0.0]], ["tether"])
    p = Parameters(model)
    p.set("inertia", "mass", mass)
    p.set("tether", "stiffness", stiffness)
    return model, p


def test_a_step_driven_flap_says_that_its_stable_step_is_too_coarse():
    model, parameters, drive = flap()
    plain = simulate(model, parameters, drive, duration=1.0)
    exact = simulate(model, parameters, drive, duration=1.0, dt=plain.dt / 64).creases[-1]
    assert 0.05 < np.abs(plain.creases[-1] - exact).max() < 0.08  # stable, and far off
    assert plain.energy_error[0] > SOUND
    (note,) = plain.notes
    assert "energy balance is off by 1.7 %" in note and "accuracy" in note

    asked = simulate(model, parameters, drive, duration=1.0, accuracy=1e-3)
    assert np.abs(asked.creases[-1] - exact).max() < 1e-3
    assert asked.energy_error[0] < 1e-3 and asked.dt < plain.dt / 8
    (note,) = asked.notes
    assert note.startswith("Accuracy 0.001: halving the steps once more changed")


def test_a_run_that_is_accurate_says_nothing():
    model, parameters, drive = flap(loss_time=0.003)
    run = simulate(model, parameters, drive, duration=0.5)
    assert 0.0 < run.energy_error[0] < SOUND and not run.notes


def test_what_is_held_and_trembles_is_not_said_to_be_wrong():
    """A tenth of the energy of a tremble by 0.03 degrees is lost, and its middle is where it should be."""
    gripper = device_module(str(Path(__file__).parents[2] / "examples" / "gripper.py"))
    model, parameters, drive = gripper.build(gripper.SETTINGS)
    held, fine = (simulate(model, parameters, drive, duration=0.5, dt=dt) for dt in (None, 2e-5))
    assert held.energy_error[0] > 10 * SOUND > fine.energy_error[0] and extent(held)[0] < SLIGHT
    assert np.abs(held.creases.mean(axis=0) - fine.creases.mean(axis=0)).max() < SLIGHT / 4 and not held.notes
    assert "tremble" in sentence(held) and "tremble" not in sentence(fine)
    model, parameters, drive = flap()
    assert "tremble" not in sentence(simulate(model, parameters, drive, duration=0.3))


@pytest.mark.parametrize("parts", [20, 40, 80])
def test_the_error_of_a_spring_is_that_of_leapfrog(parts):
    """Leapfrog keeps v^2 / 2 + (1 - (w h)^2 / 4) w^2 x^2 / 2 (Hairer, Lubich & Wanner 2003), not the energy."""
    model, p = tethered()
    h = 2 * np.pi / 4.0 / parts  # rate: 4 rad/s
    run = simulate(model, p, duration=4 * np.pi / 4.0, rate=1 / h, dt=h)
    error = (4.0 * h) ** 2 / 4
    assert run.energy_error[0] == pytest.approx(error / (1 - error / 2), rel=1e-9)


def test_what_all_take_up_sums_to_the_error_of_the_balance():
    """Losses and driven laws by their work, springs and weight by their energy."""
    model, parameters, drive = flap(loss_time=0.003)
    run = simulate(model, parameters, drive, duration=0.5)
    parts = exchanges(run)
    assert set(parts) == {"kinetic", *model.laws}
    assert parts["crease_viscosity"][-1, 0] > 0.0 > parts["magnetic_torque"][-1, 0]
    assert np.array_equal(parts["crease_viscosity"], -run.work["crease_viscosity"] + run.work["crease_viscosity"][0])
    assert np.array_equal(parts["gravity"], run.energies["gravity"] - run.energies["gravity"][0])
    balance = run.energy_balance()
    assert sum(parts.values()) == pytest.approx(balance - balance[0], abs=1e-18)


def test_rigid_panels_take_an_accuracy_as_tolerance():
    model, parameters, drive = flap()
    model, parameters = rigid(model, parameters)
    exact = simulate(model, parameters, drive, duration=0.5, tolerance=1e-13)
    errors = []
    for accuracy in (1e-2, 1e-4, 1e-6):
        run = simulate(model, parameters, drive, duration=0.5, accuracy=accuracy)
        errors.append(np.abs(run.creases - exact.creases).max())
        assert errors[-1] < accuracy and run.energy_error[0] < accuracy
    assert errors[0] > errors[1] > errors[2]


def test_implicit_steps_take_an_accuracy():
    model, p = tethered()
    run = simulate(model, p, duration=0.5, rate=10.0, method="implicit", accuracy=1e-3)
    assert run.x[:, 0, 0, 0] == pytest.approx(np.cos(4.0 * run.times), abs=1e-3)
    assert run.notes[0].startswith("Accuracy 0.001")


def test_numerical_damping_is_named():
    model, p = tethered()
    run = simulate(model, p, duration=5.0, rate=10.0, method="implicit", dt=0.1, spectral_radius=0.5)
    assert run.energy_error[0] > SOUND
    assert any("numerical damping" in n and "spectral_radius=1" in n for n in run.notes)


def test_the_worst_world_counts_and_is_named():
    model, _ = tethered()
    p = Parameters(model)
    p.set("inertia", "mass", 0.25)
    p.set("tether", "stiffness", np.array([[1.0, 4.0, 2.0]]))
    state = State.at_rest(model, 3)
    run = simulate(model, p, duration=2.0, rate=20.0, dt=0.05, state=state)
    assert run.energy_error.shape == (3,) and int(run.energy_error.argmax()) == 1
    assert "in world 1" in run.notes[0]
    finer = simulate(model, p, duration=2.0, rate=20.0, state=state, accuracy=1e-3)
    assert finer.energy_error.max() < 1e-3


def test_a_run_at_an_accuracy_goes_on_from_a_state():
    model, p = tethered()
    options = {"rate": 10.0, "dt": 0.05}
    first = simulate(model, p, duration=0.5, **options)
    then = simulate(model, p, duration=0.5, state=first.state, accuracy=1e-2, **options)
    assert then.times[[0, -1]] == pytest.approx([0.5, 1.0])
    assert then.dt < 0.05
    phase = np.arctan2(-then.v[:, 0, 0, 0] / 4.0, then.x[:, 0, 0, 0])
    assert np.unwrap(phase) - phase[0] == pytest.approx(4.0 * (then.times - 0.5), abs=1e-2)


def test_rest_has_no_error():
    model, p = tethered()
    p.set("tether", "anchor_x", 1.0)
    assert simulate(model, p, duration=0.5).energy_error[0] == 0.0


def run_of(changes, model):
    """Runs at half the step each, of which the next differs by the change given."""
    moves = [0.0, *np.cumsum(changes)]

    def run(n):
        x = np.zeros((1, 1, 1, 3)) + moves[n]
        error = np.array([1e-6])
        return SimpleNamespace(
            model=model, x=x, creases=np.zeros((1, 0, 1)), failures=[], notes=[], energy_error=error, n=n
        )

    return run


def test_what_does_not_settle_is_given_up_and_said():
    model, _ = tethered()
    run = refined(run_of([0.5] * HALVINGS, model), 1e-3)
    assert run.n == 4
    assert "was not reached" in run.notes[0] and "amplifies" in run.notes[0]
    run = refined(run_of([0.5 / 2**n for n in range(HALVINGS)], model), 1e-9)
    assert run.n == HALVINGS and "was not reached" in run.notes[0]


@pytest.mark.parametrize("accuracy", [0.0, -1e-3, 1.0, np.nan, True, "fine"])
def test_an_accuracy_is_a_small_positive_number(accuracy):
    model, p = tethered()
    with pytest.raises(InputError, match="no such accuracy"):
        simulate(model, p, duration=0.5, accuracy=accuracy)
