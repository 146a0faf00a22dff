"""Inverse design: the numbers with which a device does what is asked, or does it best."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq, least_squares, minimize
from scipy.stats import qmc

from origami_sim.errors import InputError
from origami_sim.explore.found import Build, Found, Measure, Way, find, number, unit_of
from origami_sim.explore.gradients import gradient
from origami_sim.quantities import converted

Bounds = Mapping[str, tuple[float | str, float | str]]

SAMPLES = 8
"""Points at which a search begins: it then refines the best of them, or the first interval that holds the target.

Of two optima it finds the better one if one of the points lies in its basin. Half misses more, double takes longer.
"""


@dataclass
class Solution:
    """What a search ended with.

    Attributes:
        values: numbers of the design [SI]. value: of the measure or objective there. found: the device there.
        reached: whether the target is met, or a minimum is found. message: in a sentence.
        tried: every point that was tried, with its value under "value".
    """

    values: dict[str, float]
    value: float | np.ndarray
    reached: bool
    message: str
    found: Found | None = field(default=None, repr=False)
    tried: list[dict[str, float]] = field(default_factory=list, repr=False)

    def __str__(self) -> str:
        return f"{', '.join(f'{n} = {v:.6g}' for n, v in self.values.items())}: {self.message}"


def solve_for(
    build: Build,
    measure: Measure | Sequence[Measure],
    target: float | str | Sequence[float | str],
    bounds: Bounds,
    *,
    fixed: Mapping[str, Any] | None = None,
    way: Way | None = None,
    tolerance: float = 1e-8,
) -> Solution:
    """The numbers with which measures have their targets.

    One number is bracketed by SAMPLES intervals and found by Brent's method (Brent 1973); several by trust-region least
    squares within bounds (Branch, Coleman & Li 1999) with the gradients of `gradient`.

    Args:
        measure, target: one each, or as many. Targets are SI or quantities, "90 deg".
        bounds: least and largest value of each unknown argument of `build`. fixed: other arguments.
        tolerance: of the unknowns, over the width of their bounds.

    Returns:
        The solution. If the target is out of reach, `reached` is False and `message` says how close it comes.

    Raises:
        InputError: bounds that are not an interval, as many targets as measures are not given.
    """
    how, limits = way or Way(), _limits(build, bounds)
    every = [measure] if callable(measure) else list(measure)
    targets = [target] if isinstance(target, str) or np.ndim(target) == 0 else list(target)  # pyright: ignore[reportArgumentType]
    if len(every) != len(targets):
        raise InputError(
            "measures and targets differ in number", field="target", value=len(targets), allowed=len(every)
        )
    wanted = [float(converted(t, unit_of(m), "target")) for m, t in zip(every, targets, strict=True)]
    if len(limits) == 1 and len(every) == 1:
        return _root(build, every[0], wanted[0], limits, fixed or {}, how, tolerance)
    tried: list[dict[str, float]] = []
    low, width = _box(limits)
    scale = np.array([abs(w) or 1.0 for w in wanted])

    def at(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = dict(zip(limits, low + u * width, strict=True))
        g = gradient(build, every, point, scales=dict(zip(limits, width, strict=True)), fixed=fixed, way=how)
        tried.append({**point, "value": float(np.abs(g.value - wanted).max())})
        return (g.value - wanted) / scale, g.slope * width / scale[:, None]

    memo = _Memo(at)
    start = _best_start(build, lambda f: float(sum(((m(f) - w) / s) ** 2 for m, w, s in zip(every, wanted, scale))),  # noqa: B905
                        limits, fixed or {}, how, tried)  # fmt: skip
    done = least_squares(lambda u: memo(u)[0], start, jac=lambda u: memo(u)[1], bounds=(0, 1), xtol=tolerance)
    values = dict(zip(limits, (low + done.x * width).tolist(), strict=True))
    last = find(build, [{**(fixed or {}), **values}], how)[0]
    value = np.array([m(last) for m in every])
    worst = float(np.abs((value - wanted) / scale).max())
    reached = worst < 1e-4
    message = (
        f"targets met within {worst:.1e} of their size" if reached else f"targets missed by {worst:.2g} of their size"
    )
    return Solution(values, value, reached, message, last, tried)


def _end(value: float | str | None, free: float, unit: str) -> float:
    """One end of what a measure may be [SI]; `free` where nothing is stated."""
    return free if value is None else float(converted(value, unit, "subject_to"))


def optimise(
    build: Build,
    objective: Measure,
    bounds: Bounds,
    *,
    fixed: Mapping[str, Any] | None = None,
    subject_to: Sequence[tuple[Measure, float | str | None, float | str | None]] = (),
    way: Way | None = None,
    samples: int = SAMPLES,
    rounds: int = 40,
    seed: int = 0,
) -> Solution:
    """The numbers with which an objective is least.

    A Sobol sample of the box is found in one batch; from the best of it sequential quadratic programming goes down
    (SLSQP, Kraft 1988) with the gradients of `gradient`. The best point that was tried is the answer.

    Args:
        objective: to be made small; `lambda found: -found.moved("x")` makes the way long.
        bounds: least and largest value of each unknown argument of `build`. fixed: other arguments.
        subject_to: measures with their least and largest value; None: any.
        samples: at the start. rounds: of the descent, 0 for none. seed: of the sample.

    Raises:
        InputError: bounds that are not an interval, a sample in which no device is found.
    """
    how, limits = way or Way(), _limits(build, bounds)
    low, width = _box(limits)
    walls = [(m, _end(a, -np.inf, unit_of(m)), _end(b, np.inf, unit_of(m))) for m, a, b in subject_to]
    measures = [objective, *(m for m, _, _ in walls)]
    tried: list[dict[str, float]] = []

    def allowed(values: Sequence[float]) -> bool:
        return all(
            a - 1e-6 * (abs(a) or 1) <= v <= b + 1e-6 * (abs(b) or 1)
            for v, (_, a, b) in zip(values, walls, strict=True)
        )

    def keep(point: Mapping[str, float], values: Sequence[float]) -> None:
        tried.append({**point, "value": float(values[0]), "allowed": float(allowed(values[1:]))})

    draws = qmc.Sobol(len(limits), seed=seed).random(max(samples, 1))
    points = [dict(zip(limits, (low + u * width).tolist(), strict=True)) for u in draws]
    for p, f in zip(points, find(build, [{**(fixed or {}), **p} for p in points], how), strict=True):
        if not f.failure:
            keep(p, [float(m(f)) for m in measures])
    if not tried:
        raise InputError("no device of the sample is found", field="bounds", allowed="bounds within which it works")
    begin = min(tried, key=lambda t: (not t["allowed"], t["value"]))
    size = max(float(np.ptp([t["value"] for t in tried])), abs(begin["value"]) * 1e-3) or 1.0

    def at(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        point = dict(zip(limits, (low + np.clip(u, 0, 1) * width).tolist(), strict=True))
        g = gradient(build, measures, point, scales=dict(zip(limits, width, strict=True)), fixed=fixed, way=how)
        keep(point, g.value.tolist())
        return g.value, g.slope * width

    memo, message, reached = _Memo(at), f"the best of {len(points)} samples", not rounds
    if rounds:
        inner: Any = [
            {"type": "ineq", "fun": lambda u, k=k, s=s, b=b: s * (memo(u)[0][k] - b) / (abs(b) or 1.0),
             "jac": lambda u, k=k, s=s, b=b: s * memo(u)[1][k] / (abs(b) or 1.0)}
            for k, (_, a, c) in enumerate(walls, 1) for s, b in ((1.0, a), (-1.0, c)) if np.isfinite(b)
        ]  # fmt: skip
        start = (np.array([begin[n] for n in limits]) - low) / width
        done: Any = minimize(
            lambda u: float(memo(u)[0][0]) / size,
            start,
            jac=lambda u: memo(u)[1][0] / size,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(limits),
            constraints=inner,
            options={"maxiter": rounds, "ftol": 1e-7},
        )
        reached, message = bool(done.success), f"{str(done.message).rstrip('.').lower()} after {done.nit} rounds"
    best = min(tried, key=lambda t: (not t["allowed"], t["value"]))
    values = {n: best[n] for n in limits}
    if not best["allowed"]:
        reached, message = False, "nothing that was tried keeps what it is subject to"
    last = find(build, [{**(fixed or {}), **values}], how)[0]
    return Solution(values, best["value"], reached, f"{best['value']:.6g}, {message}", last, tried)


# parts ----------------------------------------------------------------------------------------------------------------


def _limits(build: Build, bounds: Bounds) -> dict[str, tuple[float, float]]:
    out = {}
    for name, given in bounds.items():
        low, high = (float(number(build, v, name)) for v in given)
        if not low < high or not np.isfinite(high - low):
            raise InputError("bounds are an interval", field=name, value=given, allowed="(least, largest)")
        out[name] = (low, high)
    if not out:
        raise InputError("nothing is unknown", field="bounds", allowed="{name: (least, largest)}")
    return out


def _box(limits: Mapping[str, tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    low = np.array([a for a, _ in limits.values()])
    return low, np.array([b for _, b in limits.values()]) - low


def _root(build, measure, target, limits, fixed, way, tolerance) -> Solution:
    """One number for one target."""
    ((name, (low, high)),) = limits.items()
    tried: list[dict[str, float]] = []

    def off(values: Sequence[float]) -> list[float]:
        out = []
        for v, f in zip(values, find(build, [{**fixed, name: v} for v in values], way), strict=True):
            out.append(float("nan") if f.failure else float(measure(f)) - target)
            tried.append({name: v, "value": out[-1] + target})
        return out

    grid = np.linspace(low, high, SAMPLES + 1).tolist()
    values = off(grid)
    known = [(v, o) for v, o in zip(grid, values, strict=True) if np.isfinite(o)]
    if not known:
        return Solution(
            {name: low}, float("nan"), False, "the device is found at no point within the bounds", None, tried
        )
    pairs = [(a, b) for a, b in pairwise(known) if a[1] * b[1] <= 0]
    if not pairs:
        best = min(known, key=lambda k: abs(k[1]))
        reach = [o + target for _, o in known]
        said = f"the target {target:.6g} is out of reach: within the bounds is {min(reach):.6g} to {max(reach):.6g}"
        last = find(build, [{**fixed, name: best[0]}], way)[0]
        return Solution({name: best[0]}, best[1] + target, False, said, last, tried)
    (a, _), (b, _) = pairs[0]
    root = float(brentq(lambda v: off([float(v)])[0], a, b, xtol=tolerance * (high - low)))
    last = find(build, [{**fixed, name: root}], way)[0]
    value = float(measure(last))
    more = f"; {len(pairs) - 1} more between other points" if len(pairs) > 1 else ""
    return Solution({name: root}, value, True, f"{value:.6g}, target {target:.6g}{more}", last, tried)


def _best_start(build, cost: Callable[[Found], float], limits, fixed, way, tried) -> np.ndarray:
    """The best of a Sobol sample of the box, inside it."""
    low, width = _box(limits)
    draws = qmc.Sobol(len(limits), seed=0).random(SAMPLES)
    points = [dict(zip(limits, (low + u * width).tolist(), strict=True)) for u in draws]
    costs = []
    for p, f in zip(points, find(build, [{**fixed, **p} for p in points], way), strict=True):
        costs.append(float("inf") if f.failure else cost(f))
        tried.append({**p, "value": costs[-1]})
    if not np.any(np.isfinite(costs)):
        raise InputError("no device of the sample is found", field="bounds", allowed="bounds within which it works")
    return np.clip(draws[int(np.argmin(costs))], 1e-3, 1 - 1e-3)


class _Memo:
    """A function of the last point that it was asked at."""

    def __init__(self, function: Callable[[np.ndarray], Any]):
        self.function, self.point, self.value = function, None, None

    def __call__(self, u: np.ndarray) -> Any:
        if self.point is None or not np.array_equal(u, self.point):
            self.point, self.value = np.array(u), self.function(np.array(u))
        return self.value
