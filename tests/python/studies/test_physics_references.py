"""Reference solvers of the physics studies against published and closed-form results."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from hairbake.rods import GRAVITY
from physics import capstan, tension
from physics.reference import assembly, column, crossing, drape, impact, kirchhoff, modes, planar, stability
from physics.signal import poles

ELASTICA = {0.1: 0.012500, 1: 0.124562, 10: 1.066802, 100: 5.888105, 1000: 21.335440}
"""H/W of the heavy cantilever (Romero et al. 2021)."""


@pytest.mark.parametrize("gamma", ELASTICA)
def test_elastica_matches_published_values(gamma: float) -> None:
    x, y = planar.equilibrium(gamma).tip
    assert -y / x == pytest.approx(ELASTICA[gamma], abs=1e-6)


def test_friction_of_a_pressed_column_matches_published_values() -> None:
    shortening = np.array([0.01, 0.04, 0.10, 0.16, 0.25, 0.31])
    published = [0.0449, 0.0919, 0.1528, 0.2043, 0.2807, 0.3361]
    assert column.friction(shortening) == pytest.approx(published, abs=6e-5)


@pytest.mark.parametrize("mu", [0.3, 1.0])
def test_tensions_of_a_strand_over_a_cylinder_match_theory(mu: float) -> None:
    rod = capstan.strand(mu, 3.0, 0.0).rod
    exact = drape.drape(
        stiffness=rod.bending[0],
        weight=rod.line_density * GRAVITY,
        radius=capstan.RADIUS,
        mu=mu,
        hangs=capstan.HANGS,
        lies_to=1.37,
        spans=0.14,
        spacing=3.4e-3,
    )
    read = tension.tensions(exact.points, replace(rod, length=exact.length), capstan.RADIUS)
    assert read.hanging == pytest.approx(exact.hanging, rel=1e-3)
    assert read.span == pytest.approx(exact.span, rel=2e-3)
    assert read.theory == pytest.approx(exact.span, rel=2e-3)
    smoother = replace(rod, length=exact.length, friction=0.97 * mu)
    slippery = tension.tensions(exact.points, smoother, capstan.RADIUS)
    assert slippery.theory < 0.99 * exact.span


def test_drag_along_a_rod_is_half_of_that_across() -> None:
    # A weightless soft rod trails along a strong wind: its tension is half the drag across.
    shape = planar.equilibrium(1e-6, planar.DOWN, wind=3000.0)
    angle, _, force, *_ = shape.at(np.array(0.3))
    assert angle == pytest.approx(0.0, abs=1e-3)
    assert force == pytest.approx(0.5 * 3000.0 * 0.7, rel=1e-3)


def test_thin_ribbons_buckle_at_prandtls_weight() -> None:
    assert stability.critical_weight(1e-4, 1e-4) == pytest.approx(12.85e-4, rel=1e-3)


def test_natural_arc_and_straight_hanging_rod_are_stable() -> None:
    arc = planar.equilibrium(1e-9, planar.DOWN, 3.0)
    assert stability.margin(arc, 1e-9, 3.0, 1.0, 0.5) > 0.1
    assert stability.margin(planar.equilibrium(50.0, planar.DOWN), 50.0, 0.0, 1.0, 0.5) > 0.1


def test_critical_curvature_of_heavy_rods_grows_as_cube_root_of_weight() -> None:
    # Only the last stretch of length (EI/ρSg)^⅓ matters: the critical natural curvature grows as Γ^⅓.
    for gamma in (300.0, 600.0):
        critical = 1.6112 * gamma ** (1 / 3)
        below, above = (
            stability.margin(planar.equilibrium(gamma, planar.DOWN, k), gamma, k, 1.0, 2 / 3)
            for k in (0.995 * critical, 1.005 * critical)
        )
        assert below > 0 > above


def test_frequencies_of_straight_and_twisted_rods_match_textbook_values() -> None:
    roots = np.array([1.87510407, 4.69409113, 7.85475744])
    assert modes.frequencies(6)[::2] == pytest.approx(roots**2, rel=1e-7)
    # A ribbon has the frequencies of both directions.
    assert modes.frequencies(3, ratio=4.0) == pytest.approx(
        [roots[0] ** 2, 2 * roots[0] ** 2, roots[1] ** 2], rel=1e-7
    )
    # Twist does not change a round rod.
    assert modes.frequencies(6, turn=2.0) == pytest.approx(modes.frequencies(6), rel=1e-7)


def test_kirchhoff_rod_is_a_helix_without_weight_and_the_elastica_in_a_plane() -> None:
    natural = np.array([0.0, 8.0, 6.0])
    line = kirchhoff.hanging(natural, np.array([1.0, 1, 0.5]), np.zeros(3), np.eye(3))
    # Pitch over arc length is τ/|Ω|; after a whole turn the tangent is the same.
    turn = 2 * np.pi / 10.0
    at = np.array([np.interp(turn, np.linspace(0, 1, 1001), c) for c in line.T])
    assert at == pytest.approx(turn * 0.6 * natural / 10.0, abs=1e-5)
    sideways = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    tip = kirchhoff.hanging(np.zeros(3), np.ones(3), np.array([0.0, -10, 0]), sideways)[-1]
    assert tip[:2] == pytest.approx(planar.equilibrium(10.0).tip, abs=1e-6)


def test_small_swing_has_the_frequency_and_the_decay_of_its_mode() -> None:
    times = np.linspace(0.0, 4.0, 161)
    swing = planar.swing(
        planar.PlanarRod(1.0, 1.0, 1.0, damping=0.01, drag=0.2),
        gravity=0.0,
        angle=lambda s: 1e-3 * (2 * s - s**2),
        clamp=lambda _: (0.0, 0.0, 0.0),
        times=times,
        modes=7,
    )
    pole = poles(times, swing.tip[:, 1], 3)[0]
    omega = 1.87510407**2
    assert abs(pole) == pytest.approx(omega, rel=1e-4)
    assert pole.real == pytest.approx(0.5 * omega**2 * 0.01 + 0.1, rel=1e-3)


def test_poles_of_two_damped_oscillations() -> None:
    t = np.linspace(0.0, 3.0, 300)
    values = np.exp(-0.3 * t) * np.cos(7 * t) + 0.1 * np.exp(-1.0 * t) * np.sin(19 * t)
    assert poles(t, values, 2) == pytest.approx([0.3 + 7j, 1.0 + 19j], abs=1e-6)


def crossed(weight: float, stiffness: float, lower_stiffness: float, height: float) -> crossing.Crossing:
    """A rod of length 1 at a `height`, across one of length ½ at three quarters of both, 0.01 apart."""
    lower = crossing.RoundRod(np.zeros(3), np.array([1.0, 0, 0]), 0.5, lower_stiffness, weight)
    root = np.array([0.375, height, -0.75])
    upper = crossing.RoundRod(root, np.array([0, 0, 1.0]), 1.0, stiffness, weight)
    return crossing.rest(lower, upper, lambda _: 0.01, (0.375, 0.75))


def test_force_between_crossed_rods_is_that_of_beams() -> None:
    weight = 1e-4

    def sag(x: float, length: float, stiffness: float) -> float:
        """Deflection of a heavy cantilever."""
        return weight * x**2 * (6 * length**2 - 4 * length * x + x**2) / (24 * stiffness)

    # Drawn at the distance that they keep: both contact points sag alike.
    missing = sag(0.75, 1.0, 1.0) - sag(0.375, 0.5, 3.0)
    force = missing / (0.75**3 / 3 + 0.375**3 / 9)
    assert crossed(weight, 1.0, 3.0, 0.01).force == pytest.approx(force, rel=1e-5)


def test_rod_that_just_touches_another_is_the_elastica() -> None:
    shape = planar.equilibrium(1.0)
    x, y = shape.at(np.linspace(0.5, 1.0, 5001))[4:]

    def clearance(height: float) -> float:
        """Least distance from the lower rod, which is stiff, of the free upper one, less 0.01."""
        return float(np.hypot(x - 0.75, y + height).min()) - 0.01

    across = -float(np.interp(0.75, x, y))
    height = brentq(clearance, across, across + 0.1)
    touching = crossed(1.0, 1.0, 1e8, height - 1e-6)
    assert 0 < touching.force < 1e-3
    tip = touching.upper.at(np.array([1.0]))[0] - [0.375, height, -0.75]
    assert [tip[2], tip[1]] == pytest.approx(shape.tip, abs=1e-5)


def test_crossed_rods_lie_at_the_distance_along_their_common_normal() -> None:
    found = crossed(3.0, 1.0, 5.0, 0.1)
    one, other = (part.at(np.array([part.contact]))[0] for part in (found.lower, found.upper))
    tangents = [
        part.at(np.array([part.contact + 1e-6]))[0] - part.at(np.array([part.contact - 1e-6]))[0]
        for part in (found.lower, found.upper)
    ]
    apart = other - one
    assert np.linalg.norm(apart) == pytest.approx(0.01, rel=1e-6)
    assert [apart @ t for t in tangents] == pytest.approx([0.0, 0.0], abs=1e-11)
    assert np.cross(apart, found.upper.force) == pytest.approx(np.zeros(3), abs=1e-8)
    assert found.lower.force == pytest.approx(-found.upper.force)


def test_modes_of_a_cantilever_match_textbook_values() -> None:
    found = impact.Modes.of(impact.Cantilever(2.0, 3.0, 5.0, 0.0, 2.0), 30)
    roots = np.array([1.87510407, 4.69409113, 7.85475744])
    assert found.frequency[:3] == pytest.approx(roots**2 * np.sqrt(3.0 / 80.0), rel=1e-8)
    # Of unit mean square the tips are at 2, and the mean is 0.7830, 0.4339, 0.2544 (Blevins 1979).
    assert np.abs(found.at_tip) == pytest.approx(2 / np.sqrt(10.0), rel=1e-9)
    assert found.mean[:3] * np.sqrt(10.0) == pytest.approx([0.7830, 0.4339, 0.2544], abs=1e-4)
    # All of them add up to the deflection under a force at the tip, F L³/3EI.
    assert (found.at_tip**2 / found.frequency**2).sum() == pytest.approx(8.0 / 9.0, rel=1e-5)


def crossed_cantilevers(damping: float, gap: float, seconds: float, step: float, modes: int) -> impact.Swing:
    """Cantilevers of lengths 1 and ½ that cross at three quarters, of unit stiffness and density."""
    upper = impact.Cantilever(1.0, 1.0, 1.0, damping, 0.75)
    lower = impact.Cantilever(0.5, 1.0, 1.0, damping, 0.375)
    times = np.linspace(0.0, seconds, 101)
    return impact.swing((upper, lower), gap, 1.0, times, step=step, modes=modes)


def test_cantilevers_come_to_rest_on_each_other_as_beams_do() -> None:
    def sag(x: float, length: float) -> float:
        """Deflection of a heavy cantilever."""
        return x**2 * (6 * length**2 - 4 * length * x + x**2) / 24

    found = crossed_cantilevers(0.2, 0.01, 20.0, 1e-3, 24)
    force = (sag(0.75, 1.0) - sag(0.375, 0.5) - 0.01) / ((0.75**3 + 0.375**3) / 3)
    tip = sag(1.0, 1.0) - force * 0.75**2 * (3 - 0.75) / 6
    assert found.upper[-1] == pytest.approx(-tip, rel=1e-3)
    assert found.gap[-1] == pytest.approx(0.0, abs=1e-4)


def test_cantilevers_that_meet_lose_energy_and_those_that_do_not_keep_it() -> None:
    free = crossed_cantilevers(0.0, 1.0, 2.0, 1e-3, 12)
    assert free.touched == np.inf
    assert np.abs(free.energy).max() < 1e-12 and free.kinetic.max() > 1e-3
    met = crossed_cantilevers(0.0, 0.01, 2.0, 1e-4, 12)
    assert met.touched < 1.0 and met.gap.min() > -1e-5
    assert np.diff(met.energy).max() < 1e-9 and met.energy[-1] < -0.1 * met.kinetic.max()


def test_layer_without_pressure_at_rest_has_the_height_of_the_closed_form() -> None:
    # With φ0 = 0: 3/2 M^(2/3) (K/g)^(1/3) / ρ.
    height = assembly.layer_height(3.0, 1300.0, 0.0, 4e5, 9.81)
    assert height == pytest.approx(1.5 * 3.0 ** (2 / 3) * (4e5 / 9.81) ** (1 / 3) / 1300.0, rel=1e-12)
    # Of stiff hair it is that as drawn; softer, the sum of its slices.
    assert assembly.layer_height(3.0, 1300.0, 0.02, 1e12, 9.81) == pytest.approx(3.0 / 26.0, rel=1e-4)
    masses = (np.arange(20000) + 0.5) * 3.0 / 20000
    fraction = np.cbrt(9.81 * masses / 4e5 + 0.02**3)
    slices = 3.0 / 20000 / (1300.0 * fraction)
    assert assembly.layer_height(3.0, 1300.0, 0.02, 4e5, 9.81) == pytest.approx(slices.sum(), rel=1e-6)
    assert assembly.pressure(fraction, 0.02, 4e5) == pytest.approx(9.81 * masses, rel=1e-9)


def test_volume_fraction_of_a_lattice_of_strands() -> None:
    places = (np.arange(16) + 0.5) * 0.005 - 0.04
    line = np.linspace(-0.05, 0.05, 41)[:, None] * [1.0, 0.0, 0.0]
    strands = [line + [0.0, y, z] for y in places for z in places]
    middle = np.array([[0.001, 0.002, -0.001], [0.0, -0.04, 0.0]])
    fraction = assembly.Fibres.of(strands, 1e-6).around(middle, 0.01)
    # Half of it at an edge.
    assert fraction == pytest.approx([0.04, 0.02], rel=1e-3)


def test_friction_bound_adds_cohesion_to_the_load() -> None:
    assert assembly.friction_bound(0.3, 8e-5, 0.0, 0.1) == pytest.approx(0.03)
    assert assembly.friction_bound(0.3, 1 / (3 * np.pi), 2.0, 0.0) == pytest.approx(0.6)
