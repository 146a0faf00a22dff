"""What a diagnosis shows of its fits: candidates, numbers, traces, correlations, the patch."""

import numpy as np

from origami_sim.fit.held_out import HeldOut, folds
from origami_sim.fit.least_squares import OWED, Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.infer.intervals import widened
from origami_sim.infer.posterior import Key, Posterior
from origami_sim.infer.screen import Signature
from origami_sim.infer.unlisted import UNLISTED
from origami_sim.observation.channels import units_of
from origami_sim.report.diagnosis import Candidate, Correlation, Fold, Number, Suspected, Trace
from origami_sim.verdict.decide import log_odds
from origami_sim.verdict.sentences import STRAINED, Judgement


def table(
    forward: Predictor, p: Posterior, base: Fit, judged: Judgement, errors: dict[Key, np.ndarray]
) -> list[Candidate]:
    """All explanations that were fitted, best first, with the reason why each lost; the best fit of each.

    Args:
        errors: (D,) held-out error of each fitted set, estimated.
    """
    out = []
    of = {p.labels(key): key for key in sorted(p.nodes, key=lambda k: p.total[k])}
    for key in of.values():
        node, f = p.nodes[key], widened(p, key)
        out.append(
            Candidate(
                p.label(key) if key else "nominal refitted",
                _kind(f),
                [s.effect for s in f.hypothesis.suspects],
                [s.site for s in f.hypothesis.suspects],
                numbers(f),
                judged.of(key),
                log_odds(p, key),
                errors[key].tolist(),
                fit_percent(forward, node.fit).tolist(),
                why=_why(forward, key, p, judged),
                distrust=_distrust(f),
            )
        )
    for key, why in p.failed.items():
        suspects = [p.suspect(n) for n in key]
        empty = [float("nan")] * len(forward.components)
        effects, sites = [s.effect for s in suspects], [s.site for s in suspects]
        out.append(Candidate(p.label(key), "mechanism", effects, sites, [], 0.0, -np.inf, empty, empty, failed=why))
    return sorted(out, key=lambda c: (-c.probability, -c.odds))


def _why(forward: Predictor, key: Key, p: Posterior, judged: Judgement) -> str:
    """Why a row won or lost, in words."""
    f = p.nodes[key].fit
    if f.hypothesis is judged.best.hypothesis:
        if UNLISTED in f.hypothesis.effects:
            return "no law of the catalogue; its coefficients are in the patch"
        return "closest, but not enough" if judged.verdict in ("UNKNOWN", "UNTESTABLE") else "chosen"
    if any(f.hypothesis is t.hypothesis for t in judged.tied):
        return "not told from the best"
    if not key:
        return "the simplest"
    if key not in judged.chance:
        return "not named: so many laws at once rather imitate another"
    best = next(k for k, n in p.nodes.items() if n.fit.hypothesis is judged.best.hypothesis)
    misses = _squares(forward, f) - _squares(forward, p.nodes[best].fit)
    if misses < OWED:
        return "no better for its further numbers"
    return f"misses the recordings by {misses:.3g} more in squares over the noise"


def _squares(forward: Predictor, f: Fit) -> float:
    """Squares of what a fit misses of the recordings over the noise; gaps between its segments are no data."""
    return float(sum(np.nansum(np.square(r / forward.blocks[0].noise)) for r in f.residuals))


def _distrust(f: Fit) -> str:
    """When not to trust a row."""
    out, own = [], len(f.free) - len(f.hypothesis.free)
    for n, t, b, strain in zip(f.free, f.theta, f.at_bound, f.strain, strict=True):
        if b:
            out.append(f"{n.label} lies on its bound ({t:.3g} {n.unit})")
        elif strain > STRAINED:
            out.append(f"{n.label} left its prior by {strain:.1f} sd")
    strong = {id(n) for s in f.hypothesis.suspects for n in s.strengths}
    for n, t, d in zip(f.free[own:], f.theta[own:], f.deviations()[own:], strict=True):
        if id(n) in strong and abs(t) < 2 * d and n.owner != UNLISTED:
            out.append(f"{n.label} is not told from zero")
    return "; ".join(out)


def numbers(f: Fit) -> list[Number]:
    """Numbers that suspects fix, then fitted ones with 95 % intervals; no coefficients of a moment without a law."""
    given = [Number(f"{s.effect}.{n}", "-", v, v, v, v, 0.0, False) for s in f.hypothesis.suspects for n, v in s.fixed]
    return given + [
        Number(n.label, n.unit, float(t), float(low), float(high), n.start, n.spread, bool(b), float(away), n.nodes)
        for n, t, low, high, away, b in zip(f.free, f.theta, *f.intervals(), f.strain, f.at_bound, strict=True)
        if n.owner != UNLISTED
    ]


def suspected(s: Signature, scores: np.ndarray, total: float) -> Suspected:
    """A suspect in the screening, with that of its strengths which alone explains most of what the base fit misses.

    Args:
        scores: (k,) of its strengths, in standard deviations.
    """
    u, n = s.suspect, int(np.argmax(np.abs(scores)))
    z, norm, size = float(scores[n]), float(s.norm[n]), float(s.size[n])
    strength = z / norm * size if norm > 0 else 0.0
    error = abs(size) / norm if norm > 0 else np.inf
    share = z**2 / total if total > 0 else 0.0
    return Suspected(u.label, u.effect, u.site, u.kind, z, strength, error, u.free[0].unit, share, s.status)


def fit_percent(forward: Predictor, f: Fit) -> np.ndarray:
    """(D,) 100 (1 - NRMSE) [%] over all fitted blocks."""
    values = np.concatenate([forward.blocks[b].values for b in f.blocks])
    spread = np.nanstd(values, axis=0)
    return 100.0 * (1.0 - f.rms() / np.where(spread > 0, spread, np.nan))


def traces(forward: Predictor, given: Fit, base: Fit, best: Fit, noise: np.ndarray) -> list[Trace]:
    """Recorded and predicted components of each recording, segment after segment."""
    out = []
    units = units_of(forward.recordings[0])
    for r, recording in enumerate(forward.recordings):
        mine = [n for n, b in enumerate(base.blocks) if forward.blocks[b].recording == r]
        blocks = [forward.blocks[base.blocks[n]] for n in mine]
        times = np.concatenate([recording.times[b.first] + b.times for b in blocks])
        breaks = np.cumsum([0, *(len(b.times) for b in blocks)])[:-1]
        recorded = np.concatenate([b.values for b in blocks])
        predictions = [
            np.concatenate([b.values - f.residuals[n] for n, b in zip(mine, blocks, strict=True)])
            for f in (given, base, best)
        ]
        left = noise if best.weights is None else best.weights.deviation
        for d, name in enumerate(forward.components):
            out.append(
                Trace(
                    recording.name,
                    name,
                    units[d],
                    float(noise[d]),
                    times.tolist(),
                    recorded[:, d].tolist(),
                    *(p[:, d].tolist() for p in predictions),
                    band=float(2 * left[d]),
                    breaks=breaks.tolist(),
                    by_step=recording.by_step,
                )
            )
    return out


def by_fold(forward: Predictor, given: Fit, refitted: HeldOut, after: HeldOut) -> list[Fold]:
    """Errors by part of the data that was left out; none where nothing else was recorded."""
    parts, out = folds(forward, given.blocks), []
    before = HeldOut.of(forward, parts, [[given.residuals[n] for n in part] for part in parts])
    for n, part in enumerate(parts if len(parts) > 1 else []):
        blocks = [forward.blocks[given.blocks[k]] for k in part]
        names = list(dict.fromkeys(forward.recordings[b.recording].name for b in blocks))
        name = ", ".join(names)
        if len(forward.recordings) == 1:
            times, by_step = forward.recordings[0].times, forward.recordings[0].by_step
            ends = f"{times[blocks[0].first]:.4g} to {times[blocks[-1].first] + blocks[-1].times[-1]:.4g}"
            name += f", load steps {ends}" if by_step else f", {ends} s"
        out.append(Fold(name, *(e.folds[n].tolist() for e in (before, refitted, after))))
    return out


def correlations(forward: Predictor, base: Fit, best: Fit) -> list[Correlation]:
    """Auto- and cross-correlations of the residuals, averaged over segments."""
    out = []
    step = float(np.median(np.diff(forward.recordings[0].times)))
    lags = min(min(len(b.times) for b in forward.blocks) // 2, 200)
    drive, name = varying_drive(forward)
    for d, component in enumerate(forward.components):
        row = Correlation(component, (np.arange(lags) * step).tolist(), [], [], name)
        for f, auto, cross in ((base, row.before, row.cross_before), (best, row.after, row.cross_after)):
            auto += _correlation(f, d, None, lags).tolist()
            cross += _correlation(f, d, _against(forward, f, d, drive), lags).tolist()
        out.append(row)
    return out


def varying_drive(forward: Predictor):
    """Name of the drive channel that varies most; None: nothing varies."""
    spans: dict[str, float] = {}
    for drive, r in zip(forward.drives, forward.recordings, strict=True):
        for name, signal in drive.signals.items():
            values = np.squeeze(signal(r.times - r.times[0]))
            spans[name] = max(spans.get(name, 0.0), float(np.ptp(values)) if values.ndim else 0.0)
    name = max(spans, key=lambda n: spans[n], default="")
    return (name, f"drive {name}") if spans.get(name) else (None, "rate")


def _against(forward: Predictor, f: Fit, d: int, drive: str | None) -> list[np.ndarray]:
    out = []
    for b in f.blocks:
        block = forward.blocks[b]
        if drive is None:
            out.append(np.gradient(np.nan_to_num(block.values[:, d]), block.times))
        else:
            start = (
                forward.recordings[block.recording].times[block.first] - forward.recordings[block.recording].times[0]
            )
            out.append(np.squeeze(forward.drives[block.recording][drive](start + block.times)))
    return out


def _correlation(f: Fit, d: int, other: list[np.ndarray] | None, lags: int) -> np.ndarray:
    total, norm = np.zeros(lags), 0.0
    for n, r in enumerate(f.residuals):
        a = np.nan_to_num(r[:, d] - np.nanmean(r[:, d]))
        b = a if other is None else other[n] - other[n].mean()
        total += [float(a[k:] @ b[: len(b) - k]) for k in range(lags)]
        norm += float(np.sqrt((a @ a) * (b @ b)))
    return total / norm if norm > 0 else total


def patch(best: Fit) -> dict[str, float]:
    """Numbers of the best explanation, by "effect.parameter@entities" or the setting's name."""
    out = {}
    for s in best.hypothesis.suspects:
        where = "" if s.entities is None else "@" + ",".join(map(str, s.entities))
        out |= {f"{s.effect}.{name}{where}": value for name, value in s.fixed}
    for n, t in zip(best.free, best.theta, strict=True):
        if n.recording is not None:
            continue
        where = "" if n.entities is None else "@" + ",".join(map(str, n.entities))
        out[n.label + where] = float(t)
    return out


def _kind(f: Fit) -> str:
    """nominal, mechanism or measurement."""
    kinds = {s.kind for s in f.hypothesis.suspects}
    return "measurement" if kinds == {"measurement"} else "mechanism" if kinds else "nominal"
