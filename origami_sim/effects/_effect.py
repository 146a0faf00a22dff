"""What an effect is: a law, the entities it acts on, its parameters, and the prose that a diagnosis needs.

A law is a `@wp.func` that knows nothing of meshes. Its arguments are found by name, in this order: quantities of the
family it acts on (`FAMILIES`), drive channels (`DRIVES`), the effect's own memory, the effect's own parameters. So a
law reads like its formula, and writing one file is all it takes to add an effect.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import warp as wp

scalar = wp.float64
"""Laws are written in double precision; literals are wrapped, scalar(0.5), because bare floats are single."""

vec3 = wp.vec3d

FAMILIES: dict[str, tuple[str, ...]] = {
    # axial force, positive in tension
    "bar": ("length", "rate", "dt"),
    # moment, positive towards valley (increasing angle); "crease" is a fold line, "bend" a line inside a panel
    # turn: change of the angle in this step, exact where rate * dt is not
    "crease": ("angle", "rate", "turn", "dt"),
    "bend": ("angle", "rate", "turn", "dt"),
    # forces on the three corners, as the rows of a 3 x 3 matrix
    # stray: flux density from all other magnets at this one, stray_gradient: its dB_i/dx_j; see Effect.magnet
    "triangle": ("x1", "x2", "x3", "v1", "v2", "v3", "stray", "stray_gradient", "dt"),
    # resultants [N/m] from Green's strain (11, 22 and twice 12), and moments per width [N] from the curvature [1/m]
    # that comes on top of the reference state's, in the triangle's axes; both positive where they grow with it
    # change: of the strain or curvature in this step; whole: 1 for a triangle's curvature, 0 for the difference to a
    # neighbour's, which shares the triangle's memory and has to leave it as it is
    "membrane": ("strain", "change", "dt"),
    "plate": ("curvature", "change", "whole", "dt"),
    # force on the node
    "node": ("x", "v", "mass", "dt"),
    # normal: force along the ground's normal, repulsion positive
    "contact": ("gap", "rate", "dt"),
    # friction coefficient: contributions are added; at: place of the contact point
    "coefficient": ("direction", "speed", "axis", "normal_load", "at", "dt"),
    # tangential force on the contact point; slip: its tangential displacement in this step
    "tangent": ("velocity", "slip", "normal", "normal_load", "coefficient", "dt"),
    # parts of the surface that are near each other, a corner and a triangle or two edges: force between them, repulsion
    # positive, and tangential force on the first of them; parameters are those of triangles, and a pair has their mean
    # gap: distance less half of both thicknesses; velocity, slip: of the first against the second
    "pair": ("gap", "rate", "dt"),
    "rub": ("velocity", "slip", "normal", "normal_load", "dt"),
    # not forces: they change the drive that reaches the device, or what a tracker makes of its motion
    "drive": (),
    "measurement": (),
}
"""Families of entities, and the quantities that each offers to its laws (SI units)."""

HINGES = ("crease", "bend")
SHELLS = ("membrane", "plate")
CONTACTS = ("contact", "coefficient", "tangent")
PAIRS = ("pair", "rub")
DISTORTIONS = ("drive", "measurement")

DRIVES = ("field", "gradient", "voltage", "temperature", "load", "time")
"""Drive quantities: flux density B at the entity [T], its gradient dB_i/dx_j [T/m], voltage of the entity's electrode
group [V], temperature rise [K], load factor [-], time [s]."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a law, one value per entity and world.

    Args:
        name: argument name in the law.
        symbol: symbol used in the formula.
        unit: SI unit.
        default: value of an entity for which nothing else is given; chosen so that the effect then does nothing.
        bounds: physically admissible values, inclusive.
        meaning: a short description.
        knots: for a tabulated parameter, the number of values per entity; the law gets the buffer and the index of
            the first (arguments `buffer` and `<name>`).
        typical: a value at which the effect is noticeable on a device of some grams and centimetres; the diagnosis
            starts there, and sets those parameters to it that it does not fit.
        threshold: of what it is one, "fold", "moment" (of a crease), "field" or "voltage"; the diagnosis starts within
            what was recorded of it.
        takes: the parameter "effect.name" to which it is added, and of which it takes away no more than there is.
        side: parameter that says on which side of this threshold the law acts, 1 above and -1 below.
    """

    name: str
    symbol: str
    unit: str
    default: float
    bounds: tuple[float, float]
    meaning: str
    knots: int = 1
    typical: float | None = None
    threshold: str = ""
    takes: str = ""
    side: str = ""


@dataclass(frozen=True)
class Memory:
    """Extra state of a law, per entity and world: `size` numbers (3: passed as a vector), zero at the start.

    Args:
        base: so many numbers more in each world, of a law whose pairs share the room.
        own: whether a vector's components are in the entity's own axes, so that they stay when the device turns.
        begun: parameter that says what it is at the first frame of a recording that begins in the midst of a motion,
            over the most that the recorded motion makes of it. No law asks for it.
        by: parameter without which it stays zero.
    """

    name: str
    size: int = 1
    base: int = 0
    own: bool = False
    begun: str = ""
    by: str = ""


@dataclass(frozen=True, eq=False)
class Effect:
    """One physical effect: law, parameters and prose.

    Args:
        name: unique name, also the file's.
        family: key of `FAMILIES`.
        force: the law. With memory it returns the force and then the new memory values.
        energy: potential energy of one entity [J], or None if the effect has none.
        apply: instead of a force, for a distortion of the drive, `apply(drive, duration, **parameters) -> Drive`, or of
            the measurement, `apply(read, times, **parameters) -> values`, where `read(times [n, W])` gives the
            undistorted channel [n, d, W], a marker in a picture with its depth towards the camera as the third
            component. Parameters are arrays [W].
        channels: kinds of channels that a distortion of the measurement can act on (empty: all).
        on_body: of a measurement that acts on markers as their panels turn, before anything else. `read` then gives
            three components of the marker (right, up and towards the camera in a picture), and after them those of the
            model's axes x, y and z as the panel has turned them.
        fitted: parameters that the diagnosis fits when it suspects this effect; the first is its strength, which
            switches the effect off at its default. Empty: the effect is never suspected.
        further: parameters that are fitted as well where a fit of those is the best, and begins from it.
        across: another effect whose vector this one turns: of its own components, as many as are fitted are suspected
            of those across that vector.
        stated: parameters that only a model can know, such as an area; the effect is suspected where one states them.
        needs: parameters of which one has to differ from zero for the law to give anything (empty: the strength, and
            what is fitted with it and has its unit); elsewhere the law is not called.
        magnet: dipole moment of a triangle [A m^2] and its place [m], for a law that asks for the stray field. That is
            multiplied by the effect's strength, the mean of both triangles', so that action equals reaction.
        uneven: whether it often differs along a device as it was made: stretches of a beam are then suspected, too.
        conservative: True if `force` is minus the gradient of `energy` and nothing else; the energy balance then uses
            the energy, and the time-integrated work otherwise.
        stiffness: from the parameters, the largest slope of the force against its own coordinate, per entity; used to
            bound the time step. None means that the effect never limits it. A node's law also finds "mass" there.
        damping: likewise, the slope against the rate.
        inertia: of a node's law, the mass [kg] that it adds to each node, likewise from the parameters and "mass", the
            mass without it: what moves the node is then heavier, and the force is the weight that goes with it.
        formula, source, matters, confused_with, separated_by: prose for the catalogue.
    """

    name: str
    family: str
    force: wp.Function | None
    parameters: tuple[Parameter, ...]
    formula: str
    source: str
    matters: str
    confused_with: str = ""
    separated_by: str = ""
    energy: wp.Function | None = None
    magnet: wp.Function | None = None
    apply: Callable | None = None
    channels: tuple[str, ...] = ()
    on_body: bool = False
    fitted: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    across: str = ""
    stated: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    uneven: bool = False
    conservative: bool = False
    memory: tuple[Memory, ...] = ()
    stiffness: Callable[[Mapping[str, np.ndarray]], np.ndarray] | None = None
    damping: Callable[[Mapping[str, np.ndarray]], np.ndarray] | None = None
    inertia: Callable[[Mapping[str, np.ndarray]], np.ndarray] | None = None
    arguments: tuple[str, ...] = field(init=False)
    energy_arguments: tuple[str, ...] = field(init=False)

    def __post_init__(self):
        if self.family not in FAMILIES:
            raise ValueError(f"effect '{self.name}': unknown family '{self.family}'; allowed: {', '.join(FAMILIES)}")
        if (self.apply if self.family in DISTORTIONS else self.force) is None:
            raise ValueError(f"effect '{self.name}': the family '{self.family}' needs a law (apply or force)")
        for name in (*self.fitted, *self.further):
            if not any(p.name == name and p.typical is not None for p in self.parameters):
                raise ValueError(f"effect '{self.name}': fitted parameter '{name}' needs a typical value")
        own = {p.name for p in self.parameters} | {m.name for m in self.memory}
        known = own | set(FAMILIES[self.family]) | set(DRIVES) | {"buffer"}
        for attribute, which in (("arguments", "force"), ("energy_arguments", "energy")):
            names = self.asked(which)
            for name in names:
                if name not in known:
                    raise ValueError(
                        f"effect '{self.name}': its law asks for '{name}', which is neither a parameter, a memory, a "
                        f"drive nor a quantity of the family '{self.family}'; allowed: {', '.join(sorted(known))}"
                    )
            object.__setattr__(self, attribute, names)
        local = {"field", "gradient", "voltage"} & set(self.drives)
        if self.family in SHELLS and local:
            raise ValueError(f"effect '{self.name}': the family '{self.family}' offers no field or voltage")
        if self.inertia is not None and self.family != "node":
            raise ValueError(f"effect '{self.name}': only nodes have a mass to add to, not the family '{self.family}'")
        if self.interacts and (self.magnet is None or not self.fitted):
            raise ValueError(f"effect '{self.name}': a law that asks for the stray field needs a magnet and a strength")

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name."""
        return next(p for p in self.parameters if p.name == name)

    def asked(self, which: str) -> tuple[str, ...]:
        """Arguments of its "force", "energy" or "magnet"."""
        law = getattr(self, which)
        return tuple(inspect.signature(law.func).parameters) if law is not None else ()

    @cached_property
    def strengths(self) -> tuple[Parameter, ...]:
        """The parameters without which the law gives nothing; none for what acts at its default, as gravity does."""
        fitted = [self.parameter(n) for n in self.fitted]
        names = self.needs or [p.name for p in fitted if p.unit == fitted[0].unit]
        alike = tuple(map(self.parameter, names))
        return () if any(p.default for p in alike) else alike

    @property
    def drives(self) -> tuple[str, ...]:
        """Drive quantities that the law depends on."""
        return tuple(d for d in DRIVES if d in self.arguments or d in self.energy_arguments)

    @property
    def dissipates(self) -> bool:
        """Whether it is a loss in a crease or in the air that goes with the rate and remembers nothing."""
        return not (self.conservative or self.memory or self.drives or self.family in (*CONTACTS, *PAIRS, *DISTORTIONS))

    @property
    def interacts(self) -> bool:
        """Whether its entities act on each other."""
        return bool({"stray", "stray_gradient"} & {*self.arguments, *self.energy_arguments})

    @property
    def exchanges_work(self) -> bool:
        """Whether the energy balance has to integrate this effect's work over time."""
        return not (self.conservative and not self.drives)
