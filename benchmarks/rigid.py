"""Rigid panels against bars: processor time for a simulated second, and how far each is from the exact rigid motion.

    python benchmarks/rigid.py

Bars and bending lines are stiffened until they are within a milliradian (rms) of the exact motion, that of rigid panels
with a tolerance of 1e-13; real panels bend more, which is no error of theirs.
"""

import time
from dataclasses import replace

import numpy as np
from timing import table

from origami_sim import Drive, Sheet, cross, scene_module, sine, strip
from origami_sim.device.scene import scene_settings
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import rigid
from origami_sim.solve.rigid.batch import TOLERANCE, batch_of
from origami_sim.solve.timestep import stable_step

WORLDS, SECONDS, FRAME = 8, 0.5, 2e-2

ERROR, LOOSE = 1e-3, 10.0 ** -np.arange(3, 9)
"""Error that bars are stiffened to [rad]; tolerances of rigid panels: the first with no larger error is timed."""


def double_chain():
    """The scene pendulum_chain, both arms let go."""
    module = scene_module("pendulum_chain")
    model, parameters, drive = module.build(scene_settings(module).with_panels("elastic"))
    return model, parameters, drive, [1.2, 0.7]


def hanging_strip():
    """Four PET panels that hang from a held one."""
    pattern = strip([0.02, 0.03, 0.03, 0.03], 0.03)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)
    sheet = Sheet(pattern, thickness=5e-4, material="pdms", triangulation="center", membrane_damping=0.0)
    sheet.crease(stiffness=2e-5, loss_time=0.002).fix(panels=[0]).gravity()
    return *sheet.build(), Drive(), [0.6, -0.4, 0.3]


def magnetic_strip():
    """Four panels with magnetic patches in a field of 2 Hz."""
    sheet = Sheet(strip([0.02, 0.02, 0.02, 0.02], 0.02), thickness=1e-3, triangulation="center", membrane_damping=0.0)
    for panel, way in ((1, 1), (2, -1), (3, 1)):
        sheet.patch(panel, thickness=1e-3, poling=(way, 0, 0))
    sheet.crease(stiffness=2e-3, loss_time=0.003).fix(panels=[0]).gravity()
    return *sheet.build(), Drive(field=(0, 0, sine(0.02, 2.0))), [0.0, 0.0, 0.0]


def tumbling_box():
    """A free cross of five panels, folded and turning."""
    sheet = Sheet(cross(0.03, 0.03), thickness=1e-3, triangulation="center", membrane_damping=0.0)
    return *sheet.crease(stiffness=2e-3).gravity().build(), Drive(), [0.8, 0.7, 0.9, 0.6]


def start(model, angles, spin):
    arm = Articulation(model)
    x = arm.positions(replace(arm.reference(WORLDS), angles=np.tile(np.array(angles)[:, None], WORLDS)))
    state = State.at_rest(model, WORLDS, x)
    if arm.floating:
        state.v[:] = np.cross([3.0, 1.0, -2.0], state.x - state.x.mean(axis=0)) * spin
    return state


def rolled(model, parameters, drive, state, **options):
    """Fold angles [F, C, W] and processor time for a simulated second of one world [s]."""
    batch = batch_of(model, parameters, drive, state, threads=1, **options)
    steps = max(1, int(np.ceil(FRAME / stable_step(model, parameters).dt)))
    batch.film(1, steps, FRAME / steps, np.inf)
    frames = round(SECONDS / FRAME)
    began = time.process_time()
    _, angles = batch.film(frames, steps, FRAME / steps, np.inf)
    spent = time.process_time() - began
    return angles[:, : len(model.creases)], spent / SECONDS / WORLDS


def error(motion, exact):
    """Root mean square over creases and frames [rad]."""
    return float(np.sqrt(np.nanmean((motion - exact) ** 2)))


def main():
    rows = []
    for make in (double_chain, hanging_strip, magnetic_strip, tumbling_box):
        model, parameters, drive, angles = make()
        given = parameters.copy()
        given.set("body", "mass", 0.0)  # the nodes' masses, as bars have them
        body, own = rigid(model, given)
        state = start(body, angles, 1.0)
        exact, _ = rolled(body, own, drive, state, tolerance=1e-13)
        stiff = parameters.copy()
        for _ in range(3):  # the error falls as 1/stiffness once it is small
            bars, by_bars = rolled(model, stiff, drive, start(model, angles, 1.0))
            if error(bars, exact) < 1.5 * ERROR:
                break
            for owner in ("bars", "panel_bending"):
                stiff.set(owner, "stiffness", stiff[owner, "stiffness"] * error(bars, exact) / ERROR)
        for loose in LOOSE:
            found, by_bodies = rolled(body, own, drive, state, tolerance=loose)
            if error(found, exact) <= error(bars, exact):
                break
        tight, default = rolled(body, own, drive, state, tolerance=TOLERANCE)
        rows.append(
            [
                make.__name__,
                f"{stable_step(model, stiff).dt * 1e6:.1f}",
                f"{by_bars * 1e3:.1f}",
                f"{error(bars, exact):.1e}",
                f"{loose:.0e}",
                f"{by_bodies * 1e3:.2f}",
                f"{error(found, exact):.1e}",
                f"{by_bars / by_bodies:.0f}",
                f"{default * 1e3:.1f}",
                f"{error(tight, exact):.1e}",
            ]
        )
    head = ["device", "step of bars [us]", "bars [ms/s]", "error [rad]", "tolerance", "rigid [ms/s]", "error [rad]"]
    head += ["bars : rigid", "rigid, default [ms/s]", "error [rad]"]
    print(table("rigid panels against bars, one core", tuple(head), rows))


if __name__ == "__main__":
    main()
