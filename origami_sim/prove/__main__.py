"""python -m origami_sim.prove CASE_FOLDER: the diagnosis of one case."""

import argparse
import sys
from pathlib import Path

from origami_sim.prove.case import diagnose_case, guard

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    sys.addaudithook(guard)
    diagnose_case(args.folder)
