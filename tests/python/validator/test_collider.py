"""Penetration depth against closed forms."""

import numpy as np
import pytest

from hairbake_validate.collider import Collider, Frames, closest
from hairbake_validate.geometry import FloatArray, norms
from validator.good_cache import RADIUS, sphere_mesh

BOX = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 0.5)])
BOX_TRIANGLES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 7, 5],
        [4, 6, 7],
        [0, 5, 1],
        [0, 4, 5],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


def box_depth(points: FloatArray) -> FloatArray:
    """Penetration depth in the box."""
    depth: FloatArray = np.maximum(0, np.minimum(points, BOX.max(0) - points).min(axis=1))
    return depth


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0]])
def test_depth_in_a_box_is_exact_for_either_orientation(order: list[int]) -> None:
    points = np.random.default_rng(1).uniform(-0.5, 2.5, (4000, 3))
    depth = Collider(BOX, BOX_TRIANGLES[:, order]).depth(points)
    assert (depth > 0).sum() > 50
    np.testing.assert_allclose(depth, box_depth(points), atol=1e-12)


def test_split_vertices_are_joined() -> None:
    points = np.random.default_rng(2).uniform(-0.2, 2.2, (2000, 3))
    loose = Collider(BOX[BOX_TRIANGLES].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    np.testing.assert_allclose(loose.depth(points), box_depth(points), atol=1e-12)


def test_depth_in_a_sphere_is_exact_to_its_facets() -> None:
    points = np.random.default_rng(3).uniform(-RADIUS, RADIUS, (3000, 3))
    depth = Collider(*sphere_mesh()).depth(points)
    exact = np.maximum(0, RADIUS - np.linalg.norm(points, axis=1))
    sagitta = RADIUS * (1 - np.cos(np.pi / 8) * np.cos(np.pi / 12))
    assert (depth <= exact + 1e-12).all()
    assert (exact - depth).max() <= sagitta


def test_open_sheet_has_an_inside_below_and_none_beyond_its_boundary() -> None:
    sheet = Collider(
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    points = np.array([[0.5, 0.4, -0.01], [0.5, 0.4, 0.01], [-0.02, 0.4, -0.01]])
    np.testing.assert_allclose(sheet.depth(points), [0.01, 0, 0], atol=1e-12)


def test_a_closed_mesh_tells_where_its_surface_is_turned_inside_out() -> None:
    points, triangles = sphere_mesh()
    # Beside the sphere a smaller one, turned inside out, too small to turn the whole around.
    both = np.concatenate([points, points / 4 + [2 * RADIUS, 0, 0]])
    triangles = np.concatenate([triangles, triangles[:, ::-1] + len(points)])
    places = np.array([[0.0, 0, 0], [2.3 * RADIUS, 0, 0], [2 * RADIUS, 0, 0], [0, 2 * RADIUS, 0]])
    turned = Collider(both, triangles)
    distance, _ = turned.surface(places)
    assert (distance < 0).tolist() == [True, True, False, False]
    assert turned.winds_past(places).tolist() == [False, True, True, True]
    # An open one does not tell.
    assert not Collider(both, triangles[:-1]).winds_past(places).any()


def test_octree_around_the_queries_alone_gives_the_same_depths() -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.2 * RADIUS, 1.2 * RADIUS, (3000, 3))
    whole = Collider(*sphere_mesh())
    for queries in (points, points[points[:, 1] > 0.7 * RADIUS], points[:1], points + 5 * RADIUS):
        some = Collider(*sphere_mesh(), queries)
        np.testing.assert_array_equal(some.depth(queries), whole.depth(queries))
    upper = Collider(*sphere_mesh(), points[points[:, 1] > 0.7 * RADIUS])
    assert len(upper.leaves.clearance) < 0.3 * len(whole.leaves.clearance)


def test_distance_in_the_frame_of_a_triangle_is_that_to_its_closest_point() -> None:
    rng = np.random.default_rng(6)
    corners = rng.normal(size=(2000, 3, 3))
    corners[::4, 2] = corners[::4, :2].mean(axis=1) + 1e-4 * rng.normal(size=(500, 3))  # Slivers.
    points = 2 * rng.normal(size=(2000, 3))
    squared = Frames(corners).squared_distance(list(points.T), np.arange(2000))
    away, feature = closest(points, corners)
    np.testing.assert_allclose(np.sqrt(squared), norms(away), rtol=1e-9)
    assert set(feature) == set(range(7))
