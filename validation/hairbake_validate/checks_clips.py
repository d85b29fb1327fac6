"""Checks of the value clips: their metadata, and the values that they resolve to."""

from collections.abc import Callable, Iterator

import numpy as np

from .cache import GROOM, ROOT_LAYER, Cache, CacheError, read_frame
from .report import Check, Finding

TEMPLATE = "./hair.####.usdc"

CLIPS = Check(
    "clips",
    "value clips cover the frame range and a handle frame at both ends",
    "correct the clip metadata of /groom in hair.usda; docs/cache.md describes it",
)
RESOLUTION = Check(
    "resolution",
    "the composed stage resolves animated attributes to the values in the frame files",
    "remove stronger opinions on the attributes, or correct the clip metadata",
)


def clips(cache: Cache) -> Iterator[Finding]:
    """Checks clip metadata. USD holds or interpolates what clips do not cover, without a message."""
    clip = cache.clip
    if clip is None:
        yield Finding(CLIPS, message="no value clips", prim=GROOM)
        return
    expected = (cache.frames[0], cache.frames[-1], 1)
    if (clip.start, clip.end, clip.stride) != expected:
        yield Finding(
            CLIPS,
            message=f"clips run from {clip.start} to {clip.end} by {clip.stride}, "
            f"expected {expected[0]} to {expected[1]} by 1 (the range with its handles)",
        )
    if (clip.template, clip.prim_path) != (TEMPLATE, GROOM):
        message = f"template is {clip.template}, primPath {clip.prim_path}; expected {TEMPLATE}, {GROOM}"
        yield Finding(CLIPS, message=message)
    if cache.declared is None:
        yield Finding(CLIPS, message=f"clip manifest {clip.manifest!r} cannot be read")
    root = cache.stage.GetRootLayer()
    for path in cache.animated():
        if root.ListTimeSamplesForPath(path):
            # Time samples in the layer that holds the clips are stronger.
            yield Finding(CLIPS, message=f"{ROOT_LAYER} holds time samples of {path}, which hide the clips")


def resolution(cache: Cache) -> Iterator[Finding]:
    """Compares stage and files at both handles, both ends and the middle, where both can be read."""
    if cache.clip is None or cache.declared is None:
        return
    frames = {cache.frames[0], cache.first, (cache.first + cache.last) // 2, cache.last, cache.frames[-1]}
    for frame in sorted(frame for frame in frames if cache.clip.start <= frame <= cache.clip.end):
        try:
            values = read_frame(cache, frame).values
        except CacheError:
            continue
        for path in sorted(set(values) & cache.declared):
            attribute = cache.stage.GetAttributeAtPath(path)
            resolved = np.array(attribute.Get(frame)) if attribute else None
            if resolved is None or not np.array_equal(resolved, values[path], equal_nan=True):
                message = f"{path} does not resolve to the value in the frame's file"
                yield Finding(RESOLUTION, message=message, frame=frame)


CLIP_CHECKS: dict[Check, Callable[[Cache], Iterator[Finding]]] = {CLIPS: clips, RESOLUTION: resolution}
"""The checks of the value clips and their functions, in the order of the report."""
