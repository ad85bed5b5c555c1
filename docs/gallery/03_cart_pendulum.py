"""
A cart with a pendulum
======================

The crane of control courses: a cart takes a hanging pendulum along, by a textbook's state feedback
u = -k (x - x_d, x', theta, theta'), a linear-quadratic regulator for a set-point x_d.
"""

import subprocess
from pathlib import Path

import matplotlib.pyplot as plt

TEXTBOOK = """
import numpy as np
from scipy.linalg import solve_continuous_are
class Textbook:
    follows = "set-point"
    parameters = {"position": 10.0, "rate": 1.0, "angle": 10.0, "angle_rate": 1.0}
    @staticmethod
    def prepare(nominal):  # near rest x'' = u and l theta'' = -g theta - u
        weights, length = list(nominal.parameters.values()), nominal.state[4]
        a, b = np.eye(4, k=1), np.array([[0.0], [1.0], [0.0], [-1.0 / length]])
        a[1, 2], a[3, 2] = 0.0, -nominal.rig.gravity / length
        return (b.T @ solve_continuous_are(a, b, np.diag(weights), np.eye(1)))[0], np.zeros(1)
    @staticmethod
    def step(parameters, measured, reference, memory, command):
        command[0] = parameters[0] * (reference[0] - measured[0]) - parameters[1] * measured[1]
        command[0] -= parameters[2] * measured[8] + parameters[3] * measured[9]
        return 0
"""
Path("textbook.py").write_text(TEXTBOOK, encoding="utf-8")
validate = "cranectl validate cart-transfer --controller textbook.py:Textbook --drive all"
print(subprocess.check_output(validate.split(), text=True))
subprocess.check_call("cranectl render logs/cart-transfer/textbook-force.mcap c.png --plots --time 1".split())
figure, axis = plt.subplots(figsize=(9, 5), layout="constrained")
figure.suptitle("The cart after 1 s, beside the errors, angles and tension of its run")
axis.imshow(plt.imread("c.png"))
axis.axis("off")
plt.show()
