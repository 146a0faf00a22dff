"""Channels as they would have been measured: clocks that are late or fast, lags, scales and offsets of a recorder."""

from collections.abc import Sequence
from itertools import compress

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.effects import Effect, get
from origami_sim.model import Model, Parameters
from origami_sim.observation.channels import angle_mask, marked
from origami_sim.recording import Channel, Recording

ROUNDING = 1e-9
"""Lateness [s] that is due to rounding; worlds without any share one drive."""


def lateness(model: Model, parameters: Parameters, worlds: int, begins: np.ndarray, fitted: bool):
    """How late recordings are.

    A start that is fitted is that of the first frame, however late it was taken: the drive is late there, and the
    motion is read from there on. A clock that runs fast or slow is off by more in each segment, and so is the drive
    that acts there. Within a segment the reading of the motion takes care of it.

    Args:
        begins: (B,) times of first frames since the recording's start [s]. fitted: whether starts are.

    Returns:
        by how much later than its clock says a recording's frames at `begins` were taken [K, B], and the time since
        its start at which the motion of a segment is read first (K,) [s].
    """
    clock = clock_of(model, parameters, worlds, None, [-1e3, 0.0, *begins])
    late = (clock[2:] - clock[1] - begins[:, None]).T
    shown = np.zeros(worlds)
    if fitted:
        shown = clock_of(model, parameters, worlds, None, [0.0])[0]
        late += shown[:, None]
    return np.where(np.abs(late) > ROUNDING, late, 0.0), shown


def read_until(model: Model, parameters: Parameters, channel: int, last: float, shown: np.ndarray) -> float:
    """Time since its start until which the motion of a segment is read [s]."""
    clock = clock_of(model, parameters, len(shown), channel, [0.0, last])
    return max(last, float(np.max(clock[1] - shown)))


def clock_of(model: Model, parameters: Parameters, worlds: int, channel: int | None, times) -> np.ndarray:
    """[n, K] what a clock in the picture would show at frames at `times` [n], by a channel or (None) by all."""
    rows = np.repeat(np.array(times)[:, None], worlds, axis=1)
    out = rows.copy()
    for name in model.effects:
        effect = get(name)
        if effect.family != "measurement" or effect.channels or effect.apply is None:
            continue  # what reads angles or places has no time of its own
        given = at_channel(parameters, name, channel, worlds)
        out += effect.apply(lambda t: t[:, None], rows, **given)[:, 0] - rows
    return out


def measured(
    parameters: Parameters,
    recording: Recording,
    distort: Sequence[str],
    grid: np.ndarray,
    channels: np.ndarray,
    times: np.ndarray,
    shown: np.ndarray,
    *,
    rested: bool | np.ndarray | None,
) -> np.ndarray:
    """Channels [n, D, W] as distorted measurements show them; what is `shown` first (K,) is the grid's start.

    Args:
        distort: effects of the measurement. channels: [F, D + k, W] on the grid (F,). times: (n,) of frames [s], or
            [n, W] of each world's.
        rested: whether the motion was at rest before the grid's start, of all worlds or of each (W,); None: the grid
            begins with the times of frames, and they are read at no others.
    """
    worlds = channels.shape[2]
    shown = np.repeat(shown, worlds // len(shown))
    still = None if rested is None else np.broadcast_to(rested, worlds)
    at = times if times.ndim == 2 else np.repeat(times[:, None], worlds, axis=1)
    distort = sorted(distort, key=lambda name: not get(name).on_body)
    parts, row, deep = [], 0, len(angle_mask(recording))
    axes = deep + sum(c.kind == "marker_2d" for c in recording.channels.values())
    for index, channel in enumerate(recording.channels.values()):
        width = 1 if channel.values.ndim == 1 else channel.values.shape[1]
        rows = [*range(row, row + width)]
        if channel.kind == "marker_2d":  # until it is measured, a picture has a depth
            rows, deep = [*rows, deep], deep + 1
        turned: list[int] = []
        if get(distort[0]).on_body and channel in marked(recording):
            turned, axes = list(range(axes, axes + 9)), axes + 9
        given = {n: at_channel(parameters, n, index, worlds) for n in distort if _reads(get(n), channel)}
        acting = np.stack([_acts(get(n), by) for n, by in given.items()] or [np.ones(worlds, bool)])
        kinds, kind = np.unique(acting, axis=1, return_inverse=True)
        part = np.empty((len(times), width, worlds))
        for k, on in enumerate(kinds.T):  # a law is asked only about worlds in which it acts
            mine = np.flatnonzero(kind.ravel() == k)
            laws = list(compress(given.items(), on))
            seen = [*rows, *turned] if any(get(name).on_body for name, _ in laws) else rows
            rests = None if still is None else still[mine]
            reader = _reader(grid, channels[:, seen][:, :, mine], shown[mine], rests, trembling=times.ndim == 2)
            for name, by in laws:
                reader = _wrapped(get(name), reader, {n: v[mine] for n, v in by.items()})
            part[:, :, mine] = reader(at[:, mine])[:, :width]
        parts.append(part)
        row += width
    return np.concatenate(parts, axis=1)


def at_channel(parameters: Parameters, name: str, channel: int | None, worlds: int) -> dict[str, np.ndarray]:
    """Parameters (W,) of a measurement effect at one channel; None: what all have in common, the least of one sign."""
    values = parameters.of(name)
    if channel is None:
        row = {n: np.maximum(v.min(axis=0), 0.0) + np.minimum(v.max(axis=0), 0.0) for n, v in values.items()}
    else:
        row = {n: v[channel] for n, v in values.items()}
    return {n: np.broadcast_to(v, (worlds,)) for n, v in row.items()}


def _reads(effect: Effect, channel: Channel) -> bool:
    """Whether an effect has to do with channels of this kind."""
    return not effect.channels or channel.kind in effect.channels


def _acts(effect: Effect, given: dict[str, np.ndarray]) -> np.ndarray:
    """(W,) whether an effect of these parameters (W,) has any strength."""
    each = [given[p.name] != 0.0 for p in effect.strengths]
    return np.any(each, axis=0) if each else np.ones(len(next(iter(given.values()))), bool)


def _wrapped(effect, inner, given):
    return lambda t: effect.apply(inner, t, **given)


def _reader(grid: np.ndarray, values: np.ndarray, shown: np.ndarray, rested: np.ndarray | None, *, trembling: bool):
    """values [F, d, W] as a function of times [n, W], of which `shown` (W,) is the grid's start.

    Before it the motion rested (W,), or went on as it began, with its rate and acceleration there; many worlds may
    share a column. Of None, see `measured`.
    """
    if rested is None:
        return lambda times: values[: len(times)]
    curve = spline(grid, values)

    def at(times: np.ndarray) -> np.ndarray:
        since = times - shown
        # clocks are late and fast: their first and last readings tell them apart, if they do not tremble
        telling = since if trembling else since[[0, -1]]
        _, some, inverse = np.unique(telling, axis=1, return_index=True, return_inverse=True)
        columns = since[:, some]
        out = np.empty((len(times), values.shape[1], values.shape[2]))
        for c in range(columns.shape[1]):
            mine = np.flatnonzero(inverse.ravel() == c)
            part = curve if columns.shape[1] == 1 else spline(grid, values[:, :, mine])
            inside = np.clip(columns[:, c], grid[0], grid[-1])
            out[:, :, mine] = part(inside)
            outside = columns[:, c] - inside
            for end, beyond, moves in ((0, outside < 0, ~rested[mine]), (-1, outside > 0, np.ones(len(mine), bool))):
                if np.any(beyond) and np.any(moves):  # often thousands of times: only the end's rate and bend are asked
                    rate, bend = (part(grid[end], order)[:, moves] for order in (1, 2))
                    by = outside[beyond, None, None]
                    out[np.ix_(beyond, np.full(out.shape[1], True), mine[moves])] += by * rate + 0.5 * by**2 * bend
        return out

    return at


def spline(grid: np.ndarray, values: np.ndarray):
    """Cubic spline through [F, ...]; where a value is not finite, the whole curve is nan."""
    bad = ~np.all(np.isfinite(values), axis=0)
    curve = CubicSpline(grid, np.where(bad, 0.0, values), axis=0)
    return lambda t, order=0: np.where(bad, np.nan, curve(t, order))


def continuous(channels: np.ndarray, turning: np.ndarray, first: np.ndarray) -> None:
    """Makes angles [F, D, W] continuous in time, in place, starting in the turn of `first` [D, W]."""
    a = np.unwrap(np.nan_to_num(channels[:, turning]), axis=0)
    target = np.nan_to_num(first[turning])
    a += 2 * np.pi * np.round((target - a[0]) / (2 * np.pi))
    channels[:, turning] = np.where(np.isfinite(channels[:, turning]), a, np.nan)
