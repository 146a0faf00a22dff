"""What is added to a verdict that stands: places, the next experiment, baselines. None of it can lose the verdict.

Each part may fail; a note then says so, and the other parts are made. After each part that takes long, and after those
that are made side by side, the diagnosis is handed over anew, so that whatever ends the process costs only what was not
computed yet.
"""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any, TypeVar

from origami_sim.diagnose.options import Report
from origami_sim.errors import InputError
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.threads import shared

T = TypeVar("T")


@dataclass(frozen=True)
class Part:
    """One thing that is added.

    Attributes:
        name: for progress and times. fault: how the note begins that says that it could not be made.
        make: gives fields of `Diagnosis` by name.
        quick: whether it takes so little time that nothing has to be handed over after it.
        alone: whether one process makes it, beside others that do so; else all share in it.
        of: what has the fields; None: the diagnosis. If it is stated, that of the process that leads, which makes it.
    """

    name: str
    fault: str
    make: Callable[[], dict[str, Any]]
    quick: bool = False
    alone: bool = False
    of: object | None = None


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
    """Adds parts to a diagnosis, in order, those side by side that are made alone.

    Those that were not reached are `found.unfinished`.

    Args:
        stands: told whenever something is there that was not there before.
    """
    found.unfinished = list(dict.fromkeys(p.name for p in parts))
    stands(found)
    rest = list(parts)
    for alone, run in groupby(parts, lambda part: part.alone):
        for some in [list(run)] if alone else [[part] for part in run]:
            tell(some[0].name, 0.0)
            made = shared([partial(_made, part) for part in some], led=sum(part.of is not None for part in some))
            for part, (values, notes, seconds) in zip(some, made, strict=True):
                for name, value in values.items():
                    setattr(part.of or found, name, value)
                found.notes += notes
                found.seconds[part.name] = found.seconds.get(part.name, 0.0) + seconds
            rest = rest[len(some) :]
            found.unfinished = list(dict.fromkeys(part.name for part in rest))
            if not found.unfinished or not all(part.quick for part in some):
                stands(found)


def _made(part: Part) -> tuple[dict[str, Any], list[str], float]:
    """What a part gives, notes on it, and how long it took [s]."""
    began, notes = clock.perf_counter(), []
    values = attempt(notes, part.fault, part.make, {})
    return values, notes, clock.perf_counter() - began
