"""`origami-sim run PATTERN`: fold the crease pattern in a file and say whether it got there."""

import json
import math
from pathlib import Path

from origami_sim.device.scene import Settings
from origami_sim.errors import InputError
from origami_sim.pattern.mesh import FORMATS as MESHES
from origami_sim.results.run_folder import check_writable, format_table, save_run

from .elastic import BEND
from .fold import Folding, fold
from .motion import model_of, trajectory_of
from .picture import draw
from .reading import read
from .summary import Summary, summarise

REACHED, MISSED = 0, 1
"""Exit codes."""
CALIBRATION = "pattern"
UNITS = {"x_mm": "mm", "y_mm": "mm", "target_deg": "deg", "angle_deg": "deg", "error_deg": "deg"}


def check(args) -> None:
    """Raise `InputError` for what only scenes can do, and for files that give no fold to go to."""
    for name in ("panels", "until", "accuracy"):
        if getattr(args, name) is not None:
            raise InputError(
                "a pattern folds through equilibria of elastic panels and has no such option",
                field=f"--{name}",
                value=getattr(args, name),
                allowed="--set, --calibration, --touch, --no-touch, --out",
            )
    if not Path(args.scene).is_file():
        raise InputError("no such file", file=args.scene)
    if Path(args.scene).suffix.lower() in MESHES:
        raise InputError(
            "a mesh has a shape, but no fold to go to",
            file=args.scene,
            allowed="FOLD with edges_assignment or edges_foldAngle, .cp, .opx, DXF, or SVG as for Origami Simulator; "
            "in Python, Sheet(read_mesh(file)) keeps the shape",
        )


def run(args, settings: Settings, progress) -> int:
    """Fold args.scene with settings of `calibrations/pattern.toml`, save and print; returns the exit code."""
    path = Path(args.scene)
    folder = Path(args.out or f"runs/{path.stem}")
    check_writable(folder)
    pattern = read(path, size=settings.size or None, scale=settings.scale or None, merge=settings.merge or None)
    try:
        folding = fold(
            pattern,
            steps=round(settings.steps),
            tolerance=settings.tolerance,
            thickness=settings.thickness,
            touch=args.touch,
            progress=progress,
        )
    except InputError as e:
        if e.file is None:
            raise InputError(f"{path}: {e}".removesuffix(".")) from None
        raise
    found = summarise(folding)
    model, parameters, drive = model_of(
        folding,
        thickness=settings.thickness,
        material=settings.material,
        crease_stiffness=settings.crease_stiffness,
    )
    motion = trajectory_of(folding, model, parameters, drive)
    motion.notes = [*pattern.notes, *found.sentences]
    overrides = dict(o.split("=", 1) for o in args.set)
    save_run(
        folder,
        motion,
        scene=path.stem,
        tables={"creases": found.creases},
        units=UNITS,
        settings={**settings.as_dict(), "pattern": str(path), "overrides": overrides},
    )
    draw(folding, folder / "folded.png")
    _tell(args, folding, found, folder, [*pattern.notes])
    return REACHED if found.reached else MISSED


def _tell(args, folding: Folding, found: Summary, folder: Path, notes: list[str]) -> None:
    sheet = folding.sheet
    if args.json:
        numbers = {n: v if math.isfinite(v) else None for n, v in found.numbers.items()}
        out = {"reached": found.reached, "reason": found.reason, "numbers": numbers, "folder": str(folder)}
        print(json.dumps({**out, "notes": [*notes, *found.sentences]}, allow_nan=False))
        return
    for note in notes:
        print(f"note: {note}")
    if len(found.worst["edge"]):
        print(format_table(found.worst, UNITS))
    for sentence in found.sentences:
        print(sentence)
    print(
        f"Quasi-static: {len(folding.shares)} frames of {len(sheet.mesh.triangles)} triangles in {folding.wall:.1f} s; "
        f"stiffness of creases over that of the sheet in its plane: {folding.softness:g}, of panels' bending over that "
        f"of creases: {BEND:g}; run folder: {folder}"
    )
