"""A gripper of six arms, and the patches that make it grip hardest.

    python examples/gripper.py

Six arms on a hexagon hold something at their tips, 75 degrees up, in a vertical field. How much magnet they carry is
limited by its mass. Where it sits on the arm, how it is poled, and how it is shared between length and thickness is
found by gradients of the equilibrium.
"""

import numpy as np

from origami_sim import Drive, Sheet
from origami_sim.explore import optimise
from origami_sim.pattern.assemble import assemble

SIDE, REACH, WIDTH, UP = 0.015, 0.03, 0.012, np.radians(75)
DENSITY, REMANENCE = 2800.0, 0.13


def arms():
    """Directions outward and along the hinge of the six arms."""
    turns = np.radians(60 * np.arange(6) + 30)
    out = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    return out, np.cross((0, 0, 1), out)


def pattern():
    """The hexagon, flat, and six arms that stand up."""
    apothem = SIDE * np.sqrt(3) / 2
    vertices, base, faces = [], [], []
    for out, along in zip(*arms(), strict=True):
        k = len(vertices)
        middle = apothem * out
        tip = middle + REACH * (np.cos(UP) * out + np.sin(UP) * np.array([0, 0, 1]))
        vertices += [middle + s * WIDTH / 2 * along for s in (-1, 1)] + [tip + s * WIDTH / 2 * along for s in (1, -1)]
        base += [k, k + 1]
        faces.append((k + 1, k, k + 3, k + 2))
    return assemble(vertices, [tuple(base), *faces])


def build(length=0.012, thickness=0.002, centre=0.015, tilt=0.0, field=0.05):
    """The gripper with its tips held where the object is.

    Args:
        length, thickness: of each patch, as wide as the arm. centre: its distance from the hinge. tilt: of its poling,
        from along the arm towards its lower side. field: vertical.
    """
    sheet = Sheet(pattern(), thickness="0.8 mm")
    sheet.crease(stiffness="0.15 mN m/rad", rest_angle=0.0).panel(range(1, 7), rigidity=0.01).gravity()
    for k, (out, _) in enumerate(zip(*arms(), strict=True)):
        arm = np.cos(UP) * out + np.array([0, 0, np.sin(UP)])
        below = np.sin(UP) * out - np.array([0, 0, np.cos(UP)])
        volume = length * WIDTH * thickness
        poling = np.cos(tilt) * arm + np.sin(tilt) * below
        sheet.magnetise(k + 1, remanence=REMANENCE, volume=volume, poling=poling)
        sheet.point_mass(k + 1, DENSITY * volume, SIDE * np.sqrt(3) / 2 * out + centre * arm)
    tips = [n for n, x in enumerate(sheet.mesh.vertices) if x[2] > 0.9 * REACH * np.sin(UP)]
    return sheet.fix(panels=[0], nodes=tips), Drive(field=(0, 0, field))


def grip(found):
    """Mean force of a tip on the object, towards the axis [N]."""
    tips = found.model.position[:, 2] > 0.9 * REACH * np.sin(UP)
    outward = found.model.position * (1, 1, 0)
    outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    return float((found.reactions() * outward)[tips].sum() / 6)


def magnets(found):
    """Mass of the magnet of one arm [kg]."""
    return DENSITY * float(found.parameters["magnetic_torque", "volume"].sum()) / 6


if __name__ == "__main__":
    bounds = {"length": ("4 mm", "20 mm"), "thickness": ("0.5 mm", "3 mm"), "centre": ("3 mm", "26 mm"),
              "tilt": ("-90 deg", "90 deg")}  # fmt: skip
    best = optimise(build, lambda f: -grip(f), bounds, subject_to=[(magnets, 0.0, "1 g")])
    print(f"{1e3 * grip(best.found):.3f} mN per arm with {1e3 * magnets(best.found):.3f} g of magnet: {best}")
