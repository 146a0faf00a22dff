"""`diagnose`: from a model and recordings to a verdict, stage by stage, and then to what is added to it."""

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import orth
from threadpoolctl import threadpool_limits

from origami_sim.device.scene import scene_module
from origami_sim.diagnose.arrange import arranged, shortened
from origami_sim.diagnose.axes import mistaken
from origami_sim.diagnose.baselines import baselines
from origami_sim.diagnose.closed_loop import closed_loop
from origami_sim.diagnose.experiment import explanations, propose
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.later import Part, add, attempt
from origami_sim.diagnose.observed import beyond_the_log, unobserved
from origami_sim.diagnose.options import Options, Report
from origami_sim.diagnose.prepare import Recorded, among, gathered
from origami_sim.diagnose.tables import by_fold, correlations, patch, suspected, table, traces
from origami_sim.effects import get
from origami_sim.fit.bursts import bursts
from origami_sim.fit.held_out import estimated, predicted, refitted
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.nominal import level, nominal_fits
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import SEPARATOR, Suspect
from origami_sim.hypotheses.subject import Source, subject_of, untold
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.basins import calmest, settled
from origami_sim.infer.posterior import Posterior, marginals
from origami_sim.infer.recorder import recorder_noise
from origami_sim.infer.screen import LATE, Signature, screen
from origami_sim.infer.search import search
from origami_sim.locate.describe import unnamed
from origami_sim.locate.impulses import impulses
from origami_sim.locate.meeting import meetings
from origami_sim.locate.onset import onset
from origami_sim.locate.partial import partials
from origami_sim.locate.where import located
from origami_sim.observation.channels import stacked, units_of
from origami_sim.observation.doubts import assumed
from origami_sim.recording.possible import Possible
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.threads import in_step, leads, shared, told
from origami_sim.verdict.sentences import judge
from origami_sim.verdict.stored import Stored

ALONE = "One recording only: held-out data are stretches of the same recording, which share its errors."
WHOLE = "One recording, which is predicted as a whole: nothing could be left out, and errors are of what was fitted."
"""Notes on the errors of a single recording."""
SHORT = (
    "Segments are as short as tells a start, as the refitted model is too far off for linear steps; where nothing "
    "explains a recording, state longer ones (`--segment`): what sticks for long shows in these."
)


@threadpool_limits.wrap(limits=1, user_api="blas")  # small matrices: threads of their own would wait for each other
def diagnose(
    subject: Source,
    recordings: Recorded,
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
        keep: remembers predictions, so that an interrupted diagnosis resumes, and the fits; told of the diagnosis as
            soon as its verdict stands, and again whenever something was added to it.

    Raises:
        InputError: no recording, a file that cannot be read, recordings of different channels, too few frames, a drive
            that the model does not know.
    """
    o = options or Options()
    return in_step(lambda: _diagnosed(subject, recordings, o, catalogue, priors, progress, keep), o.threads)


def _diagnosed(
    subject: Source,
    recordings: Recorded,
    o: Options,
    catalogue: Sequence[str] | None,
    priors: Mapping[str, float | str] | None,
    progress: Report | None,
    keep: Keep | None,
) -> Diagnosis:
    """What `diagnose` finds; processes that go in step all find it (see `in_step`)."""
    tell = progress if progress is not None and leads() else (lambda stage, part: None)
    seconds: dict[str, float] = {}
    began = clock.perf_counter()

    def lap(stage: str):
        seconds[stage] = clock.perf_counter() - began - sum(seconds.values())

    tell("prepare", 0.0)
    said = possible_of(subject)
    subject = subject_of(subject, priors)
    recordings = gathered(recordings, o.rate)
    forward, noted = arranged(subject, recordings, o)
    if keep is not None:
        keep.follow(forward)
    compared = share_compared(forward)
    noted = [f"{compared:.0%} of {valued(forward):,} frames are compared.", *standing(forward), *noted]
    listens = "Whether a drive listens to the device could not be told"
    loop = attempt(noted, listens, lambda: closed_loop(recordings), None)
    noted += [n for r in recordings for n in [*r.metadata.get("notes", []), *assumed(r, forward.drive)]]
    noted += meetings(forward)
    unseen = unobserved(forward)
    if unseen is not None:
        noted.append(unseen)
    unclear = "Whether axes or units are mistaken could not be told"
    wrong = attempt(noted, unclear, lambda: mistaken(subject, recordings, o, forward), None)
    tell("nominal", 0.0)
    given, base, weights = nominal_fits(forward)
    if (finer := shortened(forward, base, o)) is not None:
        forward = finer
        noted.append(SHORT)
        if keep is not None:
            keep.follow(forward)
        given, base, weights = nominal_fits(forward)
    if wrong is None:
        wrong = attempt(noted, unclear, lambda: mistaken(subject, recordings, o, forward, base), None)
    if len(recordings) == 1:
        noted.append(ALONE if len(forward.blocks) > 1 else WHOLE)
    base, rough = settled(forward, base)
    weights = level(forward, base) if rough else weights
    lap("nominal")
    tell("screen", 0.0)
    every = [] if wrong else suspects(forward.model, recordings, forward.drive, forward.parameters)
    every = forward.admitted(every)
    if catalogue is not None:
        every = among(every, catalogue)
        idle = sorted({get(n).name for n in catalogue} - {s.effect for s in every})
        if idle:
            noted.append(
                f"Not suspected, as it cannot act on this device or show in these recordings: {', '.join(idle)}."
            )
    screened = lambda part: tell("screen", part)  # noqa: E731

    def in_time() -> bool:
        return clock.perf_counter() - began < o.limit

    calm = None if not rough else calmest(forward, every, given, base, screened)
    if calm is not None:
        weights, signatures = calm.weights, calm.signatures
    else:
        signatures = screen(forward, every, base, weights, progress=screened, going_on=in_time)
    lap("screen")
    tell("search", 0.0)

    def going_on(part: float, so_far: Posterior) -> bool:
        tell(f"search, so far {so_far.label(so_far.leader) if so_far.leader else 'no effect'}", part)
        return told(in_time)

    store = keep is not None and keep.store
    how = {"given": given, "calm": calm, "going_on": going_on, "most": o.fits, "store": store}
    posterior = search(forward, base, signatures, weights, **how)
    lap("search")
    noted += untold(subject, [s.suspect for s in posterior.signatures if s.status not in ("", LATE)])
    tell("verdict", 0.0)
    judged = judge(forward, given, base, posterior, compared)
    if (cause := wrong or loop) is not None:
        judged = replace(judged, verdict="UNTESTABLE", sentence=cause.sentence, probability=1.0, chosen=[], best=base)
    best = judged.best
    if keep is not None:
        keep.fits = {"before": given, "refitted": base, "after": best}
    noted = list(dict.fromkeys([*judged.notes, *noted, *beyond_the_log(forward, best)]))
    nowhere, left_out = np.full(len(forward.components), np.nan), "Held-out error could not be told"

    def error(f: Fit) -> tuple[np.ndarray, list[str]]:
        said: list[str] = []
        return attempt(said, left_out, lambda: estimated(forward, f, weights).rms, nowhere), said

    each_error = shared([partial(error, node.fit) for node in posterior.nodes.values()])
    errors = {key: rms for key, (rms, _) in zip(posterior.nodes, each_error, strict=True)}
    noted += [note for _, notes in each_error for note in notes]
    after = next(errors[k] for k, n in posterior.nodes.items() if n.fit.hypothesis is best.hypothesis)
    noise = recorder_noise(forward, best)
    scores = attempt(noted, "The screening cannot be shown", lambda: scored(posterior), [])
    shown = [s for s, _ in scores[:12] if np.any(s.norm > 0)]
    missed = float(sum(s.share for s in judged.budget) and base.cost)
    lap("verdict")
    out = Diagnosis(
        verdict=judged.verdict,
        sentence=judged.sentence,
        probability=judged.probability,
        outside=judged.outside,
        chosen=judged.chosen,
        candidates=table(forward, posterior, base, judged, errors),
        screening=[suspected(s, z, missed) for s, z in scores],
        budget=judged.budget,
        marginals=marginals(posterior),
        compared=compared,
        components=list(forward.components),
        units=units_of(recordings[0]),
        noise=noise.tolist(),
        error_before=given.rms().tolist(),
        error_refitted=errors[frozenset()].tolist(),
        error_after=after.tolist(),
        notes=noted,
        settings={
            **{k: v for k, v in o.__dict__.items() if k != "possible"},
            "segments": len(forward.blocks),
            "start": forward.start,
        },
        seconds=seconds,
        patch={} if judged.verdict == "UNTESTABLE" else patch(best),
        changed=[e for e in best.hypothesis.effects if e in forward.model.effects],
        subject=subject.name,
        recordings=[r.name for r in recordings],
        ended=posterior.ended,
    )
    if out.ended and cause is None:
        out.sentence += f" The search ended at its limit of {o.limit:g} s: sets of effects that were estimated and not "
        out.sentence += f"fitted hold p = {out.unfitted:.2f}."
        out.notes.insert(0, "With a larger limit (--limit) the same command goes on from where the search ended.")

    def curves() -> dict:
        return {"traces": traces(forward, given, base, best, noise)}

    def places() -> dict:
        found, actions = located(forward, base)
        return {"places": found, "acting": actions}

    def laws_shown() -> dict:
        return {"partials": partials(forward, shown_by(posterior, best, judged.chosen))}

    def left() -> dict:
        # what acts now and then goes with nothing that the device does
        steady = judged.verdict == "UNKNOWN" and bursts(best).probability < 0.5
        more = unnamed(forward, base, best) if steady else ""
        return {"sentence": f"{out.sentence} {more}".strip()}

    def experiments() -> dict:
        progress = lambda part: tell("next experiment", part)  # noqa: E731
        can = (o.possible or said).but(recordings[0].metadata.get("possible") or {})
        return {
            "experiments": propose(forward, *explanations(posterior), best.weights or weights, can, progress=progress)
        }

    without: list[Fit] = []  # the model without any effect, refitted without each fold

    def left_out_in_turn() -> dict:
        without[:] = refitted(forward, base)
        with_effects = without if best is base else refitted(forward, best)
        plain, now = (predicted(forward, fits, weights) for fits in (without, with_effects))
        rms = {"error_refitted": plain.rms.tolist(), "error_after": now.rms.tolist()}
        return {**rms, "folds": by_fold(forward, given, plain, now)}

    def others() -> dict:
        return {"baselines": baselines(forward, without, weights, np.array(out.error_refitted))}

    film = None if keep is None else keep.film

    def replay() -> dict:
        return {} if film is None else {"films": film(out)}

    rest = lambda: {"correlations": correlations(forward, base, best)}  # noqa: E731
    blows = lambda: {"impulses": impulses(forward, base)}  # type: ignore[arg-type]  # noqa: E731
    since = lambda: {"onset": onset(forward, base)}  # noqa: E731
    parts = [
        Part("curves", "What was predicted cannot be shown", curves, quick=True),
        Part("locate", "What is left could not be described", left, quick=True),
        Part("locate", "What each effect gives could not be told", laws_shown, alone=True),
        Part("locate", "Where the mismatch is could not be told", places, alone=True),
        Part("locate", "Impulses could not be told", blows, alone=True),
        Part("locate", "The onset could not be told", since, alone=True),
        Part("curves", "Correlations could not be told", rest, alone=True),
        Part("curves", "What looks alike could not be told", lambda: alike(shown, base), alone=True),
        *([] if film is None else [Part("replay", "The replay could not be written", replay, alone=True, of=keep)]),
        Part("held out", "Held-out errors are estimates by one linear step", left_out_in_turn),
    ]
    if out.ended and best is base:
        noted.append("No next experiment is proposed before the search is done.")
    else:
        parts.append(Part("next experiment", "The next experiment could not be told", experiments))
    if out.verdict != "UNTESTABLE":  # else there is nothing to be better than
        parts.append(Part("baselines", "Baselines could not be told", others))
    if keep is not None and keep.store:
        fault = "The search could not be stored"
        make = lambda: Stored.of(forward, given, base, posterior, compared)  # noqa: E731
        keep.stored = attempt(noted, fault, make, None)
    add(out, parts, tell, keep.stands if keep is not None else lambda _: None)
    tell("done", 1.0)
    return out


def shown_by(p: Posterior, best: Fit, labels: Sequence[str]) -> list[tuple[Suspect, Fit]]:
    """The effects that are named, each with the fit that shows it: the best one, or else the most probable with it."""
    fits = [best, *(p.nodes[k].fit for k in sorted(p.nodes, key=lambda k: -p.total[k]))]
    of: dict[str, tuple[Suspect, Fit]] = {}
    for f in fits:
        for s in f.hypothesis.suspects:
            of.setdefault(s.label, (s, f))
    each = dict.fromkeys(one for label in labels for one in label.split(SEPARATOR))
    return [of[one] for one in each if one in of]


def possible_of(source: Source) -> Possible:
    """What a scene says that its set-up can do, or the defaults."""
    given = source[0] if isinstance(source, tuple) else source
    return getattr(scene_module(given) if isinstance(given, str) else given, "POSSIBLE", None) or Possible()


def share_compared(forward: Predictor) -> float:
    """Part of the frames with a value that are compared, or repeat one that is."""
    seen = sum(np.any(b.counted(), axis=1).sum() for b in forward.blocks)
    return float(min(seen / max(valued(forward), 1), 1.0))


def valued(forward: Predictor) -> int:
    """How many frames of all recordings have a value."""
    return sum(int(np.any(np.isfinite(stacked(r)[0]), axis=1).sum()) for r in forward.recordings)


def standing(forward: Predictor) -> list[str]:
    """Notes on components whose readings stand on a step of the sensor, and then count once."""
    each = [np.sum(b.repeats, axis=0) for b in forward.blocks if b.repeats is not None]
    text = "{:,} readings of '{}' only repeat others, as its sensor stands on a step for long: these count once."
    return (
        [text.format(n, c) for n, c in zip(np.sum(each, axis=0), forward.components, strict=True) if n] if each else []
    )


def scored(p: Posterior) -> list[tuple[Signature, np.ndarray]]:
    """Signatures with the z (k,) by which each strength alone explains what the model without an effect misses.

    The best one comes first.
    """
    node = p.nodes[frozenset()]
    cell = node.grid[0]
    assert cell is not None
    gram = cell.gram
    z = [np.zeros(len(s.size)) for s in p.signatures]
    for g, o in zip(node.groups, node.others, strict=True):
        mine = list(g.columns)
        size = np.sqrt(np.maximum(gram[mine, mine], 1e-300))
        z[o] = np.where(gram[mine, mine] > 0, gram[mine, -1] / size, 0.0)
        z[o] = np.where(g.side * z[o] < 0, 0.0, z[o])
    order = np.argsort([-np.max(np.abs(each)) for each in z], kind="stable")
    seen = [k for k in order if p.signatures[k].parts or p.signatures[k].status]  # of others there is no signature
    return [(p.signatures[k], z[k]) for k in seen]


def alike(signatures: Sequence[Signature], base: Fit) -> dict:
    """Labels of suspects, and how much each looks like each other."""
    return {"isolability_labels": [s.suspect.label for s in signatures], "isolability": overlap(signatures, base)}


def overlap(signatures: Sequence[Signature], base: Fit) -> list[list[float]]:
    """|cos| between signatures, without what starts and numbers could explain: 1 where two look the same.

    Of those with several strengths, of what is most alike (the cosine of the smallest principal angle).
    """
    if not signatures or base.linear is None:
        return []
    line = base.linear
    stacked_ = [np.concatenate([s.parts[n] for s in signatures], axis=1) for n in range(len(line.rows))]
    whole = np.concatenate(
        line.cleared([np.concatenate([t, x], 1) for t, x in zip(line.tangent, stacked_, strict=True)])
    )
    width = line.tangent[0].shape[1]
    q, _ = np.linalg.qr(whole[:, :width])
    shapes = whole[:, width:] - q @ (q.T @ whole[:, width:])
    ends = np.cumsum([len(s.size) for s in signatures])[:-1]
    each = [orth(x / max(np.linalg.norm(x), 1e-300)) for x in np.split(shapes, ends, axis=1)]
    return [[float(np.linalg.norm(a.T @ b, 2)) if a.size and b.size else 0.0 for b in each] for a in each]
