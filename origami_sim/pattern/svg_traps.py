"""What a damaged drawing may hold on which the parser would work for hours: taken out, or refused."""

import re

from ..errors import InputError

LONGEST = 10_000
"""Characters of an attribute other than coordinates and links. Inkscape's longest style has 2,000."""

LONG = ("d", "points", "href")
CLOSES = re.compile(r"([zZ])(?:[\s,]*[zZ])+")


def defuse(root, *, file=None) -> None:
    """Changes an XML tree so that its parts can be parsed in a time that grows with their size.

    Of closes of a path that follow each other, one is kept: the others draw nothing, and each looks for its beginning.
    Of a style sheet, what follows the last whole rule is dropped: the parser's expression tries every start in it.

    Raises:
        InputError: an attribute beyond `LONGEST`, which is no coordinates and no link.
    """
    for element in root.iter():
        for name, value in element.attrib.items():
            if name == "d":
                element.attrib[name] = CLOSES.sub(r"\1", value)
            elif len(value) > LONGEST and name not in LONG and "}" not in name:
                raise InputError(
                    "an attribute is too long", file=file, field=name[:60], allowed=f"up to {LONGEST} characters"
                )
        if isinstance(element.tag, str) and element.tag.rpartition("}")[2] == "style" and element.text:
            opened = element.text.rfind("{")
            closed = element.text.find("}", opened) if opened >= 0 else -1
            element.text = element.text[: closed + 1]
