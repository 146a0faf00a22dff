"""Dielectric hinges: the section against closed forms, both sides alike, and what the builder refuses."""

import numpy as np
import pytest
from scipy.optimize import brentq

from origami_sim.design.build import Sheet
from origami_sim.design.dielectric import Stack
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.pattern import strip
from origami_sim.physics.materials import EPS0, layered_rigidity
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.motion.quasistatic import quasistatic
from origami_sim.solve.statics.equilibria import equilibrium

SIZE = {"layers": 6, "notch": "5 mm"}


def hinge(**options) -> Sheet:
    sheet = Sheet(strip([0.02, 0.03], 0.019), thickness=5e-4, triangulation="center").fix(panels=[0])
    return sheet.electrode(**{**SIZE, **options})


def turn(sheet: Sheet, voltage: float) -> float:
    found = equilibrium(*sheet.build(), Drive(voltage=[0.0] * 0 + [voltage]))
    assert found.converged
    return float(found.angles[0])


def test_a_stack_has_the_rigidity_and_neutral_axis_of_bonded_layers():
    stack = Stack(6, 272.8e-6, 62e-6, 1.6e9 / (1 - 0.3**2), (0.19e6 / 3,), (2.0,))
    assert stack.shear_modulus == pytest.approx(0.19e6 / 3)
    soft = 4 * 0.19e6 / 3
    assert stack.rigidity == pytest.approx(layered_rigidity([(62e-6, 1.6e9 / 0.91), (6 * 272.8e-6, soft)]))
    bends, share = stack.passive_moment(np.array([-1e-3, 1e-3]))
    np.testing.assert_allclose(bends, np.array([-1e-3, 1e-3]) * stack.rigidity, rtol=1e-4)
    np.testing.assert_allclose(share, 1.0, atol=1e-5)


def test_a_linear_hinge_turns_by_moment_over_stiffness():
    sheet = hinge(section="linear", thinning=False)
    stack = Stack(6, 272.8e-6, 62e-6, 1.6e9 / (1 - 0.3**2), (0.19e6 / 3,), (2.0,))
    moment = 4.7 * EPS0 * (2000 / 272.8e-6) ** 2 * 6 * 272.8e-6 * stack.lever * 0.019
    assert turn(sheet, 2000.0) == pytest.approx(-moment / (stack.rigidity * 0.019 / 5e-3), rel=1e-6)


@pytest.mark.parametrize("section", ["ogden", "linear"])
def test_a_stack_below_bends_the_other_way_by_as_much(section):
    above, below = (turn(hinge(section=section, side=side), 3000.0) for side in (1, -1))
    assert above < -0.02
    assert below == pytest.approx(-above, rel=1e-6)


def test_thinning_bends_further_and_sections_agree_at_small_voltages():
    assert turn(hinge(), 4000.0) < turn(hinge(thinning=False), 4000.0)
    assert turn(hinge(), 300.0) == pytest.approx(turn(hinge(section="linear"), 300.0), rel=2e-3)


def test_a_notch_bends_in_proportion_to_its_length_and_groups_are_apart():
    sheet = Sheet(strip([0.02, 0.02, 0.02], 0.019), thickness=5e-4, triangulation="center").fix(panels=[0])
    sheet.electrode([0], **{**SIZE, "notch": "4 mm"}).electrode([1], **{**SIZE, "notch": "8 mm", "group": 1})
    model, parameters = sheet.build()
    both = equilibrium(model, parameters, Drive(voltage=[1000.0, 1000.0])).angles[:2]
    assert both[1] / both[0] == pytest.approx(2.0, rel=1e-3)
    second = equilibrium(model, parameters, Drive(voltage=[0.0, 1000.0])).angles[:2]
    assert second == pytest.approx([0.0, both[1]], abs=1e-6)


def flap(voltage: float, **options) -> float:
    sheet = Sheet(strip([0.02, 0.03], 0.019), thickness=5e-4, material="pdms", triangulation="center", panels="rigid")
    sheet.electrode(**{**SIZE, "side": -1, **options}).fix(panels=[0]).gravity()
    return float(np.degrees(equilibrium(*sheet.build(), Drive(voltage=voltage)).angles[0]))


@pytest.mark.parametrize(("voltage", "table"), [(3e3, 2e-3), (4e3, 1e-3), (6e3, 1e-3), (8e3, 1e-3), (1e4, 1e-3)])
def test_a_hinge_lifts_a_flap_to_where_the_section_balances_its_weight(voltage, table):
    stack = Stack(6, 272.8e-6, 62e-6, 1.6e9 / (1 - 0.3**2), (0.19e6 / 3,), (2.0,))
    electric = 4.7 * EPS0 * (voltage / 272.8e-6) ** 2 * stack.height * stack.lever * 0.019
    weight = 1010 * 5e-4 * 0.019 * 0.03 * 9.80665 * 0.015

    def missing(angle):
        return 0.019 * stack.passive_moment(np.array([angle / 5e-3]))[0][0] + weight * np.cos(angle) - electric

    assert flap(voltage) == pytest.approx(np.degrees(brentq(missing, -0.1, 3.0)), abs=3e-4)


def test_a_run_notes_where_a_hinge_leaves_its_table():
    model, parameters = hinge(side=-1, reach=61.0).build()
    *_, note = quasistatic(model, parameters, Drive(voltage=ramp("6 kV", "1 s")), [0.0, 0.5, 1.0]).notes
    assert "table of its moment goes from -17.48 to 17.48 deg" in note
    within = quasistatic(*hinge(side=-1).build(), Drive(voltage=ramp("6 kV", "1 s")), [0.0, 0.5, 1.0])
    assert not any("table" in n for n in within.notes)


def test_a_bare_stack_only_resists():
    assert abs(turn(hinge(electrode_width=0.0), 4000.0)) < 1e-9


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"side": 0}, "one side"),
        ({"section": "cubic"}, "no such section"),
        ({"notch": 0.0}, "along some length"),
        ({"layers": 0}, "positive"),
        ({"film": "tap"}, "unknown material"),
        ({"notch": "5 mT"}, "wrong unit"),
        ({"group": -1}, "counted from 0"),
        ({"ogden": ([1e4], [-2.0])}, "no positive shear modulus"),
        ({"ogden": ([1e4, 2e4], [2.0])}, "come in pairs"),
        ({"creases": [5]}, "no such crease"),
    ],
)
def test_refusals(options, said):
    with pytest.raises(InputError, match=said):
        hinge(**options)


@pytest.mark.parametrize("how", ["motion", "slow"])
def test_a_field_beyond_breakdown_is_noted_in_megavolts_per_metre(how):
    """12 kV over a layer of 272.8 um are 44 MV/m, 4 kV 15 MV/m; what has no electrodes has no field."""

    def notes(volts, **options):
        model, parameters = hinge(loss_time="10 ms", **options).build()
        drive = Drive(voltage=ramp(volts, 0.01))
        if how == "slow":
            return quasistatic(model, parameters, drive, [0.0, 0.01]).notes
        return simulate(model, parameters, drive, duration=0.02).notes

    said = [n for n in notes("12 kV") if "MV/m" in n]
    assert len(said) == 1 and "comes to 44 MV/m (12 kV over 0.273 mm)" in said[0]
    assert not any("MV/m" in n for n in [*notes("4 kV"), *notes("12 kV", electrode_width=0.0)])
    assert any("comes to 88 MV/m" in n for n in notes("12 kV", layer_thickness=136.4e-6))


def test_a_hinge_longer_than_its_sheet_is_refused():
    with pytest.raises(InputError, match=r"longer than the sheet.*notch.*<= 0\.05"):
        hinge(notch=6.0)
