"""The truth: the object as rigid bodies in MuJoCo, with concealed laws applied as forces at every step.

An object that nothing holds moves in the plane of x and z, on its feet.
"""

import math
from dataclasses import dataclass, field

import mujoco
import numpy as np
from feet import Foot

STEP = 1.3e-4
"""Longest step [s]. Of second order: at 100 rad/s the period is right to (100 * 1.3e-4)^2 / 24 = 7e-6."""

WALKING = 4.4e-5
"""The same for what stands on feet [s]."""

FINE = 480.0
"""Samples per second that are kept; frames are splines through them."""


FASTEST = 1e3
"""Rates of nothing that is recorded here [rad/s, m/s]."""


class Unstable(Exception):
    """A motion that no real object makes."""


ROOT = {"shift": ("slide", "1 0 0"), "rise": ("slide", "0 0 1"), "pitch": ("hinge", "0 -1 0")}
"""Joints of the first panel where nothing holds it."""


@dataclass
class Numbers:
    """What the object really has, as opposed to what its description says: factors and changes by place.

    Attributes:
        stiffness, viscosity: factors by crease. mass, remanence: factors by panel. friction: coefficients by foot.
        lift: shift of a panel's centre of mass along its normal [m]. tilt: lean of gravity in x and y [rad].
    """

    stiffness: np.ndarray
    viscosity: np.ndarray
    mass: np.ndarray
    remanence: np.ndarray
    lift: np.ndarray
    tilt: np.ndarray
    friction: np.ndarray

    @classmethod
    def described(cls, o: dict) -> "Numbers":
        j, p = len(o["creases"]), len(o["faces"])
        friction = np.array([f["friction"] for f in o.get("feet", ())])
        return cls(np.ones(j), np.ones(j), np.ones(p), np.ones(p), np.zeros(p), np.zeros(2), friction)

    def copy(self) -> "Numbers":
        return Numbers(*(getattr(self, f).copy() for f in self.__dataclass_fields__))


@dataclass
class Motion:
    """times (n,), angles and rates (n, J); of what nothing holds, then those of `ROOT`."""

    times: np.ndarray
    angles: np.ndarray
    rates: np.ndarray


@dataclass
class Law:
    """A concealed law: overridden methods add to the forces or change what acts. `strength` scales it."""

    strength: float = 0.0
    place: int = 0
    extra: dict = field(default_factory=dict)

    def prepare(self, numbers: Numbers) -> None:
        """Changes the object's numbers."""

    def reset(self, world: "World", q: list[float]) -> None:
        """Forgets."""

    def field(self, b: np.ndarray, dt: float) -> np.ndarray:
        """The field that reaches the object."""
        return b

    def act(self, world: "World", t: float, q: list[float], w: list[float], dt: float) -> None:
        """Adds to `world.torque` [crease] and `world.wrench` [panel, 6]."""


class World:
    """One object with its true numbers and laws."""

    def __init__(self, o: dict, numbers: Numbers | None = None, laws: tuple[Law, ...] = ()):
        self.o, self.laws = o, laws
        self.numbers = (numbers or Numbers.described(o)).copy()
        for law in laws:
            law.prepare(self.numbers)
        self.model = mujoco.MjModel.from_xml_string(self._xml())
        self.data = mujoco.MjData(self.model)
        self.count = len(o["creases"])
        self.joints = [f"j{n}" for n in range(self.count)] + (list(ROOT) if o["held"] is None else [])
        self.feet = []
        for f, mu in zip(o.get("feet", ()), self.numbers.friction, strict=True):
            p = f["panel"]
            arm = np.array([f["at"], 0.0, 0.0]) - self.centres[p] - self.numbers.lift[p] * self.normals[p]
            self.feet.append(Foot(f, arm, float(mu)))
        self.torque = np.zeros(self.count)
        self.wrench = np.zeros((len(o["faces"]), 6))
        moment = {m["panel"]: np.array(m["poling"]) * m["moment"] for m in o["magnets"]}
        self.magnets = {p: (m * self.numbers.remanence[p]).tolist() for p, m in moment.items()}
        self.body = {p: self.model.body(f"p{p}").id for p in range(len(o["faces"]))}
        d, root = self.data, self.model.body_rootid
        self._views = {p: (d.xmat[b], d.cvel[b], d.xipos[b], d.subtree_com[root[b]]) for p, b in self.body.items()}

    def _xml(self) -> str:
        o, x = self.o, np.array(self.o["vertices"])
        self.corners = [x[f] for f in o["faces"]]
        self.centres = [c.mean(0) for c in self.corners]
        self.normals, self.areas = [], []
        for c in self.corners:
            area = sum(np.cross(c[k] - c[0], c[k + 1] - c[0]) for k in range(1, len(c) - 1)) / 2
            self.areas.append(float(np.linalg.norm(area)))
            self.normals.append(area / self.areas[-1])
        self.hinges, children = [], {p: [] for p in range(len(o["faces"]))}
        for n, crease in enumerate(o["creases"]):
            parent, child = crease["panels"]
            shared = [v for v in o["faces"][child] if v in o["faces"][parent]]
            middle = x[shared].mean(0)
            away = self.centres[child] - middle
            axis = np.cross(away, self.normals[child])
            self.hinges.append((middle, axis / np.linalg.norm(axis), child))
            children[parent].append((n, child))
        lean = self.numbers.tilt
        gravity = o["gravity"] * np.array([lean[0], lean[1], -1.0])
        text = lambda v: " ".join(f"{k:.12g}" for k in np.atleast_1d(v))  # noqa: E731

        def panel(p: int, origin: np.ndarray, joint: str = "", pos: np.ndarray | None = None) -> str:
            mass = o["density"] * o["thickness"] * self.areas[p] * self.numbers.mass[p]
            extent = np.ptp(self.corners[p], axis=0) + o["thickness"] * np.abs(self.normals[p])
            inertia = mass / 12 * (np.sum(extent**2) - extent**2)
            centre = self.centres[p] + self.numbers.lift[p] * self.normals[p] - origin
            below = "".join(
                panel(
                    child,
                    self.hinges[n][0],
                    f'<joint name="j{n}" type="hinge" axis="{text(self.hinges[n][1])}" '
                    f'stiffness="{text(o["creases"][n]["stiffness"] * self.numbers.stiffness[n])}" '
                    f'damping="{text(o["creases"][n]["viscosity"] * self.numbers.viscosity[n])}"/>',
                    self.hinges[n][0] - origin,
                )
                for n, child in children[p]
            )
            return (
                f'<body name="p{p}" pos="{text(origin if pos is None else pos)}">{joint}'
                f'<inertial pos="{text(centre)}" mass="{text(mass)}" diaginertia="{text(inertia)}"/>{below}</body>'
            )

        held, root = o["held"], ""
        if held is None:
            root = "".join(f'<joint name="{n}" type="{t}" axis="{a}"/>' for n, (t, a) in ROOT.items())
        return (
            '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0" boundinertia="0"/>'
            f'<option gravity="{text(gravity)}" integrator="Euler">'
            '<flag contact="disable" eulerdamp="disable"/></option>'
            f"<worldbody>{panel(held or 0, np.zeros(3), root)}</worldbody></mujoco>"
        )

    def run(self, recording: dict, q0, w0=None, *, duration: float, start: float = 0.0) -> Motion:
        """The motion from angles q0 and rates w0 at time `start` of the recording.

        MuJoCo's Euler step as a leapfrog: rates half a step behind, forces by those that the last acceleration makes of
        them. By forces at rates half a step behind it is of first order, but it bears the losses of feet that strike.

        Raises:
            Unstable: it flies off.
        """
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        order = np.array([m.joint(n).qposadr[0] for n in self.joints])
        dofs = np.array([m.joint(n).dofadr[0] for n in self.joints])
        hinges = dofs[: self.count]
        d.qpos[order] = q0
        d.qvel[dofs] = 0.0 if w0 is None else w0
        every = math.ceil(1.0 / FINE / (WALKING if self.feet else STEP) - 1e-9)
        dt = m.opt.timestep = 1.0 / FINE / every
        frames = round(duration * FINE) + 1
        drive = recording.get("field")
        axis = np.array(drive["axis"]) * drive["amplitude"] if drive else None
        for law in self.laws:
            law.reset(self, list(map(float, q0)))
        for foot in self.feet:
            foot.rest()
        out, rates = np.empty((2, frames, len(order)))
        bodies = np.array([self.body[p] for p in range(len(self.o["faces"]))])
        # plain numbers and kept views: arrays as short as these, and looking them up, take longer than the step itself
        magnets = [(self.wrench[p, 3:], self._views[p][0], m) for p, m in self.magnets.items()]
        angles, speeds, moments, wrenches = d.qpos, d.qvel, d.qfrc_applied, d.xfrc_applied
        acting = [law for law in self.laws if type(law).act is not Law.act]
        fielding = [law for law in self.laws if type(law).field is not Law.field]
        pushed = bool(acting or self.feet)
        half = 0.0 if self.feet else 0.5 * dt
        between, ahead = None, speeds.copy()  # rates half a step ago, and now
        for n in range(frames):
            out[n], rates[n] = angles[order], ahead[dofs]
            for k in range(every):
                t = start + (n * every + k) * dt
                speeds[:] = ahead
                mujoco.mj_step1(m, d)
                if pushed or drive:
                    self.wrench.fill(0.0)
                if drive:
                    b = axis * wave(drive, t)
                    for law in fielding:
                        b = law.field(b, dt)
                    bx, by, bz = b.tolist()
                    for couple, turn, (x, y, z) in magnets:
                        a, e, h, f, g, i, o, u, v = turn.tolist()
                        mx, my, mz = a * x + e * y + h * z, f * x + g * y + i * z, o * x + u * y + v * z
                        couple[:] = my * bz - mz * by, mz * bx - mx * bz, mx * by - my * bx
                if pushed:
                    self.torque.fill(0.0)
                    q, w = angles[order].tolist(), ahead[dofs].tolist()
                    for law in acting:
                        law.act(self, t, q, w, dt)
                    for foot in self.feet:
                        foot.press(self, dt)
                    moments[hinges] = self.torque
                if pushed or drive:
                    wrenches[bodies] = self.wrench
                if between is None:
                    mujoco.mj_forward(m, d)
                    between = ahead - half * d.qacc
                speeds[:] = between
                mujoco.mj_step2(m, d)
                between = speeds.copy()
                ahead = between + half * d.qacc
        if not np.all(np.abs(rates) < FASTEST):
            raise Unstable(f"rates of {np.abs(rates).max():.3g} 1/s")
        return Motion(start + np.arange(frames) / FINE, out, rates)

    def settled(self) -> np.ndarray:
        """Angles at rest under gravity: Newton's method on the static moments."""
        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        q = np.zeros(self.count)

        def moments(q):
            d.qpos[:], d.qvel[:] = q, 0.0
            d.qfrc_applied[:], d.xfrc_applied[:] = 0.0, 0.0
            mujoco.mj_forward(m, d)
            return d.qfrc_passive - d.qfrc_bias

        for _ in range(50):
            f = moments(q)
            slope = np.stack([(moments(q + 1e-6 * e) - f) / 1e-6 for e in np.eye(self.count)], axis=1)
            step = np.linalg.solve(slope, f)
            q = q - step
            if np.abs(step).max() < 1e-12:
                break
        order = [m.joint(f"j{n}").qposadr[0] for n in range(self.count)]
        return q[order]

    def moving(self, panel: int) -> tuple[list[float], list[float], tuple[float, float, float], float]:
        """Rotation (nine, by rows), spin, velocity of the centre of mass of a panel, and its height; plain numbers."""
        turn, speed, at, whole = self._views[panel]
        *spin, vx, vy, vz = speed.tolist()  # at the centre of mass of the whole tree
        (x, y, z), (cx, cy, cz), (sx, sy, sz) = at.tolist(), whole.tolist(), spin
        x, y, up = x - cx, y - cy, z - cz
        return turn.tolist(), spin, (vx + sy * up - sz * y, vy + sz * x - sx * up, vz + sx * y - sy * x), z


def wave(drive: dict, t: float) -> float:
    """What a field that oscillates is of its amplitude, at a time; it may set in later."""
    return math.sin(2 * math.pi * drive["frequency"] * max(t - drive.get("delay", 0.0), 0.0))


def cross(a, b) -> np.ndarray:
    """The cross product of two vectors (numpy's own takes ten times as long)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
