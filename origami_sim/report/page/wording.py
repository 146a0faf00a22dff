"""Identifiers of the catalogue turned into words, wherever a reader would meet them."""

import re
from functools import cache

from origami_sim.effects import CATALOGUE, get
from origami_sim.hypotheses.hypothesis import SEPARATOR
from origami_sim.report.page.markup import raised
from origami_sim.verdict.words import WHOLE, title

_NUMBER = re.compile(r"\b([a-z_0-9]+)\.([a-z_0-9]+)\b(?:\[([^\]]+)\])?")
_PLAIN_OWNERS = ("inertia", "setting")
"""Owners of a model's numbers that are no effects and say nothing to a reader."""


def words_of(label: str) -> str:
    """An explanation in words, as "dry friction at hinge2"; of several, joined by "with"."""
    return " with ".join(_effect(part) for part in label.split(SEPARATOR))


def number_of(label: str, *, owner: bool = True) -> str:
    """A fitted number in words: "viscosity of viscous damping"; without its owner, "viscosity"."""
    found = _NUMBER.fullmatch(label)
    if found is None:
        return label.replace("_", " ")
    text = found[2].replace("_", " ")
    if owner and found[1] in CATALOGUE:
        text += f": {title_of(found[1])}"
    return text + (f", {found[3]}" if found[3] else "")


def worded(text: str) -> str:
    """A sentence without identifiers: effects by their titles, numbers by their words, signs as they are printed."""

    def said(m: re.Match) -> str:
        if m[1] not in CATALOGUE and m[1] not in _PLAIN_OWNERS:
            return m[0]
        of = f" of {title_of(m[1])}" if m[1] in CATALOGUE else ""
        return m[2].replace("_", " ") + (f" at {m[3]}" if m[3] else "") + of

    text = _NUMBER.sub(said, text)
    text = _names().sub(lambda m: title_of(m[0]), text)
    return raised(text.replace("+-", "±"))


@cache
def title_of(effect: str) -> str:
    """An effect in words; a name that is not in the catalogue as it is, without underscores."""
    return title(effect) if effect in CATALOGUE else effect.replace("_", " ")


def effect_of(label: str) -> str:
    """The name in the catalogue of a label's effect; "" if it names none."""
    name = label.partition(" at ")[0]
    return get(name).name if name in CATALOGUE else ""


def site_of(label: str) -> str:
    return label.partition(" at ")[2]


def _effect(label: str) -> str:
    name, at, site = label.partition(" at ")
    if name not in CATALOGUE:
        return worded(label)
    return title_of(name) if site in WHOLE else f"{title_of(name)}{at}{site}"


@cache
def _names() -> re.Pattern:
    """Names of effects that no sentence would hold by chance; a single word is a word already."""
    names = sorted((n for n in CATALOGUE if "_" in n), key=len, reverse=True)
    return re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})\b")
