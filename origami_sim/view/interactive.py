"""A device to turn and play in a page: data and a small WebGL viewer inside the file, no network, no library.

Positions are 16-bit steps of the box around all frames, a 65,000th of its size.
"""

import base64
import html
import json
from pathlib import Path

import numpy as np

from origami_sim.view.film import BAND, Film
from origami_sim.view.palette import COLOURS, scaled

FRAMES, BYTES = 240, 1_500_000
"""Frames at most, and bytes of positions at most: a page of six devices stays below 10 MB."""

CODE = Path(__file__).with_name("interactive.js")


def scripts() -> str:
    """The viewer's code, once per page."""
    return f"<script>{CODE.read_text(encoding='utf-8')}</script>"


def figure(film: Film, caption: str = "") -> str:
    """A figure with the viewer of one film; the page must hold `scripts()` once, after its figures."""
    data = json.dumps(_data(film), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return (
        f"<figure class='viewer'><canvas tabindex='0' aria-label='{html.escape(film.title, quote=True)}, to be turned'>"
        "</canvas><div class='bar'><button type='button'>play</button>"
        "<input type='range' min='0' max='1000' value='0' aria-label='time'><output></output></div>"
        f"<script type='application/json'>{data}</script>"
        f"<figcaption>{html.escape(caption)} Drag to turn; Ctrl and wheel, or two fingers, to zoom. Red: mountains, "
        "blue: valleys.</figcaption></figure>"
    )


def _data(film: Film) -> dict:
    model = film.model
    nodes, place = np.unique(
        np.concatenate([model.triangles.ravel(), film.outlines().ravel(), model.creases[:, 1:3].ravel()]).astype(int),
        return_inverse=True,
    )
    count = int(np.clip(BYTES // (6 * len(nodes)), 2, FRAMES))
    frames = np.unique(np.linspace(0, len(film.times) - 1, min(count, len(film.times))).round().astype(int))
    x = film.x[frames][:, nodes]
    low, high = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    step = float((high - low).max()) / 65535.0 or 1.0
    triangles, rest = place[: model.triangles.size], place[model.triangles.size :]
    outlines, creases = rest[: film.outlines().size], rest[film.outlines().size :]
    electrodes = film.electrode_nodes()
    out = {
        "title": film.title,
        "times": np.round(film.times[frames], 5).tolist(),
        "nodes": len(nodes),
        "low": low.tolist(),
        "step": step,
        "x": _text(np.round((x - low) / step).astype("<u2")),
        "triangles": triangles.tolist(),
        "colours": [list(COLOURS[k]) for k in film.kinds],
        "outlines": outlines.tolist(),
        "creases": creases.tolist(),
        "folds": _text(film.folds()[frames].round().astype(np.uint8)),
        "size": film.size,
        "box": [film.low.tolist(), film.high.tolist()],
        "across": film.across,
        "band": BAND,
        "electrodes": [[*np.searchsorted(nodes, n).tolist(), int(c)] for n, c in zip(*electrodes, strict=True)],
    }
    origins, vectors, labels = film.arrows()
    if labels:
        out["poling"] = np.round(np.concatenate([origins, vectors], axis=2)[frames], 6).tolist()
    field = np.stack([film.channel(f"field_{i}") for i in "xyz"], axis=1)[frames]
    largest = float(np.linalg.norm(field, axis=1).max(initial=0.0))
    if largest > 0:
        unit, factor = scaled("T", largest, "m")
        out["field"] = {
            "at": film.field_origin().tolist(),
            "vector": np.round(field / largest, 4).tolist(),
            "said": [f"B = {factor * b:.0f} {unit}" for b in np.linalg.norm(field, axis=1)],
        }
    voltage = np.abs(film.voltages()[frames])
    if voltage.size and voltage.max() > 0:
        out["voltage"] = {
            "live": np.round(voltage / voltage.max(), 3).tolist(),
            "said": [f"V = {v:.0f} V" for v in voltage.max(axis=1)],
        }
    if len(model.contacts):
        out["ground"] = {"up": film.up.tolist(), "height": film.height, "step": film.step}
    return out


def _text(array: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
