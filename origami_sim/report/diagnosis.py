"""What a diagnosis says: plain data that the report shows and that JSON holds whole."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.files import write_text
from origami_sim.infer.budget import Share
from origami_sim.locate.places import Acting, Impulse, Partial, Place, clock

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VERDICTS = ("ADEQUATE", "PARAMETER", "MEASUREMENT", "MECHANISM", "TIE", "SEVERAL", "UNKNOWN", "UNTESTABLE")

EXIT = {name: 10 + n for n, name in enumerate(VERDICTS)}
"""Exit codes of `origami-sim diagnose`; 0 would hide the verdict, 1 to 3 and 130 mean what they mean elsewhere."""


@dataclass
class Number:
    """A fitted number with its 95 % interval [SI].

    Attributes:
        prior, spread: value and standard deviation of what was known before (inf: nothing was); of a positive scale,
            such as a time constant, the deviation is that of its logarithm; see `Coordinates`.
        away: how far it is from there, in standard deviations (nan: nothing was known).
        nodes: that have so much each, of a mass that is added.
    """

    label: str
    unit: str
    value: float
    low: float
    high: float
    prior: float
    spread: float
    at_bound: bool
    away: float = float("nan")
    nodes: int = 1

    @property
    def each(self) -> str:
        """How many have so much, in words; "" where it is one."""
        return f" at each of {self.nodes} nodes" if self.nodes > 1 else ""


@dataclass
class Candidate:
    """One row of the table of explanations.

    Attributes:
        label: effects and sites, "nominal as given" or "nominal refitted". kind: nominal, parameter, mechanism,
            measurement.
        effects, sites: of its suspects. numbers: what was fitted.
        probability: posterior. odds: logarithm of the posterior odds over the model without an effect.
        rms: held-out rms residual by component, by one linear step [SI].
        fit: fit % = 100 (1 - NRMSE) by component, on all data.
        why: why it lost or won. distrust: when not to trust the row, or "". failed: why it could not be fitted, or "".
    """

    label: str
    kind: str
    effects: list[str]
    sites: list[str]
    numbers: list[Number]
    probability: float
    odds: float
    rms: list[float]
    fit: list[float]
    why: str = ""
    distrust: str = ""
    failed: str = ""


@dataclass
class Suspected:
    """One suspect in the screening: score z, its strength with standard deviation [unit], part explained."""

    label: str
    effect: str
    site: str
    kind: str
    z: float
    strength: float
    error: float
    unit: str
    explained: float
    status: str = ""


@dataclass
class Trace:
    """One component of one recording: times [s], recorded, predicted before, refitted and after; band is +-2 sd.

    Where `by_step`, times count load steps.
    """

    recording: str
    component: str
    unit: str
    noise: float
    times: list[float]
    recorded: list[float]
    before: list[float]
    refitted: list[float]
    after: list[float]
    band: float
    breaks: list[int]
    """Indices at which a segment with a start of its own begins."""
    by_step: bool = False

    @property
    def clock(self) -> tuple[str, str]:
        """What times count, and their unit."""
        return clock(self.by_step)


@dataclass
class Correlation:
    """Autocorrelation of a component's residual, and cross-correlation with the drive or the rate, before and after."""

    component: str
    lags: list[float]
    before: list[float]
    after: list[float]
    against: str = ""
    cross_before: list[float] = field(default_factory=list)
    cross_after: list[float] = field(default_factory=list)


@dataclass
class Experiment:
    """A proposed next experiment.

    Attributes:
        what: to do. separates: explanations that it tells apart, the best one first.
        information: by how much it is expected to lower the entropy of the posterior over explanations [bits].
        entropy: that is there now [bits]. repeats: recordings that tell most of what it can; 9999: no number does.
    """

    what: str
    separates: list[str]
    information: float
    entropy: float
    repeats: int


@dataclass
class Fold:
    """A part of the data that was left out of a fit and then predicted: its rms error by component [SI].

    Attributes:
        name: of the recordings, or the stretch of one. before: of the model as given. refitted, after: with numbers
            that all other parts tell, without any effect and with those that are named.
    """

    name: str
    before: list[float]
    refitted: list[float]
    after: list[float]


@dataclass
class Baseline:
    """A method that names no physics, on the same folds: held-out rms by component [SI]."""

    name: str
    rms: list[float]
    note: str = ""


@dataclass(repr=False)
class Diagnosis:
    """All that was found.

    Attributes:
        verdict: one of VERDICTS. sentence: what opens the report. probability: of the chosen explanation (or set); nan
            for UNKNOWN, where the one that comes closest is chosen but not believed. outside: that candidates imitate a
            law which the catalogue lacks.
        chosen: labels of the chosen explanation; of all in the tie for TIE, of all effects for SEVERAL.
        candidates: ordered, best first. screening: all suspects, best first.
        isolability: labels and matrix |cos| of the best suspects. places: where equation error finds the mismatch.
        partials: of each named effect, what is missing without it and what it gives.
        impulses: of contacts, if nothing holds the device. acting: what alone could be missing, best first.
        onset: when the refitted nominal first departs lastingly [s]; nan: never.
        traces, correlations: for plots. experiments: what to do next. baselines: beside ours.
        components, units, noise: of the channels. error_before, error_refitted, error_after: held-out rms by component
            (see `left_out`); estimates by one linear step as long as "held out" is unfinished. folds: the same by part
            of the data.
        notes: lint, warnings, limits. settings: what reproduces the run. seconds: by stage.
        patch: numbers to write into the calibration: label -> value. changed: effects of it that the model has
            already: their numbers are changes of what it has.
        unfinished: stages after the verdict that were not reached when this was written; empty at the end. Fields that
            they give, from `places` on, are empty until then.
        ended: whether the search for effects was ended by its limit of time.
    """

    verdict: str
    sentence: str
    probability: float
    chosen: list[str]
    candidates: list[Candidate]
    screening: list[Suspected]
    budget: list[Share]
    marginals: dict[str, float]
    compared: float
    components: list[str]
    units: list[str]
    noise: list[float]
    error_before: list[float]
    error_refitted: list[float]
    error_after: list[float]
    notes: list[str]
    settings: dict
    seconds: dict[str, float]
    patch: dict[str, float]
    subject: str = ""
    recordings: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    outside: float = 0.0
    places: list[Place] = field(default_factory=list)
    acting: list[Acting] = field(default_factory=list)
    partials: list[Partial] = field(default_factory=list)
    impulses: list[Impulse] = field(default_factory=list)
    onset: float = float("nan")
    traces: list[Trace] = field(default_factory=list)
    correlations: list[Correlation] = field(default_factory=list)
    isolability_labels: list[str] = field(default_factory=list)
    isolability: list[list[float]] = field(default_factory=list)
    experiments: list[Experiment] = field(default_factory=list)
    folds: list[Fold] = field(default_factory=list)
    baselines: list[Baseline] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)
    ended: bool = False

    @property
    def exit_code(self) -> int:
        return EXIT[self.verdict]

    @property
    def by_step(self) -> bool:
        """Whether times of the recordings count load steps."""
        return any(t.by_step for t in self.traces)

    @property
    def left_out(self) -> bool:
        """Whether errors are of data that were left out: of one recording that is predicted as a whole, nothing is."""
        return len(self.recordings) != 1 or self.settings.get("segments") != 1

    @property
    def unfitted(self) -> float:
        """Probability of sets of effects that were estimated and not fitted, such as the best one and more."""
        return max(0.0, 1.0 - self.outside - sum(c.probability for c in self.candidates))

    def __repr__(self) -> str:
        from origami_sim.view.findings import diagnosis_line  # only who looks pays for it

        return diagnosis_line(self)

    def _repr_html_(self) -> str:
        from origami_sim.view.findings import diagnosis_html

        return diagnosis_html(self)

    def plot(self) -> "Figure":
        """Where the mismatch goes, and the first recording beside the model as given and the best explanation."""
        from origami_sim.view.findings import plot_diagnosis

        return plot_diagnosis(self)

    def to_dict(self) -> dict:
        """Plain lists and numbers; what is not finite becomes None."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}

    def save_json(self, path: str | Path) -> Path:
        """Writes everything as JSON, a field per line: with a line for every number it takes ten times as long."""
        return write_text(path, as_json({f.name: getattr(self, f.name) for f in fields(self)}))


def as_json(values: Mapping) -> str:
    """JSON of names and values, a line each; what is not finite becomes null."""
    lines = [f" {json.dumps(name)}: {json.dumps(_plain(v), allow_nan=False)}" for name, v in values.items()]
    return "{\n" + ",\n".join(lines) + "\n}"


def _plain(value):
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        # nearly all of it are finite numbers
        return [v if type(v) is float and math.isfinite(v) else _plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
