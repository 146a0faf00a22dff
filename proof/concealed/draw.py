"""Draws one case: an object with something concealed, its recordings, and the sealed answer.

    python draw.py --seed 7 --case 3 --folder cases/0003 --answer sealed/0003.json
    python draw.py --nearest --answer sealed/0003.json --into sealed/0003.nearest.json
    python draw.py --realise "field reversed" --folder cases/0003 --answer sealed/0003.json --into cases/0003/suggested

The case's folder gets object.json (what an experimenter knows) and the recordings; the answer goes elsewhere. Nothing
here imports the simulator under test. What kind of case it is, and of what mechanism, structure and strength, follows
from the number of the case, so that any first cases of a seed are balanced (strata.py). The strength is set by
detectability d': the norm of an effect's signature (rigid.py, beam.py); of an effect outside the catalogue, of what
neither one law of the catalogue nor two take up of it (`imitation`).
"""

import argparse
import json
import shutil
import sys
from itertools import combinations
from pathlib import Path

import beam
import coupon
import laws
import numpy as np
import objects
from beam import BeamCase
from coupon import CouponCase
from laws import Concealed
from rigid import RigidCase, entry
from rivals import ALIKE, APART, PAIRS, TIED, Pair, apart, changed, overlap, proposed
from scipy.optimize import lsq_linear
from strata import PROPORTIONS, stratum
from world import Unstable

LEVELS = (2.0, 5.0, 10.0, 20.0, 50.0)
STRUCTURES = (*objects.STRUCTURES, *beam.STRUCTURES, *coupon.STRUCTURES)
CURVES = {s: (beam, BeamCase) for s in beam.STRUCTURES} | {s: (coupon, CouponCase) for s in coupon.STRUCTURES}
"""Structures that are recorded as curves: where they are described, and as what."""

NUISANCE = 2.0
"""Largest d' of an unlisted nuisance: beyond, it would be a second effect."""

CROSSED = 0.7
"""Largest overlap of two effects in one object: beyond, one hides the other."""

BESIDE = 5.0
"""d' that the catalogue leaves of a law outside which acts beside one of its own: clearly seen, and the smaller one."""

ATTEMPTS = 12
"""Objects that are drawn until one suits its stratum."""


class Unsuited(Exception):
    """An object that cannot be what its stratum wants."""


STEPS = 20
"""Of the search for a strength."""

NULLS = ("plain", "wrong_parameter", "wrong_camera")
Case = RigidCase | BeamCase


def table(structure: str, outside: bool = False) -> dict[str, Concealed]:
    """What may be concealed in a structure."""
    if structure in CURVES:
        module = CURVES[structure][0]
        return (module.OUTSIDE if outside else module.INSIDE)[structure]
    known = laws.OUTSIDE if outside else laws.INSIDE
    return {n: c for n, c in known.items() if not c.only or structure in c.only}


def imitators(structure: str) -> dict[str, Concealed]:
    """What may be mistaken for an effect in a structure: also what never shows enough there to be concealed."""
    known = table(structure)
    if structure not in laws.HELD:
        return known
    field = structure in laws.DRIVEN
    others = {n: c for n, c in laws.INSIDE.items() if set(c.only) & set(laws.HELD)}
    return known | {n: c for n, c in others.items() if field or not set(c.only) <= set(laws.DRIVEN)}


def cells(structures=STRUCTURES, kinds=tuple(PROPORTIONS)) -> dict[str, list[tuple]]:
    """The strata of each kind that may be drawn."""
    pairs = [(n, p.structure, way) for n, p in enumerate(PAIRS) for way in (0, 1) if p.structure in structures]
    out = {
        "single": [(d, m, s) for s in structures for m in table(s) for d in LEVELS],
        "null": [
            (what, s) for s in structures for what in NULLS if what != "wrong_camera" or s not in coupon.STRUCTURES
        ],
        "outside": [(d, m, s) for s in structures for m in table(s, True) for d in LEVELS[2:]],
        "confounded": pairs,
        "double": [(m, n, s) for s in structures for m in table(s) for n in table(s) if n != m],
        "beside": [(m, n, s) for s in structures for m in table(s) for n in table(s, True)],
    }
    return {k: v for k, v in out.items() if k in kinds and v}


def case_of(o: dict, factors: dict[str, float]) -> Case:
    return (CURVES[o["structure"]][1] if o["structure"] in CURVES else RigidCase)(o, factors)


def drawn_object(structure: str, rng: np.random.Generator) -> dict:
    return (CURVES[structure][0] if structure in CURVES else objects).draw(structure, rng)


def drawn_factors(o: dict, rng: np.random.Generator, *, wrong: bool = False) -> dict[str, float]:
    """True over stated numbers; `wrong`: one of them is off by more than two standard deviations."""
    draws = {n: float(np.clip(rng.normal(), -2, 2)) for n in o["priors"]}
    if wrong:
        draws[str(rng.choice(list(draws)))] = float(rng.choice([-1, 1]) * rng.uniform(2.0, 2.5))
    relative = {n: s / o["settings"][n] if "settings" in o else s for n, s in o["priors"].items()}
    return {n: 1 + z * relative[n] for n, z in draws.items()}


def draw_extra(name: str, rng: np.random.Generator, duration: float) -> dict:
    """Second numbers of a law."""
    if name == "hysteresis":
        return {"angle": float(rng.uniform(0.05, 0.2))}
    if name == "relaxation":
        return {"time": float(np.exp(rng.uniform(np.log(0.05), np.log(1.0))))}
    if name == "parametric_stiffness":
        return {"frequency": float(rng.uniform(0.7, 3.0))}
    if name == "pushes":
        at = np.sort(rng.uniform(0.2, duration - 0.2, 5))
        return {"pulses": [[float(t), float(rng.choice([-1, 1]))] for t in at]}
    if name == "field_offset":
        return {"angle": float(rng.uniform(0.0, 2 * np.pi))}
    return {}


def placed(o: dict, mechanism: str, place: int, extra: dict, outside: bool = False) -> dict:
    """What is concealed, but for its strength."""
    c = (table(o["structure"], True) if outside else imitators(o["structure"]))[mechanism]
    site = c.site if c.site.startswith("all") else ""
    if c.site == "crease":
        site = o["creases"][place]["name"]
    elif c.site == "panel":
        site = f"panel{place}"
    elif c.site == "last panel":
        site = f"panel{len(o['faces']) - 1}"
    elif c.site == "foot":
        site = o["feet"][place]["name"]
    return {"mechanism": mechanism, "place": place, "site": site, "extra": extra}


def chosen(o: dict, mechanism: str, rng: np.random.Generator, outside: bool = False) -> dict:
    """A mechanism at a place that is drawn."""
    place = int(rng.choice(places(o, table(o["structure"], outside)[mechanism])))
    return placed(o, mechanism, place, draw_extra(mechanism, rng, o.get("duration", 1.0)), outside)


def places(o: dict, c: Concealed) -> list[int]:
    """Where a mechanism may be: creases, or panels that move."""
    if c.site in ("crease", "foot"):
        return list(range(len(o["creases" if c.site == "crease" else "feet"])))
    return [p for p in range(len(o["faces"])) if p != o["held"]] if c.site == "panel" else [0]


def strengthened(case: Case, what: dict, c: Concealed, wanted: float, sign: float, first: float = 0.0):
    """The effect at the strength with the wanted d', and its signature: secant steps in the logarithms.

    Args:
        first: strength to begin with, if not the law's.

    Raises:
        Unsuited: there is no such strength.
    """
    scale = case.scale(what["place"]) if c.stiff else 1.0
    largest = c.largest * scale
    s = min(first or c.first * scale, largest)
    fresh, last, power = False, None, 1.0
    for _ in range(STEPS):
        now = entry(what["mechanism"], sign * s, what["place"], what["extra"])
        signature = case.signature([now], fresh=fresh)
        got = max(float(np.linalg.norm(signature)), 1e-9)
        near = abs(np.log(got / wanted)) < 0.1 or (s == largest and got < wanted)
        if near and fresh:
            return now, signature
        if not near:
            if last and s != last[0]:
                power = float(np.clip(np.log(got / last[1]) / np.log(s / last[0]), 0.5, 4.0))
            last = s, got
            s = min(largest, s * float(np.clip((wanted / got) ** (1 / power), 0.02, 50.0)))
        fresh = fresh or near  # what starts and numbers take up depends on the motion: from here on found anew
    raise Unsuited(f"no strength of {what['mechanism']} has d' = {wanted:g} in {case.o['structure']}")


def concealed(case: Case, what: dict, wanted: float, rng: np.random.Generator):
    """The answer's account of an effect, and its signature; where d' cannot be reached, the nearest level is wanted."""
    c = table(case.o["structure"])[what["mechanism"]]
    sign = float(rng.choice([-1, 1])) if c.signed else 1.0
    now, signature = strengthened(case, what, c, wanted, sign)
    account = {**what, "names": list(c.names), "strength": now["strength"], "number": c.number}
    d = float(np.linalg.norm(signature))
    if d < 0.85 * wanted:
        wanted = min(LEVELS, key=lambda level: abs(np.log(level / d)))
    return account | {"d_wanted": wanted, "d": d}, signature


def nuisances(case: Case, rng: np.random.Generator, without: set[str]) -> list[dict]:
    """Two or three things that nobody lists, each too small to be seen by itself."""
    may = [n for n in case.nuisances(rng) if n["mechanism"] not in without]
    out = []
    for n in rng.choice(len(may), size=min(len(may), int(rng.integers(2, 4))), replace=False).tolist():
        d = float(np.linalg.norm(case.signature([may[n]])))
        part = min(1.0, NUISANCE / max(d, 1e-9))
        out.append({**may[n], "strength": may[n]["strength"] * part, "d": d * part})
    return out


# --- two effects


def confounded(pair: Pair, way: int, rng: np.random.Generator) -> tuple[Case, dict, dict | None]:
    """An object with one recording in which a pair is confounded, the answer, and the separating recording.

    Raises:
        Unsuited: the pair is not confounded in this object, or not separated.
    """
    true, rival = (pair.one, pair.other) if way == 0 else (pair.other, pair.one)
    o = drawn_object(pair.structure, rng)
    o["recordings"] = [o["recordings"][pair.first]]
    factors = drawn_factors(o, rng)
    case = case_of(o, factors)
    extra = [pair.extra.get(m) or draw_extra(m, rng, o.get("duration", 1.0)) for m, _ in (true, rival)]
    a, b = (placed(o, m, p, x) for (m, p), x in zip((true, rival), extra, strict=True))
    more = changed(o["recordings"][0], **pair.separating) if pair.separating else None
    wide = case_of({**o, "recordings": [o["recordings"][0], more]}, factors) if more else None
    rate, tie = _rates(case, wide, a, b)
    low, high = max(LEVELS[1], 1.1 * APART * rate), min(LEVELS[-1], TIED * tie / 1.1)
    if low > high:
        raise Unsuited("no strength at which the pair is confounded and can be separated")
    account, mine = concealed(case, a, float(np.sqrt(low * high)), rng)
    other, theirs = _like(case, b, account["d"], mine)
    found = {"overlap": overlap(mine, theirs), "apart": apart(mine, theirs)}
    if found["overlap"] < ALIKE or found["apart"] > TIED:
        raise Unsuited("not confounded")
    if wide:
        now = entry(a["mechanism"], account["strength"], a["place"], a["extra"])
        found["separated"] = apart(wide.signature([now], fresh=True), wide.signature([other]))
        if found["separated"] < APART:
            raise Unsuited("not separated")
    names = list(table(pair.structure)[b["mechanism"]].names)
    account["rival"] = {**b, "names": names, "strength": other["strength"], **found}
    return case, account, more


def _rates(case: Case, wide: Case | None, a: dict, b: dict) -> tuple[float, float]:
    """d' of the effect over d' between it and its rival, with the separating recording and without; at d' = 10."""
    known = table(case.o["structure"])
    now, mine = strengthened(case, a, known[a["mechanism"]], 10.0, 1.0)
    other, theirs = _like(case, b, 10.0, mine)
    d = float(np.linalg.norm(mine))
    if overlap(mine, theirs) < ALIKE:
        return np.inf, 0.0
    if wide is None:
        return 0.0, d / apart(mine, theirs)
    far = apart(wide.signature([now], fresh=True), wide.signature([other]))
    return d / max(far, 1e-9), d / apart(mine, theirs)


def _like(case: Case, b: dict, wanted: float, mine: np.ndarray) -> tuple[dict, np.ndarray]:
    """The rival as strong as the effect, with the sign that is more like it, about the effect's motion."""
    c = table(case.o["structure"])[b["mechanism"]]
    scale = case.scale(b["place"]) if c.stiff else 1.0
    s, sign = c.first * scale, 1.0
    for _ in range(4):
        now = entry(b["mechanism"], sign * s, b["place"], b["extra"])
        theirs = case.signature([now])
        if c.signed and mine @ theirs < 0:
            sign = -sign
            continue
        s = min(c.largest * scale, s * float(np.clip(wanted / max(np.linalg.norm(theirs), 1e-9), 0.02, 50.0)))
    now = entry(b["mechanism"], sign * s, b["place"], b["extra"])
    return now, case.signature([now])


def doubled(first: str, second: str, structure: str, rng: np.random.Generator) -> tuple[Case, dict, None]:
    """An object with two effects that do not hide one another.

    Raises:
        Unsuited: they do.
    """
    o = drawn_object(structure, rng)
    case = case_of(o, drawn_factors(o, rng))
    account, mine = concealed(case, chosen(o, first, rng), float(rng.choice(LEVELS[2:])), rng)
    account["second"], theirs = concealed(case, chosen(o, second, rng), float(rng.choice(LEVELS[2:])), rng)
    account["overlap"] = overlap(mine, theirs)
    if account["overlap"] > CROSSED:
        raise Unsuited("one effect hides the other")
    return case, account, None


def beside(first: str, other: str, structure: str, rng: np.random.Generator) -> tuple[Case, dict, None]:
    """An object with an effect, and a smaller one outside the catalogue.

    Raises:
        Unsuited: no level is well above what is outside, or one hides the other.
    """
    o = drawn_object(structure, rng)
    case = case_of(o, drawn_factors(o, rng))
    second = unlike(case, chosen(o, other, rng, True), BESIDE, rng)
    above = [level for level in LEVELS if level > 1.5 * second["d"]]
    if not above:
        raise Unsuited(f"{other} is no smaller effect in {structure}")
    account, mine = concealed(case, chosen(o, first, rng), float(rng.choice(above)), rng)
    now = entry(second["mechanism"], second["strength"], second["place"], second["extra"])
    theirs = case.signature([now], fresh=True)
    account |= {"second": second, "overlap": overlap(mine, theirs)}
    if account["overlap"] > CROSSED or account["d"] < second["d"]:
        raise Unsuited("one effect hides the other")
    return case, account, None


# --- a case


def single(wanted: float, mechanism: str, structure: str, rng: np.random.Generator, *, outside: bool = False):
    """An object with one effect."""
    o = drawn_object(structure, rng)
    case = case_of(o, drawn_factors(o, rng))
    what = chosen(o, mechanism, rng, outside)
    return case, unlike(case, what, wanted, rng) if outside else concealed(case, what, wanted, rng)[0], None


def unlike(case: Case, what: dict, wanted: float, rng: np.random.Generator) -> dict:
    """The answer's account of an effect outside the catalogue, so strong that the catalogue leaves the wanted d' of it.

    What part of d' is left is taken from the first recording, to save time.

    Raises:
        Unsuited: the catalogue can take up nearly all of it, at any strength.
    """
    c = table(case.o["structure"], True)[what["mechanism"]]
    sign = float(rng.choice([-1, 1])) if c.signed else 1.0
    recordings = case.o["recordings"]
    some = case if case.o["structure"] in CURVES else case_of({**case.o, "recordings": recordings[:1]}, case.factors)
    share = np.sqrt(len(some.o["recordings"]) / len(recordings))
    goal, first = wanted * share, 0.0
    for _ in range(3):
        now, mine = strengthened(some, what, c, goal, sign, first)
        like, d = imitation(some, mine, site=what["site"], most=2), float(np.linalg.norm(mine))
        more = min(wanted * share / max(like["apart"], 1e-9), STRONGEST / goal)
        if more < 1.4 or d < 0.85 * goal:
            break
        goal, first = goal * more, abs(now["strength"]) * more
    part, d = like["apart"] / d, float(np.linalg.norm(case.signature([now], fresh=True)))
    like["apart"] = part * d
    if like["apart"] < APART:
        raise Unsuited(f"the catalogue takes up {what['mechanism']} in {case.o['structure']}")
    wanted = min(LEVELS, key=lambda level: abs(np.log(level / like["apart"])))
    strength = {"strength": now["strength"], "number": "", "names": []}
    return {**what, **strength, "d_wanted": wanted, "d": d, "like": like}


def null(what: str, structure: str, rng: np.random.Generator) -> tuple[Case, dict, None]:
    """An object without an effect; with a wrong parameter, or seen by a wrong camera."""
    o = drawn_object(structure, rng)
    case = case_of(o, drawn_factors(o, rng, wrong=what == "wrong_parameter"))
    account = {"null": what}
    if what == "wrong_camera":
        lengths = "scene" in o or o["channels"] == "marker_2d"
        name = "length_scale" if lengths else str(rng.choice(["angle_scale", "clock_rate"]))
        account |= concealed(case, placed(o, name, 0, {}), float(rng.choice(LEVELS)), rng)[0]
    return case, account, None


def drawn(kind: str, cell: tuple, rng: np.random.Generator) -> tuple[Case, dict, dict | None]:
    """The case of a stratum, the answer's account of what is concealed, and a separating recording if there is one.

    Raises:
        Unsuited: none of the objects that were tried suits.
    """
    for _ in range(ATTEMPTS):
        try:
            if kind == "confounded":
                return confounded(PAIRS[cell[0]], cell[2], rng)
            if kind in ("double", "beside"):
                return (doubled if kind == "double" else beside)(*cell, rng)
            return null(*cell, rng) if kind == "null" else single(*cell, rng, outside=kind == "outside")
        except (Unsuited, Unstable) as error:
            why = error
    raise Unsuited(f"{kind} {cell}: {why}")


def make(seed: int, index: int, folder: Path, answer: Path, *, structures=STRUCTURES, kinds=None) -> dict:
    """Writes one case and its answer.

    Args:
        seed, index: which. folder: of the case. answer: the file of the sealed answer. structures, kinds: only these.
    """
    kind, cell = stratum(seed, index, cells(structures, kinds or tuple(PROPORTIONS)))
    rng = np.random.default_rng([seed, index])
    out: dict = {"seed": seed, "case": index, "kind": kind, "null": "", "mechanism": "", "names": [], "site": ""}
    out |= {"strength": 0.0, "d_wanted": 0.0, "d": 0.0, "number": "", "onset": None}
    case, account, more = drawn(kind, cell, rng)
    out |= account
    if out["mechanism"] == "pushes":
        out["onset"] = out["extra"]["pulses"][0][0]
    hidden = [e for e in (out if out["mechanism"] else None, out.get("second")) if e]
    entries = [{k: e[k] for k in ("mechanism", "strength", "place", "extra")} for e in hidden]
    others = nuisances(case, rng, {e["mechanism"] for e in hidden} | {out.get("rival", {}).get("mechanism", "")})
    tracker = case.tracker(rng)
    folder.mkdir(parents=True, exist_ok=True)
    answer.parent.mkdir(parents=True, exist_ok=True)
    case.write(folder, entries + others, tracker, rng)
    (folder / "object.json").write_text(json.dumps(case.known(), indent=1))
    out |= {"structure": case.o["structure"], "factors": case.factors, "concealed": entries, "nuisances": others}
    out |= {"tracker": tracker, "object": case.o, "separating": more}
    answer.write_text(json.dumps(out, indent=1))
    if more:
        add(folder, folder / "separating", out, [more])
    return out


def add(folder: Path, into: Path, answer: dict, recordings: list[dict]) -> None:
    """The case with more recordings, in a folder of its own."""
    into.mkdir(parents=True, exist_ok=True)
    for file in [*folder.glob("recording*"), folder / "object.json"]:
        shutil.copy(file, into / file.name)
    case = case_of({**answer["object"], "recordings": recordings}, answer["factors"])
    rng = np.random.default_rng([answer["seed"], answer["case"], 1])
    count = len(list(folder.glob("recording*.csv")))
    case.write(into, answer["concealed"] + answer["nuisances"], answer["tracker"], rng, first=count + 1)


def realise(what: str, folder: Path, answer: Path, into: Path, repeats: int = 1) -> None:
    """Makes a proposed experiment, so often: the case with more recordings.

    Raises:
        ValueError: an experiment that cannot be made here.
    """
    sealed = json.loads(answer.read_text())
    more = proposed(what, sealed["object"]["recordings"][0])
    if more is None:
        raise ValueError(f"'{what}' cannot be made")
    add(folder, into, sealed, [more] * repeats)


# --- what is alike


def imitation(case: Case, mine: np.ndarray, *, site: str = "", names=(), most: int = 1) -> dict:
    """The law of the catalogue that is hardest to tell from an effect, or so many of the laws that are most like it.

    They are taken as small effects about its motion, for which signatures were last found afresh.

    Args:
        mine: signature of the effect. site: where it acts; there laws of creases and panels act, too, else anywhere.
        names: what the effect may be called itself.

    Returns: `mechanism` and `site`; `overlap`, |cos| with the first; `apart`: d' that is left at their best strengths.
    """
    found = []
    for name, c in imitators(case.o["structure"]).items():
        if set(c.names) & set(names):
            continue
        for place in around(case.o, c, site):
            for extra in EXTRAS.get(name, ({},)):
                shape = case.beside(entry(name, c.first * (case.scale(place) if c.stiff else 1.0), place, extra))
                if np.linalg.norm(shape) > 1e-6:
                    found.append((placed(case.o, name, place, extra), shape, -np.inf if c.signed else 0.0))
    found.sort(key=lambda f: -overlap(mine, f[1]))
    best = {"mechanism": "", "site": "", "overlap": 0.0, "apart": float(np.linalg.norm(mine))}
    for some in (c for n in range(1, most + 1) for c in combinations(found[:PAIRED] if n > 1 else found, n)):
        shapes = np.stack([shape for _, shape, _ in some], axis=1)
        size = np.linalg.norm(shapes, axis=0)
        fit = lsq_linear(shapes / size, mine, ([least for *_, least in some], np.inf))
        left = float(np.sqrt(2.0 * fit.cost))
        if left < best["apart"]:
            said = {k: " + ".join(what[k] for what, *_ in some) for k in ("mechanism", "site")}
            best = {**said, "overlap": overlap(mine, some[0][1]), "apart": left}
    return best


def around(o: dict, c: Concealed, site: str) -> list[int]:
    """Where a law may act to be like an effect at a site: at that crease, or on the panels next to it."""
    names = [crease["name"] for crease in o.get("creases", ())]
    if site not in names or c.site not in ("crease", "panel"):
        return places(o, c)
    k = names.index(site)
    return [k] if c.site == "crease" else [p for p in o["creases"][k]["panels"] if p != o["held"]]


def nearest(sealed: dict) -> dict:
    """What of the catalogue, but for its own names, is hardest to tell from what is concealed; see `imitation`.

    One law; of an effect outside the catalogue also two.
    """
    case = case_of(sealed["object"], sealed["factors"])
    mine = case.signature([sealed["concealed"][0]], fresh=True)
    return imitation(case, mine, names=sealed["names"], most=1 if sealed["names"] else 2)


PAIRED = 6
"""Laws that are tried two at a time: those that are most like the effect."""

STRONGEST = 1000.0
"""Largest d' in the first recording of an effect outside the catalogue."""

EXTRAS = {
    "hysteresis": ({"angle": 0.1},),
    "relaxation": ({"time": 0.1}, {"time": 0.5}),
    "field_offset": ({"angle": 0.0}, {"angle": np.pi / 2}),
}
"""Second numbers that an imitation is tried with."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--case", type=int)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--answer", type=Path, required=True)
    parser.add_argument("--structures", nargs="+", choices=STRUCTURES, default=STRUCTURES)
    parser.add_argument("--kinds", nargs="+", choices=list(PROPORTIONS))
    parser.add_argument("--realise", metavar="WHAT", help="an experiment, in the words of the diagnosis")
    parser.add_argument("--repeats", type=int, default=1, help="of that experiment")
    parser.add_argument("--into", type=Path, help="folder for the case with that experiment")
    parser.add_argument("--nearest", action="store_true", help="write to the file --into what is hard to tell from it")
    args = parser.parse_args()
    if args.nearest:
        args.into.write_text(json.dumps(nearest(json.loads(args.answer.read_text())), indent=1))
        return
    if args.realise:
        try:
            realise(args.realise, args.folder, args.answer, args.into, args.repeats)
        except ValueError as error:
            sys.exit(str(error))
        return
    if args.seed is None or args.case is None:
        parser.error("--seed and --case say which case to draw")
    made = args.structures, args.kinds
    if not cells(made[0], made[1] or tuple(PROPORTIONS)):
        parser.error(f"there are no {' or '.join(made[1])} cases of {', '.join(made[0])}")
    make(args.seed, args.case, args.folder, args.answer, structures=args.structures, kinds=args.kinds)


if __name__ == "__main__":
    main()
