"""A walking strip, and the feet and the field with which it steps furthest.

    origami-sim run examples/walker.py
    origami-sim sweep examples/walker.py --vary backward=0.3,0.6 --vary field=20mT:40mT:3 --pareto field,-moved_x_mm
    python examples/walker.py

Two magnets of opposite poling arch a strip in a vertical field; feet that slip forward more easily than backward turn
that into steps.
"""

from origami_sim import Drive, Sheet, sine, strip
from origami_sim.explore import Way, sweep

DURATION, CELLS = "3 s", 12


def build(field="30 mT", frequency="1 Hz", friction=0.2, backward=0.6, height="1 mm"):
    """The strip on its feet.

    Args:
        field, frequency: of the vertical field. friction, backward: of the feet. height: of the feet.
    """
    length = 0.048 / CELLS
    sheet = Sheet(strip([length] * CELLS, 0.015), thickness="1 mm", membrane=0.1)
    for panels, way in (((1, 2), 1), ((CELLS - 3, CELLS - 2), -1)):
        for panel in panels:
            sheet.patch(panel, thickness="1 mm", poling=(way, 0, 0))
    sheet.crease(stiffness="0.5 mN m/rad", loss_time="3 ms")
    sheet.feet([0, 1, 2 * CELLS, 2 * CELLS + 1], height=height, friction=friction, backward=backward)
    sheet.ground(friction=0.2)
    return sheet, Drive(field=(0, 0, sine(field, frequency)))


def stride(found):
    """Way of the centre of mass in the last cycle [mm]."""
    frames = round(RATE / float(found.drive["field_z"].frequency))
    x = found.motion.centre_of_mass()[:, 0, 0]
    return 1e3 * float(x[-1] - x[-1 - frames])


def strength(found):
    """Amplitude of the field [mT]."""
    return 1e3 * float(found.drive["field_z"].amplitude)


RATE = 20.0

if __name__ == "__main__":
    grid = {"field": ["15 mT", "20 mT", "25 mT", "30 mT", "40 mT"], "backward": [0.25, 0.4, 0.6, 0.9]}
    measures = {"stride_mm": stride, "field_mT": strength}
    found = sweep(build, grid, measures, way=Way(duration=3.0, rate=RATE), folder="runs/walker_sweep")
    for row in found.pareto("field_mT", "-stride_mm"):
        point, stepped = found.point(row), found.columns["stride_mm"][row]
        print(f"{1e3 * point['field']:.0f} mT, backward {point['backward']:.2f}: {stepped:.1f} mm")
    print(found.draw("runs/walker_sweep/pareto.png", "field_mT", "-stride_mm"))
