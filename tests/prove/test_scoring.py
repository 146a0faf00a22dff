"""Statistics and rules of the scoreboard."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from origami_sim import prove
from origami_sim.errors import InputError

TRUTH = Path(__file__).resolve().parents[2] / "benchmarks" / "concealed"

ANSWER = {
    **{"case": 0, "kind": "single", "null": "", "structure": "box", "mechanism": "dry_friction", "site": "fold2"},
    **{"names": ["crease_friction"], "strength": 2e-5, "number": "friction_moment", "d_wanted": 10.0, "d": 10.2},
}


def diagnosis(verdict: str, chosen: list[str], probability: float, **changes) -> dict:
    number = {"label": "crease_friction.friction_moment", "value": 2.1e-5, "low": 1.9e-5, "high": 2.3e-5}
    best = {"effects": ["crease_friction"], "numbers": [number]}
    errors = {"noise": [1.0, 1.0], "error_refitted": [3.0, 3.0], "error_after": [1.0, 1.0]}
    return {"verdict": verdict, "chosen": chosen, "probability": probability, "candidates": [best], **errors, **changes}


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    # Newcombe 1998, Statistics in Medicine 17:857, Table I, method 3 (score, without continuity correction)
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_of_the_literature(hits, count, low, high):
    assert prove.wilson(hits, count) == pytest.approx((low, high), abs=5e-5)


def test_wilson_without_cases_excludes_nothing():
    assert prove.wilson(0, 0) == (0.0, 1.0)


def test_calibration_error_weighs_bins_by_their_cases():
    # bin 0.8: three of four right, 0.85 stated; bin 0.5: none of one right, 0.55 stated
    stated, right = [0.85] * 4 + [0.55], [True, True, True, False, False]
    assert prove.calibration_error(stated, right) == pytest.approx((4 * abs(0.85 - 0.75) + 0.55) / 5)
    assert prove.calibration_error([1.0], [True]) == 0.0


def test_a_right_answer():
    row = prove.judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97))
    assert row["top1"] and row["inside"] and row["found_site"] and row["covered"] and not row["wrong"]
    assert row["recovery"] == pytest.approx(0.05)
    assert row["removed"] == pytest.approx(1.0)


def test_a_tie_holds_the_truth_without_naming_it_first():
    row = prove.judge(ANSWER, diagnosis("TIE", ["crease_hysteresis at fold2", "crease_friction at fold2"], 0.97))
    assert not row["top1"] and row["inside"] and row["correct"] and not row["wrong"]


@pytest.mark.parametrize(
    ("verdict", "chosen", "probability", "wrong"),
    [
        ("MECHANISM", ["tether at the body"], 0.95, True),
        ("MECHANISM", ["tether at the body"], 0.7, False),
        ("SEVERAL", ["crease_friction at fold2", "air_drag at all panels"], 0.95, True),
        ("TIE", ["tether at the body", "air_drag at all panels"], 0.95, True),
        ("ADEQUATE", [], 0.99, False),
        ("UNKNOWN", ["tether at the body"], 0.99, False),
    ],
)
def test_confidently_wrong(verdict, chosen, probability, wrong):
    row = prove.judge(ANSWER, diagnosis(verdict, chosen, probability))
    assert row["wrong"] == wrong and not row["top1"]


@pytest.mark.parametrize(
    ("null", "verdict", "chosen", "alarm"),
    [
        ("plain", "ADEQUATE", [], False),
        ("wrong_parameter", "PARAMETER", ["crease.stiffness"], False),
        ("plain", "MEASUREMENT", ["clock_rate at the measurement"], True),
        ("wrong_camera", "MEASUREMENT", ["angle_scale at the measurement"], False),
        ("wrong_camera", "MECHANISM", ["crease_friction at fold1"], True),
        ("wrong_camera", "TIE", ["crease_softness at fold1", "angle_scale at the measurement"], False),
        ("plain", "UNKNOWN", [], True),
        ("plain", "TIE", ["crease_friction at fold1", "nominal"], False),
    ],
)
def test_false_alarms(null, verdict, chosen, alarm):
    answer = {**ANSWER, "kind": "null", "null": null, "mechanism": "", "names": []}
    if null == "wrong_camera":
        answer |= {"mechanism": "angle_scale", "names": ["angle_scale"]}
    assert prove.judge(answer, diagnosis(verdict, chosen, 0.95))["alarm"] == alarm


def test_two_effects_are_right_only_together():
    answer = {**ANSWER, "kind": "double", "second": {"names": ["air_drag"]}}
    both = ["crease_friction at fold2", "air_drag at all panels"]
    row = prove.judge(answer, diagnosis("SEVERAL", both, 0.95))
    assert row["double"] and not row["wrong"]
    row = prove.judge(answer, diagnosis("MECHANISM", both[:1], 0.95))
    assert not row["double"] and row["wrong"]


def test_a_failed_diagnosis_counts_as_a_miss():
    rows = [prove.judge(ANSWER, {"failed": "out of memory"})]
    assert prove.scores(rows)["proportions"]["top1"] | {"met": None} == {
        **{"title": "top-1 mechanism, d' >= 5", "hits": 0, "count": 1, "share": 0.0, "low": 0.0},
        **{"high": pytest.approx(0.7935, abs=1e-4), "way": ">=", "target": 0.9, "met": None},
    }


def test_the_scoreboard_is_written_and_answers_cannot_be_changed(tmp_path):
    case, sealed = tmp_path / "cases" / "0000", tmp_path / "sealed" / "0000.json"
    case.mkdir(parents=True)
    sealed.parent.mkdir()
    sealed.write_text(json.dumps(ANSWER))
    (case / "answer.sha256").write_text(prove.hashlib.sha256(sealed.read_bytes()).hexdigest())
    (case / "diagnosis.json").write_text(json.dumps(diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97)))
    (tmp_path / "run.json").write_text(json.dumps({"seed": 3}))
    board = prove.report(tmp_path, 1, say=lambda text: None)
    assert board["proportions"]["top1"]["hits"] == 1 and not board["sealed"]
    assert "DEVELOPMENT" in (tmp_path / "scoreboard.txt").read_text()
    assert (tmp_path / "confusion.png").stat().st_size > 1000 and (tmp_path / "accuracy.png").exists()
    sealed.write_text(json.dumps({**ANSWER, "names": ["tether"]}))
    with pytest.raises(InputError, match="changed after it was sealed"):
        prove.report(tmp_path, 1, say=lambda text: None)


def test_the_truth_imports_nothing_of_this_package():
    files = sorted(TRUTH.glob("*.py"))
    assert len(files) >= 4
    allowed = {"mujoco", "numpy", "scipy", *sys.stdlib_module_names, *(f.stem for f in files)}
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0
                names = [node.module or ""]
            assert {n.partition(".")[0] for n in names} <= allowed, file


def test_the_diagnosis_cannot_open_an_answer(tmp_path):
    answer = tmp_path / "sealed" / "0000.json"
    answer.parent.mkdir()
    answer.write_text("{}")
    code = f"import sys; from origami_sim.prove import _guard; sys.addaudithook(_guard); open({str(answer)!r})"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.returncode and "sealed answer" in ran.stderr
