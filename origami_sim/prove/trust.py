"""Fits the curve of `diagnose.trust` to runs: `python -m origami_sim.prove.trust RUN [RUN ...]`.

Development runs, and sealed runs that were scored: once opened, they are spent, and tell how often the diagnosis was
right on cases that nobody had seen. Outcomes are stored with the curve, and those of other seeds count on.
"""

import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from origami_sim.diagnose.trust import FILE, features
from origami_sim.prove import DEVELOPMENT
from origami_sim.prove.battery import RUN
from origami_sim.prove.freeze import FROZEN
from origami_sim.prove.score import BOARD, judge

RIDGE = np.array([0.0, 1.0, 1.0])
"""Inverse variances of the coefficients: none is far from 0 without many cases."""

EXPECTED, WORTH = 0.75, 8.0
"""Share that is expected to be right on cases that nobody has seen, and how many cases this expectation is worth: a
development battery is looked at while the method is made."""


Outcome = tuple[float, int, bool]
"""Of a case in which something was named: held-out gain, how many effects, and whether the truth is among them."""


def outcomes(run: Path) -> list[Outcome]:
    """Of all cases of a run in which something was named."""
    out = []
    for file in sorted((run / "cases").glob("*/diagnosis.json")):
        found = json.loads(file.read_text())
        row = judge(json.loads((run / "sealed" / f"{file.parent.name}.json").read_text()), found)
        nominal = any(c == "nominal" for c in found.get("chosen", []))
        if row["correct"] is None or nominal:
            continue
        best = max(found["candidates"], key=lambda c: c["probability"])
        out.append((round(best["gain"], 2), len(best["effects"]), row["correct"]))
    return out


def fitted(cases: Sequence[Outcome]) -> np.ndarray:
    """(3,) coefficients of the logistic curve of highest posterior; trust does not fall with the gain."""
    x, y = np.stack([features(*c[:2]) for c in cases]), np.array([c[2] for c in cases], float)
    x, y = np.vstack([x, x.mean(axis=0)]), np.append(y, EXPECTED)
    worth = np.append(np.ones(len(cases)), WORTH)

    def cost(w):
        s = x @ w
        return worth @ (np.logaddexp(0.0, s) - y * s) + 0.5 * RIDGE @ w**2

    free = (None, None)
    return minimize(cost, np.zeros(x.shape[1]), bounds=[free, (0.0, None), free]).x


def main() -> None:
    runs = [Path(p) for p in sys.argv[1:]]
    stored = [json.loads((r / RUN).read_text()) | json.loads((r / FROZEN).read_text()) for r in runs]
    if not runs or any(
        s["seed"] >= DEVELOPMENT and not (r / BOARD).exists() for r, s in zip(runs, stored, strict=True)
    ):
        sys.exit("runs of development seeds, or sealed ones that were scored, are needed")
    keys = ("seed", "commit", "diagnosis", "truth")
    before = json.loads(FILE.read_text())["batteries"]
    known = {b["seed"]: b for b in before if "outcomes" in b}
    known |= {s["seed"]: {k: s[k] for k in keys} | {"outcomes": outcomes(r)} for r, s in zip(runs, stored, strict=True)}
    batteries = [known[seed] for seed in sorted(known)]
    cases = [c for b in batteries for c in b["outcomes"]]
    w = fitted(cases)
    FILE.write_text(
        json.dumps(
            {
                "coefficients": [round(float(v), 3) for v in w],
                "features": ["1", "log of the held-out gain", "several effects"],
                "named": len(cases),
                "right": sum(c[2] for c in cases),
                "date": datetime.now(UTC).strftime("%Y-%m-%d"),
                "batteries": batteries,
            },
            indent=1,
        )
        + "\n"
    )
    print(FILE.read_text())


if __name__ == "__main__":
    main()
