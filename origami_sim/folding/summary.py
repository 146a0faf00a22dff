"""What became of a pattern, in sentences and numbers: reached or missed, by how much, where, why, and what to try."""

from dataclasses import dataclass

import numpy as np

from origami_sim.pattern.checks import check_positive
from origami_sim.quantities import converted

from .bends import MOST, bend_only
from .elastic import SHARE, Elastic
from .fold import DEPTH, STRETCH, Folding
from .layers import FlatVertex

NEAR = 0.1
"""Distance to the next vertex, over the median edge, below which the two may be meant as one. It only chooses the words
of an advice; half misses an edge of 20 mm that ends 1.7 mm off, double is as good."""
WORST = 8
"""Creases that a table of the worst lists."""


@dataclass(frozen=True)
class Summary:
    """The end of a folding.

    Attributes:
        reached: whether all driven creases are within the tolerance, the sheet is whole and no panel is in another.
        sentences: to print. reason: why that is not so, in a few words; empty if it is.
        numbers: by name, for machines. worst: table of the creases furthest from their targets.
        creases: the same of all creases.
    """

    reached: bool
    sentences: list[str]
    reason: str
    numbers: dict[str, float]
    worst: dict[str, np.ndarray]
    creases: dict[str, np.ndarray]


def summarise(folding: Folding, thickness: float | str | None = None) -> Summary:
    """Return what became of a pattern.

    Args:
        folding: what folded.
        thickness: of the sheet, as far as its panels leave room for bends [m], or text as "0.1 mm"; None for that with
            which it folded.

    Raises:
        InputError: a thickness that is no length above 0.
    """
    stated = folding.thickness if thickness is None else converted(thickness, "m", "thickness")
    thickness = check_positive("thickness", stated)
    sheet, errors = folding.sheet, folding.errors
    late = errors > folding.allowed
    missed = int(np.sum(late))
    pairs = folding.crossings
    crossing = len(pairs)
    unordered = folding.unordered
    narrow, share = bend_only(sheet, thickness)
    thick = share > MOST
    reached = folding.reached and not crossing and not unordered and not thick
    bends = np.abs(folding.angles[-1] - sheet.start)[len(sheet.mesh.creases) :]
    numbers = {
        "reached": float(reached),
        "creases": float(len(errors)),
        "missed": float(missed),
        "largest_error_deg": float(np.degrees(errors.max())),
        "rms_error_deg": float(np.degrees(np.sqrt(np.mean(errors**2)))),
        "largest_strain": folding.stretch,
        "largest_strain_on_the_way": folding.stretch_on_the_way,
        "largest_bend_deg": float(np.degrees(bends.max(initial=0.0))),
        "crossing_pairs": float(crossing),
        "touching_pairs": float(folding.touching),
        "snaps": float(len(folding.snaps)),
    }
    creases = _table(folding)
    order = np.argsort(-creases["error_deg"], kind="stable")
    order = order[late[order]]
    reason, advice = _why(folding)
    said = [
        _verdict(folding, missed, order, creases),
        *advice,
        _strain(folding, numbers),
        _crossings(folding, pairs),
    ]
    if folding.reached and crossing:
        reason = "panels pass through each other"
        said.append(
            "A real sheet stops before these angles: its panels touch. Try: smaller angles for the creases around "
            "these panels (opacity in SVG, edges_foldAngle in FOLD)."
        )
    if narrow:
        reason = reason or ("the sheet is too thick for its panels" if thick else "")
        said.append(_narrow(folding, narrow, share, thickness))
    if unordered:
        reason = reason or f"no order of layers at {_vertices(len(unordered))}"
        said.append(_layers(sheet, unordered))
    if (uneven := folding.uneven) and not folding.curved:
        said.append(_uneven(sheet, uneven))
    if folding.snaps:
        at = ", ".join(f"{folding.shares[n]:.0%}" for n in folding.snaps[:6])
        more = f" and {len(folding.snaps) - 6} more" if len(folding.snaps) > 6 else ""
        said.append(f"The sheet snaps to another shape on its way, at {at}{more} of the angles.")
    worst = {name: column[order[:WORST]] for name, column in creases.items()}
    return Summary(reached, said, reason, numbers, worst, creases)


def _place(point: np.ndarray) -> str:
    """Return where a point is on the sheet, in words [m]."""
    return f"({1e3 * point[0]:.1f}, {1e3 * point[1]:.1f}) mm"


def _narrow(folding: Folding, narrow: list[int], share: float, thickness: float) -> str:
    """Return the sentence on panels that are too narrow for the sheet's thickness."""
    pattern = folding.sheet.pattern
    at = _place(pattern.vertices[list(pattern.faces[narrow[0]])].mean(axis=0))
    panels = f"{len(narrow)} of {len(pattern.faces)} panels {'is' if len(narrow) == 1 else 'are'}"
    return (
        f"A sheet {1e3 * thickness:.3g} mm thick takes {1e3 * thickness * np.pi / 2:.3g} mm for a bend of 180 deg: "
        f"{panels} too narrow for the bends beside them ({share:.1%} of the area), first at {at}. "
        "Try: a thinner sheet (--set thickness=0.05mm) or a larger one (--set size=30cm)."
    )


def _layers(sheet: Elastic, unordered: list[FlatVertex]) -> str:
    """Return the sentence on vertices whose layers have no order."""
    first = unordered[0]
    at = _place(sheet.mesh.vertices[first.node])
    count = _vertices(len(unordered))
    if (caught := first.caught) is None:
        why = f"mountains less valleys are {first.excess} there, and 2 or -2 wherever sheets fold flat"
        why += " (Maekawa's theorem)"
        other = "a mountain in place of a valley there, or the other way round"
    else:
        kind = "valleys" if caught.sign > 0 else "mountains"
        size = f"{np.degrees(caught.size):.1f} deg"
        before = f"once {caught.crimped} smaller one{'s are' if caught.crimped > 1 else ' is'} folded, "
        why = (
            f"{before if caught.crimped else ''}a sector of {size} lies between larger ones and between two {kind}, "
            "where flat folds have one mountain and one valley (big-little-big lemma)"
            if caught.count == 1
            else f"{before if caught.crimped else ''}{caught.count} sectors of {size} lie side by side between larger "
            f"ones, and their {caught.count + 1} creases are all {kind}, where flat folds have as many mountains as "
            f"valleys{'' if caught.count % 2 else ', but for one'} (crimping; Hull 2002)"
        )
        other = f"exchange one of these {kind} and a {'mountain' if caught.sign > 0 else 'valley'} there"
    return (
        f"No order of layers at {count}, first at {at}: {why}. Its panels would "
        f"pass through each other on the way. Try: {other}; angles below 180 deg (opacity in SVG, edges_foldAngle in "
        "FOLD)."
    )


def _uneven(sheet: Elastic, uneven: list[FlatVertex]) -> str:
    """Return the sentence on vertices whose sectors do not let them fold flat."""
    worst = uneven[0]
    at = _place(sheet.mesh.vertices[worst.node])
    one, other = sorted(np.degrees(worst.sums), reverse=True)
    return (
        f"The sectors around {_vertices(len(uneven))} forbid a flat fold, worst at {at}: every other "
        f"one sums to {one:.1f} and {other:.1f} deg, and to 180 deg each wherever sheets fold flat (Kawasaki's "
        f"theorem); the drawing is accurate to {np.degrees(worst.accuracy):.1f} deg there. The rest is strain and "
        "bending. Try: vertices put where they belong."
    )


def _table(folding: Folding) -> dict[str, np.ndarray]:
    """Return the driven creases: edge of the pattern, middle [mm], target, angle and error [deg]."""
    sheet = folding.sheet
    which = np.flatnonzero(sheet.driven)
    ends = sheet.mesh.vertices[sheet.hinges[which, 1:3]]
    target, angle = np.degrees(sheet.target[which]), np.degrees(folding.angles[-1, which])
    return {
        "edge": sheet.mesh.crease_edge[which],
        "x_mm": 1e3 * ends.mean(axis=1)[:, 0],
        "y_mm": 1e3 * ends.mean(axis=1)[:, 1],
        "target_deg": target,
        "angle_deg": angle,
        "error_deg": np.abs(angle - target),
    }


def _verdict(folding: Folding, missed: int, order, creases) -> str:
    count, limit = len(folding.errors), f"{np.degrees(folding.tolerance):.3g} deg"
    if np.any(folding.allowed[order] < folding.tolerance):
        limit += f" or {SHARE:.0%} of the angle"
    before = folding.sheet.errors(folding.sheet.start)
    if not missed and np.all(before <= folding.allowed):
        which = "the crease is" if count == 1 else f"all {count} creases are"
        return (
            f"The given shape is folded already: {which} within {max(np.degrees(before.max()), 0.01):.2f} deg of "
            f"{'its target' if count == 1 else 'their targets'}, and nothing had to move."
        )
    if not missed:
        worst = np.degrees(folding.errors.max())
        whole = "" if not folding.torn else ", but only by tearing the sheet"
        whose = "The crease folds" if count == 1 else f"All {count} creases fold"
        within = f"within {max(worst, 0.01):.2f} deg of {'its target' if count == 1 else 'their targets'}"
        return f"{whose} to {within}{whole}."
    first = {name: column[order[0]] for name, column in creases.items()}
    wrong = int(np.sum((creases["angle_deg"] * creases["target_deg"] < 0) & (np.abs(creases["angle_deg"]) > 1.0)))
    popped = f" {wrong} of them have popped to the other side." if wrong else ""
    return (
        f"MISSED: {missed} of {count} creases end more than {limit} from their targets; the furthest, edge "
        f"{first['edge']} at ({first['x_mm']:.1f}, {first['y_mm']:.1f}) mm, by {first['error_deg']:.1f} deg "
        f"({first['angle_deg']:.1f} instead of {first['target_deg']:.1f}).{popped}"
    )


def _why(folding: Folding) -> tuple[str, list[str]]:
    """Return the reason in a few words, and sentences that say it and what to try."""
    if folding.reached:
        return "", []
    against, sheet = folding.contradictions, folding.sheet
    if against:
        worst = against[0]
        at = _place(sheet.mesh.vertices[worst.node])
        return f"targets contradict each other at {_vertices(len(against))}", [
            f"No shape has all these angles: at {_vertices(len(against))} the panels do not close, worst at {at}, "
            f"where they miss by {np.degrees(worst.gap):.0f} deg and one of the {len(worst.creases)} "
            f"creases stays off by at least {np.degrees(worst.bound):.0f} deg. What is shown is the compromise of "
            "least energy.",
            "Try: other angles for the creases there (opacity in SVG, edges_foldAngle in FOLD); a facet (yellow) "
            f"across a panel beside it; or {_made_one(sheet, worst.node)}.",
        ]
    if folding.curved:
        count = sum(v.curved for v in folding.vertices)
        return "curved creases cannot fold flat", [
            f"Its creases are curves ({count} corners): the panels beside a curve bend 1 / cos(angle / 2) "
            "times as much as the curve, without bound towards 180 deg (Fuchs and Tabachnikov 1999): no sheet folds "
            "them flat. What is shown is the compromise of least energy.",
            "Try: smaller angles (opacity in SVG); 90 deg is what most curved folds take.",
        ]
    if folding.torn:
        return "only a torn sheet gets there", [
            f"The targets strain the sheet by more than {STRETCH:.0%}: it would tear.",
            "Try: smaller angles; facets (yellow) across the strained panels; or vertices put where they belong.",
        ]
    apart = folding.apart
    if folding.touching and not apart:
        return "panels are in each other's way", [
            "Panels that touch keep the creases from their angles: these would push panels through each other, or the "
            "layers into an order that folding does not lead to.",
            "Try: angles that leave room for what lies between (opacity in SVG, edges_foldAngle in FOLD); a thinner "
            "sheet (--set thickness=0.05mm); some of the angles first; --no-touch shows where panels would pass.",
        ]
    if apart:
        at = _place(sheet.mesh.vertices[apart[0].node])
        return f"targets do not fit together at {_vertices(len(apart))}", [
            f"At {_vertices(len(apart))} the panels do not close at these angles, worst at {at}, "
            f"where they miss by {np.degrees(apart[0].gap):.2g} deg: creases stay off or panels bend. What is "
            "shown is the compromise of least energy.",
            "Try: other angles there (opacity in SVG, edges_foldAngle in FOLD); a crease without a target (magenta) "
            f"that may take what it needs; facets (yellow) across the panels; or {_made_one(sheet, apart[0].node)}.",
        ]
    return "no way there was found", [
        "No vertex forbids these angles, but following the sheet there ends in a cul-de-sac: panels that may not bend "
        "so far, or folds that have to be made one after the other.",
        "Try: facets (yellow) across large panels; more steps (--set steps=100); some of the angles first.",
    ]


def _made_one(sheet: Elastic, node: int) -> str:
    """Return what to do about a vertex that may be drawn as two: of drawings a distance, else the vertices."""
    if not np.isnan(sheet.pattern.accuracy):
        return "another distance below which points are one (--set merge=0.002)"
    away = np.linalg.norm(sheet.mesh.vertices - sheet.mesh.vertices[node], axis=1)
    away[sheet.mesh.vertex_source == sheet.mesh.vertex_source[node]] = np.inf
    nearest = int(np.argmin(away))
    if away[nearest] > NEAR * float(np.median(sheet.lengths)) * sheet.size:
        return "vertices put where they belong (vertices_coords)"
    at = _place(sheet.mesh.vertices[nearest])
    return (
        f"one vertex instead of it and the nearest, {1e3 * away[nearest]:.3g} mm off at {at}, if an "
        "edge ends beside where it should (vertices_coords, edges_vertices)"
    )


def _vertices(count: int) -> str:
    return f"{count} vert{'ices' if count > 1 else 'ex'}"


def _strain(folding: Folding, numbers) -> str:
    text = f"Largest strain {numbers['largest_strain']:.2%}"
    if numbers["largest_strain_on_the_way"] > max(2.0 * numbers["largest_strain"], 1e-3):
        text += f", on the way {numbers['largest_strain_on_the_way']:.1%}"
    if numbers["largest_bend_deg"] > 0.5:
        text += f", panels bend by up to {numbers['largest_bend_deg']:.0f} deg about a line"
    strained = np.abs(folding.sheet.strains(folding.x[-1] / folding.sheet.size))
    if numbers["largest_strain"] > STRETCH and not folding.torn:
        most, size = int(np.argmax(strained)), folding.sheet.size
        what = "an edge" if most < len(folding.sheet.bars) else "a panel's diagonal"
        left = float(folding.sheet.misfits(folding.x[-1] / size).max())
        text += (
            f"; that is {what} of {1e3 * folding.sheet.spans[most] * size:.2g} mm. Without what the drawing may be off "
            f"by, {1e3 * folding.sheet.inaccuracy * size:.2g} mm, {left:.2%} are left"
        )
    return text + "."


def _crossings(folding: Folding, pairs: np.ndarray) -> str:
    sheet, where = folding.sheet, ""
    if len(pairs):
        one, other = (1e3 * sheet.mesh.vertices[sheet.mesh.triangles[t]].mean(axis=0) for t in pairs[0])
        where = (
            f", first those at ({one[0]:.1f}, {one[1]:.1f}) and ({other[0]:.1f}, {other[1]:.1f}) mm of the flat pattern"
        )
    through = (
        f"{len(pairs)} pairs of triangles pass through each other" if len(pairs) else "No panel passes through another"
    )
    deep = f"by more than folded sheets are accurate to, {1e3 * folding.depth:.2g} mm ({DEPTH:.1%} of the longest side)"
    if folding.clear_from is None:
        return f"{through} {deep}{where}."
    whole = "on the whole way" if not folding.clear_from else f"from {folding.shares[folding.clear_from]:.0%} on"
    touch = f"{folding.touching} pairs of corners, edges and triangles touch" if folding.touching else "nothing touches"
    thick = f"the sheet's thickness ({1e3 * folding.thickness:.3g} mm)"
    return f"Panels keep each other off {whole}, at {thick}; at the end {touch}. {through}{where}."
