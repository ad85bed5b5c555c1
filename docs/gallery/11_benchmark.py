"""
A benchmark of your own controller
==================================

The benchmark runs your controller on the same cranes, and under the same rules, as the published
ones. Two scenarios and two cranes give a first impression in seconds; without ``--scenario`` and
``--draws`` the whole set runs. The controller is the one of :doc:`06_python_controller`.
"""

import json
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

names = "servo.py:Servo,lqr-integral,pid"
run = f"cranectl benchmark run --controller {names} --set-of-cranes nominal --draws 2 --out trial"
run += " --scenario pulse --scenario hoist-and-go"
subprocess.check_call(run.split())
report = f"cranectl benchmark report trial --controller {names} --json trial.json"
print(subprocess.check_output(report.split(), text=True))

# %%
# A run is settled when the load stays within 10 mm of its target. Here only ``lqr-integral`` gets
# there, and it pays with a little more effort.

rows = json.loads(Path("trial.json").read_text(encoding="utf-8"))["divisions"]["published"]["nominal"]
figure, axes = plt.subplots(1, 2, figsize=(8, 3), sharey=True, layout="constrained")
figure.suptitle("What a controller reaches, and what it spends")
controllers = [row["law"] for row in rows]
axes[0].barh(controllers, [100.0 * row["unsettled"] for row in rows])
axes[0].set(xlabel="time at rest that passes unsettled [%]")
axes[1].barh(controllers, [row["effort"] for row in rows])
axes[1].set(xlabel="RMS of the commanded accelerations [m/s²]")
plt.show()
