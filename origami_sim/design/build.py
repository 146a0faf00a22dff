"""From a crease pattern to a Model: thickness, materials, creases, magnets, feet and supports."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.design.creases import Creases
from origami_sim.design.dielectric import Electrodes
from origami_sim.design.grips import Grips
from origami_sim.design.ground import Contact, Ground, Grounds
from origami_sim.design.masses import LEVEL, Stated, positive
from origami_sim.design.shell import Shell, assign, matrices, plates, stated
from origami_sim.design.statements import statement
from origami_sim.design.thick import Hinge, Thick
from origami_sim.design.touch import Touch, refuse_overlap
from origami_sim.effects import PAIRS
from origami_sim.errors import InputError, named_arguments, nearest
from origami_sim.model import ALIKE, Model, Parameters, dihedral_angles
from origami_sim.model.bodies import rigid
from origami_sim.pattern import Pattern, triangulate
from origami_sim.pattern.intersections import overlapping_pairs
from origami_sim.pattern.triangulate import METHODS
from origami_sim.physics.materials import MATERIALS, MEMBRANE_POISSON, demagnetising_factors, layered_rigidity, material
from origami_sim.quantities import converted


class Sheet(Grounds, Electrodes, Thick, Creases, Grips):
    """Builder: collects what a designer states about a sheet and turns it into a Model and Parameters.

    Args:
        pattern: crease pattern; its own thickness, materials, stiffness and rest angles are used where given.
        thickness: of all panels [m]. material: name in `MATERIALS`. modulus, density: override it [Pa], [kg/m^3].
        triangulation: "auto", "center" (a node in the middle of each polygon of four or more corners, if all of it is
            seen from there; gives rectangles and parallelograms exactly the mass, centre of mass and inertia of the
            panel, with a patch the inertia to some per cent) or "diagonal" (fewer nodes; the masses of a panel sit at
            its corners, which is right for finely divided sheets). "auto" is "center" for panels and "diagonal" for
            cells of one, which flat lines join. Triangles have their mass at their corners: exact mass and centre, too
            large an inertia.
        membrane: factor on the membrane stiffness; below 1 it buys a longer time step (keep strains under a percent).
        membrane_damping: dashpots in the bars, as a ratio of critical.
        panels: "elastic" (bars and bending lines) or "rigid" (bodies on hinges, in reduced coordinates: a step that
            creases set, not the stiffness of panels).
        overlapping: accept panels that overlap or pass through each other at the start.

    Raises:
        InputError: unknown material, thickness or modulus not positive, faces that cannot be triangulated, panels that
            overlap or pass through each other.
    """

    @named_arguments
    def __init__(
        self,
        pattern: Pattern,
        *,
        thickness: float | str,
        material: str = "pdms",
        modulus: float | str | None = None,
        density: float | str | None = None,
        triangulation: str = "auto",
        membrane: float = 1.0,
        membrane_damping: float = 0.02,
        panels: str = "elastic",
        overlapping: bool = False,
    ):
        if panels not in ("elastic", "rigid"):
            raise InputError("no such panels", field="panels", value=panels, allowed="elastic, rigid")
        if triangulation not in METHODS:
            allowed = ", ".join(METHODS) + nearest(triangulation, METHODS)
            raise InputError("unknown triangulation", field="triangulation", value=triangulation, allowed=allowed)
        self.pattern, self.panels = pattern, panels
        self.statements = []
        self.made = {
            "thickness": thickness, "material": material, "modulus": modulus, "density": density, "panels": panels,
            "triangulation": triangulation, "membrane": membrane, "membrane_damping": membrane_damping,
            "overlapping": overlapping or None,
        }  # fmt: skip
        thickness = converted(thickness, "m", "thickness")
        modulus, density = converted(modulus, "Pa", "modulus"), converted(density, "kg/m^3", "density")
        self.mesh = triangulate(pattern, triangulation)
        if not overlapping:
            self._refuse_overlap()
        faces = pattern.face_count
        self._names = [m or material for m in pattern.materials]
        chosen = [_material(n, i) for i, n in enumerate(self._names)]
        self.thickness = np.where(np.isnan(pattern.thickness), thickness, pattern.thickness)
        self.modulus = np.array([m.modulus if modulus is None else modulus for m in chosen])
        self.density = np.array([m.density if density is None else density for m in chosen])
        self.poisson = np.array([m.poisson for m in chosen])
        for name, value in (
            ("thickness", self.thickness),
            ("modulus", self.modulus),
            ("density", self.density),
            ("membrane", np.array([membrane])),
        ):
            if not np.all(positive(value)):
                raise InputError(
                    "a panel property must be positive", field=name, value=_first_bad(value), allowed="> 0"
                )
        if not 0 <= membrane_damping < np.inf:
            raise InputError(
                "a damping ratio cannot be negative", field="membrane_damping", value=membrane_damping, allowed=">= 0"
            )
        self.membrane, self.membrane_damping = membrane, membrane_damping
        self._rigidity, self._levels = np.full(faces, np.nan), np.zeros(faces)
        self._hinges: dict[int, Hinge] = {}
        self._patches: list[dict] = [{} for _ in range(faces)]
        self._stated: dict[int, Stated] = {}
        self._points: list[tuple[int, float, np.ndarray]] = []
        self._gravity: tuple[float, float, float] | None = None
        self._extra_mass = np.zeros(len(self.mesh.vertices))
        self._free = np.ones((len(self.mesh.vertices), 3))
        self._labels: dict[str, tuple[str, ...]] = {}
        self._grips: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._contacts: list[Contact] = []
        self._ground: Ground | None = None
        self._between: Touch | None = None
        self._settings: list[tuple[str, str, object, object]] = []
        self._effects = ["bars"]
        self._shell: Shell | None = None
        self._viscous_creases: tuple[float, float] = (0.0, 0.0)
        a, b, c = (self.mesh.vertices[self.mesh.triangles[:, k]] for k in range(3))
        self._area_vector = 0.5 * np.cross(b - a, c - a)
        self.area = np.linalg.norm(self._area_vector, axis=1)
        self._crease_stiffness = pattern.stiffness[self.mesh.crease_edge]
        self._rest = np.where(
            np.isnan(pattern.rest_angles[self.mesh.crease_edge]),
            dihedral_angles(self.mesh.vertices, self.mesh.creases),
            pattern.rest_angles[self.mesh.crease_edge],
        )
        self._rest_stated = ~np.isnan(pattern.rest_angles[self.mesh.crease_edge])
        self._electrodes = np.zeros(len(self.mesh.creases) + len(self.mesh.bends), np.int32)

    def _refuse_overlap(self) -> None:
        found = overlapping_pairs(self.mesh.vertices, self.mesh.triangles)
        if len(found):
            one, other = sorted(self.mesh.triangle_face[found[0]].tolist())
            raise InputError(
                f"panel {one} and panel {other} overlap at the start" if one != other else f"panel {one} is in itself",
                field="pattern",
                allowed="panels that lie beside each other",
            )

    # what a designer states ------------------------------------------------------------------------------------

    @statement(moment="N m", viscosity="N m s/rad")
    def yields(
        self,
        creases=None,
        *,
        moment: ArrayLike | None = None,
        hardening: ArrayLike = 0.0,
        isotropic: ArrayLike = 0.0,
        viscosity: ArrayLike = 0.0,
        panels=None,
    ) -> "Sheet":
        """Creases that yield and keep part of their fold: of stiffness K up to a moment, then of `hardening` K.

        Released from the angle a they stay at a - M / K, M = moment + hardening (K a - moment), as long as the way
        back does not yield. Formula and sources: effect `crease_yield`.

        Args:
            creases: indices (default: all). moment: [N m] of the whole crease at which it yields first (default: at
                which the sheet beside it is plastic through and through, sigma w h^2 / 4, if its material yields).
            hardening: share of the stiffness that is left while it yields, 0 <= hardening < 1.
            isotropic: share of the hardening by which the moment grows on both sides; the rest moves them along.
            viscosity: excess moment per rate of flow [N m s/rad]; 0: it yields at once.

        Raises:
            InputError: panels, which do not yield; no such crease; a material without yield stress; a value out of its
                bounds.
        """
        if panels is not None:
            raise InputError(
                "panels stay elastic, only creases yield",
                field="panels",
                value=panels,
                allowed="a crease in the pattern along every line where a panel is bent beyond its yield",
            )
        index = self._index("crease", creases)
        share = np.asarray(hardening, float)
        if not np.all((share >= 0) & (share < 1)):
            raise InputError("no such hardening", field="hardening", value=hardening, allowed="0 <= hardening < 1")
        return self.set(
            "crease_yield",
            index,
            yield_moment=self._plastic_moments(index) if moment is None else moment,
            softening=1.0 - share,
            isotropic=isotropic,
            viscosity=viscosity,
        )

    @statement(elasticity="Pa", membrane="N/m", bending="N m", poisson="1")
    def shell(
        self,
        *,
        poisson: float | None = None,
        elasticity: ArrayLike | None = None,
        membrane: ArrayLike | None = None,
        bending: ArrayLike | None = None,
        axis: Sequence[float] = (1.0, 0.0, 0.0),
        relaxation: Sequence[tuple[float, float]] = (),
    ) -> "Sheet":
        """Makes the panels thin shells, which converge to plates and membranes of the material on any mesh.

        They take the place of bars and bending lines. Without further statements every panel is isotropic, with its
        thickness, modulus, Poisson's ratio, rigidity and patch.

        Args:
            poisson: Poisson's ratio instead of the material's, above -1, up to 0.5.
            elasticity: [3, 3] plane-stress stiffness [Pa], such as `orthotropic(...)`, for strains 11, 22 and twice 12.
            membrane, bending: [3, 3] stiffness of the whole thickness [N/m], [N m] instead of what follows from it.
            axis: the material's first axis in the reference state.
            relaxation: up to three Maxwell branches beside the elasticity, (stiffness over the elastic one, time [s]).

        Raises:
            InputError: rigid panels, a Poisson's ratio that no isotropic material has, a matrix that is not symmetric
                and positive, an axis without direction, a branch without stiffness or time.
        """
        if self.panels == "rigid":
            raise InputError("rigid panels neither bend nor stretch", field="panels", value="rigid", allowed="elastic")
        self._shell = stated(elasticity, membrane, bending, poisson, axis, relaxation)
        self._effects = [e for e in self._effects if e != "bars"]
        losses = ("shell_membrane_relaxation", "shell_bending_relaxation") if relaxation else ()
        return self.on("shell_membrane", "shell_bending", *losses)

    @statement(thickness="m", size="m", centre="m", remanence="T", density="kg/m^3")
    def patch(
        self,
        panel: int,
        *,
        thickness: float,
        poling: ArrayLike = (0, 0, 0),
        size: ArrayLike | None = None,
        centre: ArrayLike | None = None,
        material: str = "mae",
        remanence: float | None = None,
        density: float | None = None,
        side: int = 1,
        overhang: bool = False,
    ) -> "Sheet":
        """Bonds a rectangular patch, magnetised if its material is, on one side of a panel.

        Args:
            panel: face index. thickness: of the patch [m].
            poling: direction of the remanence in the reference state (any length); zero for no magnet.
            size: extent along x and y in the reference state [m], up to the panel's bounding box (the default).
            centre: its middle in the reference state [m] (default: the panel's centroid).
            remanence: [T], default the material's. side: +1 on the top, -1 below. overhang: whether it may be larger.
        """
        m = _material(material, panel)
        nodes = self._nodes_of(panel)
        box = np.ptp(self.mesh.vertices[nodes], axis=0)[:2]
        extent = np.asarray(box if size is None else size, float)
        density = m.density if density is None else density
        if side not in (1, -1):
            raise InputError("a patch lies on one side", field="side", value=side, allowed="1 (top), -1 (below)")
        if not np.all(positive([thickness, *extent, density])):
            raise InputError(
                "a patch needs positive dimensions and density",
                field=f"patch on panel {panel}",
                value=[float(v) for v in (thickness, *extent, density)],
                allowed="> 0",
            )
        if not overhang and np.any(extent > box * (1 + LEVEL)):
            raise InputError(
                "a patch is no larger than its panel",
                field=f"size of the patch on panel {panel}",
                value=extent.tolist(),
                allowed=f"up to ({box[0]:.6g}, {box[1]:.6g}) m, or overhang=True",
            )
        self._patches[panel] = {
            "thickness": float(thickness),
            "size": extent,
            "material": m,
            "side": side,
            "centre": np.asarray(centre, float) if centre is not None else self._centroid(panel),
            "density": density,
        }
        direction = np.asarray(poling, float)
        if np.linalg.norm(direction) > 0:
            self.magnetise(
                panel,
                remanence=m.remanence if remanence is None else remanence,
                volume=thickness * extent[0] * extent[1],
                poling=direction,
            )
        return self

    @statement(remanence="T", volume="m^3")
    def magnetise(self, panel: int, *, remanence: float, volume: float, poling: ArrayLike) -> "Sheet":
        """Remanence [T] of a volume of magnet [m^3] spread over a panel, along `poling` in the reference state."""
        d = np.asarray(poling, float)
        if d.shape != (3,) or not np.linalg.norm(d) > 0 or not np.all(np.isfinite(d)):
            raise InputError("a magnet needs a poling direction", field="poling", value=d.tolist(), allowed="x, y, z")
        d = d / np.linalg.norm(d)
        for t in self._triangles_of(panel):
            normal = self._area_vector[t] / self.area[t]
            a, b = self._edge_weights(t, d)
            scale = np.linalg.norm(d - normal * (d @ normal)) or 1.0
            self.set(
                "magnetic_torque",
                [t],
                remanence=remanence,
                volume=volume * self._share(panel, t),
                poling_1=a / scale,
                poling_2=b / scale,
                poling_n=float(np.clip(d @ normal, -1, 1)),
            )
        return self

    @statement(size="m", saturation="T")
    def soften(
        self,
        panel: int,
        *,
        susceptibility: float,
        size: ArrayLike,
        axis: ArrayLike = (1, 0, 0),
        saturation: float | None = None,
    ) -> "Sheet":
        """A patch that the field magnetises (effect `soft_magnet`), such as iron, or the soft filler of an elastomer.

        Only its magnetism is stated here: its mass and stiffness are those of `patch` or `mass`.

        Args:
            susceptibility: of its material at small fields, the relative permeability less one.
            size: [3] length along `axis`, width across it and thickness [m]; volume and demagnetising factors follow.
            axis: along its length in the reference state. saturation: polarisation [T] (default: iron, 2.15 T).
        """
        edges = np.asarray(size, float)
        if edges.shape != (3,):
            raise InputError("a patch has three edges", field="size", value=edges.tolist(), allowed="3 lengths")
        first, across, _ = demagnetising_factors(*edges.tolist())
        d = np.asarray(axis, float)
        for t in self._triangles_of(panel):
            normal = self._area_vector[t] / self.area[t]
            flat = d - normal * (d @ normal)
            if not np.linalg.norm(flat) > 1e-6 * np.linalg.norm(d):
                raise InputError("the axis of a patch lies in its panel", field="axis", value=d.tolist())
            a, b = self._edge_weights(t, flat / np.linalg.norm(flat))
            given = {} if saturation is None else {"saturation": saturation}
            self.set(
                "soft_magnet",
                [t],
                susceptibility=susceptibility,
                volume=float(edges.prod()) * self._share(panel, t),
                poling_1=a,
                poling_2=b,
                demagnetising_1=first,
                demagnetising_2=across,
                **given,
            )
        return self

    @statement()
    def name(self, family: str, labels: Sequence[str]) -> "Sheet":
        """Labels of all entities of a family ("panel", "crease", "node"), for reports and attachments.

        Contact points are labelled by `contact`.
        """
        counts = self._counts()
        if family not in counts:
            raise InputError("there is no such family", field="family", value=family, allowed=", ".join(counts))
        if len(labels) != counts[family]:
            raise InputError("wrong number of labels", field=family, value=len(labels), allowed=str(counts[family]))
        self._labels[family] = tuple(labels)
        return self

    # the model --------------------------------------------------------------------------------------------------

    def build(self) -> tuple[Model, Parameters]:
        """The model and its parameters."""
        mesh = self.mesh
        missing = np.flatnonzero(np.isnan(self._crease_stiffness))
        if len(missing) and not {"crease", "crease_yield"}.isdisjoint(self._effects):
            raise InputError(
                "a crease has no stiffness", field=f"crease {missing[0]}", allowed="Sheet.crease(stiffness=...)"
            )
        if len(mesh.bends) and self._shell is None:
            self._switch_on("panel_bending")
        if self.membrane_damping > 0:
            self._switch_on("bar_viscosity")
        if self._gravity is not None and self._off_plane():
            gx, gy, gz = self._gravity
            self._switch_on("eccentric_weight")
            self._settings[:0] = [
                ("eccentric_weight", f"gravity_{a}", g, None) for a, g in zip("xyz", (gx, gy, gz), strict=True)
            ]
        contacts, shares = self._grounded()
        tri = np.array([c.triangle for c in contacts], int)
        carriers = [c.pad or mesh.triangles[c.triangle] for c in contacts]
        elastic = None if self._shell is None else matrices(self, self._shell)
        named = {"grip": tuple(self._grips)} if self._grips else {}
        model = Model(
            position=mesh.vertices,
            free=self._free,
            bars=mesh.bars.astype(np.int32),
            creases=mesh.creases.reshape(-1, 4).astype(np.int32),
            bends=mesh.bends.reshape(-1, 4).astype(np.int32),
            triangles=mesh.triangles.astype(np.int32),
            triangle_panel=mesh.triangle_face.astype(np.int32),
            contacts=np.array(carriers, np.int32).reshape(-1, 3),
            contact_weights=np.array([c.weights for c in contacts]).reshape(-1, 3),
            contact_offsets=np.array([c.offset for c in contacts], float),
            contact_axes=np.array([c.axis for c in contacts]).reshape(-1, 3),
            electrodes=self._electrodes,
            effects=tuple(self._effects),
            names={**self._labels, "contact": tuple(c.name for c in contacts), **named},
            plates=ALIKE if elastic is None or self._shell is None else plates(self, self._shell, elastic[1]),
            **self._gripped(),
        )
        p = Parameters(model)
        mass = self._node_masses()
        p.set("inertia", "mass", mass)
        for name, values in self._bodies().items():
            p.set("body", name, values)
        lengths = np.linalg.norm(mesh.vertices[mesh.bars[:, 1]] - mesh.vertices[mesh.bars[:, 0]], axis=1)
        stiffness = self.membrane * self._bar_sections() / lengths
        if "bars" in self._effects:
            p.set("bars", "rest_length", lengths).set("bars", "stiffness", stiffness)
        if elastic is not None and self._shell is not None:
            assign(self._shell, *elastic, model, p)
        if self.membrane_damping > 0:
            reduced = 1.0 / (1.0 / mass[mesh.bars]).sum(1)
            p.set("bar_viscosity", "viscosity", 2 * self.membrane_damping * np.sqrt(stiffness * reduced))
        if "crease" in self._effects:
            p.set("crease", "stiffness", self._crease_stiffness).set("crease", "rest_angle", self._rest)
        if "crease_yield" in self._effects:
            p.set("crease_yield", "stiffness", self._crease_stiffness).set("crease_yield", "rest_angle", self._rest)
        if any(self._viscous_creases):
            p.set("crease_viscosity", "viscosity", self._crease_viscosity(mass))
        if len(mesh.bends) and "panel_bending" in self._effects:
            p.set("panel_bending", "stiffness", self._bend_stiffness())
            p.set("panel_bending", "rest_angle", dihedral_angles(mesh.vertices, mesh.bends))
        if "eccentric_weight" in self._effects:
            for t, (weight, offset) in self._off_plane().items():
                p.set("eccentric_weight", "mass", weight, [t]).set("eccentric_weight", "offset", offset, [t])
        model = self._padded(self._stand(model, p, shares, self._levels[mesh.triangle_face[tri]]))
        self._touching(p)
        self._stop(p)
        for effect, name, value, entities in self._settings:
            p.set(effect, name, value, entities)
        self._share_magnets(p)
        if "touch" in self._effects:
            refuse_overlap(model, p)
        return self._thick(*(rigid(model, p) if self.panels == "rigid" else (model, p)))

    def _share_magnets(self, p: Parameters) -> None:
        """Gives effects of remanent panels that were only switched on the magnets of `magnetic_torque`."""
        if "magnetic_torque" not in self._effects:
            return
        own = {effect for effect, *_ in self._settings}
        magnet = p.of("magnetic_torque")
        for name in (e for e in self._effects if e not in own and "remanence" in p.of(e)):
            for key in magnet.keys() & p.of(name).keys():
                p.set(name, key, magnet[key])

    def _family_counts(self) -> dict[str, int]:
        mesh = self.mesh
        triangles = dict.fromkeys(("triangle", "membrane", "plate", *PAIRS), len(mesh.triangles))
        hinges = {"bar": len(mesh.bars), "crease": len(mesh.creases), "bend": len(mesh.bends)}
        return {"node": len(mesh.vertices), **triangles, **hinges}

    # mechanics ----------------------------------------------------------------------------------------------------

    def _bar_sections(self) -> np.ndarray:
        """E A of each bar [N]: every triangle gives its edges A = 2 S t / ((1 - nu) sum L)."""
        mesh = self.mesh
        index = {tuple(b): i for i, b in enumerate(mesh.bars.tolist())}
        out = np.zeros(len(mesh.bars))
        for t, nodes in enumerate(mesh.triangles.tolist()):
            panel = mesh.triangle_face[t]
            patch = self._patches[panel]
            membrane = self.modulus[panel] * self.thickness[panel]
            if patch:
                membrane += patch["material"].modulus * patch["thickness"]
            edges = [tuple(sorted((nodes[k], nodes[(k + 1) % 3]))) for k in range(3)]
            perimeter = sum(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]) for a, b in edges)
            for e in edges:
                out[index[e]] += 2 * self.area[t] * membrane / ((1 - MEMBRANE_POISSON) * perimeter)
        return out

    def rigidity(self, panel: int) -> float:
        """Bending rigidity per width of a panel with its patch [N m]."""
        if not np.isnan(self._rigidity[panel]):
            return float(self._rigidity[panel])
        layers = [(self.thickness[panel], self.modulus[panel] / (1 - self.poisson[panel] ** 2))]
        patch = self._patches[panel]
        if patch:
            layers.append((patch["thickness"], patch["material"].plane_modulus))
        return layered_rigidity(layers)

    def has_rigidity(self, panel: int) -> bool:
        """Whether the bending rigidity of a panel was stated by `panel`."""
        return not np.isnan(self._rigidity[panel])

    def patch_of(self, panel: int) -> dict:
        """The patch on a panel; empty if there is none."""
        return self._patches[panel]

    def _bend_stiffness(self) -> np.ndarray:
        mesh = self.mesh
        by_edge: dict[tuple[int, int], list[int]] = {}
        for t, nodes in enumerate(mesh.triangles.tolist()):
            for k in range(3):
                a, b = sorted((nodes[k], nodes[(k + 1) % 3]))
                by_edge.setdefault((a, b), []).append(t)
        out = np.zeros(len(mesh.bends))
        for q, (_, j, k, _) in enumerate(mesh.bends.tolist()):
            pair = by_edge[min(j, k), max(j, k)]
            span = np.linalg.norm(mesh.vertices[k] - mesh.vertices[j])
            out[q] = self.rigidity(int(mesh.bend_face[q])) * span**2 / self.area[pair].sum()
        return out

    def _plastic_moments(self, creases: np.ndarray) -> np.ndarray:
        """Moments [N m] at which the thinner panel beside each crease is plastic through and through."""
        mesh, out = self.mesh, np.zeros(len(creases))
        for n, c in enumerate(creases):
            thin = min(sorted(self._beside[c].tolist()), key=lambda p: self.thickness[p])
            stress = material(self._names[thin]).yield_stress
            if not stress > 0:
                allowed = ", ".join(m.name for m in MATERIALS.values() if m.yield_stress > 0)
                raise InputError(
                    "the material has no yield stress: state the moment",
                    field="material",
                    value=self._names[thin],
                    allowed=f"moment=..., or {allowed}",
                )
            width = np.linalg.norm(np.diff(mesh.vertices[mesh.creases[c, 1:3]], axis=0))
            out[n] = stress * width * self.thickness[thin] ** 2 / 4
        return out

    def _crease_viscosity(self, mass: np.ndarray) -> np.ndarray:
        loss_time, ratio = self._viscous_creases
        if not ratio:
            return loss_time * self._crease_stiffness
        x, out = self.mesh.vertices, np.zeros(len(self.mesh.creases))
        for c, (i, j, k, m) in enumerate(self.mesh.creases.tolist()):
            along = (x[k] - x[j]) / np.linalg.norm(x[k] - x[j])
            arms = [mass[n] * np.linalg.norm(np.cross(x[n] - x[j], along)) ** 2 for n in (i, m)]
            out[c] = 2 * ratio * np.sqrt(self._crease_stiffness[c] * min(arms))
        return out


def _first_bad(value: np.ndarray) -> float:
    return float(value[~positive(value)][0])


def _material(name: str, panel: int):
    if name not in MATERIALS:
        said = f"unknown material{nearest(name, MATERIALS)}"
        raise InputError(said, field=f"panel {panel}", value=name, allowed=", ".join(MATERIALS))
    return material(name)
