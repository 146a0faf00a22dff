"""A model and its parameters as tables of a design file: for devices that are no plain sheet, as most scenes are.

    [model]                                   # the attributes of Model, rows one a line
    panels = "elastic"
    effects = ["bars", "crease", "gravity"]
    position = [ [0.0, -0.01, 0.0], ... ]
    [names]                                   # labels by family
    crease = ["hinge"]
    [parameters.crease]                       # by effect, "inertia", "plane" or "body": one for all, or one per entity
    stiffness = 0.002
    rest_angle = [0.0, 0.1]

What is not stated is at its default.
"""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.effects import get
from origami_sim.errors import InputError, nearest
from origami_sim.model.model import GRIPS, PADS, Model, Parameters

_COLUMNS = {
    "position": 3, "free": 3, "bars": 2, "creases": 4, "bends": 4, "triangles": 3, "triangle_panel": 0,
    "contacts": 3, "contact_weights": 3, "contact_offsets": 0, "contact_axes": 3, "electrodes": 0, "carriers": 0,
    "pad_triangles": 0, "pad_weights": 3, "pad_heights": 0, "pad_thickness": 0, "plates": 6,
    "start": 3, "grips": 0, "grip_screws": 6,
}  # fmt: skip
"""Arrays of a model, with the length of their rows."""

_NODES = ("bars", "creases", "bends", "triangles", "contacts")
_WHOLE = (*_NODES, "triangle_panel", "electrodes", "carriers", "pad_triangles", "grips")
_WORDS = ("effects", "channels", "panels")


def model_tables(model: Model, parameters: Parameters) -> dict[str, dict[str, Any]]:
    """Tables "model", "names" and "parameters.OWNER" of a design file.

    Raises:
        InputError: parameters of several worlds.
    """
    if parameters.worlds > 1:
        raise InputError("a design is one world", field="parameters", value=f"{parameters.worlds} worlds")
    empty = tuple(n for n in ("plates", "start", *GRIPS) if not len(getattr(model, n)))
    empty += PADS * (not len(model.pad_triangles))
    kept = [n for n in (*_WORDS, *_COLUMNS) if n not in empty]
    out: dict[str, dict[str, Any]] = {"model": {n: getattr(model, n) for n in kept}}
    out["model"]["effects"] = list(model.effects)
    out["names"] = {family: list(labels) for family, labels in model.names.items()}
    default = Parameters(model)
    for owner, name in parameters:
        values = parameters[owner, name][:, 0]
        if not np.array_equal(parameters[owner, name], default[owner, name]):
            same = values.ndim == 1 and len(values) and np.all(values == values[0])
            out.setdefault(f"parameters.{owner}", {})[name] = values[0] if same else values
    return out


def read_model(data: Mapping[str, Any], path: Path) -> tuple[Model, Parameters]:
    """The model and parameters of the tables of a design file.

    Raises:
        InputError: an unknown key or effect, an array of another shape, an index that points nowhere, or what
            `Parameters.set` refuses.
    """
    given = _table(data["model"], "model", path)
    for name in given:
        if name not in (*_WORDS, *_COLUMNS):
            fault = f"unknown key{nearest(name, (*_WORDS, *_COLUMNS))}"
            raise InputError(fault, file=path, field=f"model.{name}", allowed=", ".join((*_WORDS, *_COLUMNS)))
    needed = [f.name for f in fields(Model) if f.default is MISSING and f.default_factory is MISSING]
    for name in needed:
        if name not in given:
            raise InputError("the model lacks an array", file=path, field=f"model.{name}")
    arrays = {n: _array(given[n], n, width, path) for n, width in _COLUMNS.items() if n in given}
    nodes, panels = len(arrays["position"]), int(arrays["triangle_panel"].max(initial=-1)) + 1
    triangles = len(arrays["triangles"])
    for name, most in (*((n, nodes) for n in _NODES), ("carriers", panels), ("pad_triangles", triangles)):
        bad = arrays[name][(arrays[name] < 0) | (arrays[name] >= most)] if name in arrays else []
        if len(bad):
            raise InputError("points nowhere", file=path, field=f"model.{name}", value=int(bad[0]), allowed=f"< {most}")
    counts = {
        "free": nodes, "triangle_panel": len(arrays["triangles"]), "contact_weights": len(arrays["contacts"]),
        "contact_offsets": len(arrays["contacts"]), "contact_axes": len(arrays["contacts"]),
        "electrodes": len(arrays["creases"]) + len(arrays["bends"]),
    }  # fmt: skip
    pads = 4 * len(arrays.get("pad_thickness", ()))
    counts |= {n: pads for n in ("pad_triangles", "pad_weights", "pad_heights") if n in arrays}
    counts |= {
        n: count for n, count in (("plates", triangles), ("start", nodes), ("grips", nodes)) if len(arrays.get(n, ()))
    }
    for name, count in counts.items():
        if len(arrays[name]) != count:
            raise InputError(
                "has another number of rows", file=path, field=f"model.{name}", value=len(arrays[name]), allowed=count
            )
    if len(arrays.get("grips", ())) and arrays["grips"].max() >= len(arrays.get("grip_screws", ())):
        raise InputError("points nowhere", file=path, field="model.grips", value=int(arrays["grips"].max()))
    if np.any(arrays["electrodes"] < 0) or np.any(arrays["triangle_panel"] < 0):
        raise InputError("groups and panels are counted from 0", file=path, field="model.electrodes, triangle_panel")
    effects = given["effects"]
    for e in effects if isinstance(effects, list) else [effects]:
        get(str(e))
    if given.get("panels", "elastic") not in ("elastic", "rigid"):
        raise InputError("no such panels", file=path, field="model.panels", value=given["panels"])
    names = {str(f): tuple(map(str, labels)) for f, labels in _table(data.get("names", {}), "names", path).items()}
    words = {"effects": tuple(map(str, effects)), "panels": given.get("panels", "elastic"),
             "channels": int(given.get("channels", 1))}  # fmt: skip
    model = Model(**arrays, **words, names=names)
    parameters = Parameters(model)
    for owner, table in _table(data.get("parameters", {}), "parameters", path).items():
        for name, value in _table(table, f"parameters.{owner}", path).items():
            shape = parameters[owner, name].shape
            new = _numbers(value, f"parameters.{owner}.{name}", path)
            if new.ndim and new.shape[0] != shape[0]:
                raise InputError(
                    "has another number of rows", file=path, field=f"parameters.{owner}.{name}", value=new.shape[0],
                    allowed=shape[0],
                )  # fmt: skip
            if owner == "inertia" and len(model.carriers):
                parameters.replace(owner, name, _carried(model, new, path)[:, None])
            else:
                parameters.set(owner, name, new if new.ndim < 2 else new[:, None])
    return model, parameters


def _carried(model: Model, mass: np.ndarray, path: Path) -> np.ndarray:
    """Masses (N,) [kg] of a model of rigid panels, whose corners have none: points that go with each panel have."""
    out = np.broadcast_to(mass, len(model.position))
    if np.any(out < 0) or np.any(out[len(out) - len(model.carriers) :] <= 0) or not np.all(np.isfinite(out)):
        allowed = "> 0 kg at the points of its bodies, >= 0 at corners"
        raise InputError("rigid panels need mass", file=path, field="parameters.inertia.mass", allowed=allowed)
    return out


def _table(value: Any, key: str, path: Path) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError("is a table", file=path, field=key, value=value)
    return value


def _numbers(value: Any, key: str, path: Path) -> np.ndarray:
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):
        raise InputError("is not numbers in rows of one length", file=path, field=key) from None


def _array(value: Any, name: str, width: int, path: Path) -> np.ndarray:
    key = f"model.{name}"
    out = _numbers(value, key, path)
    out = out.reshape((0, width) if width else (0,)) if out.size == 0 else out
    if out.ndim != (2 if width else 1) or (width and out.shape[1] != width) or not np.all(np.isfinite(out)):
        allowed = f"rows of {width} numbers" if width else "numbers"
        raise InputError("is another array", file=path, field=key, value=list(out.shape), allowed=allowed)
    if name in _WHOLE:
        if np.any(out != np.round(out)) or np.any(np.abs(out) > 2**31 - 1):
            raise InputError("is whole numbers", file=path, field=key)
        return out.astype(np.int32)
    return out
