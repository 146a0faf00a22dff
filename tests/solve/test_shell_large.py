"""A clamped plate that is bent by twice its thickness and carries by its membrane, against a Ritz solution."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial, legendre
from scipy.optimize import minimize
from solve.sheets import at, border, plate, rimmed, tributary

from origami_sim import Drive, equilibrium

POISSON, TERMS = 0.316, 5


def shapes(power, parity):
    """Even or odd polynomials on [-1, 1] with a zero of that order at both ends: values, slopes and curvatures."""
    points = legendre.leggauss(24)[0]
    kinds = [legendre.leg2poly(np.eye(2 * k + parity + 1)[-1]) for k in range(TERMS)]
    each = [Polynomial(c) * Polynomial([1, 0, -1]) ** power for c in kinds]
    return [np.array([(p.deriv(d) if d else p)(points) for p in each]) for d in range(3)], np.array(
        [p(0) for p in each]
    )


def ritz(pressure):
    """Middle deflection over thickness by von Karman's equations, for p a^4 / (E h^4), in 75 polynomials."""
    weights = legendre.leggauss(24)[1]
    g, n = np.outer(weights, weights), TERMS**2
    (w, middle), (even, _), (odd, _) = shapes(2, 0), shapes(1, 0), shapes(1, 1)
    stretch = 1 / (1 - POISSON**2)
    bend, p = stretch / 12, pressure / 16  # side 2

    def field(c, x, y):
        return np.einsum("ij,ip,jq->pq", c, x, y)

    def back(f, x, y):
        return np.einsum("pq,ip,jq->ij", f * g, x, y)

    def resultants(x, y, xy, stiffness):
        return stiffness * (x + POISSON * y), stiffness * (y + POISSON * x), stiffness * (1 - POISSON) / 2 * xy

    def energy(z):
        cw, cu, cv = z.reshape(3, TERMS, TERMS)
        wx, wy = field(cw, w[1], w[0]), field(cw, w[0], w[1])
        k = field(cw, w[2], w[0]), field(cw, w[0], w[2]), 2 * field(cw, w[1], w[1])
        e = (
            field(cu, odd[1], even[0]) + wx**2 / 2,
            field(cv, even[0], odd[1]) + wy**2 / 2,
            field(cu, odd[0], even[1]) + field(cv, even[1], odd[0]) + wx * wy,
        )
        (nx, ny, ns), (mx, my, ms) = resultants(*e, stretch), resultants(*k, bend)
        density = sum(a * b for a, b in zip((nx, ny, ns, mx, my, ms), (*e, *k), strict=True)) / 2
        value = (g * (density - p * field(cw, w[0], w[0]))).sum()
        gw = back(mx, w[2], w[0]) + back(my, w[0], w[2]) + 2 * back(ms, w[1], w[1]) - p * back(1 + 0 * g, w[0], w[0])
        gw += back(nx * wx + ns * wy, w[1], w[0]) + back(ny * wy + ns * wx, w[0], w[1])
        gu = back(nx, odd[1], even[0]) + back(ns, odd[0], even[1])
        gv = back(ny, even[0], odd[1]) + back(ns, even[1], odd[0])
        return value, np.concatenate([gw.ravel(), gu.ravel(), gv.ravel()])

    found = minimize(energy, np.zeros(3 * n), jac=True, method="BFGS", options={"maxiter": 3000, "gtol": 1e-9})
    return float(middle @ found.x[:n].reshape(TERMS, TERMS) @ middle)


@pytest.mark.parametrize(("kind", "n"), [("diagonal", 16), ("crossed", 8), ("random", 12)])
def test_a_plate_bent_by_twice_its_thickness_is_right_to_one_percent(kind, n):
    x, triangles = rimmed(kind, n)
    model, parameters = plate(x, triangles, held=border(x), poisson=POISSON, thickness=1e-3, modulus=1e9)
    parameters.set("load", "force_z", 402.0 * 1e9 * 1e-12 * tributary(x, triangles))
    state = None
    for part in (0.3, 1.0):
        found = equilibrium(model, parameters, Drive(load=part), state=state, tolerance=1e-8)
        assert found.converged, found.message
        state = found.state
    assert at(x, found.x[:, 2], [0.5, 0.5]) / 1e-3 == pytest.approx(ritz(402.0), rel=0.01)
