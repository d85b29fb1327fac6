"""A frame with its neighbours, and what all frames are compared with."""

from dataclasses import dataclass, field

import numpy as np

from .cache import (
    ACCELERATIONS,
    GUIDES,
    HEAD,
    LEVEL,
    TRANSFORM,
    Cache,
    Curves,
    FrameFile,
    Mesh,
    Unreadable,
    read_frame,
)
from .collider import Collider
from .geometry import Arcs, arc_lengths, transformed


@dataclass
class Ground:
    """What frames are compared with, worked out once: it travels to every process."""

    rest_arcs: Arcs | None = None
    """Arcs of the guides at rest."""
    colliders: list[tuple[Mesh, Collider]] = field(default_factory=list)
    """Every collider as it is in the first frame: for good, unless it deforms."""
    outside: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)
    """Points to be kept outside a collider, by curves' and collider's path: those outside it at rest, which is the rest
    pose as the head carries it to the first frame, against the collider where it is then. A guide that is drawn through
    a collider may slide in it, so of guides the points beside such a stretch are left out too."""

    @classmethod
    def of(cls, cache: Cache) -> "Ground":
        """Builds it from the static layers and the first frame that can be read."""
        ground = cls()
        sound = [curves for curves in cache.curves if curves.sound]
        for curves in sound:
            if curves.path == GUIDES:
                ground.rest_arcs = arc_lengths(curves.rest, curves.counts)
        values = first_values(cache)
        head = values.get(f"{HEAD}.{TRANSFORM}")
        for mesh in cache.colliders:
            matrix = values.get(f"{mesh.path}.{TRANSFORM}")
            if head is None or matrix is None or not mesh.sound:
                continue
            points = values.get(f"{mesh.path}.points", mesh.points)
            if points.shape != mesh.points.shape or not np.isfinite(points).all():
                continue
            collider = Collider(points.astype(float), mesh.triangles)
            ground.colliders.append((mesh, collider))
            for curves in sound:
                there = transformed(transformed(curves.rest, head), np.linalg.inv(matrix))
                outside = collider.depth(there) == 0
                if curves.path == GUIDES:
                    outside &= ~beside(through(outside, curves), curves)
                ground.outside[curves.path, mesh.path] = outside
        return ground


def through(outside: np.ndarray, curves: Curves) -> np.ndarray:
    """Points inside after their curve has come out for the first time."""
    came_out = np.cumsum(outside)
    before = (came_out - outside)[curves.starts]
    return ~outside & (came_out > np.repeat(before, curves.counts))


def beside(points: np.ndarray, curves: Curves) -> np.ndarray:
    """The neighbours of points on their curves."""
    neighbours = np.zeros(len(points), bool)
    first = curves.segments
    neighbours[first] |= points[first + 1]
    neighbours[first + 1] |= points[first]
    return neighbours


def first_values(cache: Cache) -> dict[str, np.ndarray]:
    """Moving values of the first frame whose file can be read."""
    for frame in cache.frames:
        try:
            return read_frame(cache, frame).values
        except Unreadable:
            continue
    return {}


class Window:
    """Frames around `frame`, read as they are asked for and kept while they are near."""

    def __init__(self, cache: Cache, ground: Ground):
        self.cache = cache
        self.ground = ground
        self.frame = cache.frames[0]
        self._files: dict[int, FrameFile | str] = {}
        self._colliders: dict[str, Collider | None] = {}
        self._colliders_of: int | None = None
        self._shapes = {f"{path}.{TRANSFORM}": (4, 4) for path in self.bodies()}
        for curves in cache.curves:
            if curves.sound:
                points = (len(curves.rest), 3)
                self._shapes |= {
                    f"{curves.path}.{name}": points for name in ("points", "velocities", ACCELERATIONS)
                }
                self._shapes[f"{curves.path}.extent"] = (2, 3)
                self._shapes[f"{curves.path}.{LEVEL}"] = (len(curves.counts),)
        for mesh in cache.colliders:
            if mesh.deforms:
                self._shapes[f"{mesh.path}.points"] = mesh.points.shape
                self._shapes[f"{mesh.path}.extent"] = (2, 3)

    def move_to(self, frame: int) -> None:
        """Makes `frame` the middle one."""
        self.frame = frame
        self._files = {number: file for number, file in self._files.items() if abs(number - frame) <= 2}

    def bodies(self) -> list[str]:
        """Paths of head and colliders."""
        return [HEAD, *(mesh.path for mesh in self.cache.colliders)]

    def shape(self, path: str) -> tuple[int, ...] | None:
        """Shape that an attribute's value must have, if the topology says so."""
        return self._shapes.get(path)

    @property
    def file(self) -> FrameFile | None:
        """The middle frame's file, unless it is missing or damaged."""
        file = self._read(self.frame)
        return file if isinstance(file, FrameFile) else None

    @property
    def fault(self) -> str:
        """Why there is no file."""
        file = self._read(self.frame)
        return file if isinstance(file, str) else ""

    def values(self) -> list[tuple[str, np.ndarray]]:
        """Paths and values of the middle frame's file."""
        return sorted(self.file.values.items()) if self.file else []

    def all_values(self) -> list[tuple[str, np.ndarray]]:
        """The same at all its moments."""
        later = self.file.later.values() if self.file else []
        return self.values() + [entry for moment in later for entry in sorted(moment.items())]

    def moments(self, prim: str, name: str) -> list[tuple[float, np.ndarray]]:
        """Times and values of the middle frame's moments, as far as each is there, has its shape and is finite."""
        path = f"{prim}.{name}"
        if self.file is None:
            return []
        found = [(float(self.frame), self.file.values), *sorted(self.file.later.items())]
        return [(time, values[path]) for time, values in found if self._is_sound(path, values.get(path))]

    def _is_sound(self, path: str, value: np.ndarray | None) -> bool:
        return value is not None and value.shape == self.shape(path) and bool(np.isfinite(value).all())

    def get(self, prim: str, name: str, offset: int = 0) -> np.ndarray | None:
        """A value of the frame `offset` from the middle, if it is there, has its shape and is finite."""
        frame = self.frame + offset
        if frame not in self.cache.frames:
            return None
        file = self._read(frame)
        path = f"{prim}.{name}"
        value = file.values.get(path) if isinstance(file, FrameFile) else None
        return value if self._is_sound(path, value) else None

    def collider(self, mesh: Mesh) -> Collider | None:
        """A deforming mesh as it is in the middle frame; worked out once a frame."""
        if self._colliders_of != self.frame:
            self._colliders, self._colliders_of = {}, self.frame
        if mesh.path not in self._colliders:
            points = self.get(mesh.path, "points")
            self._colliders[mesh.path] = (
                None if points is None else Collider(points.astype(float), mesh.triangles)
            )
        return self._colliders[mesh.path]

    def _read(self, frame: int) -> FrameFile | str:
        if frame not in self._files:
            try:
                self._files[frame] = read_frame(self.cache, frame)
            except Unreadable as error:
                self._files[frame] = str(error)
        return self._files[frame]
