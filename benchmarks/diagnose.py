"""Time of a diagnosis with its page: four panels, three creases, 10 s at 240 Hz, on one core (processor time).

python benchmarks/diagnose.py
"""

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.run import machine
from origami_sim.diagnose import Options, diagnose
from origami_sim.report.page import geometry_of, write_report
from tests.diagnose.strips import record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}


def main():
    print(machine())
    for name, effects in (("nothing missing", None), ("dry friction at one crease", FRICTION)):
        recording = record(effects, duration=10.0, rate=240)
        spent: dict[str, float] = {}
        last = ["", time.process_time()]

        def tell(stage: str, _: float, spent=spent, last=last):
            now = time.process_time()
            if stage != last[0]:
                spent[last[0]] = now - last[1]
                last[:] = [stage, now]

        tested = subject()
        found = diagnose(tested, [recording], Options(threads=1), progress=tell)
        tell("page", 0.0)
        model = tested.build({f.name: f.start for f in tested.nominals})[0]
        with tempfile.TemporaryDirectory() as folder:
            write_report(found, Path(folder) / "report.html", geometry=geometry_of(model))
        tell("", 0.0)
        parts = ", ".join(f"{k} {v:.1f}" for k, v in spent.items() if k)
        print(f"{name}: {found.verdict}, {sum(spent.values()):.1f} s ({parts})")


if __name__ == "__main__":
    main()
