"""Notes on the data, numbers for the calibration, settings and time; and all data of the page behind a link."""

import base64
import gzip
import json

import numpy as np

from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import Html, element
from origami_sim.report.page.measures import known
from origami_sim.report.page.pieces import bar, figure, nothing, row, table
from origami_sim.report.page.wording import number_of, worded


def finding(d: Diagnosis) -> str:
    count = len(d.notes)
    took = sum(known(s, 0.0) for s in d.seconds.values())
    return f"{count} note{'s' if count != 1 else ''}; {took:.0f} s of computing"


def section(d: Diagnosis, geometry: dict | None) -> list:
    total = sum(known(s, 0.0) for s in d.seconds.values())
    head = ("Stage", "Time")
    stages = [row(head, k, bar(known(s) / (total or np.nan), f"{known(s, 0.0):.1f} s")) for k, s in d.seconds.items()]
    right = table(head, stages, "Time by stage", kind="short") if stages else nothing("Not measured.")
    head = ("Setting", "Value")
    settings = [row(head, k, element("code", _setting(v))) for k, v in d.settings.items() if k != "command"]
    left = table(head, settings, "Settings", kind="short") if settings else nothing("Nothing recorded.")
    head = ("Number", "In the calibration as", "Value [SI]")
    numbers = [
        row(head, number_of(k.partition("@")[0]), element("code", k), figure(f"{known(v):.6g}"))
        for k, v in d.patch.items()
        if np.isfinite(known(v))
    ]
    command = d.settings.get("command")
    beside = [
        element("div", element("h3", "Settings"), left),
        element("div", element("h3", f"Time: {total:.1f} s" if stages else "Time"), right),
    ]
    return [
        element("h3", "Notes on the data"),
        element("ul", [element("li", worded(n)) for n in d.notes]) if d.notes else nothing("Nothing to remark."),
        element("h3", "Numbers for the calibration"),
        table(head, numbers, "Numbers for the calibration") if numbers else nothing("Nothing to change."),
        element("h3", "How to reproduce"),
        element("pre", element("code", command), tabindex="0") if command else None,
        element(
            "p",
            element("a", "All data of this page", href=packed(d, geometry), download="diagnosis.json.gz"),
            " (JSON, gzip; in Python ",
            element("code", "origami_sim.report.page.read_report(path)"),
            "). The same recordings, model and settings give the same numbers.",
        ),
        element("div", beside, class_="two"),
    ]


def packed(d: Diagnosis, geometry: dict | None) -> Html:
    """Address that holds all data: {"diagnosis": as `Diagnosis.to_dict()`, "geometry": as given or None}."""
    text = json.dumps({"diagnosis": d.to_dict(), "geometry": geometry}, allow_nan=False, separators=(",", ":"))
    return Html("data:application/gzip;base64," + base64.b64encode(gzip.compress(text.encode(), 6, mtime=0)).decode())


def _setting(value) -> str:
    return "not set" if value is None else json.dumps(value, default=str) if not isinstance(value, str) else value
