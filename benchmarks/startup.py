"""Import to the first frame, as whole processes, with an empty and with a filled kernel cache."""

import os
import subprocess
import sys
import tempfile
import time

import numpy as np
from timing import table, verdict

_FIRST_FRAME = """
import time
began = time.perf_counter()
from origami_sim.device.scene import read_calibration
from origami_sim.scenes import crawler
from origami_sim.solve.motion.dynamics import simulate
imported = time.perf_counter()
model, parameters, drive = crawler.build(read_calibration("crawler"))
built = time.perf_counter()
simulate(model, parameters, drive, duration=1 / 60, rate=60)
done = time.perf_counter()
import sys
heavy = [m for m in ("matplotlib", "rerun", "pyarrow") if m in sys.modules]
print(imported - began, built - imported, done - built, *heavy)
"""


def _once(cache: str) -> tuple[float, list[float], list[str]]:
    began = time.perf_counter()
    out = subprocess.run([sys.executable, "-c", _FIRST_FRAME], env={**os.environ, "WARP_CACHE_PATH": cache},
                         capture_output=True, text=True, check=True)  # fmt: skip
    wall = time.perf_counter() - began
    words = out.stdout.strip().splitlines()[-1].split()
    return wall, [float(w) for w in words[:3]], words[3:]


def report(quick: bool = False) -> str:
    cold, warm = [], []
    for _ in range(2 if quick else 4):
        with tempfile.TemporaryDirectory() as cache:
            cold.append(_once(cache))
            warm += [_once(cache) for _ in range(2)]
    rows = []
    for name, runs, target in (("empty cache", cold, 5.0), ("filled cache", warm, 1.5)):
        walls = np.array([r[0] for r in runs])
        middle = np.median([r[1] for r in runs], axis=0)
        typical = float(np.median(walls))
        rows.append((name, float(walls.min()), typical, *(float(m) for m in middle), verdict(typical, target)))
    heavy = ", ".join(cold[0][2]) or "none of matplotlib, rerun, pyarrow"
    return table("Import to the first frame of the crawler scene [s], whole process",
                 ("kernel cache", "min", "median", "import", "build", "compile and run", "wanted"), rows,
                 (f"imported on the way but not needed: {heavy}",))  # fmt: skip
