"""The rig in MuJoCo, whose engine is loaded here.

The engine writes its warnings to the screen and to MUJOCO_LOG.TXT in the working directory. Here they go
nowhere: the kernels count them, and the run ends with the status `engine-warning`. A handler that a program
has set before stays.
"""

from cranectl.support import SafePath

with SafePath():  # it loads GLFW, which starts `python -c`
    import mujoco

if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda _: None)
    log = mujoco.MjLogConfig.get()
    log.logto_file = False  # where errors go that end the process
    log.set()
