"""Time of a diagnosis: four panels, three creases, 10 s at 240 Hz, on one core (processor time).

python benchmarks/diagnose.py
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from origami_sim.diagnose import Options, diagnose
from tests.diagnose.strips import record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}


def main():
    for name, effects in (("nothing missing", None), ("dry friction at one crease", FRICTION)):
        recording = record(effects, duration=10.0, rate=240)
        spent: dict[str, float] = {}
        last = ["", time.process_time()]

        def tell(stage: str, _: float, spent=spent, last=last):
            now = time.process_time()
            if stage != last[0]:
                spent[last[0]] = now - last[1]
                last[:] = [stage, now]

        found = diagnose(subject(), [recording], Options(threads=1), progress=tell)
        parts = ", ".join(f"{k} {v:.1f}" for k, v in spent.items() if k)
        print(f"{name}: {found.verdict}, {sum(spent.values()):.1f} s ({parts})")


if __name__ == "__main__":
    main()
