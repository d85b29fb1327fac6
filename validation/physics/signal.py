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


def strongest(times: np.ndarray, values: np.ndarray, count: int, frequency: float) -> complex:
    """Of the `count` oscillations of `poles` the one of largest amplitude among those within a tenth of `frequency`; NaN where
    there is none. The nearest would be the wrong one to ask for: weak oscillations that are but noise lie anywhere.
    """
    found = poles(times, values, count)
    waves = np.exp(np.outer(times - times[0], -found.real + 1j * found.imag))
    amplitudes = np.linalg.lstsq(np.hstack([waves.real, waves.imag]), values, rcond=None)[0]
    size = np.hypot(*amplitudes.reshape(2, -1))
    size[abs(found.imag - frequency) > 0.1 * frequency] = 0.0
    return complex(found[np.argmax(size)]) if size.any() else complex("nan+nanj")
