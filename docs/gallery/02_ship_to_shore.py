"""
A ship-to-shore crane of 32 t
=============================

The rig extends the harbour crane that comes with cranectl by a heavier load and stronger drives. A
gust meets the container at the ship. Friction, wind, delay and limits add a few centimetres to the
error.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cranectl

RIG = """
extends = "harbour-crane"
trolley_mass = 30e3
load_mass = 32e3
rated_load = 32e3
effects.limits.force = [400e3, 120e3, 700e3]
"""
Path("crane-32t.toml").write_text(RIG, encoding="utf-8")
figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
figure.suptitle("The crane of 32 t at its worst moment, and its error on the way to the ship")
for effects in [[], ["friction", "wind", "delay", "limits"]]:
    overrides = [f"effects.{effect}={{}}" for effect in effects]
    scenario = cranectl.load_scenario("ship-to-shore", rig="crane-32t.toml", overrides=overrides)
    run = cranectl.simulate_run(scenario, plant="mujoco", controller="lqr", drive="velocity")
    error = np.linalg.norm(run.block("error")[:, :3], axis=1)
    axes[1].plot(run.time, error, label=", ".join(effects) or "no effects")
axes[1].set(xlabel="time [s]", ylabel="load off its path [m]")
axes[1].legend()
cranectl.write_log("crane-32t.mcap", [run])
subprocess.check_call("cranectl render crane-32t.mcap crane-32t.png".split())
axes[0].imshow(plt.imread("crane-32t.png"))
axes[0].axis("off")
plt.show()
