"""The objects of the proof: rectangular panels on hinges, as an experimenter would describe them.

An object is plain data: `vertices` [m] and `faces` in the flat reference state, `held` panel, `thickness` [m] and
`density` [kg/m^3] of the sheet, `creases` with the two panels, `stiffness` [N m/rad] and `viscosity` [N m s/rad],
`magnets` by panel with `moment` [A m^2] along `poling`, `gravity` [m/s^2], `channels`, the `releases` (angles [rad])
and `fields` of its recordings, and what is known of the numbers: relative standard deviations in `priors`. What nothing
holds has `feet` that reach down to the ground at z = 0 and are as wide as the panels: `panel`, where along x they are
(`at`), coefficient of `friction`, and how far they `give` way [m] under their `load` [N].
Fold angles are positive towards the side from which a face runs counter-clockwise.
"""

import numpy as np

STRUCTURES = ("hanging_strip", "pendulum_chain", "magnetic_strip", "box", "bi_fold", "crawler")


def strip(lengths, width: float) -> tuple[list, list]:
    """Vertices and faces of a strip that hangs down from the origin."""
    z = -np.concatenate([[0.0], np.cumsum(lengths)])
    vertices = [[0.0, side * width / 2, float(h)] for h in z for side in (-1, 1)]
    return vertices, [[2 * p, 2 * p + 2, 2 * p + 3, 2 * p + 1] for p in range(len(lengths))]


def box(base: float, reach: float, width: float) -> tuple[list, list]:
    """Vertices and faces of a square and four flaps, flat; the hinges lie inside the sides of the square."""
    vertices, square, flaps = [], [], []
    for out in np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], float):
        along = np.cross((0, 0, 1), out)
        corner = base / 2 * (out - along)
        a, b = base / 2 * out - width / 2 * along, base / 2 * out + width / 2 * along
        k = len(vertices)
        vertices += [v.tolist() for v in (corner, a, b, b + reach * out, a + reach * out)]
        square += [k, k + 1, k + 2]
        flaps.append([k + 1, k + 4, k + 3, k + 2])
    return vertices, [square, *flaps]


def corner(side: float) -> tuple[list, list]:
    """Vertices and faces of three squares around a corner, flat: the second folds about y, on it the third about x."""
    places = [(-1, 0), (0, 0), (1, 0), (-1, 1), (0, 1), (1, 1), (0, 2), (1, 2)]
    vertices = [[side * x, side * y, 0.0] for x, y in places]
    return vertices, [[0, 1, 4, 3], [1, 2, 5, 4], [4, 5, 7, 6]]


def crawler(o: dict, vary, rng: np.random.Generator) -> None:
    """Two panels on legs, with magnets against each other: one is a little stronger, so that the load shifts with the
    field, and the crease lags, so that what slides out is not what slides in."""
    lengths, width, leg = (0.022 * vary(0.05), 0.018 * vary(0.05)), 0.02, 0.008
    x = np.concatenate([[0.0], np.cumsum(lengths)])
    o["vertices"] = [[float(a), side * width / 2, leg] for a in x for side in (-1, 1)]
    o["faces"] = [[2 * p, 2 * p + 2, 2 * p + 3, 2 * p + 1] for p in range(2)]
    o |= {"held": None, "thickness": 1.5e-3, "density": 2200.0, "channels": "marker_2d", "duration": 1.2, "rate": 120}
    o["noise"] = float(rng.uniform(2.5e-4, 4e-4))
    foot = {
        "friction": 0.5 * vary(0.2),
        "give": 5e-6,
        "load": 0.5 * o["gravity"] * o["density"] * o["thickness"] * width * sum(lengths),
    }
    o["feet"] = [
        {"name": n, "panel": p, "at": float(x[2 * p]), **foot} for p, n in enumerate(("rear foot", "front foot"))
    ]
    stiffness, moment = 5e-3 * vary(0.2), 0.04 * vary(0.05)
    o["creases"] = creases([(0, 1)], stiffness, 0.06 * vary(0.2) * stiffness)
    weaker = moment * float(rng.uniform(0.85, 0.9))
    o["magnets"] = [
        {"panel": 0, "poling": [1.0, 0.0, 0.0], "moment": moment},
        {"panel": 1, "poling": [-1.0, 0.0, 0.0], "moment": weaker},
    ]
    o["priors"] = {
        "crease.stiffness": 0.05,
        "crease_viscosity.viscosity": 0.2,
        "inertia.mass": 0.02,
        "magnetic_torque.remanence": 0.03,
        "coulomb.friction_coefficient": 0.1,
    }
    amplitude, frequency = 0.055 * vary(0.1), 2.5 * vary(0.2)
    o["recordings"] = [
        {
            "release": [0.0],
            "field": {"amplitude": b * amplitude, "frequency": f * frequency, "axis": [0.0, 0.0, 1.0], "delay": 0.1},
        }
        for b, f in ((1.0, 1.0), (0.7, 1.6), (0.85, 0.7))
    ]


def creases(pairs, stiffness: float, viscosity: float) -> list[dict]:
    return [
        {"name": f"fold{n + 1}", "panels": list(p), "stiffness": stiffness, "viscosity": viscosity}
        for n, p in enumerate(pairs)
    ]


def draw(structure: str, rng: np.random.Generator) -> dict:
    """An object of that structure with drawn dimensions and drives."""
    vary = lambda spread: float(rng.uniform(1 - spread, 1 + spread))  # noqa: E731
    o: dict = {
        "structure": structure,
        "held": 0,
        "gravity": 9.80665,
        "magnets": [],
        "priors": {"crease.stiffness": 0.05, "crease_viscosity.viscosity": 0.3, "inertia.mass": 0.02},
        "duration": 4.0,
        "rate": int(rng.choice([120, 240, 1000])),
        "noise": float(np.exp(rng.uniform(np.log(3e-3), np.log(8e-3)))),
    }
    if structure == "crawler":
        crawler(o, vary, rng)
        return o
    if structure == "hanging_strip":
        count, side = int(rng.integers(3, 5)), 0.03 * vary(0.1)
        vertices, faces = strip([side] * count, side)
        pairs = [(p, p + 1) for p in range(count - 1)]
        o |= {"thickness": 1.5e-3, "density": 965.0, "channels": "crease_angle"}
        o["creases"] = creases(pairs, 2e-4 * vary(0.2), 4e-6 * vary(0.3))
        shape = np.array([0.9, -0.7, 0.8])[: count - 1] * rng.uniform(0.8, 1.1, count - 1)
        o["recordings"] = [{"release": (a * shape).tolist()} for a in (1.0, 0.5)]
    elif structure == "pendulum_chain":
        vertices, faces = strip([0.04, 0.10 * vary(0.1), 0.08 * vary(0.1)], 0.02)
        o |= {"thickness": 1e-3, "density": 2700.0, "channels": "panel_angle"}
        o["creases"] = creases([(0, 1), (1, 2)], 1e-4, 1e-5 * vary(0.3))
        shape = np.array([0.9, -0.6]) * rng.uniform(0.8, 1.1, 2)
        o["recordings"] = [{"release": (a * shape).tolist()} for a in (1.0, 0.5)]
    else:
        amplitude, frequency = 0.02 * vary(0.2), 2.5 * vary(0.3)
        if structure == "magnetic_strip":
            side = 0.025
            vertices, faces = strip([side] * 4, 0.02)
            pairs = [(0, 1), (1, 2), (2, 3)]
            o |= {"thickness": 1.5e-3, "density": 2200.0, "channels": "crease_angle"}
            moments = [(p, [0.0, 0.0, 1.0 if p % 2 else -1.0], 0.02) for p in (1, 2, 3)]
            stiffness, axis = 5e-4, [1.0, 0.0, 0.0]
        elif structure == "bi_fold":
            vertices, faces = corner(0.02 * vary(0.05))
            pairs = [(0, 1), (1, 2)]
            o |= {"thickness": 1.5e-3, "density": 2200.0, "channels": "crease_angle"}
            moments = [(1, [1.0, 0.0, 0.0], 0.02), (2, [0.0, 1.0, 0.0], 0.02)]
            stiffness, axis = 1e-3, [0.0, 0.0, 1.0]
        else:
            vertices, faces = box(0.03, 0.02, 0.02)
            pairs = [(0, p) for p in (1, 2, 3, 4)]
            o |= {"thickness": 1.5e-3, "density": 2200.0, "channels": "crease_angle"}
            out = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
            moments = [(p + 1, list(map(float, out[p])), 0.02) for p in range(4)]
            stiffness, axis = 4e-4, [0.0, 0.0, 1.0]
        o["creases"] = creases(pairs, stiffness * vary(0.2), stiffness * 0.004 * vary(0.3))
        o["magnets"] = [{"panel": p, "poling": d, "moment": m} for p, d, m in moments]
        o["priors"]["magnetic_torque.remanence"] = 0.03
        o["recordings"] = [
            {"release": [0.0] * len(pairs), "field": {"amplitude": b * amplitude, "frequency": f, "axis": axis}}
            for b, f in ((1.0, frequency), (0.5, 1.6 * frequency))
        ]
    o |= {"vertices": vertices, "faces": faces}
    return o
