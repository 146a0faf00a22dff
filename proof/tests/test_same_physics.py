"""Truth and simulator under test mean the same: by an object without effects, and by each effect's sign and size.

What they differ in without an effect would be an effect that nobody conceals. A number that is found is compared with
the one that was concealed, which holds only if both mean the same. Recordings are without noise, from one start, with
the effect and without it: by the truth and by the simulator.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from origami_proof import case
from origami_sim.fit.least_squares import fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect
from origami_sim.hypotheses.suspects import suspects
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.prescribed import curves
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording import read_recording

SMALL, STRONG = 0.3, {"crawler": 2.0, "adhesion": 60.0}
"""Strength, over that with which the search for one begins; of what shows only beyond what contacts differ by."""

NEAR = {"crawler": 0.15}
"""Part by which sizes may differ if not by 0.08: feet have other contact laws in the truth."""

EXACT = {"noise": 1e-9, "quantum": 1e-10, "smoothing": False, "lost": 0.0, "gap": 0, "stated": 1e-6}
"""A camera without errors."""

APART = {
    # one number for all hinges, of which that at the root stands for half a cell: its turn counts an eighth of that
    ("mae_cantilever", "stiffening"): 0.74,
}
"""Changes by the simulator over the truth's that are not one, though both count the same number."""

UNLIKE = {
    "mullins": "stiffness that folding destroys is of fibres in the truth, of the whole crease here",
    "static_friction": "falls with speed by another law",
    "eccentric_weight": "the patch has a mass of its own in the truth, the mass of its panel here",
}
"""Effects whose size means something else: only the sign is compared."""

SEGMENT, GAP = 0.25, 1e-4
"""Of motions of rigid panels, as diagnoses have them: length of a segment [s], and gaps between them."""

PARTS = {"rest_angle": "offset_moment", "misalignment": "turn_y"}
"""Numbers that stand for the strength where the truth names none."""


def predictor(truth, structure: str, folder: Path):
    """The truth of a short recording without an effect, and what the simulator under test makes of it."""
    o = truth["draw"].drawn_object(structure, np.random.default_rng(3))
    o["recordings"] = o["recordings"][:1]
    if structure not in truth["draw"].CURVES:
        o |= {"duration": 0.6, "rate": 240, "noise": 1e-6}
    made = truth["draw"].case_of(o, {})
    made.write(folder, [], EXACT, np.random.default_rng(0))
    (folder / "object.json").write_text(json.dumps(made.known()))
    recordings, subject = [read_recording(folder / "recording1.csv")], case.subject(folder)
    if o.get("feet"):
        return made, BarRollouts(subject, recordings, start="rest")
    return made, curves(subject, recordings) or RigidRollouts(subject, recordings)


def concealed(truth, made, entries: list[dict]) -> np.ndarray:
    """All readings (n, D) with effects, from the start that there is without."""
    o = made.o
    if o["structure"] in truth["draw"].CURVES:
        return np.concatenate(made.curves(entries))
    laws, chain = truth["rigid"].entered(entries)
    r, lasting = o["recordings"][0], made.duration(o["recordings"][0])
    start, world = made.motions([])[0], made.world(laws)
    motion = world.run(r, start.angles[0], start.rates[0], duration=lasting + 0.1)
    times = np.arange(round(lasting * o["rate"]) + 1) / o["rate"]
    return truth["recorder"].readings(world, motion, times, chain)


def named(every: Sequence[Suspect], effect: str, site: str) -> Suspect:
    """The suspect that a diagnosis would name."""
    mine = [s for s in every if s.effect == effect]
    whole = not site or site.startswith("all")
    found = [s for s in mine if (s.entities is None if whole else s.site == site)]
    return (found or mine)[0]


def numbers(suspect: Suspect, mechanism: str, strength: float, number: str, extra: dict) -> np.ndarray:
    """What a diagnosis would say if it found the truth."""
    names, values = [f.name for f in suspect.free], np.array([f.start for f in suspect.free])
    if mechanism == "field_offset":
        along = {"x": np.cos(extra["angle"]), "y": 0.0, "z": np.sin(extra["angle"])}
        return strength * np.array([along[n[-1]] for n in names])
    if mechanism == "tether":  # by node
        strength /= len(suspect.entities or (0,))
    values[names.index(number) if number in names else 0] = strength
    if second := {"hysteresis": "angle", "relaxation": "time"}.get(mechanism):
        values[1] = extra[second]
    return values


def predicted(forward: Predictor, hypothesis: Hypothesis, values: np.ndarray) -> np.ndarray:
    theta = np.concatenate([[n.start for n in forward.subject.nominals], values])
    return np.concatenate([v[0] for v in forward.predict(hypothesis, theta[None])])


@pytest.mark.parametrize(
    "structure", ["mae_cantilever", "de_bender", "crease_coupon", "hanging_strip", "magnetic_strip", "bi_fold", "box"]
)
def test_without_effects_both_do_the_same(truth, tmp_path, structure):
    o = truth["draw"].drawn_object(structure, np.random.default_rng(2))
    made = truth["draw"].case_of(o, {})
    made.write(tmp_path, [], EXACT | {"stated": o["noise"]}, np.random.default_rng(0))
    (tmp_path / "object.json").write_text(json.dumps(made.known()))
    recordings = [read_recording(p) for p in sorted(tmp_path.glob("recording*.csv"))]
    subject = case.subject(tmp_path)
    forward = curves(subject, recordings) or RigidRollouts(subject, recordings, segment=SEGMENT)
    left = fit(forward, Hypothesis(), Weights(forward.blocks[0].noise, gap=GAP))
    assert np.sqrt(left.cost) < truth["draw"].NUISANCE  # d' of what no number and no start takes up


@pytest.mark.parametrize(
    "structure",
    [
        "mae_cantilever",
        "de_bender",
        "crease_coupon",
        "hanging_strip",
        *(
            pytest.param(s, marks=pytest.mark.slow)
            for s in ("pendulum_chain", "magnetic_strip", "bi_fold", "box", "crawler")
        ),
    ],
)
def test_an_effect_means_the_same_in_both(truth, tmp_path, structure):
    draw, wrong = truth["draw"], []
    made, forward = predictor(truth, structure, tmp_path)
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    plain, own = concealed(truth, made, []), predicted(forward, Hypothesis(), np.zeros(0))
    for name, c in draw.table(structure).items():
        place = draw.places(made.o, c)[-1] if "faces" in made.o else 0
        extra = draw.draw_extra(name, np.random.default_rng(1), 1.0)
        what = draw.placed(made.o, name, place, extra)
        strong = STRONG.get(name, STRONG.get(structure, SMALL))
        strength = strong * c.first * (made.scale(place) if c.stiff else 1.0)
        one = truth["rigid"].entry(name, strength, place, dict(extra))
        expected = concealed(truth, made, [one]) - plain
        if name == "rest_angle" and not c.number:
            strength *= made.scale(place)
        suspect = named(every, c.names[0], what["site"])
        values = numbers(suspect, name, strength, c.number or PARTS.get(name, ""), extra)
        found = predicted(forward, Hypothesis((suspect,)), values) - own
        seen = np.isfinite(expected) & np.isfinite(found)
        expected, found = expected[seen], found[seen]
        alike = float(expected @ found / np.linalg.norm(expected) / np.linalg.norm(found))
        size = float(expected @ found / (expected @ expected))
        same = APART.get((structure, name), 1.0)
        if alike < 0.85 or (name not in UNLIKE and abs(size / same - 1.0) > NEAR.get(structure, 0.08)):
            wrong.append(f"{name} at {suspect.site}: {alike:.3f} alike, {size:.3f} times as large")
    assert not wrong
