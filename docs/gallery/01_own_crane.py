"""
Your own crane
==============

A file describes a bridge crane of 10 t and its motion. What it leaves out is scaled from the
laboratory rig. Three independent models simulate the crane, and must agree.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

YARD = """
name = "yard"
title = "10 t over 12 m in 30 s, lifted by 4 m on the way"
duration = 45.0
reference.start = [10.0, 5.0, -12.0]
reference.segments = [{ kind = "line", to = [22.0, 9.0, -8.0], duration = 30.0 }]
control = { period = 0.005, physics_step = 0.005 }

[rig]
bridge_range = [0.0, 40.0]
trolley_range = [0.0, 20.0]
rope_range = [2.0, 15.0]
bridge_mass = 20000.0
trolley_mass = 5000.0
rated_load = 10000.0
"""
Path("yard.toml").write_text(YARD, encoding="utf-8")
print(subprocess.check_output("cranectl validate yard.toml --controller lqr".split(), text=True))

# %%
# ``validate`` keeps a log of each run. A log can be drawn, or opened in Foxglove.
subprocess.check_call("cranectl render logs/yard/lqr-velocity.mcap yard.png --plots --time 15".split())
figure, axis = plt.subplots(figsize=(9, 5), layout="constrained")
figure.suptitle("The crane after 15 s, beside the errors, angles and tension of its run")
axis.imshow(plt.imread("yard.png"))
axis.axis("off")
plt.show()
