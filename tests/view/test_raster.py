"""The renderer fills the pixels whose centres lie in a triangle, hides what is behind, and looks where it is told."""

import numpy as np
import pytest

from origami_sim.view.raster import OVERSAMPLING, Camera, Canvas, look

WHITE, RED, BLUE = (255.0, 255, 255), (255.0, 0, 0), (0.0, 0, 255)


def camera(width: int = 64, height: int = 48) -> Camera:
    """On the z axis, looking down, x to the right."""
    return Camera(np.array([0.0, 0, 2]), np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1]]), 40.0, width, height)


def test_a_triangle_covers_the_pixels_whose_centres_it_holds():
    canvas = Canvas(64, 48, WHITE)
    corners = np.array([[[3.2, 4.1, 1.0], [50.7, 9.3, 1.0], [20.4, 44.8, 1.0]]])
    canvas.triangles(corners, np.array([RED]))
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    (ax, ay), (bx, by), (cx, cy) = corners[0, :, :2]
    sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax), (cx - bx) * (y - by) - (cy - by) * (x - bx),
             (ax - cx) * (y - cy) - (ay - cy) * (x - cx)]  # fmt: skip
    inside = np.all([s > 0 for s in sides], axis=0)
    assert inside.sum() > 500
    assert np.array_equal(canvas.colour[:, :, 1] == 0, inside)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_triangles_that_pass_through_each_other_part_at_their_line(order):
    """Painter's algorithm cannot do this, whatever the order."""
    view = camera(256, 256)
    tilted = np.array(
        [
            [[-0.5, -0.5, -0.25], [0.5, -0.5, 0.25], [0, 0.7, 0.0]],
            [[-0.5, -0.5, 0.25], [0.5, -0.5, -0.25], [0, 0.7, 0.0]],
        ]
    )
    canvas = Canvas(256, 256, WHITE)
    for i in order:
        canvas.triangles(view.project(tilted[[i]]), np.array([(RED, BLUE)[i]]))
    left, right = canvas.colour[128, :128], canvas.colour[128, 129:]
    drawn = (left[:, 1] == 0).sum()
    assert drawn > 5
    assert (left[left[:, 1] == 0] == BLUE).all()  # the second is nearer on the left
    assert (right[right[:, 1] == 0] == RED).all()


def test_depth_between_the_corners_is_that_of_the_plane():
    """Inverse depth is linear in the picture; depth is not."""
    view = camera(64, 48)
    corners = np.array([[[-0.8, -0.5, 0.0], [0.8, -0.5, 1.0], [0.0, 0.6, 0.3]]])
    canvas = Canvas(64, 48, WHITE)
    canvas.triangles(view.project(corners), np.array([RED]))
    (a, b, c), rays = corners[0], view.rays()
    normal = np.cross(b - a, c - a)
    distance = (normal @ (a - view.eye)) / (rays @ normal)
    drawn = canvas.near > 0
    assert drawn.sum() > 100
    assert 1 / canvas.near[drawn] == pytest.approx(distance[drawn], rel=1e-9)


def test_what_is_behind_the_camera_is_not_drawn():
    canvas, view = Canvas(64, 48, WHITE), camera()
    canvas.triangles(view.project(np.array([[[-1.0, -1, 3], [1, -1, 3], [0, 1, 3]]])), np.array([RED]))
    canvas.lines(view.project(np.array([[[-1.0, 0, 0], [1, 0, 5]]])), np.array([RED]), 2.0)
    assert (canvas.colour == 255).all()


def test_nothing_and_slivers_are_drawn_without_a_word():
    canvas = Canvas(64, 48, WHITE)
    canvas.triangles(np.zeros((0, 3, 3)), np.zeros((0, 3)))
    canvas.triangles(np.array([[[5.0, 5, 1], [20, 20, 1], [35, 35, 1]]]), np.array([RED]))
    canvas.triangles(np.array([[[np.nan, 5, 1], [20, 20, 1], [35, 3, 1]]]), np.array([RED]))
    canvas.lines(np.array([[[5.0, 5, 1], [5, 5, 1]]]), np.array([RED]), 2.0)
    assert (canvas.colour[30:] == 255).all()


def test_lines_lie_on_their_surface_and_have_their_width():
    canvas, view = (
        Canvas(256, 256, WHITE),
        Camera(
            np.array([0.0, -10, 10]),
            np.array([[1.0, 0, 0], [0, 0.5**0.5, 0.5**0.5], [0, 0.5**0.5, -(0.5**0.5)]]),
            1500.0,
            256,
            256,
        ),
    )
    square = np.array(
        [[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]], float
    )
    canvas.triangles(view.project(square), np.array([BLUE, BLUE]))
    canvas.lines(view.project(np.array([[[-0.4, 0.0, 0], [0.4, 0, 0]]])), np.array([RED]), 4.0)
    column = canvas.colour[:, 128]
    assert (column == RED).all(axis=1).sum() == 4


def test_a_camera_sees_all_points_and_fills_the_picture():
    points = np.random.default_rng(0).normal(size=(50, 3)) * [0.1, 0.02, 0.05] + [3.0, -1, 2]
    found = look(points.mean(axis=0), np.array([0.5, -1.0, 0.55]), points, 640, 400)
    seen = found.project(points)
    assert (seen[:, 2] > 0).all()
    share = np.ptp(seen[:, :2], axis=0) / [640, 400]
    assert 0.8 < share.max() < 0.9
    assert (seen[:, :2] > 0).all() and (seen[:, :2] < [640, 400]).all()


def test_pictures_are_averaged_pixels():
    canvas = Canvas(4 * OVERSAMPLING, 2 * OVERSAMPLING, WHITE)
    canvas.colour[:1, :OVERSAMPLING] = 0
    assert canvas.picture()[0, 0, 0] == round(255 * (1 - 1 / OVERSAMPLING))
