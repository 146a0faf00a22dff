"""`estimate`: least-squares estimates of a model's numbers and of stated effects, with intervals and evidence.

It is the estimator of the diagnosis by itself. Nothing is searched for: who knows what acts on a device, and not how
strongly, learns the numbers, how surely recordings tell them, and how well the model predicts what it was not fitted
to. It is a maximum a posteriori estimate by Gauss-Newton steps (Nocedal & Wright 2006, chapter 10) with multiple
shooting (Bock 1983), in noise whose level and colour the residuals tell.
"""

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from origami_sim.diagnose.arrange import arranged, shortened
from origami_sim.diagnose.observed import beyond_the_log, unobserved
from origami_sim.diagnose.options import Options, Report
from origami_sim.diagnose.prepare import Recorded, gathered
from origami_sim.diagnose.tables import numbers, patch, traces
from origami_sim.effects import get
from origami_sim.errors import InputError, nearest
from origami_sim.files import write_text
from origami_sim.fit.held_out import predicted, refitted
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.implied import log_evidence, with_own_noise
from origami_sim.fit.least_squares import Fit, converged, fit
from origami_sim.fit.nominal import level, nominal_fits
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import Suspect
from origami_sim.hypotheses.subject import Source, subject_of
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.basins import settled
from origami_sim.infer.recorder import recorder_noise
from origami_sim.infer.scan import over_their_range
from origami_sim.observation.channels import units_of
from origami_sim.report.diagnosis import Candidate, Number, Trace, as_json
from origami_sim.threads import in_step, leads, shared

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AT = " at "
"""Between an effect and its site."""


@dataclass(repr=False)
class Estimate:
    """Numbers of a model and of effects, fitted to recordings.

    Attributes:
        numbers: (P,) fitted values with 95 % intervals and what was known before [SI].
        correlation: [P, P] of their errors.
        effects, sites: that were stated, one each.
        components, units, noise: (D,) of the channels.
        error_given, error_fitted: (D,) root mean square errors of the model as given and as fitted [SI].
        error_held_out: (D,) of parts of the data by numbers that all other parts tell; nan if that failed.
        log_evidence: natural logarithm of the evidence that effects gain over the model without them (a Bayes factor);
            0 where none is stated.
        recordings: their names. notes: what was assumed or left out. traces: for plots.
        patch, changed: what `write_patch` writes, see `Diagnosis`. seconds: of computing.
    """

    numbers: list[Number]
    correlation: list[list[float]]
    effects: list[str]
    sites: list[str]
    components: list[str]
    units: list[str]
    noise: list[float]
    error_given: list[float]
    error_fitted: list[float]
    error_held_out: list[float]
    log_evidence: float
    recordings: list[str]
    notes: list[str]
    traces: list[Trace]
    patch: dict[str, float]
    changed: list[str]
    seconds: float

    @property
    def over_noise(self) -> float:
        """Root mean square over all channels of what is left, over the noise."""
        return float(np.sqrt(np.nanmean((np.array(self.error_fitted) / np.array(self.noise)) ** 2)))

    @property
    def sentence(self) -> str:
        """What was fitted, and what that leaves."""
        what = f"{len(self.numbers)} number{'s' if len(self.numbers) > 1 else ''}"
        return f"{what} fitted; what is left is {self.over_noise:.3g} times the noise."

    @property
    def verdict(self) -> str:
        return "estimate"

    @property
    def candidates(self) -> list[Candidate]:
        """The one explanation there is, as a diagnosis has them."""
        label, nothing = " + ".join(f"{e}{AT}{s}" for e, s in zip(self.effects, self.sites, strict=True)), []
        return [Candidate(label, "", self.effects, self.sites, self.numbers, 1.0, 0.0, nothing, nothing)]

    def strongest_correlation(self) -> tuple[str, str, float] | None:
        """The two numbers that recordings tell apart least, and how their errors correlate; None of a single one."""
        if len(self.numbers) < 2:
            return None
        size = np.abs(np.array(self.correlation)) - np.eye(len(self.numbers))
        a, b = sorted(np.unravel_index(int(np.argmax(size)), size.shape))
        return self.numbers[a].label, self.numbers[b].label, self.correlation[a][b]

    def plot(self) -> "Figure":
        """The first recording beside the model as given and as fitted."""
        from origami_sim.view.findings import plot_estimate

        return plot_estimate(self)

    def save_json(self, path: str | Path) -> Path:
        """Writes everything as JSON; what is not finite becomes null."""
        return write_text(path, as_json({f.name: getattr(self, f.name) for f in fields(self)}))

    def __repr__(self) -> str:
        return f"<Estimate: {self.sentence}>"


@threadpool_limits.wrap(limits=1, user_api="blas")  # as of a diagnosis
def estimate(
    subject: Source,
    recordings: Recorded,
    effects: Sequence[str] = (),
    *,
    priors: Mapping[str, float | str] | None = None,
    options: Options | None = None,
    progress: Report | None = None,
) -> Estimate:
    """Fits numbers of a model, and effects that are known to act, to recordings of one object.

    Args:
        subject: the model and what is uncertain in it; or a scene, or (model, parameters), see `subject_of`.
        recordings: of one object, with their drives; or their files.
        effects: that act besides, as "crease_friction at hinge2"; without a site at all of them, or at the only one.
        priors: standard deviations of the model's numbers, which are then fitted; "300 %" of one that is hardly known.
        options: see `Options`. progress: called with the stage and the fraction done.

    Raises:
        InputError: nothing to fit; an effect that cannot act there; what `diagnose` refuses.
    """
    o = options or Options()
    return in_step(lambda: _estimated(subject, recordings, effects, priors, o, progress), o.threads)


def _estimated(
    source: Source,
    given: Recorded,
    effects: Sequence[str],
    priors: Mapping[str, float | str] | None,
    o: Options,
    progress: Report | None,
) -> Estimate:
    tell, began = progress if progress is not None and leads() else (lambda stage, part: None), clock.perf_counter()
    tell("prepare", 0.0)
    subject = subject_of(source, priors)
    if not subject.nominals and not effects:
        allowed = "priors of the numbers to fit, or effects to fit"
        raise InputError("nothing is to be fitted", field="priors", allowed=allowed)
    recordings = gathered(given, o.rate)
    forward, notes = arranged(subject, recordings, o)
    if (unseen := unobserved(forward)) is not None:
        notes.append(unseen)
    tell("fit", 0.0)
    plain, base, _ = nominal_fits(forward)
    if (finer := shortened(forward, base, o)) is not None:
        forward = finer
        plain, base, _ = nominal_fits(forward)
    found, _ = settled(forward, base)
    every = forward.admitted(suspects(forward.model, recordings, forward.drive, forward.parameters))
    wanted = [_wanted(every, text) for text in effects]
    for n, variants in enumerate(wanted):
        tell("fit", n / len(wanted))
        found = _with(forward, found, variants)
    found = _in_own_noise(forward, found)
    notes += beyond_the_log(forward, found)
    tell("held out", 0.0)
    try:
        held_out = predicted(forward, refitted(forward, found), level(forward, found)).rms
    except InputError as error:
        held_out = np.full(len(forward.components), np.nan)
        notes.append(f"Held-out error could not be told: {error}.")
    noise = recorder_noise(forward, found)
    return Estimate(
        numbers=numbers(found),
        correlation=_correlation(found).tolist(),
        effects=[s.effect for s in found.hypothesis.suspects],
        sites=[s.site for s in found.hypothesis.suspects],
        components=list(forward.components),
        units=units_of(recordings[0]),
        noise=noise.tolist(),
        error_given=plain.rms().tolist(),
        error_fitted=found.rms().tolist(),
        error_held_out=held_out.tolist(),
        log_evidence=log_evidence(found) - log_evidence(_in_own_noise(forward, base)) if effects else 0.0,
        recordings=[r.name for r in recordings],
        notes=notes,
        traces=traces(forward, plain, base, found, noise),
        patch=patch(found),
        changed=[e for e in found.hypothesis.effects if e in forward.model.effects],
        seconds=clock.perf_counter() - began,
    )


def _wanted(every: Sequence[Suspect], text: str) -> list[Suspect]:
    """An effect that is stated, as the suspects that differ in where its numbers begin alone.

    Raises:
        InputError: no such effect, or not there, or at several places.
    """
    name, _, site = (part.strip() for part in text.partition(AT))
    effect = get(name).name
    mine = [s for s in every if s.effect == effect]
    if site:
        found = [s for s in mine if s.site == site]
    else:
        found = [s for s in mine if s.entities is None] or mine
    if len({s.label for s in found}) == 1:
        return found
    labels = sorted({s.label for s in mine})
    fault = "acts at several places" if found else "cannot act there" if mine else "cannot act on this device"
    allowed = ", ".join(labels or sorted({s.effect for s in every}))
    raise InputError(fault, field="effects", value=text, allowed=allowed + nearest(text, labels))


def _with(forward: Predictor, f: Fit, variants: Sequence[Suspect]) -> Fit:
    """A fit with one more effect: the best of those from where its numbers may begin.

    Raises:
        InputError: all of them fail.
    """
    made = shared([partial(_with_one, forward, f, s) for s in variants])
    best = min(made, key=lambda one: np.inf if one.failed else one.cost)
    if best.failed:
        raise InputError(f"the fit fails: {best.failed}", field="effects", value=variants[0].label)
    return best


def _with_one(forward: Predictor, f: Fit, suspect: Suspect) -> Fit:
    """A fit with one more effect, begun at that of a few of its strengths which explains most."""
    by, start = level(forward, f), np.array([n.start for n in suspect.free])
    (scan,) = over_their_range(forward, [suspect], f, by)
    theta = np.concatenate([f.theta, start]) if scan is None else scan[0]
    found = fit(forward, f.hypothesis.plus(suspect), by, theta=theta, local=f.local)
    # what the model lacked made the noise look larger: with it the rest is fitted in less
    return found if found.failed else converged(forward, found.reweighted(level(forward, found)))


def _in_own_noise(forward: Predictor, f: Fit) -> Fit:
    """A fit that has converged in noise of the level and colour that it leaves."""
    own, _ = with_own_noise(forward, f, HYPER)
    return own if (on := converged(forward, own)).failed else on


def _correlation(f: Fit) -> np.ndarray:
    """[P, P] of the errors of the numbers."""
    size = np.sqrt(np.maximum(np.diag(f.covariance), 1e-300))
    return f.covariance / np.outer(size, size)
