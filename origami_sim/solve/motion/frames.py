"""The frames that a motion is asked for: how many there are, and whether there is memory for them."""

import math
import os

from origami_sim.errors import InputError
from origami_sim.model import Model


def check_frames(duration: float, rate: float, file: object = None) -> None:
    """Refuses a duration [s] or frames per second that are not positive.

    Raises:
        InputError: naming it.
    """
    for name, value in (("duration", duration), ("rate", rate)):
        if not (value > 0 and math.isfinite(value)):
            raise InputError("a run needs a positive number", file=file, field=name, value=value, allowed="> 0")


def check_memory(model: Model, worlds: int, duration: float, rate: float, memory: float | None = None) -> None:
    """Refuses more frames than the machine has memory for, before the first of them is computed.

    Each holds positions, velocities, accelerations and the force of every effect at all nodes, at the least.

    Args:
        duration: of the motion [s]. rate: frames per second. memory: of the machine [bytes] (default: as it says).

    Raises:
        InputError: naming the rate at which they would find room.
    """
    memory = physical_memory() if memory is None else memory
    frame = 8.0 * 3 * len(model.position) * worlds * (3 + len(model.laws))
    if duration * rate * frame > memory:
        raise InputError(
            f"the {duration * rate:.3g} frames of {duration:g} s need {duration * rate * frame / 1e9:.3g} GB of memory",
            field="rate",
            value=rate,
            allowed=f"up to {memory / frame / duration:.2g} frames per second with the {memory / 1e9:.3g} GB of this "
            "machine, or a shorter duration",
        )


def physical_memory() -> float:
    """Memory of the machine [bytes]; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return math.inf
