"""Gravity per recording, against where a weight that is turned comes to rest."""

import numpy as np
import pytest

from origami_sim import Sheet, equilibrium, strip
from origami_sim.hypotheses.weight import weighed
from origami_sim.recording import Gravity

G = 9.80665


def flap(*, gravity: float | None = G, panels: str = "rigid"):
    """A panel of 40 mm on a spring, straight along x from a held one, with a patch above its mid-plane."""
    sheet = Sheet(strip([0.02, 0.04], 0.02), thickness=1e-3, triangulation="center", panels=panels)
    sheet.patch(1, thickness=3e-3, size=(0.03, 0.02), density=2000.0)
    sheet.crease(stiffness=5e-3).fix(panels=[0])
    if gravity is not None:
        sheet.gravity((0.0, 0.0, -gravity))
    return sheet.build()


def turn(model, parameters) -> float:
    found = equilibrium(model, parameters)
    assert found.converged
    return float(found.angles[0])


def moments() -> tuple[float, float]:
    """First moments of the flap about its crease [kg m], along it and above it."""
    sheet, patch = 1010 * 1e-3 * 0.04 * 0.02, 2000 * 3e-3 * 0.03 * 0.02
    return sheet * 0.02 + patch * 0.02, patch * 2e-3


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
@pytest.mark.parametrize("direction", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0.6, 0, -0.8)])
@pytest.mark.parametrize("size", [None, 9.7])
def test_a_flap_comes_to_rest_where_its_weight_turns_it(panels, direction, size):
    """k angle = g . d(centre)/d(angle), with the centre's part above the mid-plane, by bisection."""
    along, above = moments()
    gx, _, gz = np.array(direction) * (G if size is None else size)
    low, high = -1.5, 1.5

    def missing(q: float) -> float:
        # the flap turns up (+z) as the angle grows: d/dq of (along cos q - above sin q, along sin q + above cos q)
        return gx * (-along * np.sin(q) - above * np.cos(q)) + gz * (along * np.cos(q) - above * np.sin(q)) - 5e-3 * q

    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if missing(middle) > 0 else (low, middle)
    model, parameters = flap(panels=panels)
    assert turn(*weighed(model, parameters, Gravity(direction, size, ""))) == pytest.approx(
        low, abs=1e-9 if panels == "rigid" else 2e-3
    )


def test_what_no_gravity_is_stated_for_stays_and_what_has_none_gets_it():
    model, parameters = flap()
    assert weighed(model, parameters, None) == (model, parameters)
    upright = Gravity((0.0, 0.0, -1.0), None, "hanging")
    assert turn(*weighed(*flap(gravity=None), upright)) == pytest.approx(turn(model, parameters), rel=1e-9)
    # a size that is fitted stays what it is
    heavier = parameters.copy().set("gravity", "gravity_z", -9.9)
    out = weighed(model, heavier, Gravity((1.0, 0.0, 0.0), None, "lying"))[1]
    np.testing.assert_allclose(out["gravity", "gravity_x"], 9.9)
    np.testing.assert_allclose(out["gravity", "gravity_z"], 0.0)
