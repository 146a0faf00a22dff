"""Colours that the noise of a tracker can have: power spectra of what filters, averages and rounds do to white noise.

Every family is a set of spectra over a grid of its parameters, in units of the sampling frequency and of unit variance.
Together they are the prior of the noise's colour: half of it is white, and filters of all families are equally likely,
as are the points of a grid.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.signal import savgol_coeffs

MEMORY = 40
"""Frames after which a tracker has forgotten: colours that still correlate by a hundredth then are no noise but motion.

Half of it excludes a first-order filter with a time constant above 4 frames, double of it lets noise imitate what a
slow motion of 40 frames leaves in a residual.
"""

WHITE = 0.5
"""Probability of white noise: encoders, and cameras whose markers are found picture by picture. It decides where the
motion leaves few frequencies; with a tenth, as of every other family, these are coloured twice as often by mistake."""

CELLS = 9
"""Points of a refined grid along each parameter; half leaves a level that is known to 1 % only to 1.5 %."""

MEDIAN = (0.55290, 0.26231)
"""Correlation of the running median of three normal numbers at lags one and two, from 2e8 draws (error 1e-4)."""

SHARES = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7)
"""Parts of the variance that are white beside a filter: rounding after it, electronics. The least one stands for none;
it keeps noise that an average has taken away altogether, at one frequency, from being divided by nothing."""


def frequencies(count: int) -> np.ndarray:
    """Frequencies (count,) from 0 to the highest one [cycles per frame]."""
    return np.linspace(0.0, 0.5, count)


@dataclass(frozen=True)
class Family:
    """Spectra of one kind.

    Attributes:
        name: in words; braces hold the number of the variant.
        spectrum: power at frequencies f (G,) [cycles per frame], for single values of the parameters.
        axes: grid along each parameter.
        continuous: how many of the parameters (the last ones) can be refined.
    """

    name: str
    spectrum: Callable[..., np.ndarray]
    axes: tuple[tuple[float, ...], ...] = ()
    continuous: int = 0


def _finite(taps: np.ndarray, f: np.ndarray) -> np.ndarray:
    return np.abs(np.exp(-2j * np.pi * np.outer(f, np.arange(len(taps)))) @ taps) ** 2


def _unit(power: np.ndarray) -> np.ndarray:
    return power / np.trapezoid(power, dx=1.0 / (len(power) - 1))


def _with_white(power: np.ndarray, share: float) -> np.ndarray:
    return (1 - share) * _unit(power) + share


def _first_order(f: np.ndarray, u: float, share: float) -> np.ndarray:
    return _with_white(1 / _finite(np.array([1.0, -np.tanh(u)]), f), share)


def _second_order(u: float, v: float) -> np.ndarray:
    """Taps 1, a1, a2 of a polynomial with its roots inside the unit circle, from reflection coefficients."""
    first, second = np.tanh(u), np.tanh(v)
    return np.array([1.0, first * (1 + second), second])


def _smooth(name: str, f: np.ndarray, width: float, share: float) -> np.ndarray:
    if name == "bell":
        return _with_white(np.exp(-((2 * np.pi * f * width) ** 2)), share)
    edge = np.tan(np.pi * np.minimum(f, 0.4999)) / np.tan(np.pi * np.exp(width))
    return _with_white((1 / (1 + edge**4)) ** (2 if name == "both ways" else 1), share)


def _axis(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.linspace(low, high, count))


def _grids() -> tuple[Family, ...]:
    edges = _axis(np.log(0.04), np.log(0.4), 20)
    return (
        Family("white", lambda f: np.ones_like(f)),
        Family("average of {:.0f} frames", lambda f, m, w: _with_white(_finite(np.ones(int(m)), f), w),
               (tuple(range(2, 11)), SHARES), 1),
        Family("average of {:.0f} frames, twice", lambda f, m, w: _with_white(_finite(np.ones(int(m)), f) ** 2, w),
               (tuple(range(2, 7)), SHARES), 1),
        Family("parabolas through {:.0f} frames", lambda f, m, w: _with_white(_finite(savgol_coeffs(int(m), 2), f), w),
               ((5, 7, 9, 11, 15), SHARES), 1),
        Family("median of three", lambda f, w: _with_white(
               1 + 2 * MEDIAN[0] * np.cos(2 * np.pi * f) + 2 * MEDIAN[1] * np.cos(4 * np.pi * f), w), (SHARES,), 1),
        Family("filter of first order", _first_order, (_axis(-0.5, 1.45, 40), SHARES), 2),
        Family("filter of second order", lambda f, e, w: _smooth("once", f, e, w), (edges, SHARES), 2),
        Family("filter both ways", lambda f, e, w: _smooth("both ways", f, e, w), (edges, SHARES), 2),
        Family("bell-shaped average", lambda f, s, w: _smooth("bell", f, s, w), (_axis(0.3, 4.0, 20), SHARES), 2),
        Family("autoregressive of second order", lambda f, u, v: 1 / _finite(_second_order(u, v), f),
               (_axis(-1.7, 1.1, 29), _axis(-1.4, 1.4, 25)), 2),
        Family("moving average of second order", lambda f, u, v: _finite(_second_order(u, v), f),
               (_axis(-3.0, 3.0, 31), _axis(-3.0, 3.0, 31)), 2),
    )  # fmt: skip


FAMILIES = _grids()


@dataclass(frozen=True, eq=False)
class Colours:
    """Candidates for the colour of the noise.

    Attributes:
        power: [J, G] spectra of unit variance. prior: [J] log probability. family: [J]. values: parameters of each.
    """

    power: np.ndarray
    prior: np.ndarray
    family: np.ndarray
    values: tuple[tuple[float, ...], ...]

    def name(self, j: int) -> str:
        """What the candidate is, in words."""
        return FAMILIES[self.family[j]].name.format(*self.values[j])

    def correlation(self, weights: np.ndarray, lags: int) -> np.ndarray:
        """Autocovariance (lags + 1,) of the candidates' mixture with these weights (J,)."""
        return _cosines(weights @ self.power, lags)

    def joined(self, other: "Colours", keep: np.ndarray) -> "Colours":
        """Some of these candidates (J,) and all of others."""
        return Colours(
            np.concatenate([self.power[keep], other.power]),
            np.concatenate([self.prior[keep], other.prior]),
            np.concatenate([self.family[keep], other.family]),
            (*(v for v, k in zip(self.values, keep, strict=True) if k), *other.values),
        )


def _cosines(power: np.ndarray, lags: int) -> np.ndarray:
    """Autocovariance at lags 0 to `lags` of spectra (..., G) from frequency 0 to the highest."""
    return np.fft.irfft(power, axis=-1)[..., : lags + 1]


def made(family: int, points: list[tuple[float, ...]], mass: float, count: int) -> Colours:
    """Candidates of one family at these points, which share a probability; those of too long a memory are left out."""
    f = frequencies(count)
    power = np.stack([_unit(FAMILIES[family].spectrum(f, *p)) for p in points])
    late = np.abs(_cosines(power, count - 1))[:, MEMORY:] / _cosines(power, 0)
    kept = np.flatnonzero(late.max(axis=1) < 0.01)
    prior = np.full(len(kept), np.log(mass / len(points)))
    return Colours(power[kept], prior, np.full(len(kept), family), tuple(points[k] for k in kept))


@lru_cache(maxsize=4)
def all_colours(count: int) -> Colours:
    """Every family on its whole grid, with spectra at `count` frequencies."""
    out = None
    for n, family in enumerate(FAMILIES):
        mass = (1 - WHITE) / (len(FAMILIES) - 1) if family.axes else WHITE
        new = made(n, list(product(*family.axes)), mass, count)
        out = new if out is None else out.joined(new, np.ones(len(out.prior), bool))
    assert out is not None
    return out


def refined(colours: Colours, j: int, count: int, finer: int = 0) -> Colours:
    """The candidates with a finer grid around one of them, in place of its neighbours.

    Args:
        j: the candidate. count: of frequencies. finer: how often its surroundings were refined before.
    """
    n, centre = int(colours.family[j]), colours.values[j]
    family = FAMILIES[n]
    fixed = len(family.axes) - family.continuous
    if not family.continuous:
        return colours
    spans = []
    for axis, at in zip(family.axes[fixed:], centre[fixed:], strict=True):
        i = int(np.argmin(np.abs(np.array(axis) - at)))
        low, high, part = axis[max(i - 1, 0)], axis[min(i + 1, len(axis) - 1)], (2 / (CELLS - 1)) ** finer
        if axis is SHARES:
            spans.append(np.clip(at * np.array([low / at, high / at]) ** part, low, high))
        else:
            spans.append(np.clip(at + part * np.array([low - at, high - at]), low, high))
    grids = [
        np.geomspace(low, high, CELLS) if axis is SHARES else np.linspace(low, high, CELLS)
        for axis, (low, high) in zip(family.axes[fixed:], spans, strict=True)
    ]
    points = list(product(*[(c,) for c in centre[:fixed]], *(tuple(map(float, g)) for g in grids)))
    near = np.array([
        g == n and v[:fixed] == centre[:fixed] and all(a <= x <= b for x, (a, b) in zip(v[fixed:], spans, strict=True))
        for g, v in zip(colours.family, colours.values, strict=True)
    ])  # fmt: skip
    mass = float(np.exp(colours.prior[near]).sum())
    return colours.joined(made(n, points, mass, count), ~near)
