"""Where channels are attached to a model: its entities by name or number, and points and axes of its bodies."""

import numpy as np

from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.model.vectors import cross
from origami_sim.recording import Channel


def body_point(model: Model, x: np.ndarray, channel: Channel) -> np.ndarray:
    """The point of the body that carries a marker: (F, 3) [m], for positions x [F, N, 3].

    Attached to a `node`, or to a `panel` at a point of it, see `panel_point`: it moves with the triangle of the panel
    on which it lies, or nearest to which it lies. `height` lifts it above the mid-plane along the normal, that of the
    triangle or the mean around the node.

    Raises:
        InputError: a channel attached to something that the model does not have.
    """
    height = float(channel.attachment.get("height", 0.0))
    if "panel" in channel.attachment:
        nodes, weights, lift = _on_panel(model, panel_of(model, channel), panel_point(model, channel))
        corners = x[:, nodes]
        return np.einsum("k,fkc->fc", weights, corners) + (lift + height) * _normals(corners)
    node = index_of(model, channel, "node", len(model.position))
    if height == 0.0:
        return x[:, node]
    around = model.triangles[(model.triangles == node).any(axis=1)]
    if len(around) == 0:
        raise InputError("a height needs a triangle at the node", field=f"channels.{channel.name}.height", value=height)
    doubled = _doubled(x[:, around]).sum(axis=1)
    return x[:, node] + height * doubled / np.linalg.norm(doubled, axis=1, keepdims=True)


def panel_point(model: Model, channel: Channel) -> np.ndarray:
    """Where the point of a channel's panel lies in the reference state (3,) [m].

    `point` is its offset from the panel's centroid in the reference axes. Or it is measured from a crease of the panel,
    `from`: at `distance` from it into the panel, and `along` it from its middle, to the right for who looks from it
    into the panel with the panel's upper side up. Such a point stays where it is on the body when a length is refitted.

    Raises:
        InputError: a crease that the model lacks or that is not the panel's.
    """
    triangles = model.triangles[model.triangle_panel == panel_of(model, channel)]
    corners = model.position[triangles]
    doubled = _doubled(corners)
    area = np.sqrt(np.sum(doubled**2, axis=1))
    centroid = area @ corners.mean(axis=1) / area.sum()
    if "from" not in channel.attachment:
        return centroid + np.asarray(channel.attachment.get("point", (0.0, 0.0, 0.0)), float)
    given = channel.attachment["from"]
    ends = model.creases[find(model, channel, "crease", given, len(model.creases), key="from"), 1:3]
    if not set(ends.tolist()) <= set(triangles.ravel().tolist()):
        raise InputError(
            "the panel does not have this crease", field=f"channels.{channel.name}.from", value=given,
            allowed="a crease of the panel on which the marker is",
        )  # fmt: skip
    start, end = model.position[ends]
    hinge = (end - start) / np.linalg.norm(end - start)
    normal = doubled.sum(axis=0) / np.linalg.norm(doubled.sum(axis=0))
    into = cross(normal, hinge)
    into = into * np.sign(into @ (centroid - start))
    right = cross(into, normal)
    attached = channel.attachment
    return 0.5 * (start + end) + float(attached["distance"]) * into + float(attached.get("along", 0.0)) * right


def body_axes(model: Model, x: np.ndarray, channel: Channel) -> np.ndarray:
    """The model's axes x, y, z as the triangle under a marker has turned them, as the channel sees directions.

    Returns:
        (F, 3 axes, 3): x, y, z of a marker; right, up and towards the camera of one in a picture. For x [F, N, 3].
    """
    if "panel" in channel.attachment:
        nodes = _on_panel(model, panel_of(model, channel), panel_point(model, channel))[0]
    else:
        node = index_of(model, channel, "node", len(model.position))
        around = np.flatnonzero((model.triangles == node).any(axis=1))
        nodes = model.triangles[around[0]] if len(around) else None
    turned = np.broadcast_to(np.eye(3), (len(x), 3, 3))
    if nodes is not None:  # a node without a panel does not turn
        turned = np.einsum("ka,fkb->fab", _own_axes(model.position[nodes][None])[0], _own_axes(x[:, nodes]))
    if channel.camera is not None:
        turned = turned @ np.vstack([channel.camera.axes, cross(*channel.camera.axes)]).T
    return turned


def panel_of(model: Model, channel: Channel) -> int:
    """Index of the panel that a channel is attached to."""
    return index_of(model, channel, "panel", int(model.triangle_panel.max(initial=-1)) + 1)


def index_of(model: Model, channel: Channel, family: str, count: int) -> int:
    """Index of the entity that an attachment names, by number or by the model's label.

    Raises:
        InputError: none or several of that name.
    """
    return find(model, channel, family, channel.attachment.get(family), count)


def find(model: Model, channel: Channel, family: str, given: object, count: int, key: str = "") -> int:
    """The same of any name or number, which a channel gives under a key."""
    names = model.names.get(family, ())
    if isinstance(given, str) and names.count(given) == 1:
        return names.index(given)
    if isinstance(given, int) and 0 <= given < count:
        return given
    if isinstance(given, str) and not names:  # "panel 1", as tables and pictures call what has no name
        called = [model.name(family, k) for k in range(count)]
        if given in called:
            return called.index(given)
    raise InputError(
        f"several have that name, of which a {channel.kind} needs one"
        if given in names
        else "the model has nothing of that name"
        if given is not None
        else f"a {channel.kind} needs a {family}",
        field=f"channels.{channel.name}.{key or family}",
        value=given,
        allowed=", ".join(n for n in names if names.count(n) == 1) or f"0 to {count - 1}",
    )


def _on_panel(model: Model, panel: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Nodes (3,) of the triangle under a point of a panel, its weights (3,) on them, and its height above it [m]."""
    triangles = model.triangles[model.triangle_panel == panel]
    corners = model.position[triangles]
    doubled, to = _doubled(corners), corners - point
    square = np.sum(doubled**2, axis=1)
    weights = cross(to[:, [1, 2, 0]], to[:, [2, 0, 1]]) @ doubled[:, :, None]
    weights = weights[:, :, 0] / square[:, None]
    best = int(np.argmax(weights.min(axis=1)))  # inside all are positive; else the triangle it lies least outside of
    lift = -float(to[best, 0] @ doubled[best]) / float(np.sqrt(square[best]))
    return triangles[best], weights[best] / weights[best].sum(), lift


def _doubled(corners: np.ndarray) -> np.ndarray:
    """Normals (..., 3) of triangles (..., 3, 3), as long as twice their areas."""
    return cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals (F, 3) of triangles (F, 3, 3)."""
    normal = _doubled(corners)
    with np.errstate(invalid="ignore"):  # of a world that failed
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _own_axes(corners: np.ndarray) -> np.ndarray:
    """Right-handed axes [F, 3, 3] of triangles [F, 3, 3]: along the first side, across it, along the normal."""
    along = corners[:, 1] - corners[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    normal = _normals(corners)
    return np.stack([along, cross(normal, along), normal], axis=1)
