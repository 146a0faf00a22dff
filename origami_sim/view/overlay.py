"""Replays of a diagnosis: the recorded object as outlines over simulations of it, before and after."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from origami_sim.model import Model
from origami_sim.view.film import outlines, unit
from origami_sim.view.palette import COLOURS, LIGHT, SERIES, scaled
from origami_sim.view.replay import BACKGROUND, Plot, Writer, slug, writing
from origami_sim.view.viewer import TIMELINE


@dataclass(frozen=True, eq=False)
class Overlay:
    """A recorded object and simulations of it, frame by frame.

    Attributes:
        model: topology. times: [F] [s]. recorded: [F, N, 3] node positions that the channels tell [m].
        films: "before" and "after": [F, N, 3] simulated [m].
        creases: the same names: [F, C] what parts the fold angles from the recorded [rad].
        panels: [F, P] rms distance of the panels' nodes from where they were recorded [m].
        note: a sentence on the simulations.
    """

    model: Model
    times: np.ndarray
    recorded: np.ndarray
    films: Mapping[str, np.ndarray]
    creases: Mapping[str, np.ndarray]
    panels: Mapping[str, np.ndarray]
    note: str = ""


class Compared(Protocol):
    """A component of a recording with predictions, as a diagnosis holds it."""

    component: str
    unit: str
    times: list[float]
    recorded: list[float]
    before: list[float]
    after: list[float]


RIGHT, WRONG = (172, 196, 216), (206, 44, 44)
"""Colours of what agrees with the recording, and of what is furthest from it."""


def write_overlay(path: str | Path, overlay: Overlay, series: Sequence[Compared], *, title: str) -> Path:
    """Writes a replay of two views, before and after, each with the recorded object as outlines on top.

    Creases and panels are coloured by what parts them from the recording, on one scale for both views.

    Args:
        path: the .rrd file. overlay: the frames. series: components to be plotted. title: shown in the viewer.

    Raises:
        InputError: a file that cannot be written.
    """
    digest = hashlib.sha256(repr((title, overlay.model.hash)).encode() + overlay.recorded.tobytes())
    with writing(path, "origami_sim diagnosis", digest.hexdigest()[:32]) as stream:
        out = Writer(stream)
        stream.send_recording_name(title)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        widest = [
            float(np.percentile(g["before"], 98)) if g["before"].size else 0.0
            for g in (overlay.creases, overlay.panels)
        ]
        for name, x in overlay.films.items():
            _write_film(overlay, name, x, widest, out)
        _write_series(series, out)
        unit, factor = scaled("m", widest[1], "m")
        text = (
            f"# {title}\n\nPink: the recorded object, as its channels tell. Solid: the simulation, as given (before) "
            "and with the best explanation (after).\n\nColours say what parts them, blue: nothing. Full red are "
            f"{np.degrees(widest[0]):.2g} deg at a crease, {factor * widest[1]:.2g} {unit} at a panel, in both views."
            f"\n\n{overlay.note}"
        )
        stream.log("notes", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        stream.send_blueprint(_overlay_blueprint(overlay, out))
    return Path(path).expanduser().absolute()


def _write_film(overlay: Overlay, name: str, x: np.ndarray, widest: Sequence[float], out: Writer):
    model, times = overlay.model, overlay.times
    corners = x[:, model.triangles]
    normal = unit(np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]))
    brightness = 0.58 + 0.42 * np.abs(normal @ (LIGHT / np.linalg.norm(LIGHT)))
    faces = _mixed(overlay.panels[name][:, model.triangle_panel], widest[1]) * brightness[:, :, None]
    out.moving(
        f"{name}/faces",
        times,
        rr.Mesh3D,
        static={"triangle_indices": np.arange(3 * len(model.triangles), dtype=np.uint32).reshape(-1, 3)},
        vertex_positions=corners.reshape(len(x), -1, 3),
        vertex_colors=np.repeat(faces.round().astype(np.uint8), 3, axis=1),
    )
    out.moving(
        f"{name}/creases",
        times,
        rr.LineStrips3D,
        static={"radii": [rr.Radius.ui_points(4.0)]},
        strips=x[:, model.creases[:, 1:3]],
        colors=_mixed(overlay.creases[name], widest[0]).round().astype(np.uint8),
    )
    edges = np.concatenate([outlines(model), model.creases[:, 1:3]])
    for who, positions, colour, width in (
        ("outlines", x, COLOURS["outline"], 0.8),
        ("recorded", overlay.recorded, COLOURS["marker"], 1.8),
    ):
        out.moving(
            f"{name}/{who}",
            times,
            rr.LineStrips3D,
            static={"radii": [rr.Radius.ui_points(width)], "colors": [colour]},
            strips=positions[:, edges],
        )


def _mixed(gap: np.ndarray, widest: float) -> np.ndarray:
    """Colours [..., 3] between RIGHT and WRONG."""
    share = np.clip(gap / widest, 0.0, 1.0)[..., None] if widest > 0 else np.zeros((*gap.shape, 1))
    return np.array(RIGHT) + share * (np.array(WRONG, float) - RIGHT)


def _write_series(series: Sequence[Compared], out: Writer):
    """Recorded and simulated components, and what is left; plots for the two that are most wrong before."""
    wrong = [float(np.nanstd(np.subtract(t.recorded, t.before)) / (np.nanstd(t.recorded) or 1.0)) for t in series]
    shown = np.argsort(wrong)[::-1][:2]
    for n, t in enumerate(series):
        usual = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "N": ("mN", 1e3)}
        unit, factor = usual.get(t.unit, (t.unit, 1.0))
        times, every = np.asarray(t.times, float), slice(None, None, max(1, len(t.times) // 3000))
        recorded = factor * np.asarray(t.recorded, float)
        plots = Plot(f"{t.component} ({unit})"), Plot(f"{t.component}: recorded less simulated ({unit})")
        for who, colour in (("recorded", COLOURS["marker"]), ("before", SERIES[1]), ("after", SERIES[0])):
            values = recorded if who == "recorded" else factor * np.asarray(getattr(t, who), float)
            kinds = [("", values, plots[0])] + [("left_", recorded - values, plots[1])] * (who != "recorded")
            for kind, y, plot in kinds:
                seen = np.isfinite(y)
                path = f"/channels/{slug(t.component)}/{kind}{who}"
                label = f"{who} ({unit})"
                out.series(path, label, times[seen][every], y[seen][every], colour, points=who == "recorded")
                plot.paths.append(path)
        if n in shown:
            out.plots += plots


def _overlay_blueprint(overlay: Overlay, out: Writer) -> rrb.Blueprint:
    every = np.concatenate([overlay.recorded, *overlay.films.values()])
    low, high = every.min(axis=(0, 1)), every.max(axis=(0, 1))
    across = 0 if high[0] - low[0] >= 0.8 * (high[1] - low[1]) else 1
    towards = unit(np.array([0.45, -1.0, 0.35]) if across == 0 else np.array([1.0, 0.45, 0.35]))
    target, radius = (low + high) / 2, 0.5 * float(np.linalg.norm(high - low))
    controls = rrb.EyeControls3D(position=target + 2.0 * radius * towards, look_target=target, eye_up=(0.0, 0.0, 1.0))
    views = [
        rrb.Spatial3DView(
            origin="/",
            name={"before": "Before: as given", "after": "After: best explanation"}.get(name, name) + " (m)",
            background=BACKGROUND,
            line_grid=False,
            contents=[f"+ /{name}/**"],
            eye_controls=controls,
        )
        for name in overlay.films
    ]
    plots = [
        rrb.TimeSeriesView(
            origin="/",
            name=p.name,
            contents=[f"+ {path}" for path in p.paths],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )
        for p in out.plots
    ]
    about = rrb.TextDocumentView(origin="/notes", name="About")
    below = rrb.Horizontal(*plots, about)
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(*views), below, row_shares=[5, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="Playing", loop_mode="All"),
    )
