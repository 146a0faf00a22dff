"""Crawler: two magnetic patches on a tapered silicone strip walk in an oscillating vertical field.

    python -m origami_sim.scenes.crawler

Forward (+x) is towards the small patch; each end carries a foot pad below it. The strip is a chain of narrow cells
that is guided to its plane, or (`guided=false`) a free shell of triangles.
"""

from dataclasses import dataclass

import numpy as np

from origami_sim.design.beams import as_beam, crossed
from origami_sim.design.build import Sheet
from origami_sim.design.shell import isotropic
from origami_sim.device.scene import Outcome, Progress, Settings, motion_of
from origami_sim.drive import Drive, sine
from origami_sim.model import Model, Parameters
from origami_sim.observation.gait import stride_table
from origami_sim.pattern import Pattern, strip
from origami_sim.pattern import sheet as uncreased_sheet
from origami_sim.physics.materials import layered_rigidity, material
from origami_sim.solve.motion.dynamics import Trajectory

CALIBRATION = "crawler"
REGIONS = ("middle", "big end", "small end")
"""Names of cells and of the lines between them, by owner."""

UNDERSIDE = 3
"""Points of each triangle of a free strip by which the ground under it is integrated."""


def stations(s: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the cell borders along x [m], and per cell 1 in the big patch, 2 in the small one, 0 elsewhere."""
    lengths = (s.overhang, s.big_length, s.span, s.small_length, s.overhang)
    x, owner = [0.0], []
    for length, patch in zip(lengths, (0, 1, 0, 2, 0), strict=True):
        n = max(1, round(length / s.cell))
        x += list(x[-1] + length * (np.arange(n) + 1) / n)
        owner += [patch] * n
    return np.array(x), np.array(owner)


@dataclass(frozen=True)
class Strip:
    """The device by stations along x and the cells between them; plane strain, patches spread over the width.

    Attributes:
        x, width: of stations [m]. owner, length, middle: of cells, the last their width [m].
        bare, rigidity: of sheet, of sheet and patch, by cell and whole width [N m^2].
        axial: E A by cell [N]. patch: its width by cell [m].
        hinge, lossy: of stations within the strip, what half a cell on either side bends [N m/rad], and loses
            [N m s/rad].
        beyond: turn per moment of the sheet that bends on under a patch, by cell [rad/(N m)].
    """

    x: np.ndarray
    width: np.ndarray
    owner: np.ndarray
    length: np.ndarray
    middle: np.ndarray
    patch: np.ndarray
    bare: np.ndarray
    rigidity: np.ndarray
    axial: np.ndarray
    hinge: np.ndarray
    lossy: np.ndarray
    beyond: np.ndarray

    @classmethod
    def of(cls, s: Settings) -> "Strip":
        x, owner = stations(s)
        width = s.rear_width + (s.front_width - s.rear_width) * x / x[-1]
        if s.heading < 0:  # turned by 180 degrees about z
            x, owner, width = x[-1] - x[::-1], owner[::-1], width[::-1]
        length, middle = np.diff(x), 0.5 * (width[1:] + width[:-1])
        patch = np.array([0.0, s.big_width, s.small_width])[owner]
        # bending: the sheet over its width, the bonded sandwich over the patch's width
        plane = s.modulus / (1 - s.poisson**2)
        mae = material("mae")
        bare = plane * s.thickness**3 / 12
        rigidity = bare * np.maximum(middle - patch, 0) + _bonded(s) * patch
        half = 0.5 * length / rigidity
        border = (patch[1:] > 0) != (patch[:-1] > 0)  # there the sheet bends on for c h under the patch
        ends = np.where(border, s.end_correction * s.thickness / (bare * width[1:-1]), 0.0)
        hinge = 1.0 / (half[:-1] + half[1:] + ends)
        # the sheet alone loses energy: each half cell at the rate at which its share of the hinge's angle bends the
        # sheet; of a cell, not of a hinge, so that the patches' borders lose on any mesh what the sheet there does
        share = half**2 * bare * middle / (0.5 * length)
        lossy = s.loss_time * (hinge if s.patch_loss else hinge**2 * (share[:-1] + share[1:] + ends))
        axial = s.membrane * (s.modulus * s.thickness * middle + mae.modulus * s.patch_thickness * patch)
        beyond = (np.append(ends, 0.0) + np.append(0.0, ends)) * (patch > 0)
        return cls(x, width, owner, length, middle, patch, bare * middle, rigidity, axial, hinge, lossy, beyond)

    @property
    def borders(self) -> np.ndarray:
        """Stations at which patches begin and end."""
        return np.flatnonzero(np.diff(self.owner)) + 1

    def across(self, s: Settings) -> int:
        """Cells side by side: one of a guided strip; as many of a free one on its left as on its right."""
        return 1 if s.guided else 2 * max(1, round(float(self.middle.mean()) / s.cell / 2))


def triangles(d: Strip, across: int) -> Pattern:
    """A sheet without creases, and with diagonals that are each other's mirror image left and right.

    Vertex (across + 1) s + j lies at station s; the triangles of a cell follow each other.
    """
    row = across + 1
    vertices = [(x, w * (j / across - 0.5), 0.0) for x, w in zip(d.x, d.width, strict=True) for j in range(row)]
    faces = []
    for k in range(len(d.length)):
        for j in range(across):
            a, b = k * row + j, (k + 1) * row + j
            left = 2 * j < across
            faces += [(a, b, b + 1), (a, b + 1, a + 1)] if left else [(a, b, a + 1), (b, b + 1, a + 1)]
    return uncreased_sheet(vertices, faces)


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    d = Strip.of(s)
    across = d.across(s)
    sheet = Sheet(
        strip(list(d.length), list(d.width)) if s.guided else triangles(d, across),
        thickness=s.thickness,
        modulus=s.modulus,
        density=s.density,
        triangulation="diagonal",
        membrane=s.membrane,
        membrane_damping=s.membrane_damping,
    )
    panels = sheet.pattern.face_count // len(d.length)  # of a cell
    cell = np.arange(sheet.pattern.face_count) // panels
    station = sheet.mesh.creases[:, 1] // (across + 1)
    if s.guided:
        sheet.crease(stiffness=d.hinge[station - 1])
        sheet.fix(nodes=range(2 * len(d.x)), axes="y").set("crease_viscosity", viscosity=d.lossy[station - 1])
        # cells do not twist: a cell's diagonal would couple twist to bending, which a sheet does not, and soften bare
        # cells
        sheet.panel(cell, rigidity=_bonded(s) * s.twist)
    else:
        _as_shell(s, d, sheet, cell)
    for number, size, sign, factor in (
        (1, s.big_width, s.polarity, s.big_moment),
        (2, s.small_width, -s.polarity, 1.0),
    ):
        for panel in np.flatnonzero(d.owner[cell] == number):
            sheet.patch(int(panel), thickness=s.patch_thickness, size=(d.length[cell[panel]], size / panels),
                        poling=(s.heading * sign, 0, 0), remanence=s.remanence * factor,
                        density=s.patch_density, overhang=True)  # fmt: skip

    feet, foot = (_corner_feet if s.guided else _pads)(s, d, sheet)
    belly, under = (_borders if s.guided else _underside)(s, d, sheet, cell)
    for effect in ("ground", "friction"):
        sheet.set(effect, feet, stiffness=foot, damping=foot * s.ground_time)
        sheet.set(effect, belly, stiffness=under, damping=under * s.ground_time)
    sheet.set("coulomb", friction_coefficient=s.belly_friction)
    sheet.set("coulomb", feet, friction_coefficient=s.foot_friction)
    sheet.set("directional_friction", feet, backward_excess=s.foot_friction_back - s.foot_friction)
    sheet.set("adhesion", feet, pull_off=s.adhesion * foot / s.foot_stiffness)
    patched, region = np.flatnonzero(d.owner), d.owner.copy()  # an end is a patch with its overhang
    region[: patched[0]], region[patched[-1] :] = d.owner[patched[0]], d.owner[patched[-1]]
    seam = np.where(region[1:] == region[:-1], region[1:], 0)  # what joins two regions bends as bare sheet
    sheet.name("panel", [REGIONS[r] for r in region[cell]])
    sheet.name("crease", [REGIONS[r] for r in seam[station - 1]])
    sheet.set("mass_damping", decay_rate=s.decay_rate)
    sheet.gravity((0, 0, -s.gravity))
    model, parameters = sheet.build()
    if s.guided:
        as_beam(model, parameters, d.axial)
        model, parameters = crossed(model, parameters)
    # a planar chain carries its masses on its line; what is lost in stretching is left to the dashpots of the bars
    without = ["shell_membrane_relaxation", *(() if s.patch_height else ("eccentric_weight",))]
    model = model.with_effects(without=tuple(e for e in without if e in model.effects))
    parameters = parameters.for_model(model)
    model.position[:, 2] = s.thickness / 2 + s.foot_height
    return model, parameters, Drive(field=(0, 0, sine(s.field, s.frequency)))


def _bonded(s: Settings) -> float:
    """Rigidity of sheet and patch per width [N m]."""
    plane = s.modulus / (1 - s.poisson**2)
    return layered_rigidity([(s.thickness, plane), (s.patch_thickness, material("mae").plane_modulus)])


def _as_shell(s: Settings, d: Strip, sheet: Sheet, cell: np.ndarray):
    """Makes a strip a shell whose losses relax: those of the sheet, or of the patches as well."""
    ratio = s.loss_time / s.relaxation_time
    rigidity = 1.0 / (1.0 / d.rigidity + d.beyond / d.length)
    lost = rigidity * (d.bare / d.rigidity**2 + d.beyond / d.length)  # of the moments squared, where the sheet bends
    share = np.full(len(d.length), ratio) if s.patch_loss else ratio * lost
    poisson = s.poisson if s.anticlastic else 0.0
    tension = (d.axial / d.middle)[cell]
    plane = isotropic(1.0, poisson)
    sheet.panel(np.arange(len(cell)), rigidity=(rigidity / d.middle)[cell])
    sheet.shell(poisson=poisson, relaxation=[(ratio, s.relaxation_time)])
    sheet.set("shell_bending_relaxation", share_1=share[cell])
    sheet.set("shell_membrane", stiffness_11=tension * plane[0, 0], stiffness_22=tension * plane[1, 1],
              stiffness_12=tension * plane[0, 1], stiffness_66=tension * plane[2, 2])  # fmt: skip


def _corner_feet(s: Settings, d: Strip, sheet: Sheet) -> tuple[list[int], np.ndarray]:
    """Two points at either end and their stiffness [N/m]."""
    feet, last = [], len(d.length) - 1
    for panel, station in ((0, 0), (last, last + 1)):
        for y in (-1, 1):
            feet.append(sheet.contact(panel, (d.x[station], y * d.width[station] / 2, 0), axis=(s.heading, 0, 0),
                                      offset=-s.thickness / 2 - s.foot_height,
                                      name=f"foot at x = {d.x[station]:.3f}"))  # fmt: skip
        sheet.mass([2 * station, 2 * station + 1], s.foot_mass / 2)
    return feet, np.full(len(feet), s.foot_stiffness / 2)


def _pads(s: Settings, d: Strip, sheet: Sheet) -> tuple[list[int], np.ndarray]:
    """Points along either end, by length, on pads from there to the patch: their stiffness [N/m]."""
    across, patched = d.across(s), np.flatnonzero(d.owner)
    row, last = across + 1, len(d.x) - 1
    feet, stiffness = [], []
    for end, base, cell in ((0, int(patched[0]), 0), (last, int(patched[-1]) + 1, last - 1)):
        for j in range(row):
            share = (0.5 if j in (0, across) else 1.0) / across
            node = end * row + j
            panel = next(p for p, f in enumerate(sheet.pattern.faces) if node in f and p // (2 * across) == cell)
            opposite = [c for c in (0, across) if 2 * abs(c - j) >= across]  # both corners for the middle
            for corner in opposite:
                feet.append(sheet.contact(panel, sheet.mesh.vertices[node], axis=(s.heading, 0, 0),
                                          offset=-s.thickness / 2 - s.foot_height,
                                          name=f"foot at x = {d.x[end]:.3f}",
                                          pad=(node, base * row + j, base * row + corner)))  # fmt: skip
                stiffness.append(s.foot_stiffness * share / len(opposite))
            sheet.mass([node], s.foot_mass * share)
    return feet, np.array(stiffness)


def _borders(s: Settings, d: Strip, sheet: Sheet, cell: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Gauss points along both borders of every cell and their stiffness [N/m].

    With points at the stations alone, the strip would land on some of them and not between, elsewhere on every mesh.
    """
    at, weight = np.polynomial.legendre.leggauss(int(s.belly_points))
    belly, along = [], []
    for k in cell.tolist():
        for t, share in zip((1 + at) / 2, weight / 2, strict=True):
            half = ((1 - t) * d.width[k] + t * d.width[k + 1]) / 2
            x = d.x[k] + t * d.length[k]
            belly += [sheet.contact(k, (x, y * half, 0), offset=-s.thickness / 2) for y in (-1, 1)]
            along += [share * d.length[k]] * 2  # what a point stands for
    return belly, s.ground_stiffness / 2 * np.array(along)


def _underside(s: Settings, d: Strip, sheet: Sheet, cell: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Points all over the underside and their stiffness [N/m]: that per length, spread over the width."""
    belly, area = sheet.underside(points=UNDERSIDE, offset=-s.thickness / 2)
    width = d.middle[cell[sheet.mesh.triangle_face]]
    return belly, s.ground_stiffness * area / np.repeat(width, UNDERSIDE)


def walk(s: Settings, *, cycles: int, rate: float = 60.0, progress: Progress | None = None, **options) -> Trajectory:
    """Simulates so many cycles of the field."""
    model, parameters, drive = build(s)
    lasting = {"duration": cycles / s.frequency, "rate": rate * s.frequency}
    return motion_of(s, model, parameters, drive, **lasting, progress=progress, **options)


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    motion = walk(s, cycles=10, progress=progress)
    table, numbers = stride_table(motion, s.frequency)
    return Outcome(
        motion, {"stride": table}, numbers=numbers,
        summary=[
            f"stride {numbers['stride_mm']:.1f} mm per cycle over the last {numbers['cycles']:.0f} cycles "
            f"(spread {numbers['spread_mm']:.2f} mm, trend {numbers['trend_mm_per_cycle']:+.3f} mm per cycle); "
            "the paper reports about 25 mm"
        ],
    )  # fmt: skip


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "crawler"])
