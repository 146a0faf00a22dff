"""The drive as the kernels read it: `Signal` as a warp function."""

import warp as wp


@wp.func
def wave(
    P: wp.array(dtype=wp.float64),
    layout: wp.array2d(dtype=wp.int32),
    first: int,
    k: int,
    w: int,
    series_times: wp.array(dtype=wp.float64),
    series_values: wp.array3d(dtype=wp.float64),
    t: wp.float64,
):
    """Drive channel k at time t: offset + amplitude sin(omega t + phase) + scale * sampled series."""
    value = P[layout[first, 0] + k * layout[first, 1] + w * layout[first, 2]]
    amplitude = P[layout[first + 1, 0] + k * layout[first + 1, 1] + w * layout[first + 1, 2]]
    if amplitude != wp.float64(0.0):
        omega = P[layout[first + 2, 0] + k * layout[first + 2, 1] + w * layout[first + 2, 2]]
        phase = P[layout[first + 3, 0] + k * layout[first + 3, 1] + w * layout[first + 3, 2]]
        value += amplitude * wp.sin(omega * t + phase)
    knots = series_times.shape[0]
    if knots > 1:
        scale = P[layout[first + 4, 0] + k * layout[first + 4, 1] + w * layout[first + 4, 2]]
        if scale != wp.float64(0.0):
            i = wp.clamp(wp.lower_bound(series_times, t), 1, knots - 1)
            t0 = series_times[i - 1]
            s = wp.clamp((t - t0) / (series_times[i] - t0), wp.float64(0.0), wp.float64(1.0))
            own = wp.min(w, series_values.shape[2] - 1)
            before = series_values[k, i - 1, own]
            value += scale * (before + s * (series_values[k, i, own] - before))
    return value
