"""What a designer states about a sheet: each statement takes quantities with units and is remembered as it was made."""

import copy
import functools
import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

import numpy as np

from origami_sim.effects import CONTACTS, get
from origami_sim.errors import InputError, misfit, nearest
from origami_sim.quantities import converted

P = ParamSpec("P")
S = TypeVar("S", bound="Statements")
R = TypeVar("R")


def statement(**units: str) -> Callable[[Callable[Concatenate[S, P], R]], Callable[Concatenate[S, P], R]]:
    """Makes a method a statement: it takes quantities as text, and is remembered, for a design file to repeat it.

    What it calls itself, such as the `magnetise` of a `patch`, is not remembered again.

    Args:
        units: SI unit of each argument that may be a quantity, "1 mm".
    """

    def wrap(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
        signature, name = inspect.signature(method), getattr(method, "__name__", "")
        kinds = {p.kind: n for n, p in signature.parameters.items()}
        free, listed = kinds.get(inspect.Parameter.VAR_KEYWORD), kinds.get(inspect.Parameter.VAR_POSITIONAL)

        @functools.wraps(method)
        def stated(self: S, *args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = dict(signature.bind(self, *args, **kwargs).arguments)
            except TypeError as e:
                raise misfit(f"Sheet.{name}", signature, kwargs, e) from None
            del given["self"]
            given = {n: list(v) if isinstance(v, Iterator) else v for n, v in given.items()}
            given |= given.pop(free, {}) if free else {}
            remembered = {} if self._within else copy.deepcopy(given)
            in_si = {n: converted(v, units[n], n) if n in units else v for n, v in given.items()}
            positional = in_si.pop(listed, ()) if listed else ()
            outermost, self._within = not self._within, True
            try:
                out = method(self, *positional, **in_si)  # pyright: ignore[reportCallIssue]
            except ValueError as e:  # of NumPy, about a word or a list where numbers belong
                raise e if isinstance(e, InputError) else InputError(f"Sheet.{name} cannot be stated so ({e})") from e
            finally:
                self._within = not outermost
            if outermost:
                self.statements.append((name, remembered))
            return out

        return stated

    return wrap


class Statements(ABC):
    """The part of `Sheet` that remembers what was stated, and knows the effects that are switched on."""

    statements: list[tuple[str, dict[str, Any]]]
    _within = False
    _effects: list[str]
    _settings: list[tuple[str, str, Any, Any]]

    @statement()
    def on(self, *effects: str) -> Self:
        """Switches effects on."""
        self._switch_on(*effects)
        return self

    def _switch_on(self, *effects: str) -> None:
        """The same, for what follows from statements and is none."""
        for e in effects:
            get(e)
            if e not in self._effects:
                self._effects.append(e)

    @statement()
    def set(self, effect: str, entities=None, **parameters) -> Self:
        """Switches an effect on and sets parameters for all entities of its family, or for some.

        Args:
            entities: their numbers in the effect's family (default: all).
            parameters: SI, or quantities ("2 mN m/rad"): one for all, or one per entity.

        Raises:
            InputError: no such effect, no such parameter or entity.
        """
        known = {p.name: p for p in get(effect).parameters}
        for name, value in parameters.items():
            if name not in known:
                raise InputError(
                    f"the effect has no such parameter{nearest(name, known)}",
                    field=f"{effect}.{name}",
                    value=value,
                    allowed=", ".join(known),
                )
        if entities is not None:
            self._check_entities(effect, np.atleast_1d(np.asarray(entities, int)))
        self.on(effect)
        for name, value in parameters.items():
            self._settings.append((effect, name, converted(value, known[name].unit, f"{effect}.{name}"), entities))
        return self

    def _check_entities(self, effect: str, entities: np.ndarray) -> None:
        """Refuses entities that the sheet does not have; contact points may still be added."""
        family = get(effect).family
        count = self._family_counts().get(family)
        bad = entities[(entities < 0) | (entities >= count)] if count is not None and family not in CONTACTS else []
        if len(bad):
            raise InputError(
                f"the sheet has no such {family}", field=effect, value=int(bad[0]), allowed=f"0 to {(count or 0) - 1}"
            )

    @abstractmethod
    def _family_counts(self) -> dict[str, int]:
        """Number of entities by family of effects, as far as the sheet is stated."""
