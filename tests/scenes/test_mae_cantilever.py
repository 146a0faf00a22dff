"""The magnetic cantilever against the elastica, solved apart from this code, and against a measured beam."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp
from scipy.optimize import brentq

from origami_sim.device.scene import read_calibration, recordings_folder
from origami_sim.scenes import mae_cantilever as cantilever
from origami_sim.solve.motion.dynamics import simulate

LOADS = 37.769 * np.array([0.1, 0.2, 0.3, 0.5, 0.75, 1.0])
TABLE = np.array([0.7286, 0.9198, 1.0077, 1.0969, 1.1537, 1.1879])
"""Tip displacement over length in 20, 40, 60, 100, 150 and 200 mT: the project's reference solution."""


def tip_by_quadrature(load: float) -> tuple[float, float, float]:
    """Tip angle [rad], x/L and y/L of th'' + load cos th = 0, th(0) = th'(1) = 0."""

    def integral(c, weight=lambda c: 1.0):
        # c, the angle's complement at the tip, keeps digits near saturation; c + v^2 further in takes the root out
        # of th' = sqrt(2 load (sin tip - sin th))
        def integrand(v):
            gap = 2 * np.sin(c + v * v / 2) * np.sinc(v * v / 2 / np.pi) / 2  # over v^2
            return weight(c + v * v) * 2 / np.sqrt(2 * load * gap)

        return quad(integrand, 0, np.sqrt(np.pi / 2 - c), points=[np.sqrt(c)], epsabs=1e-11, epsrel=1e-11)[0]

    c = np.exp(brentq(lambda u: integral(np.exp(u)) - 1, -8, np.log(1.5)))
    return np.pi / 2 - c, integral(c, np.sin), integral(c, np.cos)


def tip_by_boundary_values(load: float, *, phi: float = np.pi / 2, weight: float = 0.0) -> tuple[float, float, float]:
    """The same with the field at an angle phi to the beam and a weight w L^3 / EI against it."""
    s = np.linspace(0, 1, 401)
    guess = np.zeros((4, len(s)))
    for share in np.linspace(0.05, 1, 20):

        def slope(s, y, share=share):
            th, m = y[:2]
            return np.stack(
                [m, -share * load * np.sin(phi - th) + share * weight * (1 - s) * np.cos(th), np.cos(th), np.sin(th)]
            )

        found = solve_bvp(slope, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), s, guess, tol=1e-8, max_nodes=20000)
        assert found.success
        guess = found.sol(s)
    return tuple(found.y[[0, 2, 3], -1])


@pytest.fixture(scope="module")
def settings():
    return read_calibration(cantilever.CALIBRATION)


@pytest.fixture(scope="module")
def coarse(settings):
    """20 cells: R/L within 0.2 %."""
    return settings.replace(cells=20.0)


def displacement(settings, fields) -> np.ndarray:
    shape, notes = cantilever.bend(settings, fields)
    assert not notes
    return shape["r_over_l"]


def test_the_reference_solutions_agree():
    for load, printed in zip(LOADS, TABLE, strict=True):
        angle, x, y = tip_by_quadrature(load)
        np.testing.assert_allclose(tip_by_boundary_values(load), (angle, x, y), atol=1e-5)
        assert np.hypot(1 - x, y) == pytest.approx(printed, abs=6e-5)


def test_magnetic_load(settings):
    assert cantilever.magnetic_load(settings, 0.2) == pytest.approx(37.769, abs=1e-3)


def test_shape_against_the_elastica(settings):
    shape, notes = cantilever.bend(settings, 0.2 * cantilever.SHARES)
    assert not notes
    np.testing.assert_allclose(shape["r_over_l"], TABLE, rtol=0.001)
    angle, x, y = np.array([tip_by_quadrature(load) for load in LOADS]).T
    np.testing.assert_allclose(shape["tip_deg"], np.degrees(angle), atol=0.05)
    np.testing.assert_allclose(shape["x_over_l"], x, atol=0.001)
    np.testing.assert_allclose(shape["y_over_l"], y, atol=0.001)


@pytest.mark.parametrize(
    ("modulus", "fields", "expected"),
    [
        (1.38e6, [0.02, 0.1, 0.15, 0.2], [0.5408, 0.9958, 1.0704, 1.1152]),
        (1.98e6, [0.02, 0.1, 0.15, 0.2], [0.4224, 0.9162, 1.0047, 1.0579]),
    ],
)
def test_other_readings_of_the_damaged_modulus(coarse, modulus, fields, expected):
    np.testing.assert_allclose(displacement(coarse.replace(modulus=modulus), fields), expected, rtol=0.0025)


def order(settings, meshes) -> tuple[float, np.ndarray]:
    """Slope of the error in R/L against the cell, at 0.2 T, and the errors."""
    _, x, y = tip_by_quadrature(cantilever.magnetic_load(settings, 0.2))
    study = cantilever.mesh_study(settings, meshes)
    error = np.abs(study["r_over_l"] - np.hypot(1 - x, y))
    return -np.polyfit(np.log(meshes), np.log(error), 1)[0], error


def test_second_order_convergence(settings):
    slope, error = order(settings, (5, 10, 20, 40))
    assert slope == pytest.approx(2.0, abs=0.1)
    assert error[1] < 0.009 * TABLE[-1] and error[-1] < 0.005 * TABLE[-1]


@pytest.mark.slow
@pytest.mark.parametrize("twist", [30.0, 100.0])
def test_convergence_to_the_finest_mesh(settings, twist):
    slope, error = order(settings.replace(twist=twist), (10, 20, 40, 80))
    assert slope == pytest.approx(2.0, abs=0.1)
    assert error[-1] < 2e-4


def test_the_stiffness_of_the_diagonals_does_not_matter(coarse):
    soft, stiff = (displacement(coarse.replace(twist=t), [0.02, 0.2]) for t in (10.0, 100.0))
    np.testing.assert_allclose(soft, stiff, rtol=1e-3)


def test_field_reversal_mirrors_the_beam(coarse):
    fields = np.array([0.02, 0.06, 0.2])
    up, down = (cantilever.bend(coarse, sign * fields)[0] for sign in (1, -1))
    np.testing.assert_allclose(down["y_over_l"], -up["y_over_l"], atol=1e-9)
    np.testing.assert_allclose(down["x_over_l"], up["x_over_l"], atol=1e-9)


def test_weight_in_the_bending_plane(coarse):
    heavy = coarse.replace(gravity=9.80665)
    weight = 12 * 2800 * 9.80665 * 0.0305**3 / (0.78e6 * 0.0028**2)
    assert weight == pytest.approx(1.53, abs=0.01)
    for sign in (1, -1):
        shape, _ = cantilever.bend(heavy, [0.0, sign * 0.02, sign * 0.1, sign * 0.2])
        for row, load in enumerate(sign * np.array([0.0, 3.7769, 18.884, 37.769])):
            _, x, y = tip_by_boundary_values(load, weight=weight)
            assert shape["y_over_l"][row] == pytest.approx(y, abs=0.003)
            assert shape["x_over_l"][row] == pytest.approx(x, abs=0.003)
        assert shape["tip_deg"][0] == pytest.approx(-14.3, abs=0.05)
        assert shape["y_over_l"][1] == pytest.approx(0.610 if sign > 0 else -0.695, abs=0.002)


def test_misaligned_field(coarse):
    tilted = coarse.replace(misalignment=np.radians(5))
    assert displacement(tilted, [0.06, 0.2])[-1] == pytest.approx(1.1345, rel=0.0025)
    assert displacement(tilted, [-0.06, -0.2])[-1] == pytest.approx(1.2391, rel=0.0025)
    shape, _ = cantilever.bend(tilted, [0.02, 0.06])
    assert shape["tip_deg"][1] == pytest.approx(
        np.degrees(tip_by_boundary_values(11.331, phi=np.radians(85))[0]), abs=0.05
    )


def test_motion_comes_to_rest_in_the_equilibrium(settings):
    same = settings.replace(cells=settings.motion_cells)
    model, parameters, drive = cantilever.build(same)
    motion = simulate(model, parameters, drive, duration=2.5, rate=10)
    assert not motion.failures
    final = cantilever.shape(motion.x[-1, :, 0], settings.length)["r_over_l"]
    assert final == pytest.approx(displacement(same, [0.02, 0.06, 0.2])[-1], abs=1e-4)
    assert np.abs(motion.x[..., 1] - model.position[:, None, 1]).max() == 0.0


def test_run(settings):
    outcome = cantilever.run(settings)
    assert not outcome.trajectory.failures
    assert np.abs(outcome.tables["shape"]["difference_percent"]).max() < 0.5
    assert outcome.numbers["order"] == pytest.approx(2.0, abs=0.15)


def test_measured_beam():
    """Zhao et al. 2019, digitised: 13 points, one at rest."""
    folder = recordings_folder()
    if folder is None or not (folder / "magnetic_beam" / "beam.csv").is_file():
        pytest.skip("the recording magnetic_beam is not here")
    field, measured = np.loadtxt(folder / "magnetic_beam" / "beam.csv", delimiter=",", skiprows=1).T
    shape, notes = cantilever.bend(read_calibration("magnetic_beam"), field * 1e-3)
    assert not notes
    error = shape["y_over_l"] - measured
    assert np.abs(error).max() < 0.05
    assert np.sqrt(np.mean(error**2)) < 0.03
