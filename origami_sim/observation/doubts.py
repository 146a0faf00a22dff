"""What is doubtful of a recording beside its model, said before anything is simulated: drives, switches, frames."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from origami_sim.drive import Drive, Signal, as_signal
from origami_sim.drive.sources import STRENGTHS
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.observation.channels import PATH
from origami_sim.observation.observe import check_scene
from origami_sim.recording import Recording, by_component
from origami_sim.recording.drives import UNITS, recorded_signals, switches
from origami_sim.solve.timestep import stable_step
from origami_sim.units import quantity

SLOW = 1e5
"""Steps of the solver in one frame from which a note says so."""


UNLIKE = 100.0
"""Times the device's own drive from which the unit of a recorded one is suspected.

Prefixes differ by 1000, gauss and tesla by more; half and double suspect the same ones.
"""


def doubts(recording: Recording, model: Model, parameters: Parameters, drive: Drive) -> list[str]:
    """Notes, one sentence each, on what of a recording may be other than it was meant.

    Args:
        recording: of what the model is of. drive: the device's own.

    Raises:
        InputError: a drive that the simulator does not know, what `check_scene` refuses.
    """
    with naming(recording.metadata.get("sidecar")):
        notes = [*assumed(recording, drive), *switched(recording), *check_scene(recording, model)]
    return [*notes, *far_driven(recording, drive), *slow_frames(recording, stable_step(model, parameters).dt)]


@contextmanager
def naming(file: object) -> Iterator[None]:
    """Errors that name no file name this one."""
    try:
        yield
    except InputError as error:
        raise error if error.file is not None else InputError(str(error), file=file) from None


def slow_frames(recording: Recording, step: float) -> list[str]:
    """A note on frames that last very many of the solver's steps [s], as those of times in ms read as seconds do."""
    frame = float(np.median(np.diff(recording.times)))
    if recording.by_step or recording.motion == "quasistatic" or frame < SLOW * step or PATH in recording.drive:
        return []
    return [
        f"A frame of '{recording.name}' lasts {frame:.3g} s, {frame / step:.2g} steps of the solver, which takes long: "
        "are the times in ms? A slow motion is followed along equilibria: motion = 'quasistatic' in the sidecar."
    ]


def assumed(recording: Recording, drive: Drive) -> list[str]:
    """A note on what the scene drives that the recording does not state; curves take nothing of the scene's own drive.

    Raises:
        InputError: what `by_component` refuses.
    """
    if recording.by_step or PATH in recording.drive:
        return []
    file = recording.metadata.get("sidecar")
    stated = {c for name, d in recording.drive.items() for c in by_component(name, d, file=file)}
    own = {}
    units = UNITS | {f"source_{k}_strength": STRENGTHS[kind][1] for k, (kind, _) in enumerate(drive.placed)}
    for name in drive.levels:
        s = drive[name]
        if name not in stated and not s.is_zero and not (recording.sources and name.startswith("source_")):
            own[name] = f"{name} up to {quantity(_peak(s), units.get(name) or UNITS[name.split('_')[0]])}"
    if not own:
        return []
    return [f"'{recording.name}' states no {', '.join(own)}: the scene's own is assumed ({', '.join(own.values())})."]


def _peak(s: Signal) -> float:
    """The largest value that a signal may have, without its sign."""
    sampled = 0.0 if s.values is None else np.abs(s.scale) * np.abs(s.values).max()
    return float(np.max(np.abs(s.offset) + np.abs(s.amplitude) + sampled))


def driven(recording: Recording, drive: Drive) -> list[str]:
    """What each drive of a recording comes to, in words, and what the device's own does."""
    return [said for said, _ in _driven(recording, drive)]


def far_driven(recording: Recording, drive: Drive) -> list[str]:
    """A note on drives that are so many times the device's own that their unit is suspected."""
    far = [said for said, over in _driven(recording, drive) if over > UNLIKE]
    return [f"{said[0].upper()}{said[1:]}: is its unit right?" for said in far]


def _driven(recording: Recording, drive: Drive) -> list[tuple[str, float]]:
    """Sentences on the recorded drives, and how many times the device's own they are."""
    out = []
    for name, given in ({} if recording.by_step else recorded_signals(recording)).items():
        most, own = _peak(as_signal(given, name=name)), _peak(drive[name]) if name in drive.signals else 0.0
        unit = UNITS.get(name) or UNITS[name.split("_")[0]]
        beside = f", {quantity(own, unit)} in the device's own drive" if own else ""
        if most:
            out.append((f"{name} comes to {quantity(most, unit)} in the recording{beside}", most / own if own else 0.0))
    return out


def switched(recording: Recording) -> list[str]:
    """A note on drives that were switched between two rows which do not tell when, to a tenth of a frame."""
    notes, frame = [], float(np.median(np.diff(recording.times)))
    for name, (before, after) in switches(recording).items():
        if np.max(after - before) < 0.1 * frame:
            continue
        notes.append(
            f"The drive '{name}' of '{recording.name}' is switched between two rows, first after {before[0]:.6g} s: "
            f"when is known to {quantity(float(np.max(after - before)), 's')} only, and what is found as a lag or a "
            "delay of that size may be this."
            + ("" if recording.drive[name].times is not None else " A log at a higher rate (file = ...) tells when.")
        )
    return notes
