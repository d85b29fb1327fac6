"""What this package hands to `hairbake`: `header.json` and, in the order in which it lists them, arrays as plain little-endian
numbers in `data.bin`.
"""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from .faults import Fault

TYPES = {"f32": np.dtype("<f4"), "f64": np.dtype("<f8"), "i32": np.dtype("<i4"), "u32": np.dtype("<u4")}


def write(folder: Path, header: dict, arrays: dict[str, tuple[str, np.ndarray]]) -> None:
    """Writes the header and the arrays, each a name with its type and its numbers."""
    listed = []
    with open(folder / "data.bin", "wb") as data:
        for name, (kind, numbers) in arrays.items():
            flat = np.ascontiguousarray(numbers, TYPES[kind]).reshape(-1)
            data.write(flat.data)
            listed.append({"name": name, "type": kind, "count": flat.size})
    (folder / "header.json").write_text(json.dumps({**header, "arrays": listed}))


def write_faults(folder: Path, faults: list[Fault]) -> None:
    """Writes what is wrong instead."""
    (folder / "header.json").write_text(json.dumps({"faults": [asdict(fault) for fault in faults]}))
