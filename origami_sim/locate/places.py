"""What is found about where a mismatch is: plain data."""

from dataclasses import dataclass, field


def clock(by_step: bool) -> tuple[str, str]:
    """What times of a recording count, and their unit."""
    return ("load step", "1") if by_step else ("time", "s")


@dataclass
class Curve:
    """Residual moment of one coordinate binned against something: x, mean, its standard error, number in the bin."""

    against: str
    unit: str
    x: list[float]
    mean: list[float]
    error: list[float]
    count: list[int]


REVERSAL = "time since a reversal"
"""Against this, the missing moment is that along the motion: it would cancel itself otherwise."""


@dataclass
class Place:
    """What equation error says about one coordinate (a crease's fold angle, a coordinate of the root).

    Attributes:
        site: name. score: how much structure its residual moment has, in standard deviations. share: its part
            of all structure. power: mean unexplained power [W], negative: lost; nan along load steps. onset: first time
            at which it departs [s], nan: never.
        times, moment, error: residual moment in time [N m] (thinned) and its standard deviation.
        curves: the residual moment against angle, rate, what drives, its phase if it is periodic, and time since the
            last step of a drive and the last reversal (then the moment along the motion).
        balance: unexplained power [W], blocks of 0.1 s or more of the first recording against time; None: not known.
    """

    site: str
    score: float
    share: float
    power: float
    onset: float
    times: list[float]
    moment: list[float]
    error: list[float]
    curves: list[Curve] = field(default_factory=list)
    balance: Curve | None = None


@dataclass
class Acting:
    """What one action alone, whatever its size in time, leaves of the forces that are missing.

    Attributes:
        what: "moment at" a crease; "force across" a panel in its middle, "moment on" it about its crease. site: which.
        left: root mean square of what it leaves, in standard deviations: 1 if it explains all.
        same: actions that are no different in these recordings.
        like: of the others, the one that is most like it. overlap: |cos| of the two, 1 if they look the same.
        unit: "N m" or "N". curves: its size in time (means over windows of the first recording), and against angle and
            rate of the crease there (of a panel: the one that moves it), what drives, and the rest as in `Place`.
    """

    what: str
    site: str
    left: float
    same: list[str]
    like: str
    overlap: float
    unit: str = ""
    curves: list[Curve] = field(default_factory=list)


@dataclass
class Partial:
    """The partial residual of a named effect: what the found model lacks without it, and what it gives.

    Attributes:
        label: of the effect. site: the coordinate, or component of a recording, that shows it best. curve: what is
            missing there without it, against what shows it best. law: what the effect gives, in the bins of the curve.
        unit: of a component; "": a generalised force is missing.
    """

    label: str
    site: str
    curve: Curve
    law: list[float]
    unit: str = ""


@dataclass
class Impulse:
    """What a contact does to the device in a blow.

    Attributes:
        recording, time: which [s]. site: node that is lowest. recorded, predicted: impulse on the device (x, y, z)
            [N s], of the motion that was recorded and of the refitted model's. error: (3) deviation of either.
        apart: their difference [standard deviations].
    """

    recording: str
    time: float
    site: str
    recorded: list[float]
    predicted: list[float]
    error: list[float]
    apart: float
