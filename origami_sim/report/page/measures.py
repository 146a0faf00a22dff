"""Numbers that the page derives from a diagnosis: errors over the noise, fits, what stands out of noise."""

from collections.abc import Sequence

import numpy as np

from origami_sim.locate.places import clock
from origami_sim.report.diagnosis import Correlation, Diagnosis, Trace
from origami_sim.report.page.markup import amount, number


def array(values) -> np.ndarray:
    """As floats; None, as in JSON, is nan."""
    return np.asarray(values, float)


def known(value: float | None, other: float = np.nan) -> float:
    """The value, or another if it is None or not finite."""
    return float(value) if value is not None and np.isfinite(value) else other


def when(d: Diagnosis, time: float) -> str:
    """An instant of the recordings in words: "0.31 s", or "load step 12"."""
    return f"{clock(True)[0]} {number(time, 3)}" if d.by_step else amount(time, "s", 3)


def padded(values: Sequence[float], d: Diagnosis) -> np.ndarray:
    """One value per component; nan where there is none."""
    out = np.full(len(d.components), np.nan)
    given = array(values)[: len(out)]
    out[: len(given)] = given
    return out


def has_noise(d: Diagnosis) -> bool:
    noise = padded(d.noise, d)
    return bool(len(noise) and np.all(np.isfinite(noise) & (noise > 0)))


def each_multiple(d: Diagnosis, rms: Sequence[float]) -> np.ndarray:
    """Errors by component in multiples of the noise, or of the recorded spread where the noise is not known."""
    scale = padded(d.noise, d)
    if not has_noise(d):
        recorded = [[array(t.recorded) for t in d.traces if t.component == c] for c in d.components]
        spread = [float(np.nanstd(np.concatenate(r))) if r else np.nan for r in recorded]
        scale = np.array([s if s > 0 else np.nan for s in spread])
    return padded(rms, d) / scale


def multiples(d: Diagnosis, rms: Sequence[float]) -> float:
    """The same, root mean square over components."""
    values = each_multiple(d, rms)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else np.nan


def fit(t: Trace, kind: str) -> float:
    """Fit % = 100 (1 - NRMSE) of a prediction."""
    y, f = array(t.recorded), array(getattr(t, kind))
    if len(f) != len(y):
        return np.nan
    both = np.isfinite(y) & np.isfinite(f)
    if not both.any():
        return np.nan
    spread = float(np.sqrt(np.mean((y[both] - y[both].mean()) ** 2)))
    return 100 * (1 - float(np.sqrt(np.mean((y[both] - f[both]) ** 2))) / spread) if spread else np.nan


def limit(d: Diagnosis, c: Correlation) -> float:
    """Half-width of the band that holds 95 % of the correlations of white noise."""
    samples = sum(int(np.isfinite(array(t.recorded)).sum()) for t in d.traces if t.component == c.component)
    return 1.96 / np.sqrt(samples) if samples else np.nan


def outside(d: Diagnosis, c: Correlation, kind: str) -> float:
    """Part of the lags (but zero) whose autocorrelation lies outside that band; 0.05 is expected of noise."""
    values, lags = array(getattr(c, kind)), array(c.lags)
    values = values[(lags[: len(values)] != 0) & np.isfinite(values)]
    most = limit(d, c)
    return float(np.mean(np.abs(values) > most)) if len(values) and np.isfinite(most) else np.nan
