"""Crease patterns: read them from FOLD, SVG, DXF, .cp, .opx and meshes, build them, triangulate them."""

from pathlib import Path

from ..errors import InputError
from .build import cross, grid, kresling, miura, strip, waterbomb
from .cp import read_cp
from .crease_pattern import ASSIGNMENTS, Pattern
from .dxf import read_dxf
from .fold import read_fold, write_fold
from .mesh import cut, read_mesh, sheet, uncreased, write_mesh
from .opx import read_opx
from .svg import read_svg
from .topology import open_cuts
from .triangulate import Triangulation, hinge_angles, triangulate

__all__ = [
    "ASSIGNMENTS",
    "Pattern",
    "Triangulation",
    "cross",
    "cut",
    "grid",
    "hinge_angles",
    "kresling",
    "miura",
    "open_cuts",
    "read_cp",
    "read_dxf",
    "read_fold",
    "read_mesh",
    "read_opx",
    "read_pattern",
    "read_svg",
    "sheet",
    "strip",
    "triangulate",
    "uncreased",
    "waterbomb",
    "write_fold",
    "write_mesh",
]

DRAWN = {".svg": read_svg, ".dxf": read_dxf, ".cp": read_cp, ".opx": read_opx}
"""Readers of drawings, by suffix."""
READERS = {".fold": read_fold, **DRAWN, ".obj": read_mesh, ".stl": read_mesh}


def read_pattern(path, *, size=None, scale=None) -> Pattern:
    """Read a crease pattern by the file's suffix, with the defaults of its reader.

    Args:
        path: FOLD, SVG, DXF, .cp, .opx, OBJ or STL file.
        size: longest side of the pattern [m]. scale: length of one unit of the file [m], instead of `size`. Without
            either, the file's own physical unit holds; patterns without one become 0.2 m, meshes are in metres.

    Raises:
        InputError: unknown suffix, missing file, both size and scale, or what the reader refuses.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in READERS:
        raise InputError("unknown pattern format", file=path, field="suffix", value=suffix, allowed=", ".join(READERS))
    if not Path(path).is_file():
        raise InputError("no such file", file=path)
    return READERS[suffix](path, size=size, scale=scale)
