"""Opened cases judged anew from what they stored, with any hyperparameters: what half and double of each do.

No simulation and no fit is made: each case keeps the linearisations of its search (`stored.npz`, see
`origami_sim.verdict.stored`), so that hundreds are judged in minutes.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path

import numpy as np

from origami_proof.case import STORED
from origami_proof.score import BOARD, calibration_error, judge, wilson
from origami_sim.errors import InputError
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.infer.discrepancy import laws
from origami_sim.verdict.decide import by_effects, real_rest
from origami_sim.verdict.stored import Stored

REJUDGED = "rejudged.json"
"""What comes out, in the folder of the run."""

LEAST = 1e-4
"""Least probability that a log score counts: a truth that was never fitted costs as much as one in ten thousand."""

CLEAR = 4.5
"""d' from which on an effect must be found, as in `score`."""

Case = tuple[Path, Path]
"""Stored search, and answer."""


def cases_of(folders: Sequence[Path]) -> list[Case]:
    """The opened cases of runs that have a stored search.

    Raises:
        InputError: a folder that is no run, a run whose answers were not opened yet, none with a stored search.
    """
    out = []
    for folder in folders:
        if not (folder / "cases").is_dir():
            raise InputError("there is no proof in this folder", field="--rejudge", value=str(folder))
        if not (folder / BOARD).exists():
            raise InputError(
                "the answers of this run are still sealed", field="--rejudge", value=str(folder), allowed="a scored run"
            )
        for case in sorted((folder / "cases").iterdir()):
            stored, answer = case / STORED, folder / "sealed" / f"{case.name}.json"
            if stored.exists() and answer.exists():
                out.append((stored, answer))
    if not out:
        raise InputError("no case of this run stored its search", field="--rejudge", value=", ".join(map(str, folders)))
    return out


def variants(hyper: Hyper, gaps: Sequence[float]) -> dict[str, tuple[Hyper, Hyper]]:
    """Each hyperparameter halved and doubled, by its name.

    Of probabilities the odds are halved and doubled. Sizes of the gaps are part of what was stored: without the largest
    of them, and without the smallest.
    """
    out = {}
    for name in (f.name for f in fields(hyper)):
        value = getattr(hyper, name)
        if name == "gaps":
            each = tuple(gaps)[:-1], tuple(gaps)[1:]
        elif isinstance(value, tuple):
            each = tuple(v / 2 for v in value), tuple(v * 2 for v in value)
        elif isinstance(value, int):
            each = max(value // 2, 1), 2 * value
        elif 0.0 < value < 1.0:
            odds = value / (1.0 - value)
            each = tuple(o / (1.0 + o) for o in (odds / 2, odds * 2))
        else:
            each = value / 2, value * 2
        out[name] = tuple(replace(hyper, **{name: v}) for v in each)
    return out


def rejudged(case: Case, settings: Sequence[Hyper]) -> list[dict]:
    """What comes of one case under each setting: a row as `score.judge` gives, with `score`, the log score."""
    stored, answer = Stored.load(case[0]), json.loads(case[1].read_text())
    return [_row(stored, answer, hyper) for hyper in settings]


def _row(stored: Stored, answer: dict, hyper: Hyper) -> dict:
    p = stored.judged(hyper)
    decided = stored.decided(p)
    blank = {"noise": [1.0], "error_refitted": [1.0], "error_after": [1.0], "candidates": [], "screening": []}
    row = judge(answer, {**blank, **decided})
    chance = p.probabilities()
    left = {key: real_rest(p, key, stored.budgets[key]) for key in chance if key in p.nodes}
    listed = {k: value * (1.0 - hyper.foreign(laws(p.effects(k)), left.get(k, 0.0))) for k, value in chance.items()}
    missing = chance[frozenset()] * float(np.sum(p.cells(frozenset())[~hyper.clean]))
    classes = by_effects(p, listed)
    return {**row, "score": log_score(classes, 1.0 - sum(listed.values()) + missing, answer)}


def log_score(classes: dict[frozenset[str], float], unlisted: float, answer: dict) -> float:
    """Logarithm of the probability of the truth.

    A number that is off is no effect; a wrong camera is one, or a number, whichever it was drawn as.

    Args:
        classes: probability of each set of effects. unlisted: that something acts which the catalogue lacks.
    """
    kind, names = answer["kind"], set(answer["names"])
    if kind == "outside":
        right = unlisted
    elif kind == "double":
        second = set(answer["second"]["names"])
        right = sum(p for c, p in classes.items() if len(c) == 2 and c & names and c & second and len(c & names) < 2)
    elif kind == "null":
        right = classes.get(frozenset(), 0.0)
        right += sum(p for c, p in classes.items() if len(c) == 1 and c & names)
    else:
        right = sum(p for c, p in classes.items() if len(c) == 1 and c & names)
    return float(np.log(max(right, LEAST)))


def summary(rows: Sequence[dict]) -> dict:
    """Log score with its standard error, and shares, of rows of one setting."""
    told = np.array([r["score"] for r in rows])
    stated = [r for r in rows if r["correct"] is not None]
    probability, correct = [r["probability"] for r in stated], [bool(r["correct"]) for r in stated]
    clear = [r for r in rows if r["kind"] == "single" and r["d"] >= CLEAR]

    def share(values: list) -> list[float]:
        return [int(sum(map(bool, values))), len(values)]

    return {
        "score": float(told.mean()) if len(told) else None,
        "error": float(told.std(ddof=1) / np.sqrt(len(told))) if len(told) > 1 else None,
        "top1": share([r["top1"] for r in clear]),
        "alarms": share([r["alarm"] for r in rows if r["kind"] == "null"]),
        "unknown": share([r["unknown"] for r in rows if r["kind"] == "outside"]),
        "doubles": share([r["double"] for r in rows if r["kind"] == "double"]),
        "calibration": calibration_error(probability, correct) if stated else None,
    }


def _each(cases: Sequence[Case], settings: Sequence[Hyper], jobs: int) -> Iterator[list[dict]]:
    work = partial(rejudged, settings=settings)
    if jobs <= 1:
        yield from map(work, cases)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(work, cases)


def rejudge(
    folders: Sequence[Path],
    *,
    hyper: Hyper = HYPER,
    jobs: int = 1,
    vary: Sequence[str] | None = None,
    say: Callable[[str], None] = print,
) -> dict:
    """Judges all opened cases of runs anew, and prints what each hyperparameter does.

    Args:
        folders: of runs that were scored. hyper: to begin with. jobs: processes.
        vary: names of hyperparameters to halve and double (default: all).

    Returns: by setting ("as it is", "slabs halved", ...) a `summary`, with the paired change of the log score and its
        standard error; and the rows of the first setting.

    Raises:
        InputError: see `cases_of`; a name that is no hyperparameter.
    """
    names = [f.name for f in fields(hyper)] if vary is None else list(vary)
    for name in names:
        if name not in asdict(hyper):
            raise InputError("no hyperparameter", field="--vary", value=name, allowed=", ".join(asdict(hyper)))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cases = cases_of(folders)
    gaps = Stored.load(cases[0][0]).gaps
    named = {"as it is": replace(hyper, gaps=tuple(g for g in hyper.gaps if g in gaps))}
    each = variants(hyper, gaps)
    for name in names:
        named[f"{name} halved"], named[f"{name} doubled"] = each[name]
    columns: list[list[dict]] = [[] for _ in named]
    for rows in _each(cases, list(named.values()), jobs):
        for column, row in zip(columns, rows, strict=True):
            column.append(row)
    board: dict = {"cases": len(cases), "hyperparameters": asdict(hyper), "settings": {}, "rows": columns[0]}
    for name, rows in zip(named, columns, strict=True):
        pairs = [a["score"] - b["score"] for a, b in zip(rows, columns[0], strict=True)]
        change = {"change": float(np.mean(pairs)) if pairs else None}
        change["change_error"] = float(np.std(pairs, ddof=1) / np.sqrt(len(pairs))) if len(pairs) > 1 else None
        board["settings"][name] = summary(rows) | change
    say(text_of(board))
    return board


def text_of(board: dict) -> str:
    """The table in words and numbers."""
    lines = [f"{board['cases']} opened cases judged anew; log score: of the truth's probability, larger is better", ""]
    head = ("log score", "change", "top-1", "alarms", "UNKNOWN", "doubles", "calibration")
    lines.append(f"{'':20s}" + "".join(f"{h:>17s}" for h in head))
    for name, s in board["settings"].items():
        say = lambda v, f="{:.3f}": "-" if v is None else f.format(v)  # noqa: E731
        score = f"{say(s['score'])} +- {say(s['error'])}"
        change = "" if name == "as it is" else f"{say(s['change'], '{:+.3f}')} +- {say(s['change_error'])}"
        shares = [f"{h} of {n}" for h, n in (s[k] for k in ("top1", "alarms", "unknown", "doubles"))]
        cells = [score, change, *shares, say(s["calibration"])]
        lines.append(f"{name:20s}" + "".join(f"{c:>17s}" for c in cells))
    base = board["settings"]["as it is"]
    lines.append("")
    for key, title in (("top1", "top-1, d' >= 5"), ("alarms", "false alarms"), ("unknown", "UNKNOWN outside")):
        hits, count = base[key]
        low, high = wilson(hits, count)
        lines.append(f"{title}: {hits} of {count}, 95 %: {low:.0%} to {high:.0%}")
    return "\n".join(lines) + "\n"
