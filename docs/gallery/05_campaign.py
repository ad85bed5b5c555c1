"""
A campaign and what decides its outcome
=======================================

Nobody knows the numbers of a real crane exactly. A campaign runs a controller on many cranes, and
its report says which unknown number matters. Here the question is how much of the tracking error
comes from the load, and how much from the lag of the drives.
"""

import json
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

CAMPAIGN = """
name = "what-matters"
scenario = "fast-diagonal"
controllers = ["lqr+loop-shaping"]
plants = ["analytic"]
drive = "velocity"
sampling = "saltelli"        # pairs of samples, from which Sobol's indices follow
runs = 640
seed = 1

[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.5
high = 1.5

[uncertain.rig.bridge_time_constant]
distribution = "log-uniform"
low = 0.01
high = 0.04

[uncertain.rig.winch_time_constant]
distribution = "log-uniform"
low = 0.01
high = 0.04
"""
Path("what-matters.toml").write_text(CAMPAIGN, encoding="utf-8")
for command in [
    "cranectl campaign run what-matters.toml --out what-matters",
    "cranectl campaign report what-matters --json what-matters.json",
]:
    subprocess.run(command.split(), check=True)

# %%
# The total index of a number is the share of the variance that would remain if all others were
# known. Bars show 95 % intervals.

result = json.loads(Path("what-matters.json").read_text(encoding="utf-8"))["influence"][0]
names = result["correlations"]["parameters"]
sobol = result["sobol"]["max_error_m"]
total, ends = np.array(sobol["total"]), np.array(sobol["total_interval"])
figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
axis.barh(names, total, xerr=abs(ends - total), capsize=4)
axis.set(xlabel="share of the variance of the largest error", xlim=(0.0, None))
plt.show()
