"""Panels that touch each other: what a designer states of it, and what follows for each triangle."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from origami_sim.design.masses import Masses, positive
from origami_sim.design.statements import statement
from origami_sim.errors import InputError
from origami_sim.model import SURFACE, Model, Parameters
from origami_sim.model.contact import CONTACT, FRICTION, set_contact

SQUEEZE = 0.2
"""Stiffness of a pair that touches, over modulus times thickness of its panels, which is what a corner of a panel
itself has in its plane.

A gram on a pair presses panels of 1 mm PDMS some 30 um into each other. Half presses twice as deep at 1.3 times the
time step, double half as deep at 0.7 times the step.
"""

LANDING = 0.1
"""Damping of panels that meet, as a ratio of critical of the mass of a corner.

A corner alone rebounds with 0.7 of its speed, a panel that lands on several at once with less. The time step of bars
becomes 0.3 times as long; 0.43 times with half of it and 0.17 times with double, since stability is bounded for the
most pairs that may touch at once.
"""


@dataclass(frozen=True)
class Touch:
    """How panels touch, as it was stated; see `Touches.touch`."""

    on: bool
    friction: float
    stiffness: float | None
    damping_ratio: float
    thickness: float | None


class Touches(Masses):
    """The part of `Sheet` that knows that panels may touch each other."""

    modulus: np.ndarray
    _between: Touch | None

    # what a designer states ------------------------------------------------------------------------------------

    @statement(stiffness="N/m", thickness="m")
    def touch(
        self,
        on: bool = True,
        *,
        friction: float = FRICTION,
        stiffness: float | None = None,
        damping_ratio: float = LANDING,
        thickness: float | None = None,
    ) -> Self:
        """States how panels touch each other, so that none passes through another.

        Without this statement they touch with these defaults: a run goes without contact, which is much faster, until
        panels come near each other in it, and is then made again with contact (see `solve.watch`). What is stated acts
        from the start. Patches touch only where it is stated, as those of neighbouring panels may be one piece; so do
        thick panels (`hinge`, `mitre`, `panel(offset=...)`): contact rounds the edges that they cut.

        Their surfaces lie half of their thickness off their middle planes. Where two come nearer they are pushed apart
        and rub; what is pressed in by more than half of the thickness stops the run. Beside a crease two panels come
        closer than that.

        Args:
            on: False lets panels pass through each other; runs count those that do.
            friction: coefficient between panels.
            stiffness: of each pair of a corner and a triangle, or of two edges, that touches [N/m] (default: SQUEEZE
                times modulus times thickness); 0 leaves it to the diagnosis to ask whether panels touch.
            damping_ratio: of panels that meet.
            thickness: at which they touch [m], instead of each panel's own.

        Raises:
            InputError: numbers that are negative, a thickness that is not positive, numbers of what does not touch.
                `build` refuses panels that lie in each other at the start.
        """
        if not isinstance(on, bool | np.bool_):
            raise InputError("panels touch or they do not", field="on", value=on, allowed="true, false")
        if not on and (friction, stiffness, damping_ratio, thickness) != (FRICTION, None, LANDING, None):
            raise InputError("panels that pass through each other have no numbers of contact", field="touch")
        if not (friction >= 0 and damping_ratio >= 0 and (stiffness is None or stiffness >= 0)):
            raise InputError(
                "how panels touch is stated by numbers that are not negative",
                field="friction, damping_ratio, stiffness",
                value=(friction, damping_ratio, stiffness),
                allowed=">= 0, >= 0, >= 0 N/m",
            )
        if thickness is not None and not positive(thickness):
            raise InputError("panels without thickness cannot touch", field="thickness", value=thickness, allowed="> 0")
        self._between = Touch(bool(on), float(friction), stiffness, float(damping_ratio), thickness)
        self._effects = [e for e in self._effects if e not in CONTACT]
        return self.on(*CONTACT) if on else self

    @abstractmethod
    def _cut(self) -> bool:
        """Whether edges of panels are cut to fold as thick panels do; contact rounds edges by half of the thickness."""

    # what follows from it ----------------------------------------------------------------------------------------

    def _padded(self, model: Model) -> Model:
        """The model with the patches that can touch: rectangles in their middle planes, with rounded borders."""
        found: list[tuple[int, np.ndarray, float]] = []
        thickness = []
        for panel, patch in enumerate(self._patches if self._between is not None and self._between.on else []):
            if not patch:
                continue
            height = patch["side"] * 0.5 * (float(self.thickness[panel]) + patch["thickness"])
            half = np.maximum(0.5 * patch["size"] - 0.5 * patch["thickness"], 0.05 * patch["size"])
            for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                triangle, weights, _ = self._carrier(panel, patch["centre"] + np.array([x * half[0], y * half[1], 0.0]))
                found.append((int(triangle), weights, height))
            thickness.append(patch["thickness"])
        if not found:
            return model
        triangles, weights, heights = (np.array(a) for a in zip(*found, strict=True))
        return replace(
            model, pad_triangles=triangles.astype(np.int32), pad_weights=weights, pad_heights=heights,
            pad_thickness=np.array(thickness),
        )  # fmt: skip

    def _touching(self, parameters: Parameters) -> None:
        """Sets how each triangle touches, or would as soon as something comes near it."""
        stated = self._between or Touch(not self._cut(), FRICTION, None, LANDING, None)
        if not stated.on:
            return
        face = self.mesh.triangle_face
        own = self.thickness[face]
        stiffness = SQUEEZE * self.modulus[face] * own
        if stated.stiffness is not None:
            stiffness = np.full(len(face), stated.stiffness)
        mass = parameters["inertia", "mass"][:, 0][self.mesh.triangles].mean(axis=1)
        loss_time = 2 * stated.damping_ratio * np.sqrt(mass / np.where(stiffness > 0, stiffness, np.inf))
        if self._between is None:
            for name, value in zip(SURFACE, (own, stiffness, loss_time), strict=True):
                parameters.set("surface", name, value)
            return
        set_contact(
            parameters, own if stated.thickness is None else stated.thickness, stiffness, loss_time, stated.friction
        )


def refuse_overlap(model: Model, parameters: Parameters) -> None:
    """Refuses panels that lie in each other, or nearer than they touch, in the reference state.

    Raises:
        InputError: naming both.
    """
    from origami_sim.solve.skin import near_pairs  # only sheets that touch need a kernel here

    size = float(np.ptp(model.position, axis=0).max())
    found = near_pairs(model, parameters, model.position, margin=1e-6 * size)
    through = found.inside & (found.distance <= 1e-9 * size)
    deep = np.where(through, np.inf, found.offset * (1 - 1e-6) - found.distance)
    if len(deep) and deep.max() > 0:
        worst = int(deep.argmax())
        one, other = (model.name("panel", p) for p in sorted(model.triangle_panel[found.sides[worst]].tolist()))
        inside = f"lie {(found.offset - found.distance)[worst] * 1e3:.3g} mm inside each other"
        raise InputError(
            f"{one} and {other} {'overlap' if through[worst] else inside} at the start",
            field="touch",
            allowed="panels that do not touch in the pattern",
        )
