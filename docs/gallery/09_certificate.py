"""
A certificate of stability
==========================

For which rope lengths does a controller tolerate a delay of 10 ms and slow drives? ``certify``
compares the plant with the design model at each operating point. It needs no simulation.
"""

import subprocess

import matplotlib.pyplot as plt

command = "cranectl certify lqr+loop-shaping --delay 0.01 --plot certificate.png"
print(subprocess.run(command.split(), text=True, stdout=subprocess.PIPE).stdout)

# %%
# Where the distance to the design model is less than the controller's margin, the loop is certainly
# stable.
figure, axis = plt.subplots(figsize=(9, 6), layout="constrained")
figure.suptitle("Distance to the design model, by rope length and by frequency")
axis.imshow(plt.imread("certificate.png"))
axis.axis("off")
plt.show()
