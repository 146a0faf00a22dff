"""Exports are valid glTF 2.0: the rules of its specification (Khronos Group 2021), checked one by one."""

import json

import numpy as np
import pytest
import trimesh

from origami_sim.view.film import Film
from origami_sim.view.gltf import glb
from tests.view.test_replay import swing

SIZES, WIDE = {5121: 1, 5126: 4}, {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
KINDS = {5121: np.uint8, 5126: np.float32}
TOP = {"asset", "scene", "scenes", "nodes", "meshes", "materials", "animations", "accessors", "bufferViews", "buffers"}


def chunks(data: bytes) -> tuple[dict, bytes]:
    """JSON and binary part, if the container is as section 4.4 has it."""
    magic, version, length = data[:4], int.from_bytes(data[4:8], "little"), int.from_bytes(data[8:12], "little")
    assert magic == b"glTF" and version == 2 and length == len(data) and length % 4 == 0
    size = int.from_bytes(data[12:16], "little")
    assert data[16:20] == b"JSON" and size % 4 == 0
    text, rest = data[20 : 20 + size], data[20 + size :]
    assert text.startswith(b"{") and text.rstrip(b" ").endswith(b"}")  # padded with spaces only
    assert rest[4:8] == b"BIN\0" and int.from_bytes(rest[:4], "little") == len(rest) - 8 and len(rest) % 4 == 0
    return json.loads(text), rest[8:]


def values(document: dict, binary: bytes, number: int) -> np.ndarray:
    """An accessor's numbers, if it lies in its view, aligned, and its bounds are those of its numbers (3.6.2)."""
    a = document["accessors"][number]
    view = document["bufferViews"][a["bufferView"]]
    size, wide = SIZES[a["componentType"]], WIDE[a["type"]]
    start = view["byteOffset"] + a.get("byteOffset", 0)
    assert a["count"] >= 1 and start % size == 0 and a.get("byteOffset", 0) % size == 0
    assert a.get("byteOffset", 0) + a["count"] * size * wide <= view["byteLength"]
    found = np.frombuffer(binary, KINDS[a["componentType"]], a["count"] * wide, start).reshape(a["count"], wide)
    if found.dtype == np.float32:
        assert np.isfinite(found).all() and not a.get("normalized", False)
    if "min" in a:
        assert np.array_equal(np.float32(a["min"]), found.min(axis=0))
        assert np.array_equal(np.float32(a["max"]), found.max(axis=0))
    return found


def check(data: bytes) -> dict:
    """The document, if everything in it is as the specification demands."""
    document, binary = chunks(data)
    assert set(document) <= TOP and document["asset"]["version"] == "2.0"
    (buffer,) = document["buffers"]
    assert "uri" not in buffer and 0 <= len(binary) - buffer["byteLength"] <= 3
    assert not any(binary[buffer["byteLength"] :])
    for view in document["bufferViews"]:
        assert view["buffer"] == 0 and view["byteLength"] >= 1 and view.get("target", 34962) == 34962
        assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= buffer["byteLength"]
        assert "byteStride" not in view or (view["byteStride"] % 4 == 0 and 4 <= view["byteStride"] <= 252)
    nodes, meshes = document["nodes"], document["meshes"]
    assert 0 <= document["scene"] < len(document["scenes"])
    children = [c for n in nodes for c in n.get("children", ())]
    assert len(set(children)) == len(children)  # a strict tree, of which scenes name the roots
    for scene in document["scenes"]:
        assert scene["nodes"] and len(set(scene["nodes"])) == len(scene["nodes"])
        assert not set(scene["nodes"]) & set(children) and max(scene["nodes"]) < len(nodes)
    assert set(children) | {n for s in document["scenes"] for n in s["nodes"]} == set(range(len(nodes)))
    for node in nodes:
        assert 0 <= node.get("mesh", 0) < len(meshes)
        assert np.linalg.norm(node.get("rotation", [0, 0, 0, 1])) == pytest.approx(1.0, abs=1e-6)
        assert "children" not in node or node["children"]
    for mesh in meshes:
        (primitive,) = mesh["primitives"]
        assert 0 <= primitive["material"] < len(document["materials"])
        assert {"POSITION"} <= set(primitive["attributes"]) <= {"POSITION", "COLOR_0"}
        used = [primitive["attributes"], *primitive.get("targets", ())]
        for attributes in used:
            shape = values(document, binary, attributes["POSITION"]).shape
            a = document["accessors"][attributes["POSITION"]]
            assert a["type"] == "VEC3" and a["componentType"] == 5126 and {"min", "max"} <= set(a)
            assert shape == values(document, binary, primitive["attributes"]["POSITION"]).shape
            assert shape[0] % {4: 3, 1: 2}[primitive["mode"]] == 0
        for number in (n for attributes in used for n in attributes.values()):
            view = document["bufferViews"][document["accessors"][number]["bufferView"]]
            assert view["target"] == 34962
        colour = document["accessors"][primitive["attributes"]["COLOR_0"]]
        assert colour["normalized"] is True and colour["type"] == "VEC4"
        assert colour["count"] == shape[0]
        assert len(mesh.get("weights", [])) == len(primitive.get("targets", []))
        assert "targets" not in primitive or primitive["targets"]
    for animation in document.get("animations", ()):
        targets = [(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]]
        assert targets and len(set(targets)) == len(targets) and {path for _, path in targets} == {"weights"}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler.get("interpolation", "LINEAR") in ("LINEAR", "STEP")
            time, out = (values(document, binary, sampler[n]) for n in ("input", "output"))
            a = document["accessors"][sampler["input"]]
            assert a["type"] == "SCALAR" and {"min", "max"} <= set(a)
            assert time[0, 0] >= 0 and np.all(np.diff(time[:, 0]) > 0)
            (primitive,) = meshes[nodes[channel["target"]["node"]]["mesh"]]["primitives"]
            assert out.shape == (len(time) * len(primitive["targets"]), 1)
    for number in range(len(document["accessors"])):
        values(document, binary, number)
    return document


def frames_of(document: dict) -> int:
    """Number of keyframes."""
    return document["accessors"][document["animations"][0]["samplers"][0]["input"]]["count"]


def test_a_run_is_valid_and_others_open_it(tmp_path):
    film = Film(swing())
    assert frames_of(check(glb(film))) == len(film.times)
    assert frames_of(check(glb(film, keyframes=3))) == 3
    (tmp_path / "a.glb").write_bytes(glb(film))
    scene = trimesh.load(tmp_path / "a.glb")
    size = np.ptp(film.x, axis=(0, 1)).max()
    assert scene.geometry and scene.extents.max() == pytest.approx(size, rel=1e-6)


def test_one_frame_has_no_animation():
    document = check(glb(Film(swing()), keyframes=1))
    assert "animations" not in document and "targets" not in document["meshes"][0]["primitives"][0]


def test_frames_that_floats_cannot_tell_apart_are_one():
    motion = swing()
    motion.times[:] = np.linspace(0, 1e4, len(motion.times))
    motion.times[4] = motion.times[3] + 1e-6
    assert frames_of(check(glb(Film(motion)))) == len(motion.times) - 1
