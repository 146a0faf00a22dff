"""Triangles that pass through each other are counted, those that touch are not; no sheet starts with any of them."""

import numpy as np
import pytest

from origami_sim.commands.cli import main
from origami_sim.design.build import Sheet
from origami_sim.errors import InputError
from origami_sim.pattern import grid, kresling, sheet
from origami_sim.pattern.intersections import crossing_pairs, overlapping_pairs

FLOOR = [(0, 0, 0), (4, 0, 0), (0, 4, 0)]


def pairs(*triangles, depth=0.0):
    x = np.array([p for t in triangles for p in t], float)
    return crossing_pairs(x, np.arange(len(x)).reshape(-1, 3), depth).tolist()


@pytest.mark.parametrize(
    ("other", "cross"),
    [
        ([(1, 1, -1), (1, 1, 1), (2, 1, 1)], True),
        ([(1, 1, 0.5), (1, 1, 1), (2, 1, 1)], False),
        ([(1, 1, 0), (1, 1, 1), (2, 1, 1)], False),  # touches with a corner
        ([(1, 1, 0), (2, 1, 0), (2, 1, 1)], False),  # stands on it with a side
        ([(1, 1, 0), (2, 1, 0), (1, 2, 0)], False),  # lies in it
        ([(5, 5, -1), (5, 5, 1), (6, 5, 1)], False),  # goes through its plane only
        ([(-1, 1, -1), (-1, 1, 2), (6, 1, -1)], True),  # is larger than it
        ([(0, 0, 0), (1, 1, -1), (1, 1, 1)], True),  # has a corner in common with it
        ([(0, 0, 0), (2, 2, -1), (2, 2, 1)], True),  # and goes through the middle of a side
        ([(0, 0, 0), (-1, -1, -1), (-1, -1, 1)], False),  # has only that corner in common
    ],
)
def test_two_triangles(other, cross):
    assert pairs(FLOOR, other) == ([[0, 1]] if cross else [])
    assert pairs(other, FLOOR) == ([[0, 1]] if cross else [])


def test_what_shares_an_edge_does_not_cross():
    x = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.3, 0.5)])
    assert len(crossing_pairs(x, np.array([(0, 1, 2), (1, 0, 3)]), 0.0)) == 0


@pytest.mark.parametrize("turned", [np.eye(3), np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]])
def test_what_lies_in_a_triangle_overlaps_it_and_what_lies_beside_it_does_not(turned):
    def overlap(*others):
        x = np.array([*FLOOR, *(p for t in others for p in t)], float) @ turned
        return overlapping_pairs(x, np.arange(len(x)).reshape(-1, 3)).tolist()

    assert overlap([(1, 1, 0), (2, 1, 0), (1, 2, 0)]) == [[0, 1]]  # within it
    assert overlap([(-1, -1, 0), (9, -1, 0), (-1, 9, 0)]) == [[0, 1]]  # around it
    assert overlap([(3, 3, 0), (3, -1, 0), (4, 3, 0)]) == [[0, 1]]  # no corner of either in the other
    assert overlap([(1, 1, -1), (1, 1, 1), (2, 1, 1)]) == [[0, 1]]  # through it
    assert not overlap([(4, 0, 0), (0, 4, 0), (4, 4, 0)])  # on the other side of an edge
    assert not overlap([(2, 2, 0), (4, 2, 0), (4, 4, 0)])  # with a corner on that edge
    assert not overlap([(3, 3, 0), (4, 3, 0), (3, 4, 0)])
    assert not overlap([(1, 1, 0.1), (2, 1, 0.1), (1, 2, 0.1)])  # above it


def test_a_sheet_whose_triangles_overlap_at_the_start_is_refused(tmp_path, monkeypatch, capsys):
    """Folded back, across each other, or through each other; the command ends with a sentence and exit code 2."""
    square = [(0, 0, 0), (2, 0, 0), (2, 2, 0)]
    for corner, beside in (((0, 2, 0), True), ((1.5, 0.5, 0), False)):
        pattern = sheet(np.array([*square, corner]) * 0.01, [(0, 1, 2), (0, 2, 3)])
        if beside:
            Sheet(pattern, thickness=1e-3)
        else:
            with pytest.raises(InputError, match="panel 0 and panel 1 overlap at the start"):
                Sheet(pattern, thickness=1e-3)
            Sheet(pattern, thickness=1e-3, overlapping=True)
    with pytest.raises(InputError, match="overlap at the start"):
        Sheet(kresling(6, radius=0.02, height=0.02, twist=np.pi), thickness=1e-3)
    Sheet(grid(3, 3, 0.01, 0.01), thickness=1e-3, triangulation="center")

    (tmp_path / "device.py").write_text(
        "from origami_sim import Sheet, sheet\n"
        "def build(thickness=1e-3):\n"
        "    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, -1, 0), (3, 1, 0), (1, 1, 0)]\n"
        "    return Sheet(sheet(corners, [(0, 1, 2), (3, 4, 5)]), thickness=thickness).shell()\n"
    )
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        main(["run", "device.py"])
    said = capsys.readouterr().err.strip()
    assert "panel 0 and panel 1 overlap at the start" in said and "\n" not in said


def test_depth_is_how_far_one_has_to_move():
    through = [(1, 1, -0.1), (1, 1, 1), (2, 1, 1)]
    assert pairs(FLOOR, through, depth=0.099) == [[0, 1]]
    assert pairs(FLOOR, through, depth=0.101) == []


def test_turned_and_in_number_like_one_by_one():
    """Random triangles in a box, against a test of every pair by solving for the point where an edge goes through."""
    rng = np.random.default_rng(3)
    x, triangles = rng.random((120, 3)), np.arange(120).reshape(-1, 3)
    found = {tuple(p) for p in crossing_pairs(x, triangles, 0.0).tolist()}
    assert found == {(a, b) for a in range(40) for b in range(a + 1, 40) if pierced(x[3 * a :][:3], x[3 * b :][:3])}


def pierced(one, other):
    for t, s in ((one, other), (other, one)):
        for m, n in ((0, 1), (1, 2), (2, 0)):
            u, v, w = np.linalg.solve(np.column_stack([t[1] - t[0], t[2] - t[0], s[m] - s[n]]), s[m] - t[0])
            if u > 0 and v > 0 and u + v < 1 and 0 < w < 1:
                return True
    return False
