"""The result of a read, written for `hairbake`.

`header.json` holds metadata and a list of arrays; `data.bin` holds their numbers in that order,
little-endian. `layers.json` tells where some of what was read lies, which its checksum is to leave out.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

TYPES: dict[str, np.dtype[Any]] = {
    "f32": np.dtype("<f4"),
    "f64": np.dtype("<f8"),
    "i32": np.dtype("<i4"),
    "u32": np.dtype("<u4"),
}

Array = NDArray[Any]
FloatArray = NDArray[np.floating[Any]]
IntArray = NDArray[np.integer[Any]]
Header = dict[str, Any]
Arrays = dict[str, tuple[str, Array]]
"""Type, a key of `TYPES`, and numbers of each array by its name."""


def write(folder: Path, header: Header, arrays: Arrays, layers: list[Header]) -> None:
    """Writes the header, the arrays and the layers."""
    listed = []
    with (folder / "data.bin").open("wb") as data:
        for name, (kind, numbers) in arrays.items():
            flat = np.ascontiguousarray(numbers, TYPES[kind]).reshape(-1)
            data.write(flat.data)
            listed.append({"name": name, "type": kind, "count": flat.size})
    (folder / "header.json").write_text(json.dumps({**header, "arrays": listed}))
    (folder / "layers.json").write_text(json.dumps(layers))


def write_errors(folder: Path, errors: list[InputError]) -> None:
    """Writes errors in place of the header."""
    (folder / "header.json").write_text(json.dumps({"errors": [asdict(error) for error in errors]}))
