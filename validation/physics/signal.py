"""Frequencies and decay rates in a free vibration."""

import numpy as np


def poles(times: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """The `count` strongest damped oscillations in evenly sampled real `values`: decay rate + i · angular frequency of each,
    1/s, by increasing frequency (matrix pencil: Hua & Sarkar 1990).
    """
    n = values.size
    rows = np.lib.stride_tricks.sliding_window_view(values, n // 3)
    right = np.linalg.svd(rows, full_matrices=False)[2]
    space = right[: 2 * count].T
    roots = np.linalg.eigvals(np.linalg.pinv(space[:-1]) @ space[1:])
    found = np.log(roots.astype(complex)) / (times[1] - times[0])
    found = found[found.imag > 0]
    found = found[np.argsort(found.imag)]
    return -found.real + 1j * found.imag
