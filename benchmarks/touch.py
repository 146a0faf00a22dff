"""What contact between panels costs: microseconds per world-step and the stable step, without it, apart and touching.

python benchmarks/touch.py
"""

import math
import time

import numpy as np

from origami_sim import Drive, Sheet, miura, sheet, simulate
from origami_sim.model import State
from origami_sim.physics.materials import G
from origami_sim.solve.batch import Batch
from origami_sim.solve.timestep import stable_step

STEPS, REPEATS = 1000, 10


def plate_on_plate():
    """A plate of 20 mm that lies on a larger one."""
    small, large = [(0, 0), (20, 0), (20, 16), (0, 16)], [(-28, -26), (48, -26), (48, 42), (-28, 42)]
    corners = [(x, y, z) for z, c in ((0, large), (5, small)) for x, y in c]
    s = Sheet(sheet(np.array(corners) * 1e-3, [(0, 1, 2, 3), (4, 5, 6, 7)]), thickness=1e-3, triangulation="center")
    return s.fix(panels=[0]).gravity((0, 0, -G)).touch().build(), Drive(), 0.1


def folded(cells):
    """A Miura pattern that is turned shut until its layers press on each other."""

    def made():
        pattern = miura(cells, cells, 12e-3, 12e-3, math.radians(60), fold_angle=math.radians(60))
        s = Sheet(pattern, thickness=0.5e-3, triangulation="center").crease(stiffness=5e-5, loss_time=20e-3).touch()
        model, parameters = s.build()
        sign = np.sign(parameters["crease", "rest_angle"])
        return (model, parameters.set("crease", "rest_angle", sign * math.radians(179))), Drive(), 0.12

    return made


def timed(model, parameters, drive, state, dt) -> float:
    """Microseconds of processor time per step, the least of some repeats."""
    least = math.inf
    for _ in range(REPEATS):
        batch = Batch(model, parameters, drive, state, threads=1)
        batch.advance(10, dt, np.inf)
        began = time.process_time()
        batch.advance(STEPS, dt, np.inf)
        least = min(least, time.process_time() - began)
    return 1e6 * least / STEPS


def main():
    print("| | triangles | without | apart | touching | pairs listed | step with : without |")
    print("|---|---|---|---|---|---|---|")
    devices = {"plate on a plate": plate_on_plate, "Miura cell": folded(1), "Miura of 2 by 2 cells": folded(2)}
    for name, device in devices.items():
        (model, parameters), drive, until = device()
        bare = model.with_effects(without=("touch", "touch_friction"))
        own = parameters.for_model(bare)
        steps = [stable_step(m, p).dt for m, p in ((model, parameters), (bare, own))]
        dt = steps[0]
        end = simulate(model, parameters, drive, duration=until, rate=1 / until).state
        without = timed(bare, own, drive, State.at_rest(bare), dt)
        apart, touching = (timed(model, parameters, drive, s, dt) for s in (State.at_rest(model), end))
        batch = Batch(model, parameters, drive, end)
        batch.total_force(0.0)
        listed = int(batch._constants[-1].count.numpy()[0, 0])
        print(
            f"| {name} | {len(model.triangles)} | {without:.2f} | {apart:.2f} | {touching:.2f} | {listed} | "
            f"{steps[0] / steps[1]:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
