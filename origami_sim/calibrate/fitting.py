"""Least squares with bounds, profile-likelihood intervals, and what cannot be known.

`fit` minimises the residuals within bounds, estimates the noise from them, follows the profile of every parameter to
the ends of its interval and says which ones the curve determines only in combination.

References: Raue et al. 2009, Bioinformatics 25, 1923 (profile likelihood and identifiability); Seber & Wild, Nonlinear
Regression (2003), 5.9.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats
from scipy.optimize import brentq, least_squares

from origami_sim.errors import InputError
from origami_sim.units import of_unit

LEVEL = 0.95
"""Confidence of all intervals."""

FLAT = 1e-5
"""A direction of the scaled Jacobian with a singular value below this fraction of the largest is unknown."""


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
            allowed = of_unit(f"{p.bounds[0]:g} to {p.bounds[1]:g}", p.unit)
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
        jac = jacobian(residual, best, scale) * scale  # parameters of different units must not hide each other
        spread = scale * np.sqrt(np.abs(np.diag(np.linalg.pinv(jac.T @ jac, rcond=1e-12))) * rise)
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

    reach = min(max(spread, 1e-6 * (abs(best[k]) or 1.0)), room)
    inside = 0.0
    for _ in range(200):
        if excess(reach) > 0:
            return float(best[k] + sign * brentq(excess, inside, reach, rtol=1e-4)) if inside or reach else best[k]
        if reach >= room:
            return end
        inside, reach = reach, min(1.6 * reach, room)
        if not math.isfinite(reach):
            return end
    return end


def jacobian(residual, at, scale):
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
    scaled = jacobian(residual, at, np.ones(len(at))) * np.where(at != 0, at, 1.0)
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


def with_curve(found: Fit, x, y, model, *labels: str) -> Fit:
    return Fit(**{**found.__dict__, "x": x, "y": y, "model": model, "labels": labels})


def warned(found: Fit, more: Sequence[str]) -> Fit:
    return Fit(**{**found.__dict__, "warnings": (*found.warnings, *more)})
