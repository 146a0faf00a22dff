"""Numbers stated in a paper: found in its text by the words around them, with quote and place as provenance."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from origami_sim.calibrate.result import Calibration, Quantity
from origami_sim.errors import InputError
from origami_sim.files import read_bytes
from origami_sim.units import UNITS

MORE_UNITS = {
    "kg/m^3": ("kg/m^3", 1.0),
    "g/cm^3": ("kg/m^3", 1e3),
    "Hz": ("Hz", 1.0),
    "kG": ("T", 0.1),
    "GPa": ("Pa", 1e9),
    "MV/m": ("V/m", 1e6),
    "V/m": ("V/m", 1.0),
    "degrees": ("rad", math.pi / 180),
}
"""Units that papers print and recordings do not: SI unit and factor."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:\s?[eE][-+]?\d+)?"

QUOTE = 70
"""Characters of the quote on either side of the number, cut at words."""


@dataclass(frozen=True)
class Wanted:
    """A number to look for.

    Attributes:
        name: of the setting. unit: as printed; None takes the word behind the number; "1" for a bare ratio.
        phrase: words around the number, which is marked by #.
    """

    name: str
    unit: str | None
    phrase: str

    @classmethod
    def parse(cls, text: str) -> "Wanted":
        """From NAME=PHRASE or NAME[UNIT]=PHRASE; raises InputError."""
        match = re.fullmatch(r"([a-z][a-z0-9_]*)(?:\[([^\]]*)\])?=(.*)", text, re.DOTALL)
        if not match or match[3].count("#") != 1 or len(match[3].strip()) < 4:
            raise InputError("cannot read what to take", field="--take", value=text,
                             allowed="NAME=WORDS # WORDS or NAME[UNIT]=WORDS # WORDS, # for the number")  # fmt: skip
        return cls(match[1], match[2], match[3].strip())


def read_text(path: str | Path) -> str:
    """The text of a paper; raises InputError for a PDF file and for what is not text."""
    path = Path(path)
    if path.suffix.lower() == ".pdf":
        raise InputError("is a PDF file; take its text out first", file=path, allowed="a text file (pdftotext -layout)")
    try:
        text = read_bytes(path).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError("is not a text file", file=path, allowed="UTF-8 text") from None
    if not text.strip():
        raise InputError("is empty", file=path, allowed="the text of a paper")
    return text


def find(text: str, wanted: Wanted, *, file: object = None) -> Quantity:
    """The number wanted, in SI, with its place and a quote as source.

    White space in text and phrase is equal whatever its kind, so that a line may break anywhere; case does not matter.
    Pages are counted by form feeds, as PDF converters write them.

    Raises:
        InputError: the words do not occur, or occur with different numbers; the unit is missing or unknown.
    """
    before, after = (r"\s+".join(map(re.escape, part.split())) for part in wanted.phrase.split("#"))
    pattern = rf"{before}\s*(?P<number>{NUMBER}){rf'(?=.{{0,12}}?{after})' if after else ''}"
    hits = list(re.finditer(pattern, text, re.IGNORECASE | re.DOTALL))
    if not hits:
        raise InputError("the words do not occur beside a number", file=file, field=wanted.name, value=wanted.phrase,
                         allowed="words as the text has them, # for the number")  # fmt: skip
    values = [(_si(text, hit, wanted, file), hit) for hit in hits]
    (value, unit, printed), hit = values[0]
    for (other, in_unit, _), again in values[1:]:
        if in_unit != unit or not math.isclose(other, value, rel_tol=1e-9):
            lines = " and ".join(str(_line(text, h.start("number"))) for h in (hit, again))
            raise InputError(f"the words occur with different numbers, in lines {lines}", file=file, field=wanted.name,
                             value=wanted.phrase, allowed="words that occur once")  # fmt: skip
    place = f"line {_line(text, hit.start('number'))}"
    if "\f" in text:
        place = f"page {text.count(chr(12), 0, hit.start('number')) + 1}, {place}"
    source = f'{Path(str(file)).name if file else "text"}, {place}: "{_quote(text, hit)}"'
    meaning = f"as printed: {hit['number']} {printed}".rstrip()
    return Quantity(wanted.name, value, unit, meaning, source)


def stated(path: str | Path, take: Sequence[str], *, command: str, named: str | None = None) -> Calibration:
    """A calibration of numbers that a paper states.

    Args:
        path: text file. take: what to look for, as `Wanted.parse` reads it. command: re-creates the calibration.
        named: how the source calls the file; its own name when None.

    Raises:
        InputError: what `read_text`, `Wanted.parse` and `find` refuse; nothing to take; a name twice.
    """
    if not take:
        raise InputError("nothing to take from the text", file=path, field="--take", allowed="NAME=WORDS # WORDS")
    text = read_text(path)
    wanted = [Wanted.parse(t) for t in take]
    names = [w.name for w in wanted]
    for name in names:
        if names.count(name) > 1:
            raise InputError("this name stands twice", field="--take", value=name)
    found = tuple(find(text, w, file=path) for w in wanted)
    title = f"Numbers stated in {named or Path(path).name}"
    return Calibration(title, command, found, ("printed numbers, not checked against anything; read them in context",))


def _si(text: str, hit: re.Match, wanted: Wanted, file: object) -> tuple[float, str, str]:
    """Value in SI, SI unit, unit as read."""
    number = float(re.sub(r"\s", "", hit["number"]))
    known = {u: (next(iter(group)), f) for group in UNITS.values() for u, f in group.items()} | MORE_UNITS
    unit = wanted.unit
    if unit is None:
        tail = text[hit.end("number") :][:20].replace("µ", "u").replace("μ", "u").replace("³", "^3")
        match = re.match(r"\s*([A-Za-z%][A-Za-z0-9^/%]*)", tail)
        unit = match[1] if match else ""
    if unit not in known:
        raise InputError(
            "the number has no unit that is known; state it as NAME[UNIT]=...", file=file, field=wanted.name,
            value=f"{hit['number']} {unit}".strip(), allowed=", ".join(known),
        )  # fmt: skip
    si, factor = known[unit]
    return number * factor, si, "" if unit == "1" else unit


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1


def _quote(text: str, hit: re.Match) -> str:
    """The words around the number on one line, cut at words, never ending within the number."""
    first, last = max(hit.start("number") - QUOTE, 0), min(hit.end("number") + QUOTE, len(text))
    if first and not text[first - 1].isspace():
        first = next((k for k in range(first, hit.start("number")) if text[k].isspace()), hit.start("number"))
    if last < len(text) and not text[last].isspace():
        last = next((k for k in range(last, hit.end("number"), -1) if text[k - 1].isspace()), hit.end("number"))
    return " ".join(text[first:last].split()).replace('"', "'")
