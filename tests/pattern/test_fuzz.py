"""Whatever the file holds, a reader returns a pattern or raises an InputError."""

import copy
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from origami_sim.errors import InputError
from origami_sim.pattern import Pattern, read_fold, read_mesh, read_svg, triangulate, write_fold

QUICK = settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from([10**400, -0.0, 1e308]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=8,
)
GOOD = {
    "file_spec": 1.2,
    "frame_unit": "mm",
    "vertices_coords": [[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
    "edges_assignment": ["B", "B", "B", "B", "M", "V", "C", "F"],
    "edges_foldAngle": [None, None, None, None, -90, 90, None, 0],
    "faces_vertices": [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    "edges_osim:stiffness": [0, 0, 0, 0, 1, 1, 1, 1],
    "edges_osim:restAngle": [0, 0, 0, 0, 1, 1, 1, 1],
    "faces_osim:thickness": [1, 1, 2, None],
    "faces_osim:material": ["a", None, "b", "c"],
    "file_frames": [
        {"frame_inherit": True, "frame_parent": 0, "vertices_coords": [[0, 0], [2, 0], [2, 1], [0, 1], [1, 0]]}
    ],
}
ODD = st.sampled_from(
    [None, True, -1, 0, 1, 5, 99, 0.5, "x", "M", [], [0], [0, 1], [1, 0, 2], {}, 1e308, 1e-308, 10**400, "mm", -181]
)


@st.composite
def mutated_folds(draw):
    document = copy.deepcopy(GOOD)
    for _ in range(draw(st.integers(1, 3))):
        node = document
        for _ in range(draw(st.integers(0, 3))):
            keys = list(node) if isinstance(node, dict) else list(range(len(node)))
            keys = [key for key in keys if isinstance(node[key], (dict, list)) and node[key]]
            if not keys:
                break
            node = node[draw(st.sampled_from(keys))]
        key = draw(st.sampled_from(list(node) if isinstance(node, dict) else list(range(len(node)))))
        if draw(st.booleans()):
            node[key] = copy.deepcopy(draw(ODD | JSON))
        else:
            del node[key]
        if not node or not document:
            break
    return document


def outcome(reader, path, **options):
    """Return the pattern, or None for an InputError; anything else fails the test."""
    try:
        pattern = reader(path, **options)
    except InputError as error:
        assert str(error).endswith(".")
        return None
    assert isinstance(pattern, Pattern)
    assert np.isfinite(pattern.vertices).all()
    assert len(pattern.assignments) == pattern.edge_count == len(pattern.fold_angles) == len(pattern.stiffness)
    try:
        split = triangulate(pattern)
        assert split.triangles.max() < len(split.vertices)
    except InputError:
        pass
    return pattern


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@QUICK
@given(document=mutated_folds(), frame=st.integers(0, 1))
def test_mutated_fold(folder, document, frame):
    path = folder / "a.fold"
    path.write_text(json.dumps(document))
    pattern = outcome(read_fold, path, frame=frame)
    if pattern is not None:
        write_fold(pattern, path)
        assert read_fold(path).equals(pattern)


@QUICK
@given(document=JSON | st.dictionaries(st.sampled_from(list(GOOD)), JSON))
def test_arbitrary_json(folder, document):
    path = folder / "b.fold"
    path.write_text(json.dumps(document))
    outcome(read_fold, path)


@QUICK
@given(data=st.binary(max_size=200))
def test_arbitrary_bytes(folder, data):
    for name, reader in (("c.fold", read_fold), ("c.svg", read_svg), ("c.obj", read_mesh), ("c.stl", read_mesh)):
        (folder / name).write_bytes(data)
        outcome(reader, folder / name)


DRAWING = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="40mm" viewBox="0 0 20 10"><style>.a{stroke:blue}</style>'
    '<g transform="translate(1,2) rotate(30) scale(2)"><rect width="20" height="10" stroke="#000"/>'
    '<line x1="10" y1="0" x2="10" y2="10" stroke="red" opacity="0.5"/><path class="a" d="M0 5 h20 M0 0L20 10"/>'
    '<polygon points="0,0 5,0 5,5" style="stroke:rgb(0,255,0);stroke-opacity:50%"/></g></svg>'
)
SCRAPS = [
    "",
    "-",
    "1e999",
    "0",
    "nan",
    "<",
    ">",
    '"',
    "M",
    "C",
    "Z",
    "red",
    ",",
    "9" * 30,
    "\u00e9",
    "é",
    "%",
    "rotate(",
    "<g>",
]


@QUICK
@given(
    edits=st.lists(
        st.tuples(st.integers(0, len(DRAWING)), st.integers(0, 6), st.sampled_from(SCRAPS) | st.text(max_size=3)),
        min_size=1,
        max_size=3,
    )
)
def test_mutated_svg(folder, edits):
    text = DRAWING
    for start, length, scrap in edits:
        text = text[:start] + scrap + text[start + length :]
    path = folder / "d.svg"
    path.write_bytes(text.encode("utf-8", "replace"))
    outcome(read_svg, path)


@QUICK
@given(
    lines=st.lists(st.tuples(*[st.integers(0, 6)] * 4, st.sampled_from(["black", "red", "blue", "lime"])), max_size=12)
)
def test_random_lines(folder, lines):
    body = "".join(f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}" stroke="{s}"/>' for a, b, c, d, s in lines)
    path = folder / "e.svg"
    path.write_text(f'<svg><rect width="6" height="6" stroke="black"/>{body}</svg>')
    pattern = outcome(read_svg, path, scale=1e-3)
    if pattern is not None:
        split = triangulate(pattern)
        a, b, c = (split.vertices[split.triangles[:, n]] for n in range(3))
        holes = any("hole" in note for note in pattern.notes)
        assert holes or 0.5 * np.cross(b - a, c - a)[:, 2].sum() == pytest.approx(36e-6, rel=1e-6)
