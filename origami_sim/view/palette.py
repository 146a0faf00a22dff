"""Colours and units in which devices are drawn: the same in replays, pictures and plots."""

import numpy as np

COLOURS = {
    "passive": (158, 190, 219),  # clear elastomer
    "magnet": (104, 100, 114),  # dark, like iron-filled elastomer
    "arm": (226, 180, 104),
    "ground": (226, 226, 221),
    "grid": (200, 200, 194),
    "outline": (60, 66, 74),
    "crease": (60, 66, 74),
    "mountain": (214, 48, 49),  # as in drawings of folds: mountains red, valleys blue
    "valley": (20, 98, 222),
    "electrode": (222, 170, 76),
    "live": (255, 214, 60),  # electrodes under voltage
    "poling": (206, 44, 44),
    "background": (250, 250, 248),
    "field": (24, 98, 214),
    "contact": (16, 140, 84),
    "marker": (236, 84, 164),
    "scale": (60, 66, 74),
    "label": (255, 255, 255),  # on the viewer's grey
}
"""Colours (red, green, blue; 0 to 255) of what is drawn."""

SERIES = (
    (57, 135, 229),
    (233, 121, 42),
    (46, 160, 96),
    (199, 70, 110),
    (142, 105, 214),
    (176, 138, 28),
    (30, 160, 172),
    (140, 140, 140),
)
"""Colours of series, readable on dark and on light."""

PLOTTED = len(SERIES)
"""Series that a plot shows at once; all others are in the file and can be added in the viewer."""

LIGHT = np.array([0.35, -0.5, 0.79])
"""Direction to the light."""


def nice(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(k for k in (1, 2, 5) if k * power <= value * (1 + 1e-9)))


_PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))


def scaled(unit: str, largest: float, usual: str) -> tuple[str, float]:
    """Unit with prefix and factor: the usual prefix for 1 to 10,000 of it, else one that suits."""
    factors = dict(_PREFIXES)
    if largest == 0 or 1.0 <= largest * factors[usual] <= 1e4:
        return usual + unit, factors[usual]
    prefix, factor = next(((p, f) for p, f in _PREFIXES if largest * f >= 1.0), _PREFIXES[-1])
    return prefix + unit, factor


def length_text(metres: float) -> str:
    unit, factor = scaled("m", metres, "m")
    return f"{metres * factor:g} {unit}"
