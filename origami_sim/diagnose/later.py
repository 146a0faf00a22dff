"""What is added to a verdict that stands: places, the next experiment, baselines. None of it can lose the verdict.

Each part may fail; a note then says so, and the other parts are made. After each part that takes long the diagnosis is
handed over anew, so that whatever ends the process costs only what was not computed yet.
"""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from origami_sim.diagnose.options import Report
from origami_sim.errors import InputError
from origami_sim.infer.diagnosis import Diagnosis

T = TypeVar("T")


@dataclass(frozen=True)
class Part:
    """One thing that is added.

    Attributes:
        name: for progress and times. fault: how the note begins that says that it could not be made.
        make: gives fields of `Diagnosis` by name.
        quick: whether it takes so little time that nothing has to be handed over after it.
    """

    name: str
    fault: str
    make: Callable[[], dict[str, Any]]
    quick: bool = False


def attempt(
    notes: list[str], fault: str, make: Callable[[], T], otherwise: T, *, passing: type[Exception] | tuple = ()
) -> T:
    """What may fail without losing the verdict; a note says so.

    Any error counts, of memory and of files as well; what ends the process, and `passing`, is let through.
    """
    try:
        return make()
    except passing:
        raise
    except Exception as error:
        said = str(error).rstrip(".")
        if not isinstance(error, InputError):
            said = f"{type(error).__name__}: {said}" if said else type(error).__name__
        notes.append(f"{fault} ({said}).")
        return otherwise


def add(found: Diagnosis, parts: Sequence[Part], tell: Report, stands: Callable[[Diagnosis], None]) -> None:
    """Adds parts to a diagnosis, in order; those that were not reached are `found.unfinished`.

    Args:
        stands: told whenever something is there that was not there before.
    """
    found.unfinished = list(dict.fromkeys(p.name for p in parts))
    stands(found)
    for n, part in enumerate(parts):
        began = clock.perf_counter()
        tell(part.name, 0.0)
        for name, value in attempt(found.notes, part.fault, part.make, {}).items():
            setattr(found, name, value)
        found.seconds[part.name] = found.seconds.get(part.name, 0.0) + clock.perf_counter() - began
        found.unfinished = list(dict.fromkeys(p.name for p in parts[n + 1 :]))
        if not part.quick or not found.unfinished:
            stands(found)
