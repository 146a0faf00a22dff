"""`diagnose`: from a model and recordings to a verdict, stage by stage."""

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from origami_sim.diagnose import verdict as words
from origami_sim.diagnose.acting import acting
from origami_sim.diagnose.baselines import baselines
from origami_sim.diagnose.closed_loop import closed_loop
from origami_sim.diagnose.compare import score
from origami_sim.diagnose.describe import unnamed
from origami_sim.diagnose.diagnosis import Diagnosis
from origami_sim.diagnose.experiment import propose
from origami_sim.diagnose.impulses import impulses
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.locate import locate, motions_of
from origami_sim.diagnose.observed import assumed, unobserved
from origami_sim.diagnose.options import Options, Report
from origami_sim.diagnose.prepare import among, arranged, nominal_fits, prepared
from origami_sim.diagnose.screen import screen
from origami_sim.diagnose.search import (
    chosen,
    contest,
    leader,
    look_elsewhere,
    lookalikes,
    others,
    renewed,
    settled,
    twins,
    unbent,
    widened,
)
from origami_sim.diagnose.several import combine, pairs
from origami_sim.diagnose.tables import correlations, patch, rms_of, suspected, table, traces
from origami_sim.effects import get
from origami_sim.fit.channels import units_of
from origami_sim.fit.curves import CurveForward
from origami_sim.fit.hypothesis import suspects
from origami_sim.fit.least_squares import carried_on
from origami_sim.fit.subject import Source, subject_of
from origami_sim.recording import Recording, read_dataset


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
    every = forward.admitted(suspects(forward.model, recordings, forward.drive, forward.parameters))
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
    fits = renewed(fits, unbent(forward, base, every, fits, weights, o))
    fits += pairs(forward, base, screening, fits, weights, o)
    rough, seen = screening, (base, screening, weights)
    screening, fits, weights = settled(forward, rough, fits, weights)
    refined = tuple(fits)
    alike_ones = twins(forward, rough, screening, fits, weights)
    alike_ones += lookalikes(forward, every, screening, [*fits, *alike_ones], weights)
    fits = renewed(fits, alike_ones)
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
        alike_ones = lookalikes(forward, every, screening, fits, weights)
        if alike_ones:
            screening, fits, weights = settled(forward, screening, renewed(fits, alike_ones), weights, tuple(fits))
        p_value = look_elsewhere(screening, o.draws, o.seed, fits)
        p_small = look_elsewhere(screening, o.draws, o.seed, fits, small=words.SMALL)
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
    candidates = table(forward, fits, scores, judged)
    after = scores[id(best)]
    out = Diagnosis(
        verdict=judged.verdict,
        sentence=judged.sentence,
        probability=judged.probability,
        chosen=judged.chosen,
        candidates=candidates,
        screening=[suspected(s, screening) for s in (*screening.signatures, *screening.untestable)],
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
        units=units_of(recordings[0]),
        noise=noise.tolist(),
        error_before=rms_of(given).tolist(),
        error_refitted=scores[id(base)].rms.tolist(),
        error_after=after.rms.tolist(),
        notes=[*judged.notes, *noted],
        settings={**{k: v for k, v in o.__dict__.items()}, "segments": len(forward.blocks), "start": forward.start},
        seconds=seconds,
        patch={} if judged.verdict == "UNTESTABLE" else patch(best),
        changed=[e for e in best.hypothesis.effects if e in forward.model.effects],
        subject=subject.name,
        recordings=[r.name for r in recordings],
        impulses=[] if isinstance(forward, CurveForward) else impulses(forward, base),
        acting=actions,
    )
    tell("done", 1.0)
    return out
