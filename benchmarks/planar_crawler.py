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
from itertools import pairwise
from pathlib import Path

import numpy as np

MOST, POINTS, SHAPES, STRETCHES = 512, 16, 8, 16
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
        ("bending", ctypes.c_double * SHAPES * SHAPES),
        ("poisson", ctypes.c_double * SHAPES * MOST),
        ("flattening", ctypes.c_double * SHAPES * SHAPES * MOST),
        ("relief", ctypes.c_double * STRETCHES * SHAPES * MOST),
        ("loss_time", ctypes.c_double),
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


def chain(s: dict, cell: float, relaxing: bool) -> tuple[dict[str, np.ndarray], np.ndarray, float]:
    """Numbers of the device, its first state (2, stations, 2), and the shortest step of its springs [s]."""
    length, patch = [], []
    for name, width in (("overhang", 0.0), ("big_length", s["big_width"]), ("span", 0.0),
                        ("small_length", s["small_width"]), ("overhang", 0.0)):  # fmt: skip
        n = max(1, round(s[name] / cell))
        length += [s[name] / n] * n
        patch += [width] * n
    length, patch, n = np.array(length), np.array(patch), len(length)
    x = np.append(0.0, np.cumsum(length))
    width = np.interp((x[1:] + x[:-1]) / 2, x[[0, -1]], [s["rear_width"], s["front_width"]])

    # bending: two bonded layers about their own neutral axis, the sheet alone beside the patch
    h, t = s["thickness"], s["patch_thickness"]
    soft, hard = MAE / (1 - 0.49**2), s["modulus"] / (1 - s["poisson"] ** 2)
    axis = (hard * h**2 / 2 + soft * t * (h + t / 2)) / (hard * h + soft * t)
    bonded = hard * (h**3 / 12 + h * (h / 2 - axis) ** 2) + soft * (t**3 / 12 + t * (h + t / 2 - axis) ** 2)
    bare = hard * h**3 / 12
    rigidity = bare * (width - patch) + bonded * patch
    k, c = np.zeros(n + 1), np.zeros(n + 1)
    half = length / rigidity / 2
    k[1:n] = 1 / (half[1:] + half[:-1])
    part = half * bare * width / rigidity  # of the turn squared, over the whole's, that bends the sheet
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
    s: dict, cell: float, waves: int = 4, powers: tuple[int, ...] = (2, 4), nodes: int = 8
) -> tuple[int, int, dict[str, np.ndarray]]:
    """Stations where the bridge begins and ends, and energies of its curvature across by shape (see planar_crawler.c).

    Between the patches, where it is flat with its slope, the sheet is lifted by w(x, y) from a bend of curvature k(x)
    and moves by u, v within itself. Energies per area are those of Kirchhoff and, for its stretching, of Donnell:

        D / 2 (k_x^2 + k_y^2 + 2 nu k_x k_y + 2 (1 - nu) w_xy^2),  k_x = k + w_xx,  k_y = w_yy
        C / 2 (e_x^2 + e_y^2 + 2 nu e_x e_y + (1 - nu) / 2 g^2),   e_x = u_x - k w,  e_y = v_y,  g = u_y + v_x

    with C = E h / (1 - nu^2). What is lifted from a bend is stretched: so a bridge that bends far stiffens. w has no
    mean over the width, which is the chain's. The shapes are polynomials, so many `waves` along the bridge times powers
    of the place across it; u and v are condensed. Those that a walk has leave a bridge 0.3 to 0.5 % too stiff.
    """
    h, nu, span = s["thickness"], s["poisson"], s["span"]
    stretch = s["modulus"] * h / (1 - nu**2)
    plate = stretch * h**2 / 12
    counts = [max(1, round(s[n] / cell)) for n in ("overhang", "big_length", "span")]
    first, start = sum(counts[:2]), s["overhang"] + s["big_length"]
    total = start + span + s["small_length"] + s["overhang"]
    at, weight = np.polynomial.legendre.leggauss(nodes)
    half_width = 0.5 * (s["rear_width"] + (s["front_width"] - s["rear_width"]) * (start + span / 2) / total)

    def along(x, power: int, derivative: int):
        """[waves, ...] shapes that vanish at the ends as the power says."""
        rim = np.polynomial.Polynomial([1, 0, -1]) ** power
        shapes = [rim * np.polynomial.Legendre.basis(k).convert(kind=np.polynomial.Polynomial) for k in range(waves)]
        return np.array([p.deriv(derivative)(2 * x / span - 1) * (2 / span) ** derivative for p in shapes])

    def side(y, power: int, derivative: int):
        p = np.polynomial.Polynomial.basis(power).deriv(derivative)
        return p(y / half_width) / half_width**derivative

    def product(f, g):
        return np.concatenate([f * each for each in g])

    count = waves * len(powers)
    bending, membrane = np.zeros((count, count)), np.zeros((2 * count, 2 * count))
    out = {"poisson": np.zeros((MOST, count)), "flattening": np.zeros((MOST, count, count)),
           "relief": np.zeros((MOST, count, 2 * count))}  # fmt: skip
    halves = np.linspace(0.0, span, 2 * counts[2] + 1)
    for k, (a, b) in enumerate(pairwise(halves)):  # the hinge at its one end bends half a cell
        hinge = first + (k + 1) // 2
        bends = b - a if k in (0, 2 * counts[2] - 1) else 2 * (b - a)
        x = (a + b) / 2 + (b - a) / 2 * np.repeat(at, nodes)
        width = s["rear_width"] + (s["front_width"] - s["rear_width"]) * (start + x) / total
        y = width / 2 * np.tile(at, nodes)
        area = (b - a) / 2 * np.repeat(weight, nodes) * width / 2 * np.tile(weight, nodes)
        mean = {p: (width / 2 / half_width) ** p / (p + 1) for p in powers}
        lift, along_2 = (product(along(x, 2, d), [side(y, p, 0) - mean[p] for p in mean]) for d in (0, 2))
        across_2 = product(along(x, 2, 0), [side(y, p, 2) for p in mean])
        twist = product(along(x, 2, 1), [side(y, p, 1) for p in mean])
        even, odd = ([p - k for p in powers] for k in (2, 1))
        none = np.zeros((count, len(x)))
        e_x = np.concatenate([product(along(x, 1, 1), [side(y, p, 0) for p in even]), none])
        e_y = np.concatenate([none, product(along(x, 1, 0), [side(y, p, 1) for p in odd])])
        shear = np.concatenate([product(along(x, 1, 0), [side(y, p, 1) for p in even]),
                                product(along(x, 1, 1), [side(y, p, 0) for p in odd])])  # fmt: skip
        d, c = plate * area, stretch * area
        bending += (d * along_2) @ (along_2 + nu * across_2).T + (d * across_2) @ (across_2 + nu * along_2).T
        bending += (2 * (1 - nu) * d * twist) @ twist.T
        membrane += (c * e_x) @ (e_x + nu * e_y).T + (c * e_y) @ (e_y + nu * e_x).T
        membrane += (0.5 * (1 - nu) * c * shear) @ shear.T
        out["poisson"][hinge] += (along_2 + nu * across_2) @ d / bends
        out["flattening"][hinge] += (c * lift) @ lift.T / bends**2
        out["relief"][hinge] += (c * lift) @ (e_x + nu * e_y).T / bends
    root = np.linalg.cholesky(membrane)
    out["relief"] = np.linalg.solve(root, out["relief"].reshape(-1, 2 * count).T).T.reshape(out["relief"].shape)
    return first, first + counts[2], {"bending": bending, **out}


def turn(s: dict, cell: float, couple: float) -> tuple[float, float]:
    """Turn of a bridge that curves across under an even couple [N m]: [rad], and over that in plane strain."""
    from scipy.optimize import fsolve

    first, last, e = across(s, cell, 10, (2, 4, 6, 8), nodes=12)
    hinges = slice(first, last + 1)
    stiffness = chain(s, cell, True)[0]["rigidity"][hinges]
    poisson, flattening, relief = (e[n][hinges] for n in ("poisson", "flattening", "relief"))

    def unbalanced(t):
        moved = np.einsum("i,iks->ks", t, relief)
        whole = e["bending"] + np.einsum("i,ikl->kl", t**2, flattening) - moved @ moved.T
        c = np.linalg.solve(whole, -poisson.T @ t)
        flat = t * np.einsum("k,ikl,l->i", c, flattening, c) - np.einsum("k,iks,s->i", c, relief, moved.T @ c)
        return (stiffness * t + poisson @ c + flat) / couple - 1

    plane = couple / stiffness
    found = float(fsolve(unbalanced, plane).sum())
    return found, found / float(plane.sum())


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
    """Strides by cycle [m]; with `relaxing`, losses are the Maxwell branch of a free strip; with `free` too, and its
    bridge curves across."""
    values, state, step = chain(s, cell, relaxing or free)
    device = Device()
    for name, v in values.items():
        if np.ndim(v):
            getattr(device, name)[: len(v)] = list(v)
        else:
            setattr(device, name, v)
    if free:
        device.shapes, device.loss_time = SHAPES, s["loss_time"]
        device.first, device.last, energies = across(s, cell)
        for name, v in energies.items():
            ctypes.memmove(getattr(device, name), np.ascontiguousarray(v).ctypes.data, v.nbytes)
    every = int(np.ceil(1 / (s["frequency"] * step * fraction)))
    out = np.zeros(cycles + 1)
    out[0] = np.average(state[0, :, 0], weights=values["mass"])
    pointer = ctypes.POINTER(ctypes.c_double)
    lib.run(ctypes.byref(device), state.ctypes.data_as(pointer), ctypes.c_double(1 / s["frequency"] / every),
            ctypes.c_long(every * cycles), ctypes.c_long(every), out[1:].ctypes.data_as(pointer))  # fmt: skip
    return np.diff(out)


def main(argv=None):
    from origami_sim.scene import read_calibration

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibration", default="crawler_reference")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--cell", type=float, nargs="+", default=[3.8, 1.9, 0.95], help="[mm]")
    parser.add_argument("--cycles", type=int, default=6)
    parser.add_argument("--fraction", type=float, default=FRACTION)
    parser.add_argument("--relaxing", action="store_true", help="losses as those of a free strip, not viscous")
    parser.add_argument("--free", action="store_true", help="relaxing, and the bridge curves across")
    parser.add_argument("--bend", type=float, nargs="+", metavar="N m", help="no walk: turn of a free bridge by couple")
    args = parser.parse_args(argv)
    settings = read_calibration(args.calibration).override(args.set, "--set")
    values, lib = {n: settings[n].value for n in settings.as_dict()}, library()
    for cell in args.cell:
        for couple in args.bend or ():
            angle, softer = turn(values, 1e-3 * cell, couple)
            print(f"cells of {cell:g} mm, {couple:g} N m: {np.degrees(angle):.1f} deg, {softer:.4f} times plane strain")
        if args.bend:
            continue
        found = walk(lib, values, cell=1e-3 * cell, cycles=args.cycles, fraction=args.fraction,
                     relaxing=args.relaxing, free=args.free)  # fmt: skip
        print(f"cells of {cell:g} mm: " + " ".join(f"{1e3 * x:.2f}" for x in found) + " mm per cycle", flush=True)


if __name__ == "__main__":
    main()
