"""The ground under a sheet: as stiff on any mesh, just touched at the start, and what was overlooked is said."""

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.design.ground import LANDING, SINK
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import State
from origami_sim.model.clearance import gaps, heights
from origami_sim.pattern import grid, strip
from origami_sim.physics.materials import G
from origami_sim.solve.motion.dynamics import simulate

MASS = 1010 * 1e-3 * 0.06 * 0.04


def plate(n: int = 1, **options) -> Sheet:
    """A sheet of 60 x 40 mm of PDMS in squares."""
    options = {"thickness": 1e-3, "triangulation": "center", "membrane": 0.1, **options}
    return Sheet(grid(3 * n, 2 * n, 0.02 / n, 0.02 / n), **options).crease(stiffness=1e-3 * n)


@pytest.mark.parametrize("triangulation", ["center", "diagonal"])
def test_a_finer_mesh_stands_on_no_stiffer_ground(triangulation):
    for n in (1, 2, 4):
        _, parameters = plate(n, triangulation=triangulation).ground().build()
        stiffness = parameters["ground", "stiffness"].sum()
        assert stiffness == pytest.approx(MASS * G / (SINK * 0.06), rel=1e-9)
        assert parameters["ground", "damping"].sum() == pytest.approx(2 * LANDING * np.sqrt(stiffness * MASS), rel=1e-9)


def test_an_edge_bears_the_same_on_a_finer_mesh():
    edge = []
    for n in (2, 4, 8):
        model, parameters = plate(n).ground().build()
        at = (model.contact_weights[:, :, None] * model.position[model.contacts]).sum(axis=1)
        on = np.isclose(at[:, 0], 0.0)
        edge.append(parameters["ground", "stiffness"][on].sum())
    assert edge[2] / edge[1] == pytest.approx(edge[1] / edge[0], abs=0.2)
    assert edge[2] > 0.4 * edge[0]


def test_a_sheet_at_rest_sinks_as_stated():
    model, parameters = plate().ground(sink="20 um").build()
    motion = simulate(model, parameters, duration=0.4, rate=50)
    sunk = -motion.gaps[-1, :, 0] @ parameters["ground", "stiffness"][:, 0]  # of a soft plate, weighted by the load
    assert sunk == pytest.approx(MASS * G, rel=1e-3)
    assert motion.notes == []


@pytest.mark.parametrize("ratio", [0.25, LANDING, 0.9])
def test_a_landing_rebounds_as_stated(ratio):
    """Restitution of a dashpot that cannot pull (Schwager and Poeschel 2007), of a rigid sheet that lands flat."""
    omega = np.sqrt(1 - ratio**2)
    exact = np.exp(-ratio / omega * (np.pi - np.arctan2(2 * ratio * omega, omega**2 - ratio**2)))
    sheet = Sheet(grid(1, 1, 0.02, 0.02), thickness=1e-3, panels="rigid").ground(damping_ratio=ratio, sink="1 um")
    model, parameters = sheet.build()
    start = State.at_rest(model, position=model.position + np.array([0, 0, 2e-3]))
    motion = simulate(model, parameters, duration=0.024, rate=10000, state=start)
    speed = motion.v[:, 0, 0, 2]
    assert speed.max() / -speed.min() == pytest.approx(exact, abs=0.02)


def test_it_is_lifted_until_it_just_touches():
    for sheet in (plate(), plate(panels="rigid")):
        sheet.feet([0], height="2 mm").ground(tilt="10 deg", azimuth="30 deg")
        model, parameters = sheet.build()
        assert gaps(model, parameters, model.position[:, None]).min() == pytest.approx(0.0, abs=1e-15)
        centre = np.array([parameters["body", f"centre_{a}"][0, 0] for a in "xyz"])
        own = np.unique(model.triangles[model.triangle_panel == 0])[:4]
        assert centre == pytest.approx(model.position[own].mean(axis=0), abs=1e-6)


def test_a_start_inside_the_ground_is_refused():
    with pytest.raises(InputError, match=r"starts 0\.5 mm inside the ground.*lift=True"):
        plate().ground(lift=False).build()
    sheet = plate().gravity().set("ground", stiffness=500.0)
    sheet.contact(0, (0, 0, 0), offset=-1.5e-3)
    sheet.set("ground", stiffness=500.0)
    with pytest.raises(InputError, match=r"starts 1\.5 mm inside the ground, which would throw it .* mm up.*contact 0"):
        simulate(*sheet.build(), duration=0.1)


def test_what_ends_below_the_ground_is_noted():
    sheet = Sheet(strip([0.02] * 3, 0.02), thickness=1e-3, triangulation="center", membrane=0.1)
    sheet.crease(stiffness=5e-5, loss_time=0.01).feet([0, 1, 6, 7], height="10 mm").ground(nodes=())
    motion = simulate(*sheet.build(), duration=0.5)
    assert heights(motion.parameters, motion.x[-1]).min() < -5e-3
    (note,) = motion.notes
    assert "below the ground" in note and "Sheet.ground()" in note


def test_feet_share_the_weight_and_grip_one_way():
    sheet = plate().feet([0, 2, 8], height="1 mm", friction=0.2, backward=0.6, mass="0.1 g").ground(friction=0.3)
    model, parameters = sheet.build()
    assert model.names["contact"][:3] == ("foot 1", "foot 2", "foot 3")
    whole = (MASS + 3e-4) * G / (SINK * 0.06)
    assert parameters["ground", "stiffness"][:3, 0] == pytest.approx([whole / 3] * 3, rel=1e-9)
    assert parameters["coulomb", "friction_coefficient"][:4, 0].tolist() == [0.2, 0.2, 0.2, 0.3]
    assert parameters["directional_friction", "backward_excess"][:4, 0] == pytest.approx([0.4, 0.4, 0.4, 0.0])
    assert model.contact_offsets[:3] == pytest.approx([-1.5e-3] * 3)
    assert parameters["inertia", "mass"].sum() == pytest.approx(MASS + 3e-4, rel=1e-9)


def test_feet_stand_under_a_patch_stated_later():
    sheet = plate().feet([(0.01, 0.01, 0.0)])
    sheet.patch(0, thickness="2 mm", side=-1).ground()
    model, _ = sheet.build()
    assert model.contact_offsets[0] == pytest.approx(-2.5e-3)
    corners = [k for k in range(len(model.contacts)) if model.name("contact", k) == "patch on panel 0"]
    assert model.contact_offsets[corners] == pytest.approx([-2.5e-3] * 4)


def test_drives_that_move_nothing_are_noted():
    drive = Drive(field=(0, 0, "50 mT"), voltage=["1 kV", "2 kV"], temperature=5.0, load=1.0)
    notes = simulate(*plate().build(), drive, duration=0.02).notes
    words = ("magnetic", "electrodes", "temperature", "load factor")
    assert [any(w in n for n in notes) for w in words] == [True] * 4
    wired = plate().patch(0, thickness=1e-3, poling=(1, 0, 0)).electrode([0], layers=2, notch="2 mm", group=1)
    notes = simulate(*wired.build(), Drive(field=(0, 0, 0.01), voltage=[100.0, 100.0]), duration=0.02).notes
    assert len(notes) == 1 and "voltage_0" in notes[0] and "group" in notes[0]


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda s: s.set("grond", stiffness=1.0), r"no such effect; 'ground' is near"),
        (lambda s: s.set("ground", stifness=1.0), r"no such parameter; 'stiffness' is near"),
        (lambda s: s.set("ground", stiffness="3 mm"), r"wrong unit.*N/m"),
        (lambda s: s.set("crease", [99], stiffness=1.0), r"no such crease.*99"),
        (lambda s: s.on("magnetic_torqe"), r"'magnetic_torque' is near"),
        (lambda s: s.feet([99]), r"no such node"),
        (lambda s: s.feet([(1.0, 1.0, 0.0)]), r"under no panel"),
        (lambda s: s.feet([0], friction=0.5, backward=0.2), r"larger backward"),
        (lambda s: s.feet([]), r"feet need places"),
        (lambda s: s.ground(friction=-1), r"positive"),
        (lambda s: s.ground(tilt="90 deg"), r"no wall"),
        (lambda s: s.ground(nodes=[99]), r"no such node"),
    ],
)
def test_what_is_wrong_is_said_at_once(state, said):
    with pytest.raises(InputError, match=said):
        state(plate())


def test_a_corner_of_several_triangles_stands_on_the_widest_whatever_rounding_says():
    """Mirrored corners of a strip stand on mirrored triangles: those that have most of the corner."""
    for scale in (1.0, 1.0 + 1e-15, 0.3, 7.7):
        s = Sheet(
            strip([0.003 * scale] * 5, [w * scale for w in (0.014, 0.012, 0.011, 0.009, 0.008, 0.007)]),
            thickness=1e-3,
            triangulation="diagonal",
        )
        x = s.mesh.vertices
        for cell in range(5):
            for node in (2 * cell, 2 * cell + 1, 2 * cell + 2, 2 * cell + 3):
                c = s._contacts[s.contact(cell, x[node])]
                nodes = s.mesh.triangles[c.triangle]
                assert node in nodes
                assert sum(n % 2 == node % 2 for n in nodes) == 2  # its own side of the strip, along which it lies


@pytest.mark.parametrize(("points", "error"), [(3, 0.035), (6, 0.02)])
def test_a_quadrature_lands_on_an_edge_as_a_continuous_ground_does(points, error):
    """A plate pressed in along one edge over 0.5 to 1.2 cells: wedges of area and of outline, in closed form."""
    length, width, tilt = 0.06, 0.04, 0.01

    def off(n, **options):
        """Largest error of the force, over the force."""
        model, parameters = plate(n, thickness=1e-6).ground(**options).build()
        stiffness, found = parameters["ground", "stiffness"][:, 0], []
        for deep in np.linspace(0.01, 0.024, 8):
            x = model.position.copy()
            x[:, 2] = (x[:, 0] - deep) * np.tan(tilt)
            force = stiffness @ np.maximum(-gaps(model, parameters, x[:, None])[:, 0], 0.0)
            wedge = 0.5 * deep**2 * np.tan(tilt)
            outline = (width * deep * np.tan(tilt) + 2 * wedge) / (2 * (length + width))
            found.append(force / (0.5 * stiffness.sum() * (wedge / length + outline)) - 1)
        return np.abs(found).max()

    assert off(1, points=points) < error
    assert off(2, points=points) < error / 2
    assert off(1) > 0.2  # at nodes


def test_points_over_an_underside_stand_for_its_area():
    sheet = plate(2)
    total, square = 0.06 * 0.04, 0.06 * 0.04**3 / 3
    for points in (1, 3, 6):
        index, area = sheet.underside(points=points, offset=-0.5e-3)
        model, _ = sheet.build()
        assert len(index) == points * len(model.triangles)
        y = (model.contact_weights[index, :, None] * model.position[model.contacts[index]]).sum(axis=1)[:, 1]
        assert area.sum() == pytest.approx(total)
        if points > 1:
            assert area @ y**2 == pytest.approx(square, rel=1e-9)
    assert np.all(model.contact_offsets == -0.5e-3)


def test_what_a_quadrature_or_a_pad_cannot_be_is_said():
    with pytest.raises(InputError, match="no such number of points to a triangle"):
        plate().ground(points=4)
    with pytest.raises(InputError, match="at nodes or between them"):
        plate().ground(points=3, nodes=[0])
    with pytest.raises(InputError, match="a pad has three nodes, not in one line"):
        plate().contact(0, (0, 0, 0), pad=(0, 1, 1))
    with pytest.raises(InputError, match="turns with its rigid panel"):
        plate(panels="rigid").contact(0, (0, 0, 0), pad=(0, 1, 4))
    with pytest.raises(InputError, match="lies outside its pad"):
        plate().contact(0, (0.03, 0.03, 0), pad=(0, 1, 4))
