"""Pictures of a device by the renderer of `raster`: no graphics driver, no window, the same on every machine.

Panels are shaded flat; mountains are red and valleys blue; magnets are dark with an arrow along their poling;
electrodes are bands beside their creases, brighter under voltage; the ground has a grid and the device's shadow.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from origami_sim.errors import InputError
from origami_sim.view.film import WALK, Film, unit
from origami_sim.view.palette import COLOURS, LIGHT, length_text, nice, scaled
from origami_sim.view.raster import OVERSAMPLING, Camera, Canvas, look

COLOURINGS = ("kind", "strain")
SIDES = 6  # of an arrow's shaft
SMALLEST, LARGEST = 64, 4096  # pictures [px]


@dataclass
class Artist:
    """Draws frames of a film, all with one camera, or with one that goes along with what walks away.

    Attributes:
        film: what is drawn. width, height: of the pictures [px].
        colour: "kind" (passive, magnet, arm) or "strain" (principal strain of each triangle, on one scale for all).
        labels: whether time, drive and a scale bar are written on the pictures.
    """

    film: Film
    width: int = 640
    height: int = 400
    colour: str = "kind"
    labels: bool = True
    _grounds: dict[bytes, Canvas] = field(default_factory=dict, repr=False)

    def __post_init__(self):
        if self.colour not in COLOURINGS:
            raise InputError("no such colouring", field="colour", value=self.colour, allowed=", ".join(COLOURINGS))
        for name in ("width", "height"):
            value = getattr(self, name)
            if not SMALLEST <= value <= LARGEST:
                raise InputError("no such size", field=name, value=value, allowed=f"{SMALLEST} to {LARGEST} pixels")
        film = self.film
        self._corners, _ = film.faces()
        self._corners = self._corners.reshape(len(film.x), -1, 3, 3)
        self._base = np.array([COLOURS[k] for k in film.kinds], float).reshape(-1, 3)
        self._folds, self._outlines = film.folds(), film.outlines()
        self._bands, self._banded = film.electrodes()
        self._voltages = film.voltages()
        self._highest = float(np.abs(self._voltages).max(initial=0.0))
        self._arrows = self._all_arrows()
        if self.colour == "strain":
            self._strains = film.strains()
            self._scale = float(np.percentile(np.abs(self._strains), 99)) or 1e-12
        self.follows = bool(np.linalg.norm(film.high - film.low) > WALK * film.size)
        self._cameras = self._all_cameras()
        self._font = ImageFont.load_default(max(11, round(self.height / 28)))

    # what is seen ---------------------------------------------------------------------------------------------------

    def _all_cameras(self) -> list[Camera]:
        """One camera for all frames, or one for each."""
        film, n = self.film, OVERSAMPLING
        towards = np.array([0.5, -1.0, 0.55]) if film.across == 0 else np.array([1.0, 0.5, 0.55])
        used = np.unique(film.model.triangles)
        every = film.x[:: max(1, len(film.x) // 60), used]
        arrows = [o[:: max(1, len(o) // 60)] + v[:: max(1, len(o) // 60)] for o, v, *_ in self._arrows.values()]
        size = (n * self.width, n * self.height)
        if not self.follows:
            points = np.concatenate([a.reshape(-1, 3) for a in (every, *arrows)])
            self._middles = [0.5 * (film.low + film.high)]
            return [look(points.mean(axis=0), towards, points, *size)]
        centre = film.x[:, used].mean(axis=1)
        smooth = max(1, len(centre) // 8)  # the camera glides where the device jerks
        padded = np.pad(centre, ((smooth, smooth), (0, 0)), mode="edge")
        window = np.ones(2 * smooth + 1) / (2 * smooth + 1)
        path = np.stack([np.convolve(padded[:, i], window, mode="valid") for i in range(3)], axis=1)
        path[:, 2] = path[:, 2].mean()
        self._middles = list(path)
        beside = [o + k * v for n, (o, v, _) in self._arrows.items() if n == "field" for k in (0, 1)]
        local = np.concatenate([film.x[:, used], *beside], axis=1) - path[:, None]
        local = local[:: max(1, len(film.x) // 60)].reshape(-1, 3)
        near = look(np.zeros(3), towards, local, *size)
        return [Camera(near.eye + p, near.axes, near.focal, *size) for p in path]

    def _all_arrows(self) -> dict[str, tuple[np.ndarray, np.ndarray, float]]:
        """Origins and vectors [F, A, 3] [m] of all arrows by their colour, and the radius of their shafts [m]."""
        film, out = self.film, {}
        origins, vectors, labels = film.arrows()
        if labels:
            out["poling"] = (origins, vectors, 0.010 * film.size)
        field_ = np.stack([film.channel(f"field_{i}") for i in "xyz"], axis=1)
        largest = float(np.linalg.norm(field_, axis=1).max(initial=0.0))
        if largest > 0:
            corner = film.field_origin()
            moved = np.zeros((len(film.x), 1, 3))
            if np.linalg.norm(film.high - film.low) > WALK * film.size:  # it stays beside what walks away
                used = np.unique(film.model.triangles)
                moved[:, 0, :2] = film.x[:, used, :2].mean(axis=1)
                moved[:, 0, :2] -= 0.5 * (film.low + film.high)[:2]
                right = film.camera()[0]
                corner = 0.5 * (film.low + film.high) - 0.85 * film.size * right
            vector = 0.5 * film.size / largest * field_[:, None]
            out["field"] = (corner + moved - 0.5 * vector, vector, 0.014 * film.size)
        if len(film.model.contacts):
            points, forces = film.contact_arrows()
            size = np.linalg.norm(forces, axis=-1)
            if np.any(size > 0):
                typical = float(np.percentile(size[size > 0], 90))
                out["contact"] = (points, np.clip(0.3 * film.size / typical, 0, None) * forces, 0.007 * film.size)
        return out

    # drawing --------------------------------------------------------------------------------------------------------

    def frame(self, f: int) -> Image.Image:
        """The picture of one frame."""
        film, n = self.film, OVERSAMPLING
        which = f if self.follows else 0
        camera = self._cameras[which]
        canvas = self._ground(camera, self._middles[which]).copy()
        width = n * self.height / 400
        corners = self._corners[f]
        if len(film.model.contacts):
            canvas.darken(camera.project(self._shadow(corners)), 0.87)
        normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        shade = 0.62 + 0.38 * np.abs(normal @ (LIGHT / np.linalg.norm(LIGHT)))
        # the far side of a sheet is a little darker, so that the layers of a fold can be told apart
        shade *= np.where(np.einsum("ti,ti->t", normal, camera.eye - corners[:, 0]) >= 0, 1.0, 0.86)
        base = self._base if self.colour == "kind" else diverging(self._strains[f] / self._scale)
        canvas.triangles(camera.project(corners), base * shade[:, None])
        self._draw_electrodes(canvas, camera, f)
        x = film.x[f]
        canvas.lines(camera.project(x[self._outlines]), np.array([COLOURS["outline"]], float), 0.9 * width)
        canvas.lines(camera.project(x[film.model.creases[:, 1:3]]), self._folds[f], 2.0 * width)
        for name, (origins, vectors, radius) in self._arrows.items():
            solid, light = arrow(origins[f], vectors[f], radius)
            canvas.triangles(camera.project(solid), light[:, None] * np.array(COLOURS[name], float))
        picture = Image.fromarray(canvas.picture())
        return self._labelled(picture, camera, f) if self.labels else picture

    def _draw_electrodes(self, canvas: Canvas, camera: Camera, f: int):
        if not len(self._banded):
            return
        quads = camera.project(self._bands[f])
        quads[..., 2] *= 1.0015
        live = np.abs(self._voltages[f, self._banded]) / (self._highest or 1.0)
        passive, active = (np.array(COLOURS[c], float) for c in ("electrode", "live"))
        colours = passive + live[:, None] * (active - passive)
        canvas.triangles(quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), np.repeat(colours, 2, axis=0))

    def _shadow(self, corners: np.ndarray) -> np.ndarray:
        """Triangles [T, 3, 3] thrown onto the ground along a steep light."""
        light = np.array([0.25, -0.35, 0.9])
        above = corners @ self.film.up - self.film.height
        return corners - (above / (light @ self.film.up))[..., None] * light

    def _ground(self, camera: Camera, middle: np.ndarray) -> Canvas:
        """The background, with the ground and its grid if there are contacts; it fades out with the distance."""
        key = camera.eye.tobytes()
        if key in self._grounds:
            return self._grounds[key]
        canvas, n = Canvas(camera.width, camera.height, COLOURS["background"]), OVERSAMPLING
        film = self.film
        if len(film.model.contacts):
            # its lines are drawn smooth, so one ray per pixel of the picture is enough
            small = replace(camera, focal=camera.focal / n, width=camera.width // n, height=camera.height // n)
            rays = small.rays()
            down = rays @ film.up
            seen = down < 0
            reach = (film.height - camera.eye @ film.up) / np.where(seen, down, -1.0)
            points = (camera.eye + reach[..., None] * rays)[..., :2]
            away = np.linalg.norm(points - middle[:2], axis=-1)
            extent = 0.6 * float(np.linalg.norm((film.high - film.low)[:2])) * (not self.follows) + 1.2 * film.size
            share = np.where(seen, np.clip(1.6 - away / extent, 0.0, 1.0), 0.0)
            off = np.abs((points / film.step + 0.5) % 1.0 - 0.5) * film.step
            line = np.clip(1.2 - off / (reach / small.focal)[..., None], 0.0, 1.0).max(axis=-1)
            ground, grid, behind = (np.array(COLOURS[c], np.float32) for c in ("ground", "grid", "background"))
            colour = ground + line[..., None] * (grid - ground)
            colour = behind + share[..., None] * (colour - behind)
            canvas.colour[:] = colour.repeat(n, axis=0).repeat(n, axis=1)
        if not self.follows:
            self._grounds[key] = canvas
        return canvas

    def _labelled(self, picture: Image.Image, camera: Camera, f: int) -> Image.Image:
        """The picture with time, drive and scale written on it."""
        film, draw = self.film, ImageDraw.Draw(picture)
        ink, margin = COLOURS["outline"], round(0.03 * self.height)
        draw.text((margin, margin), "   ".join(self._said(f)), fill=ink, font=self._font)
        used = np.unique(film.model.triangles)
        distance = float((film.x[f, used].mean(axis=0) - camera.eye) @ camera.axes[2])
        per_pixel = OVERSAMPLING * distance / camera.focal
        step = nice(0.22 * self.width * per_pixel)
        right, bottom = self.width - margin, self.height - margin
        left = right - round(step / per_pixel)
        draw.line([(left, bottom), (right, bottom)], fill=ink, width=max(2, self.height // 160))
        draw.text(((left + right) / 2, bottom - 4), length_text(step), fill=ink, font=self._font, anchor="mb")
        return picture

    def _said(self, f: int) -> list[str]:
        film = self.film
        span = film.times[-1] - film.times[0]
        digits = 0 if span > 100 else 1 if span > 10 else 2 if span > 0.5 else 4
        out = [f"{film.times[f]:.{digits}f} s"] if span > 0 else []
        if f == len(film.times) - 1 and any(failed.world == film.world for failed in film.trajectory.failures):
            out.append("the run failed here")
        field_ = np.linalg.norm([film.channel(f"field_{i}") for i in "xyz"], axis=0)
        for size, symbol, of, usual in (
            (field_, "B", "T", "m"),
            (np.abs(self._voltages).max(axis=1, initial=0), "V", "V", ""),
        ):
            if size.max(initial=0.0) > 0:
                name, factor = scaled(of, float(size.max()), usual)
                if of == "V" and size.max() >= 1000:
                    name, factor = "kV", 1e-3
                out.append(f"{symbol} = {factor * size[f]:.{1 if factor * size.max() < 20 else 0}f} {name}")
        if self.colour == "strain":
            out.append(f"strain: blue -{100 * self._scale:.2g} % to red +{100 * self._scale:.2g} %")
        return out


def diverging(share: np.ndarray) -> np.ndarray:
    """Colours [..., 3] of shares from -1 (blue) over 0 (nearly white) to 1 (red)."""
    share = np.clip(share, -1.0, 1.0)[..., None]
    ends = np.where(share < 0, np.array([33, 102, 200]), np.array([200, 40, 40]))
    return np.array([240.0, 240, 238]) + np.abs(share) * (ends - np.array([240.0, 240, 238]))


def arrow(origins: np.ndarray, vectors: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles [K, 3, 3] of arrows [A, 3] with shafts of a radius [m], and the brightness [K] of each."""
    length = np.linalg.norm(vectors, axis=1)
    keep = length > 2.0 * radius
    origins, vectors, length = origins[keep], vectors[keep], length[keep]
    along = unit(vectors)
    guide = np.where(np.abs(along[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    one = unit(np.cross(along, guide))
    two = np.cross(along, one)
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.cos(turn)[:, None] * one[:, None] + np.sin(turn)[:, None] * two[:, None]  # [A, SIDES, 3]
    head = np.minimum(5.0 * radius, 0.5 * length)[:, None, None]
    neck, tip = origins[:, None] + vectors[:, None] - head * along[:, None], (origins + vectors)[:, None]
    low, high, wide = origins[:, None] + radius * ring, neck + radius * ring, neck + 2.4 * radius * ring
    after = {n: np.roll(v, -1, axis=1) for n, v in (("low", low), ("high", high), ("wide", wide))}
    every = [
        (low, after["low"], high),
        (after["low"], after["high"], high),
        (wide, after["wide"], np.broadcast_to(tip, wide.shape)),
        (after["wide"], wide, np.broadcast_to(neck, wide.shape)),
    ]
    solid = np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in every])
    normal = unit(np.cross(solid[:, 1] - solid[:, 0], solid[:, 2] - solid[:, 0]))
    return solid, 0.72 + 0.28 * np.abs(normal @ (LIGHT / np.linalg.norm(LIGHT)))


def nearest_frame(film: Film, time: float | None) -> int:
    """Index of the frame nearest to a time [s]; without one, where the creases are furthest from where they began.

    Raises:
        InputError: a time outside of the run.
    """
    if time is None:
        angle = film.trajectory.creases[:, :, film.world]
        away = np.abs(np.nan_to_num(angle - angle[0])).sum(axis=1) if angle.size else np.zeros(len(film.times))
        return int(np.argmax(away)) if away.max() > 0 else len(film.times) - 1
    first, last = float(film.times[0]), float(film.times[-1])
    slack = 1e-5 * max(abs(last), last - first)
    if not first - slack <= time <= last + slack:
        raise InputError("is outside of the run", field="time", value=time, allowed=f"{first:g} to {last:g} s")
    return int(np.argmin(np.abs(film.times - time)))


def frames_of(film: Film, seconds: float | None, rate: float) -> tuple[np.ndarray, float]:
    """Frames [n] of a moving picture that lasts so long, and how long each is shown [s].

    Without `seconds` it takes as long as the motion did, at least 2 and at most 6.
    """
    span = float(film.times[-1] - film.times[0])
    lasts = float(np.clip(span, 2.0, 6.0)) if seconds is None else seconds
    count = max(1, min(len(film.times), round(lasts * rate)))
    at = np.linspace(film.times[0], film.times[-1], count)
    after = np.searchsorted(film.times, at).clip(1, max(1, len(film.times) - 1))
    before = after - 1
    if len(film.times) == 1:
        return np.zeros(1, int), lasts
    nearer = at - film.times[before] <= film.times[after] - at
    return np.where(nearer, before, after), lasts / count
