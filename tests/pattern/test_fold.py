"""FOLD: what is read, defaulted, derived, refused and written back."""

import copy
import json
import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import miura, read_fold, read_pattern, write_fold
from origami_sim.pattern.fold import fold_pattern, pattern_fold

SQUARE = {
    "file_spec": 1.2,
    "frame_unit": "m",
    "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
    "edges_assignment": ["B", "B", "B", "B", "V"],
    "edges_foldAngle": [None, None, None, None, 90],
    "faces_vertices": [[0, 1, 2], [0, 2, 3]],
}


def square(**changes):
    document = copy.deepcopy(SQUARE)
    for key, value in changes.items():
        if value is None:
            del document[key]
        else:
            document[key.replace("__", ":")] = value
    return document


def test_reads_metres_and_radians():
    pattern = fold_pattern(square(frame_unit="mm", faces_osim__thickness=[0.5, 1], faces_osim__material=["PET", None]))
    assert pattern.vertices.shape == (4, 3)
    np.testing.assert_allclose(pattern.vertices[2], [1e-3, 1e-3, 0])
    assert pattern.fold_angles[4] == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(pattern.thickness, [0.5e-3, 1e-3])
    assert pattern.materials == ["PET", None]
    assert pattern.notes == []


@pytest.mark.parametrize(("unit", "metres"), [("cm", 0.01), ("in", 0.0254), ("ft", 0.3048), ("pt", 0.0254 / 72)])
def test_units(unit, metres):
    assert fold_pattern(square(frame_unit=unit)).vertices[1, 0] == pytest.approx(metres)


@pytest.mark.parametrize("unit", [None, "unit"])
def test_without_a_unit_the_longest_side_is_a_hand_wide(unit, tmp_path):
    document = square(frame_unit=unit)
    pattern = fold_pattern(document)
    assert pattern.vertices[1, 0] == pytest.approx(0.2)
    assert "0.2 m" in pattern.notes[0]
    assert fold_pattern(document, size=0.5).vertices[1, 0] == pytest.approx(0.5)
    assert fold_pattern(document, scale=1.0).vertices[1, 0] == 1.0
    assert fold_pattern(square(frame_unit="mm"), size=0.5).vertices[1, 0] == pytest.approx(0.5)
    with pytest.raises(InputError, match="exclude each other"):
        fold_pattern(document, size=0.5, scale=1.0)
    write_fold(pattern, tmp_path / "a.fold")
    assert read_fold(tmp_path / "a.fold").equals(pattern)


def test_custom_edge_keys():
    pattern = fold_pattern(square(edges_osim__stiffness=[None] * 4 + [0.02], edges_osim__restAngle=[None] * 4 + [-45]))
    assert pattern.stiffness[4] == 0.02
    assert pattern.rest_angles[4] == pytest.approx(-math.pi / 4)
    assert np.isnan(pattern.stiffness[:4]).all()


def test_missing_angles_of_a_folded_form_are_those_it_shows():
    """A square folded by 90 degrees on its diagonal; drawn from the other side, mountains and valleys change names."""
    folded = [[0, 0, 0], [1, 0, 0], [0.5, 0.5, math.sqrt(0.5)], [0, 1, 0]]
    for letter, read in (("V", "V"), ("M", "V")):
        letters = [*"BBBB", letter]
        document = square(
            vertices_coords=folded,
            edges_foldAngle=None,
            edges_assignment=letters,
            edges_vertices=[[0, 1], [1, 2], [2, 3], [3, 0], [1, 3]],
            faces_vertices=[[0, 1, 3], [1, 2, 3]],
            frame_unit="m",
        )
        pattern = fold_pattern(document)
        assert pattern.assignments[4] == read
        assert pattern.fold_angles[4] == pytest.approx(math.pi / 2)
        assert any("exchanged" in note for note in pattern.notes) == (letter != read)


def test_old_spelling_of_fold_angle():
    document = square(edges_foldAngle=None) | {"edges_foldAngles": [0, 0, 0, 0, 60]}
    assert fold_pattern(document).fold_angles[4] == pytest.approx(math.pi / 3)


def test_missing_angles_are_half_a_turn_and_zero_for_flat():
    pattern = fold_pattern(square(edges_foldAngle=None))
    assert pattern.fold_angles[4] == pytest.approx(math.pi)
    assert any("180 degrees" in note for note in pattern.notes)
    mountain = fold_pattern(square(edges_foldAngle=None, edges_assignment=list("BBBBM")))
    assert mountain.fold_angles[4] == pytest.approx(-math.pi)
    assert fold_pattern(square(edges_foldAngle=None, edges_assignment=list("BBBBF"))).fold_angles[4] == 0.0


def test_missing_assignments():
    pattern = fold_pattern(square(edges_assignment=None))
    assert pattern.assignments == ["B", "B", "B", "B", "U"]
    assert any("without an assignment" in note for note in pattern.notes)


def test_missing_edges_are_the_sides_of_the_faces():
    pattern = fold_pattern(square(edges_vertices=None, edges_assignment=None, edges_foldAngle=None))
    assert pattern.edge_count == 5
    assert sorted(pattern.assignments) == list("BBBBU")


def test_missing_faces_are_derived():
    pattern = fold_pattern(square(faces_vertices=None))
    assert sorted(sorted(face) for face in pattern.faces) == [[0, 1, 2], [0, 2, 3]]
    assert any("derived" in note for note in pattern.notes)


def test_derived_faces_in_a_vertical_plane_and_with_loose_ends():
    document = square(
        vertices_coords=[[0, 3, 0], [1, 3, 0], [1, 3, 1], [0, 3, 1], [2, 3, 2]],
        edges_vertices=[*SQUARE["edges_vertices"], [2, 4]],
        edges_assignment=list("BBBBVF"),
        edges_foldAngle=None,
        faces_vertices=None,
    )
    pattern = fold_pattern(document)
    assert pattern.face_count == 2
    assert any("1 vertices that belong to no face, and 1 edges to them" in note for note in pattern.notes)


def test_hole_bounded_by_border_edges():
    ring = [[0, 0], [3, 0], [3, 3], [0, 3], [1, 1], [2, 1], [2, 2], [1, 2]]
    edges = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
    pattern = fold_pattern({"vertices_coords": ring, "edges_vertices": edges, "edges_assignment": list("BBBBBBBBVVVV")})
    assert pattern.face_count == 4
    assert any("hole" in note for note in pattern.notes)


def test_an_island_is_joined_to_the_rest_by_facets():
    ring = [[0, 0], [3, 0], [3, 3], [0, 3], [1, 1], [2, 1], [2, 2]]
    edges = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 4]]
    angles = [None] * 4 + [90] * 3
    document = {"vertices_coords": ring, "edges_vertices": edges, "edges_foldAngle": angles, "edges_own": [*range(7)]}
    pattern = fold_pattern(document, scale=1.0)
    assert len(pattern.edges_assigned("F")) == 7 and pattern.extra["edges_own"] == [*range(7), *[None] * 7]
    areas = [0.5 * np.cross(*(pattern.vertices[[b, c]] - pattern.vertices[a]))[2] for a, b, c in pattern.faces]
    assert sum(areas) == pytest.approx(9.0) and min(areas) > 0


def test_faces_are_turned_counter_clockwise():
    pattern = fold_pattern(square(faces_vertices=[[2, 1, 0], [0, 2, 3]], faces_edges=[[1, 0, 4], [4, 2, 3]]))
    assert pattern.faces == [(0, 1, 2), (0, 2, 3)]
    assert any("reversed" in note for note in pattern.notes)
    assert "faces_edges" not in pattern.extra


def test_unlisted_side_is_added_and_unknown_edge_lists_follow():
    document = square(edges_vertices=SQUARE["edges_vertices"][:4], edges_assignment=list("BBBB"), edges_foldAngle=None)
    pattern = fold_pattern(document | {"edges_my:colour": [1, 2, 3, 4]})
    assert pattern.assignments == ["B", "B", "B", "B", "U"]
    assert pattern.extra["edges_my:colour"] == [1, 2, 3, 4, None]


def test_odd_assignments_are_told():
    pattern = fold_pattern(square(edges_assignment=list("BBMBB")))
    assert pattern.assignments[4] == "U"
    assert any("'B' between two faces" in note for note in pattern.notes)
    assert any("one face only" in note for note in pattern.notes)
    (note,) = [n for n in fold_pattern(square(edges_assignment=list("BBBBM"))).notes if "against the letter" in n]
    assert note.startswith("1 edge with a fold angle against the letter, where mountains are negative: 4 ('M', +")


def test_angles_against_their_letters_are_one_sentence():
    document = pattern_fold(miura(3, 3, 0.02, 0.02, 1.0, target_angle=1.5))
    swap = {"M": "V", "V": "M"}
    document["edges_assignment"] = [swap.get(letter, letter) for letter in document["edges_assignment"]]
    (note,) = [n for n in fold_pattern(document).notes if "letter" in n]
    count = sum(letter in "MV" for letter in document["edges_assignment"])
    assert note.startswith(f"{count} edges with a fold angle against the letter") and f"and {count - 3} more;" in note


@pytest.mark.parametrize(
    ("angle", "said"), [(3.14, True), (3.14159265, True), (3.0, False), (3.15, False), (90, False)]
)
def test_angles_that_look_like_radians_are_said_to(angle, said):
    pattern = fold_pattern(square(edges_foldAngle=[None] * 4 + [angle]))
    assert any("as pi: edges_foldAngle is in degrees" in note for note in pattern.notes) == said
    assert np.degrees(pattern.fold_angles[4]) == pytest.approx(angle)


FRAMED = square() | {
    "file_author": "A",
    "file_frames": [
        {"frame_inherit": True, "frame_parent": 0, "edges_foldAngles": [None] * 4 + [30], "frame_title": "half"},
        {"frame_inherit": True, "frame_parent": 1, "vertices_coords": [[0, 0], [2, 0], [2, 2], [0, 2]]},
        {"frame_inherit": True, "frame_parent": 3},
        {"vertices_coords": [[0, 0]]},
    ],
}


def test_frames_inherit():
    pattern = fold_pattern(FRAMED, frame=2)
    assert pattern.vertices[2, 0] == 2.0
    assert pattern.fold_angles[4] == pytest.approx(math.radians(30))
    assert pattern.extra["frame_title"] == "half"
    assert pattern.extra["file_author"] == "A"
    assert any("other frames" in note for note in pattern.notes)


@pytest.mark.parametrize(
    ("frame", "words"), [(3, "circle"), (9, "no such frame"), (-1, "no such frame"), (4, "neither edges nor faces")]
)
def test_bad_frames(frame, words):
    with pytest.raises(InputError, match=words):
        fold_pattern(FRAMED, frame=frame)


@pytest.mark.parametrize(
    "document",
    [
        square(),
        FRAMED,
        square(frame_unit="in", file_title="T", other__key={"a": [1, None]}, faces_osim__thickness=[0.1, 0.3]),
        square(frame_unit=None, faces_vertices=None, edges_assignment=None),
        square(vertices_coords=[[0, 0, 0], [1 / 3, 0, 0.1], [1.1, 1, 0], [0, 0.7, 0]], frame_unit="pt"),
    ],
)
def test_round_trip(tmp_path, document):
    source, copied = tmp_path / "a.fold", tmp_path / "b.fold"
    source.write_text(json.dumps(document))
    first = read_fold(source)
    write_fold(first, copied)
    second = read_fold(copied)
    assert second.equals(first)
    written = json.loads(copied.read_text())
    assert {k: v for k, v in document.items() if k.startswith(("file_", "frame_", "other"))}.items() <= written.items()
    assert [p.name for p in tmp_path.iterdir() if p.suffix != ".fold"] == []


@pytest.mark.parametrize("factor", [1e-3, 0.0254, 0.3048, 1e-6])
def test_many_numbers_survive_the_round_trip(tmp_path, factor):
    unit = {1e-3: "mm", 0.0254: "in", 0.3048: "ft", 1e-6: "um"}[factor]
    rng = np.random.default_rng(1)
    points = np.column_stack([np.arange(200), rng.normal(size=200), rng.normal(size=200)]).round(7)
    faces = [[3 * n, 3 * n + 1, 3 * n + 2] for n in range(66)]
    document = {"frame_unit": unit, "vertices_coords": points.tolist(), "faces_vertices": faces}
    first = fold_pattern(document)
    first.rest_angles[:] = np.radians(rng.uniform(-180, 180, first.edge_count))
    write_fold(first, tmp_path / "a.fold")
    assert read_fold(tmp_path / "a.fold").equals(first)


def test_built_pattern_is_written_in_metres(tmp_path):
    pattern = miura(1, 1, 0.01, 0.02, 1.0, fold_angle=2.0)
    write_fold(pattern, tmp_path / "a.fold")
    again = read_fold(tmp_path / "a.fold")
    np.testing.assert_array_equal(again.vertices, pattern.vertices)
    np.testing.assert_allclose(again.fold_angles, pattern.fold_angles, rtol=1e-15)
    assert again.assignments == pattern.assignments
    assert again.extra == {"frame_unit": "m"}


@pytest.mark.parametrize("corner", [1e9, -1e200])
def test_drawings_without_a_unit_may_have_any_coordinates(tmp_path, corner):
    """They are 0.2 m long wherever they lie."""
    near = square(frame_unit="unit")
    far = square(
        frame_unit="unit", vertices_coords=[[corner * x, corner * y] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    )
    for name, document in (("near", near), ("far", far)):
        (tmp_path / f"{name}.fold").write_text(json.dumps(document))
    one, other = read_fold(tmp_path / "near.fold"), read_fold(tmp_path / "far.fold")
    assert np.ptp(one.vertices, axis=0) == pytest.approx([0.2, 0.2, 0])
    assert np.ptp(other.vertices, axis=0) == pytest.approx([0.2, 0.2, 0])


def test_straight_angle_stays_in_range(tmp_path):
    pattern = fold_pattern(square(edges_foldAngle=[None] * 4 + [180]))
    pattern.fold_angles[4] = np.nextafter(math.pi, 4)
    write_fold(pattern, tmp_path / "a.fold")
    assert read_fold(tmp_path / "a.fold").fold_angles[4] == math.pi


BAD = {
    "vertices missing": square(vertices_coords=None),
    "not a list .*vertices_coords": square(vertices_coords=5),
    r"not a point .*vertices_coords\[1\]": square(vertices_coords=[[0, 0], [1], [1, 1], [0, 1]]),
    "not a finite number .*'x'": square(vertices_coords=[[0, 0], ["x", 0], [1, 1], [0, 1]]),
    "not a finite number .*True": square(vertices_coords=[[0, 0], [True, 0], [1, 1], [0, 1]]),
    "not a finite number .*huge": square(vertices_coords=[[0, 0], [10**400, 0], [1, 1], [0, 1]]),
    "coordinate out of range": square(frame_unit="m", vertices_coords=[[0, 0], [1e300, 0], [1, 1], [0, 1]]),
    r"index out of range .*faces_vertices\[1\].*0 to 3": square(faces_vertices=[[0, 1, 2], [0, 2, 7]]),
    "index out of range .*-1": square(faces_vertices=[[0, 1, 2], [0, 2, -1]]),
    r"not an index .*edges_vertices\[0\]": square(edges_vertices=[[0, 1.5], [1, 2], [2, 3], [3, 0], [0, 2]]),
    "bad entry .*edges_vertices": square(edges_vertices=[[0, 1, 2], [1, 2], [2, 3], [3, 0], [0, 2]]),
    "duplicate vertex in a face": square(faces_vertices=[[0, 1, 2, 0], [0, 2, 3]]),
    "fewer than 3": square(faces_vertices=[[0, 1], [0, 2, 3]]),
    "non-manifold": square(
        vertices_coords=[[0, 0], [1, 0], [1, 1], [0, 1], [2, 5]], faces_vertices=[[0, 1, 2], [0, 2, 3], [0, 2, 4]]
    ),
    "zero-area": square(vertices_coords=[[0, 0], [1, 1], [2, 2], [0, 1]]),
    "zero-length": square(vertices_coords=[[0, 0], [0, 0], [1, 1], [0, 1]]),
    "wrong array length .*edges_assignment.*5 entries": square(edges_assignment=["B"]),
    "wrong array length .*edges_foldAngle": square(edges_foldAngle=[0]),
    "unknown letter .*'X'.*B M V F U C J": square(edges_assignment=list("BBBBX")),
    "out of range .*edges_foldAngle.*-180 to 180": square(edges_foldAngle=[0, 0, 0, 0, 181]),
    "out of range .*restAngle": square(edges_osim__restAngle=[0, 0, 0, 0, -500]),
    "out of range .*thickness": square(faces_osim__thickness=[0, 1]),
    "out of range .*thickness.*-1": square(faces_osim__thickness=[1, -1]),
    "out of range .*stiffness": square(edges_osim__stiffness=[0, 0, 0, 0, -1]),
    "not a name": square(faces_osim__material=[3, None]),
    "unknown length unit .*cubit": square(frame_unit="cubit"),
    "unknown length unit .*list": square(frame_unit=[1]),
    "not flat": square(faces_vertices=None, vertices_coords=[[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]),
    "enclose no face": {"vertices_coords": [[0, 0], [1, 0]], "edges_vertices": [[0, 1]]},
    "neither edges nor faces": {"vertices_coords": [[0, 0], [1, 0]]},
    "Moebius": {
        "vertices_coords": [[math.cos(n), math.sin(n), (n % 2) * 0.5] for n in range(5)],
        "faces_vertices": [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 0], [4, 0, 1]],
    },
}


def test_edges_listed_twice_are_one():
    again = square(
        edges_vertices=[[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [2, 0], [1, 0]],
        edges_assignment=list("BBBBFVB"),
        edges_foldAngle=[None, None, None, None, 0, 90, None],
        edges_osim__stiffness=[0, 0, 0, 0, 1, 2, 0],
        edges_own=[0, 1, 2, 3, 4, 5, 6],
        faces_edges=[[0, 1, 5], [4, 2, 3]],
    )
    pattern = fold_pattern(again)
    assert pattern.edges.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0], [2, 0]]
    assert pattern.assignments == list("BBBBV")
    assert pattern.fold_angles[4] == pytest.approx(math.pi / 2) and pattern.stiffness[4] == 2
    assert pattern.extra["edges_own"] == [0, 1, 2, 3, 5] and "faces_edges" not in pattern.extra
    assert any("2 edges were listed more than once and are one, 1 of them with different" in n for n in pattern.notes)


def crossed(**changes):
    """A square with both diagonals, which cross without a vertex."""
    return {
        "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1]],
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]],
        "edges_assignment": list("BBBBMV"),
        "edges_foldAngle": [None, None, None, None, -90, 45],
        "edges_own": [0, 1, 2, 3, 4, 5],
        "vertices_own": [0, 1, 2, 3],
    } | changes


def test_edges_that_cross_are_cut():
    pattern = fold_pattern(crossed(), scale=1.0)
    assert len(pattern.faces) == 4 and len(pattern.vertices) == 5
    assert pattern.assignments.count("M") == pattern.assignments.count("V") == 2
    assert np.degrees(pattern.fold_angles[pattern.edges_assigned("MV")]).round(9).tolist().count(45) == 2
    assert sorted(pattern.extra["edges_own"]) == [0, 1, 2, 3, 4, 4, 5, 5] and "vertices_own" not in pattern.extra
    middle = [v for v in range(5) if np.abs(pattern.vertices[v] - [0.5, 0.5, 0]).max() < 1e-12]
    assert len(middle) == 1
    assert any("6 edges between 4 vertices were cut where they meet into 8 between 5" in n for n in pattern.notes)


def test_crossed_edges_in_a_tilted_plane_stay_there():
    tilted = crossed(vertices_coords=[[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]])
    pattern = fold_pattern(tilted, scale=1.0)
    assert len(pattern.faces) == 4 and pattern.vertices[:, 2] == pytest.approx(pattern.vertices[:, 0])


@pytest.mark.parametrize(
    "changes",
    [
        # an edge that ends on another one, one that lies on another one, and vertices at one place
        {"vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [0.5, 1]],
         "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5]], "edges_assignment": list("BBBBV"),
         "edges_foldAngle": None, "edges_own": None},
        {"vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0]],
         "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [0, 2]], "edges_assignment": list("BBBBBV"),
         "edges_foldAngle": None},
        {"vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [1, 1]],
         "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5]], "edges_assignment": list("BBBBV"),
         "edges_foldAngle": None, "edges_own": None},
    ],
)  # fmt: skip
def test_edges_that_meet_without_a_vertex(changes):
    pattern = fold_pattern(crossed(vertices_own=None, **changes))
    assert len(pattern.faces) == 2 and len(pattern.edges_assigned("V")) == 1


def test_vertices_of_no_face_are_left_out():
    pattern = fold_pattern(
        square(vertices_coords=[[9, 9], [0, 0], [1, 0], [1, 1], [0, 1], [2, 2]], vertices_own=list("abcdef"),
               edges_vertices=[[1, 2], [2, 3], [3, 4], [4, 1], [1, 3], [3, 5]], edges_assignment=list("BBBBVM"),
               edges_foldAngle=None, faces_vertices=[[1, 2, 3], [1, 3, 4]])
    )  # fmt: skip
    assert pattern.vertex_count == 4 and pattern.assignments == list("BBBBV")
    assert pattern.extra["vertices_own"] == list("bcde")
    assert any("2 vertices that belong to no face, and 1 edges to them, were left out" in n for n in pattern.notes)


def test_angles_half_a_turn_but_for_rounding():
    pattern = fold_pattern(square(edges_foldAngle=[0, 0, 0, 0, 180.00000001]))
    assert pattern.fold_angles[4] == math.pi


def test_the_crease_pattern_is_the_frame_that_is_folded():
    flat = {"frame_classes": ["creasePattern"], **crossed()}
    folded = {"frame_classes": ["foldedForm"], **crossed(vertices_coords=[[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]])}
    for document in ({"file_frames": [flat]}, {**folded, "file_frames": [{"frame_parent": 7}, flat]}):
        assert fold_pattern(document).vertices[:, 2].max() == 0
    assert fold_pattern({**crossed(), "file_frames": [folded]}).vertex_count == 5
    with pytest.raises(InputError, match="vertices missing"):
        fold_pattern({"file_frames": [flat]}, frame=0)


def test_of_equal_edges_the_one_with_an_angle_stays():
    again = square(
        edges_vertices=[[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [0, 2]],
        edges_assignment=list("BBBBMM"),
        edges_foldAngle=[None, None, None, None, None, -40],
    )
    pattern = fold_pattern(again)
    assert np.degrees(pattern.fold_angles[4]) == pytest.approx(-40)
    assert any("1 edge was listed twice and is one." in n for n in pattern.notes)


@pytest.mark.parametrize("words", BAD)
def test_bad_documents(words):
    with pytest.raises(InputError, match=words) as error:
        fold_pattern(BAD[words], file="my.fold")
    assert str(error.value).startswith("my.fold: ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"{", "malformed JSON"),
        (b"\xff\xfe", "malformed JSON"),
        (b"[1]", "not a JSON object"),
        (b'{"vertices_coords": [[NaN, 0]]}', "JSON does not have"),
        (b'{"vertices_coords": [[1e999, 0]]}', "not a finite number"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a": ' + b"1" * 5000 + b"}", "malformed JSON"),
    ],
)
def test_bad_text(tmp_path, text, words):
    path = tmp_path / "bad.fold"
    path.write_bytes(text)
    with pytest.raises(InputError, match=words) as error:
        read_fold(path)
    assert str(path) in str(error.value)


def test_read_pattern_dispatches(tmp_path):
    path = tmp_path / "A.FOLD"
    path.write_text(json.dumps(SQUARE))
    assert read_pattern(path).face_count == 2
    with pytest.raises(InputError, match=r"unknown pattern format.*\.fold"):
        read_pattern(tmp_path / "a.docx")
    with pytest.raises(InputError, match="no such file"):
        read_pattern(tmp_path / "none.fold")
    with pytest.raises(InputError, match="cannot be read"):
        read_fold(tmp_path)


def test_writing_what_cannot_be_written(tmp_path):
    pattern = fold_pattern(square())
    with pytest.raises(InputError, match="cannot write"):
        write_fold(pattern, tmp_path / "none" / "a.fold")
    pattern.extra["odd"] = {1, 2}
    with pytest.raises(InputError, match="as JSON"):
        write_fold(pattern, tmp_path / "a.fold")
    assert list(tmp_path.iterdir()) == []
