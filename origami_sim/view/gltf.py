"""glTF 2.0 with animation (GLB, one file): what Blender, three.js, Windows and macOS open.

The sheet has its own corners for every triangle, so that it is shaded flat; keyframes are morph targets, between
which a viewer goes linearly. Creases are lines of their own. Metres; z up becomes y up, as the format wants
(Khronos Group, glTF 2.0 specification, 2021; ISO/IEC 12113:2022).
"""

import json
from typing import Any

import numpy as np

from origami_sim import __version__
from origami_sim.view.film import Film
from origami_sim.view.palette import COLOURS

KEYFRAMES = 90
"""Morph targets at most, which a viewer keeps in memory: nine for each of ten cycles of a walk; half as many cut its
corners, double makes files twice as large."""

FLOAT, UNSIGNED_BYTE = 5126, 5121
ARRAY_BUFFER = 34962
TRIANGLES, LINES = 4, 1
UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Rotation (x, y, z, w) that takes z up to y up."""


def glb(film: Film, *, keyframes: int = KEYFRAMES) -> bytes:
    """A run as an animated binary glTF file."""
    frames = np.unique(np.linspace(0, len(film.times) - 1, min(keyframes, len(film.times))).round().astype(int))
    seconds = (film.times[frames] - film.times[frames[0]]).astype(np.float32)
    seconds, first = np.unique(seconds, return_index=True)  # of frames that float32 cannot tell apart one
    frames = frames[first]
    out = _Buffer()
    corners, _ = film.faces()
    base = np.array([COLOURS[k] for k in film.kinds], float).reshape(-1, 3)
    edges = np.concatenate([film.outlines(), film.model.creases[:, 1:3]]).astype(int)
    folds = film.folds()
    colours = np.concatenate([
        np.tile(np.array(COLOURS["outline"], float), (len(edges) - folds.shape[1], 1)),
        folds[np.abs(folds - folds[0]).sum(axis=(1, 2)).argmax()] if folds.shape[1] else np.zeros((0, 3)),
    ])  # fmt: skip
    parts = [("sheet", corners[frames], np.repeat(base, 3, axis=0), TRIANGLES)]
    if len(edges):
        parts.append(
            ("creases", film.x[frames][:, edges].reshape(len(frames), -1, 3), np.repeat(colours, 2, axis=0), LINES)
        )
    meshes, nodes = [], []
    for name, positions, colour, mode in parts:
        meshes.append(_mesh(out, name, positions, colour, mode, material=0 if mode == TRIANGLES else 1))
        nodes.append({"name": name, "mesh": len(meshes) - 1})
    nodes.append({"name": film.title, "children": list(range(len(parts))), "rotation": UP})
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"origami_sim {__version__}"},
        "scene": 0,
        "scenes": [{"name": film.title, "nodes": [len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [
            {
                "name": "sheet",
                "doubleSided": True,
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.85},
            },
            {"name": "line", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}},
        ],
    }
    if len(frames) > 1:
        times = out.accessor(seconds, "SCALAR", bounds=True)
        weights = np.eye(len(frames), dtype=np.float32)[:, 1:].reshape(-1)  # the first frame is the mesh itself
        output = out.accessor(weights, "SCALAR")
        document["animations"] = [
            {
                "name": film.title,
                "samplers": [{"input": times, "output": output, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": n, "path": "weights"}} for n in range(len(parts))],
            }
        ]
    document |= {
        "accessors": out.accessors,
        "bufferViews": out.views,
        "buffers": [{"byteLength": len(out.data)}],
    }
    return _packed(document, bytes(out.data))


def _mesh(out: "_Buffer", name: str, positions: np.ndarray, colours: np.ndarray, mode: int, material: int) -> dict:
    """A mesh from positions [K, V, 3] of all keyframes and colours [V, 3] (0 to 255)."""
    linear = np.clip(colours / 255.0, 0, 1) ** 2.2  # vertex colours are linear
    rgba = np.concatenate([np.round(255 * linear), np.full((len(linear), 1), 255.0)], axis=1).astype(np.uint8)
    primitive: dict[str, Any] = {
        "attributes": {
            "POSITION": out.accessor(positions[0].astype(np.float32), "VEC3", bounds=True, target=ARRAY_BUFFER),
            "COLOR_0": out.accessor(rgba, "VEC4", normalised=True, target=ARRAY_BUFFER),
        },
        "mode": mode,
        "material": material,
    }
    mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
    if len(positions) > 1:
        primitive["targets"] = [
            {"POSITION": out.accessor((p - positions[0]).astype(np.float32), "VEC3", bounds=True, target=ARRAY_BUFFER)}
            for p in positions[1:]
        ]
        mesh["weights"] = [0.0] * (len(positions) - 1)
    return mesh


class _Buffer:
    """The binary part, with the accessors and views that tell what lies where."""

    def __init__(self):
        self.data, self.views, self.accessors = bytearray(), [], []

    def accessor(
        self, values: np.ndarray, kind: str, *, bounds=False, normalised=False, target: int | None = None
    ) -> int:
        """Adds an array and returns the number of its accessor."""
        self.data += b"\0" * (-len(self.data) % 4)
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        self.data += values.tobytes()
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": UNSIGNED_BYTE if values.dtype == np.uint8 else FLOAT,
            "count": len(values),
            "type": kind,
        }
        if normalised:
            accessor["normalized"] = True
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _packed(document: dict, binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = len(text).to_bytes(4, "little") + b"JSON" + text + len(binary).to_bytes(4, "little") + b"BIN\0" + binary
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
