"""Figures of a whole cache, by the measures of the validator, with nothing exempt."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hairbake_validate import tolerances
from hairbake_validate.cache import GUIDES, HAIR, Cache
from hairbake_validate.checks_motion import speed_shares, unaccounted_jumps
from hairbake_validate.window import Reference, Window


@dataclass
class Measures:
    """What a cache holds over all frames."""

    glitches: int = 0
    """Points of a frame whose velocity their positions do not account for."""
    pops: int = 0
    """Render strands that jump there and back, summed over frames."""
    guide_depth: float = 0.0
    """Deepest guide point inside a collider, m."""
    hair_depth: float = 0.0
    """Deepest point of a render strand inside a collider, m."""


def measure(directory: Path) -> Measures:
    """Measures a cache; points that are inside a collider at rest count too."""
    cache = Cache(directory)
    reference = Reference.of(cache)
    reference.outside = {key: np.ones_like(outside) for key, outside in reference.outside.items()}
    window, found = Window(cache, reference), Measures()
    for frame in cache.frames:
        window.move_to(frame)
        for curves in cache.curves:
            shares = speed_shares(window, curves)
            found.glitches += 0 if shares is None else int((shares > 1).sum())
            jumps = unaccounted_jumps(window, curves) if curves.path == HAIR else None
            if jumps is not None:
                found.pops += int((np.maximum.reduceat(jumps, curves.starts) > tolerances.POP_M).sum())
        for mesh, at_first in reference.colliders:
            deepest = {
                path: float(depth.max()) * cache.metres_per_unit
                for path, depth in window.depths(mesh, at_first).items()
            }
            found.guide_depth = max(found.guide_depth, deepest.get(GUIDES, 0.0))
            found.hair_depth = max(found.hair_depth, deepest.get(HAIR, 0.0))
    return found
