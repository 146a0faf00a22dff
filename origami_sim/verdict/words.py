"""Words for what a diagnosis found."""

from collections.abc import Collection, Sequence

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.least_squares import Fit
from origami_sim.hypotheses.hypothesis import Free, Suspect
from origami_sim.quantities import ANY
from origami_sim.units import quantity

WHOLE = ("the measurement", "the drive", "the ground")
"""Sites that an effect's title says already."""

PEOPLE = ("Coulomb", "Kelvin", "Maxwell", "Mullins", "Stribeck")
"""Names with which titles of effects begin; they keep their capital."""


def distinct(fits: Sequence[Fit]) -> list[str]:
    """Labels of the explanations of fits, each once."""
    return list(dict.fromkeys(f.hypothesis.label for f in fits))


def say(f: Fit, *, only: Collection[str] | None = None) -> str:
    """The effects of a fit, all or `only` some, with their sites and strengths: those of the device first, each once.

    Intervals are left to the table where there are more than two: a headline has to be read at a glance. Of a single
    one its other numbers are said, as a time constant. A mass at several nodes is said as their sum.
    """
    sites: dict[str, list[str]] = {}
    every = [s for s in f.hypothesis.suspects if only is None or s.effect in only]
    every.sort(key=lambda s: s.kind == "measurement")
    deviation = dict(zip((id(n) for n in f.free), f.deviations(), strict=True))
    value = dict(zip((id(n) for n in f.free), f.theta, strict=True))
    bound = dict(zip((id(n) for n in f.free), f.at_bound, strict=True))
    ends = dict(zip((id(n) for n in f.free), zip(*f.intervals(), strict=True), strict=True))
    for s in every:
        n = max(s.strengths, key=lambda n: abs(value[id(n)]) / max(deviation[id(n)], 1e-300))
        mass = n.unit == "kg" and get(s.effect).family == "node"
        t, d = n.nodes * value[id(n)], n.nodes * deviation[id(n)]
        digits = 2 + int(np.clip(np.log10(0.5 * abs(t) / max(d, 1e-300)), 0, 4)) if t else 2
        low, high = (said(n.nodes * v, n.unit, digits) for v in ends[id(n)])
        what = f"{'more' if t > 0 else 'less'} {title(s.effect)} than stated" if s.more else title(s.effect)
        at_each = " in all" if n.nodes > 1 else " at each node" if mass and not n.entities else ""
        strength = f"{_named(n, s)} {said(t, n.unit, digits)}{at_each}"
        where = f"at {s.site} " if s.site not in WHOLE else ""
        interval = f", 95 %: {low} to {high}" if len(every) <= 2 else ""
        gone = {n.name.rpartition("_")[2] for n in s.strengths if bound[id(n)]}  # branches of a spectrum
        shape = [n for n in s.free if n not in s.strengths and not bound[id(n)]] if len(every) == 1 else []
        shape = [n for n in shape if n.name.rpartition("_")[2] not in gone]
        more = "".join(f"; {_named(n, s)} {said(value[id(n)], n.unit)}" for n in shape[:2])
        sites.setdefault(what, []).append(f"{where}({strength}{interval}{more})")
    return joined([f"{what} {joined(each)}" for what, each in sites.items()])


def _named(n: Free, s: Suspect) -> str:
    """A number of a suspect in words; that of a branch or a term says which, if there are several."""
    name, _, place = n.name.rpartition("_")
    if not place.isdigit():
        return n.name.replace("_", " ")
    several = any(f.name == f"{name}_{int(place) + 1}" or place != "1" for f in s.free)
    of = "branch" if any(f.name.startswith("time") for f in s.free) else "term"
    return f"{name}, {of} {place}:" if several else name


def said(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit; a plain factor has none, and what a device states without one."""
    return f"{value:.{digits}g}" if unit in ("-", "1", "", ANY) else quantity(value, unit, digits=digits)


def change(before: float, after: float, unit: str) -> str:
    """From which number to which, with so many digits that two of the difference are told."""
    off = abs(after - before) / max(abs(before), abs(after), 1e-300)
    digits = max(3, min(1 + int(np.ceil(-np.log10(off))), 9)) if off > 0.0 else 3
    return f"from {said(before, unit, digits)} to {said(after, unit, digits)}"


def title(effect: str) -> str:
    """The first words of an effect's file: its name as a physicist would say it."""
    import importlib

    e = get(effect)
    text = importlib.import_module(f"origami_sim.effects.{e.name}").__doc__ or e.name
    text = text.strip().splitlines()[0].split(":")[0].rstrip(".")
    first = text.split()[0]
    named = first.startswith(PEOPLE) or (len(first) > 1 and first.isupper())
    return text if named else text[0].lower() + text[1:]


def joined(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
