"""What half and double of every number do that the diagnosis is built with.

    python benchmarks/constants.py                      # all of them, 1 to 2 hours; writes docs/constants.md
    python benchmarks/constants.py infer.search:UNFITTED fit.noise:ORDER

Named numbers of `fit`, `predict`, `infer` and of the parts of `diagnose` that a verdict depends on are found by reading
the source. Each is halved and doubled, and recordings with known answers are diagnosed anew: a strip of which one
crease rubs, one that rubs less, one that stiffens, one of which nothing is missing. The table says whether a word of
the four verdicts changed, and by how much any probability of an effect did. Prior widths and sizes of
`fit/hyper.py` are varied on whole batteries instead (`origami_proof --rejudge --vary`).
"""

import ast
import importlib
import re
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from origami_sim.diagnose import diagnose  # noqa: E402
from origami_sim.effects import get  # noqa: E402
from origami_sim.recording import Recording  # noqa: E402
from tests.diagnose.strips import record, subject  # noqa: E402

FOLDERS = ("observation", "hypotheses", "fit", "predict", "infer", "verdict", "diagnose")
LEFT_OUT = ("observation/compare.py", "observation/gait.py", "observation/observe.py", "fit/hyper.py",
            "report/diagnosis.py", "diagnose/baselines.py", "diagnose/closed_loop.py",
            "diagnose/command.py", "diagnose/experiment.py", "diagnose/inertia.py", "diagnose/menu.py",
            "diagnose/observed.py", "diagnose/overlay.py", "diagnose/prepare.py", "diagnose/tables.py")  # fmt: skip
"""Varied elsewhere, asked of other recordings (closed loops, slow motions), or made after the verdict."""

SUSPECTS = ("crease_friction", "crease_stiffening", "crease_quadratic_damping", "air_drag", "crease_relaxation",
            "angle_offset", "clock_delay", "tracker_lag")  # fmt: skip
TABLE = ROOT / "docs" / "constants.md"


def recordings() -> dict[str, Recording]:
    """Four swings with known answers."""
    size: dict[str, Any] = {"panels": 3, "duration": 2.5, "rate": 80, "size": 0.6}
    cubic = get("crease_stiffening").fitted[0]
    strength = 2 * abs(get("crease_stiffening").parameter(cubic).typical or 1.0)
    rubs = {at: {"crease_friction": {"friction_moment": (m, [at])}} for at, m in ((1, 2e-5), (0, 8e-6))}
    return {
        "rubs": record(rubs[1], **size),
        "rubs less": record(rubs[0], seed=2, **size),
        "stiffens": record({"crease_stiffening": {cubic: (strength, [1])}}, seed=3, **size),
        "nothing": record(seed=4, **size),
    }


def numbers() -> Iterator[tuple[str, str, Any, str]]:
    """Module, name, value and first sentence of every named number."""
    for folder in FOLDERS:
        for file in sorted((ROOT / "origami_sim" / folder).glob("*.py")):
            if f"{folder}/{file.name}" in LEFT_OUT:
                continue
            module, body = f"{folder}.{file.stem}", ast.parse(file.read_text()).body
            for node, after in zip(body, [*body[1:], None], strict=True):
                if not isinstance(node, ast.Assign) or ast.unparse(node.value).startswith("range("):
                    continue
                names = [t.id for target in node.targets for t in ast.walk(target) if isinstance(t, ast.Name)]
                said = ast.get_docstring(ast.Module([after], [])) if isinstance(after, ast.Expr) else ""
                for name in names:
                    value = getattr(importlib.import_module(f"origami_sim.{module}"), name)
                    if name.isupper() and isinstance(value, (int, float)) and not isinstance(value, bool):
                        yield module, name, value, re.split(r"\.(?:\s|$)", said or "")[0].replace("\n", " ")


def put(name: str, old: Any, new: Any) -> None:
    """Gives a constant another value wherever it was imported."""
    for module in [m for n, m in list(sys.modules.items()) if n.startswith("origami_sim.") and m is not None]:
        if getattr(module, name, None) is old:
            setattr(module, name, new)


def judged(cases: dict[str, Recording]) -> dict[str, tuple[str, tuple[str, ...], dict[str, float]]]:
    out = {}
    for name, recording in cases.items():
        found = diagnose(subject(3), [recording], catalogue=SUSPECTS)
        out[name] = found.verdict, tuple(found.chosen), found.marginals
    return out


def compared(base: dict, now: dict) -> tuple[list[str], float]:
    """Recordings of which the word changed, and the largest change of a probability."""
    words = [n for n in base if base[n][:2] != now[n][:2]]
    moved = [abs(base[n][2].get(k, 0.0) - now[n][2].get(k, 0.0)) for n in base for k in {*base[n][2], *now[n][2]}]
    return words, max(moved, default=0.0)


def main(asked: Sequence[str]) -> None:
    cases, began = recordings(), time.process_time()
    base = judged(cases)
    print({n: v[:2] for n, v in base.items()}, f"{time.process_time() - began:.0f} s", flush=True)
    rows = []
    for module, name, value, said in numbers():
        if asked and f"{module}:{name}" not in asked:
            continue
        cells = []
        for by in (0.5, 2.0):
            new = type(value)(max(1, round(value * by))) if isinstance(value, int) else value * by
            try:
                original = getattr(importlib.import_module(f"origami_sim.{module}"), name)
                put(name, original, new)
                words, moved = compared(base, judged(cases))
                cells.append(f"{moved:.3f}" + (f", **{', '.join(words)}**" if words else ""))
            except Exception as error:  # a number that must not be so is an answer, too
                cells.append(f"fails: {str(error)[:60]}")
            finally:
                put(name, new, original)
        row = f"| `{module.replace('.', '/')}.py` {name} | {value:g} | {said} | {cells[0]} | {cells[1]} |"
        rows.append(row)
        print(row, flush=True)
    if not asked:
        head = TABLE.read_text().partition("| number |")[0]
        TABLE.write_text(
            head + "| number | value | what it is | half | double |\n|---|---|---|---|---|\n" + "\n".join(rows) + "\n"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
