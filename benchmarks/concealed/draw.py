"""Draws one case: an object with something concealed, its recordings, and the sealed answer.

    python draw.py --seed 7 --case 3 --folder cases/0003 --answer sealed/0003.json

The case's folder gets object.json (what an experimenter knows) and the recordings; the answer goes elsewhere. Nothing
here imports the simulator under test. The strength is set by detectability d': the norm of the difference that the
effect makes over stretches of a second, each from the same start, in standard deviations of the noise, after projecting
out what the starts and the uncertain numbers (within what is known of them) can take up.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from laws import INSIDE, MEASUREMENT, OUTSIDE, Concealed, Law, build
from objects import STRUCTURES, draw
from recorder import channels, readings, tracked, write
from world import FINE, Motion, Numbers, World

LEVELS = (2.0, 5.0, 10.0, 20.0, 50.0)
STRETCH = 1.0
"""Length of the stretches over which d' is taken [s]."""

EVERY = 4
"""Of the samples of a motion, which are used for d'."""

NUISANCE = 2.0
"""Largest d' of an unlisted nuisance: beyond, it would be a second effect."""

KINDS = {"single": 0.55, "null": 0.25, "outside": 0.12, "double": 0.08}
NULLS = ("plain", "wrong_parameter", "wrong_camera")
FACTORS = {
    "crease.stiffness": "stiffness",
    "crease_viscosity.viscosity": "viscosity",
    "inertia.mass": "mass",
    "magnetic_torque.remanence": "remanence",
}


class PanelMasses(Law):
    """Panels whose masses differ one by one, by about one per cent."""

    def prepare(self, numbers: Numbers):
        numbers.mass *= 1 + self.strength * np.array(self.extra["errors"])


def numbers_of(o: dict, factors: dict[str, float]) -> Numbers:
    """True numbers from common factors."""
    numbers = Numbers.described(o)
    for name, factor in factors.items():
        getattr(numbers, FACTORS[name])[:] *= factor
    return numbers


class Case:
    """An object with its true common factors, and what effects do to its recordings."""

    def __init__(self, o: dict, factors: dict[str, float]):
        self.o, self.factors = o, factors
        self._tangents: list | None = None
        noise = np.hypot(o["noise"], o["noise"] / 2 / np.sqrt(12))
        self._sigma = noise / np.sqrt(o["rate"] * EVERY / FINE)

    def world(self, laws=(), **changed) -> World:
        return World(self.o, numbers_of(self.o, {**self.factors, **changed}), tuple(laws))

    def motions(self, laws=()) -> list[Motion]:
        """Motions of all recordings, from the release, or from rest where a field drives."""
        world, out = self.world(laws), []
        for r in self.o["recordings"]:
            q0 = np.array(r["release"])
            if "field" in r:
                still = {"field": {**r["field"], "amplitude": 0.0}}
                q0 = world.run(still, world.settled(), duration=1.5).angles[-1]
            out.append(world.run(r, q0, duration=self.o["duration"] + 0.2))
        return out

    def detectability(self, laws=(), chain: dict | None = None, *, fresh: bool = False) -> float:
        """d' of laws and of errors of the measurement.

        Args:
            fresh: find anew what starts and numbers can take up, about this motion; else about the last that did.
        """
        chain, plain = chain or {}, self.world()
        stretches = list(self._stretches(self.motions(laws)))
        if fresh or self._tangents is None:
            self._tangents = [self._tangent(r, m, k) for r, m, k in stretches]
        rows = []
        for (r, m, k), (basis, _) in zip(stretches, self._tangents, strict=True):
            times = m.times[k : k + round(STRETCH * FINE) + 1 : EVERY]
            gap = readings(plain, m, times, chain) - self._stretch(plain, r, m.angles[k], m.rates[k], m.times[k])
            d = gap.ravel() / self._sigma
            rows.append(d - basis @ (basis.T @ d))
        t, d = np.concatenate([c for _, c in self._tangents]), np.concatenate(rows)
        x = np.linalg.solve(t.T @ t + np.eye(t.shape[1]), t.T @ d)
        return float(np.sqrt(np.sum((d - t @ x) ** 2) + x @ x))

    def _stretches(self, motions: list[Motion]):
        """Recording, motion and first sample of every stretch."""
        for r, m in zip(self.o["recordings"], motions, strict=True):
            for start in np.arange(0.0, self.o["duration"] - 0.5 * STRETCH, STRETCH):
                yield r, m, round(start * FINE)

    def _stretch(self, world: World, r: dict, q, w, start: float) -> np.ndarray:
        """Readings (n, D) of one stretch from a start."""
        return channels(world, world.run(r, q, w, duration=STRETCH, start=start).angles)[::EVERY]

    def _tangent(self, r: dict, m: Motion, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Orthonormal columns of what the start takes up, and columns of the numbers per standard deviation."""
        q, w, start, e = m.angles[k], m.rates[k], m.times[k], np.eye(len(self.o["creases"]))
        plain, priors = self.world(), self.o["priors"]
        base = self._stretch(plain, r, q, w, start)
        local = [(self._stretch(plain, r, q + 1e-4 * v, w, start) - base) / 1e-4 for v in e]
        local += [(self._stretch(plain, r, q, w + 1e-3 * v, start) - base) / 1e-3 for v in e]
        common = []
        for n, spread in priors.items():
            other = self.world(**{n: self.factors.get(n, 1.0) * 1.001})
            common.append((self._stretch(other, r, q, w, start) - base) / 1e-3 * spread)
        local, common = (np.stack([v.ravel() for v in vs], axis=1) / self._sigma for vs in (local, common))
        basis, _ = np.linalg.qr(local)
        return basis, common - basis @ (basis.T @ common)


def draw_extra(name: str, rng: np.random.Generator, duration: float) -> dict:
    """Second numbers of a law."""
    if name == "hysteresis":
        return {"angle": float(rng.uniform(0.05, 0.2))}
    if name == "relaxation":
        return {"time": float(np.exp(rng.uniform(np.log(0.05), np.log(1.0))))}
    if name == "parametric_stiffness":
        return {"frequency": float(rng.uniform(0.7, 3.0))}
    if name == "pushes":
        at = np.sort(rng.uniform(0.2, duration - 0.2, 5))
        return {"pulses": [[float(t), float(rng.choice([-1, 1]))] for t in at]}
    return {}


def effect(name: str, strength: float, place: int, extra: dict) -> tuple[tuple[Law, ...], dict]:
    """Laws and measurement errors of one effect."""
    if name in MEASUREMENT:
        return (), {name: strength}
    return (build(name, strength, place, extra),), {}


def strength_for(case: Case, name: str, c: Concealed, place: int, extra: dict, wanted: float, sign: float):
    """The strength with the wanted d', and the d' that it has: secant steps in the logarithm."""
    scale = case.o["creases"][place]["stiffness"] if c.stiff else 1.0
    largest, s = c.largest * scale, c.first * scale
    fresh = False
    for _ in range(12):
        got = case.detectability(*effect(name, sign * s, place, extra), fresh=fresh)
        near = abs(np.log(got / wanted)) < 0.1 or (s == largest and got < wanted)
        if near and fresh:
            break
        if not near:
            s = min(largest, s * float(np.clip(wanted / max(got, 1e-9), 0.02, 50.0)))
        fresh = near
    return sign * s, got


def nuisances(case: Case, rng: np.random.Generator, concealed: str) -> list[dict]:
    """Two or three things that nobody lists, each too small to be seen by itself."""
    o, panel = case.o, case.world()
    weight = o["density"] * o["thickness"] * panel.areas[1] * o["gravity"]
    push = 0.02 * weight * float(np.ptp(panel.corners[1], axis=0).max())
    drawn = {
        "panel_masses": (1.0, {"errors": (0.01 * rng.normal(size=len(o["faces"]))).tolist()}),
        "angle_offset": (float(3e-3 * rng.normal()), {}),
        "air_drag": (float(rng.uniform(0.3, 1.2)), {}),
        "pushes": (push, {"pulses": [[0.0, 1.0]]}),  # an imperfect release
        "clock_rate": (float(1e-3 * rng.normal()), {}),
    }
    drawn.pop(concealed, None)
    out = []
    for name in rng.choice(list(drawn), size=int(rng.integers(2, 4)), replace=False).tolist():
        strength, extra = drawn[name]
        d = case.detectability(*nuisance(name, strength, extra))
        part = min(1.0, NUISANCE / max(d, 1e-9))
        out.append({"name": name, "strength": strength * part, "extra": extra, "d": d * part})
    return out


def nuisance(name: str, strength: float, extra: dict) -> tuple[tuple[Law, ...], dict]:
    if name == "panel_masses":
        return (PanelMasses(strength, 0, dict(extra)),), {}
    return effect(name, strength, 0, extra)


def choose(o: dict, rng: np.random.Generator, kind: str, without: str = "") -> dict:
    """What is concealed, but for its strength."""
    table = OUTSIDE if kind == "outside" else INSIDE
    suited = [n for n, c in table.items() if n != without and (not c.only or o["structure"] in c.only)]
    name = str(rng.choice(suited))
    c = table[name]
    place, site = 0, {"": "", "all": "all panels"}.get(c.site, "")
    if c.site == "crease":
        place = int(rng.integers(len(o["creases"])))
        site = o["creases"][place]["name"]
    elif c.site == "panel":
        free = [p for p in range(len(o["faces"])) if p != o["held"]]
        place = int(rng.choice(free))
        site = f"panel{place}"
    return {"mechanism": name, "place": place, "site": site, "extra": draw_extra(name, rng, o["duration"])}


def make(seed: int, index: int, folder: Path, answer: Path, *, structures=STRUCTURES, kinds=None) -> dict:
    """Writes one case and its answer."""
    rng = np.random.default_rng([seed, index])
    o = draw(str(rng.choice(list(structures))), rng)
    kinds = {k: v for k, v in KINDS.items() if kinds is None or k in kinds}
    kind = str(rng.choice(list(kinds), p=np.array(list(kinds.values())) / sum(kinds.values())))
    what = str(rng.choice(NULLS)) if kind == "null" else ""
    draws = {n: float(np.clip(rng.normal(), -2, 2)) for n in o["priors"]}
    if what == "wrong_parameter":
        wrong = str(rng.choice(list(draws)))
        draws[wrong] = float(rng.choice([-1, 1]) * rng.uniform(2.0, 2.5))
    factors = {n: 1 + z * o["priors"][n] for n, z in draws.items()}
    case = Case(o, factors)
    out: dict = {"seed": seed, "case": index, "kind": kind, "null": what, "structure": o["structure"]}
    out |= {"mechanism": "", "names": [], "site": "", "strength": 0.0, "d_wanted": 0.0, "d": 0.0, "number": ""}
    laws, chain = (), {}

    def conceal(chosen: dict, levels: tuple[float, ...]) -> dict:
        """Sets the strength of what was chosen, and puts it into the object."""
        nonlocal laws, chain
        c = {**INSIDE, **OUTSIDE}[chosen["mechanism"]]
        wanted = float(rng.choice(levels))
        sign = float(rng.choice([-1, 1])) if c.signed else 1.0
        strength, d = strength_for(case, chosen["mechanism"], c, chosen["place"], chosen["extra"], wanted, sign)
        more, errors = effect(chosen["mechanism"], strength, chosen["place"], chosen["extra"])
        laws, chain = (*laws, *more), {**chain, **errors}
        return {**chosen, "names": list(c.names), "strength": strength, "d_wanted": wanted, "d": d, "number": c.number}

    if what == "wrong_camera":
        name = str(rng.choice(["angle_scale", "clock_rate"]))
        out |= conceal({"mechanism": name, "place": 0, "site": "", "extra": {}}, LEVELS)
    elif kind != "null":
        out |= conceal(choose(o, rng, kind), LEVELS if kind == "single" else LEVELS[2:])
    if kind == "double":
        out["second"] = conceal(choose(o, rng, kind, without=out["mechanism"]), LEVELS[2:])
    others = nuisances(case, rng, out["mechanism"])
    for n in others:
        more, errors = nuisance(n["name"], n["strength"], n["extra"])
        laws = (*laws, *more)
        chain = {k: chain.get(k, 0.0) + errors.get(k, 0.0) for k in {**chain, **errors}}
    smoothing = bool(rng.random() < 0.3)
    tracker = {"noise": o["noise"], "quantum": o["noise"] / 2, "smoothing": smoothing}
    tracker |= {"lost": float(rng.choice([0.0, 0.01])), "gap": int(rng.choice([0, 4]))}
    level = np.hypot(o["noise"] * (np.sqrt(0.375) if smoothing else 1.0), tracker["quantum"] / np.sqrt(12))
    tracker["stated"] = float(level) if rng.random() < 0.7 else 0.0
    folder.mkdir(parents=True, exist_ok=True)
    answer.parent.mkdir(parents=True, exist_ok=True)
    world = case.world(laws)
    times = np.arange(round(o["duration"] * o["rate"]) + 1) / o["rate"]
    for n, (r, m) in enumerate(zip(o["recordings"], case.motions(laws), strict=True)):
        values = tracked(readings(world, m, times, chain), tracker, rng)
        write(folder, f"recording{n + 1}", o, r, times, values, tracker)
    known = {k: v for k, v in o.items() if k not in ("recordings", "noise", "duration", "rate", "channels")}
    (folder / "object.json").write_text(json.dumps(known, indent=1))
    out |= {"factors": factors, "nuisances": others, "tracker": tracker, "rate": o["rate"]}
    answer.write_text(json.dumps(out, indent=1))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--case", type=int, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--answer", type=Path, required=True)
    parser.add_argument("--structures", nargs="+", choices=STRUCTURES, default=STRUCTURES)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS))
    args = parser.parse_args()
    make(args.seed, args.case, args.folder, args.answer, structures=args.structures, kinds=args.kinds)


if __name__ == "__main__":
    main()
