"""The folded pattern as a model of the catalogue's effects and a trajectory: run folders, replays, exports."""

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.drive import Drive, ramp
from origami_sim.model import Model, Parameters, State
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.timestep import AT_REST, TimeStep

from .fold import Folding


def model_of(
    folding: Folding, *, thickness: float, material: str, crease_stiffness: float
) -> tuple[Model, Parameters, Drive]:
    """Return the model of which the frames of a folding are equilibria, under a load that grows from 0 to 1.

    Effects: bars, crease, crease_drive and panel_bending, with the ratios of stiffness that the folding used.

    Args:
        folding: what folded.
        thickness: of panels for which the pattern gives none [m]. material: likewise, for the mass.
        crease_stiffness: of each metre of a driven crease [N m/rad per m].
    """
    elastic = folding.sheet
    mesh, creases = elastic.mesh, len(elastic.mesh.creases)
    # folded without contact, a shape that is given may lie in itself
    sheet = Sheet(
        elastic.pattern, thickness=thickness, material=material, triangulation="diagonal", membrane_damping=0.0,
        overlapping=True,
    )  # fmt: skip
    membrane = crease_stiffness / (folding.softness * np.median(elastic.lengths) * elastic.size)  # E t [N/m]
    stiffness = folding.softness * elastic.weights * membrane * elastic.size**2
    way = np.where(elastic.driven, elastic.target - elastic.start, 0.0)
    beyond = np.abs(way) > np.pi  # more than the drive's range: such a crease starts at its target
    rest = np.where(beyond, elastic.target, elastic.start)
    way = np.where(beyond, 0.0, way)
    sheet.crease(stiffness=stiffness[:creases])
    sheet.set("crease_drive", drive_stiffness=stiffness[:creases], target_angle=way[:creases])
    sheet.name("crease", [f"edge {e}" for e in mesh.crease_edge])
    model, parameters = sheet.build()
    parameters.set("crease", "rest_angle", np.clip(rest[:creases], -np.pi, np.pi))
    parameters.set("bars", "stiffness", membrane * elastic.sections / elastic.lengths)
    if len(mesh.bends):
        parameters.set("panel_bending", "stiffness", stiffness[creases:])
        parameters.set("panel_bending", "rest_angle", rest[creases:])
    return model, parameters, Drive(load=ramp(1.0, 1.0))


def trajectory_of(folding: Folding, model: Model, parameters: Parameters, drive: Drive) -> Trajectory:
    """Return the frames of a folding as a trajectory at rest: its times are shares of the targets, in seconds."""
    x = folding.x[:, :, None, :]
    angles = folding.angles[:, :, None]
    state = State.at_rest(model, 1, folding.x[-1])
    state.angles[:] = angles[-1]
    zero = np.zeros_like(x)
    return Trajectory(
        model=model,
        parameters=parameters,
        drive=drive,
        times=folding.shares,
        x=x,
        v=zero,
        angles=angles,
        energies=_energies(folding, model, parameters),
        work={n: np.zeros((len(x), 1)) for n in model.laws},
        gaps=np.zeros((len(x), 0, 1)),
        contact_forces=zero,
        failures=[],
        dt=float(np.diff(folding.shares).min(initial=1.0)),
        step=TimeStep(np.inf, np.inf, 0, AT_REST),
        state=state,
        wall=folding.wall,
    )


def _energies(folding: Folding, model: Model, parameters: Parameters) -> dict[str, np.ndarray]:
    """Return the energies [F, 1] of the effects [J], by their formulas; see `effects`."""
    creases, angles = len(model.creases), folding.angles
    ends = folding.x[:, model.bars[:, 1]] - folding.x[:, model.bars[:, 0]]
    stretch = np.linalg.norm(ends, axis=2) - parameters["bars", "rest_length"][:, 0]
    moment = (parameters["crease_drive", "drive_stiffness"] * parameters["crease_drive", "target_angle"])[:, 0]
    turn = angles[:, :creases] - parameters["crease", "rest_angle"][:, 0]
    out = {
        "kinetic": np.zeros(len(angles)),
        "bars": 0.5 * stretch**2 @ parameters["bars", "stiffness"][:, 0],
        "crease": 0.5 * turn**2 @ parameters["crease", "stiffness"][:, 0],
        "crease_drive": -folding.shares * (angles[:, :creases] @ moment),
    }
    if "panel_bending" in model.effects:
        bend = angles[:, creases:] - parameters["panel_bending", "rest_angle"][:, 0]
        out["panel_bending"] = 0.5 * bend**2 @ parameters["panel_bending", "stiffness"][:, 0]
    return {n: v[:, None] for n, v in out.items()}
