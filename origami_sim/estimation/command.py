"""`origami-sim estimate`: numbers of a device, and of effects that are stated, from recordings of it."""

import json
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from origami_sim.diagnose.command import (
    Progress,
    check_folder,
    check_model,
    ending_as_interrupted,
    options_of,
    read_arguments,
)
from origami_sim.diagnose.later import attempt
from origami_sim.estimation.estimate import Estimate, estimate
from origami_sim.quantities import ANY
from origami_sim.report.diagnosis import Number, as_json
from origami_sim.report.patch import write_patch

DATA, PATCH, PLOT = "estimate.json", "fitted.toml", "fit.png"


def run(args: Namespace) -> int:
    """The command; returns its exit code."""
    folder = Path(args.out or "runs/estimate")
    check_folder(folder, lambda: {p.name for p in folder.glob("*")} <= {DATA, PATCH, PLOT}, "an estimate")
    asked = read_arguments(args)
    for file in filter(None, (args.model, asked.given, asked.calibration)):
        check_model(folder / PATCH, file)
    if not args.json:
        print("\n".join(asked.said), flush=True)
    progress = Progress()
    try:
        with ending_as_interrupted():
            options = options_of(args, asked.settings)
            effects = [e.replace("@", " at ") if " at " not in e else e for e in args.effect]
            found = estimate(asked.subject, asked.recordings, effects, options=options, progress=progress)
    finally:
        progress.end()
    folder.mkdir(parents=True, exist_ok=True)
    made = {"calibration": write_patch(folder / PATCH, asked.known_units, found, scene=asked.device)}
    drawn = attempt(found.notes, "The plot could not be drawn", lambda: _draw(found, folder / PLOT), None)
    made |= {"data": found.save_json(folder / DATA)} | ({} if drawn is None else {"plot": drawn})
    print(_summary(found, made) if args.json else "\n".join(_text(found, made, asked.device)))
    return 0


def _draw(found: Estimate, path: Path) -> Path:
    found.plot().savefig(path, dpi=120)
    return path


def _summary(e: Estimate, made: Mapping[str, Path]) -> str:
    names = ("numbers", "correlation", "components", "units", "noise", "error_given", "error_fitted")
    names += ("error_held_out", "log_evidence", "effects", "sites", "recordings", "notes", "seconds")
    values = {n: getattr(e, n) for n in names} | {"files": {n: str(p) for n, p in made.items()}, "exit_code": 0}
    return json.dumps(json.loads(as_json(values)))


def _text(e: Estimate, made: Mapping[str, Path], scene: str) -> list[str]:
    lines = ["", e.sentence, "", f"{'number':44s} {'value':>12s}   {'95 % interval':26s} before"]
    for n in e.numbers:
        unit = "" if n.unit in ("-", "1", ANY) else f" [{n.unit}]"
        known = "" if not np.isfinite(n.away) else f"{n.prior:.4g}, {n.away:.1f} sd away"
        bound = "   at its bound" if n.at_bound else ""
        value, low, high = (f"{v:.{_digits(n)}g}" for v in (n.value, n.low, n.high))
        lines.append(f"{n.label + unit:44s} {value:>12s}   {f'{low} to {high}':26s} {known}{bound}{n.each}")
    if (pair := e.strongest_correlation()) is not None:
        lines += ["", f"correlated most: {pair[0]} and {pair[1]} ({pair[2]:+.3f})"]
    if e.effects:
        lines.append(f"log evidence of the effects over the model without them: {e.log_evidence:+.1f}")
    lines += ["", f"{'rms error':24s} {'noise':>10s} {'as given':>10s} {'fitted':>10s} {'held out':>10s}"]
    rows = zip(e.components, e.units, e.noise, e.error_given, e.error_fitted, e.error_held_out, strict=True)
    lines += [f"{f'{name} [{unit}]':24s} " + " ".join(f"{v:10.3g}" for v in values) for name, unit, *values in rows]
    lines += ["", *(f"note: {note}" for note in e.notes)]
    lines += [f"{name}: {path}" for name, path in made.items() if name != "calibration"]
    lines.append(f"fitted: origami-sim run {scene} --calibration {made['calibration']}")
    return [*lines, f"{e.seconds:.0f} s"]


def _digits(n: Number) -> int:
    """Digits with which a value is printed: as many as show two of its interval's, from four to nine."""
    size, width = abs(n.value), n.high - n.low
    return int(np.clip(np.ceil(np.log10(size / width)) + 2, 4, 9)) if 0.0 < width < np.inf and size else 4
