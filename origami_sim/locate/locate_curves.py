"""Where curves differ from a model: the moment that is missing at each crease, binned against what it may go with."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from origami_sim.locate.locate import BINS, binned
from origami_sim.locate.places import Curve, Place
from origami_sim.predict.curves import Balance


def places(found: Sequence[Balance], *, by_step: bool) -> list[Place]:
    """Places, most suspicious first; none where the moments are not told.

    Args:
        by_step: whether times count load steps, along which nothing has a power.
    """
    out = []
    for k, name in enumerate(found[0].names if found else ()):
        z, power = [], []
        for b in found:
            times, q, missing, error = b.times, b.q, b.missing, b.error
            width = max(1, len(times) // BINS)
            cut = len(times) // width * width
            mean, deviation = (v[k, :cut].reshape(-1, width).mean(1) for v in (missing, error))
            z.append(mean / deviation * np.sqrt(width))
            power.append(missing[k] * np.gradient(q[k], times))
        times, missing, error = found[0].times, found[0].missing, found[0].error
        score = float(np.sqrt(np.mean(np.concatenate(z) ** 2)))
        out.append(
            Place(
                name,
                score,
                0.0,
                float("nan") if by_step else float(np.mean(np.concatenate(power))),
                float("nan"),
                times.tolist(),
                missing[k].tolist(),
                error[k].tolist(),
                _curves(found, k),
            )
        )
    excess = np.array([max(p.score**2 - 1.0, 0.0) for p in out])
    for p, e in zip(out, excess, strict=True):
        p.share = float(e / excess.sum()) if excess.sum() > 0 else 1.0 / len(out)
    return sorted(out, key=lambda p: -p.score)


def _curves(found, k: int) -> list[Curve]:
    """Residual moment of a coordinate against its angle and against every drive that varies."""
    y = np.concatenate([f.missing[k] for f in found])
    error = np.concatenate([f.error[k] for f in found])
    against = {("angle", "rad"): np.concatenate([f.q[k] for f in found])}
    for n in sorted(set.intersection(*(set(f.against) for f in found))):
        unit = {"field": "T", "voltage": "V", "gradient": "T/m", "time": "s"}.get(n.split("_")[0], "")
        against[n, unit] = np.concatenate([f.against[n] for f in found])
    out = []
    for (name, unit), x in against.items():
        parts = [p for p in np.array_split(np.argsort(x, kind="stable"), BINS) if len(p)]
        out.append(binned(name, unit, x, y, parts, [np.sqrt(np.mean(error[p] ** 2) / len(p)) for p in parts]))
    return out


def sign_changes(curve: Curve) -> list[float]:
    """Where the residual moment changes its sign, between means that are both beyond twice their error."""
    x, y, e = (np.array(v) for v in (curve.x, curve.mean, curve.error))
    sure = np.flatnonzero(np.abs(y) > 2 * e)
    pairs = [(a, b) for a, b in pairwise(sure) if y[a] * y[b] < 0]
    return [float(x[a] + (x[b] - x[a]) * y[a] / (y[a] - y[b])) for a, b in pairs]
