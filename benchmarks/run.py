"""Measures origami_sim and prints tables: `make bench`, or with options

    python benchmarks/run.py [--quick] [--device cuda:0] [--only rollout,startup,scaling,commands]

With a CUDA device only the rollout on that device is measured and compared with the CPU; that needs warp, numpy
and scipy alone, with the repository's root on PYTHONPATH.
"""

import argparse
import os
import platform
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its idle threads would spin beside what is measured
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

PARTS = ("rollout", "startup", "scaling", "commands")


def machine() -> str:
    import numpy
    import warp

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text().splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg()) if hasattr(os, "getloadavg") else "?"
    versions = f"Python {platform.python_version()}, warp {warp.__version__}, numpy {numpy.__version__}"
    return f"{model}, {cores} cores, load average {load}; {versions}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer repeats, no demo")
    parser.add_argument("--device", default="cpu", help="cpu, or a CUDA device such as cuda:0")
    parser.add_argument("--only", default=",".join(PARTS), help=f"some of {', '.join(PARTS)}")
    args = parser.parse_args()
    import rollout
    import scaling

    print(machine(), flush=True)
    if args.device != "cpu":
        print(scaling.cuda_report(args.device, args.quick))
        return
    import scenes_wall
    import startup

    reports = dict(zip(PARTS, (rollout.report, startup.report, scaling.cpu_report, scenes_wall.report), strict=True))
    for part in args.only.split(","):
        if part not in reports:
            parser.error(f"there is no part '{part}'; allowed: {', '.join(PARTS)}")
        print(reports[part](args.quick), flush=True)


if __name__ == "__main__":
    main()
