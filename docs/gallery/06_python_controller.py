"""
Your own controller in Python
=============================

A controller is a class with a ``step`` that Numba compiles. This one puts a spring and a damper on
each drive, and lets bridge and trolley give way to the swinging rope. How much must they give way?
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cranectl

SERVO = """
class Servo:
    parameters = {"stiffness": 4.0, "damping": 4.0, "sway": 1.0}

    @staticmethod
    def step(parameters, measured, reference, memory, command):
        for axis in range(3):
            sign = -1.0 if axis == 2 else 1.0  # the rope is as long as the path is deep
            error = sign * reference[axis] - measured[2 * axis]
            rate = sign * reference[3 + axis] - measured[2 * axis + 1]
            command[axis] = parameters[0] * error + parameters[1] * rate
        command[0] += parameters[2] * measured[9]  # beta swings along x
        command[1] += parameters[2] * measured[7]  # alpha swings along y
        return 0
"""
Path("servo.py").write_text(SERVO, encoding="utf-8")
name = cranectl.open_controller("servo.py:Servo")
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
for sway in [0.0, 0.5, 1.0]:
    scenario = cranectl.load_scenario("fast-diagonal", overrides=[f"controller.servo.sway={sway}"])
    run = cranectl.simulate_run(scenario, plant="mujoco", controller=name, drive="velocity")
    axis.plot(run.time, np.degrees(np.linalg.norm(run.angles, axis=1)), label=f"sway = {sway:g} m/s")
axis.set(title="Giving way ends the swing", xlabel="time [s]", ylabel="rope off the vertical [°]")
axis.legend()
plt.show()
