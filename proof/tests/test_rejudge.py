"""Opened cases judged anew: linear problems whose answer is known, in the folders of a run."""

import json
from dataclasses import replace

import numpy as np
import pytest

from origami_proof import command, rejudge
from origami_sim.errors import InputError
from origami_sim.fit.evidence import Group, problem
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.linear import Linearisation, Rows
from origami_sim.hypotheses.hypothesis import Free, Suspect
from origami_sim.infer.budget import Budget, Share
from origami_sim.verdict.stored import Reduced, Stored

EFFECTS = ("crease_friction", "air_drag", "crease_stiffening", "angle_scale")


def suspect(name: str) -> Suspect:
    kind = "measurement" if name == "angle_scale" else "crease"
    return Suspect(name, "fold1", kind, (Free(name, "strength", "-", 0.0, 1.0, -np.inf, np.inf),), (0,))


def stored(strengths, seed: int = 0, rows: int = 200) -> Stored:
    """A search that fitted the model without an effect and with each one that is there; strengths in d'."""
    rng = np.random.default_rng(seed)
    shapes = np.linalg.qr(rng.normal(size=(rows, len(EFFECTS))))[0]
    waves = np.cos(np.pi * np.outer(np.arange(rows) / rows, np.arange(4)))
    y = shapes @ np.asarray(strengths, float) + rng.normal(size=rows)
    nodes, budgets = {}, {}
    for own in ([], *([n] for n in np.flatnonzero(strengths).tolist())):
        others = [n for n in range(len(EFFECTS)) if n not in own]
        at = {n: float(shapes[:, n] @ y) for n in own}
        left = y - sum((at[n] * shapes[:, n] for n in own), np.zeros(rows))
        line = Linearisation([Rows(rows)], [left], [np.zeros((rows, 0))], [np.zeros((rows, 0))], [None])
        whole = problem(line, np.arange(0), np.zeros(0), np.zeros(0), [shapes[:, [*own, *others]]], [waves])
        groups = [
            Group((k,), 1, np.full(1, at.get(n, 0.0)), 0, np.full(1, np.inf)) for k, n in enumerate([*own, *others])
        ]
        nodes[frozenset(own)] = own, groups, others, {HYPER.gaps[0]: Reduced.of(whole)}
        budgets[frozenset(own)] = Budget(
            [Share("effects", "effect", 0.9 if own else 0.0), Share("not named", "rest", 0.1)],
            1.0,
            beyond=0.9 if own else 0.0,
        )
    every = [(suspect(e), 0, "") for e in EFFECTS]
    return Stored(every, HYPER.gaps, nodes, [], budgets, "ADEQUATE", 1.0, frozenset(nodes))


def answer(kind: str, names: list[str], d: float = 0.0, **more) -> dict:
    keys = {"case": 0, "null": "plain" if kind == "null" else "", "structure": "box", "mechanism": "", "site": ""}
    return {**keys, "kind": kind, "names": names, "d_wanted": d, "d": d, "strength": 1.0, "number": "", **more}


@pytest.fixture
def run(tmp_path):
    """A scored run of a null, a single effect, one outside, and one whose search was not stored."""
    given = [
        (stored((0, 0, 0, 0)), answer("null", [])),
        (stored((40, 0, 0, 0), 1), answer("single", ["crease_friction"], 40.0)),
        (stored((0, 0, 0, 0), 2), answer("outside", [], 30.0)),
        (None, answer("single", ["air_drag"], 20.0)),
    ]
    for n, (case, truth) in enumerate(given):
        folder = tmp_path / "run" / "cases" / f"{n:04d}"
        folder.mkdir(parents=True)
        if case is not None:
            case.save(folder / rejudge.STORED)
        sealed = tmp_path / "run" / "sealed" / f"{n:04d}.json"
        sealed.parent.mkdir(exist_ok=True)
        sealed.write_text(json.dumps(truth))
    (tmp_path / "run" / rejudge.BOARD).write_text("{}")
    return tmp_path / "run"


def found(board: dict, name: str) -> dict:
    return board["settings"][name]


def test_cases_are_judged_anew_with_half_and_double_of_everything(run):
    text = []
    board = rejudge.rejudge([run], say=text.append)
    assert board["cases"] == 3
    base = found(board, "as it is")
    assert base["top1"] == [1, 1] and base["alarms"] == [0, 1] and base["unknown"] == [0, 1]
    null, single, outside = board["rows"]
    assert null["verdict"] == "ADEQUATE" and single["top"] == "crease_friction" and outside["score"] < -2.0
    assert -0.3 < single["score"] <= 0.0
    assert base["score"] == pytest.approx((null["score"] + single["score"] + outside["score"]) / 3)
    names = [f"{n} {way}" for n in HYPER.__dataclass_fields__ for way in ("halved", "doubled")]
    assert list(board["settings"]) == ["as it is", *names]
    # the prior odds of one effect more are what they are, and the null is surer
    assert found(board, "effects halved")["change"] != 0.0
    rare, one = replace(HYPER, effects=0.2), Stored.load(run / "cases" / "0001" / rejudge.STORED)
    each = [(p.log[frozenset([0])], p.log[frozenset()]) for p in (one.judged(), one.judged(rare))]
    known = np.isfinite(each[0][0])
    odds = [fitted[known] - none[known] for fitted, none in each]
    np.testing.assert_allclose(odds[1] - odds[0], np.log(0.2 / HYPER.effects), atol=1e-9)
    before, after = rejudge.rejudged(rejudge.cases_of([run])[0], [HYPER, rare])
    assert after["score"] > before["score"]
    assert text[0].count("\n") >= len(names) and "slabs doubled" in text[0]
    again = rejudge.rejudge([run], jobs=2, vary=["effects"], say=text.append)
    assert again["settings"] == {k: v for k, v in board["settings"].items() if k in again["settings"]}


def test_half_and_double_are_hyperparameters_that_can_be():
    each = rejudge.variants(HYPER, HYPER.gaps)
    assert set(each) == set(HYPER.__dataclass_fields__)
    less, more = each["effects"]
    odds = [h.effects / (1 - h.effects) for h in (less, HYPER, more)]
    assert odds[1] / odds[0] == pytest.approx(2.0) and odds[2] / odds[1] == pytest.approx(2.0)
    assert [h.flaws for h in each["flaws"]] == [(0.5, 2.0), (2.0, 8.0)]
    assert [h.most for h in each["most"]] == [2, 10]
    assert [h.gaps for h in each["gaps"]] == [HYPER.gaps[:-1], HYPER.gaps[1:]]


@pytest.mark.parametrize(
    ("kind", "names", "more", "right"),
    [
        ("single", ["a", "alias"], {}, 0.3),
        ("null", [], {}, 0.4),
        ("null", ["b"], {}, 0.5),
        ("double", ["a"], {"second": {"names": ["b"]}}, 0.2),
        ("confounded", ["b"], {"rival": {"names": ["a"]}}, 0.1),
        ("single", ["c"], {}, rejudge.LEAST),
        ("outside", [], {}, 0.25),
    ],
)
def test_the_log_score_is_that_of_the_truth(kind, names, more, right):
    classes = {frozenset(): 0.4, frozenset("a"): 0.3, frozenset("b"): 0.1, frozenset("ab"): 0.2}
    assert rejudge.log_score(classes, 0.25, answer(kind, names, **more)) == pytest.approx(np.log(right))


def test_answers_that_are_still_sealed_are_not_opened(run, capsys):
    (run / rejudge.BOARD).unlink()
    with pytest.raises(SystemExit) as end:
        command.main(["--rejudge", str(run)])
    assert end.value.code == 2 and "still sealed" in capsys.readouterr().err
    with pytest.raises(InputError, match="no proof in this folder"):
        rejudge.cases_of([run / "cases"])


def test_the_command_writes_what_came_out(run, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        command.main(["--rejudge", str(run), "--vary", "flaws", "--out", str(tmp_path / "out")])
    said = capsys.readouterr().out
    assert end.value.code == 0 and "log score" in said and "flaws halved" in said and "slabs" not in said
    with pytest.raises(InputError, match=r"no hyperparameter.*allowed: slabs"):
        rejudge.rejudge([run], vary=["trust"])
    assert json.loads((tmp_path / "out" / rejudge.REJUDGED).read_text())["cases"] == 3
