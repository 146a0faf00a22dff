"""What methods without physics would do with the same data: a parameter refit, sparse regression, a Gaussian process.

The two that learn a correction learn it from the residual moment of equation error at each crease (`locate.motion`),
outside of each fold, as a function of that crease's angle and rate. It is then put into the simulator as a table and
predicts that fold, with the starts adapted exactly as for every hypothesis. Numbers of the model are those of the refit
without that fold.
"""

import copy
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product

import numpy as np

from origami_sim.fit.held_out import HeldOut, folds
from origami_sim.fit.least_squares import Fit, Weights, fit
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import NOMINAL, Free, Hypothesis, Subject
from origami_sim.locate.locate import motion
from origami_sim.report.diagnosis import Baseline
from origami_sim.threads import shared

KNOTS = 9

FEWEST = 30
"""Frames that a correction is learnt from at least."""

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Thresholds of the sparse regression, as parts of the largest scaled coefficient; chosen on a third of the data."""

RIDGES = (0.0, 1e-3)
"""Ridges of the sparse regression, over the mean square of a scaled column, chosen likewise. Without one, two columns
that are nearly the same, such as an angle and its sine, may take large opposite coefficients, beside which the right
one falls under the threshold."""

LIBRARY: dict[str, Callable] = {
    "1": lambda a, w: np.ones_like(a),
    "angle": lambda a, w: a,
    "angle^2": lambda a, w: a**2,
    "angle^3": lambda a, w: a**3,
    "sin angle": lambda a, w: np.sin(a),
    "rate": lambda a, w: w,
    "rate |rate|": lambda a, w: w * np.abs(w),
    "rate^3": lambda a, w: w**3,
    "sign rate": lambda a, w: np.sign(w),
    "angle rate": lambda a, w: a * w,
}


def baselines(forward: Predictor, fits: Sequence[Fit], weights: Weights, reference: np.ndarray) -> list[Baseline]:
    """Held-out rms of each baseline [SI], on each fold, learnt on all others.

    Args:
        fits: the model without any effect, refitted without each fold; none if that failed. reference: (D,) their
            held-out rms [SI].
    """
    out = [Baseline("best parameter-only refit", reference.tolist())]

    def without(why: str) -> list[Baseline]:
        nan = [float("nan")] * len(forward.components)
        return [*out, Baseline("sparse regression (STLSQ)", nan, why), Baseline("Gaussian process", nan, why)]

    if forward.start != "fit" or not len(forward.model.creases):
        return without("needs recorded coordinates of every crease, and segments with starts of their own")
    parts = folds(forward, range(len(forward.blocks)))
    if not fits:
        return without("needs the model refitted without each fold")
    if len(parts) < 2:
        return without("needs several segments, and frames outside of each fold")
    each = range(len(forward.recordings))
    found = shared([partial(motion, forward, f, r) for f in fits for r in each])  # type: ignore[arg-type]
    moved = [found[k : k + len(each)] for k in range(0, len(found), len(each))]
    if any(m is None for motions in moved for m in motions):
        return without("needs recorded coordinates of every crease, and segments with starts of their own")
    if any(len(next(_samples(forward, m, 0, part))) < FEWEST for m, part in zip(moved, parts, strict=True)):
        return without("needs several segments, and frames outside of each fold")
    learners = {"sparse regression (STLSQ)": _sparse, "Gaussian process": _process}
    pairs = list(zip(parts, moved, strict=True))
    learnt = iter(shared([partial(_learnt, forward, learn, h, m) for learn in learners.values() for h, m in pairs]))
    for name in learners:
        rest, said = [], []
        for held, known in zip(parts, fits, strict=True):  # one after the other: of each fit all cores make a part
            tables, words = next(learnt)
            rest.append(_predict(forward, known, tables, held, weights))
            said.append(words)
        rms = np.full(len(forward.components), np.nan)  # where it cannot be simulated
        if not any(f.failed for f in rest):
            rms = HeldOut.of(forward, parts, [f.residuals for f in rest]).rms
        out.append(Baseline(name, rms.tolist(), said[0]))
    return out


def _learnt(forward: Predictor, learn: Callable, held: list[int], motions) -> tuple[list[tuple], str]:
    """A correction that is learnt outside of segments that are held out, a table for each crease, and in words."""
    tables, said = [], []
    for k in range(len(forward.articulation.creases)):
        a, w, y = _samples(forward, motions, k, held)
        grid_a, grid_w = _range(a), _range(w)
        values, text = learn(a, w, y, np.linspace(*grid_a, KNOTS), np.linspace(*grid_w, KNOTS))
        tables.append((grid_a, grid_w, values))
        said.append(text)
    return tables, "; ".join(said)


def _samples(forward: Predictor, motions, k: int, held: list[int]):
    """Angle, rate and missing moment of the tree's crease k outside the held-out segments."""
    row, parts = 6 * forward.articulation.floating + k, []
    for r, m in enumerate(motions):
        inside = np.zeros(len(m.times), bool)
        for b in held:
            block = forward.blocks[b]
            if block.recording == r:
                t0 = forward.recordings[r].times[block.first]
                inside |= (m.times >= t0) & (m.times <= t0 + block.times[-1])
        if len(motions) == 1:  # also what lies between held-out segments: nothing leaks from a neighbour
            span = m.times[inside]
            inside |= (m.times >= span.min()) & (m.times <= span.max())
        a, w, y = m.q[row], m.rate[row], m.missing[row]
        keep = ~inside & np.isfinite(a + w + y)
        parts.append((a[keep], w[keep], y[keep]))
    return (np.concatenate(p) for p in zip(*parts, strict=True))


def _range(x: np.ndarray) -> tuple[float, float]:
    low, high = np.quantile(x, [0.002, 0.998])
    return float(min(low, -0.02)), float(max(high, 0.02))  # a table needs some width


def _sparse(a, w, y, grid_a, grid_w):
    """Sequentially thresholded least squares over LIBRARY (Brunton, Proctor & Kutz 2016)."""
    names = list(LIBRARY)
    columns = np.stack([LIBRARY[n](a, w) for n in names], axis=1)
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    x = columns / scale
    third = len(y) // 3
    best, error = np.zeros(len(names)), np.inf
    for threshold, ridge in product(THRESHOLDS, RIDGES):
        c = _thresholded(x[third:], y[third:], threshold, ridge)
        e = float(np.mean((y[:third] - x[:third] @ c) ** 2))
        if e < error:
            best, error = _thresholded(x, y, threshold, ridge), e
    mesh_a, mesh_w = np.meshgrid(grid_a, grid_w, indexing="ij")
    table = sum(c / s * LIBRARY[n](mesh_a, mesh_w) for n, c, s in zip(names, best, scale, strict=True))
    used = [f"{c / s:.2g} {n}" for n, c, s in zip(names, best, scale, strict=True) if c]
    return np.broadcast_to(table, mesh_a.shape), " + ".join(used) or "nothing"


def _thresholded(x, y, threshold, ridge):
    keep = np.ones(x.shape[1], bool)
    c = np.zeros(x.shape[1])
    for _ in range(10):
        c[:] = 0.0
        if not np.any(keep):
            break
        some = x[:, keep]
        both = np.concatenate([some, np.sqrt(ridge * len(y)) * np.eye(some.shape[1])])
        c[keep] = np.linalg.lstsq(both, np.append(y, np.zeros(some.shape[1])), rcond=None)[0]
        new = np.abs(c) > threshold * np.abs(c).max()
        if np.array_equal(new, keep):
            break
        keep = new
    return c


def _process(a, w, y, grid_a, grid_w):
    """Posterior mean of a Gaussian process with a squared-exponential kernel; length scales by marginal likelihood."""
    if not y.var():
        return np.zeros((len(grid_a), len(grid_w))), "nothing"
    size = 350
    order = np.argsort(a + 1e-9 * np.arange(len(a)), kind="stable")
    pick = order[np.linspace(0, len(a) - 1, min(size, len(a))).astype(int)]
    # neighbours are averaged, because the noise of a second derivative is large
    spread_a, spread_w = a.std() + 1e-300, w.std() + 1e-300
    points = np.stack([a[pick] / spread_a, w[pick] / spread_w], axis=1)
    everything = np.stack([a / spread_a, w / spread_w], axis=1)
    from scipy.spatial import cKDTree

    owner = cKDTree(points).query(everything)[1]
    number = np.bincount(owner, minlength=len(pick))
    z = np.bincount(owner, weights=y, minlength=len(pick)) / np.maximum(number, 1)
    noise = y.var() / np.maximum(number, 1)
    gap = (points[:, None] - points[None]) ** 2
    best, highest = (1.0, 0.5), -np.inf
    for length in (0.3, 0.6, 1.2, 2.5):
        for part in (0.01, 0.1, 0.3, 1.0):
            k = part * y.var() * np.exp(-0.5 * gap.sum(2) / length**2) + np.diag(noise + 1e-12 * y.var())
            chol = np.linalg.cholesky(k)
            v = np.linalg.solve(chol, z)
            likelihood = -0.5 * v @ v - np.log(np.diag(chol)).sum()
            if likelihood > highest:
                best, highest = (length, part), likelihood
    length, part = best
    k = part * y.var() * np.exp(-0.5 * gap.sum(2) / length**2) + np.diag(noise + 1e-12 * y.var())
    alpha = np.linalg.solve(k, z)
    mesh = np.stack(np.meshgrid(grid_a / spread_a, grid_w / spread_w, indexing="ij"), axis=-1).reshape(-1, 2)
    cross = part * y.var() * np.exp(-0.5 * ((mesh[:, None] - points[None]) ** 2).sum(2) / length**2)
    return (cross @ alpha).reshape(len(grid_a), len(grid_w)), f"length scale {length:g}, {part:.0%} of the variance"


def _predict(forward: Predictor, base: Fit, tables, held: list[int], weights: Weights) -> Fit:
    """Fit of the starts of the held-out segments with the learnt moment in the model."""
    count = len(forward.subject.nominals)
    build = forward.subject.build
    creases = forward.articulation.creases

    def corrected(values):
        model, parameters, drive = build(values)
        richer = model.with_effects("crease_discrepancy")
        out = parameters.for_model(richer)
        for c, (grid_a, grid_w, table) in zip(creases, tables, strict=True):
            for name, value in zip(
                ("angle_low", "angle_high", "rate_low", "rate_high"), (*grid_a, *grid_w), strict=True
            ):
                out.set("crease_discrepancy", name, value, np.array([c]))
            out.set("crease_discrepancy", "missing_moment", table.reshape(1, 1, -1), np.array([c]))
        return richer, out, drive

    other = copy.copy(forward)
    nominals = tuple(
        Free(NOMINAL, f.name, f.unit, t, f.scale) for f, t in zip(base.free[:count], base.theta, strict=False)
    )
    other.subject = Subject(corrected, nominals)
    other._built = {}  # type: ignore[attr-defined]
    given = {"theta": base.theta[:count], "local": base.local, "blocks": held}
    return fit(other, Hypothesis(), weights, fixed=True, **given)
