"""
A motion over a wall in minimum time
====================================

The planner finds the fastest motion that keeps the load clear of an obstacle and all drives within
their limits. It proves both for the whole motion, not only at samples.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import cranectl

SCENARIO = """
name = "over-a-wall"
duration = 6.0
reference.start = [0.4, 0.77, -1.1]
reference.segments = [{ kind = "move", to = [1.6, 0.77, -1.1] }]
obstacles = [{ name = "wall", low = [0.8, 0.0, -1.4], high = [1.2, 1.54, -0.6] }]
effects.limits = {}
"""
Path("over-a-wall.toml").write_text(SCENARIO, encoding="utf-8")
scenario = cranectl.load_scenario("over-a-wall.toml")
run = cranectl.simulate_run(scenario, plant="mujoco", controller="lqr", drive="velocity")

# %%
# The rope is drawn every 0.2 s. The winch does nearly all of the lifting. The load also swings
# sideways, which the picture does not show, and gains a few centimetres of height by it.
figure, axis = plt.subplots(figsize=(8, 5), layout="constrained")
axis.fill([0.8, 0.8, 1.2, 1.2], [-1.4, -0.6, -0.6, -1.4], color="0.8", label="wall")
bridge, load = run.signal("state.bridge_position"), run.load_position
for k in range(0, 3000, 200):
    axis.plot([bridge[k], load[k, 0]], [0.0, load[k, 2]], color="0.7", lw=0.8)
axis.plot(load[:, 0], load[:, 2], label="load")
axis.plot(run.reference[:, 0], run.reference[:, 2], "--", label="plan")
axis.set(title="The load's path over the wall", xlabel="x [m]", ylabel="z [m]", aspect="equal")
axis.legend(loc="lower left")
plt.show()
