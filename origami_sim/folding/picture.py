"""A picture of a folding: the pattern, the way and the end, drawn without a viewer."""

from pathlib import Path

import numpy as np

from .fold import Folding

COLOURS = {"M": "#d62728", "V": "#1f77b4", "B": "#222222", "C": "#2ca02c"}
LIGHT = np.array([0.3, -0.4, 0.85])
TOP, BELOW = np.array([0.98, 0.90, 0.72]), np.array([0.72, 0.82, 0.95])
"""Colours of the two sides of the sheet."""
FRAMES = (0.0, 0.4, 0.7, 1.0)
"""Shares of the target angles that are drawn."""


def draw(folding: Folding, path: str | Path) -> Path:
    """Draw a folding into a PNG file: mountains red, valleys blue, the top side warm and the lower side cold.

    Args:
        folding: what folded. path: the file.

    Returns:
        The path.
    """
    from matplotlib.figure import Figure  # slow to import, only needed here

    figure = Figure(figsize=(4.0 * len(FRAMES), 4.2), dpi=110, layout="constrained")
    for n, share in enumerate(FRAMES):
        frame = int(np.argmin(np.abs(folding.shares - share)))
        axes = figure.add_subplot(1, len(FRAMES), n + 1, projection="3d")
        _draw(axes, folding, folding.x[frame])
        axes.set_title(f"{folding.shares[frame]:.0%} of the angles", fontsize=10)
    figure.savefig(path)
    return Path(path)


def _draw(axes, folding: Folding, x) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    mesh, pattern = folding.sheet.mesh, folding.sheet.pattern
    corners = x[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    azimuth, height = np.radians(-60.0), np.radians(40.0)
    eye = np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
    colour = np.where((normals @ eye > 0)[:, None], TOP, BELOW)
    shade = 0.65 + 0.35 * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    axes.add_collection3d(
        Poly3DCollection(corners, facecolors=np.clip(colour * shade[:, None], 0, 1), edgecolors="none")
    )
    creases = x[mesh.creases[:, 1:3]]
    letters = [pattern.assignments[e] for e in mesh.crease_edge]
    axes.add_collection3d(
        Line3DCollection(creases, colors=[COLOURS.get(n, "#999999") for n in letters], linewidths=0.6)
    )
    middle, reach = 0.5 * (x.max(axis=0) + x.min(axis=0)), 0.5 * float(np.ptp(x, axis=0).max())
    for n, axis in enumerate("xyz"):
        getattr(axes, f"set_{axis}lim")(middle[n] - 0.8 * reach, middle[n] + 0.8 * reach)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=np.degrees(height), azim=np.degrees(azimuth))
    axes.set_axis_off()
