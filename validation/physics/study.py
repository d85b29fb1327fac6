"""What a study hands to the page: rows of a table of errors, and plots."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMES = ("backward-euler", "bdf2")
"""Time schemes of hairbake (`settings.scheme`)."""

AT_REST = {"fps": 1.0, "substeps": 1, "preroll": 60.0, "settings": {"scheme": SCHEMES[0]}}
"""How a scene is made to find an equilibrium: 60 steps of a second, each of which backward Euler damps to a fraction 1/ωh of all
that swings at ω.
"""


@dataclass(frozen=True)
class Row:
    """One line of the table of errors."""

    what: str
    expected: float | str
    measured: float | str
    error: float
    goal: float | None
    """Largest error that passes; None: told for information."""

    @property
    def passed(self) -> bool:
        """Whether the goal is met. A NaN meets none."""
        return self.goal is None or self.error <= self.goal


@dataclass(frozen=True)
class Plot:
    """A plot, drawn when the page is made."""

    caption: str
    draw: Callable[["Axes"], None]


@dataclass(frozen=True)
class Study:
    """A finished study."""

    title: str
    text: str
    """What is compared with what, in HTML."""
    rows: list[Row]
    plots: list[Plot] = field(default_factory=list)


def relative(what: str, expected: float, measured: float, goal: float | None) -> Row:
    """A row whose error is relative to the expected value."""
    return Row(what, expected, measured, abs(measured / expected - 1), goal)


def order(sizes: list[float], errors: list[float]) -> float:
    """Slope of log(error) against log(size), least squares."""
    import numpy as np

    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
