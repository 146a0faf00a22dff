"""The whole page: what was found, and behind it, folded, everything that it rests on."""

import base64
import gzip
import json
import re
from importlib.resources import files
from pathlib import Path
from string import Template

from origami_sim.errors import InputError
from origami_sim.files import write_text
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page import (
    budget,
    candidates,
    errors,
    headline,
    leftover,
    map,
    next_experiment,
    notes,
    overlays,
    places,
    suspects,
)
from origami_sim.report.page.geometry import check
from origami_sim.report.page.laws import laws
from origami_sim.report.page.markup import Html, element, join
from origami_sim.report.page.measures import multiples

_DATA = re.compile(r'href="data:application/gzip;base64,([^"]+)"')


def write_report(diagnosis: Diagnosis, path: str | Path, *, geometry: dict | None = None) -> Path:
    """Writes the page in one piece; its style, script, drawings and data are inside it.

    Args:
        diagnosis: what was found.
        path: the HTML file, replaced at once when the page is complete.
        geometry: the device to draw, from `geometry_of`; without it there is no map.

    Raises:
        InputError: the geometry lacks a part or names nodes or triangles that it does not have.
    """
    return write_text(path, page(diagnosis, geometry))


def read_report(path: str | Path) -> dict:
    """The data inside a page: {"diagnosis": as `Diagnosis.to_dict()`, "geometry": as given or None}."""
    found = _DATA.search(Path(path).read_text(encoding="utf-8"))
    if not found:
        raise InputError("this page holds no diagnosis", file=path)
    return json.loads(gzip.decompress(base64.b64decode(found[1])))


def page(diagnosis: Diagnosis, geometry: dict | None = None) -> str:
    """The whole page as text; see `write_report`."""
    if geometry is not None:
        check(geometry)
    d = diagnosis
    folds = {
        "next": ("Next experiment", next_experiment.finding(d), next_experiment.section(d)),
        "overlays": ("Recorded and predicted", overlays.finding(d), overlays.section(d)),
        "where": ("Where it goes wrong", places.finding(d), places.section(d)),
        "errors": ("Error of every model", errors.finding(d), errors.section(d)),
        "suspects": ("All suspects", suspects.finding(d), suspects.section(d)),
        "alike": ("What looks alike", suspects.likeness(d), suspects.alike(d)),
        "left": ("What is left", leftover.finding(d), leftover.section(d)),
        "notes": ("Notes and settings", notes.finding(d), notes.section(d, geometry)),
    }
    body = [
        headline.section(d),
        element(
            "main",
            budget.section(d, multiples(d, d.error_before)),
            headline.numbers(d),
            _evidence(d, geometry),
            element("section", element("h2", "Explanations"), candidates.section(d), id="candidates"),
            element("section", [_fold(key, *each) for key, each in folds.items()], id="more", aria_label="More"),
            id="found",
        ),
    ]
    title = f"{d.verdict}: {d.subject}" if d.subject else f"{d.verdict}: diagnosis"
    folder = files("origami_sim.report.page")
    kept = {n: (folder / n).read_text(encoding="utf-8") for n in ("page.html", "page.css", "page.js")}
    return Template(kept["page.html"]).substitute(
        title=join([title]), style=kept["page.css"], script=kept["page.js"], body=Html("\n".join(body))
    )


def _evidence(d: Diagnosis, geometry: dict | None) -> Html | None:
    """A plot for each law, and the map."""
    figures = laws(d)
    if geometry is not None and (d.places or d.marginals):
        figures.append(map.section(d, geometry))
    return element("div", figures, class_="figures evidence") if figures else None


def _fold(key: str, title: str, finding: str, content) -> Html:
    """A section that is folded; its finding is read without opening it."""
    summary = element("summary", element("h2", title), element("span", finding, class_="finding"))
    return element("details", summary, element("div", content, class_="inside"), id=key, class_="fold")
