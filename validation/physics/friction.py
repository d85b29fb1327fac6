"""Dry friction: a strand that sticks to a plate until it slips, and one that lies across a slope."""

from collections.abc import Sequence

import numpy as np

from .reference import column
from .scene import GRAVITY, Hairbake, Rod, Scene, Strand, quaternion, straight
from .study import SCHEMES, Plot, Row, Study, relative

DOWN = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
"""Clamp straight down."""
ALONG_Z = (1.0, 0.0, 0.0, 0.0)
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
THICKNESS = 5e-4
"""Distance kept from the plate, m."""
PLATE = {
    "name": "plate",
    "shape": {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]},
    "thickness_m": THICKNESS,
}

THRESHOLDS = {0.01: 0.0449, 0.04: 0.0919, 0.10: 0.1528, 0.16: 0.2043, 0.25: 0.2807, 0.31: 0.3361}
"""|Ft/Fn| under the tip by the shortening, in L."""
PRESSED = 1e-3
"""Shortening, in L, from which on a tip surely presses."""
SLIPPED = 1e-4
"""A tip that has moved this far, in L, has slipped."""


def ramp(t: float, start: float, end: float) -> float:
    """0 before `start`, 1 after `end`, linear between."""
    return min(max((t - start) / (end - start), 0.0), 1.0)


def stick_slip(
    hairbake: Hairbake, shortenings: Sequence[float] = tuple(THRESHOLDS), steps=600, nodes=16
) -> Study:
    """A strand on a plate, pressed until its tip slips."""
    rod, most = Rod(), 1.15 * max(shortenings)
    fine = np.linspace(0.02, 1.0, 120) ** 2 * most
    theory = column.friction(fine)
    slips_at = [float(np.interp(np.sqrt(e), np.sqrt(fine), theory)) for e in shortenings]
    mus = [THRESHOLDS.get(e, mu) for e, mu in zip(shortenings, slips_at)]
    # Drawn well above the plate, so that all of the thickness is kept; it comes to touch at time 0.
    above = 4 * THICKNESS
    strands = []
    for i, mu in enumerate(mus):
        rod = Rod(friction=mu)
        strands.append(
            Strand(rod, straight(rod, (0, -1, 0), (0.0, rod.length + above, 2 * i * rod.length)), DOWN)
        )

    def lowered(t):
        return np.array(
            [0.0, -(above - THICKNESS) * ramp(t, -10, 0) - most * rod.length * ramp(t, 0, steps) ** 2, 0.0]
        ), UNTURNED

    # A breath from the side says where to buckle to; it is over before the first tip slips.
    breath = 1e-3 * rod.bending[0] / (rod.line_density * rod.length**3)
    over = steps * 0.5 * np.sqrt(min(shortenings) / most)
    scene = Scene(
        strands,
        frames=steps,
        fps=1.0,
        substeps=1,
        preroll=20,
        nodes=nodes,
        gravity=(0, 0, 0),
        force={"frames": [-30, 0.8 * over, over], "values": [[breath, 0, 0], [breath, 0, 0], [0, 0, 0]]},
        motion=lowered,
        colliders=[PLATE],
        settings={"scheme": SCHEMES[0]},
    )
    bake = hairbake.bake(scene)
    shortening = most * np.clip(bake.times / steps, 0, 1) ** 2
    rows, curves = [], []
    for e, known, mu, points in zip(shortenings, slips_at, mus, bake.points):
        rows.append(relative(f"|Ft/Fn| at ε = {e:g}, theory against published", THRESHOLDS[e], known, 2e-3))
        touching = int(np.argmax(shortening > PRESSED))
        moved = np.abs(points[:, -1, 0] - points[touching, -1, 0]) / rod.length
        slip = int(np.argmax(moved > SLIPPED))
        where = float(np.sqrt(shortening[slip] * shortening[slip - 1])) if slip else float("nan")
        measured = float(np.interp(np.sqrt(where), np.sqrt(fine), theory))
        rows.append(relative(f"µ = {mu:g}: |Ft/Fn| where it slips", mu, measured, 0.01))
        sticking = (shortening > PRESSED) & (shortening < 0.98 * where)
        creep = float(moved[sticking].max()) if sticking.any() else float("nan")
        rows.append(Row(f"µ = {mu:g}: creep while it sticks, L", "0", creep, creep, 1e-9))
        curves.append((mu, moved))

    def draw_theory(axes):
        axes.plot(fine, theory, "k-", label="elastica")
        axes.plot([np.interp(m, theory, fine) for m in mus], mus, "o", markersize=3)
        for mu, moved in curves:
            slip = int(np.argmax(moved > SLIPPED))
            axes.plot(shortening[slip], mu, "x", label=f"µ = {mu:g} slips")
        axes.set(xlabel="clamp lowered by / L", ylabel="|Ft/Fn|")
        axes.legend(fontsize=7)

    def draw_moved(axes):
        for mu, moved in curves:
            axes.semilogy(shortening, np.maximum(moved, 1e-13), label=f"µ = {mu:g}")
        axes.set(xlabel="clamp lowered by / L", ylabel="tip moved / L")
        axes.legend(fontsize=7)

    text = f"""<p>A weightless strand is clamped straight above a plate, its tip free to turn on it, and the clamp is lowered slowly, by
ε L. It buckles; its tip stands still until |Ft/Fn| of the clamped-pinned elastica (boundary-value solver, 1e-8) is µ, then slips. hairbake: one backward Euler
step of a second each, {steps} steps. Creep is the largest motion of the tip up to 98 % of the ε at which it slips.</p>"""
    plots = [Plot("Where tips slip.", draw_theory), Plot("Tips stand still, then slip.", draw_moved)]
    return Study("Stick and slip", text, rows, plots)


def incline(hairbake: Hairbake, ratios=(0.9, 0.99, 1.01, 1.2, 2.0), substeps=16, nodes=16) -> Study:
    """A strand across a slope holds below the angle of friction and slides above it."""
    rod, frames, fps = Rod(friction=0.3), 20, 100.0
    rows, curves = [], []
    for ratio in ratios:
        slope = np.arctan(ratio * rod.friction)
        free = max(0.0, GRAVITY * (np.sin(slope) - rod.friction * np.cos(slope)))

        def motion(t, free=free):
            # Lowered onto the plate, then sliding as the strand should.
            return np.array([0.5 * free * max(t, 0.0) ** 2, -THICKNESS * ramp(t, -0.5, -0.2), 0.0]), UNTURNED

        scene = Scene(
            [Strand(rod, straight(rod, (0, 0, 1), (0, 2 * THICKNESS, 0)), ALONG_Z)],
            frames=frames,
            fps=fps,
            substeps=substeps,
            preroll=1.0,
            nodes=nodes,
            gravity=(0.0, -GRAVITY * np.cos(slope), 0.0),
            force={"frames": [-0.01, 0], "values": [[0, 0, 0], [GRAVITY * np.sin(slope), 0, 0]]},
            motion=motion,
            colliders=[PLATE],
        )
        bake = hairbake.bake(scene)
        away, times = bake.points[0][..., 0], bake.times
        if free == 0.0:
            moved = float(np.abs(away).max() / rod.length)
            rows.append(Row(f"slope of {ratio:g} µ: moved, L", "0", moved, moved, 1e-9))
        else:
            outer = bake.velocities[0][-1, away.shape[1] // 2 :, 0] / times[-1]
            rows.append(
                relative(
                    f"slope of {ratio:g} µ: acceleration, mean of the outer half", free, outer.mean(), 0.01
                )
            )
            worst = float(np.abs(outer / free - 1).max())
            rows.append(
                Row(
                    f"slope of {ratio:g} µ: the same, its worst point",
                    f"{free:.6g}",
                    f"{outer[np.abs(outer - free).argmax()]:.6g}",
                    worst,
                    None,
                )
            )
        curves.append((ratio, 0.5 * free * np.maximum(times, 0) ** 2, away[:, -1], times))

    def draw(axes):
        for ratio, exact, tip, times in curves:
            line = axes.plot(times, 1e3 * tip, "o", markersize=3, label=f"{ratio:g} µ")[0]
            axes.plot(times, 1e3 * exact, "-", linewidth=0.8, color=line.get_color())
        axes.set(xlabel="t, s", ylabel="tip, mm")
        axes.legend(fontsize=7)

    text = f"""<p>A 25 cm hair (µ = {rod.friction:g}) lies on a plate across the direction in which gravity is then tilted. A guide is clamped at its root, so
the clamp is moved by the exact law, s = ½ g (sin α − µ cos α) t²: a strand under the right friction stays straight and lies beside
it, any other one bends, for it is far too flexible (Γ = 130) to be dragged along. Told: how much it moves below the angle of friction, and
above it the acceleration of its outer half.</p>"""
    return Study("A strand on a slope", text, rows, [Plot("Lines: theory; dots: tips.", draw)])
