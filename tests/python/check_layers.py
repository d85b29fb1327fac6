"""Opens pairs of a crate and a text file that should say the same, and saves them again.

Usage: check_layers.py FOLDER; expected.json there holds, by file, the values of attributes of /arrays.
Exits non-zero with the first difference.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Sdf


def check(folder: Path, name: str, arrays: dict) -> None:
    crate = Sdf.Layer.FindOrOpen(str(folder / f"{name}.usdc"))
    text = Sdf.Layer.FindOrOpen(str(folder / f"{name}.usda"))
    assert crate.GetFileFormat().formatId == "usdc"
    said = crate.ExportToString()
    assert said == text.ExportToString(), name

    for attribute, expected in arrays.items():
        found = np.array(crate.GetAttributeAtPath(f"/arrays.{attribute}").default)
        # By value and by sign, so that -0 is not taken for 0.
        expected = np.array(expected, dtype=found.dtype).reshape(found.shape)
        np.testing.assert_array_equal(found, expected, err_msg=f"{name} {attribute}")
        if found.dtype.kind == "f":
            np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))

    for suffix in ["usdc", "usda"]:
        copy = folder / "resaved" / f"{name}.{suffix}"
        assert crate.Export(str(copy))
        assert Sdf.Layer.OpenAsAnonymous(str(copy)).ExportToString() == said, copy

    # Edited and saved in place, which rewrites only what changed.
    crate.customLayerData = {**crate.customLayerData, "edited": True}
    assert crate.Save()
    edited = Sdf.Layer.OpenAsAnonymous(str(folder / f"{name}.usdc"))
    assert edited.customLayerData["edited"] and len(edited.rootPrims) == len(text.rootPrims)


def main() -> None:
    folder = Path(sys.argv[1])
    cases = json.loads((folder / "expected.json").read_text())
    assert cases
    for name, arrays in cases.items():
        check(folder, name, arrays)


if __name__ == "__main__":
    main()
