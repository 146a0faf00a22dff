"""Triangles that pass through each other are counted, those that touch are not."""

import numpy as np
import pytest

from origami_sim.folding.intersections import crossing_pairs

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
