"""Draw the pictures of the README: the rig as MuJoCo renders it, and a run of both plants.

MUJOCO_GL=egl python docs/make_pictures.py
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import mujoco
import numpy as np

import cranectl
from cranectl import resources

PICTURES = Path(__file__).parent / "pictures"
COLOURS = {"analytic": "#1f6fb4", "mujoco": "#e07b16"}


def rig() -> None:
    """The model file with the load swung out."""
    model = mujoco.MjModel.from_xml_path(str(resources.MODEL_FILE))
    data = mujoco.MjData(model)
    data.qpos[:] = 1.1, 0.6, 0.15, 0.2, 0.8
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 600, 800) as renderer:
        renderer.update_scene(data, camera="overview")
        plt.imsave(PICTURES / "rig.png", renderer.render())


def run() -> None:
    """The settled trajectory with LQR: path seen from above, error, difference of the plants."""
    scenario = cranectl.load_scenario("settled-trajectory")
    runs = {
        plant: cranectl.simulate_run(scenario, plant=plant, controller="lqr")
        for plant in ("analytic", "mujoco")
    }
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, (path, error) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    some = next(iter(runs.values()))
    path.plot(*some.reference[:, :2].T, color="0.6", lw=4, alpha=0.6, label="reference")
    for plant, drawn in runs.items():
        style = "-" if plant == "analytic" else (0, (4, 4))
        path.plot(*drawn.block("load")[:, :2].T, color=COLOURS[plant], ls=style, lw=1.5, label=plant)
        distance = np.linalg.norm(drawn.reference[:, :3] - drawn.block("load")[:, :3], axis=1)
        error.plot(drawn.time, distance, color=COLOURS[plant], ls=style, lw=1.5, label=f"{plant}: error")
    path.set(
        xlim=(-0.05, 2.05), ylim=(-0.05, 1.7), xlabel="x [m]", ylabel="y [m]", title="load seen from above"
    )
    path.add_patch(plt.Rectangle((0, 0), 2, 1.54, fill=False, color="0.8", lw=0.8))
    path.set_aspect("equal")
    path.legend(frameon=False, loc="lower center", ncols=3, fontsize=8)
    a, b = (runs[plant].block("load")[:, :3] for plant in ("analytic", "mujoco"))
    difference = np.linalg.norm(b - a, axis=1)
    error.plot(some.time, np.maximum(difference, 1e-12), color="0.25", lw=1.2, label="mujoco - analytic")
    error.axhline(1e-6, color="crimson", lw=0.8, ls=":")
    error.text(24.8, 1.4e-6, "limit of agreement", color="crimson", fontsize=8, ha="right")
    for start, joint in ((6, "α"), (12, "β")):
        error.axvline(start, color="0.7", lw=0.8)
        error.text(start + 0.2, 2e-12, f"step on {joint}", color="0.4", fontsize=8)
    error.set(yscale="log", ylim=(1e-12, 3), xlim=(0, 25), xlabel="time [s]", ylabel="[m]")
    error.set_title("tracking error, and the difference of the plants")
    error.legend(frameon=False, fontsize=8, loc=(0.6, 0.58))
    figure.savefig(PICTURES / "run.png", dpi=130)


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    rig()
    run()
