"""What findings look like: a plot by Matplotlib, and a card in a notebook, of diagnoses, comparisons and sweeps."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from origami_sim.units import with_prefix
from origami_sim.view.plot import readable
from origami_sim.view.summary import card, counted, picture_of

if TYPE_CHECKING:
    from origami_sim.estimation.estimate import Estimate
    from origami_sim.explore.sweep import Sweep
    from origami_sim.folding import Folding
    from origami_sim.observation.compare import Comparison
    from origami_sim.report.diagnosis import Diagnosis, Trace

DRAWN = 4
"""Components of a recording in the plot of a diagnosis; the report has all."""

LINES = 12
"""Rows of a sweep's table in a notebook."""

SHADES = {"effect": "#0072b2", "measurement": "#cc79a7", "numbers": "#e69f00", "rest": "#9aa7b5"}


def diagnosis_line(d: "Diagnosis") -> str:
    """A diagnosis in one line."""
    return f"<Diagnosis: {d.verdict}: {d.sentence}>"


def diagnosis_html(d: "Diagnosis") -> str:
    """A diagnosis as its verdict, the budget of the mismatch, the best explanations and a plot."""
    best = [c for c in d.candidates if not c.failed][:3]
    rows = {
        d.verdict: d.sentence,
        "mismatch": "; ".join(f"{s.share:.0%} {s.name}" for s in d.budget if s.share >= 0.005) or "none",
        **{f"explanation {k + 1}": f"{c.label}, probability {c.probability:.1%}" for k, c in enumerate(best)},
        "compared": f"{d.compared:.0%} of all frames",
        **{f"note {k + 1}": n for k, n in enumerate(d.notes[:3])},
    }
    return card("Diagnosis", rows, picture_of(plot_diagnosis(d)), "image/png")


def plot_diagnosis(d: "Diagnosis") -> Figure:
    """Where the mismatch goes; the first recording beside the model as given and the best explanation, and what each
    leaves, with the band of the noise."""
    first = _first(d.traces)
    figure = Figure(figsize=(9.0, 1.2 + 2.0 * len(first)), layout="constrained")
    grid = figure.add_gridspec(1 + len(first), 2, height_ratios=[0.35, *[1.0] * len(first)])
    top, left = figure.add_subplot(grid[0, :]), 0.0
    for s in d.budget:
        top.barh(0, s.share, left=left, color=SHADES.get(s.kind, SHADES["rest"]), edgecolor="white")
        if s.share > 0.05:
            words = f"{s.share:.0%} {s.name}" if s.share > 0.25 else f"{s.share:.0%}"
            top.text(left + s.share / 2, 0, words, ha="center", va="center", fontsize=8, color="white")
        left += s.share
    top.set(xlim=(0, max(left, 1e-9)), yticks=[], xticks=[])
    top.set_title(f"{d.verdict}: where the mismatch goes", loc="left", fontsize=9)
    top.spines[:].set_visible(False)
    _draw_traces(figure, [(grid[row, 0], grid[row, 1]) for row in range(1, len(first) + 1)], first, "best explanation")
    return figure


def plot_estimate(e: "Estimate") -> Figure:
    """The first recording beside the model as given and as fitted, and what each leaves, with the band of the noise."""
    first = _first(e.traces)
    figure = Figure(figsize=(9.0, 0.6 + 2.0 * len(first)), layout="constrained")
    grid = figure.add_gridspec(len(first), 2)
    _draw_traces(figure, [(grid[row, 0], grid[row, 1]) for row in range(len(first))], first, "model as fitted")
    return figure


def _first(traces: "Sequence[Trace]") -> "list[Trace]":
    """Components of the first recording that are drawn."""
    return [t for t in traces if t.recording == traces[0].recording][:DRAWN] if traces else []


def _draw_traces(figure: Figure, places: Sequence[tuple], traces: "Sequence[Trace]", after_is: str) -> None:
    """Draws components, each in a row: recorded and predicted, and beside it what is left."""
    for row, ((left, right), t) in enumerate(zip(places, traces, strict=True)):
        recorded, times = np.array(t.recorded, float), np.array(t.times, float)
        before, after = np.array(t.before, float), np.array(t.after, float)
        motion, rest = figure.add_subplot(left), figure.add_subplot(right)
        factor, unit = _shown(t.unit, recorded)
        for values, style in (
            (recorded, {"color": "#000000", "lw": 1.4, "label": "recorded"}),
            (before, {"color": "#9aa7b5", "lw": 1.2, "ls": "--", "label": "model as given"}),
            (after, {"color": "#d55e00", "lw": 1.0, "label": after_is}),
        ):
            motion.plot(times, factor * values, **style)
        motion.set_ylabel(f"{t.component} [{unit}]")
        factor, unit = _shown(t.unit, recorded - before)
        rest.axhspan(-factor * t.band, factor * t.band, color="#d9d9d9", label="noise")
        rest.plot(times, factor * (recorded - before), color="#9aa7b5", lw=1.2, ls="--")
        rest.plot(times, factor * (recorded - after), color="#d55e00", lw=1.0)
        rest.set_ylabel(f"left [{unit}]")
        for axes in (motion, rest):
            readable(axes)
            if row == len(traces) - 1:
                axes.set_xlabel(t.clock[0] if t.by_step else "time [s]")
        if row == 0:
            motion.legend(frameon=False, fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
            rest.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))


def _shown(unit: str, values: np.ndarray) -> tuple[float, str]:
    """Factor and unit in which values are drawn: angles in degrees."""
    size = float(np.nanmax(np.abs(values), initial=0.0))
    return (float(np.degrees(1.0)), "deg") if unit == "rad" else with_prefix(size, unit)


def comparison_html(c: "Comparison") -> str:
    """A comparison as its sentence, a row per channel and the overlay."""
    rows = {
        "found": c.sentence(),
        **{n: f"rms residual {k.rmse / k.noise:.3g} times the noise, fit {k.fit:.1f} %" for n, k in c.channels.items()},
    }
    return card("Comparison", rows, picture_of(c.plot()), "image/png")


def folding_html(f: "Folding") -> str:
    """A folding as what the command line says of it, with the sheet on its way."""
    from origami_sim.folding import summarise

    told = summarise(f).sentences
    return card("Folding", {f"{k + 1}": s for k, s in enumerate(told)}, picture_of(f.plot()), "image/png")


def plot_sweep(s: "Sweep") -> Figure:
    """Every measure over the first input, a line for each combination of the others."""
    first, *others = s.inputs
    figure = Figure(figsize=(7.0, 0.6 + 2.4 * len(s.measures)), layout="constrained")
    keys = [tuple(s.columns[n][k] for n in others) for k in range(len(s))]
    for axes, measure in zip(np.atleast_1d(figure.subplots(len(s.measures), 1, sharex=True)), s.measures, strict=True):
        for key in dict.fromkeys(keys):
            rows = [k for k in range(len(s)) if keys[k] == key]
            rows.sort(key=lambda k: s.columns[first][k])
            label = ", ".join(f"{n} = {v:.4g}" for n, v in zip(others, key, strict=True))
            axes.plot(s.columns[first][rows], s.columns[measure][rows], "o-", ms=4, lw=1.2, label=label or None)
        axes.set_ylabel(measure)
        readable(axes)
    if others and len(set(keys)) <= LINES:
        figure.axes[0].legend(frameon=False, fontsize=8)
    figure.axes[-1].set_xlabel(first)
    return figure


def sweep_line(s: "Sweep") -> str:
    """A sweep in one line."""
    failed = f"; {len(s.failures)} not found" if s.failures else ""
    return f"<Sweep: {counted(len(s), 'point')} of {', '.join(s.inputs)}; {', '.join(s.measures)}{failed}>"


def sweep_html(s: "Sweep") -> str:
    """A sweep as the first rows of its table and a plot."""
    names = [*s.inputs, *s.measures]
    rows = {" | ".join(names): ""}
    for k in range(min(len(s), LINES)):
        rows[f"{k}"] = " | ".join(f"{s.columns[n][k]:.4g}" for n in names)
    if len(s) > LINES:
        rows["..."] = f"{len(s)} rows in all"
    return card("Sweep", rows, picture_of(s.plot()), "image/png")
