"""What came of each case, and the scoreboard."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from origami_proof import DEVELOPMENT, KINDS
from origami_proof.battery import NEAREST, RUN, SEPARATING, SUGGESTED
from origami_proof.case import write_json
from origami_proof.freeze import FROZEN
from origami_sim.errors import InputError

NAMED = ("MECHANISM", "MEASUREMENT", "SEVERAL", "TIE")
QUIET = ("ADEQUATE", "PARAMETER", "UNTESTABLE")
SURE = 0.9
"""Probability from which on an answer is confident."""

CLEAR = 4.5
"""d' from which on an effect must be found: drawn as 5, within the accuracy of the search."""

TOLD = 5.0
"""d' from another effect from which on the recordings tell a single one from all others."""

BOARD = "scoreboard.json"
"""What a run is scored in."""

SOON = 2.0
"""Frames within which an onset counts as found."""

WHOLE = ("", "the body", "the drive", "the measurement", "the ground")
"""Sites that are no element of the device."""


NOTHING = [("nominal", "")]
"""An explanation by which nothing is missing; a tie that holds it claims nothing."""


# --- statistics


def wilson(hits: int, count: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a proportion (Wilson 1927); (0, 1) without any cases."""
    if count == 0:
        return 0.0, 1.0
    p, n = hits / count, count
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def calibration_error(probability: Sequence[float], correct: Sequence[bool], bins: int = 10) -> float:
    """Expected calibration error: gap between stated probability and share correct, bins weighted by count."""
    p, c = np.asarray(probability, float), np.asarray(correct, float)
    if not len(p):
        return float("nan")
    index = np.minimum((p * bins).astype(int), bins - 1)
    gaps = [abs(p[index == b].sum() - c[index == b].sum()) for b in range(bins)]
    return float(sum(gaps) / len(p))


def calibration_by_chance(probability: Sequence[float], draws: int = 2000, seed: int = 0) -> float:
    """The calibration error that is expected of so few probabilities even if all of them are right."""
    rng = np.random.default_rng(seed)
    right = rng.random((draws, len(probability))) < np.asarray(probability, float)
    return float(np.mean([calibration_error(probability, r) for r in right]))


def f1(rows: Sequence[dict], draws: int = 2000, seed: int = 0) -> dict:
    """F1 of the named elements (creases, panels), pooled over cases, with a 95 % interval (cases drawn again).

    Args:
        rows: each with `elements`, the counts (named rightly, named wrongly, missed).
    """
    counts = np.array([r["elements"] for r in rows if r.get("elements") is not None], float).reshape(-1, 3)
    out = {"cases": len(counts), "f1": None, "low": None, "high": None}
    if not counts.sum():
        return out
    rng = np.random.default_rng(seed)
    again = counts[rng.integers(len(counts), size=(draws, len(counts)))].sum(1)
    low, high = np.quantile(_f1(again), [0.025, 0.975])
    return out | {"f1": float(_f1(counts.sum(0))), "low": float(low), "high": float(high)}


def _f1(counts: np.ndarray) -> np.ndarray:
    right, wrong, missed = np.moveaxis(counts, -1, 0)
    return 2 * right / np.maximum(2 * right + wrong + missed, 1e-9)


# --- one case


def parts(label: str) -> list[tuple[str, str]]:
    """(effect, site) of a label such as "crease_friction at fold2 + air_drag at all panels"."""
    return [(e, s) for e, _, s in (one.partition(" at ") for one in label.split(" + "))]


def elements(explanation: Iterable[tuple[str, str]]) -> set[str]:
    """Creases and panels that an explanation names."""
    return {s for _, s in explanation if s not in WHOLE and not s.startswith("channel ")}


def explained(found: dict) -> list[list[tuple[str, str]]]:
    """The explanations that a diagnosis holds possible, each a list of (effect, site); none if it names nothing."""
    if found.get("failed") or found["verdict"] not in NAMED:
        return []
    chosen = found["chosen"]
    out = [parts(c) for c in chosen] if found["verdict"] == "TIE" else [[p for c in chosen for p in parts(c)]]
    return [e for e in out if e]


def alone(explanation: list[tuple[str, str]], names: set[str]) -> bool:
    """Whether an explanation is one effect, of these names."""
    return len(explanation) == 1 and explanation[0][0] in names


def _named(explanations: list, names: set[str]) -> bool:
    """Whether one of the explanations is one effect, of these names."""
    return any(alone(e, names) for e in explanations)


_CONCEALED = ("case", "kind", "null", "structure", "mechanism", "site", "d_wanted", "d")
_OUTCOMES = ("top1", "inside", "wrong", "blamed", "alarm", "found_site", "covered", "unknown", "correct")
_OUTCOMES += ("double", "said", "placed", "beside", "beside_alone")
_NUMBERS = (
    "seen",
    "removed",
    "recovery",
    "floor",
    "refitted",
    "strength",
    "value",
    "low",
    "high",
    "onset",
    "elements",
    "apart",
    "left",
)


def judge(answer: dict, found: dict, others: dict[str, dict] | None = None) -> dict:
    """What came of one case.

    Args:
        answer: the sealed answer. found: the diagnosis. others: further diagnoses of the same object, with the
            `separating` experiment or the `suggested` one.

    Returns: a row with `verdict`, `top` (named mechanism or verdict), and True, False or None (does not apply) for
        `top1`, `inside` (truth in the stated 95 % set), `wrong` (confidently, also of what says that nothing is
        missing), `blamed` (one explanation is named, and it is not the truth), `alarm`, `found_site` (where the effect
        is right), `placed` (the same, right or not), `covered`,
        `unknown`, `double`, `beside` (the law of the catalogue is named first, alone or with others), `beside_alone`
        (no other is named for what is outside), `said` (a tie of a confounded pair), `decided` (by the experiment that
        separates: the truth is in the stated set, its rival is not), `separated` and `resolved` (named alone after the
        experiment that separates, or that a tie with the truth in it suggested); `elements` (named rightly,
        wrongly, missed); concealed `strength`, recovered `value` with `low` and `high`, `recovery` (relative error);
        `seen` (score of the truth in the screening over d'); `left`, of an effect outside the catalogue, the part of
        its squares that the two laws leave which are most like it, about its motion and with all numbers refitted;
        `onset` (frames late); `removed`, `floor`, `refitted`, `probability`, `correct`. `apart` (d' from the nearest
        other effect) is left to `report`.
    """
    row: dict = {k: answer[k] for k in _CONCEALED}
    row |= {"failed": found.get("failed", ""), "verdict": "FAILED", "top": "FAILED", "probability": 0.0}
    row |= dict.fromkeys((*_OUTCOMES, *_NUMBERS, "decided", "separated", "resolved"))
    names, kind = set(answer["names"]), answer["kind"]
    if kind == "outside":
        row["left"] = (answer["like"]["apart"] / answer["d"]) ** 2 if "like" in answer else 1.0
    explanations = explained(found)
    contains = _named(explanations, names)
    for key, where in (("separated", SEPARATING), ("resolved", SUGGESTED)):
        if where in (others or {}) and (key == "separated" or contains):
            then = explained((others or {})[where])
            row[key] = len(then) == 1 and alone(then[0], names)
            if key == "separated":  # a third effect may be told from the truth by neither recording
                row["decided"] = _named(then, names) and not _named(then, set(answer["rival"]["names"]))
    _place(row, answer, explanations)
    if row["failed"]:
        row |= {"top1": False, "inside": False} if kind == "single" else {}
        row |= {"said": False} if kind == "confounded" else {}
        return row
    verdict, probability = found["verdict"], float(found["probability"] or 0.0)
    row |= {"verdict": verdict, "probability": probability, "wall": found.get("wall", 0.0)}
    nothing = NOTHING in explanations
    row["top"] = " + ".join(sorted({p[0] for p in explanations[0]})) if explanations else verdict
    if nothing:
        row["top"] = "TIE with nothing"
    if kind == "null":
        camera = answer["null"] == "wrong_camera"
        quiet = (*QUIET, *(("MEASUREMENT",) if camera else ()))
        right = verdict in quiet or nothing or (camera and contains)
        row["alarm"] = not right
    elif kind == "outside":
        right = row["unknown"] = verdict == "UNKNOWN"
    elif kind == "double":
        second = set(answer["second"]["names"])
        right = row["double"] = any(_both(e, names, second) for e in explanations)
    elif kind == "beside":
        right = row["beside_alone"] = contains
        row["beside"] = any(effect in names for e in explanations[:1] for effect, _ in e)
    elif kind == "confounded":
        rival = set(answer["rival"]["names"])
        row["said"] = contains and _named(explanations, rival)
        right = contains
    else:
        row["top1"], row["inside"] = bool(explanations) and alone(explanations[0], names), contains
        row["unknown"] = verdict == "UNKNOWN"
        right = contains
        row["seen"] = _seen(answer, found)
    row["wrong"] = verdict != "UNKNOWN" and probability >= SURE and not right and not nothing
    row["blamed"] = not right if len(explanations) == 1 else None
    row["correct"] = bool(right) if explanations else None
    row["where"] = explanations[0][0][1] if explanations else ""
    _errors(row, found)
    if answer.get("onset") is not None and found.get("onset") is not None and "rate" in found:
        row["onset"] = (found["onset"] - answer["onset"]) * found["rate"]
    if kind == "single" and answer["site"]:
        row["placed"] = row["where"] == answer["site"]
        row["found_site"] = row["placed"] if row["top1"] else None
    if kind == "single" and row["top1"] and row["found_site"] is not False:  # elsewhere it is another number
        _strength(row, answer, found)
    return row


def _both(explanation: list[tuple[str, str]], first: set[str], second: set[str]) -> bool:
    """Whether an explanation is these two effects."""
    effects = [e for e, _ in explanation]
    return len(effects) == 2 and any(a in first and b in second for a, b in (effects, effects[::-1]))


def _place(row: dict, answer: dict, explanations: list) -> None:
    """Elements named rightly, wrongly and missed; where the truth is one effect, or two."""
    if answer["kind"] not in ("single", "double"):
        return
    truth = {s for s in (answer["site"], (answer.get("second") or {}).get("site", "")) if s}
    named = elements(explanations[0]) if explanations and NOTHING not in explanations else set()
    row["elements"] = [len(truth & named), len(named - truth), len(truth - named)]


def _seen(answer: dict, found: dict) -> float | None:
    """Score of the truth in the screening over its d'; where its site was no suspect, of the effect anywhere."""
    scores = [(s["site"], abs(s["z"])) for s in found.get("screening", []) if s["effect"] in answer["names"] and s["z"]]
    here = [z for site, z in scores if site == answer["site"]] or [z for _, z in scores]
    return max(here) / answer["d"] if here else None


def _errors(row: dict, found: dict) -> None:
    """Held-out errors over the noise: refitted, explained, and of the baselines; and what was removed."""
    noise, before, after = (np.array(found[k], float) for k in ("noise", "error_refitted", "error_after"))
    row["floor"] = float(np.sqrt(np.mean((after / noise) ** 2)))
    row["refitted"] = float(np.sqrt(np.mean((before / noise) ** 2)))
    row["baselines"] = {
        b["name"]: float(np.sqrt(np.mean((np.array(b["rms"], float) / noise) ** 2)))
        for b in found.get("baselines", [])
        if all(v is not None for v in b["rms"])
    }
    excess = np.sum((before / noise) ** 2) - len(noise)
    if row["kind"] == "single" and excess > 0.1 * len(noise):
        row["removed"] = float((np.sum((before / noise) ** 2) - np.sum((after / noise) ** 2)) / excess)


def _strength(row: dict, answer: dict, found: dict) -> None:
    """Concealed and recovered strength, its relative error, and whether the interval covers it."""
    name, effect = answer["number"], answer["names"][0]
    best = next((c for c in found["candidates"] if c["effects"] == [effect]), None)
    numbers = reversed(best["numbers"]) if best and name else []  # a nominal number of that name stands before it
    number = next((n for n in numbers if n["label"] == f"{effect}.{name}"), None)
    if not number or number["value"] is None:
        return
    row |= {"effect": effect, "strength": answer["strength"], "recovery": abs(number["value"] / answer["strength"] - 1)}
    row |= {k: number[k] for k in ("value", "low", "high")}
    if number["low"] is not None and number["high"] is not None:
        row["covered"] = number["low"] <= answer["strength"] <= number["high"]


# --- many cases

TARGETS: dict[str, tuple[str, tuple[float, float] | None]] = {
    "top1": ("top-1 mechanism, d' >= 5", (0.90, 1.0)),
    "told": ("top-1, no other within d' 5", None),
    "inside": ("truth in the stated set, d' >= 5", (0.95, 1.0)),
    "wrong": ("confidently wrong, any d'", (0.0, 0.02)),
    "blamed": ("wrong where one explanation is named", None),
    "alarm": ("false alarms on nulls", (0.0, 0.05)),
    "found_site": ("site, where named, d' >= 5", (0.95, 1.0)),
    "placed": ("site, named or not, d' >= 5", (0.95, 1.0)),
    "onset": (f"onset within {SOON:g} frames", (0.90, 1.0)),
    "covered": ("95 % intervals that cover", (0.90, 0.98)),
    "unknown": ("UNKNOWN recall outside", (0.85, 1.0)),
    "unlike": ("UNKNOWN recall, not imitated by half", (0.65, 1.0)),
    "false_unknown": ("false UNKNOWN inside", (0.0, 0.05)),
    "said": ("confounded pair said so", (0.90, 1.0)),
    "decided": ("pair decided by what separates it", (0.80, 1.0)),
    "separated": ("named alone with what separates it", (0.80, 1.0)),
    "resolved": ("suggested experiment resolves a tie", (0.80, 1.0)),
    "double": ("both of two effects named", None),
    "beside": ("law beside one outside named", None),
    "beside_alone": ("and no other for what is outside", None),
}
"""What is counted, and within which shares it should lie."""


def scores(rows: Sequence[dict]) -> dict:
    """The scoreboard: for each measure hits, count, share with Wilson interval, target and whether it is met."""
    single = [r for r in rows if r["kind"] == "single"]
    clear = [r for r in single if r["d"] >= CLEAR]
    told = lambda key, part: [bool(r[key]) for r in part if r[key] is not None]  # noqa: E731
    sets = {
        "top1": told("top1", clear),
        "told": told("top1", [r for r in clear if r["apart"] is not None and r["apart"] >= TOLD]),
        "inside": told("inside", clear),
        "wrong": [bool(r["wrong"]) for r in rows],
        "blamed": told("blamed", rows),
        "alarm": told("alarm", rows),
        "found_site": told("found_site", clear),
        "placed": told("placed", clear),
        "onset": [abs(r["onset"]) <= SOON for r in rows if r["onset"] is not None],
        "covered": told("covered", clear),
        "unknown": [bool(r["unknown"]) for r in rows if r["kind"] == "outside"],
        "unlike": [bool(r["unknown"]) for r in rows if r["kind"] == "outside" and r["left"] > 0.5],
        "false_unknown": [bool(r["unknown"]) for r in single],
        "said": told("said", rows),
        "decided": told("decided", rows),
        "separated": told("separated", rows),
        "resolved": told("resolved", rows),
        "double": [bool(r["double"]) for r in rows if r["kind"] == "double"],
        "beside": told("beside", rows),
        "beside_alone": told("beside_alone", rows),
    }
    out: dict = {"proportions": {}}
    for key, (title, target) in TARGETS.items():
        counted = _share(sets[key])
        met = None if target is None else _met(counted, *target)
        out["proportions"][key] = {"title": title, **counted, "target": target, "met": met}
    stated = [r for r in rows if r["correct"] is not None]
    probability = [r["probability"] for r in stated]
    out["ece"] = calibration_error(probability, [r["correct"] for r in stated])
    out["ece_by_chance"] = calibration_by_chance(probability)
    median = lambda key, part: float(np.median(v)) if (v := [r[key] for r in part if r.get(key) is not None]) else None  # noqa: E731
    out["elements"], out["clear_elements"] = f1(rows), f1([r for r in rows if r["d"] >= CLEAR])
    out["removed"] = median("removed", clear)
    out["floor"] = median("floor", clear)
    out["refitted_floor"] = median("refitted", clear)
    out["recovery"] = median("recovery", clear)
    out["seen"] = median("seen", clear)
    out["seconds"] = median("wall", rows)
    near = [r for r in clear if r["apart"] is not None]
    best = float(np.sum(ndtr(np.array([r["apart"] for r in near]) / 2.0)))
    out["ideal"] = {"count": len(near), "hits": sum(bool(r["top1"]) for r in near), "expected": best}
    ties = [r for r in rows if r["verdict"] == "TIE"]
    out["ties"] = {"count": len(ties), "with_truth": sum(bool(r["correct"]) for r in ties)}
    out["baselines"] = {
        n: float(np.median([r["baselines"][n] for r in clear if n in r.get("baselines", {})]))
        for n in dict.fromkeys(n for r in clear for n in r.get("baselines", {}))
    }
    for key in ("mechanism", "d_wanted", "structure"):
        out[f"by_{key}"] = _grouped(single, key, "top1")
    out["by_null"] = _grouped([r for r in rows if r["kind"] == "null"], "null", "alarm")
    out["by_outside"] = _grouped([r for r in rows if r["kind"] == "outside"], "mechanism", "unknown")
    out["by_pair"] = _grouped([r for r in rows if r["kind"] == "confounded"], "mechanism", "said")
    out["kinds"] = {}
    for kind in KINDS:
        mine = [r for r in rows if r["kind"] == kind]
        verdicts = {v: sum(r["verdict"] == v for r in mine) for v in sorted({r["verdict"] for r in mine})}
        out["kinds"][kind] = {"count": len(mine), "wrong": sum(bool(r["wrong"]) for r in mine), "verdicts": verdicts}
    confusion: dict = {}
    for r in rows:
        row = confusion.setdefault(_concealed(r), {})
        row[r["top"]] = row.get(r["top"], 0) + 1
    out["confusion"] = confusion
    return out


def _share(values: Sequence[bool]) -> dict:
    hits, count = int(sum(values)), len(values)
    low, high = wilson(hits, count)
    return {"hits": hits, "count": count, "share": hits / count if count else None, "low": low, "high": high}


def _met(counted: dict, low: float, high: float) -> bool | None:
    """Whether a share lies within its target; too many of a few are too many only if chance does not explain them."""
    share = counted["share"]
    if share is None:
        return None
    most = counted["low"] if 0.0 < low and high < 1.0 else share
    return low <= share and most <= high


def _grouped(rows: Sequence[dict], key: str, what: str) -> dict:
    groups: dict[str, list[bool]] = {}
    for r in rows:
        groups.setdefault(str(r[key]), []).append(bool(r[what]))
    order = sorted(groups, key=lambda g: (float(g) if key == "d_wanted" else 0.0, g))
    return {g: _share(groups[g]) for g in order}


def _concealed(r: dict) -> str:
    """What was concealed, as the row of the confusion table."""
    if r["kind"] in ("double", "beside"):
        return "two effects" if r["kind"] == "double" else "one beside one outside"
    return f"{r['null']} (null)" if r["kind"] == "null" else r["mechanism"]


def _ideal(ideal: dict) -> list[str]:
    """How often the truth could be named first at best, of the cases for which the nearest other effect was looked for.

    By one who knows that it is one of these two, both as likely, and how strong they are: with a chance of
    Phi(d' / 2), where d' is between the two.
    """
    if not ideal["count"]:
        return []
    return [
        f"    of {ideal['count']} whose nearest other effect is known, {ideal['hits']} named first; one who had only "
        f"these two to choose from would name {ideal['expected']:.1f} in the mean"
    ]


def text_of(board: dict) -> str:
    """The scoreboard in words and numbers."""
    run = "SEALED" if board["sealed"] else "DEVELOPMENT (no evidence)"
    lines = [f"{run} run, seed {board['seed']}: {board['cases']} cases, {board['failed']} failed"]
    if board.get("undrawn"):
        lines.append(f"{board['undrawn']} cases are not drawn or could not be")
    frozen = board.get("frozen")
    if frozen:
        changed = ", changed since" if frozen["changed"] else ""
        lines.append(
            f"diagnosis {frozen['diagnosis'][:12]}, truth {frozen['truth'][:12]}, commit {frozen['commit'][:12]}"
            f"{changed}, {frozen['date']}"
        )
    lines.append("")
    for p in board["proportions"].values():
        met = {None: "", True: "met", False: "MISSED"}[p["met"]]
        wanted = f"   target {_target(p['target'])}  {met}" if p["target"] else ""
        lines.append(f"{p['title']:36s} {_counted(p)}{wanted}")
    lines += _ideal(board["ideal"])
    say = lambda v, f="{:.3g}": "-" if v is None or v != v else f.format(v)  # noqa: E731
    e = board["elements"]
    lines += [
        "",
        f"F1 of named creases and panels, any d': {say(e['f1'])} ({say(e['low'])} to {say(e['high'])}) over "
        f"{e['cases']} cases (target >= 0.80); at d' >= {CLEAR:g}: {say(board['clear_elements']['f1'])}",
        f"removable error removed, held out (median, d' >= 5): {say(board['removed'])} (target >= 0.95)",
        f"error over noise, held out (median, d' >= 5): {say(board['floor'])} (target <= 1.2); "
        f"refitted without the effect {say(board['refitted_floor'])}",
        *(f"    beside it, {n}: {v:.3g}" for n, v in board["baselines"].items()),
        f"score of the truth in the screening over its d' (median, d' >= 5): {say(board['seen'])}",
        f"error of the strength (median): {say(board['recovery'], '{:.1%}')} (target <= 5 %)",
        f"calibration error of the stated probabilities: {say(board['ece'])} (target <= 0.05); "
        f"{say(board['ece_by_chance'])} is expected of so few even if all are right",
        f"ties: {board['ties']['count']}, with the truth among them {board['ties']['with_truth']}",
        f"seconds per diagnosis (median): {say(board['seconds'])}",
        "",
        "verdicts by kind",
    ]
    for kind, k in board["kinds"].items():
        if k["count"]:
            verdicts = ", ".join(f"{v} {n}" for v, n in k["verdicts"].items())
            lines.append(f"    {kind:12s} {k['count']:4d}, confidently wrong {k['wrong']}: {verdicts}")
    for key, title in (
        ("by_mechanism", "top-1 by mechanism"),
        ("by_d_wanted", "top-1 by detectability"),
        ("by_structure", "top-1 by structure"),
        ("by_null", "false alarms by null"),
        ("by_outside", "UNKNOWN by mechanism outside the catalogue"),
        ("by_pair", "confounded pair said so, by mechanism"),
    ):
        lines += ["", title, *(f"    {g:24s} {_counted(v)}" for g, v in board[key].items())] if board[key] else []
    lines += ["", "concealed -> named"]
    for truth, named in board["confusion"].items():
        lines.append(f"    {truth:24s} " + ", ".join(f"{n} {k}" for n, k in sorted(named.items(), key=lambda v: -v[1])))
    wrong = [r for r in board["rows"] if r["failed"] or r["wrong"] or r["alarm"] or False in _wanted(r)]
    if wrong:
        lines += ["", "cases that went wrong"]
    for r in wrong:
        truth = f"{r['mechanism'] or r['null']} at {r['site'] or 'the whole'}, d' = {r['d']:.0f}, {r['structure']}"
        lines.append(
            f"    {r['case']:4d} {r['kind']}: {truth} -> {r['failed'] or r['verdict']}: {r['top']} "
            f"{r.get('where', '')} p = {r['probability']:.2f}"
        )
    return "\n".join(lines) + "\n"


def _wanted(r: dict) -> tuple:
    """What should be true of a case, by its kind."""
    return r["top1"], r["said"], r["double"], r.get("beside"), r["unknown"] if r["kind"] == "outside" else None


def _counted(p: dict) -> str:
    share = "  -  " if p["share"] is None else f"{p['share']:6.1%}"
    return f"{p['hits']:4d}/{p['count']:<4d} {share}  95 %: {p['low']:.1%} to {p['high']:.1%}"


def _target(bounds: Sequence[float]) -> str:
    low, high = bounds
    return f">= {low:.0%}" if high == 1.0 else f"<= {high:.0%}" if low == 0.0 else f"{low:.0%} to {high:.0%}"


def report(out: Path, cases: int, say: Callable[[str], None] = print) -> dict:
    """Opens the answers, scores, and writes the scoreboard and its figures.

    Args:
        out: folder of the run. cases: how many to count; those that were not diagnosed are left out.

    Raises:
        InputError: an answer that was changed after it was sealed.
    """
    from origami_proof.figures import figures

    rows, undrawn = [], 0
    for index in range(cases):
        folder, sealed = out / "cases" / f"{index:04d}", out / "sealed" / f"{index:04d}.json"
        undrawn += not (folder / "answer.sha256").exists()
        if not (folder / "diagnosis.json").exists():
            continue
        content = sealed.read_bytes()
        if hashlib.sha256(content).hexdigest() != (folder / "answer.sha256").read_text():
            raise InputError("an answer was changed after it was sealed", file=sealed)
        others = {n: _found(folder / n) for n in (SEPARATING, SUGGESTED) if (folder / n / "diagnosis.json").exists()}
        row = judge(json.loads(content), _found(folder), others)
        if sealed.with_suffix(NEAREST).exists():
            row["apart"] = json.loads(sealed.with_suffix(NEAREST).read_text())["apart"]
        rows.append(row)
    seed = json.loads((out / RUN).read_text())["seed"]
    board = {"seed": seed, "sealed": seed >= DEVELOPMENT, "cases": len(rows), "undrawn": undrawn}
    if (out / FROZEN).exists():
        board["frozen"] = json.loads((out / FROZEN).read_text())
    board |= {"failed": sum(bool(r["failed"]) for r in rows), **scores(rows), "rows": rows}
    write_json(out / BOARD, board)
    text = text_of(board)
    (out / "scoreboard.txt").write_text(text)
    if rows:
        figures(board, out)
    say(text)
    return board


def _found(folder: Path) -> dict:
    return json.loads((folder / "diagnosis.json").read_text())
