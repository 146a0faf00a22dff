"""The curve of trust: fitted to outcomes, of development runs and of sealed ones that were scored."""

import json

import numpy as np
import pytest

from origami_sim.diagnose.trust import FILE, features
from origami_sim.prove import DEVELOPMENT
from origami_sim.prove.trust import fitted, main, outcomes


def test_the_curve_is_that_of_the_outcomes():
    rng, w = np.random.default_rng(0), np.array([-1.0, 0.5, -0.7])
    gains, counts = np.exp(rng.uniform(0, 7, 4000)), rng.integers(1, 3, 4000)
    given = [(float(g), int(k)) for g, k in zip(gains, counts, strict=True)]
    cases = [(*v, bool(rng.random() < 1 / (1 + np.exp(-features(*v) @ w)))) for v in given]
    assert fitted(cases) == pytest.approx(w, abs=0.2)


def test_few_cases_do_not_make_it_steep():
    assert abs(fitted([(1000.0, 1, True), (1.0, 1, False)])[1]) < 1.0


def test_trust_does_not_fall_with_the_gain_and_some_doubt_is_kept():
    cases = [(10.0, 1, True)] * 20 + [(1000.0, 1, False)] * 5
    w = fitted(cases)
    assert w[1] == 0.0
    assert 0.75 < 1 / (1 + np.exp(-features(100.0, 1) @ fitted([c for c in cases if c[2]]))) < 0.95


def run(folder, seed: int):
    (folder / "cases" / "0000").mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"seed": seed}))
    (folder / "frozen.json").write_text(json.dumps({"commit": "c", "diagnosis": "d", "truth": "t"}))
    return folder


def test_sealed_runs_that_are_not_scored_are_refused(tmp_path, monkeypatch):
    before = FILE.read_bytes()
    monkeypatch.setattr("sys.argv", ["trust", str(run(tmp_path, DEVELOPMENT))])
    with pytest.raises(SystemExit, match="development"):
        main()
    assert FILE.read_bytes() == before


def diagnosed(folder, verdict: str, chosen: list[str]):
    """A run of one case in which a gain of 80 was found."""
    (folder / "sealed").mkdir(exist_ok=True)
    keys = ("case", "kind", "null", "structure", "mechanism", "site", "d_wanted", "d", "strength", "onset", "number")
    answer = dict.fromkeys(keys, 0) | {"kind": "single", "names": ["crease_friction"], "site": "fold1"}
    (folder / "sealed" / "0000.json").write_text(json.dumps(answer))
    candidate = {"gain": 80.0, "effects": ["crease_friction"], "probability": 1.0, "numbers": []}
    found = {"candidates": [candidate], "probability": 0.8, "error_before": [2.0], "error_after": [1.0]}
    found |= {"error_refitted": [2.0], "noise": [1.0], "baselines": [], "verdict": verdict, "chosen": chosen}
    (folder / "cases" / "0000" / "diagnosis.json").write_text(json.dumps(found))
    return folder


def test_a_case_that_names_nothing_teaches_nothing(tmp_path):
    folder = run(tmp_path, 1)
    assert outcomes(diagnosed(folder, "ADEQUATE", [])) == []
    assert outcomes(diagnosed(folder, "MECHANISM", ["crease_friction at fold1"])) == [(80.0, 1, True)]


def test_outcomes_are_stored_and_those_of_other_seeds_count_on(tmp_path, monkeypatch):
    file = tmp_path / "trust.json"
    file.write_text(json.dumps({"batteries": [{"seed": 9}]}))  # one of before outcomes were stored
    monkeypatch.setattr("origami_sim.prove.trust.FILE", file)
    for seed, named in ((1, "crease_friction at fold1"), (2, "crease_offset at fold1"), (1, "crease_offset at fold1")):
        folder = diagnosed(run(tmp_path / f"{seed} {named}", seed), "MECHANISM", [named])
        monkeypatch.setattr("sys.argv", ["trust", str(folder)])
        main()
    stored = json.loads(file.read_text())
    assert [(b["seed"], b["outcomes"]) for b in stored["batteries"]] == [
        (1, [[80.0, 1, False]]),
        (2, [[80.0, 1, False]]),
    ]
    assert (stored["named"], stored["right"]) == (2, 0)
