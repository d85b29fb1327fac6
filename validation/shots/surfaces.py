"""Star-shaped surfaces: the heads and bodies that hair grows on and falls over."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from hairbake_validate.geometry import IntArray
from physics.arrays import FloatArray

Triangles = tuple[FloatArray, IntArray]
"""Vertices, m, `V × 3`, and triangles, counter-clockwise from outside, `T × 3`."""
TABLE = 240
"""Entries around a table of radii."""
MARGIN = 0.1
"""Between the tilt of a ray and those of the corners of a triangle that it may hit, rad."""


@dataclass(frozen=True)
class Surface:
    """The points at distance `radius(d)` from a centre in each unit direction d."""

    centre: FloatArray
    radius: Callable[[FloatArray], FloatArray]
    """Distance, m, for directions, `N × 3`."""

    def at(self, directions: FloatArray) -> FloatArray:
        """Points of the surface in these unit directions."""
        points: FloatArray = self.centre + directions * self.radius(directions)[:, None]
        return points

    def height(self, points: FloatArray) -> FloatArray:
        """Distance from the surface along the ray from the centre; negative inside."""
        offset = points - self.centre
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        above: FloatArray = distance - self.radius(offset / distance[:, None])
        return above

    def triangles(self, rings: int = 24, sides: int = 36) -> Triangles:
        """A closed mesh with poles on the second axis."""
        tilt = np.pi * np.arange(1, rings) / rings
        turn = 2 * np.pi * np.arange(sides) / sides
        around = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
        belts = [np.sin(t) * around + [0, np.cos(t), 0] for t in tilt]
        directions = np.concatenate([[[0, 1, 0]], *belts, [[0, -1, 0]]])
        i, j = np.arange(sides), (np.arange(sides) + 1) % sides
        last = len(directions) - 1
        faces = [np.stack([0 * i, 1 + i, 1 + j], axis=1)]
        for ring in range(rings - 2):
            a, b = 1 + ring * sides, 1 + (ring + 1) * sides
            faces += [np.stack([a + i, b + i, b + j], axis=1), np.stack([a + i, b + j, a + j], axis=1)]
        faces.append(np.stack([last + 0 * i, last - sides + j, last - sides + i], axis=1))
        return self.at(directions), np.concatenate(faces)


def ellipsoid(centre: Sequence[float], radii: Sequence[float]) -> Surface:
    """An ellipsoid along the axes."""
    return Surface(np.array(centre), lambda d: 1 / np.linalg.norm(d / np.array(radii), axis=1))


def of_mesh(mesh: Triangles, centre: FloatArray) -> Surface:
    """The farthest place of a mesh in each direction from `centre`, from a table of radii."""
    corners = mesh[0][mesh[1]] - centre
    # Triangles that lie along a ray, as on the rims of ears, have no inverse, and their neighbours are hit.
    corners = corners[np.abs(np.linalg.det(corners)) > 1e-15]
    # A direction is a positive combination of the corners of a triangle that it hits.
    shares = np.linalg.inv(np.swapaxes(corners, 1, 2))
    tilts = np.arccos(corners[..., 1] / np.linalg.norm(corners, axis=2))
    first, last = tilts.min(axis=1) - MARGIN, tilts.max(axis=1) + MARGIN
    turn = 2 * np.pi * np.arange(TABLE) / TABLE

    def ring(tilt: float) -> FloatArray:
        around = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
        directions = np.sin(tilt) * around + [0, np.cos(tilt), 0]
        weights = np.einsum("tij,nj->nti", shares[(first < tilt) & (tilt < last)], directions)
        inverse = np.where(weights.min(axis=2) > -1e-6, weights.sum(axis=2), np.inf)
        distance: FloatArray = (1 / inverse).max(axis=1)
        return distance

    table = np.stack([ring(tilt) for tilt in np.linspace(0, np.pi, TABLE // 2 + 1)])

    def radius(directions: FloatArray) -> FloatArray:
        x, y, z = directions.T
        places = (
            np.stack([np.arccos(np.clip(y, -1, 1)), np.arctan2(x, z) % (2 * np.pi)]) * TABLE / (2 * np.pi)
        )
        distance: FloatArray = map_coordinates(table, places, order=1, mode="grid-wrap")
        return distance

    return Surface(centre, radius)


def height_above(surfaces: Sequence[Surface], points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Height over the nearest of the surfaces, and the unit direction in which it rises."""

    def height(at: FloatArray) -> FloatArray:
        least: FloatArray = np.min([surface.height(at) for surface in surfaces], axis=0)
        return least

    step = 1e-4
    slope = np.stack([height(points + step * axis) - height(points - step * axis) for axis in np.eye(3)], 1)
    steepness = np.maximum(np.linalg.norm(slope, axis=1), 1e-9)
    return height(points) / (steepness / (2 * step)), slope / steepness[:, None]


def read_obj(path: Path) -> Triangles:
    """The triangles of an OBJ file."""
    lines = [line.split() for line in path.read_text().splitlines()]
    vertices = [[float(x) for x in line[1:4]] for line in lines if line[:1] == ["v"]]
    faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:4]] for line in lines if line[:1] == ["f"]]
    return np.array(vertices), np.array(faces)
