"""A crease pattern from a file as a motion in time, driven towards its target angles.

For patterns that fold rigidly; `origami-sim run my.fold` folds any, without a choice of stiffness and time.

python -m origami_sim.scenes.fold_file
origami-sim run fold_file --set pattern=my.fold
"""

from importlib import resources
from pathlib import Path

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, motion_of
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.pattern import Pattern, read_pattern
from origami_sim.pattern.mesh import FORMATS as MESHES

CALIBRATION = "fold_file"


def load(s: Settings) -> Pattern:
    """The pattern: a path, or a file that ships with the scenes; InputError for a mesh, which nothing folds."""
    path = Path(s.pattern)
    shipped = Path(str(resources.files("origami_sim.scenes") / s.pattern))
    pattern = read_pattern(shipped if not path.exists() and shipped.exists() else path)
    if path.suffix.lower() in MESHES:
        raise InputError(
            "a mesh has a shape, but no fold to go to",
            file=s.pattern,
            allowed="FOLD with edges_foldAngle, or SVG as for Origami Simulator; in Python, Sheet(read_mesh(file)) "
            "keeps the shape",
        )
    return pattern


def build(s: Settings) -> tuple[Model, Parameters, Drive, np.ndarray]:
    """Model, parameters, drive and the target angle of each crease [rad]."""
    pattern = load(s)
    sheet = Sheet(
        pattern, thickness=s.thickness, material=s.material, triangulation="diagonal", membrane=s.membrane,
        membrane_damping=0.1,
    )  # fmt: skip
    if not len(sheet.mesh.creases):
        raise InputError("the pattern has no crease to fold", file=s.pattern, field="edges_assignment")
    stiffness = np.where(np.isnan(sheet._crease_stiffness), s.crease_stiffness, sheet._crease_stiffness)
    target = np.nan_to_num(pattern.fold_angles[sheet.mesh.crease_edge])
    if not np.any(target):
        raise InputError(
            "the pattern gives no target angle",
            file=s.pattern,
            field="edges_foldAngle",
            allowed="degrees, valley positive",
        )
    sheet.crease(stiffness=stiffness, damping_ratio=s.damping_ratio)
    sheet.set("crease_drive", drive_stiffness=stiffness, target_angle=target - sheet._rest)
    sheet.set("crease_stop", stop_stiffness=stiffness)
    sheet.name("crease", [f"edge {e}" for e in sheet.mesh.crease_edge])
    sheet.set("mass_damping", decay_rate=s.decay_rate)
    model, parameters = sheet.build()
    return model, parameters, Drive(load=ramp(1.0, s.fold_time)), target


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    pattern = load(s)
    model, parameters, drive, target = build(s)
    motion = motion_of(s, model, parameters, drive, duration=s.fold_time + s.hold_time, rate=60, progress=progress)
    final = motion.creases[-1, :, 0]
    error = np.degrees(final - target)
    lengths = np.linalg.norm(model.position[model.bars[:, 1]] - model.position[model.bars[:, 0]], axis=1)
    now = np.linalg.norm(motion.x[-1, model.bars[:, 1], 0] - motion.x[-1, model.bars[:, 0], 0], axis=1)
    strain = float(np.abs(now / lengths - 1).max(initial=0.0))
    table = {"crease": np.arange(len(target)), "target_deg": np.degrees(target), "angle_deg": np.degrees(final)}
    return Outcome(
        motion,
        {"creases": table},
        summary=[
            *pattern.notes,
            f"{len(target)} creases folded to within {np.abs(error).max():.2f} deg of their targets; "
            f"largest membrane strain {strain:.2%}",
        ],
        numbers={"largest_error_deg": float(np.abs(error).max()), "largest_strain": strain},
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "fold_file"])
