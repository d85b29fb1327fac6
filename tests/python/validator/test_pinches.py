"""Hair that bodies leave no room for: told apart from hair that is inside although it could be outside."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from hairbake_validate import pinches
from hairbake_validate.collider import Collider
from hairbake_validate.geometry import Array, BoolArray, FloatArray
from hairbake_validate.run import validate
from validator.defects import MIDDLE, failed, move_points
from validator.good_cache import (
    FPS,
    GUIDES,
    POINTS,
    RADIUS,
    SKULL,
    CacheBuilder,
    head_matrix,
    sphere_mesh,
    transform,
)

HAND = "/groom/colliders/hand"
PATHS = {"guide_penetration", "pinches"}
"""The checks in question: a tip that is moved stretches its guide too."""
DEPTH = 3e-3


def press_a_tip(cache: CacheBuilder) -> FloatArray:
    """Puts the tip of a guide 3 mm inside the skull in the middle frame; returns the way out, at rest."""
    points, triangles = sphere_mesh()
    corners = points[triangles[40]]
    out = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    out /= np.linalg.norm(out)
    tip = corners.mean(axis=0) - DEPTH * out

    def change(curves: Array) -> Array:
        curves[0, POINTS - 1] = transform(tip[None], head_matrix((MIDDLE - 1001) / FPS))[0]
        return curves

    move_points(cache, MIDDLE, GUIDES, change)
    return np.stack([corners.mean(axis=0), out])


def add_a_hand(cache: CacheBuilder, place: FloatArray, gap: float) -> None:
    """Adds a ball that comes to within `gap`, m, of a place on the skull in the middle frame only."""
    points, triangles = sphere_mesh()
    # A facet of the ball faces the place.
    facet = points[triangles[40]].mean(axis=0)
    turned = -points

    def define(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh.Define(stage, HAND)
        mesh.AddTransformOp()
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(turned.astype(np.float32)))
        mesh.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-RADIUS), Gf.Vec3f(RADIUS)]))
        mesh.CreateFaceVertexCountsAttr([3] * len(triangles))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles[:, ::-1].ravel().astype(np.int32)))
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.CreatePurposeAttr("guide")

    cache.edit_topology(define)
    there = place[0] + facet + gap * place[1]

    def sample(_layer: Sdf.Layer, frame: int, time: float) -> Gf.Matrix4d:
        matrix = np.eye(4)
        matrix[3, :3] = there if frame == MIDDLE else [0, 9, 0]
        return Gf.Matrix4d(*(matrix @ head_matrix((time - 1001) / FPS)).ravel().tolist())

    cache.add_attribute(f"{HAND}.xformOp:transform", Sdf.ValueTypeNames.Matrix4d, sample)


def add_a_hand_to_the_skull(cache: CacheBuilder, place: FloatArray, gap: float) -> None:
    """Adds the same ball to the mesh of the skull, which then deforms."""
    points, triangles = sphere_mesh()
    facet = points[triangles[40]].mean(axis=0)

    def with_hand(at: FloatArray) -> Vt.Vec3fArray:
        return Vt.Vec3fArray.FromNumpy(np.concatenate([points, at - points]).astype(np.float32))

    away = with_hand(np.array([0.0, 9.0, 0.0]))
    here = with_hand(place[0] + facet + gap * place[1])
    indices = np.concatenate([triangles, triangles[:, ::-1] + len(points)])

    def edit(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL))
        for name in ("points", "extent"):
            mesh.GetPrim().GetAttribute(name).Clear()
        mesh.CreateFaceVertexCountsAttr([3] * len(indices))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices.ravel().astype(np.int32)))
        UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("rest", Sdf.ValueTypeNames.Point3fArray, "vertex").Set(away)

    cache.edit_topology(edit)

    def sample(_layer: Sdf.Layer, frame: int, _time: float) -> Vt.Vec3fArray:
        return here if frame == MIDDLE else away

    cache.add_attribute(f"{SKULL}.points", Sdf.ValueTypeNames.Point3fArray, sample)
    cache.add_attribute(
        f"{SKULL}.extent",
        Sdf.ValueTypeNames.Float3Array,
        lambda *of: UsdGeom.PointBased.ComputeExtent(sample(*of)),
    )


def record(cache: CacheBuilder, depth: float) -> None:
    """Records pinched hair in the middle frame."""

    def change(manifest: dict[str, object]) -> None:
        frames = manifest["frames"]
        assert isinstance(frames, list)
        entry = next(entry for entry in frames if entry["frame"] == MIDDLE)
        entry["figures"]["pinched_penetration_m"] = depth

    cache.edit_record(change)


@pytest.mark.parametrize(
    ("gap", "recorded", "expected"),
    [
        # No hand, or one that leaves room: the tip is inside for no reason, recorded or not.
        (None, 0.0, {"guide_penetration"}),
        (0.01, 0.0, {"guide_penetration"}),
        (0.01, DEPTH, {"guide_penetration"}),
        # A hand that closes on the tip, and one that overlaps the skull there.
        (1e-3, 0.0, {"pinches"}),
        (1e-3, DEPTH, set()),
        (-2 * DEPTH, DEPTH, set()),
        (-2 * DEPTH, 0.5 * DEPTH, {"pinches"}),
    ],
)
@pytest.mark.parametrize("add", [add_a_hand, add_a_hand_to_the_skull])
def test_only_hair_without_room_outside_is_pinched(
    good_cache: CacheBuilder,
    add: Callable[[CacheBuilder, FloatArray, float], None],
    gap: float | None,
    recorded: float,
    expected: set[str],
) -> None:
    place = press_a_tip(good_cache)
    if gap is not None:
        add(good_cache, place, gap)
    record(good_cache, recorded)
    report = validate(good_cache.directory)
    assert failed(report) & PATHS == expected, report.as_text()


def test_what_is_held_where_it_is_deepest_is_held_in_every_collider(monkeypatch: pytest.MonkeyPatch) -> None:
    # Held in the first and deepest there; the same, deeper in the second; held nowhere; in the first only.
    depths = {"first": [3.0, 1.0, 2.0, 1.0], "second": [1.0, 3.0, 1.0, 0.0]}
    held = {"first": [True, True, False, True], "second": [False] * 4}

    def pinched_in(_window: Any, _curves: Any, mesh: Any, _at_first: Any, _depth: FloatArray) -> BoolArray:
        return np.array(held[mesh.path])

    monkeypatch.setattr(pinches, "pinched_in", pinched_in)
    meshes: list[Any] = [SimpleNamespace(path=path) for path in depths]
    window: Any = SimpleNamespace(
        reference=SimpleNamespace(colliders=[(mesh, None) for mesh in meshes]),
        depths=lambda mesh, _: {"hair": np.array(depths[mesh.path])},
    )
    curves: Any = SimpleNamespace(path="hair")
    found = {path: flags.tolist() for path, flags in pinches.pinched(window, curves, 0).items()}
    assert found == {"first": held["first"], "second": [True, False, False, False]}


def test_a_curve_does_not_leave_a_groove_that_it_runs_out_of() -> None:
    a, b = (np.array([[0.8, side * 0.6, 0.0]] * 3) for side in (1, -1))
    along = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(pinches.cosine(along, a, b), [-1.0, 0.28, 0.28], atol=1e-12)


def test_a_place_is_faced_by_another_part_of_a_collider_and_not_by_its_other_side() -> None:
    points, triangles = sphere_mesh()
    facet = points[triangles[40]].mean(axis=0)
    out = facet / np.linalg.norm(facet)
    for gap in (1e-3, -4e-3):
        both = np.concatenate([points, 2 * facet + gap * out - points])
        parts = Collider(both, np.concatenate([triangles, triangles[:, ::-1] + len(points)]))
        distance, normal = parts.facing(facet[None], out[None], 0.5, 1e-4)
        assert distance == pytest.approx(gap, abs=1e-5)
        assert normal[0] @ out < -0.99
    # A plate 2 mm thick.
    plate = Collider(points * np.where(np.arange(3) == 1, 1e-3 / RADIUS, 1), triangles)
    top = np.array([[1e-4, 1e-3, 2e-4]])
    place = top - plate.surface(top)[0] * plate.surface(top)[1]
    distance, _ = plate.facing(place, plate.surface(top)[1], 0.5, 1e-4)
    assert np.isinf(distance).all()


def test_a_place_is_inside_another_part_of_a_collider_at_any_angle() -> None:
    # Two blocks: the side of the second, at x = 0, stands on the top of the first, at y = 0.
    ends = np.array([[[-0.1, -0.06, -0.1], [0.1, 0.0, 0.1]], [[0.0, -0.04, -0.04], [0.06, 0.05, 0.04]]])
    points = np.array([[block[i >> k & 1, k] for k in range(3)] for block in ends for i in range(8)])
    quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    block = np.array([triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])])
    collider = Collider(points, np.concatenate([block, block + 8]))
    top = np.array([[5e-3, 0.0, 3e-3], [-5e-3, 0.0, 3e-3]])
    up = np.array([[0.0, 1.0, 0.0]] * 2)
    distance, normal = collider.around(top, up, 0.5, 0.5, 1e-4)
    np.testing.assert_allclose(distance, [-5e-3, np.inf], atol=1e-12)
    np.testing.assert_allclose(normal[0], [-1.0, 0.0, 0.0], atol=1e-12)
