"""The crawler by an independent model: a chain in a plane, in C (planar_crawler.c), of the same device.

    python benchmarks/planar_crawler.py --set field=0.1 --cell 0.95

It shares the calibration with the scene and nothing else. Needs a C compiler.
"""

import argparse
import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

MOST, POINTS, SHAPES, LIFTED, STRETCHES = 512, 16, 64, 32, 16
ARRAYS = ("rigidity", "loss", "axial", "dashpot", "length", "couple", "lift", "mass", "kn", "cn")
NUMBERS = ("belly", "foot", "mu", "mu_forward", "mu_back", "field", "frequency", "gravity", "decay",
           "relaxation")  # fmt: skip
MAE = 0.78e6
"""Young's modulus of the patches [Pa]; their Poisson's ratio is 0.49."""
FRACTION = 0.25
"""Step over the longest that the springs of the chain allow.

The step is of first order: half changes the strides of the reference set by 0.4 % at cells of 2.6 mm, 0.1 % at 1.3 mm;
double was used for cells of 0.65 mm only, by which time the bound itself is that small.
"""
ELEMENT = 5e-3
"""Length of the elements by which a strip curves across [m]."""


class Device(ctypes.Structure):
    _fields_ = [
        ("cells", ctypes.c_int),
        *((n, ctypes.c_double * MOST) for n in ARRAYS),
        ("foot_kn", ctypes.c_double),
        ("foot_cn", ctypes.c_double),
        ("points", ctypes.c_int),
        ("at", ctypes.c_double * POINTS),
        ("share", ctypes.c_double * POINTS),
        *((n, ctypes.c_double) for n in NUMBERS),
        ("first", ctypes.c_int),
        ("last", ctypes.c_int),
        ("shapes", ctypes.c_int),
        ("lifted", ctypes.c_int),
        ("bending", ctypes.c_double * SHAPES * SHAPES),
        ("poisson", ctypes.c_double * SHAPES * MOST),
        ("bending_loss", ctypes.c_double * SHAPES * SHAPES),
        ("poisson_loss", ctypes.c_double * SHAPES * MOST),
        ("flattening", ctypes.c_double * LIFTED * LIFTED * MOST),
        ("relief", ctypes.c_double * STRETCHES * LIFTED * MOST),
    ]


def library() -> ctypes.CDLL:
    """Compiles the chain into a temporary folder and loads it."""
    cc = shutil.which(os.environ.get("CC", "cc"))
    if cc is None:
        raise FileNotFoundError("there is no C compiler")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "planar_crawler.so"
        source = Path(__file__).with_name("planar_crawler.c")
        subprocess.run([cc, "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(out), "-lm"], check=True)
        return ctypes.CDLL(str(out))


def divided(s: dict, size: float) -> list[np.ndarray]:
    """Lengths [m] of cells of about a size: of an overhang, the big patch, the bridge, the small patch, an overhang."""
    parts = [s[n] for n in ("overhang", "big_length", "span", "small_length", "overhang")]
    counts = [max(1, round(part / size)) for part in parts]
    return [np.full(n, part / n) for part, n in zip(parts, counts, strict=True)]


def cells(s: dict, size: float) -> tuple[np.ndarray, ...]:
    """Of cells of about a size: length, width of sheet and patch [m], rigidity of the sheet, of both [N m^2].

    Two bonded layers bend about their own neutral axis, the sheet alone beside the patch.
    """
    parts = divided(s, size)
    length = np.concatenate(parts)
    patch = np.repeat([0.0, s["big_width"], 0.0, s["small_width"], 0.0], [len(part) for part in parts])
    x = np.append(0.0, np.cumsum(length))
    width = np.interp((x[1:] + x[:-1]) / 2, x[[0, -1]], [s["rear_width"], s["front_width"]])
    h, t = s["thickness"], s["patch_thickness"]
    soft, hard = MAE / (1 - 0.49**2), s["modulus"] / (1 - s["poisson"] ** 2)
    axis = (hard * h**2 / 2 + soft * t * (h + t / 2)) / (hard * h + soft * t)
    bonded = hard * (h**3 / 12 + h * (h / 2 - axis) ** 2) + soft * (t**3 / 12 + t * (h + t / 2 - axis) ** 2)
    bare = hard * h**3 / 12
    return length, width, patch, bare * width, bare * (width - patch) + bonded * patch


def chain(s: dict, cell: float, relaxing: bool) -> tuple[dict[str, np.ndarray], np.ndarray, float]:
    """Numbers of the device, its first state (2, stations, 2), and the shortest step of its springs [s]."""
    length, width, patch, bare, rigidity = cells(s, cell)
    n, h, t = len(length), s["thickness"], s["patch_thickness"]
    x = np.append(0.0, np.cumsum(length))
    k, c = np.zeros(n + 1), np.zeros(n + 1)
    half = length / rigidity / 2
    k[1:n] = 1 / (half[1:] + half[:-1])
    part = half * bare / rigidity  # of the turn squared, over the whole's, that bends the sheet
    c[1:n] = s["loss_time"] * (k[1:n] if s["patch_loss"] else k[1:n] ** 2 * (part[1:] + part[:-1]))

    time = s["relaxation_time"] if relaxing else 0.0
    fast = k + c / time if relaxing else k

    weight = s["patch_density"] * t * patch * length
    mass = np.zeros(n + 1)
    for side in (mass[1:], mass[:-1]):
        side += (s["density"] * h * width * length + weight) / 2
    mass[[0, -1]] += s["foot_mass"]
    axial = s["membrane"] * (s["modulus"] * h * width + MAE * t * patch) / length
    reduced = mass[1:] * mass[:-1] / (mass[1:] + mass[:-1])
    middle = np.cumsum(length) - length / 2
    poled = np.where(middle < s["overhang"] + s["big_length"] + s["span"] / 2, s["big_moment"], -1.0)
    kn, foot = s["ground_stiffness"] * length, s["foot_stiffness"]
    at, share = np.polynomial.legendre.leggauss(int(s["belly_points"]))
    values = {
        "cells": n, "rigidity": k, "loss": c, "axial": axial, "length": length, "mass": mass, "kn": kn,
        "dashpot": 2 * s["membrane_damping"] * np.sqrt(axial * reduced), "cn": s["ground_time"] * kn,
        "foot_kn": foot, "foot_cn": s["ground_time"] * foot, "points": len(at), "at": (1 + at) / 2, "share": share / 2,
        "couple": s["polarity"] * poled * s["remanence"] / (4e-7 * np.pi) * t * patch * length,
        "lift": weight * s["gravity"] * (h + t) / 2 * bool(s["patch_height"]),
        "belly": h / 2, "foot": h / 2 + s["foot_height"], "mu": s["belly_friction"],
        "mu_forward": s["foot_friction"], "mu_back": s["foot_friction_back"], "field": s["field"],
        "frequency": s["frequency"], "gravity": s["gravity"], "decay": s["decay_rate"],
        "relaxation": time,
    }  # fmt: skip

    near = np.minimum(np.append(length[0], length), np.append(length, length[-1]))
    hinge, rod = (
        np.maximum.reduce([a, np.append(a[1:], 0), np.append(0, a[:-1])]) for a in (fast, np.append(axial, 0))
    )
    lever = (1 + 2 * values["foot"] / near) ** 2
    ground = (np.append(kn, 0) + np.append(0, kn)) / 2
    ground[[0, -1]] += foot
    step = 2 / np.sqrt(((16 * hinge / near**2 + 4 * rod + ground * lever) / mass).max())
    state = np.zeros((2, n + 1, 2))
    state[0] = np.column_stack([x, np.full(n + 1, values["foot"])])
    return values, state, step


def across(
    s: dict, cell: float, element: float = ELEMENT, powers: tuple[int, ...] = (2, 4), waves: int = 4, nodes: int = 6
) -> dict:
    """What the device has of a strip that curves across: shapes of that, and energies by shape (see planar_crawler.c).

    The sheet is lifted by w(x, y) from a bend of curvature k(x) and moves by u, v within itself. Energies per area are
    those of Kirchhoff, with the rigidity D of sheet and patch spread over the width, and for the bridge's stretching of
    Donnell:

        D / 2 (k_x^2 + k_y^2 + 2 nu k_x k_y + 2 (1 - nu) w_xy^2),  k_x = k + w_xx,  k_y = w_yy
        C / 2 (e_x^2 + e_y^2 + 2 nu e_x e_y + (1 - nu) / 2 g^2),   e_x = u_x - k w,  e_y = v_y,  g = u_y + v_x

    with C = E h / (1 - nu^2). What is lifted from a bend is stretched: so a bridge that bends far stiffens. Patches
    hardly bend along, but curve across where the bridge bends so fast that its losses ask for more than D k. w has no
    mean over the width, which is the chain's. It is cubic along each of the elements, with its slope, times powers of
    the place across; u and v are polynomials, so many `waves` along the bridge, and condensed.
    """
    h, nu, span = s["thickness"], s["poisson"], s["span"]
    length, width, _, bare, rigidity = cells(s, cell)
    x = np.append(0.0, np.cumsum(length))
    first, last = np.cumsum([len(part) for part in divided(s, cell)])[1:3].tolist()
    stretch = s["modulus"] * h / (1 - nu**2)
    half_width = np.interp((x[first] + x[last]) / 2, x[[0, -1]], [s["rear_width"], s["front_width"]]) / 2
    at, weight = np.polynomial.legendre.leggauss(nodes)

    # shapes: those that lift the bridge first
    places = np.append(0.0, np.cumsum(np.concatenate(divided(s, element))))
    at_bridge = (places > x[first] - 1e-9) & (places < x[last] + 1e-9)
    order, lifting = np.argsort(~at_bridge, kind="stable"), 2 * len(powers) * int(at_bridge.sum())
    one, none = np.eye(len(places))[:, order], np.zeros((len(places), len(places)))
    value, slope = CubicHermiteSpline(places, one, none), CubicHermiteSpline(places, none, one / half_width)

    def lift(at, derivative: int):
        return np.stack([value(at, derivative), slope(at, derivative)]).transpose(2, 0, 1)

    def within(at, derivative: int):
        """[waves, ...] shapes that vanish at the ends of the bridge."""
        legendre = [np.polynomial.Legendre.basis(k).convert(kind=np.polynomial.Polynomial) for k in range(waves)]
        shapes = [np.polynomial.Polynomial([1, 0, -1]) * p for p in legendre]
        z = 2 * (at - x[first]) / span - 1
        return np.array([p.deriv(derivative)(z) * (2 / span) ** derivative for p in shapes])

    def side(y, power: int, derivative: int):
        p = np.polynomial.Polynomial.basis(power).deriv(derivative)
        return p(y / half_width) / half_width**derivative

    def product(f, g):
        """[shapes along times shapes across, ...]"""
        return (f[..., None, :] * np.array(g)).reshape(-1, f.shape[-1])

    count, moves = 2 * len(powers) * len(places), 2 * waves * len(powers)
    bending, bending_loss, membrane = np.zeros((count, count)), np.zeros((count, count)), np.zeros((moves, moves))
    poisson, poisson_loss = np.zeros((len(x), count)), np.zeros((len(x), count))
    flattening, relief = np.zeros((len(x), lifting, lifting)), np.zeros((len(x), lifting, moves))
    half = length / rigidity / 2
    for k in range(2 * len(length)):  # halves of cells: each bends with the hinge at its end, by its share
        j, hinge = k // 2, (k + 1) // 2
        a = x[j] + (k % 2) * length[j] / 2
        both = half[hinge - 1 : hinge + 1]
        bend = half[j] / both.sum() / (length[j] / 2) if len(both) == 2 else 0.0  # curvature over the hinge's turn
        along = a + length[j] / 4 * (1 + np.repeat(at, nodes))
        wide = np.interp(along, x[[0, -1]], [s["rear_width"], s["front_width"]])
        y = wide / 2 * np.tile(at, nodes)
        area = length[j] / 4 * np.repeat(weight, nodes) * wide / 2 * np.tile(weight, nodes)
        lifted = [side(y, p, 0) - (wide / 2 / half_width) ** p / (p + 1) for p in powers]
        along_2 = product(lift(along, 2), lifted)
        across_2 = product(lift(along, 0), [side(y, p, 2) for p in powers])
        twist = product(lift(along, 1), [side(y, p, 1) for p in powers])
        d, c = rigidity[j] / width[j] * area, stretch * area
        lossy = s["loss_time"] * (d if s["patch_loss"] else bare[j] / width[j] * area)
        for matrix, coupling, by in ((bending, poisson, d), (bending_loss, poisson_loss, lossy)):
            matrix += (by * along_2) @ (along_2 + nu * across_2).T + (by * across_2) @ (across_2 + nu * along_2).T
            matrix += (2 * (1 - nu) * by * twist) @ twist.T
            coupling[hinge] += bend * (along_2 + nu * across_2) @ by
        if not first <= j < last:
            continue
        w = product(lift(along, 0), lifted)[:lifting]
        even, odd = ([p - k for p in powers] for k in (2, 1))
        zero = np.zeros((moves // 2, len(along)))
        e_x = np.concatenate([product(within(along, 1), [side(y, p, 0) for p in even]), zero])
        e_y = np.concatenate([zero, product(within(along, 0), [side(y, p, 1) for p in odd])])
        shear = np.concatenate([product(within(along, 0), [side(y, p, 1) for p in even]),
                                product(within(along, 1), [side(y, p, 0) for p in odd])])  # fmt: skip
        membrane += (c * e_x) @ (e_x + nu * e_y).T + (c * e_y) @ (e_y + nu * e_x).T
        membrane += (0.5 * (1 - nu) * c * shear) @ shear.T
        flattening[hinge] += bend**2 * (c * w) @ w.T
        relief[hinge] += bend * (c * w) @ (e_x + nu * e_y).T
    relief = np.linalg.solve(np.linalg.cholesky(membrane), relief.reshape(-1, moves).T).T.reshape(relief.shape)
    return {"first": first, "last": last, "shapes": count, "lifted": lifting, "bending": bending, "poisson": poisson,
            "bending_loss": bending_loss, "poisson_loss": poisson_loss, "flattening": flattening,
            "relief": relief}  # fmt: skip


def turn(s: dict, cell: float, couple: float) -> tuple[float, float]:
    """Turn of a bridge that curves across under an even couple [N m]: [rad], and over that in plane strain."""
    from scipy.optimize import fsolve

    e = across(s, cell, ELEMENT / 2, (2, 4, 6), waves=8, nodes=10)
    hinges, some = slice(e["first"], e["last"] + 1), e["lifted"]
    stiffness = chain(s, cell, True)[0]["rigidity"][hinges]
    poisson, flattening, relief = (e[n][hinges] for n in ("poisson", "flattening", "relief"))

    def unbalanced(t):
        moved = np.einsum("i,iks->ks", t, relief)
        whole = e["bending"].copy()
        whole[:some, :some] += np.einsum("i,ikl->kl", t**2, flattening) - moved @ moved.T
        c = np.linalg.solve(whole, -poisson.T @ t)
        b = c[:some]
        flat = t * np.einsum("k,ikl,l->i", b, flattening, b) - np.einsum("k,iks,s->i", b, relief, moved.T @ b)
        return (stiffness * t + poisson @ c + flat) / couple - 1

    plane = couple / stiffness
    found = float(fsolve(unbalanced, plane).sum())
    return found, found / float(plane.sum())


def filled(values: dict) -> Device:
    device = Device()
    for name, v in values.items():
        if np.ndim(v):
            np.ctypeslib.as_array(getattr(device, name))[tuple(map(slice, v.shape))] = v
        else:
            setattr(device, name, v)
    return device


def swung(lib: ctypes.CDLL, s: dict, *, cell: float, free: bool, duration: float) -> float:
    """Turn of the small patch [rad] after a time in the field, the big one held, without weight, ground and air."""
    values, state, step = chain(s | {"gravity": 0.0, "decay_rate": 0.0}, cell, True)
    big, near, far = np.cumsum([len(part) for part in divided(s, cell)])[1:4]
    values["mass"][: big + 1] = 1e9 * values["mass"].sum()
    state[0, :, 1] += 1.0  # above the ground
    steps = int(np.ceil(duration / (step * FRACTION)))
    pointer, none = ctypes.POINTER(ctypes.c_double), np.zeros(1)
    lib.run(ctypes.byref(filled(values | (across(s, cell) if free else {}))), state.ctypes.data_as(pointer),
            ctypes.c_double(duration / steps), ctypes.c_long(steps), ctypes.c_long(steps + 1),
            none.ctypes.data_as(pointer))  # fmt: skip
    x, z = state[0, far] - state[0, near]
    return float(np.arctan2(z, x))


def walk(
    lib: ctypes.CDLL,
    s: dict,
    *,
    cell: float,
    cycles: int = 6,
    fraction: float = FRACTION,
    relaxing: bool = False,
    free: bool = False,
) -> np.ndarray:
    """Strides by cycle [m]; with `relaxing`, losses are the Maxwell branch of a free strip; with `free` too, and it
    curves across."""
    values, state, step = chain(s, cell, relaxing or free)
    device = filled(values | (across(s, cell) if free else {}))
    every = int(np.ceil(1 / (s["frequency"] * step * fraction)))
    out = np.zeros(cycles + 1)
    out[0] = np.average(state[0, :, 0], weights=values["mass"])
    pointer = ctypes.POINTER(ctypes.c_double)
    lib.run(ctypes.byref(device), state.ctypes.data_as(pointer), ctypes.c_double(1 / s["frequency"] / every),
            ctypes.c_long(every * cycles), ctypes.c_long(every), out[1:].ctypes.data_as(pointer))  # fmt: skip
    return np.diff(out)


def main(argv=None):
    from origami_sim.device.scene import read_calibration

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibration", default="crawler_reference")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--cell", type=float, nargs="+", default=[3.8, 1.9, 0.95], help="[mm]")
    parser.add_argument("--cycles", type=int, default=6)
    parser.add_argument("--fraction", type=float, default=FRACTION)
    parser.add_argument("--relaxing", action="store_true", help="losses as those of a free strip, not viscous")
    parser.add_argument("--free", action="store_true", help="relaxing, and the strip curves across")
    parser.add_argument("--bend", type=float, nargs="+", metavar="N m", help="no walk: turn of a free bridge by couple")
    parser.add_argument("--swing", type=float, nargs="+", metavar="ms", help="no walk: turn of a free bridge by time")
    args = parser.parse_args(argv)
    settings = read_calibration(args.calibration).override(args.set, "--set")
    values, lib = {n: settings[n].value for n in settings.as_dict()}, library()
    for cell in args.cell:
        for couple in args.bend or ():
            angle, softer = turn(values, 1e-3 * cell, couple)
            print(f"cells of {cell:g} mm, {couple:g} N m: {np.degrees(angle):.1f} deg, {softer:.4f} times plane strain")
        for time in args.swing or ():
            plane, free = (
                np.degrees(swung(lib, values, cell=1e-3 * cell, free=f, duration=1e-3 * time)) for f in (0, 1)
            )
            print(f"cells of {cell:g} mm, {time:g} ms: {free:.2f} deg, in plane strain {plane:.2f}")
        if args.bend or args.swing:
            continue
        found = walk(lib, values, cell=1e-3 * cell, cycles=args.cycles, fraction=args.fraction,
                     relaxing=args.relaxing, free=args.free)  # fmt: skip
        print(f"cells of {cell:g} mm: " + " ".join(f"{1e3 * x:.2f}" for x in found) + " mm per cycle", flush=True)


if __name__ == "__main__":
    main()
