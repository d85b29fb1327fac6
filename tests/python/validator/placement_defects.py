"""Defects of the space of groom, head and colliders."""

import numpy as np
from pxr import Usd, UsdGeom, Vt

from validator.defects import defect
from validator.good_cache import GUIDES, HAIR, HANDLES, SKULL, CacheBuilder

AWAY = np.array([0.0, 0.0, 2.0], np.float32)
"""As far as the placement of a character in a shot, m."""


def move_skull(cache: CacheBuilder, by: np.ndarray) -> None:
    """Moves the points of the collider in its own space."""

    def edit(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(SKULL))
        points = np.array(mesh.GetPointsAttr().Get()) + by
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
        box = np.stack([points.min(0), points.max(0)]).astype(np.float32)
        mesh.GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(box))

    cache.edit_topology(edit)


@defect("placement")
def body_far_from_all_roots(cache: CacheBuilder) -> None:
    move_skull(cache, AWAY)


@defect("placement")
def groom_off_the_head(cache: CacheBuilder) -> None:
    """Groom and hair in every frame are moved in the space of the head; all else agrees with them."""
    up = np.array([0.0, 0.5, 0.0], np.float32)

    def edit(stage: Usd.Stage) -> None:
        for path in (HAIR, GUIDES):
            rest = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(path)).GetPrimvar("rest")
            rest.Set(Vt.Vec3fArray.FromNumpy(np.array(rest.Get()) + up))

    cache.edit_topology(edit)
    # The head turns about Y: the same way up in the world.
    for frame in HANDLES:
        for path in (HAIR, GUIDES):
            for name in ("points", "extent"):
                for after in (0.0, 0.25, 0.5):
                    cache.edit_array(frame, f"{path}.{name}", lambda values: values + up, after=after)
