"""What becomes of a fit: the content of a calibration file, lines for the terminal, a picture."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.calibrate.crease_curve import TableFit
from origami_sim.calibrate.fitting import LEVEL, Fit
from origami_sim.calibrate.relaxation import PronyFit
from origami_sim.calibrate.result import Calibration, Quantity, significant
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError


def calibration(found, *, title: str, command: str, source: str, prefix: str = "") -> Calibration:
    """The content of a calibration file from a `Fit`, `TableFit` or `PronyFit`.

    Args:
        found: the fit. title: first line of the file. command: re-creates it. source: the recording, in words.
        prefix: in front of the names.
    """
    note = f"{source}; {LEVEL:.0%} interval"
    if isinstance(found, Fit):
        quantities = [
            Quantity(prefix + p.name, float(v), p.unit, p.meaning, f"{note} by profile likelihood", _pair(i))
            for p, v, i in zip(found.parameters, found.values, found.intervals, strict=True)
        ]
    elif isinstance(found, TableFit):
        quantities = [
            Quantity(prefix + "angle_min", float(found.knots[0]), "rad", "angle of the first knot", source),
            Quantity(prefix + "angle_max", float(found.knots[-1]), "rad", "angle of the last knot", source),
            Quantity(prefix + "stiffness", found.stiffness, "N m/rad", "slope at zero torque", source),
            Quantity(prefix + "moment_noise", found.noise, "N m", "standard deviation of the measured moment", source),
            Quantity(prefix + "resisting_moment", tuple(map(float, found.moments)), "N m",
                     "moment needed to hold the angle", f"{note}, pointwise",
                     tuple((float(a), float(b)) for a, b in found.intervals)),
        ]  # fmt: skip
        if found.rest_angle is not None:
            quantities.insert(
                2,
                Quantity(
                    prefix + "rest_angle", found.rest_angle, "rad", "angle of zero torque", note, found.rest_interval
                ),
            )
    elif isinstance(found, PronyFit):
        worst = max(found.error.values())
        quantities = [
            Quantity(prefix + "rest", found.rest, "1", "g_inf: force that stays, relative to an instantaneous stretch",
                     f"{note}, linearised", found.rest_interval),
            Quantity(prefix + "error", worst, "1", "largest relative rms residual of a hold", source),
        ]  # fmt: skip
        if found.held_out:
            worst = max(found.held_out.values())
            meaning = "largest relative rms residual of a hold predicted from the others"
            quantities.append(Quantity(prefix + "held_out_error", worst, "1", meaning, source))
        for k, (tau, g) in enumerate(zip(found.times, found.weights, strict=True), start=1):
            quantities += [
                Quantity(f"{prefix}time_{k}", float(tau), "s", f"relaxation time of term {k}",
                         f"{note} by profile likelihood", _pair(found.time_intervals[k - 1])),
                Quantity(f"{prefix}weight_{k}", float(g), "1",
                         f"g_{k}: share of term {k} in the instantaneous stiffness", f"{note}, linearised",
                         _pair(found.intervals[k - 1])),
            ]  # fmt: skip
    else:
        raise InputError("not a fit", field="found", value=type(found).__name__, allowed="Fit, TableFit, PronyFit")
    return Calibration(title, command, tuple(quantities), tuple(found.warnings))


def _pair(interval) -> tuple[float, float]:
    low, high = interval
    return float(low), float(high)


def summary(found: Calibration) -> str:
    """Values with their intervals, one per line, for the terminal."""
    lines = []
    interval: Any
    for q in found.quantities:
        interval = q.interval
        if isinstance(q.value, tuple):
            lines.append(f"{q.name} = {len(q.value)} knots, {min(q.value):.4g} to {max(q.value):.4g} {q.unit}")
        elif isinstance(q.value, (str, bool)):
            lines.append(f"{q.name} = {q.value}")
        else:
            lines.append(f"{q.name} = {significant(q.value, interval)} {'' if q.unit == '1' else q.unit}".rstrip())
    return "\n".join([*lines, *(f"warning: {w}" for w in found.warnings)])


def plot_fit(found, path: str | Path, *, title: str = "", logarithmic: bool | None = None) -> Path:
    """Curve and fit above, residual with the band of twice its standard deviation below.

    Args:
        found: a `Fit`, `TableFit` or `PronyFit`. path: .png, .svg or .pdf; it appears whole or not at all.
        title: above the picture. logarithmic: x axis; for a Prony series by default.
    """
    from matplotlib.figure import Figure  # slow to import, only needed here

    target = Path(path)
    formats = (".png", ".svg", ".pdf")
    if target.suffix.lower() not in formats:
        raise InputError("unknown kind of picture", field="path", value=str(path), allowed=", ".join(formats))
    relaxing = isinstance(found, PronyFit)
    figure = Figure(figsize=(7.2, 5.4), dpi=120, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2.2, 1.0]})
    residual = found.y - found.model
    order = np.argsort(found.x, kind="stable")
    top.plot(found.x, found.y, "o", ms=3, mfc="none", color="#000000", alpha=0.6, label="measured")
    if relaxing:
        t = np.geomspace(found.x.min() / 2, found.x.max(), 300)
        top.plot(t, found(t), "-", lw=1.6, color="#0072b2", label="g(t), after an instantaneous stretch")
        top.plot(found.x, found.model, ".", ms=3, color="#d55e00", label="fit, with each test's ramp")
    else:
        top.plot(found.x[order], found.model[order], "-", lw=1.6, color="#d55e00", label="fit")
    if isinstance(found, TableFit):
        top.plot(found.knots, found.moments, "s", ms=4, color="#0072b2", label=f"{KNOTS} knots of the crease law")
        if found.rest_angle is not None:
            top.axvline(found.rest_angle, lw=0.8, ls="--", color="#333333")
            top.annotate(f"zero torque {found.rest_angle:.4f} rad", (found.rest_angle, found.y.min()), fontsize=8,
                         xytext=(4, 0), textcoords="offset points")  # fmt: skip
    top.legend(fontsize=8, frameon=False)
    top.set_ylabel(found.labels[1])
    if title:
        top.set_title(title, fontsize=10)
    spread = float(np.sqrt(np.mean(residual**2)))
    bottom.axhspan(-2 * spread, 2 * spread, color="#d9d9d9", lw=0, label="twice the rms")
    bottom.axhline(0.0, lw=0.8, color="#333333")
    bottom.plot(found.x, residual, ".", ms=3, color="#d55e00")
    bottom.legend(fontsize=8, frameon=False, loc="upper right")
    bottom.set_ylabel("residual")
    bottom.set_xlabel(found.labels[0])
    if logarithmic if logarithmic is not None else relaxing:
        bottom.set_xscale("log")
    partial = target.with_name(f".{target.stem}.{os.getpid()}.partial{target.suffix}")
    try:
        figure.savefig(partial)
        os.replace(partial, target)
    except OSError as e:
        raise InputError(f"cannot write the picture ({e.strerror})", file=target) from None
    finally:
        partial.unlink(missing_ok=True)
    return target
