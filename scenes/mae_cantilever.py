"""Cantilever of magneto-active elastomer, magnetised along its length, in a field across it.

    python -m origami_sim.scenes.mae_cantilever

The strip is a chain of cells that bend at their borders. The border at the clamp stands for half a cell and is twice
as stiff; with that the chain converges in second order to the elastica EI th'' + A M B cos th = 0. The strip bends in
the x-z plane: y is held, which changes nothing in a plane motion and leaves out the twist.

A real beam (Zhao et al. 2019) has the same settings in another file:

    origami-sim run mae_cantilever --calibration calibrations/magnetic_beam.toml
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.design.beams import along_strip, as_beam, diagonal_share
from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, motion_of
from origami_sim.drive import Drive, Signal, ramp, sine
from origami_sim.model import Model, Parameters
from origami_sim.pattern import strip
from origami_sim.physics.materials import MU0

CALIBRATION = "mae_cantilever"
SHARES = np.array([0.1, 0.2, 0.3, 0.5, 0.75, 1.0])
"""Fields of the table over the field of the calibration."""

REFERENCE_LOAD = 37.769
REFERENCE = np.array([0.7286, 0.9198, 1.0077, 1.0969, 1.1537, 1.1879])
"""Tip displacement over length at SHARES for a magnetic load of REFERENCE_LOAD: elastica, solved independently."""

MESHES = (5, 10, 20, 40)
"""Cells of the mesh study."""


def magnetic_load(s: Settings, field: float) -> float:
    """lambda = A M B L^2 / EI [-]: the only number that the shape of a weightless beam depends on."""
    return 12 * s.remanence * field / (MU0 * s.modulus) * (s.length / s.thickness) ** 2


def direction(s: Settings) -> np.ndarray:
    """Unit vector of a positive field: along z, tilted by the misalignment towards x."""
    return np.array([np.sin(s.misalignment), 0.0, np.cos(s.misalignment)])


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """One held cell, then the beam, with x along it and its root at x = 0."""
    cells = round(s.cells)
    cell = s.length / cells
    sheet = Sheet(
        strip([cell] * (cells + 1), s.width),
        thickness=s.thickness,
        modulus=s.modulus,
        density=s.density,
        triangulation="diagonal",
        membrane_damping=s.membrane_damping,
    )
    sheet.fix(panels=[0]).fix(nodes=range(2 * (cells + 2)), axes="y")
    sheet.panel(np.arange(cells + 1), rigidity=s.twist * s.modulus * s.thickness**3 / 12)
    # the diagonals carry the moment too and take this share of the cell's bending; borders take the rest
    share = diagonal_share(cell, s.width) / s.twist
    bending = s.modulus * s.width * s.thickness**3 / 12 / cell / (1 - share)
    at_clamp = np.isclose(sheet.mesh.vertices[sheet.mesh.creases[:, 1], 0], cell)
    span = np.where(at_clamp, 0.5, 1.0) * cell  # of the beam, that a hinge stands for
    sheet.crease(stiffness=bending * cell / span, rest_angle=s.natural_curvature * span, loss_time=s.loss_time)
    sheet.name("crease", along_strip(sheet, "station"))
    for panel in range(1, cells + 1):
        sheet.magnetise(panel, remanence=s.remanence, volume=cell * s.width * s.thickness, poling=(1, 0, 0))
    sheet.gravity((0, 0, -s.gravity)).set("mass_damping", decay_rate=s.decay_rate)
    model, parameters = sheet.build()
    model.position[:, 0] -= cell
    as_beam(model, parameters, s.modulus * s.width * s.thickness)
    return model, parameters, drive(s)


def drive(s: Settings) -> Drive:
    along = direction(s)
    wave: list[Signal] = [ramp(s.field * a, 1.5) if s.mode == "ramp" else sine(s.field * a, s.frequency) for a in along]
    return Drive(field=wave)


def shape(x: np.ndarray, length: float) -> dict[str, float]:
    """Tip angle [deg], and over the length: tip position x/L, y/L and displacement R/L; x [N, 3]."""
    tip, before = x[-2:].mean(axis=0), x[-4:-2].mean(axis=0)
    along, across = tip[0] / length, tip[2] / length
    return {
        "tip_deg": float(np.degrees(np.arctan2(*(tip - before)[[2, 0]]))),
        "x_over_l": float(along),
        "y_over_l": float(across),
        "r_over_l": float(np.hypot(1 - along, across)),
    }


def bend(s: Settings, fields: Sequence[float] | np.ndarray) -> tuple[dict[str, np.ndarray], list[str]]:
    """Equilibrium shapes by statics, each field [T] from the shape in the one before it; and what failed."""
    model, parameters, _ = build(s)
    drives = [Drive(field=tuple(b * direction(s))) for b in fields]
    values, notes = follow(model, parameters, drives, lambda x: np.array(list(shape(x, s.length).values())))
    names = shape(model.position, s.length)
    return {"field_mT": 1e3 * np.asarray(fields), **dict(zip(names, values.T, strict=True))}, notes


def mesh_study(s: Settings, meshes: Sequence[int] = MESHES) -> dict[str, np.ndarray]:
    """R/L in the largest field by number of cells, and the order of convergence from each three successive meshes."""
    path = s.field * np.array([0.1, 0.3, 1.0])
    r = np.array([bend(s.replace(cells=float(n)), path)[0]["r_over_l"][-1] for n in meshes])
    step = np.abs(np.diff(r))
    order = np.full(len(r), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # no field, no bending
        order[2:] = np.log(step[:-1] / step[1:]) / np.log(np.array(meshes[2:]) / np.array(meshes[1:-1]))
    return {"cells": np.array(meshes), "r_over_l": r, "order": np.where(np.isfinite(order), order, np.nan)}


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """Shape against field and mesh by statics, and the motion for the replay."""
    table, notes = bend(s, s.field * SHARES)
    plain = not s.gravity and not s.misalignment and not s.effects
    table["load"] = np.array([magnetic_load(s, abs(b)) for b in s.field * SHARES])
    if plain and abs(table["load"][-1] / REFERENCE_LOAD - 1) < 1e-3:
        table["reference"] = REFERENCE
        table["difference_percent"] = 100 * (table["r_over_l"] / REFERENCE - 1)
    study = mesh_study(s)
    model, parameters, signals = build(s.replace(cells=s.motion_cells))
    motion = motion_of(s, model, parameters, signals, duration=2.0, rate=60, progress=progress)
    last, final = table["r_over_l"][-1], shape(motion.x[-1, :, 0], s.length)["r_over_l"]
    return Outcome(
        motion,
        {"shape": {**table}, "mesh": {**study}},
        summary=[
            *notes,
            f"R/L = {last:.4f} in {s.field * 1e3:.0f} mT with {s.cells:.0f} cells by statics, {final:.4f} with "
            f"{s.motion_cells:.0f} at the end of the motion",
            f"convergence of order {study['order'][-1]:.2f}",
        ],
        numbers={
            "r_over_l": float(last),
            "dynamic_r_over_l": final,
            "order": float(study["order"][-1]),
            "load": float(table["load"][-1]),
        },
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "mae_cantilever"])
