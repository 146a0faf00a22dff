"""Builders: sizes, assignments, closed forms, and arguments refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import cross, grid, hinge_angles, kresling, miura, read_fold, strip, triangulate, waterbomb


def edge_lengths(pattern):
    a, b = pattern.vertices[pattern.edges[:, 0]], pattern.vertices[pattern.edges[:, 1]]
    return np.linalg.norm(a - b, axis=1)


def test_strip():
    pattern = strip([0.02, 0.01, 0.03], 0.01, fold_angles=[1.0, -0.5])
    np.testing.assert_allclose(pattern.vertices[-1], [0.06, 0.005, 0])
    (valley,), (mountain,) = pattern.edges_assigned("V"), pattern.edges_assigned("M")
    assert pattern.fold_angles[valley] == 1.0
    assert pattern.fold_angles[mountain] == -0.5
    np.testing.assert_allclose(pattern.vertices[pattern.edges[valley], 0], 0.02)
    assert pattern.notes == []


def test_strip_taper():
    pattern = strip([1, 1], [0.3, 0.2, 0.1])
    np.testing.assert_allclose(pattern.vertices[1::2, 1], [0.15, 0.1, 0.05])
    assert pattern.assignments.count("U") == 1


def test_cross_folds_into_a_box():
    pattern = cross(0.02, 0.01, fold_angle=math.pi / 2)
    assert (pattern.face_count, pattern.vertex_count, pattern.assignments.count("V")) == (5, 12, 4)
    assert np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.04)
    assert cross(0.02, 0.01).assignments.count("U") == 4


def test_grid():
    pattern = grid(3, 2, 0.1, 0.2)
    assert (pattern.face_count, pattern.vertex_count, pattern.assignments.count("U")) == (6, 12, 7)
    np.testing.assert_allclose(pattern.vertices[-1], [0.3, 0.4, 0])


@pytest.mark.parametrize("fold_angle", [0.0, 0.4, 1.5, 3.0])
@pytest.mark.parametrize("gamma", [0.6, 1.2])
def test_miura_folds_rigidly(gamma, fold_angle):
    pattern = miura(2, 2, 0.02, 0.03, gamma, fold_angle=fold_angle)
    flat = miura(2, 2, 0.02, 0.03, gamma)
    np.testing.assert_allclose(edge_lengths(pattern), edge_lengths(flat), rtol=1e-12)
    split = triangulate(pattern)
    np.testing.assert_allclose(hinge_angles(split.vertices, split.bends), 0.0, atol=1e-9)
    for face, flat_face in zip(pattern.faces, flat.faces, strict=True):
        for n in range(2):
            across = np.linalg.norm(pattern.vertices[face[n]] - pattern.vertices[face[n + 2]])
            assert across == pytest.approx(
                np.linalg.norm(flat.vertices[flat_face[n]] - flat.vertices[flat_face[n + 2]])
            )
    if fold_angle:
        angles = hinge_angles(split.vertices, split.creases)
        np.testing.assert_allclose(angles, pattern.fold_angles[split.crease_edge], atol=1e-9)
        assert {round(abs(x), 9) for x in angles} >= {round(fold_angle, 9)}


def test_miura_assignments_obey_maekawa():
    pattern = miura(2, 2, 1, 1, 1.0)
    assert np.isnan(pattern.fold_angles).all()
    assert set(pattern.assignments) == set("BMV")
    for vertex in range(pattern.vertex_count):
        letters = [pattern.assignments[e] for e in np.nonzero((pattern.edges == vertex).any(axis=1))[0]]
        if "B" not in letters:
            assert abs(letters.count("M") - letters.count("V")) == 2


@pytest.mark.parametrize("fold_angle", [0.0, 0.5, 2.0, 3.1])
def test_waterbomb_folds_rigidly(fold_angle):
    pattern = waterbomb(0.1, fold_angle=fold_angle)
    np.testing.assert_allclose(edge_lengths(pattern), edge_lengths(waterbomb(0.1)), rtol=1e-12)
    assert (pattern.assignments.count("M"), pattern.assignments.count("V")) == (2, 4)
    if fold_angle:
        mountains = pattern.edges_assigned("M")
        np.testing.assert_allclose(pattern.fold_angles[mountains], -fold_angle, rtol=1e-9)
        assert (pattern.fold_angles[pattern.edges_assigned("V")] > 0).all()


def test_kresling_matches_the_published_layout():
    pattern = kresling(8, radius=1, height=1, twist=math.pi / 4)
    assert (pattern.vertex_count, pattern.face_count) == (16, 16)
    split = triangulate(pattern)
    assert len(split.creases) == 16
    assert {tuple(sorted(face)) for face in pattern.faces} >= {(0, 8, 9), (0, 1, 9), (0, 7, 8), (7, 8, 15)}
    centre = pattern.vertices.mean(axis=0)
    for face in pattern.faces:
        a, b, c = pattern.vertices[list(face)]
        assert np.cross(b - a, c - a) @ (a - centre) > 0
    assert not np.isnan(pattern.rest_angles[split.crease_edge]).any()


@pytest.mark.parametrize("twist", [0.4, -0.4])
def test_a_kresling_cell_is_a_screw_of_the_hand_of_its_twist(twist):
    """Seen from above the lower ring counts and the upper ring turns counter-clockwise; bars are chords of a helix."""
    n, radius, height = 6, 0.03, 0.02
    pattern = kresling(n, radius=radius, height=height, twist=twist)
    lower, upper = pattern.vertices[:n], pattern.vertices[n:]
    step = np.arctan2(np.cross(lower, np.roll(lower, -1, 0))[:, 2], (lower * np.roll(lower, -1, 0)).sum(1))
    np.testing.assert_allclose(step, 2 * np.pi / n, rtol=1e-12)
    np.testing.assert_allclose(np.cross(lower, upper)[:, 2], radius**2 * np.sin(twist), rtol=1e-12)

    def chord(turn):
        return np.sqrt(height**2 + (2 * radius * np.sin(turn / 2)) ** 2)

    # the diagonal leads from i to the next node's, which lies a side ahead whatever the hand
    lengths = {frozenset(e): float(np.linalg.norm(np.subtract(*pattern.vertices[list(e)]))) for e in pattern.edges}
    for i in range(n):
        assert lengths[frozenset((i, n + i))] == pytest.approx(chord(twist))
        assert lengths[frozenset((i, n + (i + 1) % n))] == pytest.approx(chord(twist + 2 * np.pi / n))


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: strip([1, -1], 1), r"positive.*lengths\[1\].*-1"),
        (lambda: strip([], 1), "lengths"),
        (lambda: strip(3, 1), "lengths"),
        (lambda: strip([1, 1], [1, 1]), "width.*allowed: 3"),
        (lambda: strip([1, 1], 0), "positive.*width"),
        (lambda: strip([1, 1], 1, fold_angles=[4.0]), "out of range.*fold_angles"),
        (lambda: strip([1, 1], 1, fold_angles=[1.0, 1.0]), "wrong number"),
        (lambda: cross(math.nan, 1), "finite.*base"),
        (lambda: cross(1, None), "finite.*flap_length"),
        (lambda: grid(0, 1, 1, 1), "bad count.*nx"),
        (lambda: grid(1, 1.5, 1, 1), "bad count.*ny"),
        (lambda: miura(1, 1, 1, 1, 1.6), "gamma"),
        (lambda: miura(1, 1, 1, 1, 1.0, fold_angle=-1), "fold_angle"),
        (lambda: miura(1, 1, 1, 1, 1.0, target_angle=4), "target_angle"),
        (lambda: waterbomb(1, fold_angle=math.pi), "fold_angle"),
        (lambda: kresling(2, radius=1, height=1, twist=0), "bad count"),
        (lambda: kresling(5, radius=1, height=-1, twist=0), "height"),
        (lambda: kresling(5, radius=1, height=1, twist=7), "twist"),
    ],
)
def test_bad_arguments(build, words):
    with pytest.raises(InputError, match=words):
        build()


TARGET = math.radians(120)


@pytest.mark.parametrize(
    ("name", "built"),
    [
        ("miura", miura(3, 3, 0.02, 0.02, math.radians(60), target_angle=TARGET)),
        ("waterbomb", waterbomb(0.06, target_angle=TARGET)),
    ],
)
def test_scene_patterns(name, built):
    pattern = read_fold(Path(__file__).parents[2] / "scenes" / f"{name}.fold")
    assert pattern.notes == []
    assert pattern.assignments == built.assignments
    np.testing.assert_allclose(pattern.vertices, built.vertices, atol=1e-15)
    np.testing.assert_allclose(pattern.fold_angles, built.fold_angles, rtol=1e-14)
    assert np.nanmax(np.abs(pattern.fold_angles)) == pytest.approx(math.radians(120), abs=0.3)
    assert not np.isnan(pattern.fold_angles[pattern.edges_assigned("MV")]).any()
    assert np.ptp(pattern.vertices[:, 0]) < 0.2


def test_lengths_and_angles_may_be_quantities():
    right, sixth = np.pi / 2, np.pi / 6
    same = (
        (strip(["10 mm", 0.02], "2 cm", fold_angles=["90 deg"]), strip([0.01, 0.02], 0.02, fold_angles=[right])),
        (
            miura(1, 1, "2 cm", 0.03, "60 deg", fold_angle="30 deg"),
            miura(1, 1, 0.02, 0.03, 2 * sixth, fold_angle=sixth),
        ),
        (kresling(6, radius="1 cm", height=0.02, twist="30 deg"), kresling(6, radius=0.01, height=0.02, twist=sixth)),
    )
    for one, other in same:
        assert one.vertices == pytest.approx(other.vertices)
        assert one.fold_angles == pytest.approx(other.fold_angles, nan_ok=True)
    with pytest.raises(InputError, match="wrong unit"):
        strip([0.01], "2 mT")
    with pytest.raises(InputError, match="must be positive"):
        strip([0.01], "-2 mm")
