"""`origami-proof`: conceals effects at random in another simulator, diagnoses them blindly, and scores.

Exit codes: 0 done; 2 bad input; 130 interrupted.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from origami_proof import DEVELOPMENT, KINDS, STRUCTURES
from origami_sim.errors import InputError


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="origami-proof", description=__doc__)
    parser.add_argument("--cases", type=int, help="cases to draw (default 12; 520 are the full battery)")
    parser.add_argument("--seed", type=int, default=1, help=f"from {DEVELOPMENT} on: a sealed run (default 1)")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time on this machine (default 1)")
    parser.add_argument("--cluster", metavar="WHERE", help="dask: local, local:WORKERS, or a scheduler's address")
    parser.add_argument("--structures", nargs="+", default=[], choices=STRUCTURES, help="only these (default all)")
    parser.add_argument("--kinds", nargs="+", default=[], choices=KINDS, help="only these (default all)")
    parser.add_argument("--follow", action="store_true", help="make the experiment that a tie proposes, and look again")
    parser.add_argument("--nearest", action="store_true", help="look which other effect is hardest to tell from each")
    parser.add_argument("--draw-only", action="store_true", help="only draw; the same command without it goes on")
    parser.add_argument("--score", action="store_true", help="only score what is done")
    text = "judge the opened cases of these runs anew, with half and double of each hyperparameter"
    parser.add_argument("--rejudge", nargs="+", type=Path, metavar="RUN", help=text)
    text = "of these only (default all; none: judge as it is)"
    parser.add_argument("--vary", nargs="*", metavar="NAME", help=text)
    parser.add_argument("--out", metavar="FOLDER", help="run folder (default runs/prove_SEED)")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of text")
    return parser


def run(args: argparse.Namespace) -> int:
    """Does what was asked; returns the exit code.

    Raises:
        InputError: options that make no sense, and what `battery.prove` and `score.report` refuse.
    """
    from origami_proof import battery, rejudge, score
    from origami_proof.case import write_json

    for name in ("cases", "jobs"):
        if getattr(args, name) is not None and getattr(args, name) < 1:
            raise InputError("must be positive", field=f"--{name}", value=getattr(args, name), allowed=">= 1")
    if args.seed < 0:
        raise InputError("must not be negative", field="--seed", value=args.seed, allowed=">= 0")
    if args.score and args.draw_only:
        raise InputError("there is nothing to do", field="--draw-only", value="with --score", allowed="one of them")
    out = Path(args.out or f"runs/prove_{args.seed}")

    def say(text: str) -> None:
        print(text, file=sys.stderr if args.json else sys.stdout, flush=True)

    if args.rejudge:
        board = rejudge.rejudge(args.rejudge, jobs=args.jobs, vary=args.vary, say=say)
        if args.out:
            write_json(Path(args.out) / rejudge.REJUDGED, board)
    elif args.score:
        if not (out / battery.RUN).exists():
            raise InputError("there is no proof in this folder", field="--out", value=str(out))
        board = score.report(out, args.cases or len(list((out / "cases").glob("*"))), say)
    else:
        board = battery.prove(
            out,
            cases=args.cases or 12,
            seed=args.seed,
            jobs=args.jobs,
            cluster=args.cluster,
            structures=args.structures,
            kinds=args.kinds,
            follow=args.follow,
            nearest=args.nearest,
            draw_only=args.draw_only,
            say=say,
        )
    if args.json:
        print(json.dumps({k: v for k, v in board.items() if k != "rows"}))
    return 0


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits with its code."""
    args = _parser().parse_args(arguments)
    try:
        code = run(args)
    except InputError as e:
        print(f"origami-proof: {e}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("origami-proof: interrupted; the same command goes on from here.", file=sys.stderr)
        code = 130
    sys.exit(code)
