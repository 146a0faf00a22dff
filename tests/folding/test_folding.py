"""Folding to target angles: what is possible is reached, what is not is said, with where and why."""

import json
from itertools import pairwise

import numpy as np
import pytest
from drawings import drawn, frame

from origami_sim.errors import InputError
from origami_sim.folding import fold, read, summarise
from origami_sim.folding.consistency import vertices
from origami_sim.folding.elastic import Elastic
from origami_sim.folding.motion import model_of
from origami_sim.pattern import grid, miura, strip, waterbomb
from origami_sim.pattern.intersections import crossing_pairs

TWIST = np.radians(30)


def square_twist(path):
    """A square twist of Origami Simulator's kind: flat-foldable, but not rigidly."""
    inner = [0.5 * np.array([np.cos(t), np.sin(t)]) for t in TWIST + 0.5 * np.pi * np.arange(4)]
    lines = list(frame(4, 4, -2, -2))
    for n, p in enumerate(inner):
        q = inner[(n + 1) % 4]
        lines.append(("V", *p, *q))
    ways = [np.array(w) for w in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    for n, p in enumerate(inner):
        ahead = ways[n]
        lines.append(("V", *p, *(p + (2 - p @ ahead) * ahead)))
        side = ways[(n + 1) % 4]
        lines.append(("M", *p, *(p + (2 - p @ side) * side)))
    return drawn(path, lines)


@pytest.mark.parametrize("target", [60.0, 150.0, 180.0])
def test_a_miura_sheet_folds_to_the_closed_form(target):
    pattern = miura(3, 3, 0.02, 0.02, np.radians(60), target_angle=np.radians(target))
    folding = fold(pattern)
    assert folding.reached
    assert np.degrees(folding.errors.max()) < 0.01
    assert folding.stretch < 1e-5
    assert not folding.snaps


def test_every_frame_is_of_the_sheet_and_continuous():
    folding = fold(waterbomb(0.1, target_angle=np.radians(170)))
    assert len(folding.x) == 21
    for x, angles in zip(folding.x, folding.angles, strict=True):
        assert np.abs(folding.sheet.strains(x / folding.sheet.size)).max() < 0.01
        np.testing.assert_allclose(folding.sheet.angles(x, angles), angles, atol=1e-9)
    assert np.abs(np.diff(folding.angles, axis=0)).max() < np.radians(40)


def test_a_square_twist_folds_flat_by_bending_its_panels(tmp_path):
    folding = fold(read(square_twist(tmp_path / "twist.svg")))
    assert folding.reached
    assert np.degrees(folding.errors.max()) < 1.0
    assert folding.stretch < 0.01


def test_a_map_folds_one_crease_after_the_other(tmp_path):
    """At a vertex of right angles only one of two lines can turn at a time."""
    lines = [*frame(2, 2), ("V", 0, 1, 1, 1), ("V", 1, 1, 2, 1), ("M", 1, 0, 1, 1), ("V", 1, 1, 1, 2)]
    folding = fold(read(drawn(tmp_path / "map.svg", lines)))
    assert folding.reached
    first, second = np.abs(folding.angles[:, :2]).max(axis=1), np.abs(folding.angles[:, 2:4]).max(axis=1)
    both = np.minimum(first, second)
    assert np.degrees(both).max() > 175


@pytest.mark.parametrize(("marks", "excess"), [("MMMM", 4), ("MVMV", 0), ("VVVV", -4), ("MMMV", None), ("VMVV", None)])
def test_a_vertex_whose_layers_have_no_order_is_named(tmp_path, marks, excess):
    """Half a turn up and down are one turn, so that angles alone let four mountains pass (Maekawa)."""
    ends = [(1, 0), (2, 1), (1, 2), (0, 1)]
    lines = [*frame(2, 2), *((m, 1, 1, *e) for m, e in zip(marks, ends, strict=True))]
    folding = fold(read(drawn(tmp_path / "square.svg", lines)))
    found = summarise(folding, 2e-4)
    assert folding.reached and found.reached == (excess is None)
    text = f"No order of layers at 1 vertex, first at (100.0, 100.0) mm: mountains less valleys are {excess} there"
    assert (text in " ".join(found.sentences)) == (excess is not None)
    if excess is not None:
        assert found.reason == "no order of layers at 1 vertex"


def test_layers_of_what_does_not_fold_flat_are_not_asked_for(tmp_path):
    ends = [(1, 0), (2, 1), (1, 2), (0, 1)]
    lines = [*frame(2, 2), *(("M", 1, 1, *e, 0.5) for e in ends)]
    pattern = read(drawn(tmp_path / "square.svg", lines))
    assert not fold(pattern).unordered


def test_targets_that_contradict_each_other_are_said_to(tmp_path):
    """Three creases that fold flat never close (Maekawa): some crease stays 60 degrees off, wherever the sheet goes."""
    ends = [(0, 2), (-2, -2 / np.sqrt(3)), (2, -2 / np.sqrt(3))]
    lines = [("B", *a, *b) for a, b in zip(ends, ends[1:] + ends[:1], strict=True)]
    lines += [("V", 0, 0, *e) for e in ends]
    pattern = read(drawn(tmp_path / "three.svg", lines))
    folding = fold(pattern)
    assert not folding.reached
    (vertex,) = vertices(Elastic(pattern))
    assert np.degrees(vertex.gap) == pytest.approx(180, abs=1e-4)
    assert np.degrees(vertex.bound) == pytest.approx(60, abs=1e-4)
    assert np.degrees(folding.errors.max()) > 60 - 1e-6
    found = summarise(folding, 2e-4)
    assert not found.reached
    assert found.numbers["missed"] == len(found.worst["edge"]) > 0
    text = " ".join(found.sentences)
    for words in ("MISSED: ", "No shape has all these angles", "at least 60 deg", "Try: "):
        assert words in text


def test_curved_creases_do_not_fold_flat(tmp_path):
    arc = [(2 * np.cos(t), 2 * np.sin(t)) for t in np.radians(np.linspace(20, 160, 12))]
    lines = [("V", *a, *b) for a, b in pairwise(arc)]
    outer = [(1.4 * x, 1.4 * y) for x, y in arc]
    inner = [(0.6 * x, 0.6 * y) for x, y in arc]
    for line in (outer, inner):
        lines += [("B", *a, *b) for a, b in pairwise(line)]
    for n in (0, -1):
        lines += [("B", *outer[n], *arc[n]), ("B", *arc[n], *inner[n])]
    folding = fold(read(drawn(tmp_path / "curve.svg", lines)))
    assert folding.curved
    if not folding.reached:
        assert summarise(folding, 2e-4).reason == "curved creases cannot fold flat"
    half = fold(read(drawn(tmp_path / "half.svg", lines, opacity=0.25)))
    assert half.reached and not half.curved
    assert half.stretch < 0.01


def test_a_tolerance_decides_what_counts_as_reached():
    pattern = waterbomb(0.1, target_angle=np.radians(120))
    pattern.fold_angles[pattern.edges_assigned("M")[0]] += np.radians(4)
    assert fold(pattern).reached
    assert not fold(pattern, tolerance=np.radians(0.1)).reached


def test_small_targets_are_reached_to_a_tenth():
    """Equal small angles do not close a Miura vertex: what is within five degrees may still miss half the turn."""
    pattern = miura(3, 3, 0.02, 0.02, np.radians(60), target_angle=1.0)
    targets = np.isfinite(pattern.fold_angles) & (pattern.fold_angles != 0.0)
    pattern.fold_angles[targets] = np.radians(3.0) * np.sign(pattern.fold_angles[targets])
    folding = fold(pattern)
    found = summarise(folding, 2e-4)
    assert np.degrees(folding.errors.max()) < 2.0 and not folding.reached and not found.reached
    assert found.numbers["missed"] == np.sum(folding.errors > np.radians(0.3)) > 10
    assert "end more than 5 deg or 10% of the angle from their targets" in found.sentences[0]
    small = miura(3, 3, 0.02, 0.02, np.radians(60), target_angle=np.radians(3.0))
    assert fold(small).reached


def test_quantities_are_taken_with_their_units(tmp_path):
    path = drawn(tmp_path / "one.svg", [*frame(40, 10), ("V", 20, 0, 20, 10, 0.5)])
    for given, size in (({"size": "15 cm"}, 0.15), ({"scale": "1 mm"}, 0.04), ({"merge": "0.1 %"}, 0.2)):
        assert np.ptp(read(path, **given).vertices[:, 0]) == pytest.approx(size)
    folding = fold(read(path, size="15 cm"), thickness="0.3 mm", tolerance="2 deg")
    assert folding.thickness == pytest.approx(3e-4) and np.degrees(folding.tolerance) == pytest.approx(2.0)
    assert summarise(folding, "0.1 mm").reached and summarise(folding).reached


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda p: fold("x.dxf"), r"is no pattern \(field 'pattern', value 'x.dxf'\); allowed: a Pattern, as read"),
        (lambda p: fold(p, thickness="2 deg"), r"wrong unit \(field 'thickness', value 'deg'\); allowed: m, cm, mm"),
        (lambda p: fold(p, thickness=-1), r"number out of range \(field 'thickness', value -1\); allowed: 1e-06 to"),
        (lambda p: fold(p, thickness=None), r"not a finite number \(field 'thickness'\)"),
        (lambda p: fold(p, tolerance=5), r"out of range \(field 'tolerance', value 5\); allowed: 1e-06 to 3 rad"),
        (lambda p: fold(p, tolerance="five"), r"not a number \(field 'tolerance', value 'five'\)"),
        (lambda p: fold(p, steps="20"), r"bad count \(field 'steps', value '20'\)"),
        (lambda p: fold(p, steps=5000), r"out of range \(field 'steps', value 5000\); allowed: 1 to 1000"),
        (lambda p: read("x.svg", merge="2 mm"), r"wrong unit \(field 'merge', value 'mm'\)"),
        (lambda p: read(p), r"is no file \(field 'path', value 'Pattern'\)"),
    ],
)
def test_misuse_is_one_sentence(asked, words):
    with pytest.raises(InputError, match=words):
        asked(strip([0.02, 0.02], 0.02, fold_angles=[1.0]))


def test_a_shape_that_is_folded_already_stays_as_it_is():
    pattern = miura(2, 2, 0.02, 0.02, np.radians(60), fold_angle=np.radians(80))
    folding = fold(pattern)
    assert folding.reached
    np.testing.assert_allclose(np.ptp(folding.x, axis=0), 0.0, atol=1e-9)


def test_nothing_to_fold_is_refused():
    with pytest.raises(InputError, match="no target angle"):
        fold(grid(2, 1, 0.02, 0.02))
    with pytest.raises(InputError, match="no crease"):
        fold(grid(1, 1, 0.1, 0.1))


def test_halves_of_a_split_vertex_are_merged(tmp_path):
    """A vertex of four creases drawn as two of three, 1.5 mm apart on 20 cm: no odd vertex folds flat."""
    ends = [(np.cos(t), np.sin(t)) for t in np.radians([0, 70, 180, 290])]
    border = [(2, -2), (2, 2), (-2, 2), (-2, -2)]
    lines = [("B", *a, *b) for a, b in zip(border, border[1:] + border[:1], strict=True)]
    for n, (letter, (x, y)) in enumerate(zip("VMVV", ends, strict=True)):
        reach = 2 / max(abs(x), abs(y))
        lines.append((letter, 0.03 if n < 2 else 0.0, 0.0, x * reach, y * reach))
    lines.append(("V", 0, 0, 0.03, 0))
    pattern = read(drawn(tmp_path / "split.svg", lines))
    middle = pattern.vertices.mean(axis=0)
    assert np.sum(np.linalg.norm(pattern.vertices - middle, axis=1) < 0.05) == 1
    assert any("were taken to meet" in note for note in pattern.notes)
    assert fold(pattern).reached


def rolled(target):
    """A strip of five panels whose four creases turn the same way."""
    return strip([0.03, 0.02, 0.02, 0.02, 0.02], 0.02, fold_angles=np.full(4, np.radians(target)))


def test_a_strip_that_would_pass_itself_stops_where_it_touches():
    """Three squares and a longer panel close to a tube, whose flap would have to go through the first panel."""
    free, folding = fold(rolled(100.0), touch=False), fold(rolled(100.0))
    assert free.reached and len(crossing_pairs(free.x[-1], free.sheet.mesh.triangles, 0.0))
    assert not folding.reached and folding.touching
    assert 0 < folding.clear_from < 20
    for x in folding.x:
        assert not len(crossing_pairs(x, folding.sheet.mesh.triangles, 0.0))
    assert summarise(folding, 2e-4).reason == "panels are in each other's way"
    assert folding.stretch < 0.01
    whole = fold(rolled(100.0), touch=True)
    assert whole.clear_from == 0
    np.testing.assert_allclose(whole.angles[-1], folding.angles[-1], atol=np.radians(1.0))


def test_panels_that_touch_are_as_far_apart_as_they_are_thick():
    """A flap of 20 mm between two of 30 and 25 mm that are turned shut over it: the angles of a triangle."""
    thickness = 1e-3
    folding = fold(strip([0.03, 0.02, 0.03], 0.02, fold_angles=np.radians([150.0, 150.0])), thickness=thickness)
    assert not folding.reached
    sheet, x = folding.sheet, folding.x[-1]
    near = sheet.contact.at(x / sheet.size).pairs
    assert 0.8 < (near.distance / near.offset).min() < 1.0
    assert not len(crossing_pairs(x, sheet.mesh.triangles, 0.0))


@pytest.mark.parametrize("thickness", [1e-6, 1e-3, 5e-3, 1e-2])
def test_a_thicker_sheet_is_not_let_through_itself(thickness):
    """What counts as passing follows from the size of the sheet, whose flap ends in its first panel."""
    pattern = rolled(100.0)
    free = fold(pattern, thickness=thickness, touch=False)
    found = summarise(free)
    assert free.depth == pytest.approx(1e-3 * 0.11) and found.numbers["crossing_pairs"] == 9 and not found.reached
    folding = fold(pattern, thickness=thickness)
    assert folding.clear_from is not None and not len(folding.crossings)


@pytest.mark.parametrize(("thickness", "named"), [(5e-3, 0), (1.2e-2, 0), (1.4e-2, 1), (3e-2, 3)])
def test_a_sheet_too_thick_for_its_panels_is_said_to_be(thickness, named):
    """The middle panel of 20 mm has bends on both sides, of t pi / 4 each; the outer ones of 20 mm on one."""
    folding = fold(strip([0.02, 0.02, 0.02], 0.05, fold_angles=[np.pi, -np.pi]), thickness=thickness, touch=False)
    found = summarise(folding)
    text = f"{named} of 3 panels {'is' if named == 1 else 'are'} too narrow for the bends beside them"
    assert (text in " ".join(found.sentences)) == bool(named)
    assert found.reached == (not named)
    assert (found.reason == "the sheet is too thick for its panels") == bool(named)


def test_what_fits_is_not_changed_by_contact():
    pattern = miura(3, 3, 0.02, 0.02, np.radians(60), target_angle=np.radians(150.0))
    one, other = fold(pattern, thickness=1e-4), fold(pattern, thickness=1e-4, touch=True)
    assert one.reached and other.reached and one.clear_from is None
    np.testing.assert_allclose(one.angles[-1], other.angles[-1], atol=1e-3)


def test_a_shape_that_lies_in_itself_cannot_be_kept_apart():
    pattern = strip([0.02, 0.02], 0.02, fold_angles=[np.pi])
    pattern.vertices[4:, 0] = 0.001  # the second panel lies on the first
    with pytest.raises(InputError, match="overlap at the start"):
        fold(pattern, touch=True)
    model = model_of(fold(pattern, touch=False), thickness=1e-4, material="paper", crease_stiffness=1e-3)[0]
    assert len(model.triangles) == 4


def test_a_ring_is_not_folded_about_a_circle_by_stretching_it(tmp_path):
    """A circle that keeps one fold angle stays plane, so that one side would have to be a cone of another length.

    The drawing is exact, so that no strain is the drawing's fault.
    """
    circle = '<circle cx="10" cy="10" r="{}" fill="none" stroke="{}"{}/>'
    rings = ((9, "black", ""), (6, "red", ' opacity="0.3"'), (3, "black", ""))
    file = tmp_path / "ring.svg"
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{"".join(circle.format(*r) for r in rings)}</svg>')
    pattern = read(file)
    assert pattern.accuracy < 3e-4 * np.ptp(pattern.vertices[:, 0])
    folding = fold(pattern)
    assert not folding.reached
    rough = read(file, merge=3e-3)
    assert rough.accuracy == pytest.approx(3e-3 * np.hypot(*np.ptp(rough.vertices, axis=0)[:2]), rel=1e-6)


def test_what_a_drawing_misses_by_is_no_tear():
    pattern = miura(2, 2, 0.02, 0.02, np.radians(60), target_angle=1.0)
    sheet = Elastic(pattern)
    wide = sheet.reference * [1.02, 1.0, 1.0]
    pattern.accuracy = 0.01 * sheet.size
    rough = Elastic(pattern)
    change = np.abs(rough.strains(wide)) * rough.spans
    np.testing.assert_allclose(rough.misfits(wide), np.maximum(change - 0.01, 0) / rough.spans, atol=1e-12)
    assert rough.misfits(wide).max() < sheet.misfits(wide).max()


def test_strain_is_measured_between_all_corners_of_a_panel():
    """A square of two triangles that is sheared along a side strains one diagonal, of which only the other is a bar."""
    sheet = Elastic(strip([0.02, 0.02], 0.02, fold_angles=[1.0]))
    bars, flat = len(sheet.bars), sheet.reference
    long_ones = np.isclose(sheet.spans, np.sqrt(0.5))
    assert len(sheet.spans) == bars + 2 and np.sum(long_ones) == 4
    sheared = flat + 0.02 * flat[:, [1]] * [1.0, 0.0, 0.0]
    change = np.abs(sheet.strains(sheared))[long_ones]
    np.testing.assert_allclose(np.sort(change), [0.00995, 0.00995, 0.01005, 0.01005], rtol=0.01)
    bent = flat.copy()
    (j, k), apexes = sheet.hinges[-1, 1:3], sheet.hinges[-1, [0, 3]]
    axis = (flat[k] - flat[j]) / np.linalg.norm(flat[k] - flat[j])
    out = flat[apexes[0]] - flat[j]
    foot = flat[j] + (out @ axis) * axis
    bent[apexes[0]] = foot + np.linalg.norm(flat[apexes[0]] - foot) * np.array([0.0, 0.0, 1.0])
    of_panel = np.isin(sheet.panels.pairs, apexes).all(axis=1)
    np.testing.assert_allclose(sheet.strains(bent)[bars:][of_panel], 0.0, atol=1e-12)


@pytest.mark.parametrize("off", [0.0, 2.0, 6.0, 10.0])
def test_sectors_that_forbid_a_flat_fold_are_said(tmp_path, off):
    """Sectors of 40, 100, 140 + off and 80 - off degrees sum to 180 + off and 180 - off by turns (Kawasaki)."""
    file = tmp_path / "vertex.fold"
    rim = [7, 27, 47, 97, 147, 217 + off / 2, 287 + off, 327]
    ends = [[0.0, 0.0], *([np.cos(t), np.sin(t)] for t in np.radians(rim))]
    spokes = [[0, n] for n in (1, 3, 5, 7)]
    around = [[n, n % 8 + 1] for n in range(1, 9)]
    document = {"vertices_coords": ends, "edges_vertices": spokes + around, "edges_assignment": list("MVVV" + 8 * "B")}
    file.write_text(json.dumps(document))
    folding = fold(read(file))
    (found,) = folding.flat
    assert sorted(np.degrees(found.sums)) == pytest.approx([180 - off, 180 + off], abs=1e-6)
    assert np.degrees(found.accuracy) < 0.3
    said = " ".join(summarise(folding, 2e-4).sentences)
    assert (f"sums to {180 + off:.1f} and {180 - off:.1f} deg" in said) == (off > 0)


@pytest.mark.parametrize("letters", ["C", "CC"])
def test_the_sides_of_a_slit_part(tmp_path, letters):
    """Between two lines that turn the same way a slit lets the upper and lower half turn the other way about."""
    lines = [*frame(4, 4), ("V", 2, 0, 2, 2, 0.3), ("M", 2, 2, 2, 4, 0.3)]
    cut = [("C", 1, 2, 3, 2)] if letters == "C" else [("C", 1, 2, 2, 2), ("C", 2, 2, 3, 2)]
    sides = [(k, x, y0, x, y1, 0.15) for x in (1, 3) for k, y0, y1 in (("M", 0, 2), ("V", 2, 4))]
    folding = fold(read(drawn(tmp_path / "slit.svg", [*lines, *sides, *cut])))
    assert folding.reached
    lone = read(drawn(tmp_path / "lone.svg", [*frame(4, 4), ("C", 1, 2, 3, 2), ("V", 1, 0, 1, 4), ("M", 3, 0, 3, 4)]))
    assert np.sum(np.abs(lone.vertices[:, 0] - lone.vertices[:, 0].mean()) < 1e-9) >= 1  # the middle of the slit
    assert fold(lone).x.shape[0] == 21


def test_a_cut_edge_of_fold_without_a_middle_is_a_free_hinge():
    """Of FOLD the vertices are the user's: a cut of one edge stays one."""
    from origami_sim.pattern.fold import fold_pattern

    document = {
        "vertices_coords": [[0, 0], [3, 0], [3, 2], [0, 2], [1, 1], [2, 1], [1, 0], [2, 0], [1, 2], [2, 2]],
        "edges_vertices": [[0, 6], [6, 7], [7, 1], [1, 2], [2, 9], [9, 8], [8, 3], [3, 0],
                           [6, 4], [4, 8], [7, 5], [5, 9], [4, 5]],
        "edges_assignment": list("BBBBBBBBVVMMC"),
        "edges_foldAngle": [None] * 8 + [60, 60, -60, -60, None],
    }  # fmt: skip
    assert fold(fold_pattern(document)).reached


def test_only_a_folded_form_may_lie_in_itself(tmp_path):
    """The corner at (0.8, 0.3) lies beyond the diagonal, so that the second triangle covers a part of the first."""
    document = {
        "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.3]],
        "faces_vertices": [[0, 1, 2], [0, 2, 4], [0, 4, 3]],
        "edges_vertices": [[0, 1], [1, 2], [2, 0], [2, 4], [4, 0], [4, 3], [3, 0]],
        "edges_assignment": list("BBVBMBB"),
        "edges_foldAngle": [0, 0, 60, 0, -60, 0, 0],
    }
    file = tmp_path / "over.fold"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"over\.fold: panel 0 and panel 1 overlap.*foldedForm"):
        read(file)
    for change in (
        {"frame_classes": ["foldedForm"]},
        {"vertices_coords": [*document["vertices_coords"][:4], [0.2, 0.6]]},
    ):
        file.write_text(json.dumps(document | change))
        assert read(file).face_count == 3
