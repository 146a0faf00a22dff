"""The text format of ORIPA, Orihime and Oriedita."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.folding import fold, read
from origami_sim.pattern import read_cp, read_pattern

WATERBOMB = """1 -200 -200 200 -200
1 200 -200 200 200
1 200 200 -200 200
1 -200 200 -200 -200
3 -200 -200 200 200
3 -200 200 200 -200
2 -200 0 200 0
4 0 -200 10 200
"""


def test_lines_are_cut_where_they_cross(tmp_path):
    file = tmp_path / "base.cp"
    file.write_text(WATERBOMB)
    pattern = read_pattern(file)
    assert len(pattern.faces) == 6 and np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.2)
    letters = sorted(pattern.assignments)
    assert letters.count("V") == 4 and letters.count("M") == 2 and letters.count("B") == 6
    mountains = pattern.fold_angles[pattern.edges_assigned("M")]
    assert mountains == pytest.approx([-math.pi] * 2)
    assert any("1 auxiliary lines were left out" in n for n in pattern.notes)


def test_y_points_down(tmp_path):
    file = tmp_path / "half.cp"
    file.write_text("1 0 0 4 0\n1 4 0 4 2\n1 4 2 0 2\n1 0 2 0 0\n2 1 0 1 2\n3 1 1 4 1\n")
    pattern = read_cp(file, scale=1.0)
    valley = pattern.edges[pattern.edges_assigned("V")[0]]
    assert pattern.vertices[valley, 1] == pytest.approx([-1, -1])
    assert pattern.vertices[:, 1].min() == pytest.approx(-2)


def test_it_folds(tmp_path):
    file = tmp_path / "base.cp"
    file.write_text(WATERBOMB)
    pattern = read(file, size=0.1)
    assert fold(pattern).reached and np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 0 0 1 0\n5 0 0 1 1\n", "line 2.*'5 0 0 1 1'"),
        ("1 0 0 1\n", "line 1"),
        ("1 0 0 1 nan\n", "line 1"),
        ("1 0 0 1 1e999\n", "line 1"),
        ("", "no border, mountain or valley"),
        ("4 0 0 1 1\n", "no border, mountain or valley"),
        ("1 0 0 1 0\n1 1 0 1 1\n", "enclose no face"),
        ("1 0 0 0 0\n", "no usable size"),
    ],
)
def test_bad_lines_are_named(tmp_path, text, words):
    file = tmp_path / "a.cp"
    file.write_text(text)
    with pytest.raises(InputError, match=words) as e:
        read_cp(file)
    assert str(e.value).startswith(str(file)) and "\n" not in str(e.value)


def test_no_text(tmp_path):
    file = tmp_path / "a.cp"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is no text"):
        read_cp(file)
