"""Sheets as thin shells: elasticity of the material, and the membrane and bending stiffness that follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.effects._plate import BRANCHES, COMPONENTS
from origami_sim.errors import InputError
from origami_sim.model import ALIKE, Model, Parameters, curvature

if TYPE_CHECKING:
    from origami_sim.design.build import Sheet

PLACES = {"11": (0, 0), "22": (1, 1), "12": (0, 1), "66": (2, 2), "16": (0, 2), "26": (1, 2)}
"""Row and column of the components of a stiffness matrix."""


@dataclass(frozen=True)
class Shell:
    """What `Sheet.shell` states.

    Attributes:
        elasticity: [3, 3] plane-stress stiffness [Pa] in the material's axes; None: isotropic, each panel's own.
        membrane: [3, 3] membrane stiffness [N/m], bending: [3, 3] bending stiffness [N m]; None: from the elasticity.
        poisson: Poisson's ratio instead of the material's. axis: the material's first axis in the reference state.
        relaxation: stiffness over the elastic one, and time [s], of each Maxwell branch; the same in every direction.
    """

    elasticity: np.ndarray | None = None
    membrane: np.ndarray | None = None
    bending: np.ndarray | None = None
    poisson: float | None = None
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    relaxation: tuple[tuple[float, float], ...] = ()


def isotropic(modulus: float, poisson: float) -> np.ndarray:
    """Plane-stress stiffness [3, 3] of an isotropic material, in the unit of its modulus.

    Raises:
        InputError: modulus not positive, Poisson's ratio not between -1 and 1.
    """
    if not (np.isfinite(modulus) and modulus > 0):
        raise InputError("a modulus must be positive", field="modulus", value=modulus, allowed="> 0")
    if not -1 < poisson < 1:
        allowed = "above -1, below 1"
        raise InputError("no sheet has this Poisson's ratio", field="poisson", value=poisson, allowed=allowed)
    return modulus / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])


def orthotropic(modulus_1: float, modulus_2: float, poisson_12: float, shear: float) -> np.ndarray:
    """Plane-stress stiffness [3, 3] of a sheet with two directions, such as paper, in the unit of its moduli.

    Args:
        modulus_1, modulus_2: Young's moduli along and across the first axis. shear: shear modulus.
        poisson_12: contraction along 2 over extension along 1 under tension along 1; nu_21 = nu_12 E2 / E1.

    Raises:
        InputError: a modulus that is not positive, or nu_12^2 >= E1 / E2.
    """
    for name, value in (("modulus_1", modulus_1), ("modulus_2", modulus_2), ("shear", shear)):
        if not (np.isfinite(value) and value > 0):
            raise InputError("a modulus must be positive", field=name, value=value, allowed="> 0")
    limit = float(np.sqrt(modulus_1 / modulus_2))
    if not abs(poisson_12) < limit:
        allowed = f"between -{limit:.4g} and {limit:.4g} (square root of modulus_1 / modulus_2)"
        raise InputError("no sheet has this Poisson's ratio", field="poisson_12", value=poisson_12, allowed=allowed)
    compliance = np.array([[1 / modulus_1, -poisson_12 / modulus_1], [-poisson_12 / modulus_1, 1 / modulus_2]])
    out = np.zeros((3, 3))
    out[:2, :2], out[2, 2] = np.linalg.inv(compliance), shear
    return out


def stated(
    elasticity: ArrayLike | None,
    membrane: ArrayLike | None,
    bending: ArrayLike | None,
    poisson: float | None,
    axis: Sequence[float],
    relaxation: Sequence[tuple[float, float]] = (),
) -> Shell:
    """A checked statement. Raises InputError for a matrix that is not positive, an axis without direction, a branch."""
    given = {"elasticity": elasticity, "membrane": membrane, "bending": bending}
    matrices = {n: None if m is None else _positive(n, m) for n, m in given.items()}
    if poisson is not None:
        if elasticity is not None:
            raise InputError("the elasticity has Poisson's ratio in it", field="poisson", value=poisson, allowed="none")
        if not isinstance(poisson, float | int) or not -1 < poisson <= 0.5:
            allowed = "above -1, up to 0.5; elasticity=isotropic(...) of a sheet that is no isotropic solid"
            raise InputError(
                "no isotropic material has this Poisson's ratio", field="poisson", value=poisson, allowed=allowed
            )
    direction = np.asarray(axis, float)
    if direction.shape != (3,) or not np.all(np.isfinite(direction)) or not np.linalg.norm(direction) > 0:
        raise InputError("a material needs a direction", field="axis", value=direction.tolist(), allowed="x, y, z")
    x, y, z = direction.tolist()
    return Shell(**matrices, poisson=poisson, axis=(x, y, z), relaxation=_branches(relaxation))


def _branches(given: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    try:
        pairs = np.asarray(given, float).reshape(-1, 2)
        good = np.shape(given) in ((len(pairs), 2), (0,)) and len(pairs) <= len(BRANCHES)
        good &= bool(np.all(np.isfinite(pairs)) and np.all(pairs > 0))
    except (TypeError, ValueError):
        good, pairs = False, np.zeros((0, 2))
    if not good:
        allowed = f"at most {len(BRANCHES)} pairs of a stiffness over the elastic one and a time [s], both positive"
        raise InputError("no sheet relaxes like this", field="relaxation", value=str(given), allowed=allowed)
    return tuple((share, time) for share, time in pairs.tolist())


def _positive(name: str, given: ArrayLike) -> np.ndarray:
    m = np.asarray(given, float)
    good = m.shape == (3, 3) and bool(np.all(np.isfinite(m))) and np.allclose(m, m.T, rtol=1e-9, atol=0)
    if not good or np.linalg.eigvalsh(m)[0] <= 0:
        allowed = "a symmetric 3 x 3 matrix with positive eigenvalues, for 11, 22 and twice 12"
        raise InputError("no sheet has this stiffness", field=name, value=m.tolist(), allowed=allowed)
    return m


def matrices(sheet: "Sheet", shell: Shell) -> tuple[np.ndarray, np.ndarray]:
    """Membrane [N/m] and bending stiffness [N m] of every triangle, both [T, 3, 3], in its axes.

    They follow from the panels' thickness, material and patch.

    Raises:
        InputError: the material's axis stands upright on a panel.
    """
    axes = curvature.axes_of(sheet.mesh.vertices, sheet.mesh.triangles)
    along, across = (axes[:, k] @ np.array(shell.axis) for k in (0, 1))
    upright = np.hypot(along, across) < 1e-6 * np.linalg.norm(shell.axis)
    turn = np.arctan2(across, along)
    membrane, bending = np.zeros((len(axes), 3, 3)), np.zeros((len(axes), 3, 3))
    by_panel = [_of_panel(sheet, shell, p) for p in range(sheet.pattern.face_count)]
    plain = shell.elasticity is None and shell.membrane is None and shell.bending is None
    for t, panel in enumerate(sheet.mesh.triangle_face.tolist()):
        a, d = by_panel[panel]
        if not plain:
            if upright[t]:
                raise InputError(
                    "the material's axis stands upright on a panel",
                    field=f"axis on panel {panel}",
                    value=list(shell.axis),
                    allowed="a direction with a part in every panel's plane",
                )
            by = _turned(turn[t])
            a, d = by.T @ a @ by, by.T @ d @ by
        membrane[t], bending[t] = a, d
    return membrane, bending


def plates(sheet: "Sheet", shell: Shell, bending: np.ndarray) -> np.ndarray:
    """Bending stiffness of the triangles as `Model.plates` has it; empty if the panels are alike."""
    first, *others = (_of_panel(sheet, shell, p)[1] for p in range(sheet.pattern.face_count))
    if all(np.array_equal(first, d) for d in others):
        return ALIKE
    rows, columns = zip(*(PLACES[c] for c in COMPONENTS), strict=True)
    return bending[:, rows, columns]


def assign(shell: Shell, membrane: np.ndarray, whole: np.ndarray, model: Model, parameters: Parameters) -> None:
    """Sets the stiffness of every triangle, of which borders and creases take a part of the bending away."""
    found = curvature.of(model)
    loosened = zip(whole, found.normal, found.loose, strict=True)
    bending = np.array([curvature.relaxed(d, n[loose]) for d, n, loose in loosened]).reshape(whole.shape)
    laws = [(n, membrane, membrane) for n in ("shell_membrane", "shell_membrane_relaxation")]
    laws += [(n, bending, whole) for n in ("shell_bending", "shell_bending_relaxation")]
    for effect, values, before in laws:
        if effect not in model.effects:
            continue
        # what is left of a relaxed direction by rounding must not be negative, nor all that a lone triangle has
        scale = np.abs(before).max(axis=(1, 2), initial=1e-300)
        for c in COMPONENTS:
            row, column = PLACES[c]
            entries = values[:, row, column]
            entries = np.where(np.abs(entries) < 1e-12 * scale, 0.0, entries)
            parameters.set(effect, f"stiffness_{c}", entries[:, None])
        if effect.endswith("relaxation"):
            for i, (share, time) in enumerate(shell.relaxation, 1):
                parameters.set(effect, f"share_{i}", share).set(effect, f"time_{i}", time)


def _of_panel(sheet: "Sheet", shell: Shell, panel: int) -> tuple[np.ndarray, np.ndarray]:
    """Membrane [N/m] and bending stiffness [N m] of a panel, in the material's axes."""
    thickness, modulus = float(sheet.thickness[panel]), float(sheet.modulus[panel])
    nu = float(sheet.poisson[panel]) if shell.poisson is None else shell.poisson
    patch = sheet.patch_of(panel)
    if shell.elasticity is not None:
        a, d = shell.elasticity * thickness, shell.elasticity * thickness**3 / 12
        if patch:
            raise InputError(
                "a patch is bonded to an isotropic sheet",
                field=f"elasticity of panel {panel}",
                allowed="membrane= and bending= of the layers together",
            )
    else:
        unit = isotropic(1.0, nu)
        a = modulus * thickness * unit
        if patch:
            m = patch["material"]
            a = a + patch["thickness"] * isotropic(m.modulus, m.poisson)
        # a stated rigidity is that of wide strips; one from the material was found with the material's Poisson's ratio
        fixed = patch or sheet.has_rigidity(panel)
        d = sheet.rigidity(panel) * (1 - (nu if fixed else float(sheet.poisson[panel])) ** 2) * unit
    a = a if shell.membrane is None else shell.membrane
    return sheet.membrane * a, d if shell.bending is None else shell.bending


def _turned(angle: float) -> np.ndarray:
    """Strains [3, 3] (11, 22 and twice 12) in axes that are turned by `angle`, from those in the old ones."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
