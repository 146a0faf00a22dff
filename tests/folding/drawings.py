"""Small drawings that the tests fold."""

from pathlib import Path

INK = {"B": "#000000", "M": "#ff0000", "V": "#0000ff", "F": "#ffff00", "C": "#00ff00", "U": "#ff00ff"}


def drawn(path: Path, lines, opacity: float = 1.0) -> Path:
    """Write lines (letter, x1, y1, x2, y2[, opacity]) as an SVG file with y upwards."""
    rows = [
        f'<line x1="{x1}" y1="{-y1}" x2="{x2}" y2="{-y2}" stroke="{INK[letter]}" '
        f'stroke-opacity="{(rest or [opacity])[0]}"/>'
        for letter, x1, y1, x2, y2, *rest in lines
    ]
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg">' + "".join(rows) + "</svg>")
    return path


def frame(width: float, height: float, x: float = 0.0, y: float = 0.0):
    """Border of a rectangle."""
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    return [("B", *a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
