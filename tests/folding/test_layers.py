"""Layers around one vertex, against all orders of layers: neither too strict nor too lax."""

from itertools import permutations, product

import numpy as np
import pytest
from drawings import drawn

from origami_sim.folding import fold, read, summarise
from origami_sim.folding.layers import caught

SECTORS = [
    (40, 100, 140, 80),
    (60, 60, 120, 120),
    (60, 120, 120, 60),
    (90, 90, 90, 90),
    (50, 90, 130, 90),
    (20, 31, 160, 149),
    (60, 60, 60, 60, 60, 60),
    (30, 30, 60, 60, 90, 90),
    (40, 40, 40, 80, 100, 60),
    (30, 30, 30, 75, 120, 75),
    (45, 45, 45, 45, 90, 90),
    (45, 90, 45, 45, 90, 45),
    (20, 50, 70, 60, 90, 70),
    (50, 20, 60, 70, 70, 90),
    (35, 10, 80, 95, 65, 75),
    (35, 80, 10, 30, 135, 70),
    (20, 35, 20, 35, 140, 110),
    (75, 40, 30, 40, 75, 100),
]
"""Sectors that alternately sum to 180 degrees (Kawasaki), of whole degrees: generic ones, equal runs, and runs that
appear only once smaller ones are folded."""


def foldable(sectors) -> set[tuple[int, ...]]:
    """Mountains and valleys of all flat folds of a vertex, found by trying all orders of its layers.

    Sector k covers the places between its creases k and k + 1. A layer cannot lie between the two that a crease within
    it joins, and two creases at one place whose layers lie to the same side cannot take turns.
    """
    n, place = len(sectors), [0]
    for k, size in enumerate(sectors):
        place.append(place[-1] + (size if k % 2 == 0 else -size))
    assert place[n] == 0
    low = [min(place[k], place[k + 1]) for k in range(n)]
    high = [max(place[k], place[k + 1]) for k in range(n)]
    found = set()
    for height in permutations(range(n)):
        joined = [tuple(sorted((height[k - 1], height[k]))) for k in range(n)]
        if any(
            low[j] < place[k] < high[j] and joined[k][0] < height[j] < joined[k][1] for k in range(n) for j in range(n)
        ):
            continue
        if any(
            place[k] == place[m]
            and (low[k] < place[k]) == (low[m] < place[m])
            and (joined[k][0] < joined[m][0] < joined[k][1] < joined[m][1])
            for k in range(n)
            for m in range(n)
        ):
            continue
        # sectors of even number lie with their top up: a valley brings the next one above them
        found.add(tuple(1 if (height[k] > height[k - 1]) == (k % 2 == 1) else -1 for k in range(n)))
    return found


def said_to_fold(sectors, slack) -> set[tuple[int, ...]]:
    """What the test of single vertices lets fold."""
    n = len(sectors)
    every = (s for s in product((1, -1), repeat=n) if abs(sum(s)) == 2)
    return {s for s in every if caught(sectors, [slack] * n, s) is None}


@pytest.mark.parametrize("sectors", SECTORS)
def test_what_the_layers_allow_is_what_all_their_orders_allow(sectors):
    there = foldable(sectors)
    assert 0 < len(there) <= 2 ** len(sectors)
    assert all(abs(sum(signs)) == 2 for signs in there)  # Maekawa
    assert said_to_fold([float(s) for s in sectors], 1e-9) == there


@pytest.mark.parametrize("sectors", SECTORS)
def test_drawings_that_are_inexact_give_the_same(sectors):
    """Creases that are half a degree off, read as accurate to a degree, are those that were meant."""
    random, there = np.random.default_rng(1), foldable(sectors)
    for _ in range(20):
        off = random.uniform(-0.5, 0.5, len(sectors))
        assert said_to_fold([s + b - a for s, a, b in zip(sectors, off, np.roll(off, -1), strict=True)], 1.0) == there


def vertex(path, sectors, letters, radius=50.0):
    """A vertex of these sectors [deg] in a convex sheet."""
    turns = np.radians(np.cumsum([7.0, *sectors[:-1]]))
    tips = [(radius * np.cos(t), radius * np.sin(t)) for t in turns]
    rim = []
    for n, (turn, size) in enumerate(zip(turns, np.radians(sectors), strict=True)):
        rim += [tips[n], (radius * np.cos(turn + size / 2), radius * np.sin(turn + size / 2))]
    lines = [("B", *a, *b) for a, b in zip(rim, rim[1:] + rim[:1], strict=True)]
    return drawn(path, [*lines, *((m, 0.0, 0.0, *tip) for m, tip in zip(letters, tips, strict=True))])


@pytest.mark.parametrize(
    ("sectors", "letters", "words"),
    [
        ((40, 100, 140, 80), "MVVV", None),
        ((40, 100, 140, 80), "VVVM", "a sector of 40.0 deg lies between larger ones and between two valleys"),
        ((60, 60, 120, 120), "VMVV", None),
        ((60, 60, 120, 120), "VVVM", "2 sectors of 60.0 deg lie side by side between larger ones, and their 3 creases"),
        ((90, 90, 90, 90), "MMVM", None),
        ((75, 40, 30, 40, 75, 100), "MVVMVV", "once 1 smaller one is folded, a sector of 50.0 deg lies"),
    ],
)
def test_a_vertex_without_an_order_of_layers_is_named(tmp_path, sectors, letters, words):
    signs = tuple({"V": 1, "M": -1}[m] for m in letters)
    assert (signs in foldable(sectors)) == (words is None)
    found = summarise(fold(read(vertex(tmp_path / "vertex.svg", sectors, letters))), 2e-4)
    said = " ".join(found.sentences)
    assert ("No order of layers at 1 vertex, first at (" in said) == (words is not None)
    if words:
        assert not found.reached and words in said and "exchange one of these " in said


@pytest.mark.parametrize(
    ("sectors", "letters", "ordered"),
    [
        ((40, 100, 140, 80), "VUVV", True),  # as a mountain
        ((40, 100, 140, 80), "VVUM", False),  # the small sector lies between two valleys, whatever the third does
    ],
)
def test_a_crease_without_a_target_may_be_a_mountain_or_a_valley(tmp_path, sectors, letters, ordered):
    """The other three close only if it folds flat, and half a turn up and down are one shape."""
    folding = fold(read(vertex(tmp_path / "vertex.svg", sectors, letters)))
    assert len(folding.errors) == 3 and folding.reached
    assert [len(v.signs) for v in folding.flat] == [4]
    assert (not folding.unordered) == ordered


def test_a_crease_without_a_target_that_stays_open_is_none(tmp_path):
    path = vertex(tmp_path / "vertex.svg", (40, 100, 140, 80), "VVVM")
    turn = np.radians(7 + 40 + 50)  # halves the sector of 100 degrees
    line = f'<line x1="0" y1="0" x2="{50 * np.cos(turn)}" y2="{-50 * np.sin(turn)}" stroke="#ff00ff"/></svg>'
    path.write_text(path.read_text().replace("</svg>", line))
    folding = fold(read(path))
    assert len(folding.errors) == 4 and folding.reached
    (found,) = folding.unordered
    assert np.degrees(found.caught.size) == pytest.approx(40.0, abs=1e-6)
