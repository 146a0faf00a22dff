"""Which effects of the catalogue may have been left out of a device's model, and where each may act."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import boxcox

from origami_sim.drive import Drive
from origami_sim.effects import CATALOGUE, CONTACTS, DISTORTIONS, get
from origami_sim.effects._effect import Effect
from origami_sim.hypotheses.hypothesis import ACROSS, ALONG, ANCHORS, PLAUSIBLE, Free, Suspect
from origami_sim.model import Model, Parameters, magnets
from origami_sim.model.places import points, stretches
from origami_sim.recording import Recording


def suspects(
    model: Model, recordings: Sequence[Recording], drive: Drive, parameters: Parameters | None = None
) -> list[Suspect]:
    """Everything in the catalogue that could act on this object, and more or less of what its model has at one place.

    An effect of the drive is a suspect only if the channels that it acts on are driven; one of the measurement, if a
    channel of its kind was recorded; one of the ground, if the device has contact points. Creases, panels and feet are
    suspected one by one and all together; those that share a name are one. An effect that the model has at no strength
    is a suspect like any other. One of which more has to be stated (`Effect.stated`) is one if the model states that,
    for it or for another effect of its family.
    """
    kinds = {c.kind for r in recordings for c in r.channels.values()}
    driven = _driven(recordings, drive)
    found = []
    for name, effect in CATALOGUE.items():
        if not effect.fitted or not model.count(effect.family):
            continue
        if name in model.effects and not (parameters and _off(parameters, name)):
            found += _more_of(model, name, parameters)
            continue
        if effect.stated and not any(_tells(model, n, effect) for n in model.effects):
            continue
        if effect.family == "measurement" and effect.channels and not kinds & set(effect.channels):
            continue
        if effect.family == "drive" and not any(n.split("_")[0] in driven for n in (name, *effect.channels)):
            continue
        # the pull of a gradient comes beside the torque of a field, if there is one
        alone = {"time"} | ({"gradient"} if "field" in effect.drives else set())
        if not set(effect.drives) - alone <= driven:
            continue
        if effect.interacts and not (parameters and _several_magnets(model, parameters)):
            continue
        sites = _sites(model, effect.family)
        if effect.interacts or any(p.name in ACROSS for p in effect.parameters):
            # magnets act on each other, and the field's form is one for all of them
            sites = [("all panels", "panel", None)]
        if any(p.name == ALONG for p in effect.parameters):  # along what has stretches
            sites = [("all creases", "crease", None)] if stretches(model, "crease") else []
        if any(p.name in ANCHORS for p in effect.parameters):
            sites += _edges(model)
        if effect.inertia is not None:  # what was added sits at a point, what was mistaken is a panel's
            at = _distinct([*_edges(model), *points(model)]) if _in_kilograms(effect) else []
            if _in_kilograms(effect):  # nodes that move, so that what is said is the mass of all of them
                sites = [("the body", "body", tuple(np.flatnonzero(model.free.any(axis=1)).tolist()))]
            sites = at or [*sites, *_panels(model)]
        if effect.family == "measurement":
            sites = _channel_sites(recordings[0], effect.channels)
            if effect.on_body and len(sites) > 1:  # each marker is beside its own point
                sites = sites[1:]
        fitted = _across(effect, parameters) or effect.fitted
        for site, kind, entities in sites:
            free = tuple(_within(free_number(name, p, entities), parameters) for p in fitted)
            found.append(Suspect(name, site, kind, free, entities, _among(effect.family, sites, entities)))
        parts = stretches(model, effect.family) if effect.uneven else []
        for site, kind, entities in parts:
            free = tuple(_within(free_number(name, p, entities), parameters) for p in effect.fitted)
            found.append(Suspect(name, site, kind, free, entities, len(parts) + 1, stretch=True))
    return found


def _among(family: str, sites, entities) -> int:
    """Of how many equally likely sites it is one. A recorder is as likely to be wrong as any of its channels is."""
    single = sum(e is not None for *_, e in sites)
    if family != "measurement" or not 0 < single < len(sites):
        return len(sites)
    return 2 if entities is None else 2 * single


def _more_of(model: Model, name: str, parameters: Parameters | None) -> list[Suspect]:
    """An effect that the model has, stronger or weaker at one crease, panel or foot than was thought."""
    effect = get(name)
    each = [s for s in _sites(model, effect.family) if s[2] is not None]
    if effect.family not in ("crease", "triangle", *CONTACTS) or len(each) < 2 or effect.interacts:
        return []
    out = []
    for site, kind, entities in each:
        strength = free_number(name, effect.fitted[0], entities)
        if parameters:  # no less than nothing is left
            strength = replace(
                strength, lower=strength.lower - float(np.min(parameters[name, strength.name][list(entities)]))
            )
        out.append(Suspect(name, site, kind, (strength,), entities, len(each), more=True))
    return out


def _within(number: Free, parameters: Parameters | None) -> Free:
    """The number, which leaves no less than nothing of what the model has and it takes away from."""
    owner, _, name = get(number.owner).parameter(number.name).takes.partition(".")
    if parameters is None or (owner, name) not in parameters:
        return number
    there = parameters[owner, name]
    mine = there if number.entities is None else there[list(number.entities)]
    if not np.any(mine > 0.0):  # another law may have what this one has not
        return number
    return replace(number, lower=max(number.lower, -float(np.min(mine))))


def _across(effect: Effect, parameters: Parameters | None) -> tuple[str, ...]:
    """Components of an effect's vector across that of another, which they turn; none if there is no such vector."""
    owner = effect.across
    if not owner or parameters is None or (owner, f"{owner}_x") not in parameters:
        return ()
    size = [float(np.abs(parameters[owner, f"{owner}_{axis}"]).mean()) for axis in "xyz"]
    most = "xyz"[int(np.argmax(size))]
    return tuple(p.name for p in effect.parameters if p.name[-2:] in {"_x", "_y", "_z"} - {f"_{most}"})


def _tells(model: Model, name: str, effect: Effect) -> bool:
    """Whether an effect of the model has what another one needs to be told."""
    return get(name).family == effect.family and set(effect.stated) <= {p.name for p in get(name).parameters}


def _several_magnets(model: Model, parameters: Parameters) -> bool:
    """Whether panels are magnets that do not join."""
    stated = {owner for owner, name in parameters if name == "poling_n"}
    return any(int(magnets(model, parameters, owner).max(initial=-1)) > 0 for owner in stated)


def _off(parameters: Parameters, name: str) -> bool:
    """Whether an effect of the model has no strength anywhere, in no component."""
    fitted = [get(name).parameter(p) for p in get(name).fitted]
    return not any(np.any(parameters[name, p.name]) for p in fitted if p.unit == fitted[0].unit)


def _driven(recordings: Sequence[Recording], drive: Drive) -> set[str]:
    names = {n for n, s in drive.signals.items() if not s.is_zero}
    names |= {n for r in recordings for n, c in r.drive.items() if np.any(c.values)}
    if drive.placed or any(r.sources for r in recordings):  # magnets and coils make a field
        names |= {"field", "gradient"}
    return {n.split("_")[0] for n in names} | ({"drive"} if names else set())


def _channel_sites(recording: Recording, kinds: Sequence[str]):
    """All channels that an effect of the measurement can act on, together and one by one."""
    each = [
        (f"channel {c.name}", "measurement", (n,))
        for n, c in enumerate(recording.channels.values())
        if not kinds or c.kind in kinds
    ]
    return [("the measurement", "measurement", None), *(each if len(each) > 1 else [])]


def named(names: Sequence[str]) -> dict[str, list[int]]:
    """Indices by name, in the order in which names occur."""
    out: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        out.setdefault(name, []).append(k)
    return out


def _sites(model: Model, family: str):
    """(site in words, kind, entities) of a family."""
    if family in DISTORTIONS:
        return [("the " + family, family, None)]
    if family in CONTACTS:
        each = _feet(model)
        every = tuple(sorted(k for _, _, mine in each for k in mine))
        if every and len(every) < len(model.contacts):  # the belly may touch as well
            each = [*each, ("all feet", "ground", every)]
        return [*each, ("the ground", "ground", None)]
    if family == "crease":
        names = [model.name("crease", c) for c in range(len(model.creases))]
        each = [(n, "crease", tuple(c)) for n, c in named(names).items()]
        return each if len(each) == 1 else [*each, ("all creases", "crease", None)]
    if family == "triangle":
        names = [model.name("panel", p) for p in model.triangle_panel]
        each = [(n, "panel", tuple(t)) for n, t in named(names).items()]
        free = [e for e in each if np.any(model.free[np.unique(model.triangles[list(e[2])])])]
        return free if len(free) == 1 else [*free, ("all panels", "panel", None)]
    return [("the body", "body", None)]


def _feet(model: Model):
    """Sites of feet of several contact points: those that share a name, or else a panel; none if there is only one.

    Where some contact points have a forward axis, which feet have, the others are the sheet's own.
    """
    forward = np.any(model.contact_axes, axis=1)
    own = np.flatnonzero(forward if forward.any() else ~forward).tolist()
    carried = zip(model.triangles.tolist(), model.triangle_panel, strict=True)
    panels = {frozenset(t): model.name("panel", p) for t, p in carried}
    for labels in (
        [model.name("contact", k) for k in own],
        [f"feet of {panels.get(frozenset(model.contacts[k].tolist()), 'the sheet')}" for k in own if forward[k]],
    ):
        feet = [(n, "ground", tuple(own[i] for i in at)) for n, at in named(labels).items() if len(at) > 1]
        if len(feet) > 1:
            return feet
    return []


def _edges(model: Model):
    """Where something may be tied to each panel: its free nodes on the sheet's edge, those of no other panel if any."""
    sides = np.sort(np.concatenate([model.triangles[:, k] for k in ([0, 1], [1, 2], [2, 0])]), axis=1)
    sides, count = np.unique(sides, axis=0, return_counts=True)
    edge = np.intersect1d(sides[count == 1], np.flatnonzero(model.free.any(axis=1)))
    labels = named([model.name("panel", p) for p in model.triangle_panel])
    panels = {n: np.intersect1d(model.triangles[t], edge) for n, t in labels.items()}
    out = []
    for p, mine in panels.items():
        own = [n for n in mine if not any(n in nodes for q, nodes in panels.items() if q != p)]
        if len(mine):
            out.append((p, "panel", tuple(map(int, own or mine))))
    return out if len(out) > 1 else []


def _distinct(places: Sequence[tuple[str, str, tuple[int, ...]]]):
    """Places without those that are another's nodes by a second name, as a strip's end and its last panel's edge."""
    of = {frozenset(nodes): (site, kind, nodes) for site, kind, nodes in reversed(places)}
    return [p for p in places if of[frozenset(p[2])] == p]


def _panels(model: Model):
    """Nodes of each panel that can move, with those that stand for its mass if it is rigid."""
    first = len(model.position) - len(model.carriers)
    labels = named([model.name("panel", p) for p in model.triangle_panel])
    out = []
    for panel, triangles in labels.items():
        nodes = np.unique(model.triangles[triangles])
        carried = np.isin(model.carriers, model.triangle_panel[triangles])
        if np.any(model.free[nodes]):
            out.append((panel, "panel", (*map(int, nodes), *map(int, first + np.flatnonzero(carried)))))
    return out if len(out) > 1 else []


def _in_kilograms(effect) -> bool:
    return effect.parameter(effect.fitted[0]).unit == "kg"


def free_number(effect: str, name: str, entities: tuple[int, ...] | None) -> Free:
    """A number of an effect that a fit may change, with what is plausible."""
    p = get(effect).parameter(name)
    assert p.typical is not None
    first = get(effect).parameter(get(effect).fitted[0])
    scale = abs(p.typical) or abs(first.typical or 1.0)
    ratio = p.bounds[0] >= 0.0 and p.unit not in (first.unit, "-") and not p.threshold
    # an angle may be next to nothing, as in Coulomb's law, where its logarithm would go on for ever
    power = 1.0 if not ratio else 0.5 if p.unit == "rad" else 0.0
    plausible = float(boxcox(PLAUSIBLE, power)) if ratio else PLAUSIBLE * scale
    return Free(
        effect,
        name,
        p.unit,
        start=0.0 if p.unit == first.unit else p.typical,  # other components of a strength are absent as well
        scale=1.0 if ratio else scale,
        lower=p.bounds[0],
        upper=p.bounds[1],
        spread=np.inf if name == first.name else plausible,
        entities=entities,
        power=power,
    )


SITES = 4
"""Creases that one channel may be asked to tell apart."""


def told_apart(every: Sequence[Suspect], channels: int) -> list[Suspect]:
    """The suspects; of many more creases or panels than channels (a beam of cells), only all together or in stretches.

    Where single ones are told apart there are no stretches.
    """
    beam = False
    for kind in ("crease", "panel"):
        sites = {s.site for s in every if s.kind == kind and s.entities is not None and not s.stretch}
        if len(sites) > SITES * channels:
            every, beam = [s for s in every if s.kind != kind or s.entities is None or s.stretch], True
    if not beam:
        return [s for s in every if not s.stretch]
    parts: dict[str, set[int]] = {}
    for s in every:
        if s.stretch:
            parts.setdefault(s.effect, set()).update(s.entities or ())
    return [_all_of(s, parts[s.effect]) if s.effect in parts and s.entities is None else s for s in every]


def _all_of(s: Suspect, entities: set[int]) -> Suspect:
    """A suspect of all entities that names them: stretches overlap, so that its signature is not the sum of theirs."""
    mine = tuple(sorted(entities))
    return replace(s, entities=mine, free=tuple(replace(f, entities=mine) for f in s.free))


CONSTANTS = 4
"""Time constants with which an effect that has one is suspected, evenly in their logarithm."""


def at_several_times(every: Sequence[Suspect], shortest: float, longest: float) -> list[Suspect]:
    """The suspects, those with a time constant several times: their signatures change with it altogether.

    Args:
        shortest, longest: between which the constants lie [s].
    """
    out = []
    for s in every:
        slow = [n for n, f in enumerate(s.free) if n and f.unit == "s"]
        if not slow or get(s.effect).family in DISTORTIONS:
            out.append(s)
            continue
        for time in np.geomspace(shortest, longest, CONSTANTS + 2)[1:-1]:
            free = [replace(f, start=float(time)) if n in slow else f for n, f in enumerate(s.free)]
            out.append(replace(s, free=tuple(free)))
    return out
