"""Drives as they were recorded, sampled finely enough, and as they reach rollouts from several starts."""

from collections.abc import Sequence

import numpy as np

from origami_sim.drive import PATHS, Drive, Signal, series
from origami_sim.drive.refining import refined
from origami_sim.drive.starts import shifted
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.model.distort import distorted
from origami_sim.recording import Recording, by_component
from origami_sim.recording.placed import surrounded


def drive_of(recording: Recording, default: Drive) -> Drive:
    """The drive and the sources that were recorded, over the model's own.

    Raises:
        InputError: what `by_component` refuses, or a drive that this model lacks.
    """
    changed: dict[str, Signal] = {}
    default = surrounded(default, recording)
    file = recording.metadata.get("sidecar")
    for name, drive in recording.drive.items():
        clock = (recording.times if drive.times is None else drive.times) - recording.times[0]
        for channel, values in by_component(name, drive, file=file).items():
            path = channel.partition("_")[0] in PATHS
            if channel not in default.signals and not path:
                raise InputError(
                    "the model has no such drive channel",
                    file=file,
                    field=f"drive.{name}",
                    value=channel,
                    allowed=", ".join(default.signals),
                )
            sampled = (clock, values) if path or drive.constant else refined(clock, values)
            changed[channel] = Signal(offset=float(values[0])) if drive.constant else series(*sampled, smooth=path)
    return default.replace(**changed)


def reaching(
    model: Model, each: Sequence[Parameters], given: Drive, starts: np.ndarray, duration: float, among=None
) -> Drive:
    """The drive that reaches worlds in rollouts from several starts [world, start].

    What distorts it acts on the whole recording, so that a lag or hysteresis remembers what was before a start.

    Args:
        each: parameters of the worlds (K). starts: (B,) or, of each world its own, [K, B] [s]. duration: of a rollout
            [s]. among: starts of all rollouts for which it is sampled alike (default: of these).
    """
    among = starts if among is None else among
    whole = distorted(model, Parameters.join(each), given, float(np.max(among)) + duration)
    return shifted(whole, starts, duration, len(each), among, given)
