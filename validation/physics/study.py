"""The result of a study: rows of a table of errors, and plots."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMES = ("backward-euler", "bdf2", "four-step")
"""Time schemes of hairbake (`settings.scheme`); the last is the default."""

AT_REST: dict[str, Any] = {
    "fps": 1.0,
    "substeps": 1,
    "preroll": 60.0,
    "settings": {"scheme": SCHEMES[0]},
}
"""Arguments of a `Scene` that finds an equilibrium: 60 steps of a second.

Each backward Euler step h damps motion of frequency ω to a fraction 1/ωh."""


@dataclass(frozen=True)
class Row:
    """One line of the table of errors."""

    what: str
    expected: float | str
    measured: float | str
    error: float
    goal: float | None
    """Largest error that passes; None: for information."""

    @property
    def passed(self) -> bool:
        """True if the goal is met; NaN meets none."""
        return self.goal is None or self.error <= self.goal


@dataclass(frozen=True)
class Plot:
    """A plot, drawn when the page is written."""

    caption: str
    draw: Callable[["Axes"], None]


@dataclass(frozen=True)
class Study:
    """The result of a study."""

    title: str
    text: str
    """Setup and reference, in HTML."""
    rows: list[Row]
    plots: list[Plot] = field(default_factory=list)


def relative(what: str, expected: float, measured: float, goal: float | None) -> Row:
    """A row whose error is relative to the expected value."""
    return Row(what, expected, measured, abs(measured / expected - 1), goal)


def absolute(what: str, error: float, goal: float | None) -> Row:
    """A row of a quantity that is to be 0."""
    return Row(what, "0", error, abs(error), goal)


def order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Order of convergence: slope of log(error) against log(size), by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
