"""Model (what is constant), Parameters (what can be identified), State (what moves)."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from origami_sim.effects import CONTACTS, DISTORTIONS, get
from origami_sim.errors import InputError
from origami_sim.model.vectors import cross

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BODY = ("mass", *(f"centre_{a}" for a in "xyz"), *(f"inertia_{a}" for a in ("xx", "yy", "zz", "xy", "xz", "yz")))
"""Numbers of a rigid body: mass, centre of mass, inertia tensor about it."""

SURFACE = ("thickness", "stiffness", "loss_time")
"""Numbers of the surface of each triangle: [m], [N/m], [s]."""

STATED = ("inertia", "plane", "body", "surface")
"""Owners of parameters that are no effects."""

PADS = ("pad_triangles", "pad_weights", "pad_heights", "pad_thickness")
"""Attributes of a model that say where patches can touch; a model without them is stored as if there were none."""

GRIPS = ("grips", "grip_screws")
"""Attributes of a model that say what moves held nodes; a model without them is stored as if there were none."""

ALIKE = np.zeros((0, 6))
"""`Model.plates` of triangles that are all alike."""


@dataclass(frozen=True, repr=False)
class Model:
    """Topology and reference geometry, shared by all worlds.

    Attributes:
        position: [N, 3] reference positions of the nodes [m].
        free: [N, 3] 1 where a node may move along that axis, 0 where it is held.
        bars: [B, 2] nodes.
        creases: [C, 4] nodes (i, j, k, l): axis j-k, l left and i right of it seen from the top.
        bends: [Q, 4] the same for the lines that triangulate a panel.
        triangles: [T, 3] nodes, counter-clockwise seen from the top.
        triangle_panel: [T] panel of each triangle.
        contacts: [K, 3] nodes of the triangle that carries the contact point.
        contact_weights: [K, 3] barycentric weights of the point.
        contact_offsets: [K] its height above the mid-plane along the panel's normal [m].
        contact_axes: [K, 3] weights of the three nodes that give the body's forward axis (they sum to zero).
        electrodes: [C + Q] electrode group of each hinge.
        effects: names of the effects that are switched on, in the order of summation.
        names: labels by family ("crease", "panel", "contact", "node"), for reports.
        channels: recorded channels that errors of the measurement tell apart; 1: the same for all.
        panels: "elastic" (bars and bending lines) or "rigid" (bodies on hinges, see `bodies.rigid`).
        carriers: panels of the last nodes, which are corners of no triangle: they stand for the mass of rigid panels,
            or belong to hinges off their middle planes.
        pad_triangles: [4 Q] triangles that carry the corners of patches, of those that can touch other parts.
        pad_weights: [4 Q, 3] barycentric weights of these corners. pad_heights: [4 Q] of the patches' middle planes
            above the panels' [m]. pad_thickness: [Q] [m].
        plates: [T, 6] bending stiffness D11, D22, D12, D66, D16, D26 [N m] of the triangles of a shell in their axes
            (`curvature.axes_of`), by which neighbours share the turn of the line between them; empty: all are alike.
        start: [N, 3] where motions and equilibria begin that are given no state, such as a buckled shape; empty: in
            the reference state.
        grips: [N] grip that moves the held axes of each node along its path in time, -1 for none; empty: nothing does.
            Grips are named by `names["grip"]`, and move with `Drive(grips=..., turns=...)`.
        grip_screws: [G, 6] angular velocity [rad] and velocity at the origin [m] of each for a unit of its path.
    """

    position: np.ndarray
    free: np.ndarray
    bars: np.ndarray
    creases: np.ndarray
    bends: np.ndarray
    triangles: np.ndarray
    triangle_panel: np.ndarray
    contacts: np.ndarray
    contact_weights: np.ndarray
    contact_offsets: np.ndarray
    contact_axes: np.ndarray
    electrodes: np.ndarray
    effects: tuple[str, ...]
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    channels: int = 1
    panels: str = "elastic"
    carriers: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    pad_triangles: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    pad_weights: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    pad_heights: np.ndarray = field(default_factory=lambda: np.zeros(0))
    pad_thickness: np.ndarray = field(default_factory=lambda: np.zeros(0))
    plates: np.ndarray = field(default_factory=lambda: ALIKE)
    start: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    grips: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    grip_screws: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))

    def __repr__(self) -> str:
        from origami_sim.view.summary import model_line  # only who looks pays for it

        return model_line(self)

    def _repr_html_(self) -> str:
        from origami_sim.view.summary import model_html

        return model_html(self)

    def plot(self, *, numbers: bool | None = None) -> "Figure":
        """The plan, with numbers of panels, creases and nodes, as a Matplotlib figure (`view.plot.plot_model`)."""
        from origami_sim.view.plot import plot_model

        return plot_model(self, numbers=numbers)

    def count(self, family: str) -> int:
        """Number of entities of a family of effects."""
        if family in CONTACTS:
            return len(self.contacts)
        if family in DISTORTIONS:
            return self.channels if family == "measurement" else 1
        return len(
            {
                "bar": self.bars,
                "crease": self.creases,
                "bend": self.bends,
                "triangle": self.triangles,
                "membrane": self.triangles,
                "plate": self.triangles,
                "pair": self.triangles,
                "rub": self.triangles,
                "node": self.position,
            }[family]
        )

    @property
    def begins(self) -> np.ndarray:
        """[N, 3] where it starts: `start`, or its reference positions."""
        return self.start if len(self.start) else self.position

    @property
    def panel_count(self) -> int:
        """Number of panels."""
        return int(self.triangle_panel.max(initial=-1)) + 1

    @property
    def laws(self) -> tuple[str, ...]:
        """The effects that act as forces: all but the distortions of drive and measurement."""
        return tuple(n for n in self.effects if get(n).family not in DISTORTIONS)

    @property
    def memories(self) -> list[tuple[str, str, int]]:
        """Effect, name and size of every memory of its laws, in their order in `State.memory`."""
        laws = map(get, self.laws)
        return [(e.name, m.name, m.base + m.size * self.count(e.family)) for e in laws for m in e.memory]

    def name(self, family: str, i: int) -> str:
        """Label of an entity."""
        names = self.names.get(family, ())
        return names[i] if i < len(names) else f"{family} {i}"

    def with_effects(self, *names: str, without: tuple[str, ...] = ()) -> "Model":
        """The same model with these effects added (or removed)."""
        for n in (*names, *without):
            get(n)
        kept = tuple(e for e in self.effects if e not in without)
        added = tuple(dict.fromkeys(n for n in names if n not in kept))
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return Model(**{**values, "effects": kept + added})

    @property
    def hash(self) -> str:
        """Digest of everything in the model that moves it."""
        h = hashlib.sha256()
        for f in fields(self):
            if f.name == "channels" or (f.name in ("panels", "carriers") and self.panels == "elastic"):
                continue
            if (f.name in PADS and not len(self.pad_triangles)) or (f.name == "plates" and not len(self.plates)):
                continue
            if (f.name == "start" and not len(self.start)) or (f.name in GRIPS and not len(self.grips)):
                continue
            value = getattr(self, f.name)
            h.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
        return h.hexdigest()[:16]


class Parameters:
    """Parameter arrays by (owner, name): shape [entity, world] or [entity, 1], tables [entity, world, knot].

    Owners are the effects that are switched on, "inertia" (mass [kg] per node), "plane" (the ground's tilt [rad],
    azimuth [rad], height [m] and reach [m], the gap below which contact laws are evaluated), "body" (mass [kg],
    centre [m] and inertia [kg m^2] of each panel as a rigid body in the reference state; zero: not stated) and
    "surface" (thickness [m], stiffness [N/m] and loss time [s] with which each triangle touches others as soon as they
    come near each other in a run, see `contact.engaged`; zero: nothing touches, or by the effect `touch`).
    """

    def __init__(self, model: Model, values: Mapping[tuple[str, str], np.ndarray] | None = None):
        self._values: dict[tuple[str, str], np.ndarray] = {
            ("inertia", "mass"): np.ones((len(model.position), 1)),
            **{("plane", n): np.zeros((1, 1)) for n in ("tilt", "azimuth", "height", "reach")},
            **{("body", n): np.zeros((model.panel_count, 1)) for n in BODY},
            **{("surface", n): np.zeros((len(model.triangles), 1)) for n in SURFACE},
        }
        for name in model.effects:
            effect = get(name)
            for p in effect.parameters:
                shape = (model.count(effect.family), 1) + ((p.knots,) if p.knots > 1 else ())
                self._values[name, p.name] = np.full(shape, p.default)
        for (owner, name), value in (values or {}).items():
            self.set(owner, name, value)

    def __getitem__(self, key: tuple[str, str]) -> np.ndarray:
        if key not in self._values:
            owned = sorted(n for o, n in self._values if o == (key if isinstance(key, str) else key[0]))
            allowed = ", ".join(owned) if owned else ", ".join(sorted({o for o, _ in self._values}))
            name = key if isinstance(key, str) else ".".join(key)
            raise InputError("there is no such parameter", field=name, allowed=allowed)
        return self._values[key]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._values)

    def of(self, owner: str) -> dict[str, np.ndarray]:
        """All parameters of one owner by name."""
        return {n: v for (o, n), v in self._values.items() if o == owner}

    def set(self, owner: str, name: str, value, entities=None) -> "Parameters":
        """Sets values for all entities or for some; a last axis of another length than 1 makes worlds differ.

        Raises:
            InputError: unknown parameter, wrong shape, values out of bounds or not finite.
        """
        old = self[owner, name]
        knots = old.shape[2:]
        new = np.asarray(value, float)
        if not np.all(np.isfinite(new)):
            raise InputError("a parameter must be finite", field=f"{owner}.{name}", value=value)
        self._check_bounds(owner, name, new)
        tail = 1 + len(knots)
        index = np.arange(len(old)) if entities is None else np.atleast_1d(entities)
        try:
            if new.ndim < 1 + tail:  # scalar, or one value (or table) per entity
                new = new.reshape((-1, 1, *knots)) if new.ndim else np.full((1, 1), float(new))
            worlds = max(old.shape[1], new.shape[1])
            out = np.array(np.broadcast_to(old, (len(old), worlds, *knots)))
            out[index] = np.broadcast_to(new, (len(index), worlds, *knots))
        except (ValueError, IndexError):
            raise InputError(
                "a parameter array has the wrong shape",
                field=f"{owner}.{name}",
                value=np.shape(value),
                allowed=f"broadcastable to ({len(index)}, worlds)",
            ) from None
        self._values[owner, name] = out
        return self

    def replace(self, owner: str, name: str, value: np.ndarray) -> None:
        """Puts an array [entity, world] in the place of another, of any number of entities, unchecked."""
        self._values[owner, name] = np.array(value, float)

    @staticmethod
    def _check_bounds(owner: str, name: str, value: np.ndarray):
        low, high = 0.0, np.inf
        if owner not in STATED:
            low, high = next(p.bounds for p in get(owner).parameters if p.name == name)
        elif owner in ("plane", "body"):
            low = -np.inf
        elif owner == "inertia" and np.any(value <= 0):
            raise InputError(
                "a mass must be positive", field="inertia.mass", value=float(value.min()), allowed="> 0 kg"
            )
        if np.any(value < low) or np.any(value > high):
            bad = float(value[(value < low) | (value > high)].flat[0])
            raise InputError(
                "a parameter is out of bounds", field=f"{owner}.{name}", value=bad, allowed=f"{low:g} to {high:g}"
            )

    @property
    def worlds(self) -> int:
        """Number of worlds that the arrays describe (1 if none differs)."""
        return max(v.shape[1] for v in self._values.values())

    def world(self, w: int) -> "Parameters":
        """The parameters of one world: every array has one column."""
        out = object.__new__(Parameters)
        out._values = {k: v[:, [w if v.shape[1] > 1 else 0]].copy() for k, v in self._values.items()}
        return out

    @classmethod
    def join(cls, parts: "Sequence[Parameters]", repeat: int = 1) -> "Parameters":
        """One batch of single-world parameters of the same model, each `repeat` times in a row."""
        out = object.__new__(cls)
        out._values = {}
        for key, first in parts[0]._values.items():
            columns = np.concatenate([p._values[key] for p in parts], axis=1)
            out._values[key] = first.copy() if np.all(columns == first) else np.repeat(columns, repeat, axis=1)
        return out

    def copy(self) -> "Parameters":
        out = object.__new__(Parameters)
        out._values = {k: v.copy() for k, v in self._values.items()}
        return out

    def for_model(self, model: Model) -> "Parameters":
        """The same values for a model with other effects or channels; new effects get their defaults."""
        out = Parameters(model)
        for k in self._values.keys() & out._values.keys():
            rows, v = len(out._values[k]), self._values[k]
            if len(v) not in (1, rows):
                raise InputError("parameters are for another model", field=".".join(k), value=len(v), allowed=rows)
            out._values[k] = v if len(v) == rows else np.repeat(v, rows, axis=0)
        return out

    @property
    def hash(self) -> str:
        h = hashlib.sha256()
        for key in sorted(self._values):
            if key[0] == "surface" and not np.any(self._values[key]):
                continue
            h.update(repr(key).encode() + self._values[key].tobytes())
        return h.hexdigest()[:16]


@dataclass
class State:
    """What moves, for a batch of W worlds.

    Attributes:
        x, v: [N, W, 3] positions [m] and velocities [m/s].
        a: [N, W, 3] accelerations of the last force evaluation [m/s^2].
        angles: [C + Q, W] continuous hinge angles, creases first [rad].
        memory: [M, W] extra state of the effects.
        work: [E, W] work done so far by each effect that exchanges it [J]. power: [E, W] its present power [W]. Both
            have a row more, the last, of the grips of a model that has any.
        step: number of steps taken; -1 before the first force evaluation.
        status: [2, W] step and node at which a world failed, -1 while it is sound.
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    angles: np.ndarray
    memory: np.ndarray
    work: np.ndarray
    power: np.ndarray
    step: int
    status: np.ndarray

    @classmethod
    def at_rest(
        cls, model: Model, worlds: int = 1, position: np.ndarray | None = None, *, placed: bool = False
    ) -> "State":
        """The state in which the model starts, or that of given positions ([N, 3] or [N, W, 3]), without motion.

        The mass points of rigid panels are put where their panels are, as in the model, unless they are `placed`:
        worlds whose bodies have other centres or inertia have them elsewhere.
        """
        start = model.begins if position is None else np.asarray(position, float)
        if start.ndim == 2:
            start = start[:, None, :]
        x = np.array(np.broadcast_to(start, (len(model.position), worlds, 3)))
        if len(model.carriers) and position is not None and not placed:
            _carry(model, x)
        effects = [get(e) for e in model.laws]
        rows = sum(size for *_, size in model.memories)
        hinges = np.concatenate([model.creases, model.bends])
        angles = dihedral_angles(x, hinges)
        return cls(
            x=x,
            v=np.zeros_like(x),
            a=np.zeros_like(x),
            angles=angles,
            memory=np.zeros((rows, worlds)),
            work=np.zeros((len(effects) + bool(len(model.grips)), worlds)),
            power=np.zeros((len(effects) + bool(len(model.grips)), worlds)),
            step=-1,
            status=np.full((2, worlds), -1, np.int32),
        )

    @classmethod
    def folded(cls, model: Model, angles: "Mapping[str | int, float | str]", worlds: int = 1) -> "State":
        """The state at rest in which creases are folded by stated angles and panels stay as they are drawn.

        Panels that are held stay where they are; creases that are not stated have the angles of the pattern.

        Args:
            angles: fold angle by name or number of the crease, valley positive: [rad], or a text such as "30 deg"; a
                name that several creases share stands for all of them.

        Raises:
            InputError: no such crease, an angle beyond half a turn, creases that close loops (whose angles are bound).
        """
        from origami_sim.model.articulation import folded  # of this module

        return cls.at_rest(model, worlds, folded(model, angles))

    def copy(self) -> "State":
        arrays = {f.name: getattr(self, f.name).copy() for f in fields(self) if f.name != "step"}
        return State(**arrays, step=self.step)

    def select(self, worlds: np.ndarray) -> "State":
        """These worlds, copied; an index may repeat."""
        names = [f.name for f in fields(self) if f.name != "step"]
        return State(**{n: getattr(self, n)[:, worlds] for n in names}, step=self.step)

    @classmethod
    def join(cls, states: "Sequence[State]") -> "State":
        """One batch of the worlds of several states, which must have taken equally many steps."""
        names = [f.name for f in fields(cls) if f.name != "step"]
        return cls(**{n: np.concatenate([getattr(s, n) for s in states], axis=1) for n in names}, step=states[0].step)

    @property
    def worlds(self) -> int:
        return self.x.shape[1]


def check_state(model: Model, state: object) -> None:
    """Refuses a start that is no `State`, or of another shape than the model's.

    Raises:
        InputError: naming the array, its shape and the one that is needed.
    """
    if not isinstance(state, State):
        allowed = "State.at_rest(model, position=x) with x [N, 3], or the state of an equilibrium or a motion"
        raise InputError("is no state", field="state", value=type(state).__name__, allowed=allowed)
    nodes, hinges = len(model.position), len(model.creases) + len(model.bends)
    for name, shape in (("x", (nodes, "W", 3)), ("v", (nodes, "W", 3)), ("angles", (hinges, "W"))):
        given = np.shape(getattr(state, name))
        if len(given) != len(shape) or any(a != b for a, b in zip(given, shape, strict=True) if b != "W"):
            raise InputError(
                "a state has another shape than the model",
                field=f"state.{name}",
                value=given,
                allowed=f"({', '.join(map(str, shape))}) with W worlds; State.at_rest(model, position=x) makes it of "
                f"x [{nodes}, 3]",
            )


def _carry(model: Model, x: np.ndarray) -> None:
    """Moves the mass points in positions [N, W, 3] to where the corners of their panels are (Kabsch 1976)."""
    first = len(model.position) - len(model.carriers)
    for panel in np.unique(model.carriers):
        corners = np.unique(model.triangles[model.triangle_panel == panel])
        reference = model.position[corners]
        middle, now = reference.mean(axis=0), x[corners].mean(axis=0)
        u, _, vt = np.linalg.svd(np.einsum("nwa,nb->wab", x[corners] - now, reference - middle))
        sign = np.sign(np.linalg.det(u @ vt))  # of flat panels the normal is left to choose
        u[:, :, 2] *= sign[:, None]
        mine = first + np.flatnonzero(model.carriers == panel)
        x[mine] = np.einsum("wab,nb->nwa", u @ vt, model.position[mine] - middle) + now


def node_mass(model: Model, parameters: Parameters) -> np.ndarray:
    """Mass that moves at every node [kg], [N, 1] or [N, worlds]: the stated one and what effects add to it.

    Raises:
        InputError: effects that take away all of a node's mass.
    """
    stated = parameters["inertia", "mass"]
    out = stated
    for effect in map(get, model.laws):
        if effect.inertia is not None:
            out = out + effect.inertia({"mass": stated, **parameters.of(effect.name)})
    if np.any((out <= 0) & (stated > 0)):
        raise InputError("effects take away all of a node's mass", field="mass", value=float(out.min()), allowed="> 0")
    return out


def magnets(model: Model, parameters: Parameters, owner: str) -> np.ndarray:
    """Magnet of each triangle [T] by the parameters of an effect, -1 for none in any world.

    Magnetised triangles that touch and are poled alike (within 8 degrees) are one magnet. Worlds may lack magnets.

    Raises:
        InputError: worlds in which other triangles join.
    """
    magnet = parameters.of(owner)
    given = [magnet["volume"] != 0, np.sign(magnet["remanence"]), *(magnet[f"poling_{k}"] for k in "12n")]
    columns = np.stack(np.broadcast_arrays(*(np.asarray(g, float) for g in given)))
    found = [_joined(model, c) for c in np.unique(columns, axis=2).transpose(2, 0, 1)]
    most = max(found, key=lambda f: np.count_nonzero(f >= 0))
    for f in found:
        pairs = np.stack([f, most], axis=1)[f >= 0]
        if len({len(np.unique(p, axis=0)) for p in (pairs, pairs[:, 0], pairs[:, 1])}) > 1 or np.any(pairs < 0):
            raise InputError(
                "magnets of the worlds join in other ways", field=f"{owner}.poling", allowed="the same in all worlds"
            )
    return most


def _joined(model: Model, magnet: np.ndarray) -> np.ndarray:
    """Magnets of one world from rows of volume, sign of the remanence and poling along both edges and the normal."""
    out = np.full(len(model.triangles), -1, np.int32)
    of = np.flatnonzero(magnet[0] * magnet[1])
    _, sign, a, b, n = magnet[:, of, None]
    x1, x2, x3 = np.moveaxis(model.position[model.triangles[of]], 1, 0)
    in_plane, normal = a * (x2 - x1) + b * (x3 - x1), cross(x2 - x1, x3 - x1)
    poling = sign * (np.sqrt(1 - n**2) * _unit(in_plane) + n * _unit(normal))
    corners = np.stack([np.repeat(np.arange(len(of)), 3), model.triangles[of].ravel()])
    touches = sp.csr_array(sp.coo_array((np.ones(corners.shape[1]), corners), (len(of), len(model.position))))
    one, other = (touches @ touches.T).nonzero()
    alike = (poling[one] * poling[other]).sum(axis=1) > 0.99
    bonds = sp.coo_array((np.ones(alike.sum()), np.stack([one, other])[:, alike]), (len(of), len(of)))
    out[of] = connected_components(bonds, directed=False)[1]
    return out


def _unit(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0, length, 1.0)


def carried_sides(model: Model) -> np.ndarray:
    """[C, 2] panels left and right of creases with nodes of their own, which panels carry (see `thick`); else none."""
    corners = len(model.position) - len(model.carriers)
    if not len(model.creases) or model.creases.min() < corners:
        return np.zeros((0, 2), np.int32)
    return model.carriers[model.creases[:, [3, 0]] - corners]


def beside(triangles: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """[H, 2] triangles [T, 3] left and right of hinges [H, 4], at their l and at their i; -1 where there is none."""
    found: dict[frozenset[int], int] = {}
    for t, corners in enumerate(triangles.tolist()):
        found.setdefault(frozenset(corners), t)
    sides = [[found.get(frozenset((j, k, tip)), -1) for tip in (m, i)] for i, j, k, m in hinges.tolist()]
    return np.array(sides, int).reshape(-1, 2)


def dihedral_angles(x: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """Fold angles in (-pi, pi] [rad] of hinges [H, 4] at positions [N, ..., 3]: shape [H, ...]."""
    if len(hinges) == 0:
        return np.zeros((0, *x.shape[1:-1]))
    i, j, k, m = (x[hinges[:, c]] for c in range(4))
    e = k - j
    n1, n2 = cross(i - j, e), cross(e, m - j)
    length = np.linalg.norm(e, axis=-1)
    return np.arctan2((cross(n1, n2) * e).sum(-1) / length, (n1 * n2).sum(-1))
