"""Errors that a user can act on: one sentence naming the file, field, value and what is allowed."""

import difflib
import errno
import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


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
        parts = [_brief(file) + ":" if file is not None else None, _brief(what).rstrip(".")]
        shown = None if value is None else _brief(repr(value))
        if field is not None:
            parts.append(f"(field '{_brief(field)}'" + (f", value {shown}" if shown is not None else "") + ")")
        elif shown is not None:
            parts.append(f"(value {shown})")
        sentence = " ".join(p for p in parts if p)
        if allowed is not None:
            sentence += f"; allowed: {_brief(allowed, 1200)}"
        super().__init__(sentence + ".")
        self.what, self.file, self.field, self.value, self.allowed = what, file, field, value, allowed


def misfit(name: str, signature: inspect.Signature, given: Mapping[str, Any], error: TypeError) -> InputError:
    """The refusal of a call with arguments that a function does not have, or without one that it needs.

    Args:
        name: of the function, for the sentence. signature: its own. given: by name. error: what Python says of it.
    """
    known = [n for n in signature.parameters if n != "self"]
    strange = next((n for n in given if n not in known), None)
    if strange is None:
        return InputError(f"{name} cannot be stated so ({error})", allowed=", ".join(known))
    return InputError(
        f"{name} has no such argument{nearest(strange, known)}",
        field=strange,
        value=given[strange],
        allowed=", ".join(known),
    )


def named_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Lets a function refuse arguments that it does not have by a sentence with the nearest name.

    Raises:
        InputError: of the function that is returned, on such arguments.
    """
    signature = inspect.signature(function)
    name = getattr(function, "__qualname__", "").removesuffix(".__init__")

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            signature.bind(*args, **kwargs)
        except TypeError as e:
            raise misfit(name, signature, kwargs, e) from None
        return function(*args, **kwargs)

    return checked


class DiskFull(InputError):
    """There is no room left where something should be written."""


def unwritable(error: OSError, *, file, allowed=None) -> InputError:
    """What an operating system's refusal to write is for the user."""
    kind = DiskFull if error.errno in (errno.ENOSPC, errno.EDQUOT) else InputError
    return kind(f"cannot be written ({error.strerror or error})", file=file, allowed=allowed)


def _brief(text, most=400) -> str:
    """The text on one line, its middle left out where it is long: a damaged file may hold a word of a megabyte."""
    text = str(text)
    if len(text) > most:
        text = f"{text[: most // 2]} ... {text[-most // 4 :]}"
    return "".join(c if c.isprintable() else " " for c in text)
