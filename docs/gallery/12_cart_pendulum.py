"""
A cart with a pendulum
======================

The crane of control courses: a cart on a rail takes a hanging pendulum along. It moves along one
axis, and its rope is fixed. The controller is the state feedback of a textbook, a linear-quadratic
regulator, and goes to a set-point.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cranectl

TEXTBOOK = '''
import numpy as np
from scipy.linalg import solve_continuous_are


class Textbook:
    """u = -k (x - x_d, x', theta, theta') with x'' = u and l theta'' = -g theta - u near rest."""

    follows = "set-point"
    parameters = {"position": 10.0, "rate": 1.0, "angle": 10.0, "angle_rate": 1.0}

    @staticmethod
    def prepare(nominal):
        weights, length = list(nominal.parameters.values()), nominal.state[4]
        a, b = np.zeros((4, 4)), np.array([[0.0], [1.0], [0.0], [-1.0 / length]])
        a[0, 1] = a[2, 3] = 1.0
        a[3, 2] = -nominal.rig.gravity / length
        cost = solve_continuous_are(a, b, np.diag(weights), np.eye(1))
        return (b.T @ cost)[0], np.zeros(1)

    @staticmethod
    def step(parameters, measured, reference, memory, command):
        command[0] = parameters[0] * (reference[0] - measured[0]) - parameters[1] * measured[1]
        command[0] -= parameters[2] * measured[8] + parameters[3] * measured[9]
        command[1] = command[2] = 0.0
        return 0
'''
Path("textbook.py").write_text(TEXTBOOK, encoding="utf-8")
command = "cranectl validate cart-transfer --controller textbook.py:Textbook --drive all"
print(subprocess.check_output(command.split(), text=True))

# %%
# The heavier the weight of the angle, the calmer the pendulum, and the later the cart arrives.
name = cranectl.open_controller("textbook.py:Textbook")
figure, (way, swing) = plt.subplots(2, sharex=True, figsize=(8, 5), layout="constrained")
for weight in [0.1, 10.0, 1000.0]:
    overrides = [f"controller.textbook.angle={weight}", "disturbances=[]", "duration=8.0"]
    scenario = cranectl.load_scenario("cart-transfer", overrides=overrides)
    run = cranectl.simulate_run(scenario, plant="mujoco", controller=name, drive="force")
    way.plot(run.time, run.state.axes[:, 0], label=f"angle = {weight:g}")
    swing.plot(run.time, np.degrees(run.angles[:, 1]))
way.set(title="A set-point 0.8 m away", ylabel="cart [m]")
swing.set(xlabel="time [s]", ylabel="pendulum [°]")
way.legend()
plt.show()
