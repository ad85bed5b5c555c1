"""
Your own crane
==============

A file describes a bridge crane of 10 t and its motion. Three independent models simulate it, and
must agree.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

YARD = """
name = "yard"
title = "10 t over 12 m in 30 s, lifted by 4 m on the way"
duration = 45.0
controller = "lqr"

[rig]
bridge_range = [0.0, 40.0]
trolley_range = [0.0, 20.0]
rope_range = [2.0, 15.0]
bridge_mass = 20000.0
trolley_mass = 5000.0
winch_mass = 800.0
load_mass = 10000.0
rated_load = 10000.0
bridge_time_constant = 0.2
trolley_time_constant = 0.2
winch_time_constant = 0.1

[control]
period = 0.005
physics_step = 0.005

[reference]
start = [10.0, 5.0, -12.0]

[[reference.segments]]
kind = "line"
to = [22.0, 9.0, -8.0]
duration = 30.0
"""
Path("yard.toml").write_text(YARD, encoding="utf-8")


def cranectl(arguments):
    """Run the command and return what it prints."""
    return subprocess.run(["cranectl", *arguments.split()], check=True, text=True, stdout=-1).stdout


print(cranectl("validate yard.toml --controller lqr"))

# %%
# ``validate`` keeps a log of each run. A log can be drawn, or opened in Foxglove.

cranectl("render logs/yard/lqr-velocity.mcap yard.png --plots --time 15")
plt.figure(figsize=(9, 4.5), layout="constrained")
plt.axis("off")
plt.imshow(plt.imread("yard.png"))
plt.show()
