"""What models and runs say of themselves: one line in a terminal, a table with a picture in a notebook."""

import base64
import html
import io
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from origami_sim.model import Model
    from origami_sim.solve.motion.dynamics import Trajectory

WIDTH, HEIGHT = 420, 260  # of pictures in notebooks [px]


def counted(count: int, noun: str) -> str:
    """A number with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def model_line(model: "Model") -> str:
    """A model in one line."""
    parts = [
        counted(model.panel_count, f"{model.panels} panel"),
        counted(len(model.creases), "crease"),
        counted(len(model.position), "node"),
        *([counted(len(model.contacts), "contact")] if len(model.contacts) else []),
    ]
    return f"<Model: {', '.join(parts)}; effects {', '.join(model.effects) or 'none'}>"


def trajectory_line(t: "Trajectory") -> str:
    """A run in one line, with what went wrong."""
    worlds = f", {t.x.shape[2]} worlds" if t.x.shape[2] > 1 else ""
    failed = f"; {counted(len(t.failures), 'world')} went unstable" if t.failures else ""
    noted = f"; {counted(len(t.notes), 'note')}" if t.notes else ""
    kind = type(t).__name__
    return (
        f"<{kind}: {counted(len(t.times), 'frame')}, {t.times[0]:g} to {t.times[-1]:g} s{worlds}, "
        f"dt = {t.dt:.3g} s, {counted(len(t.model.creases), 'crease')}{failed}{noted}>"
    )


def model_html(model: "Model") -> str:
    """A model as a table and its plan."""
    from origami_sim.view.plot import plot_model

    rows = {
        "panels": f"{model.panel_count} ({model.panels})",
        "creases": len(model.creases),
        "nodes": f"{len(model.position)}, {int((~model.free.any(axis=1)).sum())} held",
        "contacts": len(model.contacts),
        "effects": ", ".join(model.effects) or "none",
    }
    picture = picture_of(plot_model(model)) if len(model.triangles) else b""
    return card("Model", rows, picture, "image/png")


def trajectory_html(t: "Trajectory") -> str:
    """A run as a table and a moving picture of its first world."""
    from origami_sim.view.export import until_failure
    from origami_sim.view.film import Film
    from origami_sim.view.moving import moving_picture

    angle = np.degrees(t.creases[-1, :, 0]) if len(t.model.creases) else np.zeros(0)
    rows = {
        "time": f"{t.times[0]:g} to {t.times[-1]:g} s, {counted(len(t.times), 'frame')}",
        "worlds": t.x.shape[2],
        "step": str(t.step),
        "fold angles at the end": f"{angle.min():.1f} to {angle.max():.1f} deg" if angle.size else "no crease",
        **{f"world {f.world}": str(f) for f in t.failures[:3]},
        **{f"note {i + 1}": n for i, n in enumerate(t.notes)},
    }
    film = Film(until_failure(t, 0)) if len(t.model.triangles) else None
    moving = moving_picture(film, ".webp", rate=12, seconds=min(4.0, max(1.0, float(t.times[-1] - t.times[0]))),
                            width=WIDTH, height=HEIGHT) if film is not None else b""  # fmt: skip
    return card(type(t).__name__, rows, moving, "image/webp")


def picture_of(figure: "Figure") -> bytes:
    """A figure as a PNG file."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=80)
    return out.getvalue()


def card(title: str, rows: dict, picture: bytes, kind: str) -> str:
    """A table of texts with a picture in it, as HTML."""
    cells = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(str(v))}</td></tr>" for k, v in rows.items())
    image = f"<img alt='{html.escape(title)}' src='data:{kind};base64,{base64.b64encode(picture).decode()}'>"
    return f"<div><b>{html.escape(title)}</b><table>{cells}</table>{image if picture else ''}</div>"
