"""How far a run is from the exact motion: its energy balance, and runs repeated with shorter steps.

Energy is counted twice, once by where it is and once by who took it. Laws that are minus the gradient of an energy
count by that energy (springs, weight), and so does the motion. All others count by the work that they have done, which
is integrated beside the motion: losses (viscosity, drag, dry friction), contacts (as a whole, with what they give
back), laws with memory, and laws that a drive changes (fields, voltages). The two sums differ by what the solver's
steps have lost or made.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.solve.grips import WORK

if TYPE_CHECKING:
    from origami_sim.solve.motion.dynamics import Trajectory

SOUND = 0.005
"""Error of the energy balance, over the energy exchanged, above which a run says so."""

SLIGHT = 1e-3
"""Half the range of a motion, of fold angles [rad] and of positions over the device's size, up to which its energy
balance is no matter: wherever it is within that, its middle is right to the milliradian that `--accuracy 1e-3` gives.
What is held trembles by 0.03 degrees, and may lose a tenth of the little energy of that. Half and double take other
trembles, and no motion that folds a device."""

ROUNDING = 1e-12
"""Part of the largest energy at hand below which an error of the balance is rounding: 1e4 roundings of sums."""

HALVINGS = 10
"""Halvings of the step at most: a run of 1000 times the work. Half: a stiff contact is given up; double: a million."""


def exchanges(motion: "Trajectory") -> dict[str, np.ndarray]:
    """What each effect, and the motion itself, has taken up since the first frame, [F, W] [J]; together zero."""
    out = {"kinetic": motion.energies["kinetic"]}
    for name in motion.model.laws:
        out[name] = -motion.work[name] if get(name).exchanges_work else motion.energies[name]
    if WORK in motion.work:
        out[WORK] = -motion.work[WORK]
    return {n: a - a[0] for n, a in out.items()}


def energy_error(motion: "Trajectory") -> np.ndarray:
    """Largest error of the energy balance over the largest energy exchanged, [W]; nan where a world went unstable.

    The energy exchanged is half the sum of what all have taken up or given away since the first frame.
    """
    parts = np.stack(list(exchanges(motion).values()))
    error, moved = np.abs(parts.sum(axis=0)).max(axis=0), 0.5 * np.abs(parts).sum(axis=0).max(axis=0)
    levels = np.stack([motion.energies["kinetic"], *motion.energies.values(), *motion.work.values()])
    error = np.where(error > ROUNDING * np.abs(levels).max(axis=(0, 1)), error, 0.0)
    out = np.where(error > 0.0, error / np.where(moved > 0.0, moved, 1.0), 0.0)
    out[[f.world for f in motion.failures]] = np.nan
    return out


def worst(errors: np.ndarray | None) -> float:
    """The largest of the worlds' errors; 0 if none is known."""
    return float(np.nanmax(errors)) if errors is not None and np.any(np.isfinite(errors)) else 0.0


def extent(motion: "Trajectory") -> np.ndarray:
    """Half the range of a motion, [W]: the largest of fold angles [rad] and of positions over the device's size."""
    size = float(np.ptp(motion.model.position, axis=0).max(initial=0.0)) or 1.0
    turn = np.ptp(motion.creases, axis=0).max(axis=0, initial=0.0)
    return 0.5 * np.maximum(turn, np.ptp(motion.x, axis=0).max(axis=(0, 2), initial=0.0) / size)


def _telling(motion: "Trajectory") -> np.ndarray | None:
    """Errors of the energy balance [W]; 0 of worlds that hardly move, whose shape is right whatever they are."""
    errors = motion.energy_error
    return None if errors is None else np.where(extent(motion) <= SLIGHT, 0.0, errors)


def sentence(motion: "Trajectory") -> str:
    """The energy balance of a run, for its summary."""
    if motion.energy_error is None:
        return ""
    error = worst(motion.energy_error)
    said = f"energy balance: off by {_percent(error)} of the energy exchanged"
    if error > SOUND and worst(_telling(motion)) <= SOUND:
        w = int(np.nanargmax(motion.energy_error))
        said += f", in a tremble by {_percent(extent(motion)[w])} of a radian or of its size"
    return said


def warning(motion: "Trajectory", *, fixed: bool, damped: bool) -> list[str]:
    """A sentence if the energy balance is off by more than SOUND, and the device does more than tremble: what to do.

    Args:
        fixed: whether the step was of one length. damped: whether the solver was asked for numerical damping.
    """
    errors = _telling(motion)
    error = worst(errors)
    if errors is None or error <= SOUND:
        return []
    where = f" in world {int(np.nanargmax(errors))}" if len(errors) > 1 else ""
    step = f"steps of {motion.dt:.3g} s are" if fixed else "the steps' tolerance is"
    why = f"{step} too coarse for this motion, although stable"
    todo = "ask for an accuracy (accuracy=1e-3, or --accuracy 1e-3 on the command line), and the steps follow from it"
    if damped:
        why, todo = "the numerical damping that was asked for takes energy", "spectral_radius=1 takes none"
    return [f"The energy balance is off by {_percent(error)} of the energy exchanged{where}: {why}; {todo}."]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def change(coarse: "Trajectory", fine: "Trajectory") -> float:
    """Largest change of a fold angle [rad], or of a position over the device's size, between two runs in any frame.

    Infinite if a world went unstable in the first and not in the second.
    """
    gone = {f.world for f in fine.failures}
    if {f.world for f in coarse.failures} - gone:
        return np.inf
    sound = [w for w in range(fine.x.shape[2]) if w not in gone]
    size = float(np.ptp(fine.model.position, axis=0).max(initial=0.0)) or 1.0
    turn = np.abs(coarse.creases - fine.creases)[:, :, sound]
    way = np.linalg.norm(coarse.x - fine.x, axis=-1)[:, :, sound]
    return max(float(turn.max(initial=0.0)), float(way.max(initial=0.0)) / size)


def refined(run: Callable[[int], "Trajectory"], accuracy: float, *, balanced: bool = True) -> "Trajectory":
    """Repeats a run at half the step until no frame changes by more than the accuracy, and returns the finest run.

    Args:
        run: the run with the step halved so many times.
        accuracy: of fold angles [rad], of positions over the device's size and, if `balanced`, of the energy balance
            over the energy exchanged.
    """
    coarse, changes = run(0), []
    for n in range(1, HALVINGS + 1):
        fine = run(n)
        changes.append(change(coarse, fine))
        error = worst(fine.energy_error) if balanced else 0.0
        if changes[-1] <= accuracy and error <= accuracy:
            fine.notes.insert(0, f"Accuracy {accuracy:g}: halving the steps once more changed {_changed(changes)}.")
            return fine
        coarse = fine
        if n >= 4 and min(changes[-2:]) >= min(changes[:-2]):
            break
    coarse.notes.insert(
        0,
        f"Accuracy {accuracy:g} was not reached: at the end, halving the steps changed {_changed(changes)}, with the "
        f"energy balance off by {_percent(worst(coarse.energy_error))}. What amplifies small differences (free "
        "tumbling, stick and slip, snapping) cannot be told to that accuracy; a shorter run of it can.",
    )
    return coarse


def _changed(changes: list[float]) -> str:
    return f"angles [rad] and positions (over the device's size) by at most {changes[-1]:.2g}"


def check_accuracy(accuracy: float, file: Path | None = None) -> float:
    """The accuracy, or InputError (naming the file that has it) if it is none."""
    if isinstance(accuracy, bool) or not isinstance(accuracy, (int, float)) or not 0.0 < accuracy < 1.0:
        allowed = "a number above 0, below 1"
        raise InputError("no such accuracy", file=file, field="accuracy", value=accuracy, allowed=allowed)
    return float(accuracy)
