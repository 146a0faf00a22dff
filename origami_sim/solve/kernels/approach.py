"""Whether any parts of a surface come near each other between frames of a run, in a kernel; see `solve.watch`."""

import warp as wp

from origami_sim import _warp  # noqa: F401  settings
from origami_sim.solve.kernels.touching import Skin, farthest, free_share, place, renew

scalar = wp.float64


@wp.kernel(enable_backward=False)
def approach(
    s: Skin,
    films: wp.array3d(dtype=wp.vec3d),
    speeds: wp.array3d(dtype=wp.vec3d),
    times: wp.array(dtype=wp.float64),
    pieces: wp.array(dtype=wp.int32),
    thick: wp.array(dtype=wp.float64),
    by_world: int,
    stride: int,
    finest: scalar,
    X: wp.array2d(dtype=wp.vec3d),
    Y: wp.array2d(dtype=wp.vec3d),
    met: wp.array(dtype=wp.float64),
    sides: wp.array2d(dtype=wp.int32),
):
    """Time after which a pair touches on the way from frame to frame, infinite where none does, and its triangles.

    Triangles are -1 where that could not be told, because the list found no room. Pairs that touch at no more than
    `finest` [m] lie together in the reference state.
    """
    w = wp.tid()
    first = by_world * w
    one = scalar(1.0)
    two = scalar(2.0)
    met[w] = scalar(wp.inf)
    going = int(1)
    frame = int(0)
    while going == 1 and frame < pieces.shape[0]:
        length = times[frame + 1] - times[frame]
        count = pieces[frame]
        for k in range(X.shape[0]):
            Y[k, w] = films[frame, k, w]
        piece = int(0)
        while going == 1 and piece < count:
            piece += 1
            u = scalar(piece) / scalar(count)
            v = one - u
            for k in range(X.shape[0]):
                X[k, w] = Y[k, w]
                ends = v * v * (one + two * u) * films[frame, k, w] + u * u * (one + two * v) * films[frame + 1, k, w]
                Y[k, w] = ends + (length * u * v) * (v * speeds[frame, k, w] - u * speeds[frame + 1, k, w])
            far = farthest(s, Y, w)
            if s.count[1, w] == 0 or far > s.span[1, w]:
                renew(s, X, thick, first, stride, w)
                far = farthest(s, Y, w)
            if far != far:  # the world failed
                going = 0
            elif s.count[1, w] == 2 or far > s.span[1, w]:
                going = 0
                met[w] = times[frame] + u * length
                sides[0, w] = -1
                sides[1, w] = -1
            elif far > s.span[0, w]:
                for row in range(s.count[0, w]):
                    if far > s.wake[row, w] and s.offset[row, w] > finest and going == 1:
                        p = s.points[row, w]
                        a = place(s, X, p[0], w)
                        b = place(s, X, p[1], w)
                        c = place(s, X, p[2], w)
                        d = place(s, X, p[3], w)
                        da = place(s, Y, p[0], w) - a
                        db = place(s, Y, p[1], w) - b
                        dc = place(s, Y, p[2], w) - c
                        dd = place(s, Y, p[3], w) - d
                        gone = free_share(s.kind[row, w][0], a, b, c, d, da, db, dc, dd, s.offset[row, w], one)
                        if gone < one:
                            going = 0
                            met[w] = times[frame] + (scalar(piece) - one + gone) / scalar(count) * length
                            sides[0, w] = s.kind[row, w][1]
                            sides[1, w] = s.kind[row, w][2]
        frame += 1
