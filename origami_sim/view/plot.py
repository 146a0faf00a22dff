"""Plots by Matplotlib: how a run moved, what drove it, and the plan of a model."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from origami_sim.errors import InputError
from origami_sim.model import Model, dihedral_angles
from origami_sim.view.film import Film, outlines
from origami_sim.view.palette import COLOURS, PLOTTED, SERIES, scaled

if TYPE_CHECKING:
    from origami_sim.solve.motion.dynamics import Trajectory

INK = "#3c424a"
STEPS = [1, 2, 2.5, 5, 10]  # of ticks
_DRIVES = (
    ("field_", "field", "T", "m"),
    ("voltage_", "voltage", "V", ""),
    ("load", "load factor", "", ""),
    ("temperature", "temperature rise", "K", ""),
)
NUMBERED = 120
"""Nodes up to which a plan numbers everything by default; twice as many overlap at the usual size."""


def hexadecimal(colour: tuple[int, ...]) -> str:
    """A colour of the palette as Matplotlib reads it."""
    return "#" + "".join(f"{c:02x}" for c in colour)


def plot_trajectory(trajectory: "Trajectory", *, world: int = 0) -> Figure:
    """Fold angles, displacement of the node that moves most, and the drive of one world, over time.

    Raises:
        InputError: there is no such world.
    """
    film = Film(trajectory, world)
    times = film.times
    rows = []  # (name of the axis, [(label, values)])
    angles = np.degrees(trajectory.creases[:, :, world])
    shown = np.sort(np.argsort(-np.ptp(angles, axis=0))[:PLOTTED]) if angles.size else []
    if len(shown):
        more = f", the {len(shown)} of {angles.shape[1]} that move most" if angles.shape[1] > len(shown) else ""
        names = [film.model.name("crease", c) for c in range(angles.shape[1])]
        labels = [n if names.count(n) == 1 else f"{n} {c}" for c, n in enumerate(names)]
        rows.append((f"fold angle [deg]{more}", [(labels[c], angles[:, c]) for c in shown]))
    moved = film.x[:, film.tip] - film.x[0, film.tip]
    unit, factor = scaled("m", float(np.abs(moved).max(initial=0.0)), "m")
    if np.any(moved):
        rows.append((f"node {film.tip} [{unit}]", [(a, factor * moved[:, i]) for i, a in enumerate("xyz")]))
    for prefix, title, of, usual in _DRIVES:
        driven = {n: film.channel(n) for n in film.channels() if n.startswith(prefix)}
        driven = {n: v for n, v in driven.items() if np.any(v != 0)}
        if driven and not (prefix == "load" and all(np.ptp(v) == 0 for v in driven.values())):
            unit, factor = scaled(of, max(float(np.abs(v).max()) for v in driven.values()), usual) if of else ("", 1.0)
            rows.append((f"{title} [{unit or '-'}]", [(n.replace("_", " "), factor * v) for n, v in driven.items()]))
    figure = Figure(figsize=(7.0, 0.6 + 1.9 * max(1, len(rows))), layout="constrained")
    for axes, (name, lines) in zip(
        np.atleast_1d(figure.subplots(max(1, len(rows)), 1, sharex=True)), rows, strict=False
    ):
        for i, (label, values) in enumerate(lines):
            axes.plot(times, values, color=hexadecimal(SERIES[i % len(SERIES)]), linewidth=1.2, label=label)
        first, _, rest = name.partition(", ")
        axes.set_ylabel(first)
        if rest:
            axes.set_title(rest, loc="left", fontsize=8, color=INK)
        readable(axes)
        if len(lines) > 1:
            axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.axes[-1].set_xlabel("time [s]")
    return figure


def readable(axes) -> None:
    """At least four ticks on both axes, faint lines at them, no box."""
    axes.xaxis.set_major_locator(MaxNLocator(nbins=7, min_n_ticks=4, steps=STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6, min_n_ticks=4, steps=STEPS))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)


def plot_model(model: Model, *, numbers: bool | None = None) -> Figure:
    """The plan of a model, seen from the top: panels, creases, contacts, held nodes, with their numbers.

    Creases of the reference state are coloured as mountains and valleys where they are folded there.

    Args:
        numbers: whether panels (roman), creases and nodes (small) are numbered; default: of small models.
    """
    if len(model.triangles) == 0:
        raise InputError("the model has no panel to draw", field="triangles", value=0, allowed="at least one")
    numbers = len(model.position) <= NUMBERED if numbers is None else numbers
    used = np.unique(model.triangles)
    spread = np.ptp(model.position[used], axis=0)
    one, two = sorted(np.argsort(-spread, kind="stable")[:2])  # the plane in which it is widest
    unit, factor = scaled("m", float(spread.max()), "m")
    x = factor * model.position[:, [one, two]]
    wide, high = (max(float(s), 0.15 * float(spread.max())) for s in (spread[one], spread[two]))
    figure = Figure(figsize=(7.0, float(np.clip(7.0 * high / wide, 1.8, 8.0)) + 0.5), layout="constrained")
    axes = figure.subplots()
    axes.add_collection(
        PolyCollection(
            list(x[model.triangles]), facecolors=hexadecimal(COLOURS["passive"]), edgecolors="none", alpha=0.55
        )
    )
    axes.add_collection(LineCollection(list(x[outlines(model)]), colors=INK, linewidths=0.8))
    angles = dihedral_angles(model.position[:, None], model.creases)[:, 0] if len(model.creases) else np.zeros(0)
    kinds = ["crease" if abs(a) < 1e-6 else "valley" if a > 0 else "mountain" for a in angles]
    axes.add_collection(
        LineCollection(list(x[model.creases[:, 1:3]]), colors=[hexadecimal(COLOURS[k]) for k in kinds], linewidths=2.0)
    )
    held = used[~model.free[used].any(axis=1)]
    axes.plot(*x[held].T, "^", color=INK, markersize=6, label="held", linestyle="none")
    if len(model.contacts):
        feet = np.einsum("kc,kci->ki", model.contact_weights, x[model.contacts])
        axes.plot(*feet.T, "o", color=hexadecimal(COLOURS["contact"]), markersize=4, label="contact", linestyle="none")
    if numbers:
        _number(axes, model, x, used)
    if len(held) or len(model.contacts):
        axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.04)
    axes.set_xlabel(f"{'xyz'[one]} [{unit}]")
    axes.set_ylabel(f"{'xyz'[two]} [{unit}]")
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _number(axes, model: Model, x: np.ndarray, used: np.ndarray) -> None:
    """Writes the numbers of panels, creases and nodes at their places [N, 2]."""
    for p in range(model.panel_count):
        mine = model.triangles[model.triangle_panel == p]
        if len(mine):  # below the middle, where a node may be
            (a, b), below = x[mine].mean(axis=(0, 1)), {"xytext": (0, -9), "textcoords": "offset points"}
            axes.annotate(
                str(p), (a, b), ha="center", va="center", fontsize=11, weight="bold", color="#33506b", **below
            )
    for c, (_, j, k, _) in enumerate(model.creases.tolist()):
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
        a, b = 0.5 * (x[j] + x[k])
        axes.annotate(str(c), (a, b), ha="center", va="center", fontsize=8, color="#a02020", bbox=box)
    for n in used.tolist():
        a, b = x[n]
        axes.annotate(str(n), (a, b), fontsize=6, color=INK, xytext=(2, 2), textcoords="offset points")
