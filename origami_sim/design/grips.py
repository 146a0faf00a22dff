"""Grips of a sheet: clamps that hold nodes and move them along a path in time."""

from collections.abc import Iterable, Sequence
from typing import Any, Self

import numpy as np

from origami_sim.design.masses import Masses
from origami_sim.design.statements import statement
from origami_sim.errors import InputError


class Grips(Masses):
    """The part of `Sheet` that knows what moves held nodes."""

    _free: np.ndarray
    _grips: dict[str, tuple[np.ndarray, np.ndarray]]

    @statement(point="m")
    def grip(
        self,
        name: str,
        *,
        panels: Iterable[int] | int | None = None,
        nodes: Iterable[int] | int | None = None,
        direction: Sequence[float] | None = None,
        axis: Sequence[float] | None = None,
        point: Sequence[float] = (0.0, 0.0, 0.0),
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
            point: on that axis [m].

        Raises:
            InputError: nothing that it holds, a name that is taken or none, a node in two grips, no direction or axis
                or both, a motion along an axis that it does not hold.
        """
        if not isinstance(name, str) or not name or name in self._grips:
            taken = "there is a grip of that name" if name in self._grips else "a grip needs a name"
            raise InputError(taken, field="grip.name", value=name, allowed="a name of its own")
        held = [[] if v is None else list(v) if isinstance(v, Iterable) else [v] for v in (panels, nodes)]
        index = np.array([*self._index("node", held[1]), *(n for p in held[0] for n in self._nodes_of(p))], int)
        index = np.unique(index)
        if not len(index):
            allowed = "grip(name, panels=[0]), grip(name, nodes=[0, 1])"
            raise InputError("a grip holds no node", field=f"grip {name}", allowed=allowed)
        for other, (theirs, _) in self._grips.items():
            both = np.intersect1d(index, theirs)
            if len(both):
                value = f"'{other}' and '{name}'"
                raise InputError(f"node {both[0]} is in two grips", field="grip", value=value, allowed="one")
        if not axes or set(axes) - set("xyz"):
            raise InputError("there is no such axis", field=f"grip {name}.axes", value=axes, allowed="x, y, z")
        screw = _screw(name, direction, axis, point)
        slides = [a for k, a in enumerate("xyz") if a not in axes and _moves(screw, k)]
        if slides:
            allowed = f"axes='{''.join(a for a in 'xyz' if a in axes or a in slides)}'"
            value = f"along {', '.join(slides)}"
            raise InputError(
                "a grip moves where it does not hold", field=f"grip {name}.axes", value=value, allowed=allowed
            )
        for a in axes:
            self._free[index, "xyz".index(a)] = 0.0
        self._grips[name] = index, screw
        return self

    def _gripped(self) -> dict[str, Any]:
        """What a model says of its grips."""
        if not self._grips:
            return {}
        of = np.full(len(self._free), -1, np.int32)
        for k, (nodes, _) in enumerate(self._grips.values()):
            of[nodes] = k
        return {"grips": of, "grip_screws": np.array([screw for _, screw in self._grips.values()])}


def _screw(name: str, direction: Any, axis: Any, point: Any) -> np.ndarray:
    """Angular velocity and velocity of the origin (6,) for a unit of the path."""
    if (direction is None) == (axis is None):
        stated = "neither" if axis is None else "both"
        allowed = "direction=(0, 0, 1), or axis=(0, 1, 0) with a point on it"
        raise InputError("a grip moves along a direction or about an axis", field=name, value=stated, allowed=allowed)
    word, given = ("direction", direction) if axis is None else ("axis", axis)
    way, at = np.asarray(given, float), np.asarray(point, float)
    for part, value in ((word, way), ("point", at)):
        if value.shape != (3,) or not np.all(np.isfinite(value)) or (part == word and not np.any(value)):
            allowed = "x, y, z, not all zero" if part == word else "x, y, z"
            raise InputError("has three components", field=f"grip {name}.{part}", value=value.tolist(), allowed=allowed)
    way = way / np.linalg.norm(way)
    return np.append(np.zeros(3), way) if axis is None else np.append(way, np.cross(at, way))


def _moves(screw: np.ndarray, k: int) -> bool:
    """Whether a motion leads along a coordinate axis, or turns what has a place along it."""
    along = np.eye(3)[k]
    turns = bool(np.any(screw[:3]))
    return bool(np.linalg.norm(np.cross(screw[:3], along)) > 1e-9) if turns else bool(abs(screw[3 + k]) > 1e-12)
