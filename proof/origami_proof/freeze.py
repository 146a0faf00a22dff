"""What a run belongs to: thresholds of the diagnosis, and digests of its sources and of the truth."""

import hashlib
import importlib
import json
import pkgutil
import subprocess
from collections.abc import Iterable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import origami_sim
from origami_sim.errors import InputError

PACKAGE = Path(origami_sim.__file__).resolve().parent
FROZEN = "frozen.json"
HOUSES = ("hypotheses", "fit", "predict", "infer", "verdict", "locate", "report", "diagnose", "estimation")
"""Folders of the diagnosis."""


def state(truth: Path) -> dict:
    """Date, commit, digests of the diagnosis and of the truth, and every threshold by module.

    Args:
        truth: folder of the truth generator.
    """
    case = Path(__file__).resolve().parent / "case.py"
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": _git("rev-parse", "HEAD"),
        "changed": bool(_git("status", "--porcelain", "--", str(PACKAGE), str(truth))),
        "diagnosis": digest([*PACKAGE.rglob("*.py"), case]),
        "truth": digest(truth.glob("*.py")),
        "thresholds": thresholds(),
    }


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of files' names and contents, in the order of their paths."""
    out = hashlib.sha256()
    for file in sorted(files):
        content = file.read_bytes()
        out.update(f"{file.name} {len(content)}\n".encode())
        out.update(content)
    return out.hexdigest()


def _numbers(value) -> bool:
    """Whether it is a number, or a tuple of them."""
    return isinstance(value, (int, float)) or (isinstance(value, tuple) and all(map(_numbers, value)))


def thresholds() -> dict[str, dict]:
    """The numbers in capitals of every module of the diagnosis, and its default options."""
    from origami_sim.diagnose import Options
    from origami_sim.fit.hyper import HYPER

    out: dict = {"options": asdict(Options()), "hyperparameters": asdict(HYPER)}
    for package in (importlib.import_module(f"origami_sim.{name}") for name in HOUSES):
        for info in pkgutil.iter_modules(package.__path__):
            module = importlib.import_module(f"{package.__name__}.{info.name}")
            mine = {n: v for n, v in vars(module).items() if n.isupper() and _numbers(v)}
            out |= {f"{package.__name__.rpartition('.')[2]}.{info.name}": mine} if mine else {}
    return json.loads(json.dumps(out))  # as it is stored


def freeze(out: Path, truth: Path, *, sealed: bool, drawing: bool = False) -> dict:
    """Writes frozen.json when a run begins, and looks whether anything changed when it goes on.

    Args:
        drawing: nothing is diagnosed yet, so that only the truth is held.

    Raises:
        InputError: a sealed run that goes on with another diagnosis or another truth than it began with.
    """
    now, file = state(truth), out / FROZEN
    then = json.loads(file.read_text()) if file.exists() else {}
    for what in ("diagnosis", "truth"):
        if sealed and what in then and not (drawing and what == "diagnosis") and now[what] != then[what]:
            raise InputError(
                f"a sealed run goes on with the {what} that it began with",
                file=file,
                field=what,
                value=now[what][:12],
                allowed=then[what][:12],
            )
    if "diagnosis" in then:
        return then
    if drawing:
        now = {k: v for k, v in now.items() if k not in ("diagnosis", "thresholds")}
    file.write_text(json.dumps(now, indent=1))
    return now


def _git(*command: str) -> str:
    try:
        ran = subprocess.run(["git", *command], cwd=PACKAGE, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return ran.stdout.strip() if ran.returncode == 0 else ""
