"""Statistics and rules of the scoreboard."""

import ast
import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from origami_proof import score
from origami_proof.score import judge
from origami_sim.errors import InputError

TRUTH = Path(__file__).resolve().parents[1] / "concealed"

ANSWER = {
    **{"case": 0, "kind": "single", "null": "", "structure": "box", "mechanism": "dry_friction", "site": "fold2"},
    **{"names": ["crease_friction"], "strength": 2e-5, "number": "friction_moment", "d_wanted": 10.0, "d": 10.2},
}


def diagnosis(verdict: str, chosen: list[str], probability: float, **changes) -> dict:
    number = {"label": "crease_friction.friction_moment", "value": 2.1e-5, "low": 1.9e-5, "high": 2.3e-5}
    best = {"effects": ["crease_friction"], "numbers": [number], "label": "one", "probability": 0.9, "failed": ""}
    errors = {"noise": [1.0, 1.0], "error_refitted": [3.0, 3.0], "error_after": [1.0, 1.0]}
    return {"verdict": verdict, "chosen": chosen, "probability": probability, "candidates": [best], **errors, **changes}


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    # Newcombe 1998, Statistics in Medicine 17:857, Table I, method 3 (score, without continuity correction)
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_of_the_literature(hits, count, low, high):
    assert score.wilson(hits, count) == pytest.approx((low, high), abs=5e-5)


def test_wilson_without_cases_excludes_nothing():
    assert score.wilson(0, 0) == (0.0, 1.0)


def test_calibration_error_weighs_bins_by_their_cases():
    # bin 0.8: three of four right, 0.85 stated; bin 0.5: none of one right, 0.55 stated
    stated, right = [0.85] * 4 + [0.55], [True, True, True, False, False]
    assert score.calibration_error(stated, right) == pytest.approx((4 * abs(0.85 - 0.75) + 0.55) / 5)
    assert score.calibration_error([1.0], [True]) == 0.0


def test_few_probabilities_that_are_right_have_a_calibration_error_by_chance():
    # of n at 0.85 the share that is right scatters by sqrt(p q / n), and |normal| is 0.798 of that in the mean
    for n in (20, 500):
        assert score.calibration_by_chance([0.85] * n) == pytest.approx(0.798 * np.sqrt(0.85 * 0.15 / n), rel=0.06)


def test_a_right_answer():
    row = judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97))
    assert row["top1"] and row["inside"] and row["found_site"] and row["covered"] and not row["wrong"]
    assert row["blamed"] is False
    assert row["recovery"] == pytest.approx(0.05) and row["elements"] == [1, 0, 0]
    assert (row["strength"], row["value"], row["low"], row["high"]) == (2e-5, 2.1e-5, 1.9e-5, 2.3e-5)
    assert row["removed"] == pytest.approx(1.0)


def test_the_strength_at_another_site_is_another_number():
    """A foot that rubs less and one that rubs more look alike, with opposite numbers."""
    row = judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold1"], 0.97))
    assert row["top1"] and row["found_site"] is False and row["covered"] is None and row["value"] is None


def test_what_the_screening_sees_of_an_effect_is_its_score_over_what_was_concealed():
    seen = [("crease_friction", "fold2", -8.1), ("crease_friction", "all creases", 9.0), ("air_drag", "fold2", 20.0)]
    screening = [dict(zip(("effect", "site", "z"), s, strict=True)) for s in seen]
    row = judge(ANSWER, diagnosis("ADEQUATE", [], 0.9, screening=screening))
    assert row["seen"] == pytest.approx(8.1 / 10.2)
    assert judge(ANSWER, diagnosis("ADEQUATE", [], 0.9, screening=screening[1:]))["seen"] == pytest.approx(9.0 / 10.2)
    assert judge(ANSWER, diagnosis("ADEQUATE", [], 0.9, screening=screening[2:]))["seen"] is None
    assert score.scores([row])["seen"] == row["seen"]


def test_a_tie_holds_the_truth_without_naming_it_first():
    row = judge(ANSWER, diagnosis("TIE", ["crease_hysteresis at fold2", "crease_friction at fold2"], 0.97))
    assert not row["top1"] and row["inside"] and row["correct"] and not row["wrong"]
    assert row["placed"] and row["found_site"] is None  # the right place, by the wrong name


def test_every_case_that_went_wrong_is_listed_whatever_its_kind():
    second = ANSWER | {"kind": "double", "second": {"names": ["air_drag"], "site": ""}}
    friction = diagnosis("MECHANISM", ["crease_friction at fold2"], 0.8)
    rows = [
        judge(ANSWER | {"case": 11}, friction),
        judge(ANSWER | {"case": 22, "kind": "outside"}, friction),
        judge(second | {"case": 33}, friction),
        judge(ANSWER | {"case": 44, "kind": "outside"}, diagnosis("UNKNOWN", [], None)),
    ]
    board = {"sealed": False, "seed": 1, "cases": 4, "failed": 0, **score.scores(rows), "rows": rows}
    listed = score.text_of(board).partition("cases that went wrong")[2]
    assert [line.split()[0] for line in listed.strip().splitlines()] == ["22", "33"]


@pytest.mark.parametrize(
    ("verdict", "chosen", "probability", "wrong", "blamed"),
    [
        ("MECHANISM", ["tether at the body"], 0.95, True, True),
        ("MECHANISM", ["tether at the body"], 0.7, False, True),
        ("SEVERAL", ["crease_friction at fold2", "air_drag at all panels"], 0.95, True, True),
        ("TIE", ["tether at the body", "air_drag at all panels"], 0.95, True, None),
        ("ADEQUATE", [], 0.99, True, None),  # where something was concealed
        ("PARAMETER", [], 0.8, False, None),
        ("UNKNOWN", ["tether at the body"], 0.99, False, None),
    ],
)
def test_confidently_wrong(verdict, chosen, probability, wrong, blamed):
    """Only what is named alone is blamed, however sure that is; UNKNOWN has no probability."""
    row = judge(ANSWER, diagnosis(verdict, chosen, probability))
    assert row["wrong"] == wrong and row["blamed"] == blamed and not row["top1"]


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
    assert judge(answer, diagnosis(verdict, chosen, 0.95))["alarm"] == alarm


def test_two_effects_are_right_only_together():
    answer = {**ANSWER, "kind": "double", "second": {"names": ["air_drag"]}}
    both = ["crease_friction at fold2", "air_drag at all panels"]
    row = judge(answer, diagnosis("SEVERAL", both, 0.95))
    assert row["double"] and not row["wrong"]
    row = judge(answer, diagnosis("MECHANISM", both[:1], 0.95))
    assert not row["double"] and row["wrong"]


def test_beside_a_law_outside_the_catalogue_one_of_it_is_named_alone_or_with_an_imitation():
    answer = {**ANSWER, "kind": "beside", "second": {"names": []}}
    row = judge(answer, diagnosis("MECHANISM", ["crease_friction at fold2"], 0.95))
    assert row["beside"] and row["beside_alone"] and not row["wrong"]
    row = judge(answer, diagnosis("SEVERAL", ["crease_friction at fold2", "air_drag at all panels"], 0.6))
    assert row["beside"] and not row["beside_alone"] and not row["correct"]
    row = judge(answer, diagnosis("UNKNOWN", ["crease_friction at fold2"], None))
    assert not row["beside"] and row["correct"] is None
    assert score.scores([row])["proportions"]["beside"]["count"] == 1


def test_a_failed_diagnosis_counts_as_a_miss():
    rows = [judge(ANSWER, {"failed": "out of memory"})]
    board = score.scores(rows)
    assert board["proportions"]["top1"] == {
        **{"title": "top-1 mechanism, d' >= 5", "hits": 0, "count": 1, "share": 0.0, "low": 0.0},
        **{"high": pytest.approx(0.7935, abs=1e-4), "target": (0.9, 1.0), "met": False},
    }
    assert board["elements"]["f1"] == 0.0  # it named nothing where there was something


CONFOUNDED = {**ANSWER, "kind": "confounded", "rival": {"names": ["crease_hysteresis"]}}
BOTH = ["crease_hysteresis at fold2", "crease_friction at fold2", "crease_set at fold2"]


def test_a_confounded_pair_is_said_only_by_a_tie_of_both():
    row = judge(CONFOUNDED, diagnosis("TIE", BOTH, 0.97))
    assert row["said"] and not row["wrong"] and row["top1"] is None
    assert not judge(CONFOUNDED, diagnosis("TIE", BOTH[1:], 0.97))["said"]
    row = judge(CONFOUNDED, diagnosis("MECHANISM", BOTH[:1], 0.97))
    assert not row["said"] and row["wrong"]
    assert judge(CONFOUNDED, {"failed": "out of memory"})["said"] is False


def test_an_experiment_separates_if_the_truth_is_then_named_alone():
    tie, named = diagnosis("TIE", BOTH, 0.97), diagnosis("MECHANISM", BOTH[1:2], 0.97)
    row = judge(CONFOUNDED, tie, {"separating": named, "suggested": tie})
    assert row["separated"] is True and row["resolved"] is False
    row = judge(CONFOUNDED, tie, {"separating": diagnosis("MECHANISM", BOTH[:1], 0.97)})
    assert row["separated"] is False and row["resolved"] is None
    assert judge(CONFOUNDED, tie, {"separating": {"failed": "out of memory"}})["separated"] is False
    decided = [
        judge(CONFOUNDED, tie, {"separating": d})["decided"] for d in (named, diagnosis("TIE", BOTH[1:], 0.9), tie)
    ]
    assert decided == [True, True, False], "a third effect may stay, the rival not"
    assert judge(CONFOUNDED, tie, {"separating": diagnosis("MECHANISM", BOTH[2:], 0.9)})["decided"] is False
    lost = diagnosis("TIE", [BOTH[0], BOTH[2]], 0.97)  # without the truth there is nothing to resolve
    assert judge(CONFOUNDED, lost, {"suggested": named})["resolved"] is None
    board = score.scores([row])
    assert board["proportions"]["separated"]["count"] == 1 and board["proportions"]["resolved"]["share"] is None
    assert board["by_pair"]["dry_friction"]["hits"] == 1


def test_elements_named_wrongly_and_missed():
    named = diagnosis("SEVERAL", ["crease_friction at fold2", "air_drag at all panels", "field_lag at the drive"], 0.5)
    assert judge(ANSWER, named)["elements"] == [1, 1, 0]
    assert judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold1"], 0.5))["elements"] == [0, 1, 1]
    assert judge(ANSWER, diagnosis("UNKNOWN", ["crease_friction at fold2"], 0.5))["elements"] == [0, 0, 1]
    channel = diagnosis("MEASUREMENT", ["angle_offset at channel fold2"], 0.5)
    assert judge({**ANSWER, "site": ""}, channel)["elements"] == [0, 0, 0]
    assert judge({**ANSWER, "kind": "null", "names": []}, named)["elements"] is None


def test_a_tie_with_nothing_names_no_element():
    assert judge(ANSWER, diagnosis("TIE", ["crease_friction at fold2", "nominal"], 0.9))["elements"] == [0, 0, 1]


@pytest.mark.parametrize(
    ("hits", "count", "target", "met"),
    [
        (9, 10, (0.9, 1.0), True),
        (8, 10, (0.9, 1.0), False),
        (0, 10, (0.0, 0.02), True),
        (1, 10, (0.0, 0.02), False),
        (10, 10, (0.9, 0.98), True),
        (1000, 1000, (0.9, 0.98), False),
        (0, 0, (0.9, 1.0), None),
    ],
)
def test_targets(hits, count, target, met):
    assert score._met(score._share([True] * hits + [False] * (count - hits)), *target) is met


def test_f1_pools_the_counts_of_all_cases():
    # 3 named rightly, 1 wrongly, 2 missed: 2 * 3 / (2 * 3 + 1 + 2)
    rows = [{"elements": e} for e in ([1, 0, 0], [2, 1, 0], [0, 0, 2], None)]
    found = score.f1(rows)
    assert found["f1"] == pytest.approx(6 / 9) and found["cases"] == 3
    assert found["low"] < 6 / 9 < found["high"]
    assert score.f1([])["f1"] is None


def test_an_onset_is_counted_in_frames():
    answer = {**ANSWER, "kind": "outside", "mechanism": "pushes", "names": [], "onset": 0.75}
    found = diagnosis("UNKNOWN", [], 0.9, onset=0.755, rate=200.0)
    row = judge(answer, found)
    assert row["onset"] == pytest.approx(1.0)
    late = judge(answer, {**found, "onset": 0.8})
    assert score.scores([row, late])["proportions"]["onset"]["hits"] == 1
    assert judge(answer, {**found, "onset": None})["onset"] is None


def test_nulls_and_kinds_are_counted_apart():
    null = {**ANSWER, "kind": "null", "mechanism": "", "names": [], "site": ""}
    rows = [
        judge({**null, "null": "plain"}, diagnosis("ADEQUATE", [], 0.9)),
        judge({**null, "null": "plain"}, diagnosis("UNKNOWN", [], 0.9)),
        judge({**null, "null": "wrong_parameter"}, diagnosis("PARAMETER", ["crease.stiffness"], 0.9)),
        judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97)),
    ]
    board = score.scores(rows)
    assert {n: (v["hits"], v["count"]) for n, v in board["by_null"].items()} == {
        "plain": (1, 2),
        "wrong_parameter": (0, 1),
    }
    assert board["kinds"]["null"]["verdicts"] == {"ADEQUATE": 1, "PARAMETER": 1, "UNKNOWN": 1}
    assert board["confusion"]["plain (null)"] == {"ADEQUATE": 1, "UNKNOWN": 1}
    text = score.text_of({**board, "sealed": False, "seed": 1, "cases": 4, "failed": 0, "rows": rows})
    assert "false alarms by null" in text and "wrong_parameter" in text


def test_what_nobody_can_tell_is_said_beside_what_was_told():
    row = judge(ANSWER, diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97))
    rows = [{**row, "apart": apart} for apart in (0.0, 2.0, 40.0, None)]
    board = score.scores(rows)
    assert board["ideal"]["count"] == board["ideal"]["hits"] == 3
    assert board["ideal"]["expected"] == pytest.approx(0.5 + norm.cdf(1.0) + 1.0)
    shown = {"sealed": False, "seed": 1, "cases": 4, "failed": 0, "rows": rows}
    assert "of 3 whose nearest other effect is known, 3 named first" in score.text_of({**board, **shown})
    assert "would name 2.3" in score.text_of({**board, **shown})
    assert "would name" not in score.text_of({**score.scores(rows[3:]), **shown})


def test_the_scoreboard_is_written_and_answers_cannot_be_changed(tmp_path):
    case, sealed = tmp_path / "cases" / "0000", tmp_path / "sealed" / "0000.json"
    case.mkdir(parents=True)
    sealed.parent.mkdir()
    sealed.write_text(json.dumps(ANSWER))
    (case / "answer.sha256").write_text(hashlib.sha256(sealed.read_bytes()).hexdigest())
    trace = {"recording": "r", "component": "fold1", "unit": "rad", "noise": 0.1, "times": [0.0, 0.1, 0.2]}
    trace |= {"recorded": [0.0, 1.0, None], "refitted": [0.0, 0.5, 0.0], "after": [0.0, 0.9, 0.0]}
    found = diagnosis("MECHANISM", ["crease_friction at fold2"], 0.97, worked=trace)
    (case / "diagnosis.json").write_text(json.dumps(found))
    (tmp_path / "run.json").write_text(json.dumps({"seed": 3}))
    board = score.report(tmp_path, 1, say=lambda text: None)
    assert board["proportions"]["top1"]["hits"] == 1 and not board["sealed"]
    assert "DEVELOPMENT" in (tmp_path / "scoreboard.txt").read_text()
    assert all((tmp_path / f"{n}.png").stat().st_size > 1000 for n in ("confusion", "accuracy", "strength", "worked"))
    sealed.write_text(json.dumps({**ANSWER, "names": ["tether"]}))
    with pytest.raises(InputError, match="changed after it was sealed"):
        score.report(tmp_path, 1, say=lambda text: None)


def test_the_truth_imports_nothing_of_this_package():
    files = sorted(TRUTH.glob("*.py"))
    assert len(files) >= 8
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
    code = f"import sys; from origami_proof.case import guard; sys.addaudithook(guard); open({str(answer)!r})"
    home = str(TRUTH.parent)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=home)
    assert ran.returncode and "sealed answer" in ran.stderr


def test_what_two_laws_imitate_is_counted_apart_from_what_they_cannot():
    answer = {**ANSWER, "kind": "outside", "mechanism": "pushes", "names": [], "d": 20.0}
    unknown, named = diagnosis("UNKNOWN", [], 0.9), diagnosis("MECHANISM", ["air_drag at panel1"], 0.9)
    rows = [judge({**answer, "like": {"apart": apart}}, found) for apart, found in ((18.0, unknown), (5.0, named))]
    assert [r["left"] for r in rows] == pytest.approx([0.81, 0.0625])
    found = score.scores(rows)["proportions"]
    assert (found["unknown"]["hits"], found["unknown"]["count"]) == (1, 2)
    assert (found["unlike"]["hits"], found["unlike"]["count"]) == (1, 1)
