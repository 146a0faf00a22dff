"""Discrete-hinge simulator for active origami.

The names below are loaded when they are first used, so that the package imports quickly.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from origami_sim.design.build import Sheet
    from origami_sim.design.design_file import Design, read_design, write_design
    from origami_sim.design.dielectric import Stack
    from origami_sim.design.shell import isotropic, orthotropic
    from origami_sim.device.device import device_module
    from origami_sim.device.scene import read_calibration, scene_module
    from origami_sim.diagnose import Diagnosis, Subject, diagnose
    from origami_sim.drive import Drive, Signal, ramp, series, sine
    from origami_sim.drive.gridded import FieldTable
    from origami_sim.drive.sources import coil, coil_pair, dipole, field_table, magnet
    from origami_sim.effects import CATALOGUE
    from origami_sim.errors import InputError
    from origami_sim.estimation.estimate import Estimate, estimate
    from origami_sim.explore import Found, Way, gradient, optimise, solve_for, sweep
    from origami_sim.model import Model, Parameters, State
    from origami_sim.model.bodies import rigid
    from origami_sim.pattern import (
        Pattern,
        cross,
        cut,
        grid,
        kresling,
        miura,
        read_fold,
        read_mesh,
        read_pattern,
        read_svg,
        sheet,
        strip,
        triangulate,
        uncreased,
        waterbomb,
        write_fold,
        write_mesh,
    )
    from origami_sim.physics.materials import MATERIALS, bridge_stiffness, layered_rigidity, material
    from origami_sim.quantities import si
    from origami_sim.recording import Recording, read_recording
    from origami_sim.results.run_folder import format_table, load_run, save_run
    from origami_sim.solve.kernels.sources import field_at
    from origami_sim.solve.motion.dynamics import Trajectory, simulate
    from origami_sim.solve.motion.quasistatic import QuasiStatic, quasistatic
    from origami_sim.solve.statics.equilibria import Equilibrium, Path, continuation, equilibrium
    from origami_sim.solve.timestep import stable_step
    from origami_sim.view.replay import write_replay
    from origami_sim.view.viewer import open_replay, screenshot

__version__ = "0.1.0"

_HOMES = {
    "model.bodies": "rigid",
    "design.build": "Sheet",
    "design.design_file": "Design read_design write_design",
    "device.device": "device_module",
    "design.dielectric": "Stack",
    "explore": "Found Way gradient optimise solve_for sweep",
    "quantities": "si",
    "diagnose": "Diagnosis Subject diagnose",
    "estimation.estimate": "Estimate estimate",
    "drive": "Drive Signal ramp series sine",
    "effects": "CATALOGUE",
    "errors": "InputError",
    "physics.materials": "MATERIALS bridge_stiffness layered_rigidity material",
    "model": "Model Parameters State",
    "pattern": "Pattern cross cut grid kresling miura sheet strip uncreased waterbomb triangulate "
    "read_fold read_mesh read_pattern read_svg write_fold write_mesh",
    "recording": "Recording read_recording",
    "view.replay": "write_replay",
    "view.viewer": "open_replay screenshot",
    "results.run_folder": "format_table load_run save_run",
    "device.scene": "read_calibration scene_module",
    "design.shell": "isotropic orthotropic",
    "drive.gridded": "FieldTable",
    "drive.sources": "coil coil_pair dipole field_table magnet",
    "solve.kernels.sources": "field_at",
    "solve.motion.dynamics": "Trajectory simulate",
    "solve.motion.quasistatic": "QuasiStatic quasistatic",
    "solve.statics.equilibria": "Equilibrium Path continuation equilibrium",
    "solve.timestep": "stable_step",
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = [  # noqa: RUF022  (by what they are for)
    # a sheet
    "Pattern", "cross", "cut", "grid", "kresling", "miura", "sheet", "strip", "uncreased", "waterbomb",
    "read_pattern", "read_fold", "read_svg", "read_mesh", "write_fold", "write_mesh", "triangulate",
    "Sheet", "si", "Stack", "isotropic", "orthotropic", "MATERIALS", "material", "bridge_stiffness", "layered_rigidity",
    # a model and what drives it
    "Model", "Parameters", "State", "rigid", "Drive", "Signal", "ramp", "series", "sine", "CATALOGUE",
    "magnet", "coil", "coil_pair", "dipole", "field_table", "FieldTable", "field_at",
    # solutions
    "simulate", "Trajectory", "stable_step", "quasistatic", "QuasiStatic",
    "equilibrium", "Equilibrium", "continuation", "Path",
    # results
    "save_run", "load_run", "format_table", "write_replay", "open_replay", "screenshot",
    # recordings and scenes
    "Recording", "read_recording", "read_calibration", "scene_module",
    # devices as files, and questions of a designer
    "device_module", "Design", "read_design", "write_design",
    "sweep", "solve_for", "optimise", "gradient", "Found", "Way",
    # what a model lacks
    "diagnose", "Diagnosis", "Subject", "estimate", "Estimate",
    "InputError",
]  # fmt: skip


def __getattr__(name: str):
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{_MODULES[name]}")
    value = module if name == "diagnose" else getattr(module, name)  # a package that can be called
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
