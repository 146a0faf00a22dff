"""Modulus or remanence of a beam from its tip deflection against the field.

A clamped beam, magnetised along its length, in a field across it: theta'' = -lambda cos(theta + tilt), theta(0) = 0,
theta'(1) = 0, with arc length over length L and lambda = 12 B_r B L^2 / (mu0 E h^2) (Lum et al. 2016; Wang, Kim & Zhao
2020). The shape depends on lambda alone: the curve determines B_r / E, never one of the two.
"""

import math

import numpy as np
from scipy.linalg import solve_banded

from origami_sim.calibrate.curves import checked_curve
from origami_sim.calibrate.fitting import Fit, Parameter, fit, identifiability, warned, with_curve
from origami_sim.errors import InputError
from origami_sim.physics.materials import MU0

CELLS = 120
"""Intervals along the beam: Numerov's method, error 2e-7 of the length at lambda = 200."""

MEASURES = ("across", "total")
"""Tip deflection along the field, or distance of the tip from where it was."""


def elastica(load, *, tilt: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Tip position over the length, along the beam and across it, of the elastica under each magnetic load.

    Args:
        load: (n,) lambda, of either sign [-]. tilt: of the field towards the beam's axis [rad].

    Returns:
        (n,) x/L and (n,) y/L.

    Raises:
        InputError: a load for which no shape is found.
    """
    load = np.asarray(load, float)
    s = np.arange(CELLS + 1) / CELLS
    simpson = np.ones(CELLS + 1)
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    tips = []
    for value in load:
        angle = _settled(float(value), tilt, s)
        tips.append([simpson @ np.cos(angle), simpson @ np.sin(angle)])
    along, across = np.array(tips).reshape(-1, 2).T / (3 * CELLS)
    return along, across


def _settled(load: float, tilt: float, s: np.ndarray) -> np.ndarray:
    """Newton on Numerov's equations; the beam mirrored at its tip, where theta' = 0, continues it smoothly."""
    aligned = math.copysign(math.pi / 2, load) - tilt  # with the field
    # a long beam: theta'' = sqrt(lambda)^2 sin(theta - aligned) has this closed solution
    start = aligned - 4 * np.arctan(math.tan(aligned / 4) * np.exp(-math.sqrt(abs(load)) * s))
    angle, c = start[1:] if abs(load) > 2 else np.zeros(len(s) - 1), s[1] ** 2 / 12
    for _ in range(60):
        whole = np.concatenate([[0.0], angle, angle[-2:-1]])
        curve, slope = load * np.cos(whole + tilt), -load * np.sin(whole + tilt)  # -theta'' and its derivative
        rest = np.diff(whole, 2) + c * (curve[2:] + 10 * curve[1:-1] + curve[:-2])
        band = np.zeros((3, len(angle)))
        band[1] = -2 + 10 * c * slope[1:-1]
        band[0, 1:] = 1 + c * slope[2:-1]
        band[2, :-1] = 1 + c * slope[1:-2]
        band[2, -2] *= 2
        change = solve_banded((1, 1), band, -rest)
        angle = angle + change * min(1.0, 1.0 / max(np.abs(change).max(), 1e-300))
        if np.abs(change).max() < 1e-12:
            return np.concatenate([[0.0], angle])
    raise InputError("no shape of the beam was found", field="load", value=load, allowed="a weaker field")


def fit_deflection(
    field,
    deflection,
    *,
    length: float | None = None,
    thickness: float | None = None,
    remanence: float | None = None,
    modulus: float | None = None,
    measure: str = "across",
    tilted: bool = False,
) -> Fit:
    """Modulus or remanence of a magnetised cantilever from its tip deflection against a field across it.

    Args:
        field: (n,) flux density [T], monotone. deflection: (n,) of the tip over the length [-].
        length: free length [m]. thickness: in the bending plane [m].
        remanence: B_r [T], to find E. modulus: E in EI [Pa], to find B_r. With neither, only the load per field.
        measure: one of `MEASURES`. tilted: also fit the tilt of the field towards the beam's axis.

    Returns:
        The fit of `modulus` [Pa], or `remanence` [T], or `load_per_field` lambda / B [1/T] with, if length and
        thickness are given, a warning that only B_r / E can be known; and `misalignment` [rad] if tilted.

    Raises:
        InputError: fewer than 3 points, a field that turns back, NaN, a deflection against the field or longer than the
            beam allows, both or neither dimension, remanence and modulus both given, a size that is not positive.
    """
    field, deflection = checked_curve(field, deflection, ("field", "deflection"), 3)
    if measure not in MEASURES:
        raise InputError("no such measure", field="measure", value=measure, allowed=", ".join(MEASURES))
    sizes = {"length": length, "thickness": thickness, "remanence": remanence, "modulus": modulus}
    for name, value in sizes.items():
        if value is not None and not (value > 0 and math.isfinite(value)):
            raise InputError("must be positive", field=name, value=value, allowed="> 0")
    if remanence is not None and modulus is not None:
        raise InputError("one of the two is to be found", field="modulus", value=modulus,
                         allowed="a remanence or a modulus, not both")  # fmt: skip
    if length is None or thickness is None:
        if (remanence, modulus) != (None, None) or length is not thickness:
            missing = "length" if length is None else "thickness"
            raise InputError("the beam's size is needed", field=missing, allowed="length and thickness [m]")
        slender = None
    else:
        slender = 12 / MU0 * (length / thickness) ** 2
    largest = 1.0 if measure == "across" else math.sqrt(2.0)
    beyond = np.flatnonzero(np.abs(deflection) >= largest)
    if len(beyond):
        raise InputError(
            f"point {beyond[0] + 1} lies beyond the reach of a beam that keeps its length; is the deflection over the "
            "length",
            field="deflection",
            value=float(deflection[beyond[0]]),
            allowed=f"below {largest:.3g}",
        )

    def shape(load, tilt):
        x, y = elastica(load, tilt=tilt)
        return y if measure == "across" else np.hypot(1 - x, y)

    # start where the whole curve is nearest; small deflections obey y = lambda / 3
    scale = float(np.abs(field).max())
    if not scale > 0:
        raise InputError("there is no field", field="field", value=scale, allowed="a curve against field")
    if np.abs(deflection).max() < 1e-9:
        raise InputError("the beam does not move: the modulus would be infinite", field="deflection", value=0.0)
    signed = measure == "across"
    if signed and (field * deflection).sum() <= 0:
        raise InputError(
            "the deflection is against the field: the modulus would be negative; is the sign of one of the two turned",
            field="deflection",
            value=float(deflection[np.argmax(np.abs(field))]),
            allowed="along the field",
        )
    trial = np.geomspace(0.01, 150.0, 30) / scale
    start = float(min(trial, key=lambda a: float(((deflection - shape(a * field, 0.0)) ** 2).sum())))
    bounds = (1e-4 / scale, 400.0 / scale)
    what: tuple[Parameter, ...]
    if slender is not None and remanence is not None:
        a = slender * remanence  # lambda / B = a / E
        ends = (a / bounds[1], a / bounds[0])
        what = (Parameter("modulus", "Pa", a / start, ends, "Young's modulus E in EI"),)

        def per_field(p):
            return a / p[0]
    elif slender is not None and modulus is not None:
        b = slender / modulus
        ends = (bounds[0] / b, bounds[1] / b)
        what = (Parameter("remanence", "T", start / b, ends, "remanent flux density, along the beam"),)

        def per_field(p):
            return b * p[0]
    else:
        meaning = "magnetic load lambda = 12 B_r B L^2 / (mu0 E h^2) over the field B"
        what = (Parameter("load_per_field", "1/T", start, bounds, meaning),)

        def per_field(p):
            return p[0]

    if tilted:
        what += (Parameter("misalignment", "rad", 0.0, (-0.5, 0.5), "tilt of the field towards the beam's axis"),)
    found = fit(lambda p: deflection - shape(per_field(p) * field, p[1] if tilted else 0.0), what)
    if slender is not None and remanence is None and modulus is None:
        size, tilt = slender, float(found.values[1]) if tilted else 0.0
        pair = [
            Parameter("remanence", "T", 0.1, (0.0, math.inf), ""),
            Parameter("modulus", "Pa", 1.0, (0.0, math.inf), ""),
        ]
        at = np.array([0.1, size * 0.1 / found.values[0]])
        unknown = identifiability(lambda p: deflection - shape(size * p[0] / p[1] * field, tilt), pair, at)
        ratio = f"here remanence/modulus = {found.values[0] / size:.4g} T/Pa"
        found = warned(found, [f"{w} ({ratio})" for w in unknown])
    model = shape(per_field(found.values) * field, float(found.values[1]) if tilted else 0.0)
    return with_curve(found, field, deflection, model, "flux density [T]", "tip deflection over length [-]")
