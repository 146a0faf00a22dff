"""SVG in the convention of Origami Simulator."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import read_svg, triangulate
from origami_sim.pattern.planar import split_segments
from origami_sim.pattern.topology import area_vector

BORDER = '<rect x="0" y="0" width="20" height="10" stroke="#000" fill="none"/>'


def svg(tmp_path, body, head=""):
    path = tmp_path / "a.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>')
    return path


def test_split_merge_and_assign(tmp_path):
    body = (
        BORDER + '<line x1="10" y1="0" x2="10" y2="10" stroke="red" opacity="0.5"/><path d="M0 5h20" stroke="#0000FF"/>'
    )
    pattern = read_svg(svg(tmp_path, body), scale=1e-3)
    assert (pattern.vertex_count, pattern.edge_count, pattern.face_count) == (9, 12, 4)
    assert [pattern.assignments.count(letter) for letter in "BMV"] == [8, 2, 2]
    np.testing.assert_allclose(pattern.fold_angles[pattern.edges_assigned("M")], -math.pi / 2)
    np.testing.assert_allclose(pattern.fold_angles[pattern.edges_assigned("V")], math.pi)
    np.testing.assert_allclose(np.ptp(pattern.vertices, axis=0), [0.02, 0.01, 0])


def test_y_is_turned_upwards(tmp_path):
    body = '<path d="M0 0 L10 0 L0 10 Z" stroke="black"/>'
    assert sorted(read_svg(svg(tmp_path, body), scale=1e-3).vertices[:, 1].tolist()) == pytest.approx([-0.01, 0, 0])


@pytest.mark.parametrize(
    ("colour", "letter"), [("yellow", "F"), ("rgb(255, 0, 255)", "U"), ("#0f0", "C"), ("green", "C"), ("#FF0000", "M")]
)
def test_colours(tmp_path, colour, letter):
    body = BORDER + f'<g style="stroke:{colour}"><polyline points="10,0 10,10"/></g>'
    pattern = read_svg(svg(tmp_path, body))
    (e,) = pattern.edges_assigned(letter)
    assert pattern.fold_angles[e] == 0.0 if letter == "F" else True


@pytest.mark.parametrize(
    ("colour", "letter", "share"),
    [
        ("rgb(255 0 0)", "M", 1.0),
        ("rgb(255 0 0 / 50%)", "M", 0.5),
        ("rgba(0, 0, 255, 0.25)", "V", 0.25),
        ("rgb(100% 0% 0% / .5)", "M", 0.5),
        ("RGB(0%, 0%, 100%)", "V", 1.0),
        ("hsl(0 100% 50%)", "M", 1.0),
        ("hsl(240deg 100% 50% / 25%)", "V", 0.25),
        ("hsla(0.6667turn, 100%, 50%, 50%)", "V", 0.5),
        ("hsl(0 0% 0%)", "B", None),
        ("#00f8", "V", 136 / 255),
        ("currentColor", "B", None),
        ("rgb(255 0)", None, None),
        ("rgb(255 0 0 50%)", None, None),
        ("hsl(0% 100% 50%)", None, None),
        ("lab(50% 40 59)", None, None),
    ],
)
def test_colours_as_css_writes_them(tmp_path, colour, letter, share):
    body = BORDER + f'<line x1="0" y1="0" x2="20" y2="10" stroke="{colour}"/>'
    pattern = read_svg(svg(tmp_path, body))
    if letter in ("M", "V"):
        (e,) = pattern.edges_assigned(letter)
        assert abs(pattern.fold_angles[e]) == pytest.approx(math.pi * share, rel=1e-6)
    else:
        assert not len(pattern.edges_assigned("MV"))
        assert (f"1 shapes in the unknown colour {colour} were left out." in pattern.notes) == (letter is None)


def test_current_colour_is_that_of_the_shape(tmp_path):
    lines = '<g stroke="currentColor" color="red"><path d="M10 0v10"/><path d="M0 5h20" style="color: #00f"/></g>'
    styled = "<style>g, .a {color: red; stroke: currentColor} .b {color: #00f}</style>"
    of_class = '<g><path class="a" d="M10 0v10"/><path class="b" d="M0 5h20"/></g>'
    for body in (lines, styled + of_class):
        pattern = read_svg(svg(tmp_path, BORDER + body))
        assert [pattern.assignments.count(letter) for letter in "BMV"] == [8, 2, 2]


def test_style_sheet_classes_and_stroke_opacity(tmp_path):
    style = "<style>.a, .b {stroke: blue; stroke-opacity: 25%}</style>"
    pattern = read_svg(svg(tmp_path, style + BORDER + '<line class="b" x1="10" y1="0" x2="10" y2="10"/>'))
    assert pattern.fold_angles[pattern.edges_assigned("V")] == pytest.approx(math.pi / 4)


@pytest.mark.parametrize(
    "transform",
    [
        "matrix(1 0 0 1 10 0)",
        "translate(10)",
        "translate(5, 0) scale(1) translate(5,0)",
        "rotate(90) rotate(-90, 5, 5)",
    ],
)
def test_transforms(tmp_path, transform):
    line = f'<g transform="{transform}"><line x1="0" y1="0" x2="0" y2="10" stroke="red"/></g>'
    if transform.startswith("rotate"):
        line = f'<g transform="translate(20,0)">{line}</g>'
    pattern = read_svg(svg(tmp_path, BORDER + line), scale=1e-3)
    (e,) = pattern.edges_assigned("M")
    np.testing.assert_allclose(pattern.vertices[pattern.edges[e], 0], 0.01, atol=1e-9)


def test_all_shapes_and_relative_paths(tmp_path):
    body = (
        '<polygon points="0,0 20,0 20,10 0,10" stroke="black"/>'
        '<path d="m5 0 v10 m5,0 L10 0 M15 0 l0 5 0 5" stroke="red"/>'
        '<polyline points="0 5 20 5" stroke="blue"/>'
    )
    pattern = read_svg(svg(tmp_path, body))
    assert pattern.face_count == 8
    assert pattern.assignments.count("M") == 6


def test_size(tmp_path):
    stated = svg(tmp_path, BORDER, 'width="40mm" height="2cm" viewBox="0 0 20 10"')

    def width(**options):
        return np.ptp(read_svg(stated, **options).vertices[:, 0])

    assert width() == pytest.approx(0.04)
    assert width(scale=0.0254) == pytest.approx(20 * 0.0254)
    assert width(size=0.3) == pytest.approx(0.3)
    in_pixels = svg(tmp_path, BORDER, 'width="2000px" height="1000" viewBox="0 0 20 10"')
    pattern = read_svg(in_pixels)
    assert np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.2)
    assert "0.2 m" in pattern.notes[0]
    for wrong in ({"size": 0.0}, {"scale": -1.0}, {"size": 1.0, "scale": 1.0}):
        with pytest.raises(InputError):
            read_svg(in_pixels, **wrong)


def test_a_doctype_is_passed_over_and_curves_are_cut_into_chords(tmp_path):
    """A quarter circle as a Bezier curve and as an arc: chords within the flatness, ends and area kept."""
    head = '<?xml version="1.0"?><!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/x.dtd">'
    path = tmp_path / "a.svg"
    box = '<path d="M0 0 H1 V1 H0 Z" stroke="black"/>'
    for curve in ("M0 1 C0.5523 1 1 0.5523 1 0", "M0 1 A1 1 0 0 0 1 0"):
        path.write_text(f'{head}<svg xmlns="http://www.w3.org/2000/svg">{box}<path d="{curve}" stroke="red"/></svg>')
        pattern = read_svg(path, size=1.0, flatness=1e-3)
        ends = pattern.edges[pattern.edges_assigned("M")]
        middles = pattern.vertices[ends].mean(axis=1)  # y was turned upwards
        assert pattern.face_count == 2
        assert 7 <= len(ends) <= 20
        radii = np.linalg.norm(middles, axis=1)
        assert radii == pytest.approx(np.ones(len(ends)), abs=2.1e-3)
        finer = read_svg(path, size=1.0, flatness=1e-5)
        assert len(finer.edges_assigned("M")) == pytest.approx(10 * len(ends), rel=0.2)


def test_opacities_of_groups_multiply_and_colours_near_the_six_count(tmp_path):
    body = BORDER + (
        '<g opacity="0.5"><g style="stroke:#ED1C24"><line x1="5" y1="0" x2="5" y2="10" opacity="0.5"/></g></g>'
        '<line x1="10" y1="0" x2="10" y2="10" stroke="#2E3192" stroke-opacity="50%"/>'
    )
    pattern = read_svg(svg(tmp_path, body))
    assert pattern.fold_angles[pattern.edges_assigned("M")] == pytest.approx(-math.pi / 4)
    assert pattern.fold_angles[pattern.edges_assigned("V")] == pytest.approx(math.pi / 2)


def test_clones_are_drawn_and_endless_ones_refused(tmp_path):
    line = '<defs><line id="l" x1="5" y1="0" x2="5" y2="10" stroke="red"/></defs>'
    pattern = read_svg(svg(tmp_path, BORDER + line + '<use href="#l"/><use href="#l" x="10"/>'))
    assert pattern.assignments.count("M") == 2
    bomb = '<line id="u0" x1="0" y1="0" x2="9" y2="9" stroke="red"/>' + "".join(
        f'<g id="u{n}">' + f'<use href="#u{n - 1}"/>' * 10 + "</g>" for n in range(1, 9)
    )
    with pytest.raises(InputError, match="too many elements"):
        read_svg(svg(tmp_path, bomb))
    with pytest.raises(InputError, match="refers to itself"):
        read_svg(svg(tmp_path, '<g id="a"><use href="#a"/></g>'))


def test_thousands_of_crossing_lines_are_refused_in_one_sentence(tmp_path):
    rng = np.random.default_rng(3)
    ends = rng.uniform(0, 100, (3000, 4))
    body = "".join(f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}" stroke="red"/>' for a, b, c, d in ends.tolist())
    with pytest.raises(InputError, match="cross too often"):
        read_svg(svg(tmp_path, body))


def test_crossings_of_a_grid(tmp_path):
    """60 x 60 crossing lines: 3600 crossings, 61 x 61 faces inside the border."""
    marks = np.arange(1, 61) / 61
    lines = [((0, m), (1, m)) for m in marks] + [((m, 0), (m, 1)) for m in marks]
    lines += [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0))]
    starts, ends = np.array(lines).transpose(1, 0, 2)
    points, pieces = split_segments(starts, ends, 1e-6)
    assert len(points) == 62 * 62
    assert len(pieces) == 2 * 62 * 61


def test_hand_drawn_gaps_are_closed_and_fine_pleats_kept(tmp_path):
    """Ends that miss by up to 0.15 % of the sheet are joined; pleats of 0.5 % beside exact ends stay."""
    rng = np.random.default_rng(1)
    body = BORDER
    for x in range(2, 20, 2):
        top, bottom = rng.uniform(-0.015, 0.015, 2)
        body += f'<line x1="{x}" y1="{top}" x2="{x}" y2="{10 + bottom}" stroke="red"/>'
    assert read_svg(svg(tmp_path, body)).face_count == 10
    pleats = "".join(f'<line x1="{x}" y1="0" x2="{x}" y2="10" stroke="red"/>' for x in (5, 5.1, 10, 10.1))
    assert read_svg(svg(tmp_path, BORDER + pleats)).face_count == 5


def test_near_ends_merge(tmp_path):
    body = (
        '<path d="M0 0 L20 0.0004 M20 0 V10 M20 10.0005 H0 M0 10 V0" stroke="black"/>'
        '<line x1="10" y1="0.001" x2="10" y2="9.999" stroke="red"/>'
    )
    assert read_svg(svg(tmp_path, body)).face_count == 2
    with pytest.raises(InputError, match="merge_tolerance"):
        read_svg(svg(tmp_path, body), merge_tolerance=1.0)


HUB = [(0, 0), (80, 80), (80, 0), (0, 80), (0, 40), (80, 40)]


@pytest.mark.parametrize("missing", range(6))
def test_joined_ends_are_said_and_are_where_most_lines_end(tmp_path, missing):
    """Of six lines to the middle one ends 0.13 short of it, whichever is drawn first."""
    lines = []
    for n, (x, y) in enumerate(HUB):
        away = math.hypot(x - 40, y - 40)
        end = (40 + 0.13 * (x - 40) / away, 40 + 0.13 * (y - 40) / away) if n == missing else (40, 40)
        colour = "red" if n > 3 else "blue"
        lines.append(f'<path d="M{x + 10} {y + 20}L{end[0] + 10} {end[1] + 20}" stroke="{colour}"/>')
    border = '<rect x="10" y="20" width="80" height="80" stroke="#000"/>'
    head = 'viewBox="10 20 80 80" width="80mm" height="80mm"'
    pattern = read_svg(svg(tmp_path, border + "".join(lines), head))
    (note,) = [n for n in pattern.notes if "joined" in n]
    assert "joined in a point, by 0.13 of the drawing's units, at (50.00, 60.00)" in note
    middle = pattern.vertices[:, :2].min(axis=0) + 0.04
    assert np.linalg.norm(pattern.vertices[:, :2] - middle, axis=1).min() < 1e-7


def test_what_is_drawn_twice_and_loose_is_said_with_its_place(tmp_path):
    body = BORDER + '<path d="M10 0v10" stroke="red"/><path d="M10 0v5" stroke="blue"/><path d="M12 4h2" stroke="red"/>'
    notes = " ".join(read_svg(svg(tmp_path, body)).notes)
    assert "1 edge is drawn twice in different colours or opacities, at (10.00, 2.50); the first of" in notes
    assert "1 line piece that encloses nothing was left out, at (13.00, 4.00); mountains or valleys are all." in notes


def test_lines_too_short_to_be_are_said(tmp_path):
    body = BORDER + '<path d="M10 0v10" stroke="red"/><path d="M4 4l0.0005 0" stroke="red"/>'
    assert any("1 line shorter than 0.00" in n and "at (4.00, 4.00)" in n for n in read_svg(svg(tmp_path, body)).notes)


def test_what_is_left_out_is_told(tmp_path):
    body = BORDER + (
        '<line x1="1" y1="1" x2="2" y2="2" stroke="red"/><line x1="0" y1="0" x2="9" y2="9" stroke="orange"/>'
        '<text>hello</text><circle r="2" fill="red"/><line x1="10" y1="0" x2="10" y2="10" display="none" stroke="red"/>'
        '<line x1="0" y1="0" x2="20" y2="0" stroke="red"/><defs><path d="M0 0C1 1 2 2 3 3" stroke="red"/></defs>'
    )
    pattern = read_svg(svg(tmp_path, body))
    text = " ".join(pattern.notes)
    assert all(
        words in text for words in ("orange", "encloses nothing", "<text>", "without stroke", "1 edge is drawn twice")
    )
    assert "the first of border, cut, mountain, valley" in text
    assert pattern.face_count == 1
    assert set(pattern.assignments) == {"B"}


def test_coloured_outline_is_border(tmp_path):
    pattern = read_svg(svg(tmp_path, BORDER.replace("#000", "red")))
    assert set(pattern.assignments) == {"B"}
    assert any("taken as border" in note for note in pattern.notes)


BAD = {
    "no line in a crease colour.*orange": '<line x1="0" y1="0" x2="9" y2="9" stroke="orange"/>',
    "no line in a crease colour.*klingon": '<line x1="0" y1="0" x2="9" y2="9" stroke="klingon"/>',
    "no line in a crease colour.*none": "",
    "enclose no face": '<line x1="0" y1="0" x2="9" y2="9" stroke="red"/>',
    "no usable size": '<line x1="1e308" y1="0" x2="-1e308" y2="9" stroke="red"/>',
    "cannot read the drawing": '<path d="M0 0 L1" stroke="red"/>',
    "malformed XML": "<line>",
    "nested too deeply": "<g>" * 200 + "</g>" * 200,
}


@pytest.mark.parametrize("words", BAD)
def test_bad_drawings(tmp_path, words):
    with pytest.raises(InputError, match=words):
        read_svg(svg(tmp_path, BAD[words]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE svg [<!ENTITY a "aaaa">]><svg>&a;</svg>', "entity"),
        ('<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]><svg>&a;</svg>', "entity"),
        ("<html/>", "root element"),
        ("", "malformed XML"),
        ('<?xml version="1.0" encoding="klingon"?><svg/>', "malformed XML"),
    ],
)
def test_bad_xml(tmp_path, text, words):
    path = tmp_path / "a.svg"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_svg(path)


@pytest.mark.parametrize(
    ("inner", "faces_of_hole"),
    [
        ('<rect x="30" y="30" width="20" height="20" stroke="black"/>', 0),  # a window
        ('<rect x="30" y="30" width="20" height="20" stroke="#00ff00"/>', 1),  # a piece that is cut out
        ('<path d="M0 0 L30 20 L20 30 Z" stroke="black"/>', 0),  # a window that touches a corner
    ],
)
def test_a_panel_with_a_hole_is_cut_into_facets(tmp_path, inner, faces_of_hole):
    path = tmp_path / "hole.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><rect width="100" height="80" stroke="black"/>'
        f'<line x1="70" y1="0" x2="70" y2="80" stroke="blue"/>{inner}</svg>'
    )
    pattern = read_svg(path, scale=1.0)
    area = sum(np.linalg.norm(area_vector(pattern.vertices, f)) for f in pattern.faces)
    hole = 400.0 if "rect" in inner else 250.0
    assert area == pytest.approx(8000.0 - hole * (1 - faces_of_hole))
    assert any("1 panel with a hole" in note for note in pattern.notes)
    assert all(len(set(f)) == len(f) for f in pattern.faces)
    triangulate(pattern)


def test_many_lines_through_one_place_need_no_more_memory():
    from origami_sim.pattern.planar import merge_points

    there = np.array([0.3, 0.7]) + 1e-16 * np.arange(40_000)[:, None]  # pairs of them would be 800 million
    points, place = merge_points(np.vstack([[0.0, 0.0], there, [1.0, 0.0]]), 1e-4)
    assert len(points) == 3 and place[0] == 0 and set(place[1:-1]) == {1} and place[-1] == 2
    assert points[1] == pytest.approx([0.3, 0.7])


def test_a_heap_of_points_is_refused():
    from origami_sim.pattern.planar import merge_points

    heap = np.random.default_rng(0).normal(0, 1e-5, (6000, 2))
    with pytest.raises(InputError, match="too many points"):
        merge_points(heap, 1e-3)


def test_a_border_in_another_colour(tmp_path):
    """Without any black, the outline of what other lines enclose is the border, if the creases lie in it."""
    grey = '<rect x="0" y="0" width="4" height="2" stroke="#888" fill="none"/><path d="M2 0V2" stroke="#888"/>'
    fold = '<path d="M{} 0V2" stroke="red"/>'
    file = tmp_path / "a.svg"
    file.write_text(f"<svg>{grey}{fold.format(1)}</svg>")
    pattern = read_svg(file, scale=1.0)
    assert len(pattern.faces) == 2 and len(pattern.edges_assigned("M")) == 1
    assert any("the outline in #888 was taken as border" in n for n in pattern.notes)
    for other in ('<path d="M0 0V1" stroke="black"/>' + fold.format(1), fold.format(5)):
        file.write_text(f"<svg>{grey}{other}</svg>")
        with pytest.raises(InputError, match="enclose no face"):
            read_svg(file)


def test_folds_without_a_border_around_them_are_told(tmp_path):
    file = tmp_path / "a.svg"
    file.write_text('<svg><path d="M0 0H2V2H0Z M2 0H4 M2 2H4" stroke="red"/></svg>')
    notes = read_svg(file).notes
    assert any(
        "2 line pieces that enclose nothing were left out, at (3.000, 0.000), (3.000, 2.000); mountains or valleys "
        "are all: no border is drawn" in n
        for n in notes
    )
