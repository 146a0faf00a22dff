"""Dielectric hinges: a stack of electroded elastomer layers on a film, which a voltage bends.

The stack lies on the film and, getting longer under voltage, bends it away from itself.

Section, per width: z from the film's outer face, film of thickness t_f (plane strain, E_f / (1 - nu_f^2)), stack of
height H (Ogden, incompressible, plane strain: small-strain modulus 4 G, G = sum mu_i alpha_i / 2).

- linear: D and the neutral axis z_n of the bonded layers; moment p H a with the lever a = t_f + H/2 - z_n.
- ogden: exact bending of an incompressible strip. The stretch lambda of a layer at height z above the film follows from
  constant area, lambda^2 = lambda_0^2 + 2 kappa z (Rivlin 1949), and the passive moment is dU/dkappa of the elastic
  energy at zero axial force. The stack's capacitance eps/t int lambda^2 dz then grows linearly with kappa, so that the
  moment of -C V^2/2 is p H a at every curvature: with thinning layers the law `maxwell_stress` is exact as it stands.
  Without thinning (a true stress p that does not grow, as in a purely mechanical analysis) the moment is the smaller
  p int z / lambda^2 dz; the crease table is divided by that share, as no effect carries it
  (so a weight then meets a section that is up to 6 % too stiff).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.design.masses import Masses, positive
from origami_sim.design.statements import statement
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError
from origami_sim.physics.materials import layered_rigidity, material

REACH = (0.2, 1.6)
"""Curvature times a stack's height to which a crease table goes: stack inside the bend, outside; beyond, straight on.

A notch that folds by half a turn before that ends there, as one of 5 mm with 6 layers does. Outside, layers may be bent
to any curvature; half ends that hinge's table at 140 deg, a quarter at 70, where 10 kV hold its flap at 128 deg. Small
angles of a notch of 1.5 mm are off by 0.0003 deg, with double by 0.007: then the 33 knots lie too far apart. Inside,
layers close up at 0.5, where the moment has no bound; half and double of 0.2 end at 17 and at 70 deg.
"""


@dataclass(frozen=True)
class Stack:
    """Cross-section of a dielectric hinge, of unit width.

    Attributes:
        layers: number of elastomer layers. layer_thickness: of each at rest [m].
        film: thickness of the film [m]. film_modulus: its plane-strain modulus E / (1 - nu^2) [Pa].
        mu, alpha: Ogden constants of W = sum mu_i / alpha_i (l1^a + l2^a + l3^a - 3) [Pa], [-].

    Raises:
        InputError: layers, thicknesses or a modulus that are not positive.
    """

    layers: int
    layer_thickness: float
    film: float
    film_modulus: float
    mu: tuple[float, ...]
    alpha: tuple[float, ...]

    def __post_init__(self):
        for name in ("layers", "layer_thickness", "film", "film_modulus"):
            if not positive(getattr(self, name)):
                raise InputError("a stack's numbers are positive", field=name, value=getattr(self, name), allowed="> 0")
        if len(self.mu) != len(self.alpha):
            count = f"{len(self.mu)}"
            raise InputError("Ogden constants come in pairs", field="alpha", value=self.alpha, allowed=count)
        if not self.shear_modulus > 0:
            raise InputError(
                "the Ogden constants have no positive shear modulus",
                field="mu",
                value=self.shear_modulus,
                allowed="sum of mu alpha > 0",
            )

    @property
    def shear_modulus(self) -> float:
        """G at small strains [Pa]."""
        return 0.5 * float(np.dot(self.mu, self.alpha))

    @property
    def height(self) -> float:
        """Of the layers together [m]."""
        return self.layers * self.layer_thickness

    @property
    def moduli(self) -> tuple[float, float]:
        """Plane-strain moduli of film and layers [Pa]."""
        return self.film_modulus, 4 * self.shear_modulus

    @property
    def rigidity(self) -> float:
        """Bending rigidity per width D [N m]."""
        return layered_rigidity([(self.film, self.moduli[0]), (self.height, self.moduli[1])])

    @cached_property
    def neutral(self) -> float:
        """Neutral axis above the film's outer face [m]."""
        stiff = self.moduli[0] * self.film, self.moduli[1] * self.height
        return (stiff[0] * self.film / 2 + stiff[1] * (self.film + self.height / 2)) / sum(stiff)

    @property
    def lever(self) -> float:
        """Middle of the layers above the neutral axis [m]."""
        return self.film + self.height / 2 - self.neutral

    def passive_moment(self, curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What it takes to bend the section to some curvatures [1/m], positive where the layers get longer.

        Returns:
            Moment per width [N]; moment of a true stress p of constant size over p H a [-].

        Raises:
            InputError: a curvature to which incompressible layers cannot be bent.
        """
        mu, alpha = (np.asarray(v)[:, None, None] for v in (self.mu, self.alpha))
        nodes, weights = np.polynomial.legendre.leggauss(12)
        z, w = 0.5 * self.height * (1 + nodes), 0.5 * self.height * weights
        y, v = 0.5 * self.film * (1 + nodes) - self.neutral, 0.5 * self.film * weights
        above = self.film - self.neutral
        k = np.asarray(curvature, float)[:, None]
        strain = np.zeros_like(k)  # at the neutral axis

        def forces(e):
            root = 1 + e + k * above
            square = root**2 + 2 * k * z
            if np.any(square <= 0):
                raise InputError("the stack cannot bend so far", field="layers", value=float(np.abs(k).max()))
            stretch = np.sqrt(square)
            stress = (mu * (stretch**alpha - stretch**-alpha)).sum(0)  # true stress, nothing on the faces
            film = self.moduli[0] * (e + k * y)
            axial = (stress * root / square) @ w + film @ v
            bending = (stress * (root * above + z) / square) @ w + (film * y) @ v
            return axial, bending, ((root * above + z) / square) @ w

        stiffness = self.moduli[0] * self.film + self.moduli[1] * self.height
        for _ in range(60):
            step = forces(strain)[0][:, None] / stiffness
            strain = strain - step
            if np.abs(step).max() < 1e-13:
                break
        _, bending, constant = forces(strain)
        return bending, constant / (self.height * self.lever)


def _ends(stack: Stack, length: np.ndarray, reach: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Largest curvatures of tables with the stack inside and outside the bend [1/m], for notches of some length [m]."""
    if reach is not None:
        return np.full(length.shape, reach), np.full(length.shape, reach)
    inside, outside = (np.minimum(np.pi / length, r / stack.height) for r in REACH)
    before = np.rint((KNOTS - 1) * inside / (inside + outside))  # intervals inside; a knot is where nothing bends
    return outside * before / (KNOTS - 1 - before), outside


class Electrodes(Masses):
    """The part of `Sheet` that knows dielectric hinges."""

    _crease_stiffness: np.ndarray
    _rest: np.ndarray
    _electrodes: np.ndarray

    @statement(
        notch="m", layer_thickness="m", film_thickness="m", film_modulus="Pa", width="m", electrode_width="m",
        rest_angle="rad", loss_time="s", reach="1/m",
    )  # fmt: skip
    def electrode(
        self,
        creases=None,
        *,
        layers: int,
        notch: ArrayLike,
        layer_thickness: float = 272.8e-6,
        elastomer: str = "vhb",
        ogden: tuple[Sequence[float], Sequence[float]] | None = None,
        permittivity: float = 4.7,
        film: str = "tape",
        film_thickness: float = 62e-6,
        film_modulus: float | None = None,
        film_poisson: float | None = None,
        width: float | None = None,
        electrode_width: float | None = None,
        side: int = 1,
        group: int = 0,
        constraint: float = 1.0,
        thinning: bool = True,
        section: str = "ogden",
        rest_angle: ArrayLike | None = None,
        loss_time: float = 0.0,
        reach: float | None = None,
    ) -> Self:
        """Makes creases dielectric hinges: layers with electrodes between them, on a film that is the hinge's skin.

        It states both how stiff the crease is and what a voltage does there, in place of `crease`; state it after a
        `crease` that is meant for the others. The weight is that of the panels. A stack on top bends the sheet down.

        Args:
            creases: indices (default: all).
            layers: number of layers. layer_thickness: [m]. elastomer: a material; neo-Hookean, unless ogden.
            notch: length of sheet along which the hinge bends [m], for all or one per crease: the stretch where the
                film is thinner, or the part of an even strip that a hinge stands for.
            ogden: constants (mu_i [Pa], alpha_i) of the elastomer instead, W = sum mu_i / alpha_i (...).
            permittivity: relative.
            film: material of the film. film_thickness: of what is left of it in the notch [m]. film_modulus,
                film_poisson: override the material's [Pa], [-].
            width: that bends [m] (default: the crease's length). electrode_width: that has electrodes [m] (default: all
                of it; 0 for a stack without electrodes).
            side: +1 for a stack on the top, -1 below.
            group: electrode group, `voltage=[V_0, V_1, ...]` in the drive.
            constraint: 1 if the film blocks the width, 1/2 if it is free.
            thinning: whether layers get thinner, and the stress larger, as they are stretched.
            section: "ogden" (exact bending of the layers, a tabulated crease) or "linear", for small angles: of six
                layers on 62 um of tape 2 % off at 5 degrees, 10 % at 30.
            rest_angle: without voltage [rad] (default: as the pattern lies). loss_time: beta [s], viscosity = beta
                stiffness. reach: largest curvature of the table, both ways [1/m] (default: what folds the notch by half
                a turn, but no more than 1.6 over the stack's height with the stack outside, 0.2 with it inside).
                Beyond, the moment goes straight on, too large outside and too small inside; a run notes it.

        Raises:
            InputError: no such crease or material, numbers that are not positive, an unknown side or section.
        """
        index = self._index("crease", creases)
        if side not in (1, -1):
            raise InputError("a stack lies on one side", field="side", value=side, allowed="1 (top), -1 (below)")
        if section not in ("ogden", "linear"):
            raise InputError("no such section", field="section", value=section, allowed="ogden, linear")
        if not (isinstance(group, (int, np.integer)) and group >= 0):
            raise InputError("electrode groups are counted from 0", field="group", value=group, allowed="0, 1, ...")
        length = np.broadcast_to(np.asarray(notch, float), index.shape)
        if not np.all(positive(length)):
            raise InputError("a hinge bends along some length", field="notch", value=notch, allowed="> 0 m")
        whole = float(np.ptp(self.mesh.vertices, axis=0).max())
        if np.any(length > whole):
            raise InputError("a hinge is longer than the sheet", field="notch", value=notch, allowed=f"<= {whole:g} m")
        skin, soft = material(film), material(elastomer)
        modulus = skin.modulus if film_modulus is None else film_modulus
        poisson = skin.poisson if film_poisson is None else film_poisson
        mu, alpha = ogden if ogden is not None else ((soft.modulus / 3,), (2.0,))
        stack = Stack(layers, layer_thickness, film_thickness, modulus / (1 - poisson**2), tuple(mu), tuple(alpha))
        hinge = self.mesh.creases[index]
        across = np.linalg.norm(self.mesh.vertices[hinge[:, 2]] - self.mesh.vertices[hinge[:, 1]], axis=1)
        bends = across if width is None else np.full(len(index), float(width))
        live = bends if electrode_width is None else np.full(len(index), float(electrode_width))
        if rest_angle is not None:
            self._rest[index] = rest_angle
        rest = self._rest[index]
        stiffness = stack.rigidity * bends / length
        if section == "ogden":
            inside, outside = _ends(stack, length, reach)
            ends = (-outside, inside) if side > 0 else (-inside, outside)
            curvature = np.linspace(*ends, KNOTS, axis=-1)  # [C, knots], positive where the crease's angle is
            passive, share = stack.passive_moment(-side * curvature.ravel())
            moment = -side * (passive if thinning else passive / share).reshape(curvature.shape)
            self.set("crease_table", index, angle_min=rest + ends[0] * length, angle_max=rest + ends[1] * length,
                     resisting_moment=(moment * bends[:, None])[:, None])  # fmt: skip
            self._crease_stiffness[index] = 0.0  # of a linear law beside it
        else:
            self.on("crease")
            self._crease_stiffness[index] = stiffness
        electric: dict[str, ArrayLike] = {
            "permittivity": permittivity,
            "layer_thickness": layer_thickness,
            "layers": float(layers),
            "constraint": constraint,
            "side": -float(side),
        }
        on = np.flatnonzero(live > 0)
        if len(on):
            electric["width"] = live[on]
            self.set("maxwell_stress", index[on], lever=stack.lever, **electric)
            if thinning and section == "linear":
                first = stack.film - stack.neutral
                self.set("thickness_thinning", index[on], first=first, neutral=0.0, hinge_length=length[on], **electric)
        if loss_time:
            self.set("crease_viscosity", index, viscosity=loss_time * stiffness)
        self._electrodes[index] = group
        return self
