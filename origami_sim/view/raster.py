"""A small software renderer: triangles and lines with hidden surfaces removed by a depth buffer, in numpy.

Triangles are cut into rows and rows into pixels, all at once; the nearest one of each pixel stays (Catmull 1974). Lines
are strips of a width in pixels, slightly nearer than they are, so that they lie on their surfaces.
"""

from dataclasses import dataclass

import numpy as np

NEARER = 1.004
"""By how much lines are drawn nearer: less and surfaces cut into them, twice as much and lines behind shine through."""

OVERSAMPLING = 2
"""Pixels drawn per pixel of the picture and direction: 1 shows stairs, 3 takes twice as long and looks the same."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        eye: [3] position [m]. axes: [3, 3] rows: to the right, up, and into the picture, unit vectors.
        focal: focal length [px]. width, height: of the picture [px].
    """

    eye: np.ndarray
    axes: np.ndarray
    focal: float
    width: int
    height: int

    def project(self, points: np.ndarray) -> np.ndarray:
        """Column and row [px] and inverse depth [1/m] of points [..., 3]; behind the camera the inverse is <= 0."""
        seen = (points - self.eye) @ self.axes.T
        with np.errstate(divide="ignore"):
            near = np.where(seen[..., 2] > 0, 1.0 / seen[..., 2], 0.0)
        column = 0.5 * self.width + self.focal * seen[..., 0] * near
        row = 0.5 * self.height - self.focal * seen[..., 1] * near
        return np.stack([column, row, near], axis=-1)

    def rays(self) -> np.ndarray:
        """[H, W, 3] directions of all pixels' centres, of which the part into the picture is 1."""
        x = (np.arange(self.width) + 0.5 - 0.5 * self.width) / self.focal
        y = (0.5 * self.height - np.arange(self.height) - 0.5) / self.focal
        return x[None, :, None] * self.axes[0] + y[:, None, None] * self.axes[1] + self.axes[2]


def look(
    target: np.ndarray, towards: np.ndarray, points: np.ndarray, width: int, height: int, *, fill: float = 0.86
) -> Camera:
    """A camera that looks along -`towards` (z up) from as near as all points [K, 3] fit into `fill` of the picture."""
    into = -towards / np.linalg.norm(towards)
    right = np.cross(into, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, into), into])
    focal = 1.5 * max(width, height)
    reach = 0.5 * fill * np.array([width, height]) / focal
    distance = 1.0
    for _ in range(4):  # the middle of what is seen moves as the camera does
        seen = (points - target) @ axes.T
        distance = float(np.max(np.abs(seen[:, :2]) / reach - seen[:, 2:]))
        distance = max(distance, 1e-6)
        flat = Camera(target - distance * into, axes, focal, width, height).project(points)[:, :2]
        off = 0.5 * (flat.min(axis=0) + flat.max(axis=0)) - 0.5 * np.array([width, height])
        target = target + (off[0] * right - off[1] * axes[1]) * distance / focal
    return Camera(target - distance * into, axes, focal, width, height)


class Canvas:
    """Colours [H, W, 3] (0 to 255) and the inverse depth [H, W] of what is drawn so far."""

    def __init__(self, width: int, height: int, colour: np.ndarray | tuple):
        self.colour = np.empty((height, width, 3), np.float32)
        self.colour[:] = colour
        self.near = np.zeros((height, width))

    def copy(self) -> "Canvas":
        out = object.__new__(Canvas)
        out.colour, out.near = self.colour.copy(), self.near.copy()
        return out

    def triangles(self, corners: np.ndarray, colours: np.ndarray):
        """Draws projected triangles [T, 3 corners, 3] in one colour [T, 3] each."""
        pixel, near, owner = self._fragments(corners)
        depth = self.near.reshape(-1)
        np.maximum.at(depth, pixel, near)
        nearest = near >= depth[pixel]
        self.colour.reshape(-1, 3)[pixel[nearest]] = np.asarray(colours, np.float32)[owner[nearest]]

    def lines(self, ends: np.ndarray, colours: np.ndarray, width: float):
        """Draws projected lines [L, 2 ends, 3], `width` pixels wide, in one colour [L, 3] each."""
        keep = np.flatnonzero((ends[:, :, 2] > 0).all(axis=1))
        ends, colours = ends[keep], np.broadcast_to(colours, (len(ends), 3))[keep]
        along = ends[:, 1, :2] - ends[:, 0, :2]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = 0.5 * width * np.divide(along, length, out=np.zeros_like(along), where=length > 0)
        side = np.stack([-along[:, 1], along[:, 0]], axis=1)
        strip = np.repeat(ends, 2, axis=1)  # first end twice, second end twice
        strip[:, :2, :2] += np.stack([side, -side], axis=1) - 0.5 * along[:, None]
        strip[:, 2:, :2] += np.stack([side, -side], axis=1) + 0.5 * along[:, None]
        strip[:, :, 2] *= NEARER
        self.triangles(strip[:, [[0, 1, 2], [1, 3, 2]]].reshape(-1, 3, 3), np.repeat(colours, 2, axis=0))

    def darken(self, corners: np.ndarray, factor: float):
        """Darkens what lies under projected triangles [T, 3, 3], once however many of them there are: a shadow."""
        pixel = np.unique(self._fragments(corners)[0])
        self.colour.reshape(-1, 3)[pixel] *= factor

    def picture(self) -> np.ndarray:
        """The picture [H / OVERSAMPLING, W / OVERSAMPLING, 3] as bytes."""
        n = OVERSAMPLING
        height, width = self.near.shape
        averaged = self.colour.reshape(height // n, n, width // n, n, 3).mean(axis=(1, 3))
        return np.clip(averaged + 0.5, 0, 255).astype(np.uint8)

    def _fragments(self, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels whose centres lie in triangles: index of the pixel, inverse depth there, index of the triangle."""
        height, width = self.near.shape
        x, y, near = np.moveaxis(np.asarray(corners, float), -1, 0)
        area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
        whole = np.flatnonzero((near > 0).all(axis=1) & (np.abs(area) > 1e-9) & np.isfinite(corners).all(axis=(1, 2)))
        x, y, near, area = x[whole], y[whole], near[whole], area[whole]
        # rows of each triangle
        first = np.clip(np.ceil(y.min(axis=1) - 0.5), 0, height).astype(int)
        last = np.clip(np.ceil(y.max(axis=1) - 0.5), 0, height).astype(int)
        t, row = _ranges(first, last)
        centre = row + 0.5
        # columns of each row: between the two edges that it crosses
        left, right = np.full(len(t), np.inf), np.full(len(t), -np.inf)
        for a, b in ((0, 1), (1, 2), (2, 0)):
            ya, yb, xa, xb = y[t, a], y[t, b], x[t, a], x[t, b]
            crossed = (ya <= centre) != (yb <= centre)
            rise = np.where(crossed, yb - ya, 1.0)
            at = xa + (centre - ya) / rise * (xb - xa)
            left = np.where(crossed, np.minimum(left, at), left)
            right = np.where(crossed, np.maximum(right, at), right)
        crossed = right >= left
        start = np.where(crossed, np.clip(np.ceil(np.where(crossed, left, 0.0) - 0.5), 0, width), 0).astype(int)
        stop = np.where(crossed, np.clip(np.ceil(np.where(crossed, right, 0.0) - 0.5), 0, width), 0).astype(int)
        span, column = _ranges(start, stop)
        t, row = t[span], row[span]
        # inverse depth is linear in the picture
        d1, d2 = near[:, 1] - near[:, 0], near[:, 2] - near[:, 0]
        by_x = (d1 * (y[:, 2] - y[:, 0]) - d2 * (y[:, 1] - y[:, 0])) / area
        by_y = (d2 * (x[:, 1] - x[:, 0]) - d1 * (x[:, 2] - x[:, 0])) / area
        inverse = near[t, 0] + by_x[t] * (column + 0.5 - x[t, 0]) + by_y[t] * (row + 0.5 - y[t, 0])
        return row * width + column, inverse, whole[t]


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All integers of the ranges first <= n < last, one range after the other: index of the range, integer."""
    counts = np.maximum(last - first, 0)
    owner = np.repeat(np.arange(len(counts)), counts)
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return owner, first[owner] + offset
