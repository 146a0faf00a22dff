"""The map: the device with its creases and panels coloured by how probable it is that something acts there."""

from collections.abc import Callable
from functools import partial

import numpy as np

from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import Html, element, percent
from origami_sim.report.page.measures import array, known
from origami_sim.report.page.plots import colour
from origami_sim.report.page.wording import site_of

LABELLED = 8
"""Creases that carry their names, if there are many."""

LEAST = 0.05
"""Part from which a panel carries its name."""

NARROW, HIGH = 350.0, 340.0
"""Width of the drawing on the narrowest screen that labels must fit, and its greatest height [px]."""

EVERY = {"all creases": "creases", "all panels": "panels"}
"""Sites that stand for several."""


def section(d: Diagnosis, geometry: dict) -> Html:
    """The drawing with one scale, and in words what it is a scale of."""
    parts, about = _parts(d, geometry)
    return _drawing(geometry, parts, about)


def _parts(d: Diagnosis, geometry: dict) -> tuple[dict[str, float], str]:
    """A part between 0 and 1 by site, and what it is."""
    out: dict[str, float] = {}
    if d.verdict == "UNKNOWN" or not d.marginals:
        for p in d.places:  # those of one name are one region
            out[p.site] = out.get(p.site, 0.0) + known(p.share, 0.0)
        return out, "Share of the structure in the moment that is missing."
    for label, chance in d.marginals.items():
        site = site_of(label)
        names = {e["name"] for e in geometry[EVERY[site]]} if site in EVERY else {site}
        for name in names:
            out[name] = out.get(name, 0.0) + known(chance, 0.0)
    # exclusive explanations add up; where two act at once, it is at least one of them
    return {k: min(v, 1.0) for k, v in out.items()}, "Probability that an effect which the model lacks acts there."


def _drawing(g: dict, shares: dict[str, float], about: str) -> Html:
    """The device with its creases and panels in the colours of their parts."""
    flat, depth = _projected(array(g["nodes"]))
    low, high = flat.min(0), flat.max(0)
    size = np.maximum(high - low, 0.02 * float((high - low).max()) or 1.0)
    # a long strip gets a box of at most 2 : 1, a tall one a square with room for labels beside it
    box = np.maximum(size, size.max() * np.array([1.0, 0.45])) * 1.24
    at = np.column_stack([(flat[:, 0] - (low + high)[0] / 2), -(flat[:, 1] - (low + high)[1] / 2)]) / box + 0.5
    wide, tall = 1000.0, 1000.0 * box[1] / box[0]
    xy = np.round(at * [wide, tall], 1)
    shapes, labels = [], []
    triangles = np.asarray(g["triangles"], int).reshape(-1, 3)
    order = sorted(g["panels"], key=lambda p: float(depth[triangles[p["triangles"]]].mean()) if p["triangles"] else 0.0)
    for panel in order:
        share = shares.get(panel["name"], 0.0)
        path = "".join("M{} {}L{} {}L{} {}z".format(*xy[t].ravel()) for t in triangles[panel["triangles"]])
        edges = "".join("M{} {}L{} {}".format(*xy[list(e)].ravel()) for e in _outline(triangles[panel["triangles"]]))
        title = element("title", f"{panel['name']}: {percent(share)}")
        fill = element("path", d=path, style=f"fill:{colour(share)};stroke:{colour(share)}", class_="face")
        shapes.append(element("g", title, fill, element("path", d=edges, class_="edge")))
        if share >= LEAST and panel["triangles"]:
            centre = at[np.unique(triangles[panel["triangles"]])].mean(0)
            labels.append((panel["name"], share, partial(_about, centre)))
    each = sorted(shares.get(c["name"], 0.0) for c in g["creases"])
    fewest = each[-LABELLED] if len(each) > LABELLED else -1.0
    for crease in g["creases"]:
        share = shares.get(crease["name"], 0.0)
        d = "M{} {}L{} {}".format(*xy[crease["nodes"]].ravel())
        shapes.append(
            element(
                "g",
                element("title", f"{crease['name']}: {percent(share)}"),
                element("path", d=d, class_="casing"),
                element("path", d=d, class_="crease", style=f"stroke:{colour(share)}"),
            )
        )
        if share >= fewest and not any(label[0] == crease["name"] for label in labels):
            a, b = at[crease["nodes"]]
            labels.append((crease["name"], share, partial(_along, a, b)))
    for node in g.get("held", []):
        shapes.append(element("path", d="M{} {}h0".format(*xy[node]), class_="held"))
    svg = element(
        "svg",
        shapes,
        viewBox=f"0 0 {wide:.0f} {tall:.0f}",
        role="img",
        aria_label=f"the device, its creases and panels coloured: {about}",
    )
    texts = _labels(labels, tall / wide, min(NARROW, HIGH * wide / tall))
    style = f"aspect-ratio:{wide:.0f}/{tall:.0f};max-width:{HIGH * wide / tall:.0f}px"
    drawn = {c["name"] for c in g["creases"]} | {p["name"] for p in g["panels"]} | set(EVERY)
    others = [(n, s) for n, s in shares.items() if n not in drawn and known(s, 0.0) >= 0.01]
    chips = [element("span", f"{n} {percent(s)}", class_="chip") for n, s in sorted(others, key=lambda o: -o[1])]
    ramp = element(
        "div",
        element("span", "0 %"),
        element("i", style="background:linear-gradient(90deg," + ",".join(colour(k / 10) for k in range(11)) + ")"),
        element("span", "100 %"),
        class_="ramp",
    )
    note = about
    if g.get("held"):
        note += " Squares: held nodes."
    return element(
        "figure",
        element(
            "figcaption",
            element("b", "On the device"),
            element("span", note, element("span", " Elsewhere: ", chips) if chips else None),
        ),
        element("div", element("div", svg, texts, class_="origami", style=style), ramp),
        class_="heat",
    )


def _along(a: np.ndarray, b: np.ndarray, half: float) -> list[np.ndarray]:
    """Places for a label of some half width: on a line, or beside it where the label would cover it."""
    on = [a + t * (b - a) for t in (0.5, 0.2, 0.8, 0.35, 0.65, 0.0, 1.0)]
    across, up = np.abs(b - a)
    if across < up or across > 3.0 * half:
        return on
    left, right = (a, b) if a[0] < b[0] else (b, a)
    away = np.array([half + 0.03, 0.0])
    return [*(p for p in (right + away, left - away) if half <= p[0] <= 1.0 - half), *on]


def _about(centre: np.ndarray, half: float) -> list[np.ndarray]:
    """Places for a label in a panel."""
    return [centre + np.array([0.0, dy]) for dy in (0.0, -0.08, 0.08)]


def _labels(labels: list[tuple[str, float, Callable]], aspect: float, width: float) -> list[Html]:
    """Names where they do not cover each other on a narrow page; where there is no room, the percentage alone.

    Args:
        labels: name, part, and places for a label of some half width. aspect: height by width of the drawing.
    """
    taken: list[tuple[float, float, float]] = []
    out = []
    for name, share, places in sorted(labels, key=lambda label: -label[1]):
        high = 24 / width / aspect
        for text in (f" {name}", ""):
            half = (6.6 * len(percent(share) + text) + 14) / width / 2
            spots = [
                (float(np.clip(x, half, 1 - half)), float(np.clip(y, high / 2, 1 - high / 2))) for x, y in places(half)
            ]
            free = [
                (x, y) for x, y in spots if all(abs(x - u) > half + h or abs(y - v) > high for u, v, h in taken)
            ]  # fmt: skip
            if half < 0.5 and free:
                x, y = free[0]
                taken.append((x, y, half))
                style = f"left:{100 * x:.2f}%;top:{100 * y:.2f}%"
                out.append(element("span", element("b", percent(share)), text, class_="at", style=style))
                break
    return out


def _projected(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """[N, 2] picture and [N] nearness of points [N, 3]: a flat sheet from its front, anything else obliquely."""
    centred = nodes - nodes.mean(0)
    _, size, axes = np.linalg.svd(centred, full_matrices=False)
    flat = len(size) < 3 or size[2] <= 0.02 * size[0]
    normal = axes[2] if len(axes) == 3 and flat else np.array([-0.45, -0.70, 0.55])
    if flat and abs(normal[2]) > 0.5:
        normal = np.array([0.0, 0.0, 1.0])  # seen from the top, x to the right, as it was drawn
        up = np.array([0.0, 1.0, 0.0])
    else:
        normal = normal / np.linalg.norm(normal)
        up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, normal)
    right = right / np.linalg.norm(right)
    return np.column_stack([centred @ right, centred @ np.cross(normal, right)]), centred @ normal


def _outline(triangles: np.ndarray) -> list[tuple[int, int]]:
    """Edges that belong to one triangle only."""
    count: dict[tuple[int, int], int] = {}
    for t in triangles.tolist():
        for a, b in zip(t, (*t[1:], t[0]), strict=True):
            edge = (min(a, b), max(a, b))
            count[edge] = count.get(edge, 0) + 1
    return [e for e, n in count.items() if n == 1]
