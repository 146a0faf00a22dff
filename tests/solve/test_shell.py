"""Sheets as shells against plates, membranes and the elastica: what any mesh has to converge to."""

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from effects.kit import random_rotation
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from solve.sheets import KINDS, at, border, disc, joined, mesh, plate, rimmed, rimmed_end, tributary

from origami_sim import (
    Drive,
    InputError,
    Sheet,
    State,
    equilibrium,
    grid,
    isotropic,
    orthotropic,
    rigid,
    sheet,
    simulate,
    stable_step,
    uncreased,
)
from origami_sim.model import dihedral_angles
from origami_sim.model.curvature import curvature
from origami_sim.physics.materials import material
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics.equilibria import tangent

SUPPORTED = 0.0040623527
"""Deflection of the middle of a simply supported square plate, in q a^4 / D (Navier's series)."""

CLAMPED = 0.0012653191
"""The same of a clamped one (Taylor & Govindjee 2004, Commun. Numer. Meth. Eng. 20, 757)."""

E, THICKNESS = 1e9, 1e-3


def deflections(model, parameters, force):
    """Small deflections [N] of a flat sheet under forces along z [N]."""
    k = tangent(model, parameters, Drive(load=1.0)).tocsc()
    free = 3 * np.flatnonzero(model.free[:, 2]) + 2
    w = np.zeros(model.position.size)
    w[free] = spla.spsolve(k[free][:, free], np.repeat(force, 3)[free])
    return w[2::3]


def plate_error(kind, n, case, poisson):
    """Relative error of the middle's deflection under a pressure."""
    x, triangles = mesh(kind, n) if case == "supported" else rimmed(kind, n)
    axes = "z" if case == "supported" else "xyz"
    model, parameters = plate(x, triangles, held=border(x), axes=axes, poisson=poisson)
    w = deflections(model, parameters, tributary(x, triangles))
    exact = (SUPPORTED if case == "supported" else CLAMPED) * 12 * (1 - poisson**2) / (E * THICKNESS**3)
    return at(x, w, [0.5, 0.5]) / exact - 1


@pytest.mark.parametrize("case", ["supported", "clamped"])
@pytest.mark.parametrize("kind", KINDS)
def test_plates_of_sixteen_cells_are_right_to_two_percent(kind, case):
    for poisson in (0.0, 0.3, 0.49):
        assert abs(plate_error(kind, 16, case, poisson)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("case", ["supported", "clamped"])
@pytest.mark.parametrize("kind", KINDS)
def test_plates_converge(kind, case):
    """Largest error over Poisson's ratios, so that no zero between two meshes is taken for convergence."""
    coarse, fine = (max(abs(plate_error(kind, n, case, nu)) for nu in (0.0, 0.3, 0.49)) for n in (16, 32))
    assert np.log2(coarse / fine) > 1.5


@pytest.mark.parametrize(("case", "limit"), [("supported", 0.006), ("clamped", 0.03)])
def test_a_round_plate_bends_as_its_closed_form_says(case, limit):
    """Middle of a disc under a pressure (Timoshenko & Woinowsky-Krieger 1959, art. 16), on rings of triangles.

    Its border is a polygon whose nodes alone are held, so that no paradox of polygons stiffens it (Babuska).
    """
    for poisson in (0.0, 0.49):
        errors = []
        for rings in (4, 8):
            x, triangles = disc(rings + (case == "clamped"))
            x *= (rings + (case == "clamped")) / rings
            held = np.flatnonzero(np.linalg.norm(x, axis=1) > 1 - 1e-9)
            model, parameters = plate(
                x, triangles, held=held, axes="z" if case == "supported" else "xyz", poisson=poisson
            )
            w = deflections(model, parameters, tributary(x, triangles))[0]
            softer = (5 + poisson) / (1 + poisson) if case == "supported" else 1.0
            errors.append(w * 64 * E * THICKNESS**3 / (12 * (1 - poisson**2)) / softer - 1)
        assert abs(errors[1]) < limit
        assert abs(errors[1]) < max(0.36 * abs(errors[0]), 0.005)


@pytest.mark.parametrize("kind", KINDS)
def test_constant_curvature_is_found_exactly_and_needs_no_force_inside(kind):
    """The patch test of bending, with the sheet anywhere in space: hinge angles of a paraboloid, small.

    Moments that the paraboloid needs are missing at the border, which is felt three rings of triangles deep.
    """
    x, triangles = mesh(kind, 10)
    model, parameters = plate(x, triangles, poisson=0.3)
    found = curvature(x, triangles, model.bends, model.free)
    inside = np.all((x[:, :2] > 0.35) & (x[:, :2] < 0.65), axis=1)
    for k in ((1.0, -0.3, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0)):
        bent = x.copy()
        bent[:, 2] = 1e-6 * (k[0] * x[:, 0] ** 2 + k[1] * x[:, 1] ** 2 + k[2] * x[:, 0] * x[:, 1]) / 2
        rows = 1e6 * found.of(dihedral_angles(bent, model.bends))
        inner = np.flatnonzero(~np.any(found.loose[found.triangle], axis=1))
        whole = inner[found.whole[inner] == 1]
        assert rows[whole] == pytest.approx(np.tile(k, (len(whole), 1)), abs=1e-7)
        r = random_rotation(np.random.default_rng(3))
        state = Batch(model, parameters, Drive(), State.at_rest(model, 1, bent @ r.T)).evaluate(0.0)
        force = np.linalg.norm(state.forces["shell_bending"][:, 0], axis=1)
        assert force[inside].max() < 1e-6 * force.max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_membrane_stretches_and_shears_exactly(kind):
    """The patch test of the membrane at large strain: uniform Green strain, forces on the border only."""
    x, triangles = mesh(kind, 6)
    model, parameters = plate(x, triangles, poisson=0.3)
    f = np.array([[1.2, 0.3, 0.0], [0.1, 0.9, 0.0], [0.0, 0.0, 1.0]])
    r = random_rotation(np.random.default_rng(1))
    report = Batch(model, parameters, Drive(), State.at_rest(model, 1, x @ f.T @ r.T)).evaluate(0.0)
    force = np.linalg.norm(report.forces["shell_membrane"][:, 0], axis=1)
    inside = np.setdiff1d(np.arange(len(x)), border(x))
    assert force[inside].max() < 1e-12 * force.max()
    strain = 0.5 * (f[:2, :2].T @ f[:2, :2] - np.eye(2))
    e = np.array([strain[0, 0], strain[1, 1], 2 * strain[0, 1]])
    density = 0.5 * e @ (isotropic(E, 0.3) * THICKNESS) @ e
    assert report.energies["shell_membrane"][0] == pytest.approx(density, rel=1e-12)


@pytest.mark.parametrize(("kind", "cells"), [("diagonal", 40), ("crossed", 16), ("random", 16)])
def test_an_elastica_is_right_to_two_per_mille(kind, cells):
    """A cantilever strip under a dead load across its end that bends it by 60 degrees, thickness/length 1e-3.

    Flat triangles that did not know of their bow would be 4.5 % too stiff on the crossed mesh (membrane locking).
    """
    load, rows = 3.0, 2 if cells == 40 else 4
    width = rows / cells
    x, triangles = rimmed_end(kind, cells, rows, width)
    model, parameters = plate(x, triangles, held=np.flatnonzero(x[:, 0] < 1e-9), poisson=0.0)
    end = np.flatnonzero(x[:, 0] > 1 - 1e-9)
    share = np.where((x[end, 1] < 1e-9) | (x[end, 1] > width - 1e-9), 0.5, 1.0) / rows
    parameters.set("load", "force_z", share * load * E * THICKNESS**3 / 12 * width, end)
    state = None
    for part in np.linspace(0.2, 1.0, 5):
        found = equilibrium(model, parameters, Drive(load=float(part)), state=state, tolerance=1e-8)
        assert found.converged, found.message
        state = found.state
    tip = share @ found.x[end]
    assert [tip[0], tip[2]] == pytest.approx(elastica(load), abs=0.002)


def elastica(load):
    """Place of the end of a cantilever of unit length and rigidity under a dead load across it (shooting)."""

    def run(bend):
        return solve_ivp(
            lambda s, y: [y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])],
            (0, 1),
            [0.0, bend, 0.0, 0.0],
            rtol=1e-11,
            atol=1e-12,
        ).y[:, -1]

    return run(brentq(lambda b: run(b)[1], 0.0, load))[2:]


@pytest.mark.parametrize("angle", [0.0, np.pi / 4, 1.2])
def test_a_bent_strip_curves_across_as_its_material_does(angle):
    """Anticlastic: pure bending of a strip with free sides, cut from paper at an angle, on a random mesh.

    Its curvature D^-1 (1, 0, 0) is constant, so it needs no force but at the ends.
    """
    x, triangles = mesh("random", 16, 6, size=(1.0, 0.4))
    elasticity = orthotropic(E, 0.5 * E, 0.4, 0.2 * E)
    model, parameters = plate(x, triangles, elasticity=elasticity, axis=(np.cos(angle), np.sin(angle), 0))
    c, s = np.cos(angle), np.sin(angle)
    strains = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    k = np.linalg.solve(strains.T @ elasticity @ strains, [1.0, 0.0, 0.0])
    k /= np.abs(k).max()
    w = 1e-6 * (k[0] * x[:, 0] ** 2 + k[1] * x[:, 1] ** 2 + k[2] * x[:, 0] * x[:, 1]) / 2
    bent = x + np.column_stack([np.zeros_like(x[:, :2]), w])
    force = Batch(model, parameters, Drive(), State.at_rest(model, 1, bent)).evaluate(0.0).forces["shell_bending"][:, 0]
    inside = (x[:, 0] > 0.25) & (x[:, 0] < 0.75)
    assert np.abs(force[inside]).max() < 1e-6 * np.abs(force).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("poisson", [0.0, 0.49])
def test_a_square_sheet_is_twisted_into_a_saddle(kind, poisson):
    """Held at three corners and pushed at the fourth it becomes w = x y P / (2 D (1 - nu)), exactly."""
    x, triangles = mesh(kind, 8)
    corners = [int(np.argmin(((x[:, :2] - c) ** 2).sum(axis=1))) for c in ((0, 0), (1, 0), (0, 1), (1, 1))]
    model, parameters = plate(x, triangles, held=corners[:3], axes="z", poisson=poisson)
    force = np.zeros(len(x))
    force[corners[3]] = 1e-6
    rigidity = E * THICKNESS**3 / (12 * (1 - poisson**2))
    expected = x[:, 0] * x[:, 1] * 1e-6 / (2 * rigidity * (1 - poisson))
    assert deflections(model, parameters, force) == pytest.approx(expected, abs=1e-6 * expected.max())


@pytest.mark.parametrize("poisson", [0.0, 0.49])
@pytest.mark.parametrize("kind", KINDS)
def test_a_membrane_converges(kind, poisson):
    """Plane stress under a body force made for u = sin(pi x) sin(pi y) (1, 0): order 2, below 2 % at 16 cells."""
    errors = []
    for n in (8, 16):
        x, triangles = mesh(kind, n)
        model, parameters = plate(x, triangles, held=border(x), poisson=poisson)
        sx, sy, cx, cy = (f(np.pi * x[:, a]) for f in (np.sin, np.cos) for a in (0, 1))
        stiffness = E * THICKNESS / (1 - poisson**2)
        along, across = (1 + (1 - poisson) / 2) * sx * sy, -(1 + poisson) / 2 * cx * cy
        body = stiffness * np.pi**2 * np.stack([along, across], axis=1)
        k = tangent(model, parameters).tocsc()
        free = np.flatnonzero(model.free.ravel() * np.tile([1, 1, 0], len(x)))
        force = np.zeros(x.shape)
        force[:, :2] = body * tributary(x, triangles)[:, None]
        u = np.zeros(x.size)
        u[free] = spla.spsolve(k[free][:, free], force.ravel()[free])
        errors.append(np.abs(u.reshape(-1, 3)[:, 0] - sx * sy).max())
    assert errors[1] < 0.02
    assert np.log2(errors[0] / errors[1]) > 1.5


def test_a_shell_keeps_its_energy_while_it_swings():
    """A square sheet let go from a twisted shape; the range of the balance falls with the square of the step."""
    pattern = uncreased(grid(4, 4, 0.025, 0.025))
    sheet = Sheet(pattern, thickness=1e-3, modulus=1e6, density=1000.0, membrane_damping=0.0).shell(poisson=0.4)
    model, parameters = sheet.fix(nodes=[0, 1, 5]).build()
    x = model.position.copy()
    x[:, 2] = 1.0 * x[:, 0] * x[:, 1] * (x[:, 0] > 0.03)
    step = stable_step(model, parameters)
    ranges = []
    for part in (1.0, 0.5, 0.25):
        state = State.at_rest(model, 1, x)
        motion = simulate(model, parameters, duration=0.05, rate=200.0, state=state, dt=part * step.dt)
        assert not motion.failures
        ranges.append(np.ptp(motion.energy_balance()))
    assert ranges[0] < 0.1 * max(e.max() for e in motion.energies.values())
    assert ranges[2] < 0.35 * ranges[1] < 0.15 * ranges[0]


def halves(kind, n):
    """Two unit squares side by side, the second to be the stiffer: nodes, triangles, and which these are."""
    x, triangles = mesh(kind, n)
    x, triangles = joined((x, triangles), (x + np.array([1.0, 0.0, 0.0]), triangles))
    return x, triangles, x[triangles].mean(axis=1)[:, 0] > 1


@pytest.mark.parametrize("kind", KINDS)
def test_curvature_jumps_where_the_rigidity_does_so_that_the_moment_does_not(kind):
    """The patch test of two materials: moments across their line and curvatures along it are those of both sides."""
    x, triangles, stiffer = halves(kind, 8)
    model = plate(x, triangles)[0]
    stiffness = np.where(stiffer[:, None, None], 20.0 * isotropic(1.0, 0.2), isotropic(1.0, 0.4))
    plates = stiffness[:, [0, 1, 0, 2, 0, 1], [0, 1, 1, 2, 2, 2]]
    found = curvature(x, triangles, model.bends, model.free, plates)
    inside = np.all((x[triangles].mean(axis=1)[:, :2] > 0.4) & (x[triangles].mean(axis=1)[:, :2] < [1.6, 0.6]), axis=1)
    for xx, yy, xy in ((1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (0.0, 0.0, 2.0), (-0.5, 1.0, 1.0)):
        beyond = ((xx + 0.4 * yy) / (1 - 0.4**2) / (20.0 / (1 - 0.2**2))) - 0.2 * yy  # D_1 (xx + nu_1 yy) = D_2 (...)
        u, v = x[:, 0] - 1, x[:, 1]
        bent = x.copy()
        bent[:, 2] = 1e-6 * (np.where(u > 0, beyond, xx) * u**2 + yy * v**2 + xy * u * v) / 2
        rows = 1e6 * found.of(dihedral_angles(bent, model.bends))
        whole = np.flatnonzero(inside[found.triangle] & (found.whole == 1))
        expected = np.where(stiffer[found.triangle[whole], None], [beyond, yy, xy], [xx, yy, xy])
        assert rows[whole] == pytest.approx(expected, abs=1e-6)
        between = np.flatnonzero(inside[found.triangle] & (found.whole == 0))
        assert len(between) and rows[between] == pytest.approx(np.zeros((len(between), 3)), abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_strip_of_two_rigidities_bends_as_a_beam_of_both(kind):
    """Clamped where it is thin, with a load at its stiff end.

    If both sides of the line between took half of its turn, the meshes would be 5 to 7 % and 2 to 4 % too stiff.
    """
    errors = []
    for n in (4, 8):
        x, triangles = rimmed_end(kind, n, n, 0.5)
        more, beyond = mesh(kind, n, size=(1.0, 0.5))
        x, triangles = joined((x, triangles), (more + np.array([1.0, 0.0, 0.0]), beyond))
        sheet_of = Sheet(sheet(x, triangles), thickness=THICKNESS, modulus=E, density=1000.0)
        stiff = np.flatnonzero(x[triangles].mean(axis=1)[:, 0] > 1)
        sheet_of.panel(stiff, rigidity=20 * E * THICKNESS**3 / 12).shell(poisson=0.0).on("load")
        model, parameters = sheet_of.fix(nodes=np.flatnonzero(x[:, 0] < 1e-9)).build()
        end = np.flatnonzero(x[:, 0] > 2 - 1e-9)
        force = np.zeros(len(x))
        force[end] = np.where((x[end, 1] < 1e-9) | (x[end, 1] > 0.5 - 1e-9), 0.5, 1.0) / n
        w = deflections(model, parameters, force)
        exact = (7 / 3 + 1 / 60) / (E * THICKNESS**3 / 12 * 0.5)  # integral of (2 - x)^2 / D
        errors.append(w[end] @ force[end] / exact - 1)
    assert abs(errors[1]) < 0.001
    assert abs(errors[1]) < 0.4 * abs(errors[0])


def test_a_lone_triangle_bends_without_any_moment():
    """Nothing but rounding is left of its stiffness: none of it may be negative."""
    far = [(0, 0, 0), (20, 0, 0), (20, 20, 0), (5, 30, 0), (30, 30, 0), (30, 50, 0)]
    parameters = Sheet(sheet(np.array(far) * 1e-3, [(0, 1, 2), (3, 4, 5)]), thickness=1e-3).shell().build()[1]
    assert not any(np.any(parameters["shell_bending", f"stiffness_{c}"]) for c in ("11", "22", "12", "66", "16", "26"))


def test_what_no_sheet_can_be_is_refused():
    pattern = uncreased(grid(2, 2, 0.01, 0.01))
    sheet = Sheet(pattern, thickness=1e-3)
    with pytest.raises(InputError, match="positive eigenvalues"):
        sheet.shell(elasticity=np.diag([1.0, -1.0, 1.0]))
    with pytest.raises(InputError, match="Poisson"):
        sheet.shell(poisson=1.2)
    with pytest.raises(InputError, match="direction"):
        sheet.shell(axis=(0, 0, 0))
    with pytest.raises(InputError, match="upright"):
        sheet.shell(elasticity=orthotropic(1e9, 1e9, 0.3, 1e9), axis=(0, 0, 1)).build()
    with pytest.raises(InputError, match="poisson_12"):
        orthotropic(1e9, 4e9, 0.6, 1e9)
    with pytest.raises(InputError, match="neither bend nor stretch"):
        Sheet(pattern, thickness=1e-3, panels="rigid").shell()
    with pytest.raises(InputError, match="neither bend nor stretch"):
        rigid(*sheet.shell().build())


@pytest.mark.parametrize("kind", ["diagonal", "crossed", "random"])
def test_a_curved_sheet_is_right_to_two_per_mille(kind):
    """A quarter of a cylinder clamped at its lower end, pushed at its upper one: pi P R^3 / (4 E I)."""
    width, rows, thickness = 0.4, 4, 1e-2
    x, triangles = rimmed_end(kind, 16, rows, width)
    s = x[:, 0] * np.pi / 2
    arch = np.column_stack([np.sin(s), x[:, 1], 1 - np.cos(s)])
    before = x[:, 0] < 0
    arch[before] = np.column_stack([s, x[:, 1], 0 * s])[before]
    r = random_rotation(np.random.default_rng(2))
    held, end = np.flatnonzero(x[:, 0] < 1e-9), np.flatnonzero(x[:, 0] > 1 - 1e-9)
    model, parameters = plate(arch @ r.T, triangles, held=held, poisson=0.0, thickness=thickness, modulus=E)
    share = np.where((x[end, 1] < 1e-9) | (x[end, 1] > width - 1e-9), 0.5, 1.0) / rows
    force = 1e-6 * E * thickness**3 * width
    for axis, part in zip("xyz", force * r[:, 0], strict=True):
        parameters.set("load", f"force_{axis}", share * part, end)
    found = equilibrium(model, parameters, Drive(load=1.0), tolerance=1e-9)
    moved = share @ ((found.x - model.position) @ r)[end]
    assert moved[0] == pytest.approx(np.pi * force / (4 * E * thickness**3 / 12 * width), rel=2e-3)


@pytest.mark.parametrize("kind", ["diagonal", "crossed", "random"])
def test_a_sheet_with_natural_curvature_rolls_up(kind):
    """Into an arc of 86 degrees, without stress: its end lies on the circle."""
    bend, width, rows = 1.5, 0.25, 4
    x, triangles = rimmed_end(kind, 16, rows, width)
    model, parameters = plate(x, triangles, held=np.flatnonzero(x[:, 0] < 1e-9), poisson=0.0)
    end, state = np.flatnonzero(x[:, 0] > 1 - 1e-9), None
    for part in np.linspace(0.25, 1.0, 4):
        parameters.set("shell_bending", "natural_11", part * bend)
        found = equilibrium(model, parameters, Drive(), state=state, tolerance=1e-8)
        state = found.state
    assert found.converged, found.message
    tip = found.x[end].mean(axis=0)
    assert [tip[0], tip[2]] == pytest.approx([np.sin(bend) / bend, (1 - np.cos(bend)) / bend], abs=0.002)


def test_a_natural_twist_is_the_saddle_with_that_mixed_derivative():
    """w = k x y has the twist d2w / dx dy = k: with natural_12 = k it lies there without any force."""
    x, triangles = mesh("crossed", 4)
    model, parameters = plate(x, triangles, poisson=0.3)
    bent = x + np.column_stack([0 * x[:, :2], 1e-6 * x[:, 0] * x[:, 1]])

    def force(k):
        parameters.set("shell_bending", "natural_12", k)
        report = Batch(model, parameters, Drive(), State.at_rest(model, 1, bent)).evaluate(0.0)
        return np.abs(report.forces["shell_bending"]).max()

    assert force(1e-6) < 1e-5 * force(0.0)


def test_a_patch_stretches_beside_the_sheet_it_is_bonded_to():
    s = Sheet(uncreased(grid(2, 1, 0.01, 0.01)), thickness=1e-3, modulus=2e6, material="pdms")
    s.patch(1, thickness=0.5e-3, material="mae").shell(poisson=0.3)
    model, parameters = s.build()
    of = [parameters["shell_membrane", "stiffness_11"][model.triangle_panel == p, 0] for p in (0, 1)]
    mae = material("mae")
    bare = 2e6 * 1e-3 / (1 - 0.3**2)
    assert of[0] == pytest.approx(bare)
    assert of[1] == pytest.approx(bare + mae.modulus * 0.5e-3 / (1 - mae.poisson**2))


def test_a_crease_in_a_shell_is_a_hinge_between_beams():
    """A strip with a soft crease across its middle, under a load at its end: P L^3 / (3 E I) + P (L / 2)^2 / K.

    The sheet's own turn beside the crease is left out, half a cell on each side: at most P h / (4 E I).
    """
    cells, width, load = 16, 0.125, 1e-9
    pattern = uncreased(grid(cells + 2, 2, 1 / cells, width / 2))
    middle = (cells // 2 + 2) / cells
    x = pattern.vertices[pattern.edges]
    across = np.flatnonzero(np.all(np.isclose(x[:, :, 0], middle), axis=1))
    for e in across:
        pattern.assignments[e] = "V"
    s = Sheet(pattern, thickness=THICKNESS, modulus=E, density=1000.0, membrane_damping=0.0).shell(poisson=0.0)
    rigidity = E * THICKNESS**3 / 12 * width
    s.crease(stiffness=0.5 * rigidity, rest_angle=0.0).on("load")
    start = 2 / cells
    model, parameters = s.fix(nodes=np.flatnonzero(pattern.vertices[:, 0] < start + 1e-9)).build()
    end = np.flatnonzero(model.position[:, 0] > start + 1 - 1e-9)
    force = np.zeros(len(model.position))
    force[end] = load * np.array([0.25, 0.5, 0.25])
    w = deflections(model, parameters, force)
    expected = load / (3 * rigidity) + load * 0.25 / (len(across) * 0.5 * rigidity)
    found = w[end] @ np.array([0.25, 0.5, 0.25])
    assert expected - load / cells / (4 * rigidity) <= found <= expected


def test_the_gpu_finds_the_forces_of_the_cpu(cuda):
    x, triangles = mesh("random", 6)
    model, parameters = plate(x, triangles, poisson=0.3)
    rng = np.random.default_rng(0)
    worlds = x[:, None] + 0.02 * rng.normal(size=(len(x), 70, 3))
    one, two = (Batch(model, parameters, Drive(), State.at_rest(model, 70, worlds), device=d) for d in ("cpu", cuda))
    expected, found = one.evaluate(0.0), two.evaluate(0.0)
    for name, force in expected.forces.items():
        assert np.abs(found.forces[name] - force).max() <= 1e-11 * np.abs(force).max()
    assert np.abs(two.total_force(0.0) - one.total_force(0.0)).max() <= 1e-11 * np.abs(one.total_force(0.0)).max()


@pytest.mark.parametrize("angle", [0.0, np.pi / 4, 1.2])
def test_a_pulled_strip_stretches_as_its_material_does(angle):
    """Tension along a strip cut from paper at an angle, on a random mesh: it contracts and shears by Hooke's law.

    The stress is uniaxial, so that its free sides need no force, and its ends one of h b for a unit stress.
    """
    x, triangles = mesh("random", 16, 6, size=(1.0, 0.4))
    e1, e2, nu, g = E, 0.4 * E, 0.3, 0.17 * E
    first, second = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    model, parameters = plate(x, triangles, elasticity=orthotropic(e1, e2, nu, g), axis=(*first, 0))
    s1, s2, s12 = first[0] ** 2, second[0] ** 2, first[0] * second[0]
    shear = s12 / (2 * g) * (np.outer(first, second) + np.outer(second, first))
    strain = (s1 / e1 - nu * s2 / e1) * np.outer(first, first) + (s2 / e2 - nu * s1 / e1) * np.outer(second, second)
    moved = x.copy()
    moved[:, :2] += 1e-3 * E * x[:, :2] @ (strain + shear)
    report = Batch(model, parameters, Drive(), State.at_rest(model, 1, moved)).evaluate(0.0)
    force = report.forces["shell_membrane"][:, 0] / (1e-3 * E)
    end = x[:, 0] > 1 - 1e-9
    beside = (x[:, 0] > 1e-9) & ~end
    assert force[end].sum(axis=0) == pytest.approx([-THICKNESS * 0.4, 0.0, 0.0], rel=0.01, abs=4e-6)
    assert np.abs(force[beside]).max() < 0.01 * np.abs(force).max()
