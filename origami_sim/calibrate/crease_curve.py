"""Crease laws from torque-angle curves: a line, or the 33 knots of `effects.crease_table` by smoothing.

References: Wood 2011, J. R. Stat. Soc. B 73, 3 (smoothing by restricted maximum likelihood).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import minimize_scalar

from origami_sim.calibrate.curves import checked_curve
from origami_sim.calibrate.fitting import LEVEL, Fit, Parameter, fit, with_curve
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError


def fit_crease(angle, moment, *, within: tuple[float, float] | None = None) -> Fit:
    """Linear crease M = K (theta - theta0) from a torque-angle curve.

    Args:
        angle: (n,) [rad], monotone. moment: (n,) that holds the angle [N m]. within: part of the curve to use [rad].

    Returns:
        The fit: `stiffness` K [N m/rad] and `rest_angle` theta0 [rad], the angle of zero torque.

    Raises:
        InputError: fewer than 3 points, an angle that turns back, NaN, a moment that falls with the angle.
    """
    angle, moment = checked_curve(angle, moment, ("angle", "moment"), 3)
    if within is not None:
        keep = (angle >= within[0]) & (angle <= within[1])
        angle, moment = checked_curve(angle[keep], moment[keep], ("angle", "moment"), 3)
    slope, offset = np.polyfit(angle, moment, 1)
    if not slope > 0:
        raise InputError(
            "the moment falls with the angle: the stiffness would be negative; is the sign of the moment that of the "
            "moment that holds the angle",
            field="stiffness",
            value=float(slope),
            allowed="> 0 N m/rad",
        )
    parameters = (
        Parameter("stiffness", "N m/rad", slope, (0.0, math.inf), "rotational stiffness of the whole crease"),
        Parameter("rest_angle", "rad", -offset / slope, (-math.inf, math.inf), "angle of zero torque, valley positive"),
    )
    found = fit(lambda p: moment - p[0] * (angle - p[1]), parameters)
    return with_curve(found, angle, moment, found["stiffness"] * (angle - found["rest_angle"]), "angle [rad]",
                       "moment [N m]")  # fmt: skip


@dataclass(frozen=True)
class TableFit:
    """A tabulated crease law fitted to a curve.

    Attributes:
        knots: (33,) angles [rad]. moments: (33,) [N m]. intervals: (33, 2) at `LEVEL` [N m].
        rest_angle: where the law crosses zero [rad]; None where it does not. rest_interval: at `LEVEL` [rad].
        stiffness: slope there, or of the mean line [N m/rad]. noise: of the measured moments [N m].
        freedom: effective number of parameters of the smoothing. x, y, model: (n,) curve and law [rad, N m].
    """

    knots: np.ndarray
    moments: np.ndarray
    intervals: np.ndarray
    rest_angle: float | None
    rest_interval: tuple[float, float] | None
    stiffness: float
    noise: float
    freedom: float
    x: np.ndarray
    y: np.ndarray
    model: np.ndarray
    labels: tuple[str, str] = ("angle [rad]", "moment [N m]")
    warnings: tuple[str, ...] = ()


def table_basis(angle: np.ndarray, first: float, last: float) -> np.ndarray:
    """(n, 33) weights with which the knots of `effects.crease_table` make the moment at each angle [-]."""
    s = (np.asarray(angle, float) - first) / ((last - first) / (KNOTS - 1))
    k = np.clip(np.floor(s).astype(int), 0, KNOTS - 2)
    t = s - k
    one = np.eye(KNOTS)
    slope = np.array(np.gradient(one, axis=0))
    slope[2:-2] = (8 * (one[3:-1] - one[1:-3]) - (one[4:] - one[:-4])) / 12
    before, after = (t < 0)[:, None], (t > 1)[:, None]
    m0, m1, d0, d1, t = one[k], one[k + 1], slope[k], slope[k + 1], t[:, None]
    cubic = ((2 * (m0 - m1) + d0 + d1) * t + 3 * (m1 - m0) - 2 * d0 - d1) * t**2 + d0 * t + m0
    return np.where(before, m0 + d0 * t, np.where(after, m1 + d1 * (t - 1), cubic))


def fit_crease_table(angle, moment, *, ends: tuple[float, float] | None = None, falling: bool = False) -> TableFit:
    """Tabulated crease law from a torque-angle curve: smoothing in the law's own 33 knots, its noise estimated.

    The knots minimise |moment - B m|^2 + lambda |third differences of m|^2. lambda maximises the restricted likelihood
    (Wood 2011), which also yields the noise; the intervals of the knots are the Bayesian ones of that model (Nychka
    1988), and cover on average over the knots.

    Args:
        angle: (n,) [rad], monotone. moment: (n,) that holds the angle [N m]. ends: first and last knot [rad]; the
            curve's own ends when None. falling: accept a law whose moment falls with the angle somewhere.

    Raises:
        InputError: fewer than 8 points, an angle that turns back, NaN, a moment that falls by more than the noise.
    """
    angle, moment = checked_curve(angle, moment, ("angle", "moment"), 8)
    first, last = ends if ends is not None else (float(angle[0]), float(angle[-1]))
    if not first < last:
        raise InputError("a table needs a range of angles", field="ends", value=(first, last), allowed="first < last")
    basis = table_basis(angle, first, last)
    unit = float(np.abs(moment).max()) or 1.0
    y, n, order = moment / unit, len(angle), 3
    rough = np.diff(np.eye(KNOTS), order, axis=0)
    inner, penalty = basis.T @ basis, rough.T @ rough
    right = basis.T @ y
    ridge = 1e-13 * np.trace(inner) / KNOTS * np.eye(KNOTS)

    def solved(log_weight):
        weight = math.exp(log_weight)
        matrix = inner + weight * penalty + ridge
        m = np.linalg.solve(matrix, right)
        total = float(((y - basis @ m) ** 2).sum() + weight * (rough @ m) @ (rough @ m))
        return matrix, m, total, weight

    def criterion(log_weight):
        matrix, _, total, weight = solved(log_weight)
        rank = KNOTS - order
        return (n - order) * math.log(total + 1e-26) + np.linalg.slogdet(matrix)[1] - rank * math.log(weight)

    trial = np.linspace(-16, 24, 41)
    start = trial[int(np.argmin([criterion(w) for w in trial]))]
    log_weight = minimize_scalar(criterion, bounds=(start - 1, start + 1), method="bounded").x
    matrix, m, total, _ = solved(log_weight)
    sigma2 = total / (n - order)
    cover = np.linalg.inv(matrix) * sigma2
    freedom = float(np.trace(np.linalg.solve(matrix, inner)))
    half = stats.t.ppf(0.5 + LEVEL / 2, max(n - freedom, 1.0)) * np.sqrt(np.diag(cover))
    knots = np.linspace(first, last, KNOTS)
    step = np.diff(np.eye(KNOTS), axis=0)
    fall = (step @ m) + 3 * np.sqrt(np.einsum("ij,jk,ik->i", step, cover, step))
    if not falling and (fall < 0).any():
        k = int(np.argmin(fall))
        raise InputError(
            "the moment falls with the angle: the stiffness would be negative; is the sign of the moment that of the "
            "moment that holds the angle",
            field="angle",
            value=round(float(knots[k]), 4),
            allowed="a rising moment (in Python, falling=True accepts a law that snaps)",
        )
    warnings = []
    if (first < angle[0] - (last - first) / KNOTS) or (last > angle[-1] + (last - first) / KNOTS):
        warnings.append("the table reaches beyond the curve; there it is extrapolated")
    rest, rest_interval, slope = None, None, float(np.polyfit(knots, m * unit, 1)[0])
    fine = np.linspace(first, last, 3201)
    at = table_basis(fine, first, last)
    value = at @ m
    crossing = np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0))
    if len(crossing):
        k = crossing[len(crossing) // 2]
        gradient = (value[k + 1] - value[k]) / (fine[k + 1] - fine[k])
        rest, slope = float(fine[k] - value[k] / gradient), float(gradient * unit)
        error = 1.96 * math.sqrt(at[k] @ cover @ at[k]) / gradient
        rest_interval = (rest - error, rest + error)
    model = basis @ m * unit
    return TableFit(
        knots, m * unit, (m[:, None] + half[:, None] * [-1, 1]) * unit, rest, rest_interval, slope,
        math.sqrt(sigma2) * unit, freedom, angle, moment, model, warnings=tuple(warnings),
    )  # fmt: skip
