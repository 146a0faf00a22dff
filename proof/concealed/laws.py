"""What may be concealed in an object: laws of our own, written for MuJoCo, and what they are called in a diagnosis.

The laws are other formulas or other regularisations than those of the simulator under test wherever physics allows it:
dry friction is Dahl's, air drag is integrated over nine points of a panel, a Prony branch is stepped implicitly.
"""

import math
from dataclasses import dataclass

import numpy as np
from world import Law, Numbers, World, cross


class DryFriction(Law):
    """Dahl 1968: the moment approaches its limit with the angle turned."""

    ANGLE = 0.008

    def reset(self, world, q):
        self.moment = 0.0

    def act(self, world, t, q, w, dt):
        if not self.strength:
            return
        rate = w[self.place]
        pull = 1.0 - self.moment / self.strength * math.copysign(1.0, rate)
        self.moment += self.strength / self.ANGLE * pull * rate * dt
        self.moment = max(-self.strength, min(self.strength, self.moment))
        world.torque[self.place] -= self.moment


class QuadraticDamping(Law):
    def act(self, world, t, q, w, dt):
        world.torque[self.place] -= self.strength * abs(w[self.place]) * w[self.place]


class AirDrag(Law):
    """(1/2) rho Cd v_n |v_n| on nine points of every panel."""

    DENSITY = 1.2

    def reset(self, world, q):
        grid, weight = np.polynomial.legendre.leggauss(3)
        self.plates = []
        for p, corners in enumerate(world.corners):
            if p != world.o["held"]:
                u, v = corners[1] - corners[0], corners[-1] - corners[0]
                n, share = world.normals[p], np.outer(weight, weight).ravel() / 4
                at = np.array([0.5 * a * u + 0.5 * b * v for a in grid for b in grid])
                points = np.column_stack([np.cross(at, n), 0.5 * self.DENSITY * world.areas[p] * share])
                self.plates.append((p, world.body[p], n.tolist(), points.tolist()))

    def act(self, world, t, q, w, dt):
        """In plain numbers, because arrays as short as these take five times as long."""
        d = world.data
        for p, body, (nx, ny, nz), points in self.plates:
            a, b, c, e, f, g, h, k, m = d.xmat[body].tolist()  # rows of the rotation
            sx, sy, sz, vx, vy, vz = d.cvel[body].tolist()  # spin; velocity at the centre of mass of the whole tree
            cx, cy, cz = (d.xipos[body] - d.subtree_com[world.model.body_rootid[body]]).tolist()
            mx, my, mz = a * nx + b * ny + c * nz, e * nx + f * ny + g * nz, h * nx + k * ny + m * nz
            along = mx * (vx + sy * cz - sz * cy) + my * (vy + sz * cx - sx * cz) + mz * (vz + sx * cy - sy * cx)
            tx, ty, tz = a * sx + e * sy + h * sz, b * sx + f * sy + k * sz, c * sx + g * sy + m * sz
            force = ux = uy = uz = 0.0
            for ax, ay, az, weight in points:
                speed = along + ax * tx + ay * ty + az * tz  # (spin x r) . n = spin . (r x n)
                push = -self.strength * weight * abs(speed) * speed
                force, ux, uy, uz = force + push, ux + push * ax, uy + push * ay, uz + push * az
            turning = a * ux + b * uy + c * uz, e * ux + f * uy + g * uz, h * ux + k * uy + m * uz
            world.wrench[p] += (force * mx, force * my, force * mz, *turning)


class Hysteresis(Law):
    """Bouc-Wen with exponent 1.5; `extra["angle"]` is where the loop would saturate along its first slope."""

    def reset(self, world, q):
        self.z = 0.0

    def act(self, world, t, q, w, dt):
        rate = w[self.place] / self.extra["angle"]
        z = self.z
        self.z += dt * (rate - 0.5 * abs(rate) * math.sqrt(abs(z)) * z - 0.5 * rate * abs(z) ** 1.5)
        world.torque[self.place] -= self.strength * self.z


class Relaxation(Law):
    """One Maxwell branch, implicit Euler; relaxed at the start."""

    def reset(self, world, q):
        self.q, self.moment = q[self.place], 0.0

    def act(self, world, t, q, w, dt):
        turn, self.q = q[self.place] - self.q, q[self.place]
        self.moment = (self.moment + self.strength * turn) / (1.0 + dt / self.extra["time"])
        world.torque[self.place] -= self.moment


class Stiffening(Law):
    def act(self, world, t, q, w, dt):
        world.torque[self.place] -= self.strength * q[self.place] ** 3


class Asymmetry(Law):
    def act(self, world, t, q, w, dt):
        if q[self.place] > 0.0:
            world.torque[self.place] -= self.strength * q[self.place]


class RestAngle(Law):
    """The crease is at rest at another angle: K times that angle."""

    def act(self, world, t, q, w, dt):
        world.torque[self.place] += world.o["creases"][self.place]["stiffness"] * self.strength


class Viscosity(Law):
    """One crease loses more than the others."""

    def act(self, world, t, q, w, dt):
        world.torque[self.place] -= self.strength * w[self.place]


class Softness(Law):
    """One crease is softer or stiffer than the others."""

    def act(self, world, t, q, w, dt):
        world.torque[self.place] -= self.strength * q[self.place]


class Misalignment(Law):
    """The field is turned about y (a field along x or z stays in the plane of a strip)."""

    def field(self, b, dt):
        c, s = math.cos(self.strength), math.sin(self.strength)
        return np.array([c * b[0] + s * b[2], b[1], c * b[2] - s * b[0]])


class Lag(Law):
    """A supply of first order, exact for a field that is straight between steps: a lag may be shorter than one."""

    def reset(self, world, q):
        self.b, self.wanted = np.zeros(3), None

    def field(self, b, dt):
        if self.strength <= 0:
            return b
        if self.wanted is not None:
            behind = (b - self.wanted) * (self.strength / dt)
            self.b = b - behind + (self.b - self.wanted + behind) * math.exp(-dt / self.strength)
        self.wanted = b
        return self.b


class Remanence(Law):
    def prepare(self, numbers: Numbers):
        numbers.remanence[self.place] += self.strength


class Eccentric(Law):
    def prepare(self, numbers: Numbers):
        numbers.lift[self.place] += self.strength


class Tilt(Law):
    def prepare(self, numbers: Numbers):
        numbers.tilt[0] += self.strength


class Tether(Law):
    """A soft lead from the middle of the last panel's far edge to where that was in the flat state."""

    def act(self, world, t, q, w, dt):
        p = len(world.corners) - 1
        if not self.extra:
            hinge = next(h[0] for h in world.hinges if h[2] == p)
            self.extra["at"] = world.centres[p] - hinge
        at = self.extra["at"]
        arm = world.data.xmat[world.body[p]].reshape(3, 3) @ at
        force = self.strength * (world.centres[p] + at - world.data.xipos[world.body[p]] - arm)
        world.wrench[p, :3] += force
        world.wrench[p, 3:] += cross(arm, force)


class FootFriction(Law):
    """One foot rubs more or less than the others."""

    def prepare(self, numbers: Numbers):
        numbers.friction[self.place] += self.strength


class Adhesion(Law):
    """Each of a foot's two points is pulled down, exponentially less with the gap."""

    REACH = 3e-5

    def act(self, world, t, q, w, dt):
        for foot in world.feet:
            foot.pressed(world, 0.0, -2.0 * self.strength * math.exp(-max(foot.height, 0.0) / self.REACH))


class StaticFriction(Law):
    """Feet at rest rub more than those that slide, by a rational function of the speed."""

    SPEED = 0.01

    def act(self, world, t, q, w, dt):
        for foot, mu in zip(world.feet, world.numbers.friction, strict=True):
            foot.friction = float(mu) + self.strength / (1.0 + (foot.speed / self.SPEED) ** 2)


# outside the catalogue ------------------------------------------------------------------------------------------------


class Parametric(Law):
    """Stiffness that oscillates by itself."""

    def act(self, world, t, q, w, dt):
        wave = math.sin(2 * math.pi * self.extra["frequency"] * t)
        world.torque[self.place] -= self.strength * wave * q[self.place]


class Neighbour(Law):
    """A moment that depends on the square of the next crease's angle."""

    def act(self, world, t, q, w, dt):
        other = (self.place + 1) % world.count
        world.torque[self.place] -= self.strength * q[other] ** 2


class HiddenMagnets(Law):
    """Unknown point dipoles along the normals of the first two moving panels; strength: m1 m2 [A^2 m^4]."""

    def act(self, world, t, q, w, dt):
        d, pair = world.data, [world.body[h[2]] for h in world.hinges[:2]]
        n = [d.xmat[b].reshape(3, 3) @ world.normals[h[2]] for b, h in zip(pair, world.hinges[:2], strict=True)]
        r = d.xipos[pair[1]] - d.xipos[pair[0]]
        far = float(np.linalg.norm(r))
        u, k = r / far, 1e-7 * self.strength
        n0, n1 = float(n[0] @ u), float(n[1] @ u)
        force = 3 * k / far**4 * (n0 * n[1] + n1 * n[0] + (float(n[0] @ n[1]) - 5 * n0 * n1) * u)
        for sign, here, there, along, p in ((1, n[1], n[0], n0, 1), (-1, n[0], n[1], n1, 0)):
            panel = world.hinges[p][2]
            world.wrench[panel, :3] += sign * force
            world.wrench[panel, 3:] += cross(here, k / far**3 * (3 * along * u - there))


class FallingFriction(Law):
    """Friction that vanishes with speed, so that it falls where friction is flat."""

    def act(self, world, t, q, w, dt):
        rate = w[self.place]
        world.torque[self.place] -= self.strength * math.tanh(rate / 0.2) * math.exp(-((rate / 3.0) ** 2))


class Pushes(Law):
    """Somebody touches the crease now and then: pulses of 40 ms at times drawn beforehand."""

    def act(self, world, t, q, w, dt):
        for at, sign in self.extra["pulses"]:
            if 0.0 <= t - at < 0.04:
                world.torque[self.place] += sign * self.strength * math.sin(math.pi * (t - at) / 0.04)


class Ageing(Law):
    """Friction that grows while a foot rests, and is lost once it slides."""

    TIME, STILL = 0.1, 1e-3

    def reset(self, world, q):
        self.age = [0.0] * len(world.feet)

    def act(self, world, t, q, w, dt):
        for n, (foot, mu) in enumerate(zip(world.feet, world.numbers.friction, strict=True)):
            self.age[n] = self.age[n] + dt if abs(foot.speed) < self.STILL else 0.0
            foot.friction = float(mu) + self.strength * (1.0 - math.exp(-self.age[n] / self.TIME))


# measurement ----------------------------------------------------------------------------------------------------------


class ClockRate(Law):
    """e: time that passes per recorded time, less one."""


class ClockDelay(Law):
    """Lateness of the recording [s]."""


class Scale(Law):
    """Relative error of all readings."""


class Offset(Law):
    """Constant added to all readings."""


class LengthScale(Law):
    """Relative error of the lengths that a camera sees."""


@dataclass(frozen=True)
class Concealed:
    """A mechanism that may be drawn.

    Attributes:
        law: its class. names: what the diagnosis may call it, the first being the exact name; empty: nothing fits.
        site: "crease", "panel", "last panel", "foot", all of them ("all panels") or "" (the whole object or its
            measurement).
        first: strength to begin the search with, times the crease stiffness where `stiff`. largest: likewise.
        signed: either sign is possible. only: structures that it suits; empty: all.
        number: parameter of the catalogue's effect that means the same as the strength, if there is one.
    """

    law: type[Law]
    names: tuple[str, ...]
    site: str = "crease"
    first: float = 0.1
    stiff: bool = True
    signed: bool = False
    largest: float = 1e9
    only: tuple[str, ...] = ()
    number: str = ""


CRAWLER = ("crawler",)
DRIVEN = ("magnetic_strip", "box", "bi_fold", "crawler")
ELASTIC = ("hanging_strip", *DRIVEN)
FOLDED = ("hanging_strip", "magnetic_strip", "box", "bi_fold")
HELD = ("pendulum_chain", *FOLDED)
STRIPS = ("hanging_strip", "pendulum_chain", "magnetic_strip")

INSIDE: dict[str, Concealed] = {
    "dry_friction": Concealed(DryFriction, ("crease_friction",), largest=1.0, number="friction_moment"),
    "quadratic_damping": Concealed(QuadraticDamping, ("crease_quadratic_damping",), first=5e-3, number="coefficient"),
    "air_drag": Concealed(
        AirDrag, ("air_drag",), "all panels", 2.0, False, largest=10.0, only=HELD, number="drag_coefficient"
    ),
    "hysteresis": Concealed(Hysteresis, ("crease_hysteresis",), largest=1.0, only=ELASTIC, number="hysteresis_moment"),
    "relaxation": Concealed(Relaxation, ("crease_relaxation",), first=0.3, only=ELASTIC, number="stiffness_1"),
    "stiffening": Concealed(Stiffening, ("crease_stiffening",), first=0.3, largest=30.0, number="cubic_stiffness"),
    "asymmetry": Concealed(
        Asymmetry, ("crease_asymmetry",), signed=True, largest=0.8, only=ELASTIC, number="valley_stiffness"
    ),
    "rest_angle": Concealed(RestAngle, ("crease_offset", "crease_swelling"), "crease", 0.05, False, True),
    "viscosity": Concealed(Viscosity, ("crease_viscosity",), first=0.01, only=HELD, number="viscosity"),
    "softness": Concealed(
        Softness, ("crease_softness",), signed=True, largest=0.8, only=FOLDED, number="stiffness_change"
    ),
    "misalignment": Concealed(Misalignment, ("field_misalignment",), "", 0.05, False, True, 0.7, DRIVEN),
    "field_lag": Concealed(Lag, ("field_lag", "drive_delay"), "", 0.01, False, False, 0.2, DRIVEN, number="lag"),
    "remanence": Concealed(
        Remanence, ("remanence_error",), "panel", 0.1, False, True, 0.8, DRIVEN, number="remanence_gain"
    ),
    "eccentric_weight": Concealed(Eccentric, ("eccentric_weight",), "panel", 1e-4, False, True, 0.01),
    "gravity_tilt": Concealed(Tilt, ("gravity_tilt",), "", 0.01, False, True, 0.5, number="tilt_x"),
    "tether": Concealed(Tether, ("tether",), "last panel", 0.01, False, largest=1.0, only=STRIPS),
    "clock_rate": Concealed(ClockRate, ("clock_rate",), "", 2e-3, False, True, 0.1, number="clock_rate"),
    "clock_delay": Concealed(ClockDelay, ("clock_delay",), "", 2e-3, False, False, 0.1, DRIVEN, number="clock_delay"),
    "angle_scale": Concealed(Scale, ("angle_scale",), "", 5e-3, False, True, 0.3, HELD, number="angle_scale"),
    "angle_offset": Concealed(Offset, ("angle_offset",), "", 2e-3, False, True, 0.5, HELD, number="angle_offset"),
    "length_scale": Concealed(LengthScale, ("length_scale",), "", 5e-3, False, True, 0.3, CRAWLER, "length_scale"),
    "foot_friction": Concealed(
        FootFriction, ("coulomb",), "foot", 0.05, False, True, 0.3, CRAWLER, "friction_coefficient"
    ),
    "adhesion": Concealed(Adhesion, ("adhesion",), "", 1e-3, False, largest=0.1, only=CRAWLER, number="pull_off"),
    "static_friction": Concealed(
        StaticFriction, ("stribeck",), "", 0.05, False, largest=0.5, only=CRAWLER, number="static_excess"
    ),
}
"""Mechanisms that the catalogue has."""

OUTSIDE: dict[str, Concealed] = {
    "parametric_stiffness": Concealed(Parametric, (), only=ELASTIC),
    "neighbour_moment": Concealed(Neighbour, (), signed=True, only=HELD),
    "hidden_magnets": Concealed(HiddenMagnets, (), "", 1e-4, False, True, only=STRIPS),
    "falling_friction": Concealed(FallingFriction, ()),
    "pushes": Concealed(Pushes, (), first=0.1),
    "ageing_friction": Concealed(Ageing, (), "", 0.05, False, largest=0.5, only=CRAWLER),
}
"""Mechanisms that it has not."""

MEASUREMENT = ("clock_rate", "clock_delay", "angle_scale", "angle_offset", "length_scale")


def build(name: str, strength: float, place: int, extra: dict) -> Law:
    """The law of that name."""
    return {**INSIDE, **OUTSIDE}[name].law(strength, place, dict(extra))


__all__ = ["INSIDE", "MEASUREMENT", "OUTSIDE", "Concealed", "World", "build"]
