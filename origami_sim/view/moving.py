"""Moving pictures of a device: WebP and GIF by Pillow, MP4 where PyAV is installed."""

import io
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from origami_sim.errors import InputError
from origami_sim.pattern.files import write_atomic
from origami_sim.view.film import Film
from origami_sim.view.picture import Artist, frames_of, nearest_frame

RATE = {".webp": 20.0, ".gif": 20.0, ".mp4": 30.0}
"""Pictures per second: half of it jerks, double makes files twice as large."""

REST = 0.6
"""How long the last picture stays before a moving one begins again [s]."""

QUALITY = 72
"""Of lossy WebP: 50 blurs thin creases, 90 makes files twice as large."""


def picture(film: Film, *, at: float | None = None, **how) -> bytes:
    """A PNG of the frame nearest to a time [s] (default: where the creases are furthest from where they began).

    `how` is passed to `Artist`: width, height [px], colour ("kind" or "strain"), labels.

    Raises:
        InputError: a time outside of the run, a size or a colouring that there is not.
    """
    out = io.BytesIO()
    Artist(film, **how).frame(nearest_frame(film, at)).save(out, format="PNG", optimize=True)
    return out.getvalue()


def moving_picture(
    film: Film,
    suffix: str = ".webp",
    *,
    seconds: float | None = None,
    rate: float | None = None,
    progress: Callable[[float], None] | None = None,
    **how,
) -> bytes:
    """A film of the run as WebP, GIF or MP4, which begins again when it is over.

    Args:
        film: what is drawn. suffix: ".webp", ".gif" or ".mp4".
        seconds: how long it lasts (default: as long as the motion, at least 2 and at most 6).
        rate: pictures per second. progress: called with the fraction done.
        how: passed to `Artist`: width, height [px], colour ("kind" or "strain"), labels.

    Raises:
        InputError: an unknown suffix, a length or a rate that is not positive, MP4 without PyAV.
    """
    if suffix not in RATE:
        raise InputError("no such moving picture", field="suffix", value=suffix, allowed=", ".join(RATE))
    if seconds is not None and not 0 < seconds <= 600:
        raise InputError("no such length", field="seconds", value=seconds, allowed="above 0, up to 600 s")
    rate = RATE[suffix] if rate is None else rate
    if not 0 < rate <= 1000:
        raise InputError(
            "no such number of pictures", field="rate", value=rate, allowed="above 0, up to 1000 per second"
        )
    if suffix == ".mp4":
        _pyav()
    artist = Artist(film, **how)
    chosen, each = frames_of(film, seconds, rate)
    pictures, last = [], {}
    for n, f in enumerate(chosen.tolist()):
        last = last if f in last else {f: artist.frame(f)}  # slow motion shows a frame more than once
        pictures.append(last[f])
        if progress is not None:
            progress((n + 1) / len(chosen))
    if suffix == ".mp4":
        return _mp4(pictures, each)
    out, milliseconds = io.BytesIO(), max(20, round(1000 * each))
    durations = [milliseconds] * (len(pictures) - 1) + [milliseconds + round(1000 * REST)]
    if suffix == ".gif":
        pictures = _quantised(pictures)
        options = {"optimize": False, "disposal": 1}
    else:
        options = {"quality": QUALITY, "method": 4, "minimize_size": False, "allow_mixed": False}
    pictures[0].save(
        out, format=suffix[1:].upper(), save_all=True, append_images=pictures[1:], duration=durations, loop=0, **options
    )
    return out.getvalue()


def _quantised(pictures: list[Image.Image]) -> list[Image.Image]:
    """GIF has 256 colours: those of some frames together, so that nothing flickers."""
    some = pictures[:: max(1, len(pictures) // 6)]
    wide = Image.new("RGB", (some[0].width, some[0].height * len(some)))
    for i, p in enumerate(some):
        wide.paste(p, (0, i * p.height))
    palette = wide.quantize(128, method=Image.Quantize.MEDIANCUT)
    return [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]


def _pyav():
    try:
        import av  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "MP4 needs the library PyAV", field="--to", value=".mp4", allowed="pip install av, or .webp and .gif"
        ) from None
    return av


def _mp4(pictures: list[Image.Image], each: float) -> bytes:
    av, out = _pyav(), io.BytesIO()
    rate = Fraction(1.0 / each).limit_denominator(1000)
    with av.open(out, mode="w", format="mp4") as container:
        codec = next(c for c in ("libx264", "libopenh264", "mpeg4") if c in av.codecs_available)
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height = (2 * (n // 2) for n in pictures[0].size)  # encoders want even sizes
        stream.pix_fmt = "yuv420p"
        for p in pictures:
            cut = np.asarray(p)[: stream.height, : stream.width]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(cut), format="rgb24")))
        container.mux(stream.encode())
    return out.getvalue()


def write_moving(path: str | Path, film: Film, **options) -> Path:
    """Writes a moving picture, or with the suffix .png one frame; the file appears whole or not at all."""
    file = Path(path)
    suffix = file.suffix.lower()
    data = picture(film, **options) if suffix == ".png" else moving_picture(film, suffix, **options)
    write_atomic(file, data)
    return file
