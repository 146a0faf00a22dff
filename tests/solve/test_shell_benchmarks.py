"""Shells at large rotation against the tables of Sze, Liu & Lo, a twisted ribbon and sheets that only bend.

Sze, Liu & Lo 2004, Finite Elements in Analysis and Design 40, 1551, doi:10.1016/j.finel.2003.11.001: thick-shell
quadrilaterals of reduced integration, 16 by 1 (cantilever) and 10 by 80 cells (annulus).
"""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from solve.sheets import joined, mesh, plate, rimmed_end

from origami_sim import Drive, State, equilibrium
from origami_sim.solve.batch import Batch

CANTILEVER = {0.25: (0.563, 3.015), 0.5: (1.604, 4.933), 1.0: (3.286, 6.698)}
"""Share of the load of 4: shortening and deflection of the end. E 1.2e6, nu 0, 10 x 1 x 0.1."""

ANNULUS = {0.05: (2.455, 3.370), 0.2: (6.725, 9.160), 0.5: (10.468, 13.768), 1.0: (13.891, 17.528)}
"""Share of the load of 3.2: deflection of the inner and of the outer end. E 21e6, nu 0, radii 6 and 10, 0.03 thick."""


def lifted(model, parameters, end, share, force, parts):
    """Places of the nodes `end` under parts of a load across it, `force` [N] upward in these shares."""
    parameters.set("load", "force_z", force * share, end)
    state, out = None, []
    for part in parts:
        found = equilibrium(model, parameters, Drive(load=part), state=state, tolerance=1e-7)
        assert found.converged, found.message
        state = found.state
        out.append(found.x[end])
    return np.array(out)


def shares(count):
    """Of a line load for evenly spaced nodes along it."""
    out = np.ones(count)
    out[[0, -1]] = 0.5
    return out / out.sum()


@pytest.mark.parametrize("kind", ["diagonal", "crossed", "random"])
def test_a_cantilever_bends_by_two_thirds_of_its_length(kind):
    x, triangles = rimmed_end(kind, 20, 2, 0.1)
    x = 10.0 * x
    held = np.flatnonzero(x[:, 0] < 1e-9)
    model, parameters = plate(x, triangles, held=held, poisson=0.0, thickness=0.1, modulus=1.2e6)
    end = np.flatnonzero(x[:, 0] > 10 - 1e-9)
    end = end[np.argsort(x[end, 1])]
    share = shares(len(end))
    places = lifted(model, parameters, end, share, 4.0, list(CANTILEVER))
    for place, (u, w) in zip(places, CANTILEVER.values(), strict=True):
        assert [10 - share @ place[:, 0], share @ place[:, 2]] == pytest.approx([u, w], abs=0.01)


def annulus(kind, across, around, rim=True):
    """An annulus of radii 6 and 10 with a slit: places, triangles, and angle of each node.

    Its rim lies before 0, below the other end by next to nothing, since no sheet lies in itself.
    """
    step = 2 * np.pi / around
    p, triangles = mesh(kind, around, across, size=(2 * np.pi, 4.0))
    if rim:
        held, before = mesh("diagonal", 1, across, size=(step, 4.0))
        p, triangles = joined((p, triangles), (held - [step, 0, 0], before))
    angle, radius = p[:, 0], 6.0 + p[:, 1]
    below = 1e-5 * np.minimum(angle, 0.0)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), below]), triangles, angle


def annulus_errors(kind, across, around):
    """Relative errors of both ends' deflections [load, end]."""
    x, triangles, angle = annulus(kind, across, around)
    held = np.flatnonzero(angle < 1e-9)
    model, parameters = plate(x, triangles, held=held, poisson=0.0, thickness=0.03, modulus=21e6)
    end = np.flatnonzero(angle > 2 * np.pi - 1e-9)
    end = end[np.argsort(x[end, 0])]
    places = lifted(model, parameters, end, shares(len(end)), 3.2, list(ANNULUS))
    return places[:, [0, -1], 2] / np.array(list(ANNULUS.values())) - 1


def test_a_slit_annulus_is_lifted_by_more_than_its_radius():
    """On 30 by 3 cells it is too stiff throughout, since twist stretches by squares (see below)."""
    errors = annulus_errors("diagonal", 3, 30)
    assert -0.065 < errors.min() < errors.max() < 0
    assert np.abs(errors[1:]).max() < 0.036


@pytest.mark.slow
def test_a_slit_annulus_converges_to_the_table():
    coarse, fine = annulus_errors("crossed", 3, 30), annulus_errors("crossed", 6, 60)
    assert np.abs(fine).max() < 0.02
    assert np.abs(fine[0]).max() < 0.4 * np.abs(coarse[0]).max()
    assert np.all(np.abs(fine) < 0.8 * np.abs(coarse))


@pytest.mark.parametrize("kind", ["diagonal", "crossed", "random"])
def test_a_twisted_ribbon_is_stretched_at_its_borders(kind):
    """tau^2 (y^2 - b^2 / 12) / 2 along it, whose energy is E h tau^4 b^5 / 1440 per length, and bent by tau.

    Constant strains put too much energy into what grows by squares: 27 % with 8 diagonal cells across, of order 2.
    """
    width, length, h, tau, modulus = 1.0, 2.0, 0.02, 0.12, 1e6
    stretched = modulus * h * length * tau**4 * width**5 / 1440
    twisted = modulus * h**3 / 12 * tau**2 * length * width
    errors = []
    for n in (8, 16):
        x, triangles = mesh(kind, 2 * n, n, size=(length, width))
        s, y = x[:, 0], x[:, 1] - width / 2
        x1 = np.column_stack([s * (1 - tau**2 * width**2 / 24), y * np.cos(tau * s), y * np.sin(tau * s)])
        model, parameters = plate(x, triangles, poisson=0.0, thickness=h, modulus=modulus)
        energies = Batch(model, parameters, Drive(), State.at_rest(model, 1, x1)).evaluate(0.0).energies
        assert energies["shell_bending"][0] == pytest.approx(twisted, rel=2e-3)
        errors.append(energies["shell_membrane"][0] / stretched - 1)
    assert 0 < errors[0] < 0.3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("kind", ["diagonal", "crossed"])
def test_bending_does_not_stretch_a_sheet_of_any_border(kind):
    """An annulus rolled onto a cylinder across all its borders, and onto a spiral, where the error is of higher order.

    Energy of the membrane, without any relief, over that of bending; with borders that told only what they know
    themselves of the curvature it would be 0.3 to 0.7 at 3 cells across.
    """
    x, triangles, _ = annulus(kind, 3, 30, rim=False)

    def share(x, triangles, spiral):
        fine = np.linspace(-10.5, 10.5, 20001)
        turn = 0.17 * fine + spiral * fine**2 / 2
        place = [np.interp(x[:, 0], fine, cumulative_trapezoid(f(turn), fine, initial=0)) for f in (np.cos, np.sin)]
        model, parameters = plate(x, triangles, poisson=0.0, thickness=0.03, modulus=21e6)
        bent = State.at_rest(model, 1, np.column_stack([place[0], x[:, 1], place[1]]))
        energies = Batch(model, parameters, Drive(), bent).evaluate(0.0).energies
        return energies["shell_membrane"][0] / energies["shell_bending"][0]

    assert share(x, triangles, 0.0) < 1e-4
    x, triangles, _ = annulus(kind, 6, 60, rim=False)
    assert share(x, triangles, -0.02) < 1e-3
