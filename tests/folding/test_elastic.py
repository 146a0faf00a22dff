"""The energy of a folded sheet: its Jacobian, its stops, and that it is that of the catalogue's effects."""

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.folding import fold
from origami_sim.folding.elastic import Elastic, angle_gradients, bar_sections
from origami_sim.folding.motion import model_of, trajectory_of
from origami_sim.folding.placement import Placement
from origami_sim.pattern import hinge_angles, miura, waterbomb
from origami_sim.solve.batch import forces


@pytest.fixture
def sheet():
    return Elastic(miura(2, 2, 0.02, 0.03, np.radians(60), target_angle=np.radians(150)))


def shaken(sheet, size=0.02):
    return sheet.reference + np.random.default_rng(1).normal(0.0, size, sheet.reference.shape)


def test_angle_gradients_are_the_derivatives_of_the_angles(sheet):
    x = shaken(sheet)
    exact = angle_gradients(x, sheet.hinges)
    for node in range(4):
        for axis in range(3):
            step = np.zeros_like(x)
            for h in range(0, len(sheet.hinges), 7):
                step[:] = 0.0
                step[sheet.hinges[h, node], axis] = 1e-6
                change = hinge_angles(x + step, sheet.hinges[[h]]) - hinge_angles(x - step, sheet.hinges[[h]])
                assert exact[h, node, axis] == pytest.approx(change[0] / 2e-6, abs=1e-5)


def test_jacobian_is_the_derivative_of_the_residuals(sheet):
    """Some hinges are beyond half a turn, where the stop acts."""
    x = shaken(sheet)
    angles = sheet.angles(x, sheet.start) + np.where(np.arange(len(sheet.hinges)) % 3 == 0, 2 * np.pi, 0.0)
    jacobian = sheet.jacobian(x, angles)
    way = np.random.default_rng(2).normal(size=x.shape)
    ahead, _ = sheet.residuals(x + 1e-7 * way, angles, sheet.target)
    behind, _ = sheet.residuals(x - 1e-7 * way, angles, sheet.target)
    np.testing.assert_allclose(jacobian @ way.ravel(), (ahead - behind) / 2e-7, atol=1e-6)


def test_bar_sections_are_those_of_the_builder():
    pattern = miura(2, 1, 0.02, 0.03, np.radians(60))
    builder = Sheet(pattern, thickness=1e-3, material="paper", triangulation="diagonal")
    modulus = builder.modulus[0] * builder.thickness[0]
    np.testing.assert_allclose(bar_sections(pattern.vertices, builder.mesh) * modulus, builder._bar_sections())


def test_the_end_is_an_equilibrium_of_the_effects_with_their_energies():
    """What the folding found, the catalogue's laws hold still: same forces, same energies, in SI units."""
    folding = fold(waterbomb(0.1, target_angle=np.radians(100)), steps=4)
    model, parameters, drive = model_of(folding, thickness=2e-4, material="paper", crease_stiffness=0.02)
    motion = trajectory_of(folding, model, parameters, drive)
    found = forces(model, parameters, drive, motion.state, 1.0)
    total = np.abs(sum(found.forces.values())).max()
    assert total < 1e-6 * max(np.abs(f).max() for f in found.forces.values())
    for name, energy in found.energies.items():
        assert motion.energies[name][-1, 0] == pytest.approx(float(energy[0]), rel=1e-6, abs=1e-12)


def test_placement_gives_the_folded_shape_at_once():
    """A Miura sheet at consistent angles, from its flat state and from a folded one, for which no turn is the same."""
    shape = miura(2, 2, 0.02, 0.03, np.radians(60), fold_angle=np.radians(70))
    for start in (0.0, 20.0):
        pattern = miura(2, 2, 0.02, 0.03, np.radians(60), fold_angle=np.radians(start), target_angle=np.radians(70))
        sheet = Elastic(pattern)
        x = Placement(sheet).at(np.where(sheet.driven, sheet.target, 0.0)).x * sheet.size
        np.testing.assert_allclose(
            np.linalg.norm(x[:, None] - x[None], axis=2),
            np.linalg.norm(shape.vertices[:, None] - shape.vertices[None], axis=2),
            atol=1e-8,
        )
