"""What half and double of the numbers in folding/ and pattern/ that are not physics do to a folder of patterns.

python benchmarks/pattern_constants.py FOLDER [--only NUMBER ...] [--seconds 4] [--out runs/pattern_constants.json]

Every pattern that takes less than --seconds is read and folded again with half and with double of each number, and
without it where that can be. Printed: the seconds over what they were, which patterns fold that did not and which do
not any more, and how many others end with another error, strain or count of crossings. Results are kept, so that an
interrupted run goes on.
"""

import argparse
import json
from importlib import import_module
from pathlib import Path

from patterns import SUFFIXES, folded

NUMBERS = {
    "folding.elastic": (
        "BEND", "FREE", "SLIVER", "LONGEST_MOVE", "MERGED", "CLOSED", "ROUNDING", "GAIN", "STIFFEST", "LARGEST",
        "FIRST", "REFUSED", "POOR", "GOOD", "FORESEEN", "FORESIGHT",
    ),
    "folding.contact": ("REACH", "FINEST", "LEAST"),
    "folding.fold": ("SOFTNESS", "STEPS", "ITERATIONS", "LAST", "LOWER", "STRETCH", "EXACT"),
    "folding.placement": ("LOOSE", "TINY"),
    "folding.consistency": ("STRAIGHT", "SHARP"),
    "folding.reading": ("DISTANCES", "OPEN", "CLOSE", "BETTER", "KEPT"),
    "pattern.planar": ("FINEST", "COARSEST", "APART", "MAX_ROUNDS"),
}  # fmt: skip

WITHOUT = {
    "FREE": 0.1, "SLIVER": 0.0, "LONGEST_MOVE": float("inf"), "MERGED": 0.0, "ROUNDING": 0.0, "GAIN": 0.0,
    "STIFFEST": 0.0, "LOWER": 1.0, "EXACT": 0.0, "LOOSE": 1.0, "OPEN": 0.0, "CLOSE": float("inf"), "BETTER": 1.0,
    "KEPT": 0.0,
}  # fmt: skip
"""Values at which a number does nothing: what it takes to do without it."""


def scaled(value, factor: float):
    """A number, or each of several, times a factor; whole numbers stay whole."""
    if isinstance(value, tuple):
        return tuple(scaled(v, factor) for v in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def outcomes(files: dict[str, Path]) -> dict[str, dict]:
    """What becomes of each pattern."""
    return {n: folded(p, None) for n, p in files.items()}


def told(now: dict[str, dict], was: dict[str, dict]) -> str:
    """What has changed, in one line."""

    def folds(r):
        return bool(r.get("reached"))

    seconds = sum(r.get("seconds", 0.0) for r in now.values()) / sum(r.get("seconds", 0.0) for r in was.values())
    more = [n for n in was if folds(now[n]) and not folds(was[n])]
    fewer = [n for n in was if folds(was[n]) and not folds(now[n])]
    counts = ("largest_error_deg", "largest_strain", "crossing_pairs")
    others = [
        n for n in was if n not in (*more, *fewer) and any(
            abs(now[n].get(c, 0) - was[n].get(c, 0)) > 0.05 * abs(was[n].get(c, 0)) + 0.1 for c in counts
        )
    ]  # fmt: skip
    said = [f"{seconds:.2f} x the time", f"+{len(more)} -{len(fewer)} fold", f"{len(others)} end otherwise"]
    return ", ".join(said) + "".join(
        f"; {s}{Path(n).name}" for s, ns in (("+", more), ("-", fewer), ("~", others)) for n in ns
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="names of numbers")
    parser.add_argument("--seconds", type=float, default=4.0, help="longest time of a pattern")
    parser.add_argument("--least", type=float, default=0.0, help="shortest time of a pattern")
    parser.add_argument("--out", type=Path, default=Path("runs/pattern_constants.json"))
    args = parser.parse_args()
    kept = json.loads(args.out.read_text()) if args.out.is_file() else {}
    args.out.parent.mkdir(parents=True, exist_ok=True)
    files = {str(p): p for p in sorted(args.folder.rglob("*")) if p.suffix.lower() in SUFFIXES}

    def known(name, files):
        if name not in kept:
            kept[name] = outcomes(files)
            args.out.write_text(json.dumps(kept))
        return kept[name]

    first = known("as they are", files)
    quick = {n: p for n, p in files.items() if args.least < first[n].get("seconds", 0.0) <= args.seconds}
    was = {n: first[n] for n in quick}
    for module, names in NUMBERS.items():
        home = import_module(f"origami_sim.{module}")
        for name in names:
            if args.only and name not in args.only:
                continue
            value = getattr(home, name)
            others = {f"x {factor:g}": scaled(value, factor) for factor in (0.5, 2.0)}
            if name in WITHOUT:
                others["without"] = WITHOUT[name]
            for word, other in others.items():
                setattr(home, name, other)
                print(f"{module}.{name} {word}: {told(known(f'{module}.{name} {word}', quick), was)}", flush=True)
            setattr(home, name, value)


if __name__ == "__main__":
    main()
