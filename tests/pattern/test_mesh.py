"""OBJ and STL in and out."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import miura, read_mesh, read_pattern, triangulate, write_mesh

FOLD = 0.8
ROOF = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)] + [(1 + math.cos(FOLD), y, math.sin(FOLD)) for y in (0, 1)]
PANELS = [(0, 1, 2, 3), (1, 4, 5, 2)]


@pytest.mark.parametrize("suffix", [".obj", ".stl"])
@pytest.mark.parametrize("sign", [1, -1])
def test_signed_dihedral_and_flat_pairs(tmp_path, suffix, sign):
    path = tmp_path / ("roof" + suffix)
    write_mesh(np.array(ROOF) * [1, 1, sign], PANELS, path)
    pattern = read_mesh(path, unit="mm")
    assert (pattern.vertex_count, pattern.face_count) == (6, 4)
    assert sorted(pattern.assignments) == sorted("BBBBBB" + "FFU")
    (e,) = pattern.edges_assigned("U")
    assert pattern.rest_angles[e] == pytest.approx(sign * FOLD, abs=1e-6)
    assert np.ptp(pattern.vertices[:, 1]) == pytest.approx(1e-3)
    assert np.isnan(pattern.fold_angles[e])
    assert any("unit" in note for note in pattern.notes)
    split = triangulate(pattern)
    assert (len(split.creases), len(split.bends)) == (1, 2)


def test_obj_keeps_vertex_numbers(tmp_path):
    pattern = miura(1, 1, 1, 1, 1.0, fold_angle=1.0)
    write_mesh(pattern.vertices, pattern.faces, tmp_path / "a.obj")
    again = read_pattern(tmp_path / "a.obj")
    np.testing.assert_allclose(again.vertices, pattern.vertices, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.ply", "", "unknown mesh format"),
        ("a.obj", "", "mesh"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "a.obj"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "zero-area"),
        ("a.obj", "v a b c\nf x\n", "mesh"),
        ("a.stl", "solid x\nfacet nonsense", "mesh"),
        ("a.stl", "\0\1", "mesh"),
    ],
)
def test_bad_meshes(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_mesh(path)


def test_missing_mesh_and_bad_unit(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_mesh(tmp_path / "none.obj")
    with pytest.raises(InputError, match="unknown length unit"):
        read_mesh(tmp_path / "none.obj", unit="furlong")
    with pytest.raises(InputError, match="cannot be triangulated"):
        write_mesh([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 3, 0)], [(0, 1, 2, 3)], tmp_path / "a.obj")


@pytest.mark.parametrize(("name", "words"), [("a.stl", "neither binary nor ASCII STL"), ("a.obj", "not text in UTF-8")])
def test_bytes_that_are_no_mesh(tmp_path, name, words):
    (tmp_path / name).write_bytes(bytes(range(128, 256)) * 4)
    with pytest.raises(InputError, match=words):
        read_mesh(tmp_path / name)
