"""The independent double pendulum, the stand-in made from it, and initial states."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from origami_sim.errors import InputError
from origami_sim.observation.compare import compare
from origami_sim.recording import (
    Channel,
    Recording,
    double_pendulum_rhs,
    initial_angles,
    read_recording,
    simulate_double_pendulum,
    stand_in_double_pendulum,
)
from origami_sim.recording.rigid_pendulum import PUBLISHED_DOUBLE, double_pendulum_energy
from origami_sim.recording.stand_in import stand_in_start

SIDECAR = Path(__file__).resolve().parents[2] / "scenes" / "pendulum_chain_double.toml"
FRICTIONLESS = replace(PUBLISHED_DOUBLE, k1=0.0, k2=0.0)
SWING = np.array([2.6, 3.5, 7.8, -1.5])


def lagrangian(theta: np.ndarray, rate: np.ndarray) -> float:
    """T - V from the positions and velocities of the centres of mass, not from the expanded formula."""
    p = FRICTIONLESS

    def arm(k):
        return np.array([np.sin(theta[k]), np.cos(theta[k])]), rate[k] * np.array([np.cos(theta[k]), -np.sin(theta[k])])

    (e1, v1), (e2, v2) = arm(0), arm(1)
    centre1, centre2 = p.a1 * e1, p.L1 * e1 + p.a2 * e2
    velocity1, velocity2 = p.a1 * v1, p.L1 * v1 + p.a2 * v2
    kinetic = 0.5 * (p.m1 * velocity1 @ velocity1 + p.m2 * velocity2 @ velocity2)
    kinetic += 0.5 * (p.I1 * rate[0] ** 2 + p.I2 * rate[1] ** 2)
    return kinetic - p.g * (p.m1 * centre1[1] + p.m2 * centre2[1])


def test_energy_is_conserved_without_friction():
    states = simulate_double_pendulum(FRICTIONLESS, SWING, np.linspace(0.0, 10.0, 501), rtol=1e-13, atol=1e-13)
    energy = double_pendulum_energy(states, FRICTIONLESS)
    assert np.ptp(states[:, 0]) > 1.0
    kinetic = energy[0] - FRICTIONLESS.g * (
        (FRICTIONLESS.m1 * FRICTIONLESS.a1 + FRICTIONLESS.m2 * FRICTIONLESS.L1) * np.cos(SWING[0])
        + FRICTIONLESS.m2 * FRICTIONLESS.a2 * np.cos(SWING[1])
    )
    assert np.abs(energy - energy[0]).max() < 1e-9 * kinetic


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_satisfy_lagranges_equations(seed):
    """d/dt dL/dw - dL/dtheta = 0 with every derivative taken numerically from L."""
    generator = np.random.default_rng(seed)
    theta, rate = generator.uniform(-np.pi, np.pi, 2), generator.uniform(-8.0, 8.0, 2)
    acceleration = double_pendulum_rhs(0.0, np.concatenate([theta, rate]), FRICTIONLESS)[2:]
    unit, h = np.eye(2), 1e-3

    def momentum(time):  # L is quadratic in the rates, so that this difference is exact
        x, w = theta + rate * time + 0.5 * acceleration * time**2, rate + acceleration * time
        return np.array([(lagrangian(x, w + e) - lagrangian(x, w - e)) / 2.0 for e in unit])

    def slope(function, step):  # central difference of fourth order
        near, far = function(step) - function(-step), function(2.0 * step) - function(-2.0 * step)
        return (8.0 * near - far) / (12.0 * step)

    left = slope(momentum, h)
    right = np.array([slope(lambda s, e=e: lagrangian(theta + s * e, rate), h) for e in unit])
    np.testing.assert_allclose(left, right, rtol=1e-7, atol=1e-8)


def test_small_oscillations_have_the_normal_mode_frequencies():
    p = FRICTIONLESS
    coupling = p.m2 * p.L1 * p.a2
    mass = np.array([[p.I1 + p.m1 * p.a1**2 + p.m2 * p.L1**2, coupling], [coupling, p.I2 + p.m2 * p.a2**2]])
    stiffness = p.g * np.diag([p.m1 * p.a1 + p.m2 * p.L1, p.m2 * p.a2])
    squares, shapes = eigh(stiffness, mass)
    for square, shape in zip(squares, shapes.T, strict=True):
        period = 2.0 * np.pi / np.sqrt(square)
        deflection = 1e-4 * shape / np.abs(shape).max()
        start = np.concatenate([np.pi + deflection, [0.0, 0.0]])
        states = simulate_double_pendulum(p, start, np.array([0.0, 0.5 * period, period]), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(states[1, :2] - np.pi, -deflection, atol=1e-10)
        np.testing.assert_allclose(states[2, :2] - np.pi, deflection, atol=1e-10)


def test_friction_dissipates_at_the_rate_of_its_laws():
    p = replace(PUBLISHED_DOUBLE, dry1=1e-3, dry2=4e-4, dry_rate=0.5)
    times = np.linspace(0.0, 2.0, 4001)
    states = simulate_double_pendulum(p, SWING, times)
    hinge1, hinge2 = states[:, 2], states[:, 3] - states[:, 2]
    power = p.k1 * hinge1**2 + p.k2 * hinge2**2
    power += p.dry1 * hinge1 * np.tanh(hinge1 / p.dry_rate) + p.dry2 * hinge2 * np.tanh(hinge2 / p.dry_rate)
    lost = np.trapezoid(power, times)
    energy = double_pendulum_energy(states, p)
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-5)


def test_the_stand_in_is_deterministic_and_reads_like_the_recording(tmp_path):
    first = stand_in_double_pendulum(tmp_path / "a.csv", duration=2.0, seed=3)
    again = stand_in_double_pendulum(tmp_path / "b.csv", duration=2.0, seed=3)
    other = stand_in_double_pendulum(tmp_path / "c.csv", duration=2.0, seed=4)
    assert first.read_bytes() == again.read_bytes() != other.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "b.csv", "c.csv"]
    recording = read_recording(first, SIDECAR)
    assert recording.frame_count == 2001 and recording.metadata["notes"] == []
    for channel in recording.channels.values():
        assert channel.noise == pytest.approx(1.57e-4 / np.sqrt(12.0), rel=0.1)
    with pytest.raises(InputError, match="at least 3 frames"):
        stand_in_double_pendulum(tmp_path / "d.csv", duration=0.001)


def test_the_concealed_friction_parts_and_its_absence_does_not(tmp_path):
    """From the true initial state, the nominal model parts from the stand-in only if friction is concealed in it."""
    fits = {}
    for dry in (0.0, 4e-4):
        path = stand_in_double_pendulum(tmp_path / "run.csv", duration=5.0, seed=0, dry_friction=dry)
        recording = read_recording(path, SIDECAR)
        states = simulate_double_pendulum(PUBLISHED_DOUBLE, stand_in_start(0), recording.times)
        comparison = compare(recording, {"theta1": states[:, 0], "theta2": states[:, 1]})
        fits[dry] = comparison.first_time
    assert fits[0.0] is None
    assert 0.0 < fits[4e-4] < 1.0


def test_the_nominal_model_follows_the_real_recording_for_two_seconds(pendulum_recordings):
    recording = read_recording(pendulum_recordings / "double.csv", SIDECAR).window(0.0, 2.1)
    start = initial_angles(recording, 0.1)
    recording = recording.window(0.1, 2.1)
    y0 = [start["theta1"].angle, start["theta2"].angle, start["theta1"].rate, start["theta2"].rate]
    states = simulate_double_pendulum(PUBLISHED_DOUBLE, np.array(y0), recording.times)
    comparison = compare(recording, {"theta1": states[:, 0], "theta2": states[:, 1]})
    assert min(c.fit for c in comparison.channels.values()) > 93.0
    assert comparison.first_time is not None  # friction alone does not explain the residual


@pytest.mark.parametrize("half_window", [0.03, None])
@pytest.mark.parametrize("t0", [0.0, 0.5, 1.0])
def test_initial_angles_are_right_within_their_standard_errors(t0, half_window):
    times = np.arange(1001) / 1000.0
    noise, scores = 1e-4, []
    for seed in range(200):
        generator = np.random.default_rng(seed)
        values = 1.2 * np.cos(5.0 * times) + generator.normal(scale=noise, size=times.size)
        recording = Recording("r", times, {"arm": Channel("arm", "panel_angle", values, "rad", noise)})
        estimate = initial_angles(recording, t0, half_window=half_window)["arm"]
        scores.append(
            [
                (estimate.angle - 1.2 * np.cos(5.0 * t0)) / estimate.angle_error,
                (estimate.rate + 6.0 * np.sin(5.0 * t0)) / estimate.rate_error,
            ]
        )
    spread = np.std(scores, axis=0)
    assert (spread > 0.7).all() and (spread < 1.25).all()
    assert (np.abs(np.mean(scores, axis=0)) < 0.5).all()


def test_initial_angles_refuses_what_it_cannot_fit():
    times = np.arange(100) / 100.0
    marker = Recording("r", times, {"m": Channel("m", "force", times, "N", 1.0)})
    arm = Recording("r", times, {"arm": Channel("arm", "panel_angle", times, "rad", 1e-3)})
    with pytest.raises(InputError, match="no angle channel"):
        initial_angles(marker, 0.5)
    with pytest.raises(InputError, match=r"outside the recording .*allowed: 0 s to 0.99 s"):
        initial_angles(arm, 2.0)
    with pytest.raises(InputError, match="'arm' has 3 frames in the window, 7 are needed"):
        initial_angles(arm, 0.5, half_window=0.01)
    with pytest.raises(InputError, match="positive width"):
        initial_angles(arm, 0.5, half_window=0.0)
