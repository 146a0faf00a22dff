"""Compare a recording with a simulation: how well, and when and where they first part."""

import json
import os
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.recording import Channel, Recording
from origami_sim.units import quantity, with_prefix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTING_WINDOW = 5
"""Consecutive values of which the median residual must exceed the threshold."""

# the colour-blind safe colours of Okabe and Ito, and greys
_INK, _RECORDED, _SIMULATED, _PARTING, _BAND = "#333333", "#000000", "#d55e00", "#0072b2", "#d9d9d9"


@dataclass(frozen=True, eq=False)
class ChannelComparison:
    """Recording against simulation in one channel.

    Attributes:
        name: channel name.
        kind: kind of channel.
        unit: SI unit of all values.
        noise: standard deviation of the measurement noise [SI].
        recorded: (n, d) measured values [SI]; nan where missing.
        predicted: (n, d) simulated values [SI].
        rmse: root mean square residual per component [SI].
        nrmse: residual norm over the norm of the recording about its mean; nan for a recording at rest.
        parting_time: when they part [s]; None when they do not.
        parting_residual: median residual over the window that begins there [SI], of the component that parts.
    """

    name: str
    kind: str
    unit: str
    noise: float
    recorded: np.ndarray
    predicted: np.ndarray
    rmse: float
    nrmse: float
    parting_time: float | None
    parting_residual: float | None

    @property
    def residual(self) -> np.ndarray:
        """(n, d) recording minus simulation [SI]; nan where the recording is missing."""
        return self.recorded - self.predicted

    @property
    def fit(self) -> float:
        """Fit 100 (1 - nrmse) [%]; 100 is perfect, 0 as good as the mean, nan for a recording at rest."""
        return 100.0 * (1.0 - self.nrmse)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Recording against simulation, channel by channel.

    Attributes:
        name: name of the recording.
        times: (n,) times [s].
        channels: comparisons by channel name.
        threshold: residual, in standard deviations of the noise, beyond which they part.
        first_channel: the channel that parts first; None when none does.
        first_time: when it parts [s].
        by_step: whether `times` counts load steps instead of seconds.
    """

    name: str
    times: np.ndarray
    channels: dict[str, ChannelComparison]
    threshold: float
    first_channel: str | None
    first_time: float | None
    by_step: bool = False

    def instant(self, time: float) -> str:
        """A time in words: 't = 0.412 s', or 'step 12' for load steps."""
        return f"step {time:.0f}" if self.by_step else f"t = {time:.3f} s"

    def __repr__(self) -> str:
        return f"<Comparison: {self.sentence()}>"

    def _repr_html_(self) -> str:
        from origami_sim.view.findings import comparison_html  # only who looks pays for it

        return comparison_html(self)

    def plot(self) -> "Figure":
        """Recording and simulation above, their residual with the noise band below, one column per component."""
        return _overlay(self)

    def sentence(self) -> str:
        """What was found, in one sentence."""
        fits = ", ".join(f"{_fit_text(c.fit)} ({c.name})" for c in self.channels.values())
        if self.first_channel is None or self.first_time is None:
            noisiest = max(self.channels.values(), key=lambda c: c.rmse / c.noise)
            return (
                f"Simulation and recording do not part between {self.instant(self.times[0])} and "
                f"{self.instant(self.times[-1])}: no lasting residual exceeds {self.threshold:g} times the noise "
                f"(rms residual at most {noisiest.rmse / noisiest.noise:.2g} times the noise, in {noisiest.name}); "
                f"fit {fits}."
            )
        first = self.channels[self.first_channel]
        residual = quantity(abs(first.parting_residual or 0.0), first.unit)
        return (
            f"Simulation and recording part at {self.instant(self.first_time)} in channel {first.name} "
            f"(residual {residual}, noise {quantity(first.noise, first.unit)}); fit {fits}."
        )

    def table(self) -> str:
        """One line per channel as text, first to part first."""
        ordered = sorted(self.channels.values(), key=lambda c: np.inf if c.parting_time is None else c.parting_time)
        rows = [("channel", "parts at", "rms residual", "noise", "rms/noise", "NRMSE", "fit [%]")]
        for c in ordered:
            rows.append(
                (
                    c.name,
                    "never" if c.parting_time is None else self.instant(c.parting_time),
                    quantity(c.rmse, c.unit, digits=3),
                    quantity(c.noise, c.unit),
                    f"{c.rmse / c.noise:.3g}",
                    f"{c.nrmse:.3g}",
                    f"{c.fit:.1f}",
                )
            )
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        return "\n".join(
            "  ".join(
                cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
            )
            for row in rows
        )

    def to_json(self, *, series: bool = False) -> str:
        """Every number as JSON text; nan becomes null.

        Args:
            series: whether to include times and the recorded and predicted series, from which the rest follows.
        """
        tree: dict = {
            "name": self.name,
            "threshold": self.threshold,
            "parting_window": PARTING_WINDOW,
            "frame_count": len(self.times),
            "time_range_s": [float(self.times[0]), float(self.times[-1])],
            "first_channel": self.first_channel,
            "first_time_s": self.first_time,
            "by_step": self.by_step,
            "sentence": self.sentence(),
            "channels": {},
        }
        for c in self.channels.values():
            tree["channels"][c.name] = {
                "kind": c.kind,
                "unit": c.unit,
                "noise": _number(c.noise),
                "rmse": _number(c.rmse),
                "nrmse": _number(c.nrmse),
                "fit_percent": _number(c.fit),
                "parting_time_s": c.parting_time,
                "parting_residual": c.parting_residual,
            }
            if series:
                tree["channels"][c.name]["recorded"] = _numbers(c.recorded)
                tree["channels"][c.name]["predicted"] = _numbers(c.predicted)
        if series:
            tree["times_s"] = self.times.tolist()
        return json.dumps(tree, indent=1, allow_nan=False)


def compare(recording: Recording, predicted: Mapping[str, np.ndarray], *, threshold: float = 5.0) -> Comparison:
    """Compare a recording with the same channels of a simulation.

    They part at the first of five consecutive recorded values whose median residual exceeds `threshold` standard
    deviations of the noise, if that value itself does. The median asks that three of five agree in sign and size, so
    that single outliers never count. For independent Gaussian noise the chance per frame is at most
    20 q(threshold)^3, with q the upper tail: 5e-19 at 5, 2e-4 at 2. The residual of an oscillation may shrink below
    the threshold again later, as it changes sign.

    Three warnings. A simulation that starts from a measured rate drifts off by that rate's error within milliseconds:
    fit the initial state before calling an early parting physics, as a device's `replicate` does. Noise that is
    correlated over more than five frames parts sooner than stated. And a bias below the threshold never parts, however
    long it lasts: compare the rms residual with the noise.

    Args:
        recording: the recording.
        predicted: per channel, (n,) or (n, d) simulated values at the recording's times [SI].
        threshold: residual that counts, in standard deviations of the noise.

    Returns:
        The comparison of every channel of the recording.
    """
    if not threshold > 0.0:
        raise InputError("the threshold must be positive", field="threshold", value=threshold)
    if not recording.channels:
        raise InputError("the recording has no channel", field="channels")
    for name in predicted:
        if name not in recording.channels:
            raise InputError(
                f"the recording '{recording.name}' has no such channel",
                field="predicted",
                value=name,
                allowed=", ".join(recording.channels),
            )
    channels = {
        name: _compare_channel(channel, recording.times, predicted, threshold)
        for name, channel in recording.channels.items()
    }
    parted = [c for c in channels.values() if c.parting_time is not None]
    first = min(parted, key=lambda c: (c.parting_time, -abs(c.parting_residual or 0.0) / c.noise), default=None)
    return Comparison(
        name=recording.name,
        times=recording.times,
        channels=channels,
        threshold=threshold,
        first_channel=first.name if first else None,
        first_time=first.parting_time if first else None,
        by_step=recording.metadata.get("time_base") == "step",
    )


def first_parting(residual: np.ndarray, limit: float) -> tuple[int, float] | None:
    """Where a residual first exceeds a limit lastingly; see `compare` for the rule.

    Args:
        residual: (n,) residual; nan where missing, which is skipped.
        limit: the limit, positive.

    Returns:
        Index of the first value beyond the limit, and the median over the five values in which it lies; None if never.
    """
    seen = np.flatnonzero(np.isfinite(residual))
    width = min(PARTING_WINDOW, seen.size)
    if width == 0:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(residual[seen], width)
    medians = np.median(windows, axis=1)
    beyond = np.flatnonzero(np.abs(medians) > limit)
    if beyond.size == 0:
        return None
    start = int(beyond[0])
    sign = np.sign(medians[start])
    inside = int(np.flatnonzero(sign * windows[start] > limit)[0])
    return int(seen[start + inside]), float(medians[start])


def plot_overlay(comparison: Comparison, path: str | Path) -> Path:
    """Draw recording and simulation above, their residual with the noise band below, one column per component.

    Args:
        comparison: what to draw.
        path: the picture to write (.png, .svg or .pdf); it appears whole or not at all.

    Returns:
        The path written.
    """
    target = Path(path)
    formats = (".png", ".svg", ".pdf")
    if target.suffix.lower() not in formats:
        raise InputError("unknown kind of picture", field="path", value=str(path), allowed=", ".join(formats))
    partial = target.with_name(f".{target.stem}.{os.getpid()}.partial{target.suffix}")
    try:
        comparison.plot().savefig(partial)
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)
    return target


def _overlay(comparison: Comparison) -> "Figure":
    """The figure of `plot_overlay`."""
    from matplotlib.figure import Figure  # slow to import, only needed here

    panels = [(c, k) for c in comparison.channels.values() for k in range(c.recorded.shape[1])]
    columns = min(len(panels), 3)
    blocks = -(-len(panels) // columns)
    figure = Figure(figsize=(max(5.2 * columns, 7.0), 4.6 * blocks + 0.7), dpi=120, layout="constrained")
    figure.suptitle(textwrap.fill(comparison.sentence(), 55 * max(columns, 2)), fontsize=10, color=_INK)
    grid = figure.subplots(
        2 * blocks, columns, sharex=True, squeeze=False, gridspec_kw={"height_ratios": [2.0, 1.0] * blocks}
    )
    for index, (channel, component) in enumerate(panels):
        block, column = divmod(index, columns)
        _draw_channel(grid[2 * block, column], grid[2 * block + 1, column], comparison, channel, component)
    for index in range(len(panels), blocks * columns):
        block, column = divmod(index, columns)
        grid[2 * block, column].set_visible(False)
        grid[2 * block + 1, column].set_visible(False)
    return figure


def _compare_channel(
    channel: Channel, times: np.ndarray, predicted: Mapping[str, np.ndarray], threshold: float
) -> ChannelComparison:
    if channel.name not in predicted:
        raise InputError(
            f"the simulation does not predict channel '{channel.name}'",
            field="predicted",
            value=sorted(predicted),
            allowed="every channel of the recording",
        )
    simulated = np.asarray(predicted[channel.name], dtype=float)
    if simulated.shape != channel.values.shape:
        raise InputError(
            f"the prediction of channel '{channel.name}' has another shape than the recording",
            field="predicted",
            value=simulated.shape,
            allowed=str(channel.values.shape),
        )
    recorded = channel.values.reshape(len(times), -1)
    simulated = simulated.reshape(recorded.shape)
    lost = np.flatnonzero(~np.isfinite(simulated).all(axis=1))
    if lost.size:
        raise InputError(
            f"the prediction of channel '{channel.name}' is not finite from t = {times[lost[0]]:.6g} s",
            field="predicted",
        )
    residual = recorded - simulated
    seen = np.isfinite(residual)
    if not seen.any():
        raise InputError(f"channel '{channel.name}' has no recorded value to compare", field="channels")
    scatter = float(np.sqrt(np.nansum((recorded - np.nanmean(recorded, axis=0)) ** 2)))
    norm = float(np.sqrt(np.nansum(residual**2)))
    partings = [p for p in (first_parting(column, threshold * channel.noise) for column in residual.T) if p is not None]
    index, size = min(partings, key=lambda p: (p[0], -abs(p[1])), default=(None, None))
    return ChannelComparison(
        name=channel.name,
        kind=channel.kind,
        unit=channel.unit,
        noise=channel.noise,
        recorded=recorded,
        predicted=simulated,
        rmse=norm / float(np.sqrt(np.count_nonzero(seen))),
        nrmse=norm / scatter if scatter > 0.0 else float("nan"),
        parting_time=None if index is None else float(times[index]),
        parting_residual=size,
    )


def _draw_channel(above, below, comparison: Comparison, channel: ChannelComparison, component: int) -> None:
    """Draw one component into two axes that share their time axis."""
    times = comparison.times
    label = channel.name
    if channel.recorded.shape[1] > 1:
        label += " " + "xyz"[component]
    recorded, predicted = channel.recorded[:, component], channel.predicted[:, component]
    residual = channel.residual[:, component]
    size = float(np.nanmax(np.abs(np.concatenate([recorded, predicted]))))
    factor, unit = (1.0, channel.unit) if channel.unit == "rad" else with_prefix(size, channel.unit)
    above.plot(times, factor * recorded, color=_RECORDED, linewidth=1.8)
    above.plot(times, factor * predicted, color=_SIMULATED, linewidth=1.0)
    above.set_ylabel(f"{label} [{unit}]")
    above.set_title(f"fit {_fit_text(channel.fit)}", loc="right", fontsize=9, color=_INK)
    above.annotate("recording", (0.0, 1.02), xycoords="axes fraction", color=_RECORDED, fontsize=9, weight="bold")
    above.annotate("simulation", (0.24, 1.02), xycoords="axes fraction", color=_SIMULATED, fontsize=9, weight="bold")

    limit = comparison.threshold * channel.noise
    largest = float(np.nanmax(np.abs(residual)))
    factor, unit = with_prefix(max(largest, limit), channel.unit)
    if largest > 30.0 * limit:  # on a linear scale neither the band nor the parting could be seen
        size = np.abs(residual)
        below.semilogy(times, factor * np.where(size > 0.0, size, np.nan), color=_INK, linewidth=0.8)
        below.set_ylim(0.2 * factor * channel.noise, 2.0 * factor * largest)
        below.axhspan(0.2 * factor * channel.noise, factor * limit, color=_BAND, linewidth=0, zorder=0)
        below.set_ylabel(f"|residual| [{unit}]")
    else:
        below.plot(times, factor * residual, color=_INK, linewidth=0.8)
        below.axhspan(-factor * limit, factor * limit, color=_BAND, linewidth=0, zorder=0)
        below.set_ylabel(f"residual [{unit}]")
    below.set_xlabel("load step" if comparison.by_step else "time [s]")
    below.tick_params(labelbottom=True)
    below.set_title(
        f"grey: ±{comparison.threshold:g} × noise ({quantity(channel.noise, channel.unit)})",
        loc="right",
        fontsize=8,
        color=_INK,
    )
    if channel.parting_time is not None:
        for axes in (above, below):
            axes.axvline(channel.parting_time, color=_PARTING, linewidth=1.2, linestyle="--")
        low, high = above.get_ylim()
        above.set_ylim(low - 0.1 * (high - low), high)  # room for the label below the curves
        right = channel.parting_time > 0.6 * times[-1] + 0.4 * times[0]
        above.annotate(
            f"part at {comparison.instant(channel.parting_time)}",
            (channel.parting_time, 0.02),
            xycoords=("data", "axes fraction"),
            xytext=(-4 if right else 4, 0),
            textcoords="offset points",
            ha="right" if right else "left",
            color=_PARTING,
            fontsize=9,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.01)


def _fit_text(fit: float) -> str:
    return "undefined" if np.isnan(fit) else f"{fit:.1f} %"


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _numbers(values: np.ndarray) -> list[list[float | None]]:
    return [[_number(value) for value in row] for row in values.tolist()]
