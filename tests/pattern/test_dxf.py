"""Patterns drawn as DXF: layers, colours, polylines and arcs."""

import math

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.folding import fold, read
from origami_sim.pattern import read_dxf, read_pattern


def entity(kind, *pairs, layer="0", colour=None):
    """The text of an entity."""
    shown = [] if colour is None else [(62, colour)]
    return "".join(f"{code:3d}\n{value}\n" for code, value in [(0, kind), (8, layer), *shown, *pairs])


def line(a, b, **options):
    return entity("LINE", (10, a[0]), (20, a[1]), (30, 0), (11, b[0]), (21, b[1]), (31, 0), **options)


def light(corners, *more, **options):
    return entity("LWPOLYLINE", *more, *[p for x, y in corners for p in ((10, x), (20, y))], **options)


def saved(folder, *entities, header=""):
    file = folder / "a.dxf"
    file.write_text(f"{header}  0\nSECTION\n  2\nENTITIES\n{''.join(entities)}  0\nENDSEC\n  0\nEOF\n")
    return file


SQUARE = light([(0, 0), (4, 0), (4, 4), (0, 4)], (90, 4), (70, 1))
FOLDS = [line((0, 0), (4, 4), colour=5), line((0, 4), (4, 0), colour=5), line((0, 2), (4, 2), colour=1)]


def test_it_folds(tmp_path):
    pattern = read(saved(tmp_path, SQUARE, *FOLDS), size=0.1)
    assert len(pattern.faces) == 6 and np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.1)
    assert pattern.assignments.count("V") == 4 and pattern.assignments.count("M") == 2
    assert fold(pattern).reached


def test_layers_by_name_and_by_their_colour(tmp_path):
    table = "  0\nSECTION\n  2\nTABLES\n  0\nLAYER\n  2\nfolds\n 62\n1\n  0\nENDSEC\n"
    named = [line((0, 0), (4, 4), layer="ValleyLine", colour=1), line((0, 4), (4, 0), layer="folds")]
    pattern = read_dxf(saved(tmp_path, SQUARE, *named, header=table))
    assert pattern.assignments.count("V") == 2 and pattern.assignments.count("M") == 2


def test_layers_that_say_nothing_are_listed_as_they_were_read(tmp_path):
    lines = [line((0, 0), (4, 4), layer="Tal"), line((0, 4), (4, 0), layer="Tal"), line((0, 2), (4, 2), layer="Berg")]
    with pytest.raises(InputError) as refused:
        fold(read(saved(tmp_path, SQUARE, *lines)))
    words = "no line was read as a mountain or valley: 2 of layer 'Tal' in colour 0,0,0 as border, 1 of layer '0' in"
    assert words in str(refused.value) and "1 of layer 'Berg' in colour 0,0,0 as border" in str(refused.value)
    assert not any("no line was read" in n for n in read(saved(tmp_path, SQUARE, *FOLDS)).notes)


def test_units_of_the_header_and_y_upwards(tmp_path):
    header = "  0\nSECTION\n  2\nHEADER\n  9\n$INSUNITS\n 70\n4\n  0\nENDSEC\n"
    pattern = read_pattern(saved(tmp_path, SQUARE, line((0, 1), (4, 1), colour=1), header=header))
    mountain = pattern.edges[pattern.edges_assigned("M")[0]]
    assert pattern.vertices[mountain, 1] == pytest.approx(1e-3) and pattern.vertices[:, 1].min() == pytest.approx(0)


def test_bulges_arcs_and_circles_are_round(tmp_path):
    """Areas within the flatness of half a disc of radius 1, of a quarter ring cut off, and of a disc."""
    half = light([(-1, 0), (1, 0)], (70, 1), (42, 1.0), (42, 0.0))
    quarter = [
        entity("ARC", (10, 0), (20, 0), (40, 1), (50, 270), (51, 0)),
        line((0, -1), (0, 0)),
        line((0, 0), (1, 0)),
    ]
    circle = entity("CIRCLE", (10, 0), (20, 0), (40, 1))
    for drawn, area in (([half], math.pi / 2), (quarter, math.pi / 4), ([circle], math.pi)):
        pattern = read_dxf(saved(tmp_path, *drawn), scale=1.0)
        x, y = pattern.vertices[list(pattern.faces[0]), :2].T
        assert 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) == pytest.approx(area, rel=5e-3)
    assert pattern.vertices[:, :2].min() == pytest.approx(-1, abs=2e-3)


def test_old_polylines(tmp_path):
    corners = [(0, 0), (4, 0), (4, 4), (0, 4)]
    vertices = "".join(entity("VERTEX", (10, x), (20, y)) for x, y in corners)
    old = entity("POLYLINE", (66, 1), (70, 1), (10, 0), (20, 0)) + vertices + entity("SEQEND")
    assert len(read_dxf(saved(tmp_path, old, *FOLDS)).faces) == 6


def test_what_is_left_out_is_said(tmp_path):
    others = [
        entity("TEXT", (10, 0), (20, 0), (1, "x")),
        line((0, 0), (1, 3), colour=30),
        line((0, 0), (1, 3), colour=8),
    ]
    notes = read_dxf(saved(tmp_path, SQUARE, *FOLDS, *others)).notes
    assert any("1 TEXT left out" in n for n in notes) and any("255,128,0 were left out" in n for n in notes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("AutoCAD Binary DXF\r\n", "binary DXF"),
        ("hello\nworld\n", "line 1.*'hello'"),
        ("", "no line in a crease colour"),
        ("  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n 10\nx\n", "is no number.*LINE.*'x'"),
        ("  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n 62\n7\n", "of no length"),
        ("  0\nSECTION\n  2\nENTITIES\n  0\nSPLINE\n", "1 SPLINE left out"),
        ("  0\nSECTION\n  2\nENTITIES\n  0\nCIRCLE\n 40\n1.5e308\n", "no usable size"),
    ],
)  # fmt: skip
def test_bad_files(tmp_path, text, words):
    file = tmp_path / "a.dxf"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_dxf(file)
