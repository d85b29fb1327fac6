"""Large motion: a whipped hair against an independent integrator, energy, and the symmetries of mechanics."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from .reference import planar
from .scene import GRAVITY, HORIZONTAL, ISOLATED_DRAG, Hairbake, Rod, Scene, Strand, quaternion, straight
from .study import SCHEMES, Plot, Row, Study, order

FPS = 25.0
DOWN = quaternion(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
"""Clamp straight down."""
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])


def shake(t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration along x of a clamp shaken by ±5 cm at 2.5 Hz, from rest: the swing is brought up
    in 0.2 s.
    """
    if t <= 0:
        return 0.0, 0.0, 0.0
    w, rise = 2 * np.pi * 2.5, 0.2
    u = min(t / rise, 1.0)
    r = np.array([u**3 * (10 - 15 * u + 6 * u * u), 30 * (u * (1 - u)) ** 2, 60 * u * (1 - u) * (1 - 2 * u)])
    r /= [1.0, rise, rise**2]
    s, c = np.sin(w * t), w * np.cos(w * t)
    return 0.05 * r[0] * s, 0.05 * (r[1] * s + r[0] * c), 0.05 * (r[2] * s + 2 * r[1] * c - r[0] * w * w * s)


def shaken(t: float) -> tuple[np.ndarray, np.ndarray]:
    """The same as a motion of the clamp."""
    return np.array([shake(t)[0], 0.0, 0.0]), UNTURNED


def whip_scene(substeps: int, scheme: str, nodes: int, frames: int = 25) -> Scene:
    """A hair with its damping and its drag, hanging, then shaken."""
    rod = Rod(damping=0.005, drag=1.0)
    strand = Strand(rod, straight(rod, (0, -1, 0)), DOWN)
    return Scene(
        [strand],
        frames=frames,
        fps=FPS,
        substeps=substeps,
        nodes=nodes,
        motion=shaken,
        settings={"scheme": scheme},
    )


def whip(hairbake: Hairbake, substeps=(1, 2, 4, 8, 16, 32, 64, 128), nodes: int = 16) -> Study:
    """Error of a whipped hair's tip against the step."""
    rod = Rod()
    times = np.arange(26) / FPS
    exact = planar.swing(
        length=rod.length,
        bending=rod.bending[0],
        line_density=rod.line_density,
        gravity=GRAVITY,
        angle=lambda s: planar.DOWN + 0 * s,
        clamp=shake,
        times=times,
        damping=0.005,
        drag=ISOLATED_DRAG,
        modes=11,
    ).tip

    def error(n: int, scheme: str, nodes: int) -> float:
        tip = hairbake.bake(whip_scene(n, scheme, nodes)).points[0][: len(times), -1, :2]
        return float(np.sqrt(((tip - exact) ** 2).sum(axis=1).mean()) / rod.length)

    steps = [1 / (FPS * n) for n in substeps]
    errors = {scheme: [error(n, scheme, nodes) for n in substeps] for scheme in SCHEMES}
    rows = []
    for scheme, wanted in zip(SCHEMES, (1, 2)):
        rows += [
            Row(f"{scheme}, {n} steps a frame: tip, r.m.s.", "0", e, e, None)
            for n, e in zip(substeps, errors[scheme])
        ]
        fit = [i for i, n in enumerate(substeps) if 4 <= n <= 16]
        slope = order([steps[i] for i in fit], [errors[scheme][i] for i in fit])
        rows.append(
            Row(
                f"{scheme}: order in the step, 4 to 16 steps a frame",
                str(wanted),
                slope,
                max(0.0, wanted - slope),
                0.2,
            )
        )
    finest = errors[SCHEMES[1]][-1]
    rows.append(
        Row(f"bdf2, {substeps[-1]} steps a frame, {nodes} nodes: tip, r.m.s.", "0", finest, finest, 1e-4)
    )
    coarse = error(substeps[-1], SCHEMES[1], 8)
    rows.append(Row(f"bdf2, {substeps[-1]} steps a frame, 8 nodes: tip, r.m.s.", "0", coarse, coarse, 1e-3))

    def draw(axes):
        for scheme, series in errors.items():
            axes.loglog(steps, series, "o-", label=scheme)
        guide = np.array([steps[0], steps[-1]])
        axes.loglog(guide, 2.0 * guide, "k:", label="first order")
        axes.loglog(guide, 8.0 * guide**2, "k--", label="second order")
        axes.set(xlabel="step, s", ylabel="tip error, r.m.s. over 1 s / L")
        axes.legend()

    text = f"""<p>A 25 cm hair with the damping (5 ms) and the air drag of an isolated hair hangs at rest, then its clamp is shaken by ±5 cm at
2.5 Hz for a second, 25 frames; {nodes} nodes. Theory: Lagrange's equations of the planar rod, θ(s, t) polynomials of degree 11 in s,
Radau IIA of order 5 to 1e-8 in time. Error: root mean square over the frames of the tip's distance, in L. What is left at the smallest steps is the {nodes} nodes' own.</p>"""
    caption = "Refinement of the step: whipped hair against the independent integrator."
    return Study("A whipped hair", text, rows, [Plot(caption, draw)])


def energy_of(points: np.ndarray, velocities: np.ndarray, rod: Rod) -> np.ndarray:
    """Kinetic, weight's and bending energy, J, of every frame: by splines through the written points."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[0], axis=0), axis=1))])
    s *= rod.length / s[-1]

    def whole(values):
        return CubicSpline(s, values).integrate(0.0, rod.length)

    kinetic = [0.5 * rod.line_density * whole((v**2).sum(axis=1)) for v in velocities]
    weight = [rod.line_density * GRAVITY * whole(x[:, 1]) for x in points]
    fine = np.linspace(0.0, rod.length, 400)
    bending = [
        0.5 * rod.bending[0] * np.trapezoid((CubicSpline(s, x)(fine, 2) ** 2).sum(axis=1), fine)
        for x in points
    ]
    return np.array(kinetic) + np.array(weight) + np.array(bending)


def energy(hairbake: Hairbake, substeps=(4, 16, 64)) -> Study:
    """Energy of a free swing of large amplitude."""
    rod = Rod().weighing(3.0)
    rows, series = [], []
    for scheme in SCHEMES:
        for n in substeps:
            scene = Scene(
                [Strand(rod, straight(rod, (1, 0, 0)), HORIZONTAL)],
                frames=200,
                fps=100.0,
                substeps=n,
                nodes=16,
                settings={"scheme": scheme},
            )
            bake = hairbake.bake(scene)
            total = energy_of(bake.points[0], bake.velocities[0], rod)
            scale = rod.line_density * GRAVITY * rod.length**2
            drift = (total - total[0]) / scale
            series.append((scheme, n, bake.times, drift))
            gained = float(max(drift.max(), 0.0))
            name = f"{scheme}, {100 * n} steps/s: energy after 2 s, in ρSgL²"
            rows.append(
                Row(
                    name,
                    "0",
                    float(drift[-1]),
                    abs(float(drift[-1])),
                    1e-3 if n == substeps[-1] and scheme == SCHEMES[1] else None,
                )
            )
            rows.append(Row(f"{scheme}, {100 * n} steps/s: most energy gained", "0", gained, gained, 2e-3))

    def draw(axes):
        for scheme, n, times, drift in series:
            axes.plot(times, drift, "-" if scheme == SCHEMES[1] else "--", label=f"{scheme}, {100 * n}/s")
        axes.set(xlabel="s", ylabel="energy − start, in ρSgL²")
        axes.legend(fontsize=7)

    text = """<p>A strand (Γ = 3, no damping, no air) let go from horizontal swings through large angles; 16 nodes. Energy: kinetic from the
velocities of the cache, weight's and bending from its points (splines), so read to a few 1e-4.</p>"""
    return Study(
        "Energy and its drift", text, rows, [Plot("Energy of a free swing, per scheme and step.", draw)]
    )


@dataclass(frozen=True)
class Turned:
    """A rigid motion of the whole world."""

    turn: Rotation
    shift: np.ndarray

    def strand(self, strand: Strand) -> Strand:
        """The strand drawn in the turned world; its clamp's frame with it."""
        w, x, y, z = strand.frame
        frame = quaternion((self.turn * Rotation.from_quat([x, y, z, w])).as_matrix())
        return replace(strand, points=self.turn.apply(strand.points), frame=frame)

    def scene(self, scene: Scene) -> Scene:
        """The scene in the turned world: strands, gravity, wind and motion."""

        def motion(t):
            place, (w, x, y, z) = scene.motion(t)
            q = (self.turn * Rotation.from_quat([x, y, z, w]) * self.turn.inv()).as_quat()
            return self.turn.apply(place) + self.shift, np.array([q[3], q[0], q[1], q[2]])

        return replace(
            scene,
            strands=[self.strand(s) for s in scene.strands],
            gravity=tuple(self.turn.apply(scene.gravity)),
            wind=None if scene.wind is None else tuple(self.turn.apply(scene.wind)),
            motion=motion,
        )


def swung(t: float) -> tuple[np.ndarray, np.ndarray]:
    """A clamp that is shaken along x and turns about a slanted axis."""
    q = Rotation.from_rotvec(0.8 * np.sin(2 * np.pi * 1.5 * t) * np.array([0.6, 0.64, 0.48])).as_quat()
    return np.array([0.05 * np.sin(2 * np.pi * 2.5 * t), 0.02 * np.sin(9 * t), 0.0]), np.array([q[3], *q[:3]])


def symmetries(hairbake: Hairbake, schemes=SCHEMES) -> Study:
    """Rigid motions of the world, and uniform motion."""
    rod = Rod(damping=0.005, drag=0.3)
    bent = np.stack(
        [
            0.2 * np.linspace(0, 1, 24),
            -0.1 * np.linspace(0, 1, 24) ** 2,
            0.03 * np.sin(np.linspace(0, 3, 24)),
        ],
        axis=1,
    )
    tangent = CubicSpline(np.linspace(0, 1, 24), bent)(0.0, 1)
    d3 = tangent / np.linalg.norm(tangent)
    d1 = np.cross([0.0, 1, 0], d3)
    d1 /= np.linalg.norm(d1)
    frame = quaternion(np.column_stack([d1, np.cross(d3, d1), d3]))
    rod = replace(rod, bending=(7.8e-9, 1.2e-8))
    rows = []
    for scheme in schemes:
        scene = Scene(
            [Strand(rod, bent, frame)],
            frames=24,
            fps=24.0,
            wind=(0.7, 0.1, -0.3),
            motion=swung,
            settings={"scheme": scheme},
        )
        here = hairbake.tip(scene)
        for name, turned in {
            "quarter turn": Turned(Rotation.from_rotvec([0, 0, np.pi / 2]), np.zeros(3)),
            "slanted turn and shift of 3 m": Turned(
                Rotation.from_rotvec([0.7, -1.9, 0.4]), np.array([1.0, 2, -2])
            ),
        }.items():
            there = hairbake.tip(turned.scene(scene))
            error = float(np.linalg.norm(turned.turn.apply(here) + turned.shift - there) / rod.length)
            rows.append(Row(f"equivariance, {name}, {scheme}: tip, in L", "0", error, error, 1e-9))
        error = uniform_motion(hairbake, scheme)
        rows.append(Row(f"clamp at 3 m/s, no gravity, {scheme}: tip moved, in L", "0", error, error, 1e-9))
    text = """<p>A bent elliptic strand on a clamp that is shaken and turned, in wind and weight, damped, for a second; then the same world turned and
shifted: the tip must turn and shift with it. And a clamp at constant velocity without weight or air: the strand must
stay as it was drawn. Tips are read to 1e-14 m by a second bake whose world has the tip at its origin.</p>"""
    return Study("Symmetries", text, rows)


def uniform_motion(hairbake: Hairbake, scheme: str) -> float:
    """How far the tip of a strand has moved against its clamp after a second at 3 m/s, in L."""
    velocity = np.array([1.0, 2.0, -2.0])
    rod = Rod()
    s = np.linspace(0, 1, 24)
    bent = np.stack([0.2 * s, -0.1 * s**2, 0.03 * np.sin(3 * s)], axis=1)
    scene = Scene(
        [Strand(rod, bent)],
        frames=24,
        fps=24.0,
        gravity=(0.0, 0.0, 0.0),
        motion=lambda t: (velocity * t, UNTURNED),
        settings={"scheme": scheme},
    )
    end = hairbake.tip(scene) - velocity * (hairbake.bake(scene).times[-1])
    still = hairbake.tip(replace(scene, motion=lambda t: (np.zeros(3), UNTURNED)), frame=0)
    return float(np.linalg.norm(end - still) / rod.length)
