"""Caches as arrays of NumPy, read without USD."""

import io
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .program import run

Array = NDArray[Any]
FloatArray = NDArray[np.floating[Any]]
IntArray = NDArray[np.integer[Any]]
CurvesName = Literal["hair", "guides"]
Frames = int | Iterable[int] | None
"""One frame; several; None for all of the cache."""


@dataclass(frozen=True)
class Cache:
    """A cache on disk, finished or not. Arrays are in its unit and axes, in world space."""

    directory: Path

    def __post_init__(self) -> None:
        """Reads what the cache holds.

        Raises:
            HairbakeError: there is no cache, or it is damaged.
        """
        _ = self.description

    @cached_property
    def description(self) -> dict[str, Any]:
        """What the cache holds, as `hairbake read` prints it."""
        description: dict[str, Any] = json.loads(run("read", self.directory))
        return description

    @property
    def frames(self) -> list[int]:
        """Frames with a file, handle frames included."""
        return list(self.description["frames"])

    @property
    def shot(self) -> tuple[int, int]:
        """First and last frame of the shot, without handle frames."""
        first, last = self.description["shot"]
        return first, last

    @property
    def fps(self) -> float:
        """Frames per second."""
        return float(self.description["fps"])

    @property
    def metres_per_unit(self) -> float:
        """Metres per unit."""
        return float(self.description["metres_per_unit"])

    @property
    def up_axis(self) -> str:
        """`Y` or `Z`."""
        return str(self.description["up_axis"])

    @property
    def groups(self) -> dict[int, str]:
        """Names of the groups, by their number."""
        return {int(number): name for number, name in self.description["groups"].items()}

    @property
    def has_hair(self) -> bool:
        """Whether the cache has render strands."""
        return self.description["hair"] is not None

    @property
    def has_guides(self) -> bool:
        """Whether the cache has guides."""
        return self.description["guides"] is not None

    def curves(self, name: CurvesName | None = None) -> "Curves":
        """The render strands or the guides; by default strands if there are any.

        Raises:
            KeyError: the cache does not have them.
        """
        name = name or ("hair" if self.has_hair else "guides")
        if self.description[name] is None:
            raise KeyError(f"{self.directory} has no {name}")
        return Curves(self, name)

    @property
    def hair(self) -> "Curves":
        """The render strands."""
        return self.curves("hair")

    @property
    def guides(self) -> "Curves":
        """The guides."""
        return self.curves("guides")

    def points(self, frames: Frames = None) -> FloatArray:
        """Points of the render strands, or of the guides if there are none; see [`Curves.points`]."""
        return self.curves().points(frames)

    def head(self, frames: Frames = None) -> FloatArray:
        """Transforms of the head, rest space to world, for column vectors, `4 × 4` or `frames × 4 × 4`."""
        return self.moving("head", frames)

    @cached_property
    def record(self) -> dict[str, Any]:
        """The record of the bake, `manifest.json`.

        Raises:
            FileNotFoundError: the bake is not finished.
        """
        record: dict[str, Any] = json.loads((self.directory / "manifest.json").read_text(encoding="utf-8"))
        return record

    def figure(self, name: str) -> FloatArray:
        """A figure of every finished frame, such as `penetration_m`."""
        return np.array([frame["figures"][name] for frame in self.record["frames"]])

    def fixed(self, name: str) -> Array:
        """An array that does not move, by its full name, such as `hair.widths`."""
        return load(run("read", self.directory, name))

    def moving(self, name: str, frames: Frames) -> Array:
        """An array that moves, by its full name, such as `hair.points`.

        Frames come first, unless `frames` is one.
        """
        if frames is None:
            return load(run("read", self.directory, name))
        chosen = [frames] if isinstance(frames, int) else list(frames)
        array = load(run("read", self.directory, name, f"--frames={','.join(map(str, chosen))}"))
        return array[0] if isinstance(frames, int) else array


@dataclass(frozen=True)
class Curves:
    """The render strands or the guides of a cache: `n` curves with `N` points in total."""

    cache: Cache
    name: CurvesName

    @cached_property
    def counts(self) -> IntArray:
        """Number of points of each curve, `n`."""
        return self.cache.fixed(f"{self.name}.counts")

    @cached_property
    def rest(self) -> FloatArray:
        """Points in rest space, `N × 3`."""
        return self.cache.fixed(f"{self.name}.rest")

    @cached_property
    def widths(self) -> FloatArray:
        """Diameter at each point, `N`."""
        return self.cache.fixed(f"{self.name}.widths")

    @cached_property
    def ids(self) -> IntArray:
        """Id of each curve, `n`."""
        return self.cache.fixed(f"{self.name}.ids")

    @cached_property
    def groups(self) -> IntArray:
        """Group of each curve, `n`; [`Cache.groups`] has the names."""
        return self.cache.fixed(f"{self.name}.groups")

    @cached_property
    def root_uv(self) -> FloatArray:
        """Texture coordinate of each root, `n × 2`."""
        return self.cache.fixed(f"{self.name}.root_uv")

    @cached_property
    def arc(self) -> FloatArray:
        """Arc length of the rod from the root to each point, `N`, units, the same at all times; of guides."""
        return self.cache.fixed(f"{self.name}.arc")

    @cached_property
    def loose(self) -> IntArray:
        """1 for each curve whose root nothing holds, `n`; in caches that have such."""
        return self.cache.fixed(f"{self.name}.loose")

    @cached_property
    def closest_guides(self) -> IntArray:
        """Ids of the guides that each render strand follows, `n × 3`."""
        return self.cache.fixed(f"{self.name}.closest_guides")

    @cached_property
    def guide_weights(self) -> FloatArray:
        """Weights of these guides, `n × 3`."""
        return self.cache.fixed(f"{self.name}.guide_weights")

    @cached_property
    def tie_guides(self) -> IntArray:
        """Id of the guide that each of `tie_forces` acts on."""
        return self.cache.fixed(f"{self.name}.tie_guides")

    @cached_property
    def tie_numbers(self) -> IntArray:
        """Number of the tie of each of `tie_forces` in the animation, from 0."""
        return self.cache.fixed(f"{self.name}.tie_numbers")

    def points(self, frames: Frames = None) -> FloatArray:
        """Points, `N × 3` of one frame or `frames × N × 3`."""
        return self.cache.moving(f"{self.name}.points", frames)

    def velocities(self, frames: Frames = None) -> FloatArray:
        """Velocities, units per second, `N × 3` of one frame or `frames × N × 3`."""
        return self.cache.moving(f"{self.name}.velocities", frames)

    def accelerations(self, frames: Frames = None) -> FloatArray:
        """Accelerations, units per second squared, in caches baked with `accelerations`."""
        return self.cache.moving(f"{self.name}.accelerations", frames)

    def levels(self, frames: Frames = None) -> IntArray:
        """Level of the wisp of each curve, 0 for the coarsest, in adaptive caches; `n` or `frames × n`."""
        return self.cache.moving(f"{self.name}.levels", frames)

    def normals(self, frames: Frames = None) -> FloatArray:
        """First axis of the section at each point of guides, shaped as `points`, in caches with `normals`."""
        return self.cache.moving(f"{self.name}.normals", frames)

    def clamp_forces(self, frames: Frames = None) -> FloatArray:
        """Force of the clamp on each guide, N, `n × 3` or `frames × n × 3`, in caches with `reactions`."""
        return self.cache.moving(f"{self.name}.clamp_forces", frames)

    def clamp_moments(self, frames: Frames = None) -> FloatArray:
        """Moment of the clamp on each guide about its root, N·m, shaped as `clamp_forces`."""
        return self.cache.moving(f"{self.name}.clamp_moments", frames)

    def tie_forces(self, frames: Frames = None) -> FloatArray:
        """Force of each tie on a guide, N, by `tie_guides` and `tie_numbers`."""
        return self.cache.moving(f"{self.name}.tie_forces", frames)

    def tie_moments(self, frames: Frames = None) -> FloatArray:
        """Moment of each tie on a guide about the place that it holds, N·m, shaped as `tie_forces`."""
        return self.cache.moving(f"{self.name}.tie_moments", frames)

    def split(self, array: Array) -> list[Array]:
        """Parts of an array over points, one for each curve: views with as many points as it has."""
        axis = -2 if array.ndim > 1 else -1
        return np.split(array, np.cumsum(self.counts)[:-1], axis=axis)


def load(data: bytes) -> Array:
    """The array of an `.npy` file."""
    array: Array = np.load(io.BytesIO(data), allow_pickle=False)
    return array
