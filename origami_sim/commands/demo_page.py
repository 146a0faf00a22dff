"""The page that a demonstration leaves: per device a film, a view to turn, tables and plots; no network needed."""

import base64
import html
import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import numpy as np
from matplotlib.figure import Figure

from origami_sim.device.scene import Outcome
from origami_sim.observation.compare import Comparison, plot_overlay
from origami_sim.results.run_folder import format_table
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.view.export import between
from origami_sim.view.film import Film
from origami_sim.view.interactive import figure, scripts
from origami_sim.view.moving import moving_picture
from origami_sim.view.palette import SERIES
from origami_sim.view.plot import hexadecimal, plot_trajectory, readable

WIDTH, HEIGHT = 480, 300  # of films [px]
FILMED = 3.0
"""Seconds of a motion that its film shows at most; all of it is in the view beside it."""

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; margin: .5rem 0; }
h2 { font-size: 1.25rem; margin-top: 2.5rem; border-top: 1px solid #ddd; padding-top: 1rem; }
img { max-width: 100%; height: auto; } code { background: #f3f3f3; padding: .1em .3em; overflow-wrap: anywhere; }
.films { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: .75rem; }
.films a { color: inherit; text-decoration: none; border: 1px solid #ddd; border-radius: 6px; overflow: hidden; }
.films img { display: block; width: 100%; } .films span { display: block; padding: .3rem .7rem; font-size: .9rem; }
figure { margin: 1rem 0; } figcaption { font-size: .85rem; color: #555; }
.viewer canvas { display: block; width: 100%; height: min(26rem, 70vw); border: 1px solid #ddd; border-radius: 6px;
  touch-action: pan-y; cursor: grab; box-sizing: border-box; }
.viewer .bar { display: flex; flex-wrap: wrap; gap: .3rem .7rem; align-items: center; margin: .4rem 0; }
.viewer input { flex: 1 1 8rem; min-width: 0; } .viewer output { font: .85rem ui-monospace, monospace; }
.viewer button { min-width: 4.5rem; padding: .25rem .6rem; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); gap: 1rem;
  align-items: start; }
pre { background: #f7f7f7; padding: .8rem; overflow-x: auto; font-size: .85rem; }
.bad { color: #b00020; font-weight: 600; }
"""


@dataclass
class Section:
    """What the page shows of one scene.

    Attributes:
        film: a WebP. view: the figure to be turned, as HTML. plots: PNG files with their captions.
        text: tables. sentences: what was found. failures: worlds that went unstable. commands: what to try next.
    """

    name: str
    about: str
    text: str
    sentences: list[str]
    commands: list[str]
    film: bytes = b""
    view: str = ""
    plots: list[tuple[str, bytes]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, name: str, module: ModuleType, outcome: Outcome, folder: Path) -> "Section":
        """The section of a device that was run."""
        motion = outcome.trajectory
        out = cls(
            name,
            _first_line(module),
            "\n\n".join(format_table(t, outcome.units) for t in outcome.tables.values()),
            outcome.summary,
            [f"origami-sim replay {folder}", f"origami-sim export {folder} --to {name}.glb"],
            failures=[str(f) for f in motion.failures],
        )
        out._show(motion)
        table_name, table = next(iter(outcome.tables.items()))
        out.plots = [(f"table '{table_name}'", _plot(table, outcome.units)), ("in time", _png(plot_trajectory(motion)))]
        return out

    @classmethod
    def of_comparison(
        cls, name: str, module: ModuleType, comparison: Comparison | None, motion: Trajectory, note: str, folder: Path,
        commands: list[str],
    ) -> "Section":  # fmt: skip
        """The section of a recording laid beside a simulation; of the motion alone where that went unstable."""
        failures = [str(f) for f in motion.failures]
        commands = [f"origami-sim replay {folder}", *commands]
        out = cls(name, _first_line(module), "", [note + "."], commands, failures=failures)
        if comparison is not None:
            overlay = plot_overlay(comparison, folder / "overlay.png").read_bytes()
            out.text, out.plots = comparison.table(), [("recording and simulation", overlay)]
            out.sentences.append(comparison.sentence())
        out._show(motion)
        return out

    def _show(self, motion: Trajectory):
        if not len(motion.model.triangles):
            return
        start = float(motion.times[0])
        part = Film(between(motion, start, start + FILMED), title=self.name)
        self.film = moving_picture(part, ".webp", width=WIDTH, height=HEIGHT, rate=15)
        self.view = figure(Film(motion, title=self.name))


def write_report(path: Path, sections: list[Section]) -> Path:
    """Writes the page in one piece; films, views, plots and code are inside it."""
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
        f"<title>origami_sim demonstration</title><style>{_STYLE}</style><h1>origami_sim demonstration</h1>"
        "<p>Each device was simulated just now. Click a film for its numbers, and a view that you can turn.</p>"
        "<div class='films'>"
    ]
    for s in sections:
        if s.film:
            parts.append(
                f"<a href='#{html.escape(s.name)}'>{_image(f'{s.name} moving', s.film, 'webp')}"
                f"<span><b>{html.escape(s.name)}</b>: {html.escape(s.about)}</span></a>"
            )
    parts.append("</div>")
    for s in sections:
        parts.append(f"<h2 id='{html.escape(s.name)}'>{html.escape(s.name)}</h2><p>{html.escape(s.about)}</p>")
        parts += [f"<p>{html.escape(t)}</p>" for t in s.sentences]
        parts += [f"<p class='bad'>{html.escape(t)}</p>" for t in s.failures]
        parts.append(s.view)
        plots = [
            f"<figure>{_image(f'{s.name}: {caption}', png, 'png')}"
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            for caption, png in s.plots
        ]
        parts.append(f"<div class='plots'>{''.join(plots)}</div>" if len(plots) > 1 else "".join(plots))
        parts.append(f"<pre>{html.escape(s.text)}</pre>")
        parts += [f"<p><code>{html.escape(c)}</code></p>" for c in s.commands]
    parts.append(scripts())
    work = path.with_suffix(".tmp")
    work.write_text("".join(parts) + "</html>", encoding="utf-8")
    os.replace(work, path)
    return path


def _image(alt: str, data: bytes, kind: str) -> str:
    size = f" width='{WIDTH}' height='{HEIGHT}'" if kind == "webp" else ""
    return f"<img alt='{html.escape(alt)}'{size} src='data:image/{kind};base64,{base64.b64encode(data).decode()}'>"


def _first_line(module: ModuleType) -> str:
    return (module.__doc__ or "").strip().splitlines()[0]


def _png(drawn: Figure) -> bytes:
    data = io.BytesIO()
    drawn.savefig(data, format="png", dpi=110)
    return data.getvalue()


def _plot(table: dict, units: dict[str, str]) -> bytes:
    """The numeric columns of a table against its first, those of one unit in one plot, references as crosses."""
    (x_name, x), *columns = table.items()
    by_unit: dict[str, list[tuple[str, np.ndarray]]] = {}
    for name, given in columns:
        values = np.asarray(given)
        if values.dtype.kind in "fiu" and not name.startswith(("difference", "spread")):
            unit = units.get(name) or (name.rsplit("_", 1)[1] if "_" in name else "")
            by_unit.setdefault(unit, []).append((name, values))
    drawn = Figure(figsize=(7.0, 0.5 + 2.4 * max(1, len(by_unit))), layout="constrained")
    panels = np.atleast_1d(drawn.subplots(max(1, len(by_unit)), 1, sharex=True))
    for axes, (unit, lines) in zip(panels, by_unit.items(), strict=False):
        for i, (name, values) in enumerate(lines):
            reference = name.startswith(("reference", "target"))
            mark = "x" if reference else "o" if x_name == "crease" else "o-"
            axes.plot(
                x, values, mark, markersize=8 if reference else 4, markeredgewidth=2,
                color="#222222" if reference else hexadecimal(SERIES[i % len(SERIES)]), label=name.replace("_", " "),
                zorder=3 if reference else 2, linewidth=1.3,
            )  # fmt: skip
        axes.set_ylabel(f"[{unit}]" if unit else "")
        readable(axes)
        axes.legend(frameon=False, fontsize=8)
    panels[-1].set_xlabel(x_name.replace("_", " "))
    return _png(drawn)
