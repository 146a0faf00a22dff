"""Rigid panels in sheets of many closed loops."""

import numpy as np
import pytest

from origami_sim import Sheet, miura, simulate, strip
from origami_sim.errors import InputError
from origami_sim.pattern.mesh import uncreased


@pytest.mark.parametrize(("cells", "duration"), [(2, 0.3), (6, 0.02)])
def test_many_loops_keep_their_energy_and_fold_as_one(cells, duration):
    """Sheets of 16 and of 144 panels, with far more constraints than rates, keep the one motion of their cells."""
    sheet = Sheet(miura(cells, cells, 0.03, 0.03, 1.0, fold_angle=0.8), thickness=5e-4, panels="rigid")
    model, parameters = sheet.crease(stiffness=1e-3).build()
    parameters.set("crease", "rest_angle", 1.2 * parameters["crease", "rest_angle"])
    run = simulate(model, parameters, duration=duration, rate=100.0)
    half = np.abs(np.tan(0.5 * run.creases[:, :, 0]))
    ratio = half.min(axis=1) / half.max(axis=1)
    assert not run.failures and np.ptp(half[:, 0]) > 0.05
    assert ratio == pytest.approx(ratio[0], rel=2e-10)
    assert np.ptp(run.energy_balance()) < 4e-6 * run.energies["kinetic"].max()


@pytest.mark.parametrize(("pattern", "said"), [(miura(1, 1, 0.03, 0.03, 1.0), True),
                                               (miura(1, 1, 0.03, 0.03, 1.0, fold_angle=0.1), False),
                                               (strip([0.03, 0.03], 0.02), False)])  # fmt: skip
def test_loops_that_start_flat_are_noted(pattern, said):
    sheet = Sheet(pattern, thickness=5e-4, panels="rigid").crease(stiffness=1e-3)
    run = simulate(*sheet.build(), duration=0.02, rate=100.0)
    assert any("start flat" in n for n in run.notes) == said


def test_faces_that_meet_at_a_flat_edge_are_refused_with_what_to_do():
    flat = uncreased(strip([0.01] * 6, 0.02))
    with pytest.raises(InputError, match=r"joined by creases.*panel 1, panel 2, panel 3 and 2 more.*flat \('F'\) edge"):
        simulate(*Sheet(flat, thickness=1e-3, panels="rigid").build(), duration=0.1)
