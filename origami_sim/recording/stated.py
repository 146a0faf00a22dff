"""What a sidecar states of one recording beside its channels: which way gravity points, and how the motion begins."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.section import Section, split_quantity
from origami_sim.units import unit_factor

POSES = ("hanging", "upside down", "lying")
STATES = ("released", "equilibrium", "moving")
MOTIONS = ("dynamic", "quasistatic")
_GRAVITY_KEYS = ("pose", "down", "face", "size")
_START_KEYS = ("state", "angles", "sd", "rate_sd")


@dataclass(frozen=True)
class Gravity:
    """Which way gravity pointed, in the model's axes, while something was recorded.

    Attributes:
        direction: unit vector (3,). size: [m/s^2]; None: as large as the model has it. words: for notes.
    """

    direction: tuple[float, float, float]
    size: float | None
    words: str

    def vector(self, size: float) -> np.ndarray:
        """Acceleration (3,) [m/s^2], of this size where none is stated."""
        return np.array(self.direction) * (size if self.size is None else self.size)


@dataclass(frozen=True)
class Start:
    """How a motion begins, as an experimenter states it.

    Attributes:
        state: "released" (at rest), "equilibrium" (at rest where the model rests in the drive of the first frame) or
            "moving".
        angles: fold angles at release by crease, name or number as text [rad]; others are as recorded.
        sd: standard deviation of them, or of the equilibrium [rad]. rate_sd: of the fold rates that are zero [rad/s].
    """

    state: str
    angles: Mapping[str, float] = field(default_factory=dict)
    sd: float | None = None
    rate_sd: float | None = None


def gravity_spec(path: Path, given: object) -> Gravity | None:
    """The key `gravity` of a sidecar: three components [m/s^2], or a pose in words with its direction.

    Raises:
        InputError: neither, an unknown key or pose, a direction that is missing, not needed or zero.
    """
    if given is None:
        return None
    if isinstance(given, list):
        vector = np.array(Section(path, "", {"gravity": given}, ("gravity",)).vector("gravity", None))
        size = float(np.linalg.norm(vector))
        if size > 100.0:
            raise InputError(
                "no gravity is that large", file=path, field="gravity", value=given, allowed="up to 100 m/s^2"
            )
        unit = vector / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
        return Gravity((float(unit[0]), float(unit[1]), float(unit[2])), size, f"gravity {given} m/s^2")
    if not isinstance(given, dict):
        raise InputError(
            "must be three components or a pose",
            file=path,
            field="gravity",
            value=given,
            allowed="[gx, gy, gz] in m/s^2, or a table with pose = " + ", ".join(f"'{p}'" for p in POSES),
        )
    section = Section(path, "gravity.", given, _GRAVITY_KEYS)
    pose = section.choice("pose", dict.fromkeys(POSES))
    needed, other = ("face", "down") if pose == "lying" else ("down", "face")
    if needed not in given:
        meaning = {"down": "points down as it hangs", "face": "points down as it lies"}[needed]
        section.refuse(
            f"'{pose}' needs '{needed}', the direction of the model that {meaning}", f"gravity.{needed}", None
        )
    if other in given:
        section.refuse(f"is not for '{pose}', which takes '{needed}'", f"gravity.{other}", given[other])
    direction = np.array(section.vector(needed, None))
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        section.refuse("must not be zero", f"gravity.{needed}", given[needed])
    direction = direction / length * (-1.0 if pose == "upside down" else 1.0)
    size = section.quantity("size", "acceleration") if "size" in given else None
    if size is not None and not 0.0 < size <= 100.0:
        section.refuse("must be positive, at most 100 m/s^2", "gravity.size", given["size"])
    return Gravity((float(direction[0]), float(direction[1]), float(direction[2])), size, pose)


def start_spec(path: Path, given: object) -> Start | None:
    """The key `start` of a sidecar: a word, or a table with angles and their standard deviations.

    Raises:
        InputError: neither, an unknown key or word, angles without a standard deviation, one that is not positive.
    """
    if given is None:
        return None
    section = Section(path, "start.", {"state": given} if isinstance(given, str) else given, _START_KEYS)
    state = section.choice("state", dict.fromkeys(STATES))
    angles = {
        crease: section.check_quantity(f"start.angles.{crease}", value, "angle")
        for crease, value in section.table("angles").items()
    }
    if "angles" in section.values and state != "released":
        section.refuse("are those of a release", "start.angles", section.values["angles"])
    if "angles" in section.values and not angles:
        section.refuse("must name creases", "start.angles", section.values["angles"])
    sd = _deviation(section, "sd", "angle", "rad")
    if angles and sd is None:
        section.refuse("released angles need a standard deviation", "start.sd", None)
    if sd is not None and not angles and state != "equilibrium":
        section.refuse("is that of released angles or of an equilibrium", "start.sd", section.values["sd"])
    rate_sd = _deviation(section, "rate_sd", "angle", "rad/s")
    if rate_sd is not None and state == "moving":
        section.refuse("is for what begins at rest", "start.rate_sd", section.values["rate_sd"])
    return Start(state, angles, sd, rate_sd)


def _deviation(section: Section, key: str, dimension: str, unit: str) -> float | None:
    """A positive number [SI], or a text with a unit ("0.01 rad", "1 deg/s")."""
    value = section.values.get(key)
    if value is None:
        return None
    if isinstance(value, str) and unit.endswith("/s"):
        if not value.strip().endswith("/s"):
            section.refuse("must be a rate such as '0.01 rad/s'", section.prefix + key, value)
        value = value.strip()[:-2]
    found = section.check_quantity(section.prefix + key, value, dimension)
    if not found > 0.0:
        section.refuse(f"must be a positive number in {unit}, or a text with a unit", section.prefix + key, value)
    return found


def noise_spec(section: Section, dimension: str, unit: str | None) -> tuple[float, str | None] | None:
    """The key `noise` of a channel: a number in the channel's unit (None), or a text with a unit of its own.

    Raises:
        InputError: not positive, a unit of another dimension.
    """
    value = section.values.get("noise")
    if value is None:
        return None
    own: str | None = None
    if isinstance(value, str):
        number, own = split_quantity(value)
        if number is None:
            section.refuse(
                "must be a number, or a text with a unit such as '0.4 mrad'", section.prefix + "noise", value
            )
        if own == "px" and unit != "px":
            section.refuse("only readings in px have noise in px", section.prefix + "noise", value)
        if own != "px":
            unit_factor(own, dimension=dimension, file=section.file, field=section.prefix + "noise")
    else:
        number = section.check_number("noise", value)
    if number is None or not number > 0.0:
        section.refuse("the noise must be positive", section.prefix + "noise", value)
    return number, own


def prior_spec(section: Section, name: str) -> Any:
    """A prior: a number or a text, or a table with `sd` or `factor`, as the text that stands for it.

    Raises:
        InputError: a table without exactly one of both, a factor that is not above 1.
    """
    value = section.values["priors"][name]
    if not isinstance(value, dict):
        return section.label("priors", name)
    field_name = f"priors.{name}"
    if len(value) != 1 or not set(value) <= {"sd", "factor"}:
        raise InputError(
            "must have sd or factor",
            file=section.file,
            field=field_name,
            value=value,
            allowed='{ sd = "0.02 rad" } or { factor = 1.2 }',
        )
    if "sd" in value:
        return value["sd"] if isinstance(value["sd"], str) else section.check_number(field_name, value["sd"])
    factor = section.check_number(field_name + ".factor", value["factor"])
    if not factor > 1.0:
        section.refuse("must be above 1", field_name + ".factor", factor)
    return f"{50.0 * (factor - 1.0 / factor):.12g} %"
