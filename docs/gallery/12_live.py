"""
A live session, recorded
========================

``cranectl live`` runs a crane in real time and records it. Viewers and programs steer it over a
WebSocket. This program changes the controller on the way.
"""

import re
import subprocess

import matplotlib.pyplot as plt
import numpy as np
from websockets.sync.client import connect

import cranectl

command = "cranectl live fixed-position --plants mujoco --speed 10 --port 0"
session = subprocess.Popen(command.split(), text=True, stdout=subprocess.PIPE)
address = next(found[0] for line in session.stdout if (found := re.search(r"ws://\S+", line)))
with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
    # Messages that begin with 2 tell the time of the session in nanoseconds.
    clock = (int.from_bytes(message[1:9], "little") for message in viewer if message[0] == 2)
    next(time for time in clock if time > 30e9)  # disturbances have pushed the load aside; it rests
    viewer.send('{"op": "setParameters", "parameters": [{"name": "controller", "value": "lqr+hinf"}]}')
    next(time for time in clock if time > 45e9)
    session.terminate()  # as Ctrl-C does, this closes the record
recorded = re.findall(r"recorded: (.+)", session.communicate()[0])

# %%
# A change of the controller begins a new file.
before, after = (cranectl.read_log(path)["mujoco"] for path in recorded)
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
for run in [before, after]:
    error = 1000.0 * np.linalg.norm(run.block("error")[:, :3], axis=1)
    axis.plot(run.time - after.time[0], error, label=run.design.name)
axis.set(title="A new controller takes over", xlabel="time since then [s]", xlim=(-2.0, 10.0))
axis.set(ylabel="load off its place [mm]")
axis.legend()
plt.show()
