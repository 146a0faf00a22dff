"""Crease law of an elastomer bridge by finite elements: moment against fold angle of a cross-section at finite strain.

A sheet of thickness h carries two patches on its top side, a gap g apart. One half is meshed (the other is its mirror
image) in plane strain with 8-node quadrilaterals; the volumetric term is integrated on 2 x 2 points and the rest on
3 x 3, so that nearly incompressible rubber does not lock. The far end stays plane and turns by half the fold angle; it
may slide within its plane and move along its normal, so that it passes on a moment and no force (a free-pulling end).

Energy per reference volume (Mooney-Rivlin, as in equation 3 of the seed paper without its misprinted squares):

    W = C10 (J^-2/3 I1 - 3) + C01 (J^-4/3 I2 - 3) + kappa/2 (J - 1)^2

In plane strain, with f = F:F, I1 = f + 1 and I2 = f + J^2, so that W depends on f and J only.

Not computed: contact of the patches or of the sheet with itself. Under rigid patches the compressed surface at the
patch's edge creases from about 60 deg on, towards the patches; meshes differ there by up to 2 % (fineness 2 against 3).

References: Hughes, The Finite Element Method (1987), 4.4 (selective integration); Holzapfel, Nonlinear Solid Mechanics
(2000), 6.4. Needs scikit-fem (`pip install origami-sim[fe]`); only the mesh and the shape functions come from there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import splu

from origami_sim.calibrate.result import Calibration, Quantity
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError
from origami_sim.physics.materials import layered_rigidity

TOLERANCE = 1e-7
"""Newton stops at this residual, in units of the largest nodal force; round-off leaves 1e-9 at nu = 0.4999."""

ITERATIONS = 25
"""Newton iterations after which an increment counts as failed."""


@dataclass(frozen=True)
class Rubber:
    """Nearly incompressible Mooney-Rivlin rubber.

    Attributes:
        modulus: Young's modulus at small strain [Pa]. poisson: Poisson's ratio [-], 0.3 to 0.4999.
        share: C01 / (C10 + C01) [-], 0 for neo-Hookean; 40/130 for the seed paper's MAE.
    """

    modulus: float
    poisson: float = 0.49
    share: float = 0.0

    def __post_init__(self):
        if not (self.modulus > 0 and math.isfinite(self.modulus)):
            raise InputError("a rubber needs a positive modulus", field="modulus", value=self.modulus, allowed="> 0")
        if not 0.3 <= self.poisson <= 0.4999:
            raise InputError(
                "out of the range of these elements", field="poisson", value=self.poisson, allowed="0.3 to 0.4999"
            )
        if not 0 <= self.share <= 1:
            raise InputError("not a share", field="share", value=self.share, allowed="0 to 1")

    @property
    def shear(self) -> float:
        """Shear modulus 2 (C10 + C01) [Pa]."""
        return self.modulus / (2 * (1 + self.poisson))

    @property
    def bulk(self) -> float:
        """Bulk modulus [Pa]."""
        return self.modulus / (3 * (1 - 2 * self.poisson))

    @property
    def plane_modulus(self) -> float:
        """E / (1 - nu^2) [Pa]."""
        return self.modulus / (1 - self.poisson**2)


@dataclass(frozen=True)
class Bridge:
    """Cross-section of a sheet with two patches on its top side.

    Attributes:
        gap: between the patches [m]. thickness: of the sheet [m]. sheet: its rubber.
        patch: rubber of the patches; None for rigid ones. patch_thickness: [m].
        overlap: sheet under each patch that is meshed [m]; None for 4 times the height, which is long enough
            for the disturbance at the patch's edge to die out (checked in the tests). 0 for a bare strip of length gap.
    """

    gap: float
    thickness: float
    sheet: Rubber
    patch: Rubber | None = None
    patch_thickness: float = 0.003175
    overlap: float | None = None

    def __post_init__(self):
        for name in ("gap", "thickness", "patch_thickness"):
            value = getattr(self, name)
            if not (value > 0 and math.isfinite(value)):
                raise InputError("a bridge needs positive dimensions", field=name, value=value, allowed="> 0 (metres)")
            if value > 1:
                raise InputError("a bridge of this size is a slip of the unit", field=name, value=value, allowed="m")
        if self.overlap is not None and not (self.overlap >= 0 and math.isfinite(self.overlap)):
            raise InputError("not an overlap", field="overlap", value=self.overlap, allowed=">= 0, or none")

    @property
    def reach(self) -> float:
        """Meshed sheet under each patch [m]."""
        if self.overlap is not None:
            return self.overlap
        return 4 * (self.thickness + (0 if self.patch is None else self.patch_thickness))

    @property
    def rigidity(self) -> float:
        """Bending rigidity of the bare sheet per width, E' h^3 / 12 [N m]."""
        return self.sheet.plane_modulus * self.thickness**3 / 12

    @property
    def patch_bending(self) -> float:
        """Turn of both patched ends per moment per width, as layered beams [rad/N]; not part of the crease."""
        if self.patch is None or self.reach == 0:
            return 0.0
        layers = [(self.thickness, self.sheet.plane_modulus), (self.patch_thickness, self.patch.plane_modulus)]
        return 2 * self.reach / layered_rigidity(layers)

    @property
    def closing_angle(self) -> float:
        """Fold angle at which rigid patches would touch at their upper corners, towards the patches [rad].

        Contact is not computed: beyond this angle add `crease_stop`. The bridge is taken to turn about its mid-plane.
        """
        lever = self.patch_thickness + self.thickness / 2
        return 2 * math.atan2(self.gap / 2, lever)


@dataclass(frozen=True)
class Curve:
    """Moment against fold angle of a bridge.

    Attributes:
        fold: (n,) fold angle, bending of the patched ends taken off [rad]; positive folds towards the patches.
        turn: (n,) angle between the two ends, bending included [rad].
        moment: (n,) moment per width that holds the angle [N].
        stiffness: slope at zero [N/rad], from a linear solution. elements: of the half section.
        bridge: what was computed.
    """

    fold: np.ndarray
    turn: np.ndarray
    moment: np.ndarray
    stiffness: float
    elements: int
    bridge: Bridge

    @property
    def effective_length(self) -> float:
        """L* = E' h^3 / (12 K) [m]."""
        return self.bridge.rigidity / self.stiffness

    @property
    def end_correction(self) -> float:
        """c of L* = g + 2 c h [-]."""
        return (self.effective_length - self.bridge.gap) / (2 * self.bridge.thickness)


def crease_curve(
    bridge: Bridge, angles: Sequence[float] | np.ndarray = (), *, fineness: int = 2, largest_step: float = 0.12
) -> Curve:
    """Moment of a bridge at given angles between its ends.

    Args:
        bridge: the cross-section. angles: between the ends [rad], any order; the slope at zero comes in any case.
        fineness: mesh; 1 has 4 elements through the sheet, each further step halves all of them.
        largest_step: increment of the angle between the ends [rad]; a failed increment is halved.

    Returns:
        The curve, ordered by angle, with (0, 0) where an angle is 0.

    Raises:
        InputError: scikit-fem is missing, a fineness outside 1 to 4, angles beyond +-pi, or no equilibrium found.
    """
    turns = np.unique(np.asarray(angles, float))
    if not np.isfinite(turns).all() or (len(turns) and np.abs(turns).max() > math.pi):
        raise InputError("an angle must lie between -pi and pi", field="angles", allowed="radians")
    section = _Section(bridge, fineness)
    slope = section.slope()
    found = {0.0: 0.0}
    for sign in (1.0, -1.0):
        found.update(section.sweep(np.sort(sign * turns[sign * turns > 0]), sign, largest_step))
    moment = np.array([found[float(a)] for a in turns])
    fold = turns - bridge.patch_bending * moment
    stiffness = 1 / (1 / slope - bridge.patch_bending)
    return Curve(fold, turns, moment, stiffness, section.mesh.nelements, bridge)


def crease_table(
    bridge: Bridge, width: float, *, largest: float = math.radians(100), fineness: int = 2, points: int = 12
) -> tuple[np.ndarray, Curve]:
    """Tabulated crease law of a bridge, for the effect `crease_table`.

    Args:
        bridge: the cross-section. width: along the crease [m], much more than the thickness. largest: end of the table
            on both sides [rad]. fineness: mesh. points: equilibria computed on each side.

    Returns:
        (33,) moments [N m] at fold angles equally spaced from -largest to largest, and the curve they come from.
    """
    if not (width > 0 and math.isfinite(width)):
        raise InputError("a crease needs a positive width", field="width", value=width, allowed="> 0 (metres)")
    if not 0 < largest <= 3:
        raise InputError("not an end of a table", field="largest", value=largest, allowed="0 to 3 rad")
    ends = np.linspace(0, largest, points + 1)[1:]
    linear = crease_curve(bridge, fineness=fineness)
    turns = ends * (1 + 1.15 * bridge.patch_bending * linear.stiffness)  # 15 % more: the bridge may stiffen
    curve = crease_curve(bridge, np.concatenate([-turns[::-1], [0.0], turns]), fineness=fineness)
    if curve.fold[-1] < largest or curve.fold[0] > -largest:
        raise InputError("the patches bend more than the crease", field="patch", allowed="stiffer or thicker patches")
    knots = np.linspace(-largest, largest, KNOTS)
    return width * CubicSpline(curve.fold, curve.moment)(knots), curve


def crease_calibration(bridge: Bridge, width: float, *, command: str, largest: float = math.radians(100),
                       fineness: int = 2) -> Calibration:  # fmt: skip
    """A calibration file's content for one crease: linear stiffness, end correction and tabulated law.

    The interval of each value is its change from the next coarser mesh, on both sides.
    """
    moments, curve = crease_table(bridge, width, largest=largest, fineness=fineness)
    coarse, rough = crease_table(bridge, width, largest=largest, fineness=max(fineness - 1, 1))
    source = (
        f"plane-strain finite elements, {curve.elements} in the half section; interval: change from {rough.elements}"
    )

    def around(value, other):
        return (value - abs(value - other), value + abs(value - other))

    patch = "rigid" if bridge.patch is None else f"{bridge.patch.modulus:.4g} Pa"
    quantities = [
        Quantity(name, value, unit, meaning, "input of this calibration")
        for name, value, unit, meaning in (
            ("gap", bridge.gap, "m", "between the patches"),
            ("thickness", bridge.thickness, "m", "sheet"),
            ("width", width, "m", "along the crease"),
            ("modulus", bridge.sheet.modulus, "Pa", "Young's modulus of the sheet"),
            ("poisson", bridge.sheet.poisson, "1", "Poisson's ratio of the sheet"),
            ("patch_thickness", bridge.patch_thickness, "m", "patches"),
            ("patch_modulus", patch, "", "Young's modulus of the patches"),
        )
    ]
    k, kc = curve.stiffness * width, rough.stiffness * width
    c, cc = curve.end_correction, rough.end_correction
    quantities += [
        Quantity("stiffness", k, "N m/rad", "slope at zero angle", source, around(k, kc)),
        Quantity("rest_angle", 0.0, "rad", "flat as cast", "input of this calibration"),
        Quantity("end_correction", c, "1", "c of L* = g + 2 c h", source, around(c, cc)),
        Quantity("angle_min", -largest, "rad", "first knot, away from the patches", "choice"),
        Quantity("angle_max", largest, "rad", "last knot, towards the patches", "choice"),
        Quantity("resisting_moment", tuple(moments), "N m", "moment that holds the fold angle", source,
                 tuple(around(m, mc) for m, mc in zip(moments, coarse, strict=True))),
    ]  # fmt: skip
    warnings = []
    if bridge.closing_angle < largest:
        warnings.append(
            f"patches on the inside touch at about {math.degrees(bridge.closing_angle):.0f} deg; "
            "contact is not computed"
        )
    return Calibration(f"Crease of an elastomer bridge, patches {patch}", command, tuple(quantities), tuple(warnings))


def _skfem(fineness: int) -> Any:
    """The module scikit-fem, after a check of the mesh's number."""
    try:
        import skfem
    except ImportError:
        raise InputError(
            "finite elements need scikit-fem", field="calibrate fe", allowed="pip install 'origami-sim[fe]'"
        ) from None
    if fineness not in (1, 2, 3, 4):
        raise InputError("no such mesh", field="fineness", value=fineness, allowed="1, 2, 3, 4")
    return skfem


class _Section:
    """Mesh, shape functions and equilibrium of the half section x >= 0; the sheet's top side is y = 0."""

    def __init__(self, bridge: Bridge, fineness: int):
        skfem = _skfem(fineness)
        self.bridge = bridge
        b, edge, end = bridge, bridge.gap / 2, bridge.gap / 2 + bridge.reach
        finest = b.thickness / 8
        x = _graded(0.0, edge, finest, at_start=False, largest=b.thickness / 4)
        y = _graded(-b.thickness, 0.0, finest, at_start=False, largest=b.thickness / 3)
        if b.reach > 0:
            x = np.append(x, _graded(edge, end, finest, at_start=True, largest=b.reach / 8)[1:])
        solid = b.patch is not None and b.reach > 0
        if solid:
            y = np.append(y, _graded(0.0, b.patch_thickness, finest, at_start=True, largest=b.patch_thickness / 4)[1:])
        for _ in range(fineness - 1):
            x, y = (np.sort(np.append(a, (a[1:] + a[:-1]) / 2)) for a in (x, y))
        mesh = skfem.MeshQuad.init_tensor(x, y)
        centre = mesh.p[:, mesh.t].mean(axis=1)
        if solid:
            mesh = mesh.remove_elements(np.flatnonzero((centre[0] < edge) & (centre[1] > 0)))
            centre = mesh.p[:, mesh.t].mean(axis=1)
        self.rigid = b.patch is None and b.reach > 0
        self._shape(mesh, [b.sheet if y < 0 else b.patch for y in centre[1]])
        self._constrain(edge, end)

    def _shape(self, mesh: Any, rubber: Sequence[Any]):
        """Shape functions and materials, by element."""
        skfem = _skfem(1)
        self.mesh = mesh
        self.electric = np.zeros((len(rubber), 1))
        shapes = [skfem.CellBasis(mesh, skfem.ElementQuadS2(), intorder=order) for order in (5, 3)]
        self.nodes = shapes[0].doflocs.T  # (n, 2) [m]
        self.size = 2 * len(self.nodes)
        dofs = shapes[0].element_dofs.T  # (e, 8)
        self.dofs = (2 * dofs[:, :, None] + np.arange(2)).reshape(len(dofs), 16)
        self.rows = np.repeat(self.dofs, 16, axis=1).ravel()
        self.columns = np.tile(self.dofs, (1, 16)).ravel()
        # gradient operators: vec F = (F11, F12, F21, F22) = sum over the 16 dofs, (e, q, 4, 16), and weights (e, q)
        self.operators, self.weights = [], []
        for basis in shapes:
            g = np.stack([np.asarray(basis.basis[i][0].grad) for i in range(8)])  # (8, 2, e, q)
            op = np.zeros((*g.shape[2:], 4, 16))
            for a in range(2):
                for c in range(2):
                    op[:, :, 2 * a + c, a::2] = np.moveaxis(g[:, c], 0, -1)
            self.operators.append(op)
            self.weights.append(basis.dx)
        self.c10 = np.array([r.shear / 2 * (1 - r.share) for r in rubber])[:, None]
        self.c01 = np.array([r.shear / 2 * r.share for r in rubber])[:, None]
        self.bulk = np.array([r.bulk for r in rubber])[:, None]

    def _constrain(self, edge: float, end: float):
        x, y = self.nodes.T
        near = 1e-9 * end
        middle = np.flatnonzero(np.abs(x) < near)
        self.fixed = np.append(2 * middle, 2 * middle[np.argmin(y[middle])] + 1)  # mirror plane; one point held in y
        held = (np.abs(y) < near) & (x > edge - near) if self.rigid else np.abs(x - end) < near
        self.held = np.flatnonzero(held)
        self.free = np.setdiff1d(
            np.arange(self.size), np.concatenate([self.fixed, 2 * self.held, 2 * self.held + 1])
        )  # others follow the end

    def _motion(self, angle: float):
        """Map T of the unknowns to all displacements, offset b, and d(position)/d(angle) of the held nodes as maps.

        The end turns by `angle`. Plane end: position = n d + t s, one d for all, s per node. Rigid patch:
        position = d + R X, d with two components.
        """
        n, t = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        place = self.nodes[self.held]
        k, f = len(self.held), len(self.free)
        rows, columns, values = [self.free], [np.arange(f)], [np.ones(f)]
        for a in range(2):
            own = 2 * self.held + a
            if self.rigid:
                rows.append(own)
                columns.append(np.full(k, f + a))
                values.append(np.ones(k))
            else:
                rows += [own, own]
                columns += [np.full(k, f), f + 1 + np.arange(k)]
                values += [np.full(k, n[a]), np.full(k, t[a])]
        unknowns = f + 2 if self.rigid else f + 1 + k
        to_all = sparse.csr_matrix(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(self.size, unknowns)
        )
        offset = np.zeros((len(self.nodes), 2))
        turned = place @ np.stack([n, t])  # R X = n X1 + t X2
        offset[self.held] = turned - place if self.rigid else -place
        return to_all, offset.ravel()

    def _swing(self, angle: float, q: np.ndarray):
        """(size,) d(position)/d(angle) at fixed unknowns."""
        n, t = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        swing = np.zeros((len(self.nodes), 2))
        f = len(self.free)
        if self.rigid:
            swing[self.held] = self.nodes[self.held] @ np.stack([t, -n])
        else:
            swing[self.held] = t * q[f] - n * q[f + 1 :, None]
        return swing.ravel()

    def _start(self) -> np.ndarray:
        f = len(self.free)
        if self.rigid:
            return np.zeros(f + 2)
        return np.concatenate([np.zeros(f), [self.nodes[self.held[0], 0]], self.nodes[self.held, 1]])

    def pressure(self, u: np.ndarray, change: np.ndarray | None = None) -> np.ndarray:
        """(e, 4) kappa (J - 1) at the volume's points [Pa], linearised about u for the change of u if given."""
        grad = np.einsum("eqkm,em->eqk", self.operators[1], u[self.dofs]) + np.array([1.0, 0, 0, 1])
        jac = grad[..., 0] * grad[..., 3] - grad[..., 1] * grad[..., 2]
        if change is not None:
            turn = np.einsum("eqkm,em->eqk", self.operators[1], change[self.dofs])
            jac = jac + np.einsum("eqk,kl,eql->eq", grad, _COFACTOR, turn)
        return self.bulk * (jac - 1)

    def assemble(self, u: np.ndarray, pressure: np.ndarray | None = None) -> Any:
        """Internal forces (size,) [N/m] and their derivative; None where an element is inverted.

        With a `pressure` (e, 4) the derivative is that of the mixed form, displacement and pressure, with the pressure
        eliminated: the same at equilibrium, but it does not mistake the volume error of an iterate for a stress.
        """
        local = u[self.dofs]  # (e, 16)
        force = np.zeros_like(local)
        stiff = np.zeros((len(local), 16, 16))
        for part, (op, weight) in enumerate(zip(self.operators, self.weights, strict=True)):
            grad = np.einsum("eqkm,em->eqk", op, local) + np.array([1.0, 0, 0, 1])
            jac = grad[..., 0] * grad[..., 3] - grad[..., 1] * grad[..., 2]
            if not (jac > 0).all():
                return None
            cof = np.stack([grad[..., 3], -grad[..., 2], -grad[..., 1], grad[..., 0]], axis=-1)
            if part == 0:  # distortion
                f = (grad**2).sum(axis=-1)
                j3 = jac ** (-2 / 3)
                w_f = self.c10 * j3 + self.c01 * j3**2
                w_j = (-2 / 3) * self.c10 * j3 / jac * (f + 1)
                w_j += self.c01 * j3**2 * ((-4 / 3) * f / jac + (2 / 3) * jac)
                w_fj = (-2 / 3) * self.c10 * j3 / jac - (4 / 3) * self.c01 * j3**2 / jac
                w_jj = (10 / 9) * self.c10 * j3 / jac**2 * (f + 1)
                w_jj += self.c01 * j3**2 * ((28 / 9) * f / jac**2 - 2 / 9)
            else:  # volume
                w_f = w_fj = np.zeros_like(jac)
                w_j, w_jj = self.bulk * (jac - 1), self.bulk * np.ones_like(jac)
            e, points = weight.shape
            flat = op.reshape(e, points * 4, 16)
            stress = (2 * w_f[..., None] * grad + w_j[..., None] * cof) * weight[..., None]
            active = part == 0 and self.electric.any()
            line = grad * np.array([1.0, 0, 1, 0])  # the first column of F, along the layers
            spread = (line**2).sum(axis=-1)
            if active:  # energy -eps E0^2 / 2 |F e1|^2 / J of a field E0 across the layers, at fixed voltage
                pull = -self.electric * weight / 2
                stress += pull[..., None] * (2 * line / jac[..., None] - (spread / jac**2)[..., None] * cof)
            force += np.einsum("ekm,ek->em", flat, stress.reshape(e, points * 4))
            if part == 1 and pressure is not None:
                w_j = pressure
            d = w_jj[..., None, None] * cof[..., :, None] * cof[..., None, :]
            mixed = 2 * w_fj[..., None, None] * grad[..., :, None] * cof[..., None, :]
            d = d + mixed + np.swapaxes(mixed, -1, -2) + 2 * w_f[..., None, None] * np.eye(4)
            d += w_j[..., None, None] * _COFACTOR
            if active:
                cross = line[..., :, None] * cof[..., None, :]
                e2 = 2 * np.diag([1.0, 0, 1, 0]) / jac[..., None, None]
                e2 = e2 - 2 * (cross + np.swapaxes(cross, -1, -2)) / (jac**2)[..., None, None]
                e2 = e2 + (2 * spread / jac**3)[..., None, None] * cof[..., :, None] * cof[..., None, :]
                e2 = e2 - (spread / jac**2)[..., None, None] * _COFACTOR
                d += -self.electric[..., None, None] / 2 * e2
            stiff += np.swapaxes(flat, 1, 2) @ ((d * weight[..., None, None]) @ op).reshape(e, points * 4, 16)
        out = np.bincount(self.dofs.ravel(), force.ravel(), self.size)
        return out, sparse.csr_matrix((stiff.ravel(), (self.rows, self.columns)), shape=(self.size, self.size))

    def slope(self) -> float:
        """dM / d(angle between the ends) of the undeformed section, per width [N/rad]."""
        q = self._start()
        to_all, offset = self._motion(0.0)
        u = to_all @ q + offset
        _, k = self.assemble(u)
        swing = self._swing(0.0, q)
        response = _solve(to_all.T @ k @ to_all, -(to_all.T @ (k @ swing)))
        return float(swing @ (k @ (swing + to_all @ response))) / 2

    def sweep(self, targets: np.ndarray, sign: float, largest_step: float) -> dict[float, float]:
        """Moments per width [N] at rising angles between the ends, from the undeformed state on."""
        q, now, moment, out = self._start(), 0.0, 0.0, {}
        for target in targets:
            step = (target - now) / max(1, math.ceil((target - now) / largest_step - 1e-9))
            while target - now > 1e-12:
                step = min(step, target - now)
                found = self._increment(sign * now / 2, sign * step / 2, q)
                if found is None:
                    step /= 2
                    if step < 1e-3:
                        raise InputError(
                            "no equilibrium of the section found: an element turns inside out",
                            field="angle",
                            value=round(math.degrees(sign * now), 1),
                            allowed="a smaller angle in degrees, or a larger gap",
                        )
                    continue
                q, moment = found
                now += step
            out[float(sign * target)] = moment
        return out

    def _increment(self, angle: float, by: float, q: np.ndarray):
        """Turns the end by `by` from an equilibrium: unknowns and moment per width, or None where Newton fails."""
        to_all, offset = self._motion(angle)
        u = to_all @ q + offset
        force, k = self.assemble(u)
        pressure = self.pressure(u)
        swing = self._swing(angle, q)
        nudge = self._motion(angle + 1e-6)[0] - self._motion(angle - 1e-6)[0]
        right = to_all.T @ (k @ swing) + (nudge.T @ force) / 2e-6
        ahead = -by * _solve(to_all.T @ k @ to_all, right)
        pressure = self.pressure(u, to_all @ ahead + swing * by)
        q = q + ahead
        to_all, offset = self._motion(angle + by)
        for _ in range(ITERATIONS):
            u = to_all @ q + offset
            assembled = self.assemble(u, pressure)
            if assembled is None:
                return None
            force, k = assembled
            residual = to_all.T @ force
            if np.abs(residual).max() < TOLERANCE * np.abs(force).max():
                return q, float(force @ self._swing(angle + by, q))
            change = -_solve(to_all.T @ k @ to_all, residual)
            pressure = self.pressure(u, to_all @ change)
            q = q + change
        return None


def _solve(matrix: Any, right: Any) -> np.ndarray:
    """Solution of a symmetric sparse system; ordered for symmetry, which halves the time of the default."""
    factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
    return factors.solve(right)


_COFACTOR = np.zeros((4, 4))
_COFACTOR[0, 3] = _COFACTOR[3, 0] = 1.0
_COFACTOR[1, 2] = _COFACTOR[2, 1] = -1.0


def _graded(start: float, stop: float, finest: float, *, at_start: bool, largest: float, growth: float = 1.4):
    """Points from start to stop whose spacing grows away from one end, from `finest` to at most `largest`."""
    length, steps = stop - start, []
    size = min(finest, length / 2)
    while sum(steps) < length - 1e-12:
        steps.append(size)
        size = min(size * growth, max(largest, finest))
    scaled = np.cumsum(steps) * (length / sum(steps))
    points = np.concatenate([[0.0], scaled])
    points[-1] = length
    return start + points if at_start else stop - points[::-1]
