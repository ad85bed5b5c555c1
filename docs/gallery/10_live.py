"""
A live session, recorded
========================

``cranectl live`` runs a crane in real time. A viewer or a program steers it over a WebSocket, and
all is recorded. This program starts a session, changes the controller on the way, and reads the
record.
"""

import json
import re
import signal
import subprocess
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from websockets.sync.client import connect

import cranectl

command = "cranectl live fixed-position --plants mujoco --speed 5 --port 0 --record live.mcap"
for old in Path().glob("live*"):
    old.unlink()
session = subprocess.Popen(command.split(), text=True, stdout=subprocess.PIPE)
address = next(found[0] for line in session.stdout if (found := re.search(r"ws://\S+", line)))
with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
    time.sleep(3.0)
    change = {"op": "setParameters", "parameters": [{"name": "controller", "value": "lqr+hinf"}]}
    viewer.send(json.dumps(change))
    time.sleep(3.0)
    session.send_signal(signal.SIGINT)
session.wait(timeout=60)

# %%
# Two disturbances push the load aside. The new controller brings it back. A change of the
# controller begins a new file.

figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
for path in sorted(Path().glob("live*.mcap"), key=lambda path: len(path.name)):
    run = cranectl.read_log(path)["mujoco"]
    error = np.linalg.norm(run.block("error")[:, :3], axis=1)
    axis.plot(run.time, 1000.0 * error, label=run.design.name)
axis.set(xlabel="time [s]", ylabel="load off its place [mm]", xlim=(0.0, 30.0))
axis.legend()
plt.show()
