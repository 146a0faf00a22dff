"""Errors that a user can act on: one sentence naming the file, field, value and what is allowed."""

import difflib
from collections.abc import Iterable


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of a sentence that refuses a name: what it nearly is, or nothing."""
    return "".join(f"; '{n}' is near" for n in difflib.get_close_matches(str(name), [*known], n=1))


class InputError(ValueError):
    """Bad input from a user. The command line prints the sentence and exits with code 2.

    Args:
        what: what is wrong, as the start of a sentence.
        file: the file it was read from, if any.
        field: the field, argument or entity, if any.
        value: the offending value, if any.
        allowed: what would have been accepted, if it can be said briefly.
    """

    def __init__(self, what, *, file=None, field=None, value=None, allowed=None):
        parts = [str(file) + ":" if file is not None else None, what.rstrip(".")]
        if field is not None:
            parts.append(f"(field '{field}'" + (f", value {value!r}" if value is not None else "") + ")")
        elif value is not None:
            parts.append(f"(value {value!r})")
        sentence = " ".join(p for p in parts if p)
        if allowed is not None:
            sentence += f"; allowed: {allowed}"
        super().__init__(sentence + ".")
        self.file, self.field, self.value, self.allowed = file, field, value, allowed
