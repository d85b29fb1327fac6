"""The studies by name, in the order of the page."""

from collections.abc import Callable

from . import (
    air,
    buckling,
    cantilever,
    capstan,
    energy,
    friction,
    helix,
    impact,
    layer,
    locks,
    ropes,
    strand_friction,
    symmetries,
    tufts,
    vibration,
    whip,
)
from .program import Hairbake
from .study import Study

STUDIES: dict[str, Callable[[Hairbake], Study]] = {
    "cantilever": cantilever.study,
    "bend-twist": buckling.bend_twist,
    "lateral-buckling": buckling.lateral,
    "helix": helix.study,
    "frequencies": vibration.frequencies,
    "damping": vibration.damping,
    "wind": air.study,
    "whip": whip.study,
    "energy": energy.study,
    "symmetries": symmetries.study,
    "stick-slip": friction.stick_slip,
    "incline": friction.incline,
    "capstan": capstan.study,
    "rope-on-rope": ropes.study,
    "strand-friction": strand_friction.study,
    "crossed-cantilevers": impact.study,
    "hair-layer": layer.study,
    "tufts": tufts.study,
    "locks": locks.study,
}
