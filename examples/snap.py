"""A shallow arch in a test machine, and the rise with which it stays through once it was pressed through.

    origami-sim run examples/snap.py --quasistatic --set rise=3mm
    python examples/snap.py

A punch is glued to the middle and moves down at an even rate; a load cell reads its force. Under a dead load the arch
snaps over where that force falls. An arch that the punch has to pull back on the way stays through without it.
"""

import numpy as np

from origami_sim import Drive, Sheet, quasistatic, ramp, si, strip
from origami_sim.explore import solve_for

SPAN, WIDTH, CELLS = si("80 mm"), si("10 mm"), 8


def build(rise="1.5 mm", thickness="1 mm", depth=2.0):
    """A strip between two pins, of the shape of half a sine.

    Args:
        rise: of the middle over the pins. thickness: of the strip. depth: how far the punch goes, in rises.
    """
    rise, thickness = si(rise), si(thickness)
    pattern = strip([SPAN / CELLS] * CELLS, WIDTH)
    pattern.vertices[:, 2] = rise * np.sin(np.pi * pattern.vertices[:, 0] / SPAN)
    sheet = Sheet(pattern, thickness=thickness, modulus="1.5 MPa", triangulation="diagonal")
    sheet.crease(stiffness=1.5e6 * WIDTH * thickness**3 / 12 / (SPAN / CELLS)).touch(False)
    place = sheet.mesh.vertices[:, 0]
    sheet.fix(nodes=np.flatnonzero(np.isclose(place, 0) | np.isclose(place, SPAN)))
    sheet.grip("punch", nodes=np.flatnonzero(np.isclose(place, SPAN / 2)), direction=(0, 0, -1))
    return sheet, Drive(grips={"punch": ramp(depth * rise, "10 s")})


def curve(rise, points=41):
    """Travel [m] of the punch and its force [N]."""
    sheet, drive = build(rise)
    run = quasistatic(*sheet.build(), drive, np.linspace(0, 10, points))
    return run.grip_path("punch")[:, 0], run.grip_load("punch")[:, 0]


def hold(found):
    """Force with which the punch presses [N] at the end of its way."""
    grip = np.flatnonzero(found.model.grips == 0)
    return -float(found.reactions()[grip, 2].sum())


if __name__ == "__main__":
    for height in ("1 mm", "1.5 mm"):
        travel, force = curve(height)
        print(f"rise {height}: at most {force.max() * 1e3:.3g} mN, at least {force.min() * 1e3:.3g} mN")
    print(solve_for(lambda rise: build(rise, depth=1.5), hold, 0.0, {"rise": ("1 mm", "8 mm")}))
