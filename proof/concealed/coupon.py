"""A crease in a torque test: a bridge of finite length between two stiff panels, fibre by fibre.

The bridge is cut into stations along its length and fibres across its height. A fibre at height s (-1 to 1) turns by s
times the fold, and has a law and a memory of its own; the moment is the same at all stations, their turns add up to the
fold that is prescribed. There is no hinge, and no law of a moment against an angle.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from beam import BeamCase
from laws import Concealed, Law

STRUCTURES = ("crease_coupon",)
STATIONS = 5
HEIGHT, SHARE = np.polynomial.legendre.leggauss(24)
"""Heights of the fibres over half of the bridge's, and the part of it that each stands for (twice)."""

SHARP = 0.004
"""Turn of the outermost fibre at which a dry layer begins to slide [rad]."""

TORN = 0.75
"""Part of the largest fold of a recording at which a bridge tears."""


@dataclass(frozen=True)
class Bridge:
    """What the effects change of a bridge; strengths are in the numbers of the catalogue where it has them.

    Attributes:
        cubic: moment over the cube of the fold [N m/rad^3]. valley: stiffness added to valleys [N m/rad].
        offset: moment by which it folds itself, without a test's [N m]. lasting: stiffness times the part of a fold
            that stays [N m/rad].
        virgin: stiffness that folding destroys [N m/rad], half of it at the fold `half` [rad].
        dry: moment of dry layers [N m]. plastic: moment of layers that yield at the turn `yields` [N m, rad].
        play: of the grip [rad]. wear: part of the stiffness lost at each reversal. tear: part that is lost at once.
        drift: of the load cell over a recording [N m]. taper: relative difference of stiffness from end to end.
    """

    cubic: float = 0.0
    valley: float = 0.0
    offset: float = 0.0
    lasting: float = 0.0
    virgin: float = 0.0
    half: float = 0.3
    dry: float = 0.0
    plastic: float = 0.0
    yields: float = 0.1
    play: float = 0.0
    wear: float = 0.0
    tear: float = 0.0
    drift: float = 0.0
    taper: float = 0.0


FIELDS = {
    "stiffening": "cubic",
    "asymmetry": "valley",
    "rest_angle": "offset",
    "set": "lasting",
    "mullins": "virgin",
    "friction": "dry",
    "hysteresis": "plastic",
    "backlash": "play",
    "fatigue": "wear",
    "tear": "tear",
    "drift": "drift",
    "taper": "taper",
}
SITE = "crease"
INSIDE: dict[str, dict[str, Concealed]] = {
    "crease_coupon": {
        "stiffening": Concealed(Law, ("crease_stiffening",), SITE, 0.1, number="cubic_stiffness"),
        "asymmetry": Concealed(Law, ("crease_asymmetry",), SITE, 0.1, signed=True, number="valley_stiffness"),
        "rest_angle": Concealed(
            Law, ("crease_offset", "crease_swelling"), SITE, 0.02, signed=True, number="offset_moment"
        ),
        "set": Concealed(Law, ("crease_set",), SITE, 0.05, number="set_stiffness"),
        "mullins": Concealed(Law, ("crease_mullins",), SITE, 0.2),
        "friction": Concealed(Law, ("crease_friction",), SITE, 0.02, number="friction_moment"),
        "hysteresis": Concealed(Law, ("crease_hysteresis",), SITE, 0.02, number="hysteresis_moment"),
    }
}
"""Mechanisms that the catalogue has."""

OUTSIDE: dict[str, dict[str, Concealed]] = {
    "crease_coupon": {
        "backlash": Concealed(Law, (), SITE, 0.02, False, False, 0.3),
        "fatigue": Concealed(Law, (), SITE, 0.02, False, False, 0.3),
        "tear": Concealed(Law, (), SITE, 0.05, False, False, 0.6),
    }
}
"""Mechanisms that it has not."""


def draw(structure: str, rng: np.random.Generator) -> dict:
    """A coupon with a drawn stiffness, and two tests of growing folds on coupons of one batch."""
    stiffness = 1.5e-3 * float(rng.uniform(0.7, 1.4))
    o: dict = {
        "structure": structure,
        "scene": structure,
        "creases": [{"name": "hinge"}],
        "faces": [0, 1],
        "held": 0,
    }
    o["settings"] = {"stiffness": stiffness, "rest_angle": 0.0}
    o["priors"] = {"stiffness": 0.05 * stiffness}
    most = float(rng.uniform(0.9, 1.3))
    loop = np.concatenate([path(a, b) for a, b in ((0, 0.5), (0.5, -0.5), (-0.5, 1.0), (1.0, -1.0), (-1.0, 0.0))])
    o["recordings"] = [{"levels": (a * most * np.concatenate([[0.0], loop])).tolist()} for a in (1.0, 0.5)]
    o["noise"] = float(stiffness * most * np.exp(rng.uniform(np.log(1e-3), np.log(4e-3))))
    return o


def path(start: float, end: float) -> np.ndarray:
    """Even steps of 0.1 from one fold to another, without the first."""
    return np.linspace(start, end, round(abs(end - start) / 0.1) + 1)[1:]


class CouponCase(BeamCase):
    """A coupon with its true stiffness; see `BeamCase`."""

    def scale(self, place: int) -> float:
        return self.settings["stiffness"]

    def curves(self, entries: list[dict], **factors) -> list[np.ndarray]:
        """The moment [N m] that holds the fold, (n, 1) for every recording."""
        stiffness = self.settings["stiffness"] * factors.get("stiffness", 1.0)
        bridge = entered(entries)
        return [moments(stiffness, np.array(r["levels"]), bridge)[:, None] for r in self.o["recordings"]]

    def nuisances(self, rng: np.random.Generator) -> list[dict]:
        """A load cell that drifts, a grip with play, a bridge that is thicker at one end."""
        return [
            {"mechanism": "drift", "strength": float(0.01 * self.scale(0) * rng.normal()), "place": 0, "extra": {}},
            {"mechanism": "backlash", "strength": float(0.005 * rng.uniform()), "place": 0, "extra": {}},
            {"mechanism": "taper", "strength": float(0.3 * rng.normal()), "place": 0, "extra": {}},
        ]

    def known(self) -> dict:
        """What an experimenter knows: where the coupon rests, too."""
        known = super().known()
        return known | {"priors": known["priors"] | {"rest_angle": 0.0}}

    def write(self, folder: Path, entries: list[dict], tracker: dict, rng: np.random.Generator, first: int = 1) -> None:
        for n, (r, curve) in enumerate(zip(self.o["recordings"], self.curves(entries), strict=True)):
            name = f"recording{first + n}"
            values = curve[:, 0] + tracker["noise"] * rng.normal(size=len(curve))
            values = np.round(values / tracker["quantum"]) * tracker["quantum"]
            rows = [f"{a:.9g},{m:.9g}" for a, m in zip(r["levels"], values, strict=True)]
            (folder / f"{name}.csv").write_text("\n".join(["fold_rad,moment_Nm", *rows]) + "\n")
            text = [f'name = "{name}"', "[channels.moment]", 'column = "moment_Nm"', 'kind = "moment"', 'unit = "N m"']
            text += ["crease = 0", f"noise = {tracker['stated']:.6g}"]
            text += ["[drive.crease_angle]", 'column = "fold_rad"', 'unit = "rad"']
            (folder / f"{name}.toml").write_text("\n".join(text) + "\n")


def entered(entries: list[dict]) -> Bridge:
    """The bridge with some effects; what stands twice adds up."""
    bridge = Bridge()
    for e in entries:
        name = FIELDS[e["mechanism"]]
        bridge = replace(bridge, **{name: getattr(bridge, name) + e["strength"]})
        if e["mechanism"] == "hysteresis":
            bridge = replace(bridge, yields=e["extra"]["angle"])
    return bridge


@dataclass
class Fibres:
    """What all fibres remember: their largest turns to both sides, and the turns at which their layers are relaxed."""

    most: np.ndarray
    least: np.ndarray
    dry: np.ndarray
    plastic: np.ndarray


def moments(stiffness: float, folds: np.ndarray, b: Bridge) -> np.ndarray:
    """The moment (n,) [N m] along folds (n,) [rad]."""
    own = 1.0 + b.taper * ((np.arange(STATIONS) + 0.5) / STATIONS - 0.5)
    empty = np.zeros((STATIONS, len(HEIGHT)))
    known, turn, moment = Fibres(empty, empty, empty, empty), np.zeros(STATIONS), 0.0
    out, health, torn, last = [], 1.0, False, 0.0
    for n, fold in enumerate(folds):
        way = np.sign(fold - folds[n - 1]) if n else 0.0
        health *= 1.0 - b.wear if way * last < 0 else 1.0
        last = way or last
        if not torn and abs(fold) > TORN * np.abs(folds).max():
            torn, health = True, health * (1.0 - b.tear)
        bent = np.sign(fold) * max(abs(fold) - b.play, 0.0)
        for _ in range(60):
            held, slope, _ = section(turn, known, b, stiffness * health)
            held, slope = held * own, slope * own
            # one moment at all stations, and turns whose mean is the fold
            change = (bent - np.mean(turn + (moment - held) / slope)) / np.mean(1.0 / slope)
            moment += change
            step = (moment - held) / slope
            turn = turn + step
            if np.abs(step).max() < 1e-12:
                break
        else:
            raise RuntimeError(f"no moment holds a fold of {fold:.3g} rad")
        known = section(turn, known, b, stiffness * health)[2]
        out.append(moment + b.drift * n / (len(folds) - 1))
    return np.array(out)


def section(turn: np.ndarray, known: Fibres, b: Bridge, stiffness: float) -> tuple[np.ndarray, np.ndarray, Fibres]:
    """Moment and its slope (S,) where the stations have turned to `turn` (S,), and what the fibres then remember."""
    u = turn[:, None] * HEIGHT
    most, least = np.maximum(known.most, u), np.minimum(known.least, u)
    far = np.maximum(most, -least)
    stress = stiffness * u + b.cubic / 0.6 * u**3 - b.offset * HEIGHT - b.lasting * (most + least)
    slope = stiffness + 3 * b.cubic / 0.6 * u**2 - b.lasting * ((u >= known.most) | (u <= known.least))
    carries = u * HEIGHT > 0  # coats whose cracks close, on both faces, in a valley
    stress, slope = stress + b.valley * u * carries, slope + b.valley * carries
    soft = b.virgin * b.half / (b.half + far)
    stress, slope = stress + soft * u, slope + soft
    layers = []
    for limit, at, relaxed in ((b.dry, SHARP, known.dry), (b.plastic, b.yields, known.plastic)):
        stretch = np.clip(u - relaxed, -at, at)
        stress, slope = stress + limit / 1.5 * stretch / at, slope + limit / 1.5 / at * (np.abs(u - relaxed) < at)
        layers.append(u - stretch)
    moment = 1.5 * (stress * HEIGHT) @ SHARE
    return moment, 1.5 * (slope * HEIGHT**2) @ SHARE, Fibres(most, least, *layers)
