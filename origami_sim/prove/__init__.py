"""The proof: concealed effects drawn at random, diagnosed from the recordings alone, and a scoreboard.

Three kinds of processes that know nothing of each other: the truth (`benchmarks/concealed/draw.py`, other formulations
than ours, imports nothing of this package) writes recordings into a case's folder and the answer into a sealed one; the
diagnosis (`python -m origami_sim.prove CASE_FOLDER`) gets the case's folder, and an audit hook stops it if it opens an
answer; the score opens the answers at the end, and checks them against digests that were taken when they were drawn.

    case.py     the diagnosis of one case, in a process of its own
    battery.py  drawing and diagnosing many, here or on a cluster
    freeze.py   thresholds and sources of the diagnosis that a run belongs to
    score.py    what came of each case, and the scoreboard
    figures.py  its pictures
"""

import argparse
import json
import sys
from pathlib import Path

from origami_sim.errors import InputError

DEVELOPMENT = 1000
"""Seeds below this are for development; a seed from here on is sealed: it counts once."""

KINDS = ("single", "null", "outside", "confounded", "double")
RIGID = ("hanging_strip", "pendulum_chain", "magnetic_strip", "box", "bi_fold", "crawler")
STRUCTURES = (*RIGID, "mae_cantilever", "de_bender", "crease_coupon")
"""As the truth names them."""


def register(parser: argparse.ArgumentParser) -> None:
    """Arguments of `origami-sim prove`."""
    parser.add_argument("--cases", type=int, help="cases to draw (default 12; 480 are the full battery)")
    parser.add_argument("--seed", type=int, default=1, help=f"from {DEVELOPMENT} on: a sealed run (default 1)")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time on this machine (default 1)")
    parser.add_argument("--cluster", metavar="WHERE", help="dask: local, local:WORKERS, or a scheduler's address")
    parser.add_argument("--structures", nargs="+", default=[], choices=STRUCTURES, help="only these (default all)")
    parser.add_argument("--kinds", nargs="+", default=[], choices=KINDS, help="only these (default all)")
    parser.add_argument("--follow", action="store_true", help="make the experiment that a tie proposes, and look again")
    parser.add_argument("--nearest", action="store_true", help="look which other effect is hardest to tell from each")
    parser.add_argument("--draw-only", action="store_true", help="only draw; the same command without it goes on")
    parser.add_argument("--score", action="store_true", help="only score what is done")
    parser.add_argument("--out", metavar="FOLDER", help="run folder (default runs/prove_SEED)")


def run(args: argparse.Namespace) -> int:
    """Runs `origami-sim prove`.

    Raises:
        InputError: options that make no sense, and what `battery.prove` and `score.report` refuse.
    """
    from origami_sim.prove import battery, score

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

    if args.score:
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
