"""Wall time of what a user types, as whole processes with a filled kernel cache."""

import subprocess
import sys
import tempfile
import time

from timing import table, verdict


def _wall(*arguments: str) -> tuple[float, int]:
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        done = subprocess.run([sys.executable, "-m", "origami_sim.commands.cli", *arguments, "--out", f"{folder}/run"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        return time.perf_counter() - began, done.returncode


def report(quick: bool = False) -> str:
    rows = []
    for label, arguments, target in (
        ("origami-sim run box", ("run", "box"), None), ("origami-sim run crawler", ("run", "crawler"), None),
        ("origami-sim demo", ("demo",), 120.0),
    ):  # fmt: skip
        if quick and label.endswith("demo"):
            continue
        walls, codes = zip(*(_wall(*arguments) for _ in range(1 if quick or target else 3)), strict=True)
        result = f"exit code {max(codes)}" if any(codes) else "ok"
        rows.append((label, min(walls), verdict(min(walls), target) if target else "", result))
    return table("Commands [s], whole process", ("command", "min", "wanted", "result"), rows)
