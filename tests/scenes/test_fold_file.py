"""Patterns from files: a Miura sheet on its rigid-folding path, a waterbomb, and files that cannot be folded."""

import json
from pathlib import Path

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.device.scene import read_calibration
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.pattern import miura, write_mesh
from origami_sim.scenes import fold_file
from origami_sim.solve.statics.equilibria import equilibrium

SECTOR = np.radians(60)


def partner(zigzag: np.ndarray) -> np.ndarray:
    """Fold angle of a Miura's straight creases: tan(straight / 2) = cos(sector) tan(zigzag / 2).

    The fold-angle multiplier of a flat-foldable vertex of degree four, |sin((a - b) / 2) / sin((a + b) / 2)| for its
    sectors a = 60 and b = 120 deg (Tachi 2009; Evans, Lang, Magleby and Howell 2015, doi:10.1098/rsos.150067).
    """
    return 2 * np.arctan(np.cos(SECTOR) * np.tan(zigzag / 2))


@pytest.fixture(scope="module")
def settings():
    return read_calibration(fold_file.CALIBRATION)


def test_miura_sheet_stays_on_the_rigid_folding_path():
    """One zigzag crease is driven, the others are limp: stiff panels leave a single way to fold."""
    start = np.radians(20)
    sheet = Sheet(miura(2, 2, 0.02, 0.02, SECTOR, fold_angle=start), thickness=1e-3, material="paper")
    sheet.crease(stiffness=1e-6)
    rest = sheet.build()[1]["crease", "rest_angle"][:, 0]
    zigzag = np.isclose(np.abs(rest), start)
    driven = int(np.flatnonzero(zigzag)[0])
    sheet.crease([driven], stiffness=1e-3)
    sheet.set("crease_drive", [driven], drive_stiffness=1e-3, target_angle=np.sign(rest[driven]))
    model, parameters = sheet.build()
    state, angles = None, []
    for turn in np.radians([0, 10, 20, 30, 45, 60, 75, 90, 105, 120]):
        found = equilibrium(model, parameters, Drive(load=turn), state=state, tolerance=1e-9)
        assert found.converged
        state = found.state
        angles.append(found.angles[: len(rest)])
    folds = np.degrees(np.abs(angles))
    assert np.all(np.sign(angles) == np.sign(rest))
    assert folds[0, zigzag].mean() == pytest.approx(20, abs=1e-6)
    assert folds[-1, zigzag].mean() > 130
    assert np.ptp(folds[:, zigzag], axis=1).max() < 0.05
    assert np.ptp(folds[:, ~zigzag], axis=1).max() < 0.05
    exact = np.degrees(partner(np.radians(folds[:, zigzag].mean(1))))
    np.testing.assert_allclose(folds[:, ~zigzag].mean(1), exact, atol=1e-3)


def test_shipped_miura_folds_along_that_path_to_its_target(settings):
    """In the motion every crease is driven at its own rate, and panels of paper bend a little: half a degree."""
    outcome = fold_file.run(settings)
    motion = outcome.trajectory
    target = np.radians(outcome.tables["creases"]["target_deg"])
    zigzag = np.isclose(np.abs(target), np.radians(120), atol=1e-6)
    np.testing.assert_allclose(np.abs(target[~zigzag]), partner(np.radians(120)), atol=1e-6)
    folds = np.abs(motion.creases[:, :, 0])
    exact = partner(folds[:, zigzag].mean(1))
    np.testing.assert_allclose(folds[:, ~zigzag].mean(1), exact, atol=np.radians(0.6))
    assert outcome.numbers["largest_error_deg"] < 0.01
    assert outcome.numbers["largest_strain"] < 1e-4
    assert not motion.failures


def test_shipped_waterbomb_folds_to_its_target(settings):
    outcome = fold_file.run(settings.replace(pattern="waterbomb.fold"))
    assert outcome.numbers["largest_error_deg"] < 0.01
    assert np.ptp(outcome.trajectory.x[-1, :, 0, 2]) > 0.005
    assert not outcome.trajectory.failures


def test_a_path_is_read_before_a_shipped_name(settings, tmp_path):
    shipped = Path(fold_file.__file__).with_name("waterbomb.fold")
    own = tmp_path / "own.fold"
    own.write_bytes(shipped.read_bytes())
    assert fold_file.load(settings.replace(pattern=str(own))).equals(
        fold_file.load(settings.replace(pattern="waterbomb.fold"))
    )


SQUARE = {
    "file_spec": 1.2,
    "frame_unit": "m",
    "vertices_coords": [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]],
    "faces_vertices": [[0, 1, 2], [0, 2, 3]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
    "edges_assignment": ["B", "B", "B", "B", "V"],
    "edges_foldAngle": [0, 0, 0, 0, 90],
}


def test_the_square_itself_folds(settings, tmp_path):
    path = tmp_path / "square.fold"
    path.write_text(json.dumps(SQUARE))
    assert fold_file.run(settings.replace(pattern=str(path), fold_time=0.2)).numbers["largest_error_deg"] < 0.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vertices_coords": None}, "vertices_coords"),
        ({"faces_vertices": [[0, 1, 2], [0, 2, 9]]}, "9"),
        ({"faces_vertices": [[0, 1, 2], [0, 2, 3], [0, 2, 1]]}, "faces"),
        ({"vertices_coords": [[0, 0], [0.02, 0], [0.04, 0], [0, 0.02]]}, "area"),
        ({"vertices_coords": [[0, 0], [0.02, "x"], [0.02, 0.02], [0, 0.02]]}, "vertices_coords"),
        ({"frame_unit": "furlong"}, "furlong"),
        ({"edges_foldAngle": [0, 0, 0, 0, 270]}, "270"),
        (
            {"edges_assignment": list("BBBBU"), "edges_foldAngle": [0, 0, 0, 0, None]},
            "no target angle.*edges_foldAngle.*degrees, valley positive",
        ),
        ({"edges_assignment": ["B", "B", "B", "B", "F"]}, "no crease to fold.*edges_assignment"),
    ],
)
def test_bad_patterns_are_one_sentence(settings, tmp_path, change, words):
    path = tmp_path / "bad.fold"
    path.write_text(json.dumps({k: v for k, v in {**SQUARE, **change}.items() if v is not None}))
    with pytest.raises(InputError, match=words) as e:
        fold_file.run(settings.replace(pattern=str(path)))
    assert str(path) in str(e.value)
    assert "\n" not in str(e.value)


@pytest.mark.parametrize("height", [0.0, 0.005])
@pytest.mark.parametrize("suffix", [".obj", ".STL"])
def test_a_mesh_has_no_fold_to_go_to(settings, tmp_path, suffix, height):
    path = tmp_path / f"square{suffix}"
    write_mesh([(0, 0, 0), (0.02, 0, 0), (0.02, 0.02, height), (0, 0.02, 0)], [(0, 1, 3), (1, 2, 3)], path)
    with pytest.raises(InputError, match=rf"square\{suffix}: a mesh has a shape, but no fold.*edges_foldAngle"):
        fold_file.run(settings.replace(pattern=str(path)))


def test_files_that_are_no_patterns(settings, tmp_path):
    torn = tmp_path / "torn.fold"
    torn.write_text('{"vertices_coords": [[0, 0')
    for given, words in (
        ("nowhere.fold", "no such file"),
        ("picture.png", "unknown pattern format"),
        (str(torn), "JSON"),
    ):
        with pytest.raises(InputError, match=words):
            fold_file.run(settings.replace(pattern=given))
