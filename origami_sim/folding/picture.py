"""A picture of a folding: the pattern, the way and the end, drawn without a viewer."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .fold import Folding

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"M": "#d62728", "V": "#1f77b4"}
OTHER = "#888888"
"""Colours of mountains, valleys and other creases."""
TOP, BELOW = np.array([0.98, 0.90, 0.72]), np.array([0.72, 0.82, 0.95])
"""Colours of the two sides of the sheet."""
LIGHT = np.array([0.33, -0.44, 0.84])
AZIMUTH, HEIGHT = np.radians(-60.0), np.radians(40.0)
"""Where the light comes from and the eye is."""
FRAMES = (0.0, 0.4, 0.7, 1.0)
"""Shares of the target angles that are drawn."""


def draw(folding: Folding, path: str | Path) -> Path:
    """Draw a folding into a PNG file: mountains red, valleys blue, the top side warm and the lower side cold.

    Args:
        folding: what folded. path: the file.

    Returns:
        The path.
    """
    figure_of(folding).savefig(path)
    return Path(path)


def figure_of(folding: Folding) -> "Figure":
    """Return the sheet on its way as a figure; see `draw`."""
    from matplotlib.figure import Figure  # slow to import, only needed here

    figure = Figure(figsize=(3.6 * len(FRAMES), 3.8), dpi=110, layout="constrained")
    for axes, share in zip(figure.subplots(1, len(FRAMES)), FRAMES, strict=True):
        frame = int(np.argmin(np.abs(folding.shares - share)))
        _draw(axes, folding, folding.x[frame])
        axes.set_title(f"{folding.shares[frame]:.0%} of the angles", fontsize=10)
    return figure


def _draw(axes, folding: Folding, x) -> None:
    """Draw one shape by the painter's algorithm: from back to front, a crease after the panels beside it."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgba_array

    mesh, letters = folding.sheet.mesh, folding.sheet.pattern.assignments
    eye = np.array([np.cos(AZIMUTH) * np.cos(HEIGHT), np.sin(AZIMUTH) * np.cos(HEIGHT), np.sin(HEIGHT)])
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    screen = x @ np.column_stack([right, np.cross(eye, right)])
    corners = x[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    side = np.where((normals @ eye > 0)[:, None], TOP, BELOW)
    faces = to_rgba_array(np.clip(side * (0.65 + 0.35 * np.abs(normals @ LIGHT))[:, None], 0.0, 1.0))
    inks = to_rgba_array([COLOURS.get(letters[e], OTHER) for e in mesh.crease_edge])
    near = corners.mean(axis=1) @ eye
    tip = {side: t for t, (a, b, c) in enumerate(mesh.triangles.tolist()) for side in ((a, b), (b, c), (c, a))}
    beside = np.array([[tip[j, k], tip[k, j]] for _, j, k, _ in mesh.creases.tolist()], dtype=np.int64).reshape(-1, 2)
    order = np.argsort(np.concatenate([near, near[beside].max(axis=1)]), kind="stable")
    colours = np.concatenate([faces, inks])[order]
    shapes = np.concatenate([screen[mesh.triangles], screen[mesh.creases[:, [1, 2, 2]]]])
    widths = np.repeat([0.3, 0.9], [len(faces), len(inks)])
    pieces = PolyCollection(list(shapes[order]))
    pieces.set(facecolors=colours, edgecolors=colours, linewidths=widths[order])
    axes.add_collection(pieces)
    middle, reach = 0.5 * (screen.max(axis=0) + screen.min(axis=0)), 0.55 * float(np.ptp(screen, axis=0).max())
    axes.set(xlim=middle[0] + reach * np.array([-1, 1]), ylim=middle[1] + reach * np.array([-1, 1]), aspect="equal")
    axes.set_axis_off()
