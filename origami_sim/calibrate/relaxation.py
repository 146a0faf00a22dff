"""Prony series from stress relaxation, joint over several tests.

References: Emri and Tschoegl 1993, Rheol. Acta 32, 311 (non-negative spectra); Fung, Biomechanics (1993), 7.6
(quasi-linear viscoelasticity).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from scipy.optimize import least_squares, nnls

from origami_sim.calibrate.curves import checked_curve, read_columns
from origami_sim.calibrate.fitting import LEVEL, Parameter, fit, jacobian
from origami_sim.errors import InputError

RESOLVED = 0.05
"""Shortest relaxation time that a hold can show, in units of its ramp: faster terms have relaxed when it begins."""


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
    checked_curve(time, displacement, (columns[0], columns[1]), 30)
    checked_curve(time, force, (columns[0], columns[2]), 30)
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
        checked_curve(h.time, h.force, ("time", "force"), 20)
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
    jac = jacobian(residual, found.values, np.ones(2 * chosen))
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
