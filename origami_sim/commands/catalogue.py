"""The catalogue of effects as data and as text, for `origami-sim effects`."""

from typing import Any

from origami_sim.effects import CATALOGUE, Effect, get

_KEYS = ("name", "family", "formula", "source", "matters", "confused_with", "separated_by")
_OF_PARAMETER = ("name", "symbol", "unit", "default", "bounds", "meaning")


def entries(name: str | None = None) -> list[dict[str, Any]]:
    """One effect, or all of them, as plain data; InputError for one that there is not."""
    return [
        {k: getattr(e, k) for k in _KEYS}
        | {"parameters": [{k: getattr(p, k) for k in _OF_PARAMETER} for p in e.parameters]}
        for e in _chosen(name)
    ]


def text(name: str | None = None) -> str:
    """One effect, or all of them, to read; InputError for one that there is not."""
    lines = []
    for e in _chosen(name):
        lines += [f"{e.name}  ({e.family})\n    {e.formula}", f"    matters: {e.matters}"]
        if e.confused_with:
            lines.append(f"    confused with: {e.confused_with}\n    separated by: {e.separated_by}")
        lines.append(f"    source: {e.source}")
        for p in e.parameters:
            limits = f"default {p.default:g}, {p.bounds[0]:g} to {p.bounds[1]:g}"
            lines.append(f"    {p.name:18s} {p.symbol:8s} [{p.unit}]  {limits}: {p.meaning}")
        lines.append("")
    return "\n".join(lines)


def _chosen(name: str | None) -> list[Effect]:
    return [get(name)] if name else list(CATALOGUE.values())
