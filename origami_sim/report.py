"""The page that a demonstration leaves: one section per scene, with its table, plot and picture, no network needed."""

import base64
import html
import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from origami_sim.compare import Comparison, plot_overlay
from origami_sim.replay import screenshot
from origami_sim.results import format_table
from origami_sim.scene import Outcome

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; border-top: 1px solid #ddd; padding-top: 1rem; }
img { max-width: 100%; border: 1px solid #ddd; margin: .5rem 0; } code { background: #f3f3f3; padding: .1em .3em; }
pre { background: #f7f7f7; padding: .8rem; overflow-x: auto; font-size: .85rem; }
.bad { color: #b00020; font-weight: 600; }
"""


@dataclass
class Section:
    """What the page shows of one scene; `pictures` are PNG files as bytes with their captions."""

    name: str
    about: str
    text: str
    sentences: list[str]
    replay: str
    pictures: list[tuple[str, bytes]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, name: str, module: ModuleType, outcome: Outcome, folder: Path) -> "Section":
        tables = "\n\n".join(format_table(t, outcome.units) for t in outcome.tables.values())
        out = cls(
            name,
            _first_line(module),
            tables,
            outcome.summary,
            f"origami-sim replay {folder}",
            failures=[str(f) for f in outcome.trajectory.failures],
        )
        table = next(iter(outcome.tables.values()))
        out.pictures = [*_picture(folder), ("first table, drawn", _plot(table))]
        return out

    @classmethod
    def of_comparison(cls, name: str, module: ModuleType, comparison: Comparison, note: str, folder: Path) -> "Section":
        overlay = plot_overlay(comparison, folder / "overlay.png").read_bytes()
        return cls(
            name,
            _first_line(module),
            comparison.table(),
            [note + ".", comparison.sentence()],
            f"origami-sim replay {folder}",
            [*_picture(folder), ("recording and simulation", overlay)],
        )


def write_report(path: Path, sections: list[Section]) -> Path:
    """Writes the page in one piece; every picture is inside it."""
    parts = [
        f"<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
        f"<title>origami_sim demonstration</title><style>{_STYLE}</style><h1>origami_sim demonstration</h1>"
    ]
    for s in sections:
        parts.append(f"<h2 id='{html.escape(s.name)}'>{html.escape(s.name)}</h2><p>{html.escape(s.about)}</p>")
        parts += [f"<p>{html.escape(t)}</p>" for t in s.sentences]
        parts += [f"<p class='bad'>{html.escape(t)}</p>" for t in s.failures]
        for caption, png in s.pictures:
            data = base64.b64encode(png).decode()
            parts.append(
                f"<img alt='{html.escape(s.name)}: {html.escape(caption)}' src='data:image/png;base64,{data}'>"
            )
        parts.append(f"<pre>{html.escape(s.text)}</pre><p>Replay: <code>{html.escape(s.replay)}</code></p>")
    work = path.with_suffix(".tmp")
    work.write_text("".join(parts) + "</html>", encoding="utf-8")
    os.replace(work, path)
    return path


def _first_line(module: ModuleType) -> str:
    return (module.__doc__ or "").strip().splitlines()[0]


def _picture(folder: Path) -> list[tuple[str, bytes]]:
    """The replay's picture, where a renderer is present; it stays in the run folder too."""
    target = folder / "screenshot.png"
    taken = screenshot(folder / "replay.rrd", target, note=lambda _: None)
    return [("replay", target.read_bytes())] if taken else []


def _plot(table: dict) -> bytes:
    """The numeric columns of a table against its first."""
    (x_name, x), *columns = table.items()
    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    for name, values in columns:
        values = np.asarray(values)
        if values.dtype.kind in "fiu" and not name.startswith(("difference", "spread")):
            reference = name.startswith(("reference", "target"))
            axes.plot(x, values, "x" if reference else "o-", label=name, markersize=7 if reference else 4)
    axes.set_xlabel(x_name)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    plt.close(figure)
    return data.getvalue()
