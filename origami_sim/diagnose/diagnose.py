"""`diagnose`: from a model and recordings to a verdict, stage by stage."""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from origami_sim.diagnose import verdict as words
from origami_sim.diagnose.acting import acting
from origami_sim.diagnose.baselines import baselines
from origami_sim.diagnose.closed_loop import closed_loop
from origami_sim.diagnose.compare import (
    Score,
    better,
    difference,
    probabilities,
    score,
    supported,
    weights_from,
)
from origami_sim.diagnose.describe import described
from origami_sim.diagnose.diagnosis import Candidate, Correlation, Diagnosis, Number, Suspected, Trace
from origami_sim.diagnose.experiment import propose
from origami_sim.diagnose.forward import Forward, stacked
from origami_sim.diagnose.hypothesis import Hypothesis, Subject, Suspect, suspects
from origami_sim.diagnose.impulses import impulses
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.locate import locate, motions_of
from origami_sim.diagnose.observed import assumed, unobserved
from origami_sim.diagnose.prescribed import curves
from origami_sim.diagnose.refit import LITTLE, Fit, Weights, carried_on, fit, promised
from origami_sim.diagnose.screen import Projector, Screening, Signature, again, reweighted, screen, widening
from origami_sim.diagnose.static import CurveForward
from origami_sim.diagnose.subject import Source, subject_of
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.recording import Recording, read_dataset
from origami_sim.solve.timestep import stable_step


@dataclass(frozen=True)
class Options:
    """How thoroughly to look; the defaults keep the promise of a minute for four panels and ten seconds.

    Attributes:
        segment: length of a segment [s], each with a start of its own; None: chosen from how fast starts are forgotten
            or amplified.
        start: "fit", "rest" or None (rest if the recording starts at rest in the reference state).
        rate: frames per second that are compared; the recording is thinned to it.
        steps: solver steps that one pass over the data may take; longer recordings are sampled evenly.
        screened: segments that the screening uses at most.
        finalists: suspects that are refitted. most: effects that may be combined.
        significance, level: of the look-elsewhere tests, against noise and against effects too small to be told.
        seed: of the null draws. threads: see `Batch`.
    """

    segment: float | None = None
    start: str | None = None
    rate: float = 200.0
    steps: int = 150_000
    screened: int = 8
    finalists: int = 6
    most: int = 3
    significance: float = 0.05
    level: float = 0.05
    draws: int = 999
    seed: int = 0
    threads: int | None = None


GROWTH = 30.0
"""Growth of a difference in the start beyond which a segment is cut: below the time in which chaos takes over."""

FRAMES = 400
"""Frames of a recording that are compared at least, if it has as many."""

FEWEST = 8
"""Segments that a single recording is cut into at least, where its start is fitted, for held-out scores."""

Report = Callable[[str, float], None]


def diagnose(
    subject: Source,
    recordings: Sequence[Recording | str | Path] | Recording | str | Path,
    options: Options | None = None,
    *,
    catalogue: Sequence[str] | None = None,
    priors: Mapping[str, float | str] | None = None,
    progress: Report | None = None,
    keep: Keep | None = None,
) -> Diagnosis:
    """Locates the mismatch between a model and recordings of one object, and says what it is.

    Args:
        subject: the model and what is uncertain in it; or a scene, or (model, parameters), see `subject_of`.
        recordings: of one object, with their drives; or their files.
        options: see `Options`. catalogue: suspect only these effects (default: all that can act).
        priors: standard deviations of the model's numbers, see `subject_of`.
        progress: called with the stage and the fraction done.
        keep: remembers predictions, so that an interrupted diagnosis resumes, and the fits.

    Raises:
        InputError: no recording, a file that cannot be read, recordings of different channels, too few frames, a drive
            that the model does not know.
    """
    o = options or Options()
    tell = progress or (lambda stage, part: None)
    seconds: dict[str, float] = {}
    began = clock.perf_counter()

    def lap(stage: str):
        seconds[stage] = clock.perf_counter() - began - sum(seconds.values())

    tell("prepare", 0.0)
    subject = subject_of(subject, priors)
    each = [recordings] if isinstance(recordings, (Recording, str, Path)) else recordings
    recordings = prepared([r for s in each for r in ([s] if isinstance(s, Recording) else read_dataset(s))], o.rate)
    forward = arranged(subject, recordings, o)
    forward.soften()
    if keep is not None:
        keep.follow(forward)
    loop = closed_loop(recordings)
    noted = [n for r in recordings for n in [*r.metadata.get("notes", []), *assumed(r, forward.drive)]]
    noted = list(dict.fromkeys(noted))
    unseen = unobserved(forward)
    if unseen is not None:
        noted.append(unseen)
    tell("nominal", 0.0)
    given, base, weights = nominal_fits(forward)
    first = weights
    lap("nominal")
    tell("screen", 0.0)
    every = forward.admitted(suspects(forward.model, recordings, _union(forward), forward.parameters))
    if catalogue is not None:
        every = among(every, catalogue)
        idle = sorted({get(n).name for n in catalogue} - {s.effect for s in every})
        if idle:
            noted.append(
                f"Not suspected, as it cannot act on this device or show in these recordings: {', '.join(idle)}."
            )
    screening = screen(forward, every, base, weights, most=o.screened, progress=lambda part: tell("screen", part))
    lap("screen")
    tell("locate", 0.0)
    motions = [] if isinstance(forward, CurveForward) else motions_of(forward, base)
    places = forward.locate(base) if isinstance(forward, CurveForward) else locate(forward, motions)
    actions = acting(forward.articulation, motions)
    lap("locate")
    finalists = chosen(screening, o.finalists)
    fits = contest(forward, base, finalists, screening, weights, lambda part: tell("refit", part))
    fits += unbent(forward, base, every, fits, weights, o)
    fits += pairs(forward, base, screening, fits, weights, o)
    rough, seen = screening, (base, screening, weights)
    screening, fits, weights = settled(forward, rough, fits, weights)
    refined = tuple(fits)
    alike_ones = twins(forward, rough, screening, fits, weights)
    alike_ones += lookalikes(forward, every, screening, [*fits, *alike_ones], weights)
    fits = [*{f.hypothesis.label: f for f in [*fits, *alike_ones]}.values()]  # what was fitted anew instead of before
    # with weights that do not count the effect itself as noise
    p_value = look_elsewhere(screening, o.draws, o.seed, fits)
    p_small = look_elsewhere(screening, o.draws, o.seed, fits, small=words.SMALL)
    lap("refit")
    tell("combine", 0.0)
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    more = combine(forward, fits, scores, screening, weights, o, tell)
    if alike_ones or more:
        screening, fits, weights = settled(forward, screening, [*fits, *more], weights, refined)
    rest = others(forward, seen, fits, weights, tell)
    if rest:
        noted.append("No suspect that stood out left noise alone, so that all that show were fitted.")
        screening, fits, weights = settled(forward, screening, [*fits, *rest], weights, tuple(fits))
    fits = [f if f.failed else replace(f, wider=widened(forward, screening, f, weights)) for f in fits]
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    base = fits[0]
    best = leader(fits, scores)
    noise = words.floor_of(forward, base if best is None else best)
    lap("combine")
    tell("verdict", 0.0)
    given = carried_on(forward, given.reweighted(first, weights), weights, fixed=True)
    judged = words.judge(forward, given, base, noise, fits, scores, screening, (p_value, p_small), weights, o)
    if loop is not None:
        judged = replace(judged, verdict="UNTESTABLE", sentence=loop.sentence, probability=1.0, chosen=[], best=base)
    best = judged.best
    if judged.verdict == "UNKNOWN":
        judged = replace(judged, sentence=f"{judged.sentence} {unnamed(forward, base, best)}".strip())
    if keep is not None:
        keep.fits = {"before": given, "refitted": base, "after": best}
    experiments = propose(forward, judged, weights, progress=lambda part: tell("next experiment", part))
    lap("next experiment")
    tell("baselines", 0.0)
    beside = baselines(forward, base, weights, scores[id(base)])
    lap("baselines")
    candidates = table(forward, given, fits, scores, judged, screening)
    after = scores[id(best)]
    out = Diagnosis(
        verdict=judged.verdict,
        sentence=judged.sentence,
        probability=judged.probability,
        chosen=judged.chosen,
        candidates=candidates,
        screening=[_suspected(s, screening) for s in (*screening.signatures, *screening.untestable)],
        isolability_labels=[s.suspect.label for s in screening.signatures[:12]],
        isolability=screening.overlap()[:12, :12].tolist(),
        places=places,
        p_value=p_value,
        p_small=p_small,
        structure=judged.structure,
        onset=judged.onset,
        traces=traces(forward, given, base, best, weights, noise),
        correlations=correlations(forward, base, best),
        experiments=experiments,
        baselines=beside,
        components=list(forward.components),
        units=_units(recordings[0]),
        noise=noise.tolist(),
        error_before=_rms(given).tolist(),
        error_refitted=scores[id(base)].rms.tolist(),
        error_after=after.rms.tolist(),
        notes=[*judged.notes, *noted],
        settings={**{k: v for k, v in o.__dict__.items()}, "segments": len(forward.blocks), "start": forward.start},
        seconds=seconds,
        patch=patch(best),
        changed=[e for e in best.hypothesis.effects if e in forward.model.effects],
        subject=subject.name,
        recordings=[r.name for r in recordings],
        impulses=[] if isinstance(forward, CurveForward) else impulses(forward, base),
        acting=actions,
    )
    tell("done", 1.0)
    return out


# --- preparation


def among(every: Sequence[Suspect], catalogue: Sequence[str]) -> list[Suspect]:
    """The suspects of some effects.

    Raises:
        InputError: an effect that the catalogue lacks; effects of which none can act here.
    """
    wanted = {get(n).name for n in catalogue}
    out = [s for s in every if s.effect in wanted]
    if not out:
        raise InputError(
            "none of these can act on this device, or show in these recordings",
            field="suspects",
            value=", ".join(sorted(wanted)),
            allowed=", ".join(sorted({s.effect for s in every})),
        )
    return out


def prepared(recordings: Sequence[Recording], rate: float) -> list[Recording]:
    """The recordings, thinned to about `rate` frames per second, but to no fewer than FRAMES frames.

    Raises:
        InputError: none, different channels, too few frames.
    """
    if not recordings:
        raise InputError("there is nothing to diagnose", field="recordings", value=0, allowed="at least one recording")
    names = list(recordings[0].channels)
    out = []
    for r in recordings:
        if list(r.channels) != names:
            raise InputError(
                "recordings of one object need the same channels",
                field=f"{r.name}.channels",
                value=", ".join(r.channels),
                allowed=", ".join(names),
            )
        fewest = 8 if r.by_step else 16
        if len(r.times) < fewest:
            raise InputError(
                "a recording is too short for a diagnosis",
                field=f"{r.name}.frames",
                value=len(r.times),
                allowed=f"at least {fewest}",
            )
        every = int(1.0 / float(np.median(np.diff(r.times))) / rate + 1e-6)
        out.append(thinned(r, max(1, min(every, len(r.times) // FRAMES))))
    return out


def thinned(recording: Recording, every: int) -> Recording:
    """Every so-manieth frame."""
    if every <= 1:
        return recording
    cut = slice(None, None, every)
    return replace(
        recording,
        times=recording.times[cut],
        channels={n: replace(c, values=c.values[cut]) for n, c in recording.channels.items()},
        drive={
            n: d if d.constant or d.times is not None else replace(d, values=d.values[cut])
            for n, d in recording.drive.items()
        },
    )


def arranged(subject: Subject, recordings: list[Recording], o: Options) -> Forward:
    """Segments that are short enough to be predictable, and start modes; for curves, what predicts them."""
    curve = curves(subject, recordings, o.threads)
    if curve is not None:
        return curve
    whole = max(float(r.times[-1] - r.times[0]) for r in recordings)
    shortest = 8 * max(float(np.median(np.diff(r.times))) for r in recordings)
    if o.segment is not None and not shortest <= o.segment < np.inf:
        raise InputError(
            "a segment needs frames to be compared", field="segment", value=o.segment, allowed=f">= {shortest:.3g} s"
        )
    start = o.start or ("fit" if o.segment is not None else starting(subject, recordings))
    if start == "rest":  # later segments would not begin there
        return Forward(subject, recordings, start="rest", threads=o.threads)
    step = stable_step(*subject.build({f.name: f.start for f in subject.nominals})[:2]).dt
    step = min(step, float(np.median(np.diff(recordings[0].times))))  # without stiffness any step is stable
    length = o.segment
    if length is None:
        count = FEWEST if len(recordings) == 1 else max(1, FEWEST // len(recordings))
        length = min(whole / count, max(o.steps * step / FEWEST, whole / 100))
        length = min(length, predictable(Forward(subject, recordings, segment=length, most=4, threads=o.threads)))
    most = max(FEWEST, int(o.steps * step / length)) // len(recordings)
    return Forward(subject, recordings, segment=length, start="fit", most=max(1, most), threads=o.threads)


def starting(subject: Subject, recordings: list[Recording]) -> str:
    """ "rest" if all recordings begin at rest in the reference state, else "fit"."""
    probe = Forward(subject, recordings, start="rest")
    for index, recording in enumerate(recordings):
        values, noise = stacked(recording)
        block = next(b for b in probe.blocks if b.recording == index)
        head = slice(0, max(4, len(values) // 100))
        now, _ = probe._channel_tangent(recording, block.pose, values[0])
        # a start on the ground is better guessed than fitted: where feet touch turns on micrometres
        standing = probe.articulation.floating and len(probe.model.contacts) and len(set(_units(recording))) == 1
        if standing and len(values) >= 4 * words.WINDOW:  # a tracker that smooths hides its noise from the next frames
            noise = np.maximum(noise, np.sqrt(np.nan_to_num(np.nanmedian(words.scatter(values), axis=0))))
        with np.errstate(invalid="ignore"):
            away = np.nanmedian(values[head], axis=0) - now
            drift = np.nanstd(values[head], axis=0)
        scale = np.maximum(np.nanstd(values, axis=0), 5 * noise)
        moves = np.hypot(np.maximum(0.2 * scale, 0.05 * scale.max()), 3 * noise) if standing else 0.2 * scale
        if np.any(np.abs(away) > np.maximum(0.05 * scale, 5 * noise)) or np.any(drift > moves):
            return "fit" if probe.articulation.size else "rest"
    return "rest"


def predictable(forward: Forward) -> float:
    """Time over which a difference in the start grows less than GROWTH times [s]."""
    m = forward.local
    local = np.zeros((m + 1, len(forward.blocks), m))
    for k in range(m):
        local[1 + k, :, k] = 1e-6 if k < m // 2 else 1e-5
    theta = np.array([f.start for f in forward.subject.nominals])
    predicted = forward.predict(Hypothesis(), [theta] * (m + 1), local)
    shortest = np.inf
    for block, values in zip(forward.blocks, predicted, strict=True):
        moved = np.linalg.norm(np.nan_to_num(values[1:] - values[0], nan=np.inf), axis=2)  # [m, n]
        early = np.maximum.accumulate(moved, axis=1)
        first = np.maximum(early[:, max(2, len(block.times) // 20)], 1e-9)
        beyond = np.any(moved > GROWTH * first[:, None], axis=0)
        shortest = min(shortest, block.times[np.argmax(beyond)] if np.any(beyond) else block.times[-1] + 1e-9)
    return max(float(shortest), 8 * float(np.median(np.diff(forward.recordings[0].times))))


def _union(forward: Forward):
    """A drive in which everything is switched on that is in any recording's."""
    return forward._drives[0]


# --- stages


def nominal_fits(forward: Forward) -> tuple[Fit, Fit, Weights]:
    """The nominal model as given (only starts fitted) and refitted, and the weights."""
    noise = forward.blocks[0].noise
    theta = np.array([f.start for f in forward.subject.nominals])
    rough = forward.predict(Hypothesis(), theta[None], np.zeros((1, len(forward.blocks), forward.local)))
    gaps = [b.values - v[0] for b, v in zip(forward.blocks, rough, strict=True)]
    if any(np.any(np.isnan(v[0])) for v in rough):
        raise InputError(
            "the nominal model goes unstable on this recording", field="model", allowed="a model that can be simulated"
        )
    rms = np.sqrt(np.nanmean(np.concatenate(gaps) ** 2, axis=0))
    w = first = Weights(np.maximum(rms, noise), 0.1)
    given = base = fit(forward, Hypothesis(), w, fixed=True, most=3, done=0.01)
    for n in range(3):
        if base.failed:
            break
        new = weights_from(forward, [base])
        if n and np.all(np.abs(np.log(new.deviation / w.deviation)) < 0.1) and abs(np.log(new.part / w.part)) < 0.3:
            break
        known = None if base.linear is None else base.linear.reweighted(w, new)
        w, kept = new, len(theta) if n else 0
        base = fit(
            forward, Hypothesis(), w, theta=base.theta, local=base.local, most=5, done=0.01, known=known, kept=kept
        )
    if not base.failed:
        base = carried_on(forward, base, w)
    if base.failed:
        raise InputError(f"the nominal model cannot be fitted: {base.failed}", field="model")
    return given.reweighted(first, w), base, w


def look_elsewhere(screening: Screening, draws: int, seed: int, fits: Sequence[Fit] = (), *, small: int = 0) -> float:
    """Chance that noise alone gives any suspect so high a score: draws of white residuals, the same projection.

    Args:
        small: so many suspects, drawn at random, act with a score of `words.SHOWN` each beside the noise.
        fits: the model without an effect, then those with one; what they gain counts if it is more than the screening
            saw, which knows small effects only.
    """
    if not screening.signatures:
        return 1.0
    shapes = np.stack([s.shape for s in screening.signatures])
    rng = np.random.default_rng(seed)
    # the scores of white noise have the covariance of the signatures' overlaps
    overlap = shapes @ shapes.T
    value, vector = np.linalg.eigh(overlap)
    draws_ = rng.normal(size=(draws, len(value))) * np.sqrt(np.maximum(value, 0.0)) @ vector.T
    for _ in range(small):
        sign = rng.choice([-words.SHOWN, words.SHOWN], size=(draws, 1))
        draws_ += sign * overlap[rng.integers(len(overlap), size=draws)]
    highest = np.abs(draws_).max(axis=1)
    found = max(abs(s.score) for s in screening.signatures)
    for f in fits[1:]:
        if not f.failed and len(f.hypothesis.suspects) == 1:
            gain = fits[0].cost - f.cost - 2.0 * (len(f.hypothesis.free) - 1)
            found = max(found, np.sqrt(max(gain, 0.0)))
    return float((1 + np.count_nonzero(highest >= found)) / (draws + 1))


FAR = 4.0
"""Standard deviations from what was recorded beyond which a fitted start makes up for what the model lacks."""


def unbent(
    forward: Forward, base: Fit, every: Sequence[Suspect], fits: Sequence[Fit], weights: Weights, o: Options
) -> list[Fit]:
    """The suspects that stand out where starts that were bent to make up for them are put back, fitted from there.

    Seen from a bent start, an effect can have the wrong sign.
    """
    if not forward.local:
        return []
    far = bent(forward, base, FAR)
    if not len(far):
        return []
    local = base.local.copy()
    local[far] = forward.told(base.hypothesis, base.theta)[far]
    back = fit(forward, base.hypothesis, weights, theta=base.theta, local=local, most=0)
    if back.failed:
        return []
    seen = screen(forward, every, back, weights, most=o.screened)
    known = {f.hypothesis.label for f in fits}
    return [
        refit(forward, back, s, weights, seen, most=8) for s in chosen(seen, UNBENT) if s.suspect.label not in known
    ]


def bent(forward: Forward, f: Fit, by: float = 1.0) -> list[int]:
    """The blocks whose fitted start is further from what was recorded than so many of its standard deviations."""
    if not forward.local:
        return []
    away = np.abs(f.local - forward.told(f.hypothesis, f.theta))
    return [b for b in f.blocks if np.any(away[b] > by * forward.blocks[b].known)]


UNBENT = 3
"""How many of these are fitted."""

TWINS = 5
"""Suspects that look the same as the best explanation and are fitted beside it, at most."""


def alike(a: Signature, b: Signature) -> bool:
    """Whether these recordings cannot tell two suspects apart, by less than half a unit of log likelihood."""
    strength = max(abs(a.score), abs(b.score), 1.0)
    return 1.0 - float(a.shape @ b.shape) ** 2 < 1.0 / strength**2


def chosen(screening: Screening, most: int) -> list[Signature]:
    """The best suspects, at most so many; of those that look the same, the best only."""
    out: list[Signature] = []
    for s in distinct(screening.signatures):
        if len(out) >= most or abs(s.score) < 2.0:
            break
        if not any(alike(s, t) for t in out):
            out.append(s)
    return out


def distinct(found: Sequence[Signature]) -> list[Signature]:
    """Of signatures of one suspect, with several time constants, the first."""
    first: dict[str, Signature] = {}
    for s in found:
        first.setdefault(s.suspect.label, s)
    return list(first.values())


def twins(forward: Forward, rough: Screening, screening: Screening, fits: Sequence[Fit], weights: Weights) -> list[Fit]:
    """The single suspects that looked the same as the best of those that were fitted, fitted as well.

    Args:
        rough: the screening by which fits were chosen, whose weights may have hidden differences. screening: the same
            with the present weights.
    """
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    good = [f for f in fits if id(f) in scores]
    evidence = supported(good, scores)
    near = [f for f, e in zip(good, evidence, strict=True) if e > max(evidence) - words.CLOSE]
    done = {f.hypothesis.label for f in fits}
    best = [s for f in near for s in rough.signatures if f.hypothesis.label == s.suspect.label]
    same = {s.suspect.label for s in rough.signatures for m in best if s.score and alike(s, m)} - done
    again = [s for s in distinct(screening.signatures) if s.suspect.label in same]
    return [refit(forward, fits[0], s, weights, screening) for s in again[:TWINS]]


LOOKALIKE = 0.9
"""Isolability from which a suspect is fitted as a lookalike."""

LINEAR = 0.5
"""Part of a fit's gain that its signature promised, from which on signatures tell what looks the same."""


def lookalikes(
    forward: Forward, every: Sequence[Suspect], screening: Screening, fits: Sequence[Fit], weights: Weights
) -> list[Fit]:
    """The suspects that look the same as the best single explanation where that was fitted, fitted from there.

    Those, too, that were fitted from elsewhere and ended far from it, if they end nearer now. Where its effect is
    large, what starts and numbers make up for without it is, too: seen from there, two suspects that are the same (a
    clock and a drive that are late) can look different. They are compared in one segment.
    """
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    base, best = fits[0], leader(fits, scores)
    if best is None or len(best.hypothesis.suspects) != 1 or isinstance(forward, CurveForward):
        return []
    label, own = best.hypothesis.label, len(base.free)
    seen = max((g.score**2 for g in screening.signatures if g.suspect.label == label), default=0.0)
    if seen > LINEAR * (base.cost - best.cost):
        return []
    assert best.linear is not None
    effect = [best.linear.clear(n, t[:, own]) for n, t in enumerate(best.linear.tangent)]
    n = max(range(len(effect)), key=lambda n: effect[n] @ effect[n])
    part = best.only([best.blocks[n]])
    done = {f.hypothesis.label for f in fits if f is best or min(f.cost, f.promise) < best.cost + words.CLOSE}
    at_fit = screen(forward, [s for s in every if s.label not in done], part, weights)
    assert part.linear is not None
    line = part.linear.beside([np.zeros((len(t), 0)) for t in part.linear.tangent], own)
    project = Projector(replace(part, free=base.free, linear=line), part.blocks)
    mine = project([part.linear.tangent[0][part.linear.data(0), own]])
    strength = (best.theta[own] - best.free[own].start) / best.free[own].scale
    found = []
    for g in (*at_fit.signatures, *at_fit.untestable):
        theirs = project(g.parts) if g.parts else np.zeros(len(mine))
        same = float(mine @ theirs / max(np.linalg.norm(mine) * np.linalg.norm(theirs), 1e-300))
        if abs(same) < LOOKALIKE:
            continue
        first = g.suspect.free[0]
        value = first.start + strength * float(mine @ theirs) / float(theirs @ theirs) * g.size
        if first.lower <= value <= first.upper:
            found.append((abs(same), g.suspect, value))
    most: dict[str, tuple[Suspect, float]] = {}
    for _, s, value in sorted(found, key=lambda f: -f[0]):
        most.setdefault(s.label, (s, value))
    out = []
    for s, value in list(most.values())[:TWINS]:
        begin = np.concatenate([best.theta[:own], [value], [f.start for f in s.free[1:]]])
        near = {"theta": begin, "local": best.local, "blocks": best.blocks, "known": best.linear, "kept": own}
        f = fit(forward, base.hypothesis.plus(s), weights, rough=True, **near)
        f = finished(forward, f, weights) if min(f.cost, f.promise) < best.cost + NEAR else f
        if all(g.cost > f.cost for g in fits if g.hypothesis.label == f.hypothesis.label):
            out.append(f)
    return out


MANY = 6
"""Suspects that are fitted to all recordings where none leaves noise alone."""


def others(
    forward: Forward, seen: tuple[Fit, Screening, Weights], fits: Sequence[Fit], weights: Weights, tell: Report
) -> list[Fit]:
    """Where the best explanation leaves structure: the best of all suspects that were not fitted alone, fitted as well.

    A screening knows small changes only, and is no reason to refuse a suspect where what is missing is large. All are
    fitted to the segment that the model without an effect misses most, and those that explain most of it to all.

    Args:
        seen: the model without an effect, the screening about it, and their weights. weights: those of the fits.
    """
    base, screening, old = seen
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    best = leader(fits, scores)
    if best is None or not words.lacking(fits[0], best):
        return []
    done = {f.hypothesis.label for f in fits}
    rest = [s for s in distinct(screening.signatures) if abs(s.score) >= 2.0 and s.suspect.label not in done]
    assert base.linear is not None
    missed = [r @ r for r in base.linear.residual]
    worst = max(range(len(screening.blocks)), key=lambda n: missed[base.blocks.index(screening.blocks[n])])
    block, tried = [screening.blocks[worst]], []
    part, seen_there = base.only(block), replace(screening, blocks=block)
    for n, s in enumerate(rest):
        tell("other suspects", 0.8 * n / len(rest))
        tried.append(roughly(forward, part, s.only(worst), old, seen_there))
    good = sorted((f for f in tried if not f.failed), key=lambda f: min(f.cost, f.promise))[:MANY]
    out = []
    for n, f in enumerate(good):
        tell("other suspects", 0.8 + 0.2 * n / len(good))
        given = {"theta": f.theta, "local": base.local, "known": base.linear, "kept": len(base.free)}
        out.append(finished(forward, fit(forward, f.hypothesis, old, rough=True, **given), old))
    return [f.reweighted(old, weights) for f in out if not f.failed]


def widened(forward: Forward, screening: Screening, f: Fit, weights: Weights) -> np.ndarray:
    """How effects that are too small to be told widen a fit's intervals (P,); less where a fit leaves more than noise.

    What is left already counts as noise in the weights.
    """
    noise = np.minimum(forward.blocks[0].noise / weights.deviation, 1.0)
    return widening(screening, f, words.ALLOWED * float(np.mean(noise**2)) * weights.part)


HOPELESS = 4.0
"""How many times the cost of the best fit one may have that is refined."""

CONTENDERS = 5
"""Fits that are refined, beside the model without any effect."""

AGAIN = 2
"""Of these, how many are also fitted anew from the starts that were recorded."""


def settled(
    forward: Forward, screening: Screening, fits: list[Fit], weights: Weights, refined: Sequence[Fit] = ()
) -> tuple[Screening, list[Fit], Weights]:
    """The fits with the weights of the best one, which first counted what it lacks as noise; the best ones refined.

    Args:
        refined: fits that have been, with the weights given.
    """
    new = weights_from(forward, fits)
    same = np.all(np.abs(np.log(new.deviation / weights.deviation)) < 0.05)
    if same and abs(np.log(new.part / weights.part)) < 0.2:
        new = weights
    out = [f if f.failed else f.reweighted(weights, new) for f in fits]
    least = min(f.cost for f in out)
    order = [n for n, f in enumerate(out) if n and not f.failed and f.cost < HOPELESS * least]
    order.sort(key=lambda n: out[n].cost)
    for place, n in enumerate([0, *order[:CONTENDERS]]):
        f = out[n]
        if new is weights and any(fits[n] is r for r in refined):
            continue
        if n and f.cost > least + NEAR and promised(forward, f) > least + NEAR:
            continue
        out[n] = carried_on(forward, f, new)
        if new is not weights and place <= AGAIN and bent(forward, out[n]) and f.cost < HOPELESS * least:
            # starts that made up for what the model lacked can be far off: those that were recorded are tried as well
            near = {"known": out[n].linear, "kept": len(forward.subject.nominals) if n else 0}
            other = fit(forward, f.hypothesis, new, theta=f.theta, blocks=f.blocks, **near)
            if other.cost < out[n].cost - LITTLE:
                out[n] = carried_on(forward, other, new)
    return reweighted(screening, out[0], weights, new), out, new


HOPE, NEAR = 0.5, 50.0
"""A rough fit is carried on if it gains, or promises, this part of what the best one gains, or all but so much cost."""


def contest(
    forward: Forward,
    base: Fit,
    finalists: Sequence[Signature],
    screening: Screening,
    weights: Weights,
    tell: Callable[[float], None] = lambda part: None,
) -> list[Fit]:
    """A fit, and that with each finalist more; those that neither are nor promise to be good stay rough."""
    fits = [base]
    for n, s in enumerate(finalists):
        tell(0.5 * n / len(finalists))
        fits.append(roughly(forward, base, s, weights, screening))
    gain = base.cost - min(f.cost for f in fits)
    enough = base.cost - min(HOPE * gain, gain - NEAR)
    for n, f in enumerate(fits):
        tell(0.5 + 0.5 * n / len(fits))
        if n and min(f.cost, f.promise) <= enough:
            fits[n] = finished(forward, f, weights)
    return fits


SHAPES = (0.3, 3.0)
"""Factors on the typical value of a suspect's second number (a time, an angle) from which fits begin as well."""


def refit(forward: Forward, base: Fit, found: Signature, weights: Weights, screening: Screening, most: int = 5) -> Fit:
    """The nominal model with one more suspect: from the fit without it and its signature, which cannot become worse."""
    return finished(forward, roughly(forward, base, found, weights, screening, most), weights, most)


def finished(forward: Forward, f: Fit, weights: Weights, most: int = 5) -> Fit:
    """A rough fit, carried on with derivatives of its own."""
    if f.failed or f.promise == np.inf:
        return f
    return carried_on(forward, f, weights, most=most)


def roughly(
    forward: Forward, base: Fit, found: Signature, weights: Weights, screening: Screening, most: int = 5
) -> Fit:
    """The same, with the derivatives by nominals and starts that the fit without the suspect had.

    Of a suspect with a second number, which sets the shape of its signature, several values are tried.
    """
    s = found.suspect
    begin = None
    if list(base.blocks) == screening.blocks and found.parts:
        assert base.linear is not None
        unit = s.free[0].scale / found.size
        rest = len(s.free) - 1
        parts = [base.linear.below(n, p) for n, p in enumerate(found.parts)]
        columns = [np.concatenate([unit * p[:, None], np.zeros((len(p), rest))], axis=1) for p in parts]
        begin = base.linear.beside(columns, len(base.free))

    def fitted(second: float, begin) -> Fit:
        values = [f.start for f in s.free]
        if len(values) > 1:
            values[1] = float(np.clip(second * values[1], s.free[1].lower, s.free[1].upper))
        return fit(
            forward,
            base.hypothesis.plus(s),
            weights,
            theta=np.concatenate([base.theta, values]),
            local=base.local,
            blocks=base.blocks,
            most=most,
            known=base.linear,
            kept=len(base.free),
            begin=begin,
            rough=True,
        )

    tried = [fitted(1.0, begin)]
    if len(s.free) > 1:
        tried += [fitted(part, None) for part in SHAPES]
    return min(tried, key=lambda f: f.cost)


def pairs(forward, base: Fit, screening: Screening, fits: list[Fit], weights: Weights, o: Options) -> list[Fit]:
    """The best pair of suspects by the screening, if it promises much more than the best single one gives.

    What they promise is measured by the noise alone: in the weights of the model without them, they are noise.
    """
    if o.most < 2:
        return []
    sharp = Weights(forward.blocks[0].noise)
    plain = base.reweighted(weights, sharp)
    seen = reweighted(screening, plain, weights, sharp)
    r, top = seen.residual, distinct(seen.signatures)[:12]

    def missed(f: Fit) -> float:
        """What a fit misses of the screened blocks."""
        line = f.reweighted(weights, sharp).linear
        assert line is not None
        return float(sum(line.residual[f.blocks.index(b)] @ line.residual[f.blocks.index(b)] for b in seen.blocks))

    gains = {f.hypothesis.label: missed(base) - missed(f) for f in fits if not f.failed}
    single = max([*(s.score**2 for s in top), *gains.values()])
    best, most = None, 0.0
    for a, b in combinations(top, 2):
        both = np.stack([a.shape, b.shape], axis=1)
        if abs(a.shape @ b.shape) > 0.95 or min(abs(a.score), abs(b.score)) < 2.0:
            continue
        x, *_ = np.linalg.lstsq(both, r, rcond=None)
        if np.sign(x[0]) != np.sign(a.score) or np.sign(x[1]) != np.sign(b.score):
            continue
        # fits gain other amounts than signatures promise, for which strengths are small
        more = max(gains.get(s.suspect.label, 0.0) / s.score**2 for s in (a, b))
        explained = float(np.sum((both @ x) ** 2)) * float(np.clip(more, 1.0, MORE))
        if explained > most:
            best, most = (a, b), explained
    if best is None or most - single < 9.0 + 0.1 * single:
        return []
    first, second = (_counterpart(screening, s) for s in best)
    known = [f for f in fits if f.hypothesis.suspects == (first.suspect,)]
    one = known[0] if known else refit(forward, base, first, weights, screening)
    if one.failed:
        return []
    both = refit(forward, one, second, weights, screening)
    return [both] if known else [one, both]


MORE = 4.0
"""Times as much as a signature promises that a fit is thought to gain, at most."""


def _counterpart(screening: Screening, found: Signature) -> Signature:
    """The same signature in other weights, in which it may not stand out enough to be tested."""

    def key(s: Suspect):
        return s.label, tuple(n.start for n in s.free[1:])

    return next(s for s in (*screening.signatures, *screening.untestable) if key(s.suspect) == key(found.suspect))


def combine(forward, fits, scores, screening: Screening, weights, o: Options, tell) -> list[Fit]:
    """Adds effects to the best explanation while held-out data ask for it, and exchanges each of several."""
    more: list[Fit] = []
    base, best, asked, exchanged, extended = fits[0], leader(fits, scores), True, set(), set()
    while best is not None and best is not base:
        several = len(best.hypothesis.suspects)
        tell("combine", several / (o.most + 1))
        if several > 1 and id(best) not in exchanged:  # what stands in for another may ask for a further effect
            exchanged.add(id(best))
            more += swaps(forward, base, best, [*fits, *more], scores, screening, weights)
            more += spared(forward, [*fits, *more], scores, weights)
            best = leader([*fits, *more], scores)
        elif asked and several < o.most and id(best) not in extended:
            extended.add(id(best))
            tried, told = further(forward, best, [*fits, *more], scores, screening, weights, o)
            more += tried
            asked, best = told is not None, told or leader([*fits, *more], scores)
        else:
            break
    return more


def further(
    forward, best: Fit, fits, scores, screening: Screening, weights, o: Options
) -> tuple[list[Fit], Fit | None]:
    """New fits of the best explanation and one effect more; of all such, the one that held-out data ask for."""
    base = fits[0]
    left = again(screening, best, without=best.hypothesis.effects)
    if not left.signatures:
        return [], None
    top, found = left.signatures[0], distinct(left.signatures)
    structured = words.structure(best, best).repeated >= words.STRUCTURED
    inexact = top.score**2 < words.INEXACT * (base.cost - best.cost)
    told = look_elsewhere(left, o.draws, o.seed, small=words.SMALL) <= o.level and not inexact
    if told:  # at other sites, too
        found = [g for g in found if g.suspect.effect == top.suspect.effect and g.score**2 > 0.7 * top.score**2]
    elif not structured:
        return [], None
    made = {g.suspect.label: _made(fits, (*best.hypothesis.suspects, g.suspect)) for g in found[:RIVALS]}
    new = contest(forward, best, [g for g in found[:RIVALS] if not made[g.suspect.label]], screening, weights)[1:]
    new = [f for f in new if not f.failed]
    tried = [*new, *(f for f in made.values() if f is not None and not f.failed)]
    if not tried:
        return [], None
    scores |= {id(f): score(forward, f, weights) for f in new}
    f = max(tried, key=lambda f: scores[id(f)].evidence)
    if told:
        told = better(scores[id(f)], scores[id(best)])
    else:
        told = stands_out(forward, base, best, f, screening, weights, o)
    return new, f if told else None


RIVALS = 3
"""Further effects that are tried at a time."""


def stands_out(
    forward: Forward, base: Fit, best: Fit, f: Fit, screening: Screening, weights: Weights, o: Options
) -> bool:
    """Whether a further effect is told by the weights of the fit with it; in others, what it explains is noise."""
    new = weights_from(forward, [f])
    none, less, all_ = (g.reweighted(weights, new) for g in (base, best, f))
    if less.cost - all_.cost < words.INEXACT * (none.cost - less.cost):
        return False
    left = again(reweighted(screening, none, weights, new), less, without=less.hypothesis.effects)
    if not left.signatures or look_elsewhere(left, o.draws, o.seed, small=words.SMALL) > o.level:
        return False
    return better(score(forward, all_, new), score(forward, less, new))


def swaps(forward, base: Fit, best: Fit, fits, scores, screening: Screening, weights) -> list[Fit]:
    """Of several effects, each is left out in turn, and the others that could take its place are tried."""
    out: list[Fit] = []
    near = {"known": best.linear, "kept": len(forward.subject.nominals)}
    for s in best.hypothesis.suspects:
        rest = tuple(t for t in best.hypothesis.suspects if t is not s)
        known = [f for f in (*fits, *out) if _same(f.hypothesis, rest) and not f.failed]
        rest = known[0].hypothesis.suspects if known else rest
        place = _kept(best, rest)
        inner = known[0] if known else fit(forward, Hypothesis(rest), weights, theta=place, local=best.local, **near)
        if inner.failed:
            continue
        if not known:
            scores[id(inner)] = score(forward, inner, weights)
            out.append(inner)
        left = again(screening, inner, without=inner.hypothesis.effects)
        for g in distinct(left.signatures)[:RIVALS]:
            wanted = (*inner.hypothesis.suspects, g.suspect)
            if any(_same(f.hypothesis, wanted) for f in (*fits, *out)):
                continue
            f = roughly(forward, inner, g, weights, screening)
            theta = np.concatenate([place, f.theta[len(inner.free) :]])
            other = fit(forward, f.hypothesis, weights, theta=theta, local=best.local, rough=True, **near)
            f = min(f, other, key=lambda f: min(f.cost, f.promise))
            if min(f.cost, f.promise) < best.cost + NEAR:
                f = finished(forward, f, weights)
            if not f.failed:
                scores[id(f)] = score(forward, f, weights)
                out.append(f)
    return out


def spared(forward: Forward, fits: Sequence[Fit], scores: dict[int, Score], weights: Weights) -> list[Fit]:
    """Of the best explanations by several effects: without those whose strength is not told from none.

    What is left may have been fitted before, and have been stuck far from where this fit came to.
    """
    out: list[Fit] = []
    good = [f for f in fits if id(f) in scores]
    most = max(scores[id(f)].evidence for f in good)
    for f in good:
        if len(f.hypothesis.suspects) < 2 or scores[id(f)].evidence < most - words.CLOSE:
            continue
        sure = dict(zip((id(n) for n in f.free), zip(f.theta, f.deviations(), strict=True), strict=True))
        for s in f.hypothesis.suspects:
            value, deviation = sure[id(s.free[0])]
            rest = tuple(t for t in f.hypothesis.suspects if t is not s)
            near = [g for g in (*fits, *out) if _same(g.hypothesis, rest) and g.cost < f.cost + words.CLOSE]
            if abs(value - s.free[0].start) > 2.0 * deviation or near:
                continue
            near = {"known": f.linear, "kept": len(forward.subject.nominals)}
            fewer = fit(forward, Hypothesis(rest), weights, theta=_kept(f, rest), local=f.local, **near)
            if not fewer.failed:
                scores[id(fewer)] = score(forward, fewer, weights)
                out.append(fewer)
    return out


def _made(fits: Sequence[Fit], wanted: tuple[Suspect, ...]) -> Fit | None:
    """The fit of these suspects, if there is one."""
    return next((f for f in fits if _same(f.hypothesis, wanted)), None)


def _same(hypothesis: Hypothesis, wanted: tuple[Suspect, ...]) -> bool:
    return {s.label for s in hypothesis.suspects} == {s.label for s in wanted}


def _kept(f: Fit, rest: tuple[Suspect, ...]) -> np.ndarray:
    """The numbers of a fit that a smaller hypothesis of these suspects still has."""
    ends = np.cumsum([len(f.free) - len(f.hypothesis.free), *(len(s.free) for s in f.hypothesis.suspects)])
    own = {s.label: f.theta[a:b] for s, a, b in zip(f.hypothesis.suspects, ends[:-1], ends[1:], strict=True)}
    return np.concatenate([f.theta[: ends[0]], *(own[s.label] for s in rest)])


def unnamed(forward: Forward, base: Fit, best: Fit) -> str:
    """What the best explanation does not name, in words; or, where frames do not tell that, what it was to explain.

    They know no memory, and are read as recorded, without what a hypothesis says of the measurement.
    """
    lost = any(get(e).memory or get(e).family == "measurement" for e in best.hypothesis.effects)
    f, what = (base, "What is missing") if lost else (best, "What is left")
    if isinstance(forward, CurveForward):
        return described(forward.locate(f), [], what)
    motions = motions_of(forward, f)
    return described(locate(forward, motions), acting(forward.articulation, motions), what)


def leader(fits: Sequence[Fit], scores: dict[int, Score]) -> Fit | None:
    """The fit of the highest evidence."""
    good = [f for f in fits if id(f) in scores]
    return good[int(np.argmax(supported(good, scores)))] if good else None


# --- results


def table(forward, given: Fit, fits: list[Fit], scores, judged, screening: Screening) -> list[Candidate]:
    """All explanations that were fitted, best first, with the reason why each lost."""
    base = fits[0]
    rows = [f for f in fits if id(f) in scores]
    p = probabilities(supported(rows, scores))
    out = []
    for f, probability in zip(rows, p, strict=True):
        gain, error = difference(scores[id(f)], scores[id(base)]) if f is not base else (0.0, 0.0)
        kind = words.kind(f)
        label = f.hypothesis.label if f.hypothesis.suspects else "nominal refitted"
        out.append(
            Candidate(
                label,
                kind,
                [s.effect for s in f.hypothesis.suspects],
                [s.site for s in f.hypothesis.suspects],
                numbers(f),
                float(probability),
                gain,
                error,
                scores[id(f)].rms.tolist(),
                fit_percent(forward, f).tolist(),
                why=words.why(f, base, judged, scores),
                distrust=words.distrust(f, forward),
            )
        )
    for f in fits:
        if f.failed:
            empty = [float("nan")] * len(forward.components)
            h = f.hypothesis
            out.append(
                Candidate(
                    h.label,
                    "mechanism",
                    [s.effect for s in h.suspects],
                    [s.site for s in h.suspects],
                    [],
                    0.0,
                    float("nan"),
                    float("nan"),
                    empty,
                    empty,
                    failed=f.failed,
                )
            )
    return sorted(out, key=lambda c: -c.probability)


def numbers(f: Fit) -> list[Number]:
    """Fitted numbers with 95 % intervals."""
    deviation = f.deviations()
    return [
        Number(n.label, n.unit, float(t), float(t - 1.96 * d), float(t + 1.96 * d), n.start, n.spread, bool(b))
        for n, t, d, b in zip(f.free, f.theta, deviation, f.at_bound, strict=True)
    ]


def _suspected(s: Signature, screening: Screening) -> Suspected:
    u = s.suspect
    explained = s.score**2 / screening.total if screening.total > 0 else 0.0
    return Suspected(
        u.label, u.effect, u.site, u.kind, s.score, s.strength, s.error, u.free[0].unit, explained, s.status
    )


def _rms(f: Fit) -> np.ndarray:
    return np.sqrt(np.nanmean(np.concatenate(f.residuals) ** 2, axis=0))


def fit_percent(forward: Forward, f: Fit) -> np.ndarray:
    """(D,) 100 (1 - NRMSE) [%] over all fitted blocks."""
    values = np.concatenate([forward.blocks[b].values for b in f.blocks])
    spread = np.nanstd(values, axis=0)
    return 100.0 * (1.0 - _rms(f) / np.where(spread > 0, spread, np.nan))


def _units(recording: Recording) -> list[str]:
    return [c.unit for c in recording.channels.values() for _ in range(1 if c.values.ndim == 1 else c.values.shape[1])]


def traces(forward: Forward, given: Fit, base: Fit, best: Fit, weights: Weights, noise: np.ndarray) -> list[Trace]:
    """Recorded and predicted components of each recording, segment after segment."""
    out = []
    units = _units(forward.recordings[0])
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
                    band=float(2 * weights.deviation[d]),
                    breaks=breaks.tolist(),
                )
            )
    return out


def correlations(forward: Forward, base: Fit, best: Fit) -> list[Correlation]:
    """Auto- and cross-correlations of the residuals, averaged over segments."""
    out = []
    step = float(np.median(np.diff(forward.recordings[0].times)))
    lags = min(min(len(b.times) for b in forward.blocks) // 2, 200)
    drive, name = _varying_drive(forward)
    for d, component in enumerate(forward.components):
        row = Correlation(component, (np.arange(lags) * step).tolist(), [], [], name)
        for f, auto, cross in ((base, row.before, row.cross_before), (best, row.after, row.cross_after)):
            auto += _correlation(f, d, None, lags).tolist()
            cross += _correlation(f, d, _against(forward, f, d, drive), lags).tolist()
        out.append(row)
    return out


def _varying_drive(forward: Forward):
    """Name of the drive channel that varies most; None: nothing varies."""
    spans = {}
    for name, signal in forward._drives[0].signals.items():
        values = [np.squeeze(signal(r.times - r.times[0])) for r in forward.recordings]
        spans[name] = max(float(np.ptp(v)) if v.ndim else 0.0 for v in values)
    name = max(spans, key=lambda n: spans[n], default="")
    return (name, f"drive {name}") if spans.get(name) else (None, "rate")


def _against(forward: Forward, f: Fit, d: int, drive: str | None) -> list[np.ndarray]:
    out = []
    for b in f.blocks:
        block = forward.blocks[b]
        if drive is None:
            out.append(np.gradient(np.nan_to_num(block.values[:, d]), block.times))
        else:
            start = (
                forward.recordings[block.recording].times[block.first] - forward.recordings[block.recording].times[0]
            )
            out.append(np.squeeze(forward._drives[block.recording][drive](start + block.times)))
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
    for n, t in zip(best.free, best.theta, strict=True):
        where = "" if n.entities is None else "@" + ",".join(map(str, n.entities))
        out[n.label + where] = float(t)
    return out
