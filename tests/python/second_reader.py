"""A second oracle: LightUSD, which shares no code with Pixar's library, reads what Pixar's library reads."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lightusd
import numpy as np
from pxr import Sdf


def assert_same_in_both(folder: Path) -> int:
    """Compares every value of every crate file in a folder; returns how many there are."""
    return sum(assert_same_layer(file) for file in sorted(folder.glob("*.usdc")))


def assert_same_layer(file: Path) -> int:
    """Compares every value of a file; returns how many there are."""
    count = 0
    layer, stage = Sdf.Layer.FindOrOpen(str(file)), lightusd.load(str(file))
    assert not stage.warnings(), (file, stage.warnings())
    for spec in attributes(layer):
        path = spec.path
        other = stage.prim_at(str(path.GetPrimPath())).attribute(spec.name)
        assert other.type_name == str(spec.typeName), (file, path, other.type_name)
        times = layer.ListTimeSamplesForPath(path)
        assert list(other.timesamples.times if times else []) == times, (file, path)
        for time in times:
            assert_equal(layer.QueryTimeSample(path, time), other.get(time), f"{file} {path} {time}")
        if spec.default is not None:
            assert_equal(spec.default, other.get(), f"{file} {path}")
        count += len(times) + (spec.default is not None)
    return count


def attributes(layer: Sdf.Layer) -> Iterator[Sdf.AttributeSpec]:
    """All attributes of a layer that have values."""
    found: list[Sdf.AttributeSpec] = []

    def visit(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.AttributeSpec):
            found.append(spec)

    layer.Traverse("/", visit)
    for spec in found:
        if spec.default is not None or layer.ListTimeSamplesForPath(spec.path):
            yield spec


def assert_equal(expected: Any, found: Any, where: str) -> None:
    """Compares a value as both libraries hold it."""
    if isinstance(expected, str | bool):
        assert str(found) == str(expected), (where, expected, found)
        return
    wanted, read = np.array(expected), np.asarray(lightusd.asarray(found))
    assert wanted.size == read.size and np.array_equal(wanted.ravel(), read.ravel()), where
