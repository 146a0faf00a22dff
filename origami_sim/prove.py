"""The proof: concealed effects drawn at random, diagnosed from the recordings alone, and a scoreboard.

Three kinds of processes that know nothing of each other: the truth (`benchmarks/concealed/draw.py`, MuJoCo, imports
nothing of this package) writes recordings into a case's folder and the answer into a sealed one; the diagnosis
(`python -m origami_sim.prove CASE_FOLDER`) gets the case's folder, and an audit hook stops it if it opens an answer;
the score opens the answers at the end, and checks them against the digests that were taken when they were drawn.
"""

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from origami_sim.errors import InputError

DEVELOPMENT = 1000
"""Seeds below this are for development; a seed from here on is sealed: it counts once."""

TIMEOUT = 900.0
"""Longest diagnosis or drawing of one case [s]."""


# --- the diagnosis of one case, in a process of its own


def subject(folder: Path):
    """The model that an experimenter would build from object.json, with what is known of its numbers.

    Panels are kept straight by bars that stretch by less than a thousandth under the device's weight.
    """
    import numpy as np

    from origami_sim.build import Sheet
    from origami_sim.diagnose import Subject, factor
    from origami_sim.drive import Drive
    from origami_sim.materials import MU0
    from origami_sim.pattern.assemble import assemble

    o = json.loads((folder / "object.json").read_text())
    x, faces = np.array(o["vertices"]), o["faces"]
    sheet = Sheet(
        assemble(x, [tuple(f) for f in faces]),
        thickness=o["thickness"],
        density=o["density"],
        modulus=1.5e6,
        triangulation="center",
    )
    sheet.fix(panels=[o["held"]])
    corners = [x[f] for f in faces]
    area = sum(
        np.linalg.norm(sum(np.cross(c[k] - c[0], c[k + 1] - c[0]) for k in range(1, len(c) - 1))) / 2
        for p, c in enumerate(corners)
        if p != o["held"]
    )
    weight = o["density"] * o["thickness"] * area * o["gravity"]
    sheet.on("bars").set("bars", stiffness=RIGIDITY * weight)
    sheet.set("panel_bending", stiffness=DIAGONAL_STIFFNESS)
    for m in o["magnets"]:
        sheet.magnetise(m["panel"], remanence=1.0, volume=m["moment"] * MU0, poling=m["poling"])
    sheet.crease(range(len(o["creases"])), stiffness=0.0)
    sheet.on("crease_viscosity")
    sheet.gravity((0.0, 0.0, -o["gravity"]))
    sheet.membrane_damping = 0.0
    sheet.name("panel", [f"panel{p}" for p in range(len(faces))])
    model, parameters = sheet.build()
    middles = model.position[model.creases[:, 1:3]].mean(1)
    names = [""] * len(middles)
    for c in o["creases"]:
        parent, child = (faces[p] for p in c["panels"])
        middle = x[[v for v in child if v in parent]].mean(0)
        n = int(np.argmin(np.linalg.norm(middles - middle, axis=1)))
        names[n] = c["name"]
        parameters.set("crease", "stiffness", c["stiffness"], np.array([n]))
        parameters.set("crease_viscosity", "viscosity", c["viscosity"], np.array([n]))
    model = replace(model, names={**model.names, "crease": tuple(names)})
    return Subject.from_model(model, parameters, Drive(), [factor(n, s) for n, s in o["priors"].items()])


RIGIDITY = 6e4
"""Stiffness of each bar that keeps a panel's shape, over the device's weight [1/m]: panels stretch by some 0.01 mm."""

DIAGONAL_STIFFNESS = 0.2
"""Of the diagonals of a panel, some 500 times that of a crease [N m/rad]."""


def diagnose_case(folder: Path) -> dict:
    """Diagnoses the recordings of a case's folder and writes diagnosis.json there."""
    from origami_sim.diagnose import diagnose
    from origami_sim.recording import read_recording

    began = time.perf_counter()
    recordings = [read_recording(p) for p in sorted(folder.glob("recording*.csv"))]
    found = diagnose(subject(folder), recordings).to_dict()
    for bulky in ("traces", "correlations", "isolability"):
        found.pop(bulky, None)
    for place in found["places"]:
        for bulky in ("times", "moment", "error", "curves"):
            place.pop(bulky, None)
    found["wall"] = time.perf_counter() - began
    _write(folder / "diagnosis.json", found)
    return found


def _guard(event: str, arguments: tuple) -> None:
    """Audit hook: the diagnosis never opens an answer."""
    if event == "open" and Path(str(arguments[0])).parent.name == "sealed":
        raise PermissionError("the diagnosis tried to open a sealed answer")


def _write(path: Path, value) -> None:
    part = path.with_suffix(".part")
    part.write_text(json.dumps(value, indent=1))
    part.replace(path)


# --- drawing and running


def generator() -> Path:
    """The truth generator of a checkout.

    Raises:
        InputError: the package was installed without it.
    """
    path = Path(__file__).resolve().parent.parent / "benchmarks" / "concealed" / "draw.py"
    if not path.is_file():
        raise InputError("the proof needs a checkout of the repository", field="benchmarks/concealed", value="absent")
    return path


def prove(
    out: Path,
    *,
    cases: int,
    seed: int,
    jobs: int = 1,
    structures: Sequence[str] = (),
    kinds: Sequence[str] = (),
    say: Callable[[str], None] = print,
) -> dict:
    """Draws cases, diagnoses them and scores; what is done already is kept.

    Args:
        out: folder of the run: cases/, sealed/, scoreboard.json, scoreboard.txt and figures.
        cases, seed: how many, and which. jobs: cases at a time. structures, kinds: only these (default: all).

    Raises:
        InputError: another seed or choice in the same folder, or a truth generator that cannot run.
    """
    out.mkdir(parents=True, exist_ok=True)
    choice = {"seed": seed, "structures": list(structures), "kinds": list(kinds)}
    stored = out / "run.json"
    if stored.exists() and json.loads(stored.read_text()) != choice:
        raise InputError("the folder holds another run", field="--out", value=str(out), allowed="a folder of its own")
    _write(stored, choice)
    sealed = seed >= DEVELOPMENT
    say(f"{'sealed' if sealed else 'development'} run: seed {seed}, {cases} cases, in {out}")
    began = time.perf_counter()
    done = 0

    def one(index: int) -> None:
        nonlocal done
        folder, answer = out / "cases" / f"{index:04d}", out / "sealed" / f"{index:04d}.json"
        _draw(index, folder, answer, choice)
        found = _diagnose(folder)
        done += 1
        passed = time.perf_counter() - began
        told = found.get("failed") or f"{found['verdict']} {', '.join(found['chosen'])}"
        say(f"{done}/{cases} case {index}: {told} (p = {found.get('probability', 0):.2f}); {passed:.0f} s")

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        list(pool.map(one, range(cases)))
    return report(out, cases, say)


def _draw(index: int, folder: Path, answer: Path, choice: dict) -> None:
    """The truth, in a process of its own, and the digest of its answer."""
    digest = folder / "answer.sha256"
    if digest.exists():
        return
    command = [sys.executable, str(generator()), "--seed", str(choice["seed"]), "--case", str(index)]
    command += ["--folder", str(folder.resolve()), "--answer", str(answer.resolve())]
    for option in ("structures", "kinds"):
        command += [f"--{option}", *choice[option]] if choice[option] else []
    ran = _run(command)
    if isinstance(ran, str):
        raise InputError(
            f"the truth generator failed ({ran}); it needs MuJoCo: pip install 'origami-sim[proof]'",
            field="case",
            value=index,
        )
    digest.write_text(hashlib.sha256(answer.read_bytes()).hexdigest())


def _diagnose(folder: Path) -> dict:
    """The diagnosis of a case, in a process of its own; a failure is a result too."""
    result = folder / "diagnosis.json"
    if not result.exists():
        ran = _run([sys.executable, "-m", "origami_sim.prove", str(folder.resolve())])
        if isinstance(ran, str):
            _write(result, {"failed": ran})
    return json.loads(result.read_text())


def _run(command: list[str]) -> str | None:
    """None if it succeeded, else its last line."""
    single = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=single)
    except subprocess.TimeoutExpired:
        return f"longer than {TIMEOUT:.0f} s"
    return (ran.stderr.strip().splitlines() or ["no message"])[-1] if ran.returncode else None


# --- scoring

NAMED = ("MECHANISM", "MEASUREMENT", "SEVERAL", "TIE")
SURE = 0.9


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
    import numpy as np

    p, c = np.asarray(probability, float), np.asarray(correct, float)
    if not len(p):
        return float("nan")
    index = np.minimum((p * bins).astype(int), bins - 1)
    gaps = [abs(p[index == b].sum() - c[index == b].sum()) for b in range(bins)]
    return float(sum(gaps) / len(p))


def parts(label: str) -> list[tuple[str, str]]:
    """(effect, site) of a label such as "crease_friction at fold2 + air_drag at all panels"."""
    return [(e, s) for e, _, s in (one.partition(" at ") for one in label.split(" + "))]


def judge(answer: dict, found: dict) -> dict:
    """What came of one case.

    Returns: a row with `verdict`, `top` (named mechanism or verdict), and True, False or None (does not apply) for
    `top1`, `inside` (truth in the stated 95 % set), `wrong` (confidently), `alarm`, `site`, `covered`, `unknown`; and
    `removed`, `recovery` (relative error of the strength), `probability`, `correct`.
    """
    import numpy as np

    row: dict = {k: answer[k] for k in ("case", "kind", "null", "structure", "mechanism", "site", "d_wanted", "d")}
    row |= {"failed": found.get("failed", ""), "verdict": "FAILED", "top": "FAILED", "probability": 0.0}
    row |= dict.fromkeys(("top1", "inside", "wrong", "alarm", "found_site", "covered", "unknown", "correct", "double"))
    row |= dict.fromkeys(("removed", "recovery", "floor"))
    truth, names = bool(answer["names"]), set(answer["names"])
    if row["failed"]:
        row |= {"top1": False, "inside": False} if truth and answer["kind"] == "single" else {}
        return row
    verdict, chosen = found["verdict"], found["chosen"] if found["verdict"] in NAMED else []
    explanations = [parts(c) for c in chosen] if verdict == "TIE" else [[p for c in chosen for p in parts(c)]]
    explanations = [e for e in explanations if e]
    hit = lambda e: len(e) == 1 and e[0][0] in names  # noqa: E731
    contains = any(hit(e) for e in explanations)
    probability = float(found["probability"] or 0.0)
    row |= {"verdict": verdict, "probability": probability, "wall": found.get("wall", 0.0)}
    row["top"] = " + ".join(sorted({p[0] for p in explanations[0]})) if explanations else verdict
    nothing = [("nominal", "")] in explanations  # a tie with "nothing is missing" claims nothing
    camera = answer["null"] == "wrong_camera"
    if answer["kind"] == "null":
        acceptable = ("ADEQUATE", "PARAMETER", "UNTESTABLE", *(("MEASUREMENT",) if camera else ()))
        row["alarm"] = verdict not in acceptable and not nothing and not (camera and contains)
        right = not row["alarm"]
    elif answer["kind"] == "outside":
        row["unknown"] = verdict == "UNKNOWN"
        right = row["unknown"]
    elif answer["kind"] == "double":
        second = set(answer["second"]["names"])
        both = lambda e: {p[0] for p in e} & names and {p[0] for p in e} & second and len(e) == 2  # noqa: E731
        right = row["double"] = any(map(both, explanations))
    else:
        row["top1"], row["inside"] = bool(explanations) and hit(explanations[0]), contains
        row["unknown"] = verdict == "UNKNOWN"
        right = contains
    row["wrong"] = bool(explanations) and probability >= SURE and not right and not nothing
    if explanations:
        row["correct"] = bool(right)
    row["where"] = explanations[0][0][1] if explanations else ""
    noise, before, after = (np.array(found[k], float) for k in ("noise", "error_refitted", "error_after"))
    row["floor"] = float(np.sqrt(np.mean((after / noise) ** 2)))
    row["refitted"] = float(np.sqrt(np.mean((before / noise) ** 2)))
    row["baselines"] = {
        b["name"]: float(np.sqrt(np.mean((np.array(b["rms"], float) / noise) ** 2)))
        for b in found.get("baselines", [])
        if all(v is not None for v in b["rms"])
    }
    if answer["kind"] == "single":
        excess = np.sum((before / noise) ** 2) - len(noise)
        if excess > 0.1 * len(noise):
            row["removed"] = float((np.sum((before / noise) ** 2) - np.sum((after / noise) ** 2)) / excess)
        if row["top1"]:
            row["found_site"] = row["where"] == answer["site"] if answer["site"] else None
            _strength(row, answer, found)
    return row


def _strength(row: dict, answer: dict, found: dict) -> None:
    """Error of the strength and whether its interval covers it."""
    name, effect = answer["number"], answer["names"][0]
    best = next((c for c in found["candidates"] if len(c["effects"]) == 1 and c["effects"][0] == effect), None)
    number = next((n for n in best["numbers"] if n["label"] == f"{effect}.{name}"), None) if best and name else None
    if number and number["value"] is not None:
        row["recovery"] = abs(number["value"] / answer["strength"] - 1)
        if number["low"] is not None and number["high"] is not None:
            row["covered"] = number["low"] <= answer["strength"] <= number["high"]


TARGETS = {
    "top1": ("top-1 mechanism, d' >= 5", ">=", 0.90),
    "inside": ("truth in the stated set, d' >= 5", ">=", 0.95),
    "wrong": ("confidently wrong, any d'", "<=", 0.02),
    "alarm": ("false alarms on nulls", "<=", 0.05),
    "found_site": ("site, where named, d' >= 5", ">=", 0.95),
    "covered": ("95 % intervals that cover", ">=", 0.90),
    "unknown": ("UNKNOWN recall outside", ">=", 0.85),
    "false_unknown": ("false UNKNOWN inside", "<=", 0.05),
    "double": ("both of two effects named", "", None),
}


def scores(rows: Sequence[dict]) -> dict:
    """The scoreboard: for each measure, hits, count, share with Wilson interval, target and whether it is met."""
    import numpy as np

    single = [r for r in rows if r["kind"] == "single"]
    clear = [r for r in single if r["d"] >= 4.5]  # drawn as 5, within the accuracy of the search
    sets = {
        "top1": [r["top1"] for r in clear],
        "inside": [r["inside"] for r in clear],
        "wrong": [bool(r["wrong"]) for r in rows],
        "alarm": [r["alarm"] for r in rows if r["kind"] == "null" and r["alarm"] is not None],
        "found_site": [r["found_site"] for r in clear if r["found_site"] is not None],
        "covered": [r["covered"] for r in clear if r["covered"] is not None],
        "unknown": [bool(r["unknown"]) for r in rows if r["kind"] == "outside"],
        "false_unknown": [bool(r["unknown"]) for r in single],
        "double": [bool(r["double"]) for r in rows if r["kind"] == "double"],
    }
    out: dict = {"proportions": {}}
    for key, (title, way, target) in TARGETS.items():
        hits, count = int(sum(map(bool, sets[key]))), len(sets[key])
        low, high = wilson(hits, count)
        share = hits / count if count else None
        met = None if share is None or target is None else (share >= target if way == ">=" else share <= target)
        out["proportions"][key] = {"title": title, "hits": hits, "count": count, "share": share}
        out["proportions"][key] |= {"low": low, "high": high, "way": way, "target": target, "met": met}
    stated = [r for r in rows if r["correct"] is not None]
    out["ece"] = calibration_error([r["probability"] for r in stated], [r["correct"] for r in stated])
    median = lambda key, part: float(np.median(v)) if (v := [r[key] for r in part if r.get(key) is not None]) else None  # noqa: E731
    out["removed"] = median("removed", clear)
    out["floor"] = median("floor", clear)
    out["refitted_floor"] = median("refitted", clear)
    out["recovery"] = median("recovery", clear)
    out["seconds"] = median("wall", rows)
    ties = [r for r in rows if r["verdict"] == "TIE"]
    out["ties"] = {"count": len(ties), "with_truth": sum(bool(r["correct"]) for r in ties)}
    out["baselines"] = {
        n: float(np.median([r["baselines"][n] for r in clear if n in r.get("baselines", {})]))
        for n in dict.fromkeys(n for r in clear for n in r.get("baselines", {}))
    }
    for key in ("mechanism", "d_wanted", "structure"):
        groups = {}
        for r in single:
            groups.setdefault(str(r[key]), []).append(bool(r["top1"]))
        out[f"by_{key}"] = {g: {"hits": sum(v), "count": len(v)} for g, v in sorted(groups.items())}
    confusion: dict = {}
    for r in rows:
        truth = "two effects" if r["kind"] == "double" else r["mechanism"] or r["null"]
        confusion.setdefault(truth, {}).setdefault(r["top"], 0)
        confusion[truth][r["top"]] += 1
    out["confusion"] = confusion
    return out


def text_of(board: dict) -> str:
    """The scoreboard in words and numbers."""
    run = "SEALED" if board["sealed"] else "DEVELOPMENT (no evidence)"
    lines = [f"{run} run, seed {board['seed']}: {board['cases']} cases, {board['failed']} failed", ""]
    for p in board["proportions"].values():
        share = "  -  " if p["share"] is None else f"{p['share']:5.1%}"
        met = {None: "", True: "met", False: "MISSED"}[p["met"]]
        lines.append(
            f"{p['title']:36s} {p['hits']:4d}/{p['count']:<4d} {share}  95 %: {p['low']:.1%} to {p['high']:.1%}"
            + (f"   target {p['way']} {p['target']:.0%}  {met}" if p["target"] is not None else "")
        )
    say = lambda v, f="{:.3g}": "-" if v is None or v != v else f.format(v)  # noqa: E731
    lines += [
        "",
        f"removable error removed, held out (median, d' >= 5): {say(board['removed'])} (target >= 0.95)",
        f"error over noise, held out (median, d' >= 5): {say(board['floor'])} (target <= 1.2); "
        f"refitted without the effect {say(board['refitted_floor'])}",
        *(f"    beside it, {n}: {v:.3g}" for n, v in board["baselines"].items()),
        f"error of the strength (median): {say(board['recovery'], '{:.1%}')} (target <= 5 %)",
        f"calibration error of the stated probabilities: {say(board['ece'])} (target <= 0.05)",
        f"ties: {board['ties']['count']}, with the truth among them {board['ties']['with_truth']}",
        f"seconds per diagnosis (median): {say(board['seconds'])}",
    ]
    for key in ("mechanism", "d_wanted", "structure"):
        lines += ["", f"top-1 by {key.replace('d_wanted', 'detectability')}"]
        lines += [f"    {g:24s} {v['hits']}/{v['count']}" for g, v in board[f"by_{key}"].items()]
    lines += ["", "concealed -> named"]
    for truth, named in board["confusion"].items():
        lines.append(f"    {truth:24s} " + ", ".join(f"{n} {k}" for n, k in sorted(named.items(), key=lambda v: -v[1])))
    wrong = [r for r in board["rows"] if r["failed"] or r["wrong"] or r["alarm"] or r["top1"] is False]
    if wrong:
        lines += ["", "cases that went wrong"]
    for r in wrong:
        truth = f"{r['mechanism'] or r['null']} at {r['site'] or 'the whole'}, d' = {r['d']:.0f}, {r['structure']}"
        lines.append(
            f"    {r['case']:4d} {truth} -> {r['failed'] or r['verdict']}: {r['top']} {r.get('where', '')} "
            f"p = {r['probability']:.2f}"
        )
    return "\n".join(lines) + "\n"


def report(out: Path, cases: int, say: Callable[[str], None] = print) -> dict:
    """Opens the answers, scores, and writes the scoreboard and its figures.

    Raises:
        InputError: an answer that was changed after it was sealed.
    """
    rows = []
    for index in range(cases):
        folder, sealed = out / "cases" / f"{index:04d}", out / "sealed" / f"{index:04d}.json"
        if not (folder / "diagnosis.json").exists():
            continue
        content = sealed.read_bytes()
        if hashlib.sha256(content).hexdigest() != (folder / "answer.sha256").read_text():
            raise InputError("an answer was changed after it was sealed", file=sealed)
        rows.append(judge(json.loads(content), json.loads((folder / "diagnosis.json").read_text())))
    seed = json.loads((out / "run.json").read_text())["seed"]
    board = {"seed": seed, "sealed": seed >= DEVELOPMENT, "cases": len(rows)}
    board |= {"failed": sum(bool(r["failed"]) for r in rows), **scores(rows), "rows": rows}
    _write(out / "scoreboard.json", board)
    text = text_of(board)
    (out / "scoreboard.txt").write_text(text)
    if rows:
        figures(board, out)
    say(text)
    return board


def figures(board: dict, out: Path) -> None:
    """confusion.png; accuracy.png with accuracy by d' and stated against observed probability."""
    import matplotlib
    import numpy as np

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    truths = sorted(board["confusion"])
    tops = sorted({t for v in board["confusion"].values() for t in v})
    table = np.array([[board["confusion"][t].get(n, 0) for n in tops] for t in truths])
    fig, ax = plt.subplots(figsize=(3.5 + 0.32 * len(tops), 2.8 + 0.28 * len(truths)), layout="constrained")
    ax.imshow(table, cmap="Blues", aspect="auto")
    ax.set_xticks(range(len(tops)), tops, rotation=60, ha="right", fontsize=8)
    ax.set_yticks(range(len(truths)), truths, fontsize=8)
    for i, j in zip(*np.nonzero(table), strict=True):
        dark = table[i, j] > 0.6 * table.max()
        ax.text(j, i, str(table[i, j]), ha="center", va="center", fontsize=8, color="white" if dark else "black")
    ax.set(xlabel="named", ylabel="concealed")
    fig.savefig(out / "confusion.png", dpi=130)
    plt.close(fig)
    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    levels = sorted(board["by_d_wanted"], key=float)
    for n, level in enumerate(levels):
        v = board["by_d_wanted"][level]
        share, (low, high) = v["hits"] / v["count"], wilson(v["hits"], v["count"])
        left.errorbar(n, share, [[max(0.0, share - low)], [max(0.0, high - share)]], fmt="o", color="C0", capsize=4)
        left.annotate(f"{v['hits']}/{v['count']}", (n, share), (6, 4), textcoords="offset points", fontsize=8)
    left.axhline(0.9, color="0.6", lw=1, ls="--")
    left.set_xticks(range(len(levels)), [f"{float(v):g}" for v in levels])
    left.set(
        xlabel="detectability d'",
        ylabel="top-1, with 95 % interval",
        ylim=(-0.05, 1.05),
        xlim=(-0.5, len(levels) - 0.5),
    )
    stated = [(r["probability"], r["correct"]) for r in board["rows"] if r["correct"] is not None]
    right.plot([0, 1], [0, 1], color="0.6", lw=1, ls="--")
    if stated:
        p, c = np.array(stated, float).T
        index = np.minimum((p * 10).astype(int), 9)
        for b in np.unique(index):
            mine = index == b
            right.plot(p[mine].mean(), c[mine].mean(), "o", color="C1", ms=4 + 2 * np.sqrt(mine.sum()))
            right.annotate(
                str(mine.sum()), (p[mine].mean(), c[mine].mean()), (6, 4), textcoords="offset points", fontsize=8
            )
    right.set(xlabel="stated probability", ylabel="share correct", xlim=(0, 1.05), ylim=(-0.05, 1.05))
    fig.savefig(out / "accuracy.png", dpi=130)
    plt.close(fig)


def register(parser: argparse.ArgumentParser) -> None:
    """Arguments of `origami-sim prove`."""
    parser.add_argument("--cases", type=int, default=12, help="cases to draw (default 12)")
    parser.add_argument("--seed", type=int, default=1, help=f"from {DEVELOPMENT} on: a sealed run (default 1)")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time (default 1)")
    parser.add_argument("--structures", nargs="+", default=[], help="only these (see benchmarks/concealed/objects.py)")
    parser.add_argument("--kinds", nargs="+", default=[], help="only these: single, null, outside, double")
    parser.add_argument("--score", action="store_true", help="only score what is done")
    parser.add_argument("--out", metavar="FOLDER", help="run folder (default runs/prove_SEED)")


def run(args: argparse.Namespace) -> int:
    """Runs `origami-sim prove`."""
    for name in ("cases", "jobs"):
        if getattr(args, name) < 1:
            raise InputError("must be positive", field=f"--{name}", value=getattr(args, name), allowed=">= 1")
    if args.seed < 0:
        raise InputError("must not be negative", field="--seed", value=args.seed, allowed=">= 0")
    out = Path(args.out or f"runs/prove_{args.seed}")

    def say(text: str) -> None:
        print(text, file=sys.stderr if args.json else sys.stdout, flush=True)

    if args.score:
        if not (out / "run.json").exists():
            raise InputError("there is no proof in this folder", field="--out", value=str(out))
        board = report(out, args.cases, say)
    else:
        board = prove(
            out, cases=args.cases, seed=args.seed, jobs=args.jobs, structures=args.structures, kinds=args.kinds, say=say
        )
    if args.json:
        print(json.dumps({k: v for k, v in board.items() if k != "rows"}))
    return 0


if __name__ == "__main__":
    sys.addaudithook(_guard)
    diagnose_case(Path(sys.argv[1]))
