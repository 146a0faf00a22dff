"""`origami-sim run PATTERN`: what it prints, its exit codes and what it leaves."""

import json
import re

import numpy as np
import pytest
from drawings import drawn, frame

from origami_sim.pattern import grid, miura, strip, triangulate, waterbomb, write_fold, write_mesh
from origami_sim.results.run_folder import load_run

DEGREES = np.pi / 180


@pytest.fixture
def bomb(tmp_path):
    path = tmp_path / "bomb.fold"
    write_fold(waterbomb(0.1, target_angle=100 * DEGREES), path)
    return path


@pytest.fixture
def three(tmp_path):
    """Three valleys that fold flat: impossible."""
    ends = [(0, 2), (-2, -1.2), (2, -1.2)]
    lines = [("B", *a, *b) for a, b in zip(ends, ends[1:] + ends[:1], strict=True)]
    return drawn(tmp_path / "three.svg", lines + [("V", 0, 0, *e) for e in ends])


def test_a_pattern_that_folds(call, bomb, tmp_path):
    code, out, _ = call("run", bomb)
    assert code == 0
    assert re.search(r"All 6 creases fold to within 0\.01 deg of their targets\.", out)
    assert "No panel passes through another" in out
    run = load_run(tmp_path / "runs" / "bomb")
    assert len(run.trajectory.times) == 21
    np.testing.assert_allclose(run.tables["creases"]["error_deg"], 0.0, atol=1e-3)
    assert (tmp_path / "runs" / "bomb" / "folded.png").stat().st_size > 5_000
    assert run.replay.stat().st_size > 5_000


def test_a_pattern_that_does_not(call, three):
    code, out, _ = call("run", three)
    assert code == 1
    assert re.search(r"MISSED: [123] of 3 creases end more than 5 deg .* edge \d+ at \(.*\) mm, by \d+\.\d deg", out)
    assert "No shape has all these angles" in out
    assert "Try: " in out
    assert re.search(r"target_deg +angle_deg +error_deg", out)


def test_one_crease_is_said_in_the_singular(call, tmp_path):
    code, out, _ = call("run", drawn(tmp_path / "one.svg", [*frame(40, 10), ("V", 20, 0, 20, 10, 0.5)]))
    assert code == 0 and re.search(r"The crease folds to within 0\.01 deg of its target\.", out)


def test_panels_that_pass_through_each_other(call, tmp_path):
    """Of three panels turned by 150 degrees the last goes through the first; by 60 degrees they are an open roll."""
    for share, expected in ((1 / 3, 0), (5 / 6, 1)):
        lines = frame(40, 10) + [("V", x, 0, x, 10, share) for x in (15, 25)]
        code, out, _ = call("run", drawn(tmp_path / "roll.svg", lines), "--no-touch")
        assert code == expected and "All 2 creases fold" in out
    assert "A real sheet stops before these angles" in out and "mm of the flat pattern" in out


def test_a_shape_that_is_folded_already_is_said_to_be(call, tmp_path):
    write_fold(miura(2, 2, 0.02, 0.02, 60 * DEGREES, fold_angle=80 * DEGREES), tmp_path / "folded.fold")
    code, out, _ = call("run", "folded.fold")
    assert code == 0 and "fold to within" not in out
    assert re.search(r"The given shape is folded already: all 24 creases are within 0\.01 deg of their targets", out)


def test_of_fold_no_distance_of_merging_is_advised(call, tmp_path):
    """A crease that ends beside its vertex: the advice names both, and not a setting that is refused."""
    file = tmp_path / "open.fold"
    write_fold(miura(3, 3, 0.02, 0.02, 60 * DEGREES, target_angle=180 * DEGREES), file)
    document = json.loads(file.read_text())
    del document["faces_vertices"]
    at = np.array(document["vertices_coords"])[:, :2]
    hub = int(np.argmin(np.linalg.norm(at - at.mean(axis=0), axis=1)))
    edge = [e for e, pair in enumerate(document["edges_vertices"]) if hub in pair][2]
    other = [v for v in document["edges_vertices"][edge] if v != hub]
    document["vertices_coords"].append((at[hub] - [1.5e-3, 1e-3]).tolist())
    document["edges_vertices"][edge] = [*other, len(at)]
    file.write_text(json.dumps(document))
    code, out, _ = call("run", file, "--no-touch")
    assert code == 1 and "merge" not in out
    assert re.search(r"one vertex instead of it and the nearest, [0-9.]+ mm off at \([-0-9.]+, [-0-9.]+\) mm", out)


def test_as_json(call, three):
    code, out, _ = call("run", three, "--json")
    assert code == 1
    found = json.loads(out)
    assert found["reached"] is False
    assert found["reason"] == "targets contradict each other at 1 vertex"
    assert found["numbers"]["missed"] >= 1
    assert found["numbers"]["largest_error_deg"] > 59


def test_size_and_scale_from_the_command_line(call, tmp_path):
    path = drawn(tmp_path / "fold.svg", [*frame(300, 100), ("V", 100, 0, 100, 100, 0.5)])
    for given, size in (("size=15cm", 0.15), ("scale=1mm", 0.3), ("merge=0.001", 0.2)):
        assert call("run", path, "--set", given)[0] == 0
        x = load_run(tmp_path / "runs" / "fold").trajectory.model.position
        assert np.ptp(x[:, 0]) == pytest.approx(size)
    code, out, _ = call("run", path, "--settings")
    assert code == 0
    assert "size = 0 m" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.svg"], r"none\.svg: no such file"),
        (["bomb.fold", "--set", "size=1cm", "--set", "scale=1cm"], r"exclude each other"),
        (["bomb.fold", "--set", "stiffness=1"], r"cannot apply this setting.*crease_stiffness"),
        (["bomb.fold", "--set", "merge=0.001"], r"only drawings have points to merge"),
        (["box", "--touch"], r"only a pattern leaves this open.*--touch"),
        (["bomb.fold", "--panels", "rigid"], r"no such option.*--panels"),
        (["bomb.fold", "--set", "steps=0"], r"out of its range.*steps"),
        (
            ["dashed.svg"],
            r"dashed\.svg: the pattern gives no target angle; no line was read as a mountain or valley: "
            r"4 of stroke #000000 as border, 1 of stroke black dashed 4 2 as border; allowed: mountains and valleys by",
        ),
        (["flat.fold"], r"flat\.fold: .*no target angle"),
        (["sheet.obj"], r"sheet\.obj: a mesh has a shape, but no fold to go to"),
    ],
)
def test_what_is_refused(call, bomb, tmp_path, arguments, words):
    write_fold(grid(2, 1, 0.02, 0.02), tmp_path / "flat.fold")
    dashed = '<path d="M0 0L40 -10" stroke="black" stroke-dasharray="4 2"/></svg>'
    file = drawn(tmp_path / "dashed.svg", frame(40, 10))
    file.write_text(file.read_text().replace("</svg>", dashed))
    shape = miura(1, 1, 0.02, 0.02, 1.0)
    write_mesh(shape.vertices, triangulate(shape).triangles, tmp_path / "sheet.obj")
    code, _, err = call("run", *arguments)
    assert code == 2
    assert re.match(rf"origami-sim: .*{words}", err)
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "runs").exists()


def test_panels_that_would_pass_each_other_are_kept_apart_unless_told_otherwise(call, tmp_path):
    write_fold(
        strip([0.03, 0.02, 0.02, 0.02, 0.02], 0.02, fold_angles=np.full(4, 100 * DEGREES)), tmp_path / "tube.fold"
    )
    code, out, _ = call("run", "tube.fold")
    assert code == 1
    assert re.search(r"Panels keep each other off from \d+% on, .*No panel passes through another\.", out)
    code, out, _ = call("run", "tube.fold", "--no-touch")
    assert code == 1
    assert re.search(r"\d+ pairs of triangles pass through each other", out)
    code, out, _ = call("run", "tube.fold", "--touch", "--json")
    found = json.loads(out)
    assert code == 1 and found["reason"] == "panels are in each other's way"
    assert found["numbers"]["crossing_pairs"] == 0 < found["numbers"]["touching_pairs"]
