"""A Miura tube, and the angles at which it is stiffest across for what it weighs.

    origami-sim show examples/miura_tube.py
    python examples/miura_tube.py

A Miura strip and its mirror image, joined along their edges, fold as one tube (Tachi 2009; Filipov, Tachi and Paulino
2015, doi:10.1073/pnas.1509465112). One end is held, the other is pushed across.
"""

import numpy as np

from origami_sim import Drive, Sheet, miura, si
from origami_sim.explore import optimise
from origami_sim.pattern.assemble import assemble

CELLS, SIDE, FORCE = 4, 0.02, 1e-2


def pattern(gamma, fold):
    """Two strips of one Miura cell across, which share their outer rows."""
    columns = 2 * CELLS + 1
    upper = miura(CELLS, 1, SIDE, SIDE, gamma, fold_angle=fold).vertices
    lower = upper[columns : 2 * columns] * (1, 1, -1)
    rows = [
        np.arange(columns),
        columns + np.arange(columns),
        2 * columns + np.arange(columns),
        3 * columns + np.arange(columns),
    ]
    around = [(rows[0], rows[1]), (rows[1], rows[2]), (rows[2], rows[3]), (rows[3], rows[0])]
    faces = [(int(a[c]), int(a[c + 1]), int(b[c + 1]), int(b[c])) for a, b in around for c in range(columns - 1)]
    return assemble(np.vstack([upper, lower]), faces)


def build(gamma="60 deg", fold="80 deg"):
    """The tube of paper, held at one end and pushed at the other.

    Args:
        gamma: acute angle of its parallelograms. fold: fold angle of the zigzag creases.
    """
    sheet = Sheet(pattern(si(gamma), si(fold)), thickness="0.2 mm", material="paper")
    sheet.crease(stiffness="1 mN m/rad")
    columns = 2 * CELLS + 1
    first, last = [r * columns for r in range(4)], [r * columns + columns - 1 for r in range(4)]
    sheet.fix(nodes=first).set("load", last, force_z=FORCE / 4)
    return sheet, Drive(load=1.0)


def stiffness(found):
    """Force across over the mean way of the end [N/m]."""
    columns = 2 * CELLS + 1
    last = [r * columns + columns - 1 for r in range(4)]
    return FORCE / float((found.x - found.model.position)[last, 2].mean())


def length(found):
    """From end to end [m]."""
    return float(np.ptp(found.model.position[:, 0]))


if __name__ == "__main__":
    bounds = {"gamma": ("40 deg", "80 deg"), "fold": ("30 deg", "140 deg")}
    best = optimise(build, lambda f: -stiffness(f), bounds, subject_to=[(length, "80 mm", "200 mm")])
    angles = ", ".join(f"{n} = {np.degrees(v):.1f} deg" for n, v in best.values.items())
    print(f"{stiffness(best.found):.2f} N/m at {angles}, {1e3 * length(best.found):.1f} mm long: {best.message}")
