"""python -m origami_sim.prove CASE_FOLDER [--show FOLDER]: the diagnosis of one case, or its page and replays."""

import argparse
import sys
from pathlib import Path

from origami_sim.prove.case import diagnose_case, guard, show

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--show", type=Path, metavar="FOLDER", help="write page and replays here, not the diagnosis")
    args = parser.parse_args()
    sys.addaudithook(guard)
    if args.show:
        print(*show(args.folder, args.show), sep="\n")
    else:
        diagnose_case(args.folder)
