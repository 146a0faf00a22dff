"""Devices of rigid panels: motions of MuJoCo, what effects do to their recordings, and how well that shows."""

from pathlib import Path

import numpy as np
from laws import MEASUREMENT, build
from recorder import channels, readings, tracked, write
from world import FINE, Law, Motion, Numbers, World

EVERY = 4
"""Of the samples of a motion, which are used for d'."""

FACTORS = {
    "crease.stiffness": "stiffness",
    "crease_viscosity.viscosity": "viscosity",
    "inertia.mass": "mass",
    "magnetic_torque.remanence": "remanence",
    "coulomb.friction_coefficient": "friction",
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


class RigidCase:
    """An object with its true common factors; effects are entries {mechanism, strength, place, extra}.

    The signature of effects is the difference that they make, over whole recordings that start alike, in standard
    deviations of the noise, after projecting out what the starts and the uncertain numbers (within what is known of
    them) can take up. Its norm is d'.
    """

    def __init__(self, o: dict, factors: dict[str, float]):
        self.o, self.factors = o, factors
        self._tangents: list | None = None
        self._about: list = []
        self._without: list[np.ndarray] = []
        self._rest = o["held"] is None
        self._plain: dict[int, np.ndarray] = {}
        noise = np.hypot(o["noise"], o["noise"] / 2 / np.sqrt(12))
        self._sigma = noise / np.sqrt(o["rate"] * EVERY / FINE)

    def scale(self, place: int) -> float:
        """What the strengths of elastic effects are measured in: the crease's stiffness [N m/rad]."""
        return self.o["creases"][place]["stiffness"]

    def duration(self, recording: dict) -> float:
        return self.o["duration"] * recording.get("stretch", 1.0)

    def world(self, laws=(), **changed) -> World:
        return World(self.o, numbers_of(self.o, {**self.factors, **changed}), tuple(laws))

    def motions(self, laws=()) -> list[Motion]:
        """Motions of all recordings, from the release, or from rest where a field drives."""
        world, out = self.world(laws), []
        for r in self.o["recordings"]:
            q0 = np.array(r["release"])
            if self._rest:
                q0 = np.zeros(len(world.joints))
            elif "field" in r:
                still = {"field": {**r["field"], "amplitude": 0.0}}
                q0 = world.run(still, world.settled(), duration=1.5).angles[-1]
            out.append(world.run(r, q0, duration=self.duration(r) + 0.2))
        return out

    def signature(self, entries: list[dict], *, fresh: bool = False) -> np.ndarray:
        """The projected difference that effects make.

        Args:
            fresh: find anew what starts and numbers can take up, about this motion; else about the last that did.
        """
        (laws, chain), plain = entered(entries), self.world()
        recorded = list(zip(self.o["recordings"], self.motions(laws), strict=True))
        if fresh or self._tangents is None:
            self._tangents = [self._tangent(r, m) for r, m in recorded]
            self._about, self._without = recorded, []
        rows = []
        for n, ((r, m), (basis, _)) in enumerate(zip(recorded, self._tangents, strict=True)):
            without = self._plain.get(n)
            if without is None:
                without = self._repeated(plain, r, m.angles[0], m.rates[0])
            if self._rest:  # it starts alike, whatever is concealed
                self._plain[n] = without
            gap = readings(plain, m, self._times(r, m), chain) - without
            d = gap.ravel() / self._sigma
            rows.append(d - basis @ (basis.T @ d))
        return self._cleared(rows)

    def beside(self, other: dict) -> np.ndarray:
        """The signature of another, small effect, about the motion for which signatures were last found afresh.

        Laws with memory begin without one.
        """
        (laws, chain), plain, gaps = entered([other]), self.world(), []
        if laws:
            self._without = self._without or [self._repeated(plain, r, m.angles[0], m.rates[0]) for r, m in self._about]
            world = self.world(laws)
            for (r, m), without in zip(self._about, self._without, strict=True):
                gaps.append(self._repeated(world, r, m.angles[0], m.rates[0]) - without)
        else:
            for r, m in self._about:
                times = self._times(r, m)
                gaps.append(readings(plain, m, times, chain) - readings(plain, m, times, {}))
        rows = [gap.ravel() / self._sigma for gap in gaps]
        bases = [basis for basis, _ in self._tangents or ()]
        return self._cleared([d - basis @ (basis.T @ d) for d, basis in zip(rows, bases, strict=True)])

    def _cleared(self, rows: list[np.ndarray]) -> np.ndarray:
        """Differences over the recordings without what the numbers can take up, and by how much they would change."""
        t, d = np.concatenate([c for _, c in self._tangents or ()]), np.concatenate(rows)
        x = np.linalg.solve(t.T @ t + np.eye(t.shape[1]), t.T @ d)
        return np.concatenate([d - t @ x, -x])

    def _times(self, r: dict, m: Motion) -> np.ndarray:
        """Times of the samples of a recording that are used for d' [s]."""
        return m.times[: round(self.duration(r) * FINE) + 1 : EVERY]

    def _repeated(self, world: World, r: dict, q: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Readings (n, D) of a recording from a start."""
        return channels(world, world.run(r, q, w, duration=self.duration(r)).angles)[::EVERY]

    def _tangent(self, r: dict, m: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Orthonormal columns of what the start takes up, and columns of the numbers per standard deviation."""
        q, w, e = m.angles[0], m.rates[0], np.eye(0 if self._rest else len(self.o["creases"]))
        plain, priors = self.world(), self.o["priors"]
        base = self._repeated(plain, r, q, w)
        local = [(self._repeated(plain, r, q + 1e-4 * v, w) - base) / 1e-4 for v in e]
        local += [(self._repeated(plain, r, q, w + 1e-3 * v) - base) / 1e-3 for v in e]
        common = []
        for n, spread in priors.items():
            other = self.world(**{n: self.factors.get(n, 1.0) * 1.001})
            common.append((self._repeated(other, r, q, w) - base) / 1e-3 * spread)
        common = np.stack([v.ravel() for v in common], axis=1) / self._sigma
        basis = np.zeros((len(common), 0))
        if local:
            basis, _ = np.linalg.qr(np.stack([v.ravel() for v in local], axis=1) / self._sigma)
        return basis, common - basis @ (basis.T @ common)

    # --- what nobody lists

    def nuisances(self, rng: np.random.Generator) -> list[dict]:
        """Nuisances that may be drawn: panel masses, zero and clock of the camera, air, an imperfect release."""
        o, still = self.o, self.world()
        weight = o["density"] * o["thickness"] * still.areas[1] * o["gravity"]
        push = 0.02 * weight * float(np.ptp(still.corners[1], axis=0).max())
        errors = {"errors": (0.01 * rng.normal(size=len(o["faces"]))).tolist()}
        if self._rest:
            return [
                entry("panel_masses", 1.0, extra=errors),
                entry("length_scale", float(2e-3 * rng.normal())),
                entry("air_drag", float(rng.uniform(0.3, 1.2))),
                entry("clock_rate", float(1e-3 * rng.normal())),
            ]
        return [
            entry("panel_masses", 1.0, extra=errors),
            entry("angle_offset", float(3e-3 * rng.normal())),
            entry("air_drag", float(rng.uniform(0.3, 1.2))),
            entry("pushes", push, extra={"pulses": [[0.0, 1.0]]}),
            entry("clock_rate", float(1e-3 * rng.normal())),
        ]

    # --- recordings

    def tracker(self, rng: np.random.Generator) -> dict:
        """A camera's habits; `stated`: the noise that the sidecar states, 0 if none."""
        smoothing = bool(rng.random() < 0.3)
        out = {"noise": self.o["noise"], "quantum": self.o["noise"] / 2, "smoothing": smoothing}
        out |= {"lost": float(rng.choice([0.0, 0.01])), "gap": int(rng.choice([0, 4]))}
        level = np.hypot(out["noise"] * (np.sqrt(0.375) if smoothing else 1.0), out["quantum"] / np.sqrt(12))
        return out | {"stated": float(level) if rng.random() < 0.7 else 0.0}

    def write(self, folder: Path, entries: list[dict], tracker: dict, rng: np.random.Generator, first: int = 1) -> None:
        """The recordings, numbered from `first` on."""
        laws, chain = entered(entries)
        world = self.world(laws)
        for n, (r, m) in enumerate(zip(self.o["recordings"], self.motions(laws), strict=True)):
            times = np.arange(round(self.duration(r) * self.o["rate"]) + 1) / self.o["rate"]
            values = tracked(readings(world, m, times, chain), tracker, rng)
            write(folder, f"recording{first + n}", self.o, r, times, values, tracker)

    def known(self) -> dict:
        """What an experimenter knows of the object."""
        return {k: v for k, v in self.o.items() if k not in ("recordings", "noise", "duration", "rate", "channels")}


def entry(mechanism: str, strength: float, place: int = 0, extra: dict | None = None) -> dict:
    return {"mechanism": mechanism, "strength": strength, "place": place, "extra": extra or {}}


def entered(entries: list[dict]) -> tuple[list[Law], dict[str, float]]:
    """Laws and measurement errors of some effects; errors of the same kind add up."""
    laws: list[Law] = []
    chain: dict[str, float] = {}
    for e in entries:
        if e["mechanism"] in MEASUREMENT:
            chain[e["mechanism"]] = chain.get(e["mechanism"], 0.0) + e["strength"]
        elif e["mechanism"] == "panel_masses":
            laws.append(PanelMasses(e["strength"], e["place"], dict(e["extra"])))
        else:
            laws.append(build(e["mechanism"], e["strength"], e["place"], e["extra"]))
    return laws, chain
