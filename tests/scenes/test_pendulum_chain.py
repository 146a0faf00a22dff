"""Two hinged arms, against rigid-body equations integrated by SciPy and against the real recording."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from origami_sim.device.scene import Settings, read_calibration, recordings_folder, scene_settings
from origami_sim.errors import InputError
from origami_sim.observation.compare import compare
from origami_sim.observation.observe import observe
from origami_sim.recording import read_recording, simulate_double_pendulum
from origami_sim.recording.rigid_pendulum import DoublePendulum
from origami_sim.scenes import pendulum_chain


@pytest.fixture(scope="module")
def settings():
    return read_calibration(pendulum_chain.CALIBRATION).replace(duration=2.0).with_panels("elastic")


def error(s, **options) -> float:
    """Largest difference to the rigid-body solution [rad]."""
    motion = pendulum_chain.swing(s, rate=100.0, **options)
    rigid = DoublePendulum(
        m1=s.mass_1, m2=s.mass_2, a1=s.centre_1, a2=s.centre_2, L1=s.length_1, I1=s.inertia_1, I2=s.inertia_2,
        k1=s.viscosity_1, k2=s.viscosity_2 if s.mass_2 else 0.0, g=s.gravity,
    )  # fmt: skip
    start = np.array([s.angle_1, s.angle_2, s.rate_1, s.rate_2])
    exact = simulate_double_pendulum(rigid, start, motion.times, rtol=1e-12, atol=1e-13)[:, :2]
    found = pendulum_chain.arm_angles(motion, s)
    return float(np.abs(found - exact[:, : found.shape[1]]).max())


def test_default_arms_are_rigid_to_a_milliradian(settings):
    assert error(settings) < 1e-3


def test_a_single_arm_too(settings):
    """Without the mass and the friction of arm 2 the equations leave arm 1 alone."""
    assert error(settings.replace(mass_2=0.0)) < 1e-3


def test_error_falls_as_one_over_the_bar_stiffness(settings):
    stiffness = np.array([1e4, 1e5, 1e6, 1e7])
    errors = [error(settings.replace(membrane_stiffness=k)) for k in stiffness]
    slope = np.polyfit(np.log(stiffness), np.log(errors), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)


def test_motion_converges_with_the_square_of_the_step(settings):
    """Soft bars and a short swing, so that the vibration of the bars is resolved by every step."""
    s = settings.replace(membrane_stiffness=1e3, duration=0.2)
    base = pendulum_chain.swing(s, rate=100.0).dt / 4
    ends = [pendulum_chain.swing(s, rate=100.0, dt=base / n).x[-1] for n in (1, 2, 4, 8, 32)]
    errors = [np.abs(x - ends[-1]).max() for x in ends[:-1]]
    slope = np.polyfit(np.log([1, 2, 4, 8]), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.1)


def further(s, **last):
    """Settings with one arm more, in which arm 3 is like arm 2 but for what is given."""
    names = pendulum_chain.SERIES
    third = [replace(s[f"{n}_2"], name=f"{n}_3", value=last.get(n, s[f"{n}_2"].value)) for n in names]
    return Settings([*s.values(), *third], s.file)


def test_three_rigid_arms_move_as_lagrange_says(settings):
    """Any number of arms of any length: absolute angles p of a chain, M(p) p'' + C(p) p'^2 = moments."""
    s = further(
        settings.replace(length_2=0.31), mass=0.06, centre=0.05, inertia=2e-4, angle=2.9, rate=1.0, viscosity=2e-5
    )
    m, a, length, inertia, c = (
        pendulum_chain.of_arms(s, n) for n in ("mass", "centre", "length", "inertia", "viscosity")
    )
    reach = np.tril(np.tile(length, (3, 1)), -1) + np.diag(a)  # of each arm's centre, by arm
    moving, weight = np.diag(inertia), m @ reach * s.gravity

    def rates(_, y):
        p, w = np.split(y, 2)
        pull = reach.T @ (m[:, None] * reach)
        apart = p[:, None] - p
        hinge = c * np.diff(w, prepend=0.0)
        right = -(pull * np.sin(apart)) @ w**2 + weight * np.sin(p) - hinge + np.append(hinge[1:], 0.0)
        return np.append(w, np.linalg.solve(moving + pull * np.cos(apart), right))

    run = pendulum_chain.swing(s.with_panels("rigid").replace(duration=1.0), rate=100.0, tolerance=1e-11)
    start = np.concatenate([pendulum_chain.of_arms(s, "angle"), pendulum_chain.of_arms(s, "rate")])
    exact = solve_ivp(rates, (0, 1), start, "DOP853", run.times, rtol=1e-12, atol=1e-13).y[:3].T
    assert np.abs(pendulum_chain.arm_angles(run, s) - exact).max() < 1e-7
    assert run.model.names["crease"] == ("hinge1", "hinge2", "hinge3")


def test_a_calibration_may_state_further_arms(settings, tmp_path):
    text = settings.file.read_text()
    part = "".join(block.replace("_2]", "_3]") for block in re.findall(r"\[\w+_2\]\n(?:.+\n)+", text))
    (tmp_path / "three.toml").write_text(text + part)
    three = scene_settings(pendulum_chain, tmp_path / "three.toml")
    assert pendulum_chain.arms(three) == [1, 2, 3]
    assert pendulum_chain.build(three)[0].names["panel"] == ("mount", "arm1", "arm2", "arm3")
    (tmp_path / "three.toml").write_text(text + part.replace("[rate_3]", "[rate_4]"))
    with pytest.raises(InputError, match=r"lacks a setting.*rate_3|no such setting"):
        scene_settings(pendulum_chain, tmp_path / "three.toml")


def test_energy_is_kept_without_friction(settings):
    s = settings.replace(viscosity_1=0.0, viscosity_2=0.0, duration=10.0)
    motion = pendulum_chain.swing(s, rate=50.0)
    balance = motion.energy_balance()[:, 0]
    scale = motion.energies["kinetic"].max()
    assert np.ptp(balance) < 1e-5 * scale
    first, last = np.array_split(balance, 2)
    assert abs(last.mean() - first.mean()) < 1e-6 * scale  # no trend


def test_parts_early_from_the_real_recording_yet_fits_it(settings):
    folder = recordings_folder()
    if folder is None or not (folder / "pendulum_chain" / "double.csv").is_file():
        pytest.skip("no real recording here: the pendulum is not compared with it")
    sidecar = Path(pendulum_chain.__file__).with_name("pendulum_chain_double.toml")
    recording = read_recording(folder / "pendulum_chain" / "double.csv", sidecar)
    first = float(recording.times[0])
    part = recording.window(first, first + 5.0)
    motion, _ = pendulum_chain.replicate(settings, part)
    result = compare(part, observe(motion, part))
    assert result.first_time is not None
    assert result.first_time - first < 2.0
    assert all(c.fit > 80.0 for c in result.channels.values())
