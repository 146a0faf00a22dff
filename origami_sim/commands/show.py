"""`origami-sim show`: a picture of a device with its numbers and names, which sidecars and settings refer to."""

from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.design.design_file import write_design
from origami_sim.device.device import device_module, source_of
from origami_sim.device.scene import scene_settings
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.results.run_folder import format_table

FLAT = 0.02
"""Height over longest side below which a device is drawn from above, and otherwise from the front, right and above.

Half would draw the stacked feet and patches of a flat sheet aslant, double hide a shallow dome.
"""

PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp")
"""Suffixes of what is drawn."""

VIEW = (0.5, -1.0, 0.8)
"""Direction from the device to whoever looks at it aslant."""

PANELS, MAGNETIC, VALLEY, MOUNTAIN, CREASE = "#dfe7ee", "#eadcf2", "#1f6fb2", "#c8342b", "#555555"
MAGNET, ELECTRODE, FOOT, HELD, NODE = "#7a3b9e", "#e08a00", "#1b7f4b", "#000000", "#8a8a8a"


def run(args: Namespace) -> dict[str, Any]:
    """The command: draws, saves the design if asked to, and returns tables and files."""
    picture = None if args.out is None else Path(args.out)
    if picture is not None and picture.suffix.lower() not in PICTURES:
        raise InputError("is no picture", field="--out", value=args.out, allowed=", ".join(PICTURES))
    module = device_module(args.device)
    name = module.__name__.rpartition(".")[2]
    settings = scene_settings(module).override(args.set, "--set")
    model, parameters, drive, *_ = module.build(settings)
    found: dict[str, Any] = {**tables(model, parameters), "notes": getattr(module, "noted", [])}
    if args.save:
        if Path(args.save).suffix != ".toml":
            raise InputError("a design is a TOML file", field="--save", value=args.save, allowed="my_flap.toml")
        stated: dict[str, Any] = {n: float(settings[n].value) for n in ("duration", "rate") if n in settings}
        stated |= settings.how
        about = " ".join((module.__doc__ or "").split("\n\n")[0].split())
        found["design"] = str(write_design(args.save, source_of(module, settings), drive, **stated, about=about))
    drawn = draw(model, parameters, picture or Path(f"runs/show/{name}.png"), drive=drive, title=name)
    return {**found, "picture": str(drawn)}


def text(found: dict[str, Any]) -> str:
    """What `run` found, to read."""
    parts = [
        f"{n}\n{format_table(t)}\n" for n, t in found.items() if isinstance(t, dict) and len(next(iter(t.values())))
    ]
    said = [f"design: {found['design']}"] if "design" in found else []
    return "\n".join([*parts, *found.get("notes", []), *said, f"picture: {found['picture']}"])


def tables(model: Model, parameters: Parameters) -> dict[str, dict[str, list]]:
    """Panels, creases and contact points, with numbers, names and nodes."""
    panels = range(model.panel_count)
    creases = range(len(model.creases))
    corners = [np.unique(model.triangles[model.triangle_panel == p]).tolist() for p in panels]
    poles = _magnets(model, parameters)
    marks = _marks(model, parameters)
    return {
        "panels": {
            "panel": list(panels),
            "name": [model.name("panel", p) for p in panels],
            "nodes": [", ".join(map(str, c)) for c in corners],
            "magnet_along": [_words(poles[p]) if p in poles else "" for p in panels],
        },
        "creases": {
            "crease": list(creases),
            "name": [model.name("crease", c) for c in creases],
            "nodes": [f"{j}, {k}" for _, j, k, _ in model.creases.tolist()],
            "marks": [marks[c] for c in creases],
        },
        "feet and contact points": {
            "contact": [k for k in range(len(model.contacts)) if _own(model, k)],
            "name": [model.name("contact", k) for k in range(len(model.contacts)) if _own(model, k)],
        },
    }


def draw(
    model: Model, parameters: Parameters, path: Path, *, drive: Drive | None = None, title: str = "", x=None
) -> Path:
    """Draws a device with the numbers of its panels, creases, nodes and feet, supports, magnets and electrodes.

    Args:
        x: positions [N, 3] [m] (default: the reference state).

    Returns:
        The picture, PNG or whatever its suffix says.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D

    x = 1e3 * (model.position if x is None else np.asarray(x))
    corners = np.unique(model.triangles)
    axes, words = _view(x[corners])
    flat = x @ axes[:2].T
    span = np.ptp(flat[corners], axis=0)
    width = float(np.clip(3.0 * np.sqrt(model.panel_count), 8.0, 16.0))
    height = float(np.clip(width * (span[1] + 0.1 * span[0]) / max(span[0], 1e-9), 3.0, 14.0))
    figure, ax = plt.subplots(figsize=(width, height + 1.2), layout="constrained")
    order = np.argsort((x[model.triangles].mean(axis=1) @ axes[2]), kind="stable")
    poles, marks = _magnets(model, parameters), _marks(model, parameters)
    shade = _shading(x, model, axes[2])
    ax.add_collection(
        PolyCollection(
            [*flat[model.triangles[order]]],
            facecolors=[
                _toned(MAGNETIC if int(model.triangle_panel[t]) in poles else PANELS, float(shade[t])) for t in order
            ],
            edgecolors="face",
            linewidths=0.3,
        )
    )
    edges = np.sort(np.concatenate([model.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    pairs, counts = np.unique(edges, axis=0, return_counts=True)
    for a, b in pairs[counts == 1]:
        ax.plot(*flat[[a, b]].T, color="#222222", lw=1.0, zorder=2)
    shown: dict[str, Line2D] = {}
    for c, (_, j, k, _) in enumerate(model.creases.tolist()):
        colour = {"valley": VALLEY, "mountain": MOUNTAIN}.get(marks[c].partition(",")[0], CREASE)
        if "electrodes" in marks[c]:
            ax.plot(*flat[[j, k]].T, color=ELECTRODE, lw=6, alpha=0.6, solid_capstyle="butt", zorder=2)
            shown["electrodes, by group"] = Line2D([], [], color=ELECTRODE, lw=6, alpha=0.6)
        ax.plot(*flat[[j, k]].T, color=colour, lw=1.8, zorder=3)
        shown.setdefault(marks[c].partition(",")[0] or "crease", Line2D([], [], color=colour, lw=1.8))
    size = _letters(flat[corners], model, width)
    points = 0.8 * 72 * width / max(span[0], 1e-9)  # of the picture, per millimetre
    for p in range(model.panel_count):
        own = model.triangles[model.triangle_panel == p]
        middle = flat[own].mean(axis=(0, 1))
        name = model.name("panel", p)
        room = points * np.ptp(flat[own][..., 0])
        label = f"{p} {name}" if name != f"panel {p}" and _fits(f"{p} {name}", 1.3 * size, room) else f"{p}"
        ax.annotate(label, middle, (0, 0.9 * size), textcoords="offset points", ha="center", va="center",
                    fontsize=1.3 * size, weight="bold", color="#223344", zorder=6)  # fmt: skip
        if p in poles:
            along = poles[p] @ axes[:2].T
            along = along * 0.4 * np.ptp(flat[own].reshape(-1, 2) @ along) / max(float(along @ along), 0.01)
            ax.annotate("", middle + along, middle - along, zorder=5,
                        arrowprops={"arrowstyle": "-|>", "color": MAGNET, "lw": 1.6, "alpha": 0.7})  # fmt: skip
            shown["magnet, S to N"] = Line2D([], [], color=MAGNET, lw=1.6, marker=">")
    for c, (_, j, k, _) in enumerate(model.creases.tolist()):
        name = model.name("crease", c)
        group = f" ({marks[c].rpartition(' ')[2]})" if "electrodes" in marks[c] else ""
        along = flat[k] - flat[j]
        full = f"c{c} {name}{group}"
        room = points * float(np.linalg.norm(along))
        label = full if name != f"crease {c}" and _fits(full, size, room) else f"c{c}{group}"
        label = label if _fits(label, size, 2 * room) else f"c{c}"
        turn = (np.degrees(np.arctan2(along[1], along[0])) + 89.9) % 180 - 89.9
        ax.annotate(label, tuple(flat[j] + 0.32 * along), ha="center", va="center", fontsize=size, color="#8b3a00",
                    rotation=turn, rotation_mode="anchor", zorder=7,
                    bbox={"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.8})  # fmt: skip
    ax.plot(*flat[corners].T, ".", color=NODE, ms=3, zorder=4)
    for n in corners:
        small = {"fontsize": 0.8 * size, "color": "#444444", "zorder": 5}
        ax.annotate(str(n), tuple(flat[n]), (3, 2), textcoords="offset points", **small)
    held = corners[np.any(model.free[corners] == 0, axis=1)]
    if len(held):
        fully = np.all(model.free[held] == 0, axis=1)
        for which, marker, label in ((fully, "s", "held"), (~fully, "D", "held along some axes")):
            if np.any(which):
                ax.plot(*flat[held[which]].T, marker, color=HELD, ms=5, mfc="none", zorder=4)
                shown[label] = Line2D([], [], color=HELD, marker=marker, ls="", mfc="none")
    feet: dict[tuple[float, float], list[str]] = {}
    for k in range(len(model.contacts)):
        if _own(model, k):
            at = (model.contact_weights[k, :, None] * flat[model.contacts[k]]).sum(axis=0)
            name = model.name("contact", k)
            feet.setdefault((round(float(at[0]), 3), round(float(at[1]), 3)), []).append(
                str(k) if name == f"contact {k}" else name
            )
    for at, names in feet.items():
        ax.plot(*at, "^", color=FOOT, ms=9, alpha=0.8, zorder=4)
        ax.annotate(", ".join(names), at, (0, -12), textcoords="offset points", ha="center",
                    fontsize=0.9 * size, color=FOOT, zorder=7)  # fmt: skip
        shown["foot, contact"] = Line2D([], [], color=FOOT, marker="^", ls="")
    ax.set_aspect("equal")
    margin = 0.08 * span.max()
    low, high = flat[corners].min(axis=0) - margin, flat[corners].max(axis=0) + margin
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel=words[0], ylabel=words[1], title=title)
    ax.set_facecolor("white")
    labels = {"crease" if n == "flat" else n: line for n, line in shown.items()}
    labels["node"] = Line2D([], [], color=NODE, marker=".", ls="")
    figure.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=140, bbox_inches="tight")
    plt.close(figure)
    return path


def _view(x: np.ndarray) -> tuple[np.ndarray, tuple[str, str]]:
    """Right, up and towards the eye [3, 3], and labels of the axes."""
    size = np.ptp(x, axis=0)
    if size[2] <= FLAT * size.max():
        return np.eye(3), ("x [mm]", "y [mm], seen from above")
    eye = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross((0, 0, 1), eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye]), ("[mm], seen from the front, right and above", "[mm]")


def _shading(x: np.ndarray, model: Model, eye: np.ndarray) -> np.ndarray:
    """Brightness of the triangles, 1 where they face the eye."""
    a, b, c = np.moveaxis(x[model.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    return 0.72 + 0.28 * np.abs(normal @ eye) / np.linalg.norm(normal, axis=1)


def _toned(colour: str, brightness: float) -> tuple[float, float, float]:
    red, green, blue = (brightness * int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _fits(text: str, size: float, room: float) -> bool:
    """Whether letters of a size have room [pt]; elsewhere the tables have the names."""
    return 0.62 * size * len(text) <= room


def _letters(flat: np.ndarray, model: Model, width: float) -> float:
    """Size of letters [pt]: a third of a panel's usual width, within 4 and 9."""
    span = np.ptp(flat, axis=0).max()
    share = np.sqrt(np.prod(np.maximum(np.ptp(flat, axis=0), 1e-9)) / max(model.panel_count, 1)) / span
    return float(np.clip(0.22 * share * width * 72, 4.0, 9.0))


def _own(model: Model, contact: int) -> bool:
    """Whether a contact point was stated, and is not one of those that `Sheet.ground` gives to every node."""
    return not model.name("contact", contact).startswith(("node ", "patch on "))


def _words(direction: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.2g}" for v in np.round(direction, 3) + 0.0) + ")"


def _magnets(model: Model, parameters: Parameters) -> dict[int, np.ndarray]:
    """Direction (3,) of the magnetisation in the reference state, by panel."""
    out: dict[int, np.ndarray] = {}
    for effect in ("magnetic_torque", "magnetic_torque_affine"):
        own = parameters.of(effect)
        if not own or "poling_1" not in own:
            continue
        x1, x2, x3 = np.moveaxis(model.position[model.triangles], 1, 0)
        normal = np.cross(x2 - x1, x3 - x1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        a, b, n = (own[f"poling_{k}"][:, :1] for k in "12n")
        flat = a * (x2 - x1) + b * (x3 - x1)
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        moment = own["remanence"][:, :1] * own["volume"][:, :1] * (np.sqrt(1 - n**2) * flat + n * normal)
        for p in np.unique(model.triangle_panel[np.any(moment, axis=1)]):
            total = moment[model.triangle_panel == p].sum(axis=0)
            out[int(p)] = total / (np.linalg.norm(total) or 1.0)
    return out


def _marks(model: Model, parameters: Parameters) -> list[str]:
    """Of each crease whether it goes to a valley or a mountain, and its electrode group."""
    target = np.zeros(len(model.creases))
    for effect, name in (("crease", "rest_angle"), ("crease_drive", "target_angle")):
        if (effect, name) in parameters:
            target = target + parameters[effect, name][:, 0]
    words = np.where(target > 1e-6, "valley", np.where(target < -1e-6, "mountain", "flat"))
    stack = parameters.of("maxwell_stress")
    live = (stack["layers"] * stack["width"])[:, 0] > 0 if stack else np.zeros(len(target), bool)
    return [
        f"{w}, electrodes of group {g}" if on else str(w)
        for w, on, g in zip(words, live, model.electrodes[: len(target)], strict=True)
    ]
