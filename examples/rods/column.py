"""How tall can a mast be? It buckles under its own weight at Γ = ρSgL³/EI = 7.8373 (Greenhill 1881).

θ'' = −σ sin θ, with the angle θ from the vertical and the distance σ from the tip, in (EI/ρSg)^(1/3).
From θ = α and θ' = 0 at the tip the mast reaches its clamp where θ = 0. Γ is the cube of that distance.

python examples/rods/column.py -o column.png
"""

import argparse

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp

from hairbake.rods import GRAVITY, Rod, Scene, Strand, quaternion, simulate, straight

parser = argparse.ArgumentParser()
parser.add_argument("-o", "--output", default="column.png")
output = parser.parse_args().output

weights = np.concatenate([np.arange(5.0, 9.9, 0.2), np.arange(10.0, 26.0, 1.0)])
upwards = quaternion(np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))
strands = [Strand(Rod().with_weight(gamma), straight(Rod(), (0, 1, 0)), upwards) for gamma in weights]
# Backward Euler with steps of a second finds rest. Tilted by 1e-6, gravity makes the masts choose a side.
settings = {"scheme": "backward-euler"}
tilted = (1e-6 * GRAVITY, -GRAVITY, 0.0)
motion = simulate(
    Scene(strands, frames=60, fps=1, substeps=1, preroll=60, nodes=16, gravity=tilted, settings=settings)
)
shapes = [points[-1, :, :2] / Rod().length for points in motion.points]
tips = np.array([shape[-1, 0] for shape in shapes])

theory = []
for alpha in np.linspace(1e-3, 2.8, 200):
    # The state is (θ, θ', x), where x is the distance from the vertical through the tip.
    fall = solve_ivp(
        lambda s, y: [y[1], -s * np.sin(y[0]), np.sin(y[0])],
        (0, 4),
        [alpha, 0, 0],
        events=lambda s, y: y[0],
        rtol=1e-10,
        atol=1e-12,
    )
    assert fall.t_events is not None and fall.y_events is not None
    length, x = fall.t_events[0][0], fall.y_events[0][0][2]
    theory.append((length**3, x / length))
gammas, sideways = np.array(theory).T

bent, upright = weights > 1.02 * gammas[0], weights < 0.98 * gammas[0]
error = np.abs(tips[bent] - np.interp(weights[bent], gammas, sideways)).max()
print(
    f"upright masts, up to Γ = {weights[upright].max():.2f}: tips {np.abs(tips[upright]).max():.1e} L aside"
)
print(f"bent masts, from Γ = {weights[bent].min():.2f} on: largest error {error:.1e} L")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
left.plot(np.r_[0, gammas[0], gammas], np.r_[0, 0, sideways], "k-", linewidth=0.8, label="theory")
left.plot(weights, tips, "o", markersize=4, label="hairbake")
left.axvline(gammas[0], color="grey", linestyle=":", label=f"Greenhill, {gammas[0]:.4f}")
left.set(xlabel="Γ = ρSgL³/EI", ylabel="tip aside / L", xlim=(4, 26))
left.legend()
for i in (0, 16, 20, 25, 28, 40):
    right.plot(*shapes[i].T, color=plt.colormaps["viridis"](weights[i] / 28))
    right.annotate(f"Γ = {weights[i]:g}", shapes[i][-1], (4, 4), textcoords="offset points", fontsize=8)
right.set(xlabel="x / L", ylabel="y / L", aspect="equal", xlim=(-0.1, 1.2))
figure.savefig(output, dpi=100)
