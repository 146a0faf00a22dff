"""Where a motion beside a recording begins."""

import numpy as np
import pytest

from origami_sim import Sheet, strip
from origami_sim.device.begun import begun
from origami_sim.recording import Channel, Recording
from origami_sim.recording.stated import Start


@pytest.mark.parametrize("stated", [True, False])
def test_a_device_that_markers_show_begins_at_the_angles_that_are_stated(stated):
    sheet = Sheet(strip([0.02, 0.03], 0.02), thickness=1e-3, panels="rigid").crease(stiffness=1e-3)
    model, _ = sheet.name("crease", ["hinge"]).fix(panels=[0]).build()
    marker = Channel("m", "marker", np.zeros((3, 3)), "m", 1e-4, {"panel": 1})
    start = Start(state="released", angles={"hinge": 0.4}, sd=0.01) if stated else None
    found = begun(model, Recording("film", np.arange(3.0), {"m": marker}, start=start))
    if not stated:
        assert found is None
    else:
        assert found is not None and found.angles[0, 0] == pytest.approx(0.4, abs=1e-15) and not np.any(found.v)
