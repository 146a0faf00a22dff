"""What a set-up can do in a further recording, as its scene or a sidecar states it: the menu of next experiments."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.quantities import parsed

UPSIDE_DOWN = np.pi
"""Tilt from which a set-up can be turned over [rad]."""


@dataclass(frozen=True)
class Possible:
    """What a set-up can do.

    A scene states it as `POSSIBLE`, a sidecar as the table `[possible]`, whose keys go before the scene's. The defaults
    are those of a device on a bench: everything that needs no other set-up.

    Attributes:
        levels: of its drives, over those that were recorded; negative: reversed.
        frequencies: of its drives, over those that were recorded.
        steps: whether a drive can be switched on and held.
        starts: displacements and rates at the start, over those that were recorded.
        ring_down: displacement over the recorded one from which it can be let go at rest, with every drive off, until
            it rests; 0: it cannot.
        clamps: creases that can be clamped, by name; None: all.
        tilt: by how much it can be tilted [rad]; from half a turn on also upside down; 0: not at all.
        weights: whether mass can be added to its panels.
        longest: longest recording [s]; None: three times the longest, of a device that is held.
    """

    levels: tuple[float, ...] = (0.3, 0.6, 1.5, -1.0)
    frequencies: tuple[float, ...] = (0.3, 3.0)
    steps: bool = True
    starts: tuple[float, ...] = (0.1, 0.3, 2.0)
    ring_down: float = 0.2
    clamps: tuple[str, ...] | None = None
    tilt: float = np.deg2rad(10.0)
    weights: bool = True
    longest: float | None = None

    def but(self, stated: Mapping[str, Any], file: object = None) -> "Possible":
        """The same with what a sidecar states in place of the defaults.

        Raises:
            InputError: an unknown key, a value of another kind, a factor of zero.
        """
        known = {f.name for f in fields(self)}
        out: dict[str, Any] = {}
        for key, value in stated.items():
            where: dict[str, Any] = {"file": file, "field": f"possible.{key}", "value": value}
            if key not in known:
                raise InputError("unknown key", **where, allowed=", ".join(sorted(known)))
            if key in ("levels", "frequencies", "starts"):
                allowed = "a list of factors, without zero" + (", positive" if key != "levels" else "")
                if not isinstance(value, (list, tuple)) or not all(_number(v) and v != 0.0 for v in value):
                    raise InputError("not a list of factors", **where, allowed=allowed)
                if key != "levels" and any(v < 0.0 for v in value):
                    raise InputError("a factor must be positive", **where, allowed=allowed)
                out[key] = tuple(map(float, value))
            elif key == "clamps":
                if not isinstance(value, (list, tuple)) or not all(isinstance(v, str) for v in value):
                    raise InputError("not a list of names", **where, allowed="names of creases, [] for none")
                out[key] = tuple(value)
            elif key in ("steps", "weights"):
                if not isinstance(value, bool):
                    raise InputError("not a switch", **where, allowed="true, false")
                out[key] = value
            elif key == "ring_down":
                if not _number(value) or not 0.0 <= value <= 1.0:
                    raise InputError("not a part of a displacement", **where, allowed="0 to 1")
                out[key] = float(value)
            else:
                unit = "rad" if key == "tilt" else "s"
                text = value if isinstance(value, str) else str(value) if _number(value) else ""
                number = float(parsed(text, unit, field=f"possible.{key}", file=file))
                if number < 0.0 or (key == "longest" and number == 0.0):
                    raise InputError("must be positive", **where, allowed=f"> 0 {unit}")
                out[key] = number
        return replace(self, **out)


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))
