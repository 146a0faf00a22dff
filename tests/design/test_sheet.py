"""The builder: masses, stiffnesses and contacts of a sheet against closed forms, and what it refuses."""

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.errors import InputError
from origami_sim.model import dihedral_angles
from origami_sim.pattern import Pattern, grid, strip
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import MATERIALS, layered_rigidity


def one_face(corners) -> Pattern:
    return assemble([(*c, 0.0) for c in corners], [tuple(range(len(corners)))])


def moments(sheet: Sheet) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass (2,) and second moments about it (2, 2) of the node masses."""
    model, parameters = sheet.build()
    m, x = parameters["inertia", "mass"][:, 0], model.position[:, :2]
    centre = m @ x / m.sum()
    d = x - centre
    return m.sum(), centre, (m[:, None, None] * d[:, :, None] * d[:, None, :]).sum(0)


# mass ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("u", "v"),
    [((0.03, 0.0), (0.0, 0.02)), ((0.03, 0.0), (0.01, 0.02)), ((0.02, 0.005), (-0.01, 0.04))],
    ids=["rectangle", "parallelogram", "turned"],
)
def test_centred_parallelograms_have_the_mass_centre_and_inertia_of_the_plate(u, v):
    u, v, origin = np.array(u), np.array(v), np.array([0.1, -0.05])
    corners = [origin, origin + u, origin + u + v, origin + v]
    sheet = Sheet(one_face(corners), thickness=1e-3, triangulation="center")
    mass, centre, second = moments(sheet)
    exact = MATERIALS["pdms"].density * 1e-3 * abs(u[0] * v[1] - u[1] * v[0])
    assert mass == pytest.approx(exact, rel=1e-12)
    np.testing.assert_allclose(centre, origin + 0.5 * (u + v), atol=1e-15)
    np.testing.assert_allclose(second, exact / 12 * (np.outer(u, u) + np.outer(v, v)), rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("triangulation", ["center", "diagonal"])
def test_triangles_have_the_mass_and_centre_of_the_plate(triangulation):
    corners = np.array([(0, 0), (0.03, 0.004), (0.01, 0.02)])
    mass, centre, _ = moments(Sheet(one_face(corners), thickness=2e-3, density=900.0, triangulation=triangulation))
    assert mass == pytest.approx(900 * 2e-3 * 0.5 * (0.03 * 0.02 - 0.004 * 0.01), rel=1e-12)
    np.testing.assert_allclose(centre, corners.mean(0), atol=1e-15)


def test_diagonal_split_keeps_mass_and_centre():
    mass, centre, _ = moments(Sheet(grid(3, 2, 0.01, 0.02), thickness=1e-3))
    assert mass == pytest.approx(1010 * 1e-3 * 0.03 * 0.04, rel=1e-12)
    np.testing.assert_allclose(centre, (0.015, 0.02), atol=1e-15)


def test_a_patch_adds_its_mass_centre_and_inertia():
    """Rectangular patch of 10 x 8 mm off the middle of a panel of 30 x 20 mm."""
    sheet = Sheet(one_face([(0, 0), (0.03, 0), (0.03, 0.02), (0, 0.02)]), thickness=1e-3, triangulation="center")
    size, at = np.array([0.01, 0.008]), np.array([0.018, 0.011])
    sheet.patch(0, thickness=2e-3, size=size, centre=(*at, 0), density=2000.0)
    mass, centre, second = moments(sheet)
    m1, m2, c1 = 1010 * 1e-3 * 0.03 * 0.02, 2000 * 2e-3 * size.prod(), np.array([0.015, 0.01])
    middle = (m1 * c1 + m2 * at) / (m1 + m2)
    plates = ((m1, c1, (0.03, 0.02)), (m2, at, size))
    exact = sum(m * (np.diag(np.square(s)) / 12 + np.outer(c - middle, c - middle)) for m, c, s in plates)
    assert mass == pytest.approx(m1 + m2, rel=1e-9)
    np.testing.assert_allclose(centre, middle, atol=1e-9)
    np.testing.assert_allclose(second, exact, rtol=0.02)  # five nodes cannot have all six moments


def test_weight_of_a_patch_sits_above_or_below_the_sheet():
    for side in (1, -1):
        sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3, triangulation="center").crease(stiffness=1e-3)
        sheet.patch(1, thickness=3e-3, density=2000.0, size=(0.02, 0.01), side=side).gravity()
        model, parameters = sheet.build()
        own = model.triangle_panel == 1
        mass, offset = (parameters["eccentric_weight", n][:, 0] for n in ("mass", "offset"))
        assert mass.sum() == pytest.approx(2000 * 3e-3 * 0.02 * 0.01, rel=1e-12)
        assert np.all(mass[~own] == 0)
        np.testing.assert_allclose(offset[own], side * 2e-3, rtol=1e-12)


def test_a_rigid_body_has_the_given_mass_centre_and_inertia():
    sheet = Sheet(strip([0.04, 0.17], 0.02), thickness=5e-3, triangulation="center").crease(stiffness=1e-3)
    sheet.body(1, mass=0.0938, centre=(0.04 + 0.1086, 0, 0), inertia=4.3753e-4, about=(0, 1, 0))
    model, parameters = sheet.build()
    before = Sheet(strip([0.04, 0.17], 0.02), thickness=5e-3, triangulation="center").crease(stiffness=1e-3).build()[1]
    own = np.unique(model.triangles[model.triangle_panel == 1])
    shared = np.intersect1d(own, np.unique(model.triangles[model.triangle_panel == 0]))
    m = parameters["inertia", "mass"][:, 0].copy()
    # what panel 0 gives to the nodes on the crease: a twelfth of its mass each, as for any rectangle
    m[shared] -= 1010 * 5e-3 * 0.04 * 0.02 / 12
    m, x = m[own], model.position[own, 0]
    assert m.sum() == pytest.approx(0.0938, rel=1e-6)
    centre = m @ x / m.sum()
    assert centre == pytest.approx(0.04 + 0.1086, rel=1e-6)
    assert m @ (x - centre) ** 2 == pytest.approx(4.3753e-4, rel=1e-6)
    assert before["inertia", "mass"].sum() != pytest.approx(parameters["inertia", "mass"].sum())


def test_a_rigid_body_beyond_its_panel_is_refused():
    sheet = Sheet(strip([0.04, 0.17], 0.02), thickness=5e-3, triangulation="center").crease(stiffness=1e-3)
    sheet.body(1, mass=0.1, centre=(0.5, 0, 0), inertia=1e-4, about=(0, 1, 0))
    with pytest.raises(InputError, match=r"no non-negative node masses.*panel 1.*within its panel"):
        sheet.build()


def test_point_masses_add():
    plain = Sheet(grid(1, 1, 0.01, 0.01), thickness=1e-3).build()[1]["inertia", "mass"].sum()
    loaded = Sheet(grid(1, 1, 0.01, 0.01), thickness=1e-3).mass([0, 0, 2], 1e-3).build()[1]["inertia", "mass"].sum()
    assert loaded - plain == pytest.approx(3e-3, rel=1e-9)


# membrane ----------------------------------------------------------------------------------------------------------


def equilateral(rows: int, columns: int, side: float) -> Pattern:
    """Grid of equilateral triangles; its inner edges are flat, part of one panel each."""
    height = side * np.sqrt(3) / 2
    vertices = [(side * (c + 0.5 * r), height * r, 0.0) for r in range(rows + 1) for c in range(columns + 1)]
    faces = []
    for r in range(rows):
        for c in range(columns):
            a = r * (columns + 1) + c
            b, d, e = a + 1, a + columns + 1, a + columns + 2
            faces += [(a, b, d), (b, e, d)]
    return flat(assemble(vertices, faces))


def flat(pattern: Pattern) -> Pattern:
    """The same with its inner edges flat: they bend, they do not fold."""
    pattern.assignments = ["B" if a == "B" else "F" for a in pattern.assignments]
    return pattern


def membrane_energy(sheet: Sheet, strain: np.ndarray) -> float:
    """Energy of the bars in a small uniform strain (2, 2) [J], to second order."""
    model, parameters = sheet.build()
    along = (model.position[model.bars[:, 1]] - model.position[model.bars[:, 0]])[:, :2]
    length = np.linalg.norm(along, axis=1)
    stretch = np.einsum("bi,ij,bj->b", along, strain, along) / length
    return 0.5 * float(parameters["bars", "stiffness"][:, 0] @ stretch**2)


@pytest.mark.parametrize("strain", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -0.4, 0.7)])
def test_equilateral_bars_are_plane_stress_with_a_third(strain):
    """U / area = E t / (2 (1 - nu^2)) (exx^2 + eyy^2 + 2 nu exx eyy + 2 (1 - nu) exy^2), nu = 1/3."""
    sheet = Sheet(equilateral(3, 4, 0.01), thickness=1e-3, modulus=2e6)
    exx, eyy, exy = 1e-3 * np.array(strain)
    nu = 1 / 3
    density = 0.5 * 2e6 * 1e-3 / (1 - nu**2) * (exx**2 + eyy**2 + 2 * nu * exx * eyy + 2 * (1 - nu) * exy**2)
    found = membrane_energy(sheet, np.array([[exx, exy], [exy, eyy]]))
    assert found == pytest.approx(density * sheet.area.sum(), rel=1e-9)


def test_any_mesh_is_exact_in_equal_biaxial_strain():
    """U / area = E t e^2 / (1 - nu)."""
    sheet = Sheet(strip([0.01, 0.023], [0.01, 0.02, 0.005]), thickness=1e-3, modulus=2e6).crease(stiffness=1e-3)
    assert membrane_energy(sheet, 1e-3 * np.eye(2)) == pytest.approx(
        2e6 * 1e-3 * 1e-6 * 1.5 * sheet.area.sum(), rel=1e-9
    )


def test_membrane_factor_and_patch_scale_the_bars():
    base = membrane_energy(Sheet(grid(1, 1, 0.01, 0.01), thickness=1e-3), np.eye(2))
    soft = membrane_energy(Sheet(grid(1, 1, 0.01, 0.01), thickness=1e-3, membrane=0.1), np.eye(2))
    assert soft == pytest.approx(0.1 * base, rel=1e-12)
    patched = membrane_energy(Sheet(grid(1, 1, 0.01, 0.01), thickness=1e-3).patch(0, thickness=2e-3), np.eye(2))
    assert patched == pytest.approx((1 + 2 * 0.78 / 1.5) * base, rel=1e-12)


# bending -----------------------------------------------------------------------------------------------------------


def bent_energies(sheet: Sheet, direction: float, curvature: float) -> tuple[np.ndarray, np.ndarray]:
    """Energy of each bend line on a cylinder [J], and the directions of the lines in the plane (2,)."""
    model, parameters = sheet.build()
    n, t = np.array([np.cos(direction), np.sin(direction)]), np.array([-np.sin(direction), np.cos(direction)])
    s, r = model.position[:, :2] @ n, model.position[:, :2] @ t
    x = np.outer(np.sin(curvature * s) / curvature, [*n, 0]) + np.outer(r, [*t, 0])
    x[:, 2] = (1 - np.cos(curvature * s)) / curvature
    angles = dihedral_angles(x, model.bends)
    lines = (model.position[model.bends[:, 2]] - model.position[model.bends[:, 1]])[:, :2]
    return 0.5 * parameters["panel_bending", "stiffness"][:, 0] * angles**2, lines


PLATE = 1.5e6 / (1 - 0.49**2) * 1e-3**3 / 12
"""E h^3 / 12 (1 - nu^2) of a millimetre of silicone [N m]."""


@pytest.mark.parametrize("side", [0.01, 0.005])
@pytest.mark.parametrize("degrees", [0, 13, 30, 47, 60, 90])
def test_equilateral_meshes_bend_like_the_plate_in_all_directions(side, degrees):
    """Energy of a cell (two triangles, three lines) against D kappa^2 / 2 per area; 0.99 to 1.02 by physics.md 3.2."""
    sheet = Sheet(equilateral(6, 6, side), thickness=1e-3)
    curvature = 0.5
    energies, lines = bent_energies(sheet, np.radians(degrees), curvature)
    family = np.round(np.degrees(np.arctan2(lines[:, 1], lines[:, 0])) % 180 / 60).astype(int) % 3
    cell = sum(energies[family == k].mean() for k in range(3))
    exact = 0.5 * PLATE * curvature**2 * 2 * sheet.area[0]
    assert cell / exact == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(("columns", "length"), [(4, 0.01), (8, 0.005), (16, 0.0025)])
def test_strips_bend_like_the_beam_however_they_are_cut(columns, length):
    """Along the edges of a rectangular mesh: (columns - 1) lines, each for a cell's length of D' w / l."""
    sheet = Sheet(flat(grid(columns, 1, length, 0.02)), thickness=1e-3)
    energies, _ = bent_energies(sheet, 0.0, 2.0)
    assert energies.sum() == pytest.approx(0.5 * PLATE * 4.0 * 0.02 * length * (columns - 1), rel=1e-3)


def test_rigidity_of_panels():
    sheet = Sheet(grid(2, 1, 0.01, 0.01), thickness=1e-3)
    assert sheet.rigidity(0) == pytest.approx(PLATE, rel=1e-12)
    sheet.patch(0, thickness=2e-3)
    layers = [(1e-3, 1.5e6 / (1 - 0.49**2)), (2e-3, 0.78e6 / (1 - 0.49**2))]
    assert sheet.rigidity(0) == pytest.approx(layered_rigidity(layers), rel=1e-12)
    sheet.panel(1, rigidity=0.5)
    assert sheet.rigidity(1) == 0.5


def test_layers_of_one_material_are_one_layer():
    assert layered_rigidity([(1e-3, 2e6), (2e-3, 2e6)]) == pytest.approx(2e6 * 3e-3**3 / 12, rel=1e-12)


# creases, magnets, contacts, names -----------------------------------------------------------------------------------


def test_crease_losses():
    """A loss time is c / K; a damping ratio is that of the lighter panel's swing."""
    sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3).crease(stiffness=2e-3, loss_time=0.003)
    assert sheet.build()[1]["crease_viscosity", "viscosity"][0, 0] == pytest.approx(6e-6)
    sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3).crease(stiffness=2e-3, damping_ratio=0.5)
    model, parameters = sheet.build()
    mass = parameters["inertia", "mass"][:, 0]
    i, _, _, far = model.creases[0]
    arms = [mass[n] * (model.position[n, 0] - 0.01) ** 2 for n in (i, far)]
    assert parameters["crease_viscosity", "viscosity"][0, 0] == pytest.approx(np.sqrt(2e-3 * min(arms)), rel=1e-12)


def test_the_magnet_is_spread_over_the_panel_and_keeps_its_direction():
    sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3, triangulation="center").crease(stiffness=1e-3)
    model, parameters = sheet.magnetise(1, remanence=0.1, volume=6e-7, poling=(3, 0, 4)).build()
    own = np.flatnonzero(model.triangle_panel == 1)
    values = {n: parameters["magnetic_torque", n][own, 0] for n in ("volume", "poling_1", "poling_2", "poling_n")}
    assert values["volume"].sum() == pytest.approx(6e-7, rel=1e-12)
    np.testing.assert_allclose(values["poling_n"], 0.8, rtol=1e-12)
    for n, t in enumerate(own):
        x1, x2, x3 = model.position[model.triangles[t]]
        along = values["poling_1"][n] * (x2 - x1) + values["poling_2"][n] * (x3 - x1)
        np.testing.assert_allclose(along, (1, 0, 0), atol=1e-12)


@pytest.mark.parametrize("triangulation", ["center", "diagonal"])
def test_contact_points_lie_where_they_were_put(triangulation):
    sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3, triangulation=triangulation).crease(stiffness=1e-3)
    point = np.array([0.023, -0.004, 0.0])
    assert sheet.contact(1, point, offset=-5e-4, axis=(1, 0.5, 0), name="foot") == 0
    assert sheet.contact(0, (0.0, 0.005, 0.0)) == 1
    model, _ = sheet.build()
    corners = model.position[model.contacts]
    np.testing.assert_allclose(np.einsum("k,kx->x", model.contact_weights[0], corners[0]), point, atol=1e-15)
    np.testing.assert_allclose(np.einsum("k,kx->x", model.contact_axes[0], corners[0]), (1, 0.5, 0), atol=1e-12)
    np.testing.assert_allclose(model.contact_weights.sum(1), 1, rtol=1e-12)
    np.testing.assert_allclose(model.contact_axes.sum(1), 0, atol=1e-12)
    assert model.contact_weights.min() > -1e-12
    assert model.contact_offsets.tolist() == [-5e-4, 0.0]
    assert model.names["contact"] == ("foot", "contact 1")


def test_supports_and_names():
    sheet = Sheet(strip([0.01, 0.02], 0.01), thickness=1e-3, triangulation="diagonal").crease(stiffness=1e-3)
    sheet.fix(panels=[0], axes="xz").fix(nodes=[5]).name("panel", ["base", "flap"]).name("crease", ["hinge"])
    model, _ = sheet.build()
    np.testing.assert_array_equal(model.free[:4], np.tile([0.0, 1.0, 0.0], (4, 1)))
    np.testing.assert_array_equal(model.free[4:], [[1, 1, 1], [0, 0, 0]])
    assert model.name("panel", 1) == "flap"
    assert model.name("crease", 0) == "hinge"
    assert model.name("node", 3) == "node 3"


def test_the_patterns_own_properties_win():
    pattern = strip([0.01, 0.02], 0.01)
    pattern.thickness[1], pattern.materials[1] = 4e-3, "mae"
    pattern.stiffness[:], pattern.rest_angles[:] = 7e-3, 0.25
    sheet = Sheet(pattern, thickness=1e-3).crease()
    np.testing.assert_allclose(sheet.thickness, [1e-3, 4e-3])
    np.testing.assert_allclose(sheet.density, [1010, 2800])
    parameters = sheet.build()[1]
    assert parameters["crease", "stiffness"][0, 0] == 7e-3
    assert parameters["crease", "rest_angle"][0, 0] == 0.25


# bad input -----------------------------------------------------------------------------------------------------


def sheet(**options) -> Sheet:
    return Sheet(strip([0.01, 0.02], 0.01), **{"thickness": 1e-3, **options})


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: sheet(thickness=-1e-3), r"must be positive.*thickness.*-0\.001.*> 0"),
        (lambda: sheet(thickness=float("nan")), r"must be positive.*thickness"),
        (lambda: sheet(modulus=0.0), r"must be positive.*modulus"),
        (lambda: sheet(density=-1.0), r"must be positive.*density"),
        (lambda: sheet(membrane=0.0), r"must be positive.*membrane"),
        (lambda: sheet(membrane_damping=-0.1), r"cannot be negative.*membrane_damping"),
        (lambda: sheet(material="steel"), r"unknown material.*panel 0.*steel.*pdms, mae"),
        (lambda: sheet(triangulation="fan"), r"unknown triangulation.*fan.*auto, diagonal, center"),
        (lambda: sheet().crease().build(), r"a crease has no stiffness.*crease 0.*stiffness="),
        (lambda: sheet().crease(stiffness=-1.0), r"crease stiffness cannot be negative.*-1\.0"),
        (lambda: sheet().crease(stiffness=float("nan")), r"crease stiffness cannot be negative"),
        (lambda: sheet().crease(stiffness=1.0, loss_time=-1.0), r"loss cannot be negative.*loss_time"),
        (lambda: sheet().crease([3], stiffness=1.0), r"no such crease.*3.*0 to 0"),
        (lambda: sheet().panel(5, rigidity=1.0), r"no such panel.*5.*0 to 1"),
        (lambda: sheet().panel(1, rigidity=0.0), r"rigidity must be positive"),
        (lambda: sheet().patch(2, thickness=1e-3), r"no such panel.*2.*0 to 1"),
        (lambda: sheet().patch(0, thickness=-1e-3), r"patch needs positive.*panel 0"),
        (lambda: sheet().patch(0, thickness=1e-3, size=(0.01, 0.0)), r"patch needs positive"),
        (
            lambda: sheet().patch(0, thickness="1 mm", size=("50 mm", "5 mm")),
            r"no larger than its panel \(field 'size of the patch on panel 0', value \[0.05, 0.005\]\); allowed: up",
        ),
        (lambda: sheet().gravity(9.81), r"gravity is a vector \(field 'acceleration', value 9.81\); allowed: x, y, z"),
        (lambda: sheet().gravity((0, 0)), r"gravity is a vector.*\(0, 0\)"),
        (lambda: sheet().crease(stifness=1), r"Sheet.crease has no such argument; 'stiffness' is near.*rest_angle"),
        (lambda: sheet().patch(0), r"Sheet.patch cannot be stated so.*'thickness'"),
        (lambda: sheet().patch(0, thickness=1e-3, density=0.0), r"patch needs positive"),
        (lambda: sheet().patch(0, thickness=1e-3, side=2), r"one side.*2.*top"),
        (lambda: sheet().patch(0, thickness=1e-3, material="iron"), r"unknown material.*iron"),
        (lambda: sheet().magnetise(0, remanence=0.1, volume=1e-7, poling=(0, 0, 0)), r"poling direction"),
        (lambda: sheet().magnetise(9, remanence=0.1, volume=1e-7, poling=(1, 0, 0)), r"no such panel"),
        (lambda: sheet().magnetise(0, remanence=0.1, volume=-1e-7, poling=(1, 0, 0)).crease(stiffness=1).build(),
         r"out of bounds.*magnetic_torque\.volume"),
        (lambda: sheet().contact(1, (0.5, 0, 0)), r"outside its panel.*panel 1.*0\.5"),
        (lambda: sheet().contact(1, (float("nan"), 0, 0)), r"outside its panel"),
        (lambda: sheet().contact(-1, (0, 0, 0)), r"no such panel.*-1"),
        (lambda: sheet().body(1, mass=0.0, centre=(0, 0, 0), inertia=1e-4, about="crease"), r"positive mass"),
        (lambda: sheet().body(1, mass=1.0, centre=(0, 0, 0), inertia=-1e-4, about="crease"), r"positive.*inertia"),
        (lambda: sheet().body(4, mass=1.0, centre=(0, 0, 0), inertia=1e-4, about="crease"), r"no such panel"),
        (lambda: sheet().body(1, mass=1.0, centre=(0, 0, 0), inertia=1e-4), r"needs an axis.*panel 1\.about"),
        (lambda: sheet().body(1, mass=1.0, centre=(0, 0, 0), inertia=1e-4, about=(0, 0, 0)), r"axis is a direction"),
        (lambda: sheet().body(1, mass=1.0, centre=(0, 0, 0), inertia=(1, 1, 1), about="crease"), r"tensor has no axis"),
        (lambda: sheet().body(1, mass=1.0, centre=(1, 0, 0), inertia=(1, 1, 1), through=(0, 0, 9)), r"from through="),
        (lambda: sheet().body(1, mass=1.0, centre=(0, 0, 0), inertia=1.0, about="hip").crease(stiffness=1.0).build(),
         r"has no such crease.*panel 1\.about.*hip.*0"),
        (lambda: sheet().body(1, mass=1.0, centre=(3, 0, 0), inertia=1.0, about=0).crease(stiffness=1.0).build(),
         r"no body has this inertia.*panel 1\.inertia.*distance of its centre"),
        (lambda: sheet().point_mass(1, 1e-3, (0.5, 0, 0)), r"outside its panel.*panel 1.*rigid"),
        (lambda: sheet().point_mass(1, -1e-3, (0.01, 0, 0)), r"point mass is positive.*panel 1"),
        (lambda: sheet().mass(0, -1.0), r"mass cannot be negative"),
        (lambda: sheet().mass(99, 1.0), r"no such node.*99.*0 to 7"),
        (lambda: sheet().fix(nodes=[77]), r"no such node.*77"),
        (lambda: sheet().fix(panels=[7]), r"no such panel.*7"),
        (lambda: sheet().fix(panels=[0], axes="q"), r"no such axis.*q.*x, y, z"),
        (lambda: sheet().electrode([4], layers=6, notch=1e-3), r"no such crease.*4"),
        (lambda: sheet().name("hinge", ["a"]), r"no such family.*hinge.*panel, crease, node"),
        (lambda: sheet().name("panel", ["a"]), r"wrong number of labels.*panel.*1.*2"),
        (lambda: sheet().on("telekinesis"), r"no such effect.*telekinesis"),
        (lambda: sheet().set("ground", stiffnes=1.0).crease(stiffness=1.0).build(), r"no such parameter.*stiffnes"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(build, words):
    with pytest.raises(InputError, match=words) as e:
        build()
    assert "\n" not in str(e.value)
