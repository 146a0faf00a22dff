"""Elastic panels whose mass sits at their corners swing too slowly, which a run says with the right amount."""

import re

import numpy as np
import pytest

from origami_sim import Sheet, simulate
from origami_sim.pattern import grid, miura, strip
from origami_sim.pattern.assemble import assemble
from origami_sim.pattern.mesh import uncreased

HEIGHT, WIDTH, K = 0.03, 0.02, 2e-4


def flap(corners: int, **options) -> Sheet:
    """A held square with a rectangle or a triangle that swings about their common side."""
    tip = [(0.01 + HEIGHT, -WIDTH / 2, 0.0), (0.01 + HEIGHT, WIDTH / 2, 0.0)]
    tip = tip if corners == 4 else [(0.01 + HEIGHT, 0.0, 0.0)]
    base = [(0.0, -0.01, 0.0), (0.01, -0.01, 0.0), (0.01, 0.01, 0.0), (0.0, 0.01, 0.0)]
    moving = (1, 4, 5, 2) if corners == 4 else (1, 4, 2)
    pattern = assemble(np.array([*base, *tip]), [(0, 1, 2, 3), moving])
    sheet = Sheet(pattern, thickness=0.2e-3, material="pet", membrane_damping=0.0, **options)
    return sheet.crease(stiffness=K, rest_angle=0.02).fix(panels=[0])


def swing(sheet: Sheet) -> tuple[float, list[str]]:
    """Period [s] of a small swing about the crease, and what the run says of its masses."""
    motion = simulate(*sheet.build(), duration=0.3, rate=4000)
    angle = motion.creases[:, 0, 0] - 0.02
    before = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    crossings = motion.times[before] + angle[before] / (angle[before] - angle[before + 1]) / 4000
    return float(np.mean(np.diff(crossings))), [n for n in motion.notes if "at their corners" in n]


@pytest.mark.parametrize(
    ("corners", "moment", "excess", "better"),
    [(4, 1 / 3, 0.5, "triangulation='center' and panels='rigid' have it"), (3, 1 / 6, 1.0, "panels='rigid' has it")],
)
def test_the_excess_of_inertia_is_that_of_the_swing(corners, moment, excess, better):
    sheet = flap(corners, triangulation="diagonal")
    mass = float(sheet.density[1] * 0.2e-3 * WIDTH * HEIGHT * (1.0 if corners == 4 else 0.5))
    closed = 2 * np.pi * np.sqrt(moment * mass * HEIGHT**2 / K)
    period, (note,) = swing(sheet)
    inertia, slower = (0.01 * int(v) for v in re.findall(r"(\d+)% (?:too large|slower)", note))
    assert inertia == pytest.approx(excess, abs=0.005) and better in note
    assert period / closed - 1.0 == pytest.approx(np.sqrt(1.0 + excess) - 1.0, abs=6e-4)
    assert slower == pytest.approx(period / closed - 1.0, abs=0.006)
    assert swing(flap(corners, panels="rigid")) == (pytest.approx(closed, rel=2e-5), [])


def notes(sheet: Sheet) -> list[str]:
    return [n for n in simulate(*sheet.build(), duration=1e-3, rate=1000).notes if "at their corners" in n]


def test_of_a_chain_all_that_hangs_on_a_crease_counts():
    """Of n panels in a row the sum of excesses is 1 / (n (n + 1)), that about the first crease 1 / (2 n^2)."""
    chains = {
        n: Sheet(strip([0.01] * (n + 1), 0.02), thickness=1e-4, triangulation="diagonal").crease(stiffness=K)
        for n in (2, 3)
    }
    assert "crease 0 is 12% too large, and what hangs on it swings 6% slower" in notes(chains[2].fix(panels=[0]))[0]
    assert not notes(chains[3].fix(panels=[0]))


def test_nothing_is_said_where_masses_are_right_or_a_panel_is_divided():
    assert not swing(flap(4))[1]
    assert not notes(Sheet(strip([0.01, 0.03], 0.02), thickness=1e-3).crease(stiffness=K).fix(panels=[0, 1]))
    assert not notes(Sheet(uncreased(grid(4, 2, 0.01, 0.01)), thickness=1e-3))  # one panel, without a crease
    assert not notes(Sheet(miura(1, 1, 0.03, 0.03, 1.0, fold_angle=0.5), thickness=1e-3).crease(stiffness=K))  # a loop

    def divided(n: int) -> Sheet:
        """A held square, and beyond a crease a panel of n elements, with an excess of 1 / (2 n^2)."""
        pattern = uncreased(strip([0.01, *[HEIGHT / n] * n], 0.02))
        first = next(e for e in range(pattern.edge_count) if np.allclose(pattern.vertices[pattern.edges[e], 0], 0.01))
        pattern.assignments[first] = "U"
        return Sheet(pattern, thickness=1e-3).crease(stiffness=K).fix(panels=[0])

    assert "12% too large" in notes(divided(2))[0]
    assert not notes(divided(3))
