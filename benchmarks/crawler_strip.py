"""The benchmark's device: a crawler-like strip with 12 nodes, 26 bars and 13 hinges, built without the builder.

Five cells between six stations of two nodes, both diagonals of every cell braced. Needs warp and numpy only.
"""

import numpy as np

from origami_sim.drive import Drive, sine
from origami_sim.model import Model, Parameters

EFFECTS = (
    "bars", "crease", "crease_viscosity", "panel_bending", "gravity", "magnetic_torque",
    "ground", "coulomb", "directional_friction", "friction",
)  # fmt: skip
CELLS, PITCH, WIDTH, THICKNESS, DENSITY = 5, 0.01, 0.012, 1e-3, 1500.0
FREQUENCY = 1.0


def strip(worlds: int = 1) -> tuple[Model, Parameters, Drive]:
    """Model, parameters and drive; with several worlds they differ in friction."""
    position = np.array([(PITCH * s, side * WIDTH / 2, 0.0) for s in range(CELLS + 1) for side in (-1, 1)])
    right, left = np.arange(0, 2 * CELLS, 2), np.arange(1, 2 * CELLS, 2)  # of the station behind each cell
    bars = np.concatenate([
        np.stack([right, left], 1), [[2 * CELLS, 2 * CELLS + 1]],  # stations
        np.stack([right, right + 2], 1), np.stack([left, left + 2], 1),  # edges
        np.stack([right, left + 2], 1), np.stack([left, right + 2], 1),  # braces
    ]).astype(np.int32)  # fmt: skip
    inner = right[1:]
    creases = np.stack([inner - 2, inner + 1, inner, inner + 3], 1).astype(np.int32)
    # both diagonals of every cell but the last bend
    bends = np.concatenate([
        np.stack([right + 2, right, left + 2, left], 1), np.stack([right, left, right + 2, left + 2], 1)[:-1],
    ]).astype(np.int32)  # fmt: skip
    triangles = np.concatenate([np.stack([right, right + 2, left + 2], 1), np.stack([right, left + 2, left], 1)])
    # a foot under every node, carried by a triangle of its cell
    cell = np.minimum(np.arange(2 * (CELLS + 1)) // 2, CELLS - 1)
    side, end = np.arange(2 * (CELLS + 1)) % 2, np.arange(2 * (CELLS + 1)) // 2 - cell
    contacts = triangles[cell + CELLS * np.where(end == 1, 0, side)].astype(np.int32)
    nodes = np.arange(len(position))
    weights = (contacts == nodes[:, None]).astype(float)
    ahead = np.zeros_like(weights)  # weights of the edge along x of that triangle
    for row, corners in enumerate(contacts):
        x, y = position[corners, 0], position[corners, 1]
        a, b = next((a, b) for a in range(3) for b in range(3) if y[a] == y[b] and x[b] > x[a])
        ahead[row, a], ahead[row, b] = -1, 1
    model = Model(
        position=position, free=np.ones_like(position), bars=bars, creases=creases, bends=bends,
        triangles=triangles.astype(np.int32), triangle_panel=np.tile(np.arange(CELLS, dtype=np.int32), 2),
        contacts=contacts, contact_weights=weights, contact_offsets=np.full(len(contacts), -0.5e-3), contact_axes=ahead,
        electrodes=np.zeros(len(creases) + len(bends), np.int32), effects=EFFECTS,
    )  # fmt: skip
    model.position[:, 2] = 0.5e-3
    assert (len(position), len(bars), len(creases) + len(bends)) == (12, 26, 13)
    assert np.all(weights.sum(1) == 1)

    area = PITCH * WIDTH / 2
    mass = np.zeros(len(position))
    np.add.at(mass, triangles, DENSITY * THICKNESS * area / 3)
    lengths = np.linalg.norm(np.diff(position[bars], axis=1)[:, 0], axis=-1)
    magnet = np.tile(np.array([0.0, 1.0, 0.0, -1.0, 0.0]), 2)  # two patches, poled against each other
    # poled along x: x2 - x1 of a cell's first triangle, x2 - x3 of its second
    along = np.repeat([[1.0, 0.0], [1.0, -1.0]], CELLS, axis=0)
    p = Parameters(model)
    mu = np.linspace(0.2, 0.6, worlds) if worlds > 1 else np.array([0.3])
    for owner, name, value in (
        ("inertia", "mass", mass),
        ("plane", "reach", 0.0),
        ("bars", "stiffness", 400.0 * PITCH / lengths), ("bars", "rest_length", lengths),
        ("crease", "stiffness", 1e-3), ("crease_viscosity", "viscosity", 1e-6), ("panel_bending", "stiffness", 4e-3),
        ("gravity", "gravity_z", -9.80665),
        ("magnetic_torque", "remanence", 0.06 * magnet), ("magnetic_torque", "volume", area * 3e-3),
        ("magnetic_torque", "poling_1", along[:, 0]), ("magnetic_torque", "poling_2", along[:, 1]),
        ("ground", "stiffness", 100.0), ("ground", "damping", 0.02),
        ("coulomb", "friction_coefficient", np.broadcast_to(mu, (len(contacts), worlds))),
        ("directional_friction", "backward_excess", 0.3),
        ("friction", "stiffness", 100.0), ("friction", "damping", 0.01),
    ):  # fmt: skip
        p.set(owner, name, value)
    return model, p, Drive(field=(0.0, 0.0, sine(0.1, FREQUENCY)))
