"""What is compared: recordings without wild frames, thinned to a rate at which nothing is lost."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Suspect
from origami_sim.observation.thinning import thinned
from origami_sim.predict.rigid import FEWEST
from origami_sim.recording import Recording, read_dataset
from origami_sim.recording.drives import switches
from origami_sim.recording.wild import wild_frames
from origami_sim.threads import shared

Recorded = Sequence[Recording | str | Path] | Recording | str | Path
"""Recordings of one object, or their files."""

FRAMES = 400
"""Frames of a recording that are compared at least, if it has as many."""


def among(every: Sequence[Suspect], catalogue: Sequence[str]) -> list[Suspect]:
    """The suspects of some effects.

    Raises:
        InputError: an effect that the catalogue lacks; effects of which none can act here.
    """
    wanted = {get(n).name for n in catalogue}
    out = [s for s in every if s.effect in wanted]
    if not out:
        raise InputError(
            "none of these can act on this device, or show in these recordings",
            field="suspects",
            value=", ".join(sorted(wanted)),
            allowed=", ".join(sorted({s.effect for s in every})),
        )
    return out


def gathered(given: Recorded, rate: float) -> list[Recording]:
    """Recordings, and those of files, as they are compared, see `prepared`.

    Raises:
        InputError: a file that cannot be read; what `prepared` refuses.
    """
    each = [given] if isinstance(given, (Recording, str, Path)) else given
    return prepared([r for s in each for r in ([s] if isinstance(s, Recording) else read_dataset(s))], rate)


def prepared(recordings: Sequence[Recording], rate: float) -> list[Recording]:
    """The recordings without wild frames, thinned to about `rate` frames per second, but to no less than FRAMES frames.

    Raises:
        InputError: none, different channels, too few frames.
    """
    if not recordings:
        raise InputError("there is nothing to diagnose", field="recordings", value=0, allowed="at least one recording")
    names = list(recordings[0].channels)
    for r in recordings:
        if list(r.channels) != names:
            raise InputError(
                "recordings of one object need the same channels",
                field=f"{r.name}.channels",
                value=", ".join(r.channels),
                allowed=", ".join(names),
            )
        fewest = 8 if r.by_step else 16
        if len(r.times) < fewest:
            raise InputError(
                "a recording is too short for a diagnosis",
                field=f"{r.name}.frames",
                value=len(r.times),
                allowed=f"at least {fewest}",
            )
    return shared([partial(_prepared, r, rate) for r in recordings])


def _prepared(r: Recording, rate: float) -> Recording:
    every = int(1.0 / float(np.median(np.diff(r.times))) / rate + 1e-6)
    return thinned(filled(tamed(r)), max(1, min(every, len(r.times) // FRAMES)))


def tamed(recording: Recording) -> Recording:
    """The recording without wild frames, of which a note tells; load steps have no course to be far off from."""
    channels, notes = dict(recording.channels), []
    looked = [] if recording.by_step else list(channels.items())
    corners = np.concatenate([np.zeros(0), *(t for both in switches(recording).values() for t in both)])
    found = shared([partial(wild_frames, recording.times, c.values, c.noise, corners) for _, c in looked])
    for (name, c), wild in zip(looked, found, strict=True):
        if not wild.any():
            continue
        values = np.where(wild if c.values.ndim == 1 else wild[:, None], np.nan, c.values)
        channels[name] = replace(c, values=values)
        when, count = f"at t = {recording.times[np.argmax(wild)]:.6g} s", np.count_nonzero(wild)
        notes.append(f"{recording.name}: a wild frame of channel '{name}' is left out, {when}.")
        if count > 1:
            notes[-1] = f"{recording.name}: {count} wild frames of channel '{name}' are left out, the first {when}."
    if not notes:
        return recording
    known = recording.metadata.get("notes", ())
    return replace(recording, channels=channels, metadata={**recording.metadata, "notes": [*known, *notes]})


def filled(recording: Recording) -> Recording:
    """The recording with frames that were lost here and there, as frames without a value.

    Segments then have equal times, and are simulated together: with four frames lost in 900, in 0.4 of the time. Where
    as many frames as a segment has are lost in a row, time has a gap. A clock of which a tenth of the steps are longer
    is none of even frames.
    """
    steps = np.diff(recording.times) / np.median(np.diff(recording.times))
    lost = np.round(steps).astype(int) - 1
    lost[lost >= FEWEST] = 0
    if recording.by_step or not 0 < 10 * np.count_nonzero(lost) < len(lost):
        return recording
    place = np.arange(len(recording.times)) + np.concatenate([[0], np.cumsum(lost)])
    every = np.arange(place[-1] + 1)
    channels = {}
    for name, c in recording.channels.items():
        values = np.full((len(every), *c.values.shape[1:]), np.nan)
        values[place] = c.values
        channels[name] = replace(c, values=values)
    drive = {
        name: d if d.constant or d.times is not None else replace(d, times=recording.times)
        for name, d in recording.drive.items()
    }
    return replace(recording, times=np.interp(every, place, recording.times), channels=channels, drive=drive)
