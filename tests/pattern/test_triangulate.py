"""Triangles, hinge order and sign, bends, cuts, and faces refused."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import cross, grid, hinge_angles, miura, open_cuts, strip, triangulate
from origami_sim.pattern.assemble import assemble


def polygon(points):
    return assemble([(x, y, z) for x, y, z in (tuple(p) + (0,) * (3 - len(p)) for p in points)], [range(len(points))])


def area(split):
    a, b, c = (split.vertices[split.triangles[:, n]] for n in range(3))
    return 0.5 * np.cross(b - a, c - a)[:, 2].sum()


@pytest.mark.parametrize("method", ["diagonal", "center"])
@pytest.mark.parametrize("fold", [0.3, -0.7, 3.0, -3.0])
def test_valley_is_positive(method, fold):
    pattern = strip([1.0, 1.0], 1.0)
    split = triangulate(pattern, method)
    folded = split.vertices.copy()
    beyond = folded[:, 0] > 1.0
    folded[beyond] = [
        (1 + (x - 1) * math.cos(fold), y, (x - 1) * math.sin(fold)) for x, y, _ in folded[beyond]
    ]  # up for fold > 0
    np.testing.assert_allclose(hinge_angles(folded, split.creases), fold, atol=1e-12)
    np.testing.assert_allclose(hinge_angles(folded, split.bends), 0.0, atol=1e-12)


@pytest.mark.parametrize("method", ["diagonal", "center"])
def test_hinge_node_order(method):
    split = triangulate(miura(1, 1, 1, 1, 1.0, fold_angle=1.0), method)
    sides = {(t[n], t[(n + 1) % 3]): t[(n + 2) % 3] for t in split.triangles.tolist() for n in range(3)}
    for i, j, k, left in np.vstack([split.creases, split.bends]).tolist():
        assert sides[j, k] == left
        assert sides[k, j] == i


def test_counts_of_a_grid():
    pattern = grid(3, 2, 1.0, 1.0)
    split = triangulate(pattern)
    assert len(split.triangles) == 12
    assert len(split.bends) == 6
    assert sorted(split.bend_face) == list(range(6))
    assert (split.bend_edge == -1).all()
    assert [pattern.assignments[e] for e in split.crease_edge] == ["U"] * 7
    assert len(split.bars) == pattern.edge_count + 6
    assert len(np.unique(split.bars, axis=0)) == len(split.bars)
    np.testing.assert_array_equal(split.vertex_source, np.arange(12))


def test_center_adds_centroids():
    pattern = grid(2, 1, 1.0, 2.0)
    split = triangulate(pattern, "center")
    np.testing.assert_allclose(split.vertices[6:], [[0.5, 1, 0], [1.5, 1, 0]])
    assert split.vertex_source.tolist() == [0, 1, 2, 3, 4, 5, -1, -1]
    assert (len(split.triangles), len(split.bends), len(split.creases)) == (8, 8, 1)


def test_shorter_diagonal_and_tie():
    kite = triangulate(polygon([(0, 0), (2, -0.5), (4, 0), (2, 0.5)]))
    assert [1, 3] in kite.bars.tolist()
    square = triangulate(polygon([(0, 0), (1, 0), (1, 1), (0, 1)]))
    assert [0, 2] in square.bars.tolist()


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
        [(0, 0), (4, -1), (1, 0), (4, 1)],
        [(0, 0), (1, 0), (2, 0), (3, 0), (3, 2), (1.5, 2), (0, 2)],
        [(0, 0), (3, 0), (3, 3), (1, 3), (1, 2), (2, 2), (2, 1), (0, 1)],
        [(math.cos(n) * (1 + n % 2), math.sin(n) * (1 + n % 2)) for n in np.linspace(0, 2 * math.pi, 13)[:-1]],
    ],
)
def test_concave_and_straight_corners(points):
    if len(points) == 12:
        points = [
            (r * math.cos(a), r * math.sin(a))
            for a, r in zip(np.linspace(0, 2 * math.pi, 13)[:-1], [1.0, 3.0] * 6, strict=True)
        ]
    split = triangulate(polygon(points))
    x, y = np.array(points).T
    assert len(split.triangles) == len(points) - 2
    assert area(split) == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    a, b, c = (split.vertices[split.triangles[:, n]] for n in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 1e-9).all()


def test_flat_and_join_edges_are_bends():
    pattern = strip([1, 1, 1, 1], 1)
    inner = pattern.edges_assigned("U")
    pattern.assignments[inner[0]], pattern.assignments[inner[1]] = "F", "J"
    split = triangulate(pattern)
    assert split.crease_edge.tolist() == [inner[2]]
    assert set(split.bend_edge.tolist()) == {-1, int(inner[0]), int(inner[1])}


def cut_grid(*cut_pairs):
    pattern = grid(2, 2, 1.0, 1.0)
    for e, pair in enumerate(pattern.edges.tolist()):
        if tuple(pair) in cut_pairs:
            pattern.assignments[e] = "C"
    return pattern


def test_cut_from_the_border_opens():
    opened, source = open_cuts(cut_grid((1, 4)))
    assert opened.vertex_count == 10
    assert source[9] == 1
    assert opened.edge_count == 13
    split = triangulate(cut_grid((1, 4)))
    assert len(split.creases) == 3
    assert split.vertex_source.tolist() == [*range(9), 1]


def test_cut_through_separates():
    split = triangulate(cut_grid((1, 4), (4, 7)))
    assert len(split.vertices) == 12
    assert len(split.creases) == 2
    left = {v for t in split.triangles.tolist() for v in t if split.vertices[t, 0].mean() < 1}
    right = {v for t in split.triangles.tolist() for v in t if split.vertices[t, 0].mean() > 1}
    assert not left & right


def test_cut_with_two_inner_tips_stays_closed():
    pattern = grid(3, 3, 1.0, 1.0)
    e = pattern.edges.tolist().index([5, 6])
    pattern.assignments[e] = "C"
    split = triangulate(pattern)
    assert len(split.vertices) == 16
    assert len(split.creases) == 11


def test_box_net():
    split = triangulate(cross(1.0, 0.5))
    assert (len(split.creases), len(split.bends), len(split.triangles)) == (4, 5, 10)


@pytest.mark.parametrize(
    ("points", "method", "words"),
    [
        ([(0, 0, 0), (1, 0, 0), (1, 1, 0.2), (0, 1, 0)], "diagonal", "not planar"),
        ([(0, 0), (4, 4), (4, 0), (1, 3)], "diagonal", "intersects itself"),
        ([(0, 0), (4, 0), (2, 0), (2, 3)], "diagonal", "intersects itself"),
        ([(0, 0), (1, 0), (1, 1), (0, 1)], "middle", "unknown triangulation.*auto, diagonal, center"),
    ],
)
def test_bad_faces(points, method, words):
    with pytest.raises(InputError, match=words):
        triangulate(polygon(points), method)


def test_a_face_not_seen_whole_from_its_centroid_gets_no_centre():
    angled = polygon([(0, 0), (3, 0), (3, 3), (2.9, 3), (2.9, 0.1), (0, 0.1)])
    split, plain = triangulate(angled, "center"), triangulate(angled, "diagonal")
    assert len(split.vertices) == 6 and np.array_equal(split.triangles, plain.triangles)


def test_unused_vertex_and_inconsistent_faces():
    pattern = grid(2, 1, 1.0, 1.0)
    pattern.faces[1] = tuple(reversed(pattern.faces[1]))
    with pytest.raises(InputError, match="same way"):
        triangulate(pattern)
    with pytest.raises(InputError, match="belongs to no face"):
        triangulate(assemble([(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5)], [(0, 1, 2)]))
