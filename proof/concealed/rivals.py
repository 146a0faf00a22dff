"""Confounded pairs: two effects of the same signature in one recording, and the recording that separates them."""

import re
from dataclasses import dataclass, field

import numpy as np

ALIKE = 0.97
"""Overlap |cos| of two signatures from which on they are a pair."""

TIED = 3.0
"""Largest d' between an effect and its rival at its best strength that is still a tie."""

APART = 5.0
"""Smallest d' between them with the separating recording."""


@dataclass(frozen=True)
class Pair:
    """Two effects, (mechanism, place), of a structure.

    Attributes:
        extra: second numbers by mechanism. first: recording of the object that is kept.
        separating: changes of that recording, see `changed`; empty: nothing that can be recorded separates them.
    """

    structure: str
    one: tuple[str, int]
    other: tuple[str, int]
    separating: dict = field(default_factory=dict)
    extra: dict = field(default_factory=dict)
    first: int = 0


PAIRS = (
    Pair("pendulum_chain", ("angle_scale", 0), ("angle_offset", 0), {"size": 2.0}),
    Pair("pendulum_chain", ("rest_angle", 0), ("eccentric_weight", 1), {"size": 2.0}),
    Pair("pendulum_chain", ("gravity_tilt", 0), ("angle_offset", 0)),
    Pair("hanging_strip", ("rest_angle", 0), ("eccentric_weight", 1), {"size": 2.0}),
    Pair("magnetic_strip", ("relaxation", 0), ("softness", 0), {"speed": 0.1}, {"relaxation": {"time": 1.0}}),
    Pair("magnetic_strip", ("relaxation", 2), ("softness", 2), {"speed": 0.1}, {"relaxation": {"time": 1.0}}),
    Pair("box", ("softness", 0), ("eccentric_weight", 1), {"speed": 3.0}),
    Pair("box", ("quadratic_damping", 0), ("viscosity", 0), {"speed": 3.0}),
    Pair("box", ("field_lag", 0), ("clock_delay", 0)),
    Pair("mae_cantilever", ("stiffening", 0), ("compliant_dipoles", 0), {"gain": 2.0}, first=1),
    Pair("mae_cantilever", ("stiffening", 0), ("field_stiffening", 0), {"gain": 2.0}, first=1),
    Pair("mae_cantilever", ("compliant_dipoles", 0), ("field_stiffening", 0), {"gain": 2.0}, first=1),
)
"""Found by comparing the signatures of all mechanisms at all sites of one object of each structure; whether a pair is
one in the object at hand is looked at again when it is drawn."""


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """|cos| of two signatures."""
    return float(abs(a @ b) / (np.linalg.norm(a) * np.linalg.norm(b)))


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """What is left of signature a after b, at its best strength, is taken away: d' between the two."""
    return float(np.linalg.norm(a - b * (a @ b) / (b @ b)))


def changed(recording: dict, *, size=1.0, gain=1.0, speed=1.0, stretch=1.0) -> dict | None:
    """Another experiment of the same kind; None if this kind has nothing of that sort to change.

    Args:
        size: factor on the angles of a release. gain: on the level of the drive. speed: on its frequency.
        stretch: on the duration.
    """
    out = dict(recording)
    if "levels" in recording:
        if size != 1.0 or speed != 1.0 or stretch != 1.0:
            return None
        return out | {"levels": [gain * v for v in recording["levels"]]}
    driven = "field" in recording
    if (size != 1.0 and driven) or ((gain != 1.0 or speed != 1.0) and not driven):
        return None
    if stretch != 1.0:
        out["stretch"] = stretch
    if driven:
        f = recording["field"]
        out["field"] = {**f, "amplitude": gain * f["amplitude"], "frequency": speed * f["frequency"]}
    else:
        out["release"] = [size * q for q in recording["release"]]
    return out


MENU = (
    (r"repeat the same (?:experiment|curve)", lambda m: {}),
    (r"start from ([\d.]+) times the displacement and rate", lambda m: {"size": float(m[1])}),
    (r"let it run ([\d.]+) times as long", lambda m: {"stretch": float(m[1])}),
    (
        r"let go at rest from ([\d.]+) times the displacement, drives off, until it rests",
        lambda m: {"size": float(m[1]), "stretch": 3.0},
    ),
    (r"(?:field|voltage) at ([\d.]+) times the level", lambda m: {"gain": float(m[1])}),
    (r"(?:field|voltage) reversed|the same angles to the other side", lambda m: {"gain": -1.0}),
    (r"half of the angles", lambda m: {"gain": 0.5}),
    (r"(?:field|voltage) at ([\d.]+) times the frequency", lambda m: {"speed": float(m[1])}),
)
"""Experiments that a diagnosis may propose and that can be made here; others, such as a tilted set-up, would need
another description of the object."""


def proposed(what: str, recording: dict) -> dict | None:
    """The experiment of these words; None if it cannot be made."""
    for pattern, changes in MENU:
        match = re.fullmatch(pattern, what)
        if match:
            return changed(recording, **changes(match))
    return None
