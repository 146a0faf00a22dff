"""A magnetic flap, and the gap at which it stands upright in 50 mT.

    origami-sim run examples/flap.py --set gap=3mm
    python examples/flap.py

A wider gap makes a softer bridge. The field leans back by 15 degrees, as a vertical one pulls no patch upright against
its weight. The flap lies on a table, from which the field lifts it.
"""

from math import cos, radians, sin

from origami_sim import Drive, Sheet, bridge_stiffness, ramp, si, strip
from origami_sim.explore import angle, solve_for

LENGTH, WIDTH = si("18 mm"), si("20 mm")


def build(gap="2 mm", field="50 mT", lean="15 deg", patch="3 mm"):
    """A base that is held and a flap with a patch, joined by a bridge of bare elastomer.

    Args:
        gap: between base and patch. field: at the end of the ramp. lean: of the field, back over the base.
        patch: its thickness.
    """
    gap, field, lean = si(gap), si(field), si(lean)
    sheet = Sheet(strip([0.01, gap / 2 + LENGTH], WIDTH), thickness="1 mm")
    centre = (0.01 + gap / 2 + LENGTH / 2, 0, 0)
    sheet.patch(1, thickness=patch, size=(LENGTH, WIDTH), centre=centre, poling=(1, 0, 0))
    sheet.crease(stiffness=bridge_stiffness(1.5e6, WIDTH, 1e-3, gap), loss_time="3 ms").name("crease", ["hinge"])
    sheet.ground().fix(panels=[0])
    return sheet, Drive(field=(-field * sin(lean), 0, ramp(field * cos(lean), 0.5)))


if __name__ == "__main__":
    found = solve_for(build, angle("hinge"), radians(90), {"gap": ("0.3 mm", "6 mm")})
    print(found)
