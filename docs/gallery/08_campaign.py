"""
A campaign and what decides its outcome
=======================================

Nobody knows the numbers of a real crane exactly. A campaign runs a controller on many cranes, and
its report says which unknown number matters: here the load, or the lag of the drives?
"""

import json
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

CAMPAIGN = """
name = "unknowns"
scenario = "fast-diagonal"
controllers = ["lqr+loop-shaping"]
drive = "velocity"
sampling = "saltelli"        # pairs of samples, from which Sobol's indices follow
runs = 640

[uncertain.rig]
load_mass = { distribution = "uniform", low = 0.5, high = 1.5 }
bridge_time_constant = { distribution = "log-uniform", low = 0.01, high = 0.04 }
winch_time_constant = { distribution = "log-uniform", low = 0.01, high = 0.04 }
"""
Path("unknowns.toml").write_text(CAMPAIGN, encoding="utf-8")
subprocess.check_output("cranectl campaign run unknowns.toml --out unknowns --overwrite".split())
print(subprocess.check_output("cranectl campaign report unknowns --json report.json".split(), text=True))

# %%
# A total index is the share of the variance that would remain if all other numbers were known.
result = json.loads(Path("report.json").read_text(encoding="utf-8"))["influence"][0]
names, sobol = result["correlations"]["parameters"], result["sobol"]["max_error_m"]
plt.figure(figsize=(8, 3), layout="constrained")
plt.barh(names, sobol["total"])
plt.hlines(names, *sobol["total_interval"], color="black")
plt.title("Total indices of the largest error, with 95 % intervals")
plt.show()
