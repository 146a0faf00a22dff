"""SVG in the convention of Origami Simulator."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.pattern import read_svg

BORDER = '<rect x="0" y="0" width="20" height="10" stroke="#000" fill="none"/>'


def svg(tmp_path, body, head=""):
    path = tmp_path / "a.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>')
    return path


def test_split_merge_and_assign(tmp_path):
    body = (
        BORDER + '<line x1="10" y1="0" x2="10" y2="10" stroke="red" opacity="0.5"/><path d="M0 5h20" stroke="#0000FF"/>'
    )
    pattern = read_svg(svg(tmp_path, body))
    assert (pattern.vertex_count, pattern.edge_count, pattern.face_count) == (9, 12, 4)
    assert [pattern.assignments.count(letter) for letter in "BMV"] == [8, 2, 2]
    np.testing.assert_allclose(pattern.fold_angles[pattern.edges_assigned("M")], -math.pi / 2)
    np.testing.assert_allclose(pattern.fold_angles[pattern.edges_assigned("V")], math.pi)
    np.testing.assert_allclose(np.ptp(pattern.vertices, axis=0), [0.02, 0.01, 0])
    assert "1 mm" in pattern.notes[0]


def test_y_is_turned_upwards(tmp_path):
    body = '<path d="M0 0 L10 0 L0 10 Z" stroke="black"/>'
    assert sorted(read_svg(svg(tmp_path, body)).vertices[:, 1].tolist()) == pytest.approx([-0.01, 0, 0])


@pytest.mark.parametrize(
    ("colour", "letter"), [("yellow", "F"), ("rgb(255, 0, 255)", "U"), ("#0f0", "C"), ("green", "C"), ("#FF0000", "M")]
)
def test_colours(tmp_path, colour, letter):
    body = BORDER + f'<g style="stroke:{colour}"><polyline points="10,0 10,10"/></g>'
    pattern = read_svg(svg(tmp_path, body))
    (e,) = pattern.edges_assigned(letter)
    assert pattern.fold_angles[e] == 0.0 if letter == "F" else True


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
    pattern = read_svg(svg(tmp_path, BORDER + line))
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


def test_physical_size(tmp_path):
    pattern = read_svg(svg(tmp_path, BORDER, 'width="40mm" height="2cm" viewBox="0 0 20 10"'))
    assert np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.04)
    assert np.ptp(read_svg(svg(tmp_path, BORDER), unit="in").vertices[:, 0]) == pytest.approx(20 * 0.0254)


def test_near_ends_merge(tmp_path):
    body = (
        '<path d="M0 0 L20 0.0004 M20 0 V10 M20 10.0005 H0 M0 10 V0" stroke="black"/>'
        '<line x1="10" y1="0.001" x2="10" y2="9.999" stroke="red"/>'
    )
    assert read_svg(svg(tmp_path, body)).face_count == 2
    with pytest.raises(InputError, match="merge_tolerance"):
        read_svg(svg(tmp_path, body), merge_tolerance=1.0)


def test_what_is_left_out_is_told(tmp_path):
    body = BORDER + (
        '<line x1="1" y1="1" x2="2" y2="2" stroke="red"/><line x1="0" y1="0" x2="9" y2="9" stroke="orange"/>'
        '<text>hello</text><circle r="2" fill="red"/><line x1="10" y1="0" x2="10" y2="10" display="none" stroke="red"/>'
        '<line x1="0" y1="0" x2="20" y2="0" stroke="red"/><defs><path d="M0 0C1 1 2 2 3 3" stroke="red"/></defs>'
    )
    pattern = read_svg(svg(tmp_path, body))
    text = " ".join(pattern.notes)
    assert all(words in text for words in ("orange", "enclose nothing", "<text>", "without stroke", "drawn twice"))
    assert pattern.face_count == 1
    assert set(pattern.assignments) == {"B"}


def test_coloured_outline_is_border(tmp_path):
    pattern = read_svg(svg(tmp_path, BORDER.replace("#000", "red")))
    assert set(pattern.assignments) == {"B"}
    assert any("taken as border" in note for note in pattern.notes)


BAD = {
    "curve .cubic, command 'c'": BORDER + '<path d="M0 0c1 1 2 2 3 3" stroke="red"/>',
    "curve .arc": '<path d="M0 0 A 1 1 0 0 0 3 3" stroke="red"/>',
    "<circle> is a curve": '<circle r="3" stroke="black"/>',
    "no line in a crease colour.*orange": '<line x1="0" y1="0" x2="9" y2="9" stroke="orange"/>',
    "no line in a crease colour.*none": "",
    "enclose no face": '<line x1="0" y1="0" x2="9" y2="9" stroke="red"/>',
    "not a number": '<line x1="a" y1="0" x2="9" y2="9" stroke="red"/>',
    "no usable size": '<line x1="1e308" y1="0" x2="-1e308" y2="9" stroke="red"/>',
    "malformed path": '<path d="M0 0 L1" stroke="red"/>',
    "malformed path data": '<path d="M0 0 X1 2" stroke="red"/>',
    "does not start": '<path d="1 2 M0 0" stroke="red"/>',
    "malformed path ": '<path d="L1 1" stroke="red"/>',
    "odd number": '<polygon points="0,0 1" stroke="red"/>',
    "rect without area": '<rect width="0" height="1" stroke="red"/>',
    "rounded": '<rect width="1" height="1" rx="0.1" stroke="red"/>',
    "unsupported transform": '<g transform="skewX(3)"/>',
    "malformed transform": '<g transform="rotate 3"/>',
    "malformed XML": "<line>",
    "nested too deeply": "<g>" * 200 + "</g>" * 200,
    "shorter than the merge": '<path d="M0 0h1e-9M1 1h1e-9" stroke="red"/>',
}


@pytest.mark.parametrize("words", BAD)
def test_bad_drawings(tmp_path, words):
    with pytest.raises(InputError, match=words):
        read_svg(svg(tmp_path, BAD[words]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE svg [<!ENTITY a "aaaa">]><svg>&a;</svg>', "DOCTYPE"),
        ('<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://x"><svg/>', "DOCTYPE"),
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
