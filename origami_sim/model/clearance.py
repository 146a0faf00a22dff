"""How far a device is above the ground: heights of places, gaps under its contact points."""

import numpy as np

from origami_sim.model.model import Model, Parameters


def upward(tilt: float, azimuth: float) -> np.ndarray:
    """Normal (3,) of a ground that rises by `tilt` in the horizontal direction `azimuth` [rad]."""
    s = np.sin(tilt)
    return np.array([-s * np.cos(azimuth), -s * np.sin(azimuth), np.cos(tilt)])


def heights(parameters: Parameters, x: np.ndarray) -> np.ndarray:
    """Heights [..., W] of places x [..., W, 3] above the ground [m]."""
    plane = [parameters["plane", n][0] for n in ("tilt", "azimuth", "height")]
    worlds = [np.broadcast_to(p, (x.shape[-2],)) for p in plane]
    up = np.array([upward(t, a) for t, a in zip(*worlds[:2], strict=True)])
    return (x * up).sum(-1) - worlds[2]


def gaps(model: Model, parameters: Parameters, x: np.ndarray) -> np.ndarray:
    """Heights [..., K, W] of the contact points above the ground [m], at node positions x [..., N, W, 3]."""
    corners = np.moveaxis(x[..., model.contacts, :, :], -3, 0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
    weights = model.contact_weights.T[:, :, None, None]
    at = sum(w * c for w, c in zip(weights, corners, strict=True)) + model.contact_offsets[:, None, None] * normal
    return heights(parameters, at)
