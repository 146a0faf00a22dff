"""The page that a diagnosis leaves: the verdict, and for every claim the plot that shows it. No network needed.

The page is drawn from the plain data of a `Diagnosis` alone, and carries them (compressed) behind a link, so that every
number in it can be checked: `read_report`.
"""

import base64
import gzip
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from origami_sim.diagnose.acting import DRAWN
from origami_sim.diagnose.diagnosis import (
    REVERSAL,
    Acting,
    Correlation,
    Curve,
    Diagnosis,
    Number,
    Place,
    Suspected,
    Trace,
)
from origami_sim.diagnose.report_markup import (
    MISSING,
    Html,
    amount,
    element,
    fit_percent,
    interval,
    join,
    number,
    percent,
    plus_minus,
    times,
)
from origami_sim.diagnose.report_plots import Plot, colour, is_dark, span_of
from origami_sim.diagnose.report_style import SCRIPT, STYLE
from origami_sim.errors import InputError
from origami_sim.model import Model

MEANING = {
    "ADEQUATE": "Nothing is found that the model lacks.",
    "PARAMETER": "The model has the right effects; its own numbers were off.",
    "MEASUREMENT": "The measurement, not the device, makes the difference.",
    "MECHANISM": "A physical effect was left out of the model.",
    "TIE": "Several explanations do equally well; only another experiment can tell them apart.",
    "SEVERAL": "More than one effect was left out of the model.",
    "UNKNOWN": "Something real is missing that the catalogue does not name.",
    "UNTESTABLE": "These recordings cannot answer the question.",
}

SECTIONS = {
    "figures": "Key figures",
    "overlays": "Before and after",
    "where": "Where it goes wrong",
    "candidates": "Candidates",
    "screening": "Screening",
    "isolability": "What can be told apart",
    "whiteness": "What is left",
    "next": "Next experiment",
    "baselines": "Baselines",
    "notes": "Notes and settings",
}

PLACES, OPEN_PLACES, OPEN_RECORDINGS, OPEN_SUSPECTS = 6, 2, 3, 12
"""Places drawn in full; of those, and of recordings and suspects, how many are open at first."""

BLOWS = 12
"""Blows that are listed."""

_DATA = re.compile(r'href="data:application/gzip;base64,([^"]+)"')
_SECURITY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def write_report(diagnosis: Diagnosis, path: str | Path, *, geometry: dict | None = None) -> Path:
    """Writes the page in one piece; its styles, script, drawings and data are inside it.

    Args:
        diagnosis: what was found.
        path: the HTML file, replaced at once when the page is complete.
        geometry: the origami to draw, from `geometry_of`; without it the places are listed only.

    Raises:
        InputError: the geometry lacks a part or names nodes or triangles that it does not have.
    """
    if geometry is not None:
        _check(geometry)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(page(diagnosis, geometry), encoding="utf-8")
    os.replace(part, path)
    return path


def read_report(path: str | Path) -> dict:
    """The data inside a page: {"diagnosis": as `Diagnosis.to_dict()`, "geometry": as given or None}."""
    found = _DATA.search(Path(path).read_text(encoding="utf-8"))
    if not found:
        raise InputError("this page holds no diagnosis", file=path)
    return json.loads(gzip.decompress(base64.b64decode(found[1])))


def geometry_of(model: Model) -> dict:
    """What the page needs to draw the origami: nodes [m], triangles, panels and creases with their names.

    Returns:
        nodes: [N, 3] reference positions. triangles: [T, 3] nodes. panels: name and triangles of each.
        creases: name and the two nodes of the axis of each. held: nodes that cannot move.
    """
    panels = [int(p) for p in np.unique(model.triangle_panel)]
    return {
        "nodes": model.position.tolist(),
        "triangles": model.triangles.tolist(),
        "panels": [
            {"name": model.name("panel", p), "triangles": np.flatnonzero(model.triangle_panel == p).tolist()}
            for p in panels
        ],
        "creases": [
            {"name": model.name("crease", c), "nodes": [int(j), int(k)]} for c, (_, j, k, _) in enumerate(model.creases)
        ],
        "held": np.flatnonzero(~np.any(model.free, axis=1)).tolist(),
    }


def page(diagnosis: Diagnosis, geometry: dict | None = None) -> Html:
    """The whole page as text."""
    d = diagnosis
    parts = {
        "figures": _figures(d),
        "overlays": _overlays(d),
        "where": _where(d, geometry),
        "candidates": _candidates(d),
        "screening": _screening(d),
        "isolability": _isolability(d),
        "whiteness": _whiteness(d),
        "next": _next(d),
        "baselines": _baselines(d),
        "notes": _notes(d, geometry),
    }
    title = f"{d.verdict}: {d.subject}" if d.subject else f"{d.verdict}: diagnosis"
    links = [element("li", element("a", name, href=f"#{key}")) for key, name in SECTIONS.items()]
    body = [
        element("a", "Skip to the findings", href="#figures", class_="skip"),
        _head(d),
        element("nav", element("ul", links), aria_label="Sections"),
        element("main", [_section(key, content) for key, content in parts.items()]),
    ]
    head = [
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=_SECURITY),
        element("title", title),
        element("style", Html(STYLE)),
    ]
    content = [element("head", head), element("body", body, element("script", Html(SCRIPT)))]
    return Html("<!doctype html>\n" + element("html", content, lang="en") + "\n")


# --- the parts


def _section(key: str, content) -> Html:
    return element("section", element("h2", SECTIONS[key]), content, id=key, aria_label=SECTIONS[key])


def _head(d: Diagnosis) -> Html:
    recorded = f"{len(d.recordings)} recording{'s' if len(d.recordings) != 1 else ''}: {', '.join(d.recordings)}"
    sure = np.isfinite(d.probability)
    banner = element(
        "div",
        element("div", element("span", d.verdict, class_="pill"), element("span", MEANING[d.verdict])),
        element("p", _say(d.sentence), class_="sentence"),
        element("div", element("b", percent(d.probability)), element("span", "probability"), class_="sure")
        if sure
        else None,
        class_=f"verdict v-{d.verdict.lower()}",
    )
    cards = [
        element(
            "a",
            element("span", name, class_="claim"),
            element("span", text, class_="finding"),
            element("span", SECTIONS[target], class_="to"),
            href=f"#{target}",
        )
        for name, text, target in _claims(d)
    ]
    return element(
        "header",
        element("h1", "Diagnosis", f" of {d.subject}" if d.subject else ""),
        element("p", recorded, class_="quiet") if d.recordings else None,
        banner,
        element("div", cards, class_="claims"),
    )


def _claims(d: Diagnosis) -> list[tuple[str, str, str]]:
    """(claim, finding, section that shows it)."""
    given, refitted, left = (number(_multiples(d, e)) for e in (d.error_before, d.error_refitted, d.error_after))
    unit = "the noise" if _has_noise(d) else "the signal"
    label = {"TIE": "In the tie", "SEVERAL": "Effects", "ADEQUATE": "Explanation"}.get(d.verdict, "What")
    out = [(label, " · ".join(d.chosen) or "nothing added", "candidates")]
    if d.places:
        best = max(d.places, key=lambda p: p.share if np.isfinite(p.share) else -1.0)
        alone = f"; like a {d.acting[0].what} {d.acting[0].site}" if d.acting else ""
        out.append(("Where", f"{best.site}, share {percent(best.share)}{alone}", "where"))
    if np.isfinite(d.onset):
        out.append(("Since when", f"{amount(d.onset, 's', 3)} after the start", "overlays"))
    elif d.traces:
        out.append(("Since when", "no lasting departure", "overlays"))
    if left != MISSING:
        out.append(("Held-out error", f"{given} as given, {refitted} refitted, {left} now, times {unit}", "figures"))
    if np.isfinite(d.p_value):
        found = f"p {_p_value(d.p_value)} among {len(d.screening)} suspects"
        out.append(("Against chance", found, "screening"))
    rival, alike = _rival(d)
    if rival:
        out.append(("Closest lookalike", f"{rival}, overlap {alike:.2f}", "isolability"))
    if d.correlations:
        out.append(("What is left", _white(d), "whiteness"))
    if d.experiments:
        out.append(("Next", d.experiments[0].what, "next"))
    return out


def _figures(d: Diagnosis) -> list:
    unit = "noise" if _has_noise(d) else "spread"
    rows = [("as given", d.error_before, "before", ""), ("nominal refitted", d.error_refitted, "refitted", "")]
    rows += [(b.name, b.rms, "other", "") for b in d.baselines]
    rows.append(("ours: " + (" + ".join(d.chosen) or "nominal"), d.error_after, "after", "ours"))
    each = [_each_multiple(d, rms) for _, rms, *_ in rows]
    finite = np.concatenate([np.zeros(0), *each])
    finite = finite[np.isfinite(finite) & (finite > 0)]
    low = min(0.7, 0.8 * float(finite.min())) if len(finite) else 0.7
    high = max(3.0, 1.25 * float(finite.max())) if len(finite) else 3.0
    body = []
    for (name, rms, kind, mark), values in zip(rows, each, strict=True):
        cells = [
            element("td", element("span", amount(v, u, 3)), element("small", f" {times(m)}"), class_="n")
            for v, u, m in zip(_padded(rms, d), d.units, values, strict=True)
        ]
        total = _multiples(d, rms)
        strip = _strip(values, total, low, high, kind, f"{name}: {times(total)} {unit}")
        body.append(
            element(
                "tr",
                element("th", name, scope="row"),
                element("td", strip, class_="strip"),
                element("td", times(total), class_="n"),
                cells,
                class_=mark or None,
            )
        )
    names = [element("th", c, scope="col", class_="n") for c in d.components]
    axis = [
        element("span", f"{v:g}", style=f"left:{100 * _log_place(v, low, high):.2f}%") for v in _log_ticks(low, high)
    ]
    head = element(
        "tr",
        element("th", "Held-out rms residual", scope="col"),
        element("th", element("div", axis, class_="logaxis"), scope="col", class_="strip"),
        element("th", f"× {unit}", scope="col", class_="n"),
        names,
    )
    note = (
        "On data that the fit did not see. Dot: over all components; ticks: one each; vertical line: the noise floor."
        if _has_noise(d)
        else "The noise is not known: errors are multiples of the recorded standard deviation (NRMSE)."
    )
    floor = [f"{c}: {amount(s, u)}" for c, s, u in zip(d.components, _padded(d.noise, d), d.units, strict=True)]
    return [
        _tiles(d, unit),
        _table(head, body, "Held-out error of every model"),
        element("p", f"{note} Noise floor: {'; '.join(floor)}." if _has_noise(d) else note, class_="quiet"),
    ]


def _tiles(d: Diagnosis, unit: str) -> Html:
    before, refitted, after = (_multiples(d, e) for e in (d.error_before, d.error_refitted, d.error_after))
    if not np.isfinite(after):
        return _nothing("No held-out error could be measured.")
    tiles = [
        ("held-out error", f"{times(before)} → {times(after)}", f"of the {unit}, as given → now"),
        ("after refitting alone", times(refitted), f"of the {unit}"),
    ]
    if _has_noise(d) and before > 1.1:
        removed = (before**2 - after**2) / (before**2 - 1)
        tiles.append(("removable error removed", percent(min(max(removed, 0.0), 1.0)), "(E₀² − E²) / (E₀² − σ²)"))
    fits = {kind: np.array([_fit(t, kind) for t in d.traces]) for kind in ("before", "after")}
    if d.traces and np.isfinite(fits["after"]).any():
        shown = [fit_percent(float(np.nanmedian(f))) for f in fits.values()]
        tiles.append(("fit", " → ".join(shown), "median over recordings and components"))
    return element(
        "div",
        [element("div", element("span", a), element("b", b), element("small", c), class_="tile") for a, b, c in tiles],
        class_="tiles",
    )


def _strip(values, total: float, low: float, high: float, kind: str, label: str) -> Html:
    """Dots on a logarithmic axis, 1 to be the floor."""
    at = [round(1000 * _log_place(v, low, high)) for v in values if np.isfinite(v) and v > 0]
    parts = [element("path", d=f"M{round(1000 * _log_place(1.0, low, high))} 0v100", class_="floor")]
    parts.append(element("path", d="M0 50h1000", class_="grid"))
    parts += [element("path", d=f"M{x} 25v50", class_=f"{kind} tick") for x in at]
    if np.isfinite(total) and total > 0:
        spot = f"M{round(1000 * _log_place(total, low, high))} 50h0"
        parts.append(element("path", d=spot, class_=f"{kind} dots big"))
    return element("svg", parts, viewBox="0 0 1000 100", preserveAspectRatio="none", role="img", aria_label=label)


def _overlays(d: Diagnosis) -> list:
    if not d.traces:
        return [_nothing("No component could be compared in time.")]
    single = len({t.recording for t in d.traces}) == 1
    groups = {r: [t for t in d.traces if t.recording == r] for r in dict.fromkeys(t.recording for t in d.traces)}
    legend = [
        _legend(("recorded", "recorded"), ("before", "as given"), ("refitted", "nominal refitted"), ("after", "now")),
        element("p", "Shaded: ± 2 sd of the prediction; below, recorded minus predicted, shaded ± 2 sd of the noise."),
    ]
    out = [element("div", legend, class_="legendrow")]
    if np.isfinite(d.onset) and not single:
        out.append(element("p", f"The refitted model first departs lastingly after {amount(d.onset, 's', 3)}."))
    for n, (name, traces) in enumerate(groups.items()):
        figures = element("div", [_overlay(t, d.onset if single else np.nan) for t in traces], class_="figures")
        shown = n < OPEN_RECORDINGS
        out.append(element("details", element("summary", element("h3", name)), figures, open=shown))
    return out


def _overlay(t: Trace, onset: float) -> Html:
    x = _array(t.times)
    y = {kind: _array(getattr(t, kind)) for kind in ("recorded", "before", "refitted", "after")}
    along = span_of(x, margin=0.0)
    top = Plot(
        f"{t.component} of {t.recording} in time: recorded and predicted",
        along,
        span_of(*y.values()),
        y_name=t.component,
        y_unit=t.unit,
        height=190,
        bare=True,
    )
    low = Plot(
        f"residual of {t.component} of {t.recording} in time",
        along,
        span_of(y["recorded"] - y["before"], y["recorded"] - y["after"], [2 * _or(t.noise, 0.0)], symmetric=True),
        x_name="time",
        x_unit="s",
        y_name="residual",
        y_unit=t.unit,
        height=90,
    )
    if np.isfinite(_or(t.band)) and t.band > 0:
        top.band(x, y["after"] - t.band, y["after"] + t.band, "band", breaks=t.breaks)
    if _or(t.noise, 0.0) > 0:
        ends = _array(along)
        low.band(ends, np.full(2, -2 * t.noise), np.full(2, 2 * t.noise), "noise")
    if len(x) <= 150:
        top.dots(x, y["recorded"], "recorded")
    else:
        top.line(x, y["recorded"], "recorded", title="recorded")
    for kind, title in (("before", "as given"), ("refitted", "nominal refitted"), ("after", "now")):
        top.line(x, y[kind], kind, breaks=t.breaks, title=title)
    low.level(0.0, "zero")
    for kind, title in (("before", "as given"), ("after", "now")):
        low.line(x, y["recorded"] - y[kind], kind, breaks=t.breaks, title=f"residual, {title}")
    if np.isfinite(onset):
        for plot in (top, low):
            plot.mark(onset, "onset", f"departs lastingly at {amount(onset, 's', 3)}")
    for b in t.breaks if len(t.breaks) <= 40 else []:
        if 0 < b < len(x):
            for plot in (top, low):
                plot.mark(x[b], "cut", "a segment with a start of its own")
    fits = [("given", "before"), ("refitted", "refitted"), ("now", "after")]
    caption = element(
        "figcaption",
        element("b", t.component),
        " fit: ",
        join(element("span", f"{name} {fit_percent(_fit(t, kind))}", class_=f"key k-{kind}") for name, kind in fits),
    )
    return element("figure", caption, top.html(), low.html())


def _where(d: Diagnosis, geometry: dict | None) -> list:
    shares: dict[str, float] = {}
    for p in d.places:  # those of one name are one region
        shares[p.site] = shares.get(p.site, 0.0) + p.share
    panels = _panel_shares(d)
    out: list = []
    if geometry is not None:
        out.append(_drawing(geometry, shares, panels))
    blows = [_impulses(d)] if d.impulses else []
    if not d.places:
        return [*out, *(blows or [_nothing("The residual moment could not be located.")])]
    ordered = sorted(d.places, key=lambda p: -_or(p.share, -1.0))
    ids = {p.site: f"place-{n}" for n, p in enumerate(ordered[:PLACES])}
    head = _header("Place", "Share", "Structure [sd]", "Unexplained power", "Departs at")
    body = [
        element(
            "tr",
            element("th", element("a", p.site, href=f"#{ids[p.site]}") if p.site in ids else p.site, scope="row"),
            _bar_cell(p.share),
            element("td", number(p.score), class_="n"),
            element("td", amount(p.power, "W"), class_="n"),
            element("td", amount(p.onset, "s", 3) if np.isfinite(_or(p.onset)) else "never", class_="n"),
        )
        for p in ordered
    ]
    about = (
        "Found without fitting any suspect: the moment that the recorded motion needs minus the moment that the model "
        "has, at each coordinate. Negative power is lost, positive gained."
    )
    alone = [_alone(d)] if d.acting else []
    listed = element("div", element("p", about, class_="quiet"), _table(head, body, "Places"), *alone)
    out = [element("div", *out, listed, class_="map" if out else None)]
    for n, p in enumerate(ordered[:PLACES]):
        out.append(
            element(
                "details",
                element("summary", element("h3", f"Residual moment at {p.site}")),
                _place(p),
                open=n < OPEN_PLACES,
                id=ids[p.site],
            )
        )
    if len(ordered) > PLACES:
        rest = sum(_or(p.share, 0.0) for p in ordered[PLACES:])
        out.append(
            element("p", f"{len(ordered) - PLACES} more places share {percent(rest)}; their curves are in the data.")
        )
    return [*out, *_actions(d), *blows]


def _alone(d: Diagnosis) -> Html:
    """What one action alone leaves of the missing forces."""
    body = [
        element(
            "tr",
            element("th", ", ".join([f"{a.what} {a.site}", *a.same]), scope="row"),
            element("td", number(a.left), class_="n"),
            element("td", f"{a.like} ({a.overlap:.2f})" if a.like else ""),
            element("td", amount(_size(a), a.unit) if a.curves else "", class_="n"),
        )
        for a in d.acting[:DRAWN]
    ]
    about = (
        "If one thing alone acted, as strongly as it takes from moment to moment: what would be left of the missing "
        "forces, in standard deviations (1: nothing), and which other action looks most like it (1: the same)."
    )
    head = _header("Acting alone", "Leaves [sd]", "Most like it", "Size (rms)")
    return element(
        "div", element("h3", "One action"), element("p", about, class_="quiet"), _table(head, body, "Actions")
    )


def _actions(d: Diagnosis) -> list[Html]:
    """The sizes of actions that could each be the mismatch."""
    return [
        element(
            "details",
            element("summary", element("h3", f"If only a {a.what} {a.site}")),
            element("div", *_action(a), class_="figures three"),
            open=not n,
        )
        for n, a in enumerate(a for a in d.acting if a.curves)
    ]


def _size(a: Acting) -> float:
    """Root mean square of an action in time, less its error's."""
    c = a.curves[0]
    return float(np.sqrt(max(np.mean(_array(c.mean) ** 2 - _array(c.error) ** 2), 0.0)))


def _action(a: Acting) -> list[Html]:
    """The size of an action in time, and against what it may go with."""
    time, *rest = a.curves
    name = a.what.split()[0]
    plot = _in_time(name, a.site, a.unit, time.x, time.mean, time.error)
    caption = element("figcaption", element("b", "in time"), " shaded: ± 2 sd")
    return [element("figure", caption, plot.html()), *(_curve(a.site, c, name, a.unit) for c in rest)]


def _impulses(d: Diagnosis) -> Html:
    """Momentum that contacts give, recorded and predicted, the most different first."""
    listed = sorted(d.impulses, key=lambda i: -i.apart)[:BLOWS]
    body = [
        element(
            "tr",
            element("th", f"{i.site}, {i.recording}", scope="row"),
            element("td", amount(i.time, "s", 3), class_="n"),
            *(
                element("td", ", ".join(f"{1e3 * v:.3g}" for v in part), class_="n")
                for part in (i.recorded, i.predicted, i.error)
            ),
            element("td", number(i.apart), class_="n"),
        )
        for i in listed
    ]
    head = _header("Contact", "At", "Recorded", "Refitted model", "Error", "Apart [sd]")
    about = (
        "Impulses on the device (x, y, z) [mN s]: inertia times the change of its rates, from lines through the frames "
        f"before and after each blow. {len(d.impulses)} blows are seen on both sides."
    )
    return element("div", element("h3", "Blows"), element("p", about, class_="quiet"), _table(head, body, "Impulses"))


def _place(p: Place) -> Html:
    unit = "N" if p.site.startswith("shift ") else "N m"
    name = "force" if unit == "N" else "moment"
    figures = []
    if p.times:
        plot = _in_time(f"residual {name}", p.site, unit, p.times, p.moment, p.error)
        if np.isfinite(_or(p.onset)):
            plot.mark(p.onset, "onset", f"departs at {amount(p.onset, 's', 3)}")
        caption = element("figcaption", element("b", "in time"), " shaded: ± 2 sd")
        figures.append(element("figure", caption, plot.html()))
    if p.balance is not None:  # what is left of the change of energy less the work, block by block
        c = p.balance
        plot = _in_time("unexplained power", p.site, "W", c.x, c.mean, c.error)
        width = amount(float(np.median(np.diff(_array(c.x)))), "s", 2) if len(c.x) > 1 else "one block"
        caption = element("figcaption", element("b", "unexplained power"), f" means over {width}, shaded: ± 2 sd")
        figures.append(element("figure", caption, plot.html()))
    figures += [_curve(p.site, c, f"residual {name}", unit) for c in p.curves]
    return element("div", figures or _nothing("No curves."), class_="figures three")


def _in_time(name: str, site: str, unit: str, times: Sequence, values: Sequence, error: Sequence) -> Plot:
    """Something at a place in time, with twice its standard deviation where that is known."""
    x, y, e = _array(times), _array(values), _array(error)
    plot = Plot(
        f"{name} at {site} in time",
        span_of(x, margin=0.0),
        span_of(y, zero=True, margin=0.15),
        x_name="time",
        x_unit="s",
        y_name=name,
        y_unit=unit,
    )
    if len(e) == len(x):
        plot.band(x, y - 2 * e, y + 2 * e, "noise")
    return plot.level(0.0, "zero").line(x, y, "place")


def _curve(site: str, c: Curve, name: str, unit: str) -> Html:
    x, y, e = _array(c.x), _array(c.mean), _array(c.error)
    plot = Plot(
        f"{name} at {site} against {c.against}",
        span_of(x),
        span_of(y - 2 * np.nan_to_num(e), y + 2 * np.nan_to_num(e), zero=True),
        x_name=c.against,
        x_unit=c.unit,
        y_name=name,
        y_unit=unit,
    )
    titles = [
        f"{c.against} {amount(a, c.unit, 3)}: {plus_minus(b, s, unit)}, {n} values"
        for a, b, s, n in zip(x, y, e, c.count, strict=False)
    ]
    plot.level(0.0, "zero").bars(x, y - 2 * e, y + 2 * e, "place").dots(x, y, "place", titles=titles)
    how = " along the motion, bars: ± 2 se" if c.against == REVERSAL else " bars: ± 2 se"
    caption = element("figcaption", element("b", f"against {c.against}"), how)
    return element("figure", caption, plot.html())


def _drawing(g: dict, shares: dict[str, float], panels: dict[str, float]) -> Html:
    """The origami with its creases and panels in the colours of their shares."""
    flat, depth = _projected(_array(g["nodes"]))
    low, high = flat.min(0), flat.max(0)
    size = np.maximum(high - low, 0.02 * float((high - low).max()) or 1.0)
    # a tall or a long strip gets a box of at most 2 : 1 with room for labels
    box = np.maximum(size, size.max() * np.array([0.75, 0.45])) * 1.24
    at = np.column_stack([(flat[:, 0] - (low + high)[0] / 2), -(flat[:, 1] - (low + high)[1] / 2)]) / box + 0.5
    wide, tall = 1000.0, 1000.0 * box[1] / box[0]
    xy = np.round(at * [wide, tall], 1)
    shapes, labels = [], []
    triangles = np.asarray(g["triangles"], int).reshape(-1, 3)
    order = sorted(g["panels"], key=lambda p: float(depth[triangles[p["triangles"]]].mean()) if p["triangles"] else 0.0)
    for panel in order:
        share = panels.get(panel["name"], 0.0)
        path = "".join("M{} {}L{} {}L{} {}z".format(*xy[t].ravel()) for t in triangles[panel["triangles"]])
        edges = "".join("M{} {}L{} {}".format(*xy[list(e)].ravel()) for e in _outline(triangles[panel["triangles"]]))
        title = element("title", f"{panel['name']}: {percent(share) if share else 'not suspected'}")
        fill = element("path", d=path, style=f"fill:{colour(share)};stroke:{colour(share)}", class_="face")
        shapes.append(element("g", title, fill, element("path", d=edges, class_="edge")))
        if share >= 0.05 and panel["triangles"]:
            centre = at[np.unique(triangles[panel["triangles"]])].mean(0)
            labels.append((panel["name"], share, [centre + np.array([0.0, dy]) for dy in (0.0, -0.08, 0.08)]))
    known = [s for s in shares.values() if np.isfinite(s)]
    fewest = sorted(known)[-8] if len(g["creases"]) > 8 and len(known) > 8 else -1.0
    for crease in g["creases"]:
        share = _or(shares.get(crease["name"], np.nan))
        text = f"{crease['name']}: {percent(share)}" if np.isfinite(share) else f"{crease['name']}: not judged"
        d = "M{} {}L{} {}".format(*xy[crease["nodes"]].ravel())
        shapes.append(
            element(
                "g",
                element("title", text),
                element("path", d=d, class_="casing"),
                element("path", d=d, class_="crease", style=f"stroke:{colour(share)}"),
            )
        )
        if np.isfinite(share) and share >= fewest and not any(label[0] == crease["name"] for label in labels):
            a, b = at[crease["nodes"]]
            labels.append((crease["name"], share, [a + t * (b - a) for t in (0.5, 0.2, 0.8, 0.35, 0.65, 0.0, 1.0)]))
    for node in g.get("held", []):
        shapes.append(element("path", d="M{} {}h0".format(*xy[node]), class_="held"))
    svg = element(
        "svg",
        shapes,
        viewBox=f"0 0 {wide:.0f} {tall:.0f}",
        role="img",
        aria_label="the origami, its creases and panels coloured by their share of the mismatch",
    )
    texts = _labels(labels, tall / wide)
    drawn = {c["name"] for c in g["creases"]} | {p["name"] for p in g["panels"]}
    others = [(n, s) for n, s in shares.items() if n not in drawn and _or(s, 0.0) >= 0.01]
    chips = [element("span", f"{n} {percent(s)}", class_="chip") for n, s in sorted(others, key=lambda o: -o[1])]
    ramp = element(
        "div",
        element("span", "0 %"),
        element("i", style="background:linear-gradient(90deg," + ",".join(colour(k / 10) for k in range(11)) + ")"),
        element("span", "100 %"),
        class_="ramp",
    )
    note = "Creases: share of the mismatch. Panels: probability of the candidates that act on them."
    if g.get("held"):
        note += " Squares: held nodes."
    return element(
        "figure",
        element("div", svg, texts, class_="origami", style=f"aspect-ratio:{wide:.0f}/{tall:.0f}"),
        element("figcaption", ramp, note, element("span", " Not on the drawing: ", chips) if chips else None),
        class_="heat",
    )


def _labels(labels: list[tuple[str, float, list]], aspect: float, width: float = 350.0) -> list[Html]:
    """Names where they do not cover each other on a narrow page; where there is no room, the percentage alone."""
    taken: list[tuple[float, float, float]] = []
    out = []
    for name, share, places in sorted(labels, key=lambda label: -label[1]):
        high = 24 / width / aspect
        for text in (f" {name}", ""):
            half = (6.6 * len(percent(share) + text) + 14) / width / 2
            spots = [(float(np.clip(x, half, 1 - half)), float(np.clip(y, high / 2, 1 - high / 2))) for x, y in places]
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


def _candidates(d: Diagnosis) -> list:
    if not d.candidates:
        return [_nothing("No explanation was fitted.")]
    head = _header(
        "Explanation",
        "Probability",
        "Held-out gain",
        "Numbers (95 % interval)",
        "Held-out error",
        "Fit",
        "Why it won or lost",
        "When not to trust it",
    )
    body = []
    joint = any(set(c.label.split(" + ")) == set(d.chosen) for c in d.candidates)
    for c in d.candidates:
        chosen = set(c.label.split(" + ")) == set(d.chosen) if joint else c.label in d.chosen
        errors = [
            element("div", f"{times(m)} ", element("small", amount(v, u, 3)))
            for v, u, m in zip(_padded(c.rms, d), d.units, _each_multiple(d, c.rms), strict=True)
        ]
        body.append(
            element(
                "tr",
                element("th", c.label, element("small", c.kind, class_="tag"), scope="row"),
                _bar_cell(c.probability),
                element("td", plus_minus(_or(c.gain), _or(c.error), sign=True), class_="n"),
                element("td", [_number(n) for n in c.numbers] or MISSING),
                element("td", errors, class_="n"),
                element("td", [element("div", fit_percent(_or(f))) for f in c.fit] or MISSING, class_="n"),
                element("td", f"could not be fitted: {c.failed}" if c.failed else _say(c.why) or MISSING),
                element("td", _say(c.distrust) or MISSING, class_="warn" if c.distrust else None),
                class_="chosen" if chosen else "failed" if c.failed else None,
            )
        )
    about = (
        "Best first. Gain: held-out log score over the refitted nominal model, ± standard error; "
        f"error in multiples of {'the noise' if _has_noise(d) else 'the recorded spread'} and fit by component "
        f"({', '.join(d.components)})."
    )
    return [element("p", about, class_="quiet"), _table(head, body, "Candidates", wide=True)]


def _number(n: Number) -> Html:
    spread, prior = _or(n.spread), _or(n.prior)
    before = None
    if np.isfinite(prior):
        away = f", {abs(_or(n.value) - prior) / spread:.1f} sd away" if np.isfinite(spread) and spread > 0 else ""
        before = element("small", f"before: {amount(prior, n.unit, 3)}{away}")
    bound = element("span", "at its bound", class_="badge") if n.at_bound else None
    value = interval(_or(n.value), _or(n.low), _or(n.high), n.unit)
    return element("div", element("span", n.label, class_="name"), f" {value} ", bound, before, class_="fitted")


def _screening(d: Diagnosis) -> list:
    if not d.screening:
        return [_nothing("Nothing in the catalogue could act on this object in these recordings.")]
    best = d.screening[0]
    summary = f"{len(d.screening)} suspects; the best, {best.label}, scores {number(best.z)} standard deviations"
    if np.isfinite(_or(d.p_value)):
        summary += f", which noise alone would reach somewhere in the list with p {_p_value(d.p_value)}"
    largest = max((abs(s.z) for s in d.screening if np.isfinite(_or(s.z))), default=1.0) or 1.0
    head = _header("Suspect", "Kind", "Score", "Strength by screening", "Explains", "Status")
    rows = [_suspected(s, largest) for s in d.screening]
    out = [element("p", summary + "."), _table(head, rows[:OPEN_SUSPECTS], "Best suspects")]
    if len(rows) > OPEN_SUSPECTS:
        more = element("summary", f"the other {len(rows) - OPEN_SUSPECTS} suspects")
        out.append(element("details", more, _table(head, rows[OPEN_SUSPECTS:], "Other suspects"), class_="small"))
    return [element("details", element("summary", element("h3", "All suspects, scored")), out, open=True)]


def _suspected(s: Suspected, largest: float) -> Html:
    return element(
        "tr",
        element("th", s.label, scope="row"),
        element("td", s.kind),
        _bar_cell(abs(_or(s.z)) / largest, number(_or(s.z))),
        element("td", plus_minus(_or(s.strength), _or(s.error), s.unit), class_="n"),
        element("td", percent(_or(s.explained)), class_="n"),
        element("td", s.status or MISSING),
    )


def _isolability(d: Diagnosis) -> list:
    m = _array(d.isolability)
    if m.size == 0:
        return [_nothing("There are no suspects to tell apart.")]
    head = element("tr", element("th", "Overlap |cos| of the signatures", scope="col"), [
        element("th", str(n + 1), scope="col", class_="n") for n in range(len(d.isolability_labels))
    ])  # fmt: skip
    body = []
    for n, (label, row) in enumerate(zip(d.isolability_labels, m, strict=True)):
        cells = [
            element(
                "td",
                "" if k == n else f"{v:.2f}" if np.isfinite(v) else MISSING,
                class_="cell" + (" light" if is_dark(v) and k != n else "") + (" twin" if v > 0.98 and k != n else ""),
                style=f"background:{'#fff' if k == n else colour(float(v))}",
                title=f"{label} and {d.isolability_labels[k]}",
            )
            for k, v in enumerate(row)
        ]
        body.append(element("tr", element("th", f"{n + 1}  {label}", scope="row"), cells))
    about = (
        "1: the recordings cannot tell the two apart, whatever the noise; 0: entirely different signatures. What the "
        "nominal parameters, starts and the measurement could absorb has been taken out. Framed: more than 0.98."
    )
    return [element("p", about, class_="quiet"), _table(head, body, "Isolability", kind="matrix")]


def _whiteness(d: Diagnosis) -> list:
    if not d.correlations:
        return [_nothing("No correlations were computed.")]
    legend = _legend(("before", "before"), ("after", "now"))
    note = element("p", "Shaded: where 95 % of the values lie if the residual is noise. Lags in seconds.")
    out = []
    for c in d.correlations:
        lags, limit = _array(c.lags), _limit(d, c)
        pairs = [("autocorrelation", c.before, c.after)]
        if len(c.cross_before) or len(c.cross_after):
            pairs.append((f"correlation with {c.against or 'the drive'}", c.cross_before, c.cross_after))
        for name, before, after in pairs:
            plot = Plot(
                f"{name} of the residual of {c.component}",
                span_of(lags, margin=0.02),
                (-1.05, 1.05),
                x_name="lag",
                x_unit="s",
                y_name=name.split(" with")[0],
                height=170,
            )
            if np.isfinite(limit):
                ends = _array(plot.x)
                plot.band(ends, np.full(2, -limit), np.full(2, limit), "noise")
            plot.level(0.0, "zero")
            for kind, values in (("before", before), ("after", after)):
                y = _array(values)
                plot.line(lags[: len(y)], y, kind, title="before" if kind == "before" else "now")
            facts = ""
            if name == "autocorrelation" and np.isfinite(limit):
                facts = f" outside: {percent(_outside(d, c, 'before'))} → {percent(_outside(d, c, 'after'))}"
            caption = element("figcaption", element("b", f"{c.component}, {name}"), facts)
            out.append(element("figure", caption, plot.html()))
    return [element("div", legend, note, class_="legendrow"), element("div", out, class_="figures three")]


def _next(d: Diagnosis) -> list:
    if not d.experiments:
        return [_nothing("No further experiment is proposed.")]
    out = []
    for n, e in enumerate(d.experiments):
        runs = f"{e.repeats} recording{'s' if e.repeats != 1 else ''}"
        out.append(
            element(
                "li",
                element("b", e.what),
                element("span", f"expected separation d′ = {number(_or(e.expected))} in one recording; do {runs}"),
                element("small", "separates ", " from ".join(e.separates)) if e.separates else None,
                class_="best" if n == 0 else None,
            )
        )
    about = "d′ is the distance between the predictions in standard deviations of the noise; best first."
    return [element("p", about, class_="quiet"), element("ol", out, class_="experiments")]


def _baselines(d: Diagnosis) -> list:
    if not d.baselines:
        return [_nothing("No baselines were run.")]
    ours = _multiples(d, d.error_after)
    head = _header("Method", "Held-out error", "Against ours", "Finds")
    body = [
        element(
            "tr",
            element("th", b.name, scope="row"),
            element("td", times(_multiples(d, b.rms)), class_="n"),
            element("td", times(_multiples(d, b.rms) / ours) if ours > 0 else MISSING, class_="n"),
            element("td", b.note or MISSING),
        )
        for b in d.baselines
    ]
    about = "Methods that name no physics, on the same folds. Error in multiples of "
    about += "the noise." if _has_noise(d) else "the recorded spread."
    return [element("p", about, class_="quiet"), _table(head, body, "Baselines")]


def _notes(d: Diagnosis, geometry: dict | None) -> list:
    packed = {"diagnosis": d.to_dict(), "geometry": geometry}
    text = json.dumps(packed, allow_nan=False, separators=(",", ":"))
    link = "data:application/gzip;base64," + base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()
    total = sum(_or(s, 0.0) for s in d.seconds.values())
    stages = [
        element("tr", element("th", k, scope="row"), _bar_cell(_or(s) / (total or np.nan), f"{_or(s, 0.0):.1f} s"))
        for k, s in d.seconds.items()
    ]
    settings = [
        element("tr", element("th", k, scope="row"), element("td", element("code", _setting(v))))
        for k, v in d.settings.items()
        if k != "command"
    ]
    patch = [
        element("tr", element("th", k, scope="row"), element("td", element("code", f"{_or(v):.6g}")))
        for k, v in d.patch.items()
        if np.isfinite(_or(v))
    ]
    command = d.settings.get("command")
    again = [element("pre", element("code", command), tabindex="0")] if command else []
    left = _table(_header("Setting", "Value"), settings, "Settings") if settings else _nothing("Nothing recorded.")
    right = _table(_header("Stage", "Time"), stages, "Time by stage") if stages else _nothing("Not measured.")
    beside = [
        element("div", element("h3", "Settings"), left),
        element("div", element("h3", f"Time: {total:.1f} s" if stages else "Time"), right),
    ]
    again.append(
        element(
            "p",
            element("a", "All data of this page", href=Html(link), download="diagnosis.json.gz"),
            " (JSON, gzip; in Python ",
            element("code", "origami_sim.diagnose.report.read_report(page)"),
            "). The same recordings, model and settings give the same numbers.",
        )
    )
    return [
        element("h3", "Notes on the data"),
        element("ul", [element("li", _say(n)) for n in d.notes]) if d.notes else _nothing("Nothing to remark."),
        element("h3", "Numbers for the calibration"),
        _table(_header("Number", "Value [SI]"), patch, "Patch") if patch else _nothing("Nothing to change."),
        element("h3", "How to reproduce"),
        again,
        element("div", beside, class_="two"),
    ]


# --- numbers


def _array(values) -> np.ndarray:
    """As floats; None, as in JSON, is nan."""
    return np.asarray(values, float)


def _or(value: float | None, other: float = np.nan) -> float:
    """The value, or another if it is None or not finite."""
    return float(value) if value is not None and np.isfinite(value) else other


def _padded(values: Sequence[float], d: Diagnosis) -> np.ndarray:
    """One value per component; nan where there is none."""
    out = np.full(len(d.components), np.nan)
    given = _array(values)[: len(out)]
    out[: len(given)] = given
    return out


def _has_noise(d: Diagnosis) -> bool:
    noise = _padded(d.noise, d)
    return bool(len(noise) and np.all(np.isfinite(noise) & (noise > 0)))


def _each_multiple(d: Diagnosis, rms: Sequence[float]) -> np.ndarray:
    """Errors by component in multiples of the noise, or of the recorded spread where the noise is not known."""
    scale = _padded(d.noise, d)
    if not _has_noise(d):
        recorded = [[_array(t.recorded) for t in d.traces if t.component == c] for c in d.components]
        spread = [float(np.nanstd(np.concatenate(r))) if r else np.nan for r in recorded]
        scale = np.array([s if s > 0 else np.nan for s in spread])
    return _padded(rms, d) / scale


def _multiples(d: Diagnosis, rms: Sequence[float]) -> float:
    """The same, root mean square over components."""
    values = _each_multiple(d, rms)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else np.nan


def _fit(t: Trace, kind: str) -> float:
    """Fit % = 100 (1 - NRMSE) of a prediction."""
    y, f = _array(t.recorded), _array(getattr(t, kind))
    if len(f) != len(y):
        return np.nan
    both = np.isfinite(y) & np.isfinite(f)
    if not both.any():
        return np.nan
    spread = float(np.sqrt(np.mean((y[both] - y[both].mean()) ** 2)))
    return 100 * (1 - float(np.sqrt(np.mean((y[both] - f[both]) ** 2))) / spread) if spread else np.nan


def _limit(d: Diagnosis, c: Correlation) -> float:
    """Half-width of the band that holds 95 % of the correlations of white noise."""
    samples = sum(int(np.isfinite(_array(t.recorded)).sum()) for t in d.traces if t.component == c.component)
    return 1.96 / np.sqrt(samples) if samples else np.nan


def _outside(d: Diagnosis, c: Correlation, kind: str) -> float:
    """Part of the lags (but zero) whose autocorrelation lies outside that band; 0.05 is expected of noise."""
    values, lags = _array(getattr(c, kind)), _array(c.lags)
    values = values[(lags[: len(values)] != 0) & np.isfinite(values)]
    limit = _limit(d, c)
    return float(np.mean(np.abs(values) > limit)) if len(values) and np.isfinite(limit) else np.nan


def _white(d: Diagnosis) -> str:
    """Whether as many lags stand out as noise would have (5 %, with 2 standard errors of that many)."""
    outside = np.array([_outside(d, c, "after") for c in d.correlations])
    outside = outside[np.isfinite(outside)]
    if not len(outside):
        return "not judged"
    lags = sum(max(len(c.lags) - 1, 1) for c in d.correlations)
    close = outside.mean() <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / lags)
    return f"{'like noise' if close else 'not noise'}: {percent(float(outside.mean()))} of lags stand out"


def _rival(d: Diagnosis) -> tuple[str, float]:
    """The suspect that looks most like the chosen one, and their overlap."""
    m = _array(d.isolability)
    at = [n for n, label in enumerate(d.isolability_labels) if label in d.chosen]
    if len(at) != 1 or len(m) < 2:
        return "", np.nan
    row = np.where(np.isfinite(m[at[0]]), m[at[0]], -1.0)
    row[at[0]] = -1.0
    best = int(np.argmax(row))
    return (d.isolability_labels[best], float(row[best])) if row[best] >= 0 else ("", np.nan)


def _panel_shares(d: Diagnosis) -> dict[str, float]:
    """Probability of the candidates that act on a site, by site; of a place, its share."""
    out: dict[str, float] = {}
    for c in d.candidates:
        for site in dict.fromkeys(c.sites):
            out[site] = out.get(site, 0.0) + _or(c.probability, 0.0)
    return out | {p.site: p.share for p in d.places if p.site in out and np.isfinite(_or(p.share))}


def _p_value(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"= {number(p, 1 if p < 0.1 else 2)}"


def _log_place(value: float, low: float, high: float) -> float:
    return float(np.log(value / low) / np.log(high / low))


def _log_ticks(low: float, high: float) -> list[float]:
    steps = (1, 2, 5) if high / low < 60 else (1, 3) if high / low < 300 else (1,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [s * 10.0**p for p in powers for s in steps if low <= s * 10.0**p <= high]


def _setting(value) -> str:
    return "not set" if value is None else json.dumps(value, default=str) if not isinstance(value, str) else value


def _say(text: str) -> str:
    return text.replace("+-", "±")


# --- drawing


def _check(g: dict) -> None:
    """Says which part of a geometry is missing or points nowhere."""
    for key in ("nodes", "triangles", "panels", "creases"):
        if key not in g:
            raise InputError(
                "the geometry lacks a part", field=key, allowed="nodes, triangles, panels, creases and, if any, held"
            )
    nodes, triangles = len(g["nodes"]), len(g["triangles"])
    if not nodes or np.shape(g["nodes"])[1:] != (3,) or not np.isfinite(_array(g["nodes"])).all():
        raise InputError("the geometry needs finite positions", field="nodes", allowed="[N, 3] numbers")
    named = [(f"creases.{c['name']}.nodes", c["nodes"], nodes) for c in g["creases"]]
    named += [(f"panels.{p['name']}.triangles", p["triangles"], triangles) for p in g["panels"]]
    named += [("triangles", np.ravel(g["triangles"]).tolist(), nodes), ("held", g.get("held", []), nodes)]
    for field, values, count in named:
        for value in values:
            if not 0 <= value < count:
                raise InputError("the geometry points nowhere", field=field, value=value, allowed=f"0 to {count - 1}")


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


# --- pieces of the page


def _header(*names: str) -> Html:
    return element("tr", [element("th", n, scope="col") for n in names])


def _table(head: Html, rows: list, label: str, *, wide: bool = False, kind: str = "") -> Html:
    table = element("table", element("thead", head), element("tbody", rows), class_="wide" if wide else kind or None)
    return element("div", table, class_="scroll", role="region", aria_label=label, tabindex="0")


def _bar_cell(part: float, text: str | None = None) -> Html:
    filled = float(np.clip(_or(part, 0.0), 0.0, 1.0))
    bar = element("i", element("i", style=f"width:{100 * filled:.1f}%"), class_="bar")
    return element("td", element("span", percent(_or(part)) if text is None else text), bar, class_="n barred")


def _legend(*entries: tuple[str, str]) -> Html:
    return element("p", [element("span", name, class_=f"key k-{kind}") for kind, name in entries], class_="legend")


def _nothing(text: str) -> Html:
    return element("p", text, class_="nothing")
