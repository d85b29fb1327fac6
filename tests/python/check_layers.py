"""Opens pairs of a crate and a text file with equal content, compares them, and saves them again.

Usage: check_layers.py FOLDER. expected.json there holds, by file name, the values of attributes of /arrays.
Exits with an error at the first difference.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf


def check(folder: Path, name: str, arrays: dict[str, Any]) -> None:
    """Checks one pair of files."""
    crate = Sdf.Layer.FindOrOpen(str(folder / f"{name}.usdc"))
    text = Sdf.Layer.FindOrOpen(str(folder / f"{name}.usda"))
    assert crate.GetFileFormat().formatId == "usdc"
    content = crate.ExportToString()
    assert content == text.ExportToString(), name

    for attribute, values in arrays.items():
        found = np.array(crate.GetAttributeAtPath(f"/arrays.{attribute}").default)
        # By value and by sign: -0 differs from 0.
        expected = np.array(values, dtype=found.dtype).reshape(found.shape)
        np.testing.assert_array_equal(found, expected, err_msg=f"{name} {attribute}")
        if found.dtype.kind == "f":
            np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))

    for suffix in ["usdc", "usda"]:
        copy = folder / "resaved" / f"{name}.{suffix}"
        assert crate.Export(str(copy))
        assert Sdf.Layer.OpenAsAnonymous(str(copy)).ExportToString() == content, copy

    # Edited and saved in place, USD rewrites only what changed.
    crate.customLayerData = {**crate.customLayerData, "edited": True}
    assert crate.Save()
    edited = Sdf.Layer.OpenAsAnonymous(str(folder / f"{name}.usdc"))
    assert edited.customLayerData["edited"] and len(edited.rootPrims) == len(text.rootPrims)


def main() -> None:
    """Checks all pairs."""
    folder = Path(sys.argv[1])
    cases = json.loads((folder / "expected.json").read_text())
    assert cases
    for name, arrays in cases.items():
        check(folder, name, arrays)


if __name__ == "__main__":
    main()
