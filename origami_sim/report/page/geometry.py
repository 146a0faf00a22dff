"""The device as the page needs it: nodes, triangles, and the names of panels and creases."""

import numpy as np

from origami_sim.errors import InputError
from origami_sim.model import Model


def geometry_of(model: Model) -> dict:
    """What the page needs to draw the origami: nodes [m], triangles, panels and creases with their names.

    Returns:
        nodes: [N, 3] reference positions. triangles: [T, 3] nodes. panels: name and triangles of each.
        creases: name and the two nodes of the axis of each. held: nodes that cannot move.
    """
    panels = [int(p) for p in np.unique(model.triangle_panel)]
    return {
        "nodes": model.position.tolist(),
        "triangles": model.triangles.tolist(),
        "panels": [
            {"name": model.name("panel", p), "triangles": np.flatnonzero(model.triangle_panel == p).tolist()}
            for p in panels
        ],
        "creases": [
            {"name": model.name("crease", c), "nodes": [int(j), int(k)]} for c, (_, j, k, _) in enumerate(model.creases)
        ],
        "held": np.flatnonzero(~np.any(model.free, axis=1)).tolist(),
    }


def check(g: dict) -> None:
    """Says which part of a geometry is missing or points nowhere."""
    for key in ("nodes", "triangles", "panels", "creases"):
        if key not in g:
            raise InputError(
                "the geometry lacks a part", field=key, allowed="nodes, triangles, panels, creases and, if any, held"
            )
    nodes, triangles = len(g["nodes"]), len(g["triangles"])
    if not nodes or np.shape(g["nodes"])[1:] != (3,) or not np.isfinite(np.asarray(g["nodes"], float)).all():
        raise InputError("the geometry needs finite positions", field="nodes", allowed="[N, 3] numbers")
    named = [(f"creases.{c['name']}.nodes", c["nodes"], nodes) for c in g["creases"]]
    named += [(f"panels.{p['name']}.triangles", p["triangles"], triangles) for p in g["panels"]]
    named += [("triangles", np.ravel(g["triangles"]).tolist(), nodes), ("held", g.get("held", []), nodes)]
    for field, values, count in named:
        for value in values:
            if not 0 <= value < count:
                raise InputError("the geometry points nowhere", field=field, value=value, allowed=f"0 to {count - 1}")
