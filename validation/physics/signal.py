"""Frequencies and decay rates of a free vibration."""

import numpy as np

from .arrays import ComplexArray, FloatArray


def poles(times: FloatArray, values: FloatArray, count: int) -> ComplexArray:
    """The `count` strongest damped oscillations in real `values`, by increasing frequency.

    Returns decay rate + i · angular frequency of each, 1/s, by the matrix pencil method (Hua and Sarkar
    1990). `times` are evenly spaced.
    """
    n = values.size
    rows = np.lib.stride_tricks.sliding_window_view(values, n // 3)
    right = np.linalg.svd(rows, full_matrices=False)[2]
    space = right[: 2 * count].T
    roots = np.linalg.eigvals(np.linalg.pinv(space[:-1]) @ space[1:])
    found: ComplexArray = np.log(roots.astype(complex)) / (times[1] - times[0])
    found = found[found.imag > 0]
    found = found[np.argsort(found.imag)]
    return -found.real + 1j * found.imag


def strongest(times: FloatArray, values: FloatArray, count: int, frequency: float) -> complex:
    """The oscillation of `poles` of largest amplitude within a tenth of `frequency`; NaN for none.

    The nearest one may be a weak oscillation that is noise.
    """
    found = poles(times, values, count)
    waves = np.exp(np.outer(times - times[0], -found.real + 1j * found.imag))
    amplitudes = np.linalg.lstsq(np.hstack([waves.real, waves.imag]), values, rcond=None)[0]
    size = np.hypot(*amplitudes.reshape(2, -1))
    size[abs(found.imag - frequency) > 0.1 * frequency] = 0.0
    return complex(found[np.argmax(size)]) if size.any() else complex("nan+nanj")
