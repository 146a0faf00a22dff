"""Calibration from measured curves: least squares with bounds, profile-likelihood intervals, what cannot be known.

Every fit goes through `fit`: it minimises the residuals within bounds, estimates the noise from them, follows the
profile of every parameter to the ends of its interval and says which ones the curve determines only in combination.

References: Raue et al. 2009, Bioinformatics 25, 1923 (profile likelihood and identifiability); Seber & Wild, Nonlinear
Regression (2003), 5.9; Wood 2011, J. R. Stat. Soc. B 73, 3 (smoothing by restricted maximum likelihood); Emri and
Tschoegl 1993, Rheol. Acta 32, 311 (non-negative spectra); Fung, Biomechanics (1993), 7.6 (quasi-linear
viscoelasticity).
"""

import csv
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from scipy.optimize import brentq, least_squares, minimize_scalar, nnls

from origami_sim.calibrate.result import Calibration, Quantity, significant
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError
from origami_sim.recording.units import UNITS, unit_factor

LEVEL = 0.95
"""Confidence of all intervals."""

RESOLVED = 0.05
"""Shortest relaxation time that a hold can show, in units of its ramp: faster terms have relaxed when it begins."""

FLAT = 1e-5
"""A direction of the scaled Jacobian with a singular value below this fraction of the largest is unknown."""


# --- reading ----------------------------------------------------------------------------------------------------------


def read_columns(path: str | Path, columns: Mapping[str, tuple[str | None, str]]) -> dict[str, np.ndarray]:
    """Columns of a CSV file in SI.

    Args:
        path: the file; its first line names the columns.
        columns: name -> (unit, dimension), the dimension a key of `recording.units.UNITS`; a unit None is refused,
            because a calibration must not guess it.

    Returns:
        (n,) values [SI] by name.

    Raises:
        InputError: no such file or column, a unit that is missing or of another dimension, a cell that is not a number.
    """
    path = Path(path)
    factors = {}
    for name, (unit, dimension) in columns.items():
        if unit is None:
            allowed = ", ".join(UNITS[dimension])
            raise InputError("the unit of a column is not stated", file=path, field=name, allowed=allowed)
        factors[name] = unit_factor(unit, dimension=dimension, file=path, field=name)
    try:
        with path.open(newline="") as stream:
            rows = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as e:
        raise InputError(f"cannot be read ({getattr(e, 'strerror', None) or e})", file=path) from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    out = {}
    for name in columns:
        if name not in header:
            raise InputError("there is no such column", file=path, field=name, allowed=", ".join(header) or "a header")
        k = header.index(name)
        values = []
        for line, row in enumerate(rows[1:], start=2):
            if not row:
                continue
            try:
                values.append(float(row[k]))
            except (ValueError, IndexError):
                cell = row[k] if k < len(row) else ""
                raise InputError(f"line {line} is not a number", file=path, field=name, value=cell) from None
        out[name] = np.array(values) * factors[name]
    return out


def _curve(x, y, names: tuple[str, str], fewest: int, *, strict: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """A checked curve, x rising."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.ndim != 1 or x.shape != y.shape:
        raise InputError("a curve has as many values of one kind as of the other", field=names[1], value=y.shape,
                         allowed=f"{x.shape}")  # fmt: skip
    for name, values in zip(names, (x, y), strict=True):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"point {bad[0] + 1} of the curve is not a finite number", field=name, value=values[bad[0]]
            )
    if len(x) < fewest:
        raise InputError("too few points on the curve", field=names[0], value=len(x), allowed=f"{fewest} or more")
    step = np.diff(x)
    if strict and not ((step > 0).all() or (step < 0).all()):
        turn = int(np.flatnonzero(step * np.sign(step.sum() or 1.0) <= 0)[0]) + 2
        raise InputError(
            f"the load is not monotone: it turns back or stands at point {turn}",
            field=names[0],
            value=float(x[turn - 1]),
            allowed="one branch, loading or unloading",
        )
    return (x, y) if step[0] > 0 else (x[::-1], y[::-1])


# --- the fit ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Parameter:
    """A parameter of a fit: name, SI unit, start, bounds [SI] and meaning."""

    name: str
    unit: str
    start: float
    bounds: tuple[float, float]
    meaning: str


@dataclass(frozen=True)
class Fit:
    """A least-squares fit.

    Attributes:
        parameters: what was fitted. values: (p,) best values [SI].
        intervals: (p, 2) profile-likelihood intervals at `LEVEL` [SI]; an end on a bound means not bounded by the data.
        noise: (n,) residual's standard deviation as estimated, or as given, in units of the residual.
        correlation: of neighbouring residuals; its effect on the intervals is allowed for.
        warnings: sentences on what the data cannot tell.
        x, y, model: (n,) curve and fitted curve, for the plot; residual is y - model.
        labels: of x and y, with units.
    """

    parameters: tuple[Parameter, ...]
    values: np.ndarray
    intervals: np.ndarray
    noise: float
    correlation: float
    warnings: tuple[str, ...]
    x: np.ndarray = field(default_factory=lambda: np.zeros(0))
    y: np.ndarray = field(default_factory=lambda: np.zeros(0))
    model: np.ndarray = field(default_factory=lambda: np.zeros(0))
    labels: tuple[str, str] = ("", "")

    def __getitem__(self, name: str) -> float:
        return float(self.values[[p.name for p in self.parameters].index(name)])

    def interval(self, name: str) -> tuple[float, float]:
        """(low, high) [SI]."""
        low, high = self.intervals[[p.name for p in self.parameters].index(name)]
        return float(low), float(high)


def fit(
    residual: Callable[[np.ndarray], np.ndarray],
    parameters: Sequence[Parameter],
    *,
    noise: float | None = None,
    intervals: bool = True,
    independent: bool = False,
) -> Fit:
    """Least squares within bounds, with profile-likelihood intervals and a test of what can be known.

    Args:
        residual: (p,) values [SI] -> (n,) measured minus computed.
        parameters: what to fit. noise: standard deviation of a residual; estimated from the fit when None.
        intervals: compute them. independent: take residuals as independent without looking at their correlation.

    The interval of a parameter holds the values at which the sum of squares S, minimised over all others, stays below
    S_min (1 + F q / (n - p)), F the quantile of F(1, n - p) at `LEVEL`, or S_min + noise^2 z^2 with a known noise.
    q = (1 + rho) / (1 - rho) allows for residuals with correlation rho of neighbours, where rho is above chance.

    Raises:
        InputError: no more points than parameters, a start outside its bounds, residuals that are not finite.
    """
    parameters = tuple(parameters)
    start = np.array([p.start for p in parameters], float)
    low, high = np.array([p.bounds for p in parameters], float).T
    for p in parameters:
        if not p.bounds[0] <= p.start <= p.bounds[1]:
            allowed = f"{p.bounds[0]:g} to {p.bounds[1]:g} {p.unit}"
            raise InputError("the start is out of its bounds", field=p.name, value=p.start, allowed=allowed)
    first = np.asarray(residual(start), float)
    if not np.isfinite(first).all():
        raise InputError("the model is not finite at the start", field=parameters[0].name, value=parameters[0].start)
    n, count = len(first), len(parameters)
    if n <= count:
        raise InputError("too few points for the parameters", field="points", value=n, allowed=f"{count + 1} or more")
    scale = np.maximum(np.abs(start), 1e-3 * np.where(np.isfinite(high - low), high - low, 0.0))
    scale = np.where(scale > 0, scale, 1.0)

    def solve(at, keep):
        """Minimum over the parameters `keep`, from `at`."""
        at = at.copy()
        if not keep.any():
            return at, float((residual(at) ** 2).sum())

        def reduced(part):
            at[keep] = part
            return residual(at)

        inner = np.clip(at[keep], low[keep], high[keep])
        found = least_squares(
            reduced, inner, bounds=(low[keep], high[keep]), x_scale=scale[keep], xtol=1e-12, ftol=1e-12, gtol=1e-12,
            max_nfev=400,
        )  # fmt: skip
        at[keep] = found.x
        return at, 2 * float(found.cost)

    every = np.ones(count, bool)
    best, least = solve(start, every)
    rest = np.asarray(residual(best), float)
    sigma = noise if noise is not None else math.sqrt(least / (n - count))
    rho = 0.0
    if not independent and rest.std() > 0:
        centred = rest - rest.mean()
        rho = float((centred[1:] * centred[:-1]).sum() / (centred**2).sum())
        rho = min(rho, 0.99) if rho > 2 / math.sqrt(n) else 0.0
    widen = (1 + rho) / (1 - rho)
    warnings = list(identifiability(residual, parameters, best))
    if rho > 0.5:
        warnings.append(
            f"neighbouring residuals are correlated ({rho:.2f}): the model leaves something out; intervals were "
            f"widened by {math.sqrt(widen):.1f}, but a wrong model is not made right by that"
        )
    bounds = np.column_stack([best, best])
    if intervals:
        if noise is not None:
            rise = stats.norm.ppf(0.5 + LEVEL / 2) ** 2 * noise**2 * widen
        else:
            rise = least * stats.f.ppf(LEVEL, 1, n - count) * widen / (n - count)
        rise = max(rise, 1e-24 * float((first**2).sum()), 1e-300)
        jac = _jacobian(residual, best, scale)
        spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(jac.T @ jac, rcond=1e-12))) * rise)
        for k, p in enumerate(parameters):
            for side, end in enumerate(p.bounds):
                bounds[k, side] = _profile_end(solve, best, least, k, end, spread[k], rise)
                if bounds[k, side] == end and abs(best[k] - end) > 1e-9 * scale[k]:
                    warnings.append(
                        f"the curve does not bound {p.name} {'above' if side else 'below'}: its profile is flat up to "
                        f"{end:g} {p.unit}".rstrip()
                    )
    return Fit(parameters, best, bounds, sigma, rho, tuple(warnings))


def _profile_end(solve, best, least, k, end, spread, rise):
    """Value of parameter k, towards `end`, at which the profile has risen by `rise`; `end` where it never does."""
    keep = np.ones(len(best), bool)
    keep[k] = False
    state = {0.0: best}
    sign = 1.0 if end > best[k] else -1.0
    if end == best[k]:
        return end
    room = abs(end - best[k])

    def excess(distance):
        near = state[min(state, key=lambda d: abs(d - distance))].copy()
        near[k] = best[k] + sign * distance
        found, value = solve(near, keep)
        state[distance] = found
        return value - least - rise

    reach = min(spread if spread > 0 else 1e-6 * (abs(best[k]) or 1.0), room)
    inside = 0.0
    for _ in range(60):
        if excess(reach) > 0:
            return float(best[k] + sign * brentq(excess, inside, reach, rtol=1e-4)) if inside or reach else best[k]
        if reach >= room:
            return end
        inside, reach = reach, min(1.6 * reach, room)
        if not math.isfinite(reach):
            return end
    return end


def _jacobian(residual, at, scale):
    columns = []
    for k in range(len(at)):
        h = 1e-5 * (abs(at[k]) or scale[k])
        up, down = at.copy(), at.copy()
        up[k] += h
        down[k] -= h
        columns.append((np.asarray(residual(up)) - np.asarray(residual(down))) / (2 * h))
    return np.column_stack(columns)


def identifiability(residual, parameters: Sequence[Parameter], at: np.ndarray) -> tuple[str, ...]:
    """Sentences on parameters that the curve determines only together: the null space of the scaled Jacobian.

    Columns are scaled by their values, so that a direction (1, 1) is a common factor (only the ratio is known) and
    (1, -1) an exchange (only the product is known).
    """
    at = np.asarray(at, float)
    scaled = _jacobian(residual, at, np.ones(len(at))) * np.where(at != 0, at, 1.0)
    if not np.isfinite(scaled).all():
        return ()
    _, values, directions = np.linalg.svd(scaled, full_matrices=True)
    values = np.append(values, np.zeros(len(at) - len(values)))
    if values[0] == 0:
        return ("the curve does not depend on any of the parameters",)
    out = []
    for direction in directions[values < FLAT * values[0]]:
        part = direction / np.abs(direction).max()
        involved = [k for k in range(len(at)) if abs(part[k]) > 0.05]
        names = [parameters[k].name for k in involved]
        if len(involved) == 1:
            out.append(f"the curve does not depend on {names[0]}: it cannot be known")
        elif all(abs(abs(part[k]) - 1) < 0.05 for k in involved):
            last = involved[-1]
            signs = ["/" if part[k] * part[last] > 0 else " * " for k in involved[:-1]]
            known = [f"{n}{s}{names[-1]}" for n, s in zip(names, signs, strict=False)]
            kind = "product" if signs == [" * "] else "ratio" if len(known) == 1 else "combinations"
            out.append(f"only the {kind} {', '.join(known)} can be known from this curve; state one of them")
        else:
            out.append(f"only a combination of {', '.join(names)} can be known from this curve; state one of them")
    return tuple(out)


# --- crease -----------------------------------------------------------------------------------------------------------


def fit_crease(angle, moment, *, within: tuple[float, float] | None = None) -> Fit:
    """Linear crease M = K (theta - theta0) from a torque-angle curve.

    Args:
        angle: (n,) [rad], monotone. moment: (n,) that holds the angle [N m]. within: part of the curve to use [rad].

    Returns:
        The fit: `stiffness` K [N m/rad] and `rest_angle` theta0 [rad], the angle of zero torque.

    Raises:
        InputError: fewer than 3 points, an angle that turns back, NaN, a moment that falls with the angle.
    """
    angle, moment = _curve(angle, moment, ("angle", "moment"), 3)
    if within is not None:
        keep = (angle >= within[0]) & (angle <= within[1])
        angle, moment = _curve(angle[keep], moment[keep], ("angle", "moment"), 3)
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
    return _with_curve(found, angle, moment, found["stiffness"] * (angle - found["rest_angle"]), "angle [rad]",
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
    slope = np.gradient(one, axis=0)
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
    angle, moment = _curve(angle, moment, ("angle", "moment"), 8)
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
            allowed="a rising moment, or falling=True",
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


# --- relaxation -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hold:
    """A stress relaxation: a stretch that is reached, then held.

    Attributes:
        name: to tell it from others. time: (n,) from the end of the ramp [s], of the hold. force: (n,) [N or any].
        ramp_time: (m,) times of the ramp, up to 0 [s]. ramp_force: (m,) instantaneous elastic force during it, relative
            to that of the held stretch (0 to 1): without loss the force would follow it.
    """

    name: str
    time: np.ndarray
    force: np.ndarray
    ramp_time: np.ndarray
    ramp_force: np.ndarray

    def branch(self, tau: np.ndarray) -> np.ndarray:
        """(len(tau),) force of a Maxwell branch at the end of the ramp, relative to a step's [-]."""
        rise = np.diff(self.ramp_force)
        age = -self.ramp_time
        middle = np.maximum(np.diff(-age), 1e-12)[None, :]
        r = middle / np.asarray(tau, float)[:, None]
        grown = -np.expm1(-r) / r * np.exp(-age[1:][None, :] / np.asarray(tau, float)[:, None])
        return grown @ rise


def read_hold(
    path: str | Path,
    *,
    time_unit: str | None,
    displacement_unit: str | None,
    force_unit: str | None,
    gauge_length: float,
    columns: tuple[str, str, str] = ("time_s", "displacement_mm", "force_n"),
) -> Hold:
    """A relaxation test from a CSV file; the elastic force during the ramp follows l - l^-2 (neo-Hookean).

    Args:
        path: the file. time_unit, displacement_unit, force_unit: of its columns. gauge_length: [m].
        columns: names of time, displacement and force.

    Raises:
        InputError: as `read_columns`; a time that turns back, no hold, a force that is not tensile.
    """
    if not gauge_length > 0:
        raise InputError("not a gauge length", file=path, field="gauge_length", value=gauge_length, allowed="> 0 m")
    data = read_columns(
        path,
        dict(zip(columns, ((time_unit, "time"), (displacement_unit, "length"), (force_unit, "force")), strict=True)),
    )
    time, displacement, force = (data[c] for c in columns)
    _curve(time, displacement, (columns[0], columns[1]), 30)
    _curve(time, force, (columns[0], columns[2]), 30)
    if not time[1] > time[0]:
        raise InputError("the time runs backwards", file=path, field=columns[0], value=float(time[1]))
    final = displacement[-1]
    end = int(np.argmax(displacement >= 0.999 * final))
    if not final > 0 or len(time) - end < 20 or np.abs(displacement[end:] - final).max() > 0.02 * final:
        raise InputError("there is no hold at the end of the ramp", file=path, field=columns[1], value=float(final))
    stretch = 1 + np.clip(np.append(displacement[:end], final), 0, final) / gauge_length
    elastic = np.maximum.accumulate(stretch - stretch**-2)
    if not (force[end:] > 0).all():
        raise InputError("the held force is not tensile", file=path, field=columns[2], allowed="> 0")
    return Hold(
        Path(path).stem,
        time[end + 1 :] - time[end],
        force[end + 1 :],
        time[: end + 1] - time[end],
        elastic / elastic[-1],
    )


@dataclass(frozen=True)
class PronyFit:
    """A Prony series g(t) = g_inf + sum g_i exp(-t / tau_i) with g(0) = 1.

    Attributes:
        times: (m,) relaxation times, rising [s]. weights: (m,) g_i. rest: g_inf, 1 - sum g_i.
        intervals: (m, 2) of the weights at `LEVEL`. time_intervals: (m, 2) of the times [s].
        rest_interval: (low, high). scales: instantaneous force by hold [force].
        error: relative root-mean-square residual by hold. held_out: the same for each hold predicted by a series fitted
            to the others, its force scale alone fitted; empty for a single hold.
        criteria: BIC by number of terms. spectrum: (times [s], weights) of the non-negative spectrum on the log grid.
        decades: of time that the curves cover. warnings: what the curves cannot tell.
        fit: relative force of all holds against time, for the plot.
    """

    times: np.ndarray
    weights: np.ndarray
    rest: float
    intervals: np.ndarray
    time_intervals: np.ndarray
    rest_interval: tuple[float, float]
    scales: dict[str, float]
    error: dict[str, float]
    held_out: dict[str, float]
    criteria: dict[int, float]
    spectrum: tuple[np.ndarray, np.ndarray]
    decades: float
    warnings: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    model: np.ndarray
    labels: tuple[str, str] = ("time after the ramp [s]", "force over instantaneous force [-]")

    def __call__(self, time) -> np.ndarray:
        """Relaxation function at these times [s]."""
        return self.rest + np.exp(-np.asarray(time, float)[..., None] / self.times) @ self.weights

    def crease_parameters(self, instantaneous: float) -> dict[tuple[str, str], float]:
        """Values for the effects `crease` and `crease_relaxation` of a series of at most three terms.

        Args:
            instantaneous: stiffness of the crease before any relaxation [N m/rad].
        """
        if len(self.times) > 3:
            raise InputError(
                "crease_relaxation has three branches", field="terms", value=len(self.times), allowed="1 to 3"
            )
        out = {("crease", "stiffness"): instantaneous * self.rest}
        for k, (tau, g) in enumerate(zip(self.times, self.weights, strict=True), start=1):
            out["crease_relaxation", f"stiffness_{k}"] = instantaneous * float(g)
            out["crease_relaxation", f"time_{k}"] = float(tau)
        return out


def thinned(hold: Hold, shortest: float, per_decade: int = 16) -> Hold:
    """The hold from `shortest` on [s], averaged in bins of equal width in log time, so that no decade dominates."""
    keep = hold.time >= shortest * (1 - 1e-9)
    time, force = hold.time[keep], hold.force[keep]
    bins = np.floor(per_decade * np.log10(time / shortest * (1 + 1e-9))).astype(int)
    keys = np.unique(bins)
    t = np.array([np.exp(np.log(time[bins == k]).mean()) for k in keys])
    f = np.array([force[bins == k].mean() for k in keys])
    return Hold(hold.name, t, f, hold.ramp_time, hold.ramp_force)


def fit_prony(holds: Sequence[Hold], *, terms: int | None = None, most: int = 8, leave_out: bool = True) -> PronyFit:
    """Prony series of one material from one or several holds, joint: one relaxation function, one force scale each.

    A non-negative spectrum on a logarithmic grid (4 times per decade) starts series of 1, 2, ... terms with free times;
    the number of terms has the least BIC, counted in points per decade, not in samples. Residuals are relative forces.

    Args:
        holds: the tests. terms: number of terms; chosen by BIC when None. most: terms tried.
        leave_out: also predict each hold from the others.

    Raises:
        InputError: no hold, fewer than 20 points, a force that is not positive or rises over the hold.
    """
    if not holds:
        raise InputError("a Prony series needs at least one hold", field="holds", value=0, allowed="1 or more")
    if terms is not None and not 1 <= terms <= 12:
        raise InputError("no such number of terms", field="terms", value=terms, allowed="1 to 12, or none")
    for h in holds:
        _curve(h.time, h.force, ("time", "force"), 20)
        if not (h.force > 0).all() or not h.time[0] > 0:
            raise InputError("a held force is positive", field=h.name, value=float(h.force.min()), allowed="> 0")
        tenth = max(len(h.force) // 10, 1)
        if not h.force[:tenth].mean() > h.force[-tenth:].mean():
            raise InputError(
                "the force does not relax: a weight of the series would be negative",
                field=h.name,
                value=float(h.force[-1] / h.force[0]),
                allowed="a falling force",
            )
    ramp = min(-float(h.ramp_time[0]) for h in holds)
    shortest, longest = max(RESOLVED * ramp, *(float(h.time[0]) for h in holds)), max(h.time[-1] for h in holds)
    if not longest > 10 * shortest:
        raise InputError("the hold is too short for a series", field="time", value=float(longest),
                         allowed=f"more than {10 * shortest:g} s after the ramp")  # fmt: skip
    thin = [thinned(h, shortest) for h in holds]
    spectrum = _spectrum(thin, shortest, longest)
    series: dict[int, Any] = {}
    criteria: dict[int, float] = {}
    for m in [terms] if terms is not None else range(1, most + 1):
        series[m] = _series(thin, m, spectrum, shortest, longest)
        criteria[m] = series[m][1]
        if terms is None and m > min(criteria, key=criteria.__getitem__) + 1:
            break
    chosen = min(criteria, key=criteria.__getitem__)
    parameters, _, model = series[chosen]
    residual = model
    start = [
        *(
            Parameter(f"log_time_{k + 1}", "1", v, (math.log(shortest), math.log(longest * 4)), "")
            for k, v in enumerate(parameters[:chosen])
        ),
        *(Parameter(f"log_weight_{k + 1}", "1", v, (v - 9, v + 9), "") for k, v in enumerate(parameters[chosen:])),
    ]
    found = fit(residual, start, independent=False)
    times = np.exp(found.values[:chosen])
    odds = np.exp(np.append(found.values[chosen:], 0.0))
    weights, rest = odds[:-1] / odds.sum(), float(odds[-1] / odds.sum())
    jac = _jacobian(residual, found.values, np.ones(2 * chosen))
    widen = (1 + found.correlation) / (1 - found.correlation)
    cover = np.linalg.pinv(jac.T @ jac) * found.noise**2 * widen
    shares = np.append(weights, rest)
    to_share = (np.diag(shares) - np.outer(shares, shares))[:, :-1]
    z = stats.t.ppf(0.5 + LEVEL / 2, max(sum(len(h.time) for h in thin) - 2 * chosen, 1))
    half = z * np.sqrt(np.einsum("ij,jk,ik->i", to_share, cover[chosen:, chosen:], to_share))
    span = np.column_stack([np.clip(shares - half, 0, 1), np.clip(shares + half, 0, 1)])
    scales, predictions = _scaled(thin, times, weights, rest)
    error = {h.name: _relative(h, p) for h, p in zip(thin, predictions, strict=True)}
    held_out = {}
    if leave_out and len(holds) > 1:
        for k, h in enumerate(thin):
            others = [o for j, o in enumerate(thin) if j != k]
            p, _, _ = _series(others, chosen, _spectrum(others, shortest, longest), shortest, longest)
            t_k, g_k, rest_k = _unpacked(p)
            held_out[h.name] = _relative(h, _scaled([h], t_k, g_k, rest_k)[1][0])
    decades = math.log10(longest / shortest)
    warnings = [w for w in found.warnings if "profile is flat" not in w]
    if times[0] < 0.2 * max(-h.ramp_time[0] for h in holds):
        slow = max(-float(h.ramp_time[0]) for h in holds)
        warnings.append(f"terms faster than the ramp ({slow:.2g} s) rest on its assumed elastic force")
    if times[-1] > longest:
        warnings.append("the slowest time exceeds the hold: the rest force is extrapolated")
    order = np.argsort(times)
    y = np.concatenate([h.force / s for h, s in zip(thin, scales, strict=True)])
    m_all = np.concatenate([p / s for p, s in zip(predictions, scales, strict=True)])
    return PronyFit(
        times[order], weights[order], rest, span[:-1][order], np.exp(found.intervals[:chosen])[order],
        tuple(span[-1]), {h.name: float(s) for h, s in zip(thin, scales, strict=True)}, error, held_out, criteria,
        spectrum, decades, tuple(warnings), np.concatenate([h.time for h in thin]), y, m_all,
    )  # fmt: skip


def _columns(hold: Hold, times: np.ndarray) -> np.ndarray:
    """(n, m + 1) force of each branch of unit weight, and of the rest, over the hold."""
    decays = np.exp(-hold.time[:, None] / times[None, :]) * hold.branch(times)[None, :]
    return np.column_stack([decays, np.ones(len(hold.time))])


def _scaled(holds, times, weights, rest):
    scales, out = [], []
    for h in holds:
        shape = _columns(h, times) @ np.append(weights, rest)
        ratio = shape / h.force
        scales.append(float(ratio.sum() / (ratio**2).sum()))  # least squares of 1 - s ratio
        out.append(scales[-1] * shape)
    return scales, out


def _relative(hold, prediction) -> float:
    return float(np.sqrt(np.mean((prediction / hold.force - 1) ** 2)))


def _spectrum(holds, shortest, longest):
    """Non-negative weights on a log grid, joint over the holds by alternating scales and weights."""
    grid = np.exp(np.arange(math.log(shortest), math.log(longest * 4), math.log(10) / 4))
    columns = [_columns(h, grid) for h in holds]
    scales = np.array([h.force[0] for h in holds])
    weights = np.zeros(len(grid) + 1)
    for _ in range(30):
        matrix = np.vstack([s * c / h.force[:, None] for s, c, h in zip(scales, columns, holds, strict=True)])
        weights, _ = nnls(matrix, np.ones(len(matrix)))
        weights /= weights.sum()
        ratios = [c @ weights / h.force for c, h in zip(columns, holds, strict=True)]
        scales = np.array([r.sum() / (r**2).sum() for r in ratios])
    return grid, weights[:-1]


def _unpacked(p):
    m = len(p) // 2
    odds = np.exp(np.append(p[m:], 0.0))
    return np.exp(p[:m]), odds[:-1] / odds.sum(), float(odds[-1] / odds.sum())


def _series(holds, terms, spectrum, shortest, longest):
    """Best series of that many terms: (log times, log odds of weights), BIC, residual function."""
    grid, weights = spectrum
    rest = max(1 - weights.sum(), 1e-3)
    # cut the spectrum into `terms` parts of equal range in log time; a part's time is its weighted mean
    used = weights > 0
    ends = np.linspace(np.log(grid[used][0]) - 0.1, np.log(grid[used][-1]) + 0.1, terms + 1)
    start = []
    for k in range(terms):
        part = (np.log(grid) >= ends[k]) & (np.log(grid) < ends[k + 1])
        weight = weights[part].sum()
        mean = (weights[part] * np.log(grid[part])).sum() / weight if weight > 0 else (ends[k] + ends[k + 1]) / 2
        start.append((mean, math.log(max(weight, 1e-3) / rest)))
    p0 = np.array([s[0] for s in start] + [s[1] for s in start])
    low = np.append(np.full(terms, math.log(shortest)), np.full(terms, -12.0))
    high = np.append(np.full(terms, math.log(longest * 4)), np.full(terms, 12.0))

    def residual(p):
        _, out = _scaled(holds, *_unpacked(p))
        return np.concatenate([f / h.force - 1 for f, h in zip(out, holds, strict=True)])

    found = least_squares(residual, np.clip(p0, low + 1e-6, high - 1e-6), bounds=(low, high), max_nfev=300)
    n = len(found.fun)
    order = np.argsort(found.x[:terms])
    p = np.append(found.x[:terms][order], found.x[terms:][order])
    bic = n * math.log(max(2 * found.cost / n, 1e-16)) + (2 * terms + len(holds)) * math.log(n)
    return p, bic, residual


# --- ring-down --------------------------------------------------------------------------------------------------------


def fit_ring_down(time, angle, *, inertia: float | None = None) -> Fit:
    """Stiffness and viscosity of a crease from a free swing: I theta'' + c theta' + K (theta - theta0) = 0.

    Args:
        time: (n,) [s], rising. angle: (n,) [rad]. inertia: I about the crease [kg m^2]. Without it only K / I and c / I
            can be known: they are returned, and a warning says so.

    Returns:
        With an inertia `stiffness` [N m/rad] and `viscosity` [N m s/rad]; without, `stiffness_per_inertia` [1/s^2] and
        `viscosity_per_inertia` [1/s]. Also `rest_angle` [rad].

    Raises:
        InputError: fewer than 10 points, a time that turns back, NaN, no swing, an amplitude that grows (the viscosity
            would be negative), an inertia that is not positive.
    """
    if inertia is not None and not (inertia > 0 and math.isfinite(inertia)):
        raise InputError("not an inertia", field="inertia", value=inertia, allowed="> 0 kg m^2, or none")
    raw = np.asarray(time, float)
    time, angle = _curve(time, angle, ("time", "angle"), 10)
    if len(raw) and raw[0] != time[0]:
        raise InputError("the time runs backwards", field="time", value=float(raw[-1]), allowed="rising times")
    t = time - time[0]
    swing = angle - angle.mean()
    if not swing.std() > 1e-12 * max(np.abs(angle).max(), 1e-300):
        raise InputError("there is no swing", field="angle", value=float(swing.std()), allowed="a free oscillation")
    even = np.linspace(0, t[-1], len(t))
    power = np.abs(np.fft.rfft(np.interp(even, t, swing) * np.hanning(len(t)), 8 * len(t))) ** 2
    rates = 2 * math.pi * np.fft.rfftfreq(8 * len(t), even[1])
    lowest = 2 * math.pi / t[-1]
    peak = int(np.argmax(np.where(rates >= lowest, power, 0)))
    if power[peak] <= 0 or rates[peak] > 0.9 * math.pi / even[1]:
        raise InputError("the swing is not resolved in time", field="time", value=len(t), allowed="8 points per period")

    def columns(square, loss):
        gamma = loss / 2
        rate2 = square - gamma**2
        decay = np.exp(-gamma * t)
        rate = math.sqrt(abs(rate2)) + 1e-12
        if rate2 > 0:
            return np.column_stack([decay * np.cos(rate * t), decay * np.sin(rate * t)])
        return np.column_stack([np.exp((-gamma + rate) * t), np.exp((-gamma - rate) * t)])

    def predicted(square, loss, rest):
        c = columns(square, loss)
        return rest + c @ np.linalg.lstsq(c, angle - rest, rcond=None)[0]

    def start_of(loss):
        c = np.column_stack([columns(rates[peak] ** 2 + loss**2 / 4, loss), np.ones(len(t))])
        a = np.linalg.lstsq(c, angle, rcond=None)[0]
        return float(((angle - c @ a) ** 2).sum()), loss, float(a[-1])

    trials = [start_of(x / t[-1]) for x in (-4.0, -1.0, -0.2, 0.02, 0.1, 0.4, 1.0, 2.5, 6.0, 15.0)]
    _, loss, rest = min(trials)
    square = rates[peak] ** 2
    free = least_squares(
        lambda p: angle - predicted(p[0] * square, p[1] * lowest, p[2]), [1.0, loss / lowest, rest], max_nfev=200
    )
    jacobian = np.asarray(free.jac)
    error = np.linalg.pinv(jacobian.T @ jacobian) * 2 * free.cost / max(len(t) - 5, 1)
    if free.x[1] < -3 * math.sqrt(abs(error[1, 1])) and free.x[1] * lowest * t[-1] < -1e-3:
        raise InputError(
            "the amplitude grows: the viscosity would be negative",
            field="viscosity_per_inertia",
            value=float(free.x[1] * lowest),
            allowed=">= 0 1/s",
        )
    if not free.x[0] > 0:
        square = float(free.x[0] * square)
        raise InputError(
            "the stiffness would be negative", field="stiffness_per_inertia", value=square, allowed="> 0 1/s^2"
        )
    known = inertia or 1.0
    names = (
        (("stiffness", "N m/rad"), ("viscosity", "N m s/rad"))
        if inertia
        else (("stiffness_per_inertia", "1/s^2"), ("viscosity_per_inertia", "1/s"))
    )
    inf = math.inf
    parameters = (
        Parameter(*names[0], free.x[0] * square * known, (0.0, inf), "rotational stiffness of the whole crease"),
        Parameter(*names[1], max(free.x[1] * lowest, 0.0) * known, (0.0, inf), "Kelvin-Voigt loss of the crease"),
        Parameter("rest_angle", "rad", free.x[2], (-inf, inf), "angle without moment"),
    )
    found = fit(lambda p: angle - predicted(p[0] / known, p[1] / known, p[2]), parameters)
    model = predicted(found.values[0] / known, found.values[1] / known, found.values[2])
    if inertia is None:
        triple = [
            Parameter(n, u, v, (0.0, inf), "")
            for n, u, v in (
                ("stiffness", "N m/rad", found.values[0]),
                ("viscosity", "N m s/rad", max(found.values[1], 1e-9 * lowest)),
                ("inertia", "kg m^2", 1.0),
            )
        ]
        unknown = identifiability(
            lambda p: angle - predicted(p[0] / p[2], p[1] / p[2], found.values[2]), triple,
            np.array([p.start for p in triple]),
        )  # fmt: skip
        found = _warned(found, unknown)
    return _with_curve(found, time, angle, model, "time [s]", "angle [rad]")


# --- results ----------------------------------------------------------------------------------------------------------


def calibration(found, *, title: str, command: str, source: str, prefix: str = "") -> Calibration:
    """The content of a calibration file from a `Fit`, `TableFit` or `PronyFit`.

    Args:
        found: the fit. title: first line of the file. command: re-creates it. source: the recording, in words.
        prefix: in front of the names.
    """
    note = f"{source}; {LEVEL:.0%} interval"
    if isinstance(found, Fit):
        quantities = [
            Quantity(prefix + p.name, float(v), p.unit, p.meaning, f"{note} by profile likelihood", _pair(i))
            for p, v, i in zip(found.parameters, found.values, found.intervals, strict=True)
        ]
    elif isinstance(found, TableFit):
        quantities = [
            Quantity(prefix + "angle_min", float(found.knots[0]), "rad", "angle of the first knot", source),
            Quantity(prefix + "angle_max", float(found.knots[-1]), "rad", "angle of the last knot", source),
            Quantity(prefix + "stiffness", found.stiffness, "N m/rad", "slope at zero torque", source),
            Quantity(prefix + "moment_noise", found.noise, "N m", "standard deviation of the measured moment", source),
            Quantity(prefix + "resisting_moment", tuple(map(float, found.moments)), "N m",
                     "moment needed to hold the angle", f"{note}, pointwise",
                     tuple((float(a), float(b)) for a, b in found.intervals)),
        ]  # fmt: skip
        if found.rest_angle is not None:
            quantities.insert(
                2,
                Quantity(
                    prefix + "rest_angle", found.rest_angle, "rad", "angle of zero torque", note, found.rest_interval
                ),
            )
    elif isinstance(found, PronyFit):
        worst = max(found.error.values())
        quantities = [
            Quantity(prefix + "rest", found.rest, "1", "g_inf: force that stays, relative to an instantaneous stretch",
                     f"{note}, linearised", found.rest_interval),
            Quantity(prefix + "error", worst, "1", "largest relative rms residual of a hold", source),
        ]  # fmt: skip
        if found.held_out:
            worst = max(found.held_out.values())
            meaning = "largest relative rms residual of a hold predicted from the others"
            quantities.append(Quantity(prefix + "held_out_error", worst, "1", meaning, source))
        for k, (tau, g) in enumerate(zip(found.times, found.weights, strict=True), start=1):
            quantities += [
                Quantity(f"{prefix}time_{k}", float(tau), "s", f"relaxation time of term {k}",
                         f"{note} by profile likelihood", _pair(found.time_intervals[k - 1])),
                Quantity(f"{prefix}weight_{k}", float(g), "1",
                         f"g_{k}: share of term {k} in the instantaneous stiffness", f"{note}, linearised",
                         _pair(found.intervals[k - 1])),
            ]  # fmt: skip
    else:
        raise InputError("not a fit", field="found", value=type(found).__name__, allowed="Fit, TableFit, PronyFit")
    return Calibration(title, command, tuple(quantities), tuple(found.warnings))


def _pair(interval) -> tuple[float, float]:
    low, high = interval
    return float(low), float(high)


def summary(found: Calibration) -> str:
    """Values with their intervals, one per line, for the terminal."""
    lines = []
    interval: Any
    for q in found.quantities:
        interval = q.interval
        if isinstance(q.value, tuple):
            lines.append(f"{q.name} = {len(q.value)} knots, {min(q.value):.4g} to {max(q.value):.4g} {q.unit}")
        elif isinstance(q.value, (str, bool)):
            lines.append(f"{q.name} = {q.value}")
        else:
            lines.append(f"{q.name} = {significant(q.value, interval)} {'' if q.unit == '1' else q.unit}".rstrip())
    return "\n".join([*lines, *(f"warning: {w}" for w in found.warnings)])


def plot_fit(found, path: str | Path, *, title: str = "", logarithmic: bool | None = None) -> Path:
    """Curve and fit above, residual with the band of twice its standard deviation below.

    Args:
        found: a `Fit`, `TableFit` or `PronyFit`. path: .png, .svg or .pdf; it appears whole or not at all.
        title: above the picture. logarithmic: x axis; for a Prony series by default.
    """
    from matplotlib.figure import Figure  # slow to import, only needed here

    target = Path(path)
    formats = (".png", ".svg", ".pdf")
    if target.suffix.lower() not in formats:
        raise InputError("unknown kind of picture", field="path", value=str(path), allowed=", ".join(formats))
    relaxing = isinstance(found, PronyFit)
    figure = Figure(figsize=(7.2, 5.4), dpi=120, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2.2, 1.0]})
    residual = found.y - found.model
    order = np.argsort(found.x, kind="stable")
    top.plot(found.x, found.y, "o", ms=3, mfc="none", color="#000000", alpha=0.6, label="measured")
    if relaxing:
        t = np.geomspace(found.x.min() / 2, found.x.max(), 300)
        top.plot(t, found(t), "-", lw=1.6, color="#0072b2", label="g(t), after an instantaneous stretch")
        top.plot(found.x, found.model, ".", ms=3, color="#d55e00", label="fit, with each test's ramp")
    else:
        top.plot(found.x[order], found.model[order], "-", lw=1.6, color="#d55e00", label="fit")
    if isinstance(found, TableFit):
        top.plot(found.knots, found.moments, "s", ms=4, color="#0072b2", label=f"{KNOTS} knots of the crease law")
        if found.rest_angle is not None:
            top.axvline(found.rest_angle, lw=0.8, ls="--", color="#333333")
            top.annotate(f"zero torque {found.rest_angle:.4f} rad", (found.rest_angle, found.y.min()), fontsize=8,
                         xytext=(4, 0), textcoords="offset points")  # fmt: skip
    top.legend(fontsize=8, frameon=False)
    top.set_ylabel(found.labels[1])
    if title:
        top.set_title(title, fontsize=10)
    spread = float(np.sqrt(np.mean(residual**2)))
    bottom.axhspan(-2 * spread, 2 * spread, color="#d9d9d9", lw=0, label="twice the rms")
    bottom.axhline(0.0, lw=0.8, color="#333333")
    bottom.plot(found.x, residual, ".", ms=3, color="#d55e00")
    bottom.legend(fontsize=8, frameon=False, loc="upper right")
    bottom.set_ylabel("residual")
    bottom.set_xlabel(found.labels[0])
    if logarithmic if logarithmic is not None else relaxing:
        bottom.set_xscale("log")
    partial = target.with_name(f".{target.stem}.{os.getpid()}.partial{target.suffix}")
    try:
        figure.savefig(partial)
        os.replace(partial, target)
    except OSError as e:
        raise InputError(f"cannot write the picture ({e.strerror})", file=target) from None
    finally:
        partial.unlink(missing_ok=True)
    return target


def _with_curve(found: Fit, x, y, model, *labels: str) -> Fit:
    return Fit(**{**found.__dict__, "x": x, "y": y, "model": model, "labels": labels})


def _warned(found: Fit, more: Sequence[str]) -> Fit:
    return Fit(**{**found.__dict__, "warnings": (*found.warnings, *more)})
