"""Drawing, freezing and spreading of the battery."""

import json
import sys
import threading
import time
from collections import Counter
from contextlib import suppress

import pytest

from origami_proof import KINDS, battery, command, freeze
from origami_sim.errors import InputError


@pytest.fixture
def strata(monkeypatch):
    """The module of the truth generator that says which case is what; it needs no MuJoCo."""
    monkeypatch.syspath_prepend(str(battery.generator().parent))
    import strata

    yield strata
    sys.modules.pop("strata", None)


CELLS = [(d, m, s) for d in range(5) for m in range(12) for s in range(4) if m % 4 != 3 or s < 2]
"""Strengths, mechanisms and structures; every fourth mechanism suits two structures only."""


def spread(values) -> int:
    counts = Counter(values).values()
    return max(counts) - min(counts)


def test_any_first_cases_have_the_kinds_of_the_whole(strata):
    kinds = strata.kinds_of(strata.FULL)
    assert Counter(kinds) == strata.PROPORTIONS
    assert tuple(strata.PROPORTIONS) == KINDS
    for count in (12, 40, 100, 333):
        for kind, drawn in Counter(kinds[:count]).items():
            assert abs(drawn - count * strata.PROPORTIONS[kind] / strata.FULL) <= 1.0


def test_any_first_cells_are_even(strata):
    import numpy as np

    drawn = strata.balanced(CELLS, 240, np.random.default_rng(3))
    for count in (20, 60, 137, 240):
        assert spread(d for d, _, _ in drawn[:count]) <= 1
        assert spread(m for _, m, _ in drawn[:count]) <= 1
        assert spread(s for _, _, s in drawn[:count]) <= 2
    assert spread((d, m) for d, m, _ in drawn) <= 2  # each four times on average
    assert strata.balanced(CELLS, 50, np.random.default_rng(3)) == drawn[:50]
    assert strata.balanced(CELLS, 50, np.random.default_rng(4)) != drawn[:50]


def test_a_stratum_follows_from_seed_and_index(strata):
    cells = {"single": CELLS, "null": [("plain", 0), ("wrong", 0)]}
    first = [strata.stratum(7, n, cells) for n in range(24)]
    assert first == [strata.stratum(7, n, cells) for n in range(24)]
    assert Counter(kind for kind, _ in first) == {"single": 17, "null": 7}
    assert spread(cell for kind, cell in first if kind == "null") == 1


def test_a_sealed_run_goes_on_with_the_diagnosis_that_it_began_with(tmp_path):
    truth = battery.generator().parent
    drawn = freeze.freeze(tmp_path, truth, sealed=True, drawing=True)
    assert "diagnosis" not in drawn and "truth" in drawn
    first = freeze.freeze(tmp_path, truth, sealed=True)
    assert freeze.freeze(tmp_path, truth, sealed=True) == first
    held = first["thresholds"]
    assert held["options"]["rate"] > 0 and 0 < held["hyperparameters"]["effects"] < 1
    assert held["verdict.decide"] and len(held["fit.least_squares"]["STEPS"]) > 1  # several numbers of one name
    stored = tmp_path / freeze.FROZEN
    stored.write_text(json.dumps({**first, "diagnosis": "0" * 64}))
    assert freeze.freeze(tmp_path, truth, sealed=False)["diagnosis"] == "0" * 64
    with pytest.raises(InputError, match="a sealed run goes on with the diagnosis that it began with"):
        freeze.freeze(tmp_path, truth, sealed=True)


def test_a_digest_knows_names_and_contents(tmp_path):
    a, b = tmp_path / "a.py", tmp_path / "b.py"
    a.write_text("1")
    b.write_text("2")
    one = freeze.digest([b, a])
    assert one == freeze.digest([a, b])
    a.write_text("2")
    b.write_text("1")
    assert freeze.digest([a, b]) != one


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--cases", "0"], "must be positive"),
        (["--seed", "-1"], "must not be negative"),
        (["--score", "--draw-only"], "there is nothing to do"),
        (["--cluster", "somewhere", "--cases", "1"], "cluster"),
    ],
)
def test_wrong_options(tmp_path, capsys, given, message):
    with pytest.raises(SystemExit) as end:
        command.main([*given, "--out", str(tmp_path / "run")])
    assert end.value.code == 2
    assert message in capsys.readouterr().err


def test_a_cluster_without_dask_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install -e 'proof\[cluster\]'"), battery.workers("local:2", 1):
        pass


def done(work: battery.Work) -> str:
    return f"case {work.index}"


def test_threads_do_every_case_once(monkeypatch):
    monkeypatch.setattr(battery, "do", done)
    works = [battery.Work(n, "", "{}", False, False, False) for n in range(9)]
    with battery.workers(None, 3) as each:
        assert sorted(each(works)) == sorted(map(done, works))


@pytest.mark.slow
def test_a_dask_cluster_draws(tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install -e 'proof[cluster]'")
    pytest.importorskip("mujoco", reason="the truth of the proof needs MuJoCo: pip install -e proof")
    options = {"cases": 3, "seed": 5, "structures": ["de_bender"], "kinds": ["single"], "say": lambda text: None}
    battery.prove(tmp_path / "dask", cluster="local:2", draw_only=True, **options)
    battery.prove(tmp_path / "threads", jobs=1, draw_only=True, **options)
    for n in range(3):
        one, other = (tmp_path / f / "sealed" / f"{n:04d}.json" for f in ("dask", "threads"))
        assert one.read_bytes() == other.read_bytes()
    with pytest.raises(InputError, match="no scheduler answers"), battery.workers("tcp://127.0.0.1:9", 1):
        pass


def test_what_is_interrupted_is_no_failure_of_the_case(monkeypatch):
    sleeper = [sys.executable, "-c", "import time; print('awake', flush=True); time.sleep(60)"]
    started, results = threading.Event(), []

    def do(work):
        started.set()
        results.append(battery._run(sleeper))

    def all_of(each):
        with suppress(KeyboardInterrupt):
            list(each([battery.Work(0, "", "{}", False, False, False)]))

    monkeypatch.setattr(battery, "do", do)
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt), battery.workers(None, 2) as each:
        threading.Thread(target=all_of, args=(each,)).start()
        started.wait()
        while not battery._CHILDREN:
            time.sleep(0.01)
        raise KeyboardInterrupt
    assert time.perf_counter() - began < 30 and not results and not battery._CHILDREN
    with battery.workers(None, 1):  # and the next battery runs
        assert battery._run([sys.executable, "-c", "raise SystemExit('words')"]) == "words"


def test_a_verdict_counts_that_stood_when_its_process_ended(tmp_path, monkeypatch):
    result, asked = tmp_path / "diagnosis.json", []

    def ends(command):
        asked.append(command[-1])
        if len(asked) > 1:
            result.write_text(json.dumps({"verdict": "TIE", "chosen": ["a", "b"], "unfinished": ["baselines"]}))
        return "longer than 1800 s"

    monkeypatch.setattr(battery, "_run", ends)
    assert battery.diagnosed(tmp_path) == {"failed": "longer than 1800 s"}
    result.unlink()
    assert battery.diagnosed(tmp_path)["verdict"] == "TIE"
    assert battery.diagnosed(tmp_path)["ended"] == "longer than 1800 s" and len(asked) == 2  # it is done
    result.write_text(json.dumps({"verdict": "TIE", "chosen": [], "unfinished": ["baselines"]}))
    battery.diagnosed(tmp_path)
    assert len(asked) == 3  # of a battery that was interrupted
