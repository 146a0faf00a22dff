"""Shells that are curved at rest, under point loads: a pinched cylinder and a hemisphere with a hole.

Cylinder: length 600, radius 300, 3 thick, E 3e6, nu 0.3, rigid diaphragms at its ends, pinched by 1: 1.8249e-5 under
the load (Fluegge's series, in the obstacle course of Belytschko et al. 1985, doi:10.1016/0045-7825(85)90035-0).
Hemisphere: radius 10, hole of 18 degrees, 0.04 thick, E 6.825e7, nu 0.3, two forces outward and two inward at its
equator: 0.0940 under forces of 2, that is of 1 on each quarter (MacNeal & Harder 1985,
doi:10.1016/0168-874X(85)90003-4), and the table of Sze, Liu & Lo 2004 up to 400 (see `test_shell_benchmarks`).
"""

import numpy as np
import pytest
from solve.sheets import joined, mesh

from origami_sim import Drive, Sheet, equilibrium
from origami_sim.pattern import sheet

CYLINDER, SPHERE = 1.8249e-5, 0.0940

TABLE = {0.05: (0.855, 0.955), 0.5: (3.406, 5.902), 1.0: (4.067, 8.178)}
"""Share of forces of 400: way out and way in of the points at which they act (16 by 16 cells per quarter)."""


def shell(x, triangles, thickness, modulus, holds):
    """Model and parameters of a shell at rest as it is, with some nodes held along some axes."""
    s = Sheet(sheet(x, triangles), thickness=thickness, modulus=modulus, density=1000.0, membrane_damping=0.0)
    s.shell(poisson=0.3)
    for nodes, axes in holds:
        s.fix(nodes=nodes, axes=axes)
    return s.on("load").build()


def at(x, *place):
    """The node at a place."""
    n = int(np.linalg.norm(x - np.array(place), axis=1).argmin())
    assert np.linalg.norm(x[n] - place) < 1e-6 * np.ptp(x)
    return n


def cylinder(n):
    """Way of the load over the exact one, with 4 n by 2 n diagonal cells: [-]."""
    p, triangles = mesh("diagonal", 4 * n, 2 * n, size=(2 * np.pi, 600.0))
    angle = p[:, 0]
    x, triangles = joined((np.column_stack([p[:, 1] - 300, 300 * np.cos(angle), 300 * np.sin(angle)]), triangles))
    ends, middle = np.flatnonzero(np.abs(x[:, 0]) > 300 - 1e-6), at(x, 0, 300, 0)
    model, parameters = shell(x, triangles, 3.0, 3e6, [(ends, "yz"), ([middle], "x")])
    top, bottom = at(x, 0, 0, 300), at(x, 0, 0, -300)
    parameters.set("load", "force_z", np.array([-1.0, 1.0]), [top, bottom])
    found = equilibrium(model, parameters, Drive(load=1.0))
    assert found.converged, found.message
    return (x[top, 2] - found.x[top, 2]) / CYLINDER


def hemisphere(n):
    """Model, parameters and nodes A and B, with 4 n by n crossed cells; forces of 1 times the drive."""
    p, triangles = mesh("crossed", 4 * n, n, size=(2 * np.pi, np.radians(72)))
    a, b = p[:, 0], p[:, 1]
    x = 10 * np.column_stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])
    x, triangles = joined((x, triangles))
    out, inward = [at(x, 10, 0, 0), at(x, -10, 0, 0)], [at(x, 0, 10, 0), at(x, 0, -10, 0)]
    c, s = 10 * np.cos(np.radians(72)), 10 * np.sin(np.radians(72))
    rim = [at(x, c, 0, s), at(x, -c, 0, s)]  # what symmetry holds, without force
    model, parameters = shell(x, triangles, 0.04, 6.825e7, [(out, "yz"), (inward, "x"), (rim, "y")])
    parameters.set("load", "force_x", np.array([1.0, -1.0]), out)
    parameters.set("load", "force_y", np.array([-1.0, 1.0]), inward)
    return model, parameters, out[0], inward[0]


def moved(found, model, a, b):
    """Ways out and in."""
    return np.array([found.x[a, 0] - model.position[a, 0], model.position[b, 1] - found.x[b, 1]])


@pytest.mark.slow
def test_a_pinched_cylinder_converges_to_the_series():
    """From above, as elements do that bend without stretching: 6.2 % and 3.4 % too soft, 2.2 % with 32 (order 1.5)."""
    errors = [cylinder(n) - 1 for n in (16, 24)]
    assert 0 < errors[1] < 0.036
    assert np.log(errors[0] / errors[1]) / np.log(1.5) > 1.4


def test_a_hemisphere_is_pinched_as_published():
    """4 and 8 cells per quarter: 1.6 % too soft, 0.75 % too stiff; towards 0.0928 on finer ones (12: 0.0930).

    MacNeal & Harder's 0.0940 is 1.3 % above that.
    """
    for n, within in ((4, 0.02), (8, 0.01)):
        model, parameters, a, b = hemisphere(n)
        found = equilibrium(model, parameters, Drive(load=0.02))
        assert found.converged, found.message
        assert 100 * moved(found, model, a, b) == pytest.approx([SPHERE, SPHERE], rel=within)


def pinched(n, parts):
    """Relative errors of the ways in the table."""
    model, parameters, a, b = hemisphere(n)
    state, errors = None, []
    for part in parts:
        found = equilibrium(model, parameters, Drive(load=400 * part), state=state)
        assert found.converged, found.message
        state = found.state
        if part in TABLE:
            errors.append(moved(found, model, a, b) / TABLE[part] - 1)
    return np.array(errors)


@pytest.mark.slow
def test_a_hemisphere_is_pinched_far_on_a_coarse_mesh():
    """4 cells per quarter: 1.6 to 3.7 % too soft."""
    errors = pinched(4, (0.05, 0.2, 0.5, 1.0))
    assert 0 < errors.min() < errors.max() < 0.04


@pytest.mark.slow
def test_a_hemisphere_is_pinched_far_as_in_the_table():
    """8 cells per quarter: 0.0 to 0.9 % off where it yields outward, 1.0 to 2.4 % too stiff inward."""
    errors = pinched(8, (0.05, 0.15, 0.3, 0.5, 0.75, 1.0))
    assert np.abs(errors[:, 0]).max() < 0.012
    assert -0.026 < errors[:, 1].min() < errors[:, 1].max() < 0
