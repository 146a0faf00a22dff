"""What holds nodes of a sheet: supports that stand, and grips, which move along a path in time."""

from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np

from origami_sim.design.masses import Masses
from origami_sim.design.statements import statement
from origami_sim.errors import InputError
from origami_sim.model.motions import velocity

STILL = 1e-9
"""Part of a direction, and of the sheet's size, below which nothing moves: rounding of what is stated leaves 1e-16, and
nobody states less than 1e-6."""


class Grips(Masses):
    """The part of `Sheet` that knows what holds nodes, and what moves them."""

    _free: np.ndarray
    _grips: dict[str, tuple[np.ndarray, np.ndarray]]

    @statement()
    def fix(
        self, *, panels: Iterable[int] | None = None, nodes: Iterable[int] | None = None, axes: str = "xyz"
    ) -> Self:
        """Holds panels or nodes along the named axes; lists may be empty.

        Raises:
            InputError: no such panel, node or axis; neither panels nor nodes; what a grip moves along such an axis.
        """
        if panels is None and nodes is None:
            raise InputError("nothing is held", field="panels, nodes", allowed="fix(panels=[0]), fix(nodes=[0, 1])")
        index, along = self._holding(panels, nodes), _axes(axes, "axes")
        for name, (theirs, screw) in self._grips.items():
            self._refuse_led(name, np.intersect1d(index, theirs), along, screw)
        self._free[index[:, None], along] = 0.0
        return self

    @statement(point="m")
    def grip(
        self,
        name: str,
        *,
        panels: Iterable[int] | int | None = None,
        nodes: Iterable[int] | int | None = None,
        direction: Sequence[float] | None = None,
        axis: Sequence[float] | None = None,
        point: Sequence[float] | None = None,
        axes: str = "xyz",
    ) -> Self:
        """A clamp that holds panels or nodes and moves them: a shaken base, the crosshead of a test machine.

        How far it moves is a channel of the drive, `Drive(grips={name: ramp("5 mm", "1 s")})` along a direction and
        `Drive(turns={name: "30 deg"})` about an axis; without one it stands still. The path counts from the reference
        state. Force, moment and work of every grip are part of a motion (`Trajectory.grip_wrenches`, `grip_load`).

        Args:
            name: by which the drive, recordings and results call it.
            panels, nodes: what it holds. axes: along which it does; a pin that slides leaves out what it slides along.
            direction: in which it moves (3,), of any length. axis: or about which it turns, by the right hand.
            point: on that axis [m]; default the origin.

        Raises:
            InputError: nothing that it holds, a name that is taken or none, a node in two grips, no direction or axis
                or both, a motion along an axis that it does not hold, or along which a node is fixed.
        """
        if not isinstance(name, str) or not name or name in self._grips:
            taken = "there is a grip of that name" if name in self._grips else "a grip needs a name"
            raise InputError(taken, field="grip.name", value=name, allowed="a name of its own")
        index = self._holding(panels, nodes)
        if not len(index):
            allowed = "grip(name, panels=[0]), grip(name, nodes=[0, 1])"
            raise InputError("a grip holds no node", field=f"grip {name}", allowed=allowed)
        for other, (theirs, _) in self._grips.items():
            both = np.intersect1d(index, theirs)
            if len(both):
                value = f"'{other}' and '{name}'"
                raise InputError(f"node {both[0]} is in two grips", field="grip", value=value, allowed="one")
        along, screw = _axes(axes, f"grip {name}.axes"), _screw(name, direction, axis, point)
        slides = [a for k, a in enumerate("xyz") if k not in along and _moves(screw, k)]
        if slides:
            allowed = f"axes='{''.join(a for a in 'xyz' if a in axes or a in slides)}'"
            value = f"along {', '.join(slides)}"
            raise InputError(
                "a grip moves where it does not hold", field=f"grip {name}.axes", value=value, allowed=allowed
            )
        for k in range(3):
            self._refuse_led(name, index[self._free[index, k] == 0.0], [k], screw)
        self._free[index[:, None], along] = 0.0
        self._grips[name] = index, screw
        return self

    def _holding(self, panels: Iterable[int] | int | None, nodes: Iterable[int] | int | None) -> np.ndarray:
        """The nodes of panels and these nodes (k,), each once."""
        panels, nodes = ([] if v is None else list(v) if isinstance(v, Iterable) else [v] for v in (panels, nodes))
        return np.unique([*self._index("node", nodes), *(n for p in panels for n in self._nodes_of(p))]).astype(int)

    def _refuse_led(self, name: str, nodes: np.ndarray, along: Sequence[int], screw: np.ndarray) -> None:
        """Refuses nodes that are fixed along axes along which their grip moves them; on its own axis none is moved."""
        x = self.mesh.vertices[nodes]
        led = nodes[np.linalg.norm(velocity(x, screw), axis=1) > STILL * np.ptp(self.mesh.vertices)]
        if len(led) and any(_moves(screw, k) for k in along):
            value = f"node {led[0]}"
            raise InputError("what a grip moves is fixed", field=f"grip {name}", value=value, allowed="fix, or grip")

    def _gripped(self) -> dict[str, Any]:
        """What a model says of its grips."""
        if not self._grips:
            return {}
        of = np.full(len(self._free), -1, np.int32)
        for k, (nodes, _) in enumerate(self._grips.values()):
            of[nodes] = k
        return {"grips": of, "grip_screws": np.array([screw for _, screw in self._grips.values()])}


def _axes(axes: Sequence[str], field: str) -> list[int]:
    """Numbers of the axes that letters name."""
    if set(axes) - set("xyz"):
        raise InputError("there is no such axis", field=field, value=axes, allowed="x, y, z")
    return ["xyz".index(a) for a in axes]


def _screw(name: str, direction: Any, axis: Any, point: Any) -> np.ndarray:
    """Angular velocity and velocity of the origin (6,) for a unit of the path."""
    if (direction is None) == (axis is None):
        stated = "neither" if axis is None else "both"
        allowed = "direction=(0, 0, 1), or axis=(0, 1, 0) with a point on it"
        said = "a grip moves along a direction or about an axis"
        raise InputError(said, field=f"grip {name}", value=stated, allowed=allowed)
    if axis is None and point is not None:
        raise InputError("a point is one on an axis", field=f"grip {name}.point", value=point, allowed="axis=(0, 1, 0)")
    word, given = ("direction", direction) if axis is None else ("axis", axis)
    way, at = np.asarray(given, float), np.asarray((0.0, 0.0, 0.0) if point is None else point, float)
    for part, value in ((word, way), ("point", at)):
        if value.shape != (3,) or not np.all(np.isfinite(value)) or (part == word and not np.any(value)):
            allowed = "x, y, z, not all zero" if part == word else "x, y, z"
            said = f"the {part} of a grip has three components"
            raise InputError(said, field=f"grip {name}.{part}", value=value.tolist(), allowed=allowed)
    way = way / np.linalg.norm(way)
    return np.append(np.zeros(3), way) if axis is None else np.append(way, np.cross(at, way))


def _moves(screw: np.ndarray, k: int) -> bool:
    """Whether a motion leads along a coordinate axis, or turns what has a place along it."""
    leads = np.cross(screw[:3], np.eye(3)[k]) if np.any(screw[:3]) else screw[3 + k]
    return bool(np.linalg.norm(leads) > STILL)
