"""What panels weigh, stated as an experimenter measures it, against closed forms."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, equilibrium, simulate, strip
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import body_of

G = 9.80665
MOUNT = 0.04


def plate(width: float = 0.2, *, panels: str = "rigid") -> Sheet:
    """A panel of 0.1 m, much wider than it is long, that hangs from a held mount on one crease."""
    pattern = strip([MOUNT, 0.1], width)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)
    sheet = Sheet(pattern, thickness=2e-3, material="aluminium", triangulation="center", panels=panels)
    return sheet.fix(panels=[0]).gravity().name("crease", ["hip"])


def period(sheet: Sheet, rest: float = 0.0, amplitude: float = 1e-4) -> float:
    """Period of small swings about a fold angle [s], from where the angle passes it."""
    model, parameters = sheet.build()
    arm = Articulation(model)
    pose = arm.reference()
    pose.angles[:] = rest + amplitude
    run = simulate(
        model, parameters, Drive(), duration=3.0, rate=2000.0,
        state=State.at_rest(model, position=arm.positions(pose)), tolerance=1e-12,
    )  # fmt: skip
    swing = run.creases[:, 0, 0] - rest
    k = np.flatnonzero((swing[:-1] > 0) & (swing[1:] <= 0))
    # through four points, so that the crossing is exact to 1e-9 of a frame
    at = []
    for i in k:
        t = np.arange(-1, 3)
        at.append(run.times[i] + np.interp(0, [0, 1], [0, 1]) + _root(t, swing[i - 1 : i + 3]) * (run.times[1]))
    return float(np.mean(np.diff(at)))


def _root(t: np.ndarray, y: np.ndarray) -> float:
    roots = np.roots(np.polyfit(t, y / np.abs(y).max(), 3))
    return float(next(r.real for r in roots if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9))


@pytest.mark.parametrize(
    "stated",
    [
        {"about": "crease"},
        {"about": "hip"},
        {"about": 0},
        {"about": (0.0, 3.0, 0.0), "through": (0.0, 0.07, -MOUNT)},
    ],
)
def test_inertia_about_the_crease_is_that_of_a_physical_pendulum(stated):
    """T = 2 pi sqrt(I / m g a), also of a panel whose crease is its longer side."""
    mass, arm, inertia = 0.05, 0.06, 3.1e-4
    sheet = plate().body(1, mass=mass, centre=(0, 0, -MOUNT - arm), inertia=inertia, **stated)
    expected = 2 * np.pi * np.sqrt(inertia / (mass * G * arm))
    assert period(sheet) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_one_moment_is_right_about_any_axis_through_any_point(panels):
    """Five nodes of an elastic rectangle can have the moment about an axis along its sides."""
    mass, centre, moment = 0.05, np.array([0.0, 0.005, -MOUNT - 0.06]), 1.5e-4
    axis = np.array([0.0, 0.6, 0.8] if panels == "rigid" else [0.0, 1.0, 0.0])
    point = np.array([0.0, 0.02, -MOUNT - 0.03])
    sheet = plate(0.12, panels=panels)
    sheet.body(1, mass=mass, centre=centre, inertia=moment, about=axis, through=point)
    model, parameters = sheet.build()
    if panels == "rigid":
        found, tensor = body_of(parameters, 1)
        np.testing.assert_allclose(found, centre, atol=1e-12)
        away = np.cross(centre - point, axis)
        assert axis @ tensor @ axis + mass * away @ away == pytest.approx(moment, rel=1e-9)
        return
    without = plate(0.12, panels=panels)
    without.body(1, mass=1e-9 * mass, centre=centre, inertia=1e-9 * moment, about=axis, through=point)
    own = parameters["inertia", "mass"][:, 0] - without.build()[1]["inertia", "mass"][:, 0]
    assert own.sum() == pytest.approx(mass, rel=1e-6)
    far = np.cross(model.position - point, axis)
    assert own @ (far**2).sum(1) == pytest.approx(moment, rel=1e-6)


def test_a_tensor_about_a_point_is_shifted_to_the_centre():
    mass, centre, point = 0.05, np.array([0.01, 0.0, -0.1]), np.array([0.0, 0.0, -MOUNT])
    tensor = np.array([[4e-4, 2e-5, 0.0], [2e-5, 5e-4, 1e-5], [0.0, 1e-5, 2e-4]])
    away = centre - point
    about = tensor + mass * (away @ away * np.eye(3) - np.outer(away, away))
    sheet = plate().body(1, mass=mass, centre=centre, inertia=about, through=point)
    found, own = body_of(sheet.build()[1], 1)
    np.testing.assert_allclose(own, tensor, atol=1e-15)
    np.testing.assert_allclose(found, centre, atol=1e-15)


def test_a_mass_off_the_mid_plane_turns_the_rest_angle_and_swings_with_it():
    """tan(rest) = m h / (M a + m b); the moment about the crease grows by m (b^2 + h^2)."""
    mass, arm, inertia, small, b, h = 0.05, 0.06, 3.1e-4, 0.01, 0.08, 0.015
    sheet = plate().body(1, mass=mass, centre=(0, 0, -MOUNT - arm), inertia=inertia, about="crease")
    sheet.point_mass(1, small, (0.0, 0.0, -MOUNT - b), offset=h)
    lever = np.array([small * h, mass * arm + small * b])
    rest = equilibrium(*sheet.build()).angles[0]
    assert abs(rest) == pytest.approx(np.arctan2(*lever), rel=1e-8)
    expected = 2 * np.pi * np.sqrt((inertia + small * (b**2 + h**2)) / (G * np.hypot(*lever)))
    assert period(sheet, rest) == pytest.approx(expected, rel=1e-6)


def test_a_mass_off_the_mid_plane_of_an_elastic_panel_acts_by_its_weight():
    """The same rest angle as with rigid panels, to the bending of the panel."""
    angles = []
    for panels in ("rigid", "elastic"):
        sheet = plate(panels=panels).point_mass(1, 0.01, (0.0, 0.0, -MOUNT - 0.08), offset=0.015)
        model, parameters = sheet.crease(stiffness=1e-4).build()
        angles.append(equilibrium(model, parameters).angles[0])
    assert angles[1] == pytest.approx(angles[0], rel=2e-3) and abs(angles[0]) > 0.02


def test_a_patch_counts_its_weight_off_the_plane_whenever_gravity_was_stated():
    early, late = plate(panels="elastic"), plate(panels="elastic")
    for sheet in (early, late):
        sheet.patch(1, thickness=3e-3, size=(0.02, 0.05), overhang=True)
    late.gravity()
    a, b = (s.crease(stiffness=1e-4).build()[1]["eccentric_weight", "gravity_z"] for s in (early, late))
    np.testing.assert_array_equal(a, b)
    assert np.all(a == -G)
