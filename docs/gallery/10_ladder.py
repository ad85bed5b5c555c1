"""
The fidelity ladder
===================

Why does a real crane not do what its design model predicts? The ladder adds one effect after the
other to a run, and measures what each costs.
"""

import json
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

command = "cranectl ladder fast-diagonal --controller lqr+loop-shaping --json ladder.json --out ladder.mcap"
print(subprocess.check_output(command.split(), text=True))

# %%
# Friction moves the load most on this motion. Another engine moves it by less than a nanometre: the
# models agree.

levels = json.loads(Path("ladder.json").read_text(encoding="utf-8"))["levels"][1:]
names = [level["level"] for level in levels]
moved = [1000.0 * level["cumulative"]["max"] for level in levels]
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
axis.bar(names, moved)
axis.set(title="What each effect costs on a fast diagonal", ylabel="load moved by this level [mm]")
axis.tick_params(axis="x", rotation=45)
plt.show()
