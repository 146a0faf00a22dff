"""The moment that a law of the catalogue gives, where the fitted numbers and one coordinate say all of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from origami_sim.effects import CATALOGUE
from origami_sim.effects._effect import scalar

SLID = 1e3
"""Turn [rad] after which a law with a memory of the motion's way has forgotten everything before."""


@dataclass(frozen=True, eq=False)
class Law:
    """A moment at a crease.

    Attributes:
        against: "angle" or "rate". moment: of values [rad or rad/s], (n,) [N m]. assumed: numbers that were not fitted
            and have their defaults.
    """

    against: str
    moment: Callable[[np.ndarray], np.ndarray]
    assumed: dict[str, float]

    def straight(self, x: np.ndarray) -> bool:
        """Whether it is a straight line over these values."""
        y = self.moment(x)
        left = y - np.polyval(np.polyfit(x, y, 1), x) if len(x) > 2 else np.zeros(1)
        return bool(np.ptp(left) <= 1e-6 * max(np.ptp(y), np.max(np.abs(y)), 1e-300))


def law_of(effect: str, values: Mapping[str, float]) -> Law | None:
    """The law of an effect with fitted numbers; None where it needs more than them and an angle or a rate.

    What a law with memory gives in a motion that goes on one way is drawn against the rate.
    """
    found = CATALOGUE.get(effect)
    if found is None or found.family != "crease" or found.force is None or not values:
        return None
    own = {p.name: p.default for p in found.parameters if p.knots == 1} | dict(values)
    memory = {m.name for m in found.memory if m.size == 1}
    moving = set(found.arguments) - set(own) - memory
    if not moving <= {"angle", "rate", "turn"} or len(moving) > 1 or (memory and moving != {"turn"}):
        return None
    force, arguments = found.force, found.arguments

    def one(x: float) -> float:
        at = {"angle": x, "rate": x, "turn": SLID * float(np.sign(x)), **dict.fromkeys(memory, 0.0), **own}
        out = force(*(scalar(at[name]) for name in arguments))
        return float(out[0] if isinstance(out, tuple) else out)

    assumed = {p.name: own[p.name] for p in found.parameters if p.name in arguments and p.name not in values}
    variable = "rate" if moving & {"rate", "turn"} else "angle"
    return Law(variable, lambda x: np.array([one(float(v)) for v in np.ravel(x)]), assumed)
